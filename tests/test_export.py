"""How a result leaves: every format says the same numbers, names, units and gaps."""

from __future__ import annotations

import csv
import io
import json
import math
import os
import re
import stat
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from jsonschema import Draft202012Validator

import blockmech as bm
from blockmech.figures.curves import pictures_of, with_reversals
from blockmech.ground.files import folder, writing
from blockmech.result.data import json_chunks, result_schema
from blockmech.result.motion import fact_unit
from blockmech.result.spreadsheet import csv_chunks, write_csv
from blockmech.result.tables import _select, html_table, table
from examples.wire_ruiz import fourbar
from tests.analysis.linkages import fivebar, short_fourbar
from tests.gallery import GRAPHS

BAR = bm.Link(mass=1.0, inertia=0.1, cm=(0.5, 0.0))
GAP = 4.0  # [rad] crank angle at which `short_fourbar` cannot close


@pytest.fixture(scope="module")
def turn() -> Any:
    return fourbar().compile().run(samples=25)


@pytest.fixture(scope="module")
def gappy() -> Any:
    return short_fourbar(bar=BAR).compile().run(at=[0.0, 0.5, GAP, 6.0], on_gap="mark")


def rows_of(text: str, separator: str = ",") -> list[list[str]]:
    return list(csv.reader(io.StringIO(text), delimiter=separator))


# -- JSON ---------------------------------------------------------------------------


def test_json_has_the_settled_form(turn):
    data = turn.to_dict()
    assert list(data) == [
        *("format", "version", "graph", "samples"),
        *("drivers", "time", "outputs", "quality"),
    ]
    assert (data["format"], data["version"]) == ("blockmech/result", 1)
    assert (data["graph"], data["samples"]) == ("ruiz_fourbar", 25)
    assert data["drivers"] == {"crank.q": turn.drivers["crank.q"].tolist()}
    reaction = data["outputs"]["dyad.B.reaction"]
    assert (reaction["unit"], reaction["by"], reaction["on"]) == ("N", "crank.crank", "dyad.i")
    assert reaction["values"] == [[z.real, z.imag] for z in turn["dyad.B.reaction"].tolist()]
    flag = data["quality"]["flags"][0]
    assert set(flag) == {"sample", "code", "where", "interval"}
    assert (flag["sample"], flag["code"], flag["where"]) == (0, "zero-relative-speed", "dyad.C")
    assert len(flag["interval"]) == 2


def test_json_has_nested_lists_for_matrices():
    result = fivebar(BAR).run(at={"left": [0.3, 0.6], "right": [2.0, 2.2]})
    outputs = result.to_dict()["outputs"]
    assert outputs["mechanism.M"]["values"] == result["mechanism.M"].tolist()
    assert outputs["mechanism.Q"]["values"] == result["mechanism.Q"].tolist()
    assert np.shape(outputs["mechanism.M"]["values"]) == (2, 2, 2)


def test_a_sample_without_an_answer_is_null_and_its_neighbours_are_whole(gappy):
    data = json.loads(json.dumps(gappy.to_dict(), allow_nan=False))
    for name in ("dyad.C.p", "dyad.i.omega", "dyad.C.reaction"):
        values = data["outputs"][name]["values"]
        assert [v is None for v in values] == [False, False, True, False], name
    assert data["quality"]["status"] == ["ok", "ok", "no-assembly", "ok"]
    assert data["quality"]["margin"]["dyad"][2] < 0
    assert data["outputs"]["crank.B.p"]["values"][2] == pytest.approx(
        [2 * math.cos(GAP), 2 * math.sin(GAP)], rel=1e-15
    )


def test_json_leaves_time_out_where_nobody_knows_it():
    result = fivebar(BAR).run(at={"left": 0.3, "right": 2.0})
    assert "time" not in result.to_dict()


@pytest.mark.parametrize("which", ["turn", "gappy"])
def test_json_in_pieces_is_the_same_document(which, request):
    result = request.getfixturevalue(which)
    text = "".join(json_chunks(result))
    assert json.loads(text) == result.to_dict()


def test_json_text_is_ascii_for_any_name_and_reads_back():
    result = short_fourbar(name="Mühle 𝛼", crank="größe").run(at=0.1)
    text = "".join(json_chunks(result))
    assert text.isascii()
    assert json.loads(text) == result.to_dict()


@pytest.mark.parametrize("which", ["turn", "gappy"])
def test_results_keep_the_schema(which, request):
    schema = result_schema()
    Draft202012Validator.check_schema(schema)
    Draft202012Validator(schema).validate(request.getfixturevalue(which).to_dict())


def test_the_schema_refuses_what_is_no_result(turn):
    validator = Draft202012Validator(result_schema())
    data = turn.to_dict()
    assert not validator.is_valid({**data, "surprise": 1})
    assert not validator.is_valid({k: v for k, v in data.items() if k != "quality"})
    assert not validator.is_valid({**data, "outputs": {"a": {"unit": "m", "values": ["1"]}}})


def test_the_schema_tells_the_units_of_a_motions_facts():
    facts = result_schema()["$defs"]["motion"]["properties"]["facts"]
    descriptions = {name: fact["description"] for name, fact in facts["properties"].items()}
    assert descriptions["period"] == "[s]"
    assert descriptions["work_per_period"] == "[J]"
    assert descriptions["mean_speed"] == "[rad/s or m/s]"


@pytest.mark.parametrize(
    ("fact", "unit"),
    [("period", "s"), ("mean_speed", "m/s"), ("multiplier_2_angle", "rad"), ("multiplier", "")],
)
def test_a_fact_of_a_slide_in_motion_has_its_unit(fact, unit):
    assert fact_unit(fact, "m") == unit


# -- CSV ----------------------------------------------------------------------------


def test_csv_reads_back_to_the_last_bit(turn):
    head, *rows = rows_of(turn.to_csv())
    assert head[:3] == ["crank.q [rad]", "time [s]", "crank.rate [rad/s]"]
    assert len(set(head)) == len(head)
    assert head[-1] == "status"
    assert [row[-1] for row in rows] == ["ok"] * 25
    column = {name: [float(row[i]) for row in rows] for i, name in enumerate(head[:-1])}
    assert column["crank.drive [N m]"] == turn["crank.drive"].tolist()
    assert column["dyad.B.reaction.x [N]"] == turn["dyad.B.reaction"].real.tolist()
    assert column["dyad.B.reaction.y [N]"] == turn["dyad.B.reaction"].imag.tolist()
    assert column["dyad.margin [-]"] == turn["dyad.margin"].tolist()
    efficiency = turn["mechanism.friction_efficiency"]  # one number of the run
    assert column["mechanism.friction_efficiency [-]"] == [efficiency] * 25
    assert turn.to_dict()["outputs"]["mechanism.friction_efficiency"]["values"] == [efficiency]


def test_csv_leaves_cells_without_an_answer_empty(gappy):
    head, *rows = rows_of(gappy.to_csv())
    i = head.index("dyad.i.omega [rad/s]")
    assert [row[i] == "" for row in rows] == [False, False, True, False]
    assert [row[-1] for row in rows] == ["ok", "ok", "no-assembly", "ok"]


def test_csv_names_the_entries_of_matrices():
    result = fivebar(BAR).run(at={"left": [0.3], "right": [2.0]}, want="mechanism.*")
    head, row = rows_of(result.to_csv())
    cell = dict(zip(head, row, strict=True))
    assert head[:2] == ["left.q [rad]", "right.q [rad]"]
    assert float(cell["mechanism.M.left.right [SI]"]) == result["mechanism.M"][0, 0, 1]
    assert float(cell["mechanism.Q.right [SI]"]) == result["mechanism.Q"][0, 1]


@pytest.mark.parametrize("separator", [",", ";", "\t", "|"])
def test_csv_takes_separators(turn, separator):
    assert rows_of(turn.to_csv(separator=separator), separator) == rows_of(turn.to_csv())


def test_csv_writes_decimal_commas(turn):
    plain = rows_of(turn.to_csv())
    german = rows_of("".join(csv_chunks(turn, ";", ",")), ";")
    assert german[0] == plain[0]
    assert [[cell.replace(",", ".") for cell in row] for row in german[1:]] == plain[1:]
    assert "," in german[2][0]


@pytest.mark.parametrize(("separator", "decimal"), [("a", "."), ("", "."), (",", ","), (";", ";")])
def test_csv_refuses_signs_that_tear_numbers(turn, separator, decimal):
    with pytest.raises(bm.RequestError):
        csv_chunks(turn, separator, decimal)


def test_csv_gives_angles_in_degrees_and_says_so(turn):
    head, *rows = rows_of("".join(csv_chunks(turn.to("deg"))))
    assert head[0] == "crank.q [deg]"
    assert not [name for name in head if name.endswith("[rad]")]
    assert float(rows[-1][0]) == pytest.approx(360.0, rel=1e-15)
    i = head.index("dyad.i.angle [deg]")
    assert float(rows[3][i]) == pytest.approx(math.degrees(turn["dyad.i.angle"][3]), rel=1e-15)
    assert "crank.rate [rad/s]" in head


def test_csv_of_many_rows_is_that_of_its_parts():
    mechanism = fourbar().compile()
    at = np.linspace(0.1, 6.0, 4001)  # over two chunks and one row
    text = mechanism.run(at=at, want="crank.drive").to_csv()
    assert text.count("\n") == 4002
    last = mechanism.run(at=at[-1:], want="crank.drive", engine="numpy").to_csv()
    assert text.splitlines()[-1] == last.splitlines()[-1]


def test_csv_quotes_names_that_hold_separators():
    result = short_fourbar(crank='a,"b";c').run(at=0.1, want="dyad.i.omega")
    for separator in (",", ";"):
        head, row = rows_of(result.to_csv(separator=separator), separator)
        assert head[0] == 'a,"b";c.q [rad]'
        assert len(row) == len(head) == 4


def test_csv_files_have_one_newline_a_row_and_a_mark_only_where_it_is_needed(turn, tmp_path):
    text = turn.to_csv(tmp_path / "plain.csv")
    assert (tmp_path / "plain.csv").read_bytes() == text.encode()
    assert b"\r" not in text.encode()
    short_fourbar(crank="größe").run(at=0.1).to_csv(tmp_path / "marked.csv")
    marked = (tmp_path / "marked.csv").read_bytes()
    assert marked.startswith(b"\xef\xbb\xbf")
    assert "größe.q [rad]" in marked.decode("utf-8-sig").splitlines()[0]


def test_a_result_without_samples_leaves_as_a_head(gappy):
    empty = short_fourbar().compile().run(at=[GAP, 0.1], on_gap="stop")
    assert empty.n == 0
    assert len(rows_of(empty.to_csv())) == 1
    assert json.loads("".join(json_chunks(empty)))["outputs"]["dyad.C.p"]["values"] == []
    assert "0 samples" in table(empty)


# -- NumPy and pandas ------------------------------------------------------------------


def test_npz_keeps_every_array(turn, tmp_path):
    bm.write(turn, tmp_path / "turn.npz")
    with np.load(tmp_path / "turn.npz", allow_pickle=False) as data:
        for name in turn:
            np.testing.assert_array_equal(data[name], turn[name])
        np.testing.assert_array_equal(data["time"], turn.time)
        np.testing.assert_array_equal(data["quality.margin.dyad"], turn.quality.margin["dyad"])
        assert data["quality.status"].tolist() == ["ok"] * 25
        units = dict(data["units"].tolist())
    assert units["dyad.B.reaction"] == "N"
    assert units["crank.q"] == "rad"


def test_dataframe_has_the_columns_of_the_csv(turn):
    frame = turn.to_dataframe()
    head = rows_of(turn.to_csv())[0]
    assert [f"{name} [{u or '-'}]" for name, u in frame.attrs["units"].items()] == head[:-1]
    assert frame["dyad.B.reaction.y"].tolist() == turn["dyad.B.reaction"].imag.tolist()
    assert frame["status"].tolist() == ["ok"] * 25


def test_dataframe_without_pandas_names_what_to_install(turn, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)  # Python then finds no such module
    with pytest.raises(bm.MissingEngineError, match=r"pip install \"blockmech\[study\]"):
        turn.to_dataframe()


# -- tables ------------------------------------------------------------------------------


def test_the_table_fits_a_terminal_and_starts_with_what_matters():
    text = table(fourbar().run())
    lines = text.splitlines()
    assert max(map(len, lines)) <= 100
    assert "361 samples" in lines[0]
    assert lines[2].split()[:2] == ["crank", "crank"]
    assert lines[3].split()[:3] == ["q", "time", "drive"]
    assert lines[4].split()[:4] == ["[rad]", "[s]", "[N", "m]"]
    assert lines[2].split()[-4:] == ["crank.A", "dyad.B", "dyad.C", "dyad.D"]
    assert lines[3].split()[-4:] == ["|reaction|"] * 4
    assert "  zero-relative-speed: nothing slides there" in text
    assert "  no load keeps work over the run: friction takes all" in text
    body = lines[5 : lines.index("", 5)]
    assert len(body) == 13
    assert body[0].split()[2] == "-10605.7"
    assert float(body[1].split()[0]) == pytest.approx(math.pi / 6, rel=1e-5)


def test_the_table_says_how_many_outputs_it_leaves_out(turn):
    columns = len(set(re.findall(r"[\w.]+", table(turn).splitlines()[2])))
    match = re.search(r"(\d+) more outputs: crank", table(turn))
    assert match
    assert 0 < int(match[1]) < len(turn)
    assert columns > 1


def test_the_table_shows_what_is_wanted_and_nothing_else():
    text = table(fourbar().run(at=[1.0], want=["dyad.j.omega", "dyad.C.p"]))
    assert "omega" in text
    assert "p.x" in text
    assert "more output" not in text
    assert "drive" not in text


def test_the_table_names_gaps_and_shows_no_number_there(gappy):
    text = table(gappy)
    row = next(line for line in text.splitlines() if line.lstrip().startswith("4 "))
    assert row.split()[-1] == "no-assembly"
    assert "-" in row.split()
    assert "nan" not in text
    assert "no answer at 1 of 4 samples:" in text
    assert "no-assembly at dyad, 1 sample: crank.q = 4 rad" in text


def test_the_table_joins_neighbouring_gaps_into_one_line():
    result = short_fourbar().compile().run(samples=361, on_gap="mark")
    text = table(result)
    assert len(result.quality.gaps) > 100
    assert text.count("no-assembly at dyad") == 1


def test_the_table_gives_angles_in_degrees():
    assert "60" in str(fourbar().run(at="60deg").to("deg")).splitlines()[5].split()


def test_the_html_table_escapes_names():
    result = short_fourbar(name="<script>", crank="<b>&").run(at=0.1)
    text = html_table(result)
    assert "<script>" not in text
    assert "<b>" not in text
    assert "&lt;script&gt;" in text
    assert "&lt;b&gt;&amp;.q [rad]" in text


def test_notebooks_show_the_html_table(gappy):
    assert gappy._repr_html_() == html_table(gappy)
    assert "no-assembly" in gappy._repr_html_()


# -- files: whole or not at all -------------------------------------------------------------


def test_a_failed_write_leaves_the_old_file_and_nothing_beside_it(tmp_path):
    old = tmp_path / "results.csv"
    old.write_text("old", encoding="utf-8")

    def half() -> Any:
        yield "half"
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        write_csv(half(), old)
    assert old.read_text(encoding="utf-8") == "old"
    assert os.listdir(tmp_path) == ["results.csv"]


def test_writing_replaces_a_file_and_follows_a_link(tmp_path):
    target, link = tmp_path / "target.csv", tmp_path / "link.csv"
    target.write_text("old", encoding="utf-8")
    try:
        link.symlink_to(target)
    except OSError:
        pytest.skip("links need a permission here")
    write_csv(["new"], link)
    assert link.is_symlink()
    assert target.read_text(encoding="utf-8") == "new"


@pytest.mark.skipif(sys.platform == "win32", reason="a device file")
def test_writing_to_a_device_does_not_replace_it():
    with writing(os.devnull) as stream:
        stream.write(b"gone")
    assert stat.S_ISCHR(os.stat(os.devnull).st_mode)


@pytest.mark.parametrize("name", ["", "missing/x.csv", "file/x.csv"])
def test_a_place_that_cannot_be_written_is_refused_by_name(turn, tmp_path, name):
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(bm.RequestError, match="cannot-write") as caught:
        turn.to_csv(tmp_path / name)
    assert caught.value.problems[0].where == str(tmp_path / name)
    assert os.listdir(tmp_path) == ["file"]


def test_a_folder_appears_whole_with_its_parents(tmp_path):
    with folder(tmp_path / "a" / "b") as draft:
        (draft / "one.txt").write_text("1", encoding="utf-8")
        assert not (tmp_path / "a").exists()
    assert (tmp_path / "a" / "b" / "one.txt").read_text(encoding="utf-8") == "1"
    assert os.listdir(tmp_path) == ["a"]
    assert os.listdir(tmp_path / "a") == ["b"]


def test_a_folder_keeps_other_files_and_replaces_its_own(tmp_path):
    (tmp_path / "other.txt").write_text("other", encoding="utf-8")
    (tmp_path / "one.txt").write_text("old", encoding="utf-8")
    with folder(tmp_path) as draft:
        (draft / "one.txt").write_text("new", encoding="utf-8")
    assert sorted(os.listdir(tmp_path)) == ["one.txt", "other.txt"]
    assert (tmp_path / "one.txt").read_text(encoding="utf-8") == "new"


def test_a_failed_folder_leaves_nothing(tmp_path):
    def fail(target: Path) -> None:
        with folder(target) as draft:
            (draft / "one.txt").write_text("1", encoding="utf-8")
            raise ZeroDivisionError

    for target in (tmp_path / "new", tmp_path):
        with pytest.raises(ZeroDivisionError):
            fail(target)
    assert os.listdir(tmp_path) == []


def test_a_directory_in_the_way_stops_a_folder_before_anything_moves(tmp_path):
    def fill(target: Path) -> None:
        with folder(target) as draft:
            (draft / "a.txt").write_text("new", encoding="utf-8")
            (draft / "b.txt").write_text("new", encoding="utf-8")

    (tmp_path / "b.txt").mkdir()
    with pytest.raises(bm.RequestError, match="in the way"):
        fill(tmp_path)
    assert os.listdir(tmp_path) == ["b.txt"]


def test_a_file_in_the_place_of_a_folder_is_refused(tmp_path):
    def fill(target: Path) -> None:
        with folder(target):
            pass

    (tmp_path / "file").write_text("old", encoding="utf-8")
    with pytest.raises(bm.RequestError, match="it is a file"):
        fill(tmp_path / "file")
    assert (tmp_path / "file").read_text(encoding="utf-8") == "old"


def test_every_table_opens_where_numbers_have_a_comma():
    mechanism = fourbar().compile()
    tables = (
        mechanism.run(at=[0.5, 1.0], want="crank.drive"),
        mechanism.study({"dyad.l_i": [5.9, 6.0]}, want="max(crank.drive)", samples=3),
        mechanism.sensitivity("crank.drive", to="dyad.l_*", at=1.0),
    )
    for answer in tables:
        point = list(csv.reader(io.StringIO(answer.to_csv())))
        text = answer.to_csv(separator=";", decimal=",")
        comma = list(csv.reader(io.StringIO(text), delimiter=";"))
        assert comma[0] == point[0]
        assert comma[1:] != point[1:]
        assert [[x.replace(",", ".") for x in row] for row in comma[1:]] == point[1:]
        with pytest.raises(bm.RequestError, match='use separator=";" with decimal=","'):
            answer.to_csv(decimal=",")


def test_a_result_is_shown_in_other_units_and_keeps_its_numbers(turn):
    converted = turn.to("deg", "rpm", "mm", "kN m")
    heads = rows_of(converted.to_csv())[0]
    assert {"crank.q [deg]", "crank.rate [rpm]", "dyad.C.p.x [mm]", "crank.drive [kN m]"} <= {
        *heads
    }
    assert "dyad.C.v.x [m/s]" in heads  # no unit of its kind is named
    frame = turn.to("mm").to_dataframe()
    assert frame["dyad.C.p.x"].to_numpy() == pytest.approx(1000 * turn["dyad.C.p"].real)
    assert np.array_equal(converted["dyad.C.p"], turn["dyad.C.p"])
    assert converted.to_dict() == turn.to_dict()
    assert converted._plan is turn._plan
    figure = converted.plot(want=["dyad.C.p", "crank.rate"])
    assert [axes.get_ylabel() for axes in figure.axes] == ["p [mm]", "rate [rpm]"]
    with pytest.raises(bm.RequestError, match='no unit "furlong"'):
        turn.to("furlong")


def test_vectors_are_drawn_by_size_or_by_components(turn):
    sized = turn.plot(want=["dyad.D.reaction"])
    parts = turn.plot(want=["dyad.D.reaction"], components=True)
    assert [axes.get_ylabel() for axes in (*sized.axes, *parts.axes)] == [
        *("|reaction| [kN]", "reaction [kN]")
    ]
    x, y = (1000 * line.get_ydata() for line in parts.axes[0].lines)
    assert x == pytest.approx(with_reversals(turn)["dyad.D.reaction"].real, abs=1e-6)
    assert np.hypot(x, y) == pytest.approx(1000 * sized.axes[0].lines[0].get_ydata())


def test_sizes_in_tables_and_pictures_are_in_the_units_of_their_heads():
    run = bm.read(GRAPHS / "joints" / "slider_crank.json").run(samples=13)
    (size,) = [c for c in _select(run.to("kN"), 200, tuple(run)).columns if "joint.B" in c.name]
    assert size.unit == "kN"
    assert size.values == pytest.approx(np.abs(run["joint.B.reaction"]) / 1000.0, rel=1e-15)
    labels = " ".join(axes.get_ylabel() for axes in run.to("kN", "N mm").plot().axes)
    assert "N mm" in labels
    assert "kN" in labels
    assert run.plot(want="*.reaction").axes
    assert pictures_of(run.to("kN"))["reactions"][0].unit == "kN"  # as files of a run are, too


def test_what_is_not_compiled_is_told_how():
    drawing = bm.read(GRAPHS / "joints" / "slider_crank.json")
    with pytest.raises(bm.RequestError, match="compile it first"):
        bm.design.flywheel(drawing, speed=80.0, fluctuation=0.05)


def test_rounding_beside_the_largest_of_a_unit_is_zero_in_tables():
    """Where rounding is beside the largest speed; and 30 deg is no 29.999999999999996 deg."""
    r = bm.Graph.load(GRAPHS / "slider_crank.json").run(
        at=["0 deg", "30 deg", "90 deg", "180 deg"], want="*.v"
    )
    rows = list(csv.DictReader(io.StringIO(r.to("deg").to_csv())))
    assert [row["crank.q [deg]"] for row in rows] == ["0.0", "30.0", "90.0", "180.0"]
    values = np.abs([float(x) for row in rows for name, x in row.items() if "[m/s]" in name])
    assert values[values > 0].min() > 1e-13 * values.max()
    assert "-0.0" not in {x for row in rows for x in row.values()}
