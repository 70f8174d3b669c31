r"""Linear models: how a mechanism vibrates about rest or a steady motion.

About a state q0, q0', q0'' that the drivers keep up with the effort u0, small disturbances x obey

    M x'' + C x' + K x = f

with M, C, K the derivatives of the driving effort (`blockmech.dynamics.tangents`), exact to
rounding, and f what is added to u0. From them natural frequencies and modes, the state space

    z' = A z + B f,    y = C z + D f,    z = (x, x'),

with outputs and inputs by name, and its frequency response. A periodic motion has no such
constant A; its disturbances grow or fade each period by the multipliers of Floquet, the
eigenvalues of what one period makes of them,

    Phi' = A(t) Phi,    Phi(0) = 1,

integrated by Gauss's method of order eight from exact A(t).

Sources: Shabana, Dynamics of Multibody Systems, 4th ed.; Meirovitch, Fundamentals of Vibrations,
2001, ch. 7; Hairer, Norsett & Wanner, Solving ODEs I, II.7 (Gauss); Floquet 1883.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from blockmech.analysis.equilibria import Equilibrium, companion, equilibria, natural_frequencies
from blockmech.arguments import declared
from blockmech.dynamics.tangents import tangents
from blockmech.errors import listed, needed, refused
from blockmech.result import Result
from blockmech.series import Floats
from blockmech.studies.differentiate import sensitivity
from blockmech.told import DEGREES, TextReport, as_data, with_unit
from blockmech.typing import Coordinates, FrictionMethod

if TYPE_CHECKING:
    from blockmech.compiled import Compiled

DECADES = 2.0  # of frequency below the lowest and above the highest mode that are shown
SHOWN = 400  # frequencies of a response
SAME = 1e-9  # relative: no oscillation, no growth
NOUGHT = 1e-13  # relative: what eigenvalues leave of no damping
STAGES = 4  # of Gauss's method: order eight
STEPS = 256  # of a period


class Mode(NamedTuple):
    """One mode of vibration.

    value : eigenvalue [1/s]
    frequency : its magnitude [rad/s]; without damping the natural frequency
    damping : ratio [-], 1 and above where it does not swing, negative where it grows
    shape : (k,) complex amplitudes of the drivers' coordinates, the largest 1
    """

    value: complex
    frequency: float
    damping: float
    shape: NDArray[np.complex128]


@dataclass(frozen=True, repr=False)
class Linearization(TextReport):
    """A mechanism about a state, as a linear system.

    Attributes
    ----------
    mechanism : the mechanism
    at, rates : driver -> coordinate [rad or m] and rate, about which it is linear
    effort : (k,) [N m or N] that keeps up the state: zero at an equilibrium
    M, damping, K : (k, k) by accelerations, rates and coordinates
    A, B, C, D : of the state space, for z = (x, x'), inputs and outputs
    inputs, outputs : their names
    units : name of an input or output -> unit
    notes : what should be known
    """

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

    @property
    def eigenvalues(self) -> NDArray[np.complex128]:
        """Eigenvalues (2k,) [1/s] of A, the least damped first."""
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
        return bool(values[0].real <= SAME * np.abs(values).max())

    @property
    def modes(self) -> tuple[Mode, ...]:
        """The modes, slowest first; of a conjugate pair the one with a positive frequency."""
        values, vectors = np.linalg.eig(self.A)
        values = np.where(np.abs(values.real) <= NOUGHT * np.abs(values), 1j * values.imag, values)
        k, found = len(self.M), []
        for value, vector in zip(values.tolist(), vectors.T, strict=True):
            value = complex(value)
            if value.imag < -SAME * abs(value):
                continue
            shape = np.asarray(vector[:k], complex)
            shape = shape / shape[np.argmax(np.abs(shape))]
            size = abs(value)
            found.append(Mode(value, size, 0.0 - value.real / size if size else 0.0, shape))
        return tuple(sorted(found, key=lambda m: (m.frequency, m.value.real)))

    def response(self, frequencies: Any) -> NDArray[np.complex128]:
        """Frequency response (n, outputs, inputs) at angular frequencies (n,) [rad/s].

        C (iw - A)^-1 B + D; infinite where it resonates without damping.
        """
        w = np.atleast_1d(np.asarray(frequencies, float))
        whole = 1j * w[:, None, None] * np.eye(len(self.A)) - self.A
        with np.errstate(all="ignore"):
            try:
                z = np.linalg.solve(whole, np.broadcast_to(self.B, (len(w), *self.B.shape)))
            except np.linalg.LinAlgError:
                z = np.linalg.pinv(whole) @ self.B
        return np.asarray(self.C @ z + self.D)

    def around(self) -> Floats:
        """Angular frequencies [rad/s] about all modes, as a picture shows them."""
        sizes = [m.frequency for m in self.modes if m.frequency > 0] or [1.0]
        low, high = math.log10(min(sizes)) - DECADES / 2, math.log10(max(sizes)) + DECADES / 2
        return np.logspace(low, high, SHOWN)

    def to_statespace(self) -> Any:
        """The system as a `scipy.signal.StateSpace`."""
        from scipy.signal import StateSpace

        return StateSpace(self.A, self.B, self.C, self.D)

    def to_control(self) -> Any:
        """The system as a `control.StateSpace`; its names have _ for the dots it does not take.

        Raises `MissingEngineError` without the package control (extra ``control``).
        """
        control: Any = needed("control", "to_control", "control", "to_statespace() needs SciPy")
        inputs, outputs = ([n.replace(".", "_") for n in x] for x in (self.inputs, self.outputs))
        return control.ss(self.A, self.B, self.C, self.D, inputs=inputs, outputs=outputs)

    def text(self, degrees: bool = DEGREES) -> str:
        """The state and the modes, one a line."""
        return "\n".join(self._lines(degrees))

    def _lines(self, degrees: bool) -> Iterator[str]:
        m = self.mechanism
        unit = {d: m.driver_joint(d).coordinate_unit for d in self.at}
        places = (
            f"{m.of_driver(d, 'q')} = {with_unit(q, unit[d], degrees)}" for d, q in self.at.items()
        )
        yield f"about {', '.join(places)}"
        for d, x in zip(self.at, self.effort.tolist(), strict=True):
            drive = m.of_driver(d, "drive")
            yield f"{drive} = {with_unit(x, m.outputs[drive].unit)} keeps it up"
        for mode in self.modes:
            ways = ", ".join(
                f"{abs(z):.3g} at {math.degrees(cmath.phase(z)):.0f}°" for z in mode.shape
            )
            if abs(mode.value.imag) > SAME * mode.frequency:
                hertz = abs(mode.value.imag) / math.tau
                yield (
                    f"mode {abs(mode.value.imag):.9g} rad/s ({hertz:.6g} Hz), damping ratio "
                    f"{mode.damping:.4g}" + (f", shape {ways}" if len(mode.shape) > 1 else "")
                )
            else:
                yield f"no oscillation: exp({mode.value.real:.9g} t)"
        yield from self.notes

    def to_dict(self) -> dict[str, Any]:
        """The system as a JSON object."""
        arrays = ("effort", "M", "damping", "K", "A", "B", "C", "D", "frequencies")
        found: dict[str, Any] = {name: getattr(self, name).tolist() for name in arrays}
        found["eigenvalues"] = [[z.real, z.imag] for z in self.eigenvalues.tolist()]
        names = ("at", "rates", "inputs", "outputs", "units", "notes")
        return as_data(found | {name: getattr(self, name) for name in names})


@declared
def linearize(
    mechanism: Compiled,
    at: Coordinates | Equilibrium | None = None,
    *,
    rates: Coordinates | None = None,
    time: float = 0.0,
    inputs: Iterable[str] | str = (),
    outputs: Iterable[str] | str = (),
    friction: FrictionMethod | None = None,
) -> Linearization:
    """The linear system of small disturbances about a pose or a steady motion.

    Parameters
    ----------
    at : driver -> coordinate [rad or m], or one of `equilibria`; by default the only stable
        equilibrium
    rates : driver -> rate [rad/s or m/s] of a motion that the drivers keep up; default rest
    time : [s], where loads follow the time
    inputs : besides the efforts of the drivers (``crank.drive``), which are always inputs:
        addresses of numbers, e.g. ``push.force.x`` (`Mechanism.parameters`)
    outputs : names of outputs that are a number, e.g. ``dyad.C.p.x``; by default the
        coordinates of the drivers
    friction : as that of a run, for joints that slip at the rates; at rest joint friction has no
        linear part and is left out

    Returns
    -------
    Linearization

    Raises
    ------
    RequestError for unknown names, a pose that is not said, or drivers that move no mass
    AssemblyError where the pose cannot be
    """
    q, qd = _state(mechanism, at, rates)
    slips = bool(qd.any()) and bool(mechanism.frictional_joints) and friction != "none"
    of = tangents(mechanism, q[None], qd, t=time, friction=slips)
    drivers = dict(zip(mechanism.drivers, q.tolist(), strict=True))
    speeds = dict(zip(mechanism.drivers, qd.tolist(), strict=True))
    if not of.margin[0] > 0:  # the run's own error says which group fails
        mechanism.run(drivers, want=[mechanism.of_driver(d, "tau_red") for d in drivers])
    M, C, K = of.M[0], of.C[0], of.K[0]
    if np.linalg.matrix_rank(M) < len(M):
        raise refused("linearize", "a driver moves no mass here", "give its links mass or inertia")
    efforts = [mechanism.of_driver(d, "drive") for d in mechanism.drivers]
    wanted = _names(outputs) or tuple(mechanism.of_driver(d, "q") for d in mechanism.drivers)
    extra = _names(inputs)
    state = _tangent_of_outputs(mechanism, (*wanted,), extra, drivers, speeds)
    inverse = np.linalg.inv(M)
    A = companion(M, C, K)
    B = np.vstack([np.zeros_like(M), inverse])
    by_q, by_rate, by_acceleration, direct = _split(state, len(M))
    moved = -by_acceleration @ inverse
    Cy = np.hstack([by_q + moved @ K, by_rate + moved @ C])
    D = -moved
    if extra:
        du = _effort_by(mechanism, extra, drivers, speeds)
        B = np.hstack([B, np.vstack([np.zeros_like(du), -inverse @ du])])
        D = np.hstack([D, direct + moved @ du])
    known = mechanism.parameters() if extra else {}  # type: ignore[attr-defined]
    units = {n: mechanism.outputs[e].unit for n, e in zip(efforts, efforts, strict=True)}
    units |= {n: _unit(mechanism, n) for n in wanted} | {a: known[a].unit for a in extra}
    notes = []
    if mechanism.frictional_joints and not slips:
        notes.append("friction of joints is left out: what rests by it does not vibrate")
    return Linearization(
        mechanism, drivers, speeds, of.effort[0], M, C, K, A, B, Cy, D,
        (*efforts, *extra), wanted, units, tuple(notes),
    )  # fmt: skip


def _names(given: Iterable[str] | str) -> tuple[str, ...]:
    return (given,) if isinstance(given, str) else tuple(given)


def _unit(mechanism: Compiled, name: str) -> str:
    head, _, tail = name.rpartition(".")
    return mechanism.outputs[
        head if tail in ("x", "y") and head in mechanism.outputs else name
    ].unit


def _state(mechanism: Compiled, at: Any, rates: Any) -> tuple[Floats, Floats]:
    """Coordinates and rates (k,) of a request."""
    if not mechanism.drivers:
        raise refused("linearize", "the mechanism has no driver", "what does not move has no modes")
    if at is None:
        found = [
            e for e in equilibria(mechanism, friction="none") if e.kind == "stable" and not e.stop
        ]
        if len(found) != 1:
            words = f"there are {len(found)} stable equilibria"
            remedy = "give at=, a pose or one of equilibria()"
            valid = listed(e.text() for e in found) if found else ""
            raise refused("at", words, remedy, valid)
        at = found[0]
    if isinstance(at, Equilibrium):
        at = dict(zip(mechanism.drivers, at.q.tolist(), strict=True))
    none = dict.fromkeys(mechanism.drivers, 0.0)
    taken = mechanism.samples(at, None, None, none if rates is None else rates, none)
    if taken.n != 1:
        raise refused("at", f"it names {taken.n} poses", "give one number for each driver")
    k = len(mechanism.drivers)
    q, qd = ([float(np.ravel(taken.inputs[f"{x}_{i}"])[0]) for i in range(k)] for x in ("q", "qd"))
    return np.array(q), np.array(qd)


def _tangent_of_outputs(
    mechanism: Compiled,
    outputs: tuple[str, ...],
    extra: tuple[str, ...],
    at: Mapping[str, float],
    rates: Mapping[str, float],
) -> Floats:
    """Derivatives (outputs, 3k + extra) by coordinates, rates, accelerations and numbers."""
    motion = [
        mechanism.of_driver(d, what)
        for what in ("q", "rate", "acceleration")
        for d in mechanism.drivers
    ]
    found = sensitivity(
        mechanism, outputs, [*motion, *extra], dict(at), rates=dict(rates),
        accelerations=dict.fromkeys(at, 0.0),
    )  # fmt: skip
    vectors = [n for n in outputs if np.iscomplexobj(found[n])]
    if vectors:
        raise refused(vectors[0], "it is a vector", f"name {vectors[0]}.x or {vectors[0]}.y")
    return np.array([[found[n, a][0] for a in (*motion, *extra)] for n in outputs])


def _split(rows: Floats, k: int) -> tuple[Floats, Floats, Floats, Floats]:
    return rows[:, :k], rows[:, k : 2 * k], rows[:, 2 * k : 3 * k], rows[:, 3 * k :]


def _effort_by(
    mechanism: Compiled, extra: tuple[str, ...], at: Mapping[str, float], rates: Mapping[str, float]
) -> Floats:
    """Derivatives (k, extra) of the driving efforts by numbers."""
    names = [mechanism.of_driver(d, "drive_by_reduction") for d in mechanism.drivers]
    found = sensitivity(
        mechanism, names, extra, dict(at), rates=dict(rates), friction="none",
        accelerations=dict.fromkeys(at, 0.0),
    )  # fmt: skip
    return np.array([[found[n, a][0] for a in extra] for n in names])


# -- periodic motions ----------------------------------------------------------------------


@dataclass(frozen=True, repr=False)
class Floquet(TextReport):
    """What a period of a motion makes of small disturbances.

    Attributes
    ----------
    period : [s]
    monodromy : (2k, 2k), the disturbance (x, x') after a period by that before it
    multipliers : (2k,) its eigenvalues, the largest first
    """

    period: float
    monodromy: Floats
    multipliers: NDArray[np.complex128]

    @property
    def exponents(self) -> NDArray[np.complex128]:
        """Mean rates [1/s] at which disturbances grow: ln(multiplier) / period."""
        with np.errstate(divide="ignore"):
            return np.asarray(np.log(self.multipliers.astype(complex)) / self.period)

    def text(self, degrees: bool = DEGREES) -> str:
        """The multipliers, one a line."""
        rows = [f"period {self.period:.9g} s"]
        rows += [f"multiplier {_shown(complex(z))}" for z in self.multipliers.tolist()]
        return "\n".join(rows)

    def to_dict(self) -> dict[str, Any]:
        """All of it as a JSON object."""
        rows = [[complex(z).real, complex(z).imag] for z in self.multipliers.tolist()]
        return as_data({"period": self.period, "monodromy": self.monodromy.tolist()}) | {
            "multipliers": rows
        }


def _shown(z: complex) -> str:
    return f"{z.real:.9g}" if not z.imag else f"{abs(z):.9g} at {math.degrees(cmath.phase(z)):.4g}°"


@declared
def floquet(mechanism: Compiled, motion: Result, *, steps: int = STEPS) -> Floquet:
    """Multipliers of Floquet of a periodic motion, from exact derivatives along it.

    Parameters
    ----------
    motion : a steady state, ``mechanism.simulate("steady")``, whose motion has a period
    steps : of the integration of a period, order eight

    Raises `RequestError` for a motion without a period, and where joints have friction: their
    effort jumps where a slip reverses.
    """
    found = motion.motion
    if found is None or "period" not in found.facts:
        raise refused("motion", "it has no period", 'give a steady state: simulate("steady")')
    if mechanism.frictional_joints and motion.settings.get("friction") != "none":
        raise refused(
            "motion", "joint friction jumps where slips reverse", 'simulate with friction="none"'
        )
    period, k = float(found.facts["period"]), len(mechanism.drivers)
    nodes, weights = np.polynomial.legendre.leggauss(STAGES)
    c, b = (nodes + 1) / 2, weights / 2
    powers = np.vander(c, STAGES, increasing=True)
    a = (c[:, None] ** np.arange(1, STAGES + 1) / np.arange(1, STAGES + 1)) @ np.linalg.inv(powers)
    h = period / steps
    t = found.t_start + h * (np.arange(steps)[:, None] + c).ravel()
    state = found.track.state(t)
    q, qd = np.reshape(state.q, (-1, k)), np.reshape(state.qd, (-1, k))
    resting = tangents(mechanism, q, qd, t=t)
    qdd = -np.linalg.solve(resting.M, resting.effort[..., None])[..., 0]
    of = tangents(mechanism, q, qd, qdd, t)
    A = np.array([companion(*row) for row in zip(of.M, of.C, of.K, strict=True)])
    A = A.reshape(steps, STAGES, 2 * k, 2 * k)
    whole, one = np.eye(2 * k), np.eye(STAGES * 2 * k)
    for step in A:
        blocks = np.einsum("ij,jab->iajb", a, step).reshape(one.shape)
        stages = np.linalg.solve(one - h * blocks, np.tile(whole, (STAGES, 1)))
        rates = np.einsum("jab,jbc->jac", step, stages.reshape(STAGES, 2 * k, 2 * k))
        whole = whole + h * np.einsum("j,jac->ac", b, rates)
    values = np.linalg.eigvals(whole).astype(complex)
    return Floquet(period, whole, values[np.argsort(-np.abs(values), kind="stable")])
