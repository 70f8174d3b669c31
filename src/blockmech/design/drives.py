r"""What a motor must give, and what it can hold.

**Motor**: behind a gear of ratio n and efficiency eta a rotor of inertia J_r needs
T/(n eta) + J_r n q''; the rms moment is least at n^4 = mean (T/eta)^2 / mean (J_r q'')^2.

**Force at hand**: the inverse of the drive: which load a given driving moment holds at a pose, by
Newton's method with exact derivatives, joint friction included.

Source: van de Straete et al., Servo motor selection criterion for mechatronic applications,
IEEE/ASME Trans. Mechatronics 3 (1998).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from blockmech.analysis.deflections import refuse_deflections
from blockmech.compiled import Compiled
from blockmech.design.efforts import with_efforts
from blockmech.engines.derivatives import Dual, DualEngine
from blockmech.engines.numpy import CHUNK
from blockmech.figures import palette as ink
from blockmech.figures.paper import Pictured, panelled, picture_unit
from blockmech.functions.roots import NEWTON_STEPS
from blockmech.ground.arguments import declared
from blockmech.ground.errors import among, refused
from blockmech.ground.plane import EPS
from blockmech.ground.report import Facts
from blockmech.ground.units import number_in_si
from blockmech.plan.plan import Plan
from blockmech.result.samples import Samples
from blockmech.studies.differentiate import chosen_numbers
from blockmech.studies.family import Family, parameters
from blockmech.typing import Coordinates, Floats, FrictionMethod, Numbers, Quantity, Record

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PANEL = 19.5 * ink.TEXT  # [pt] height of a picture


@dataclass(frozen=True, repr=False)
class MotorDemand(Facts, Pictured):
    """Requirements of a driver on its motor over the samples of a run.

    Attributes
    ----------
    driver, unit : of the effort, "N m" or "N"
    ratio : motor turns (or metres) per unit of the driver's coordinate; the best one if not given
    moment, speed : (n,) at the motor [N m or N, rad/s or m/s]
    rms, peak, fastest, power : rms and peak moment, largest speed, largest power [W]
    limits : ratings of the motor: rms, peak, speed fits : whether all of them are kept
    """

    FACTS = ("driver", "unit", "ratio", "rms", "peak", "fastest", "power", "limits", "fits")

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
        """Limit -> requirement over rating of the motor [-]; above 1 the motor is too weak."""
        demand = {"rms": self.rms, "peak": self.peak, "speed": self.fastest}
        return {name: demand[name] / x for name, x in self.limits.items()}

    @property
    def fits(self) -> bool:
        """Whether the motor meets all requirements."""
        return all(x <= 1.0 for x in self.margins.values())

    @property
    def speed_unit(self) -> str:
        """SI unit of the speed."""
        return "rad/s" if self.unit == "N m" else "m/s"

    def figure(self, ax: Axes | None = None) -> Any:
        """Moment over speed, with the motor's limits."""
        caption = " ".join(line + "." for line in self.text().split("\n"))
        with panelled(caption, PANEL + 2 * ink.ROW, ax=ax) as ((axes,),):
            largest = max(self.peak, self.limits.get("peak", 0.0))
            factor, unit = picture_unit(self.unit, self._display, largest)
            scale, per = picture_unit(self.speed_unit, self._display)
            x, y = scale * self.speed, factor * self.moment
            axes.plot(x, y, ".-", ms=2, lw=0.6, color=ink.FORWARD)
            axes.axhline(factor * self.rms, color=ink.FORWARD, ls="--", lw=0.8)
            for name, style in (("peak", "-"), ("rms", "--")):
                for side in (-factor, factor) if name in self.limits else ():
                    axes.axhline(side * self.limits[name], color=ink.ALARM, ls=style, lw=1.0)
            for side in (-1.0, 1.0) if "speed" in self.limits else ():
                if np.any(side * self.speed > 0):
                    axes.axvline(side * scale * self.limits["speed"], color=ink.ALARM, lw=1.0)
            axes.set_ylabel(f"motor [{unit}]; dashed: rms", labelpad=2)
            axes.set_xlabel(f"speed of the motor [{per}]; red: its limits", labelpad=1)
        return axes.figure

    def lines(self) -> Iterator[str]:
        """The requirements, and whether the motor meets them."""
        yield (
            f"ratio {self.ratio:.6g}: rms {self.rms:.6g} {self.unit}, peak {self.peak:.6g} "
            f"{self.unit}, {self.fastest:.6g} {self.speed_unit}, {self.power:.6g} W"
        )
        yield from (f"{name}: {x:.1%} of the motor's" for name, x in self.margins.items())
        if self.limits:
            yield "the motor fits" if self.fits else "the motor does not fit"


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
    inertia: Quantity = 0.0,
    efficiency: Quantity = 1.0,
    limits: Mapping[str, Quantity] | None = None,
    friction: FrictionMethod | None = None,
) -> MotorDemand:
    """Requirements of a motor: rms and peak moment, speed, and gear ratio.

    All samples have the same weight in time: give ``times``, or a constant rate.

    Parameters
    ----------
    driver : not needed if there is one
    at, samples, times, rates, accelerations, friction : as those of a run
    ratio : of the gear; by default 1 without ``inertia``, else the ratio with the least rms moment
    inertia : [kg m2 or kg] of the rotor
    efficiency : of the gear [-]; losses add to the moment where the motor drives, and reduce it
    where it brakes
    limits : ratings of the motor: "rms", "peak" [N m or N], "speed" [rad/s or m/s]

    Raises `RequestError` for unknown names or values that do not fit.

    >>> print(bm.design.motor(mech))
    ratio 1: rms 6231.52 N m, peak 18552.9 N m, 10 rad/s, 185529 W
    """
    actuated = _driver(mechanism, driver)
    joint = mechanism.structure.driver_joint(actuated)
    units = dict.fromkeys(("rms", "peak"), joint.effort_unit)
    units["speed"] = f"{joint.coordinate_unit}/s"
    bounds = {n: number_in_si(x, units.get(n, "")) for n, x in (limits or {}).items()}
    rotor_inertia, share = number_in_si(inertia, "kg m2", "kg"), number_in_si(efficiency)
    invalid = [n for n, x in bounds.items() if n not in units or not x > 0]
    if (
        invalid
        or not 0 < share <= 1
        or not rotor_inertia >= 0
        or (ratio is not None and not ratio > 0)
    ):
        valid = "limits: rms, peak, speed > 0; 0 < efficiency <= 1, inertia >= 0, ratio > 0"
        raise refused(invalid[0] if invalid else "motor", "a value does not fit", valid)
    names = [mechanism._of_driver(actuated, x) for x in ("drive", "rate", "acceleration")]
    run = mechanism.run(at, samples=samples, times=times, rates=rates, accelerations=accelerations,
                        want=names, friction=friction)  # fmt: skip
    effort, rate, acceleration = (np.asarray(run[n], float) for n in names)
    loss = np.where(effort * rate > 0, 1 / share, share)
    load, rotor = effort * loss, rotor_inertia * acceleration
    if ratio is None:
        turning = float(np.mean(rotor**2))
        ratio = (float(np.mean(load**2)) / turning) ** 0.25 if turning > 0 else 1.0
    moment, speed = load / ratio + rotor * ratio, rate * ratio
    return MotorDemand(
        actuated, run.unit(names[0]), float(ratio), moment, speed,
        float(np.sqrt(np.mean(moment**2))),
        float(np.abs(moment).max()), float(np.abs(speed).max()),
        float(np.abs(moment * speed).max()), bounds,
    )  # fmt: skip


# -- force at hand -------------------------------------------------------------------------


@declared
def available(
    mechanism: Compiled,
    number: str,
    effort: Quantity,
    at: Coordinates | None = None,
    *,
    driver: str | None = None,
    samples: int | None = None,
    rates: Coordinates | None = None,
    friction: FrictionMethod | None = None,
    static: bool = True,
) -> Floats:
    """The load that a given driving effort balances at each pose: the inverse of the drive.

    Parameters
    ----------
    number : parameter path of the load, e.g. ``work.force.x``, or an effort as those of `solve`,
        e.g. ``"joint.C.moment"``, which with the driving effort 0 stands for the drive
    effort : [N m or N] of the driver, also as text with a unit
    at, samples, rates, friction, static : as those of a run; friction counts in the sense of the
        rates
    driver : the driver of ``effort``; not needed if there is only one

    Returns
    -------
    (n,) in the unit of the number; NaN where no load gives that effort, e.g. at a dead centre

    Raises `RequestError` for unknown names, or a number on which the drive does not depend.

    >>> moments = bm.design.available(mech, "couple.moment", -500.0, at=[0.5, 1.0], friction="none")
    >>> moments.round(1)
    array([5277.8, 2402.6])
    """
    actuated = _driver(mechanism, driver)
    mechanism, paths = with_efforts(mechanism, (number,), parameters(mechanism))
    (p,) = chosen_numbers(mechanism, tuple(paths.values())).values()
    family = Family(mechanism, [p.address])
    if family.alone:
        raise refused(p.address, family.alone, "name a load")
    name = mechanism._of_driver(actuated, "drive")
    if not math.isfinite(target := number_in_si(effort, unit := mechanism.outputs[name].unit)):
        raise refused("effort", f"got {effort!r}", f"give a number, or a text in {unit}")
    run_samples = mechanism.samples(at, samples, None, rates, None)
    plan = family.general.plan([name], friction=friction, static=static)
    refuse_deflections(mechanism, plan, "designs")
    mechanism._refuse_states(plan, run_samples.inputs)
    engine, n = DualEngine(plan.program), run_samples.n
    columns = {
        k: np.broadcast_to(np.asarray(x, float), n) for k, x in _inputs(run_samples, plan).items()
    }
    forces = np.full(n, np.nan)
    for start in range(0, n, CHUNK):
        part = slice(start, min(start + CHUNK, n))
        inputs = {k: x[part] for k, x in columns.items()}
        x = np.full(part.stop - part.start, float(p.value) or 1.0)
        for _ in range(NEWTON_STEPS):
            design = family.design({p: Dual(x, np.ones((1, x.size)))})
            values = engine.run(inputs, plan.program.values(*design), x.size, 1)
            drive = values[plan.layout[name][0]]
            with np.errstate(all="ignore"):
                step = (target - drive.x) / drive.d[0]
            converged = np.abs(step) <= 64 * EPS * np.maximum(np.abs(x), np.abs(p.value) or 1.0)
            x = x + np.where(np.isfinite(step), step, np.nan)
            if (converged | ~np.isfinite(x)).all():
                break
        forces[part] = np.where(converged, x, np.nan)
    if not np.isfinite(forces).any():
        raise refused(p.address, f"no value of it makes {name} {target:.6g}", "name a load")
    return forces


def _driver(mechanism: Compiled, driver: str | None) -> str:
    """The driver that is meant. Raises `RequestError` where there is no such one."""
    drivers = mechanism.drivers
    actuated = drivers[0] if driver is None and len(drivers) == 1 else driver
    return among(drivers, "driver", actuated, where="driver")[0]


def _inputs(samples: Samples, plan: Plan) -> Record:
    inputs = samples.given(plan.program.inputs)
    return {name: inputs[name] for name in plan.program.inputs}
