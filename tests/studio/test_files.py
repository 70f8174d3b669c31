"""Files, edits and fields of the studio, without a browser."""

import shutil
import socket
from pathlib import Path

import pytest

import blockmech as bm
from blockmech.blocks.registry import REGISTRY
from blockmech.model.schema import graph_schema
from blockmech.studio import edits
from blockmech.studio.diagram import kinds
from blockmech.studio.fields import Shown, fields_of, item_at
from blockmech.studio.files import Desk, Filed
from blockmech.studio.form import Form
from blockmech.studio.server import serve

GRAPHS = Path(__file__).parents[2] / "graphs"


@pytest.fixture
def folder(tmp_path):
    shutil.copy(GRAPHS / "ruiz_fourbar.json", tmp_path / "a.json")
    return tmp_path


def test_a_value_that_cannot_be_is_told_under_its_field():
    sheet, said = Filed(bm.Graph.load(GRAPHS / "ruiz_fourbar.json")), []
    form = Form(sheet, said.append)
    form.selected = ("blocks", "crank")
    before = sheet.form
    form.typed(("length",), "-2")
    assert "length must be > 0 m, got -2" in form.wrong["length",]
    assert said == [""]  # nothing is left to be told elsewhere
    assert sheet.form is before
    form.typed(("length",), "2.5")
    assert sheet.form["blocks"]["crank"]["length"] == 2.5
    assert form.wrong["length",] == ""


def test_a_file_is_saved_as_it_was_read(folder):
    sheet = Filed(None, folder)
    sheet.open("a.json")
    sheet.save("b.json")
    bm.Graph.load(folder / "a.json").save(folder / "c.json")
    assert (folder / "b.json").read_bytes() == (folder / "c.json").read_bytes()


def test_nothing_outside_of_the_folder_is_read_or_written(folder):
    inner = folder / "inner"
    inner.mkdir()
    (inner / "link.json").symlink_to(folder / "a.json")
    sheet = Filed(None, inner)
    for name in ("../a.json", str(folder / "a.json"), "link.json"):
        with pytest.raises(bm.RequestError, match="outside of the folder"):
            sheet.open(name)
        with pytest.raises(bm.RequestError, match="outside of the folder"):
            sheet.save(name)


def test_a_port_that_another_has_is_refused():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(bm.RequestError, match=rf"port: {port}: .*choose another"):
            serve(print, "", port, print)


def test_a_file_that_changed_since_is_not_overwritten_silently(folder):
    sheet = Filed(None, folder)
    sheet.open("a.json")
    (folder / "a.json").write_text("{}", encoding="utf-8")
    with pytest.raises(bm.RequestError, match="changed by somebody else"):
        sheet.save("a.json")
    sheet.save("a.json", replace=True)
    assert sheet.saved
    assert bm.Graph.load(folder / "a.json").name == "ruiz_fourbar"


def test_one_file_is_one_sheet(folder):
    desk = Desk(folder)
    assert desk.open("a.json") == desk.open("./a.json")


def test_a_renamed_block_is_renamed_wherever_it_is_named():
    form = bm.Graph.load(GRAPHS / "ruiz_fourbar.json").to_data()
    made = bm.Graph.from_data(edits.renamed(form, "crank", "motor"))
    assert made.check() == []
    assert list(made.scene.drive) == ["motor"]
    with pytest.raises(bm.GraphError, match="taken"):
        edits.renamed(form, "crank", "dyad")


def test_without_a_block_its_wires_and_its_drive_are_gone():
    form = edits.without(bm.Graph.load(GRAPHS / "ruiz_fourbar.json").to_data(), ["crank"])
    assert [w for w in form["wires"] if "crank" in str(w)] == []
    assert not form["scene"].get("drive")


def test_a_driver_called_by_a_joint_goes_with_its_block():
    form = bm.Graph.load(GRAPHS / "scissor_lift.json").to_data()
    assert list(form["scene"]["drive"]) == ["scissors.cylinder"]
    made = bm.Graph.from_data(edits.renamed(form, "scissors", "arms"))
    assert made.check() == []
    assert list(made.scene.drive) == ["arms.cylinder"]
    assert "drive" not in edits.without(form, ["scissors"])["scene"]


def test_the_palette_offers_every_kind_of_block():
    assert {kind for kind, *_ in kinds()} == {*REGISTRY}
    unready = {kind for kind, _, _, why in kinds() if why and not kind.startswith("signal.")}
    assert unready == {"group.general", "graph"}


def test_a_friction_law_is_chosen_where_there_was_none():
    sheet = Filed(bm.Graph.load(GRAPHS / "slider_crank.json"))
    form = Form(sheet, print)
    form.selected = ("blocks", "crank")
    form.typed(("friction", "A", "law"), "stiction")
    assert sheet.form["blocks"]["crank"]["friction"]["A"]["law"] == "stiction"
    assert ("friction", "A", "kinetic") in form.fields


def test_a_coupling_follows_the_new_name_of_its_driver():
    form = bm.Graph.load(GRAPHS / "geared_fivebar.json").to_data()
    made = bm.Graph.from_data(edits.renamed(form, "second", "wheel"))
    assert made.check() == []
    assert made.blocks["mesh"].driven == "wheel"


@pytest.mark.parametrize("kind", [kind for kind, _, _, why in kinds() if not why])
def test_every_kind_of_block_begins_with_valid_values(kind):
    form = edits.added(bm.Graph().to_data(), kind, "new", (0.0, 0.0))
    assert bm.Graph.from_data(form).blocks["new"].type_name == kind


@pytest.fixture(scope="module")
def schema():
    return graph_schema()


@pytest.mark.parametrize("shown", [Shown(), Shown("mm", "deg"), Shown("inch", "deg", "rpm", "lbf")])
@pytest.mark.parametrize("path", sorted(GRAPHS.glob("*.json")), ids=lambda path: path.stem)
def test_a_value_that_is_shown_and_read_again_is_the_same(path, shown, schema):
    read = 0
    for raw in bm.Graph.load(path).to_data()["blocks"].values():
        for field in fields_of(schema, schema["$defs"][raw["type"]], raw):
            value = item_at(raw, field.path)
            if value is not None and field.kind in ("number", "pair", "place"):
                assert shown.value(field, shown.text(field, value)) == value
                read += 1
    assert read


def test_a_graph_inside_is_read_from_the_folder_alone(tmp_path):
    knee = bm.Graph("knee")
    knee.add("dyad", bm.RRR(l_i=1.0, l_j=1.0))
    (tmp_path / "in").mkdir()
    knee.save(tmp_path / "knee.json")
    legs = bm.Graph("legs")
    legs.add("knee", bm.Subgraph(file=str(tmp_path / "knee.json")))
    legs.save(tmp_path / "in" / "legs.json")
    desk = Desk(tmp_path / "in")
    with pytest.raises(bm.FormatError, match="outside of the folder"):
        desk.open("legs.json")
    sheet = desk.sheets[desk.put()]
    with pytest.raises(bm.FormatError, match="outside of the folder"):
        sheet.change(legs.to_data(), "add a graph")
    assert sheet.form == bm.Graph().to_data()
