"""A mechanism for controllers outside: it moves on by a time at each call.

What a controller gives are blocks ``signal.input`` of the graph; their values are held over a
step. All else, friction, events, sampled blocks, is that of `simulate`, by the same integrator.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from blockmech.dynamics import ends
from blockmech.dynamics.contacts import Constraints
from blockmech.dynamics.equation import Equation
from blockmech.dynamics.estimate import TARGET
from blockmech.dynamics.layout import StateLayout
from blockmech.dynamics.loads import refuse_memory
from blockmech.dynamics.motion_outputs import by_column, friction_along
from blockmech.dynamics.request import (
    Pairs,
    SimulationRequest,
    Start,
    Until,
    refuse_no_inertia,
    request_of,
    start_of,
    starts_of,
)
from blockmech.dynamics.roles import RolesGiven, roles_of
from blockmech.dynamics.stops import prepared
from blockmech.dynamics.system import System
from blockmech.dynamics.time import TimeIntegration
from blockmech.ground.arguments import declared
from blockmech.ground.errors import among, as_names, listed, refused
from blockmech.ground.values import is_count, is_number
from blockmech.model.structure import JointRef
from blockmech.plan.plan import Friction
from blockmech.plan.settings import friction_asked
from blockmech.result.samples import Samples
from blockmech.signals.contract import HELD
from blockmech.signals.sources import Input
from blockmech.typing import Arguments, EngineName, Floats, FrictionMethod, Indices, Quantity, Real

if TYPE_CHECKING:
    from blockmech.compiled import Compiled


class Stepper:
    """Copies of a mechanism, each with its own state, that advance step by step.

    Attributes
    ----------
    inputs : names of the blocks ``signal.input``, which a controller feeds
    outputs : names of what `observe` and `step` give
    copies : number n of copies
    t : (n,) time [s] of each
    ended : (n,) reason for the end of a copy's motion, ``""`` before; it stays until reset
    """

    def __init__(
        self,
        mechanism: Compiled,
        system: System,
        start: Pairs,
        want: Iterable[str] | str,
        copies: int,
        tolerance: float,
        roles: RolesGiven | None,
    ) -> None:
        """See `stepper`, which reads what a user gives."""
        self.mechanism, self.copies, self._system = mechanism, copies, system
        self._start, self._tolerance, self._roles = dict(start), tolerance, roles
        self.outputs = mechanism.outputs.match(want)
        friction_method = system.method or Friction("none")
        friction_method = replace(friction_method, along=friction_method.method != "none")
        self._plan = mechanism._plan_for(self.outputs, friction_method)
        structure = mechanism.structure
        self._places = {
            name: structure.states[JointRef(name, f"{HELD}y")]
            for name, block in structure.signals.items()
            if isinstance(block, Input)
        }
        self.inputs = tuple(self._places)
        self._layout: StateLayout = Equation(system, start_of(start).q).layout
        self.t = np.zeros(copies)
        self._y = np.zeros((copies, self._layout.size))
        self.ended = [""] * copies
        self._counted = [system.counted] * copies
        self.reset()

    def __repr__(self) -> str:
        inputs = listed(self.inputs)
        return f"<Stepper of {self.mechanism.name}: {self.copies} copies, fed {inputs}>"

    @property
    def state(self) -> Floats:
        """(n, m) coordinates, rates, works and states of signals; a copy, see `StateLayout`."""
        return self._y.copy()

    def reset(
        self, copies: Iterable[int] | int | None = None, start: Pairs | None = None
    ) -> dict[str, Floats]:
        """Reset some copies, or all, to their start at time 0, and return their outputs.

        ``start`` is driver -> (q [rad or m], rate), by default that of the stepper. Raises
        `RequestError` for an unknown copy or driver.
        """
        which = range(self.copies) if copies is None else np.atleast_1d(np.asarray(copies))
        begin = self._start | dict(start or {})
        scene, units = self.mechanism.scene, self.mechanism._coordinate_units
        _, bound = roles_of(scene, units, self._roles, {}, math.inf)
        y = self._layout.start(*start_of(starts_of(scene, units, begin, bound))[:2])
        for i in which:
            if not 0 <= i < self.copies:
                fault, valid = f"there is no copy {i}", f"copies: 0 to {self.copies - 1}"
                raise refused("copies", fault, valid=valid)
            self._y[i], self.t[i], self.ended[i] = y, 0.0, ""
            if self._system.counted is not None:
                self._counted[i] = self._system.counted.restarted(self._y[i, self._layout.q])
        return self.observe()

    def step(
        self, dt: float, signals: Mapping[str, float | Floats] | None = None
    ) -> dict[str, Floats]:
        """Advance all copies by a time [s] with signals held, and return their outputs.

        ``signals`` is input -> number, or (n,) one for each copy; an input that is not named
        keeps its value. Raises `RequestError` for an unknown input, or a step that is not above
        zero.
        """
        if not (is_number(dt) and dt > 0):
            raise refused("dt", f"{dt!r} is not a number above zero", "give a time in s")
        for name, value in (signals or {}).items():
            self._feed(name, value)
        for i in range(self.copies):
            if not self.ended[i]:
                self._move(i, float(dt))
        return self.observe()

    def observe(self) -> dict[str, Floats]:
        """The present outputs of all copies: name -> (n,), complex for vectors."""
        layout, y = self._layout, self._y.copy()
        inputs = by_column("q", y[:, layout.q]) | by_column("qd", y[:, layout.rate])
        inputs |= by_column("x", y[:, layout.signals])
        if not inputs.keys() >= {*self._plan.program.inputs} - {"t"}:
            for name, rows in self._acting().items():
                inputs |= by_column(name, rows)
        samples = Samples(self.copies, inputs, self.t.copy())
        values, _ = self.mechanism._evaluate(self._plan, samples)
        outputs = {}
        for name in self.outputs:
            read = self.mechanism.outputs[name].read
            columns = [np.broadcast_to(values[j], self.copies) for j in self._plan.layout[name]]
            outputs[name] = np.array(read(*columns))
        return outputs

    def _feed(self, name: str, value: Real) -> None:
        among(self.inputs, "input", name, remedy='add a block of the type "signal.input"')
        try:
            numbers = np.broadcast_to(np.asarray(value, dtype=np.float64), self.copies)
        except (TypeError, ValueError):
            numbers = np.array([math.nan])
        if not np.isfinite(numbers).all():
            valid = f"a finite number, or {self.copies} of them"
            raise refused(name, f"got {value!r:.60}", valid=valid)
        self._y[:, self._layout.signals.start + self._places[name]] = numbers

    @np.errstate(all="ignore")
    def _move(self, i: int, dt: float) -> None:
        """Integrate one copy."""
        layout, t = self._layout, float(self.t[i])
        q, rate = layout.motion(self._y[i])
        request = SimulationRequest(Start(q, rate, t), Until("time", dt), roles=self._system.roles)
        system, counted = self._system, self._counted[i]
        system.budget = ends.Budget()
        if counted is not None:
            system = replace(system, counted=counted)
        run = TimeIntegration(system, request, "dop853", self._tolerance, "step", 0.0)
        run.y = self._y[i].copy()
        motion = run.motion()
        self._y[i] = run.y
        if counted is not None:
            self._counted[i] = counted.restarted(run.y[layout.q])
        if motion.end == "time" or motion.end == ends.REST:
            self.t[i] = t + dt
        else:
            self.t[i], self.ended[i] = motion.t_end, motion.end

    def _acting(self) -> dict[str, Floats]:
        """Accelerations (n, k) of the copies, and what (n, m) the pairs with friction do."""
        system, layout, y, t = self._system, self._layout, self._y, self.t
        friction = system.friction
        if friction is None:
            rates = [Equation(system, layout.motion(x)[0])(s, x) for x, s in zip(y, t, strict=True)]
            return {"qdd": np.array(rates)[:, layout.rate]}
        roles = system.roles
        bound = np.ones((self.copies, 0 if roles is None else len(roles.bound)), dtype=bool)

        def against(q: Floats, qd: Floats, t: Floats, which: Indices) -> Constraints:
            assert roles is not None
            return roles.constraint(t)

        state = y[:, layout.q], y[:, layout.rate], t, y[:, layout.signals]
        unknown = np.full((self.copies, len(friction.names)), math.nan)
        response = friction_along(friction, state, unknown, bound, against)
        return {
            "qdd": response.qdd,
            "friction": response.friction,
            "sticks": response.stand.astype(float),
        }


@declared
def stepper(
    mechanism: Compiled,
    want: Iterable[str] | str = ("*.q", "*.rate"),
    *,
    copies: int = 1,
    start: Pairs | None = None,
    stops: Pairs | None = None,
    roles: RolesGiven | None = None,
    friction: FrictionMethod | None = None,
    accuracy: Quantity | None = None,
    engine: EngineName = "auto",
) -> Stepper:
    """Copies of a mechanism that a controller of yours advances step by step.

    Parameters
    ----------
    want : names or patterns of the outputs that a step gives
    copies : number of copies, each with a state of its own
    start : driver -> (q [rad or m], rate), or q alone at rest; by default the scene's ``initial``
    stops : driver, or coordinate of a pair -> (lowest, highest) [rad or m]; by default the scene's
    roles : of drivers that are not free, as `simulate` takes them
    friction : of the joints: "none", "single", "successive" or "newton" (default)
    accuracy : relative tolerance of a step; default 1e-9
    engine : "scalar", "llvm" (machine code), or "auto": machine code once it pays

    Returns
    -------
    Stepper, at the start

    Raises
    ------
    RequestError for unknown names and invalid numbers

    >>> import blockmech as bm
    >>> from blockmech import laws, signals
    >>> g = bm.Graph("wheel")
    >>> g.add("frame", bm.Frame(markers={"A": (0.0, 0.0)}))
    >>> g.add("wheel", bm.Crank(links={"crank": bm.Link(inertia=2.0)}))
    >>> g.add("drive", bm.Motor(law=laws.Signal()))
    >>> g.add("moment", signals.Input())
    >>> for wire in ("frame.A wheel.A", "frame.A drive.a", "wheel.crank drive.b",
    ...              "moment.y drive.law"):
    ...     g.connect(*wire.split())
    >>> g.start("wheel")
    >>> env = g.compile().stepper(copies=2)
    >>> env.step(0.5, {"moment": [1.0, -2.0]})["wheel.rate"]
    array([ 0.25, -0.5 ])
    """
    if not is_count(copies):
        fault = f"{copies!r} is no number of copies"
        raise refused("copies", fault, valid="a whole number from 1 on")
    arguments: Arguments = {"accuracy": accuracy, "start": start, "stops": stops, "roles": roles}
    request, starts = request_of(mechanism.scene, mechanism._coordinate_units, **arguments)
    options = {"method": friction_asked(friction), "engine": engine}
    system, request = prepared(mechanism, request, starts, stops, options)
    if request.roles is None:
        mechanism._once(refuse_no_inertia)
    refuse_memory(mechanism, starts)
    about = as_names("want", want), copies, request.accuracy or TARGET, roles
    return Stepper(mechanism, system, starts, *about)
