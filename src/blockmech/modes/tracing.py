"""Following the modes of a triad along a driver: curves of poses, with every fold on them.

All poses of a triad over one driver coordinate form curves. A curve is followed by its
length, not by the driver, so it is followed *through* a dead centre, where it turns back
in the driver and two modes merge. Predictor: the tangent. Corrector: Newton's method
across the tangent. A step is refused if the corrector moves far or the curve bends much.

Followed curves prove nothing by themselves: a step may jump to a neighbour. So all modes
are computed by elimination at check points, and the curves must pass each of them
exactly once; if they do not, everything is followed again with shorter steps.

The driver coordinate is p in here, 2 pi over the range or the turn.
Source: [AG90] Allgower & Georg, Numerical continuation methods, 1990, chapters 2 and 6.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from blockmech.analysis.peaks import turning_place
from blockmech.errors import Problem, RequestError
from blockmech.modes.closing import CLOSED, Pose, apart, close, fold, looseness, poses, solved
from blockmech.modes.elimination import EPS
from blockmech.modes.triad import Floats, Placed, Support, Triad, hold, place_of, size_of

Outer = Callable[[float], Sequence[Support]]
TriadAt = Callable[[float], Triad]

TURN = 2 * math.pi
CHECKS = 48  # places where all modes are computed
SHIFT = 0.381966  # of their spacing: keeps them off places of symmetry
LONGEST, SHORTEST = 0.1, 1e-9  # steps along a curve, in sizes and radians
BENT = 0.95  # cosine between tangents below which a step is too long
MOVED = 0.3  # of a step that the corrector may move
MOST_STEPS = 20_000  # of a curve
TRIES = 4  # with steps a quarter as long each
MATCH = 1e-5  # a followed pose and a mode by elimination that are the same
SAFE = 1e-4  # ratio of singular values below which a check point is moved
NUDGE = 1e-5  # of p, for a check point that was asked for
AT_BORDER = 1e-5  # of p: where supports exist no further, the range has ended
DELTA = 1e-6  # of p, for the rate of the conditions by p


class Visit(NamedTuple):
    """A mode at a check point that a curve passes."""

    p: float
    check: int
    mode: int
    forward: bool


class Turning(NamedTuple):
    """A dead centre where the curve turns back in p."""

    p: float
    x: Floats


class Passage(NamedTuple):
    """A change point: the determinant passes zero, and the curve goes on."""

    p: float


class Border(NamedTuple):
    """An end of a curve: of the range, or where it could not be followed further."""

    p: float
    lost: bool


Event = Visit | Turning | Passage | Border


@dataclass(frozen=True)
class Curve:
    """One curve of poses: what it meets, in order.

    Closed curves begin and end at the same visit, with ``turns`` of the driver between
    (0 if there are dead centres, in general); others begin and end at borders.
    """

    events: tuple[Event, ...]
    closed: bool
    turns: int = 0


@dataclass(frozen=True)
class Course:
    """A triad along p: where its supports are, in numbers of one size about one place."""

    triad: TriadAt
    outer: Outer
    low: float
    span: float
    turn: bool
    origin: complex
    size: float

    @classmethod
    def of(cls, triad: TriadAt, outer: Outer, low: float, high: float, turn: bool) -> Course:
        """A course over a range of the driver; its size is that of its middle."""
        middle = low + 0.5 * (high - low)
        supports = outer(middle)
        first, _ = place_of(supports[0])
        return cls(triad, outer, low, high - low, turn, first, size_of(triad(middle), supports))

    def held(self, p: float) -> Placed:
        """The triad at p."""
        q = self.q(p)
        return hold(self.triad(q), self.outer(q), self.origin, self.size)

    def q(self, p: float) -> float:
        """The driver coordinate at p."""
        return self.low + self.span * (p / TURN)


@dataclass(frozen=True)
class Check:
    """All modes at one place, by elimination."""

    p: float
    modes: tuple[Pose, ...]

    def match(self, x: Floats) -> int | None:
        """The one mode that a followed pose is."""
        near = [k for k, pose in enumerate(self.modes) if apart(pose.x, x) <= MATCH]
        return near[0] if len(near) == 1 else None


class JumpError(Exception):
    """A step has left its curve: the visits do not fit together."""


def curves(
    course: Course, checks: int = CHECKS, also: Sequence[float] = ()
) -> tuple[tuple[Check, ...], tuple[Curve, ...]]:
    """Check points with all modes, those at places ``also`` last, and curves through them.

    Raises `RequestError` if the curves do not pass each mode once, however short the steps.
    """
    places = [TURN * (j + SHIFT) / checks for j in range(checks)]
    at = tuple(_check(course, p, TURN / checks / 13) for p in places)
    at += tuple(_check(course, p, NUDGE) for p in also)
    longest = LONGEST
    for _ in range(TRIES):
        try:
            return at, _all_curves(course, at, longest)
        except JumpError:
            longest /= 4
    found = "the modes of the triad could not be followed along the driver without doubt"
    raise RequestError(
        Problem("not-followed", "modes", found, "", "ask for a shorter range of the driver")
    )


def _check(course: Course, p: float, nudge: float) -> Check:
    """All modes at a place, or a little beside it if one is at a dead centre there."""
    for _ in range(8):
        held = course.held(p)
        found = poses(held)
        if all(not m.double and looseness(held, m.x) > SAFE for m in found):
            break
        p += nudge
    return Check(p, found)


def _all_curves(course: Course, checks: tuple[Check, ...], longest: float) -> tuple[Curve, ...]:
    left = {(j, k) for j, check in enumerate(checks) for k in range(len(check.modes))}
    found = []
    while left:
        start = min(left)
        curve = _curve(course, checks, start, longest)
        for event in curve.events[:-1] if curve.closed else curve.events:
            if isinstance(event, Visit):
                if (event.check, event.mode) not in left:
                    raise JumpError
                left.remove((event.check, event.mode))
        found.append(curve)
    return tuple(found)


def _curve(
    course: Course, checks: tuple[Check, ...], start: tuple[int, int], longest: float
) -> Curve:
    """The whole curve through one mode at a check point."""
    ahead = _Walk(course, checks, start, 1.0, longest)
    if ahead.walk():
        last = ahead.events[-1]
        turns = round((last.p - ahead.events[0].p) / TURN)
        return Curve(tuple(ahead.events), True, turns)
    back = _Walk(course, checks, start, -1.0, longest)
    if back.walk():
        raise JumpError
    return Curve((*reversed([_turned(e) for e in back.events[1:]]), *ahead.events), False)


def _turned(event: Event) -> Event:
    return event._replace(forward=not event.forward) if isinstance(event, Visit) else event


@dataclass
class _Walk:
    """One way along a curve from a mode at a check point."""

    course: Course
    checks: tuple[Check, ...]
    start: tuple[int, int]
    way: float
    longest: float
    events: list[Event] = field(default_factory=list)

    def walk(self) -> bool:
        """Follow the curve until it closes (True) or ends; the events are collected."""
        j, k = self.start
        z = np.append(self.checks[j].modes[k].x, self.checks[j].p)
        self.events.append(Visit(float(z[3]), j, k, self.way > 0))
        t = self._tangent(z, np.array([0.0, 0.0, 0.0, self.way]))
        h = self.longest / 4
        for _ in range(MOST_STEPS):
            if t is None:
                raise JumpError
            stepped = self._step(z, t, h)
            if stepped is None:
                h /= 2
                if h < SHORTEST:
                    self.events.append(self._stuck(float(z[3])))
                    return False
                continue
            z_new, t_new, easy = stepped
            if self._passed(z, t, z_new, t_new, h):
                return True
            if isinstance(self.events[-1], Border):
                return False
            z, t = z_new, t_new
            h = min(self.longest, h * 1.6) if easy else h
        raise JumpError

    # -- one step --------------------------------------------------------------------------

    def _tangent(self, z: Floats, before: Floats) -> Floats | None:
        matrix = np.empty((4, 4))
        _, matrix[:3, :3] = self.course.held(float(z[3])).conditions(z[:3])
        matrix[:3, 3] = self._rate(z)
        matrix[3] = before
        t = solved(matrix, np.array([0.0, 0.0, 0.0, 1.0]))
        return None if t is None else np.asarray(t / np.linalg.norm(t))

    def _rate(self, z: Floats) -> Floats:
        """Rate (3,) of the conditions by p; one-sided where one side does not exist."""
        p, x = float(z[3]), z[:3]
        places = {d: self.course.held(p + d).conditions(x)[0] for d in (-DELTA, DELTA)}
        ends = {d: f for d, f in places.items() if np.isfinite(f).all()}
        if len(ends) == 1:
            ends[0.0] = self.course.held(p).conditions(x)[0]
        if len(ends) < 2:
            return np.full(3, np.nan)
        low, high = min(ends), max(ends)
        return np.asarray((ends[high] - ends[low]) / (high - low))

    def _step(self, z: Floats, t: Floats, h: float) -> tuple[Floats, Floats, bool] | None:
        """The next point of the curve and its tangent; None if the step is too long."""
        z_new = self._corrected(z + h * t, t)
        if z_new is None:
            return None
        moved = float(np.linalg.norm(z_new - z - h * t))
        t_new = self._tangent(z_new, t)
        if moved > MOVED * h or t_new is None or float(t @ t_new) < BENT:
            return None
        return z_new, t_new, moved < 0.1 * h and float(t @ t_new) > 0.99

    def _corrected(self, predicted: Floats, t: Floats) -> Floats | None:
        """The point of the curve across the tangent from a predicted one."""
        z, matrix, rate = predicted, np.empty((4, 4)), self._rate(predicted)
        if not np.isfinite(rate).all():
            return None
        matrix[:3, 3], matrix[3] = rate, t
        for _ in range(6):
            f, matrix[:3, :3] = self.course.held(float(z[3])).conditions(z[:3])
            step = solved(matrix, -np.append(f, t @ (z - predicted)))
            if step is None:
                return None
            z = z + step
            if np.abs(step).max() <= 1e-12 * max(1.0, float(np.abs(z).max())):
                return z
        return None

    # -- what a step has passed ------------------------------------------------------------

    def _passed(self, z: Floats, t: Floats, z_new: Floats, t_new: Floats, h: float) -> bool:
        """Record what lies between two points; whether the curve has closed."""
        if t[3] * t_new[3] < 0:
            turning = self._turning(z, t, z_new, t_new, h)
            at = np.append(turning.x, turning.p)
            if self._monotone(z, at, root="end"):
                return True
            if isinstance(self.events[-1], Border):
                return False
            self.events.append(turning)
            return self._monotone(at, z_new, root="start")
        if self._det(z) * self._det(z_new) < 0:
            self.events.append(Passage(self._passage(z, z_new)))
        return self._monotone(z, z_new, root="")

    def _det(self, z: Floats) -> float:
        return float(np.linalg.det(self.course.held(float(z[3])).conditions(z[:3])[1]))

    def _passage(self, z: Floats, z_new: Floats) -> float:
        """The change point p between two points: there the gap between both modes vanishes.

        The extreme of tau is zero there and has the same sign on both sides.
        """
        before, after = abs(self._det(z)), abs(self._det(z_new))
        middle = z + (z_new - z) * before / (before + after)

        def gap(places: Floats) -> Floats:
            near = [fold(self.course.held(p), middle[:3]) for p in places.tolist()]
            return np.array([f.value * np.sign(f.bend) if f.sound else np.nan for f in near])

        p, width = float(middle[3]), abs(float(z_new[3] - z[3]))
        widest = (-math.inf, math.inf) if self.course.turn else (0.0, TURN)
        found = turning_place(gap, (p - width, p + width), widest, 1)
        return p if found is None else found.place

    def _turning(self, z: Floats, t: Floats, z_new: Floats, t_new: Floats, h: float) -> Turning:
        """The dead centre between two points, to rounding in p: the extreme of tau is zero."""
        share = t[3] / (t[3] - t_new[3])
        middle = z + share * h * t + (z_new - z - h * t) * share**2
        p = float(middle[3])
        near = fold(self.course.held(p), middle[:3])
        if not near.sound or apart(near.x, middle[:3]) > 2 * h:
            raise JumpError
        last, value, p = p, near.value * np.sign(near.bend), p + 1e-3 * h * h
        for _ in range(12):  # secants
            near = fold(self.course.held(p), near.x)
            now = near.value * np.sign(near.bend)
            if not near.sound:
                raise JumpError
            if abs(now) <= CLOSED / 32 or now == value:
                break
            step = -now * (p - last) / (now - value)
            last, value, p = p, now, p + step
            if abs(step) <= EPS * max(1.0, abs(p)):
                break
        if abs(p - middle[3]) > h:
            raise JumpError
        return Turning(float(p), near.x)

    def _monotone(self, z: Floats, z_new: Floats, root: str) -> bool:
        """Record check points and borders between two points; whether the curve has closed.

        Towards a dead centre (``root`` says at which end) poses go with the square root.
        """
        a, b = float(z[3]), float(z_new[3])
        for p, j in self._checks_between(a, b):
            share = (p - a) / (b - a)
            if root == "end":
                guess = z_new[:3] + (z[:3] - z_new[:3]) * math.sqrt(1 - share)
            else:
                share = math.sqrt(share) if root else share
                guess = z[:3] + (z_new[:3] - z[:3]) * share
            x, miss = close(self.course.held(p), guess)
            k = self.checks[j].match(x)
            if k is None or miss > 1e-9 or apart(x, guess) > self.longest:
                raise JumpError
            forward = b > a
            self.events.append(Visit(p, j, k, forward))
            if (j, k) == self.start:
                if forward != (self.way > 0):
                    raise JumpError
                return True
        if self._leaves(b):
            self.events.append(Border(0.0 if b < 0 else TURN, False))
        return False

    def _checks_between(self, a: float, b: float) -> list[tuple[float, int]]:
        low, high = min(a, b), max(a, b)
        found = []
        for j, check in enumerate(self.checks):
            first, last = (math.floor((end - check.p) / TURN) for end in (low, high))
            for n in range(first, last + 1) if self.course.turn else (0,):
                p = check.p + n * TURN
                if low < p < high or p == b:
                    found.append((p, j))
        return sorted(found, reverse=b < a)

    def _leaves(self, p: float) -> bool:
        return not self.course.turn and not 0.0 <= p <= TURN

    def _stuck(self, p: float) -> Border:
        near = min((0.0, TURN), key=lambda border: abs(border - p))
        lost = self.course.turn or abs(near - p) > AT_BORDER
        return Border(p if lost else near, lost)
