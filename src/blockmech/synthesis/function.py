r"""Function generation: four-bars whose rocker follows a function of the crank's angle.

Freudenstein's equation of a four-bar with frame 1 between the fixed pivots,

    K1 cos psi - K2 cos phi + K3 = cos(phi - psi),

is linear in K1 = frame/crank, K2 = frame/rocker, K3; where both angles are counted from is
sampled, and five positions are met exactly where they can be. The best are refined in what
counts, the angle of the rocker.

Sources: Freudenstein, Trans. ASME 77 (1955); Hartenberg & Denavit, Kinematic Synthesis of
Linkages, 1964, ch. 10.
"""

from __future__ import annotations

import numpy as np

from blockmech.ground.arguments import declared
from blockmech.ground.errors import refused
from blockmech.ground.progress import with_bar
from blockmech.synthesis.designs import Design, Synthesis, fourbar, proposed
from blockmech.synthesis.fourbar import SHAPE, angles_and_point
from blockmech.synthesis.search import STARTS, Task, monotonic, numbers_in_si
from blockmech.typing import Floats, Numbers, Progress


@with_bar
@declared
def function_generator(
    inputs: Numbers,
    outputs: Numbers,
    *,
    count: int = 5,
    starts: int = STARTS,
    seed: int = 0,
    progress: Progress | None = None,
) -> Synthesis:
    """Four-bars whose rocker has wanted angles at angles of the crank, the best first.

    Parameters
    ----------
    inputs : (n,) [rad] of the crank, rising or falling: coordinates of the driver
    outputs : (n,) [rad] of the rocker: ``dyad.j.angle``. The orientation of the linkage is free,
        so only their differences count
    count, starts, seed, progress : as those of `path_generator`

    Returns
    -------
    Synthesis of `Design`, whose output is ``dyad.j.angle`` of the graph, errors in rad; the frame
    is 1 m long, as lengths do not count

    Raises `RequestError` for fewer than three positions, or inputs that do not rise or fall.

    >>> found = function_generator([0.0, 0.4, 0.9, 1.3], [0.0, 0.1, 0.4, 0.8], starts=256)
    >>> found[0].output
    'dyad.j.angle'
    """
    remedy = "give three angles or more"
    psi = numbers_in_si("outputs", outputs, remedy, "rad")
    if psi.ndim != 1 or len(psi) < 3 or not np.ptp(psi) > 0:
        raise refused("outputs", f"got {outputs!r:.60}", remedy)
    phi = monotonic("inputs", inputs, len(psi))
    task = Task(swings=psi, angles=phi)
    name = "function_generator"

    def made(x: Floats, branch: int, margin: float) -> Design:
        zero, scale = x[SHAPE + 4], np.exp(-x[0])
        rocker = angles_and_point(x[:SHAPE], phi, np.asarray(branch))[2] + zero
        errors = np.abs(np.angle(np.exp(1j * (rocker - psi))))
        graph = fourbar(x[:4], complex(scale * np.exp(1j * zero)), 0j, branch, name)
        return Design(graph, phi, "dyad.j.angle", errors, margin)

    return proposed(task, count, starts, seed, progress, made)
