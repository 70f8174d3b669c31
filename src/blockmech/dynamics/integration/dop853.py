r"""DOP853 for one driver in plain Python numbers.

The method is that of Dormand and Prince, order 8 with error estimates of order 5 and 3
and a dense output of order 7 [HNW, section II.10]; the coefficients are SciPy's. Its
array code costs some 7 us an evaluation whatever the right-hand side; two floats need a
third of that. Dense output is worked out only for the steps that somebody asks about.
The work of the loads feeds back on nothing, so it is summed at a step's end only.

Source: [HNW] Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, 1993.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from blockmech.dynamics.chebyshev import Floats
from blockmech.dynamics.ends import INTERRUPTED, TOO_MANY
from blockmech.dynamics.integration.dips import Dips, cut_at
from blockmech.dynamics.integration.legs import (
    Ask,
    Hit,
    Leg,
    TooMany,
    directions,
    first_values,
    scales,
)
from blockmech.dynamics.integration.surfaces import Surface, crosses

SAFETY, SHRINK, GROW = 0.9, 0.2, 10.0
EXPONENT = -1 / 8

Terms = tuple[tuple[int, float], ...]


class Tableau(NamedTuple):
    """Coefficients without their zeros: (index of stage, value)."""

    stages: tuple[tuple[float, Terms], ...]  # c and row of A, stages 1 to 11
    weights: Terms
    error5: Terms
    error3: Terms
    extra: tuple[tuple[float, Terms], ...]  # stages 13 to 15
    dense: tuple[Terms, ...]


@cache
def tableau() -> Tableau:
    """The coefficients, from SciPy's class."""
    from scipy.integrate import DOP853

    def terms(row: Any) -> Terms:
        return tuple((i, float(a)) for i, a in enumerate(row) if a)

    n = DOP853.n_stages
    return Tableau(
        stages=tuple((float(DOP853.C[i]), terms(DOP853.A[i][:i])) for i in range(1, n)),
        weights=terms(DOP853.B),
        error5=terms(DOP853.E5),
        error3=terms(DOP853.E3),
        extra=tuple(
            (float(c), terms(row)) for c, row in zip(DOP853.C_EXTRA, DOP853.A_EXTRA, strict=True)
        ),
        dense=tuple(terms(row) for row in DOP853.D),
    )


class Step(NamedTuple):
    """An accepted step: where it began, and rates and accelerations of its stages."""

    t: float
    h: float
    q: float
    v: float
    work: float
    rates: list[float]  # q' of stages 0 .. 12
    accelerations: list[float]
    powers: list[float]


def integrate(ask: Ask) -> Leg:
    """One leg."""
    table = tableau()
    rhs, end = ask.rhs, ask.end
    rtol, atol = (x.tolist() for x in scales(ask.equation, ask.y, ask.tolerance))
    counts = directions(ask)
    t = ask.t
    q, v, work = ask.y.tolist()
    first = rhs(t, ask.y)
    a, p = float(first[1]), float(first[2])
    values = first_values(ask, counts)
    h = min(_first_step(v, a, atol, ask.equation.speed), end - t, ask.longest)
    steps: list[Step] = []
    hits: list[Hit] = []
    turned, failed = 0.0, False
    grow = GROW
    halted = ""
    dips = None if ask.equation.margin is None else Dips(ask.equation, t, ask.y)
    try:
        while t < end:
            if end - t <= 4 * math.ulp(end):  # it is there: after a kink at the end, say
                t = end
                break
            if h <= 4 * math.ulp(t) + 1e-300:
                failed = True
                break
            h = min(h, end - t)
            if end - t - h < 1e-3 * h:
                h = end - t
            new = _attempt(rhs, table, t, q, v, work, a, p, h)
            error = _error(table, new, rtol, atol)
            if not error <= 1:
                h *= max(SHRINK, SAFETY * error**EXPONENT) if error == error else SHRINK
                grow = 1.0
                continue
            steps.append(new)
            dq, dv, dw = _moved(table.weights, new)
            here = t + h if h < end - t else end
            q1, v1, w1 = q + dq, v + dv, work + dw
            if ask.surfaces:
                y1 = np.array([q1, v1, w1])
                after = [s.value(here, y1) for s in ask.surfaces]
                crossed = [i for i, d in enumerate(counts) if crosses(values[i], after[i], d)]
                found = _hits(ask, new, [(ask.surfaces[i], values[i]) for i in crossed])
                if dips is not None:
                    dead = dips.within(here, y1, _between(rhs, steps[-2:]))
                    hits, found = cut_at(dead, ask, hits, found)
                if found:
                    last = next((k for k, hit in enumerate(found) if hit.surface.terminal), None)
                    if last is not None:
                        hits += found[: last + 1]
                        t, (q, v, work) = found[last].t, found[last].y
                        if found[last].surface.kind == "knot" and t > new.t:
                            steps[-1], (q, v, work) = _short(rhs, table, new, t - new.t)
                        break
                    hits += found
                values = after
                counts = [
                    s.direction if abs(x) > 0 else d
                    for s, x, d in zip(ask.surfaces, after, counts, strict=True)
                ]
            t, q, v, work = here, q1, v1, w1
            a, p = new.accelerations[12], new.powers[12]
            turned = max(turned, abs(work))
            factor = min(GROW, SAFETY * error**EXPONENT) if error > 0 else GROW
            h = min(h * min(factor, grow) if grow < GROW else h * factor, ask.longest)
            grow = GROW
    except (KeyboardInterrupt, TooMany) as stop:
        if not steps and isinstance(stop, KeyboardInterrupt):
            raise
        halted = TOO_MANY if isinstance(stop, TooMany) else INTERRUPTED
        rhs = ask.equation.rhs  # not counted
        steps = [s for s in steps if s.t + s.h <= t + 4 * math.ulp(t)]
    y1 = np.array([q, v, work])
    marks = np.array([s.t for s in steps])
    dense = _Dense(ask.equation.rhs, steps, y1)  # not counted
    return Leg(ask.t, t, y1, dense, tuple(hits), failed, turned, marks, halted)


def _short(
    rhs: Any, table: Tableau, long: Step, h: float
) -> tuple[Step, tuple[float, float, float]]:
    """A step again, only up to a kink: stages beyond it spoil the whole of it."""
    begin = (long.t, long.q, long.v, long.work)
    new = _attempt(rhs, table, *begin, long.accelerations[0], long.powers[0], h)
    dq, dv, dw = _moved(table.weights, new)
    return new, (long.q + dq, long.v + dv, long.work + dw)


def _first_step(v: float, a: float, atol: Sequence[float], speed: float) -> float:
    """A cautious first step [s]: less than a radian at a typical speed, less for tight targets."""
    pace = max(abs(speed), abs(v))
    length = min(1.0 / pace, pace / abs(a)) if a else 1.0 / pace
    return 0.1 * length * min(1.0, float((atol[0] * 1e2) ** 0.125))


def _attempt(
    rhs: Any,
    table: Tableau,
    t: float,
    q: float,
    v: float,
    work: float,
    a: float,
    p: float,
    h: float,
) -> Step:
    """The stages of one step, the last of which is the next step's first."""
    rates, accelerations, powers = [v], [a], [p]
    for c, row in table.stages:
        dq = dv = 0.0
        for i, x in row:
            dq += x * rates[i]
            dv += x * accelerations[i]
        rate, acceleration, power = rhs(t + c * h, _State((q + h * dq, v + h * dv, 0.0)))
        rates.append(rate)
        accelerations.append(acceleration)
        powers.append(power)
    dq = dv = 0.0
    for i, x in table.weights:
        dq += x * rates[i]
        dv += x * accelerations[i]
    rate, acceleration, power = rhs(t + h, _State((q + h * dq, v + h * dv, 0.0)))
    rates.append(rate)
    accelerations.append(acceleration)
    powers.append(power)
    return Step(t, h, q, v, work, rates, accelerations, powers)


class _State(tuple[float, float, float]):
    """Three floats that a right-hand side for arrays can read."""

    __slots__ = ()

    def tolist(self) -> tuple[float, float, float]:
        return self  # a tuple unpacks like a list


def _moved(row: Terms, step: Step) -> tuple[float, float, float]:
    """h times a weighted sum over the stages, of q, v and work."""
    dq = dv = dw = 0.0
    for i, x in row:
        dq += x * step.rates[i]
        dv += x * step.accelerations[i]
        dw += x * step.powers[i]
    return step.h * dq, step.h * dv, step.h * dw


def _error(table: Tableau, step: Step, rtol: list[float], atol: list[float]) -> float:
    """Error of a step relative to its tolerance; NaN at an impossible pose."""
    dq, dv, _ = _moved(table.weights, step)
    q = atol[0] + rtol[0] * max(abs(step.q), abs(step.q + dq))
    v = atol[1] + rtol[1] * max(abs(step.v), abs(step.v + dv))
    q5, v5, _ = _moved(table.error5, step)
    q3, v3, _ = _moved(table.error3, step)
    five = (q5 / q) ** 2 + (v5 / v) ** 2
    three = (q3 / q) ** 2 + (v3 / v) ** 2
    if five == 0.0:
        return 0.0
    return float(five) / math.sqrt((five + 0.01 * three) * 2)


def _interpolant(rhs: Any, step: Step) -> tuple[list[float], list[float], list[float]]:
    """Coefficients of q, v and work within a step; three more evaluations."""
    table = tableau()
    h = step.h
    whole = step._replace(
        rates=list(step.rates),
        accelerations=list(step.accelerations),
        powers=list(step.powers),
    )
    for c, row in table.extra:
        dq, dv, _ = _moved(row, whole)
        rate, acceleration, power = rhs(step.t + c * h, _State((step.q + dq, step.v + dv, 0.0)))
        whole.rates.append(rate)
        whole.accelerations.append(acceleration)
        whole.powers.append(power)
    delta = _moved(table.weights, whole)
    firsts = (whole.rates[0], whole.accelerations[0], whole.powers[0])
    lasts = (whole.rates[12], whole.accelerations[12], whole.powers[12])
    rows = [_moved(row, whole) for row in table.dense]
    found = []
    for i in range(3):
        d, f0, f1 = delta[i], firsts[i], lasts[i]
        found.append([d, h * f0 - d, 2 * d - h * (f1 + f0), *(row[i] for row in rows)])
    return found[0], found[1], found[2]


def _at(coefficients: Sequence[float], x: float) -> float:
    """The interpolant's change since the beginning of the step, x in [0, 1]."""
    y = 0.0
    for i, f in enumerate(reversed(coefficients)):
        y = (y + f) * (x if i % 2 == 0 else 1 - x)
    return y


class _Dense:
    """Dense output of steps; ``known`` are coefficients of those that were asked about.

    ``last`` is the state (3,) where there is no step.
    """

    def __init__(
        self, rhs: Any, steps: list[Step], last: Floats, known: dict[int, Any] | None = None
    ) -> None:
        self.rhs, self.steps, self.last = rhs, steps, last
        self.starts = np.array([s.t for s in steps])
        self.known = {} if known is None else known

    def __call__(self, times: Floats) -> Floats:
        out = np.empty((3, times.size))
        if not self.steps:
            out[:] = self.last[:, None]
            return out
        which = np.searchsorted(self.starts, times, side="right") - 1
        which = np.clip(which, 0, len(self.steps) - 1)
        for m, (i, t) in enumerate(zip(which.tolist(), times.tolist(), strict=True)):
            step = self.steps[i]
            x = (t - step.t) / step.h
            begin = (step.q, step.v, step.work)
            if x == 0.0:
                out[:, m] = begin
                continue
            coefficients = self._coefficients(i)
            for row in range(3):
                out[row, m] = begin[row] + _at(coefficients[row], x)
        return out

    def _coefficients(self, i: int) -> Any:
        if i not in self.known:
            self.known[i] = _interpolant(self.rhs, self.steps[i])
        return self.known[i]

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickled with the coefficients of all steps: the right-hand side cannot be."""
        every = {i: self._coefficients(i) for i in range(len(self.steps))}
        return _Dense, (None, self.steps, self.last, every)


def _between(rhs: Any, steps: list[Step]) -> Callable[[float], Floats]:
    """The state at a time within the last steps."""
    dense = _Dense(rhs, steps, np.empty(0))
    return lambda t: np.asarray(dense(np.array([t]))[:, 0])


def _hits(ask: Ask, step: Step, crossed: list[tuple[Surface, float]]) -> list[Hit]:
    """Where within a step surfaces are met, by bisection and secants on the dense output."""
    if not crossed:
        return []
    coefficients = _interpolant(ask.rhs, step)
    begin = (step.q, step.v, step.work)

    def state(x: float) -> Floats:
        return np.array([b + _at(c, x) for b, c in zip(begin, coefficients, strict=True)])

    found = []
    for surface, before in crossed:
        low, high, f_low = 0.0, 1.0, before
        f_high = surface.value(step.t + step.h, state(1.0))
        side = 0
        for _ in range(100):
            x = (low * f_high - high * f_low) / (f_high - f_low) if f_high != f_low else low
            if not low < x < high:
                x = (low + high) / 2
            f = surface.value(step.t + x * step.h, state(x))
            if (f > 0) == (f_high > 0) and f != 0:
                high, f_high = x, f
                f_low, side = (f_low / 2 if side == 1 else f_low), 1
            else:
                low, f_low = x, f
                f_high, side = (f_high / 2 if side == -1 else f_high), -1
            if high - low <= 4e-16 or f == 0:
                break
        found.append(Hit(surface, step.t + x * step.h, state(x)))
    return sorted(found, key=lambda hit: hit.t)
