"""When a run ends, and what it starts from."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal, NamedTuple, TypeAlias, get_args

from blockmech.errors import Problem, RequestError, close_match, listed

Goal: TypeAlias = Literal["standstill", "swings", "turns", "time", "angle", "steady", "event"]

Surface: TypeAlias = Callable[[float, float, float], float]  # (t, q, q') -> value

Progress: TypeAlias = Callable[[str, float, float | None], None]
"""Told now and then in a run: what is at work, how far it is, and the whole where that is known.

It may raise `KeyboardInterrupt` to stop the run, which keeps what was done.
"""


class Start(NamedTuple):
    """Driver coordinate [rad or m], its rate and the time [s] at which a run begins."""

    q: float
    rate: float = 0.0
    t: float = 0.0


@dataclass(frozen=True)
class Watch:
    """A user's event: where ``surface(t, q, q')`` changes sign.

    direction : +1 rising only, -1 falling only, 0 both
    terminal : whether the run ends there
    """

    name: str
    surface: Surface
    direction: int = 0
    terminal: bool = True


@dataclass(frozen=True)
class Until:
    """What ends a run.

    ``standstill``; ``swings`` (that many standstills after the start); ``turns`` of the
    driver; ``time`` [s] after the start; ``angle``: the driver coordinate reaches it
    [rad or m]; ``steady``: what the motion settles to, a periodic motion or rest;
    ``event``: the first terminal event.

    forcing : [s] period of loads of the time whose law does not tell it, of ``steady`` only

    >>> Until.parse("swings=3")
    Until(goal='swings', value=3.0)
    """

    goal: Goal
    value: float = 1.0
    forcing: float = field(default=0.0, repr=False)

    @classmethod
    def parse(cls, text: str) -> Until:
        """Read ``standstill``, ``steady``, ``event`` or ``<goal>=<number>``.

        ``steady=<s>`` names the period of the loads.
        """
        name, _, number = text.partition("=")
        degrees = name == "angle" and number.rstrip().endswith("deg")
        try:
            value = float(number.rstrip().removesuffix("deg" if degrees else "")) if number else 1.0
        except ValueError:
            value = math.nan
        forced = name == "steady" and bool(number)
        valued = name in VALUED or forced
        wrong = not math.isfinite(value) or (forced and value <= 0)
        if name not in get_args(Goal):
            raise _refused(text, close_match(name, get_args(Goal)))
        if valued is not bool(number) or wrong:
            takes = VALUED.get(name, "the period of the loads [s] or nothing" if forced else "")
            raise _refused(text, f'"{name}" takes {takes or "no number"}')
        if forced:
            return cls("steady", forcing=value)
        return cls(name, math.radians(value) if degrees else value).checked()  # type: ignore[arg-type]

    def checked(self) -> Until:
        """Itself, if there can be such an end.

        Raises `RequestError` for a time before the start, or a count that is none.
        """
        goal, value = self.goal, self.value
        valid = VALUED.get(goal, "")
        fits = math.isfinite(value) and {
            "time": value >= 0,
            "turns": value > 0,
            "swings": value >= 1 and value == round(value),
        }.get(goal, True)
        if goal not in get_args(Goal) or not fits:
            raise _refused(f"{goal}={value:g}", f'"{goal}" takes {valid}' if valid else "")
        return self


VALUED = {
    "swings": "a whole number from 1 on",
    "turns": "a number above 0",
    "time": "a number from 0 on",
    "angle": "a number",
}


def _refused(text: str, remedy: str) -> RequestError:
    found = f'"{text}" says nothing about when to stop'
    return RequestError(Problem("until", "until", found, f"valid: {listed(_SPELLINGS)}", remedy))


@dataclass(frozen=True)
class Asked:
    """All that a run with one driver is asked for.

    accuracy : target for the error of q [rad or m], or None
    why : why this method, recorded in the result
    times : further times [s] at which the answer is wanted
    progress : told now and then how far an integration is
    """

    start: Start
    until: Until
    accuracy: float | None = None
    why: str = ""
    times: tuple[float, ...] = ()
    watches: tuple[Watch, ...] = ()
    progress: Progress | None = None


_SPELLINGS = (
    "standstill",
    "swings=<count>",
    "turns=<count>",
    "time=<s>",
    "angle=<rad or m>, or 60deg",
    "steady",
    "steady=<s>, the period of the loads",
    "event",
)
