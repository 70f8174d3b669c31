"""Numbers on the command line: ``0,1,60deg``, ``0:2:201``, ``crank=0,1``."""

from __future__ import annotations

import math

import numpy as np

from blockmech.errors import Problem, RequestError, listed
from blockmech.mechanism import Mechanism

UNITS = {"rad": {"": 1.0, "rad": 1.0, "deg": math.pi / 180}, "m": {"": 1.0, "m": 1.0, "mm": 1e-3}}
SECONDS = {"": 1.0, "s": 1.0, "ms": 1e-3}
MOST = 10**8  # samples of one range; no memory holds more


def coordinates(mechanism: Mechanism, given: list[str]) -> dict[str, list[float]] | None:
    """Driver coordinates from the ``--at`` options, one for each driver; None without any.

    ``0,1,60deg`` for the one driver, ``crank=0,1`` by name with several.
    Raises `RequestError` with all problems.
    """
    drivers = mechanism.drivers
    found: dict[str, list[float]] = {}
    problems = []
    for text in given:
        name, equals, numbers = text.partition("=")
        if not equals:
            name, numbers = drivers[0] if len(drivers) == 1 else "", text
        if name not in drivers:
            problems.append(
                _problem(
                    f"--at {text}",
                    f'no driver "{name}"' if name else f"there are {len(drivers)} drivers",
                    f"drivers: {listed(drivers)}" if drivers else "it has no drivers",
                    f"write --at {drivers[-1]}=0,1" if drivers else "leave --at out",
                )
            )
            continue
        if name in found:
            problems.append(_problem(f"--at {text}", f"{name} is given twice", "", "give it once"))
            continue
        unit = mechanism.driver_joint(name).coordinate_unit
        try:
            found[name] = row(f"--at {text}", numbers, UNITS[unit])
        except RequestError as error:
            problems += error.problems
    if problems:
        raise RequestError(problems)
    return found or None


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


def _number(where: str, text: str, units: dict[str, float]) -> float:
    word = text.strip()
    unit = max((u for u in units if word.endswith(u)), key=len)
    try:
        x = float(word.removesuffix(unit)) * units[unit]
    except ValueError:
        x = math.nan
    if math.isfinite(x):
        return x
    suffixes = " or ".join(u for u in units if u)
    raise RequestError(
        _problem(
            where,
            f'"{text}" is not a number',
            f"numbers are separated by commas and may end in {suffixes}",
            "write for example 0,0.5,1",
        )
    )


def _count(where: str, text: str) -> int:
    if text.isascii() and text.isdigit() and 1 <= int(text[:12]) <= MOST:
        return int(text)
    problem = _problem(where, f'"{text}" is not a count', f"a count is 1 to {MOST}", "")
    raise RequestError(problem)


def _problem(where: str, found: str, valid: str, remedy: str) -> Problem:
    return Problem("bad-request", where, found, valid, remedy)
