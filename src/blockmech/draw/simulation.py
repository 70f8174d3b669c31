"""Pictures of a simulation: the second paper's Figures 6 and 7, phase plot, animation.

What the run did not compute is computed here, at times of the pictures' own along the
same motion, so a picture is smooth however few output times were asked for.

Sources: [D14] Durango et al. 2014, Figs. 6 and 7.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from blockmech.draw.animation import FRAME, FRICTION_POWER, Animation
from blockmech.draw.motion import moves_of_result
from blockmech.dynamics.chart_outputs import result_along
from blockmech.figures import palette as ink
from blockmech.figures.curves import (
    Panels,
    abscissa,
    by_unit,
    friction_panels,
    in_units,
    reaction_panels,
    values,
)
from blockmech.figures.panels import BOTTOM, PANEL, Abscissa, Panel, draw_panels
from blockmech.figures.paper import legend_above, panelled, shown_name, svg, write_figure
from blockmech.functions.roots import SCANNED
from blockmech.ground.files import AnyPath
from blockmech.ground.files import folder as whole_folder
from blockmech.result.motion import Motion
from blockmech.result.result import Result
from blockmech.typing import Data

CURVE = SCANNED + 1  # times of a curve
SHORTEST, LONGEST = 1.0, 16.0  # [s] on the screen; real time between them
MARKED = ("rest", "joint reverses")  # events of a motion with friction
ENERGIES = ("mechanism.kinetic_energy", "mechanism.potential_energy")


def motion_svg(result: Result) -> str:
    """Coordinate and rate of each driver over time as SVG text; "" of a motion of no duration."""
    motion = result.motion
    if motion is None or not motion.t_end > motion.t_start:
        return ""
    fine, over = _smooth(result, motion, ())
    return svg(draw_panels(state_panels(fine), over))


def simulation_pictures(result: Result, folder: AnyPath) -> list[Path]:
    """Draw a simulation into a folder.

    ``motion.png`` (coordinate, rate and reactions over time), ``energy.png``,
    ``friction_power.png`` where joints have friction, ``phase.png`` (rate over coordinate),
    ``animation.gif`` and ``animation.html`` in real time; a run shorter than 1 s or longer
    than 16 s is slowed or sped up by a power of ten or two. A motion of no duration has none
    of them.

    Parameters
    ----------
    result : of `Mechanism.simulate`
    folder : made if it is missing

    Raises `RequestError` where the folder cannot be written.
    """
    motion, mechanism = result.motion, result.mechanism
    if motion is None or not motion.t_end > motion.t_start:
        return []
    friction = result.settings["friction"] != "none"
    ends = (".reaction", *ENERGIES, *(".friction_power",) * friction)
    fine, over = _smooth(result, motion, [n for n in mechanism.outputs if n.endswith(ends)])
    panels = {
        "motion.png": motion_panels(fine),
        "energy.png": energy_panels(fine),
        "friction_power.png": friction_panels(fine),
    }
    groups = {name: in_units(group, fine) for name, group in panels.items() if group}
    figures = {name: draw_panels(group, over) for name, group in groups.items()}
    figures |= phase_plots(fine)
    film = _film(result)
    with whole_folder(folder) as home:
        for name, figure in figures.items():
            write_figure(figure, home / name)
        for suffix in ("gif", "html"):
            film.save(home / f"animation.{suffix}")
    return [Path(folder) / name for name in (*figures, "animation.gif", "animation.html")]


def _smooth(result: Result, motion: Motion, names: Iterable[str]) -> tuple[Result, Abscissa]:
    """Coordinates, rates and further outputs at times of a picture's own, and these times."""
    mechanism = result.mechanism
    states = [mechanism._of_driver(d, state) for d in mechanism.drivers for state in ("q", "rate")]
    t = motion.curve_times(CURVE)
    marked = tuple((e.t, e.kind) for e in motion.events if e.kind in MARKED)
    fine = result_along(mechanism, motion, t, [*states, *names]).to(*result._display)
    return fine, replace(abscissa(fine, "time"), events=marked)


def motion_panels(result: Result) -> Panels:
    """Coordinate and rate of each driver and the reactions' magnitudes ([D14] Fig. 6)."""
    return (*state_panels(result), *reaction_panels(result, None))


def state_panels(result: Result) -> Panels:
    """Coordinate and rate of each driver."""
    panels = []
    for state, quantity in (("q", "coordinate"), ("rate", "rate")):
        for unit, curves in by_unit(result, state).items():
            (first, y), *rest = curves.items()
            alone = Panel(f"{quantity} of {shown_name(first)}", unit, {"": y})
            panels.append(Panel(quantity, unit, curves) if rest else alone)
    return tuple(panels)


def energy_panels(result: Result) -> Panels:
    """Kinetic, potential and total energy ([D14] Fig. 7)."""
    T, V = (values(result, name) for name in ENERGIES)
    if not np.nanmax(np.abs(V), initial=0.0) > 0:  # neither weights nor springs
        return (Panel("kinetic energy", "J", {"": T}),)
    return (Panel("energy", "J", {"kinetic": T, "potential": V, "total": T + V}),)


def phase_plots(result: Result) -> Data:
    """Figures by file: rates over coordinates, start and end marked.

    Drivers that turn share one, those that slide another.
    """
    figures: Data = {}
    alike = by_unit(result, "q"), by_unit(result, "rate")
    for (x_unit, over), (y_unit, rates) in zip(*map(dict.items, alike), strict=True):
        with panelled("", BOTTOM + PANEL) as ((axes,),):
            for i, (driver, x) in enumerate(over.items()):
                y, style = rates[driver], ink.curve_style(i)
                ends = {"marker": "o", "ms": 3, "color": style["color"]}
                axes.plot(x, y, **style, label=shown_name(driver))
                axes.plot(x[:1], y[:1], mfc=ink.PAPER, **ends)
                axes.plot(x[-1:], y[-1:], **ends)
            of = f" of {shown_name(next(iter(over)))}" if len(over) == 1 else ""
            axes.set(xlabel=f"coordinate{of} [{x_unit}]", ylabel=f"rate{of} [{y_unit}]")
            if len(over) > 1:
                legend_above(axes, ink.COLUMN)
        figures["phase_slides.png" if figures else "phase.png"] = axes.figure
    return figures


def _film(result: Result) -> Animation:
    """The motion played forward in time."""
    motion = result.motion
    assert motion is not None
    seconds = screen_time(motion.t_end - motion.t_start)
    frames = max(2, round(seconds / FRAME))
    finer = math.ceil(CURVE / frames)  # a path is smooth however few frames there are
    friction = FRICTION_POWER in result.mechanism.outputs and result.settings["friction"] != "none"
    want = [FRICTION_POWER] if friction else []
    times = motion.times((frames - 1) * finer + 1)
    moving = result_along(result.mechanism, motion, times, want).to(*result._display)
    return Animation(moves_of_result(moving), seconds, every=finer)


def screen_time(duration: float) -> float:
    """Seconds on the screen for a motion: its own, or a round multiple if that is too short.

    One that ended where it began stands still for a while.

    >>> screen_time(2.0), screen_time(0.03), screen_time(40.0), screen_time(0.0)
    (2.0, 3.0, 8.0, 1.0)
    """
    seconds = duration or SHORTEST
    while seconds < SHORTEST:
        seconds *= 10
    for share in (2, 5, 10):
        if seconds <= LONGEST:
            break
        seconds = duration / share
    return min(seconds, LONGEST)
