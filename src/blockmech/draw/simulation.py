"""Pictures of a simulation: the second paper's Figures 6 and 7, phase plot, animation.

What the run did not compute is computed here, at times of the pictures' own along the
same motion, so a picture is smooth however few output times were asked for.

Sources: [D14] Durango et al. 2014, Figs. 6 and 7.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from blockmech.draw import palette as ink
from blockmech.draw.animation import FRICTION_POWER, Animation
from blockmech.draw.curves import friction_panels, reaction_panels
from blockmech.draw.motion import moves_of_result
from blockmech.draw.panels import BOTTOM, PANEL, Abscissa, Curve, Panel, draw_panels
from blockmech.draw.paper import legend_above, new_figure, shown_name, styled, write_figure
from blockmech.dynamics.simulation import result_along
from blockmech.files import AnyPath
from blockmech.files import folder as whole_folder
from blockmech.result import Result

CURVE = 721  # times of a curve
FRAME = 0.04  # [s] on the screen
SHORTEST, LONGEST = 1.0, 16.0  # [s] on the screen; real time between them
MARKED = ("rest", "joint reverses")  # events of a motion with friction
ENERGIES = ("kinetic_energy", "potential_energy")


def simulation_pictures(result: Result, folder: AnyPath, *, degrees: bool = True) -> list[Path]:
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
    degrees : angles in degrees

    Raises `RequestError` where the folder cannot be written.
    """
    motion, mechanism = result.motion, result.mechanism
    assert motion is not None
    if not motion.t_end > motion.t_start:
        return []
    drivers = [mechanism.of_driver(d, what) for d in mechanism.drivers for what in ("q", "rate")]
    others = [n for n in mechanism.outputs if n.endswith(_endings(result))]
    t = motion.times(CURVE)
    fine = result_along(mechanism, motion, t, (*drivers, *others))
    marked = tuple((e.t, e.kind) for e in motion.events if e.kind in MARKED)
    over = Abscissa("time [s]", t, events=marked)
    drawn = {
        "motion.png": motion_panels(fine, degrees),
        "energy.png": energy_panels(fine),
        "friction_power.png": friction_panels(fine),
    }
    figures = {name: draw_panels(panels, over).figure for name, panels in drawn.items() if panels}
    figures |= phase_plots(fine, degrees)
    films = animated(result, degrees)
    with whole_folder(folder) as home:
        for name, figure in figures.items():
            write_figure(figure, home / name)
        for name, data in films.items():
            (home / name).write_bytes(data)
    return [Path(folder) / name for name in (*figures, *films)]


def _endings(result: Result) -> tuple[str, ...]:
    """What the names of the outputs end with that the pictures need beside the drivers'."""
    friction = (".friction_power",) if result.settings["friction"] != "none" else ()
    return (".reaction", *(f"mechanism.{name}" for name in ENERGIES), *friction)


def motion_panels(result: Result, degrees: bool = True) -> tuple[Panel, ...]:
    """Coordinate and rate of each driver and the reactions' magnitudes ([D14] Fig. 6)."""
    return (*_states(result, degrees), *reaction_panels(result, None))


def _states(result: Result, degrees: bool) -> tuple[Panel, ...]:
    """Coordinates in one panel for each unit, and rates."""
    panels = []
    for what, quantity in (("q", "coordinate"), ("rate", "rate")):
        for rotary in (True, False):
            curves, unit = _drivers(result, what, rotary, degrees)
            if len(curves) == 1:
                of = f"{quantity} of {shown_name(curves[0].name)}"
                panels.append(Panel(of, unit, (Curve("", curves[0].values),)))
            elif curves:
                panels.append(Panel(quantity, unit, tuple(curves)))
    return tuple(panels)


def _drivers(result: Result, what: str, rotary: bool, degrees: bool) -> tuple[list[Curve], str]:
    """Curves of the drivers of one sort, and their unit; an angle is drawn in degrees."""
    mechanism = result.mechanism
    names = [d for d in mechanism.drivers if mechanism.driver_joint(d).rotary == rotary]
    turned = rotary and degrees and what == "q"
    curves = []
    for name in names:
        values = np.asarray(result[mechanism.of_driver(name, what)], dtype=float)
        curves.append(Curve(name, np.degrees(values) if turned else values))
    unit = ("°" if turned else "rad") if rotary else "m"
    return curves, unit if what == "q" else f"{unit}/s"


def energy_panels(result: Result) -> tuple[Panel, ...]:
    """Kinetic, potential and total energy ([D14] Fig. 7)."""
    T, V = (np.asarray(result[f"mechanism.{name}"], dtype=float) for name in ENERGIES)
    if not np.nanmax(np.abs(V), initial=0.0) > 0:  # neither weights nor springs
        return (Panel("kinetic energy", "J", (Curve("", T),)),)
    curves = (Curve("kinetic", T), Curve("potential", V), Curve("total", T + V))
    return (Panel("energy", "J", curves),)


def phase_plots(result: Result, degrees: bool = True) -> dict[str, Any]:
    """Figures by file: rates over coordinates, start and end marked.

    Drivers that turn share one, those that slide another.
    """
    found: dict[str, Any] = {}
    for rotary in (True, False):
        over, x_unit = _drivers(result, "q", rotary, degrees)
        rates, y_unit = _drivers(result, "rate", rotary, degrees)
        if not over:
            continue
        with styled():
            figure = new_figure(ink.COLUMN, BOTTOM + PANEL, layout="constrained")
            axes = figure.subplots()
            for i, (x, y) in enumerate(zip(over, rates, strict=True)):
                style = ink.curve_style(i)
                ends: dict[str, Any] = {
                    "marker": "o",
                    "color": style["color"],
                    "ms": 3,
                    "zorder": 3,
                }
                axes.plot(x.values, y.values, **style, label=shown_name(x.name))
                axes.plot(x.values[:1], y.values[:1], mfc=ink.PAPER, **ends)
                axes.plot(x.values[-1:], y.values[-1:], **ends)
            of = f" of {shown_name(over[0].name)}" if len(over) == 1 else ""
            axes.set(xlabel=f"coordinate{of} [{x_unit}]", ylabel=f"rate{of} [{y_unit}]")
            axes.grid(True, color=ink.PALE, lw=0.3)
            if len(over) > 1:
                legend_above(axes, ink.COLUMN)
        found["phase_slides.png" if found else "phase.png"] = figure
    return found


def animated(result: Result, degrees: bool = True) -> dict[str, bytes]:
    """The motion as ``animation.gif`` and ``animation.html``, played forward in time."""
    motion = result.motion
    assert motion is not None
    seconds = screen_time(motion.t_end - motion.t_start)
    frames = max(2, round(seconds / FRAME))
    finer = math.ceil(CURVE / frames)  # a path is smooth however few frames there are
    want = [FRICTION_POWER] if FRICTION_POWER in result.mechanism.outputs else []
    want = want if result.settings["friction"] != "none" else []
    times = motion.times((frames - 1) * finer + 1)
    moving = result_along(result.mechanism, motion, times, want)
    film = Animation(moves_of_result(moving), seconds, None, degrees, every=finer)
    return {"animation.gif": film.gif, "animation.html": film.html.encode()}


def screen_time(duration: float) -> float:
    """Seconds on the screen for a motion: its own, or a round multiple if that is too short.

    >>> screen_time(2.0), screen_time(0.03), screen_time(40.0)
    (2.0, 3.0, 8.0)
    """
    shown = duration
    while shown < SHORTEST:
        shown *= 10
    for share in (2, 5, 10):
        if shown <= LONGEST:
            break
        shown = duration / share
    return min(shown, LONGEST)
