"""What a sheet is exported as: every kind is the file that Python writes."""

import io
import zipfile
from pathlib import Path

import pytest

from blockmech.builders import from_data, opened
from blockmech.ground.errors import BlockmechError
from blockmech.studio.answers import Answers
from blockmech.studio.exports import exported, kinds
from blockmech.studio.mechanism import MechanismView
from blockmech.studio.sheet import Sheet
from tests.studio.page import choose, press, show, told

GRAPHS = Path(__file__).parents[2] / "graphs"
HEADS = {
    "document .json": b'{\n  "format"',
    "diagram .svg": b"<?xml",
    "diagram .png": b"\x89PNG",
    "pose .pdf": b"%PDF",
    "motion .html": b"<!DOCTYPE html>",
    "motion .gif": b"GIF89a",
    "motion .mp4": b"\0\0\0 ftypisom",
    "numbers .csv": b"driver.motor.q",
    "numbers .xlsx": b"PK",
    "numbers .npz": b"PK",
    "numbers .json": b"{",
    "outlines .dxf": b"0",
    "outlines .svg": b"<",
    "c": b"PK",
    "fmu": b"PK",
    "page": b"<!",
    "report": b"<!DOCTYPE html>",
}


def sheet_of(name):
    sheet = Sheet(opened(GRAPHS / "joints" / name))
    view = MechanismView(sheet)
    return sheet, view, Answers(sheet, view)


@pytest.fixture(scope="module")
def shown():
    return sheet_of("slider_crank.json")


@pytest.mark.parametrize("kind", HEADS)
def test_every_kind_is_a_file(shown, kind):
    assert kind in {kind for group in kinds().values() for kind in group}
    massive = sheet_of("engine.json") if kind == "fmu" else shown  # loads move what has mass
    name, data = exported(kind, *massive)
    assert data.startswith(HEADS[kind])
    if kind == "c":
        files = zipfile.ZipFile(io.BytesIO(data)).namelist()
        assert name == "slider_crank-c.zip"
        assert "slider_crank.c" in files


def test_what_cannot_be_exported_says_why(shown):
    with pytest.raises(BlockmechError, match="--to mjcf"):
        exported("mjcf", *shown)
    sheet = Sheet()
    view = MechanismView(sheet)
    with pytest.raises(BlockmechError, match="nothing moves"):
        exported("pose .svg", sheet, view, Answers(sheet, view))


def test_a_name_leads_out_of_no_folder(shown):
    sheet, view, answers = shown
    other = Sheet(from_data({**sheet.form, "name": "../../up"}, None))
    assert exported("numbers .csv", other, view, answers)[0] == "_up.csv"


def test_the_browser_saves_what_is_exported(page, studio):
    show(page, studio, "?example=slider_crank")
    for kind, name in (
        ("outlines .dxf", "slider_crank.dxf"),
        ("numbers .xlsx", "slider_crank.xlsx"),
    ):
        choose(page, "Export as", kind)
        with page.expect_download() as saved:
            press(page, "Export")
            told(page, f"exported {kind}")  # what fails before is no fault of the download
        assert saved.value.suggested_filename == name
