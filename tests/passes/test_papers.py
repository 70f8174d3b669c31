"""Forces, reduced inertia and energies of Watt's six-bar falling from rest.

Source: tests/data/watt_sixbar.json (Durango et al. 2014, Table 1).
"""

import numpy as np

from tests.machines import watt
from tests.wiring import off, recorded

WATT = recorded("watt_sixbar")["from_0"]
DIGITS = 1e-13  # [-] of its own size: some 100 roundings, times a condition below 4


def falling():
    rows = WATT["table"]
    columns = {k: np.array([row[k] for row in rows]) for k in rows[0] if k != "reactions"}
    r = watt().run(at=columns["theta"], rates=columns["omega"], accelerations=columns["alpha"])
    return r, rows, columns


def test_energies_of_the_falling_sixbar():
    r, _, columns = falling()
    kinetic, potential = r["mechanism.kinetic_energy"], r["mechanism.potential_energy"]
    assert off(kinetic, columns["T"]) <= DIGITS
    assert off(potential, columns["V"]) <= DIGITS
    assert off(kinetic + potential, potential[0]) <= DIGITS


def test_equation_of_motion_holds_at_any_state():
    # J q'' + J' q'^2 / 2 = tau + tau_red, at rates and accelerations of no motion in particular
    mech, rng = watt(rate=0.0).compile(), np.random.default_rng(2)
    q, qd, qdd = rng.uniform(-3, 3, 40), rng.normal(size=40) * 5, rng.normal(size=40) * 20
    r = mech.run(at=q, rates=qd, accelerations=qdd, friction="none")
    J, dJ = r["crank.J_red"], r["crank.dJ_red"]
    inertial = J * qdd + dJ * qd**2 / 2
    size = np.abs(J * qdd) + np.abs(dJ * qd**2 / 2) + np.abs(r["crank.tau_red"])
    worst = np.sqrt(np.minimum(r["first.margin"], r["last.margin"]).min())
    assert np.max(np.abs(inertial - r["crank.drive"] - r["crank.tau_red"]) / size) <= DIGITS / worst
