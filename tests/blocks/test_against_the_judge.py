"""Every dyad against the independent multibody solver: motion, reactions, friction.

Errors are relative to the largest of a kind (motion), or to the force itself
(reactions, friction, drives), and in units of the condition of the judge's Jacobian.
"""

from __future__ import annotations

import numpy as np
import pytest

import blockmech as bm
from tests.blocks import machines
from tests.blocks.twin import Twin
from tests.independent import multibody as mb

ROUNDING = 1e-13  # [-] some hundred roundings of 1e-16, times the condition that is divided out
CERTAIN = 1e-9  # [-] of a limit of self-locking: the judge stops its steps a bit before
RATES, ACCELERATIONS = (9.0, -0.4), (40.0, 3.0)

MACHINES = {
    "slider-crank": (machines.slider_crank(), [0.3, 1.1, 2.0, 2.9, 3.7, 4.8, 5.9]),
    "slider-crank, other branch": (machines.slider_crank(branch=-1), [0.3, 2.0, 3.7, 5.9]),
    "slider-crank, point on the guide": (machines.slider_crank(slider="earlier"), [0.3, 2.0, 3.7]),
    "whitworth": (machines.whitworth(), [0.3, 1.1, 2.0, 2.9, 3.7, 4.8, 5.9]),
    "whitworth, other branch": (machines.whitworth(branch=-1), [0.3, 2.0, 3.7, 5.9]),
    "whitworth, point on the block": (machines.whitworth(slider="i"), [0.3, 2.0, 3.7]),
    "slotted crank": (machines.slotted_crank(), [0.3, 1.1, 2.6, 3.7, 4.2]),
    "slotted crank, points on guides": (
        machines.slotted_crank({"S1": "earlier", "S2": "earlier"}),
        [0.3, 2.6, 3.7],
    ),
    "yoke": (machines.yoke(), [0.3, 1.1, 2.0, 2.9, 3.7, 4.8, 5.9]),
    "yoke, points on the pin and the guide": (
        machines.yoke({"S1": "i", "S": "earlier"}, beta=-1.1),
        [0.3, 2.0, 3.7, 5.9],
    ),
    "shaper": (machines.shaper(), [0.3, 1.1, 2.0, 2.9, 3.7, 4.8, 5.9]),
    "stacked": (machines.stacked(), [(4.0, 0.24), (0.26, 0.11), (5.73, -0.1), (2.2, 0.4)]),
}


class Comparison:
    """One sample by blockmech and by the judge."""

    def __init__(self, graph, q, friction):
        self.mechanism = graph.compile()
        twin = Twin(self.mechanism)
        drivers = self.mechanism.drivers
        given = [np.atleast_1d(x)[: len(drivers)] for x in (q, RATES, ACCELERATIONS)]
        self.judge = twin.judge(*given, friction)
        keys = ("at", "rates", "accelerations")
        request = {k: dict(zip(drivers, x, strict=True)) for k, x in zip(keys, given, strict=True)}
        method = "newton" if friction else "none"
        self.run = self.mechanism.run(**request, friction=method, on_gap="mark")
        poses = np.array(list(self.judge.poses.values()))
        self.size = float(mb.Instant(twin.system, poses).size)

    def relative(self, found, wanted, scale):
        """Error per scale and condition."""
        error = float(abs(found - wanted))
        return error / float(scale) / self.judge.condition if error else 0.0

    def motion(self):
        """Errors of places, velocities and accelerations of all links."""
        kinds = (
            ("p", "angle", self.judge.poses),
            ("v", "omega", self.judge.rates),
            ("a", "alpha", self.judge.accelerations),
        )
        for vector, scalar, wanted in kinds:
            rows = {n: np.asarray(x, float) for n, x in wanted.items()}
            scale = max(max(np.hypot(*x[:2]), self.size * abs(x[2])) for x in rows.values())
            for name, (x, y, turn) in rows.items():
                found = self.run[f"{name}.{vector}"][0]
                yield f"{name}.{vector}", self.relative(found, complex(x, y), scale)
                angle = self.run[f"{name}.{scalar}"][0]
                if scalar == "angle":
                    angle = turn + np.angle(np.exp(1j * (angle - turn)))
                yield f"{name}.{scalar}", self.relative(angle, turn, scale / self.size)

    def forces(self):
        """Errors of reactions, couples, friction and drives, each of its own size."""
        for name, joint in self.judge.forces.joints.items():
            force = complex(*map(float, joint.force))
            yield name, self.relative(self.run[f"{name}.reaction"][0], force, abs(force))
            if joint.C is not None:
                scale = abs(float(joint.C)) + self.size * abs(float(joint.N))
                C = self.run[f"{name}.C"][0]
                yield f"{name}.C", self.relative(C, float(joint.C), scale)
            t = float(joint.friction)
            if t:
                found = self.run[f"{name}.friction"][0]
                yield f"{name}.friction", self.relative(found, t, abs(t))
        for name, effort in self.judge.forces.drivers.items():
            found = self.run[f"{name}.drive"][0]
            yield f"{name}.drive", self.relative(found, float(effort), abs(float(effort)))


def assert_the_judge_agrees(compared):
    """Motion and forces are the judge's, to rounding."""
    assert compared.run.quality.status == ("ok",)
    assert compared.judge.forces.converged
    errors = dict(compared.motion()) | dict(compared.forces())
    assert {name: e for name, e in errors.items() if not e <= ROUNDING} == {}


SAMPLES = [
    pytest.param(g, q, id=f"{name} at {q}") for name, (g, qs) in MACHINES.items() for q in qs
]


@pytest.mark.parametrize(("graph", "q"), SAMPLES)
@pytest.mark.parametrize("friction", [False, True], ids=["smooth", "rough"])
def test_motion_and_forces_are_the_judge_s(graph, q, friction):
    compared = Comparison(graph, q, friction)
    assert_the_judge_agrees(compared)


@pytest.mark.parametrize(("graph", "qs"), MACHINES.values(), ids=list(MACHINES))
def test_friction_was_there_to_be_compared(graph, qs):
    found = Comparison(graph, qs[0], friction=True).judge.forces
    assert sum(float(joint.friction) != 0 for joint in found.joints.values()) >= 3


ROUGH = [
    ("slider-crank", lambda shoe: machines.slider_crank(shoe=shoe, x_S=0.2), 0.4),
    ("whitworth", lambda shoe: machines.whitworth(shoe=shoe), 0.9),
    ("slotted crank", lambda shoe: machines.slotted_crank(shoe=shoe), 0.35),
    ("yoke", lambda shoe: machines.yoke(shoe=shoe), 0.35),
]


@pytest.mark.parametrize(("name", "machine", "mu"), ROUGH, ids=[r[0] for r in ROUGH])
def test_short_rough_guides_jam_where_the_judge_finds_no_solution(name, machine, mu):
    graph = machine(bm.Coulomb(coefficient=mu, guide_length=0.03))
    chance = np.random.default_rng(7)
    counts = {"ok": 0, "jammed": 0}
    for q in chance.uniform(0, 2 * np.pi, 25):
        compared = Comparison(graph, q, friction=True)
        (status,) = compared.run.quality.status
        if status == "no-assembly":
            continue
        counts[status] += 1
        forces = compared.judge.forces
        assert forces.converged == (status == "ok"), q
        if status == "ok":
            worst = max(e for _, e in compared.forces())
            # Near a limit the friction is as uncertain as its own equations say.
            assert worst <= 1e3 * ROUNDING, q
        else:
            limits = [f.value for f in compared.run.quality.flags if f.where == "dyad"]
            assert limits[0] == pytest.approx(forces.scale, rel=1e-4), q
    assert min(counts.values()) >= 2
