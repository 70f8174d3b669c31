"""The C bounds: hand-written C for one mechanism, compiled here, as the yardstick of speed.

Speeds are compared as ratios within one run, because machines differ and are shared.
"""

from __future__ import annotations

import functools
import json
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import pytest

FOLDER = Path(__file__).parent / "bounds"


def compiler() -> str | None:
    """The C compiler of this machine, if there is one."""
    return shutil.which("gcc") or shutil.which("cc") or shutil.which("clang")


@functools.cache
def run(name: str) -> list[dict[str, Any]]:
    """Compile and run a bound; its report, a JSON object a line."""
    found = compiler()
    if found is None:
        pytest.skip("no C compiler, so there is no bound to compare with")
    with tempfile.TemporaryDirectory() as folder:
        program = Path(folder) / name
        source = FOLDER / f"{name}.c"
        subprocess.run(
            [found, "-O3", "-march=native", str(source), "-o", str(program), "-lm"], check=True
        )
        text = subprocess.run([program], check=True, capture_output=True, text=True).stdout
    return [json.loads(line) for line in text.splitlines()]


def kinematics() -> float:
    """Seconds per pose: four-bar positions, velocities, accelerations of all links."""
    return 1e-9 * float(run("bound_kinematics")[0]["ns_per_config_full_arrays"])


def kinetostatics(friction: bool) -> float:
    """Seconds per pose: the same and all reactions; friction is stopped at 1e-3 N."""
    return 1e-9 * float(run("bound_kinetostatics")[int(friction)]["ns_per_config"])


def dynamics(error: float) -> float:
    """Seconds for the Watt six-bar's angle at 2 s to an error, by the best setting."""
    curve = run("bound_dynamics")[0]["curve"]
    return min(float(p["seconds"]) for p in curve if float(p["err_theta"]) <= error)
