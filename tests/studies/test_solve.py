"""Inverse questions: answers put back into a run give what was wanted."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import blockmech as bm
from blockmech.analysis.turning_points import Signal, Turn, Turns
from blockmech.design.solve import _crossings
from tests.gallery import GRAPHS

RUIZ = bm.Graph.load(GRAPHS / "ruiz_fourbar.json").compile()
ANGLE = "dyad.j.angle"
EPS = np.finfo(float).eps


def test_every_place_of_a_driver_is_found_to_rounding():
    for value in (0.8, 1.4, 2.3, 1.4 - 2 * np.pi):  # an angle is told but for whole turns
        solutions = RUIZ.solve({ANGLE: value})
        assert len(solutions) == 2
        for solution in solutions:
            q = solution["crank.q"]
            off = RUIZ.run(q, want=ANGLE)[ANGLE][0] - value
            # rounding of the angle, and of the place times its slope
            assert abs((off + np.pi) % (2 * np.pi) - np.pi) <= 8 * EPS * (1 + q)
            h = 1e-5
            angles = RUIZ.run([q - h, q + h], want=ANGLE)[ANGLE]
            assert solution.slopes[0, 0] == pytest.approx(2 * h / np.diff(angles)[0], rel=1e-8)


@pytest.mark.parametrize("name", ["crank.q", "crank.crank.angle"])
def test_what_grows_over_a_turn_does_not_close_on_it(name):
    for value in (0.0, 0.05, 3.0, 6.2):
        (pose,) = RUIZ.solve({name: value})
        assert pose["crank.q"] == pytest.approx(value, abs=8 * EPS)


def test_a_value_may_have_a_unit():
    solutions, in_radians = RUIZ.solve({ANGLE: "80deg"}), RUIZ.solve({ANGLE: np.radians(80.0)})
    assert [s["crank.q"] for s in solutions] == [s["crank.q"] for s in in_radians]


def test_forces_are_solved_for_as_well():
    solutions = RUIZ.solve({"crank.drive": 1000.0})
    assert len(solutions) == 4
    drives = RUIZ.run([s["crank.q"] for s in solutions], want="crank.drive")["crank.drive"]
    assert drives == pytest.approx(1000.0, rel=1e-11)


def test_a_value_that_is_only_touched_has_one_place_and_none_beyond():
    top = RUIZ.extremes(ANGLE).maximum
    (touch,) = RUIZ.solve({ANGLE: top.value})
    assert touch["crank.q"] == pytest.approx(top.at["crank.q"], abs=1e-7)  # root of rounding
    assert np.isnan(touch.slopes).all()
    beyond = RUIZ.solve({ANGLE: top.value + 1e-9})
    assert len(beyond) == 0
    assert f"goes from {RUIZ.extremes(ANGLE).minimum.value:.9g} rad" in str(beyond)


def test_all_assembly_modes_are_gone_through():
    target = RUIZ.run(0.7, want="dyad.C.p")["dyad.C.p"][0].real
    design = RUIZ.document.replace({"dyad.branch": -1}).compile()
    solutions = RUIZ.solve({"dyad.C.p.x": float(target)}, modes=True)
    assert {s.mode["dyad.branch"] for s in solutions} == {1, -1}
    for s in solutions:
        mech = RUIZ if s.mode["dyad.branch"] == 1 else design
        x = mech.run(s["crank.q"], want="dyad.C.p")["dyad.C.p"][0].real
        assert x == pytest.approx(target, abs=1e-13)


def test_a_point_is_reached_by_two_drivers_from_all_sides():
    arms = bm.Graph.load(GRAPHS / "fivebar_falling.json").compile()
    p = complex(arms.run({"left": [1.2], "right": [2.2]}, want="dyad.C.p")["dyad.C.p"][0])
    solutions = arms.solve({"dyad.C.p.x": p.real, "dyad.C.p.y": p.imag})
    assert any(
        s["left.q"] == pytest.approx(1.2, abs=1e-12)
        and s["right.q"] == pytest.approx(2.2, abs=1e-12)
        for s in solutions
    )
    for s in solutions:
        at = {"left": [s["left.q"]], "right": [s["right.q"]]}
        assert arms.run(at, want="dyad.C.p")["dyad.C.p"][0] == pytest.approx(p, abs=1e-12)


def test_numbers_of_the_design():
    (length,) = RUIZ.solve({ANGLE: 1.4}, to="dyad.l_i", at=0.5)
    design = RUIZ.document.replace({"dyad.l_i": length["dyad.l_i"]}).compile()
    assert design.run(0.5, want=ANGLE)[ANGLE][0] == pytest.approx(1.4, abs=1e-14)
    slope = RUIZ.document.replace({"dyad.l_i": length["dyad.l_i"]}).compile()
    exact = slope.sensitivity(ANGLE, to="dyad.l_i", at=0.5)[ANGLE][0, 0]
    assert length.slopes[0, 0] == pytest.approx(1 / exact, rel=1e-12)


def test_a_load_for_a_drive_is_the_force_at_hand():
    request = {"friction": "none", "static": True}
    (load,) = RUIZ.solve({"crank.drive": 500.0}, to="weightlike.force.y", at=1.0, **request)
    force = bm.design.available(RUIZ, "weightlike.force.y", 500.0, 1.0, friction="none")
    assert load["weightlike.force.y"] == pytest.approx(force[0], rel=1e-12)


def test_an_extreme_between_the_samples():
    top = RUIZ.extremes("crank.drive").maximum.value
    (solution,) = RUIZ.solve({"max(crank.drive)": 1.01 * top}, to="couple.moment", samples=73)
    design = RUIZ.document.replace(dict(solution.values)).compile()
    assert design.extremes("crank.drive").maximum.value == pytest.approx(1.01 * top, rel=1e-9)


@pytest.mark.parametrize(
    ("expected", "request_", "message"),
    [
        ({}, {}, "as many values as there are unknowns"),
        ({ANGLE: 1.0, "dyad.i.angle": 0.0}, {}, "2 wanted for 1 driver"),
        ({"dyad.C.p": 1.0}, {}, "name a part"),
        ({ANGLE: "80mm"}, {}, "rad, deg"),
        ({ANGLE: [1.0]}, {}, r"got \[1.0\]. give a number"),
        ({ANGLE: float("nan")}, {}, "not finite"),
        ({ANGLE: 1.0}, {"to": "dyad.l_i"}, "wanted at one pose"),
        ({ANGLE: 1.0}, {"to": "dyad.l_x", "at": 0.5}, "dyad.l_i"),
        ({"dyad.k.angle": 1.0}, {}, "dyad.j.angle"),
    ],
)
def test_what_is_no_question_is_refused(expected, request_, message):
    with pytest.raises(bm.RequestError, match=message):
        RUIZ.solve(expected, **request_)


def test_what_cannot_be_reached_says_how_near_it_came():
    solutions = RUIZ.solve({ANGLE: 3.0}, to="dyad.l_i", at=0.5)
    assert len(solutions) == 0
    assert "no solution: dyad.l_i = " in str(solutions)


def test_a_gap_between_samples_is_refused_by_its_place():
    """Half of a signal's range is lost between two places at which it has values."""

    def value(s):
        return np.where(np.abs(s - 0.5) < 0.25, np.nan, s)

    cycle = SimpleNamespace(stretches=lambda value: [(0.0, 1.0)])
    turns = Turns(Turn(0.0, 0.0, -1), Turn(1.0, 1.0, 1), (), False)
    signal = Signal("crank.drive", value, value, value)
    with pytest.raises(bm.RequestError, match=r"no value at 0\.5"):
        list(_crossings(cycle, signal, turns, 0.5, False))
