"""Graph files: read strictly, written canonically, kept across versions."""

from __future__ import annotations

import cmath
import copy
import json
import math

import pytest

import blockmech as bm
from blockmech.builders import opened, problems_in
from blockmech.ground.errors import FormatError, GraphError, RequestError
from blockmech.ground.limits import DEEPEST
from blockmech.model.diagram import UnknownBlock, Wire
from blockmech.model.expect import Expectation
from blockmech.model.form import WIDTH, canonical_text
from blockmech.model.reading import data_of
from blockmech.model.versions import VERSION, current
from blockmech.testing import check_expectations
from tests.doors import graph_of as loads
from tests.gallery import GRAPHS
from tests.machines import ruiz

LEGACY = sorted((GRAPHS / "legacy").glob("*.json"))
OURS = sorted(GRAPHS.glob("*.json"))  # what blockmech wrote


def text_of(path):
    return path.read_text(encoding="utf-8")


def content(path):
    return json.loads(text_of(path))


# Reading and writing.


@pytest.mark.parametrize("path", OURS, ids=lambda path: path.stem)
def test_a_file_that_blockmech_wrote_is_reproduced_byte_for_byte(path):
    assert bm.Graph.load(path).to_json() == text_of(path)


def test_a_hand_written_file_is_reproduced_in_content():
    text = """{"blocks": {"g": {"type":"frame", "markers": {"B": {"dir":[0,2], "at":[1,2]},
      "A": {"at": {"polar": [1, 0.5]}}}}, "c": {"offset": 1, "length": 2, "type": "driver.crank",
      "friction": {"A": {"radius": 1e-2, "coefficient": 1}}}},
      "scene": {"drive": {"c": {"to": 1, "law": "constant_rate", "rate": 1E1}}},
      "wires": [{"to": "c.A", "from": "g.A"}], "notes": "by hand",
      "format": "blockmech/graph", "name": "hand", "version": 2}"""
    written = loads(text).to_json()
    assert json.loads(written) == json.loads(text)
    assert loads(written).to_json() == written


def test_reading_keeps_the_order_of_blocks_and_wires():
    data = content(GRAPHS / "ruiz_fourbar.json")
    data["blocks"] = dict(reversed(data["blocks"].items()))
    data["wires"].reverse()
    written = json.loads(loads(json.dumps(data)).to_json())
    assert list(written["blocks"]) == ["couple", "weightlike", "dyad", "crank", "frame"]
    assert written["wires"] == data["wires"]


def test_a_law_made_in_python_is_written_with_its_name():
    g = bm.Graph("driven")
    g.add("crank", bm.Crank())
    g.drive("crank", bm.motion.Cycloidal(start=0.0, end=1.0, time=2.0))
    law = {"law": "cycloidal", "from": 0.0, "to": 1.0, "duration": 2.0}
    assert json.loads(g.to_json())["scene"]["drive"]["crank"] == law
    assert loads(g.to_json()).scene == g.scene


def test_places_keep_the_author_s_spelling():
    g = bm.Graph("places")
    markers = {"P": {"at": {"polar": [2, 1]}}, "Q": cmath.rect(2, 1), "R": (1, 2)}
    g.add("frame", bm.Frame(markers=markers))
    back = loads(g.to_json()).blocks["frame"].markers
    assert back["P"].at.written == {"polar": [2.0, 1.0]}
    assert back["Q"].at.z == cmath.rect(2, 1)
    assert back["R"].at.written == [1.0, 2.0]


def test_a_bare_pair_for_a_marker_is_refused_with_what_to_write():
    data = content(GRAPHS / "ruiz_fourbar.json")
    data["blocks"]["frame"]["markers"]["A"] = [0, 0.5]
    with pytest.raises(FormatError) as caught:
        loads(json.dumps(data))
    assert [str(p) for p in caught.value.problems] == [
        "[wrong-type] blocks.frame.markers.A: A must be an object {...}, got [0, 0.5]. "
        'write {"at": [0, 0.5]}.'
    ]


def test_a_block_of_a_type_that_is_not_installed_is_kept_word_for_word():
    data = content(GRAPHS / "ruiz_fourbar.json")
    data["blocks"]["gear"] = {"type": "acme.gear", "teeth": [17, 34], "x": {"b": 1, "a": None}}
    data["wires"] += [
        {"from": "crank.crank", "to": "gear.shaft"},
        {"from": "gear.rim", "to": "gear.x"},
    ]
    g = loads(json.dumps(data))
    assert isinstance(g.blocks["gear"], UnknownBlock)
    assert json.loads(g.to_json()) == data
    assert [p.code for p in g.check()] == ["unknown-block"]


def test_sections_that_are_not_computed_with_travel_along():
    data = content(GRAPHS / "ruiz_fourbar.json")
    data |= {"view": {"crank": [1, 2]}, "source": "[R10]", "notes": ["one", "two"]}
    data["expect"] = [
        {
            "source": "by hand",
            "at": {"crank": [0.0]},
            "want": {"crank.B.p": [[2.0, 0.0]]},
            "atol": 0.0,
        }
    ]
    g = loads(json.dumps(data))
    assert json.loads(g.to_json()) == data
    assert isinstance(g.extras["expect"][0], Expectation)


def test_an_unfinished_mechanism_can_be_saved_and_read(tmp_path):
    g = bm.Graph("unfinished")
    g.add("dyad", bm.RRR(l_i=1.0, l_j=1.0))
    g.save(tmp_path / "unfinished.json")
    back = bm.Graph.load(tmp_path / "unfinished.json")
    assert {p.code for p in back.check()} == {"no-frame", "unwired-joint"}


@pytest.mark.parametrize(
    "change",
    [
        lambda text: b"\xef\xbb\xbf" + text.encode(),
        lambda text: text.replace("\n", "\r\n").encode(),
        lambda text: text.replace("Ruiz", "Ru\u00edz").encode(),
        lambda text: text.replace("Ruiz", "Ru\\u00edz").encode(),
        lambda text: text.replace("Ruiz", "\\ud83d\\ude00").encode(),
    ],
    ids=["mark of UTF-8", "lines of Windows", "accent", "escaped accent", "escaped pair"],
)
def test_texts_of_other_editors_are_read(change, tmp_path):
    path = tmp_path / "graph.json"
    path.write_bytes(change(text_of(GRAPHS / "ruiz_fourbar.json")))
    assert bm.Graph.load(path).structure().formula == "I(crank: 0,1) -> II RRR(dyad: 2,3)"


# Refusing.


def test_a_block_that_is_wrong_makes_its_wires_no_problem():
    data = content(GRAPHS / "ruiz_fourbar.json")
    data["blocks"]["frame"] = {"type": "frame", "marker": {}}
    data["blocks"]["crank"]["length"] = 0.0
    with pytest.raises(FormatError) as raised:
        loads(json.dumps(data))
    assert [p.where for p in raised.value.problems] == [
        "blocks.frame.marker",
        "blocks.crank.length",
    ]


def test_numbers_are_numbers_and_flags_are_flags():
    data = content(GRAPHS / "ruiz_fourbar.json")
    data["blocks"]["dyad"]["l_i"] = "6"
    data["blocks"]["dyad"]["l_j"] = True
    data["blocks"]["dyad"]["branch"] = True
    data["blocks"]["couple"]["useful"] = "yes"
    with pytest.raises(FormatError) as raised:
        loads(json.dumps(data))
    keys = ["l_i", "l_j", "branch", "useful"]
    assert [p.where.rsplit(".", 1)[-1] for p in raised.value.problems] == keys


AT, Q = {"at": {"crank": [0.0]}}, {"want": {"crank.q": [0.0]}}
UNTESTABLE = {
    "no tolerance": AT | Q,
    "neither at nor simulate": Q | {"rtol": 0.0},
    "at and simulate": AT | Q | {"simulate": {"times": [0.0]}, "rtol": 0.0},
    "nothing wanted": AT | {"want": {}, "rtol": 0.0},
    "no samples": Q | {"at": {"crank": []}, "rtol": 0.0},
    "unequal numbers": AT | {"want": {"crank.q": [0.0, 1.0, 2.0]}, "rtol": 0.0},
    "null": AT | {"want": {"crank.q": [None]}, "rtol": 0.0},
    "three coordinates": AT | {"want": {"crank.B.p": [[0.0, 1.0, 2.0]]}, "rtol": 0.0},
    "negative tolerance": AT | Q | {"rtol": -1.0},
    "unknown friction": AT | Q | {"rtol": 0.0, "friction": "some"},
}


@pytest.mark.parametrize("entry", UNTESTABLE.values(), ids=list(UNTESTABLE))
def test_an_expectation_that_cannot_be_tested_is_refused(entry):
    data = content(GRAPHS / "ruiz_fourbar.json")
    data["expect"] = [{"source": "by hand", **entry}]
    with pytest.raises(FormatError) as raised:
        loads(json.dumps(data))
    assert all(p.where.startswith("expect[0]") for p in raised.value.problems)


# Saving.


def files_of(folder):
    return sorted(p.name for p in folder.iterdir())


def test_a_file_is_written_with_unix_lines_and_nothing_beside_it(tmp_path):
    ruiz().save(tmp_path / "four.json")
    raw = (tmp_path / "four.json").read_bytes()
    assert raw.decode() == ruiz().to_json()
    assert b"\r" not in raw
    assert files_of(tmp_path) == ["four.json"]


SPOILT = {
    "wire": lambda g: g.wires.append(Wire("dyad.C", "dyad.D")),
    "name": lambda g: g.blocks.update({"a.b": g.blocks.pop("couple")}),
    "not finite": lambda g: g.extras.update(view={"crank": [0.0, math.nan]}),
    "not JSON": lambda g: g.extras.update(view={"crank": {1, 2}}),
    "half a character": lambda g: setattr(g, "title", "\ud800"),
    "expectation": lambda g: g.extras.update(expect=[{"source": "by hand"}]),
}


@pytest.mark.parametrize("spoil", SPOILT.values(), ids=list(SPOILT))
def test_what_could_not_be_read_again_is_not_saved(spoil, tmp_path):
    path = tmp_path / "graph.json"
    path.write_text("the old file", encoding="utf-8")
    g = ruiz()
    spoil(g)
    with pytest.raises((FormatError, GraphError)):
        g.save(path)
    assert text_of(path) == "the old file"
    assert files_of(tmp_path) == ["graph.json"]


def test_a_place_that_cannot_be_written_is_said(tmp_path):
    for path in (tmp_path, tmp_path / "no" / "folder.json"):
        with pytest.raises(RequestError):
            ruiz().save(path)
    assert files_of(tmp_path) == []


# Layout.


def test_lines_are_short_and_long_lists_filled():
    times = [k / 7 for k in range(300)]
    g = bm.Graph("table", drive={"crank": bm.motion.Trajectory(times=times, values=times)})
    text = g.to_json()
    assert max(map(len, text.splitlines())) <= WIDTH
    assert len(text.splitlines()) < 2 * 300 * 22 / 80 + 30  # at most 22 characters a number
    assert loads(text).scene.drive["crank"].times == times


def test_a_line_that_just_fits_stays_one_line():
    item = "x" * (WIDTH - len('    "k": {"n": [""]}'))
    text = canonical_text({"section": {"k": {"n": [item]}}})
    opened = canonical_text({"section": {"k": {"n": [item]}, "last": 1}})
    assert text.splitlines()[2] == f'    "k": {{"n": ["{item}"]}}'
    assert opened.splitlines()[2] == '    "k": {'


def test_numbers_are_the_shortest_that_read_back_the_same():
    text = canonical_text({"view": {"n": [0.1, 1e22, 5e-324, -0.0, 1 / 3, 100.0, 7]}})
    assert "[0.1, 1e+22, 5e-324, -0.0, 0.3333333333333333, 100.0, 7]" in text


# Versions.


@pytest.mark.parametrize("path", LEGACY, ids=lambda path: path.stem)
def test_an_old_file_is_still_read(path):
    assert content(path)["version"] < VERSION
    assert {p.code for p in problems_in(path)} <= {"unknown-block"}
    text = opened(path).to_json()
    today = text_of(path).replace('"law": "table"', '"law": "trajectory"')
    today = today.replace('"coupling.mesh.effort"', '"mesh_.effort"')  # a load is called mesh
    today = today.replace('"mesh": {"type": "gear"', '"mesh_": {"type": "gear"')
    assert json.loads(text) == {**json.loads(today), "version": VERSION}


def test_what_is_wrong_with_an_old_file_is_no_harder_to_read():
    laws = {"motor": {"joint": "A", "law": "table"}, "odd": 3}
    data = {"format": "blockmech/joints", "version": 1, "links": [], "joints": {}, "drivers": laws}
    data |= {"couplings": {"driver": {}}, "wires": [{"to": 1}, 3], "expect": [{"want": []}, {}]}
    before = copy.deepcopy(data)
    with pytest.raises(bm.FormatError) as refused:
        bm.Linkage.from_data(data)
    assert data == before
    assert "drivers.motor.times" in str(refused.value)
    assert "a driver must be an object" in str(refused.value)


def test_a_graph_inside_of_an_old_file_is_old_as_well():
    law = {"law": "table", "times": [0.0, 1.0], "values": [0.0, 2.0]}
    inner = {"blocks": {"crank": {"type": "driver.crank"}}, "scene": {"drive": {"crank": law}}}
    for head in ({}, {"format": "blockmech/graph", "version": 1}):
        data = {"format": "blockmech/graph", "version": 1, "blocks": {"frame": {"type": "frame"}}}
        data["blocks"]["arm"] = {"type": "graph", "graph": head | copy.deepcopy(inner)}
        graph = bm.Graph.from_data(data).blocks["arm"].graph
        assert graph["scene"]["drive"]["crank"]["law"] == "trajectory"
    arm = bm.Subgraph(graph=head | inner)
    assert arm.graph["scene"]["drive"]["crank"]["law"] == "trajectory"


def test_couplings_of_an_old_file_keep_names_of_their_own():
    """Each is renamed where a load has its name, to one that no other coupling has."""
    loads = {"gas": {}, "gas_": {}}
    data = {"format": "blockmech/joints", "version": 1, "loads": loads}
    couplings = {"gas": {"ratio": 1.0}, "gas_": {"ratio": 2.0}, "gas__": {"ratio": 3.0}}
    renamed = current({**data, "couplings": couplings})["couplings"]
    assert list(renamed.values()) == list(couplings.values())
    assert not renamed.keys() & loads.keys()


@pytest.mark.parametrize("version", [1.0, 2.0, True, 0, "1", None])
def test_a_version_is_a_whole_number(version):
    with pytest.raises(bm.FormatError) as refused:
        bm.Graph.from_data({"format": "blockmech/graph", "version": version, "blocks": {}})
    assert refused.value.problems[0].where == "version"


def test_an_old_file_of_links_still_gives_its_numbers():
    linkage = opened(GRAPHS / "legacy" / "version_1_joints.json")
    outcomes = {outcome.output: outcome.got for outcome in check_expectations(linkage)}
    expected = {"driver.motor.drive": -4.0, "mesh_.effort": 8.0, "gain.y": 4.0}
    assert outcomes == pytest.approx(expected, rel=1e-12)


def test_an_old_file_still_gives_its_numbers():
    g = bm.Graph.load(GRAPHS / "legacy" / "version_1.json")
    expected = g.extras["expect"][0]
    result = g.run(at=expected.at, want=list(expected.want), friction=expected.friction)
    ((x, y),) = expected.want["slide.S.p"]
    assert abs(result["slide.S.p"][0] - complex(x, y)) <= expected.rtol * abs(complex(x, y))


@pytest.mark.parametrize(
    ("text", "codes"),
    [
        ('{"a": [1, -2.5, 1e75, true, null, "é", {}]}', []),
        ('{"a": {"b": 1, "b": 1}}', ["duplicate-key"]),
        ('{"a": [1, 1e76]}', ["non-finite"]),
        ('{"a": [[-Infinity], NaN]}', ["non-finite", "non-finite"]),
        ('{"a": ' + "9" * 400 + "}", ["non-finite"]),
        ('{"a": ' * (DEEPEST - 1) + "{}" + "}" * (DEEPEST - 1), []),
    ],
)
def test_single_values_that_do_not_fit_are_found_wherever_they_are(text, codes):
    assert [problem.code for problem in data_of(text)[1]] == codes


def test_one_level_too_deep_is_refused_even_where_nothing_is_in_it():
    with pytest.raises(FormatError, match=f"{DEEPEST} deep"):
        data_of('{"a": ' * DEEPEST + "{}" + "}" * DEEPEST)
