"""Files, edits and fields of the studio, without a browser."""

import json
import shutil
import socket
from pathlib import Path

import pytest

import blockmech as bm
from blockmech.blocks.block import REGISTRY
from blockmech.builders import opened
from blockmech.editor import edits
from blockmech.editor.diagram import kinds
from blockmech.editor.fields import Units, item_at
from blockmech.editor.forms import fields_by_path, form_of, parts_of
from blockmech.editor.server import bound
from blockmech.editor.sheets import Desk, Sheet
from blockmech.testing.graph_files import gallery
from tests.studio.hand import Hand

GRAPHS = Path(__file__).parents[2] / "graphs"
FILES = sorted(gallery().values())
CASES = json.loads(
    (Path(__file__).parents[1] / "data" / "typed_quantities.json").read_text("utf-8")
)


@pytest.fixture
def folder(tmp_path):
    shutil.copy(GRAPHS / "ruiz_fourbar.json", tmp_path / "a.json")
    return tmp_path


def test_a_value_that_cannot_be_is_refused_at_its_field():
    hand = Hand(bm.Graph.load(GRAPHS / "ruiz_fourbar.json"))
    before = hand.form
    hand.do("fields", part=["blocks", "crank"], edits=[[["length"], "-2"]])
    assert "length must be > 0 m, got -2" in hand.said
    assert hand.form is before
    hand.do("fields", part=["blocks", "crank"], edits=[[["length"], "-2"], [["length"], "250 cm"]])
    assert hand.form["blocks"]["crank"]["length"] == 2.5
    hand.do("fields", part=["blocks", "crank"], edits=[[["length"], "long"]])
    assert "'long' is no number" in hand.said


def test_what_is_wrong_stands_under_its_field():
    hand = Hand(bm.Graph.load(GRAPHS / "ruiz_fourbar.json"))
    hand.sheet.change({**hand.form, "wires": hand.form["wires"][1:]}, "cut")
    now = hand.sheet.now
    fields = form_of(now.document, now.form, ("blocks", "crank"), Units(), now.problems)
    (wire,) = (
        row for group in fields["groups"] for row in group["rows"] if "wire to" in row["label"]
    )
    assert "nothing is wired to it" in wire["wrong"]


def test_a_file_is_saved_as_it_was_read(folder):
    sheet = Sheet(None, folder)
    sheet.open("a.json")
    sheet.save("b.json")
    bm.Graph.load(folder / "a.json").save(folder / "c.json")
    assert (folder / "b.json").read_bytes() == (folder / "c.json").read_bytes()


def test_nothing_outside_of_the_folder_is_read_or_written(folder):
    inner = folder / "inner"
    inner.mkdir()
    (inner / "link.json").symlink_to(folder / "a.json")
    sheet = Sheet(None, inner)
    for name in ("../a.json", str(folder / "a.json"), "link.json"):
        with pytest.raises(bm.RequestError, match="outside of the folder"):
            sheet.open(name)
        with pytest.raises(bm.RequestError, match="outside of the folder"):
            sheet.save(name)


def test_a_port_that_another_has_is_refused():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(bm.RequestError, match=rf"port: {port}: .*choose another"):
            bound(port)


def test_a_file_that_changed_since_is_not_overwritten_silently(folder):
    sheet = Sheet(None, folder)
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
    graph = bm.Graph.load(GRAPHS / "ruiz_fourbar.json")
    renamed = bm.Graph.from_data(edits.renamed(graph, "crank", "motor"))
    assert renamed.check() == []
    assert list(renamed.scene.drive) == ["motor"]
    with pytest.raises(bm.GraphError, match="taken"):
        edits.renamed(graph, "crank", "dyad")


def test_without_a_block_its_wires_and_its_drive_are_gone():
    form = edits.without(bm.Graph.load(GRAPHS / "ruiz_fourbar.json").to_data(), ["crank"])
    assert [w for w in form["wires"] if "crank" in str(w)] == []
    assert not form["scene"].get("drive")


def test_a_driver_called_by_a_joint_goes_with_its_block():
    graph = bm.Graph.load(GRAPHS / "scissor_lift.json")
    assert list(graph.scene.drive) == ["scissors.cylinder"]
    renamed = bm.Graph.from_data(edits.renamed(graph, "scissors", "arms"))
    assert renamed.check() == []
    assert list(renamed.scene.drive) == ["arms.cylinder"]
    assert "drive" not in edits.without(graph.to_data(), ["scissors"])["scene"]


def test_the_palette_offers_every_kind_of_block():
    assert {kind for kind, *_ in kinds()} == {*REGISTRY}
    unready = {kind for kind, _, _, why in kinds() if why and not kind.startswith("signal.")}
    assert unready == {"group.general", "graph"}


def test_a_friction_law_is_chosen_where_there_was_none():
    hand, part = Hand(bm.Graph.load(GRAPHS / "slider_crank.json")), ("blocks", "crank")
    hand.do("fields", part=part, edits=[[["friction", "A", "law"], "stiction"]])
    assert hand.form["blocks"]["crank"]["friction"]["A"]["law"] == "stiction"
    fields = fields_by_path(hand.sheet.now.document, hand.form, part)
    assert ("friction", "A", "kinetic") in fields


@pytest.mark.parametrize(("name", "load"), [("engine", "gas"), ("pump", "motor")])
def test_a_load_with_a_law_has_another_name(name, load):
    graph = bm.Graph.load(GRAPHS / f"{name}.json")
    form = edits.renamed(graph, load, "other")
    assert form["blocks"]["other"] == graph.to_data()["blocks"][load]
    assert bm.Graph.from_data(form).check() == []


def test_a_coupling_follows_the_new_name_of_its_driver():
    graph = bm.Graph.load(GRAPHS / "geared_fivebar.json")
    renamed = bm.Graph.from_data(edits.renamed(graph, "second", "wheel"))
    assert renamed.check() == []
    assert renamed.blocks["mesh"].driven == "wheel"


@pytest.mark.parametrize("kind", [kind for kind, _, _, why in kinds() if not why])
def test_every_kind_of_block_begins_with_valid_values(kind):
    form = edits.added(bm.Graph().to_data(), kind, "new", (0.0, 0.0))
    assert bm.Graph.from_data(form).blocks["new"].type_name == kind


UNITS = Units.of("inch|deg|rpm|lbf")


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.relative_to(GRAPHS).as_posix())
def test_every_part_of_every_document_has_its_form(path):
    """Every value has a field, and reads as itself where it is shown in other units."""
    document = opened(path)
    form = document.to_data()
    for part in parts_of(form):
        fields = fields_by_path(document, form, part)
        held = {field.path: item_at(form, field.path) for field in fields.values()}
        for field in fields.values():
            value = held[field.path]
            if value is not None and field.kind not in ("choice", "map", "json"):
                assert UNITS.value(field, UNITS.text(field, value)) == value
        if part:
            lines = {field.path for field in fields.values() if field.kind != "map"}
            assert {*leaves(item_at(form, part), part, lines)} <= lines | {(*part, "type")}


def leaves(raw, path, known):
    """Paths of values, no deeper than the fields that are known."""
    if path in known or not isinstance(raw, dict):
        yield path
    else:
        for key, value in raw.items():
            yield from leaves(value, (*path, key), known)


@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case['text']} {case['shown']}")
def test_a_quantity_is_read_as_people_type_it(case):
    units = Units({case["si"]: case["shown"]})
    assert units.number(case["text"], case["si"]) == case["value"]


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
