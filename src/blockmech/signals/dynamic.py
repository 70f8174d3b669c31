r"""Signals with a memory: integrator, controller, linear systems, delay, motor.

    integrator         x' = u                                   y = x
    pid                I' = e,  x_f' = n (e - x_f)              y = kp e + ki I + kd n (e - x_f)
    state_space        x' = A x + B u                           y = C x + D u
    dc_motor           L i' = u - R i - k w                     M = k i

A ``sample`` T makes the second and third discrete. The controller then has backward differences
in its filter, n / (1 + n T) in the place of n, and adds T e to I after its output; matrices, and
polynomials of z, are those of the discrete system, x <- A x + B u.

Limits of a controller stop its integral (conditional integration): while the output without
limits is beyond one and e would drive it further, the integral rests. In continuous time that
alone would switch without end where the integral holds the output at the limit; so it slows
down over the last thousandth of the range before the limit, and comes to rest there.

Sources: Astrom & Hagglund, Advanced PID Control, 2006, sections 3.2 (filter), 3.5 (windup) and
13.3 (discretization); Kailath, Linear Systems, 1980, section 2.1 (canonical forms).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, NamedTuple

from pydantic import Field, model_validator

from blockmech.ground.plane import always, maximum, minimum, where
from blockmech.ground.validation_errors import mistake
from blockmech.ground.values import Number, NumbersGiven, Positive, default, in_unit
from blockmech.signals.algebra import Range
from blockmech.signals.contract import Signal, State
from blockmech.typing import Kernel, Parameters, Real

BAND = 1e-3  # of the range between limits, over which a continuous integral comes to rest
Sample = Annotated[Positive, in_unit("s")]


# -- integrator ----------------------------------------------------------------------------


def integrated(x_integral: Real, p: Parameters) -> tuple[Real]:
    """The state."""
    return (x_integral,)


def input_rate(u: Real, p: Parameters) -> tuple[Real]:
    """x' = u."""
    return (u,)


class Integrator(Signal, type="signal.integrator"):
    """The integral of the input over time, from ``initial`` on.

    >>> Integrator(initial=1.0).block_states
    {'integral': State(initial=1.0, unit='')}
    """

    initial: Number = default(0.0)

    @property
    def block_states(self) -> Mapping[str, State]:
        """The integral."""
        return {"integral": State(self.initial)}

    output = always(integrated)
    rates = always(input_rate)


# -- controller ----------------------------------------------------------------------------


class PidNumbers(NamedTuple):
    """Numbers of a controller."""

    kp: Real
    ki: Real
    kd: Real
    n: Real  # [1/s] of the filter, n / (1 + n T)
    low: Real
    high: Real
    T: Real  # [s]; 0 in continuous time


def unlimited(u: Real, states: tuple[Real, ...], p: PidNumbers) -> Real:
    """The output of a controller without limits; its states are integral and filtered error."""
    return p.kp * u + p.ki * states[0] + p.kd * p.n * (u - states[1])


def controlled(u: Real, states: tuple[Real, ...], p: PidNumbers) -> tuple[Real]:
    """The output of a controller without limits."""
    return (unlimited(u, states, p),)


def limited(u: Real, states: tuple[Real, ...], p: PidNumbers) -> tuple[Real]:
    """The output between the limits."""
    return (maximum(p.low, minimum(p.high, unlimited(u, states, p))),)


def pid_rates(u: Real, states: tuple[Real, ...], p: PidNumbers) -> tuple[Real, Real]:
    """I' and x_f' of a controller without limits."""
    return u, p.n * (u - states[1])


def limited_rates(u: Real, states: tuple[Real, ...], p: PidNumbers) -> tuple[Real, Real]:
    """I' and x_f': the integral rests where it would drive the output beyond a limit."""
    v, band = unlimited(u, states, p), BAND * (p.high - p.low)
    room = where(p.ki * u > 0.0, p.high - v, v - p.low) / band
    return u * maximum(0.0, minimum(1.0, room)), p.n * (u - states[1])


def limit_kinks(u: Real, states: tuple[Real, ...], p: PidNumbers) -> tuple[Real, ...]:
    """Zero where the output reaches a limit, or the integral begins to slow down before one."""
    v, band = unlimited(u, states, p), BAND * (p.high - p.low)
    return v - p.low, v - p.low - band, v - p.high + band, v - p.high


def pid_update(u: Real, states: tuple[Real, ...], p: PidNumbers) -> tuple[Real, Real]:
    """I and x_f from this instant on, without limits."""
    return states[0] + p.T * u, states[1] + p.T * p.n * (u - states[1])


def limited_update(u: Real, states: tuple[Real, ...], p: PidNumbers) -> tuple[Real, Real]:
    """The same; the integral stays where it would drive the output further beyond a limit."""
    v = unlimited(u, states, p)
    beyond = where(p.ki * u > 0.0, v > p.high, v < p.low)
    return states[0] + where(beyond, 0.0, p.T * u), states[1] + p.T * p.n * (u - states[1])


class Pid(Signal, type="signal.pid"):
    """Proportional, integral and derivative control of the error ``u``.

    kp, ki [1/s], kd [s] : gains of the error, its integral and its filtered derivative
    n : [1/s] of the filter of the derivative
    limits : [low, high] of the output; beyond them the integral is held
    sample : [s] of a discrete controller
    initial : of the integral

    States are ``integral`` and ``filtered``, the error behind the filter, from 0 on.

    >>> pid = Pid(kp=2.0, ki=1.0)
    >>> pid.output()(0.5, (0.25, 0.0), pid.numbers())
    (1.25,)
    """

    kp: Number = default(0.0)
    ki: Annotated[Number, in_unit("1/s")] = default(0.0)
    kd: Annotated[Number, in_unit("s")] = default(0.0)
    n: Annotated[Positive, in_unit("1/s")] = default(100.0)
    limits: Range | None = None
    sample: Sample | None = None
    initial: Number = default(0.0)

    @property
    def block_states(self) -> Mapping[str, State]:
        """The integral and the filtered error."""
        return {"integral": State(self.initial), "filtered": State()}

    def numbers(self) -> PidNumbers:
        """Gains, filter, limits and sample."""
        low, high = self.limits or (0.0, 0.0)
        T = self.sample or 0.0
        return PidNumbers(self.kp, self.ki, self.kd, self.n / (1 + self.n * T), low, high, T)

    def output(self) -> Kernel:
        """The output, between the limits if there are some."""
        return controlled if self.limits is None else limited

    def rates(self) -> Kernel:
        """Rates of both states."""
        return pid_rates if self.limits is None else limited_rates

    def update(self) -> Kernel:
        """Both states after a sampling instant."""
        return pid_update if self.limits is None else limited_update

    def kinks(self) -> tuple[Kernel, int]:
        """Limits of the output."""
        return limit_kinks, 0 if self.limits is None else 4


# -- linear systems ------------------------------------------------------------------------


class SpaceNumbers(NamedTuple):
    """Numbers of a linear system of one input and one output."""

    A: tuple[tuple[Real, ...], ...]
    B: tuple[Real, ...]
    C: tuple[Real, ...]
    D: Real


def read_out(states: tuple[Real, ...], p: SpaceNumbers) -> tuple[Real]:
    """C x."""
    return (row(p.C, states),)


def read_through(u: Real, states: tuple[Real, ...], p: SpaceNumbers) -> tuple[Real]:
    """C x + D u."""
    return (row(p.C, states) + p.D * u,)


def moved(u: Real, states: tuple[Real, ...], p: SpaceNumbers) -> tuple[Real, ...]:
    """A x + B u: rates of the states, of a discrete system the next ones."""
    return tuple(row(a, states) + b * u for a, b in zip(p.A, p.B, strict=True))


def row(factors: tuple[Real, ...], x: tuple[Real, ...]) -> Real:
    """The sum of products."""
    total = 0.0 * x[0] if x else 0.0
    for factor, value in zip(factors, x, strict=True):
        total = total + factor * value
    return total


class Linear(Signal):
    """A linear system with states x1, x2, ..."""

    sample: Sample | None = None

    @property
    def starts(self) -> tuple[float, ...]:
        """Initial states."""
        return (0.0,) * len(self.numbers().B)

    @property
    def block_states(self) -> Mapping[str, State]:
        """x1, x2, ..."""
        return {f"x{k}": State(x) for k, x in enumerate(self.starts, 1)}

    def output(self) -> Kernel:
        """C x, and D u if D is not zero."""
        return read_through if self.numbers().D else read_out

    rates = always(moved)
    update = always(moved)


class StateSpace(Linear, type="signal.state_space"):
    """x' = A x + B u, y = C x + D u; with ``sample`` x <- A x + B u.

    >>> StateSpace(A=[[-2.0]], B=[2.0], C=[1.0]).feedthrough
    ()
    """

    A: Annotated[list[NumbersGiven], Field(min_length=1)]
    B: Annotated[NumbersGiven, Field(min_length=1)]
    C: Annotated[NumbersGiven, Field(min_length=1)]
    D: Number = default(0.0)
    initial: NumbersGiven | None = None

    @model_validator(mode="after")
    def _check_sizes(self) -> StateSpace:
        n = len(self.A)
        rows = [len(a) for a in self._rows]
        sizes = [*rows, len(self.B), len(self.C), n if self.initial is None else len(self.initial)]
        if set(sizes) != {n}:
            found = f"A has {n} rows of {rows}, B {len(self.B)} and C {len(self.C)} numbers"
            raise mistake("wrong-value", found, f"A is {n} by {n}; B, C, initial have {n} numbers")
        return self

    @property
    def _rows(self) -> tuple[tuple[float, ...], ...]:
        rows: Any = self.A
        return tuple(map(tuple, rows))

    @property
    def starts(self) -> tuple[float, ...]:
        """``initial``, or zeros."""
        return (0.0,) * len(self.A) if self.initial is None else tuple(self.initial)

    def numbers(self) -> SpaceNumbers:
        """The matrices as they are."""
        return SpaceNumbers(self._rows, tuple(self.B), tuple(self.C), self.D)


class TransferFunction(Linear, type="signal.transfer_function"):
    """y = num(s) / den(s) u, highest power first; with ``sample`` polynomials of z.

    Its states are those of the controllable canonical form, from 0 on.

    >>> TransferFunction(num=[1.0], den=[0.1, 1.0]).numbers()
    SpaceNumbers(A=((-10.0,),), B=(1.0,), C=(10.0,), D=0.0)
    """

    num: Annotated[NumbersGiven, Field(min_length=1)]
    den: Annotated[NumbersGiven, Field(min_length=2)]

    @model_validator(mode="after")
    def _is_proper(self) -> TransferFunction:
        if self.den[0] == 0:
            raise mistake("wrong-value", "the first number of den is 0", "", "leave it out")
        if len(self.num) > len(self.den):
            found = f"num has degree {len(self.num) - 1}, den {len(self.den) - 1}"
            valid = "the degree of num is at most that of den"
            raise mistake("wrong-value", found, valid, "add a filter")
        return self

    def numbers(self) -> SpaceNumbers:
        """The canonical form: x_n gets the input, x_k' = x_(k+1)."""
        n, lead = len(self.den) - 1, self.den[0]
        a = [x / lead for x in self.den[1:]][::-1]  # lowest power first
        b = [0.0] * (n + 1 - len(self.num)) + [x / lead for x in self.num]
        D, c = b[0], b[1:][::-1]
        A = [tuple(float(j == i + 1) for j in range(n)) for i in range(n - 1)]
        C = tuple(x - D * y for x, y in zip(c, a, strict=True))
        return SpaceNumbers((*A, tuple(-x for x in a)), (0.0,) * (n - 1) + (1.0,), C, D)


# -- delay ---------------------------------------------------------------------------------


def oldest(states: tuple[Real, ...], p: Parameters) -> tuple[Real]:
    """The oldest stored sample."""
    return (states[-1],)


def shifted(u: Real, states: tuple[Real, ...], p: Parameters) -> tuple[Real, ...]:
    """Shift the stored samples by one, and put the input first."""
    return u, *states[:-1]


class Delay(Signal, type="signal.delay"):
    """The input, delayed by some samples.

    ``steps`` of the ``sample`` [s] before; ``initial`` until then.

    >>> Delay(sample=0.01, steps=2).feedthrough
    ()
    """

    sample: Sample
    steps: Annotated[int, Field(strict=True, ge=1)] = 1
    initial: Number = default(0.0)

    @property
    def block_states(self) -> Mapping[str, State]:
        """The stored samples."""
        return {f"x{k + 1}": State(self.initial) for k in range(self.steps)}

    def initial_output(self) -> float:
        """The output until the first sample arrives."""
        return self.initial

    output = always(oldest)
    update = always(shifted)


# -- motor ---------------------------------------------------------------------------------


def motor_output(x_current: Real, p: Parameters) -> tuple[Real]:
    """k i."""
    return (p.k * x_current,)


def current_rate(u: Real, rate: Real, x_current: Real, p: Parameters) -> tuple[Real]:
    """i' = (u - R i - k w) / L."""
    return ((u - p.R * x_current - p.k * rate) / p.L,)


class DCMotor(Signal, type="signal.dc_motor"):
    """The electric side of a direct-current motor: voltage ``u`` [V] and ``rate`` [rad/s] in.

    R [ohm], L [H], k [N m/A, the same as V s/rad]. It gives the ``moment`` [N m], for the law of
    a `load.motor`; its state is the ``current`` [A], which changes on while the shaft is at rest.
    As L falls to 0 it becomes the law ``dc`` with stall_moment k u / R, no_load_speed u / k.

    >>> DCMotor(R=1.0, L=0.1, k=10.0).ports
    ('moment', 'current')
    """

    outputs = {"moment": "N m"}

    R: Annotated[Positive, in_unit("ohm")]
    L: Annotated[Positive, in_unit("H")]
    k: Annotated[Number, in_unit("N m/A")]
    initial: Annotated[Number, in_unit("A")] = default(0.0)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Voltage and rate."""
        return ("u", "rate")

    @property
    def block_states(self) -> Mapping[str, State]:
        """The current."""
        return {"current": State(self.initial, "A")}

    output = always(motor_output)
    rates = always(current_rate)
