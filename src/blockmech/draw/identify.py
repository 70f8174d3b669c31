"""The picture of an identification: what each column leaves over the coordinate."""

from __future__ import annotations

from typing import Any

import numpy as np

from blockmech.design.identify import Identification
from blockmech.draw import palette as ink
from blockmech.draw.paper import captioned, scaled_unit, shown_name

PANEL = 9.0 * ink.TEXT  # [pt] height of a panel
COLUMNS = 6  # that one picture can hold
DOT = 2.0  # [pt2] of a sample
BAND = 3.0  # standard deviations


def identification_figure(fit: Identification, degrees: bool) -> Any:
    """Residual of each column over the first driver's coordinate, with its scatter."""
    names = [*fit.residuals][:COLUMNS]
    driver = fit.mechanism.drivers[0]
    x, unit_of_x = fit.coordinate, fit.mechanism.driver_joint(driver).coordinate_unit
    if degrees and unit_of_x == "rad":
        x, unit_of_x = np.degrees(x), "°"
    caption = (
        f"{shown_name(fit.mechanism.name, 40)}: measured less computed; shaded: {BAND:g} "
        "standard deviations. "
    )
    caption += (
        f"Red: a pattern that is no noise, so the model misses something at "
        f"{', '.join(dict.fromkeys(n.partition('.')[0] for n in fit.doubts))}."
        if fit.doubts
        else "What is left is noise."
    )
    with captioned(caption, len(names) * PANEL + 2 * ink.ROW) as figure:
        panels = figure.subplots(len(names), sharex=True, squeeze=False)[:, 0]
        for axes, name in zip(panels, names, strict=True):
            r, sigma = fit.residuals[name], fit.noise[name]
            factor, unit = scaled_unit(fit.units[name], float(np.abs(r).max()))
            colour = ink.ALARM if name in fit.doubts else ink.FORWARD
            axes.axhspan(
                -BAND * factor * sigma, BAND * factor * sigma, color=ink.LINK_FILLS[0], lw=0
            )
            axes.scatter(x, factor * r, s=DOT, lw=0, color=colour, rasterized=True)
            axes.set_ylabel(f"{shown_name(name)}\n[{unit or '–'}]", labelpad=2)
            axes.grid(True)
        panels[-1].set_xlabel(f"{fit.mechanism.of_driver(driver, 'q')} [{unit_of_x}]", labelpad=1)
    return figure
