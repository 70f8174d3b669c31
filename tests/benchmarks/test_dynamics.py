"""T3 and T4: forward dynamics to an error, against C and against the table of the field."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import pytest

import blockmech as bm
from tests.wiring import watt

from . import c_bounds
from .results import ROWS, Row

ROOT = Path(__file__).parents[2]
WATT = -4.375366616457432  # [rad] crank angle at 2 s from rest at 60 degrees, in long double
ANDREWS = 15.8107711951537  # [rad] beta(0.03 s), high-precision solution of the IVP test set
PINOCCHIO = {1e-3: 22e-3, 1e-6: 38e-3, 1e-8: 65e-3}  # [s] T4, best general tool of the table
TABLE_C = {1e-3: 0.116e-3, 1e-6: 0.388e-3, 1e-8: 0.770e-3}  # [s] T4, C RK4, the table's figure


@pytest.mark.parametrize(("target", "goal"), [(1e-3, None), (1e-6, None), (1e-9, 2.0)])
def test_watt_sixbar_from_rest(benchmark: Callable[..., object], target: float, goal) -> None:
    mech = watt().compile()
    start = {"crank": (math.pi / 3, 0.0)}
    result = benchmark(lambda: mech.simulate("time=2", times=[2.0], start=start, accuracy=target))
    seconds = benchmark.stats.stats.median  # type: ignore[attr-defined]
    error = abs(result["crank.q"][-1] - WATT)
    bound = c_bounds.dynamics(target)
    ROWS.append(Row(f"T3 Watt six-bar to {target:g}", seconds, bound, "C RK4", goal, error))
    assert error <= target


@pytest.mark.parametrize(("target", "goal"), [(1e-3, None), (1e-6, None), (1e-8, None)])
def test_andrews_squeezer(benchmark: Callable[..., object], target: float, goal) -> None:
    mech = bm.Graph.load(ROOT / "graphs" / "andrews_squeezer.json").compile()
    result = benchmark(lambda: mech.simulate("time=0.03", times=[0.03], accuracy=target))
    seconds = benchmark.stats.stats.median  # type: ignore[attr-defined]
    error = abs(result["crank.q"][-1] - ANDREWS)
    task = f"T4 Andrews' squeezer to {target:g}"
    ROWS.append(Row(task, seconds, TABLE_C[target], "C RK4 (table)", goal, error))
    ROWS.append(Row(task, seconds, PINOCCHIO[target], "Pinocchio + DOP853 (table)", None, error))
    assert error <= target


def test_andrews_squeezer_from_the_file(benchmark: Callable[..., object]) -> None:
    def whole() -> float:
        mech = bm.Graph.load(ROOT / "graphs" / "andrews_squeezer.json").compile()
        return float(mech.simulate("time=0.03", times=[0.03], accuracy=1e-6)["crank.q"][-1])

    q = benchmark(whole)
    seconds = benchmark.stats.stats.median  # type: ignore[attr-defined]
    row = ("T4 to 1e-6 from the JSON file", seconds, 2e-3, "goal of 2 ms", 1.0, abs(q - ANDREWS))
    ROWS.append(Row(*row))
    assert abs(q - ANDREWS) <= 1e-6
