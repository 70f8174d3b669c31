"""Pictures of balancing and sizing: before and after, speed over a turn, moment over speed."""

from __future__ import annotations

from typing import Any

import numpy as np

from blockmech.design.balance import Balance
from blockmech.design.drives import MotorDemand
from blockmech.design.flywheel import Flywheel
from blockmech.draw import palette as ink
from blockmech.draw.curves import abscissa, values
from blockmech.draw.paper import axis_label, captioned, legend_above, scaled_unit, shown_name

PANEL = 13.0 * ink.TEXT  # [pt] height of a panel
OUTPUTS = 4  # that one picture can hold


def balance_figure(balance: Balance, degrees: bool) -> Any:
    """Each output before and after, over the poses."""
    before, after = balance.runs
    names, across = [*balance.after][:OUTPUTS], abscissa(before, degrees=degrees)
    caption = f"{shown_name(balance.mechanism.name, 40)}: outputs before and after balancing, "
    caption += "vectors by their size."
    with captioned(caption, len(names) * PANEL + 2 * ink.ROW) as figure:
        panels = figure.subplots(len(names), sharex=True, squeeze=False)[:, 0]
        for axes, name in zip(panels, names, strict=True):
            factor, unit = scaled_unit(balance.units[name], balance.before[name].largest)
            for n, (label, run) in enumerate((("before", before), ("after", after))):
                axes.plot(
                    across.values, factor * values(run, name), label=label, **ink.curve_style(n)
                )
            axes.set_ylabel(axis_label(shown_name(name), unit, PANEL), labelpad=2)
            axes.grid(True)
        legend_above(panels[0], ink.COLUMN)
        panels[-1].set_xlabel(across.words, labelpad=1)
    return figure


def flywheel_figure(flywheel: Flywheel, degrees: bool) -> Any:
    """Speed over the turn, with the flywheel and without."""
    q = np.degrees(flywheel.q) if degrees else flywheel.q
    with captioned(
        f"{flywheel.text()[0].upper()}{flywheel.text()[1:]}.", PANEL + 3 * ink.ROW
    ) as figure:
        axes = figure.subplots()
        for n, (label, row) in enumerate(
            (("with the flywheel", flywheel.speeds), ("without it", flywheel.speeds_without))
        ):
            axes.plot(q, row, label=label, **ink.curve_style(n))
        axes.set_ylabel("speed [rad/s]", labelpad=2)
        axes.set_xlabel(f"crank [{'°' if degrees else 'rad'}]", labelpad=1)
        axes.grid(True)
        legend_above(axes, ink.COLUMN)
    return figure


def motor_figure(motor: MotorDemand, degrees: bool) -> Any:
    """Moment over speed, with the motor's limits."""
    caption = " ".join(line + "." for line in motor.text().split("\n"))
    with captioned(caption, 1.5 * PANEL + 2 * ink.ROW) as figure:
        axes = figure.subplots()
        factor, unit = scaled_unit(motor.unit, max(motor.peak, motor.limits.get("peak", 0.0)))
        axes.plot(motor.speed, factor * motor.moment, ".-", ms=2, lw=0.6, color=ink.FORWARD)
        axes.axhline(factor * motor.rms, color=ink.FORWARD, ls="--", lw=0.8)
        for name, style in (("peak", "-"), ("rms", "--")):
            for side in (-1.0, 1.0) if name in motor.limits else ():
                axes.axhline(side * factor * motor.limits[name], color=ink.ALARM, ls=style, lw=1.0)
        for side in (-1.0, 1.0) if "speed" in motor.limits else ():
            if np.any(side * motor.speed > 0):
                axes.axvline(side * motor.limits["speed"], color=ink.ALARM, lw=1.0)
        per = "rad/s" if motor.unit == "N m" else "m/s"
        axes.set_ylabel(f"motor [{unit}]; dashed: rms", labelpad=2)
        axes.set_xlabel(f"speed of the motor [{per}]; red: its limits", labelpad=1)
        axes.grid(True)
    return figure
