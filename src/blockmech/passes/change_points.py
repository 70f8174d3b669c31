"""Change points of the dyads whose branch follows the motion, found once per mechanism.

At a change point the determinant of a dyad goes through zero. A pose tells its size only,
which has a corner there, but the square is smooth: change points are minima of its Chebyshev
series. At a minimum the size, taken negative on one side, is smooth as well if it is a change
point, and that is where this series is zero, to about 1e-14 rad. A determinant that only
comes near zero, or touches it, has no such series.

Source: the search is blockmech's own.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from blockmech.blocks.modes import TwoModes
from blockmech.engines.interpreters import NumpyEngine
from blockmech.functions.roots import SCANNED
from blockmech.functions.series import GOLDEN, NODES, Series, fit, panels
from blockmech.ground.errors import GraphError, Problem
from blockmech.ground.tolerances import DOUBLE_ROOT
from blockmech.model.scene import Scene
from blockmech.model.structure import FollowedBranch, Structure
from blockmech.passes.forward import position
from blockmech.passes.homotopy import schedule
from blockmech.plan.plan import Friction, Schedule
from blockmech.typing import Floats

SEAM = -math.pi / 2  # where the scan of a turn begins
# Spacings on either side that a series covers. From further away larger misses look like rounding:
# from the first those of lengths that are off by some 1e-13, as lengths of twelve digits are.
REACHES = (6.0, 2.5, 1.2)
AT_HOME = 1e-3  # of the largest determinant: below it home is at a change point
TRAVEL = 2.0  # sizes of the mechanism to which a slide is searched on either side


class _Search(NamedTuple):
    """The size of a dyad's determinant along its driver, and where to look for zeros."""

    size: Callable[[Floats], Floats]
    low: float
    high: float
    rotary: bool

    @property
    def spacing(self) -> float:
        """Distance [rad or m] of the samples of a scan."""
        return (self.high - self.low) / SCANNED


def with_followed(structure: Structure, scene: Scene) -> Structure:
    """The structure with the change points of its dyads that follow.

    Raises `GraphError` where a home cannot be assembled or is itself a change point.
    """
    followed_structure, problems = structure, list[Problem]()
    wrong: set[str] = set()
    last, upstream = "", schedule(structure, scene, Friction("none"))
    for name, block in structure.blocks.items():
        if not (isinstance(block, TwoModes) and block.follows and (home := block.home)):
            continue
        if wrong & structure.ancestors(name):
            continue  # nothing is known of what stands on a wrong home
        ((driver, q_home),) = home.drivers.items()
        shared = {p for x in followed_structure.followed.values() for p in x.points}
        if last in structure.ancestors(name):  # what moves it goes on from there
            upstream.structure = followed_structure
            upstream.ask(position, last)
        else:
            upstream = schedule(followed_structure, scene, Friction("none"))
        last, s = name, upstream.copied()
        plain = {**followed_structure.followed, name: FollowedBranch(driver)}
        s.structure = replace(followed_structure, followed=plain)
        search = _search(s, name, driver, q_home)
        square, at_home, largest = _squared_determinant(search, q_home)
        if not at_home > AT_HOME * largest:
            problems.append(_no_home(name, driver, q_home, at_home))
            wrong.add(name)
            continue
        points = tuple(sorted(_change_points(search, square, shared)))
        sides = (_side(q_home, p, search.rotary) for p in points)
        first = home.branch * math.prod(sides)
        scale = 1.0 if search.rotary else (search.high - search.low) / 2
        branch = FollowedBranch(driver, points, first, scale)
        followed_structure = replace(
            followed_structure, followed={**followed_structure.followed, name: branch}
        )
    GraphError.raise_for(problems)
    return followed_structure


def _search(s: Schedule, block: str, driver: str, q_home: float) -> _Search:
    program = s.program([s.ask(position, block).det])
    engine = NumpyEngine(program)

    def size(q: Floats) -> Floats:
        sizes = engine.run(dict.fromkeys(program.inputs, q), q.size)[0]
        return np.asarray(np.abs(np.asarray(sizes, dtype=float)))

    if s.structure.driver_joint(driver).rotary:
        low = SEAM + GOLDEN * math.tau / SCANNED
        return _Search(size, low, low + math.tau, True)
    reach = TRAVEL * sum(b.largest_length() for b in s.structure.blocks.values())
    return _Search(size, q_home - reach, q_home + reach, False)


def _side(q: float, point: float, rotary: bool) -> float:
    return math.copysign(1.0, math.sin((q - point) / 2) if rotary else q - point)


def _no_home(block: str, driver: str, q: float, size: float) -> Problem:
    state = "stands at a change point" if math.isfinite(size) else "does not close"
    message = f"the dyad {state} at {driver} = {q:.9g}, so its branch there means nothing"
    remedy = "name a pose in which both its modes exist and differ"
    return Problem("bad-home", f"{block}.home", message, "", remedy)


def _squared_determinant(search: _Search, q_home: float) -> tuple[Series, float, float]:
    """The series of the determinant's square; its size at home, and the largest that was seen."""
    sizes: list[Floats] = []

    def squared(q: Floats) -> Floats:
        sizes.append(search.size(np.append(q, q_home)))
        return np.asarray(sizes[-1][:-1] ** 2)

    square = fit(squared, panels(search.low, search.high, SCANNED // NODES))
    return square, float(sizes[0][-1]), float(np.nanmax(sizes[0], initial=0.0))


def _change_points(search: _Search, square: Series, shared: set[float]) -> Iterator[float]:
    """Change points among the minima of the determinant's square."""
    extremes = square.extrema()
    sides = np.minimum(square(extremes - search.spacing), square(extremes + search.spacing))
    minima = extremes[~(square(extremes) > sides)]  # NaN on one side decides nothing
    points = [x for guess in minima.tolist() if (x := _root(search, guess)) is not None]
    for point in points:
        x = SEAM + (point - SEAM) % math.tau if search.rotary else point
        yield next((k for k in shared if abs(k - x) <= DOUBLE_ROOT * search.spacing), x)
    if search.rotary and len(points) % 2:
        edges = panels(search.low, search.high, SCANNED)
        gap = np.isnan(search.size(edges))
        if gap.any():
            # the driver does not turn fully: a turn further on the same pose is the same mode
            yield float(edges[_middle_of_longest_run(gap[:-1])])


def _root(search: _Search, guess: float) -> float | None:
    """The zero that the determinant goes through near a guess, or None if it is not smooth."""

    def signed(q: Floats) -> Floats:
        return np.asarray(np.copysign(search.size(q), q - guess))

    for reach in REACHES:
        ends = guess + reach * search.spacing * np.array([-1.0, 1.0])
        series = fit(signed, ends, n=NODES // 2, levels=0)
        if series.resolved[0]:
            roots = series.roots()
            return float(roots[np.argmin(np.abs(roots - guess))]) if roots.size else None
    return None


def _middle_of_longest_run(gap: Floats) -> int:
    """Index of the middle of the longest run of True on a circle."""
    n, first = gap.size, int(np.argmin(gap))
    turned = np.roll(gap, -first)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], turned.astype(int), [0]])))
    runs = edges.reshape(-1, 2)
    start, end = runs[int(np.argmax(runs[:, 1] - runs[:, 0]))].tolist()
    return int((first + (start + end) // 2) % n)
