"""A page to be printed: its numbers are those of the mechanism, and its texts run nothing."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

import blockmech as bm
from blockmech.builders import opened
from blockmech.draw.mechanism import draw_result

GRAPHS = Path(__file__).parents[2] / "graphs"
HURT = "</title><script>hurt=1</script>"


def report_of(document, path, **options):
    bm.write(document, path, to="report", **options)
    return path.read_text("utf-8")


@pytest.mark.parametrize("name", ["whitworth_shaper", "excavator", "joints/slider_crank"])
def test_a_report_has_drawing_dimensions_values_and_verification(tmp_path, name):
    mechanism = opened(GRAPHS / f"{name}.json").compile()
    text = report_of(mechanism, tmp_path / "r.html")
    assert text.count("<img") == 3  # drawing, curves, reactions
    assert "Verified: " in text
    numbers = re.findall(r"<tr><td>([^<]+)</td><td>([^ <]+) ?[^<]*</td></tr>", text)
    expected = {p.address: f"{p.value:.6g}" for p in mechanism.parameters().values()}
    assert dict(numbers).items() >= expected.items()
    assert "FAILS" not in text
    assert "reaction" not in text.partition("<h2>Values")[2].partition("<h2>")[0]


def test_a_drawing_has_the_lengths_of_links():
    """Of the four-bar in its file: crank 2 m, coupler 6 m, rocker 3 m, in mm."""
    linkage = opened(GRAPHS / "joints" / "ruiz_fourbar.json")
    picture = draw_result(linkage.run(samples=25, want=()).to("mm"), sheet=True)
    texts = {text.get_text() for text in picture.axes.texts}
    assert {"2000", "6000", "3000"} <= texts


def tables_of(text):
    """The rows of each table by the first word of its head."""
    cells = r"<t[dh]>([^<]*)</t[dh]>"
    tables = ([re.findall(cells, row) for row in x.split("</tr>")] for x in text.split("<table>"))
    return {rows[0][0]: rows for rows in tables if rows[0]}


def test_the_data_are_tables_of_the_parts_with_their_units(tmp_path):
    linkage = opened(GRAPHS / "joints" / "engine.json")
    result = linkage.run(samples=9, want="driver.*.drive").to("mm", "g")
    tables = tables_of(report_of(result, tmp_path / "r.html"))
    head, *rows = tables["links"]
    masses = {row[0]: float(row[head.index("mass [g]")]) for row in rows if row}
    links = linkage.to_data()["links"]
    assert masses == pytest.approx({name: 1e3 * x["mass"] for name, x in links.items()})
    head, *rows = tables["joints R"]
    joints = linkage.to_data()["joints"]
    pins = {name: joint for name, joint in joints.items() if joint["type"] == "R"}
    assert [row[0] for row in rows if row] == list(pins)
    for row in filter(None, rows):
        joint = pins[row[0]]
        assert row[head.index("links")] == ", ".join(joint["links"])
        x, y = map(float, row[head.index("at 1 [mm]")].split(", "))
        assert complex(x, y) == pytest.approx(1e3 * complex(*joint["at"][0]), rel=1e-4)
    assert not any(word.startswith("pose") for rows in tables.values() for word in rows[0])
    four_bar = tables_of(report_of(opened(GRAPHS / "ruiz_fourbar.json"), tmp_path / "b.html"))
    assert ["dyad.i", "30", "48.8", "2.7677, 0.42396"] in four_bar["links"]
    assert ["crank", "constant_rate", "10", "360"] in four_bar["drive"]


def test_the_largest_reactions_are_those_of_the_run(tmp_path):
    linkage = opened(GRAPHS / "joints" / "slider_crank.json")
    text = report_of(linkage, tmp_path / "r.html", samples=61)
    rows = dict(re.findall(r"<tr><td>(joint[^<]+)</td><td>([^<]+)</td><td>", text))
    run = linkage.run(samples=61, want=list(rows))
    for name, printed in rows.items():
        assert float(printed) == pytest.approx(np.abs(run[name]).max(), rel=1e-5)
    assert len(rows) == 4


def test_the_table_has_the_wanted_outputs_where_the_run_has_them(tmp_path):
    shaper = opened(GRAPHS / "ruiz_fourbar.json")
    text = report_of(shaper, tmp_path / "r.html", want="dyad.C.reaction", samples=25)
    rows = re.findall(r"<tr><td>([-\d.e]+)</td><td>([^<]+)</td></tr>", text)
    assert len(rows) == 13
    run = shaper.run(samples=25, want=["dyad.C.reaction"])["dyad.C.reaction"][::2]
    printed = [complex(*map(float, values.split(", "))) for _, values in rows]
    assert np.abs(np.array(printed) - run).max() < 1e-5 * np.abs(run).max()


def test_a_mechanism_without_laws_is_reported_over_a_turn_or_at_poses(tmp_path):
    data = opened(GRAPHS / "ruiz_fourbar.json").to_data()
    data["scene"]["drive"] = {}
    loose = bm.Graph.from_data(data)
    assert "crank.drive" in report_of(loose, tmp_path / "a.html")
    assert "crank.drive" in report_of(loose, tmp_path / "b.html", at=[0.1, 0.2])


def test_texts_run_nothing_in_a_report(tmp_path):
    data = json.loads((GRAPHS / "slider_crank.json").read_text("utf-8"))
    data |= {"title": HURT, "notes": HURT, "source": HURT}
    text = report_of(bm.Graph.from_data(data), tmp_path / "r.html")
    assert "<script" not in text
    assert text.count("&lt;script&gt;hurt=1") == 4


def test_what_a_report_cannot_have_is_one_sentence(tmp_path, call):
    path = tmp_path / "r.html"
    outcome = call("report", GRAPHS / "ruiz_fourbar.json", "-o", path, "--want", "crank.drve")
    assert (outcome.code, path.exists()) == (2, False)
    assert "crank.drive" in outcome.err


def test_an_upright_edge_has_its_length(tmp_path):
    coupling = opened(GRAPHS / "joints" / "oldham_coupling.json").compile()
    assert "<h1>Oldham coupling" in report_of(coupling, tmp_path / "it.html", samples=5)
