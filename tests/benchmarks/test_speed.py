"""Speed against the C bounds; run with ``python -m pytest tests/benchmarks``.

Timings are reported, never asserted: a busy machine must not fail a test. What is
asserted is that the timed answers are right.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

import blockmech as bm
from blockmech.mechanism import Mechanism

from . import c_bounds

ROOT = Path(__file__).parents[2]
ROWS = json.loads((ROOT / "tests/data/ruiz_fourbar.json").read_text("utf-8"))["rows"]
POSES = 100_000
KINEMATICS = ("*.p", "*.v", "*.a", "*.omega", "*.alpha")
FORCES = ("*.reaction", "crank.drive")
REPORT: list[tuple[str, float, float, float]] = []  # what, seconds, yardstick, goal


@pytest.fixture(scope="module")
def mech() -> Mechanism:
    return bm.Graph.load(ROOT / "graphs" / "ruiz_fourbar.json").compile()


@pytest.fixture(scope="module", autouse=True)
def report() -> Iterator[None]:
    yield
    print("\n| task | us | yardstick us | ratio | goal |\n|---|---|---|---|---|")
    for what, seconds, yardstick, goal in REPORT:
        ratio = seconds / yardstick
        print(f"| {what} | {seconds * 1e6:.3f} | {yardstick * 1e6:.3f} | {ratio:.2f} | {goal:g} |")


def measure(
    benchmark: Callable[..., object],
    what: str,
    run: Callable[[], bm.Result],
    per: int,
    yardstick: float,
    goal: float,
) -> bm.Result:
    """Time a run and put its ratio to the yardstick into the report."""
    result = benchmark(run)
    seconds = benchmark.stats.stats.median / per  # type: ignore[attr-defined]
    benchmark.extra_info |= {"ratio": seconds / yardstick, "goal": goal}  # type: ignore[attr-defined]
    REPORT.append((what, seconds, yardstick, goal))
    return result


def test_kinematics_of_a_sweep(benchmark, mech: Mechanism) -> None:
    q = np.linspace(0.0, 2 * np.pi, POSES, endpoint=False)
    q[1] = ROWS[1]["crank"]
    result = measure(
        benchmark,
        "1e5 poses, p + v + a",
        lambda: mech.run(at=q, want=KINEMATICS),
        POSES,
        c_bounds.kinematics(),
        6.0,
    )
    assert result["dyad.j.alpha"][1] == pytest.approx(ROWS[1]["alpha"]["3"], rel=1e-13)


@pytest.mark.parametrize(
    ("friction", "goal"), [("none", 20.0), ("successive", 20.0), ("newton", 20.0)]
)
def test_kinetostatics_of_a_sweep(benchmark, mech: Mechanism, friction: str, goal: float) -> None:
    q = np.linspace(0.0, 2 * np.pi, POSES, endpoint=False)
    q[1] = ROWS[1]["crank"]
    result = measure(
        benchmark,
        f"1e5 poses, reactions, friction {friction}",
        lambda: mech.run(at=q, want=FORCES, friction=friction),
        POSES,
        c_bounds.kinetostatics(friction != "none"),
        goal,
    )
    key = "frictionless_driving_moment" if friction == "none" else "driving_moment"
    assert result["crank.drive"][1] == pytest.approx(ROWS[1][key], rel=1e-8)


def test_one_warm_pose(benchmark, mech: Mechanism) -> None:
    result = measure(
        benchmark,
        "one pose, p + v + a, labelled (against 30 us)",
        lambda: mech.run(at=1.0, want=KINEMATICS),
        1,
        30e-6,
        1.0,
    )
    assert result["dyad.i.omega"][0] == pytest.approx(ROWS[1]["omega"]["2"], rel=1e-13)


def test_import(benchmark) -> None:
    def seconds(modules: str) -> float:
        clock = "time.perf_counter()"
        code = f"import time; t = {clock}; import {modules}; print({clock} - t)"
        done = subprocess.run(
            [sys.executable, "-c", code], check=True, capture_output=True, text=True
        )
        return float(done.stdout)

    ours = benchmark.pedantic(lambda: seconds("blockmech"), rounds=1)
    times = sorted(seconds("blockmech") for _ in range(7))
    core = sorted(seconds("numpy, networkx, pydantic") for _ in range(7))
    REPORT.append(
        ("import blockmech (against 0.3 s or 1.5 cores)", times[3], max(0.3, 1.5 * core[3]), 1.0)
    )
    assert ours > 0
