r"""Linear models: how a mechanism vibrates about rest or a steady motion.

About a state q0, q0', q0'' that the drivers keep up with the effort u0, small disturbances x obey

    M x'' + C x' + K x = f

with M, C, K the derivatives of the driving effort (`blockmech.dynamics.programs`), exact to
rounding, and f what is added to u0. From them natural frequencies and modes, the state space

    z' = A z + B f,    y = C z + D f,    z = (x, x'),

with outputs and inputs by name, and its frequency response. Where signal blocks drive loads,
z = (x, x', s) has their states s, too: closed loops are in A, and what a block without inputs
holds, ``setpoint.y``, is an input by its name.

Sources: Shabana, Dynamics of Multibody Systems, 4th ed.; Meirovitch, Fundamentals of Vibrations,
2001, ch. 7; Ogata, Modern Control Engineering, 2010, section 2-7.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from blockmech.analysis.equilibrium import Equilibrium, natural_frequencies
from blockmech.dynamics.programs import refuse_friction_states
from blockmech.figures import palette as ink
from blockmech.figures.panels import log_ticks
from blockmech.figures.paper import Pictured, legend_above, panelled, shown_name
from blockmech.functions.roots import NEWTON_STEPS
from blockmech.ground.arguments import declared
from blockmech.ground.errors import among, as_names, listed, needed, refused
from blockmech.ground.plane import EPS
from blockmech.ground.report import Facts, places, with_unit
from blockmech.ground.runnable import LazyMethod
from blockmech.ground.tolerances import EQUAL
from blockmech.result.samples import DEFAULT_SAMPLES
from blockmech.studies.derivatives_at import (
    Derivatives,
    derivatives_at,
    initial_states,
    refuse_sampled,
    states_and_sources,
)
from blockmech.studies.differentiate import chosen_numbers
from blockmech.typing import Coordinates, Floats, FrictionMethod, Numbers

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from blockmech.compiled import Compiled

DECADES = 2.0  # of frequency below the lowest and above the highest mode that are shown
NOUGHT = 512 * EPS  # relative: what eigenvalues leave of no damping
SWING = 0.2  # [rad] or share of a metre: amplitude of a mode that is shown
PANEL = 13.0 * ink.TEXT  # [pt] height of a panel of a picture


class Mode(NamedTuple):
    """One mode of vibration.

    value : eigenvalue [1/s]
    frequency : its magnitude [rad/s], the natural frequency
    damping : ratio [-]; without oscillation at 1 and above, growing if negative
    shape : (k,) complex amplitudes of the drivers' coordinates, the largest 1; 0 of signals alone
    """

    value: complex
    frequency: float
    damping: float
    shape: NDArray[np.complex128]

    @property
    def damped_frequency(self) -> float:
        """Frequency of the damped oscillation [rad/s]: frequency sqrt(1 - damping^2)."""
        return abs(self.value.imag)


@dataclass(frozen=True, repr=False)
class Linearization(Facts, Pictured):
    """A mechanism about a state, as a linear system.

    Attributes
    ----------
    mechanism : the mechanism
    at, rates : driver -> coordinate [rad or m] and rate of the linearised state
    effort : (k,) [N m or N] that maintains the state: zero at an equilibrium
    M, damping, K : (k, k) by accelerations, rates and coordinates
    A, B, C, D : of the state space, for z = (x, x', s), inputs and outputs
    states : state of a signal block, ``pid.integral`` -> its value; their disturbances are s
    inputs, outputs : their names
    units : name of an input or output -> unit
    notes : remarks for the reader
    """

    FACTS = (
        *("effort", "M", "damping", "K", "A", "B", "C", "D", "frequencies", "eigenvalues"),
        *("at", "rates", "states", "inputs", "outputs", "units", "notes"),
    )

    mechanism: Compiled
    at: Mapping[str, float]
    rates: Mapping[str, float]
    effort: Floats
    M: Floats
    damping: Floats
    K: Floats
    A: Floats
    B: Floats
    C: Floats
    D: Floats
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    units: Mapping[str, str]
    notes: tuple[str, ...] = ()
    states: Mapping[str, float] = field(default_factory=dict)

    animate = LazyMethod("blockmech.draw.vibration.animate")

    @property
    def eigenvalues(self) -> NDArray[np.complex128]:
        """Eigenvalues (2k + n,) [1/s] of A, the least damped first."""
        values = np.linalg.eigvals(self.A).astype(complex)
        return np.asarray(values[np.argsort(-values.real, kind="stable")])

    @property
    def frequencies(self) -> Floats:
        """Natural frequencies [rad/s] without damping, rising."""
        return natural_frequencies(self.M, self.K)

    @property
    def stable(self) -> bool:
        """Whether no disturbance grows."""
        values = self.eigenvalues
        return bool(values[0].real <= EQUAL * np.abs(values).max())

    @property
    def modes(self) -> tuple[Mode, ...]:
        """The modes, slowest first; of a conjugate pair the one with a positive frequency."""
        values, vectors = np.linalg.eig(self.A)
        values = np.where(np.abs(values.real) <= NOUGHT * np.abs(values), 1j * values.imag, values)
        k, modes = len(self.M), []
        for value, vector in zip(values.tolist(), vectors.T, strict=True):
            value = complex(value)
            if value.imag < -EQUAL * abs(value):
                continue
            shape = np.asarray(vector[:k], complex)
            largest = shape[np.argmax(np.abs(shape))]
            shape = shape / largest if abs(largest) > NOUGHT else np.zeros(k, complex)
            size = abs(value)
            modes.append(Mode(value, size, 0.0 - value.real / size if size else 0.0, shape))
        return tuple(sorted(modes, key=lambda m: (m.frequency, m.value.real)))

    def response(self, frequencies: Numbers) -> NDArray[np.complex128]:
        """Frequency response (n, outputs, inputs) at angular frequencies (n,) [rad/s].

        C (iw - A)^-1 B + D; infinite where it resonates without damping.
        """
        w = np.atleast_1d(np.asarray(frequencies, float))
        pencil = 1j * w[:, None, None] * np.eye(len(self.A)) - self.A
        with np.errstate(all="ignore"):
            try:
                z = np.linalg.solve(pencil, np.broadcast_to(self.B, (len(w), *self.B.shape)))
            except np.linalg.LinAlgError:
                z = np.linalg.pinv(pencil) @ self.B
        return np.asarray(self.C @ z + self.D)

    def around(self) -> Floats:
        """Angular frequencies [rad/s] about all modes, as a picture shows them."""
        sizes = [m.frequency for m in self.modes if m.frequency > 0] or [1.0]
        low, high = math.log10(min(sizes)) - DECADES / 2, math.log10(max(sizes)) + DECADES / 2
        return np.logspace(low, high, DEFAULT_SAMPLES)

    def to_statespace(self) -> Any:
        """The system as a `scipy.signal.StateSpace`."""
        from scipy.signal import StateSpace

        return StateSpace(self.A, self.B, self.C, self.D)

    def to_control(self) -> Any:
        """The system as a `control.StateSpace`; dots in names become _.

        Raises `MissingEngineError` without the package control (extra ``control``).
        """
        control: Any = needed("control", "to_control", "control", "to_statespace() needs SciPy")
        inputs, outputs = ([n.replace(".", "_") for n in x] for x in (self.inputs, self.outputs))
        return control.ss(self.A, self.B, self.C, self.D, inputs=inputs, outputs=outputs)

    def figure(self, ax: Axes | None = None) -> Any:
        """Bode diagram: magnitude and phase of each output over each input.

        Raises `RequestError` where there are more curves than a picture can hold.
        """
        pairs = [(i, j) for i in range(len(self.outputs)) for j in range(len(self.inputs))]
        if len(pairs) > len(ink.SERIES):
            found = f"{len(pairs)} pairs of inputs and outputs"
            raise refused("plot", found, "name fewer outputs", code="too-many-curves")
        w, m = self.around(), self.mechanism
        responses = self.response(w)
        at = ", ".join(f"{m._of_driver(d, 'q')} = {q:.6g}" for d, q in self.at.items())
        caption = f"{shown_name(m.name, 40)}: response of outputs to inputs, linear about {at}."
        with panelled(caption, 2 * PANEL + 3 * ink.ROW, 2, ax=ax) as ((size,), (phase,)):
            for n, (i, j) in enumerate(pairs):
                name = f"{shown_name(self.outputs[i])} by {shown_name(self.inputs[j])}"
                row, style = responses[:, i, j], ink.curve_style(n)
                size.plot(w, np.abs(row), label=name, **style)
                phase.plot(w, np.degrees(np.unwrap(np.angle(row))), **style)
            size.set(xscale="log", yscale="log")
            units = {
                f"{self.units[self.outputs[i]]}/({self.units[self.inputs[j]]})" for i, j in pairs
            }
            size.set_ylabel(f"magnitude [{units.pop() if len(units) == 1 else 'SI'}]", labelpad=2)
            phase.set_ylabel("phase [°]", labelpad=2)
            phase.set_xlabel("frequency [rad/s]", labelpad=1)
            log_ticks(size.xaxis, *size.get_xlim())
            log_ticks(size.yaxis, *size.get_ylim())
            phase.set_yticks(np.arange(-360, 361, 90))
            low, high = phase.dataLim.intervaly
            phase.set_ylim(90 * math.floor(low / 90 - 0.1), 90 * math.ceil(high / 90 + 0.1))
            legend_above(size, ink.COLUMN)
        return size.figure

    def lines(self) -> Iterator[str]:
        """The state and the modes, one a line."""
        m = self.mechanism
        at = {m._of_driver(d, "q"): q for d, q in self.at.items()}
        yield f"about {places(at, {name: m.outputs[name].unit for name in at}, self._display)}"
        if self.states:
            yield f"with {', '.join(f'{n} = {x:.9g}' for n, x in self.states.items())}"
        for d, x in zip(self.at, self.effort.tolist(), strict=True):
            drive = m._of_driver(d, "drive")
            yield f"{drive} = {with_unit(x, m.outputs[drive].unit, self._display)} keeps it up"
        for mode in self.modes:
            ways = ", ".join(
                f"{abs(z):.3g} at {math.degrees(cmath.phase(z)):.0f}°" for z in mode.shape
            )
            if mode.damped_frequency > EQUAL * mode.frequency:
                hertz = mode.frequency / math.tau
                row = f"mode: natural frequency {mode.frequency:.9g} rad/s ({hertz:.6g} Hz)"
                if abs(mode.damping) > EQUAL:
                    row += f", damped {mode.damped_frequency:.9g} rad/s"
                row += f", damping ratio {mode.damping:.4g}"
                yield row + (f", shape {ways}" if len(mode.shape) > 1 else "")
            else:
                yield f"no oscillation: exp({mode.value.real:.9g} t)"
        yield from self.notes


@declared
def linearize(
    mechanism: Compiled,
    at: Coordinates | Equilibrium | None = None,
    *,
    rates: Coordinates | None = None,
    states: Mapping[str, float] | None = None,
    time: float = 0.0,
    inputs: Iterable[str] | str = (),
    outputs: Iterable[str] | str = (),
    friction: FrictionMethod | None = None,
) -> Linearization:
    """The linear system of small disturbances about a pose or a steady motion.

    Parameters
    ----------
    at : driver -> coordinate [rad or m], or one of `equilibria`; by default the only stable
        equilibrium. At an equilibrium with another joint as coordinate, that joint is the driver
        of the result
    rates : driver -> rate [rad/s or m/s] of a motion that the drivers keep up; default rest
    states : ``pid.integral`` -> value, of signal blocks; by default those at which signals are
        constant and loads balance as far as they can
    time : [s], where loads or signals follow the time
    inputs : besides the efforts of the drivers (``crank.drive``), which are always inputs:
        addresses of numbers, e.g. ``push.force.x`` (`Mechanism.parameters`), and outputs of
        signal blocks that are held from outside, e.g. ``setpoint.y`` of a step
    outputs : names of outputs that are a number, e.g. ``dyad.C.p.x``; by default the
        coordinates of the drivers
    friction : as that of a run, for joints that slip at the rates; at rest joint friction has no
        linear part and is left out

    Returns
    -------
    Linearization

    Raises
    ------
    RequestError for unknown names, a pose that is not given, drivers that move no mass, or
    signal blocks that are sampled
    AssemblyError where the pose cannot be

    >>> mech.linearize(at=0.5, friction="none")
    <Linearization: about crank.q = 0.5 rad ...>
    """
    refuse_sampled(mechanism)
    if not mechanism.drivers:
        raise refused("linearize", "the mechanism has no driver", "what does not move has no modes")
    at = _only_stable_equilibrium(mechanism) if at is None else at
    balanced = isinstance(at, Equilibrium) and not (at.stop or at.jump)
    if isinstance(at, Equilibrium):
        mechanism = mechanism if at.chart is None else at.chart.mechanism
        at = dict(zip(mechanism.drivers, (at.leads or at.at).values(), strict=True))
    q, qd = _coordinates_and_rates(mechanism, at, rates)
    slips = bool(qd.any()) and bool(mechanism.frictional_joints) and friction != "none"
    if slips:
        refuse_friction_states(mechanism)
    drivers = dict(zip(mechanism.drivers, q.tolist(), strict=True))
    efforts = [mechanism._of_driver(d, "drive") for d in mechanism.drivers]
    selected = _outputs(mechanism, as_names("outputs", outputs))
    signal_states, sources = states_and_sources(mechanism)
    extra = as_names("inputs", inputs)
    numbers = chosen_numbers(mechanism, [n for n in extra if n not in sources])
    motion = q, qd, np.zeros_like(q)
    x, notes = _signals(mechanism, motion, time, states or {}, slips)
    of = derivatives_at(
        mechanism, motion, x, time, outputs=selected, numbers=numbers, friction=slips
    )
    if not of.margin > 0:  # the run's own error says which group fails
        mechanism.run(drivers, want=[mechanism._of_driver(d, "tau_red") for d in drivers])
    fed = [(n in sources, sources[n] if n in sources else [*numbers].index(n)) for n in extra]
    space = _state_space_matrices(of, len(q), [*signal_states.values()], fed)
    k = len(q)
    K, damping, M = (of.by[:k, i * k : (i + 1) * k] for i in range(3))
    effort = 0 * of.effort if balanced else of.effort  # what is left of a balance is rounding
    units = {n: mechanism.outputs[n].unit for n in (*efforts, *selected)}
    units |= {n: mechanism.outputs[n].unit if n in sources else numbers[n].unit for n in extra}
    if mechanism.frictional_joints and not slips:
        notes.append("joint friction is left out: where it holds the mechanism, nothing vibrates")
    speeds = dict(zip(mechanism.drivers, qd.tolist(), strict=True))
    return Linearization(
        mechanism, drivers, speeds, effort, M, damping, K, *space, (*efforts, *extra), selected,
        units, tuple(notes), {n: float(x[i]) for n, i in signal_states.items()},
    )  # fmt: skip


def _signals(
    mechanism: Compiled,
    motion: tuple[Floats, Floats, Floats],
    t: float,
    values: Mapping[str, float],
    slips: bool,
) -> tuple[Floats, list[str]]:
    """States (n,) of all signal blocks, those that are not given at rest, and what to know."""
    (state_numbers, _), x = states_and_sources(mechanism), initial_states(mechanism, t)
    for name, number in values.items():
        among(state_numbers, "state", name, where=f"states[{name}]")
        x[state_numbers[name]] = float(number)
    free = [i for n, i in state_numbers.items() if n not in values]
    k = len(motion[0])
    of: Derivatives | None = None
    for _ in range(NEWTON_STEPS if free else 0):
        of = derivatives_at(mechanism, motion, x, t, numbers={}, friction=slips)
        y = np.concatenate([of.effort, of.rates])
        step = np.linalg.lstsq(of.by[: len(y), [3 * k + i for i in free]], -y, rcond=None)[0]
        x[free] += step
        if np.abs(step).max() <= EQUAL * np.abs(x[free]).max(initial=EQUAL):
            break
    notes = []
    if of is not None and np.abs(of.rates).max(initial=0.0) > EQUAL * (1 + np.abs(x).max()):
        notes.append("signals are not constant in this state: the model holds only near it")
    return x, notes


def _state_space_matrices(
    of: Derivatives, k: int, states: list[int], extra: list[tuple[bool, int]]
) -> tuple[Floats, Floats, Floats, Floats]:
    """A, B, C, D of z = (x, x', s) from derivatives by motion, signals and numbers.

    With M x'' = f - K x - C x' - U s - V v of inputs f and v, accelerations go into all rows.
    """
    n = len(of.rates)
    q, qd, qdd = (slice(i * k, (i + 1) * k) for i in range(3))
    s = [3 * k + i for i in states]
    v = [3 * k + i if is_source else 3 * k + n + i for is_source, i in extra]
    u = of.by[:k]
    if np.linalg.matrix_rank(u[:, qdd]) < k:
        raise refused("linearize", "a driver moves no mass here", "give its links mass or inertia")
    inverse = np.linalg.inv(u[:, qdd])
    by_z = -inverse @ np.hstack([u[:, q], u[:, qd], u[:, s]])  # of the accelerations
    by_in = inverse @ np.hstack([np.eye(k), -u[:, v]])

    def rows(of_rows: Floats) -> tuple[Floats, Floats]:
        direct = np.hstack([of_rows[:, q], of_rows[:, qd], of_rows[:, s]])
        fed = np.hstack([np.zeros((len(of_rows), k)), of_rows[:, v]])
        return direct + of_rows[:, qdd] @ by_z, fed + of_rows[:, qdd] @ by_in

    size = 2 * k + len(s)
    signals, fed = rows(of.by[k + np.array(states, int)])
    A = np.vstack([np.eye(k, size, k), by_z, signals])
    B = np.vstack([np.zeros_like(by_in), by_in, fed])
    return A, B, *rows(of.by[k + n :])


def _outputs(mechanism: Compiled, names: tuple[str, ...]) -> tuple[str, ...]:
    """Names of outputs, by default the coordinates. Raises `RequestError` for what is no number."""
    if not names:
        return tuple(mechanism._of_driver(d, "q") for d in mechanism.drivers)
    matched = tuple(mechanism.outputs.match(names))
    for name in matched:
        kind = mechanism.outputs[name].kind
        if kind == "vector":
            raise refused(name, "it is a vector", f"name {name}.x or {name}.y")
        if kind != "real":
            raise refused(name, f"it is a {kind}", "name an output that is a number a pose")
    return matched


def _only_stable_equilibrium(mechanism: Compiled) -> Equilibrium:
    """The only stable equilibrium, beyond dead centres only where there is no other."""
    look: Any = partial(mechanism.equilibria, friction="none")  # type: ignore[attr-defined]
    every = ([e for e in look(charts=x).stable if not e.stop] for x in (False, True))
    stable = next(filter(None, every), [])
    if len(stable) != 1:
        message = f"there are {len(stable)} stable equilibria"
        remedy = "give at=, a pose or one of equilibria()"
        raise refused("at", message, remedy, listed(e.text() for e in stable) if stable else "")
    only: Equilibrium = stable[0]
    return only


def _coordinates_and_rates(
    mechanism: Compiled, at: Coordinates, rates: Coordinates | None
) -> tuple[Floats, Floats]:
    """Coordinates and rates (k,) of a request."""
    none = dict.fromkeys(mechanism.drivers, 0.0)
    samples = mechanism.samples(at, None, None, none if rates is None else rates, none)
    if samples.n != 1:
        raise refused("at", f"it names {samples.n} poses", "give one number for each driver")
    k = len(mechanism.drivers)
    q, qd = (
        [float(np.ravel(samples.inputs[f"{x}_{i}"])[0]) for i in range(k)] for x in ("q", "qd")
    )
    return np.array(q), np.array(qd)
