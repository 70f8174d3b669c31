"""T1 against pylinkage, the fastest peer, where it is installed."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from statistics import median

import numpy as np
import pytest

import blockmech as bm

from .results import NOTES, ROWS, Row

pytestmark = pytest.mark.benchmark(timer=time.process_time)  # others use the machine, too
ROOT = Path(__file__).parents[2]
POSES = 100_000
KINEMATICS = ("*.p", "*.v", "*.a", "*.omega", "*.alpha")


def pylinkage_sweep() -> Callable[[], np.ndarray]:
    """The Ruiz four-bar in pylinkage; a call sweeps one turn, positions to accelerations."""
    pytest.importorskip("pylinkage")
    pytest.importorskip("numba")
    from pylinkage.actuators import Crank
    from pylinkage.components import Ground
    from pylinkage.dyads import RRRDyad
    from pylinkage.simulation import Linkage

    step = 2 * np.pi / POSES
    a, d = Ground(0.0, 0.0, name="A"), Ground(5.5, 0.0, name="D")
    crank = Crank(anchor=a, radius=2.0, angular_velocity=step, name="crank")
    dyad = RRRDyad(anchor1=crank.output, anchor2=d, distance1=6.0, distance2=3.0, name="C")
    linkage = Linkage([a, d, crank, dyad], name="ruiz")
    linkage.set_input_velocity(crank, omega=10.0)
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
    seconds = benchmark.stats.stats.median  # type: ignore[attr-defined]
    exact = mech.run(at=q, want="dyad.C.p", precision="clongdouble", engine="numpy")["dyad.C.p"]
    ours = float(np.abs(result["dyad.C.p"] - exact).max())
    # Each of their runs goes on where the last one stopped, a turn on.
    off = float(np.abs(path[:, 0] + 1j * path[:, 1] - exact).max())
    row = ("T1 1e5 poses, p + v + a", seconds / POSES, median(times) / POSES, "pylinkage, numba")
    ROWS.append(Row(*row, 1.0, ours))
    NOTES.append(
        f"pylinkage: largest error of C over 1e5 poses {off:.1e} m, blockmech {ours:.1e} m; "
        f"pylinkage gives {path.shape[-1]} coordinates of 4 points, blockmech "
        f"{len(result)} outputs"
    )
    assert ours < 1e-13
