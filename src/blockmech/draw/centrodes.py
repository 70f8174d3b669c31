"""Centrodes of a link: where its instant centre goes, on the frame and on the link itself.

The moving centrode, drawn in the first pose, rolls on the fixed one.

Source: Hunt, Kinematic Geometry of Mechanisms, 1978, ch. 2.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from blockmech.analysis.instant_centres import instant_centre
from blockmech.compiled import Compiled
from blockmech.draw.page import Paths
from blockmech.figures.curves import reach
from blockmech.functions.roots import SCANNED

WINDOW = 2.0  # sizes of the mechanism, beyond which a centrode is not drawn
SWEEP = SCANNED + 1  # samples of the range


def centrodes(mechanism: Compiled, link: str, at: Any = None) -> Paths:
    """The fixed and the moving centrode (n,) of a link [m], the latter in the first pose.

    Parameters
    ----------
    at : coordinates of the driver [rad or m]; by default the range of its law of motion

    Raises `RequestError` for a link that there is not, or a mechanism of several drivers.
    """
    (driver,) = mechanism.drivers if len(mechanism.drivers) == 1 else ("",)
    if at is None and driver:
        samples = mechanism.samples(None, SWEEP, None, None, None)
        at = samples.inputs["q_0"]
    centre = instant_centre(mechanism, link, at=at)
    name = link if mechanism.names is None else f"link.{link}"
    run = mechanism.run(at=at, want=[f"{name}.p", f"{name}.angle"], on_gap="mark")
    o, e = run[f"{name}.p"], np.exp(1j * run[f"{name}.angle"])
    with np.errstate(invalid="ignore"):
        moving = o[0] + e[0] * np.conj(e) * (centre - o)
        in_window = np.abs(centre - np.nanmean(o)) <= WINDOW * reach(mechanism)
    return {
        "fixed centrode": np.where(in_window, centre, np.nan),
        "moving centrode": np.where(in_window, moving, np.nan),
    }
