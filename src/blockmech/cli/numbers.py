"""Numbers on the command line: ``0,1,60deg``, ``0:2:201``, ``crank=0,1``."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

from blockmech.compiled import Compiled
from blockmech.errors import Problem, RequestError, close_match, listed

UNITS = {"rad": {"": 1.0, "rad": 1.0, "deg": math.pi / 180}, "m": {"": 1.0, "m": 1.0, "mm": 1e-3}}
RATES = {of: units | {f"{u}/s": x for u, x in units.items() if u} for of, units in UNITS.items()}
SECONDS = {"": 1.0, "s": 1.0, "ms": 1e-3}
MOST = 10**8  # samples of one range; no memory holds more
ROW = ("numbers are separated by commas and", "write for example 0,0.5,1")

Read = TypeVar("Read")


def coordinates(mechanism: Compiled, given: list[str]) -> dict[str, list[float]] | None:
    """Driver coordinates from the ``--at`` options, one for each driver; None without any.

    ``0,1,60deg`` for the one driver, ``crank=0,1`` by name with several.
    Raises `RequestError` with all problems.
    """
    return _by_driver(mechanism, given, "--at", "0,1", lambda at, x, of: row(at, x, UNITS[of]))


def rates_of(mechanism: Compiled, given: list[str]) -> dict[str, list[float]] | None:
    """Driver rates from the ``--rates`` options, as `coordinates` reads them."""
    return _by_driver(mechanism, given, "--rates", "2", lambda at, x, of: row(at, x, RATES[of]))


def starts(mechanism: Compiled, given: list[str]) -> dict[str, tuple[float, float]] | None:
    """Driver -> (q [rad or m], rate) from the ``--start`` options; None without any.

    ``1.2,-3deg/s`` for the one driver, ``crank=60deg`` by name with several; without a rate
    the driver starts from rest. Raises `RequestError` with all problems.
    """
    return _by_driver(mechanism, given, "--start", "0.5", _start)


def _by_driver(
    mechanism: Compiled,
    given: list[str],
    option: str,
    example: str,
    read: Callable[[str, str, str], Read],
) -> dict[str, Read] | None:
    """Driver -> what ``read(where, text, unit of the coordinate)`` finds; None without any.

    The only driver needs no name. Raises `RequestError` with all problems.
    """
    drivers = mechanism.drivers
    found: dict[str, Read] = {}
    problems: list[Problem] = []
    named = set()
    for text in given:
        where = f"{option} {text}"
        name, equals, numbers = text.partition("=")
        if not equals:
            name, numbers = drivers[0] if len(drivers) == 1 else "", text
        if name not in drivers:
            problems.append(_unknown(where, name, drivers, f"{option} {{}}={example}"))
        elif name in named:
            problems.append(_problem(where, f"{name} is given twice", "", "give it once"))
        else:
            try:
                found[name] = read(where, numbers, mechanism.driver_joint(name).coordinate_unit)
            except RequestError as error:
                problems += error.problems
        named.add(name)
    if problems:
        raise RequestError(problems)
    return found or None


def _unknown(where: str, name: str, drivers: Sequence[str], example: str) -> Problem:
    """No driver of that name, or none where there are several or none at all."""
    found = f'no driver "{name}"' if name else f"there are {len(drivers)} drivers"
    if not drivers:
        return _problem(where, found, "it has no drivers", f"leave {where.split()[0]} out")
    remedy = close_match(name, drivers) or f"write {example.format(drivers[-1])}"
    return _problem(where, found, f"drivers: {listed(drivers)}", remedy)


def _start(where: str, text: str, unit: str) -> tuple[float, float]:
    """Coordinate and rate of one driver, whose coordinate is in ``unit``."""
    parts, found = text.split(","), [0.0, 0.0]
    problems: list[Problem] = []
    if len(parts) > 2:
        valid = "a start is the coordinate, then the rate"
        raise RequestError(_problem(where, f"{len(parts)} numbers", valid, ""))
    asked = [(UNITS[unit], f"a coordinate is in {unit}"), (RATES[unit], f"a rate is in {unit}/s")]
    for i, (part, (units, valid)) in enumerate(zip(parts, asked, strict=False)):
        try:
            found[i] = _number(where, part, units, (f"{valid} and", ""))
        except RequestError as error:
            problems += error.problems
    if problems:
        raise RequestError(problems)
    return found[0], found[1]


def times(text: str | None) -> list[float] | None:
    """Times [s] from ``--times``: ``0:2:201`` or ``0,0.1,0.2``."""
    return None if text is None else row(f"--times {text}", text, SECONDS)


def row(where: str, text: str, units: dict[str, float]) -> list[float]:
    """Numbers separated by commas; ``start:stop:count`` is that many, equally spaced.

    Raises `RequestError` for what is not a number with one of the units.
    """
    found: list[float] = []
    for part in text.split(","):
        pieces = part.split(":")
        if len(pieces) == 1:
            found.append(_number(where, part, units))
            continue
        if len(pieces) != 3:
            raise RequestError(
                _problem(where, f'"{part}" is not a range', "a range is start:stop:count", "")
            )
        start, stop = (_number(where, x, units) for x in pieces[:2])
        found += np.linspace(start, stop, _count(where, pieces[2])).tolist()
    return found


def _number(where: str, text: str, units: dict[str, float], hint: tuple[str, str] = ROW) -> float:
    """A number times its unit; ``hint`` says what is valid, up to the units, and a remedy."""
    word = text.strip()
    unit = max((u for u in units if word.endswith(u)), key=len)
    try:
        x = float(word.removesuffix(unit)) * units[unit]
    except ValueError:
        x = math.nan
    if math.isfinite(x):
        return x
    *others, last = (u for u in units if u)
    suffixes = f"{', '.join(others)} or {last}"
    valid, remedy = hint
    found = f'"{text}" is not a number'
    raise RequestError(_problem(where, found, f"{valid} may end in {suffixes}", remedy))


def _count(where: str, text: str) -> int:
    if text.isascii() and text.isdigit() and 1 <= int(text[:12]) <= MOST:
        return int(text)
    problem = _problem(where, f'"{text}" is not a count', f"a count is 1 to {MOST}", "")
    raise RequestError(problem)


def _problem(where: str, found: str, valid: str, remedy: str) -> Problem:
    return Problem("bad-request", where, found, valid, remedy)
