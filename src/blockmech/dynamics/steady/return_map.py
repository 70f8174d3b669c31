"""What an autonomous motion with one driver settles to, found without waiting for it.

In the plane of q and q' orbits cannot cross. So where the driver turns back, the map from
one standstill to the next on the same side is monotonic; where it turns round, that from
the speed at a place to the speed one turn later. A motion moves along its map in one
direction and comes to the next fixed point there: a periodic motion, or an equilibrium.
The map is therefore sampled ahead of the motion, further and further, until it points
back; in between lies what the motion settles to.

Source: Guckenheimer & Holmes, Nonlinear Oscillations, 1983, section 1.8 (Poincare-Bendixson)
and 1.5 (return maps).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from blockmech.dynamics.chebyshev import Floats
from blockmech.dynamics.ends import TOO_MANY
from blockmech.dynamics.path.mesh import View
from blockmech.dynamics.steady.collocation import Rotation
from blockmech.dynamics.steady.equilibrium import Rest, equilibrium
from blockmech.dynamics.steady.flow import LOOSE, Flow
from blockmech.dynamics.steady.outcome import Lost, Spent
from blockmech.dynamics.steady.shooting import Guess
from blockmech.dynamics.until import Until, Watch

ROUNDS = 60  # standstills and turns followed until a trend shows
PATIENCE = 4000  # evaluations of one passage, at first, after which rest is looked for
INWARD, OUTWARD = 0.6, 1.25  # amplitudes at which the map of standstills is sampled
INNERMOST = 1e-4  # amplitude, relative to that of the motion
FARTHEST = 60  # amplitudes or speeds tried outward
AWAY = 1e4  # scales that a driver without turns may go without a standstill
ENDLESS = "a way without end"
UNBOUND = 1e5  # times the speed of the motion: there is no end to it
SLOWER = 0.85  # speeds at which the map of turns is sampled
SAME = 1e-7  # relative change of a map that is none
ROOT = 1e-6  # width of a bracket, relative, that Newton's method takes over
HALVINGS = 40
AT_REST = 1e-4  # distance from a stable equilibrium, in scales, that counts as rest
APART = 1e-3  # step away from an unstable equilibrium, in scales
BETWEEN = 65  # places at which an equilibrium between standstills is looked for

Next: TypeAlias = Callable[[float, float, bool], "Steadily | None"]
"""(q, q', whether it gets faster) -> the rotation found by collocation that lies ahead."""


class Steadily(NamedTuple):
    """A rotation found by collocation, seen in its direction."""

    view: View
    rotation: Rotation


class Passage(NamedTuple):
    """A way to the next standstill or through a whole turn.

    kind : "standstill", "turn" or "rest"
    """

    kind: Literal["standstill", "turn", "rest"]
    x: Floats
    time: float


@dataclass
class Settling:
    """A search with one driver.

    period : [rad or m] of the place, None where there is none
    scale : [rad or m]
    stopped : whether end stops keep the driver from turning for ever
    known : rotations that another method has found
    tried : what was done, in words
    """

    flow: Flow
    period: float | None
    scale: float
    stopped: bool = False
    known: Next | None = None
    tried: list[str] = field(default_factory=list)

    def found(self, x: Floats) -> Guess | Rest | Steadily:
        """What the motion from a state settles to.

        Raises `Lost` where it ends by itself, "without bound" included, `Spent`.
        """
        x = np.array(x, dtype=np.float64)
        rest = self._resting(x)
        if rest is not None:
            if rest.kind != "unstable":
                return rest
            self.tried.append("started beside the unstable equilibrium of the start")
            x[0] += APART * self.scale
        clock = 0.0  # [s] since the start, while it is its motion that is followed
        for _ in range(ROUNDS):
            mapped = False
            try:
                way = self._passage(x)
                found: Guess | Rest | Steadily | Floats = way.x
                if way.kind == "rest":
                    return self._rest(way.x)
                mapped = (way.kind == "turn") is bool(x[1])
                if mapped:
                    found = self._turning(x, way) if x[1] else self._swinging(x, way)
            except Lost as lost:
                raise Lost(lost.end, math.nan if mapped else clock + lost.t) from None
            if not isinstance(found, np.ndarray):
                return found
            clock += way.time if found is way.x else math.nan
            x = found
        raise Spent

    # -- passages ----------------------------------------------------------------------------

    def _passage(self, x: Floats) -> Passage:
        """The way to the next standstill, a whole turn, or rest."""
        begin, t, most = x, 0.0, PATIENCE
        far = self.period or AWAY * self.scale
        watches = [Watch("turn" if self.period else ENDLESS, _gone(float(x[0]), far))]
        while True:
            done = self.flow.towards(x, Until("standstill"), LOOSE, watches, most)
            x, t = np.array(done.y_end[:2]), t + done.t_end - self.flow.t0
            if done.end in ("standstill", "turn"):
                if done.end == "standstill":
                    x[1] = 0.0
                    if abs(x[0] - begin[0]) < AT_REST * self.scale and self._near(x):
                        return Passage("rest", x, t)
                return Passage("turn" if done.end == "turn" else "standstill", x, t)
            if done.end not in (TOO_MANY, "time"):
                raise Lost(done.end, t)
            if self._near(x):
                return Passage("rest", x, t)
            if done.end == "time":
                raise Lost(ENDLESS, math.nan)
            most *= 2

    def _near(self, x: Floats) -> bool:
        """Whether a state will stay at the stable equilibrium beside it."""
        rest = self._equilibrium(float(x[0]))
        if rest is None or rest.values[0].real > 0:
            return False
        slow = float(np.abs(rest.values).min()) or float(np.abs(rest.values).max())
        far = abs(float(x[0] - rest.q[0])) + (abs(float(x[1])) / slow if slow else math.inf)
        return far <= AT_REST * self.scale

    def _equilibrium(self, q: float) -> Rest | None:
        flow = self.flow
        return equilibrium(flow.equation, flow.t0, np.array([q]), np.array([self.scale]))

    def _resting(self, x: Floats) -> Rest | None:
        """The equilibrium that a start at rest is at."""
        if x[1]:
            return None
        rest = self._equilibrium(float(x[0]))
        return rest if rest is not None and abs(rest.q[0] - x[0]) <= 2 * rest.error else None

    def _rest(self, x: Floats) -> Rest:
        rest = self._equilibrium(float(x[0]))
        assert rest is not None
        return rest

    # -- the map of standstills --------------------------------------------------------------

    def _swung(self, a: float) -> tuple[float, float, float] | Passage:
        """From a standstill: the next on the other side, that on this side, and the time."""
        there = self._passage(np.array([a, 0.0]))
        if there.kind != "standstill":
            return there
        back = self._passage(there.x)
        if back.kind != "standstill":
            return back
        return float(there.x[0]), float(back.x[0]), there.time + back.time

    def _swinging(self, x: Floats, there: Passage) -> Guess | Rest | Floats:
        """The next fixed point of the map of standstills; a state where it is left."""
        a, b = float(x[0]), float(there.x[0])
        back = self._passage(there.x)
        if back.kind == "rest":
            return self._rest(back.x)
        if back.kind == "turn":
            return back.x
        c = float(back.x[0])
        self.tried.append(f"followed its swings, {a:.6g} to {b:.6g}")
        if abs(c - a) <= SAME * abs(b - a):
            return self._libration(a, there.time + back.time)
        centre = self._between(a, b)
        if (c - a) * (b - a) > 0:
            return self._inward(a, b, centre)
        return self._outward(c, centre)

    def _between(self, a: float, b: float) -> float:
        """The equilibrium nearest to a on the way to b."""
        q: list[float] = np.linspace(a, b, BETWEEN)[1:-1].tolist()
        push = [self._push(x) for x in q]
        for x, y, f, g in zip(q, q[1:], push, push[1:], strict=False):
            if f * g <= 0:
                low, high = x, y
                for _ in range(HALVINGS):
                    middle = (low + high) / 2
                    low, high = (middle, high) if self._push(middle) * f > 0 else (low, middle)
                return (low + high) / 2
        return (a + b) / 2

    def _push(self, q: float) -> float:
        """Acceleration at rest."""
        return float(self.flow.equation.rhs(self.flow.t0, np.array([q, 0.0, 0.0]))[1])

    def _inward(self, a: float, b: float, centre: float) -> Guess | Rest | Floats:
        last = a
        share = INWARD
        while share > INNERMOST:
            here = centre + (a - centre) * share
            swung = self._swung(here)
            if isinstance(swung, Passage):
                return self._rest(swung.x) if swung.kind == "rest" else swung.x
            if (swung[1] - here) * (b - a) <= 0:  # it swings back further than it came
                return self._bracketed(here, last)
            last, share = here, share * INWARD
        rest = self._equilibrium(centre)
        if rest is None or rest.kind == "unstable":
            raise Spent
        return rest

    def _outward(self, a: float, centre: float) -> Guess | Rest | Floats:
        last = a
        for _ in range(FARTHEST):
            here = centre + (last - centre) * OUTWARD
            if not self.period and abs(here - centre) > AWAY * self.scale / 4:
                break
            swung = self._swung(here)
            if isinstance(swung, Passage):
                return self._rest(swung.x) if swung.kind == "rest" else swung.x
            if (swung[1] - here) * (swung[0] - here) >= 0:
                return self._bracketed(last, here)
            last = here
        raise Lost("swings that grow without bound", math.nan)

    def _bracketed(self, inner: float, outer: float) -> Guess | Floats:
        """The periodic swing between two standstills, the inner one of which swings out."""
        time = 0.0
        width = abs(outer - inner)
        for _ in range(HALVINGS):
            middle = (inner + outer) / 2
            swung = self._swung(middle)
            if isinstance(swung, Passage):
                return swung.x
            time = swung[2]
            out = (swung[1] - middle) * (swung[0] - middle) <= 0
            inner, outer = (middle, outer) if out else (inner, middle)
            if abs(outer - inner) <= max(ROOT * width, 1e-9 * self.scale):
                break
        return self._libration((inner + outer) / 2, time)

    def _libration(self, a: float, time: float) -> Guess:
        return Guess(np.array([a, 0.0]), time, 1, np.zeros(2), True)

    # -- the map of turns --------------------------------------------------------------------

    def _turning(self, x: Floats, way: Passage) -> Guess | Steadily | Floats:
        """The next fixed point of the map of turns; a state where it is left."""
        q, sign = float(x[0]), math.copysign(1.0, x[1])
        before, after = abs(float(x[1])), abs(float(way.x[1]))
        self.tried.append(f"followed its turns, at {before * sign:.6g} and {after * sign:.6g}")
        if abs(after - before) <= SAME * before and not self.stopped:
            return self._rotation(q, sign, after, way.time)
        if self.stopped:  # sooner or later, unless it turns back before
            return way.x
        faster = after > before
        known = self.known(q, sign * after, faster) if self.known is not None else None
        if known is not None:
            return known
        last, step = after, max(abs(after - before), 0.05 * after)
        for _ in range(FARTHEST):
            here = last + step if faster else last * SLOWER
            if here > UNBOUND * after:
                break
            turned = self._passage(np.array([q, sign * here]))
            if turned.kind != "turn":
                return turned.x
            if (abs(turned.x[1]) > here) != faster:
                return self._speed_between(q, sign, min(here, last), max(here, last))
            last, step = here, step * 1.5
        if faster:
            raise Lost("a speed that grows without bound", math.nan)
        raise Spent

    def _speed_between(self, q: float, sign: float, low: float, high: float) -> Guess | Floats:
        """The periodic rotation between two speeds, between which the map points back."""
        rising = abs(self._passage(np.array([q, sign * low])).x[1]) > low
        time, width = 0.0, high - low
        while high - low > ROOT * width:
            middle = (low + high) / 2
            turned = self._passage(np.array([q, sign * middle]))
            if turned.kind != "turn":
                return turned.x
            time = turned.time
            up = abs(turned.x[1]) > middle
            low, high = (middle, high) if up == rising else (low, middle)
        return self._rotation(q, sign, (low + high) / 2, time)

    def _rotation(self, q: float, sign: float, speed: float, time: float) -> Guess:
        assert self.period is not None
        shift = np.array([sign * self.period, 0.0])
        return Guess(np.array([q, sign * speed]), time, 1, shift, True)


def _gone(q: float, far: float) -> Callable[[float, float, float], float]:
    """A surface that is met where the driver is that far from q."""
    return lambda t, here, rate: float(abs(here - q) - far)
