"""User's events on a motion that is known in closed form: found after the run.

The surfaces are sampled along the motion, changes of sign are bracketed and halved, all
of them at once. Two crossings between neighbouring samples are not seen.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from blockmech.dynamics.chebyshev import Floats
from blockmech.dynamics.ends import END_STOP
from blockmech.dynamics.motion import Event, Motion
from blockmech.dynamics.path.quadrature import EPS
from blockmech.dynamics.until import Watch

BLIND = ("spectral", "euler_q")  # methods that run on beyond an end stop
SAMPLES_A_PASSAGE = 64
LEAST, MOST = 257, 200_001
HALVINGS = 60


def watched_motion(motion: Motion, watches: tuple[Watch, ...]) -> Motion:
    """The motion with the watches' events, cut at the first terminal one."""
    if not watches or motion.t_end <= motion.t_start:
        return motion
    found = [(event, watch) for watch in watches for event in _crossings(motion, watch)]
    found.sort(key=lambda pair: pair[0].t)
    last = next((event for event, watch in found if watch.terminal), None)
    t_end = motion.t_end if last is None else last.t
    events = [e for e in motion.events if e.t <= t_end] + [e for e, _ in found if e.t <= t_end]
    events.sort(key=lambda e: e.t)
    if last is None:
        return replace(motion, events=tuple(events))
    return replace(
        motion,
        events=tuple(events),
        t_end=t_end,
        q_end=last.q,
        qd_end=last.qd,
        status="reached",
        end=last.kind,
    )


def stopped_motion(motion: Motion, stops: tuple[float, float]) -> Motion:
    """The motion cut where it meets an end stop (low, high) that its method did not see."""
    if motion.method not in BLIND or motion.t_end <= motion.t_start:
        return motion
    inner = motion.times(LEAST)
    t = np.union1d(inner, getattr(motion.track, "t", inner))  # all steps, where there are steps
    t = t[(t >= motion.t_start) & (t <= motion.t_end)]
    q = motion.track.state(t).q
    out = np.flatnonzero((q < stops[0]) | (q > stops[1]))
    if not out.size:
        return motion
    i = int(out[0])
    stop = stops[0] if q[i] < stops[0] else stops[1]
    side = 1.0 if stop == stops[1] else -1.0
    low = _first_beyond(motion, t, q, stop, side, 0.0)
    met = Event(END_STOP, low, stop, float(motion.track.state(np.array([low])).qd[0]))
    spread = abs(stop) * EPS + motion.error
    early = _first_beyond(motion, t, q, stop, side, -spread)
    late = _first_beyond(motion, t, q, stop, side, spread)
    return replace(
        motion,
        events=(*(e for e in motion.events if e.t <= low), met),
        t_end=low,
        q_end=met.q,
        qd_end=met.qd,
        status="ended",
        end=met.kind,
        time_error=max(low - early, late - low) + EPS * low,
    )


def _first_beyond(
    motion: Motion, t: Floats, q: Floats, stop: float, side: float, more: float
) -> float:
    """First time [s] at which the motion is by ``more`` beyond a stop, inf if it never is."""
    found = np.flatnonzero(side * (q - stop) > more)
    if not found.size:
        return math.inf
    i = int(found[0])
    low, high = float(t[max(i - 1, 0)]), float(t[i])
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        beyond = side * (float(motion.track.state(np.array([middle])).q[0]) - stop) > more
        low, high = (low, middle) if beyond else (middle, high)
    return low


def _crossings(motion: Motion, watch: Watch) -> list[Event]:
    swing = motion.facts.get("swing_time") or motion.facts.get("period") or 0.0
    span = motion.t_end - motion.t_start
    count = SAMPLES_A_PASSAGE * span / swing if swing else LEAST
    t = motion.times(int(min(max(count, LEAST), MOST)))
    value = _values(motion, watch, t)
    rising = (value[:-1] < 0) & (value[1:] >= 0) & (watch.direction >= 0)
    falling = (value[:-1] > 0) & (value[1:] <= 0) & (watch.direction <= 0)
    at = np.flatnonzero(rising | falling)
    if not at.size:
        return []
    low, high, start = t[at], t[at + 1], value[at]
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        same = np.sign(_values(motion, watch, middle)) == np.sign(start)
        low, high = np.where(same, middle, low), np.where(same, high, middle)
        if ((high - low) <= 2e-16 * np.abs(high)).all():
            break
    state = motion.track.state(high)
    return [
        Event(watch.name, float(a), float(b), float(c))
        for a, b, c in zip(high, state.q, state.qd, strict=True)
    ]


def _values(motion: Motion, watch: Watch, t: Floats) -> Floats:
    state = motion.track.state(t)
    rows = zip(t.tolist(), state.q.tolist(), state.qd.tolist(), strict=True)
    return np.array([watch.surface(*row) for row in rows])
