"""PMKS: text and JSON of the program, and the expressions of Pyslvs, which say the same.

A joint is a line: names of its links, its type, a place, an angle in degrees, flags. ``ground`` is
the frame. R is a pin, P slides without turning, RP is a pin in a slot of the first link, G is the
pitch point of two gear wheels.

Sources: DesignEngrLab/PMKS, ``Simulator.Main.cs`` and its examples; KmolYuan/Pyslvs-UI,
``docs/introduction.md``.
"""

from __future__ import annotations

import math
import re
from typing import NamedTuple

from blockmech.exchange.drawing import FRAME, Drawing, Drive, Pair, Slot, Wheels
from blockmech.exchange.formats import Reader
from blockmech.exchange.parsing import json_of, number, record_of_json, wrong

TYPES = ("R", "P", "RP", "G")
GROUND = "ground"
LOOKS = {"Links", "OffsetAngle", "Pathvisible", "Velocityvisible", "Accelvisible", "IsGround"}
LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"
JOINT = re.compile(
    r"J\[\s*(?P<type>\w+)\s*,(?:\s*A\[(?P<angle>[^\]]*)\]\s*,)?\s*(?:color\[[^\]]*\]\s*,)?"
    r"\s*P\[(?P<x>[^,\]]*),(?P<y>[^\]]*)\]\s*,\s*L\[(?P<links>[^\]]*)\]\s*\]"
)


class Row(NamedTuple):
    """A joint as all three have it."""

    links: list[str]
    kind: str
    at: complex
    angle: float  # [rad]
    driven: bool
    name: str


def drawing_of(rows: list[Row], where: str, rate: float = 1.0) -> Drawing:
    """The drawing of joints; the driver is the flagged one, else the link called input."""
    drawing = Drawing(where, source="")
    for row in rows:
        for link in row.links:
            if link != GROUND:
                drawing.links.setdefault(link, [])
    for row in rows:
        if row.links:
            _take(row, drawing)
        else:
            drawing.note(f"joint {row.name} is on no link: left out")
    if not any(row.driven for row in rows):
        pins = [r for r in rows if GROUND in r.links and r.kind == "R" and len(r.links) > 1]
        pins.sort(key=lambda r: "input" not in r.links)
        if pins:
            drawing.drives[pins[0].name] = Drive(rate)
            drawing.note(f"no joint is marked as the input: {pins[0].name} was taken")
    for row in rows:
        if row.driven:
            slides = row.kind != "R"
            drawing.drives[row.name] = Drive(rate, 0.0, None) if slides else Drive(rate)
    return drawing


def _take(row: Row, drawing: Drawing) -> None:
    moving = [link for link in row.links if link != GROUND]
    first, *rest = [FRAME if link == GROUND else link for link in row.links]
    if row.kind == "G":
        name = f"gear joint {row.name} between {' and '.join(row.links)}"
        if len(moving) == 2:
            drawing.wheels.append(Wheels(name, moving[0], moving[1], pitch=row.at))
        else:
            drawing.note(f"{name}: left out")
        return
    if row.kind == "P" and rest:
        for partner in rest:
            pair = (first, partner) if partner != FRAME else (partner, first)
            drive = Drive(1.0, 0.0, None) if row.driven else None
            drawing.pairs.append(Pair(*pair, row.at, row.angle, drive))
        if row.driven:
            drawing.note(f"the drive of {row.name} has no stroke in the file")
        return
    drawing.points[row.name] = row.at
    if row.kind == "RP" and rest:
        drawing.slots[row.name] = [Slot(row.angle, first)]
        moving = [link for link in moving if link != first]
        if first == FRAME:
            rest = []
    if GROUND in row.links and (row.kind != "RP" or FRAME in rest):
        drawing.fixed.add(row.name)
    for link in moving:
        drawing.links[link].append(row.name)


def _name(i: int) -> str:
    return LETTERS[i] if i < len(LETTERS) else f"J{i}"


def _kind(raw: object, where: str) -> str:
    kind = str(raw).upper()
    if kind not in TYPES:
        raise wrong(where, f'no joint type "{raw}"', f"types: {', '.join(TYPES)}")
    return kind


def read_text(text: str, where: str) -> Drawing:
    """A line for each joint."""
    rows, notes = list[Row](), list[str]()
    body = text.partition("mech=")[2] if "mech=" in text else text
    for line in body.splitlines():
        tokens = [w for w in re.split(r"[,\s]+", line.strip()) if w]
        if not tokens or line.lstrip().startswith("#"):
            continue
        at = f"{where}, joint {len(rows) + 1}"
        indices = [
            i for i, w in enumerate(tokens) if i and w.upper() in TYPES and len(tokens) > i + 2
        ]
        if not indices:
            raise wrong(at, f'"{line.strip()[:60]}" has no type', "links, type, x, y")
        i = indices[-1]
        values = [w for w in tokens[i + 1 :] if not re.fullmatch(r"[tf+\-]{1,4}", w)]
        flags = [w for w in tokens[i + 1 :] if re.fullmatch(r"[tf+\-]{4}", w)]
        x, y, *rest = [number(w, at) for w in values[:3]]
        notes += [f"joint {_name(len(rows))}: {w[:20]}: left out" for w in values[3:]]
        angle = math.radians(rest[0]) if rest else 0.0
        driven = bool(flags) and flags[0][3] in "t+"
        kind = _kind(tokens[i], at)
        rows.append(Row(tokens[:i], kind, complex(x, y), angle, driven, _name(len(rows))))
    drawing = drawing_of(rows, where)
    drawing.notes += notes
    return drawing


def read_json(text: str, where: str) -> Drawing:
    """``Joints`` with their links, ``DrivingIndex`` and ``InputSpeed``."""
    root = record_of_json(json_of(text, where), "file", where)
    driving = int(root.number("DrivingIndex", -1.0))
    rows = list[Row]()
    for i, record in enumerate(root.all("Joints")):
        record.where = f"{where}, Joints[{i}]"
        position = complex(record.number("X"), record.number("Y"))
        angle = math.radians(record.number("Angle", 0.0))
        kind = _kind(record.get("TypeOfJoint", "R"), record.where)
        links = [link.text for link in record.all("Links")]
        rows.append(Row(links, kind, position, angle, i == driving, _name(i)))
    drawing = drawing_of(rows, root.get("Name") or where, root.number("InputSpeed", 1.0))
    drawing.notes += root.unread(LOOKS)
    return drawing


def read_expression(text: str, where: str) -> Drawing:
    """``M[J[R, color[Green], P[0.0, 0.0], L[ground, link_0]], ...]``."""
    rows: list[Row] = []
    end = 0
    for match in JOINT.finditer(text):
        end = match.end()
        at = f"{where}, joint {len(rows)}"
        links = [w.strip() for w in match["links"].split(",") if w.strip()]
        position = complex(number(match["x"].strip(), at), number(match["y"].strip(), at))
        angle = math.radians(number((match["angle"] or "").strip(), at, 0.0))
        rows.append(Row(links, _kind(match["type"], at), position, angle, False, _name(len(rows))))
    if text.count("J[") != len(rows) or text[end:].strip() != "]":
        raise wrong(where, f"joint {len(rows)} cannot be read", "J[type, P[x, y], L[links]]")
    return drawing_of(rows, where)


def _is_text(text: str) -> bool:
    lines = [line for line in text.splitlines() if line.strip()][:3]
    row = re.compile(r"^\s*(mech=.*|[\w \-,]+[,\s](R|P|RP|G)[,\s]+-?[\d.].*)$", re.IGNORECASE)
    return bool(lines) and all(row.match(line) for line in lines)


TEXT = Reader("PMKS: a line for each joint", (".txt",), _is_text, read_text)
JSON = Reader("PMKS: joints as JSON", (".pmks",), lambda text: '"TypeOfJoint"' in text, read_json)
EXPRESSION = Reader(
    "Pyslvs: an expression M[J[...], ...]",
    (".pyslvs",),
    lambda text: bool(re.match(r"\s*M\[\s*J\[", text)),
    read_expression,
)
