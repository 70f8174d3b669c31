"""Drawings of every format: positions by distances alone, and nothing that is read past.

Files and places in tests/data/drawings are of `tests.exchange.corpus`; places are those of
`tests.exchange.distances` over 24 poses of the crank.
"""

import json
import random
import re

import numpy as np
import pytest

import blockmech as bm
from blockmech.exchange.reading import imported
from blockmech.ground.errors import FormatError
from tests.exchange.corpus import FOLDER, MACHINES, drawings
from tests.exchange.distances import turn

PLACES = json.loads((FOLDER / "places.json").read_text("utf-8"))
DRAWINGS = drawings()
EXACT = 1e-9  # of the drawing's size
UNITLESS = (".txt", ".pmks", ".pyslvs", ".json")


def read(name):
    unit = {"unit": "mm"} if name.endswith(UNITLESS) else {}
    return bm.read(FOLDER / name, **unit)


def names_of(name, machine):
    """What points of a machine are called in a drawing of it: numbers, or by their order."""
    keys = list(machine.points)
    if name.endswith("linkage2"):
        return {key: str(k) for k, key in enumerate(keys)}
    if name.endswith(("svg", "dxf")):
        order = dict.fromkeys([*machine.fixed, *"".join(machine.links.values())])
        return {key: chr(ord("A") + k) for k, key in enumerate(order)}
    if name.endswith(("txt", "pmks", "pyslvs")):
        return {key: chr(ord("A") + k) for k, key in enumerate(keys)}
    return {key: key for key in keys}


def test_the_files_are_what_the_corpus_writes():
    assert len(DRAWINGS) >= 120
    for name, (_, text, _) in DRAWINGS.items():
        assert (FOLDER / name).read_text("utf-8") == text, name


@pytest.mark.parametrize("name", DRAWINGS)
def test_positions_are_those_of_the_distances(name):
    key, _, unit = DRAWINGS[name]
    machine, linkage = MACHINES[key], read(name)
    assert not linkage.check()
    assert len(linkage.drivers) == 1  # mobility 1
    run = linkage.run(at=turn(), want=["joint.*.p", "link.*.p"])
    positions = {}
    for output in run:
        parts = output.split(".")
        if parts[0] == "joint" or len(parts) == 4:
            positions.setdefault(parts[-2], run[output])
    size = max(abs(a - b) for a in machine.points.values() for b in machine.points.values())
    called, compared = names_of(name, machine), 0
    for point, row in PLACES[key].items():
        if called[point] not in positions:
            continue
        expected = np.array([complex(*z) for z in row])
        assert np.abs(positions[called[point]] / unit - expected).max() < EXACT * size, point
        compared += point not in machine.fixed
    jointed = name.endswith(("asmt", "mjcf", "urdf", "sdf"))  # these have joints alone
    joined = [
        p for p in machine.points if sum(p in corners for corners in machine.links.values()) > 1
    ]
    assert compared >= (len(joined) if jointed else len(machine.points) - len(machine.fixed))


def notes_of(text):
    return imported(text).get("notes", [])


ADDED = {  # format -> what finds a place for a thing that nobody knows, and how the note begins
    "linkage2": ('<connector id="0"', '<connector quirk="7" id="0"', "connector quirk"),
    "mjcf": ('type="capsule"', 'quirk="7" type="capsule"', "geom quirk"),
    "urdf": ("</robot>", "<quirk/></robot>", "quirk"),
    "sdf": ("</model>", "<quirk/></model>", "quirk"),
    "asmt": ("\tConstraintSets\n", "\tQuirk\n\t\t7\n\tConstraintSets\n", "Quirk"),
    "json": ('"id": "B"', '"quirk": 7, "id": "B"', "joints quirk"),
    "pmks": ('"X": 0.0', '"Quirk": 7, "X": 0.0', "Joints Quirk"),
    "txt": ("0.0,0.0,0.0,tfft", "0.0,0.0,0.0,7,tfft", "joint A: 7"),
}


@pytest.mark.parametrize("suffix", ADDED)
def test_what_nobody_knows_is_a_note_that_names_it(suffix):
    text = DRAWINGS[f"rocker.{suffix}"][1]
    before, after, message = ADDED[suffix]
    assert before in text
    fresh = set(notes_of(text.replace(before, after))) - set(notes_of(text))
    assert [note for note in fresh if note.startswith(message) and "left out" in note], fresh


def stamped(code):
    """An address whose last character counts the rest."""
    from blockmech.exchange.pmks_plus import COUNTED

    return code + COUNTED[len(code) % 62]


def test_a_word_too_many_in_an_address_is_a_note():
    code = DRAWINGS["rocker.pmksplus"][1].partition("?")[2][:-1]
    record = re.search(r"0C,C,[^.]*", code)[0]
    assert "joint 3: 7: left out" in notes_of(stamped(code.replace(record, f"{record},,,,,,,7")))
    assert "mark Q7: left out" in notes_of(stamped(f"{code}.Q7"))
    assert "force 1: 7: left out" in notes_of(stamped(code.replace(",Fe..N_", ",Fe,7..N_")))


def fields_of(suffix, text):
    """Spans of the text that are a field of its format."""
    pattern = {
        "asmt": r"^\t*\S+\n",
        "pmksplus": r"(?<=[.,])[\w-]+(?=[.,])",
        "url": r"(?<=[,=])[^,%&]+(?=[,%&])",
        "txt": r"[^,\n]+",
        "pyslvs": r"\w+\[[^\[\]]*\]",
        "pmks": r'"\w+": [^,\[\]{}]+',
        "json": r'"\w+": [^,\[\]{}]+',
        "dxf": r"^.*\n.*\n",
    }.get(suffix, r'\s[\w:]+="[^"]*"|<(\w+)>[^<]*</\1>')
    return [match.span() for match in re.finditer(pattern, text, re.MULTILINE)]


UNREAD = {  # what may be missing without a trace: what is the default, or how parts are drawn
    "asmt": r"OndselSolver|RotationMatrix|drive",
    "dxf": r"0\s+(ENDSEC|EOF)|40\s+0.1",
    "linkage2": r'scalefactor="1"|units="Millimeters"|zoom',
    "mjcf": r'(anchor|pos)="[-0. ]+"|axis="0 0 1"|gravity="0 0 0"',
    "sdf": r"<i[xy][xy]>|<pose>[-0. ]+<|expressed_in|version",
    "svg": r'(cx|cy|x1|x2|y1|y2)="|r="|xmlns',  # zeros, ends of lines
    "txt": r"0\.0|tfff",
    "urdf": r'effort|velocity|i[xyz][xyz]="|name="t"|xyz="[-0. ]+"|xyz="1.0 0.0 0"',
    "url": r"0|10|[A-Z]+[a-z]?(\|[A-Z]+[a-z]?)?|Null|R|f|t|false",  # links of joints stand twice
}


@pytest.mark.parametrize("suffix", sorted({name.rpartition(".")[2] for name in DRAWINGS}))
def test_a_field_that_is_taken_away_is_missed(suffix):
    names = [name for name in DRAWINGS if name in (f"slider.{suffix}", f"rocker.{suffix}")]
    formats = {"pmksplus": "pmks+", "url": "pmks+", "txt": "pmks", "pmks": "pmks-json"}
    formats |= {"linkage2": "linkage", "json": "pylinkage"}
    missed = 0
    for name in names:
        text = DRAWINGS[name][1]
        base = imported(text)
        for a, b in fields_of(suffix, text):
            shorter = text[:a] + text[b:]
            shorter = stamped(shorter[:-1]) if suffix == "pmksplus" else shorter
            try:
                document = imported(shorter, format=formats.get(suffix, suffix))
            except FormatError:
                document = None
            if document == base:
                assert re.match(UNREAD.get(suffix, "$"), text[a:b].strip()), (name, text[a:b])
            missed += document != base
    assert missed > 10


CHANGED = ("", "nan", "-1", "frame", "A", "1e400", "9" * 400, "0", "\u00e9", "..")


def mutations(count, seed):
    """Texts of the corpus with a field removed, changed, doubled, or cut off behind it."""
    chance = random.Random(seed)
    names = sorted(DRAWINGS)
    for _ in range(count):
        name = chance.choice(names)
        text, suffix = DRAWINGS[name][1], name.rpartition(".")[2]
        a, b = chance.choice(fields_of(suffix, text))
        field = text[a:b]
        replacement = chance.choice(["", chance.choice(CHANGED), field * 2, None])
        if replacement is None:
            text = text[:b]
        elif suffix in ("asmt", "dxf") or replacement in ("", field * 2):
            text = text[:a] + replacement + text[b:]
        else:
            text = (
                text[:a]
                + re.sub(r'(?<=[":>\[])[^"\[\]<>]+(?="|$|<|\])|^[\w.-]+$', replacement, field)
                + text[b:]
            )
        if suffix in ("pmksplus",) and chance.random() < 0.9:
            text = stamped(text[:-1])
        yield name, text


def test_mutated_files_are_read_or_one_message(tmp_path):
    outcomes = {"read": 0, "refused": 0}
    for name, text in mutations(2000, 45):
        path = tmp_path / name
        path.write_text(text, "utf-8")
        try:
            document = imported(path)
        except FormatError as refusal:
            error = refusal
            outcomes["refused"] += 1
        else:
            assert document["joints"]
            outcomes["read"] += 1
            continue
        assert len(error.problems) == 1
        assert name in str(error)
    assert min(outcomes.values()) > 200, outcomes
