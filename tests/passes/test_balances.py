"""Random mechanisms against the independent multibody solver, and against themselves.

The solver knows absolute coordinates and Lagrange multipliers only (tests/independent). Its
poses are assembled in extended precision, so what differs is blockmech's rounding: measured
1e-16 to 4e-16 of the largest number of a kind, times the condition of the Jacobian.
"""

import numpy as np
from hypothesis import given, settings

from blockmech.testing.strategies import KINDS, Options, Seeded, mechanisms, random_mechanism

MOTION = 4e-15  # [-] of the largest of its kind, times the condition
FORCES = 1e-14  # [-] of the largest reaction, times the condition
BALANCE = 1e-12  # what `verify` allows, of the sum of absolute terms times its conditioning

CHAINS = Options(kinds=("dyad.rrr",), groups=(1, 5), drivers=(1, 3))
ALL = Options(kinds=KINDS, groups=(1, 4), drivers=(1, 3))


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
