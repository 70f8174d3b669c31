"""An installed package adds a block through the entry point, without touching the core."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

MODULE = '''
"""A driving link with a rim: all of an outside package."""
from blockmech.blocks import crank
from blockmech.blocks.contract import BuiltIn, DrivingLink, Kernels, outer_joint
from blockmech.values import Angle, Length


class Wheel(DrivingLink, type="demo.wheel"):
    """Wheel on a joint A, with a marker R on its rim."""

    kind = "wheel"
    link_names = ("crank",)
    A = outer_joint("R", "crank", reads="guide", driven=True)
    built_in = {"A": BuiltIn("crank"), "R": BuiltIn("crank", "radius")}
    lengths = ("radius",)
    kernels = Kernels(crank.position, crank.velocity, crank.acceleration, crank.reactions)

    radius: Length
    offset: Angle = 0.0
'''

GRAPH = {
    "format": "blockmech/graph",
    "version": 1,
    "name": "wheel",
    "blocks": {
        "frame": {"type": "frame", "markers": {"A": {"at": [0.0, 0.0]}}},
        "wheel": {"type": "demo.wheel", "radius": 0.5},
    },
    "wires": [{"from": "frame.A", "to": "wheel.A"}],
    "scene": {"drive": {"wheel": {"law": "constant_rate", "rate": 2.0}}},
}


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the tiny package installed by pip from a wheel made here."""
    folder = tmp_path_factory.mktemp("outside")
    wheel = folder / "demo_wheel-1.0-py3-none-any.whl"
    info = "demo_wheel-1.0.dist-info"
    with zipfile.ZipFile(wheel, "w") as archive:
        archive.writestr("demo_wheel.py", MODULE)
        archive.writestr(
            f"{info}/METADATA", "Metadata-Version: 2.1\nName: demo-wheel\nVersion: 1.0\n"
        )
        archive.writestr(
            f"{info}/WHEEL",
            "Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
        )
        archive.writestr(f"{info}/entry_points.txt", "[blockmech.blocks]\nwheel = demo_wheel\n")
        archive.writestr(f"{info}/RECORD", "")
    target = folder / "site"
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-index", "--no-deps"]
    quiet = ["--disable-pip-version-check", "--target", str(target), str(wheel)]
    subprocess.run([*pip, *quiet], check=True, capture_output=True)
    return target


def command(installed: Path, *words: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(installed)}
    return subprocess.run(
        [sys.executable, "-m", "blockmech", *words],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )


def test_the_outside_block_runs_from_a_file(installed: Path, tmp_path: Path) -> None:
    file = tmp_path / "wheel.json"
    file.write_text(json.dumps(GRAPH), "utf-8")
    done = command(installed, "run", str(file), "--at", "0", "--want", "wheel.R.v", "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["outputs"]["wheel.R.v"]["values"] == [[0.0, 1.0]]


def test_the_outside_block_is_listed_and_in_the_schema(installed: Path) -> None:
    assert "demo.wheel" in command(installed, "blocks").stdout
    assert '"demo.wheel"' in command(installed, "schema", "graph").stdout


def test_without_the_package_the_type_is_unknown(tmp_path: Path) -> None:
    file = tmp_path / "wheel.json"
    file.write_text(json.dumps(GRAPH), "utf-8")
    done = command(tmp_path, "run", str(file))
    assert done.returncode == 2
    assert 'no block type "demo.wheel"' in done.stderr


def test_the_outside_block_keeps_the_contract(installed: Path) -> None:
    code = "from blockmech.testing import conformance; conformance('demo.wheel', {'radius': 0.5})"
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONPATH": str(installed)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr


def test_the_outside_block_is_on_the_studios_palette(installed: Path) -> None:
    pytest.importorskip("panel_reactflow", reason="the extra studio is not installed")
    code = "from blockmech.studio.diagram import kinds; print([kind[:3] for kind in kinds()])"
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONPATH": str(installed)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert "('demo.wheel', 'driver', 'wheel')" in done.stdout, done.stderr
