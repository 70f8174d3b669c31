"""The C bounds: hand-written C for one mechanism, compiled here, as the yardstick of speed.

Speeds are compared as ratios within one run, because machines differ and are shared.
"""

from __future__ import annotations

import functools
import json
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

FOLDER = Path(__file__).parent / "bounds"
ROUNDS = 3


def compiler() -> str | None:
    """The C compiler of this machine, if there is one."""
    return shutil.which("gcc") or shutil.which("cc") or shutil.which("clang")


@functools.cache
def program(name: str) -> tuple[Path, Any]:
    """A bound, compiled once; and the folder that it lives in."""
    result = compiler()
    if result is None:
        pytest.skip("no C compiler, so there is no bound to compare with")
    folder = tempfile.TemporaryDirectory()
    made, source = Path(folder.name) / name, FOLDER / f"{name}.c"
    subprocess.run(
        [result, "-O3", "-march=native", str(source), "-o", str(made), "-lm"], check=True
    )
    return made, folder


def least(name: str, read: Callable[[list[dict[str, Any]]], float]) -> float:
    """The least of some runs of a bound, of its reports: JSON objects, one a line.

    It runs again for every row, so that both sides of a ratio saw the same machine.
    """
    made, _ = program(name)
    runs = [
        subprocess.run([made], check=True, capture_output=True, text=True) for _ in range(ROUNDS)
    ]
    return min(read([json.loads(line) for line in run.stdout.splitlines()]) for run in runs)


def kinematics() -> float:
    """Seconds per pose: four-bar positions, velocities, accelerations of all links."""
    return 1e-9 * least("bound_kinematics", lambda x: float(x[0]["ns_per_config_full_arrays"]))


def kinetostatics(friction: bool) -> float:
    """Seconds per pose: the same and all reactions; friction is stopped at 1e-3 N."""
    return 1e-9 * least("bound_kinetostatics", lambda x: float(x[friction]["ns_per_config"]))


def dynamics(error: float, name: str = "bound_dynamics", method: str = "curve") -> float:
    """Seconds for the Watt six-bar's angle at 2 s to an error, by the best setting.

    name : "bound_squeezer" is Andrews' squeezer at 0.03 s
    method : "curve" of RK4 by its steps, "dop853" by its tolerances
    """

    def read(reports: list[dict[str, Any]]) -> float:
        curve = reports[0][method]
        return min(float(p["seconds"]) for p in curve if float(p["err_theta"]) <= error)

    return least(name, read)
