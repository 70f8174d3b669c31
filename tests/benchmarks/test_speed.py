"""Speed against the C bounds; run with ``python -m pytest tests/benchmarks``.

Timings are reported, never asserted: a busy machine must not fail a test. What is
asserted is that the timed answers are right.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import pytest

import blockmech as bm
from blockmech.mechanism import Mechanism
from blockmech.result.result import Result

from . import c_bounds
from .results import ROWS, Row, python

pytestmark = pytest.mark.benchmark(timer=time.process_time)  # others use the machine, too
ROOT = Path(__file__).parents[2]
RUIZ = json.loads((ROOT / "tests/data/ruiz_fourbar.json").read_text("utf-8"))["rows"]
POSES = 100_000
DESIGNS = 10_000
KINEMATICS = ("*.p", "*.v", "*.a", "*.omega", "*.alpha")
FORCES = ("*.reaction", "crank.drive")


@pytest.fixture(scope="module")
def mech() -> Mechanism:
    return bm.Graph.load(ROOT / "graphs" / "ruiz_fourbar.json").compile()


def measure(
    benchmark: Callable[..., object],
    what: str,
    run: Callable[[], Result],
    per: int,
    yardstick: tuple[str, float],
    goal: float,
) -> Result:
    """Time a run and put its ratio to the yardstick into the report."""
    result = benchmark(run)
    seconds = benchmark.stats.stats.min / per  # type: ignore[attr-defined]
    against, bound = yardstick
    benchmark.extra_info |= {"ratio": seconds / bound, "goal": goal}  # type: ignore[attr-defined]
    ROWS.append(Row(what, seconds, bound, against, goal))
    return result


def test_kinematics_of_a_sweep(benchmark, mech: Mechanism) -> None:
    q = np.linspace(0.0, 2 * np.pi, POSES, endpoint=False)
    q[1] = RUIZ[1]["crank"]
    result = measure(
        benchmark,
        "T1 1e5 poses, p + v + a",
        lambda: mech.run(at=q, want=KINEMATICS),
        POSES,
        ("C, scalar libm", c_bounds.kinematics()),
        6.0,
    )
    assert result["dyad.j.alpha"][1] == pytest.approx(RUIZ[1]["alpha"]["3"], rel=1e-13)


@pytest.mark.parametrize(
    ("friction", "goal"), [("none", 20.0), ("successive", 20.0), ("newton", 20.0)]
)
def test_kinetostatics_of_a_sweep(benchmark, mech: Mechanism, friction: str, goal: float) -> None:
    q = np.linspace(0.0, 2 * np.pi, POSES, endpoint=False)
    q[1] = RUIZ[1]["crank"]
    result = measure(
        benchmark,
        f"T2 1e5 poses, reactions, friction {friction}",
        lambda: mech.run(at=q, want=FORCES, friction=friction),
        POSES,
        ("C, scalar libm", c_bounds.kinetostatics(friction != "none")),
        goal,
    )
    key = "frictionless_driving_moment" if friction == "none" else "driving_moment"
    assert result["crank.drive"][1] == pytest.approx(RUIZ[1][key], rel=1e-8)


def test_one_warm_pose(benchmark, mech: Mechanism) -> None:
    result = measure(
        benchmark,
        "T1 one pose, p + v + a, labelled",
        lambda: mech.run(at=1.0, want=KINEMATICS),
        1,
        ("goal of 30 µs", 30e-6),
        1.0,
    )
    assert result["dyad.i.omega"][0] == pytest.approx(RUIZ[1]["omega"]["2"], rel=1e-13)


def test_import(benchmark, tmp_path: Path) -> None:
    def seconds(modules: str) -> float:
        clock = "time.process_time()"
        code = f"import time; t = {clock}; import {modules}; print({clock} - t)"
        return float(python(code, byte_code=tmp_path))

    ours = benchmark.pedantic(lambda: seconds("blockmech"), rounds=1)
    pairs = [(seconds("blockmech"), seconds("numpy, networkx, pydantic")) for _ in range(5)]
    own, core = (median(times) for times in zip(*pairs, strict=True))
    limit = max(0.3, 1.5 * core)
    ROWS.append(Row("import blockmech", own, limit, "0.3 s or 1.5 x its core", 1.0))
    ROWS.append(Row("import blockmech", own, core, "numpy, networkx, pydantic"))
    assert ours > 0
    assert (
        python("import sys, blockmech; print('networkx' in sys.modules)", byte_code=tmp_path)
        == "False\n"
    )


def test_an_accuracy_against_the_method_that_it_chooses() -> None:
    """A request that comes again, on every graph whose drivers have laws of motion."""
    worst = (0.0, "", 0.0, 0.0)
    for path in sorted((ROOT / "graphs").glob("*.json")):
        mech = bm.Graph.load(path).compile()
        if not set(mech.drivers) <= set(mech.scene.drive):
            continue
        result = mech.run(accuracy=1e-6, on_gap="mark").accuracy
        assert result is not None
        k, name = result.iterations, result.friction
        setting: dict[str, Any] = {
            "friction": name if k is None else bm.friction.Successive(iterations=k)
        }
        calls = [{"accuracy": 1e-6}, setting | {"precision": result.precision, "engine": "auto"}]
        times: list[list[float]] = [[], []]
        for _ in range(100):  # machine code, where it pays, is made before the least one
            for how, spent in zip(calls, times, strict=True):
                start = time.process_time()
                mech.run(on_gap="mark", **how)
                spent.append(time.process_time() - start)
        mine, its = map(min, times)
        worst = max(worst, (mine / its, path.stem, mine, its))
    what = f"a run of 361 samples to an accuracy, the worst of all graphs: {worst[1]}"
    ROWS.append(Row(what, worst[2], worst[3], "the method that it chooses", 1.2))
    assert worst[1]


def test_extremes_of_a_study_against_its_poses_alone(mech: Mechanism) -> None:
    """Designs by machine code: what extremes between the poses cost."""
    rng = np.random.default_rng(3)
    vary = {"dyad.l_i": rng.uniform(5.8, 6.2, DESIGNS), "dyad.l_j": rng.uniform(5.9, 6.3, DESIGNS)}
    settings: dict[str, Any] = {"sampling": "paired", "friction": "newton", "engine": "llvm"}
    wants = ("max_abs(crank.drive)", "rms(crank.drive)")
    times: tuple[list[float], list[float]] = ([], [])
    for _ in range(15):
        for want, spent in zip(wants, times, strict=True):
            start = time.process_time()
            study = mech.study(vary, want=want, samples=72, **settings)
            spent.append(time.process_time() - start)
            assert set(study.status) == {"ok"}
    refined, plain = (min(spent) for spent in times)
    what = f"a study of {DESIGNS:,} designs, 72 poses with friction, extremes between them"
    ROWS.append(Row(what, refined, plain, "the same, over the poses alone", 1 / 0.8))
    few = {address: x[:20] for address, x in vary.items()}
    coarse, fine = (mech.study(few, want=wants[0], samples=n, **settings) for n in (72, 1441))
    np.testing.assert_allclose(coarse[wants[0]], fine[wants[0]], rtol=1e-9)
