"""Sweeps and designs against pylinkage, motions against Pinocchio, MuJoCo and Exudyn.

Each where it is installed (the extras ``judges`` and ``peers``). pylinkage has no forward dynamics.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import blockmech as bm
from blockmech.engines.interpreters import NumpyEngine
from blockmech.engines.llvm import compiled_program
from blockmech.studies.family import Family

from . import peers
from .results import NOTES, ROWS, Row
from .test_dynamics import BETA, START, WATT

pytestmark = pytest.mark.benchmark(timer=time.process_time)  # others use the machine, too
ROOT = Path(__file__).parents[2]
POSES = 100_000
KINEMATICS = ("*.p", "*.v", "*.a", "*.omega", "*.alpha")


DESIGNS, TURN = 2000, 72
NUMPY_BLOCK = 113  # designs whose samples stay in cache


def pylinkage_fourbar(step: float) -> Any:
    """The Ruiz four-bar in pylinkage, turned by steps of an angle [rad]."""
    pytest.importorskip("pylinkage", reason="pylinkage, the peer, is not installed")
    pytest.importorskip("numba", reason="pylinkage is fast with numba only")
    from pylinkage.actuators import Crank
    from pylinkage.components import Ground
    from pylinkage.dyads import RRRDyad
    from pylinkage.simulation import Linkage

    a, d = Ground(0.0, 0.0, name="A"), Ground(5.5, 0.0, name="D")
    crank = Crank(anchor=a, radius=2.0, angular_velocity=step, name="crank")
    dyad = RRRDyad(anchor1=crank.output, anchor2=d, distance1=6.0, distance2=3.0, name="C")
    linkage = Linkage([a, d, crank, dyad], name="ruiz")
    linkage.set_input_velocity(crank, omega=10.0)
    return linkage


def pylinkage_sweep() -> Callable[[], np.ndarray]:
    """A call sweeps one turn, positions to accelerations."""
    linkage = pylinkage_fourbar(2 * np.pi / POSES)
    linkage.compile()
    return lambda: linkage.step_fast_with_kinematics(iterations=POSES, dt=1.0)[0][:, 3]


def test_a_sweep_against_pylinkage(benchmark: Callable[..., object]) -> None:
    theirs = pylinkage_sweep()
    theirs()  # numba compiles
    times = []
    for _ in range(7):
        start = time.process_time()
        path = theirs()
        times.append(time.process_time() - start)
    mech = bm.Graph.load(ROOT / "graphs" / "ruiz_fourbar.json").compile()
    q = 2 * np.pi / POSES * np.arange(1, POSES + 1)
    result = benchmark(lambda: mech.run(at=q, want=KINEMATICS))
    seconds = benchmark.stats.stats.min  # type: ignore[attr-defined]
    exact = mech.run(at=q, want="dyad.C.p", precision="clongdouble", engine="numpy")["dyad.C.p"]
    ours = float(np.abs(result["dyad.C.p"] - exact).max())
    # Each of their runs goes on where the last one stopped, a turn on.
    off = float(np.abs(path[:, 0] + 1j * path[:, 1] - exact).max())
    row = ("T1 1e5 poses, p + v + a", seconds / POSES, min(times) / POSES, "pylinkage, numba")
    ROWS.append(Row(*row, 1.0, ours))
    NOTES.append(
        f"pylinkage: largest error of C over 1e5 poses {off:.1e} m, blockmech {ours:.1e} m; "
        f"pylinkage gives {path.shape[-1]} coordinates of 4 points, blockmech "
        f"{len(result)} outputs"
    )
    assert ours < 1e-13


def least_time(call: Callable[[], object], runs: int = 7) -> float:
    """Processor time of a warm call [s]."""
    call()
    times = []
    for _ in range(runs):
        start = time.process_time()
        call()
        times.append(time.process_time() - start)
    return min(times)


def test_designs_against_an_ensemble_of_pylinkage() -> None:
    """Positions at 72 poses: what of all ways they have and we have is the fastest."""
    step = 2 * np.pi / TURN
    linkage = pylinkage_fourbar(step)
    from pylinkage.population import Ensemble

    l_i = np.linspace(5.8, 6.2, DESIGNS)
    sizes = np.stack([np.full(DESIGNS, 2.0), l_i, np.full(DESIGNS, 3.0)], axis=1)
    start = Ensemble(linkage, sizes[:1], np.zeros((1, 4, 2))).template.positions
    members = Ensemble(linkage, sizes, np.tile(start, (DESIGNS, 1, 1)))
    theirs = least_time(lambda: members.simulate(TURN, store=False)) / DESIGNS
    path = members.simulate(TURN, store=False)[:, :, 3]

    mech = bm.Graph.load(ROOT / "graphs" / "ruiz_fourbar.json").compile()
    q = step * np.arange(1, TURN + 1)
    exact = mech.study({"dyad.l_i": l_i}, at={"crank": q}, want="poses(dyad.C.p)")
    ours = exact["poses(dyad.C.p)"]
    assert np.abs(path[..., 0] + 1j * path[..., 1] - ours).max() < 1e-12
    family = Family(mech, ["dyad.l_i"])
    plan = family.general.plan("dyad.C.p")
    inputs = mech.samples(q, None, None, None, None).given(plan.program.inputs)
    yardstick = "pylinkage's ensemble, numba"
    for kind, most, goal in ((NumpyEngine, NUMPY_BLOCK, 1 / 3), (compiled_program, DESIGNS, 1 / 6)):
        engine: Any = kind(plan.program)
        column = {family.parameters[0]: l_i[:most, None]}
        values = plan.program.values(*family.design(column))
        spent = least_time(lambda e=engine, v=values: e.run_designs(inputs, e.numbers(v))) / most  # type: ignore[misc]
        task = f"a design, positions at {TURN} poses, {engine.name}"
        ROWS.append(Row(task, spent, theirs, yardstick, goal))
    many = {"dyad.l_i": np.linspace(5.8, 6.2, 50 * DESIGNS)}
    study = lambda: mech.study(many, at={"crank": q}, want="max(dyad.C.p.x)")  # noqa: E731
    spent = least_time(study, 3) / (50 * DESIGNS)
    ROWS.append(Row("the same by `study`, its largest x kept", spent, theirs, yardstick))


MOTIONS = {
    "T3 Watt six-bar": ("watt_sixbar", START, 2.0, WATT["theta_at_2s"]),
    "T4 Andrews' squeezer": ("andrews_squeezer", {}, 0.03, BETA),
}
TARGETS = (1e-3, 1e-6, 1e-8, 1e-9)  # [rad]
TOLERANCES = [10.0**-k for k in range(2, 13)]
STEPS = [125 * 2**k for k in range(13)]  # of a motion


def ours(mech: Any, end: float, right: float, **request: Any) -> list[tuple[float, float, str]]:
    """Errors of settings [rad], the least processor times [s] of whole calls, and their names."""
    points = []
    for method, engine in (("auto", "auto"), ("dop853", "llvm")):
        for target in TARGETS:
            how = {"method": method, "engine": engine, "accuracy": target, **request}
            call = lambda h=how: mech.simulate(f"time={end}", **h)  # noqa: E731
            result = call()
            error = abs(float(result["crank.q"][-1]) - right)
            points.append((error, least_time(call), result.motion.method))
    return points


@pytest.mark.parametrize("task", MOTIONS)
@pytest.mark.parametrize("name", ["pinocchio", "mujoco", "exudyn"])
def test_a_motion_against_a_peer(name: str, task: str, tmp_path: Path) -> None:
    """To the same accuracy: of either the quickest setting whose measured error is within it.

    Of ours the time of the whole call, of the peers that of the integration alone.
    """
    graph, start, end, angle = MOTIONS[task]
    path = ROOT / "graphs" / f"{graph}.json"
    mech = bm.Graph.load(path).compile()
    at = start["crank"][0] if start else mech.scene.initial["crank"].q
    answer = getattr(peers, name)(peers.machine(path, tmp_path, at, end, angle))
    by_tolerance = name == "pinocchio"
    settings = TOLERANCES if by_tolerance else [end / n for n in STEPS]
    points = peers.curve(answer, settings, angle)
    assert min(points)[0] < 1e-6  # it is the same machine
    request: dict[str, Any] = {"times": [end], "start": {"crank": (at, 0.0)}, "want": ["crank.q"]}
    own = ours(mech, end, angle, **request)
    against = f"{name}, DOP853 of SciPy" if by_tolerance else name
    # The last row is as near as the peer comes; ours is nearer in each.
    for target in sorted({*(t for t in TARGETS if t > min(points)[0]), min(points)[0]})[::-1]:
        seconds, error = min((s, e) for e, s in points if e <= target)
        mine, off, method = min((s, e, m) for e, s, m in own if e <= target)
        row = f"{task} within {target:.2g} rad, {method}", mine, seconds
        ROWS.append(Row(*row, f"{against}, off {error:.1e}", 1.0, off))
