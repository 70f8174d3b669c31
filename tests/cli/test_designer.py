"""What a designer runs into: units, spellings, turned wires; each is told with what to do."""

from __future__ import annotations

import copy
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import blockmech as bm
from tests.gallery import GRAPHS
from tests.machines import wire

RUIZ = json.loads((GRAPHS / "ruiz_fourbar.json").read_text("utf-8"))
LINKAGE = json.loads((GRAPHS / "joints" / "ruiz_fourbar.json").read_text("utf-8"))


def changed(path: str, value: Any, document: Any = RUIZ) -> Any:
    """The document with the value at a path replaced."""
    variant = copy.deepcopy(document)
    *keys, last = path.split("/")
    container = variant
    for key in keys:
        container = container[int(key) if isinstance(container, list) else key]
    container[int(last) if isinstance(container, list) else last] = value
    return variant


LAW = "scene/drive/crank"
TURNED = {"from": "crank.A", "to": "frame.A"}
SPELLED = [
    ("blocks/crank/length", "2.0", "a number in m", "write 2.0"),
    ("blocks/crank/length", "2,0", "a number in m", "with m, mm, cm"),
    ("blocks/crank/offset", "36mm", "a number in rad", "with rad, deg, turns"),
    ("blocks/crank/length", "2 parsec", "a number in m", "parsec"),
    (f"{LAW}/rate", "30 knots", "a number", 'no unit "knots"'),
    (f"{LAW}/rate", "30 mm/s", "has another kind of unit", "with rad/s, deg/s, rpm"),
    (f"{LAW}/rpm", 30, 'no key "rpm"', 'write "rate": "30rpm"'),
    (LAW, "harmonic", "an object", '{"law": "harmonic", ...}'),
    (LAW, 10, "an object", '{"law": "constant_rate", ...}'),
    ("blocks/dyad/l_1", 6.0, 'no key "l_1"', 'did you mean "l_i"'),
    ("blocks/dyad/l_2", 6.0, 'no key "l_2"', 'did you mean "l_j"'),
    ("wires/0", TURNED, "does not end there", "turn the wire round: frame.A -> crank.A"),
]


@pytest.mark.parametrize(
    ("path", "written", "value"),
    [
        ("blocks/crank/length", "2000 mm", 2.0),
        ("blocks/crank/offset", "360deg", math.tau),
        ("blocks/frame/markers/D/at", ["5500mm", 0.0], 5.5),
        (f"{LAW}/rate", "30 rpm", math.pi),
        ("scene/gravity", ["0 m/s2", "-9810 mm/s^2"], -9.81),
    ],
)
def test_a_number_is_written_with_its_unit(path: str, written: Any, value: float) -> None:
    """It is the same mechanism as with the number in SI, and is kept in SI."""
    graph = bm.Graph.from_data(changed(path, written))
    plain = (
        value if isinstance(written, str) else [0.0, value] if "gravity" in path else [value, 0.0]
    )
    assert graph.to_data() == bm.Graph.from_data(changed(path, plain)).to_data()
    assert graph.compile().name == RUIZ["name"]


@pytest.mark.parametrize(("path", "written", "mistake", "remedy"), SPELLED)
def test_a_slip_of_spelling_is_one_message_that_says_what_to_write(
    path: str, written: Any, mistake: str, remedy: str
) -> None:
    with pytest.raises((bm.FormatError, bm.GraphError)) as caught:
        bm.Graph.from_data(changed(path, written)).compile()
    (problem,) = map(str, caught.value.problems)
    assert mistake in problem
    assert remedy in problem


def test_a_comma_inside_of_a_number_is_called_that(tmp_path: Path) -> None:
    file = tmp_path / "comma.json"
    file.write_text(json.dumps(RUIZ).replace('"length": 2.0', '"length": 2,0'), "utf-8")
    with pytest.raises(bm.FormatError, match=r"comma inside of a number.*point: 2\.0"):
        bm.Graph.load(file)


@pytest.mark.parametrize(
    ("written", "mistake"),
    [
        ("06", '"06" is not a value. write 6.0.'),
        ("0x6", '"0x6" is not a value. write 6.'),
        ("6.", '"6." is not a value. write 6.0.'),
        ("+6.0", '"+6.0" is not a value. write 6.0.'),
        ("6 mm", '"6 mm" is not a value. write "6 mm".'),
        ("60deg", '"60deg" is not a value. write "60deg".'),
        ("None", '"None" is not a value. write null.'),
        ("13/2", '"13/2" is not a value. a value is a number,'),
        ("\u201csix\u201d", "a typographic quotation mark. texts and keys need double"),
        ("6 // m", "a comment. JSON has none"),
        ("6]", '"]" closes the "{" of line 1, column 2. close it with "}".'),
        ('["a": 6]', "a key in the list that begins at line 1, column 10. keys stand in {...}."),
        ('6 "b": 7', '"b" where a comma is expected. add the comma.'),
    ],
)
def test_a_value_written_as_elsewhere_is_told_in_json(written: str, mistake: str) -> None:
    with pytest.raises(bm.FormatError) as caught:
        bm.Graph.from_json(f' {{"l_i": {written}}}')
    (problem,) = map(str, caught.value.problems)
    assert mistake in problem


@pytest.mark.parametrize("section", ["blocks", "links"])
def test_a_name_given_twice_is_one_message(section: str, tmp_path: Path) -> None:
    document = RUIZ if section == "blocks" else LINKAGE
    first, second = list(document[section])[:2]
    file, text = tmp_path / "twice.json", json.dumps(document)
    file.write_text(text.replace(f'"{second}": {{', f'"{first}": {{', 1), "utf-8")
    with pytest.raises(bm.FormatError) as caught:
        (bm.Graph if section == "blocks" else bm.Linkage).load(file)
    (problem,) = caught.value.problems
    assert (problem.code, problem.where) == ("duplicate-key", f"{section}.{first}")


@pytest.mark.parametrize(
    ("output", "suggestion"), [("crank.torque", "crank.drive"), ("dyad.C.force", "dyad.C.reaction")]
)
def test_an_output_by_another_name_of_the_trade_is_found(output: str, suggestion: str) -> None:
    with pytest.raises(bm.RequestError, match=f'did you mean "{suggestion}"'):
        bm.Graph.from_data(RUIZ).run(at=1.0, want=output)


# ---- lengths that do not close -----------------------------------------------------------

IN_MM = [
    ("blocks/crank/length", 2000.0, "too large", "crank.length 1000 times smaller"),
    ("blocks/dyad/l_i", 6000.0, "too small", "dyad.l_i 1000 times smaller"),
    ("blocks/frame/markers/D/at", [5500.0, 0.0], "too large", "frame.markers 1000 times smaller"),
    ("blocks/dyad/l_j", 0.003, "too small", "dyad.l_j 1000 times as large"),
]


@pytest.mark.parametrize(("path", "written", "remedy", "slip"), IN_MM)
def test_lengths_in_mm_are_recognised(path: str, written: Any, remedy: str, slip: str) -> None:
    with pytest.raises(bm.AssemblyError) as caught:
        bm.Graph.from_data(changed(path, written)).run(at=1.0)
    message = str(caught.value)
    assert remedy in message
    assert slip in message
    assert "margin" not in message


@pytest.mark.parametrize("link", ["frame", "crank", "coupler", "rocker"])
def test_places_in_mm_on_a_link_of_a_document_are_recognised(link: str) -> None:
    document = copy.deepcopy(LINKAGE)
    for joint in document["joints"].values():
        for k, name in enumerate(joint["links"]):
            joint["at"][k] = [x * (1000 if name == link else 1) for x in joint["at"][k]]
    with pytest.raises(bm.GraphError) as caught:
        bm.Linkage.from_data(document).compile()
    (problem,) = caught.value.problems
    assert problem.code == "does-not-close"
    assert f"close with the places on {link} 1000 times smaller" in problem.remedy
    long = changed("joints/C/at/0", [16.0, 0.0], LINKAGE)
    with pytest.raises(bm.GraphError, match="check the places of C on coupler and rocker"):
        bm.Linkage.from_data(long).compile()


def test_a_group_that_misses_by_a_little_says_how_much_and_suspects_nothing() -> None:
    graph = bm.Graph.from_data(changed("blocks/dyad/l_i", 2.0))
    with pytest.raises(bm.AssemblyError) as caught:
        graph.run(at=2.5)
    apart = abs(2 * np.exp(2.5j) - 5.5)
    message = str(caught.value)
    assert f"{apart:.6g} m, {apart - 5:.4g} m too large: its lengths allow 1 to 5 m" in message
    assert "1000" not in message


def test_check_and_limits_tell_it_too(call: Any, tmp_path: Path) -> None:
    file = tmp_path / "mm.json"
    file.write_text(json.dumps(changed("blocks/crank/length", 2000.0)), "utf-8")
    checked, limits, run = call("check", file), call("limits", file), call("run", file)
    assert (checked.code, limits.code, run.code) == (0, 0, 1)
    for message in (checked.err, limits.out, run.out):
        assert "crank.length 1000 times smaller" in message
    assert json.loads(call("check", file, "--json").out)["remarks"]


def test_the_command_line_says_how_much_friction_could_be_overcome(
    call: Any, tmp_path: Path
) -> None:
    file = tmp_path / "locked.json"
    file.write_text(json.dumps(changed("blocks/dyad/friction/C/coefficient", 400.0)), "utf-8")
    with pytest.raises(bm.FrictionError) as caught:
        bm.Graph.load(file).run(samples=5, want="crank.drive")
    outcome = call("run", file, "--samples", "5", "--want", "crank.drive")
    (part,) = [p for p in str(caught.value).split("(") if "times the friction" in p]
    assert part.split(")")[0] in outcome.out


# ---- tables ------------------------------------------------------------------------------


def test_tables_keep_the_order_asked_for_and_name_friction_where_there_is_some() -> None:
    result = bm.Graph.from_data(RUIZ).run(at=1.0, want=["dyad.C.p", "crank.drive"])
    head = str(result).splitlines()
    assert head[0].endswith("friction newton")
    assert head[2].index("dyad") < head[2].rindex("crank")
    smooth = bm.Graph.load(GRAPHS / "slider_crank.json").run(at=1.0)
    assert "friction newton" not in str(smooth)


@pytest.mark.parametrize(
    ("links", "note"),
    [
        ({}, "no link has mass or inertia"),
        ({"links": {"i": bm.Link(mass=2.0)}}, "dyad.i turn with mass and no inertia"),
        ({"links": {"i": bm.Link(mass=2.0, inertia=1.0)}}, ""),
    ],
)
def test_missing_inertia_is_one_note_where_a_force_is_asked(links: Any, note: str) -> None:
    g = bm.Graph("fourbar", drive={"crank": bm.motion.ConstantRate(rate=1.0)})
    g.add("frame", bm.Frame(markers={"A": (0, 0), "D": (5.5, 0)}))
    g.add("crank", bm.Crank(length=2.0))
    g.add("dyad", bm.RRR(l_i=6.0, l_j=3.0, **links))
    wire(g, "frame.A crank.A", "crank.B dyad.B", "frame.D dyad.D")
    noted = [x for x in str(g.run(at=1.0, want="crank.drive")).splitlines() if "note:" in x]
    assert len(noted) == bool(note)
    assert all(note in line for line in noted)
    assert "note:" not in str(g.run(at=1.0, want="dyad.C.p"))
