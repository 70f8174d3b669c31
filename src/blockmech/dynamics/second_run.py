"""The run beside a motion along the path: how far both are apart is the estimate of its error.

Where its energy is used up on a panel that holds no standstill it takes another path, and only a
run with panels of its own can say how far.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from blockmech.dynamics.ends import END_STOP
from blockmech.dynamics.panel_nodes import KIND, TO_LIMIT
from blockmech.dynamics.panels import Panels
from blockmech.dynamics.track import Leg, RepeatedSegment

if TYPE_CHECKING:
    from blockmech.dynamics.path import PathRun


def second_run(run: PathRun) -> list[Leg] | None:
    """The second run; None where it needs panels of its own.

    So it is where the path ends by itself: at a dead centre, in equilibrium, where nothing is
    smooth.
    """
    named = run.end in ("time", END_STOP, run.request.until.goal)
    if not named and not run.end.startswith("never reached"):
        return None
    parts = [x.panels if isinstance(x, RepeatedSegment) else x for x in run.whole]
    if run.regime == "rest" or any((x.spans[KIND] == TO_LIMIT).any() for x in parts):
        return None
    if not all(math.isfinite(x.other.t1) for x in parts):
        return None
    legs, t = list[Leg](), 0.0
    for leg, following in zip(run.whole, [*run.whole[1:], None], strict=True):
        if isinstance(leg, Panels):
            panels = leg.other.taken_from(t)
            legs.append(panels)
            t = panels.t1
            continue
        panels = leg.panels.other.taken_from(0.0)
        segment = replace(leg, t0=t, panels=panels, gain=panels.gain if leg.gain else 0.0, known={})
        if leg.starts is not None:
            energies = np.arange(len(leg.starts) - 1) * np.float64(segment.gain)
            starts = np.append(0.0, np.cumsum(segment.durations(energies)))
            segment = replace(segment, starts=starts)
        legs.append(segment)
        if isinstance(following, Panels):
            t = segment.begins(round((following.begin - leg.panels.begin) / leg.step))
    return legs
