"""What the search for a steady state may come to, and that there is none."""

from __future__ import annotations

from blockmech.dynamics.ends import DEAD_CENTRE, END_STOP, IMPOSSIBLE
from blockmech.errors import Problem, RequestError

TIMED = 'ask for "time=<s>" to see how it goes on'
ELSEWHERE = f"start elsewhere, or {TIMED}"


class Lost(Exception):
    """A motion ended on the way, by something named: "dead centre", "end stop" ..."""

    def __init__(self, end: str, t: float) -> None:
        super().__init__(end)
        self.end, self.t = end, t


class Spent(Exception):
    """The evaluations that a search may take are used up."""


def no_steady(why: str, remedy: str = TIMED) -> RequestError:
    """The error that says why there is no steady state, or why none was found."""
    return RequestError(Problem("until", "until", f'"steady": {why}', "", remedy))


def an(end: str) -> str:
    """What a motion ends in, with its article where it needs one.

    >>> an("dead centre"), an("swings that grow without bound")
    ('a dead centre', 'swings that grow without bound')
    """
    if end.startswith("end stop of"):
        return f"the {end}"
    if end == IMPOSSIBLE:  # to a search both look alike
        return "an impossible pose, or where a load has no value,"
    if end in (DEAD_CENTRE, END_STOP):
        return f"an {end}" if end[0] == "e" else f"a {end}"
    return end
