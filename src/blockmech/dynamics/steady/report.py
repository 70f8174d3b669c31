"""Steady states as motions: one period of them, their stability, how they were found."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from blockmech.dynamics.chebyshev import Floats
from blockmech.dynamics.integration.integrate import Run
from blockmech.dynamics.motion import Event, Motion, State, Still
from blockmech.dynamics.path.conservative import Conservative
from blockmech.dynamics.path.line import Line
from blockmech.dynamics.path.quadrature import EPS
from blockmech.dynamics.steady.equilibrium import Rest
from blockmech.dynamics.steady.return_map import Steadily
from blockmech.dynamics.steady.shooting import NEUTRAL, Cycle
from blockmech.dynamics.system.reduced import TURN, Cost
from blockmech.dynamics.until import Asked

NAMED = 6  # other steady states named
REAL = 1e-9  # imaginary part, relative, that is none


@dataclass(frozen=True)
class Repeated:
    """Dense output of a periodic motion: runs one after another, and again.

    T : [s] of each run
    shift : [rad or m] by how much the coordinates advance in all of them; (k,) or a number
    """

    runs: tuple[Run, ...]
    T: float
    shift: Floats
    t0: float

    def state(self, t: Floats) -> State:
        """State at times (m,) [s]."""
        period = self.T * len(self.runs)
        turn = np.floor((t - self.t0) / period)
        local = np.clip(t - self.t0 - turn * period, 0.0, period)
        which = np.minimum(np.floor(local / self.T).astype(np.intp), len(self.runs) - 1)
        q: Floats | None = None
        qd: Floats | None = None
        for i in np.unique(which).tolist():
            here = which == i
            found = self.runs[i].state(self.t0 + local[here] - i * self.T)
            if q is None or qd is None:
                q, qd = (np.empty((t.size, *x.shape[1:])) for x in found)
            q[here], qd[here] = found
        assert q is not None
        assert qd is not None
        many = turn if q.ndim == 1 else turn[:, None]
        return State(q + many * self.shift, qd)


def of_cycle(cycle: Cycle, asked: Asked, how: str, notes: Sequence[str]) -> Motion:
    """One period of a motion found by Newton's method on a map."""
    k = cycle.x.size // 2
    shift = cycle.shift[:k]
    track = Repeated(cycle.runs, cycle.T, shift[0] if k == 1 else shift, asked.start.t)
    facts = {"period": cycle.period, **_multipliers(cycle.multipliers)}
    if how != "return map":
        facts["periods_of_the_loads"] = float(cycle.periods)
    if (np.abs(shift) > cycle.error).any():
        facts["mean_speed"] = float(np.abs(shift).max() / cycle.period)
    notes = (_stability(cycle.largest), *notes)
    motion = _periodic(track, cycle.period, asked, how, facts, notes)
    return _judged(motion, cycle.error, cycle.period_error, cycle.largest)


def of_rotation(found: Steadily, asked: Asked, notes: Sequence[str]) -> Motion:
    """One turn of a rotation found by collocation."""
    view, rotation = found
    turn, start = rotation.turn, asked.start
    facts = {
        "period": turn.total,
        "multiplier": rotation.multiplier,
        "mean_speed": turn.period / turn.total,
    }
    told = f"found from the constant speed {view.sign * rotation.start:.6g}"
    track = Conservative(Line(view, turn, period=turn.period), 0.0, 1, start.t)
    notes = (_stability(rotation.multiplier), told, *notes)
    motion = _periodic(track, turn.total, asked, "collocation", facts, notes)
    if motion.t_end == start.t + turn.total:  # to the last bit
        motion = replace(motion, q_end=start.q + view.sign * turn.period)
    error = turn.error * turn.fastest
    return _judged(motion, error, turn.error, rotation.multiplier)


def of_rest(rest: Rest, asked: Asked, notes: Sequence[str]) -> Motion:
    """The equilibrium at which a motion comes to rest."""
    k, start = rest.q.size, asked.start
    q = float(rest.q[0]) if k == 1 else rest.q
    qd = 0.0 if k == 1 else np.zeros(k)
    facts: dict[str, float] = {}
    slowest = complex(rest.values[0])
    if rest.kind == "stable":
        facts["decay_rate"] = -slowest.real
        words = f"stable: disturbances fade as exp(-{-slowest.real:.6g} t)"
    elif rest.kind == "unstable":
        facts["rate"] = slowest.real
        words = f"unstable: any disturbance grows as exp({slowest.real:.6g} t)"
    else:
        words = "indifferent: a disturbance neither grows nor fades by itself at first"
    if slowest.imag:
        facts["frequency"] = abs(slowest.imag)
    motion = Motion(
        method="equilibrium",
        why=asked.why,
        regime="rest",
        status="reached",
        end="steady",
        t_start=start.t,
        t_end=_last(asked, 0.0),
        q_end=q,
        qd_end=qd,
        track=Still(q, qd),
        events=(Event("rest", start.t, q, qd),),
        error=0.0,
        time_error=0.0,
        accuracy=asked.accuracy,
        cost=Cost(),
        notes=(f"at rest at an equilibrium; {words}", *notes),
        facts=facts,
    )
    return _judged(motion, rest.error, 0.0, 0.0)


def named_others(others: Sequence[str]) -> tuple[str, ...]:
    """Notes about other steady states, a few of them."""
    more = len(others) - NAMED
    said = tuple(f"another steady state: {text}" for text in others[:NAMED])
    return said if more <= 0 else (*said, f"and {more} more")


def cycle_in_words(cycle: Cycle) -> str:
    """A periodic motion in a line."""
    k = cycle.x.size // 2
    turns = cycle.shift[0] / TURN if k == 1 else 0.0
    at = f", q = {cycle.x[0]:.6g} when the loads begin a period" if k == 1 and not turns else ""
    way = f"{turns:+g} turns in " if turns else ""
    return f"{way}{cycle.period:.9g} s, {_word(cycle.largest)}, multiplier {cycle.largest:.6g}{at}"


def rotation_in_words(found: Steadily) -> str:
    """A rotation found by collocation in a line."""
    turn, mu = found.rotation.turn, found.rotation.multiplier
    turns = found.view.sign * turn.period / TURN
    return f"{turns:+g} turns in {turn.total:.9g} s, {_word(mu)}, multiplier {mu:.6g}"


def _periodic(
    track: Repeated | Conservative,
    period: float,
    asked: Asked,
    how: str,
    facts: dict[str, float],
    notes: Sequence[str],
) -> Motion:
    t0 = asked.start.t
    t_end = _last(asked, period)
    q, qd = (x[0] for x in track.state(np.array([t_end])))
    return Motion(
        method=how,
        why=asked.why,
        regime="steady state",
        status="reached",
        end="steady",
        t_start=t0,
        t_end=t_end,
        q_end=float(q) if np.ndim(q) == 0 else q,
        qd_end=float(qd) if np.ndim(qd) == 0 else qd,
        track=track,
        events=(),
        error=0.0,
        time_error=0.0,
        accuracy=asked.accuracy,
        cost=Cost(),
        notes=tuple(notes),
        facts=facts,
    )


def _last(asked: Asked, period: float) -> float:
    """The end of a period, or the last time that is asked for [s]."""
    return max([asked.start.t + period, *asked.times])


def _judged(motion: Motion, error: float, late: float, largest: float) -> Motion:
    """With its error; that of the period adds up over many of them."""
    period = motion.facts.get("period", 0.0)
    many = max((motion.t_end - motion.t_start) / period, 1.0) if period else 1.0
    fastest = 0.0
    if many > 1:
        t = motion.t_start + np.linspace(0.0, period, 65)
        fastest = float(np.abs(motion.track.state(t).qd).max())
    error += (many - 1) * late * fastest + 4 * EPS * float(np.abs(motion.q_end).max())
    notes = motion.notes
    if motion.accuracy is not None and not error <= motion.accuracy:
        notes += (f"accuracy not reached: {error:.1e} instead of {motion.accuracy:.1e}",)
    regime = motion.regime if largest < 1 - NEUTRAL else f"{_word(largest)} periodic motion"
    return replace(motion, error=error, time_error=late * many, notes=notes, regime=regime)


def _word(multiplier: float) -> str:
    if abs(abs(multiplier) - 1) <= NEUTRAL:
        return "neutral"
    return "stable" if abs(multiplier) < 1 else "unstable"


def _stability(multiplier: float) -> str:
    """What becomes of disturbances, by the largest multiplier."""
    size, word = abs(multiplier), _word(multiplier)
    if word == "neutral":
        return "neutral: disturbances neither grow nor fade, so a motion from elsewhere stays away"
    if word == "stable":
        return f"stable: a period leaves {size:.6g} of a disturbance"
    return f"unstable: a period makes {size:.6g} of a disturbance, so no motion stays"


def _multipliers(values: Floats) -> dict[str, float]:
    """The largest as `multiplier`: with its sign if it is real, else its size and angle."""
    facts: dict[str, float] = {}
    for i, value in enumerate(values.tolist()):
        name = "multiplier" if i == 0 else f"multiplier_{i + 1}"
        z = complex(value)
        if abs(z.imag) <= REAL * abs(z):
            facts[name] = z.real
        else:
            facts[name] = abs(z)
            facts[f"{name}_angle"] = math.atan2(z.imag, z.real)
    return facts
