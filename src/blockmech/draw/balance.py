"""Pictures of balancing and sizing: before and after, speed over a turn, moment over speed."""

from __future__ import annotations

from typing import Any

import numpy as np

from blockmech.draw import palette as ink
from blockmech.draw.curves import abscissa, values
from blockmech.draw.paper import captioned, legend_above, scaled_unit, shown_name
from blockmech.draw.pictured import Pictured
from blockmech.runnable import wrap_result
from blockmech.studies.balance import Balance
from blockmech.studies.balance import balance as balance_of
from blockmech.studies.drives import MotorDemand
from blockmech.studies.drives import motor as motor_of
from blockmech.studies.flywheel import Flywheel
from blockmech.studies.flywheel import flywheel as flywheel_of

PANEL = 13.0 * ink.TEXT  # [pt] height of a panel
OUTPUTS = 4  # that one picture can hold


class PlottedBalance(Pictured, Balance):
    """A balance with its picture."""

    def figure(self) -> Any:
        """Each output before and after, over the poses."""
        before, after = self.runs
        names, across = [*self.after][:OUTPUTS], abscissa(before)
        caption = f"{shown_name(self.mechanism.name, 40)}: outputs before and after balancing, "
        caption += "vectors by their size."
        with captioned(caption, len(names) * PANEL + 2 * ink.ROW) as figure:
            panels = figure.subplots(len(names), sharex=True, squeeze=False)[:, 0]
            for axes, name in zip(panels, names, strict=True):
                factor, unit = scaled_unit(self.units[name], self.before[name].largest)
                for n, (label, run) in enumerate((("before", before), ("after", after))):
                    axes.plot(
                        across.values, factor * values(run, name), label=label, **ink.curve_style(n)
                    )
                axes.set_ylabel(f"{shown_name(name)} [{unit or '–'}]", labelpad=2)
                axes.grid(True)
            legend_above(panels[0], ink.COLUMN)
            panels[-1].set_xlabel(across.words, labelpad=1)
        return figure


class PlottedFlywheel(Pictured, Flywheel):
    """A flywheel with its picture."""

    def figure(self) -> Any:
        """Speed over the turn, with the flywheel and without."""
        with captioned(
            f"{self.text()[0].upper()}{self.text()[1:]}.", PANEL + 3 * ink.ROW
        ) as figure:
            axes = figure.subplots()
            for n, (label, row) in enumerate(
                (("with the flywheel", self.speeds), ("without it", self.speeds_without))
            ):
                axes.plot(self.q, row, label=label, **ink.curve_style(n))
            axes.set_ylabel("speed [rad/s]", labelpad=2)
            axes.set_xlabel("crank [rad]", labelpad=1)
            axes.grid(True)
            legend_above(axes, ink.COLUMN)
        return figure


class PlottedMotorDemand(Pictured, MotorDemand):
    """What a driver asks of its motor, with its picture."""

    def figure(self) -> Any:
        """Moment over speed, with the motor's limits."""
        caption = " ".join(line + "." for line in self.text().split("\n"))
        with captioned(caption, 1.5 * PANEL + 2 * ink.ROW) as figure:
            axes = figure.subplots()
            factor, unit = scaled_unit(self.unit, max(self.peak, self.limits.get("peak", 0.0)))
            axes.plot(self.speed, factor * self.moment, ".-", ms=2, lw=0.6, color=ink.FORWARD)
            axes.axhline(factor * self.rms, color=ink.FORWARD, ls="--", lw=0.8)
            for name, style in (("peak", "-"), ("rms", "--")):
                for side in (-1.0, 1.0) if name in self.limits else ():
                    axes.axhline(
                        side * factor * self.limits[name], color=ink.ALARM, ls=style, lw=1.0
                    )
            for side in (-1.0, 1.0) if "speed" in self.limits else ():
                if np.any(side * self.speed > 0):
                    axes.axvline(side * self.limits["speed"], color=ink.ALARM, lw=1.0)
            per = "rad/s" if self.unit == "N m" else "m/s"
            axes.set_ylabel(f"motor [{unit}]; dashed: rms", labelpad=2)
            axes.set_xlabel(f"speed of the motor [{per}]; red: its limits", labelpad=1)
            axes.grid(True)
        return figure


balance = wrap_result(PlottedBalance, balance_of)
"""`blockmech.studies.balance.balance`, which can be drawn."""

flywheel = wrap_result(PlottedFlywheel, flywheel_of)
"""`blockmech.studies.flywheel.flywheel`, which can be drawn."""

motor = wrap_result(PlottedMotorDemand, motor_of)
"""`blockmech.studies.drives.motor`, which can be drawn."""
