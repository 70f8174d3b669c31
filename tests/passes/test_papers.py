"""Forces, reduced inertia and energies against recorded motions: Watt's six-bar falling from
rest, and Andrews' squeezer at 0.03 s. Both are free motions, so the driving effort is zero.

Sources: tests/data/watt_sixbar.json (Durango et al. 2014, Table 1) and
tests/data/andrews_squeezer.json (IVP test set; Hairer & Wanner).
"""

import numpy as np
import pytest

from tests.wiring import off, recorded, squeezer, watt

WATT = recorded("watt_sixbar")["from_0"]
PINS = {
    "O2": "crank.A",
    "A": "first.B",
    "B": "first.C",
    "O4": "first.D",
    "C": "last.B",
    "D": "last.D",
    "E": "last.C",
}
MARGIN = 0.08  # smallest margin over the fall: conditions below 1 / sqrt(MARGIN) = 4
DIGITS = 1e-13  # [-] of its own size: some 100 roundings, times that condition

EACH_ENGINE = pytest.mark.parametrize("engine", ["scalar", "numpy"])


def falling(engine):
    rows = WATT["table"]
    columns = {k: np.array([row[k] for row in rows]) for k in rows[0] if k != "reactions"}
    r = watt().run(
        at=columns["theta"], rates=columns["omega"], accelerations=columns["alpha"], engine=engine
    )
    return r, rows, columns


@EACH_ENGINE
def test_reactions_of_the_falling_sixbar(engine):
    r, rows, _ = falling(engine)
    assert min(r["first.margin"].min(), r["last.margin"].min()) > MARGIN
    for pin, name in PINS.items():
        for k, row in enumerate(rows):
            force = complex(*row["reactions"][pin])
            assert abs(r[f"{name}.reaction"][k] - force) <= DIGITS * abs(force)


@EACH_ENGINE
def test_reduced_inertia_and_moment_of_the_sixbar(engine):
    r, _, columns = falling(engine)
    for name, key in (("J_red", "J_red"), ("tau_red", "tau_red"), ("dJ_red", "dJ_red_dtheta")):
        assert np.max(np.abs(r[f"crank.{name}"] / columns[key] - 1)) <= DIGITS
    shares = sum(r[f"{block}.J_red"] for block in ("first", "last"))
    assert off(shares + (0.0833 + 1.0 * 0.5**2), columns["J_red"]) <= DIGITS


@EACH_ENGINE
def test_energies_of_the_falling_sixbar(engine):
    r, _, columns = falling(engine)
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
    left = J * qdd + dJ * qd**2 / 2
    size = np.abs(J * qdd) + np.abs(dJ * qd**2 / 2) + np.abs(r["crank.tau_red"])
    worst = np.sqrt(np.minimum(r["first.margin"], r["last.margin"]).min())
    assert np.max(np.abs(left - r["crank.drive"] - r["crank.tau_red"]) / size) <= DIGITS / worst


# ---- Andrews' squeezer: three dyads on one pin -------------------------------------------

ANDREWS = recorded("andrews_squeezer")["converged_at_0_03"]
# Source of the reference: two formulations agree to 1e-12 at speeds of 1,000 rad/s.
AGREED = 5e-12
REACTIONS = {
    "O": ("crank.A", 1),
    "F": ("first.B", 1),
    "P23": ("first.C", 1),
    "B": ("first.D", 1),
    "P24": ("upper.B", 1),
    "G": ("upper.C", -1),  # there of link 5 on 4, here of link 4 on 5
    "A5": ("upper.D", 1),
    "P26": ("lower.B", 1),
    "H": ("lower.C", -1),
    "A7": ("lower.D", 1),
}


@EACH_ENGINE
def test_squeezer_moves_as_the_benchmark_says(engine):
    q, dq, ddq = (np.array(ANDREWS[k]) for k in ("q", "dq", "ddq"))
    r = squeezer().run(at=[q[0]], rates=dq[0], accelerations=ddq[0], engine=engine)

    def links(x):
        """Angles or rates from the benchmark's (beta, Theta, gamma, Phi, delta, Omega, eps)."""
        return {
            "first.i": x[0] + x[1],
            "first.j": x[2],
            "upper.i": x[3] + x[4],
            "upper.j": x[4],
            "lower.i": x[5] + x[6],
            "lower.j": x[6],
        }

    frames = {
        "first.i": -1,
        "first.j": -1j,
        "upper.i": 1j,
        "upper.j": 1,
        "lower.i": -1,
        "lower.j": -1j,
    }
    for name, angle in links(q).items():
        direction = np.exp(1j * angle) * frames[name]
        assert abs(np.exp(1j * r[f"{name}.angle"][0]) - direction) <= AGREED
    for what, column in (("omega", dq), ("alpha", ddq)):
        wanted = links(column)
        largest = max(map(abs, wanted.values()))
        for name, x in wanted.items():
            assert abs(r[f"{name}.{what}"][0] - x) <= AGREED * largest


@EACH_ENGINE
def test_squeezer_has_the_reactions_of_the_benchmark(engine):
    q, dq, ddq = (ANDREWS[k][0] for k in ("q", "dq", "ddq"))
    r = squeezer().run(at=[q], rates=dq, accelerations=ddq, engine=engine)
    for pin, (name, sign) in REACTIONS.items():
        force = complex(*ANDREWS["reactions"][pin])
        assert abs(sign * r[f"{name}.reaction"][0] - force) <= AGREED * 300.0  # the largest [N]
    assert abs(r["crank.drive"][0]) <= AGREED * 300.0 * 0.007  # force times crank length


def test_squeezer_counts_its_threefold_pin_as_two_pairs():
    structure = squeezer().structure()
    assert len(structure.links) - 1 == 7
    assert structure.pairs == 10
    assert structure.mobility == 1
    assert structure.formula == (
        "I(crank: 0,1) -> II RRR(first: 2,3) -> II RRR(lower: 4,5) -> II RRR(upper: 6,7)"
    )
