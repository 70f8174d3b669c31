"""Newton's and Euler's laws link by link, with every force between links as an unknown.

Knows nothing of blocks, drivers or reductions: links with their motion as it is, and the lines
along which they push on each other. All unknown magnitudes follow from one linear system; an
unknown that the laws do not determine is told by the rank.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

RANK = 1e-10  # [-] of the largest singular value


@dataclass(frozen=True)
class Body:
    """A link: mass [kg], inertia [kg m2] about its centre, which is at `cm` and moves so."""

    mass: float
    inertia: float
    cm: complex
    a: complex = 0j  # [m/s2] of the centre of mass
    al: float = 0.0  # [rad/s2]
    force: complex = 0j  # [N] known, at the centre of mass
    couple: float = 0.0  # [N m] known


@dataclass(frozen=True)
class Push:
    """A force of unknown size along `way` [-] at a place [m], of one link on another.

    Without a way it is a couple of unknown size.
    """

    by: str
    on: str
    at: complex = 0j
    way: complex | None = None


def solved(bodies: Mapping[str, Body], pushes: Mapping[str, Push]) -> dict[str, float]:
    """Sizes [N or N m] of all pushes; "frame" is the link that balances itself."""
    names = list(bodies)
    rows, right = np.zeros((3 * len(names), len(pushes))), np.zeros(3 * len(names))
    for k, body in enumerate(bodies.values()):
        needed = body.mass * body.a - body.force
        right[3 * k : 3 * k + 3] = needed.real, needed.imag, body.inertia * body.al - body.couple
    for column, push in enumerate(pushes.values()):
        for link, sign in ((push.on, 1.0), (push.by, -1.0)):
            if link == "frame":
                continue
            k = names.index(link)
            if push.way is None:
                rows[3 * k + 2, column] += sign
                continue
            arm = push.at - bodies[link].cm
            rows[3 * k, column] += sign * push.way.real
            rows[3 * k + 1, column] += sign * push.way.imag
            rows[3 * k + 2, column] += sign * (np.conj(arm) * push.way).imag
    found, _, rank, _ = np.linalg.lstsq(rows, right, rcond=RANK)
    assert rank == len(pushes), "the laws do not determine all forces"
    assert np.abs(rows @ found - right).max() <= RANK * max(np.abs(right).max(), 1e-300)
    return dict(zip(pushes, map(float, found), strict=True))


def pin(by: str, on: str, at: complex, name: str) -> dict[str, Push]:
    """Both components of the force in a pin."""
    ways: Sequence[tuple[str, complex]] = (("x", 1 + 0j), ("y", 1j))
    return {f"{name}.{part}": Push(by, on, at, way) for part, way in ways}
