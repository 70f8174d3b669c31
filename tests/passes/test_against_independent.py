"""Random mechanisms against the independent multibody solver, and against themselves.

The solver knows absolute coordinates and Lagrange multipliers only (tests/independent). Its
poses are assembled in extended precision, so what differs is blockmech's rounding: measured
1e-16 to 4e-16 of the largest number of a kind, times the condition of the Jacobian.
"""

from collections import Counter
from dataclasses import replace

import numpy as np
from hypothesis import given, settings

from blockmech.testing.strategies import KINDS, Options, Seeded, mechanisms, random_mechanism
from tests.blocks.twin import Twin
from tests.wiring import swept, watt

MOTION = 4e-15  # [-] of the largest of its kind, times the condition
FORCES = 1e-14  # [-] of the largest reaction, times the condition
BALANCE = 1e-12  # what `verify` allows, of the sum of absolute terms times its conditioning

CHAINS = Options(kinds=("dyad.rrr",), groups=(1, 5), drivers=(1, 3))
ALL = Options(kinds=KINDS, groups=(1, 4), drivers=(1, 3))


class Comparison:
    """Largest errors of a run against the judge's verdict, by kind of quantity."""

    def __init__(self, mech, request, friction=True):
        method = "newton" if friction else "none"
        self.run = mech.run(**request, on_gap="mark", friction=method)
        order = [[request[k][d] for d in mech.drivers] for k in ("at", "rates", "accelerations")]
        twin = Twin(mech)
        twin.system = without_idle_friction(twin.system, self.run)
        self.verdict = twin.judge(*order, friction=friction)
        self.worst = Counter()
        self.inertial = 0.0

    def note(self, kind, found, wanted, scale):
        size = float(scale) * self.verdict.condition
        error = abs(complex(found) - complex(wanted)) / size if size else abs(found - wanted)
        self.worst[kind] = max(self.worst[kind], float(error))

    def motion(self):
        r, v = self.run, self.verdict
        kinds = {"p": v.poses, "v": v.rates, "a": v.accelerations}
        turns = {"v": "omega", "a": "alpha"}
        size = max(1.0, max(abs(complex(*x[:2])) for x in v.poses.values()))
        largest = 0.0
        for kind, found in kinds.items():
            # lengths in units of the size: a rate counts with the speed at that distance, and
            # an acceleration with what speeds and their rounding make at it (even if all is zero)
            squared = largest**2 / size if kind == "a" else 0.0
            speed = max(abs(complex(*x[:2])) for x in found.values())
            turn = max(abs(x[2]) for x in found.values()) if kind in turns else 0.0
            largest = max(speed, turn * size, squared)
            for link, x in found.items():
                self.note(kind, r[f"{link}.{kind}"][0], complex(*x[:2]), largest)
                if kind in turns:
                    self.note(turns[kind], r[f"{link}.{turns[kind]}"][0], x[2], largest / size)
                else:
                    found_e = np.exp(1j * r[f"{link}.angle"][0])
                    self.note("angle", found_e, np.exp(1j * float(x[2])), 1.0)
        structure = r.mechanism.structure
        self.inertial = largest * max(structure.properties(link).mass for link in structure.links)
        return self

    def forces(self):
        r, joints = self.run, self.verdict.forces.joints
        forces = [abs(complex(*j.force)) for j in joints.values()]
        couples = [abs(j.C or 0.0) for j in joints.values()]
        couples += map(abs, self.verdict.forces.drivers.values())
        # all are solved for at once, so each has rounding of the largest (sizes are about 1 m),
        # which may be the drive alone, or of an inertia force that only rounding has moved
        largest = max(*forces, *couples, self.inertial)
        for name, joint in joints.items():
            self.note("reaction", r[f"{name}.reaction"][0], complex(*joint.force), largest)
            self.note("friction", r[f"{name}.friction"][0], joint.friction, largest)
            if joint.C is not None:
                self.note("couple", r[f"{name}.C"][0], joint.C, largest)
        for name, effort in self.verdict.forces.drivers.items():
            self.note("drive", r[f"{name}.drive"][0], effort, largest)
        return self

    def check(self):
        # the forces are solved from the motion, with the same Jacobian: the condition counts twice
        for kind, error in self.worst.items():
            motion = kind in ("p", "v", "a", "angle", "omega", "alpha")
            allowed = MOTION if motion else FORCES * max(1.0, self.verdict.condition / 100)
            assert error <= allowed, (kind, error, self.verdict.condition)


def without_idle_friction(system, run):
    """The judge's system, smooth where blockmech has a structural zero.

    The judge computes 1e-56 N there and then asks friction to follow that rounding.
    """

    def idle(name):
        return run[f"{name}.reaction"][0] == 0 and run.get(f"{name}.C", [0.0])[0] == 0

    joints = {n: replace(j, friction=None) if idle(n) else j for n, j in system.joints.items()}
    return replace(system, joints=joints)


def compare(case, friction=True):
    mech = case.graph.compile()
    found = Comparison(mech, case.request, friction)
    found.motion()
    solved = found.verdict.forces.converged
    assert (found.run.quality.status[0] == "ok") == solved
    if solved:
        found.forces()
    found.check()
    return found


@given(mechanisms(CHAINS))
@settings(max_examples=60)
def test_random_chains_move_and_push_as_the_independent_solver_says(case):
    compare(case)


@given(mechanisms(ALL))
@settings(max_examples=40)
def test_random_mechanisms_of_all_dyads_agree_with_the_independent_solver(case):
    compare(case)


def test_agreement_lasts_towards_dead_centres():
    # of many poses of each random chain, the one that is nearest to a dead centre
    margins = []
    for seed in range(40):
        case = random_mechanism(Seeded(seed), Options(kinds=("dyad.rrr",), groups=(1, 4)))
        mech, request = case.graph.compile(), swept(case, 60, seed)
        margin = mech.run(**request, want="*.margin")
        least = np.min([margin[name] for name in margin], axis=0)
        nearest = int(np.argmin(np.where(least > 0, least, np.inf)))
        at = {d: q[nearest] for d, q in request["at"].items()}
        compare(replace(case, request={**case.request, "at": at}))
        margins.append(least[nearest])
    assert min(margins) < 1e-3
    assert np.median(margins) < 0.1


@given(mechanisms(CHAINS))
@settings(max_examples=30)
def test_branch_is_the_sign_it_is_declared_by(case):
    mech = case.graph.compile()
    r = mech.run(**case.request, friction="none", want=["*.p"])
    for name, block in mech.structure.blocks.items():
        if block.type_name != "dyad.rrr":
            continue
        B, C, D = (r[f"{name}.{x}.p"][0] for x in "BCD")
        assert np.sign(((D - B).conjugate() * (C - B)).imag) == block.branch


# ---- balances ----------------------------------------------------------------------------


@given(mechanisms(ALL))
@settings(max_examples=60)
def test_balances_and_both_routes_to_the_drive_hold_on_random_mechanisms(case):
    mech = case.graph.compile()
    found = mech.verify(**case.request)
    if found.samples == 0:  # no friction solution: the balances are judged without
        found = mech.verify(**case.request, friction="none")
    assert found.ok, str(found)
    assert max(row.allowed for row in found.rows) <= BALANCE


@given(mechanisms(ALL))
@settings(max_examples=30)
def test_power_of_every_wire_is_what_flows_through_it(case):
    mech = case.graph.compile()
    r = mech.run(**case.request, friction="none")
    for joint, marker in mech.structure.feeds.items():
        found = r.wire(str(marker), str(joint))
        work = (found["F"] * found["v"].conj()).real + found["M"] * found["om"]
        size = np.abs(found["F"]) * np.abs(found["v"]) + np.abs(found["M"] * found["om"])
        assert np.all(np.abs(found["power"] + work) <= 1e-15 * size)


def test_generalised_loads_are_the_power_of_loads_per_unit_rate():
    for seed in range(12):
        options = Options(kinds=("dyad.rrr",), drivers=(2, 2), groups=(2, 3))
        case = random_mechanism(Seeded(seed), options)
        mech = case.graph.compile()
        r = mech.run(**case.request, friction="none", static=True)
        Q = r["mechanism.Q"][0]
        drives = [r[f"{d}.drive"][0] for d in mech.drivers]
        assert np.allclose(drives, -Q, rtol=1e-10, atol=1e-10 * np.abs(Q).max())


def test_watt_with_a_damper_agrees_with_the_independent_solver():
    mech = watt(spring=5.0, force=True, friction=True).compile()
    request = {"at": {"crank": 1.1}, "rates": {"crank": 4.0}, "accelerations": {"crank": -9.0}}
    Comparison(mech, request).motion().forces().check()
