"""The notebooks of `examples` run, and show what they are stored with."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from docs.notebooks import cells_of_code, execute

ROOT = Path(__file__).parents[1]
NOTEBOOKS = sorted((ROOT / "examples").glob("*.ipynb"))
NUMBER = re.compile(r"(?<![\w.#])-?\d+(?:\.\d+)?(?:e-?\d+)?(?![\w.])")
DIGITS, ROUNDING = 1e-5, 1e-9  # of what a table prints; what is nothing but rounding


def test_there_are_two_notebooks():
    assert [path.stem for path in NOTEBOOKS] == ["designer", "teacher"]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_shows_what_it_is_stored_with(path, monkeypatch):
    monkeypatch.chdir(ROOT)
    notebook = json.loads(path.read_text("utf-8"))
    cells, fresh = cells_of_code(notebook), execute(notebook)
    assert len(cells) == len(fresh) >= 6
    for number, (cell, outputs) in enumerate(zip(cells, fresh, strict=True), 1):
        assert cell["execution_count"] == number
        assert len(cell["outputs"]) == len(outputs)
        for stored, shown in zip(cell["outputs"], outputs, strict=True):
            assert stored["output_type"] == shown["output_type"]
            same(*(text_of(output) for output in (stored, shown)))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_has_a_table_and_a_picture(path):
    shown = "".join(
        "".join(lines)
        for cell in cells_of_code(json.loads(path.read_text("utf-8")))
        for output in cell["outputs"]
        for lines in output.get("data", {}).values()
    )
    assert "<table" in shown
    assert "<svg" in shown


def text_of(output):
    """What an output says: its text, or its HTML without pictures."""
    data = output.get("data", {})
    text = "".join(output.get("text") or data.get("text/html") or data["text/plain"])
    return re.sub(r"<svg.*?</svg>", "", text, flags=re.DOTALL)


def same(stored, shown):
    """The same words, and numbers that agree to the digits printed."""
    assert NUMBER.sub("#", stored) == NUMBER.sub("#", shown)
    for a, b in zip(NUMBER.findall(stored), NUMBER.findall(shown), strict=True):
        assert float(a) == pytest.approx(float(b), rel=DIGITS, abs=ROUNDING)
