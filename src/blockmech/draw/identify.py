"""The picture of an identification: what each column leaves over the coordinate."""

from __future__ import annotations

from typing import Any

import numpy as np

from blockmech.draw import palette as ink
from blockmech.draw.paper import captioned, scaled_unit, shown_name
from blockmech.draw.pictured import Pictured
from blockmech.runnable import wrap_result
from blockmech.studies.identify import Identification
from blockmech.studies.identify import identify as found_of

PANEL = 9.0 * ink.TEXT  # [pt] height of a panel
COLUMNS = 6  # that one picture can hold
DOT = 2.0  # [pt2] of a sample
BAND = 3.0  # standard deviations


class PlottedIdentification(Pictured, Identification):
    """An identification with its picture."""

    def figure(self) -> Any:
        """Residual of each column over the first driver's coordinate, with its scatter."""
        names = [*self.residuals][:COLUMNS]
        driver = self.mechanism.drivers[0]
        caption = (
            f"{shown_name(self.mechanism.name, 40)}: measured less computed; shaded: {BAND:g} "
            "standard deviations. "
        )
        caption += (
            f"Red: a pattern that is no noise, so the model misses something at "
            f"{', '.join(dict.fromkeys(n.partition('.')[0] for n in self.doubts))}."
            if self.doubts
            else "What is left is noise."
        )
        with captioned(caption, len(names) * PANEL + 2 * ink.ROW) as figure:
            panels = figure.subplots(len(names), sharex=True, squeeze=False)[:, 0]
            for axes, name in zip(panels, names, strict=True):
                r, sigma = self.residuals[name], self.noise[name]
                factor, unit = scaled_unit(self.units[name], float(np.abs(r).max()))
                colour = ink.ALARM if name in self.doubts else ink.FORWARD
                axes.axhspan(
                    -BAND * factor * sigma, BAND * factor * sigma, color=ink.LINK_FILLS[0], lw=0
                )
                axes.scatter(
                    self.coordinate, factor * r, s=DOT, lw=0, color=colour, rasterized=True
                )
                axes.set_ylabel(f"{shown_name(name)}\n[{unit or '–'}]", labelpad=2)
                axes.grid(True)
            unit = self.mechanism.driver_joint(driver).coordinate_unit
            panels[-1].set_xlabel(f"{self.mechanism.of_driver(driver, 'q')} [{unit}]", labelpad=1)
        return figure


identify = wrap_result(PlottedIdentification, found_of)
"""`blockmech.studies.identify.identify`, which can be drawn."""
