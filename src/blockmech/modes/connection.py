"""Which modes of a triad connect along the driver: arcs, dead centres, and the turn.

A *circuit* is a set of poses that the group can move through without being taken apart;
an *arc* is a part of it between two dead centres, where the driver alone decides the
pose: what a mode is along the driver. At a dead centre two arcs of one circuit merge.
After a whole turn of a crank a mode may be another one: the permutation.
Source: [CM93] Chase & Mirth, Circuits and branches of single-degree-of-freedom planar
linkages, J. Mech. Design 115, 1993 (their branch is the arc here).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from blockmech.errors import Problem, RequestError
from blockmech.modes.closing import TriadMode, mode_of
from blockmech.modes.tracing import (
    CHECKS,
    Border,
    Course,
    Curve,
    Event,
    Outer,
    Passage,
    TriadAt,
    Turning,
    Visit,
    curves,
)
from blockmech.modes.triad import Triad

TURN = 2 * math.pi
DEAD, RANGE, WHOLE, LOST = "dead centre", "range", "turn", "lost"


@dataclass(frozen=True)
class ArcEnd:
    """An end of an arc.

    Attributes
    ----------
    q : driver coordinate [rad or m]
    how : "dead centre"; "range" where the range that was asked for ends; "turn" where a
        whole turn begins and ends; "lost" where the group could not be followed further
    other : at a dead centre, the number of the arc that merges with this one
    """

    q: float
    how: str
    other: int | None = None

    def to_dict(self) -> dict[str, Any]:
        """The end as a JSON object; null stands for infinity."""
        q = self.q if math.isfinite(self.q) else None
        return {"q": q, "how": self.how, "other": self.other}


@dataclass(frozen=True)
class ModeArc:
    """A stretch of the driver over which one mode exists.

    Attributes
    ----------
    circuit : number of the circuit; arcs of one connect through dead centres
    start, end : its ends, start.q <= end.q; of a whole turn, ``turns`` turns apart
    sign : of the determinant along it; 0 where a change point leaves it open
    turns : after how many turns it closes; 0 if it has ends
    change_points : [rad or m], dead centres that it passes
    passes : (check, mode) it passes, in rising order of the driver
    places : (n,) [rad or m] driver coordinate of each pass on the arc, which may be a turn
        and more away from that of the check
    """

    circuit: int
    start: ArcEnd
    end: ArcEnd
    sign: int
    turns: int
    change_points: tuple[float, ...]
    passes: tuple[tuple[int, int], ...]
    places: tuple[float, ...]

    @property
    def length(self) -> float:
        """Length [rad or m] of the arc."""
        return self.end.q - self.start.q


@dataclass(frozen=True)
class Connections:
    """How the modes of a triad connect along one driver.

    Attributes
    ----------
    checks : driver coordinates [rad or m] at which all modes were computed
    modes : the modes at each of them, by rising angle of the platform
    arcs : all arcs, by circuit
    turn : whether the driver was followed over a whole turn
    """

    checks: tuple[float, ...]
    modes: tuple[tuple[TriadMode, ...], ...]
    arcs: tuple[ModeArc, ...]
    turn: bool

    def arc_of(self, check: int, mode: int) -> int:
        """Number of the arc that a mode at a check point is on."""
        return next(n for n, arc in enumerate(self.arcs) if (check, mode) in arc.passes)

    @property
    def circuits(self) -> tuple[tuple[int, ...], ...]:
        """Numbers of the arcs of each circuit."""
        count = 1 + max((arc.circuit for arc in self.arcs), default=-1)
        return tuple(
            tuple(n for n, arc in enumerate(self.arcs) if arc.circuit == c) for c in range(count)
        )

    def after_turn(self, check: int = 0) -> tuple[int | None, ...]:
        """For each mode at a check point, the one it is after a turn; None if it ends.

        Raises `RequestError` if the driver was not followed over a turn.
        """
        if not self.turn:
            found = "the driver was followed over a range, not over a turn"
            raise RequestError(Problem("bad-request", "after_turn", found))
        then: list[int | None] = [None] * len(self.modes[check])
        for arc in self.arcs:
            met = [mode for at, mode in arc.passes if at == check]
            for one, other in itertools.pairwise(met):
                then[one] = other
            if arc.turns and met:
                then[met[-1]] = met[0]
        return tuple(then)


def connect(
    triad: Triad | TriadAt,
    outer: Outer,
    low: float = 0.0,
    high: float = TURN,
    *,
    turn: bool | None = None,
    checks: int = CHECKS,
    also: Sequence[float] = (),
) -> Connections:
    """Follow every mode of a triad along the driver.

    Parameters
    ----------
    triad : its legs, or driver coordinate -> its legs where the driver is in one of them
    outer : driver coordinate -> the three supports; smooth, finite on the whole range
    low, high : range of the driver [rad or m]
    turn : whether the supports repeat after the range; by default if it is 2 pi long
    checks : places where all modes are computed by elimination, and the followed curves
        are held against them
    also : driver coordinates of further check points, which come after the others

    Returns
    -------
    Connections. A circuit that exists only between two neighbouring check points is missed.

    Raises
    ------
    RequestError if the modes cannot be followed without doubt

    Notes
    -----
    Cost: about a tenth of a second; some hundred steps of continuation a mode, each with
    some ten evaluations of ``outer``.
    """
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        wrong = f"a range of the driver is needed, got {low} to {high}"
        raise RequestError(Problem("bad-request", "connect", wrong))
    whole = abs(high - low - TURN) <= 1e-9 if turn is None else turn
    made: TriadAt = (lambda _: triad) if isinstance(triad, Triad) else triad
    course = Course.of(made, outer, low, high, whole)
    more = [TURN * (q - low) / (high - low) for q in also]
    at, found = curves(course, checks, [p % TURN if whole else p for p in more])
    places = tuple(course.q(check.p) for check in at)
    modes = tuple(
        tuple(mode_of(made(q), outer(q), course.held(c.p), pose) for pose in c.modes)
        for q, c in zip(places, at, strict=True)
    )
    arcs: list[ModeArc] = []
    for number, curve in enumerate(found):
        arcs += _arcs(course, curve, number, len(arcs), modes)
    return Connections(places, modes, tuple(arcs), whole)


def _arcs(
    course: Course,
    curve: Curve,
    circuit: int,
    first: int,
    modes: Sequence[Sequence[TriadMode]],
) -> Iterator[ModeArc]:
    """The arcs of one curve, numbered from ``first`` on."""
    pieces = tuple(_pieces(curve))
    signs = _signs(pieces, modes)
    for n, piece in enumerate(pieces):
        ends = []
        for event, beyond in ((piece[0], n - 1), (piece[-1], n + 1)):
            how = _how(event)
            other = first + beyond % len(pieces) if how == DEAD else None
            ends.append(ArcEnd(course.q(event.p), how, other))
        inside = piece if ends[0].q <= ends[1].q else piece[::-1]
        start, end = sorted(ends, key=lambda e: e.q)
        turned, closed = 0.0, start.how == WHOLE
        if closed:
            turned = start.q - course.low
        elif course.turn:
            turned = TURN * math.floor((0.5 * (start.q + end.q) - course.low) / TURN)
        visits = [e for e in inside if isinstance(e, Visit)]
        visits = visits[:-1] if closed else visits
        yield ModeArc(
            circuit,
            ArcEnd(start.q - turned, start.how, start.other),
            ArcEnd(end.q - turned, end.how, end.other),
            signs[n],
            curve.turns if closed else 0,
            tuple(
                course.q(e.p) - (0.0 if closed else turned)
                for e in inside
                if isinstance(e, Passage)
            ),
            tuple((e.check, e.mode) for e in visits),
            tuple(course.q(e.p) - turned for e in visits),
        )


def _signs(
    pieces: Sequence[Sequence[Event]], modes: Sequence[Sequence[TriadMode]]
) -> tuple[int, ...]:
    """Sign of the determinant along each piece: it changes at each dead centre between them."""
    met = [{modes[e.check][e.mode].sign for e in piece if isinstance(e, Visit)} for piece in pieces]
    if any(isinstance(e, Passage) for piece in pieces for e in piece):
        return tuple(found.pop() if len(found) == 1 else 0 for found in met)
    n, (sign, *_) = next((n, tuple(found)) for n, found in enumerate(met) if found)
    return tuple(sign if (k - n) % 2 == 0 else -sign for k in range(len(pieces)))


def _pieces(curve: Curve) -> Iterator[tuple[Event, ...]]:
    """The events between neighbouring ends, the ends included."""
    events = list(curve.events)
    turnings = [n for n, e in enumerate(events) if isinstance(e, Turning)]
    if curve.closed and turnings:  # begin at a dead centre, and come back to it
        n, along = turnings[0], curve.turns * TURN
        events = events[n:-1] + [e._replace(p=e.p + along) for e in events[: n + 1]]
    piece: list[Event] = []
    for n, event in enumerate(events):
        piece.append(event)
        if n and isinstance(event, Turning | Border):
            yield tuple(piece)
            piece = [event]
    if len(piece) > 1:
        yield tuple(piece)


def _how(event: Event) -> str:
    if isinstance(event, Border):
        return LOST if event.lost else RANGE
    return DEAD if isinstance(event, Turning) else WHOLE
