"""Steady states as motions: a periodic motion or rest, and what becomes of disturbances."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import root

from blockmech.dynamics.estimate import ROUNDING, missed
from blockmech.dynamics.motion import (
    SPEED_SAMPLES,
    Cost,
    Event,
    Floats,
    Motion,
    State,
    Still,
    Track,
)
from blockmech.dynamics.request import SimulationRequest
from blockmech.plane import EPS

if TYPE_CHECKING:
    from blockmech.dynamics.system import System

QUOTIENT = 1e-3  # step of fourth-order differences: its fourth power is their error, 1e-12
NEUTRAL = 1e-6  # distance of a multiplier from 1 that is none: what differences leave of it
NONE = 1e-9  # part of an eigenvalue, relative to the largest, that is none


def slope(of: Callable[[Floats], Floats], x: Floats, step: Floats) -> Floats:
    """The matrix of derivatives of a function (n,) -> (m,), by fourth-order differences."""
    columns = []
    for i in range(x.size):
        e = np.zeros(x.size)
        e[i] = step[i]
        rise = of(x - 2 * e) - of(x + 2 * e) + 8 * (of(x + e) - of(x - e))
        columns.append(rise / (12 * step[i]))
    return np.column_stack(columns)


# -- rest ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Equilibrium:
    """Where nothing accelerates.

    q : (k,) [rad or m]
    values : (2k,) eigenvalues [1/s] of disturbances, the slowest first
    error : of q [rad or m]
    """

    q: Floats
    values: Any
    error: float

    @property
    def kind(self) -> str:
        """ "stable", "indifferent" or "unstable"."""
        slowest = float(self.values[0].real)
        if abs(slowest) <= NONE * float(np.abs(self.values).max()):
            return "indifferent"
        return "stable" if slowest < 0 else "unstable"


def equilibrium_near(system: System, q: Floats, t: float, speed: float) -> Equilibrium | None:
    """The equilibrium near coordinates q (k,) without joint friction, or None."""
    k, span = q.size, system.span

    def acceleration(at: Floats, rates: Floats) -> Floats:
        if k == 1:
            return np.array([system.acceleration(float(at[0]), float(rates[0]), t)[0]])
        return np.asarray(system.acceleration(at, rates, t)[0], dtype=np.float64)

    still = np.zeros(k)
    step, fast = np.full(k, QUOTIENT * span), np.full(k, QUOTIENT * speed)
    found = root(lambda at: acceleration(at, still), q, options={"xtol": EPS})
    at = np.asarray(found.x, dtype=np.float64)
    left = acceleration(at, still)
    A = np.zeros((2 * k, 2 * k))
    A[:k, k:] = np.eye(k)
    with np.errstate(all="ignore"):
        A[k:, :k] = slope(lambda z: acceleration(z, still), at, step)
        A[k:, k:] = slope(lambda z: acceleration(at, z), still, fast)
    if not (np.isfinite(A).all() and np.isfinite(left).all()):
        return None
    move = np.linalg.lstsq(A[k:, :k], left, rcond=NONE)[0]
    if np.abs(left - A[k:, :k] @ move).max() > NONE * speed**2 or np.abs(at - q).max() > span:
        return None  # nothing near balances what is left
    values = np.linalg.eigvals(A)
    error = 2 * float(np.abs(move).max()) + ROUNDING * float(np.abs(at).max() + span)
    if error > NEUTRAL * span:
        return None
    return Equilibrium(at, values[np.argsort(-values.real, kind="stable")], error)


def at_rest(found: Equilibrium, request: SimulationRequest, notes: Sequence[str]) -> Motion:
    """The equilibrium at which a motion comes to rest."""
    slowest = complex(found.values[0])
    facts: dict[str, float] = {}
    if found.kind == "stable":
        facts["decay_rate"] = -slowest.real
        words = f"stable: disturbances fade as exp(-{-slowest.real:.6g} t)"
    elif found.kind == "unstable":
        facts["rate"] = slowest.real
        words = f"unstable: any disturbance grows as exp({slowest.real:.6g} t)"
    else:
        words = "indifferent: a disturbance neither grows nor fades by itself at first"
    if slowest.imag:
        facts["frequency"] = abs(slowest.imag)
    told = (f"at rest at an equilibrium; {words}", *notes)
    return resting(request, found.q, found.error, "equilibrium", facts, told)


def resting(
    request: SimulationRequest,
    q: Floats,
    error: float,
    method: str,
    facts: dict[str, float],
    notes: Sequence[str],
) -> Motion:
    """A steady state in which nothing moves."""
    one = q.size == 1
    at, rate = (float(q[0]), 0.0) if one else (q, np.zeros(q.size))
    t0 = request.start.t
    motion = _steady(request, method, "rest", Still(at, rate), max([t0, *request.times]), facts)
    motion = replace(
        motion,
        q_end=at,
        qd_end=rate,
        error=error,
        events=(Event("rest", t0, at, rate),),
        notes=tuple(notes),
    )
    return missed(motion, request.accuracy or math.inf)


# -- periodic motions ----------------------------------------------------------------------


@dataclass(frozen=True)
class PeriodicMotion:
    """Dense output of a periodic motion: one period of it, and again.

    shift : [rad or m] by how much the coordinates advance in a period; (k,) or a number
    """

    once: Track
    period: float
    shift: Any
    t0: float

    def state(self, t: Floats) -> State:
        """State at times (m,) [s]."""
        turn = np.floor((t - self.t0) / self.period)
        local = np.clip(t - turn * self.period, self.t0, self.t0 + self.period)
        q, qd = self.once.state(local)
        many = turn if q.ndim == 1 else turn[:, None]
        return State(q + many * self.shift, qd)


@dataclass(frozen=True)
class Cycle:
    """A periodic motion that was found.

    x : (2k,) state at its begin
    once : the motion over a period, with its own error
    shift : (k,) advance of the coordinates in a period
    multipliers : of disturbances, the largest first
    gain : how many times larger the error of the state is than that of the map
    periods : of the loads in one of it
    """

    x: Floats
    once: Motion
    shift: Floats
    multipliers: Any
    gain: float = 1.0
    periods: int = 0

    @property
    def largest(self) -> float:
        """Size of the largest multiplier."""
        return float(np.abs(self.multipliers[0]))

    @property
    def stable(self) -> bool:
        """Whether disturbances fade."""
        return self.largest < 1 - NEUTRAL


def in_words(multiplier: float) -> str:
    """stable, unstable or neutral."""
    if abs(abs(multiplier) - 1) <= NEUTRAL:
        return "neutral"
    return "stable" if abs(multiplier) < 1 else "unstable"


def repeated(cycle: Cycle, request: SimulationRequest, method: str, notes: Sequence[str]) -> Motion:
    """A periodic motion, for as long as is asked for."""
    once, t0 = cycle.once, request.start.t
    period = once.t_end - t0
    shift = float(cycle.shift[0]) if cycle.shift.size == 1 else cycle.shift
    track = PeriodicMotion(once.track, period, shift, t0)
    facts = {"period": period, **_named(cycle.multipliers)}
    if cycle.periods:
        facts["periods_of_the_loads"] = float(cycle.periods)
    if (np.abs(cycle.shift) > once.error + EPS).any():
        facts["mean_speed"] = float(np.abs(cycle.shift).max() / period)
    size, word = cycle.largest, in_words(cycle.largest)
    told = {
        "neutral": "neutral: disturbances neither grow nor fade, so a motion from elsewhere "
        "stays away",
        "stable": f"stable: a period leaves {size:.6g} of a disturbance",
        "unstable": f"unstable: a period makes {size:.6g} of a disturbance, so no motion stays",
    }[word]
    regime = "steady state" if word == "stable" else f"{word} periodic motion"
    t_end = max([t0 + period, *request.times])
    motion = _steady(request, method, regime, track, t_end, facts)
    many = (t_end - t0) / period
    fastest = float(np.abs(once.at(once.times(SPEED_SAMPLES)).qd).max())
    error = cycle.gain * once.error + (many - 1) * once.time_error * fastest
    error += ROUNDING * float(np.max(np.abs(motion.q_end)))
    motion = replace(motion, error=error, time_error=many * once.time_error, notes=(told, *notes))
    return missed(motion, request.accuracy or math.inf)


def _steady(
    request: SimulationRequest,
    method: str,
    regime: str,
    track: Track,
    t_end: float,
    facts: dict[str, float],
) -> Motion:
    q, qd = (x[0] for x in track.state(np.array([t_end])))
    one = np.ndim(q) == 0
    return Motion(
        method=method,
        why=request.why,
        regime=regime,
        status="reached",
        end="steady",
        t_start=request.start.t,
        t_end=t_end,
        q_end=float(q) if one else q,
        qd_end=float(qd) if one else qd,
        track=track,
        events=(),
        error=0.0,
        time_error=0.0,
        accuracy=request.accuracy,
        cost=Cost(),
        facts=facts,
    )


def _named(multipliers: Any) -> dict[str, float]:
    """The largest as `multiplier`: with its sign if it is real, else its size and angle."""
    facts: dict[str, float] = {}
    for i, value in enumerate(np.asarray(multipliers).tolist()):
        name = "multiplier" if i == 0 else f"multiplier_{i + 1}"
        z = complex(value)
        if abs(z.imag) <= NONE * abs(z):
            facts[name] = z.real
        else:
            facts[name] = abs(z)
            facts[f"{name}_angle"] = math.atan2(z.imag, z.real)
    return facts
