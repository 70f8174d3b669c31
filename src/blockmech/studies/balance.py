r"""Balancing and sizing: springs, counterweights, flywheel, motor, and the force at hand.

**Balance**: outputs such as the effort of the loads are linear in stiffnesses, preloads and
masses, so the best ones are a least-squares problem over the poses; with exact derivatives also
where they are not linear (free lengths, places). SciPy's `least_squares`, with bounds.

**Flywheel**: a constant moment T that gives over a turn what the loads take; then the kinetic
energy follows the loads, (J(q) + J_f) w^2 / 2 = E0 + int (tau + T) dq, and J_f is the root of the
wanted fluctuation (w_max - w_min) / w_mean. Loads of the rate count at the mean speed.

**Motor**: behind a gear of ratio n and efficiency eta a rotor of inertia J_r needs
T/(n eta) + J_r n q''; the rms moment is least at n^4 = mean (T/eta)^2 / mean (J_r q'')^2.

**Force at hand**: the inverse of the drive: which load a given driving moment holds at a pose, by
Newton's method with exact derivatives, joint friction included.

Sources: Norton, Design of Machinery, 6th ed., 11.11 (flywheels); van de Straete et al., Servo
motor selection criterion for mechatronic applications, IEEE/ASME Trans. Mechatronics 3 (1998).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from blockmech.analysis.deflections import refuse_deflections
from blockmech.analysis.limits import limits
from blockmech.analysis.scan import NODES, TURN
from blockmech.arguments import declared
from blockmech.compiled import Compiled
from blockmech.dynamics.system import System
from blockmech.dynamics.tangents import refuse_signals
from blockmech.engines.derivatives import DualEngine
from blockmech.engines.dual import Dual
from blockmech.errors import BlockmechError, listed, refused
from blockmech.export import aligned
from blockmech.plan import Plan
from blockmech.plane import EPS
from blockmech.result import Result
from blockmech.samples import Samples
from blockmech.series import SCANNED, Floats, Series, fit, panels
from blockmech.studies.differentiate import chosen_numbers, sensitivity
from blockmech.studies.family import Family, remade
from blockmech.studies.sampling import as_sequence
from blockmech.studies.sensitivity import size_of
from blockmech.told import DEGREES, TextReport, as_data, with_unit
from blockmech.typing import Coordinates, FrictionMethod, Numbers

BLOCK = 4096  # samples of a force at hand at a time
STEPS = 40  # of Newton's method for a force at hand; from afar, friction included, ten do
FAR = 1e9  # times the size of the outputs: a design that cannot be


class Left(NamedTuple):
    """What is left of an output over the poses: its rms, its largest size, and where that is."""

    rms: float
    largest: float
    sample: int


def left_of(y: Any) -> Left:
    """What is left of an output (n,)."""
    size = np.abs(np.asarray(y))
    k = int(np.argmax(size))
    return Left(float(np.sqrt(np.mean(size**2))), float(size[k]), k)


@dataclass(frozen=True, repr=False)
class Balance(TextReport):
    """Numbers that balance a mechanism best.

    Attributes
    ----------
    mechanism : with these numbers
    numbers : address -> value
    before, after : output -> what is left of it
    runs : the two runs whose outputs these are
    units : address or output -> unit
    linear : whether the outputs are linear in the numbers, so that no better ones exist
    at_bounds : numbers that their bounds hold
    """

    mechanism: Compiled
    numbers: Mapping[str, float]
    before: Mapping[str, Left]
    after: Mapping[str, Left]
    runs: tuple[Result, Result]
    units: Mapping[str, str]
    linear: bool
    at_bounds: tuple[str, ...]

    def text(self, degrees: bool = DEGREES) -> str:
        """The numbers, then what is left of each output, and where most."""
        return "\n".join(self._lines(degrees))

    def _lines(self, degrees: bool) -> Iterator[str]:
        rows = [(a, with_unit(x, self.units[a])) for a, x in self.numbers.items()]
        yield from aligned(("number", "value"), rows)
        run = self.runs[1]
        for name, left in self.after.items():
            was, unit = self.before[name], self.units[name]
            at = ", ".join(
                f"{d} = {with_unit(float(q[left.sample]), run.unit_of_driver(d), degrees)}"
                for d, q in run.drivers.items()
            )
            yield (
                f"{name}: rms {left.rms:.4g} {unit} of {was.rms:.4g}, "
                f"largest {left.largest:.4g} of {was.largest:.4g}, at {at}"
            )
        if self.at_bounds:
            yield f"at their bounds: {listed(self.at_bounds)}"
        if not self.linear:
            yield "not linear in these numbers: the best near the start"

    def to_dict(self) -> dict[str, Any]:
        """All of it as a JSON object."""
        names = ("numbers", "units", "linear", "at_bounds")
        found = {n: getattr(self, n) for n in names}
        for word in ("before", "after"):
            found[word] = {n: x._asdict() for n, x in getattr(self, word).items()}
        return as_data(found)


@declared
def balance(
    mechanism: Compiled,
    numbers: Iterable[str] | str,
    want: Iterable[str] | str | None = None,
    at: Coordinates | None = None,
    *,
    samples: int | None = None,
    times: Numbers | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    friction: FrictionMethod | None = "none",
    static: bool | None = None,
) -> Balance:
    """The springs or counterweights that leave the least of some outputs over the poses.

    Parameters
    ----------
    numbers : addresses, e.g. ``spring.stiffness``, ``crank.links.crank.mass``
    want : outputs whose sum of squares is to be least, each by its size before; by default the
        efforts of the loads on the drivers, ``crank.tau_red``
    at, samples, times : the poses, as those of a run
    bounds : address -> (lowest, highest); by default what the file takes
    friction : as that of a run; by default left out
    static : without inertia; by default so where ``want`` is

    Returns
    -------
    Balance, with the mechanism that has these numbers

    Raises
    ------
    RequestError for unknown names, or numbers that no output follows
    AssemblyError at poses that cannot be
    """
    from scipy.optimize import least_squares

    chosen = chosen_numbers(mechanism, as_sequence("numbers", numbers))
    drivers = mechanism.drivers
    names = as_sequence("want", want if want is not None else
                        tuple(mechanism.of_driver(d, "tau_red") for d in drivers))  # fmt: skip
    poses: dict[str, Any] = {"samples": samples, "times": times}
    how: dict[str, Any] = {
        "friction": friction,
        "static": want is None if static is None else static,
    }
    before = mechanism.run(at, want=names, **poses, **how)
    outputs = [n for n in before if before.output(n).kind in ("real", "vector")]
    scale = {n: left_of(before[n]).rms or 1.0 for n in outputs}
    start = np.array([float(p.value) for p in chosen.values()])
    sizes = np.array([size_of(p, chosen.values()) for p in chosen.values()])
    kept: dict[str, Any] = {}

    def evaluated(u: Floats) -> tuple[Floats, Floats]:
        if kept.get("u") != u.tobytes():
            other = remade(mechanism, dict(zip(chosen, (u * sizes).tolist(), strict=True)))
            found = sensitivity(other, outputs, tuple(chosen), at, **poses, **how)
            y = np.concatenate([_real(found.result[n]) / scale[n] for n in outputs])
            J = np.hstack([_real(found[n]) / scale[n] for n in outputs]).T * sizes
            kept.update(u=u.tobytes(), y=y, J=J)
        return kept["y"], kept["J"]

    def residual(u: Floats) -> Floats:
        try:
            return evaluated(u)[0]
        except BlockmechError:
            return np.full(first.shape, FAR)

    first, J = evaluated(start / sizes)
    unseen = [a for a, c in zip(chosen, np.abs(J).max(axis=0), strict=True) if not c > 0]
    if unseen:
        raise refused(unseen[0], f"none of {listed(outputs)} follows it", "leave it out")
    ends = np.array([_bounds(mechanism, a, bounds or {}) for a in chosen])
    u = np.clip(start, *ends.T) / sizes
    found = least_squares(
        residual, u, lambda v: evaluated(v)[1], bounds=(ends[:, 0] / sizes, ends[:, 1] / sizes),
        xtol=EPS, ftol=EPS, gtol=EPS, x_scale="jac",
    )  # fmt: skip
    x = found.x * sizes
    values = dict(zip(chosen, x.tolist(), strict=True))
    best = remade(mechanism, values)
    after = best.run(at, want=names, **poses, **how)
    straight = first + J @ (found.x - start / sizes)
    linear = np.abs(found.fun - straight).max() <= 1e-9 * max(np.abs(first).max(), 1.0)
    units = {a: p.unit for a, p in chosen.items()} | {n: before.unit(n) for n in outputs}
    held = tuple(a for a, side in zip(chosen, found.active_mask, strict=True) if side)
    return Balance(
        best, values, {n: left_of(before[n]) for n in outputs},
        {n: left_of(after[n]) for n in outputs}, (before, after), units, bool(linear), held,
    )  # fmt: skip


def _real(y: Any) -> Floats:
    """An output (..., n) as real numbers: of a vector its parts beside each other."""
    y = np.asarray(y)
    return np.concatenate([y.real, y.imag], axis=-1) if np.iscomplexobj(y) else y


def _bounds(
    mechanism: Compiled, address: str, given: Mapping[str, tuple[float, float]]
) -> tuple[float, float]:
    """Lowest and highest value of a number: as asked, and not below zero where the file says so."""
    if address in given:
        low, high = given[address]
        if not low < high:
            raise refused(f"bounds[{address}]", f"got ({low!r}, {high!r})", "lowest, then highest")
        return float(low), float(high)
    try:
        remade(mechanism, {address: -1.0})
    except BlockmechError:
        return 0.0, math.inf
    return -math.inf, math.inf


# -- flywheel ------------------------------------------------------------------------------


@dataclass(frozen=True, repr=False)
class Flywheel(TextReport):
    """A flywheel on the driving crank, and the turn that it makes even.

    Attributes
    ----------
    inertia : [kg m2] of the flywheel; 0 where none is needed
    moment : [N m] of the motor, constant over the turn
    fluctuation : (w_max - w_min) / w_mean [-] with it
    without : that of the mechanism alone; infinite where it does not get round
    speed : mean [rad/s]
    q : (n,) [rad] over the period
    speeds, speeds_without : (n,) [rad/s]
    """

    inertia: float
    moment: float
    fluctuation: float
    without: float
    speed: float
    q: Floats
    speeds: Floats
    speeds_without: Floats

    def text(self, degrees: bool = DEGREES) -> str:
        """The flywheel as a sentence."""
        alone = f"{self.without:.4g}" if math.isfinite(self.without) else "it does not get round"
        return (
            f"flywheel {self.inertia:.6g} kg m2 for a fluctuation of {self.fluctuation:.4g} at "
            f"{self.speed:.6g} rad/s, motor {self.moment:.6g} N m; without it {alone}"
        )

    def to_dict(self) -> dict[str, Any]:
        """The numbers as a JSON object."""
        names = ("inertia", "moment", "fluctuation", "without", "speed")
        return as_data({n: getattr(self, n) for n in names})


class _Turn(NamedTuple):
    """Inertia and energy over a turn as the loads and a constant moment leave it."""

    q: Floats
    share: Floats  # (n,) weights of the mean over q
    J: Floats
    energy: Floats  # [J] from the first place

    def speeds(self, flywheel: float, mean: float) -> Floats:
        """Speeds (n,) with a flywheel, by their mean in time; NaN where it does not get round."""
        from scipy.optimize import brentq

        J = self.J + flywheel
        least = float(np.max(-self.energy))

        def late(E0: float) -> float:
            w = np.sqrt(2 * np.maximum(E0 + self.energy, 0.0) / J)
            return 1 / float(self.share @ (1 / np.maximum(w, math.sqrt(EPS)))) - mean

        size = float(np.max(J)) * mean**2 + float(np.ptp(self.energy))
        low = least + EPS * size
        if late(low) > 0:  # it turns faster than that at least, or it would stand
            return np.full(self.q.shape, np.nan)
        E0 = brentq(late, low, least + 10 * size, xtol=EPS * size, rtol=8 * EPS)
        return np.asarray(np.sqrt(2 * (E0 + self.energy) / J))


def fluctuation_of(speeds: Floats, mean: float) -> float:
    """(w_max - w_min) / w_mean [-]; infinite where it does not get round."""
    return float(np.ptp(speeds)) / mean if np.isfinite(speeds).all() else math.inf


@declared
def flywheel(mechanism: Compiled, speed: float, fluctuation: float) -> Flywheel:
    """The flywheel on the only crank that keeps its speed within a fluctuation.

    The motor gives a constant moment. Loads of the rate count at the mean speed; joint friction
    is left out.

    Parameters
    ----------
    speed : mean [rad/s]
    fluctuation : (w_max - w_min) / w_mean [-] that is allowed, e.g. 0.02

    Raises `RequestError` unless there is one crank that turns fully, and for loads of the time.
    """
    from scipy.optimize import brentq

    drivers = mechanism.drivers
    if len(drivers) != 1 or not (
        mechanism.driver_joint(drivers[0]).rotary and limits(mechanism).whole_turn
    ):
        raise refused("flywheel", "there is not one crank that turns fully", "a flywheel turns")
    if not (speed > 0 and 0 < fluctuation < 2):
        raise refused("fluctuation", f"got {fluctuation!r} at {speed!r} rad/s", "both are positive")
    refuse_signals(mechanism)
    system = System(mechanism)
    if "time" in system.depends_on:
        raise refused("flywheel", "loads follow the time", "let them follow the crank")
    period = system.period or TURN
    knots = [x for x in system.knots if 0 < x < period]
    edges = np.unique([*panels(0.0, period, max(4, round(4 * period / TURN))), *knots])
    load: Series = fit(lambda q: system.sample(q, speed).tau, edges, n=NODES)
    work = load.integral()
    moment = -float(work(np.array([period]))[0]) / period
    nodes, weights = np.polynomial.legendre.leggauss(16)
    fine = np.unique([*np.linspace(0.0, period, SCANNED // 8 + 1), *knots])
    half = np.diff(fine) / 2
    q = (fine[:-1, None] + half[:, None] * (1 + nodes)).ravel()
    share = (half[:, None] * weights).ravel() / period
    turn = _Turn(q, share, system.sample(q, speed).J, work(q) + moment * q)
    alone = turn.speeds(0.0, speed)
    without = fluctuation_of(alone, speed)
    if without <= fluctuation:
        return Flywheel(0.0, moment, without, without, speed, q, alone, alone)

    def beyond(log: float) -> float:
        return min(fluctuation_of(turn.speeds(math.exp(log), speed), speed), 1e3) - fluctuation

    guess = math.log(
        (float(np.ptp(turn.energy)) + float(np.ptp(turn.J)) * speed**2) / (fluctuation * speed**2)
    )
    found = math.exp(brentq(beyond, guess - 12, guess + 3, xtol=1e-13, rtol=8 * EPS))
    speeds = turn.speeds(found, speed)
    return Flywheel(found, moment, fluctuation_of(speeds, speed), without, speed, q, speeds, alone)


# -- motor ---------------------------------------------------------------------------------


@dataclass(frozen=True, repr=False)
class MotorDemand(TextReport):
    """What a driver asks of its motor over the samples of a run.

    Attributes
    ----------
    driver, unit : of the effort, "N m" or "N"
    ratio : motor turns (or metres) per unit of the driver's coordinate; the best one if not given
    moment, speed : (n,) at the motor [N m or N, rad/s or m/s]
    rms, peak, fastest, power : of them; power is the largest [W]
    limits : what the motor can: rms, peak, speed
    fits : whether all of them hold
    """

    driver: str
    unit: str
    ratio: float
    moment: Floats
    speed: Floats
    rms: float
    peak: float
    fastest: float
    power: float
    limits: Mapping[str, float]

    @property
    def margins(self) -> Mapping[str, float]:
        """Limit -> what is asked over what the motor can [-]; above 1 it cannot."""
        asked = {"rms": self.rms, "peak": self.peak, "speed": self.fastest}
        return {name: asked[name] / x for name, x in self.limits.items()}

    @property
    def fits(self) -> bool:
        """Whether the motor can do it."""
        return all(x <= 1.0 for x in self.margins.values())

    def text(self, degrees: bool = DEGREES) -> str:
        """What is asked, and whether the motor can."""
        per = "rad/s" if self.unit == "N m" else "m/s"
        rows = [
            f"ratio {self.ratio:.6g}: rms {self.rms:.6g} {self.unit}, peak {self.peak:.6g} "
            f"{self.unit}, {self.fastest:.6g} {per}, {self.power:.6g} W"
        ]
        rows += [f"{name}: {x:.1%} of the motor's" for name, x in self.margins.items()]
        if self.limits:
            rows.append("the motor fits" if self.fits else "the motor does not fit")
        return "\n".join(rows)

    def to_dict(self) -> dict[str, Any]:
        """The numbers as a JSON object."""
        names = ("driver", "unit", "ratio", "rms", "peak", "fastest", "power", "limits", "fits")
        return as_data({n: getattr(self, n) for n in names})


@declared
def motor(
    mechanism: Compiled,
    driver: str | None = None,
    at: Coordinates | None = None,
    *,
    samples: int | None = None,
    times: Numbers | None = None,
    rates: Coordinates | None = None,
    accelerations: Coordinates | None = None,
    ratio: float | None = None,
    inertia: float = 0.0,
    efficiency: float = 1.0,
    limits: Mapping[str, float] | None = None,
    friction: FrictionMethod | None = None,
) -> MotorDemand:
    """What a driver asks of its motor over a run: rms and peak moment, speed, gear ratio.

    Samples count alike in time: name them by ``times``, or at a constant rate.

    Parameters
    ----------
    driver : not needed if there is one
    at, samples, times, rates, accelerations, friction : as those of a run
    ratio : of the gear; by default 1 without inertia of the rotor, else that of the least rms
    inertia : [kg m2 or kg] of the rotor
    efficiency : of the gear [-]; it costs where the motor gives work, and helps where it brakes
    limits : what the motor can: "rms", "peak" [N m or N], "speed" [rad/s or m/s]

    Raises `RequestError` for unknown names or values that do not fit.
    """
    own = _driver(mechanism, driver)
    given = dict(limits or {})
    odd = [n for n, x in given.items() if n not in ("rms", "peak", "speed") or not x > 0]
    if odd or not 0 < efficiency <= 1 or not inertia >= 0 or (ratio is not None and not ratio > 0):
        valid = "limits: rms, peak, speed > 0; 0 < efficiency <= 1, inertia >= 0, ratio > 0"
        raise refused(odd[0] if odd else "motor", "a value does not fit", valid)
    names = [mechanism.of_driver(own, x) for x in ("drive", "rate", "acceleration")]
    run = mechanism.run(at, samples=samples, times=times, rates=rates, accelerations=accelerations,
                        want=names, friction=friction)  # fmt: skip
    effort, rate, acceleration = (np.asarray(run[n], float) for n in names)
    loss = np.where(effort * rate > 0, 1 / efficiency, efficiency)
    load, rotor = effort * loss, inertia * acceleration
    if ratio is None:
        turning = float(np.mean(rotor**2))
        ratio = (float(np.mean(load**2)) / turning) ** 0.25 if turning > 0 else 1.0
    moment, speed = load / ratio + rotor * ratio, rate * ratio
    return MotorDemand(
        own, run.unit(names[0]), float(ratio), moment, speed, float(np.sqrt(np.mean(moment**2))),
        float(np.abs(moment).max()), float(np.abs(speed).max()),
        float(np.abs(moment * speed).max()), given,
    )  # fmt: skip


# -- force at hand -------------------------------------------------------------------------


@declared
def available(
    mechanism: Compiled,
    number: str,
    effort: float,
    at: Coordinates | None = None,
    *,
    driver: str | None = None,
    samples: int | None = None,
    rates: Coordinates | None = None,
    friction: FrictionMethod | None = None,
    static: bool = True,
) -> Floats:
    """The load that a given driving effort holds, pose by pose: the inverse of the drive.

    Parameters
    ----------
    number : address of the load, e.g. ``work.force.x``
    effort : [N m or N] of the driver
    at, samples, rates, friction, static : as those of a run; friction counts in the sense of the
        rates
    driver : whose effort it is; not needed if there is one

    Returns
    -------
    (n,) in the unit of the number; NaN where no load makes the drive that, e.g. at a dead centre

    Raises `RequestError` for unknown names, or a number that the drive does not follow.
    """
    own = _driver(mechanism, driver)
    (p,) = chosen_numbers(mechanism, (number,)).values()
    family = Family(mechanism, [p.address])
    if family.alone:
        raise refused(p.address, family.alone, "name a load")
    name = mechanism.of_driver(own, "drive")
    taken = mechanism.samples(at, samples, None, rates, None)
    plan = family.general.plan([name], friction=friction, static=static)
    refuse_deflections(mechanism, plan, "designs")
    engine, n = DualEngine(plan.program), taken.n
    given = {k: np.broadcast_to(np.asarray(x, float), n) for k, x in _inputs(taken, plan).items()}
    found = np.full(n, np.nan)
    for start in range(0, n, BLOCK):
        part = slice(start, min(start + BLOCK, n))
        inputs = {k: x[part] for k, x in given.items()}
        x = np.full(part.stop - part.start, float(p.value) or 1.0)
        for _ in range(STEPS):
            design = family.design({p: Dual(x, np.ones((1, x.size)))})
            values = engine.run(inputs, plan.program.values(*design), x.size, 1)
            drive = values[plan.layout[name][0]]
            with np.errstate(all="ignore"):
                step = (effort - drive.x) / drive.d[0]
            done = np.abs(step) <= 64 * EPS * np.maximum(np.abs(x), np.abs(p.value) or 1.0)
            x = x + np.where(np.isfinite(step), step, np.nan)
            if (done | ~np.isfinite(x)).all():
                break
        found[part] = np.where(done, x, np.nan)
    if not np.isfinite(found).any():
        raise refused(p.address, f"no value of it makes {name} {effort:.6g}", "name a load")
    return found


def _driver(mechanism: Compiled, driver: str | None) -> str:
    """The driver that is meant. Raises `RequestError` where there is no such one."""
    drivers = mechanism.drivers
    own = drivers[0] if driver is None and len(drivers) == 1 else driver
    if own is None or own not in drivers:
        raise refused("driver", f"no driver {own!r}", f"drivers: {listed(drivers)}")
    return own


def _inputs(taken: Samples, plan: Plan) -> Mapping[str, Any]:
    inputs = taken.given(plan.program.inputs)
    return {name: inputs[name] for name in plan.program.inputs}
