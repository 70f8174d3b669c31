"""Documents spoilt at random, each from a seed and a number alone, so that one can be made again.

A mutant is a document of the gallery in which a few things are changed: a number is scaled, turned
round or made extreme, a value gets another type, a key is renamed, removed, doubled or moved, names
and texts are injected, wires are crossed, or the text itself is cut and patched.
"""

from __future__ import annotations

import copy
import json
import random
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any, NamedTuple

from tests.gallery import GRAPHS

FOLDERS = ("", "joints", "motions", "legacy", "couplings", "control", "control/joints")
MOST_CHANGES = 3
EXTREME = (
    *(0, -0.0, 1, -1, 1e-300, 5e-324, 1e-16, 1e-9, 1e9, 1e16, 9e18, 1e154, -1e154, 1e300, -1e308),
    *(1.7976931348623157e308, 2**31, 2**53 + 1, 2**63, 10**25, 1.7e308, 0.1, 3.141592653589793),
)
OTHERS: tuple[Any, ...] = (None, True, False, "", "1", "2 mm", "nan", [], {}, [1], [[]], {"": 0})
TEXTS = (
    "\x1b[31mred\x1b[2J",
    "=1+1",
    "@SUM(A1)",
    "a\rb",
    "a\nb",
    "../../etc/passwd",
    "a.b",
    "a/b",
    "%s%n{0}{x!r}",
    "__import__('os').system('true')",
    "\u202eabc",
    "\x00",
    "\x7f\x9b",
    "é" * 5000,
    "<script>alert(1)</script>",
    "$(true)",
    "[bold]x[/bold]",
    "q_0",
    "nan",
    "lambda",
)
PIECES = ("NaN", "1e999", "{", "}", "[", ",", '"', "\\", "\\ud800", "\x00", "//", "-", "0x1", "é")


class Mutant(NamedTuple):
    """A spoilt document: its number, what it was made of, and its text."""

    number: int
    base: str
    text: str


@cache
def bases() -> tuple[tuple[str, Any], ...]:
    """Documents of the gallery by name, without the numbers that they expect."""
    documents = []
    for folder in FOLDERS:
        for path in sorted((GRAPHS / folder).glob("*.json")):
            data = json.loads(path.read_text("utf-8"))
            data.pop("expect", None)
            documents.append((path.relative_to(GRAPHS).as_posix(), data))
    return tuple(documents)


def mutant(seed: int, number: int) -> Mutant:
    """The mutant of that number; it does not depend on those before it."""
    rng = random.Random(f"{seed}/{number}")
    name, data = rng.choice(bases())
    data = copy.deepcopy(data)
    for _ in range(rng.randint(1, MOST_CHANGES)):
        change = rng.choices(list(CHANGES), weights=list(CHANGES.values()))[0]
        change(rng, data)
    text = json.dumps(data, ensure_ascii=rng.random() < 0.5)
    return Mutant(number, name, _torn(rng, text) if rng.random() < TORN else text)


TORN = 0.03  # share of the documents whose text is broken as well: most end at the parser


def _torn(rng: random.Random, text: str) -> str:
    """A text that is cut, or in which a piece is put or left out."""
    start = rng.randrange(len(text))
    stop = min(len(text), start + rng.choice((0, 1, 1, 5, len(text))))
    return text[:start] + rng.choice(("", *PIECES)) + text[stop:]


# -- changes ---------------------------------------------------------------------------------


def _places(data: Any) -> Iterator[tuple[Any, Any]]:
    """Every (box, key) of a document."""
    for key, item in list(data.items() if isinstance(data, dict) else enumerate(data)):
        yield data, key
        if isinstance(item, dict | list):
            yield from _places(item)


def _somewhere(
    rng: random.Random, data: Any, accepts: Callable[[Any], bool] = lambda item: True
) -> tuple[Any, Any] | None:
    """A place at random whose item fits."""
    result = [(box, key) for box, key in _places(data) if accepts(box[key])]
    return rng.choice(result) if result else None


def _is_number(item: Any) -> bool:
    return isinstance(item, int | float) and not isinstance(item, bool)


def _scaled(rng: random.Random, data: Any) -> None:
    """A number by a power of ten: a slip of units, or far worse."""
    if item := _somewhere(rng, data, _is_number):
        box, key = item
        box[key] = float(box[key]) * 10.0 ** rng.choice((-9, -6, -3, -1, 1, 3, 3, 6, 9, 20))


def _moved(rng: random.Random, data: Any) -> None:
    """A number as a designer would change it."""
    if item := _somewhere(rng, data, _is_number):
        box, key = item
        box[key] = float(box[key]) * rng.uniform(-2, 2) + rng.choice((0, 0, 1, -1))


def _extreme(rng: random.Random, data: Any) -> None:
    if item := _somewhere(rng, data, _is_number):
        box, key = item
        box[key] = rng.choice(EXTREME)


def _retyped(rng: random.Random, data: Any) -> None:
    if item := _somewhere(rng, data):
        box, key = item
        box[key] = rng.choice(OTHERS)


def _injected(rng: random.Random, data: Any) -> None:
    """A text in place of a value, or of a key."""
    if spot := _somewhere(rng, data, lambda item: isinstance(item, str)):
        box, key = spot
        box[key] = rng.choice(TEXTS)


def _renamed(rng: random.Random, data: Any) -> None:
    """A key; or a block, together with every wire that names it."""
    if (item := _somewhere(rng, data)) and isinstance(item[0], dict):
        box, key = item
        name = rng.choice((*TEXTS, key + "_", key.upper()))
        if rng.random() < 0.5:
            text = json.dumps(data).replace(json.dumps(key)[:-1], json.dumps(name)[:-1])
            data.clear()
            data.update(json.loads(text))
        else:
            box[name] = box.pop(key)


def _removed(rng: random.Random, data: Any) -> None:
    if item := _somewhere(rng, data):
        box, key = item
        del box[key]


def _copied(rng: random.Random, data: Any) -> None:
    """What stands in one place, in another one of the same or of any kind."""
    target = _somewhere(rng, data)
    if target is None:
        return
    kind = type(target[0][target[1]]) if rng.random() < 0.7 else object
    source = _somewhere(rng, data, lambda item: isinstance(item, kind))
    if source is not None:
        target[0][target[1]] = copy.deepcopy(source[0][source[1]])


def _grafted(rng: random.Random, data: Any) -> None:
    """A section of another document of the gallery."""
    _, donor = rng.choice(bases())
    if shared := sorted(set(donor) & set(data)):
        key = rng.choice(shared)
        if isinstance(data[key], dict) and isinstance(donor[key], dict) and rng.random() < 0.7:
            data[key] |= copy.deepcopy(donor[key])
        else:
            data[key] = copy.deepcopy(donor[key])


def _crossed(rng: random.Random, data: Any) -> None:
    """Two items of a list or an object change places."""
    spot = _somewhere(rng, data, lambda item: isinstance(item, dict | list) and len(item) > 1)
    if spot is not None:
        box = spot[0][spot[1]]
        keys = list(box) if isinstance(box, dict) else range(len(box))
        a, b = rng.sample(list(keys), 2)
        box[a], box[b] = box[b], box[a]


CHANGES: dict[Callable[[random.Random, Any], None], float] = {
    _scaled: 4,
    _moved: 3,
    _extreme: 4,
    _retyped: 1,
    _injected: 1,
    _renamed: 1,
    _removed: 1,
    _copied: 1.5,
    _grafted: 1,
    _crossed: 1,
}
"""How often each is taken: numbers most, because what they spoil goes furthest."""
