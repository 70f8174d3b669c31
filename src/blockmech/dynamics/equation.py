r"""The equation of motion as the right-hand side of an integration in time.

    one driver       J q'' = tau - J' q'^2 / 2,     tau all loads, less what friction takes
    k drivers        M q'' = Q - c

Drivers that follow a law or are locked have q'' of that, see `roles`.

The state is y = (q, q', W), with joint friction (q, q', W, F): W [J] is the work of the loads
since the start, F [J] what friction took of it, so that the balance of energy is at hand. The
directions of slip are given from outside, and so the right-hand side is smooth (numerics 8).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from blockmech.dynamics import ends
from blockmech.dynamics.ends import RunEnd, TooMany
from blockmech.dynamics.layout import StateLayout
from blockmech.dynamics.rates import LEAST_INERTIA, rates_of
from blockmech.dynamics.source import by_name
from blockmech.dynamics.system import REPORTED, System
from blockmech.engines.compiled_rates import CompiledRhs, CompiledStepper
from blockmech.engines.stages import Method, dop853
from blockmech.ground.memory import RETAINED
from blockmech.ground.plane import EPS
from blockmech.ground.tolerances import BLUR as LEAST_MARGIN
from blockmech.typing import Floats, Real

if TYPE_CHECKING:
    from blockmech.dynamics.friction import Response
    from blockmech.typing import Vectors

NEAR_DEAD_CENTRE = math.sqrt(LEAST_MARGIN)  # below which a solver that gives up is at one
PAST = 16 * EPS  # relative: so near to a place, and so little beyond it
AHEAD = math.sqrt(EPS)  # relative: how far ahead of where a solver gives up there is no pose


@dataclass
class Equation:
    """The right-hand side of a system; ``sides`` are directions of slip, see `sticking`."""

    system: System
    q0: Real
    limit: float = math.inf  # states
    spent: int = 0
    sides: tuple[int, ...] = ()
    error: Exception | None = None  # what the mechanism's own kernels raised
    is_fixed: bool = False  # whether friction and stops leave no freedom: signals alone go on
    method: Callable[[], Method] = dop853  # whose steps are made of its machine code
    holds: bool = False  # whether some of what sticks holds a freedom
    _last: tuple[bytes, float, float] = (b"", math.nan, math.nan)  # coordinates, margin, J
    # Of states looked at last.
    _slips: dict[bytes, Sequence[float] | Floats] = field(default_factory=dict)

    def again(self) -> Equation:
        """The same for another run: nothing is spent, no pair slips yet."""
        self.spent, self.sides, self.is_fixed, self.holds = 0, (), False, False
        return self

    @cached_property
    def layout(self) -> StateLayout:
        """Where what stands in a state."""
        rubs = self.system.friction is not None
        initial, driven = self.system.signals.initial, self.system.roles is not None
        return StateLayout(len(self.system.drivers), rubs, initial, driven)

    def motion(self, t: float, y: Real) -> tuple[Real, Real]:
        """Coordinates and rates of a state, those of drivers with a law as that says."""
        roles, (q, qd) = self.system.roles, self.layout.motion(y)
        return (q, qd) if roles is None else roles.motion(q, qd, t)

    def __call__(self, t: float, y: Floats) -> Sequence[float] | Floats:
        """y' at a state; NaN where there is no pose. What is raised on the way is kept."""
        try:
            return self._slope(t, y)
        except Exception as error:
            self.error = error
            raise

    def _slope(self, t: float, y: Floats) -> Sequence[float] | Floats:
        row, n = self.row(t, y), len(self.layout.initial)
        if row is not None:
            size = self.layout.size
            self.took(1)
            self.know(y, row[size], row[size + 1])
            return row[:size]
        self.spend(1)
        if self.is_fixed:
            return *[0.0] * (self.layout.size - n), *self.signals(t, y)[:n]
        return self._alone(t, y) if self.layout.scalar and not self.sides else self._general(t, y)

    def _alone(self, t: float, y: Floats) -> Sequence[float]:
        """That of one driver without friction, in numbers."""
        q, qd = self.layout.motion(y)
        terms = self.system.scalar_terms(q, qd, t, y[self.layout.signals])
        J, tau, dJ, margin, signal_values = terms
        self.know(y, margin, J)
        if not margin > 0:
            return (math.nan,) * self.layout.size
        qdd = (tau - 0.5 * dJ * qd * qd) / J if J > 0 else math.nan
        return qd, qdd, tau * qd, *signal_values[: len(self.layout.initial)]

    def spend(self, states: int) -> None:
        """Count states; `TooMany` where they are more than allowed."""
        self.spent += states
        self.system.states += states
        if self.spent > self.limit:
            self.limit = math.inf  # once: what is kept of the run is still looked at
            raise TooMany

    # -- machine code ------------------------------------------------------------

    @property
    def code(self) -> CompiledStepper | None:
        """The rates as machine code, for the directions of slip as they are.

        None where there can be none, and where they are to be interpreted: while pairs that stick,
        stops or drives hold a freedom.
        """
        system = self.system
        if self.is_fixed or self.holds or system.contacts or system.roles is not None:
            return None
        steppers, key = self.system.steppers, (self.typical, self.sides, self.method)
        if key in steppers:
            return steppers[key]
        unsettled = self.system.friction is not None and not self.sides
        if not self.system.compiled_states or unsettled:
            return None
        if (rates := cached_rates(self.system, self.method)) is None:
            return None
        try:
            stepper = self.system.idle_steppers(self.method).pop()
        except IndexError:
            stepper = CompiledStepper(rates, REPORTED)
        steppers[key] = stepper.with_numbers((0.0, 1.0, LEAST_INERTIA * self.typical, *self.sides))
        return steppers[key]

    def took(self, states: int) -> None:
        """Count states that machine code was asked for."""
        per_state = 3 + len(self.sides) if self.sides else 1  # with those of the force pass
        self.spend(states)
        self.system._count(states * per_state, False)

    def row(self, t: float, y: Floats) -> list[float] | None:
        """What machine code says of a state, see `rates`; None where it says nothing."""
        code = self.code
        return None if code is None else code.at(t, y)

    # -- one state ------------------------------------------------------------

    def _general(self, t: float, y: Floats) -> Floats:
        q, qd = map(np.atleast_1d, self.motion(t, y))
        response = self.resisted(t, y) if self.sides else None
        qdd = None if response is None else response.qdd
        M, c, Q, margin, signal_values = self.system.terms(q, qd, t, y[self.layout.signals], qdd)
        self._last = q.tobytes(), margin, M[0, 0]
        if not margin > 0:
            return np.full(self.layout.size, math.nan)
        works = [Q @ qd]
        if (friction := self.system.friction) is not None:
            works.append(0.0 if response is None else friction.power(response, self.sides))
        if response is None:
            acc, pushes = self.system.accelerations(M, Q - c, q, qd, t)
        else:
            acc, pushes = response.qdd, response.pushes
        if (roles := self.system.roles) is not None:
            works.append(pushes[len(self.system.contacts) :] @ qd[roles.bound])
        return np.concatenate([qd, acc, works, signal_values[: len(self.layout.initial)]])

    def switched(self, t: float, y: Floats, due: Collection[str]) -> Floats:
        """A state after the discrete signal blocks named ``due`` have switched."""
        layout, signals = self.layout, self.system.signals
        assert signals.update is not None
        slope = np.asarray(self(t, y), dtype=np.float64)
        parts = y[layout.q], y[layout.rate], slope[layout.rate], y[layout.signals]
        inputs = by_name(*(x.tolist() for x in parts)) | {"t": t}
        engine = signals.update.engine(self.system.compiled_states)
        new = engine.one([inputs[name] for name in signals.update.program.inputs])
        after = y.copy()
        for (block, index), value in zip(signals.updated, new, strict=True):
            if block in due:
                after[layout.signals.start + index] = value
        return after

    def kinks(self, t: float, y: Floats) -> Sequence[float]:
        """Values of signal blocks of which a change of sign is a kink."""
        n, many = len(self.layout.initial), self.system.signals.kinks
        row = self.row(t, y)
        return self.signals(t, y)[n:] if row is None else row[-many - 1 : -1]

    def signals(self, t: float, y: Floats) -> Sequence[float]:
        """Rates of states of signal blocks, and where these have kinks; see `SignalProgram`."""
        qdd = np.zeros(self.layout.drivers) if self.is_fixed else None
        if not self.is_fixed and self.sides and self.system.follows_acceleration:
            qdd = self.resisted(t, y).qdd
        return self.system.terms(*self.motion(t, y), t, y[self.layout.signals], qdd).signals

    def resisted(self, t: float, y: Floats) -> Response:
        """Acceleration and friction of the pairs at a state."""
        friction = self.system.friction
        assert friction is not None
        q, qd = map(np.atleast_1d, self.motion(t, y))
        constraint = self.system.against(q, qd, t)
        at = friction.instant(q, qd, t, self.layout.states(y), constraint)
        return friction.respond(at, self.sides)

    def stop_force(self, i: int, t: float, y: Floats) -> float:
        """What a stop that it lies against pushes with [N m or N], along its coordinate."""
        which = sorted(self.system.contacts).index(i)
        if self.sides:
            return float(self.resisted(t, y).pushes[which])
        q, qd = self.motion(t, y)
        return float(self.system.response(q, qd, t, y[self.layout.signals])[1][which])

    def pair_loads(self, t: float, y: Floats) -> Sequence[complex] | Vectors:
        """Loads on the pairs with friction."""
        row = self.row(t, y)
        if row is not None:
            first = self.layout.size + 2  # behind the rates, margin and J
            parts = row[first : first + 2 * len(self.sides)]
            return [complex(*z) for z in zip(parts[::2], parts[1::2], strict=True)]
        return self.resisted(t, y).loads

    def slips(self, y: Floats) -> Sequence[float] | Floats:
        """Relative rates (m,) of the pairs with friction at a state.

        Of one driver those per unit of its rate: of them a standstill says nothing.
        """
        friction, alone = self.system.friction, self.layout.scalar
        assert friction is not None
        key = y[: 1 if alone else self.layout.work].tobytes()
        if key not in self._slips:
            if len(self._slips) > RETAINED:
                self._slips.clear()
            unit = self.layout.start(y[0], 1.0) if alone else y
            row, m = self.row(0.0, unit), len(self.sides)
            first = self.layout.size + 4 + 2 * m  # behind margin, J, loads and the least of both
            q, qd = unit[self.layout.q], unit[self.layout.rate]
            self._slips[key] = friction.rates(q, qd) if row is None else row[first : first + m]
        return self._slips[key]

    def know(self, y: Floats, margin: float, J: float) -> None:
        """Keep what was computed at the place of a state."""
        self._last = y[self.layout.q].tobytes(), margin, J

    def closeness(self, y: Floats) -> tuple[float, float]:
        """Margin, and inertia relative to a typical one, of one driver, at a state."""
        q, n = y[self.layout.q], self.layout.size
        if self._last[0] != q.tobytes():
            row = self.row(0.0, self.layout.start(q, 0.0 * q))
            if row is not None:
                self.know(y, *row[n : n + 2])
            elif self.layout.scalar:
                terms = self.system.scalar_terms(float(q[0]))
                self.know(y, terms.margin, terms.J)
            else:
                self.know(y, self.system.terms(q, 0 * q).margin, math.nan)
        _, margin, J = self._last
        return margin, J / self.typical if self.layout.scalar else 1.0

    @cached_property
    def typical(self) -> float:
        """See `System.typical_inertia`; 1 of several drivers."""
        return self.system.typical_inertia(self.q0) if self.system.scalar else 1.0

    def kinetic(self, y: Floats, rates: Floats | None = None) -> float:
        """Kinetic energy [J] of a state, or at other rates (k,) there."""
        qd = y[self.layout.rate] if rates is None else rates
        if not qd.any():
            return 0.0
        if self.code is None or not self.layout.scalar:
            return 0.5 * float(qd @ self.system.terms(*self.layout.motion(y)).M @ qd)
        self.closeness(y)
        rate = float(qd[0])
        return 0.5 * self._last[2] * (rate * rate)  # infinite, where ** would raise


def cached_rates(system: System, method: Callable[[], Method] = dop853) -> CompiledRhs | None:
    """The rates as machine code, made once a mechanism; None where there can be none.

    There is none of what is no program: series near change points.
    """
    if type(system).scalar_terms is not System.scalar_terms:
        return None
    about = system.equation_program, system.friction, system.signals, len(system.drivers)
    return system.keep((rates_of, system.method, method), lambda: rates_of(*about, method()))


def scales(equation: Equation, t: float, y: Floats) -> Floats:
    """Typical sizes (n,) of the components of a state, for the tolerances."""
    at, signals = equation.layout, equation.system.signals.sizes
    speed, work = typical_motion(equation, t, y)
    moving = [1.0] * at.drivers + [speed] * at.drivers
    return np.array([*moving, *[work] * (at.works.stop - at.work), *signals])


def typical_motion(equation: Equation, t: float, y: Floats) -> tuple[float, float]:
    """A typical speed [rad/s or m/s] and a typical work [J]."""
    rate = equation.layout.rate
    push = max((abs(x) for x in equation(t, y)[rate] if not math.isnan(x)), default=0.0)
    fallen = math.sqrt(2 * push * min(equation.system.span, 1.0))
    speed = max(map(abs, y[rate].tolist())) + fallen or 1.0
    work = sum(equation.kinetic(y, rates) for rates in np.diag([speed] * equation.layout.drivers))
    return speed, work if 0 < work < math.inf else 1.0


# -- where it cannot go on ------------------------------------------------------------------


def time_left(system: System, kind: str, q: float, qd: float) -> float:
    """The time left to a dead centre, or to a place without inertia; infinite if not known.

    The margin goes with the square of that time, the inertia with the square of the way. With
    several drivers nothing is known.
    """
    if not system.scalar or not qd:
        return math.inf
    scalar = system.scalar_terms(q)
    if kind == ends.NO_INERTIA:
        return abs(scalar.J / scalar.dJ / qd) if scalar.dJ else math.inf
    h = math.copysign(LEAST_MARGIN * NEAR_DEAD_CENTRE, qd)
    fall = (system.scalar_terms(q - h).margin - scalar.margin) / abs(h) * abs(qd)
    return 2 * scalar.margin / fall if fall > 0 else math.inf


def classify_obstacle(equation: Equation, t: float, y: Floats) -> RunEnd:
    """What is ahead of a state from which a solver found no step."""
    rates = y[equation.layout.rate]
    margin = equation.closeness(y)[0]
    if not margin > NEAR_DEAD_CENTRE:
        is_possible = margin > 0
        q, qd = float(y[0]), float(rates[0])
        remaining_time = time_left(equation.system, ends.DEAD_CENTRE, q, qd) if is_possible else 0.0
        return RunEnd(ends.DEAD_CENTRE, remaining_time=remaining_time)
    direction = np.sign(np.asarray(equation(t, y), dtype=float))
    direction = np.where(np.isfinite(direction), direction, 0.0)
    beyond = y + AHEAD * np.maximum(np.abs(y), 1.0) * direction
    later = t + AHEAD * max(abs(t), 1.0)
    if equation.sides and equation.resisted(later, beyond).locked:
        return RunEnd(ends.SELF_LOCKED)
    if np.isfinite(np.asarray(equation(later, beyond), dtype=float)).all():
        return RunEnd(ends.NO_STEP, "failed")
    rate, reach = float(np.abs(rates[0])), PAST * max(1.0, float(np.abs(y[0])))
    remaining_time = PAST * max(abs(t), EPS)  # it comes so near, and steps so short
    return RunEnd(ends.IMPOSSIBLE, remaining_time=remaining_time + (reach / rate if rate else 0.0))
