"""How `auto` fares beside the best method that reaches the accuracy, over all graphs and motions.

Processor time, warm: a mechanism has been moved so often that machine code is made where it pays.
Times are reported, never asserted; what is asserted is that the answers agree.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import blockmech as bm
from blockmech.dynamics.method_table import METHODS
from blockmech.ground.errors import BlockmechError
from tests.dynamics.honesty import DEAR, RUNS, apart, mechanism

from .results import NOTES

pytest.importorskip("llvmlite", reason="machine code needs llvmlite")
MOTIONS = Path(__file__).parents[2] / "graphs" / "motions"
WARM, PATIENCE = 40, 0.3  # calls before and while it is timed, and [s] of each
NEAR = 1.5  # of the best method
COMPARED = [name for name, method in METHODS.items() if method.finds_steady]


def scenes() -> dict[str, tuple[Any, str, Any]]:
    """Name -> mechanism, goal and start."""
    found: dict[str, tuple[Any, str, Any]] = {}
    for name, (_, runs) in RUNS.items():
        if name not in DEAR:
            mech = mechanism(name)
            (driver,) = mech.drivers
            for run in runs:
                start = {driver: (run.q, run.rate)}
                found[f"{name} {run.q:g} {run.rate:g}"] = mech, f"time={run.span!r}", start
    for path in sorted(MOTIONS.glob("*.json")):
        found[path.stem] = bm.Graph.load(path).compile(), "time=1", None
    return found


def least(run: Callable[[], Any]) -> float:
    """Seconds of processor time: the least of some calls, after others that make it warm."""
    times = []
    for _ in range(2):
        begin, times = time.process_time(), []
        while len(times) < WARM and time.process_time() - begin < PATIENCE:
            start = time.process_time()
            run()
            times.append(time.process_time() - start)
    return min(times)


def test_auto_is_near_the_best_method() -> None:
    ratios, missed, compared = dict[str, float](), dict[str, float](), 0
    for name, (mech, until, start) in scenes().items():

        def motion(method: Any, mech: Any = mech, until: str = until, start: Any = start) -> Any:
            return mech.simulate(until, method=method, start=start, want=[]).motion

        chosen, times = motion("auto"), dict[str, float]()
        if not chosen.reached:
            continue
        for method in COMPARED:
            try:
                other = motion(method)
            except BlockmechError:
                continue
            if other.reached and other.end == chosen.end:
                compared += 1
                share = apart(other, chosen) / max(other.error + chosen.error, 1e-300)
                if share > 1:
                    missed[f"{name}, {method}"] = share
                times[method] = least(lambda method=method: motion(method))
        ratios[name] = least(lambda: motion("auto")) / min(times.values())
        print(f"{name:34} {chosen.method:8} {ratios[name]:6.2f}", times, flush=True)
    worst = sorted(ratios, key=ratios.__getitem__)[-3:]
    near = sum(r <= NEAR for r in ratios.values()) / len(ratios)
    NOTES.append(
        f"`auto`, warm: within {NEAR:g} of the best method in {near:.0%} of {len(ratios)} motions; "
        f"most {', '.join(f'{ratios[name]:.2f} ({name})' for name in worst)}"
    )
    print(NOTES[-1])
    assert compared
    assert not missed
