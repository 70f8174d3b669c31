"""A mode of vibration in motion."""

from __future__ import annotations

import math

import numpy as np

from blockmech.design.linearize import SWING, Linearization
from blockmech.draw.animation import RATE, Animation
from blockmech.draw.motion import moves
from blockmech.figures.paper import MOVING, suffix_of
from blockmech.ground.errors import refused
from blockmech.ground.files import AnyPath


def animate(
    linear: Linearization, mode: int = 0, path: AnyPath | None = None, *, amplitude: float = SWING
) -> Animation:
    """One mode in motion: its shape, swinging about the pose.

    Parameters
    ----------
    mode : which of `modes`
    path : a .gif, .html or .mp4 file
    amplitude : [rad or m] of the driver that swings most

    Raises `RequestError` for a mode that there is not, and the errors of a run where the
    amplitude leaves the range in which the mechanism closes.
    """
    if path is not None:
        suffix_of(path, "an animation", MOVING)  # before anything is computed
    modes = linear.modes
    if not 0 <= mode < len(modes):
        raise refused("mode", f"got {mode}", f"there are {len(modes)}, from 0 on")
    turn = np.exp(1j * np.linspace(0.0, math.tau, 2 * RATE, endpoint=False))
    at = {
        driver: q + amplitude * (z * turn).real
        for (driver, q), z in zip(linear.at.items(), modes[mode].shape, strict=True)
    }
    film = Animation(moves(linear.mechanism, at))
    return film if path is None else film.save(path)
