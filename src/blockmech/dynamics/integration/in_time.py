"""Motions by integrators: `refine`d runs in time."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from blockmech.dynamics.chebyshev import Floats
from blockmech.dynamics.ends import INTERRUPTED, LEAST_INERTIA
from blockmech.dynamics.integration.ends_ahead import up_to_its_end
from blockmech.dynamics.integration.equation import (
    Equation,
    from_kernels,
    one_driver,
    several_drivers,
)
from blockmech.dynamics.integration.integrate import Method, Task
from blockmech.dynamics.integration.refine import refined
from blockmech.dynamics.integration.reporting import reporting
from blockmech.dynamics.motion import Motion
from blockmech.dynamics.path.massless import hollows
from blockmech.dynamics.path.quadrature import EPS
from blockmech.dynamics.rest import nothing, resting, trouble
from blockmech.dynamics.system.claims import typical_speed
from blockmech.dynamics.system.reduced import Cost, Metered, MeteredSystems, One
from blockmech.dynamics.until import Asked

FINEST = 1e-9  # target if none is given [rad or m]
TABLE = 0.1  # share of an error from which on the table is to blame


def in_time(
    meter: Metered,
    asked: Asked,
    method: Method,
    tabulated: float = math.inf,
    instead: Method | None = None,
) -> Motion:
    """One driver, integrated in time.

    ``tabulated`` [rad or m]: the table serves this target even if the one asked for is looser,
    where its error is known to grow. ``instead``: the method where no table serves, or where
    on the table the first one misses the target.
    """
    start, system = asked.start, meter.system
    here = meter.one(start.q, start.rate, start.t)
    if trouble(here):
        return nothing(meter, asked, method, trouble(here))
    span = asked.until.value if asked.until.goal == "time" else 0.0
    least = min(asked.accuracy or FINEST, tabulated)
    equation = one_driver(meter, start.q, start.rate, start.t, least, span)
    if equation.source == "kernels":
        method = instead or method
    y0 = np.array([start.q, start.rate, 0.0])
    rest = asked.accuracy or FINEST
    knots = system.time_knots
    inertia = equation.inertia
    empty = hollows(meter, start.q, inertia, LEAST_INERTIA) if inertia is not None else ()
    task = Task(equation, system, y0, start.t, asked.until, asked.watches, knots, rest, empty)
    if start.rate == 0 and "time" not in system.depends_on and equation.rhs(start.t, y0)[1] == 0:
        return resting(meter, asked, method)
    motion = _assembled(replace(task, equation=reporting(equation, asked, method)), asked, method)
    if instead and instead != method and motion.status == "reached" and not motion.reached:
        more = replace(asked, why=f"{asked.why}; {method} misses the target")
        method = instead
        again = replace(task, equation=reporting(equation, asked, method))
        other = _assembled(again, more, method)
        motion = other if other.error < motion.error else motion
    if not motion.reached and _table_is_to_blame(here, asked, equation, motion):
        equation = from_kernels(meter, start.q, start.rate, start.t)
        again = replace(task, equation=reporting(equation, asked, method))
        motion = _assembled(again, asked, method)
    return up_to_its_end(meter, motion)


def _table_is_to_blame(here: One, asked: Asked, equation: Equation, motion: Motion) -> bool:
    """Whether the target is missed because of the table."""
    start, until = asked.start, asked.until
    span = until.value if until.goal == "time" else 0.0
    way = max(1.0, span * typical_speed(here, start.rate))
    return equation.table_error * way > TABLE * motion.error


def several_in_time(
    meter: MeteredSystems, q0: Floats, qd0: Floats, asked: Asked, method: Method
) -> Motion:
    """Several drivers, integrated in time; ``asked.start`` gives the time only."""
    equation = reporting(several_drivers(meter, q0, qd0, asked.start.t), asked, method)
    y0 = np.concatenate([q0, qd0, [0.0]])
    knots = meter.systems.time_knots
    task = Task(equation, None, y0, asked.start.t, asked.until, asked.watches, knots)
    return replace(_assembled(task, asked, method), cost=meter.cost)


def _assembled(task: Task, asked: Asked, method: Method) -> Motion:
    target = asked.accuracy or FINEST
    best = refined(task, method, target, np.asarray(asked.times, dtype=np.float64))
    run, k, equation = best.run, task.equation.drivers, task.equation
    error = best.error + 4 * EPS * float(np.abs(run.y_end[:k]).max())
    notes: tuple[str, ...] = ()
    if run.end == INTERRUPTED:
        judged = "by coarser runs" if math.isfinite(best.error) else "not judged by another run"
        notes = (f"interrupted: the error is {judged}",)
    elif not error <= target:
        notes = (
            f"accuracy not reached: {error:.1e} instead of {target:.1e} "
            f"at tolerance {best.tolerance:.1e}",
        )
    if equation.source == "table":
        notes += (f"right-hand side from the reduced table, error {equation.table_error:.1e}",)
    y = run.y_end
    return Motion(
        method=method,
        why=asked.why,
        regime="integrated",
        status=run.status,
        end=run.end,
        t_start=task.t0,
        t_end=run.t_end,
        q_end=float(y[0]) if k == 1 else y[:k],
        qd_end=float(y[1]) if k == 1 else y[k : 2 * k],
        track=run,
        events=run.events,
        error=error,
        time_error=best.time_error,
        accuracy=asked.accuracy,
        cost=Cost(),
        notes=notes,
        facts={
            "energy_balance": run.balance,
            "tolerance": best.tolerance,
            "rounding": best.rounding,
            "right_hand_sides": float(run.evaluations),
        },
    )
