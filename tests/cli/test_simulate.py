"""``blockmech simulate``: the same motion as Python, its events, files and exit codes."""

from __future__ import annotations

import json
import math
import os
import re

import jsonschema
import pytest

import blockmech as bm
from blockmech.result.data import result_schema
from tests.gallery import GRAPHS

WATT = GRAPHS / "watt_sixbar.json"
FIVEBAR = GRAPHS / "joints" / "fivebar_falling.json"
DEGREES = math.pi / 180


def simulated(until=None, **request):
    """What Python computes, as JSON data."""
    return bm.Graph.load(WATT).compile().simulate(until, **request).to_dict()


REQUESTS = [
    ([], {}),
    (["--until", "swings=2"], {"until": "swings=2"}),
    (["--times", "0:1:5"], {"times": [0.0, 0.25, 0.5, 0.75, 1.0]}),
    (["--until", "time=1", "--want", "*.reaction"], {"until": "time=1", "want": ["*.reaction"]}),
    (["--until", "angle=-1", "--accuracy", "1e-6"], {"until": "angle=-1", "accuracy": 1e-6}),
    (["--method", "rk4", "--step", "0.01"], {"method": bm.FixedStep("rk4", 0.01)}),
    (["--method", "euler_q", "--step", "0.01"], {"method": bm.FixedStep("euler_q", 0.01)}),
    (["--engine", "scalar"], {"engine": "scalar"}),
    (["--friction", "none"], {"friction": "none"}),
    (["--start", "crank=60deg"], {"start": {"crank": (60 * DEGREES, 0.0)}}),
    (["--start", "0.5, -3"], {"start": {"crank": (0.5, -3.0)}}),
    (["--start", "crank=1rad,-20deg/s"], {"start": {"crank": (1.0, -20 * DEGREES)}}),
    (["--start", "crank=1.2,20rpm"], {"start": {"crank": (1.2, 20 * math.tau / 60)}}),
]


@pytest.mark.parametrize(("arguments", "request_"), REQUESTS)
def test_json_is_what_python_computes_and_fits_the_schema(call, arguments, request_):
    outcome = call("simulate", WATT, *arguments, "--json")
    assert outcome.code == 0
    document = json.loads(outcome.out)
    jsonschema.validate(document, result_schema())
    assert document == json.loads(json.dumps(simulated(**request_)))


def test_roles_of_drivers_are_options(call):
    linkage = bm.Linkage.load(FIVEBAR)
    left, right = linkage.compile().drivers
    q = linkage.initial[right].q
    options = ["--until", "time=0.1", "--locked", f"{right}={q / DEGREES!r}deg", "--json"]
    document = json.loads(call("simulate", FIVEBAR, *options).out)
    jsonschema.validate(document, result_schema())
    same = linkage.compile().simulate("time=0.1", roles={right: q / DEGREES * DEGREES})
    assert document == json.loads(json.dumps(same.to_dict()))
    outcome = call("simulate", FIVEBAR, "--prescribed", left)
    assert outcome.code == 2
    assert f"roles.{left}: {left} has no law of motion" in outcome.err


def test_a_start_and_a_lock_in_degrees_have_rates_in_radians(call):
    rest = ("--until", "time=0.01", "--deg")
    bare = call("simulate", WATT, "--start", "60,-3", *rest)
    assert bare.out == call("simulate", WATT, "--start", "60deg,-3", *rest).out
    linkage = bm.Linkage.load(FIVEBAR)
    _, right = linkage.compile().drivers
    q = linkage.initial[right].q / DEGREES
    lock = ("simulate", FIVEBAR, "--until", "time=0.01", "--deg", "--locked")
    bare = call(*lock, f"{right}={q!r}")
    assert (bare.code, bare.out) == (0, call(*lock, f"{right}={q!r}deg").out)


def test_the_standstill_is_an_event_with_time_and_place(call):
    document = json.loads(call("simulate", WATT, "--json").out)
    (event,) = document["events"]
    assert event["kind"] == "standstill"
    assert event["time"] == document["motion"]["end_time"] == document["time"][-1]
    assert event["crank.q"] == pytest.approx(-3.7998507643768, abs=1e-12)


def test_alone_it_prints_a_table_and_how_it_went_and_writes_nothing(call, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    outcome = call("simulate", WATT, "--deg")
    assert outcome.code == 0
    assert "standstill at 1.38475256594 s, crank.q = -217.7" in outcome.out
    assert "method energy (all loads depend on the driver's coordinate alone)" in outcome.out
    assert "estimated error" in outcome.out
    assert os.listdir(tmp_path) == []


def test_a_folder_gets_the_numbers_and_the_pictures(call, tmp_path, monkeypatch):
    monkeypatch.setattr("blockmech.draw.simulation.FRAME", 0.4)  # [s] fewer pictures in a film
    out = tmp_path / "fall"
    outcome = call("simulate", WATT, "--out", out)
    assert outcome.code == 0
    pictures = ["animation.gif", "animation.html", "energy.png", "motion.png", "phase.png"]
    assert sorted(os.listdir(out)) == [*pictures, "result.json", "results.csv"]
    assert all((out / name).stat().st_size > 1000 for name in pictures)
    head = (out / "results.csv").read_text(encoding="utf-8").splitlines()[0]
    assert "time [s]" in head


def test_times_that_the_motion_does_not_reach_are_said_by_the_exit_code(call):
    outcome = call("simulate", WATT, "--until", "standstill", "--times", "0,1,2")
    assert outcome.code == 1
    assert "1 of 3 times after the end are left out" in outcome.out
    top = call("simulate", WATT, "--until", "time=20", "--start", "1.4933373434657107")
    assert top.code == 1
    assert "failed: not decided" in top.out


def test_joint_friction_brakes_unless_it_is_waived(call, ruiz, tmp_path):
    data = json.loads(ruiz.read_text(encoding="utf-8"))
    data["scene"]["initial"] = {"crank": {"q": 1.0, "rate": 0.0}}
    path = tmp_path / "falling.json"
    path.write_text(json.dumps(data), encoding="utf-8")
    outcome = call("simulate", path, "--until", "time=0.1")
    assert outcome.code == 0
    assert "the joints have friction" in outcome.out
    assert "friction work" in outcome.out
    options = ("--friction", "successive", "--iterations", "3")
    assert call("simulate", path, "--until", "time=0.1", *options).code == 0
    assert "has no meaning" in call("simulate", path, "--friction", "newton", *options[2:]).err
    explained = call("simulate", path, "--explain").out
    assert re.search(r"equation of motion \d+; pairs with friction \d+, 6 times", explained)
    free = call("simulate", path, "--until", "time=0.1", "--friction", "none")
    assert free.code == 0
    assert "friction work" not in free.out


def test_a_steady_state_tells_its_period_its_stability_and_how_it_was_found(call, tmp_path):
    data = json.loads((GRAPHS / "pump.json").read_text(encoding="utf-8"))
    series = {"kind": "fourier", "of": "time", "period": 0.2, "mean": 1.0, "cosines": [5.0]}
    data["blocks"]["motor"]["law"] = series
    path = tmp_path / "forced.json"
    path.write_text(json.dumps(data), encoding="utf-8")
    outcome = call("simulate", path, "--until", "steady")
    assert outcome.code == 0
    assert "method stroboscopic map (the loads depend on rate, time)" in outcome.out
    assert "\nperiod 0.2 s\n" in outcome.out
    assert "\nmultiplier " in outcome.out
    assert "note: stable: a period leaves" in outcome.out
    data["blocks"]["spring"]["damping"] = 0.0
    data["blocks"]["motor"]["law"] = {"kind": "constant", "value": 3.0}
    path.write_text(json.dumps(data), encoding="utf-8")
    refused = call("simulate", path, "--until", "steady")
    assert (refused.code, refused.out) == (2, "")
    assert "rad the loads do a work of 18.8495559 J" in refused.err


STARTS = [  # words; (coordinate, rate) of both drivers, by the scene where they are not named
    (("right=2.4,-10deg/s",), (1.2, 0.0), (2.4, -10 * DEGREES)),
    (("right=2.4", "left=1.1,1"), (1.1, 1.0), (2.4, 0.0)),
]


@pytest.mark.parametrize(("starts", "left", "right"), STARTS)
def test_drivers_start_where_they_are_told(call, starts, left, right):
    options = [word for start in starts for word in ("--start", start)]
    outcome = call("simulate", FIVEBAR, "--until", "time=0.1", *options, "--json")
    first = {n: x["values"][0] for n, x in json.loads(outcome.out)["outputs"].items()}
    for name, (q, rate) in {"left": left, "right": right}.items():
        assert (first[f"driver.{name}.q"], first[f"driver.{name}.rate"]) == (q, rate)


def test_a_slide_starts_in_metres_without_a_start_in_the_file(call, slide):
    options = ("--until", "time=1", "--start", "table=200mm,-0.5m/s", "--json")
    result = json.loads(call("simulate", slide, *options).out)["outputs"]
    assert result["table.q"]["values"][0] == 0.2
    assert result["table.q"]["values"][-1] == pytest.approx(-0.3, abs=1e-12)


def test_all_mistakes_of_starts_are_told_at_once(call):
    starts = ("lift=1", "rihgt=60deg", "left=x,2y", "left=1", "right=1,2,3", "1.2")
    outcome = call("simulate", FIVEBAR, *(word for text in starts for word in ("--start", text)))
    assert (outcome.code, outcome.out) == (2, "")
    assert outcome.err.splitlines() == [
        '[bad-request] --start lift=1: no driver "lift". drivers: left, right. '
        'did you mean "left"?',
        '[bad-request] --start rihgt=60deg: no driver "rihgt". drivers: left, right. '
        'did you mean "right"?',
        '[bad-request] --start left=x,2y: "x" is not a number. '
        "a number, in SI or with rad, deg, turns.",
        '[bad-request] --start left=x,2y: no unit "y" in "2y". '
        "a number, in SI or with rad/s, deg/s, rpm.",
        "[bad-request] --start left=1: left is given twice. give it once.",
        "[bad-request] --start right=1,2,3: 3 numbers. a start is the coordinate, then the rate.",
        "[bad-request] --start 1.2: there are 2 drivers. drivers: left, right. "
        "write --start right=0.5.",
    ]


def test_degrees_are_refused_for_a_slide(call, slide):
    outcome = call("simulate", slide, "--start", "table=60deg,5deg/s")
    assert (outcome.code, outcome.out) == (2, "")
    assert '"60deg" has another kind of unit. a number, in SI or with m, mm, cm' in outcome.err
    assert '"5deg/s" has another kind of unit. a number, in SI or with m/s, mm/s' in outcome.err
