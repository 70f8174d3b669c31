"""Pictures of a simulation: the second paper's Figures 6 and 7, phase plot, animation.

What the run did not compute is computed here, at times of the pictures' own along the
same motion, so a picture is smooth however few output times were asked for.

Sources: [D14] Durango et al. 2014, Figs. 6 and 7.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blockmech.draw.animation import gif, page, reel_of
from blockmech.draw.curves import reaction_panels
from blockmech.draw.panels import Abscissa, Curve, Panel, draw_panels
from blockmech.draw.paper import rendered, shown_name
from blockmech.dynamics.simulation import result_along
from blockmech.files import AnyPath, writing
from blockmech.result import Result

Array = NDArray[np.float64]

CURVE = 721  # times of a curve
FRAME = 0.04  # [s] on the screen
SHORTEST, LONGEST = 1.0, 16.0  # [s] on the screen; real time between them
ENERGIES = ("kinetic_energy", "potential_energy")


def simulation_pictures(result: Result, folder: AnyPath, *, degrees: bool = True) -> list[Path]:
    """Draw a simulation into a folder.

    ``motion.png`` (coordinate, rate and reactions over time), ``energy.png``,
    ``phase.png`` (rate over coordinate), ``animation.gif`` and ``animation.html`` in
    real time; a run shorter than 1 s or longer than 16 s is slowed or sped up by a power
    of ten or two. A motion of no duration has none of them.

    Parameters
    ----------
    result : of `Mechanism.simulate`
    folder : made if it is missing
    degrees : angles in degrees

    Raises `RequestError` where the folder cannot be written.
    """
    motion = result.motion
    assert motion is not None
    home = Path(folder)
    home.mkdir(parents=True, exist_ok=True)
    if not motion.t_end > motion.t_start:
        return []
    names = [f"mechanism.{name}" for name in ENERGIES]
    reactions = [n for n in result.mechanism.outputs if n.endswith(".reaction")]
    of_driver, named = result.mechanism.of_driver, result.mechanism.drivers
    drivers = [of_driver(d, what) for d in named for what in ("q", "rate")]
    t = motion.times(CURVE)
    fine = result_along(result.mechanism, motion, t, (*drivers, *names, *reactions))
    over = Abscissa("time [s]", t)
    drawn = {
        "motion.png": draw_panels(motion_panels(fine, degrees), over).figure,
        "energy.png": draw_panels(energy_panels(fine), over).figure,
        **phase_plots(fine, degrees),
    }
    files = {name: rendered(figure, ".png") for name, figure in drawn.items()}
    files |= animated(result, degrees)
    for name, data in files.items():
        with writing(home / name) as stream:
            stream.write(data)
    return [home / name for name in files]


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
        x, x_unit = _drivers(result, "q", rotary, degrees)
        y, y_unit = _drivers(result, "rate", rotary, degrees)
        if not x:
            continue
        alone = len(x) == 1
        of = f" of {shown_name(x[0].name)}" if alone else ""
        curves = tuple(Curve("" if alone else c.name, c.values) for c in y)
        along = Abscissa("", np.arange(float(result.n)))
        plot = draw_panels((Panel(f"rate{of}", y_unit, curves),), along)
        pairs = [(a.values, b.values) for a, b in zip(x, y, strict=True)]
        _over(plot.axes[0], pairs, f"coordinate{of} [{x_unit}]")
        found["phase_slides.png" if found else "phase.png"] = plot.figure
    return found


def _over(axes: Any, pairs: list[tuple[Array, Array]], words: str) -> None:
    """Put a panel's curves over coordinates, in the order of time; mark both ends."""
    from matplotlib.ticker import AutoLocator, ScalarFormatter

    for line, (x, y) in zip(list(axes.get_lines()), pairs, strict=True):
        line.set_data(x, y)
        line.set_marker("")
        colour = line.get_color()
        axes.plot(x[:1], y[:1], "o", color=colour, ms=3, mfc="white", zorder=3)
        axes.plot(x[-1:], y[-1:], "o", color=colour, ms=3, zorder=3)
    axes.xaxis.set_major_locator(AutoLocator())
    axes.xaxis.set_major_formatter(ScalarFormatter())
    axes.set_xlabel(words, labelpad=2)
    axes.relim()
    axes.autoscale(True)
    axes.margins(0.04)
    axes.autoscale_view()


def animated(result: Result, degrees: bool = True) -> dict[str, bytes]:
    """The motion as ``animation.gif`` and ``animation.html``, played forward in time."""
    motion = result.motion
    assert motion is not None
    seconds = screen_time(motion.t_end - motion.t_start)
    frames = max(2, round(seconds / FRAME))
    finer = math.ceil(CURVE / frames)  # a path is smooth however few frames there are
    moving = result_along(result.mechanism, motion, motion.times((frames - 1) * finer + 1), ())
    reel, scale = reel_of(moving, degrees=degrees, seconds=seconds)
    forward = tuple(dict.fromkeys(reel.order))  # never to and fro: time has one direction
    reel = replace(reel, order=tuple(k for k in forward if k % finer == 0))
    return {"animation.gif": gif(reel, scale), "animation.html": page(reel, scale).encode()}


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
