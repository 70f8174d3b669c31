"""Path generation: four-bars whose coupler point passes through points."""

from __future__ import annotations

import numpy as np

from blockmech.ground.arguments import declared
from blockmech.ground.progress import with_bar
from blockmech.synthesis.designs import Synthesis, design_of_path, proposed
from blockmech.synthesis.search import STARTS, Task, path_of
from blockmech.typing import Numbers, Points, Progress


@with_bar
@declared
def path_generator(
    points: Points,
    angles: Numbers | None = None,
    *,
    count: int = 5,
    starts: int = STARTS,
    seed: int = 0,
    progress: Progress | None = None,
) -> Synthesis:
    """Four-bars whose coupler point passes through points, the best first.

    Parameters
    ----------
    points : (n,) complex [m], or (n, 2), numbers or texts such as "80mm", in the order in which
        they are passed; where the last is the first, the crank makes a full turn
    angles : (n,) [rad] that the crank turns to at them, counted from any start; by default the
        timing is free
    count : designs that are returned
    starts : shapes that are tried
    seed : of the shapes
    progress : called as ``progress(task, completed, total)``

    Returns
    -------
    Synthesis of `Design`, whose output is ``dyad.P.p`` of the graph

    Raises `RequestError` for fewer than three points, or angles that do not rise or fall.

    >>> found = path_generator([0.0, 1.0 + 0.2j, 2.0, 3.0 - 0.1j], starts=256)
    >>> found[0].graph.name
    'path_generator'
    """
    P, theta = path_of(points, angles)
    closed = theta is None and abs(P[-1] - P[0]) <= 1e-12 * float(np.abs(P).max())
    task = Task(points=P, angles=theta, closed=bool(closed))
    name = "path_generator"
    return proposed(
        task, count, starts, seed, progress, lambda *row: design_of_path(task, name, *row)
    )
