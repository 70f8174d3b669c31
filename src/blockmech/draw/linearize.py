"""Pictures of linear systems: the Bode diagram, and modes in motion."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from blockmech.design.linearize import Linearization
from blockmech.draw import palette as ink
from blockmech.draw.animation import MOVING, Animation
from blockmech.draw.motion import moves
from blockmech.draw.paper import captioned, legend_above, shown_name, suffix_of
from blockmech.draw.trade import log_ticks
from blockmech.ground.errors import refused
from blockmech.ground.files import AnyPath

PANEL = 13.0 * ink.TEXT  # [pt] height of a panel
CURVES = 8  # that one diagram can hold
FRAMES = 48  # of a period of a mode


def bode_figure(linear: Linearization, degrees: bool) -> Any:
    """Bode diagram: magnitude and phase of each output by each input.

    Raises `RequestError` where there are more curves than a picture can hold.
    """
    pairs = [(i, j) for i in range(len(linear.outputs)) for j in range(len(linear.inputs))]
    if len(pairs) > CURVES:
        found = f"{len(pairs)} pairs of inputs and outputs"
        raise refused("plot", found, "name fewer outputs", code="too-many-curves")
    w = linear.around()
    whole = linear.response(w)
    caption = (
        f"{shown_name(linear.mechanism.name, 40)}: response of outputs to inputs, linear about "
    )
    caption += ", ".join(
        f"{linear.mechanism.of_driver(d, 'q')} = {q:.6g}" for d, q in linear.at.items()
    )
    with captioned(f"{caption}.", 2 * PANEL + 3 * ink.ROW) as figure:
        size, phase = figure.subplots(2, sharex=True)
        for n, (i, j) in enumerate(pairs):
            name = f"{shown_name(linear.outputs[i])} by {shown_name(linear.inputs[j])}"
            row, style = whole[:, i, j], ink.curve_style(n)
            size.plot(w, np.abs(row), label=name, **style)
            phase.plot(w, np.degrees(np.unwrap(np.angle(row))), **style)
        size.set(xscale="log", yscale="log")
        units = {
            f"{linear.units[linear.outputs[i]]}/({linear.units[linear.inputs[j]]})"
            for i, j in pairs
        }
        size.set_ylabel(f"magnitude [{units.pop() if len(units) == 1 else 'SI'}]", labelpad=2)
        phase.set_ylabel("phase [°]", labelpad=2)
        phase.set_xlabel("frequency [rad/s]", labelpad=1)
        for axes in (size, phase):
            axes.grid(True)
        log_ticks(size.xaxis, *size.get_xlim())
        log_ticks(size.yaxis, *size.get_ylim())
        phase.set_yticks(np.arange(-360, 361, 90))
        low, high = phase.dataLim.intervaly
        phase.set_ylim(90 * math.floor(low / 90 - 0.1), 90 * math.ceil(high / 90 + 0.1))
        legend_above(size, ink.COLUMN)
    return figure


def animate_mode(
    linear: Linearization, mode: int, path: AnyPath | None, amplitude: float
) -> Animation:
    """One mode in motion; see `Linearization.animate`."""
    if path is not None:
        suffix_of(path, "an animation", MOVING)  # before anything is computed
    modes = linear.modes
    if not 0 <= mode < len(modes):
        raise refused("mode", f"got {mode}", f"there are {len(modes)}, from 0 on")
    turn = np.exp(1j * np.linspace(0.0, math.tau, FRAMES, endpoint=False))
    at = {
        driver: q + amplitude * (z * turn).real
        for (driver, q), z in zip(linear.at.items(), modes[mode].shape, strict=True)
    }
    made = Animation(moves(linear.mechanism, at))
    return made if path is None else made.save(path)
