r"""A whole swing between two standstills as one cosine series: the fast path.

    x = x_low + 2a sin^2(phi/2),     dt = f dphi,     f = a sin(phi) sqrt(J / 2K)

K is zero at both ends, so f is smooth and even at both: its cosine series converges
geometrically and gives t(phi) = c_0 phi + sum (c_k/k) sin(k phi), the swing time
pi c_0. K is summed from the nearer end. What is left over at the far end moves a
standstill that was found by integration.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache
from typing import NamedTuple

import numpy as np

from blockmech.dynamics.chebyshev import (
    TAIL,
    Floats,
    angle,
    blocks,
    integral_one,
    rule,
    unresolved,
    waves,
)
from blockmech.dynamics.mesh import Mesh, View, places
from blockmech.dynamics.passage import Allowed, End, Known, Place
from blockmech.dynamics.quadrature import EPS, ROUNDING, delay
from blockmech.dynamics.reduced import feasible

SIZES = (128, 256)
HOPEFUL = {128: 1e-4, 256: 1e-12}  # tails above which a longer series is not worth its samples
TAYLOR = 1e-8  # relative shift below which samples are carried along, not sampled again
ROUGH = 1e-10  # end of a survey's series, relative, above which 128 nodes are not tried
CHUNK = 2048
NEXT_IS_EXACT = 3e-8  # [rad] a Newton step after which the next would be rounding
NEWTON_STEPS = 8


@dataclass(frozen=True)
class Swing:
    """A swing with its series; arrays (n,) over the nodes or coefficients.

    Attributes
    ----------
    low, high : ends [rad or m]
    half : a [rad or m]
    times : c [s], of f
    effort : coefficients of tau [N m or N]
    inertia : coefficients of J [kg m2 or kg]
    fastest : [rad/s or m/s]
    error, end_error : [s] and [rad or m]
    """

    low: End
    high: End
    half: float
    times: Floats
    effort: Floats
    inertia: Floats
    fastest: float
    error: float
    end_error: float

    @property
    def total(self) -> float:
        """Swing time [s]."""
        return float(np.pi * self.times[0])

    def place(self, time: Floats) -> Place:
        """Place and speed at times (m,) [s] from the low end."""
        parts = [self._place(time[i : i + CHUNK]) for i in range(0, time.size, CHUNK)]
        if len(parts) == 1:
            return parts[0]
        return Place(*(np.concatenate(column) for column in zip(*parts, strict=True)))

    def when(self, x: Floats) -> Floats:
        """Time [s] from the low end at places x (m,)."""
        low = (x - self.low.x) / (2 * self.half)
        high = (self.high.x - x) / (2 * self.half)
        phi = np.where(low < 0.5, angle(low), np.pi - angle(high))
        return self._time(phi)

    def _time(self, phi: Floats) -> Floats:
        k = np.arange(1, self.times.size)
        return np.asarray(self.times[0] * phi + np.sin(phi[:, None] * k) @ (self.times[1:] / k))

    def _place(self, time: Floats) -> Place:
        phi = self._angle(time)
        k = np.arange(self.times.size)
        near = phi <= np.pi / 2
        from_low, from_high = np.sin(phi / 2) ** 2, np.cos(phi / 2) ** 2
        length = 2 * self.half
        x = np.where(near, self.low.x + length * from_low, self.high.x - length * from_high)
        works = waves(self.effort)
        m = np.arange(1, works.size + 1)
        squares = np.sin(np.where(near, phi, np.pi - phi)[:, None] * (m / 2)) ** 2
        K = length * np.where(near, squares @ works, squares @ (works * (-1.0) ** m))
        J = np.cos(phi[:, None] * k) @ self.inertia
        return Place(x, np.sqrt(2 * np.maximum(K, 0.0) / J))

    def _angle(self, time: Floats) -> Floats:
        """phi at times (m,): a table of equal angles, then Newton's method."""
        n = self.times.size
        grid, table = _clock(n, self.times)
        phi = np.interp(time, table, grid)
        if time.size == 1:
            return np.array([self._angle_one(float(time[0]), float(phi[0]))])
        k = np.arange(n)
        weights = self.times[1:] / k[1:]
        for _ in range(NEWTON_STEPS):
            angles = phi[:, None] * k
            t = self.times[0] * phi + np.sin(angles[:, 1:]) @ weights
            step = (time - t) / (np.cos(angles) @ self.times)
            phi = np.minimum(np.maximum(phi + step, 0.0), np.pi)
            if not np.abs(step).max() > NEXT_IS_EXACT:
                break
        return phi

    def _angle_one(self, time: float, phi: float) -> float:
        """The same for one time, without the overhead of arrays of one."""
        c, k = self.times, np.arange(1, self.times.size)
        mean, rest = float(c[0]), c[1:]
        weights = rest / k
        for _ in range(NEWTON_STEPS):
            angles = k * phi
            t = mean * phi + float(np.sin(angles) @ weights)
            step = (time - t) / (mean + float(np.cos(angles) @ rest))
            phi = min(max(phi + step, 0.0), math.pi)
            if not abs(step) > NEXT_IS_EXACT:
                break
        return phi


def swing(
    view: View, low: End, high: End, inside: Known | None, allowed: Allowed, survey: Mesh
) -> Swing | None:
    """The swing between two standstills, or None where one series does not serve.

    Cost: one batch call of 128 samples, and one of 256 where those are too few for the
    error that is allowed; 256 at once where the ``survey`` on panels is rough.
    """
    judged: _Judged | None = None
    for n in SIZES[_rough(survey) :]:
        x = places(np.array([low.x]), np.array([high.x]), (False, False), n)[0]
        sample = view.meter.sample(view.q(x))
        if not feasible(sample).all():
            return None
        J, tau = np.asarray(sample.J), view.sign * sample.tau
        judged = _judged(view, low, high, inside, J, tau)
        if judged is None:
            return None
        enough = max(allowed(judged) - judged.rounding, judged.rounding)
        if judged.tail <= enough < judged.reducible and judged.shift < TAYLOR:
            judged, J, tau = _carried(judged, J, tau)
        if judged.reducible <= enough:
            break
        low, high = judged.moved
        tail = np.abs(judged.times[3 * n // 4 :]).max() / judged.times[0]
        if tail > HOPEFUL[n]:
            return None
    assert judged is not None
    return Swing(
        low=judged.low,
        high=judged.high,
        half=judged.half,
        times=judged.times,
        effort=(tau @ _large(n).cosine).ravel(),
        inertia=(J @ _large(n).cosine).ravel(),
        fastest=judged.fastest,
        error=judged.reducible + judged.rounding,
        end_error=judged.end_error,
    )


def _rough(survey: Mesh) -> bool:
    """Whether the survey's series end so high that 128 nodes would hardly do."""
    r = rule(survey.J.shape[1])
    end = r.tail[:, TAIL:]
    return any(np.abs(f @ end).max() > ROUGH * np.abs(f).max() for f in (survey.J, survey.tau))


class _Judged(NamedTuple):
    """A swing on given nodes: errors of its time [s], and how far its ends should move."""

    low: End
    high: End
    half: float  # [rad or m]
    times: Floats  # coefficients of f [s]
    fastest: float  # [rad/s or m/s]
    tail: float  # error from the end of the series
    reducible: float  # the same, and from the ends' places
    moving: float  # the part of it that moving the ends would remove
    rounding: float
    end_error: float  # [rad or m]
    steps: tuple[float, float]  # [rad or m]
    shift: float  # [-] the larger step, relative to the distance over which the time changes

    @property
    def total(self) -> float:
        return float(np.pi * self.times[0])

    @property
    def moved(self) -> tuple[End, End]:
        """The ends, where they should be."""
        low, high = self.low, self.high
        if self.steps[0]:
            low = replace(low, x=low.x + self.steps[0])
        if self.steps[1]:
            high = replace(high, x=high.x + self.steps[1])
        return low, high


def _carried(judged: _Judged, J: Floats, tau: Floats) -> tuple[_Judged, Floats, Floats]:
    """Ends moved a little, and the samples carried along by their first derivative."""
    r, large = rule(J.size), _large(J.size)
    low, high = judged.moved
    by = (judged.steps[0] * r.high + judged.steps[1] * r.low) / (2 * judged.half)
    J = J + (J @ large.differentiate).ravel() * by
    tau = tau + (tau @ large.differentiate).ravel() * by
    half = (high.x - low.x) / 2
    times, fastest = _series(half, J, tau)
    left = judged.reducible - judged.moving + judged.total * judged.shift**2
    carried = judged._replace(
        low=low, high=high, half=half, times=times, fastest=fastest, reducible=left, steps=(0.0, 0.0)
    )
    return carried, J, tau


def _series(half: float, J: Floats, tau: Floats) -> tuple[Floats, float]:
    """Coefficients of f [s], NaN where the energy is not above zero, and the largest speed."""
    n, large = J.size, _large(J.size)
    K = np.empty(n)
    K[: n // 2] = (tau @ large.integrate).ravel()
    K[n // 2 :] = -(tau[::-1] @ large.integrate).ravel()[::-1]
    speed = np.sqrt(2 * half * K / J)
    return ((half * large.sine / speed) @ large.cosine).ravel(), float(speed.max())


def _judged(
    view: View, low: End, high: End, inside: Known | None, J: Floats, tau: Floats
) -> _Judged | None:
    n = J.size
    r, large = rule(n), _large(n)
    a = (high.x - low.x) / 2
    tau_low, tau_high, slope_low, slope_high, total = (tau @ r.ends).tolist()
    c, fastest = _series(a, J, tau)
    T = math.pi * float(c[0])
    if not (T > 0 and tau_low > 0 > tau_high):
        return None
    total *= a
    tail = unresolved(c[3 * n // 4 :])

    noise = ROUNDING * a * float(np.abs(tau) @ r.total)
    if inside is None:
        left = (total if low.free and not high.free else 0.0, total if high.free else 0.0)
    else:
        phi = float(angle(np.array((inside[0] - low.x) / (2 * a))))
        behind = a * integral_one(tau @ r.sine, phi)
        left = (inside[1] - behind, inside[1] + total - behind)
        noise += EPS * inside[1]
    doubt = noise + a * unresolved((tau @ large.tail).ravel()) * 8 / n
    J_ends = (J @ r.ends[:, :2]).tolist()
    reducible, rounding, end_error = tail, 2 * EPS * T, 0.0
    steps, moving, shift = [0.0, 0.0], 0.0, 0.0
    for side, end in enumerate((low, high)):
        if not end.free:
            continue
        effort = -tau_high if side else tau_low
        slope = (slope_high if side else slope_low) / (2 * a)
        slowing = delay(effort, slope, J_ends[side], T, 2 * a)
        if abs(left[side]) > doubt:
            steps[side] = (left[side] if side else -left[side]) / effort
        else:
            reducible += doubt / effort * slowing
        step = abs(steps[side])
        moving += step * slowing
        shift = max(shift, step * (1 / (2 * a) + abs(slope / effort)))
        placed = noise / effort + EPS * (abs(view.origin) + abs(end.x))
        rounding += placed * slowing
        end_error = max(end_error, placed + step + doubt / effort)
    return _Judged(
        low=low,
        high=high,
        half=a,
        times=c,
        fastest=fastest,
        tail=tail,
        reducible=reducible + moving,
        moving=moving,
        rounding=rounding,
        end_error=end_error,
        steps=(steps[0], steps[1]),
        shift=shift,
    )


class _Large(NamedTuple):
    """Matrices of a large rule, in blocks, and the sines of its nodes."""

    integrate: Floats  # the first half of the nodes
    cosine: Floats
    tail: Floats  # the last quarter of the coefficients
    differentiate: Floats
    sine: Floats


@cache
def _large(n: int) -> _Large:
    r = rule(n)
    return _Large(
        blocks(r.integrate[:, : n // 2]),
        blocks(r.cosine),
        blocks(r.cosine[:, 3 * n // 4 :]),
        blocks(r.differentiate),
        np.sin(r.phi),
    )


def _clock(n: int, c: Floats) -> tuple[Floats, Floats]:
    """n + 1 equal angles from 0 to pi, and the times there from the series of f."""
    grid, table = _equal(n)
    return grid, np.append((c @ table).ravel(), np.pi * c[0])


@cache
def _equal(n: int) -> tuple[Floats, Floats]:
    grid, k = np.linspace(0.0, np.pi, n + 1), np.arange(1, n)
    return grid, blocks(np.vstack([grid[:n], np.sin(np.outer(k, grid[:n])) / k[:, None]]))
