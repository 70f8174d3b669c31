"""The trade of speed for accuracy: what is measured, what is claimed, what is recommended."""

from __future__ import annotations

import csv
import io
import json
import math
from functools import cache
from itertools import combinations

import numpy as np
import pytest

import blockmech as bm
from blockmech.analysis.trade import Point, Reference, Skipped, Trade, front, trade
from blockmech.analysis.trade.free_motion import FreeMotion
from blockmech.analysis.trade.measure import Clock
from blockmech.mechanism import Mechanism
from tests.gallery import mechanism
from tests.machines import pushed, ruiz, watt

pytestmark = pytest.mark.usefixtures("one_repeat")
TARGETS = (1e-3, 1e-6, 1e-9, 1e-12)
LONG = bool(np.finfo(np.longdouble).eps < np.finfo(np.float64).eps)
PLENTY = 90.0  # [s] budget that no setting misses, even on a machine that does much else
ENOUGH = 30.0  # [s] the same for the coarser settings of every method


@cache
def friction() -> Trade:
    return trade(ruiz().compile(), budget=PLENTY, samples=501)


@cache
def motion() -> Trade:
    request = {"until": "time=2", "times": [2.0], "start": {"crank": (math.pi / 3, 0.0)}}
    return trade(watt().compile(), "simulate", "crank.q", budget=ENOUGH, **request)


def of(found: Trade, method: str) -> list[Point]:
    return found.series()[method]


# -- what is measured ----------------------------------------------------------------------


def test_a_force_analysis_is_measured_with_every_friction_method_and_precision() -> None:
    methods = set(friction().series())
    assert {"numpy", "scalar", "friction none", "friction single", "successive"} <= methods
    assert {"llvm", "friction none llvm", "friction single llvm", "successive llvm"} <= methods
    settings = [p.setting for p in of(friction(), "numpy")]
    assert settings == ["complex64", "complex128"] + ["clongdouble"] * LONG  # from cheap to dear
    iterations = [p.options["friction"].iterations for p in of(friction(), "successive")]
    assert iterations == [2, 3, 4, 5, 6]


def test_a_simulation_is_measured_with_every_method_that_applies() -> None:
    assert {"energy", "dop853", "radau", "rk4", "euler_q"} <= set(motion().series())
    assert {"energy scalar", "dop853 scalar", "radau scalar"} <= set(motion().series())


@pytest.mark.parametrize("found", [friction, motion])
def test_nothing_is_claimed_below_the_floor(found) -> None:
    floor = found().reference.floor
    assert floor > 0
    assert all(p.error >= floor for p in found().points)
    assert all(p.error == floor for p in found().points if p.at_floor)


def test_more_successive_approximations_give_smaller_errors() -> None:
    errors = [p.error for p in of(friction(), "successive")]
    assert errors == sorted(errors, reverse=True)
    single = of(friction(), "friction single")[0]
    assert of(friction(), "friction none")[0].error > single.error > errors[0]


def test_successive_approximations_contract_at_the_measured_rate() -> None:
    run = ruiz().compile().run(samples=501, friction=bm.friction.Successive(iterations=4))
    rho = float(np.nanmax(run.quality.contraction["dyad"]))
    two, three, four = (p.error for p in of(friction(), "successive")[:3])
    # The worst sample of an error need not be the one that contracts worst; the rate is
    # that of the last two changes there, which the error's ratio approaches from below.
    assert 0.8 * rho <= three / two <= 1.1 * rho
    assert 0.8 * rho <= four / three <= 1.1 * rho


@cache
def watt_question() -> FreeMotion:
    return FreeMotion(mechanism("watt_sixbar"), None, {"until": "time=2"}, Clock(PLENTY))


@pytest.mark.parametrize(("method", "order", "off"), [("rk4", 4.0, 0.3), ("euler_q", 1.0, 0.15)])
def test_fixed_steps_show_their_orders(method: str, order: float, off: float) -> None:
    question = watt_question()
    fine = [s.options for s in question.settings() if s.method == method][-2:]
    e, finer = (question.error(question.run(options, PLENTY))[0] for options in fine)
    assert finer > 10 * question.reference.floor
    refined = math.log(fine[0]["method"].step / fine[1]["method"].step)
    assert math.log(e / finer) / refined == pytest.approx(order, abs=off)


@pytest.mark.parametrize("method", ["rk4", "euler_q", "dop853"])
def test_refining_a_method_does_not_make_it_worse(method: str) -> None:
    errors = [p.error for p in of(motion(), method)]
    assert errors == sorted(errors, reverse=True)


# -- the choice ------------------------------------------------------------------------------


def point(method: str, seconds: float, error: float) -> Point:
    settings = {"seconds": seconds, "slowest": seconds, "repeats": 5}
    return Point(method, evaluations=100, error=error, **settings)


def by_hand(*points: Point, **options) -> Trade:
    return Trade("m", "q", "e", "n", Reference("r", "c", 1e-15), points, **options)


def test_the_front_holds_what_nothing_beats_in_both_and_no_error_as_large_as_the_answer() -> None:
    a, b, c, d = (point("m", *row) for row in ((1.0, 1e-2), (2.0, 1e-3), (3.0, 1e-2), (0.1, 2.4)))
    assert front((c, a, d, b), "seconds") == (a, b)


def test_a_place_on_the_front_needs_a_difference_beyond_the_noise() -> None:
    exact = point("m", 1.04, 1e-9)
    a, b = point("a", 1.0, 1e-9), point("b", 1.0, 1e-6)
    assert front((a, exact), "seconds") == (a, exact)  # equal as far as can be seen
    assert front((b, exact), "seconds") == (exact,)  # not surely faster, and less exact
    assert front((point("c", 0.5, 1e-6), exact), "seconds")[0].method == "c"


@pytest.mark.parametrize("target", [1e-4, 1e-6, 1e-8])
def test_the_recommended_setting_is_the_fastest_of_the_front_within_the_target(target) -> None:
    best = friction().best(target)
    assert best in friction().pareto
    within = [p.seconds for p in friction().points if p.error <= target]
    assert best.seconds <= 1.11 * min(within)  # two steps of noise


def test_what_another_beats_in_both_is_named_as_beaten() -> None:
    exact = point("llvm", 1.0, 1e-15)
    single = point("numpy", 3.0, 1e-6)
    slow = point("s", 9.0, 1e-15)
    close = point("numpy", 1.02, 1e-6)  # within the noise
    result = by_hand(exact, single, slow, close)
    assert result.beaten_by(single) is exact
    assert [result.beaten_by(p) for p in (exact, slow, close)] == [None] * 3
    assert "beaten in time and in error by llvm: numpy" in result.text()
    rows = {row["method"]: row["beaten_by"] for row in result.to_dict()["points"][:3]}
    assert rows == {"llvm": "", "numpy": "llvm", "s": ""}


ENERGY, RK4 = point("energy", 4e-4, 1e-6), point("rk4", 4e-5, 1e-3)
SLOW, FAST = point("slow", 2.0, 1e-9), point("fast", 0.1, 1e-4)
NOTHING = "no setting here gives an error of 1e-9"
TOLD = "for 1e-5, 1e-6 in 400 µs: energy; 10.0 times faster costs"


@pytest.mark.parametrize(
    ("points", "target", "message"),
    [
        ([ENERGY, RK4], {"target": 1e-5}, f"{TOLD} 3 digits (rk4)"),
        ([ENERGY, point("rk4", 4e-5, 1.1e-5)], {"target": 1e-5}, f"{TOLD} 1 digit (rk4)"),
        ([ENERGY, point("rk4", 9e-5, 2e-6)], {"target": 1e-6}, "costs less than a digit (rk4)"),
        ([RK4, point("wild", 1e-6, 2.4)], {"target": 1e-2}, "rk4; nothing here is twice as fast"),
        ([RK4], {}, f"{NOTHING}; the closest is rk4: 1e-3 in 40 µs"),
        ([RK4], {"target": 1e-16}, "cannot be confirmed: the reference itself is known to 1e-15"),
        ([SLOW, FAST], {"within": 1.0}, "1e-4 in 100 ms: fast; nothing here is twice as fast"),
        (
            [SLOW, FAST],
            {"within": 1.0, "target": 1e-9},
            f"{NOTHING} and a run within 1 s; the closest is fast: 1e-4 in 100 ms",
        ),
        ([SLOW, FAST], {"within": 2.0, "target": 1e-9}, "for 1e-9, 1e-9 in 2 s: slow"),
    ],
)
def test_the_sentence_names_the_choice_and_its_price(points, target, message: str) -> None:
    assert message in by_hand(*points, **target).recommendation


def test_what_friction_alone_makes_is_judged_where_it_is_asked_for() -> None:
    (none, _) = of(friction(), "friction none")
    assert none.error < 0.05
    assert any("as friction alone makes them" in note for note in friction().notes)
    study = trade(ruiz().compile(), want="mechanism.friction_power", budget=PLENTY, samples=51)
    (none,) = of(study, "friction none")  # no friction power in either precision: one row
    assert none.same == ("complex64",)
    assert (none.error, none.worst) == (pytest.approx(1.0), "mechanism.friction_power")


@pytest.mark.parametrize("target", TARGETS)
def test_the_recommended_simulation_meets_its_target_against_an_outside_number(
    target: float,
) -> None:
    request = {"until": "time=2", "times": [2.0], "start": {"crank": (math.pi / 3, 0.0)}}
    best = motion().best(target)
    assert best is not None
    fresh = watt().compile().simulate(**request, **best.options)
    # Crank angle [rad] at 2 s by Runge and Kutta's method in long double, made outside.
    error = abs(fresh["crank.q"][-1] + 4.375366616457432)
    assert error <= max(target, motion().reference.floor)


# -- single precision ------------------------------------------------------------------------


def test_the_report_says_how_far_single_precision_is_usable() -> None:
    assert any("single precision" in note and "margin" in note for note in friction().notes)


def test_single_precision_stops_being_usable_near_a_dead_centre() -> None:
    q = 9.0 - np.geomspace(1.0, 1e-5, 41)
    result = trade(nearly_straight(), budget=PLENTY, at=q, rates=1.0)
    (note,) = [n for n in result.notes if "single precision" in n]
    assert "it stops being usable" in note


def nearly_straight() -> Mechanism:
    """A dyad of 6 m and 3 m whose outer joints a slide draws apart."""
    return pushed(6.0, 3.0, 0j).compile()


# -- paper -----------------------------------------------------------------------------------


def test_the_table_names_the_floor_the_front_and_what_was_skipped() -> None:
    result = by_hand(point("a", 1.0, 1e-2), skipped=(Skipped("b", "the budget is spent"),))
    text = result.text()
    assert "(the floor)" in text
    assert "skipped: b: the budget is spent" in text
    assert "*  a" in text


def test_json_and_csv_hold_every_point() -> None:
    data = json.loads(json.dumps(friction().to_dict()))
    assert len(data["points"]) == len(friction().points)
    assert data["reference"]["floor"] == friction().reference.floor
    rows = csv.DictReader(io.StringIO(friction().to_csv()))
    expected = [(p.method, p.error) for p in friction().points]
    assert [(row["method"], float(row["error"])) for row in rows] == expected


def test_the_picture_has_both_costs_a_floor_and_a_caption() -> None:
    figure = friction().figure()
    assert [a.get_xlabel() for a in figure.axes] == [
        "time of one run [s]",
        "kernel evaluations [–]",
    ]
    assert all(a.get_xscale() == a.get_yscale() == "log" for a in figure.axes)
    assert figure.get_size_inches()[0] == pytest.approx(8.5 / 2.54)
    text = " ".join(t.get_text() for t in figure.texts)
    assert "processor time" in " ".join(text.split())
    assert "Pareto front" in text
    floor = friction().reference.floor
    assert all(a.get_ylim()[0] < floor for a in figure.axes)


@pytest.mark.parametrize("found", [friction, motion])
def test_labels_of_the_picture_do_not_overlap_and_stay_inside(found) -> None:
    figure = found().figure()
    renderer = figure.canvas.get_renderer()
    page = figure.bbox
    for axes in figure.axes:
        labels = [t.get_window_extent(renderer) for t in axes.texts]
        assert labels
        assert not any(a.overlaps(b) for a, b in combinations(labels, 2))
        low, high = axes.get_xlim()
        visible = [t for t in axes.xaxis.get_major_ticks() if low <= t.get_loc() <= high]
        ticks = [t.label1.get_window_extent(renderer) for t in visible]
        assert len(ticks) >= 2
        assert not any(a.overlaps(b) for a, b in combinations(ticks, 2))
        for box in (*labels, *ticks):
            assert page.x0 <= box.x0 <= box.x1 <= page.x1


# -- mistakes --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "value"),
    [("budget", 0.0), ("target", -1.0), ("within", "-1 ms"), ("budget", math.inf)],
)
def test_a_limit_must_be_positive(name: str, value: float) -> None:
    with pytest.raises(bm.RequestError, match=f"{name}: must be > 0"):
        trade(ruiz().compile(), **{name: value})
