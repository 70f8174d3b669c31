"""The compiled engine against the C bounds, in one run; see `tests/benchmarks/test_speed.py`."""

from __future__ import annotations

import json
import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import blockmech as bm
from blockmech.engines.interpreters import NumpyEngine
from blockmech.engines.llvm import compiled_program
from blockmech.mechanism import Mechanism
from blockmech.result.samples import make_samples
from tests.engines.test_designs import design

from . import c_bounds
from .results import ROWS, Row, python
from .test_speed import FORCES, KINEMATICS, POSES, RUIZ, measure

pytest.importorskip("llvmlite", reason="the compiled engine needs the extra fast")
pytestmark = pytest.mark.benchmark(timer=time.process_time)  # others use the machine, too
ROOT = Path(__file__).parents[2]
DESIGNS, TURN = 2000, 72
WANTED = 700_000  # designs a second and core, 72 poses each


@pytest.fixture(scope="module")
def mech() -> Mechanism:
    return bm.Graph.load(ROOT / "graphs" / "ruiz_fourbar.json").compile()


def sweep() -> np.ndarray:
    q = np.linspace(0.0, 2 * np.pi, POSES, endpoint=False)
    q[1] = RUIZ[1]["crank"]
    return q


def test_kinematics_of_a_sweep(benchmark, mech: Mechanism) -> None:
    q, bound = sweep(), ("C, scalar libm", c_bounds.kinematics())

    def run() -> bm.Result:
        return mech.run(at=q, want=KINEMATICS, engine="llvm")

    result = measure(benchmark, "T1 1e5 poses, p + v + a, llvm", run, POSES, bound, 1.8)
    assert result["dyad.j.alpha"][1] == pytest.approx(RUIZ[1]["alpha"]["3"], rel=1e-13)


@pytest.mark.parametrize(("friction", "goal"), [("none", 0.6), ("newton", 2.2)])
def test_kinetostatics_of_a_sweep(benchmark, mech: Mechanism, friction: str, goal: float) -> None:
    q, bound = sweep(), ("C, scalar libm", c_bounds.kinetostatics(friction != "none"))

    def run() -> bm.Result:
        return mech.run(at=q, want=FORCES, friction=friction, engine="llvm")

    what = f"T2 1e5 poses, reactions, friction {friction}, llvm"
    result = measure(benchmark, what, run, POSES, bound, goal)
    key = "frictionless_driving_moment" if friction == "none" else "driving_moment"
    assert result["crank.drive"][1] == pytest.approx(RUIZ[1][key], rel=1e-8)


@pytest.mark.parametrize("name", ["stephenson_3_triad", "stephenson_2_class_4"])
def test_general_groups_in_a_sweep(benchmark, name: str) -> None:
    """Newton, rates, accelerations, reactions and margins of a group that is followed."""
    mech = bm.Graph.load(ROOT / "graphs" / f"{name}.json").compile()
    q = np.linspace(0.0, 1.0, POSES // 10)
    benchmark(lambda: mech.run(at=q, engine="llvm"))
    seconds = benchmark.stats.stats.min / q.size
    ROWS.append(Row(f"{name}, a sample, llvm", seconds, 5e-6, "goal of 5 µs", 1.0))


def test_one_warm_pose_with_reactions(benchmark, mech: Mechanism) -> None:
    def run() -> bm.Result:
        return mech.run(at=RUIZ[1]["crank"], want=FORCES, engine="llvm")

    goal = ("goal of 15 µs", 15e-6)
    result = measure(benchmark, "T2 one pose, reactions, labelled, llvm", run, 1, goal, 1.0)
    assert result["crank.drive"][0] == pytest.approx(RUIZ[1]["driving_moment"], rel=1e-8)


@pytest.mark.parametrize(("friction", "goal"), [("none", 0.9), ("newton", 2.5)])
def test_largest_driving_moment_of_designs(
    benchmark, mech: Mechanism, friction: str, goal: float
) -> None:
    plan = mech.plan("crank.drive", friction=friction)
    q = np.linspace(0.0, 2 * np.pi, TURN, endpoint=False)
    taken = make_samples(mech._coordinate_units, mech.scene, q, rates=10.0)
    inputs = taken.given(plan.program.inputs)
    columns = [np.linspace(a, b, DESIGNS)[:, None] for a, b in ((5.6, 6.4), (1.0, 3.0))]
    values = plan.program.values(design(mech, *columns, 5.5, 0.4), mech.scene)
    engines = [kind(plan.program) for kind in (compiled_program, NumpyEngine)]

    def largest(engine: object) -> np.ndarray:
        result = engine.run_designs(inputs, engine.numbers(values))  # type: ignore[attr-defined]
        return np.abs(result[plan.layout["crank.drive"][0]]).max(axis=1)

    result = benchmark(lambda: largest(engines[0]))
    seconds = benchmark.stats.stats.min / (DESIGNS * TURN)
    bound = c_bounds.kinetostatics(friction != "none")
    task = f"T2 largest drive of {DESIGNS} designs, {TURN} poses, friction {friction}, llvm"
    ROWS.append(Row(task, seconds, bound, "C, scalar libm", goal))
    if friction == "none":
        most = 1 / (WANTED * TURN)
        ROWS.append(Row(task, seconds, most, f"goal of {WANTED:,} designs a second", 1.0))
    start = time.process_time()
    reference = largest(engines[1])
    spent = (time.process_time() - start) / (DESIGNS * TURN)
    ROWS.append(Row(task, seconds, spent, "NumPy engine, one block", 0.4))
    np.testing.assert_allclose(result, reference, rtol=1e-10)


SECOND = """
import sys, time
start = time.process_time()
import blockmech as bm
mech = bm.Graph.load(sys.argv[1]).compile()
mech.run(samples=361, want=["*.reaction", "crank.drive"], engine="llvm")
print(time.process_time() - start)
"""


def test_first_result_of_a_process(tmp_path: Path) -> None:
    graph = str(ROOT / "graphs" / "ruiz_fourbar.json")
    seconds = min(float(python(SECOND, graph, byte_code=tmp_path)) for _ in range(5))
    ROWS.append(Row("first result of a process, llvm", seconds, 0.75, "goal of 0.75 s", 1.0))
    assert seconds > 0


@pytest.mark.parametrize(("name", "goal"), [("ruiz_fourbar", 3e-3), ("scissor_lift", 15e-3)])
def test_first_run_of_a_known_structure(name: str, goal: float) -> None:
    """From the file's data: of other masses, and of other lengths, which general groups follow."""
    text = (ROOT / "graphs" / f"{name}.json").read_text("utf-8")
    for changed in ("mass", "at", "l_i"):
        seconds = []
        for k in range(20):
            data = json.loads(text, object_hook=partial(scaled, changed, 1.0 + 1e-7 * k))
            start = time.process_time()
            bm.Graph.from_data(data).compile().run(samples=361, engine="llvm")
            seconds.append(time.process_time() - start)
        what = f"{name}, first run of a known structure, other numbers: {changed}"
        ROWS.append(Row(what, min(seconds[1:]), goal, f"goal of {goal * 1e3:g} ms", 1.0))


def scaled(key: str, factor: float, data: dict[str, object]) -> dict[str, object]:
    """Data of a file with the numbers at a key changed."""
    return {k: times_all(factor, x) if k == key else x for k, x in data.items()}


def times_all(factor: float, x: object) -> object:
    """Numbers in lists, each times a factor."""
    if isinstance(x, list):
        return [times_all(factor, part) for part in x]
    return factor * x if isinstance(x, float) else x
