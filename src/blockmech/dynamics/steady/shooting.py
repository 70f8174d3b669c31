r"""Closing a motion: the state that the flow brings back to itself.

    P(x) - shift - x = 0,       P the flow over a period T,   M = dP/dx,

by Newton's method. Under loads of the time T is that of the loads; without them it is one
more unknown, and the state may not move along its own orbit: it stays at its place, at its
standstill, or across its rates. A cyclic coordinate, on which nothing depends, stays as it
is, and its shift is what it comes to (`cyclic`).
The eigenvalues of M are the multipliers of disturbances in a period; of a motion with
unknown T one of them, 1, belongs to a shift along the orbit and tells nothing.

Source: Seydel, Practical Bifurcation and Stability Analysis, 2010, sections 7.2 to 7.5.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from blockmech.dynamics.chebyshev import Floats
from blockmech.dynamics.integration.integrate import Run
from blockmech.dynamics.integration.legs import FINEST
from blockmech.dynamics.path.quadrature import EPS
from blockmech.dynamics.steady.flow import FINE, ROUGH, Flow, sampled, size_of, state_at_end
from blockmech.dynamics.steady.outcome import Lost
from blockmech.dynamics.steady.variation import EXACT, PLAIN, Variation, variation

NEWTON_STEPS = 14
CHORDS = 6  # corrections with the last slopes
WILD = 5  # steps that are cut short, after which Newton's method is given up
LONGEST = 0.5  # step of Newton's method, of the size of the motion
CLOSE = 1e-5  # step after which the next one, which is not made, would be its square
STRETCH = 3.0  # factor by which an unknown period may leave its guess
SAFETY = 2.0  # times the difference of the last two tolerances: the error of a period
NEUTRAL = 1e-9  # distance of a multiplier from 1 that is none: nothing dissipates
VANISHED = 1e-4  # size of a motion, of that which was guessed, below which it is none


class Guess(NamedTuple):
    """Where to begin.

    periods : of the loads until it repeats
    shift : (2k,) by how much the drivers advance; of cyclic ones it comes out
    free : whether the period is unknown
    cyclic : drivers on whose coordinate nothing depends: it stays as it is at the start
    """

    x: Floats
    T: float
    periods: int
    shift: Floats
    free: bool
    cyclic: tuple[int, ...] = ()


class Cycle(NamedTuple):
    """A periodic motion.

    multipliers : of disturbances in a period, the largest first
    error : of the coordinates at all times [rad or m]
    period_error : [s]
    """

    x: Floats
    T: float
    periods: int
    shift: Floats
    runs: tuple[Run, ...]
    multipliers: Floats
    error: float
    period_error: float

    @property
    def period(self) -> float:
        """Time after which it repeats [s]."""
        return self.T * self.periods

    @property
    def largest(self) -> float:
        """What a period leaves of the worst disturbance [-]."""
        return float(np.abs(self.multipliers).max())

    @property
    def stable(self) -> bool:
        """Whether all disturbances fall."""
        return self.largest < 1 - NEUTRAL


def closed(
    flow: Flow,
    guess: Guess,
    rotary: Sequence[bool],
    span: float,
    known: Callable[[Floats], bool] = lambda x: False,
) -> Cycle | None:
    """The periodic motion near a guess; None where there is none, or it is ``known`` already."""
    try:
        return _closed(flow, guess, rotary, span, known)
    except (Lost, np.linalg.LinAlgError):
        return None


def _closed(
    flow: Flow,
    guess: Guess,
    rotary: Sequence[bool],
    span: float,
    known: Callable[[Floats], bool],
) -> Cycle | None:
    x, T = guess.x.copy(), guess.T
    runs = flow.after(x, T, ROUGH, guess.periods)
    scale = first = size_of(sampled(runs, T, flow.t0), rotary, span)
    wild = 0
    for _ in range(NEWTON_STEPS):
        end = state_at_end(runs[-1])
        A = _matrix(flow, variation(flow, runs, scale, PLAIN).M, guess, x, end, T, scale)
        step = np.linalg.solve(A, -_residual(x, end, guess, scale))
        size = float(np.abs(step).max())
        wild += size > LONGEST
        if not np.isfinite(size) or wild > WILD:
            return None
        step *= min(1.0, LONGEST / size) if size else 1.0
        x = x + step[: x.size] * scale
        T *= 1 + float(step[x.size :].sum())
        if not guess.T / STRETCH < T < guess.T * STRETCH:
            return None
        runs = flow.after(x, T, ROUGH, guess.periods)
        scale = size_of(sampled(runs, T, flow.t0), rotary, span)
        if guess.free and (scale < VANISHED * first).any():
            return None
        if size < CLOSE:
            return None if known(x) else _finished(flow, guess._replace(x=x, T=T), scale)
    return None


def _residual(x: Floats, end: Floats, guess: Guess, scale: Floats) -> Floats:
    open_ = (end - guess.shift - x) / scale
    open_[list(guess.cyclic)] = 0.0
    return np.append(open_, 0.0) if guess.free else open_


def _matrix(
    flow: Flow, M: Floats, guess: Guess, x: Floats, end: Floats, T: float, scale: Floats
) -> Floats:
    """Slopes of what must vanish, by the state and, where it is unknown, by log T."""
    open_ = M - np.eye(x.size)
    for i in guess.cyclic:
        open_[i] = np.eye(x.size)[i]
    if not guess.free:
        return open_
    begin, final = (_rates(flow, y) * T / scale for y in (x, end))
    if x.size == 2:  # a rotation stays at its place, a swing at its standstill
        along = np.array([1.0, 0.0]) if guess.shift.any() else np.array([0.0, 1.0])
    else:
        along = begin / np.linalg.norm(begin)
    return np.block([[open_, final[:, None]], [along[None, :], np.zeros((1, 1))]])


def _rates(flow: Flow, x: Floats) -> Floats:
    """x' (2k,) of an autonomous scene."""
    y = np.append(x, 0.0)
    return np.asarray(flow.equation.rhs(flow.t0, y), dtype=np.float64)[: x.size]


def _finished(flow: Flow, guess: Guess, scale: Floats) -> Cycle:
    """To rounding, by chords with the exact slopes; multipliers and errors."""
    x, T, n = guess.x, guess.T, guess.x.size
    runs = flow.after(x, T, FINEST, guess.periods)
    last = variation(flow, runs, scale, EXACT)
    end = state_at_end(runs[-1])
    A = _matrix(flow, last.M, guess, x, end, T, scale)
    inverse = np.linalg.inv(A)
    before = np.inf
    for _ in range(CHORDS):
        step = -inverse @ _residual(x, end, guess, scale)
        size = float(np.abs(step).max())
        if not size < before / 2:  # what is left is rounding
            break
        before = size
        x, T = x + step[:n] * scale, T * (1 + float(step[n:].sum()))
        runs = flow.after(x, T, FINEST, guess.periods)
        end = state_at_end(runs[-1])
    other = flow.after(x, T, FINE, guess.periods)
    apart = np.abs(sampled(runs, T, flow.t0) - sampled(other, T, flow.t0)) / scale
    local = SAFETY * apart.max(axis=0) + 8 * EPS * (1 + np.abs(end) / scale)
    way = float(np.abs(end[: n // 2] - x[: n // 2]).max() + scale[: n // 2].max())
    local += flow.equation.table_error * max(1.0, way)
    wrong = np.abs(inverse) @ (np.append(local, 0.0) if guess.free else local)
    wrong += np.abs(step)
    angle = last.growth * wrong[:n].max() + local[: n // 2].max()
    if guess.free:  # late by as much at the end
        angle += wrong[n] * T * scale[n // 2 : n].max() / scale[: n // 2].max()
    shift = guess.shift.copy()
    for i in guess.cyclic:
        shift[i] = end[i] - x[i]
    return Cycle(
        x=x,
        T=T,
        periods=guess.periods,
        shift=shift,
        runs=runs,
        multipliers=_multipliers(last, guess),
        error=float(angle * scale[: n // 2].max()),
        period_error=float(wrong[n] * T) if guess.free else 4 * EPS * T,
    )


def _multipliers(last: Variation, guess: Guess) -> Floats:
    """Multipliers, the largest first; with one driver from trace and determinant.

    A shift of a cyclic coordinate stays as it is, and tells nothing.
    """
    free, cyclic = guess.free, list(guess.cyclic)
    if len(last.M) == 2:
        if free or cyclic:
            return np.array([last.fading])
        half = complex(np.trace(last.M)) / 2
        root = np.sqrt(half**2 - last.fading)
        large = half + root if (half.conjugate() * root).real >= 0 else half - root
        found = np.array([large, last.fading / large if large else 0.0])
        return np.asarray(found.real if not found.imag.any() else found)
    M = np.delete(np.delete(last.M, cyclic, axis=0), cyclic, axis=1)
    found = np.linalg.eigvals(M)
    if free:
        found = np.delete(found, np.argmin(np.abs(found - 1)))
    return np.asarray(found[np.argsort(-np.abs(found), kind="stable")])
