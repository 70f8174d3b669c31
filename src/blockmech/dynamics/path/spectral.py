"""Method ``spectral``: speed-dependent loads without steps in time.

The energy equation is marched over panels of the driver's path (`march`), the time is a
quadrature afterwards. It serves scenes without explicit time whose driver does not stop on the way;
where it does, the method says so and leaves the run to an integrator. It does not pass
standstills on purpose: there the effort on the way back is another function of K than on
the way out, so a march would have to stop and turn at an unknown place, and then an
integrator in time, which sees nothing special there, is simpler and as accurate.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from blockmech.dynamics.chebyshev import Floats
from blockmech.dynamics.ends import INTERRUPTED, LEAST_MARGIN
from blockmech.dynamics.motion import Motion, State, Status
from blockmech.dynamics.path.dense import place, when
from blockmech.dynamics.path.march import March, Panel, as_quadrature, errors, march
from blockmech.dynamics.path.massless import SUSPECT, first_touch, first_zero
from blockmech.dynamics.path.mesh import View
from blockmech.dynamics.path.patches import Path
from blockmech.dynamics.path.quadrature import EPS, Quadrature
from blockmech.dynamics.rest import trouble
from blockmech.dynamics.system.claims import splits
from blockmech.dynamics.system.reduced import TURN, Metered
from blockmech.dynamics.until import Asked

NODES, CHECK_NODES = 32, 48
PER_TURN = 4
TOLERANCES = (1e-6, 1e-9, 1e-12, 1e-15)  # of a panel, one after the other
FINEST = 1e-10  # target if none is given [rad or m]
COMPARED = 20
SAFETY = 2.0  # in a campaign with random starts the error was 1.2 times the ends of the series
MIXED = "it is not declared how the loads depend on place and rate"


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


def spectral(meter: Metered, asked: Asked) -> Motion | str:
    """The motion by panels in q, or the reason why this method cannot give it.

    The tolerance is lowered until the error estimate meets the target. With a target,
    one more march with more nodes checks the estimate.
    """
    with np.errstate(all="ignore"):
        return _spectral(meter, asked)


def _spectral(meter: Metered, asked: Asked) -> Motion | str:
    way = _way(meter, asked)
    if isinstance(way, str):
        return way
    found = _finest(way)
    if isinstance(found, str):
        return found
    if asked.accuracy is not None and found.status == "reached":
        found = _checked(way, found)
    return _motion(way, found)


@dataclass(frozen=True)
class _Way:
    """What is marched, the same at every tolerance.

    J, effort : [kg m2, N m; or kg, N] at the start, the effort in the direction of the motion
    far : [rad or m] way to the goal; infinite where the goal is a time
    """

    asked: Asked
    view: View
    J: float
    effort: float
    far: float

    @property
    def target(self) -> float:
        """Error that is good enough [rad or m]."""
        return self.asked.accuracy or FINEST

    def march(self, path: Path, tolerance: float, panels: list[Panel]) -> March:
        """March at one tolerance until the goal; ``panels`` hold what is done on the way."""
        K0 = self.J * self.asked.start.rate**2 / 2
        return march(path, K0, self.effort, tolerance, self.done, panels)

    def done(self, x: float, elapsed: float) -> bool:
        """Whether the goal is met after a way [rad or m] and a time [s]."""
        asked, timed = self.asked, self.asked.until.goal == "time"
        came, goal = (elapsed, asked.until.value) if timed else (x, self.far)
        if asked.progress is not None:
            asked.progress("spectral", came, goal)
        return came >= goal


class _Found(NamedTuple):
    """A march that came to its end: the time along its way, and how far that is off."""

    error: float  # [rad or m]
    quad: Quadrature
    tolerance: float
    status: Status


def _way(meter: Metered, asked: Asked) -> _Way | str:
    """What is to be marched, or why that cannot be."""
    start, (goal, value) = asked.start, (asked.until.goal, asked.until.value)
    one = meter.one(start.q, start.rate, start.t)
    if trouble(one):
        return f"{trouble(one)} at the start"
    if start.rate == 0 and one.tau == 0:
        return "it starts at rest at an equilibrium"
    if not splits(meter, start.q, start.rate, start.t, batch=True):
        return MIXED
    view = View(meter, start.q, math.copysign(1.0, start.rate or one.tau))
    far = {"turns": value * TURN, "angle": view.sign * (value - start.q)}.get(goal, math.inf)
    if goal not in ("time", "turns", "angle") or far <= 0:
        return "the goal asks for a standstill or a way back"
    return _Way(asked, view, one.J, view.sign * one.tau, far)


def _finest(way: _Way) -> _Found | str:
    """The best of marches at finer and finer tolerances, or why there is none."""
    best = None
    path = Path(way.view, NODES, PER_TURN)
    for tolerance in TOLERANCES:
        panels: list[Panel] = []
        status: Status = "reached"
        try:
            run = way.march(path, tolerance, panels)
        except KeyboardInterrupt:  # a whole march is kept, else as far as this one came
            if best is not None:
                return best._replace(status="ended")
            if not panels:
                raise
            run, status = March(panels, "done"), "ended"
        if run.reason != "done":
            return _trouble(run, way.view)
        empty = _no_inertia(run, way.view, way.J)
        if empty is not None:
            return f"the driver has no inertia at q = {empty:.6g}"
        dead = _dead_centre(run, way.view)
        if dead is not None:
            return f"the mechanism comes to a dead centre at q = {dead:.6g}"
        found = _timed(way, run, tolerance, status)
        if best is None or found.error < best.error:
            best = found
        if found.error <= way.target or status == "ended":
            break
    assert best is not None
    return best


def _timed(way: _Way, run: March, tolerance: float, status: Status) -> _Found:
    quad = as_quadrature(run.panels)
    error = SAFETY * errors(run.panels, way.asked.start.q)[0] * quad.fastest
    return _Found(error, quad, tolerance, status)


def _checked(way: _Way, found: _Found) -> _Found:
    """The better of a march and one with more nodes; their difference is in its error."""
    try:
        check = way.march(Path(way.view, CHECK_NODES, PER_TURN), found.tolerance, [])
    except KeyboardInterrupt:
        return found._replace(status="ended")
    if check.reason != "done":
        return found
    other = _timed(way, check, found.tolerance, found.status)
    apart = SAFETY * _apart(way.view, found.quad, other.quad)
    if other.error <= found.error:
        return other._replace(error=max(found.error, apart))
    # its panels are longer, and their difference may be its own error
    return found._replace(error=max(found.error, apart - other.error))


def _motion(way: _Way, found: _Found) -> Motion:
    asked, quad = way.asked, found.quad
    start, goal = asked.start, asked.until.goal
    if goal == "time":
        t_end = start.t + min(asked.until.value, quad.total)
    else:
        t_end = start.t + float(when(quad, np.array([min(way.far, quad.mesh.edges[-1])]))[0])
    track = Marched(way.view, quad, start.t)
    q_end, qd_end = (float(x[0]) for x in track.state(np.array([t_end])))
    error = found.error + 4 * EPS * max(abs(start.q), abs(q_end))
    error += EPS * (abs(start.t) + t_end) * quad.fastest  # of a time that is rounded
    missed = f"accuracy not reached: {error:.1e} instead of {way.target:.1e}"
    return Motion(
        method="spectral",
        why=asked.why,
        regime="one way",
        status=found.status,
        end=goal if found.status == "reached" else INTERRUPTED,
        t_start=start.t,
        t_end=t_end,
        q_end=q_end,
        qd_end=qd_end,
        track=track,
        events=(),
        error=error,
        time_error=error / max(abs(qd_end), 1e-300),
        accuracy=asked.accuracy,
        cost=way.view.meter.cost,
        notes=() if error <= way.target else (missed,),
        facts={"panels": float(quad.mesh.panels)},
    )


def _no_inertia(run: March, view: View, J0: float) -> float | None:
    """A driver coordinate on the way at which there is none, from the samples of the march.

    ``J0`` is that at the start, which lies before the first sample.
    """
    panels = [p for p in run.panels if not p.patch.root and p.shift == 0]
    if not panels:
        return None
    x = np.concatenate([p.patch.x for p in panels])
    J = np.concatenate([p.patch.J for p in panels])
    found = None
    if J0 / J[0] < SUSPECT:
        behind = view.meter.pose(view.origin - view.sign * x[0]).J
        at = first_zero(view, np.array([-x[0], 0.0, x[0]]), np.array([behind, J0, J[0]]))
        found = at if at is not None and at >= 0 else None
    if found is None:
        found = first_zero(view, x, J)
    return None if found is None else view.origin + view.sign * found


def _dead_centre(run: March, view: View) -> float | None:
    """A driver coordinate on the way at which the margin touches zero between two samples."""
    panels = [p for p in run.panels if p.shift == 0]
    x = np.concatenate([p.patch.x for p in panels])
    margins = np.concatenate([p.patch.margin for p in panels])

    def margin(at: float) -> float:
        return view.meter.pose(view.origin + view.sign * at).margin

    touches = first_touch(x, margins, margin, SUSPECT)
    found = next((at for at, left in touches if left <= LEAST_MARGIN), None)
    return None if found is None else view.origin + view.sign * found


def _apart(view: View, a: Quadrature, b: Quadrature) -> float:
    """Largest difference of two marches at common times [rad or m]."""
    times = np.linspace(0.0, min(a.total, b.total), COMPARED + 1)[1:]
    return float(np.abs(place(a, times).x - place(b, times).x).max())


def _trouble(run: March, view: View) -> str:
    x = run.panels[-1].patch.high + run.panels[-1].shift if run.panels else 0.0
    q = view.origin + view.sign * x
    if run.reason == "slow":
        return f"the motion slows down to a standstill after q = {q:.6g}"
    if run.reason == "gap":
        return f"the mechanism comes to an end of its range after q = {q:.6g}"
    return "the run is too long for it"
