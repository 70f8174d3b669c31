"""The sheet: a document, its problems, and what was done to it."""

from pathlib import Path

import pytest

import blockmech as bm
from blockmech.builders import opened
from blockmech.editor.sheets import Sheet

GRAPHS = Path(__file__).parents[2] / "graphs"


def fourbar():
    return opened(GRAPHS / "ruiz_fourbar.json")


def longer(sheet, length, label="crank.length"):
    crank = {**sheet.form["blocks"]["crank"], "length": length}
    form = {**sheet.form, "blocks": {**sheet.form["blocks"], "crank": crank}}
    sheet.change(form, label)


def test_an_empty_sheet_lacks_a_frame_and_is_saved():
    sheet = Sheet()
    assert [p.code for p in sheet.now.problems] == ["no-frame"]
    assert (sheet.now.mechanism, sheet.saved) == (None, True)
    assert sheet.now.empty  # the page says a first step in place of what is missing


@pytest.mark.parametrize("name", ["ruiz_fourbar", "joints/slider_crank"])
def test_a_sheet_holds_what_the_file_holds(name):
    document = opened(GRAPHS / f"{name}.json")
    sheet = Sheet(document)
    assert sheet.text() == document.to_json()
    assert (sheet.now.problems, sheet.saved) == ((), True)
    assert sheet.now.mechanism.name == document.name


def test_a_change_is_one_revision_and_one_step_back():
    sheet = Sheet(fourbar())
    before, first = sheet.text(), sheet.now.number
    longer(sheet, 2.1)
    assert sheet.now.number == first + 1
    assert (sheet.undoable, sheet.saved) == ("crank.length", False)
    after = sheet.text()
    sheet.undo()
    assert (sheet.text(), sheet.saved, sheet.redoable) == (before, True, "crank.length")
    sheet.redo()
    assert sheet.text() == after


def test_an_equal_form_is_no_step():
    sheet = Sheet(fourbar())
    longer(sheet, 2)
    assert (sheet.undoable, sheet.saved) == ("", True)


def test_a_change_forgets_what_was_undone():
    sheet = Sheet(fourbar())
    longer(sheet, 2.1)
    sheet.undo()
    longer(sheet, 2.2)
    sheet.redo()
    assert sheet.form["blocks"]["crank"]["length"] == 2.2


def test_what_could_not_be_read_again_is_refused_as_a_whole():
    sheet = Sheet(fourbar())
    before = sheet.form
    with pytest.raises(bm.FormatError, match="length must be > 0 m, got -2"):
        longer(sheet, -2)
    assert sheet.form is before
    assert sheet.undoable == ""


def test_what_a_mechanism_lacks_is_a_problem_and_no_refusal():
    sheet = Sheet(fourbar())
    sheet.change({**sheet.form, "wires": sheet.form["wires"][1:]}, "wire removed")
    assert [(p.code, p.where) for p in sheet.now.problems] == [("unwired-joint", "crank.A")]
    assert sheet.now.mechanism is None
    assert sheet.now.document.wires
    sheet.undo()
    assert sheet.now.mechanism is not None


def test_a_written_file_is_saved_until_the_next_change(tmp_path):
    sheet = Sheet(fourbar(), tmp_path)
    longer(sheet, 2.1)
    sheet.save("a.json")
    assert (sheet.saved, sheet.path) == (True, tmp_path / "a.json")
    sheet.undo()
    assert not sheet.saved
