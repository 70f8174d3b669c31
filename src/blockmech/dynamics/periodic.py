"""Steady states: fixed points of Poincare maps, and equilibria, as motions.

A periodic motion is a fixed point of the map that takes a state to the one at its return. It is
found as a root of what the map changes (`scipy.optimize.root`); the eigenvalues of the map's
derivative, its multipliers, tell what a period leaves of a disturbance.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import root

from blockmech.dynamics.contacts import SETTLED
from blockmech.dynamics.estimate import ROUNDING, missed
from blockmech.dynamics.request import SimulationRequest
from blockmech.functions.pieces import Function
from blockmech.functions.roots import SCANNED
from blockmech.ground.errors import RequestError, refused
from blockmech.ground.plane import EPS
from blockmech.loads.contract import Following
from blockmech.loads.laws import Polynomial
from blockmech.model.structure import Structure
from blockmech.result.motion import Event, Motion, Slips, State, Still, Track
from blockmech.typing import Array, Floats

QUOTIENT: float = EPS**0.2  # step of fourth-order differences: its fourth power is rounding over it
NEUTRAL = QUOTIENT**2  # distance of a multiplier from 1 that is none: half of those digits
FLOWS = 1e-13  # accuracy of the flows whose fixed points are looked for
SEARCH = 20  # values of a map in a search; from a settled motion some ten are enough


def slope(of: Callable[[Floats], Floats], x: Floats, step: Floats) -> Floats:
    """The matrix of derivatives of a function (n,) -> (m,), by fourth-order differences."""
    columns = []
    for e, h in zip(np.diag(step), step, strict=True):
        rise = of(x - 2 * e) - of(x + 2 * e) + 8 * (of(x + e) - of(x - e))
        columns.append(rise / (12 * h))
    return np.column_stack(columns)


# -- rest ----------------------------------------------------------------------------------


class Equilibrium(NamedTuple):
    """Where nothing accelerates.

    q : (k,) [rad or m]
    values : (2k,) eigenvalues [1/s] of disturbances, the slowest first
    error : of q [rad or m]
    """

    q: Floats
    values: Array
    error: float

    @property
    def kind(self) -> str:
        """ "stable", "indifferent" or "unstable"."""
        slowest = float(self.values[0].real)
        if abs(slowest) <= SETTLED * float(np.abs(self.values).max()):
            return "indifferent"
        return "stable" if slowest < 0 else "unstable"

    def described(self) -> tuple[dict[str, float], str]:
        """What becomes of disturbances: facts, and in words."""
        slowest = complex(self.values[0])
        rate = slowest.real
        facts, description = {
            "stable": ({"decay_rate": -rate}, f"disturbances fade as exp(-{-rate:.6g} t)"),
            "unstable": ({"rate": rate}, f"any disturbance grows as exp({rate:.6g} t)"),
            "indifferent": ({}, "a disturbance neither grows nor fades by itself at first"),
        }[self.kind]
        if slowest.imag:
            facts["frequency"] = abs(slowest.imag)
        return facts, f"at rest at an equilibrium; {self.kind}: {description}"


def equilibrium_near(
    acceleration: Callable[[Floats], Floats], q: Floats, size: Floats
) -> Equilibrium | None:
    """The equilibrium near coordinates q (k,), or None.

    acceleration : state (2k,) -> q'' (k,)
    size : (2k,) by which the parts of a state are measured
    """
    k = q.size
    still, span, speed = np.zeros(k), float(size[0]), float(size[-1])
    solution = root(lambda at: acceleration(np.append(at, still)), q, options={"xtol": EPS}).x
    x = np.append(solution, still)
    with np.errstate(all="ignore"):
        residual = acceleration(x)
        A = np.vstack([np.eye(k, 2 * k, k), slope(acceleration, x, QUOTIENT * size)])
    if not (np.isfinite(A).all() and np.isfinite(residual).all()):
        return None
    move = np.linalg.lstsq(A[k:, :k], residual, rcond=SETTLED)[0]
    balanced = np.abs(residual - A[k:, :k] @ move).max() <= SETTLED * speed**2
    error = 2 * float(np.abs(move).max()) + ROUNDING * float(np.abs(solution).max() + span)
    if not balanced or error > NEUTRAL * span or np.abs(solution - q).max() > 2 * math.pi * span:
        return None
    values = np.linalg.eigvals(A)
    return Equilibrium(solution, values[np.argsort(-values.real, kind="stable")], error)


def resting(
    request: SimulationRequest,
    q: Floats,
    error: float,
    method: str,
    facts: dict[str, float],
    note: str,
) -> Motion:
    """A steady state in which nothing moves."""
    at, rate = (float(q[0]), 0.0) if q.size == 1 else (q, np.zeros(q.size))
    t0, still = request.start.t, Still(at, rate)
    rest = Event("rest", t0, at, rate)
    return _steady(request, method, "rest", still, t0, (error, 0.0), facts, (note,), rest)


# -- periodic motions ----------------------------------------------------------------------


class FixedPoint(NamedTuple):
    """A fixed point of a Poincare map.

    x : (2k,) the state there
    multipliers : (n,) of disturbances, the largest first
    gain : how many times larger its error is than that of the map
    """

    x: Floats
    multipliers: Array
    gain: float

    @property
    def kind(self) -> str:
        """ "stable", "neutral" or "unstable"."""
        beyond = float(np.abs(self.multipliers[0])) - 1
        return "neutral" if abs(beyond) <= NEUTRAL else "stable" if beyond < 0 else "unstable"


def fixed_point(
    change: Callable[[Floats], Floats], x: Floats, free: Sequence[int], size: Floats
) -> FixedPoint | None:
    """The fixed point of a map near a state (2k,), or None.

    change : state -> by how much a return changes it (2k,), NaN where there is no return
    free : (n,) parts of the state that vary on the section
    size : (2k,) by which the parts are measured
    """

    def at(u: Floats) -> Floats:
        point = x.copy()
        point[free] += u * size[free]
        return point

    def moved(u: Floats) -> Floats:
        return (change(at(u)) / size)[free]

    u = np.zeros(len(free))
    if not np.abs(moved(u)).max() <= SETTLED:
        u = np.asarray(root(moved, u, options={"xtol": SETTLED, "maxfev": SEARCH}).x)
    residual, jump = moved(u), slope(moved, u, np.full(u.size, QUOTIENT))
    if not (np.isfinite(jump).all() and np.abs(residual).max() <= NEUTRAL):
        return None
    U, steep, V = np.linalg.svd(jump)
    some = steep > NEUTRAL  # along the others every point is a fixed one
    u = u - (U[:, some].T @ residual / steep[some]) @ V[some]  # Newton's last step
    values = np.linalg.eigvals(jump + np.eye(u.size))
    order = np.argsort(-np.abs(values), kind="stable")
    return FixedPoint(at(u), values[order], 1 + 1 / np.min(steep[some], initial=1.0))


@dataclass(frozen=True)
class PeriodicMotion:
    """Dense output of a periodic motion: one period of it, and again.

    shift : [rad or m] by how much the coordinates advance in a period; (k,) or a number
    """

    once: Track
    period: float
    shift: float | Floats
    t0: float

    def state(self, t: Floats) -> State:
        """State at times (m,) [s]."""
        turn, local = self._in_one(t)
        q, qd = self.once.state(local)
        return State(q + (turn if q.ndim == 1 else turn[:, None]) * self.shift, qd)

    def signal_states(self, t: Floats) -> Floats:
        """States (m, n) of signal blocks at times (m,) [s]."""
        states: Floats = self.once.signal_states(self._in_one(t)[1])  # type: ignore[attr-defined]
        return states

    def _in_one(self, t: Floats) -> tuple[Floats, Floats]:
        """Which period times [s] are in, and the times in the first one."""
        turn = np.floor((t - self.t0) / self.period)
        return turn, np.clip(t - turn * self.period, self.t0, self.t0 + self.period)


def repeated(
    point: FixedPoint,
    once: Motion,
    shift: Floats,
    request: SimulationRequest,
    method: str,
    notes: Sequence[str] = (),
    **extra_facts: float,
) -> Motion:
    """A periodic motion, for as long as is asked for.

    once : the motion over a period, with its own error
    shift : (k,) advance of the coordinates in a period
    extra_facts : further ones
    """
    t0 = request.start.t
    period = once.t_end - t0
    track = PeriodicMotion(once.track, period, float(shift[0]) if shift.size == 1 else shift, t0)
    facts = {"period": period, **_named(point.multipliers), **extra_facts}
    if (np.abs(shift) > once.error + EPS).any():
        facts["mean_speed"] = float(np.abs(shift).max() / period)
    size = float(np.abs(point.multipliers[0]))
    note = {
        "neutral": "neutral: disturbances neither grow nor fade, so a motion from elsewhere "
        "stays away",
        "stable": f"stable: a period leaves {size:.6g} of a disturbance",
        "unstable": f"unstable: a period makes {size:.6g} of a disturbance, so no motion stays",
    }[point.kind]
    regime = "steady state" if point.kind == "stable" else f"{point.kind} periodic motion"
    k, many = shift.size, (max([t0 + period, *request.times]) - t0) / period
    fastest = float(np.abs(once.at(once.times(SCANNED + 1)).qd).max())
    moved = np.append(once.q_end, once.qd_end)
    missed_by = moved - point.x[: 2 * k] - np.append(shift, np.zeros(k))
    off = float(np.abs(missed_by[:k]).max() + period * np.abs(missed_by[k:]).max())
    late = 0.0 if once.end == "time" else point.gain * (once.time_error + off / fastest)
    errors = point.gain * (once.error + off) + (many - 1) * late * fastest, many * late
    steady = _steady(request, method, regime, track, t0 + period, errors, facts, (note, *notes))
    turns = range(math.ceil(many))
    slips = [Slips(s.begin + n * period, s.sides) for n in turns for s in once.slips]
    steady = replace(steady, slips=tuple(slips))
    if not once.x_end:
        return steady
    return replace(steady, x_end=tuple(track.signal_states(np.array([steady.t_end]))[0].tolist()))


def _named(multipliers: Array) -> dict[str, float]:
    """The largest as `multiplier`: with its sign if it is real, else its size and angle."""
    facts: dict[str, float] = {}
    for i, value in enumerate(np.asarray(multipliers).tolist()):
        name = "multiplier" if i == 0 else f"multiplier_{i + 1}"
        z = complex(value)
        if abs(z.imag) <= SETTLED * abs(z):
            facts[name] = z.real
        else:
            facts[name] = abs(z)
            facts[f"{name}_angle"] = math.atan2(z.imag, z.real)
    return facts


def _steady(
    request: SimulationRequest,
    method: str,
    regime: str,
    track: Track,
    t_end: float,
    errors: tuple[float, float],
    facts: dict[str, float],
    notes: tuple[str, ...],
    *events: Event,
) -> Motion:
    """A steady state as the motion that was asked for, to the last of the times wanted."""
    t_end = max([t_end, *request.times])
    q, qd = (x[0] for x in track.state(np.array([t_end])))
    is_single = np.ndim(q) == 0
    motion = replace(
        request.standing,
        method=method,
        regime=regime,
        end="steady",
        t_end=t_end,
        q_end=float(q) if is_single else q,
        qd_end=float(qd) if is_single else qd,
        track=track,
        events=events,
        error=errors[0] + ROUNDING * float(np.max(np.abs(q))),
        time_error=errors[1],
        facts=facts,
        notes=notes,
    )
    return missed(motion, request.accuracy or math.inf)


# -- loads of the time ------------------------------------------------------------------


COMMON = 1000  # periods of one load in the common one at most
TIMED = 'ask for "time=<s>" to see how it goes on'
ELSEWHERE = f"start elsewhere, or {TIMED}"
GIVE = 'give the period of the loads: "steady=<s>"'


def no_steady(why: str, remedy: str = TIMED) -> RequestError:
    """The error that says why there is no steady state, or why none was found."""
    return refused("until", f'"steady": {why}', remedy, code="until")


def forcing_period(structure: Structure, declared: float) -> float:
    """The shortest time [s] after which all loads of the time repeat.

    ``declared`` [s] is the period that the user names for loads whose law does not tell it.
    """
    common, first = declared, "steady"
    for name, element in structure.elements.items():
        law: Any = element.law if isinstance(element, Following) else None
        if law is None or "time" not in law.variables():
            continue
        if isinstance(law, Polynomial) and not any(law.coefficients[1:]):
            continue
        if period := getattr(law, "whole", 0.0):
            common, first = _common(common, first, float(period), name), name
        elif not isinstance(law, Function):
            raise no_steady(f"the load {name} follows the time and does not repeat")
        elif not declared:
            raise no_steady(f"the load {name} follows the time by a law that tells no period", GIVE)
    if not common:
        raise no_steady("the loads follow the time, and their period is not known", GIVE)
    return common


def _common(period: float, name: str, second: float, second_name: str) -> float:
    """The least common multiple of two periods [s]; the first may be 0: not known."""
    ratio = Fraction(second / period if period else 1.0).limit_denominator(COMMON)
    is_common = 0 < ratio.numerator <= COMMON
    is_common &= abs(float(ratio) * period / second - 1) <= SETTLED
    if period and not is_common:
        raise no_steady(
            f"the loads {name} and {second_name} repeat after {period:.9g} s and {second:.9g} s, "
            "which have no common multiple, so nothing repeats"
        )
    return period * ratio.numerator or second
