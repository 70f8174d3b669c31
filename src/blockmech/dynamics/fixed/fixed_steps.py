"""Motions by the methods of fixed steps, and what differences of such runs tell of their errors.

Three runs, each with half the step, show the order; where it does not show, less is believed.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np

from blockmech.dynamics.chebyshev import Floats
from blockmech.dynamics.ends import END_STOP, IMPOSSIBLE, INTERRUPTED, NO_INERTIA
from blockmech.dynamics.fixed import euler_q, rk4
from blockmech.dynamics.integration.disturbance import grown
from blockmech.dynamics.integration.ends_ahead import up_to_its_end
from blockmech.dynamics.integration.equation import (
    from_kernels,
)
from blockmech.dynamics.integration.integrate import Ending, Run
from blockmech.dynamics.integration.legs import Leg
from blockmech.dynamics.integration.reporting import reporting
from blockmech.dynamics.motion import Event, Motion
from blockmech.dynamics.path.massless import massless_between
from blockmech.dynamics.path.quadrature import EPS
from blockmech.dynamics.rest import nothing, trouble
from blockmech.dynamics.system.reduced import TURN, Metered
from blockmech.dynamics.until import Asked, Until
from blockmech.errors import Problem, RequestError

COMPARED = (np.arange(1, 100) * (math.sqrt(5) - 1) / 2) % 1.0  # shares of the time: no step's ends
RK4_STEPS = 200  # of a run or a turn to begin with, where neither step nor target is given
UNTIMED = 25_000  # steps of the coarsest run to a goal that may never be met
RK4_MOST = 100_000  # the same of a long run
ORDER_4 = (10.0, 25.0, 3.0, 1.5)  # fall of differences: as it should be; some; hardly any
RK4_GAIN = 4.0  # of the fifteen that order 4 promises for half the step
RK4_LEAST = 0.2  # gain believed where the order hardly shows
KINKED, KINKED_FALL = 4.0, 0.5  # of the last difference, and of the one before it
RK4_SMALL = 0.1  # share of the way up to which differences are small enough to tell an order
NOISE = 1e-9  # differences relative to the coordinate that may be rounding
EULER_GAIN = 0.25  # of the one that order 1 promises: from rest the order is less at first
EULER_LEAST = 0.2  # gain below which steps are too long for any order
FEW = 8  # steps
BEYOND = 1 / 64  # of the way: how far beyond it a place without inertia is looked for
HALVINGS = 14
EULER_STEP = 1e-3  # [rad or m] that of the paper
UNKNOWN = (math.inf, math.inf)  # errors of an interrupted run that nothing else was compared with

Stepped: TypeAlias = rk4.Fixed | euler_q.Grid


def by_rk4(meter: Metered, asked: Asked, step: float | None) -> Motion:
    """Fixed steps in time; halved until two runs agree if a target is given."""
    start, until, accuracy = asked.start, asked.until, asked.accuracy
    reason = trouble(meter.one(start.q, start.rate, start.t))
    if reason:
        return nothing(meter, asked, "rk4", reason)
    equation = reporting(from_kernels(meter, start.q, start.rate, start.t), asked, "rk4")
    h = step or _rk4_step(until, equation.speed)
    timed = until.goal == "time"
    if timed and until.value > rk4.MOST_STEPS * h:
        raise _too_short(h, until.value)
    most = rk4.MOST_STEPS if step or timed else UNTIMED
    runs = []
    for parts, size in ((1, 4 * h), (2, 2 * h)):
        runs.append(
            rk4.stepped(equation, start, until, size, parts, meter.system.stops, parts * most)
        )
        if runs[-1].end == INTERRUPTED or runs[-1].status == "failed":
            return _fixed(runs[-1], meter, asked, "rk4", UNKNOWN, size, ())
    coarse = runs[-1]
    empty = _massless(meter, coarse)
    if empty:
        return _fixed(_cut(coarse, empty), meter, asked, "rk4", UNKNOWN, 2 * h, ())
    before = _apart(*runs)
    kinked = bool(meter.system.time_knots or meter.system.knots)
    for _ in range(HALVINGS):
        parts *= 2
        fine = rk4.stepped(equation, start, until, h, parts, meter.system.stops, parts * most)
        apart = _apart(coarse, fine)
        error, time_error = _judged(fine, before, apart, kinked)
        few = fine.q.size <= FEW and fine.end != INTERRUPTED
        if few:  # steps as long as the whole motion tell nothing
            error = time_error = math.inf
        enough = accuracy is None and not few
        if step or enough or error <= (accuracy or 0.0) or fine.end == INTERRUPTED:
            break
        coarse, before, h = fine, apart, h / 2
    error += EPS / 2 * fine.q.size * float(np.abs(fine.q).max())  # each step's sum is rounded
    if fine.end != INTERRUPTED:
        more = grown(equation, _as_run(fine))
        error, time_error = error + more.coordinate, time_error + more.time
    if fine.status == "ended" and not error <= RK4_SMALL * _whole(fine)[0]:
        time_error = math.inf  # when it ends is as good as where it goes
    y = float(fine.t[-1]), float(fine.q[-1]), float(fine.qd[-1])
    events = (Event(fine.end, *y),) if fine.status == "ended" else ()
    motion = _fixed(fine, meter, asked, "rk4", (error, time_error), h, events)
    return up_to_its_end(meter, motion)


def _too_short(step: float, span: float) -> RequestError:
    found = f"{step:g} s is {span / step:.2g} steps of the run, at most {rk4.MOST_STEPS:,} are made"
    remedy = 'give a longer step, or leave it out; for accuracy take "dop853"'
    return RequestError(Problem("bad-value", "step", found, "", remedy))


def _rk4_step(until: Until, speed: float) -> float:
    """Step [s] where none is given: of the run, or of a turn if it is longer than that."""
    turn = TURN / speed
    if until.goal != "time":
        return turn / RK4_STEPS
    return max(min(until.value, turn) / RK4_STEPS, until.value / RK4_MOST)


def _as_run(fixed: rk4.Fixed) -> Run:
    """Fixed steps as a run whose disturbances can be followed."""
    y = np.array([fixed.q[-1], fixed.qd[-1], 0.0])
    begin, end = float(fixed.t[0]), float(fixed.t[-1])

    def dense(t: Floats) -> Floats:
        return np.stack([*fixed.state(t), np.zeros_like(t)])

    status: Ending = fixed.status if fixed.status != "rest" else "ended"
    leg = Leg(begin, end, y, dense, (), False, 0.0, fixed.t[:-1])
    return Run(1, (leg,), (), status, fixed.end, end, y, 4 * fixed.t.size)


def _whole(run: Stepped) -> tuple[float, float]:
    """Extent of a run: way between its ends of range [rad or m], and time [s]."""
    return float(np.ptp(run.q)), float(run.t[-1] - run.t[0])


def _judged(
    fine: rk4.Fixed, before: tuple[float, float], apart: tuple[float, float], kinked: bool
) -> tuple[float, float]:
    """Errors of the finest of three runs [rad or m] and [s], from their differences."""
    pairs = tuple(zip(before, apart, strict=True))
    if fine.status == "reached" or fine.end == END_STOP:
        if kinked:
            return _across_kinks(*pairs[0]), _across_kinks(*pairs[1])
        noise = NOISE * max(1.0, float(np.abs(fine.q).max()))
        place, time = (
            _of_order_4(a, b, noise, whole)
            for (a, b), whole in zip(pairs, _whole(fine), strict=True)
        )
        return place, time
    # no order shows in the last steps
    place, time = (max(a if math.isfinite(a) else 0.0, b) / RK4_LEAST for a, b in pairs)
    # beside the end, where no time is compared, a delay is one of the place
    return max(place, time * float(np.abs(fine.qd[-FEW:]).max())), time


def _of_order_4(before: float, apart: float, noise: float, whole: float) -> float:
    """Error of the finest of three runs, each with half the step, from their differences.

    They fall to a sixteenth where the steps are short enough for the order to show. Where
    they fall otherwise, or are no small part of the ``whole``, less is believed, and nothing
    where they do not fall at all, if they are more than ``noise``.
    """
    if not (math.isfinite(apart) and apart > 0):
        return apart
    fall = before / apart if math.isfinite(before) else 0.0
    if ORDER_4[0] <= fall <= ORDER_4[1] and before <= RK4_SMALL * whole:
        return apart / RK4_GAIN
    if fall >= ORDER_4[2] and before <= whole:
        return apart
    return apart / RK4_LEAST if fall >= ORDER_4[3] or apart <= noise else math.inf


def _across_kinks(before: float, apart: float) -> float:
    """Error of the finest of three runs whose steps pass kinks of the loads.

    Each kink costs the step it lies in the order, by an amount that depends on where in the
    step it lies: differences fall like those of order 2, and not steadily.
    """
    return max(KINKED * apart, KINKED_FALL * before)


def by_euler_q(meter: Metered, asked: Asked, step: float | None) -> Motion:
    """The paper's scheme; its error from a run with twice the step."""
    start, until = asked.start, asked.until
    reason = trouble(meter.one(start.q, start.rate, start.t))
    if reason:
        return nothing(meter, asked, "euler_q", reason)
    h = step or EULER_STEP
    runs = []
    for size in (4 * h, 2 * h):
        runs.append(euler_q.stepped(meter, start, until, size))
        if runs[-1].end == INTERRUPTED:
            return _fixed(runs[-1], meter, asked, "euler_q", UNKNOWN, size, ())
    empty = _massless(meter, runs[-1])
    if empty:
        return _fixed(_cut(runs[-1], empty), meter, asked, "euler_q", UNKNOWN, 2 * h, ())
    fine = euler_q.stepped(meter, start, until, h)
    before, apart = _apart(*runs), _apart(runs[-1], fine)
    error, time_error = (_of_order_1(a, b) for a, b in zip(before, apart, strict=True))
    if fine.q.size <= FEW:  # the first steps of all runs are alike, so nothing is known
        error = math.inf
    if fine.end == IMPOSSIBLE and fine.qd[-1]:  # it ends up to two steps before that
        time_error += 2 * h / abs(float(fine.qd[-1]))
    if fine.status == "ended" and not math.isfinite(error):
        time_error = math.inf  # when it ends is as good as where it goes
    events = tuple(Event("standstill", float(fine.t[i]), float(fine.q[i]), 0.0) for i in fine.stops)
    motion = _fixed(fine, meter, asked, "euler_q", (error, time_error), h, events)
    return up_to_its_end(meter, motion)


def _of_order_1(before: float, apart: float) -> float:
    """Error of the finest of three runs, each with half the step, from their differences.

    Half the step halves them where the steps are short enough for the order to show. Where
    they hardly fall, as near a separatrix, there is no telling where they would end.
    """
    if not (math.isfinite(apart) and apart > 0):
        return apart
    gain = before / apart - 1 if math.isfinite(before) else 0.0
    return apart / min(gain, 1.0) / EULER_GAIN if gain > EULER_LEAST else math.inf


def _massless(meter: Metered, run: Stepped) -> list[float]:
    """Places without inertia that fixed steps would step over, or end just before."""
    around = run.q[0] + np.array([-1.0, 1.0]) * (meter.system.period or math.inf)
    good = run.q[np.isfinite(run.q)]
    step, ends = float(np.abs(np.diff(good)).max(initial=0.0)), (float(good.min()), good.max())
    beyond = max(step, BEYOND * float(np.ptp(good)))  # seen from both sides
    low, high = np.array([ends[0] - beyond, ends[1] + beyond]).clip(*around)
    return [
        place
        for place in massless_between(meter, float(low), float(high))
        if ends[0] <= place <= ends[1] or abs(place - float(good[-1])) <= 2 * step
    ]


def _cut(run: Stepped, places: list[float]) -> Stepped:
    """The run before it comes to the first of some places [rad or m]."""
    at = np.array(places)
    passed = ((run.q[:, None] > at) != (run.q[0] > at)).any(axis=1)
    n = max(int(np.argmax(passed)), 1) if passed.any() else run.q.size
    rows = {name: getattr(run, name)[:n] for name in run._fields if name in ("t", "q", "qd", "qdd")}
    return run._replace(**rows, end=NO_INERTIA, status="ended")


def _apart(coarse: Stepped, fine: Stepped) -> tuple[float, float]:
    """Largest difference of two runs at common times, and of their ends."""
    end = min(coarse.t[-1], fine.t[-1])
    if coarse.end != fine.end and fine.end != INTERRUPTED:
        return UNKNOWN
    t = fine.t[0] + (end - fine.t[0]) * COMPARED
    difference = float(np.abs(coarse.state(t).q - fine.state(t).q).max())
    if fine.end == INTERRUPTED:
        return difference, 0.0
    difference = max(difference, abs(float(coarse.q[-1] - fine.q[-1])))
    return difference, abs(float(coarse.t[-1] - fine.t[-1]))


def _fixed(
    run: Stepped,
    meter: Metered,
    asked: Asked,
    method: str,
    errors: tuple[float, float],
    step: float,
    events: tuple[Event, ...],
) -> Motion:
    accuracy, error = asked.accuracy, errors[0]
    notes: tuple[str, ...] = ()
    if accuracy is not None and not error <= accuracy:
        notes = (f"accuracy not reached: {error:.1e} instead of {accuracy:.1e}",)
    told = error <= max(_whole(run)[0], NOISE)
    if run.end != INTERRUPTED and run.status != "failed" and not told and run.t.size > 1:
        unit = "s" if method == "rk4" else "rad" if meter.system.kind == "rotation" else "m"
        notes += (f"steps of {step:.3g} {unit} are too long: this may be no motion at all",)
    return Motion(
        method=method,
        why=asked.why,
        regime="integrated",
        status=run.status,
        end=run.end,
        t_start=asked.start.t,
        t_end=float(run.t[-1]),
        q_end=float(run.q[-1]),
        qd_end=float(run.qd[-1]),
        track=run,
        events=events,
        error=error,
        time_error=errors[1],
        accuracy=accuracy,
        cost=meter.cost,
        notes=notes,
        facts={"time_step" if method == "rk4" else "coordinate_step": step},
    )
