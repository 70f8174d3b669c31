"""What a sheet is exported as: every kind is the file that Python writes."""

import io
import zipfile
from pathlib import Path

import pytest

import blockmech as bm
from blockmech.builders import opened
from blockmech.cli import main
from blockmech.editor.exports import exported, formats
from blockmech.editor.revision import Question, Revision
from blockmech.ground.errors import BlockmechError

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


def asked(name):
    document = opened(GRAPHS / "joints" / name)
    now = Revision(1, document.to_data(), document)
    (driver, *_) = now.mechanism.drivers
    return Question(now, {"names": [f"driver.{driver}.drive"]})


@pytest.fixture(scope="module")
def shown():
    return asked("slider_crank.json")


@pytest.mark.parametrize("kind", HEADS)
def test_every_kind_is_a_file(shown, kind):
    assert kind in {kind for group in formats().values() for kind in group}
    massive = asked("engine.json") if kind == "fmu" else shown  # loads move what has mass
    name, data = exported(kind, massive)
    assert data.startswith(HEADS[kind])
    if kind == "c":
        files = zipfile.ZipFile(io.BytesIO(data)).namelist()
        assert name == "slider_crank-c.zip"
        assert "slider_crank.c" in files


def test_nothing_is_exported_of_what_does_not_move():
    document = bm.Linkage("empty")
    with pytest.raises(BlockmechError, match="there is no moving link"):
        exported("numbers .csv", Question(Revision(1, document.to_data(), document), {}))


def test_the_numbers_are_those_of_the_command_line(tmp_path):
    path = tmp_path / "run.csv"
    expected = ["--want", "driver.motor.drive", "--csv", str(path)]
    assert main(["run", str(GRAPHS / "joints" / "ruiz_fourbar.json"), *expected]) == 0
    assert exported("numbers .csv", asked("ruiz_fourbar.json"))[1] == path.read_bytes()
