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
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from blockmech.blocks.modes import TwoModes
from blockmech.engines.interpreters import NumpyEngine
from blockmech.functions.roots import SCANNED
from blockmech.functions.series import GOLDEN, NODES, Series, fit, panels
from blockmech.ground.errors import GraphError, Problem
from blockmech.ground.memory import Recent
from blockmech.ground.tolerances import DOUBLE_ROOT
from blockmech.model.scene import Scene
from blockmech.model.structure import FollowedBranch, LinkRef, Structure
from blockmech.passes.forward import Moved, link_position, position
from blockmech.passes.homotopy import schedule
from blockmech.plan.plan import Friction, Schedule
from blockmech.plan.values import NOUGHT, Value, planar
from blockmech.typing import Floats, Values

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


class _Chain:
    """Blocks along a driver, placed one after the other, each once for the same coordinates.

    Change points of dyads in a row stand together, so their searches ask for the same ones.

    structure : with the branches that are known so far
    """

    def __init__(self, structure: Structure, scene: Scene) -> None:
        self.structure, self.scene = structure, scene
        self._engines: dict[str, NumpyEngine] = {}
        self._poses: defaultdict[str, Recent[bytes, Values]] = defaultdict(Recent)

    def poses(self, block: str, q: Floats) -> Values:
        """Parts of origin and x axis of each link of a block at coordinates (n,), in a row."""
        above, question = self.structure.ancestors(block), q.tobytes()
        for name in self.structure.blocks:
            if name in above and question not in self._poses[name]:
                if name not in self._engines:
                    self._engines[name] = self.engine(name, self._frames)
                self._poses[name].renew(question, self.run(self._engines[name], name, q))
        return self._poses[block][question]

    def _frames(self, s: Schedule, block: str) -> Iterator[Value]:
        for link in self.structure.blocks[block].link_names:
            for x in s.ask(link_position, LinkRef(block, link)):
                yield from (x.real, x.imag)

    def engine(self, block: str, ask: Callable[[Schedule, str], Iterable[Value]]) -> NumpyEngine:
        """What computes a block alone: the poses of the links that it hangs on are inputs."""
        s = schedule(self.structure, self.scene, Friction("none"))
        for k, source in enumerate(self._sources(block)):
            s.settle(NOUGHT, position, source)
            for n, link in enumerate(self.structure.blocks[source].link_names):
                x = [s.unknown(f"x_{k}_{i}") for i in range(4 * n, 4 * n + 4)]
                pose = Moved(planar(*x[:2]), planar(*x[2:]))
                s.settle(pose, link_position, LinkRef(source, link))
        return NumpyEngine(s.program(ask(s, block)))

    def run(self, engine: NumpyEngine, block: str, q: Floats) -> Values:
        """Values (n,) of a block's program at driver coordinates."""
        inputs = dict.fromkeys(engine.program.inputs, q)
        for k, source in enumerate(self._sources(block)):
            inputs |= {f"x_{k}_{i}": x for i, x in enumerate(self.poses(source, q))}
        return engine.run(inputs, q.size)

    def _sources(self, block: str) -> list[str]:
        return [x for x in self.structure.sources(block) if x in self.structure.blocks]


def with_followed(structure: Structure, scene: Scene) -> Structure:
    """The structure with the change points of its dyads that follow.

    Raises `GraphError` where a home cannot be assembled or is itself a change point.
    """
    problems, chain = list[Problem](), _Chain(structure, scene)
    wrong: set[str] = set()
    for name, block in structure.blocks.items():
        if not (isinstance(block, TwoModes) and block.follows and (home := block.home)):
            continue
        if wrong & structure.ancestors(name):
            continue  # nothing is known of what stands on a wrong home
        ((driver, q_home),) = home.drivers.items()
        followed = chain.structure.followed
        shared = {p for x in followed.values() for p in x.points}
        plain = {**followed, name: FollowedBranch(driver)}
        chain.structure = replace(chain.structure, followed=plain)
        search = _search(chain, name, driver, q_home)
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
        chain.structure = replace(chain.structure, followed={**followed, name: branch})
    GraphError.raise_for(problems)
    return chain.structure


def _search(chain: _Chain, block: str, driver: str, q_home: float) -> _Search:
    engine, structure = chain.engine(block, lambda s, x: [s.ask(position, x).det]), chain.structure

    def size(q: Floats) -> Floats:
        sizes = chain.run(engine, block, q)[0]
        return np.asarray(np.abs(np.asarray(sizes, dtype=float)))

    if structure.driver_joint(driver).rotary:
        low = SEAM + GOLDEN * math.tau / SCANNED
        return _Search(size, low, low + math.tau, True)
    reach = TRAVEL * sum(b.largest_length() for b in structure.blocks.values())
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
