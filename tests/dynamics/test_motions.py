"""The graphs of `graphs/motions`: their numbers are those of the closed forms, and how they end."""

from __future__ import annotations

import functools
import json
from pathlib import Path

import pytest

import blockmech as bm
from tests.doors import graph_of as loads
from tests.dynamics.motions import MOTIONS, PRESS_START, STOP, press_moment

FOLDER = Path(__file__).resolve().parents[2] / "graphs" / "motions"


@functools.cache
def data_of(name):
    return json.loads((FOLDER / f"{name}.json").read_text("utf-8"))


def test_every_graph_has_its_closed_form():
    assert {path.stem for path in FOLDER.glob("*.json")} == set(MOTIONS)


@pytest.mark.parametrize("name", MOTIONS)
def test_expected_numbers_are_those_of_the_closed_form(name):
    entry, expected = data_of(name)["expect"][0], MOTIONS[name]()
    asked = entry["simulate"] if "simulate" in entry else entry["at"]["crank"]
    times = expected.pop("times", None) or expected.pop("at")
    assert (asked["times"] if isinstance(asked, dict) else asked) == pytest.approx(times, rel=1e-14)
    for output, values in expected.items():
        assert entry["want"][output] == pytest.approx(values, rel=1e-13, abs=1e-13), output


def test_friction_holds_the_press_for_moments_between_those_of_both_ways():
    motion = bm.Graph.load(FOLDER / "locking_press.json").compile().simulate("standstill").motion
    assert (motion.status, motion.end) == ("rest", "rest")
    moments = sorted(float(press_moment(PRESS_START, way)) for way in (1, -1))
    result = [motion.facts[f"holding_{end}"] for end in ("low", "high")]
    assert result == pytest.approx(moments, rel=1e-9)
    assert moments[0] < 0 < moments[1]


def test_with_half_the_friction_the_press_opens():
    data = json.loads(json.dumps(data_of("locking_press")))
    for block in ("crank", "ram"):
        for friction in data["blocks"][block]["friction"].values():
            friction["coefficient"] /= 2
    motion = loads(json.dumps(data)).compile().simulate("time=0.05").motion
    assert motion.q_end > 2 * PRESS_START


@pytest.mark.parametrize("name", ["damped_rod", "clock"])
@pytest.mark.parametrize("q", [-1.1707963267948966, -1.2181163267948967])
def test_loads_of_the_rate_meet_a_standstill_alike_by_both_integrators(name, q):
    mech, start = bm.Graph.load(FOLDER / f"{name}.json").compile(), {"crank": (q, 0.0)}
    explicit, implicit = (
        mech.simulate("swings=2", start=start, method=method, accuracy=accuracy).motion
        for method, accuracy in (("dop853", 1e-10), ("radau", 1e-8))
    )
    assert explicit.reached
    assert implicit.reached
    assert abs(explicit.q_end - implicit.q_end) <= explicit.error + implicit.error
    assert abs(explicit.t_end - implicit.t_end) <= explicit.time_error + implicit.time_error


def test_the_rod_ends_at_its_stop():
    motion = bm.Graph.load(FOLDER / "falling_rod.json").compile().simulate("time=2").motion
    assert (motion.end, motion.q_end) == ("end stop", STOP)


def test_the_slider_sticks_and_starts_again():
    motion = bm.Graph.load(FOLDER / "sticking_slider.json").compile().simulate("time=2.2").motion
    assert [event.kind for event in motion.events].count("rest") == 5
    assert motion.reached
