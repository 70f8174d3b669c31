"""Files for the command line."""

from __future__ import annotations

from pathlib import Path

import pytest

import blockmech as bm
from examples.wire_ruiz import fourbar
from tests.analysis import linkages


@pytest.fixture
def ruiz(tmp_path: Path) -> Path:
    """A file of the paper's four-bar."""
    path = tmp_path / "ruiz.json"
    fourbar().save(path)
    return path


@pytest.fixture
def short(tmp_path: Path) -> Path:
    """A file of a four-bar whose dyad is too short for half of the turn."""
    path = tmp_path / "short.json"
    linkages.short_fourbar().save(path)
    return path


@pytest.fixture
def fivebar(tmp_path: Path) -> Path:
    """A file of a mechanism with two drivers, without a law of motion."""
    path = tmp_path / "fivebar.json"
    linkages.fivebar().save(path)
    return path


@pytest.fixture
def slide(tmp_path: Path) -> Path:
    """A file of a slider alone, driven along the frame's x axis."""
    g = bm.Graph("slide", drive={"table": bm.motion.ConstantRate(rate=1.0)})
    g.add("frame", bm.Frame(markers={"S": bm.Marker(at=(0.0, 0.0), angle=0.0)}))
    g.add("table", bm.SlideDrive(links={"slider": bm.Link(mass=2.0)}))
    g.connect("frame.S", "table.S")
    path = tmp_path / "slide.json"
    g.save(path)
    return path
