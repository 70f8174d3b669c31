"""Numbers with units as people type them: 60deg, 300rpm, 50mm, 2kN, 1/2 in.

Everything inside is in SI units and radians; this is the border where people write others. A
unit is a product of symbols, so `N mm` and `kN s/m` are known without being listed.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from fractions import Fraction
from functools import cache
from typing import Any, TypeAlias

Meaning: TypeAlias = tuple[Fraction, frozenset[tuple[str, int]]]
"""How much of SI a unit is, and its powers of kg, m, s, rad and others."""

PI = Fraction(math.pi)  # so 180deg is math.pi
DEGREE, TURN, INCH, POUND = PI / 180, 2 * PI, Fraction("0.0254"), Fraction("0.45359237")
GRAVITY = Fraction("9.80665")  # what a pound or a kilogram weighs by definition
TEN_TURNS, FEW_TURNS = 3600, 4 * math.tau  # [deg], [rad]
PREFIXES = {"": 0, "n": -9, "u": -6, "m": -3, "c": -2, "k": 3, "M": 6, "G": 9}
PREFIXED: Mapping[str, tuple[Fraction | int, str]] = {
    "m": (1, "m"),
    "g": (Fraction(1, 1000), "kg"),
    "s": (1, "s"),
    "rad": (1, "rad"),
    "N": (1, "kg m s-2"),
    "J": (1, "kg m2 s-2"),
    "W": (1, "kg m2 s-3"),
    "Pa": (1, "kg m-1 s-2"),
    "Hz": (1, "s-1"),
    "A": (1, "A"),
    "V": (1, "kg m2 s-3 A-1"),
    "ohm": (1, "kg m2 s-3 A-2"),
    "H": (1, "kg m2 s-2 A-2"),
}
ALONE: Mapping[str, tuple[Fraction | int, str]] = {
    "deg": (DEGREE, "rad"),
    "degrees": (DEGREE, "rad"),
    "°": (DEGREE, "rad"),
    "turn": (TURN, "rad"),
    "turns": (TURN, "rad"),
    "rev": (TURN, "rad"),
    "rpm": (TURN / 60, "rad s-1"),
    "RPM": (TURN / 60, "rad s-1"),
    "min": (60, "s"),
    "h": (3600, "s"),
    "in": (INCH, "m"),
    "inch": (INCH, "m"),
    '"': (INCH, "m"),
    "ft": (12 * INCH, "m"),
    "t": (1000, "kg"),
    "lb": (POUND, "kg"),
    "lbf": (POUND * GRAVITY, "kg m s-2"),
    "kgf": (GRAVITY, "kg m s-2"),
    "%": (Fraction(1, 100), ""),
}
SUGGESTED = {
    "rad": "rad, deg, turns",
    "m": "m, mm, cm, in, ft",
    "s": "s, ms, min",
    "rad/s": "rad/s, deg/s, rpm",
    "m/s": "m/s, mm/s",
    "rad/s2": "rad/s2, deg/s2",
    "m/s2": "m/s2, mm/s2",
    "kg": "kg, g, t, lb",
    "kg m2": "kg m2, kg mm2, g mm2",
    "N": "N, kN, mN, lbf",
    "N m": "N m, N mm, kN m, lbf ft",
    "N/m": "N/m, N/mm, kN/m",
}
"""SI unit -> units of its kind that a message names."""
SPELLED = str.maketrans({"²": "2", "³": "3", "µ": "u", "μ": "u", "·": " ", "*": " ", "−": "-"})
NUMBER = re.compile(
    r"(?P<sign>[-+]?)(?:(?:(?P<whole>\d+) +)?(?P<share>\d+/0*[1-9]\d*)(?![.\d])|"
    r"(?P<plain>(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?))\s*(?P<unit>(?:1/)?[^\d\s.,/].*|)"
)
POWER = re.compile(r"\^?(-?\d)")


class NoQuantity(ValueError):
    """A text that is no quantity of a unit: what was ``found``, and what is ``valid``."""

    def __init__(self, found: str, units: Iterable[str]) -> None:
        names = ", ".join(SUGGESTED.get(si, si) for si in units if si)
        self.found = found
        self.valid = f"a number, in SI or with {names}" if names else "a number without a unit"
        super().__init__(f"{self.found}: {self.valid}")


class UnitWarning(UserWarning):
    """A number that is taken in SI, and surely is meant in another unit."""


def quantity(text: str, *units: str) -> float:
    """The number in SI that a text says, of one of the SI ``units``: 30deg, 1/2 in, 2kN.

    A number without a unit is in SI already. Without ``units`` any is read. Raises `NoQuantity`
    for what is no number, is not finite, or has a unit that is unknown or of another kind.

    >>> quantity("1 1/2 in", "m"), quantity("5 N/mm", "N/m"), quantity("0.5", "rad")
    (0.0381, 5000.0, 0.5)
    """
    match = NUMBER.fullmatch(text.strip().translate(SPELLED))
    if match is None:
        comma = ", a decimal sign is a point" if NUMBER.fullmatch(text.replace(",", ".")) else ""
        raise NoQuantity(f'"{text}" is not a number{comma}', units)
    if match["plain"] and not math.isfinite(float(match["plain"])):
        raise NoQuantity(f'"{text}" is not finite', units)
    number = Fraction(match["plain"] or match["whole"] or "0") + Fraction(match["share"] or "0")
    factor = _factor(match["unit"], units, text) if match["unit"] else 1
    return float(-number * factor if match["sign"] == "-" else number * factor)


def in_si(raw: Any, *units: str) -> Any:
    """A value in which every text is a number with a unit, in SI; all else is as it is."""
    if isinstance(raw, str):
        if not unit_behind(raw):
            raise NoQuantity(f'"{raw}" is not a number with a unit', units)
        return quantity(raw, *units)
    return type(raw)(in_si(x, *units) for x in raw) if type(raw) in (list, tuple) else raw


def number_in_si(raw: object, *units: str) -> float:
    """A number, or a text with one of the units, in SI; NaN for anything else."""
    try:
        return float(in_si(raw, *units or ("",)))
    except (TypeError, ValueError, OverflowError):
        return math.nan


def unit_behind(text: str) -> str:
    """The unit that stands behind a number; "" where there is none."""
    match = NUMBER.fullmatch(text.strip().translate(SPELLED))
    return match["unit"] if match else ""


def shown_in(si: str, units: Iterable[str]) -> tuple[float, str]:
    """What a number in an SI unit is multiplied by to be shown in the first of its kind."""
    for unit in units:
        with suppress(NoQuantity):
            return float(1 / si_of(unit, si)), unit
    return 1.0, si


def si_of(unit: str, si: str) -> Fraction:
    """How much of an SI unit one of the same kind is. Raises `NoQuantity` for another kind."""
    return _factor(unit, (si,), unit) if unit != si else Fraction(1)


def seem_degrees(low: float, high: float) -> bool:
    """Whether angles between two that are said to be radians end at whole tens, as degrees do.

    Radians may too in a run of a few turns that begins or ends at zero, and beyond 3600.
    """
    if 0 in (low, high) and high - low < FEW_TURNS:
        return False
    return all(x % 10 == 0 and abs(x) <= TEN_TURNS for x in (low, high))


def _factor(unit: str, units: Iterable[str], text: str) -> Fraction:
    """How much of SI a unit is, as one of the ``units``."""
    meanings = _meanings(unit)
    kinds = {powers for si in units for _, powers in _meanings(si)}
    for factor, powers in meanings:
        if powers in kinds or not units:
            return factor
    message = f'"{text}" has another kind of unit' if meanings else f'no unit "{unit}" in "{text}"'
    raise NoQuantity(message, units)


@cache
def _meanings(unit: str) -> tuple[Meaning, ...]:
    """What a unit may mean, the likeliest first: the "ms" of Nms are milliseconds, or m s."""
    above, *below = (part.strip(" ()") for part in unit.split("/"))
    meanings = [*_products(above.removeprefix("1"))]
    for part in below:
        read = [*_products(part)]
        meanings = [(a / b, _product(x, y, -1)) for a, x in meanings for b, y in read]
    return tuple((factor, frozenset(powers.items())) for factor, powers in meanings)


def _products(text: str) -> Iterator[tuple[Fraction, Counter[str]]]:
    """What symbols side by side may mean: N mm, Nmm, kg m2; a square is never written mm."""
    if not text:
        yield Fraction(1), Counter()
    for end in range(len(text), 0, -1):
        if text[:end] in _symbols() and not text.startswith(text[:end], end):
            size, powers = _symbols()[text[:end]]
            power = POWER.match(text, end)
            n = int(power[1]) if power else 1
            for factor, inner in _products(text[power.end() if power else end :].lstrip()):
                yield size**n * factor, _product(inner, powers, n)


@cache
def _symbols() -> dict[str, tuple[Fraction, Counter[str]]]:
    """Every symbol, with prefixes too: how much of SI it is, and its powers."""
    symbols = {
        prefix + name: (Fraction(f"1e{ten}") * size, powers)
        for name, (size, powers) in PREFIXED.items()
        for prefix, ten in PREFIXES.items()
    } | dict(ALONE)
    return {
        name: (Fraction(size), Counter({x[1]: int(x[2] or 1) for x in BASE.finditer(powers)}))
        for name, (size, powers) in symbols.items()
    }


BASE = re.compile(r"([A-Za-z]+)(-?\d*)")


def _product(x: Counter[str], y: Counter[str], n: int) -> Counter[str]:
    """The powers of a product of one thing with the n-th power of another."""
    return Counter({name: p for name in {**x, **y} if (p := x[name] + n * y[name])})
