"""What a simulation is asked for, read and checked before anything is computed."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from blockmech.dynamics.until import Until, Watch
from blockmech.errors import Problem, RequestError, listed

if TYPE_CHECKING:
    from blockmech.compiled import Compiled

Array: TypeAlias = NDArray[np.float64]
Pairs: TypeAlias = Mapping[str, tuple[float, float]]
PAIRS = "give them by driver, like {pairs}"
WATCH = 'blockmech.dynamics.until.Watch("name", lambda t, q, rate: ...)'
GIVE = f"give one in Python: watch=[{WATCH}]"
START, STOPS = '{"crank": (0.0, 1.0)}', '{"crank": (-1.0, 2.0)}'


def goal_of(until: Any, times: Array | None) -> Until:
    """What ends the run; without a word the last of the times asked for, or the standstill."""
    if until is None:
        return Until("time", float(times.max())) if times is not None else Until("standstill")
    if isinstance(until, Until):
        return until.checked()
    if isinstance(until, str):
        return Until.parse(until)
    raise _bad("until", f"{until!r} says nothing about when to stop", 'write for example "time=2"')


def starts_of(mechanism: Compiled, start: Any) -> Pairs:
    """Driver -> (q [rad or m], rate) of every driver, in their order."""
    asked = pairs_of("start", start, START) or {}
    given = {d: (x.q, x.rate) for d, x in mechanism.scene.initial.items()} | asked
    missing = [d for d in mechanism.drivers if d not in given]
    unknown = [d for d in given if d not in mechanism.drivers]
    if missing or unknown:
        raise RequestError(
            Problem(
                "no-start",
                mechanism.scene.address("initial"),
                f"no start for: {listed(missing)}" if missing else f"unknown: {listed(unknown)}",
                f"drivers: {listed(mechanism.drivers)}",
                'give it "initial": {"<driver>": {"q": ..., "rate": ...}}, or say where it '
                "starts: start= in Python, --start on the command line",
            )
        )
    for d, pair in asked.items():
        if not all(map(math.isfinite, pair)):
            found = f"({pair[0]:g}, {pair[1]:g}) are not two finite numbers"
            raise _bad(f"start.{d}", found, "give coordinate and rate")
    return {d: given[d] for d in mechanism.drivers}


def pairs_of(where: str, given: Any, example: str) -> dict[str, tuple[float, float]] | None:
    """Two numbers for each driver."""
    if given is None:
        return None
    if not isinstance(given, Mapping):
        raise _bad(where, f"{given!r} names no driver", PAIRS.format(pairs=example))
    found = {}
    for driver, pair in given.items():
        try:
            first, second = (float(x) for x in pair)
        except (TypeError, ValueError):
            at = f"{where}.{driver}"
            raise _bad(at, f"{pair!r} are not two numbers", PAIRS.format(pairs=example)) from None
        found[driver] = (first, second)
    return found


def size_of(where: str, given: Any) -> float | None:
    """An accuracy or a step: a number above zero, or None."""
    if given is None:
        return None
    try:
        size = float(given)
    except (TypeError, ValueError):
        size = math.nan
    if not (math.isfinite(size) and size > 0):
        raise _bad(where, f"{given!r} is not a number above zero", "leave it out, or give one")
    return size


def watches_of(given: Any, goal: Until) -> tuple[Watch, ...]:
    """The user's events; one of them must be able to end a run that goes on until then."""
    row = (given,) if isinstance(given, Watch) else given
    if not isinstance(row, Sequence) or not all(isinstance(x, Watch) for x in row):
        raise _bad("watch", f"{given!r} are not events", f"give {WATCH}")
    if goal.goal == "event" and not any(x.terminal for x in row):
        raise _bad("until", '"event": no event is given that ends the run', GIVE)
    return tuple(replace(x, surface=_Asked(x.name, x.surface)) for x in row)


@dataclass(frozen=True)
class _Asked:
    """A user's surface, whose mistakes are told as such."""

    name: str
    surface: Callable[..., Any]

    def __call__(self, t: float, q: Any, qd: Any) -> float:
        """The surface at a state; NaN where there is no state."""
        if not (np.isfinite(q).all() and np.isfinite(qd).all()):
            return math.nan
        try:
            value = self.surface(t, q, qd)
        except Exception as error:
            raise self.refused(f"{type(error).__name__}: {error}", t, q, qd) from error
        try:
            number = float(value)
        except (TypeError, ValueError):
            number = math.nan
        if math.isnan(number):
            raise self.refused(f"it gave {value!r}", t, q, qd) from None
        return number

    def refused(self, found: str, t: float, q: Any, qd: Any) -> RequestError:
        at = f"at t = {t:.9g} s, q = {q}, rate = {qd}"
        remedy = "give a number that changes its sign where the event is"
        return RequestError(
            Problem("user-function", f"watch.{self.name}", f"{found}, {at}", "", remedy)
        )


def times_of(times: Any) -> Array | None:
    """(n,) output times [s], or None."""
    if times is None:
        return None
    try:
        column = np.atleast_1d(np.asarray(times, dtype=np.float64))
    except (TypeError, ValueError):
        raise _bad("times", "not a row of numbers", "give times like 0:2:201") from None
    if column.ndim != 1 or not len(column) or not np.isfinite(column).all() or column.min() < 0:
        found = "not a row of finite times from 0 s on"
        raise _bad("times", found, "give times like 0:2:201")
    return column


def _bad(where: str, found: str, remedy: str) -> RequestError:
    return RequestError(Problem("bad-request", where, found, "", remedy))
