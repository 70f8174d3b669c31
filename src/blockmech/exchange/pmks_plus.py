"""PMKS+: the address of a drawing, which has the whole mechanism behind its question mark.

Groups stand between dots: four of settings, then joints, an empty one, links, an empty one, forces,
an empty one, and what is selected with a character that counts the length. Numbers are of base 64,
a leading 0 is a minus, decimals are thousandths.

Source: PMKS-Web/PMKSWeb, ``src/app/services/transcoding``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from urllib.parse import unquote

from blockmech.errors import listed
from blockmech.exchange.drawn_linkage import FRAME, Drawing, Drive, Inertia, Load, Slot
from blockmech.exchange.formats import Reader
from blockmech.exchange.parsing import wrong

DIGITS = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz_-"
COUNTED = DIGITS[:62]  # what the last character may be
UNITS = {"0": "in", "1": "cm", "2": "m"}
PRISMATIC, INPUT, GROUNDED, WELDED = (1 << k for k in range(4))
RPM = math.tau / 60


def _whole(text: str, where: str) -> int:
    sign, digits = (-1, text[1:]) if len(text) > 1 and text[0] == "0" else (1, text)
    if not digits or any(c not in DIGITS for c in digits) or len(digits) > 10:
        raise wrong(where, f'"{text[:20]}" is not a number of base 64')
    value = 0
    for c in digits:
        value = 64 * value + DIGITS.index(c)
    return sign * value


def _decimal(text: str, where: str) -> float:
    return _whole(text, where) / 1000


def code_of(text: str) -> str:
    """What stands behind the question mark."""
    return unquote(text.strip().partition("?")[2] or text.strip())


def _groups(code: str, where: str) -> tuple[list[str], list[list[str]]]:
    """Settings, and the groups of joints, links and forces."""
    parts = code.split(".")
    settings, rest = parts[:4], parts[4:]
    groups: list[list[str]] = [[]]
    for k, part in enumerate(rest):
        if part:
            groups[-1].append(part)
        elif len(groups) < 3:
            groups.append([])
        else:
            if k < len(rest) - 2:
                raise wrong(where, "there is more behind the forces than what is selected")
            break
    if len(groups) < 3 or not groups[0]:
        raise wrong(where, "the address ends too early", "all of it, up to its last character")
    return settings, groups


def read(text: str, where: str) -> Drawing:
    """The drawing of an address."""
    code = code_of(text)
    if len(code) > 1 and COUNTED[(len(code) - 1) % 62] != code[-1]:
        raise wrong(where, "the address is not whole: its last character does not count the rest")
    settings, (joints, links, forces) = _groups(code, where)
    ints = settings[2].split(",")
    rpm = abs(_whole(ints[0], where)) if ints[0] else 10
    clockwise = not (DIGITS.find(settings[0][:1]) & 1)
    drawing = Drawing("pmks_plus", UNITS.get(settings[3][:1], ""), "PMKS+ address")
    names: dict[str, str] = {}
    welded = []
    for raw in joints:
        at = f"{where}, joint {len(names) + 1}"
        token, *rest = raw.split(",")
        if len(rest) < 4 or len(token) < 2:
            raise wrong(at, f'"{raw[:40]}" is no joint', "id, name, x, y, angle")
        flags, key = DIGITS.find(token[0]), token[1:]
        x, y, angle = (_decimal(w, at) for w in rest[1:4])
        names[key] = key
        drawing.points[key] = complex(x, y)
        slides = bool(flags & PRISMATIC)
        if flags & GROUNDED and not slides:
            drawing.fixed.add(key)
        if slides:
            carrier = rest[4] if len(rest) > 4 and rest[4] else FRAME
            drawing.slots[key] = [Slot(angle, carrier)]
        if flags & WELDED:
            welded.append(key)
        if flags & INPUT:
            rate = -rpm * RPM if clockwise else rpm * RPM
            drawing.drives[key] = Drive(rpm * 1e-3, 0.0, None) if slides else Drive(rate)
    for name, points in _links(links, names, drawing, where):
        drawing.links[name] = points
    if welded:
        drawing.note(f"welded at {listed(welded)}: links that are welded are one link here")
    for k, raw in enumerate(forces):
        _force(raw, f"{where}, force {k + 1}", drawing)
    return drawing


def _links(
    raws: list[str], names: dict[str, str], drawing: Drawing, where: str
) -> Iterator[tuple[str, list[str]]]:
    """Root links: what is welded of others is one of them."""
    for k, raw in enumerate(raws):
        at = f"{where}, link {k + 1}"
        words = raw.split(",")
        if len(words) < 8 or len(words[0]) < 3:
            raise wrong(at, f'"{raw[:40]}" is no link')
        root, kind, key = words[0][0] == "Y", words[0][1], words[0][2:]
        mass, inertia, x, y = (_decimal(w, at) for w in words[2:6])
        points = []
        for word in words[7:]:
            if not word:
                break
            points.append(word)
        if unknown := [p for p in points if p not in names]:
            raise wrong(at, f"no joint {listed(unknown)}", f"joints: {listed(names)}")
        if not root:
            continue
        if kind == "P":
            drawing.sliders.add(key)
        drawing.inertias[key] = Inertia(mass, inertia, complex(x, y))
        yield key, points


def _force(raw: str, where: str, drawing: Drawing) -> None:
    words = raw.split(",")
    if len(words) < 7 or len(words[0]) < 2:
        raise wrong(where, f'"{raw[:40]}" is no force')
    flags = DIGITS.find(words[0][0])
    *names, sx, sy, ex, ey, size = words
    start, end = (complex(_decimal(a, where), _decimal(b, where)) for a, b in ((sx, sy), (ex, ey)))
    along = end - start if flags & 2 else start - end
    if along:
        force = along / abs(along) * _decimal(size, where)
        drawing.loads.append(Load(words[0][1:], names[1], start, force, bool(flags & 1)))


def recognises(text: str) -> bool:
    """An address of PMKS+, or what stands behind its question mark."""
    word = text.strip()
    if "\n" in word:
        return False
    code = r"\w[\w\-]*\.[\w\-,]*\.[\w\-,]*\.\d{1,6}\.[\w\-,. %]+"
    return bool(re.fullmatch(rf"(https?://\S*\?)?{code}", word))


READER = Reader("PMKS+: the address of a drawing", (".pmksplus", ".url"), recognises, read)
