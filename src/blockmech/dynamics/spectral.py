"""Method ``spectral``: speed-dependent loads without steps in time.

The energy equation is marched over panels of the driver's path (`march`), the time is a
quadrature afterwards, and the periodic steady state is a collocation on one turn
(`steady`). It serves scenes without explicit time whose driver does not stop on the way;
where it does, the method says so and leaves the run to an integrator.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from blockmech.dynamics.chebyshev import Floats
from blockmech.dynamics.conservative import Conservative
from blockmech.dynamics.dense import place, when
from blockmech.dynamics.line import Line
from blockmech.dynamics.march import March, as_quadrature, errors, march
from blockmech.dynamics.mesh import View
from blockmech.dynamics.motion import Motion, State
from blockmech.dynamics.patches import Path
from blockmech.dynamics.quadrature import EPS, Quadrature
from blockmech.dynamics.reduced import TURN, Metered
from blockmech.dynamics.steady import Steady, steady
from blockmech.dynamics.until import Start, Until

NODES, CHECK_NODES = 32, 48
PER_TURN = 4
TOLERANCES = (1e-6, 1e-9, 1e-12, 1e-15)  # of a panel, one after the other
FINEST = 1e-10  # target if none is given [rad or m]
COMPARED = 20


@dataclass(frozen=True)
class Marched:
    """Dense output of a march."""

    view: View
    quad: Quadrature
    t0: float

    def state(self, t: Floats) -> State:
        """State at times (m,) [s]."""
        found = place(self.quad, np.clip(t - self.t0, 0.0, self.quad.total))
        return State(self.view.q(found.x), self.view.sign * found.rate)


def spectral(
    meter: Metered, start: Start, until: Until, accuracy: float | None, why: str
) -> Motion | str:
    """The motion by panels in q, or the reason why this method cannot give it.

    The tolerance is lowered until the error estimate meets the target. With a target,
    one more march with more nodes checks the estimate.
    """
    with np.errstate(all="ignore"):
        return _spectral(meter, start, until, accuracy, why)


def _spectral(
    meter: Metered, start: Start, until: Until, accuracy: float | None, why: str
) -> Motion | str:
    one = meter.one(start.q, start.rate, start.t)
    if not (one.margin > 0 and one.J > 0):
        return "the start is no pose of the mechanism"
    if start.rate == 0 and one.tau == 0:
        return "it starts at rest at an equilibrium"
    view = View(meter, start.q, math.copysign(1.0, start.rate or one.tau))
    goal, value = until.goal, until.value
    far = {"turns": value * TURN, "angle": view.sign * (value - start.q)}.get(goal, math.inf)
    if goal not in ("time", "turns", "angle") or far < 0:
        return "the goal asks for a standstill or a way back"

    def done(x: float, elapsed: float) -> bool:
        return elapsed >= value if goal == "time" else x >= far

    K0 = one.J * start.rate**2 / 2
    effort0 = view.sign * one.tau
    target = accuracy or FINEST
    path = Path(view, NODES, PER_TURN)
    found: tuple[March, Quadrature, float, float] | None = None
    for tolerance in TOLERANCES:
        run = march(path, K0, effort0, tolerance, done)
        if run.reason != "done":
            return _trouble(run, view)
        quad = as_quadrature(run.panels)
        seconds, _ = errors(run.panels)
        error = seconds * quad.fastest
        if found is None or error < found[2]:
            found = (run, quad, error, tolerance)
        if error <= target:
            break
    assert found is not None
    run, quad, error, tolerance = found
    t_end = start.t + (value if goal == "time" else float(when(quad, np.array([far]))[0]))
    if accuracy is not None:
        finer = Path(view, CHECK_NODES, PER_TURN)
        check = march(finer, K0, effort0, tolerance, done)
        if check.reason == "done":
            other = as_quadrature(check.panels)
            times = np.linspace(start.t, t_end, COMPARED + 1)[1:]
            a, b = (Marched(view, x, start.t).state(times).q for x in (quad, other))
            error, quad = max(error, float(np.abs(a - b).max())), other
            if goal != "time":
                t_end = start.t + float(when(quad, np.array([far]))[0])
    track = Marched(view, quad, start.t)
    q_end, qd_end = (float(x[0]) for x in track.state(np.array([t_end])))
    error += 4 * EPS * abs(q_end)
    notes = () if error <= target else (f"accuracy not reached: {error:.1e} not {target:.1e}",)
    return Motion(
        method="spectral",
        why=why,
        regime="one way",
        status="reached",
        end=goal,
        t_start=start.t,
        t_end=t_end,
        q_end=q_end,
        qd_end=qd_end,
        track=track,
        events=(),
        error=error,
        time_error=error / max(abs(qd_end), 1e-300),
        accuracy=accuracy,
        cost=meter.cost,
        notes=notes,
        facts={"panels": float(len(run.panels))},
    )


def _trouble(run: March, view: View) -> str:
    x = run.panels[-1].patch.high + run.panels[-1].shift if run.panels else 0.0
    q = view.origin + view.sign * x
    if run.reason == "slow":
        return f"the motion slows down to a standstill after q = {q:.6g}"
    if run.reason == "gap":
        return f"the mechanism comes to an end of its range after q = {q:.6g}"
    return "the run is too long for it"


def steady_motion(
    meter: Metered, start: Start, accuracy: float | None, why: str
) -> Motion | str:
    """The periodic motion in the direction of the start, or why none was found.

    Several may exist: the one whose mean speed is nearest the start's is taken (the
    fastest for a start from rest), the others are named in the notes.
    """
    with np.errstate(all="ignore"):
        one = meter.one(start.q, start.rate, start.t)
        if not one.margin > 0:
            return "the start is no pose of the mechanism"
        view = View(meter, start.q, math.copysign(1.0, start.rate or one.tau or 1.0))
        target = accuracy or FINEST
        found = steady(view, target)
        if not found:
            return "no periodic rotation was found in this direction"
        chosen = _nearest(found, abs(start.rate))
        return _periodic(meter, view, start, chosen, found, accuracy, why)


def _nearest(found: list[Steady], rate: float) -> Steady:
    if rate == 0:
        return min(found, key=lambda s: s.turn.total)
    return min(found, key=lambda s: abs(s.turn.period / s.turn.total - rate))


def _periodic(
    meter: Metered,
    view: View,
    start: Start,
    chosen: Steady,
    found: list[Steady],
    accuracy: float | None,
    why: str,
) -> Motion:
    turn = chosen.turn
    track = Conservative(Line(view, turn, period=turn.period), 0.0, 1, start.t)
    state = track.state(np.array([start.t]))
    mean = turn.period / turn.total
    stable = chosen.multiplier < 1
    notes = [f"found by {chosen.how}, started from the constant speed {chosen.start:.6g}"]
    notes += [
        f"another periodic motion: period {s.turn.total:.9g} s, multiplier {s.multiplier:.6g}"
        for s in found
        if s is not chosen
    ]
    if not stable:
        notes.append("this motion is unstable: its multiplier is not below 1")
    speeds = 1 / turn.slowness
    error = turn.error * turn.fastest
    return Motion(
        method="spectral",
        why=why,
        regime="steady state" if stable else "unstable periodic motion",
        status="reached",
        end="steady",
        t_start=start.t,
        t_end=start.t + turn.total,
        q_end=start.q + view.sign * turn.period,
        qd_end=float(state.qd[0]),
        track=track,
        events=(),
        error=error,
        time_error=turn.error,
        accuracy=accuracy,
        cost=meter.cost,
        notes=tuple(notes),
        facts={
            "period": turn.total,
            "multiplier": chosen.multiplier,
            "mean_speed": mean,
            "fluctuation": float((speeds.max() - speeds.min()) / mean),
        },
    )
