"""Path generation: four-bars whose coupler point passes through points."""

from __future__ import annotations

from typing import Any

import numpy as np

from blockmech.arguments import declared
from blockmech.errors import refused
from blockmech.series import Floats
from blockmech.synthesis.designs import Synthesis, design_of_path, proposed
from blockmech.synthesis.fourbar import Points
from blockmech.synthesis.search import STARTS, Task, monotonic
from blockmech.typing import Progress


@declared
def path_generator(
    points: Any,
    angles: Any = None,
    *,
    count: int = 5,
    starts: int = STARTS,
    seed: int = 0,
    progress: Progress | None = None,
) -> Synthesis:
    """Four-bars whose coupler point passes through points, the best first.

    Parameters
    ----------
    points : (n,) complex [m], or (n, 2), in the order in which they are passed; where the last
        is the first, the crank makes a full turn
    angles : (n,) [rad] that the crank turns to at them, counted from any start; by default the
        timing is free
    count : designs that are returned
    starts : shapes that are tried
    seed : of the shapes
    progress : called with how far it is: ``progress(what, done, whole)``

    Returns
    -------
    Synthesis of `Design`, whose output is ``dyad.P.p`` of the graph

    Raises `RequestError` for fewer than three points, or angles that do not rise or fall.

    >>> found = path_generator([0.0, 1.0 + 0.2j, 2.0, 3.0 - 0.1j], starts=256)
    >>> found[0].graph.name
    'path_generator'
    """
    P, theta = _path(points, angles)
    closed = theta is None and abs(P[-1] - P[0]) <= 1e-12 * float(np.abs(P).max())
    task = Task(points=P, angles=theta, closed=bool(closed))
    name = "path_generator"
    return proposed(
        task, count, starts, seed, progress, lambda *row: design_of_path(task, name, *row)
    )


def _path(points: Any, angles: Any) -> tuple[Points, Floats | None]:
    """Points and angles of a request. Raises `RequestError` for what is none."""
    try:
        P = np.asarray(points)
        P = P[:, 0] + 1j * P[:, 1] if P.ndim == 2 and P.shape[1] == 2 else P.astype(complex)
    except (TypeError, ValueError, IndexError):
        raise refused(
            "points", f"got {points!r:.60}", "give complex numbers, or rows x, y"
        ) from None
    if P.ndim != 1 or len(P) < 3 or not np.isfinite(P).all() or not np.ptp(np.abs(P - P[0])) > 0:
        raise refused("points", f"got {points!r:.60}", "give three points or more")
    return P, None if angles is None else monotonic("angles", angles, len(P))
