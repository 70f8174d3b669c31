"""An installed package adds a block and a friction law through the entry point alone."""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import pytest

MODULE = '''
"""A driving link with a rim, and a friction law: all of an outside package."""
from typing import Literal

from blockmech.blocks import crank
from blockmech.blocks.contract import BuiltIn, DrivingLink, Kernels, outer_joint
from blockmech.friction.laws import FrictionLaw, FrictionTerms
from blockmech.ground.values import Angle, Length, NotNegative


def fan(speed, p):
    return FrictionTerms(0.0 * speed, p.size * speed * speed)


class Fan(FrictionLaw):
    """A fan on the shaft: a drag by the square of the speed."""

    law: Literal["demo_fan"] = "demo_fan"
    size: NotNegative

    def kernel(self):
        return fan


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
        "wheel": {
            "type": "demo.wheel",
            "radius": 0.5,
            "friction": {"A": {"law": "demo_fan", "size": 0.25}},
            "links": {"crank": {"mass": 1.0, "inertia": 0.5}},
        },
    },
    "wires": [{"from": "frame.A", "to": "wheel.A"}],
    "scene": {"drive": {"wheel": {"law": "constant_rate", "rate": 2.0}}},
}


@pytest.fixture
def installed(tmp_path: Path) -> Path:
    """A folder with the tiny package installed by pip from a wheel made here."""
    wheel = tmp_path / "demo_wheel-1.0-py3-none-any.whl"
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
    target = tmp_path / "site"
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-index", "--no-deps"]
    quiet = ["--disable-pip-version-check", "--target", str(target), str(wheel)]
    subprocess.run([*pip, *quiet], check=True, capture_output=True)
    return target


ASKED = """
import contextlib, io, json, sys
from blockmech.cli import main
from blockmech.testing import conformance

def said(*words):
    with contextlib.redirect_stdout(io.StringIO()) as out:
        assert main(words) == 0, words
    return out.getvalue()

run = said("run", sys.argv[1], "--at", "0", "--want", "wheel.R.v", "--json")
assert json.loads(run)["outputs"]["wheel.R.v"]["values"] == [[0.0, 1.0]]
assert "demo.wheel" in said("blocks")
assert '"demo.wheel"' in said("schema", "graph")
conformance("demo.wheel", {"radius": 0.5})
drive = said("run", sys.argv[1], "--at", "0", "--want", "wheel.drive", "--json")
assert json.loads(drive)["outputs"]["wheel.drive"]["values"] == [1.0]  # 0.25 * 2^2
request = ["--until", "time=1", "--start", "0,4", "--want", "wheel.rate", "--json"]
slowed = said("simulate", sys.argv[1], *request)
rate = json.loads(slowed)["outputs"]["wheel.rate"]["values"][-1]
assert abs(rate - 4.0 / (1.0 + 4.0 * 0.5)) < 1e-9  # 1/w grows by size / J in a second
assert "demo_fan" in said("schema", "graph")
conformance("demo_fan", {"size": 0.25})
if "studio" in sys.argv:
    from blockmech.editor.diagram import kinds
    assert ("demo.wheel", "driver", "wheel") in [kind[:3] for kind in kinds()]
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A file with a block of the outside type."""
    path = tmp_path / "wheel.json"
    path.write_text(json.dumps(GRAPH), "utf-8")
    return path


def test_the_outside_block_runs_is_listed_and_in_the_schema_and_keeps_the_contract(
    installed: Path, file: Path
) -> None:
    has_studio = importlib.util.find_spec("starlette") is not None
    result = subprocess.run(
        [sys.executable, "-c", ASKED, file, *["studio"] * has_studio],
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(installed), *sys.path])},
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stderr


def test_without_the_package_the_type_is_unknown(call: Any, file: Path) -> None:
    outcome = call("run", file)
    assert outcome.code == 2
    assert 'no block type "demo.wheel"' in outcome.err
    assert "demo_fan" not in outcome.err  # of a block that nobody knows nothing else is said
