"""What can be wrong with a graph file, and how its problems are shown."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, replace
from typing import TypeAlias

from blockmech.errors import Problem, close_match, listed
from blockmech.values import shown

Path: TypeAlias = Sequence[str | int]

FILE_CODES: Mapping[str, str] = {
    # the file
    "no-file": "there is no such file",
    "not-a-file": "a directory was named",
    "no-permission": "the file may not be read",
    "unreadable": "the system cannot read the file",
    "too-large": "more bytes than a graph file has",
    "empty-file": "nothing in it",
    "wrong-encoding": "not UTF-8 text, or half of a character",
    "truncated": "the text ends in the middle",
    "syntax": "the text is not JSON",
    "too-deep": "objects and lists nested without end",
    "duplicate-key": "a key given twice in one object",
    "non-finite": "NaN, infinity or a number too large for a double",
    # the document
    "not-an-object": "the document is a list, a number or a text",
    "wrong-format": "another kind of document, or none that is named",
    "missing-version": "the document does not say its version",
    "bad-version": "the version is not a whole number from 1",
    "newer-version": "made by a newer blockmech",
    # its content
    "unknown-key": "a key that is not known there",
    "missing-key": "a key that is needed there",
    "wrong-type": "a text for a number and the like",
    "wrong-value": "a number out of its range, or a word that is not known there",
    "bad-place": "not [x, y] nor, on links, a polar place",
    "bad-direction": "a direction given twice, or zero",
    "bad-name": 'an empty name, or one with "." or "/"',
    "taken-name": "two markers of a block, or a driver and another thing, with one name",
    "unknown-link": "a link that the block does not have",
    "friction-mismatch": "friction that does not fit the kind of pair",
    "bad-table": "a table that does not increase or has unequal columns",
    "bad-expectation": "an expected number that cannot be tested",
    # the wiring
    "unknown-block": "a block type that is not installed",
    "no-frame": "no fixed link",
    "two-frames": "more than one fixed link",
    "bad-address": 'not "block.joint"',
    "no-such-block": "a wire from or to a block that is not there",
    "not-a-marker": "a wire that starts at an element",
    "unknown-marker": "a wire that starts at a marker that is not there",
    "unknown-joint": "a joint that the block does not have, or that takes no wire",
    "double-wire": "a joint fed twice",
    "self-wire": "a block that feeds itself",
    "pair-mismatch": "a prismatic joint wired to a point",
    "many-drivers": "a branch that follows the motion of several drivers",
    "wrong-home": "a home that names another driver than the one that moves the dyad",
    "unwired-joint": "a joint or terminal that nothing feeds",
    "cycle": "blocks that wait for each other",
    "unknown-driver": "the scene drives something that is no driving link",
}
"""Every code that a graph file can cause; each has a file in ``graphs/broken``."""

MOST = 100  # problems that are listed
LONGEST = 400  # characters of one part of a message


def path_text(path: Path) -> str:
    """A place in a JSON document, e.g. ``wires[2].from``."""
    text = ""
    for part in path:
        if isinstance(part, int):
            text += f"[{part}]"
        elif re.fullmatch(r'[^\s./\[\]"]+', part):
            text += f".{part}" if text else part
        else:
            text += f"[{shown(part)}]"
    return text


def in_file(problems: Iterable[Problem], file: str) -> list[Problem]:
    """Problems as they are shown: each once, with the file, in printable text, not endless."""
    once = list(dict.fromkeys(problems))
    found = [_printable(replace(p, file=file)) for p in once[:MOST]]
    if len(once) > MOST:
        found.append(Problem(once[MOST].code, "", f"and more after these {MOST}", file=file))
    return found


def said_already(problem: Problem, odd: Iterable[Problem]) -> bool:
    """Whether one of the problems is at the same place, or inside it."""
    inside = (f"{problem.where}.", f"{problem.where}[")
    return any(p.where == problem.where or p.where.startswith(inside) for p in odd)


def _printable(problem: Problem) -> Problem:
    parts = {f.name: getattr(problem, f.name) for f in fields(problem)}
    return Problem(**{name: _line(text) for name, text in parts.items()})


def _line(text: str) -> str:
    cut = text if len(text) <= LONGEST else text[: LONGEST - 3] + "..."
    if cut.isprintable():
        return cut
    return "".join(c if c.isprintable() else json.dumps(c)[1:-1] for c in cut)


def unknown_key(where: str, owner: str, key: str, keys: Iterable[str]) -> Problem:
    """The problem that names a key and the ones that are valid there."""
    keys = list(keys)
    valid = f"keys there: {listed(keys, 20)}" if keys else ""
    found = f"{owner} has no key {shown(key)}"
    return Problem("unknown-key", where, found, valid, close_match(key, keys) or "remove it")
