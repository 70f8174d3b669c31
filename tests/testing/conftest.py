"""Mechanisms whose numbers are known without blockmech."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

import blockmech as bm
from examples.wire_ruiz import fourbar
from tests import machines
from tests.analysis.linkages import short_fourbar

REFERENCE = Path(__file__).parents[1] / "data" / "ruiz_fourbar.json"

MET = {"source": "by hand", "at": {"crank": [0.0]}, "want": {"crank.B.p": [[2.0, 0.0]]}, "atol": 0}
MISSED = {
    "source": "a slip",
    "at": {"crank": [0.0, 1.0]},
    "want": {"crank.q": [0.0, 1.5], "crank.rate": [3.0, 3.0]},
    "atol": 1e-3,
}


@pytest.fixture
def home(tmp_path: Path) -> Path:
    """The folder in which files stand."""
    return tmp_path


@pytest.fixture
def file(arm: bm.Graph, home: Path) -> Any:
    """``file(name, *entries)``: a file of the crank with these expectations."""

    def writing(name: str, *entries: Any) -> Path:
        path = home / name
        path.parent.mkdir(parents=True, exist_ok=True)
        arm.extras["expect"] = list(entries)
        arm.save(path)
        return path

    return writing


@pytest.fixture
def arm() -> bm.Graph:
    """A crank of 2 m at 3 rad/s: its end B is at 2 (cos q, sin q), at 6 m/s across."""
    g = machines.crank(2.0)
    g.name = "arm"
    g.drive("crank", bm.motion.ConstantRate(rate=3.0))
    return g


@pytest.fixture
def ruiz() -> bm.Graph:
    """The paper's four-bar."""
    return fourbar()


@pytest.fixture
def short() -> bm.Graph:
    """A four-bar that cannot turn fully."""
    return short_fourbar()


@pytest.fixture(scope="session")
def rows() -> list[dict[str, Any]]:
    """The four-bar at crank 0, 1, ..., 6 rad by an independent multibody solution."""
    found: list[dict[str, Any]] = json.loads(REFERENCE.read_text(encoding="utf-8"))["rows"]
    return found
