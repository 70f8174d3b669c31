"""Numbers on the command line: ``0,1,60deg``, ``0:2:201``, ``0..360°``, ``crank=0,1``."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import TYPE_CHECKING, TypeAlias, TypeVar

import numpy as np

from blockmech.ground.errors import Problem, RequestError, close_match, listed, refused
from blockmech.ground.units import NoQuantity, quantity, unit_behind
from blockmech.result.samples import DEFAULT_SAMPLES

if TYPE_CHECKING:
    from blockmech.compiled import Compiled

MOST = 10**8  # samples of one range; no memory holds more
NAMED = re.compile(r",(?=[^,=]+=)")  # before the next driver's name
ROW = "numbers are separated by commas: write for example 0,0.5,1"

Read = TypeVar("Read")
Texts: TypeAlias = list[str] | None


def coordinates(
    mechanism: Compiled, texts: Texts, degrees: bool | None = None, count: int = DEFAULT_SAMPLES
) -> dict[str, list[float]] | None:
    """Driver coordinates from the ``--at`` options, one for each driver; None without any.

    ``0,1,60deg`` for the one driver, ``crank=0,1`` by name with several; ``0..360deg`` are
    ``count``. Angles without a unit are radians, or ``degrees``. Raises `RequestError` with all
    problems.
    """
    read = partial(row, count=count, degrees=degrees)
    return _by_driver(mechanism, texts, "--at", "0,1", read)


def rates_of(mechanism: Compiled, texts: Texts) -> dict[str, list[float]] | None:
    """Driver rates from the ``--rates`` options, as `coordinates` reads them."""
    return _by_driver(mechanism, texts, "--rates", "2", lambda at, x, of: row(at, x, f"{of}/s"))


def starts(
    mechanism: Compiled, texts: Texts, degrees: bool | None = None
) -> dict[str, tuple[float, float]] | None:
    """Driver -> (q [rad or m], rate) from the ``--start`` options; None without any.

    ``1.2,-3deg/s`` for the one driver, ``crank=60deg`` by name with several; without a rate
    the driver starts from rest. Raises `RequestError` with all problems.
    """
    return _by_driver(mechanism, texts, "--start", "0.5", partial(_start, degrees=degrees))


def roles(
    mechanism: Compiled, prescribed: Texts, locked: Texts, degrees: bool | None = None
) -> dict[str, str | float] | None:
    """Roles of drivers from the ``--prescribed`` and ``--locked`` options; None without any."""
    coordinates = _by_driver(
        mechanism, locked, "--locked", "0.5", partial(number_in, degrees=degrees)
    )
    if prescribed is None and coordinates is None:
        return None
    if both := sorted({*(prescribed or ())} & {*(coordinates or ())}):
        found, remedy = f"{listed(both)} is prescribed as well", "give each driver one role"
        raise refused("--locked", found, remedy, code="roles")
    return dict.fromkeys(prescribed or (), "prescribed") | (coordinates or {})


def _by_driver(
    mechanism: Compiled,
    texts: Texts,
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
    for text in (part for option_text in texts or () for part in NAMED.split(option_text)):
        where = f"{option} {text}"
        name, equals, numbers = text.partition("=")
        if not equals:
            name, numbers = drivers[0] if len(drivers) == 1 else "", text
        if name not in drivers:
            problems += _unknown(where, name, drivers, f"{option} {{}}={example}").problems
        elif name in named:
            problems += refused(where, f"{name} is given twice", "give it once").problems
        else:
            try:
                values[name] = read(
                    where, numbers, mechanism.structure.driver_joint(name).coordinate_unit
                )
            except RequestError as error:
                problems += error.problems
        named.add(name)
    RequestError.raise_for(problems)
    return values or None


def _unknown(where: str, name: str, drivers: Sequence[str], example: str) -> RequestError:
    """No driver of that name, or none where there are several or none at all."""
    message = f'no driver "{name}"' if name else f"there are {len(drivers)} drivers"
    if not drivers:
        return refused(where, message, f"leave {where.split()[0]} out", "it has no drivers")
    remedy = close_match(name, drivers) or f"write {example.format(drivers[-1])}"
    return refused(where, message, remedy, f"drivers: {listed(drivers)}")


def _start(where: str, text: str, unit: str, degrees: bool | None) -> tuple[float, float]:
    """Coordinate and rate of one driver, whose coordinate is in ``unit``."""
    parts, start = text.split(","), [0.0, 0.0]
    problems: list[Problem] = []
    if len(parts) > 2:
        valid = "a start is the coordinate, then the rate"
        raise refused(where, f"{len(parts)} numbers", valid=valid)
    for i, (part, of) in enumerate(zip(parts, (unit, f"{unit}/s"), strict=False)):
        try:
            start[i] = number_in(where, part, of, degrees=degrees)
        except RequestError as error:
            problems += error.problems
    RequestError.raise_for(problems)
    return start[0], start[1]


def times(text: str | None) -> list[float] | None:
    """Times [s] from ``--times``: ``0:2:201`` or ``0,0.1,0.2``."""
    return None if text is None else row(f"--times {text}", text, "s")


def row(
    where: str, text: str, unit: str, count: int = DEFAULT_SAMPLES, degrees: bool | None = None
) -> list[float]:
    """Numbers separated by commas; ``start:stop:count`` is that many, equally spaced.

    ``start..stop`` has ``count``, as a run of the whole range by default. A start without a unit
    has that of its stop. Raises `RequestError` for what is not a number of the unit.
    """
    numbers: list[float] = []
    read = partial(number_in, where, remedy=ROW, degrees=degrees)
    for part in text.split(","):
        pieces = part.replace("..", ":", 1).split(":")
        if len(pieces) == 1:
            numbers.append(read(part, unit))
            continue
        if ".." in part and len(pieces) == 2:
            pieces.append(str(count))
        if len(pieces) != 3:
            valid = "a range is start:stop:count, or start..stop"
            raise refused(where, f'"{part}" is not a range', valid=valid)
        if not unit_behind(pieces[0]):
            pieces[0] += unit_behind(pieces[1])
        start, stop = (read(x, unit) for x in pieces[:2])
        numbers += np.linspace(start, stop, _count(where, pieces[2])).tolist()
    return numbers


def number_in(
    where: str, text: str, *units: str, remedy: str = "", degrees: bool | None = None
) -> float:
    """The number of a unit of one of these kinds that a text says; of angles perhaps in degrees."""
    try:
        number = quantity(text, *units)
    except NoQuantity as error:
        raise refused(where, error.found, remedy, error.valid) from None
    in_degrees = degrees and "rad" in units and not unit_behind(text)
    return quantity(f"{text}deg") if in_degrees else number


def _count(where: str, text: str) -> int:
    if text.isascii() and text.isdigit() and 1 <= int(text[:12]) <= MOST:
        return int(text)
    raise refused(where, f'"{text}" is not a count', valid=f"a count is 1 to {MOST}")


def texts_by_name(option: str, texts: Texts, example: str) -> Iterator[tuple[str, str]]:
    """Name and text of options that are NAME=TEXT. Raises `RequestError` for others."""
    for text in texts or ():
        name, equals, value = text.partition("=")
        if not (name and equals):
            remedy = f"write for example {option} {example}"
            raise refused(f"{option} {text}", "it names no values", remedy)
        yield name, value
