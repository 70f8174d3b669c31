"""Numbers on the command line: ``0,1,60deg``, ``0:2:201``, ``0..360°``, ``crank=0,1``."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, TypeAlias, TypeVar

import numpy as np

from blockmech.cli.terminal import note
from blockmech.ground.errors import Problem, RequestError, close_match, listed
from blockmech.ground.units import has_unit, number_in, units_of
from blockmech.result.samples import DEFAULT_SAMPLES

if TYPE_CHECKING:
    from blockmech.compiled import Compiled

UNITS = {of: units_of(of) for of in ("rad", "m")}
RATES = {of: {**units, **units_of(f"{of}/s")} for of, units in UNITS.items()}
SECONDS = units_of("s")
MOST = 10**8  # samples of one range; no memory holds more
NAMED = re.compile(r",(?=[^,=]+=)")  # before the next driver's name
ROW = ("numbers are separated by commas and", "write for example 0,0.5,1")

Units: TypeAlias = Mapping[str, float]
Read = TypeVar("Read")


def coordinates(mechanism: Compiled, given: list[str] | None) -> dict[str, list[float]] | None:
    """Driver coordinates from the ``--at`` options, one for each driver; None without any.

    ``0,1,60deg`` for the one driver, ``crank=0,1`` by name with several. Angles that look like
    degrees without saying so are noted. Raises `RequestError` with all problems.
    """

    def read(where: str, text: str, of: str) -> list[float]:
        values = row(where, text, UNITS[of])
        if of == "rad" and _seem_degrees(text):
            note(
                f"{where}: these are radians, {max(map(abs, values)) / math.tau:.3g} turns; "
                f"degrees are written {_in_degrees(text)}"
            )
        return values

    return _by_driver(mechanism, given, "--at", "0,1", read)


def _seem_degrees(text: str) -> bool:
    """Whether numbers without a unit are whole tens, as nobody counts radians."""
    words = [w for part in text.split(",") for w in re.split(r":|\.\.", part)[:2]]
    if any(has_unit(word, UNITS["rad"]) for word in words):
        return False
    numbers = [float(word) for word in words]
    return all(x % 10 == 0 for x in numbers) and any(numbers)


def _in_degrees(text: str) -> str:
    """The same numbers with their unit: behind each, of a range behind its end."""
    parts = []
    for part in text.split(","):
        start, *more = re.split(r"(:|\.\.)", part.strip())
        if more:
            colon, stop, *count = more
            parts.append("".join([start, colon, f"{stop}deg", *count]))
        else:
            parts.append(f"{start}deg")
    return ",".join(parts)


def rates_of(mechanism: Compiled, given: list[str] | None) -> dict[str, list[float]] | None:
    """Driver rates from the ``--rates`` options, as `coordinates` reads them."""
    return _by_driver(mechanism, given, "--rates", "2", lambda at, x, of: row(at, x, RATES[of]))


def starts(mechanism: Compiled, given: list[str] | None) -> dict[str, tuple[float, float]] | None:
    """Driver -> (q [rad or m], rate) from the ``--start`` options; None without any.

    ``1.2,-3deg/s`` for the one driver, ``crank=60deg`` by name with several; without a rate
    the driver starts from rest. Raises `RequestError` with all problems.
    """
    return _by_driver(mechanism, given, "--start", "0.5", _start)


def places(mechanism: Compiled, given: list[str] | None) -> dict[str, float] | None:
    """Driver -> q [rad or m] from the ``--locked`` options; None without any."""

    def read(where: str, text: str, unit: str) -> float:
        return _number(where, text, UNITS[unit], (f"a coordinate is in {unit} and", ""))

    return _by_driver(mechanism, given, "--locked", "0.5", read)


def _by_driver(
    mechanism: Compiled,
    given: list[str] | None,
    option: str,
    example: str,
    read: Callable[[str, str, str], Read],
) -> dict[str, Read] | None:
    """Driver -> what ``read(where, text, unit of the coordinate)`` finds; None without any.

    The only driver needs no name; several may stand in one option, each with its own. Raises
    `RequestError` with all problems.
    """
    drivers = mechanism.drivers
    values: dict[str, Read] = {}
    problems: list[Problem] = []
    named = set()
    for text in (part for whole in given or () for part in NAMED.split(whole)):
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
                values[name] = read(where, numbers, mechanism.driver_joint(name).coordinate_unit)
            except RequestError as error:
                problems += error.problems
        named.add(name)
    if problems:
        raise RequestError(problems)
    return values or None


def _unknown(where: str, name: str, drivers: Sequence[str], example: str) -> Problem:
    """No driver of that name, or none where there are several or none at all."""
    found = f'no driver "{name}"' if name else f"there are {len(drivers)} drivers"
    if not drivers:
        return _problem(where, found, "it has no drivers", f"leave {where.split()[0]} out")
    remedy = close_match(name, drivers) or f"write {example.format(drivers[-1])}"
    return _problem(where, found, f"drivers: {listed(drivers)}", remedy)


def _start(where: str, text: str, unit: str) -> tuple[float, float]:
    """Coordinate and rate of one driver, whose coordinate is in ``unit``."""
    parts, start = text.split(","), [0.0, 0.0]
    problems: list[Problem] = []
    if len(parts) > 2:
        valid = "a start is the coordinate, then the rate"
        raise RequestError(_problem(where, f"{len(parts)} numbers", valid, ""))
    kinds = [(UNITS[unit], f"a coordinate is in {unit}"), (RATES[unit], f"a rate is in {unit}/s")]
    for i, (part, (units, valid)) in enumerate(zip(parts, kinds, strict=False)):
        try:
            start[i] = _number(where, part, units, (f"{valid} and", ""))
        except RequestError as error:
            problems += error.problems
    if problems:
        raise RequestError(problems)
    return start[0], start[1]


def times(text: str | None) -> list[float] | None:
    """Times [s] from ``--times``: ``0:2:201`` or ``0,0.1,0.2``."""
    return None if text is None else row(f"--times {text}", text, SECONDS)


def row(where: str, text: str, units: Units) -> list[float]:
    """Numbers separated by commas; ``start:stop:count`` is that many, equally spaced.

    ``start..stop`` has as many as a run of the whole range. A start without a unit has that of
    its stop. Raises `RequestError` for what is not a number with one of the units.
    """
    numbers: list[float] = []
    for part in text.split(","):
        pieces = part.replace("..", ":", 1).split(":")
        if len(pieces) == 1:
            numbers.append(_number(where, part, units))
            continue
        if ".." in part and len(pieces) == 2:
            pieces.append(str(DEFAULT_SAMPLES))
        if len(pieces) != 3:
            valid = "a range is start:stop:count, or start..stop"
            raise RequestError(_problem(where, f'"{part}" is not a range', valid, ""))
        if not has_unit(pieces[0], units):
            pieces[0] += max((u for u in units if pieces[1].strip().endswith(u)), key=len)
        start, stop = (_number(where, x, units) for x in pieces[:2])
        numbers += np.linspace(start, stop, _count(where, pieces[2])).tolist()
    return numbers


def _number(where: str, text: str, units: Units, hint: tuple[str, str] = ROW) -> float:
    """A number times its unit; ``hint`` says what is valid, up to the units, and a remedy."""
    if (x := number_in(text, units)) is not None:
        return x
    names = [u for u in units if u]
    suffixes = f" may end in {' or '.join([', '.join(names[:-1]), names[-1]])}" if names else ""
    valid, remedy = hint
    found = f'"{text}" is not a number'
    raise RequestError(_problem(where, found, f"{valid}{suffixes}".removesuffix(" and"), remedy))


def _count(where: str, text: str) -> int:
    if text.isascii() and text.isdigit() and 1 <= int(text[:12]) <= MOST:
        return int(text)
    problem = _problem(where, f'"{text}" is not a count', f"a count is 1 to {MOST}", "")
    raise RequestError(problem)


def _problem(where: str, found: str, valid: str, remedy: str) -> Problem:
    return Problem("bad-request", where, found, valid, remedy)
