r"""The flywheel that keeps a machine's speed within a fluctuation.

A constant moment T gives over a turn what the loads take; then the kinetic energy follows the
loads, (J(q) + J_f) w^2 / 2 = E0 + int (tau + T) dq, and J_f is the root of the wanted fluctuation
(w_max - w_min) / w_mean. Loads of the rate count at the mean speed.

Source: Norton, Design of Machinery, 6th ed., 11.11 (flywheels).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from blockmech.analysis.limits import limits
from blockmech.analysis.scan import NODES, TURN
from blockmech.compiled import Compiled
from blockmech.dynamics.programs import refuse_signals
from blockmech.dynamics.system import System
from blockmech.figures import palette as ink
from blockmech.figures.panels import label_coordinate
from blockmech.figures.paper import Pictured, legend_above, panelled, picture_unit
from blockmech.functions.roots import SCANNED
from blockmech.functions.series import Series, fit, panels
from blockmech.ground.arguments import declared
from blockmech.ground.errors import refused
from blockmech.ground.plane import EPS
from blockmech.ground.report import Facts
from blockmech.ground.units import number_in_si
from blockmech.result.columns import without_noise
from blockmech.typing import Floats, Quantity

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PANEL = 13.0 * ink.TEXT  # [pt] height of a picture


@dataclass(frozen=True, repr=False)
class Flywheel(Facts, Pictured):
    """A flywheel on the driving crank, and the speed over a turn with it.

    Attributes
    ----------
    inertia : [kg m2] of the flywheel; 0 where none is needed
    moment : [N m] of the motor, constant over the turn
    fluctuation : (w_max - w_min) / w_mean [-] with it
    without : fluctuation without the flywheel; infinite if the crank would not turn fully
    speed : mean [rad/s]
    q : (n,) [rad] over the period
    speeds, speeds_without : (n,) [rad/s]
    """

    FACTS = ("inertia", "moment", "fluctuation", "without", "speed")

    inertia: float
    moment: float
    fluctuation: float
    without: float
    speed: float
    q: Floats
    speeds: Floats
    speeds_without: Floats

    def figure(self, ax: Axes | None = None) -> Any:
        """Speed over the turn, with the flywheel and without."""
        (scale, unit), (factor, rate) = (picture_unit(x, self._display) for x in ("rad", "rad/s"))
        curves = {"with the flywheel": self.speeds, "without it": self.speeds_without}
        caption = f"{self.text()[0].upper()}{self.text()[1:]}."
        with panelled(caption, PANEL + 3 * ink.ROW, ax=ax) as ((axes,),):
            for n, (label, row) in enumerate(curves.items()):
                axes.plot(scale * self.q, factor * row, label=label, **ink.curve_style(n))
            axes.set_ylabel(f"speed [{rate}]", labelpad=2)
            label_coordinate(axes, f"crank [{unit}]")
            legend_above(axes, ink.COLUMN)
        return axes.figure

    def lines(self) -> Iterator[str]:
        """The flywheel as a sentence."""
        alone = f"{self.without:.4g}" if math.isfinite(self.without) else "it does not get round"
        yield (
            f"flywheel {self.inertia:.6g} kg m2 for a fluctuation of {self.fluctuation:.4g} at "
            f"{self.speed:.6g} rad/s, motor {self.moment:.6g} N m; without it {alone}"
        )


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
        if not J.all():
            return np.full(self.q.shape, np.nan)
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
def flywheel(mechanism: Compiled, speed: Quantity, fluctuation: Quantity) -> Flywheel:
    """The flywheel on the only crank that keeps its speed within a fluctuation.

    The motor gives a constant moment. Rate-dependent loads are evaluated at the mean speed; joint
    friction is left out.

    Parameters
    ----------
    speed : mean [rad/s], also as text with a unit
    fluctuation : (w_max - w_min) / w_mean [-] that is allowed, e.g. 0.02

    Raises `RequestError` unless the only driver is a crank that turns fully, and for
    time-dependent loads.

    >>> round(bm.design.flywheel(mech, speed="300rpm", fluctuation=0.02).inertia)
    4143
    """
    from scipy.optimize import brentq

    drivers = mechanism.drivers
    if len(drivers) != 1 or not (
        mechanism.structure.driver_joint(drivers[0]).rotary and limits(mechanism).whole_turn
    ):
        raise refused("flywheel", "there is not one crank that turns fully", "a flywheel turns")
    mean = number_in_si(speed, "rad/s")
    if not mean > 0:
        raise refused("speed", f"got {speed!r}", "it is positive, in rad/s, deg/s or rpm")
    allowed = number_in_si(fluctuation, "")
    if not 0 < allowed < 2:
        raise refused("fluctuation", f"got {fluctuation!r}", "it is positive, and below 2")
    refuse_signals(mechanism)
    system = System(mechanism)
    if "time" in system.depends_on:
        raise refused("flywheel", "loads follow the time", "let them follow the crank")
    period = system.period or TURN
    knots = [x for x in system.knots if 0 < x < period]
    edges = np.unique([*panels(0.0, period, max(4, round(4 * period / TURN))), *knots])
    load: Series = fit(lambda q: system.sample(q, mean).tau, edges, n=NODES)
    work = load.integral()
    nodes, weights = np.polynomial.legendre.leggauss(16)
    fine = np.unique([*np.linspace(0.0, period, SCANNED // 8 + 1), *knots])
    half = np.diff(fine) / 2
    q = (fine[:-1, None] + half[:, None] * (1 + nodes)).ravel()
    share = (half[:, None] * weights).ravel() / period
    total, largest = -float(work(np.array([period]))[0]), float(np.abs(work(q)).max())
    moment = float(without_noise(total, largest)) / period
    turn = _Turn(q, share, system.sample(q, mean).J, work(q) + moment * q)
    if not np.isfinite(turn.J + turn.energy).all():
        fault, remedy = "inertia or loads are undefined at change points", "change a length"
        raise refused("flywheel", fault, remedy)
    if not (turn.J.any() or np.ptp(turn.energy)):
        raise refused("flywheel", "nothing has inertia, and no load works", "give links a mass")
    alone = turn.speeds(0.0, mean)
    without = fluctuation_of(alone, mean)
    if without <= allowed:
        return Flywheel(0.0, moment, without, without, mean, q, alone, alone)

    def beyond(log: float) -> float:
        return min(fluctuation_of(turn.speeds(math.exp(log), mean), mean), 1e3) - allowed

    guess = math.log(
        (float(np.ptp(turn.energy)) + float(np.ptp(turn.J)) * mean**2) / (allowed * mean**2)
    )
    inertia = math.exp(brentq(beyond, guess - 12, guess + 3, xtol=1e-13, rtol=8 * EPS))
    speeds = turn.speeds(inertia, mean)
    return Flywheel(inertia, moment, fluctuation_of(speeds, mean), without, mean, q, speeds, alone)
