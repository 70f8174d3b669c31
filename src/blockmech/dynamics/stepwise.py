"""Motions by integrators: `refine`d runs in time, and the fixed-step methods."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from blockmech.dynamics import euler_q, rk4
from blockmech.dynamics.chebyshev import Floats
from blockmech.dynamics.equation import Equation, from_kernels, one_driver, several_drivers
from blockmech.dynamics.integrate import Method, Run, Task
from blockmech.dynamics.motion import Event, Motion, Still, Track
from blockmech.dynamics.quadrature import EPS
from blockmech.dynamics.reduced import TURN, Metered, MeteredSystems
from blockmech.dynamics.refine import refined
from blockmech.dynamics.surfaces import DEAD_CENTRE
from blockmech.dynamics.until import Start, Until, Watch

FINEST = 1e-9  # target if none is given [rad or m]
COMPARED = 20
RK4_STEPS = 200  # to begin with, where neither step nor target is given
HALVINGS = 14
EULER_STEP = 1e-3  # [rad or m] that of the paper


def in_time(
    meter: Metered,
    start: Start,
    until: Until,
    method: Method,
    accuracy: float | None,
    why: str,
    times: Floats,
    watches: tuple[Watch, ...],
) -> Motion:
    """One driver, integrated in time."""
    target = accuracy or FINEST
    trouble = _impossible(meter, start, method, accuracy, why)
    if trouble is not None:
        return trouble
    equation = one_driver(meter, start.q, start.rate, start.t, target)
    y0 = np.array([start.q, start.rate, 0.0])
    task = Task(equation, meter.system, y0, start.t, until, watches, meter.system.time_knots)
    if start.rate == 0 and _stays(equation, task):
        from blockmech.dynamics.energy import resting

        return resting(meter, start, until, accuracy, why)
    return _assembled(task, method, accuracy, target, times, why, lambda: meter.cost, meter)


def several_in_time(
    meter: MeteredSystems,
    q0: Floats,
    qd0: Floats,
    t0: float,
    until: Until,
    method: Method,
    accuracy: float | None,
    why: str,
    times: Floats,
    watches: tuple[Watch, ...],
) -> Motion:
    """Several drivers, integrated in time."""
    equation = several_drivers(meter, q0, qd0, t0)
    y0 = np.concatenate([q0, qd0, [0.0]])
    task = Task(equation, None, y0, t0, until, watches, meter.systems.time_knots)
    target = accuracy or FINEST
    return _assembled(task, method, accuracy, target, times, why, lambda: meter.cost, None)


def _stays(equation: Equation, task: Task) -> bool:
    """Whether a start from rest is an equilibrium for good (no explicit time)."""
    system = task.system
    if system is None or "time" in system.depends_on:
        return False
    return bool(equation.rhs(task.t0, task.y0)[1] == 0.0)


def _impossible(
    meter: Metered, start: Start, method: str, accuracy: float | None, why: str
) -> Motion | None:
    one = meter.one(start.q, start.rate, start.t)
    if one.margin > 0 and one.J > 0:
        return None
    reason = "no inertia" if one.margin > 0 else "impossible pose"
    return Motion(
        method=method,
        why=why,
        regime="none",
        status="failed",
        end=reason,
        t_start=start.t,
        t_end=start.t,
        q_end=start.q,
        qd_end=start.rate,
        track=Still(start.q),
        events=(),
        error=math.nan,
        time_error=math.nan,
        accuracy=accuracy,
        cost=meter.cost,
        notes=(f"{reason} at the start",),
    )


def _assembled(
    task: Task,
    method: Method,
    accuracy: float | None,
    target: float,
    times: Floats,
    why: str,
    cost: Callable[[], Any],
    meter: Metered | None,
) -> Motion:
    best = refined(task, method, target, times)
    run, k = best.run, task.equation.drivers
    notes: list[str] = []
    if not best.reached:
        notes.append(
            f"accuracy not reached: {best.error:.1e} instead of {target:.1e} "
            f"at tolerance {best.tolerance:.1e}"
        )
    if task.equation.source == "table":
        notes.append(f"right-hand side from the reduced table, error {task.equation.table_error:.1e}")
    facts = {
        "energy_balance": run.balance,
        "tolerance": best.tolerance,
        "right_hand_sides": float(run.evaluations),
    }
    if run.end == "dead centre" and run.status == "ended" and meter is not None:
        facts["dead_centre_time"] = _dead_centre_time(meter, run)
    y = run.y_end
    return Motion(
        method=method,
        why=why,
        regime="integrated",
        status=run.status,
        end=run.end,
        t_start=task.t0,
        t_end=run.t_end,
        q_end=float(y[0]) if k == 1 else y[:k],
        qd_end=float(y[1]) if k == 1 else y[k : 2 * k],
        track=run,
        events=run.events,
        error=best.error + 4 * EPS * float(np.abs(y[:k]).max()),
        time_error=best.time_error,
        accuracy=accuracy,
        cost=cost(),
        notes=tuple(notes),
        facts=facts,
    )


def _dead_centre_time(meter: Metered, run: Run) -> float:
    """When the margin would be zero: it goes with the square of the time left [s]."""
    q, qd = float(run.y_end[0]), float(run.y_end[1])
    h = 1e-3 * DEAD_CENTRE
    slope = (meter.one(q).margin - meter.one(q - math.copysign(h, qd)).margin) / h
    rate = abs(slope * qd)
    return run.t_end + 2 * DEAD_CENTRE / rate if rate > 0 else math.nan


def by_rk4(
    meter: Metered,
    start: Start,
    until: Until,
    step: float | None,
    accuracy: float | None,
    why: str,
) -> Motion:
    """Fixed steps in time; halved until two runs agree if a target is given."""
    trouble = _impossible(meter, start, "rk4", accuracy, why)
    if trouble is not None:
        return trouble
    equation = from_kernels(meter, start.q, start.rate, start.t)
    scale = until.value if until.goal == "time" else TURN / equation.speed
    h = step or scale / RK4_STEPS
    coarse = rk4.stepped(equation, start, until, 2 * h)
    for _ in range(HALVINGS):
        fine = rk4.stepped(equation, start, until, h)
        error, time_error = _apart(coarse, fine)
        error, time_error = error / 7, time_error / 7  # of order 4 the finer has a fifteenth
        if step or accuracy is None or error <= accuracy:
            break
        coarse, h = fine, h / 2
    return _fixed("rk4", fine, meter, start, accuracy, why, error, time_error, {"step": h}, ())


def by_euler_q(
    meter: Metered,
    start: Start,
    until: Until,
    step: float | None,
    accuracy: float | None,
    why: str,
) -> Motion:
    """The paper's scheme; its error from a run with twice the step."""
    trouble = _impossible(meter, start, "euler_q", accuracy, why)
    if trouble is not None:
        return trouble
    h = step or EULER_STEP
    coarse = euler_q.stepped(meter, start, until, 2 * h)
    fine = euler_q.stepped(meter, start, until, h)
    error, time_error = _apart(coarse, fine)
    events = tuple(
        Event("standstill", float(fine.t[i]), float(fine.q[i]), 0.0) for i in fine.stops
    )
    return _fixed(
        "euler_q",
        fine,
        meter,
        start,
        accuracy,
        why,
        2 * error,
        2 * time_error,
        {"step": h},
        events,
    )


def _apart(coarse: Any, fine: Any) -> tuple[float, float]:
    """Largest difference of two runs at common times, and of their ends."""
    end = min(coarse.t[-1], fine.t[-1])
    t = np.linspace(fine.t[0], end, COMPARED + 1)
    difference = float(np.abs(coarse.state(t).q - fine.state(t).q).max())
    difference = max(difference, abs(float(coarse.q[-1] - fine.q[-1])))
    return difference, abs(float(coarse.t[-1] - fine.t[-1]))


def _fixed(
    method: str,
    run: Any,
    meter: Metered,
    start: Start,
    accuracy: float | None,
    why: str,
    error: float,
    time_error: float,
    facts: dict[str, float],
    events: tuple[Event, ...],
) -> Motion:
    track: Track = run
    notes = ()
    if accuracy is not None and not error <= accuracy:
        notes = (f"accuracy not reached: {error:.1e} instead of {accuracy:.1e}",)
    return Motion(
        method=method,
        why=why,
        regime="integrated",
        status=run.status,
        end=run.end,
        t_start=start.t,
        t_end=float(run.t[-1]),
        q_end=float(run.q[-1]),
        qd_end=float(run.qd[-1]),
        track=track,
        events=events,
        error=error,
        time_error=time_error,
        accuracy=accuracy,
        cost=meter.cost,
        notes=notes,
        facts=facts,
    )
