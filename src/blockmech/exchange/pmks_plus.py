"""PMKS+: the address of a drawing, which has the whole mechanism behind its question mark.

Groups stand between dots: four of settings, then joints, an empty one, links, an empty one, forces,
an empty one, what is selected, marks, and a character that counts the length. Numbers are of base
64, a leading 0 is a minus, decimals are thousandths. Of addresses before 2023, ``?j=...&l=...``,
joints, links, forces and settings are lines of words.

A joint that slides has a line of the frame by its angle, or one of a moving link by two joints of
that link, which goes through both. It is pinned to the links at it, or rigid with them where it is
welded; until 2026 by a block without length, a link of its kind. Links that are welded at a joint
are one. Masses and forces have the units of the lengths: cm, g, kg cm2, N; m, kg, kg m2, N; or in,
lbm, lbm in2, lbf.

Source: PMKS-Web/PMKSWeb, ``src/app/services/transcoding``, ``model/unit-conversions.ts``; for old
addresses ``toolbar.component.ts`` and ``url-processor.service.ts`` of 2022.
"""

from __future__ import annotations

import cmath
import math
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import NamedTuple
from urllib.parse import unquote

from blockmech.exchange.drawing import (
    FRAME,
    STEP,
    Drawing,
    Drive,
    Inertia,
    Load,
    Slot,
    Weld,
    direction,
)
from blockmech.exchange.formats import Reader
from blockmech.exchange.parsing import number, wrong
from blockmech.ground.errors import listed
from blockmech.ground.names import is_name
from blockmech.ground.units import GRAVITY, INCH, POUND

DIGITS = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz_-"
COUNTED = DIGITS[:62]  # what the last character may be
PRISMATIC, INPUT, GROUNDED, WELDED, CURVE, SEALED = (1 << k for k in range(6))
ROOTS, PARTS = "YAMG0123", "NamgN4567"  # a link, or one that is welded into another
CLOCKWISE, NO_GRAVITY = 1 << 0, 1 << 8  # among the settings
MARKS = "JLFCSKH"  # what the last group has of locks, anchors, synthesis, colours and holds
RPM = math.tau / 60
SLIDING = 5.0  # lengths per second of a drive that slides, where the address is older than that


class Units(NamedTuple):
    """Units of an address: of lengths by name, the others in SI."""

    length: str
    mass: float
    inertia: float
    force: float


UNITS = {
    "0": Units("in", float(POUND), float(POUND * INCH**2), float(POUND * GRAVITY)),
    "1": Units("cm", 1e-3, 1e-4, 1.0),
    "2": Units("m", 1.0, 1.0, 1.0),
}
UNNAMED = Units("", 1.0, 1.0, 1.0)


class Joint(NamedTuple):
    """A joint as it is written; its line by an angle [rad], or carrier and two of its joints."""

    key: str
    flags: int
    at: complex
    angle: float
    line: list[str]
    speed: float = 0.0
    mass: float = 0.0

    def has(self, flag: int) -> bool:
        """Whether a flag is set."""
        return bool(self.flags & flag)


class Bar(NamedTuple):
    """A link as it is written, or the block of a slider; parts are links that are welded in it."""

    key: str
    block: bool
    body: Inertia
    joints: list[str]
    parts: list[str]
    root: bool


@dataclass
class Address:
    """What an address says, whatever its age; rates [rad/s, length/s] with their sense."""

    units: Units = UNNAMED
    turning: float = 10 * RPM
    sliding: float = SLIDING
    gravity: bool = True
    joints: dict[str, Joint] = field(default_factory=dict)
    bars: dict[str, Bar] = field(default_factory=dict)
    loads: list[Load] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    labels: dict[str, dict[str, str]] = field(default_factory=lambda: {"joint": {}, "link": {}})

    def relabelled(self) -> Address:
        """The same with labels for names, where all of a kind are names and no two alike."""
        for kind, keys in (("joint", self.joints), ("link", self.bars)):
            labels = self.labels[kind]
            names = [labels.get(key, key) for key in keys]
            if len({*names}) < len(names) or FRAME in names or not all(map(is_name, names)):
                changed = (item for item in labels.items() if item[0] != item[1])
                self.notes += [f"{kind} {key} is called {x[:40]} there" for key, x in changed]
                labels.clear()

        def named(kind: str, keys: Iterable[str]) -> list[str]:
            return [self.labels[kind].get(key, key) for key in keys]

        joints = [
            x._replace(key=key, line=[*named("link", x.line[:1]), *named("joint", x.line[1:])])
            for key, x in zip(named("joint", self.joints), self.joints.values(), strict=True)
        ]
        bars = [
            x._replace(key=key, joints=named("joint", x.joints), parts=named("link", x.parts))
            for key, x in zip(named("link", self.bars), self.bars.values(), strict=True)
        ]
        self.joints, self.bars = {x.key: x for x in joints}, {x.key: x for x in bars}
        self.loads = [x._replace(link=link) for x in self.loads for link in named("link", [x.link])]
        return self

    def push(
        self, key: str, link: str, ends: tuple[complex, complex], flags: int, size: float
    ) -> None:
        """Add a force between two places: 1 turns with its link, 2 points away from its own."""
        start, end = ends
        arrow = end - start if flags & 2 else start - end
        if not arrow:
            self.notes.append(f"force {key} has no direction: left out")
            return
        force = cmath.rect(size * self.units.force, cmath.phase(arrow))
        self.loads.append(Load(key, link, start, force, bool(flags & 1)))


class Tokens:
    """The words of a record, which its reader takes one by one; what is left it tells."""

    def __init__(self, text: str, name: str, address: Address, where: str) -> None:
        self.words, self.name, self.address = text.split(","), name, address
        self.where = f"{where}, {name}"

    def word(self, valid: str = "") -> str:
        """The next word, "" behind the last. Raises `FormatError` where something must stand."""
        word = self.words.pop(0).strip() if self.words else ""
        if valid and not word:
            raise wrong(self.where, "it ends too early", valid)
        return word

    def integer(self, default: str = "0") -> int:
        """A whole number of base 64, signed."""
        return _integer(self.word() or default, self.where)

    def decimal(self) -> float:
        """A number in thousandths."""
        return self.integer() / 1000

    def point(self) -> complex:
        """Two numbers in thousandths."""
        return complex(self.decimal(), self.decimal())

    def number(self, default: float | None = None) -> float:
        """A number as it is printed."""
        word = self.word()
        return number("" if word == "Null" else word, self.where, default)

    def yes(self) -> bool:
        """A word that is t or true."""
        return self.word().lower() in ("t", "true")

    def finish(self) -> None:
        """Tell what nobody took."""
        if any(self.words):
            unread = listed([w[:20] for w in self.words if w])
            self.address.notes.append(f"{self.name}: {unread}: left out")


def _integer(text: str, where: str, signed: bool = True) -> int:
    negative = signed and len(text) > 1 and text[0] == "0"
    digits = text[1:] if negative else text
    if not digits or any(c not in DIGITS for c in digits) or len(digits) > 10:
        raise wrong(where, f'"{text[:20]}" is not a number of base 64')
    value = 0
    for c in digits:
        value = 64 * value + DIGITS.index(c)
    return -value if negative else value


def code_of(text: str) -> str:
    """What stands behind the question mark."""
    line = text.strip().partition("\nleft out")[0]
    if line.startswith("[InternetShortcut]"):
        line = line.partition("URL=")[2].partition("\n")[0]
    match = re.search(r"https?://\S*?\?(.*)", line, re.DOTALL)
    return unquote(match[1] if match else line.removeprefix("?")).strip()


def read(text: str, where: str) -> Drawing:
    """The drawing of an address."""
    code = code_of(text)
    old = re.match(r"j=.*&l=", code, re.DOTALL)
    return drawing_of(_old(code, where) if old else _new(code, where), where)


def _groups(code: str, where: str) -> tuple[list[str], list[list[str]], list[str]]:
    """Settings, the groups of joints, links and forces, and what stands behind."""
    parts = code.split(".")
    settings, rest = parts[:4], parts[4:]
    groups: list[list[str]] = [[]]
    while rest and len(groups) < 4:
        if part := rest.pop(0):
            groups[-1].append(part)
        else:
            groups.append([])
    if len(groups) < 3 or not groups[0]:
        raise wrong(where, "the address ends too early", "all of it, up to its last character")
    return settings, groups[:3], rest


def _new(code: str, where: str) -> Address:
    if len(code) > 1 and COUNTED[(len(code) - 1) % 62] != code[-1]:
        raise wrong(where, "the address is not whole: its last character does not count the rest")
    settings, groups, rest = _groups(code[:-1], where)
    address = Address(units=UNITS.get(settings[3][:1], UNITS["1"]))
    if settings[3][2:3] == "3" and settings[3][:1] != "0":
        address.units = address.units._replace(force=float(GRAVITY))
    flags = _integer(settings[0], where, signed=False)
    sense = -1 if flags & CLOCKWISE else 1
    address.gravity = not flags & NO_GRAVITY
    lengths = Tokens(settings[1], "settings", address, where)
    lengths.decimal()  # the scale of the picture
    address.sliding = sense * (abs(lengths.decimal()) or SLIDING)
    speeds = Tokens(settings[2], "settings", address, where)
    address.turning = sense * abs(speeds.integer("A")) * RPM
    for raw in groups[0]:
        _new_joint(raw, address, where)
    for raw in groups[1]:
        _new_bar(raw, address, where)
    for k, raw in enumerate(groups[2], 1):
        tokens = Tokens(raw, f"force {k}", address, where)
        token, link, _ = tokens.word("flags and id"), tokens.word("a link"), tokens.word()
        ends, kind = (tokens.point(), tokens.point()), _integer(token[0], where, signed=False)
        address.push(token[1:], link, ends, kind, tokens.decimal())
        tokens.finish()
    for mark in ",".join(rest[1:]).split(","):
        if mark[:1] == "P":
            address.notes.append("digits beyond thousandths: left out")
        elif mark[:1] not in MARKS:
            address.notes.append(f"mark {mark[:20]}: left out")
    return address.relabelled()


def _new_joint(raw: str, address: Address, where: str) -> None:
    tokens = Tokens(raw, f"joint {len(address.joints) + 1}", address, where)
    token, label = tokens.word("flags and id"), tokens.word("id, name, x, y, angle")
    flags, key = _integer(token[0], tokens.where, signed=False), token[1:]
    at, angle, line = tokens.point(), tokens.decimal(), [tokens.word() for _ in range(3)]
    speed, mass = tokens.decimal(), tokens.decimal()
    if not key or key in address.joints:
        raise wrong(tokens.where, f'"{key}" is no id, or one of two', "ids of their own")
    if tokens.word() not in ("", "0") or (flags & PRISMATIC and flags & SEALED):
        flags |= WELDED  # the rod of a cylinder does not turn in it
    address.joints[key] = Joint(key, flags, at, angle, line if any(line) else [], speed, mass)
    address.labels["joint"][key] = label or key
    tokens.finish()


def _new_bar(raw: str, address: Address, where: str) -> None:
    tokens = Tokens(raw, f"link {len(address.bars) + 1}", address, where)
    token, label = tokens.word("flags and id"), tokens.word("id, name, mass, inertia, ...")
    if len(token) < 3 or token[0] not in ROOTS + PARTS or token[1] not in "RP":
        raise wrong(tokens.where, f'"{token[:20]}" is no link', f"one of {ROOTS}{PARTS}, R or P")
    mass, inertia, cm = tokens.decimal(), tokens.decimal(), tokens.point()
    tokens.word()  # colour
    joints, parts = [], []
    while word := tokens.word():
        joints.append(word)
    while word := tokens.word():
        parts.append(word)
    units, key = address.units, token[2:]
    body = Inertia(mass * units.mass, inertia * units.inertia, cm)
    if key in address.bars:
        raise wrong(tokens.where, f'there are two links "{key}"')
    address.bars[key] = Bar(key, token[1] == "P", body, joints, parts, token[0] in ROOTS)
    address.labels["link"][key] = label or key
    tokens.finish()


# -- addresses before 2023 ---------------------------------------------------------------------


def _old(code: str, where: str) -> Address:
    """Lines of words: joints, links, forces, settings; of two orders, which the words tell."""
    sections = dict(re.findall(r"(?:^|&)(\w+)=([^&]*)", code))
    address = Address()
    tokens = Tokens(sections.pop("s", ""), "settings", address, where)
    speed, clockwise = tokens.number(10.0), tokens.yes()
    address.turning = (-1 if clockwise else 1) * speed * RPM
    address.sliding = (-1 if clockwise else 1) * SLIDING
    address.gravity = tokens.yes()
    unit = tokens.word().lower()
    address.units = {"cm": UNITS["1"], "m": UNITS["2"], "in": UNITS["0"]}.get(unit[:2], UNITS["1"])
    tokens.finish()
    blocks: dict[str, list[str]] = {}
    readers: dict[str, Callable[[Tokens, Address], None]] = {"l": _old_bar, "f": _old_push}
    for raw in _lines(sections.pop("j")):
        tokens = Tokens(raw, f"joint {len(address.joints) + 1}", address, where)
        _old_joint(tokens, address, blocks)
        tokens.finish()
    for section, names in (("l", "link"), ("f", "force")):
        for k, raw in enumerate(_lines(sections.pop(section, "")), 1):
            tokens = Tokens(raw, f"{names} {k}", address, where)
            readers[section](tokens, address)
            tokens.finish()
    for key, joints in blocks.items():  # blocks of sliders were not written as links then
        if key not in address.bars:
            at = address.joints[joints[0]].at
            address.bars[key] = Bar(key, True, Inertia(0.0, 0.0, at), joints, [], True)
    address.notes += [f"{key}={body[:20]}: left out" for key, body in sections.items() if body]
    return address


def _lines(text: str) -> list[str]:
    return [line for line in text.replace("%0A", "\n").splitlines() if line.strip(" ,")]


def _old_joint(tokens: Tokens, address: Address, blocks: dict[str, list[str]]) -> None:
    key, at = tokens.word("id, x, y, links, type"), complex(tokens.number(), tokens.number())
    links, kind = tokens.word().split("|"), tokens.word("R or P")
    if kind[0] not in "RP":
        raise wrong(tokens.where, f'no joint type "{kind[:20]}"', "R or P")
    flags = [PRISMATIC * (kind[0] == "P")]
    angle = number(kind[1:], tokens.where, 0.0)
    for flag in (GROUNDED, INPUT):  # the angle stands between them, or behind
        if tokens.words and re.fullmatch(r"-?[\d.e-]+|Null", tokens.words[0].strip()):
            angle = tokens.number(0.0)
        flags.append(flag * tokens.yes())
    angle = tokens.number(angle)
    if key in address.joints:
        raise wrong(tokens.where, f'there are two joints "{key}"')
    address.joints[key] = Joint(key, sum(flags), at, angle, [])
    for link in filter(None, links):
        blocks.setdefault(link, []).append(key)


def _old_bar(tokens: Tokens, address: Address) -> None:
    key, block = tokens.word("id, mass, inertia, ..."), False
    if tokens.words and tokens.words[0].strip() in "RP":
        block = tokens.word() == "P"
    mass, inertia = tokens.number(0.0), tokens.number(0.0)
    cm = complex(tokens.number(0.0), tokens.number(0.0))
    joints = [x for x in tokens.word("joints").split("|") if x]
    tokens.words = []  # forces, which say it themselves, and how it is drawn
    units = address.units
    body = Inertia(mass * units.mass, inertia * units.inertia, cm)
    address.bars[key] = Bar(key, block, body, joints, [], True)


def _old_push(tokens: Tokens, address: Address) -> None:
    key, link = tokens.word("id"), tokens.word("a link")
    start, end = (complex(tokens.number(), tokens.number()) for _ in range(2))
    flags = (not tokens.yes()) | 2 * tokens.yes()
    address.push(key, link, (start, end), flags, tokens.number())


# -- what they mean ----------------------------------------------------------------------------


def drawing_of(address: Address, where: str) -> Drawing:
    """The drawing of what an address says. Raises `FormatError` for what does not fit."""
    drawing = Drawing("pmks_plus", address.units.length, "PMKS+ address")
    drawing.gravity = -9.81j if address.gravity else 0j
    joints, bars = address.joints, address.bars
    for bar in bars.values():
        for kind, keys, valid in ("joint", bar.joints, joints), ("link", bar.parts, bars):
            if unknown := [key for key in keys if key not in valid]:
                message = f"no {kind} {listed(unknown)}"
                raise wrong(f"{where}, link {bar.key}", message, f"{kind}s: {listed(valid)}")
    roots = {bar.key: bar for bar in bars.values() if bar.root}
    root_of = {part: bar.key for bar in roots.values() for part in bar.parts}
    slid, pins = _blocks(address, roots)
    for key, bar in roots.items():
        drawing.links[key] = list(bar.joints)
        drawing.inertias[key] = (
            bar.body._replace(cm=joints[bar.joints[0]].at) if key in slid else bar.body
        )
    drawing.points = {joint.key: joint.at for joint in joints.values()}
    for joint in joints.values():
        if joint.has(PRISMATIC):
            _slide(joint, address, drawing, {v: k for k, v in slid.items()}, root_of, where)
        slide = joints[pins.get(joint.key, joint.key)]
        if joint.has(GROUNDED) and bool(slide.line) == slide.has(PRISMATIC):
            drawing.fixed.add(slide.key if slide.line else joint.key)
        if joint.has(INPUT):
            driven = joints[pins.get(joint.key, joint.key)]
            drawing.drives[driven.key] = _drive(joint, driven, address, drawing)
    for joint in joints.values():
        if joint.has(WELDED):
            drawing.welds += _welds(joint, roots, bars, drawing)
    drawing.loads = [x._replace(link=root_of.get(x.link, x.link)) for x in address.loads]
    drawing.notes += list(dict.fromkeys(address.notes))
    return drawing


def _blocks(address: Address, roots: dict[str, Bar]) -> tuple[dict[str, str], dict[str, str]]:
    """Block -> the joint that slides with it, and pin of a block -> the same."""
    slid, pins = {}, {}
    for key, bar in roots.items():
        sliding = [p for p in bar.joints if address.joints[p].has(PRISMATIC)]
        if bar.block and len(sliding) == 1:
            slid[key] = sliding[0]
            pins.update({p: sliding[0] for p in bar.joints if p != sliding[0]})
    return slid, pins


def _slide(
    joint: Joint,
    address: Address,
    drawing: Drawing,
    block_of: dict[str, str],
    root_of: dict[str, str],
    where: str,
) -> None:
    at, (carrier, *ends) = f"{where}, joint {joint.key}", joint.line or [""]
    slot = Slot(joint.angle)
    if joint.line:
        bar = address.bars.get(carrier)
        if bar is None or len(set(ends)) < 2 or not set(ends) <= {*bar.joints}:
            message = f"its slot is {listed([x or '?' for x in joint.line])}"
            raise wrong(at, message, "a link and two of its joints", "copy the whole address")
        if joint.key in bar.joints:
            raise wrong(at, "it slides on its own link", "a slot of another link")
        a, b = (address.joints[p].at for p in ends)
        slot = Slot(direction(a, b, at), root_of.get(carrier, carrier), "", a)
    rider = block_of.get(joint.key, "")
    if not rider and joint.has(WELDED):
        rider = next(iter(drawing.meeting()[joint.key]), "")
    elif not rider and joint.mass:
        rider = f"block_{joint.key}"
        drawing.links[rider] = [joint.key]
        drawing.inertias[rider] = Inertia(joint.mass * address.units.mass, 0.0, joint.at)
    drawing.slots[joint.key] = [slot._replace(rider=rider)]


def _drive(joint: Joint, driven: Joint, address: Address, drawing: Drawing) -> Drive:
    speed = joint.speed or driven.speed
    if not driven.has(PRISMATIC):
        return Drive(speed * RPM or address.turning)
    rate = speed or address.sliding
    points = [j.at for j in address.joints.values()]
    stroke = math.copysign(STEP * max(abs(z - points[0]) for z in points), rate)
    drawing.note(f"the drive of {driven.key} has no stroke in the address: {stroke:.3g} was taken")
    return Drive(rate, 0.0, stroke)


def _welds(
    joint: Joint, roots: dict[str, Bar], bars: dict[str, Bar], drawing: Drawing
) -> Iterator[Weld]:
    """Welds of the links that meet at a joint: a compound link and blocks, or without one all."""
    key, members = joint.key, [x for x in drawing.meeting()[joint.key] if x != FRAME]
    compounds = [
        name
        for name in members
        if name in roots and sum(key in bars[part].joints for part in roots[name].parts) > 1
    ]
    if compounds:
        members = [x for x in members if x in compounds or (x in roots and roots[x].block)]
    members.sort(key=lambda x: x in roots and roots[x].block)
    return (Weld(key, members[0], link, joint.at) for link in members[1:])


def recognises(text: str) -> bool:
    """An address of PMKS+, or what stands behind its question mark."""
    word = text.strip().partition("\nleft out")[0]
    code = r"[\w\-]+\.[\w\-,]*\.[\w\-,]*\.\d{1,6}\.[\w\-,. %#~]+"
    old = r"\??j=[^&]*&l=.*"
    if word.startswith("[InternetShortcut]"):
        word = word.partition("URL=")[2].strip()
    return bool(re.fullmatch(rf"(https?://\S*\?)?({code}|{old})", word, re.DOTALL))


READER = Reader("PMKS+: the address of a drawing", (".pmksplus", ".url"), recognises, read)
