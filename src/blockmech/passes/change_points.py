"""Change points of the dyads whose branch follows the motion, found once per mechanism.

Through a change point the determinant of a dyad goes like a smooth function that changes
sign; its size, which is all that a pose tells, has a corner there. So a local minimum of
the size is a change point if the size, taken negative on one side, is smooth: its
Chebyshev series through the point ends. The root of the series is the change point, to
about 1e-14 rad, though no pose nearer than 1e-2 is looked at: close to the point the
size has lost its digits.

Two change points between the same three samples of the scan are taken for none.

Source: the search is blockmech's own.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

from blockmech.blocks.modes import TwoModes
from blockmech.engines.numpy import NumpyEngine
from blockmech.errors import GraphError, Problem
from blockmech.model.scene import Scene
from blockmech.model.structure import FollowedBranch, Structure
from blockmech.passes.forward import position
from blockmech.passes.homotopy import schedule
from blockmech.plan import Friction
from blockmech.series import DOUBLE_ROOT, GOLDEN, SCANNED, Floats, coefficients, nodes

SEAM = -math.pi / 2  # where the scan of a turn begins
NODES = 16  # even, so that none is at the change point
REACHES = (12.0, 6.0, 2.5, 1.2)  # spacings on either side that a series covers
ENDED = 1e-10  # end of a series that is smooth
AT_HOME = 1e-3  # of the largest determinant: below it home is at a change point
TRAVEL = 2.0  # sizes of the mechanism to which a slide is searched on either side


class _Search(NamedTuple):
    """The size of a dyad's determinant along its driver, and where to look for zeros."""

    size: Callable[[Floats], Floats]
    nodes: Floats
    rotary: bool
    reach: float = 1.0  # [m] of a slide, on either side of home


def with_followed(structure: Structure, scene: Scene) -> Structure:
    """The structure with the change points of its dyads that follow.

    Raises `GraphError` where a home cannot be assembled or is itself a change point.
    """
    found, problems = structure, list[Problem]()
    wrong: set[str] = set()
    for name, block in structure.blocks.items():
        if not (isinstance(block, TwoModes) and block.follows):
            continue
        if wrong & structure.ancestors(name):
            continue  # nothing is known of what stands on a wrong home
        home: Any = block.home  # type: ignore[attr-defined]
        ((driver, q_home),) = home.drivers.items()
        known = {p for other in found.followed.values() for p in other.points}
        plain = {**found.followed, name: FollowedBranch(driver)}
        search = _search(replace(found, followed=plain), scene, name, driver, q_home)
        sizes = search.size(search.nodes)
        largest = float(np.nanmax(sizes, initial=0.0))
        at_home = float(search.size(np.array([q_home]))[0])
        if not at_home > AT_HOME * largest:
            problems.append(_no_home(name, driver, q_home, at_home))
            wrong.add(name)
            continue
        points = tuple(sorted(_points(search, sizes / largest, largest, known)))
        sides = (_side(q_home, p, search.rotary) for p in points)
        first = home.branch * math.prod(sides)
        here = FollowedBranch(driver, points, first, 1.0 if search.rotary else search.reach)
        found = replace(found, followed={**found.followed, name: here})
    if problems:
        raise GraphError(problems)
    return found


def _search(structure: Structure, scene: Scene, block: str, driver: str, q_home: float) -> _Search:
    made = schedule(structure, scene, Friction("none"))
    program = made.program([f"{made.ask(position, block)}.det"])
    engine = NumpyEngine(program)

    def size(q: Floats) -> Floats:
        found = engine.run(dict.fromkeys(program.inputs, q), q.size)[0]
        return np.asarray(np.abs(np.asarray(found, dtype=float)))

    steps: Floats = np.asarray(np.arange(SCANNED) + GOLDEN)
    if structure.driver_joint(driver).rotary:
        return _Search(size, np.asarray(SEAM + math.tau / SCANNED * steps), True)
    reach = TRAVEL * sum(b.largest_length() for b in structure.blocks.values())
    nodes: Floats = np.asarray(q_home + reach * (2 / SCANNED * steps - 1))
    return _Search(size, nodes, False, reach)


def _side(q: float, point: float, rotary: bool) -> float:
    return math.copysign(1.0, math.sin((q - point) / 2) if rotary else q - point)


def _no_home(block: str, driver: str, q: float, size: float) -> Problem:
    what = "stands at a change point" if math.isfinite(size) else "does not close"
    return Problem(
        "bad-home",
        f"{block}.home",
        f"the dyad {what} at {driver} = {q:.9g}, so its branch there means nothing",
        "",
        "name a pose in which both its modes exist and differ",
    )


def _points(search: _Search, y: Floats, largest: float, known: set[float]) -> Iterator[float]:
    """Change points among the local minima of the samples y (n,) of the relative size."""
    spacing = float(search.nodes[1] - search.nodes[0])
    low, high = np.roll(y, 1), np.roll(y, -1)
    with np.errstate(invalid="ignore"):
        minima = (y <= low) & (y < high)
    count = 0
    for i in np.flatnonzero(minima).tolist():
        if not search.rotary and not 2 <= i < y.size - 2:
            continue
        around = np.take(y, range(i - 2, i + 3), mode="wrap")
        guess = float(search.nodes[i]) + spacing * _corner(around)
        point = _root(search.size, guess, spacing, largest)
        if point is not None:
            count += 1
            if search.rotary:
                point = SEAM + (point - SEAM) % math.tau
            yield next((k for k in known if abs(k - point) <= DOUBLE_ROOT * spacing), point)
    gap = ~np.isfinite(y)
    if search.rotary and count % 2 and gap.any():
        # the driver does not turn fully: a turn further on the same pose is the same mode
        yield float(search.nodes[_middle(gap)])


def _corner(y: Floats) -> float:
    """Where lines through the two samples on either side meet, in spacings from the middle."""
    left, right = y[1] - y[0], y[4] - y[3]
    if not left < 0 < right:
        return 0.0
    return float(np.clip((y[1] - y[3] + left + right) / (right - left), -1.0, 1.0))


def _root(
    size: Callable[[Floats], Floats], guess: float, spacing: float, largest: float
) -> float | None:
    """The zero that the size goes through near a guess, or None if it is not smooth there."""
    x = nodes(NODES)
    for reach in REACHES:
        half = reach * spacing
        series = coefficients(np.sign(x) * size(guess + half * x) / largest)
        if not np.isfinite(series).all():
            continue
        if np.abs(series[-4:]).max() <= ENDED * np.abs(series).max():
            roots = chebyshev.chebroots(series)
            real = roots[np.abs(roots.imag) < DOUBLE_ROOT].real
            return guess + half * float(real[np.argmin(np.abs(real))]) if real.size else None
    return None


def _middle(gap: Floats) -> int:
    """Index of the middle of the longest run of True on a circle."""
    n, first = gap.size, int(np.argmin(gap))
    turned = np.roll(gap, -first)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], turned.astype(int), [0]])))
    runs = edges.reshape(-1, 2)
    start, end = runs[int(np.argmax(runs[:, 1] - runs[:, 0]))].tolist()
    return int((first + (start + end) // 2) % n)
