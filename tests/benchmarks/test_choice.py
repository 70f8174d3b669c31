"""How `auto` fares beside the better engine, over the gallery: the cost model, held.

Each engine's times are measured for some numbers of samples, and what making machine code takes,
from nothing and from the disk; longer runs are blocks, so their times are in proportion. What
`auto` spends on one call, and on ten, follows from the choices that it makes.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from blockmech.engines import code_cache, cost, llvm
from blockmech.engines.interpreters import NumpyEngine, ScalarEngine
from blockmech.engines.llvm import LlvmEngine
from blockmech.plan.plan import Program
from tests.engines.test_llvm import request_of
from tests.gallery import SHORT, mechanism

from .results import NOTES, ROWS, Row

pytest.importorskip("llvmlite", reason="machine code needs llvmlite")
FORCES = ("*.reaction", "*.drive", "*.alpha")
MEASURED = (1, 10, 100, 1_000, 10_000)
ASKED = (*MEASURED, 100_000, 1_000_000)
SCALAR_TO = 100  # samples that Python's numbers are measured for
NEAR = 1.3  # of the better engine
MODEL = 1.5  # what the model's times are off by in one program of ten


@dataclass
class Times:
    """Seconds of a program: of each engine by samples, and until there is machine code."""

    program: Program
    engines: dict[str, dict[int, float]]
    compiling: float
    loading: float

    def of(self, engine: str, n: int) -> float:
        """Seconds of n samples."""
        times = self.engines[engine]
        known = max(k for k in times if k <= n)
        return times[known] * n / known

    def best(self, n: int, calls: int, making: float) -> float:
        """The better of the interpreters and machine code, for so many calls."""
        alone = min(self.of("scalar", n), self.of("numpy", n)) * calls
        return min(alone, making + calls * self.of("llvm", n))

    def auto(self, n: int, calls: int, making: float, kept: bool) -> float:
        """What `auto` spends on so many calls, of a text that nobody asked for before."""
        costs, made, total = cost.Account(), False, 0.0
        costs.kept = kept
        for _ in range(calls):
            engine = costs.choice(self.program, n, made)
            if engine == "llvm":
                total += 0.0 if made else making
                made = True
            else:
                costs.count(self.program, n)
            total += self.of(engine, n)
        return total


def least(f: Callable[[], Any], most: float = 0.3) -> float:
    """Seconds of processor time: the least of some runs, after one to warm up."""
    f()
    found, begin = [], time.process_time()
    while len(found) < 5 and (not found or time.process_time() - begin < most):
        start = time.process_time()
        f()
        found.append(time.process_time() - start)
    return min(found)


def spent(f: Callable[[], Any]) -> float:
    """Seconds of processor time, once."""
    start = time.process_time()
    f()
    return time.process_time() - start


def times_of(name: str, friction: Any) -> Times:
    mech = mechanism(name)
    plan = mech.plan(FORCES, friction=friction)

    def inputs(n: int) -> Any:
        request = dict.fromkeys(("at", "samples", "times", "rates", "accelerations"))
        request |= request_of(mech, n)
        taken = mech.samples(*request.values())
        return (
            mech._with_states(plan, taken)
            if mech.structure.states
            else taken.given(plan.program.inputs)
        )

    llvm._CODES.clear()
    compiling = spent(lambda: LlvmEngine(plan.program))
    llvm._CODES.clear()
    loading = spent(lambda: LlvmEngine(plan.program))
    made = {e.name: e for e in (k(plan.program) for k in (ScalarEngine, NumpyEngine, LlvmEngine))}
    given = {n: inputs(n) for n in MEASURED}
    engines = {
        kind: {
            n: least(lambda e=engine, n=n: e.run(given[n], n))
            for n in MEASURED
            if kind != "scalar" or n <= SCALAR_TO
        }
        for kind, engine in made.items()
    }
    return Times(plan.program, engines, compiling, loading)


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Times]:
    """Times over the gallery, friction by Newton's method where there is some."""
    llvm.processor()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(code_cache.FOLDER, str(tmp_path_factory.mktemp("codes")))
        return {
            f"{name}, {how}": times_of(name, how)
            for name in SHORT
            for how in (("none", "newton") if mechanism(name).frictional_joints else ("none",))
        }


# Of ten calls no rule stays within 1.3 that does so of one: where the interpreter takes 0.7 of what
# making takes, one call is to be interpreted, and ten have then cost 1.7. Without knowledge of what
# comes, 2 is the bound of the best rule; the rest are errors of the model.
@pytest.mark.parametrize(("calls", "most"), [(1, NEAR * MODEL), (10, 2.0 * MODEL)])
@pytest.mark.parametrize("kept", [False, True])
def test_auto_is_near_the_better_engine(
    measured: dict[str, Times], calls: int, most: float, kept: bool
) -> None:
    cases = {
        f"{name}, {n} samples": (times.auto(n, calls, making, kept), times.best(n, calls, making))
        for name, times in measured.items()
        for making in (times.loading if kept else times.compiling,)
        for n in ASKED
    }
    ratios = {name: seconds / best for name, (seconds, best) in cases.items()}
    worst = max(ratios, key=ratios.__getitem__)
    near = np.mean([r <= NEAR for r in ratios.values()])
    about = f"`auto`, {calls} calls, code {'on disk' if kept else 'nowhere'}"
    NOTES.append(
        f"{about}: within {NEAR:g} of the better engine in {near:.0%} of {len(ratios)} cases"
    )
    ROWS.append(Row(f"{about}, the worst: {worst}", *cases[worst], "the better engine", most))
    print(NOTES[-1], {k: round(r, 2) for k, r in ratios.items() if r > NEAR})
    assert all(best > 0 for _, best in cases.values())
