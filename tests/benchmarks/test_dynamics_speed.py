"""Forward dynamics against the C bound; run with ``python -m pytest tests/benchmarks``.

Timings are reported, never asserted: a busy machine must not fail a test. What is
asserted is that the timed answers are right.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path

import pytest

import blockmech as bm

from . import c_bounds

ROOT = Path(__file__).parents[2]
WATT = json.loads((ROOT / "tests/data/watt_sixbar.json").read_text("utf-8"))["from_60_degrees"]
ANDREWS = json.loads((ROOT / "tests/data/andrews_squeezer.json").read_text("utf-8"))
START = {"crank": (math.pi / 3, 0.0)}
YARDSTICK = 1e-9  # [rad] error of the C integrator's setting
REPORT: list[str] = []


@pytest.fixture(scope="module", autouse=True)
def report() -> Iterator[None]:
    yield
    print("\n" + "\n".join(REPORT))


def reported(benchmark, what: str, goal: float | None) -> None:
    seconds = benchmark.stats.stats.median
    bound = c_bounds.dynamics(YARDSTICK)
    goal_words = f", goal {goal:g}" if goal else ""
    REPORT.append(f"{what}: {1e3 * seconds:.3f} ms, {seconds / bound:.2f} x C{goal_words}")


@pytest.mark.parametrize(
    ("method", "accuracy", "goal"), [("energy", 1e-12, 2.0), ("dop853", 1e-9, 30.0)]
)
def test_the_watt_six_bar_at_2_seconds(benchmark, method, accuracy, goal):
    mech = bm.Graph.load(ROOT / "graphs" / "watt_sixbar.json").compile()

    def angle():
        return mech.simulate(
            until="time=2",
            method=method,
            accuracy=accuracy,
            times=[2.0],
            want=["crank.q"],
            start=START,
        )["crank.q"][0]

    found = benchmark(angle)
    assert abs(found - WATT["theta_at_2s"]) < accuracy
    reported(benchmark, f"Watt six-bar, theta(2 s), {method} at {accuracy:g}", goal)


@pytest.mark.parametrize(("method", "accuracy"), [("energy", 1e-11), ("dop853", 1e-9)])
def test_andrews_squeezer_at_30_milliseconds(benchmark, method, accuracy):
    mech = bm.Graph.load(ROOT / "graphs" / "andrews_squeezer.json").compile()

    def angle():
        return mech.simulate(
            until="time=0.03", method=method, accuracy=accuracy, times=[0.03], want=["crank.q"]
        )["crank.q"][0]

    found = benchmark(angle)
    assert abs(found - ANDREWS["converged_at_0_03"]["q"][0]) < accuracy
    reported(benchmark, f"Andrews' squeezer at 0.03 s, {method} at {accuracy:g}", None)
