"""Following a group without closed form from its home to a sample.

The pose of a general group at driver values q is the one reached from its home along the
straight line of driver values, by small steps: predict with the rates, correct with
Newton, halve what needs a large correction or turns the determinant's sign. So an answer
is a function of the sample alone, in any order, batch or chunk. Groups that it hangs on
and that have no closed form either are followed along the same line.

With one driver all lines lie on one axis: *knots* along it are laid once, outward from
home and the same whoever asks, and a sample starts from the last one before it.

Sources: Allgower & Georg, Introduction to numerical continuation methods, 2003, ch. 2
(Euler-Newton predictor-corrector).
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from blockmech.blocks.general import GeneralGroup
from blockmech.blocks.general.kernels import orientation
from blockmech.errors import GraphError, Problem, listed
from blockmech.model.scene import Scene
from blockmech.model.structure import LinkRef, Structure
from blockmech.passes.forward import (
    ACTUAL,
    link_position,
    link_velocity,
    moves,
    parameters,
    position,
)
from blockmech.plan import Friction, Schedule

if TYPE_CHECKING:
    from blockmech.engines import NumpyEngine, ScalarEngine

Array = NDArray[Any]
TURN = 2 * math.pi
CORRECTION = 0.03  # [-] correction of a predicted pose up to which a step is taken
STRIDE = 0.3  # [-] motion of a link in one step: radians, or sizes of the group
SMALLEST = 1e-10  # share of a line below which a step is given up: the path ends there
END = 1e-14  # [-] step of knots at which their side ends: a dead centre, to rounding
BEFORE = 1.0 - 1e-16  # the largest share that is not all
MOST = 5000  # steps of a line
SAME = 1e-9  # [-] difference of poses that are one pose


class Stand(NamedTuple):
    """Poses of all followed links at n samples, with their rates along the line.

    place : (n, m, 4) [m, -] origin and direction of each link
    rate : (n, m, 3) [m, rad] of origin and angle by the share of the line
    """

    place: Array
    rate: Array


def guess(s: Schedule, block: str) -> str:
    """The guess of a general group's pose: links' places, and the share of the path."""
    path = path_of(s.structure, block)
    q = "".join(f"{s.input('q', d)}, " for d in path.drivers)
    return s.emit(path, f"({q})", name=f"{block}_guess")


def path_of(structure: Structure, block: str) -> Path:
    """The path of a general group; made once for a structure, so knots are laid once."""
    if block not in structure.paths:
        structure.paths[block] = Path(structure, block)
    found: Path = structure.paths[block]
    return found


def followed(structure: Structure) -> tuple[str, ...]:
    """Groups without closed form, in formation order."""
    return tuple(name for name, block in structure.blocks.items() if block.own_form)


def refuse_open_homes(structure: Structure) -> None:
    """Raise `GraphError` for every general group that does not close at its home."""
    problems = []
    for name in followed(structure):
        try:
            path_of(structure, name).at_home  # noqa: B018
        except GraphError as error:
            problems += error.problems
    if problems:
        raise GraphError(list(dict.fromkeys(problems)))


class Path:
    """Follows one general group, and those it hangs on, from its home.

    Called by programs with the driver values: numbers, or arrays (...).
    """

    def __init__(self, structure: Structure, block: str) -> None:
        self.__name__ = f"path_{block}"
        self.block = block
        self.structure = structure
        group = structure.blocks[block]
        assert isinstance(group, GeneralGroup)
        self.group = group
        upstream = structure.upstream[block]
        self.drivers = tuple(d for d in structure.drivers if d in upstream)
        self._problems()
        self.tracker = Tracker(structure, block, self.drivers)
        self.own = len(group.link_names)  # the last links of the state

    def _problems(self) -> None:
        given = self.group.home.drivers
        missing = [d for d in self.drivers if d not in given]
        strange = [d for d in given if d not in self.drivers]
        if missing or strange:
            found = [f"no value of {listed(missing)}"] * bool(missing)
            found += [f"{listed(strange)} does not move it"] * bool(strange)
            valid = f"drivers that move it: {listed(self.drivers) or 'none'}"
            where = f"{self.block}.home.drivers"
            raise GraphError(Problem("bad-home", where, "; ".join(found), valid))

    @cached_property
    def home(self) -> Array:
        """Driver values at home (k,)."""
        return np.array([self.group.home.drivers[d] for d in self.drivers], float)

    @cached_property
    def at_home(self) -> Stand:
        """The refined pose at home, one sample; rates are those of a line that stands still.

        Raises `GraphError` where the links do not close there.
        """
        places: list[tuple[float, float, float, float]] = []
        for name in self.tracker.groups:
            if name == self.block:
                rows = (self.group.home.poses[link] for link in self.group.link_names)
                places += [(x, y, math.cos(a), math.sin(a)) for x, y, a in rows]
            else:
                places += self._of_another(name)
        still = np.zeros((1, len(self.drivers)))
        found, first, sign = self.tracker.at(self.home[None, :], still, np.array([places]))
        if not (np.isfinite(first).all() and np.isfinite(sign).all() and sign.all()):
            raise GraphError(
                Problem(
                    "bad-home",
                    f"{self.block}.home",
                    "the pairs do not close near this pose, or close at a dead centre",
                    "home is a pose of the links [x, y, angle] and its driver values",
                    "give the poses of one assembled position; `decompose` finds them",
                )
            )
        self.sign = sign
        return found

    def _of_another(self, name: str) -> list[tuple[float, float, float, float]]:
        other = path_of(self.structure, name)
        q = tuple(self.home[self.drivers.index(d)] for d in other.drivers)
        links, _ = other(q)
        return [(float(x), float(y), float(c), float(s)) for x, y, c, s in links]

    def __call__(self, q: tuple[Any, ...]) -> Any:
        """Places and directions of the group's links, and the share of the path (1: all)."""
        shape = np.broadcast_shapes(*(np.shape(x) for x in q)) if q else ()
        wanted = np.empty((math.prod(shape), len(q)))
        for k, x in enumerate(q):
            wanted[:, k] = np.broadcast_to(x, shape).ravel()
        place, reached = self.follow(wanted)
        own = place[:, -self.own :, :]
        if not shape:
            links = tuple(tuple(row) for row in own[0].tolist())
            return links, float(reached[0])
        columns = np.ascontiguousarray(np.moveaxis(own, 0, -1)).reshape((self.own, 4, *shape))
        return tuple(tuple(link) for link in columns), reached.reshape(shape)

    def follow(self, q: Array) -> tuple[Array, Array]:
        """Places (n, m, 4) at driver values (n, k), NaN where the path ends before, and
        the share of it (n,) that was possible."""
        home = self.at_home
        if not self.drivers:
            return np.repeat(home.place, len(q), axis=0), np.ones(len(q))
        if len(self.drivers) == 1:
            return self.knots.follow(q[:, 0])
        start = np.repeat(self.home[None, :], len(q), axis=0)
        _, rate = self._rates(start, q - start, np.repeat(home.place, len(q), axis=0))
        stand = Stand(np.repeat(home.place, len(q), axis=0), rate)
        found, reached = travel(self, start, stand, q)
        return found.place, reached

    def _rates(self, q: Array, line: Array, place: Array) -> Stand:
        return self.tracker.at(q, line, place)[0]

    @property
    def repeats(self) -> bool:
        """Whether a turn of the only driver, if it is a rotary one, ends at home again."""
        return not self.drivers or (len(self.drivers) == 1 and self.knots.repeats)

    @cached_property
    def knots(self) -> Knots:
        """Poses along the axis of the only driver."""
        return Knots(self)


def travel(path: Path, start: Array, stand: Stand, end: Array) -> tuple[Stand, Array]:
    """Follow n samples from their start (n, k) to their end along straight lines.

    Returns where they arrived, places NaN where the line ends before, and the share of
    the line (n,) that was gone.
    """
    n, line = len(start), end - start
    place, rate = stand.place.copy(), stand.rate.copy()
    gone, h = np.zeros(n), np.ones(n)
    active = np.isfinite(line).all(axis=1)
    h = np.minimum(h, strides(path, rate))
    for _ in range(MOST):
        now = np.flatnonzero(active)
        if not len(now):
            break
        left = 1.0 - gone[now]
        last = h[now] >= left
        step = np.where(last, left, h[now])
        at = np.where(last, 1.0, gone[now] + step)
        q = np.where(last[:, None], end[now], start[now] + at[:, None] * line[now])
        found, first, sign = path.tracker.at(q, line[now], predicted(place[now], rate[now], step))
        good = (first <= CORRECTION) & (sign == path.sign).all(axis=1)
        taken = now[good]
        place[taken], rate[taken], gone[taken] = found.place[good], found.rate[good], at[good]
        growth = np.where(good, 0.7 * np.sqrt(CORRECTION / np.maximum(first, 1e-6)), 0.25)
        h[now] = step * np.clip(np.nan_to_num(growth, nan=0.25), 0.25, 4.0)
        h[taken] = np.minimum(h[taken], strides(path, rate[taken]))
        active[now] = (gone[now] < 1.0) & (h[now] > SMALLEST)
    place[gone < 1.0] = np.nan
    return Stand(place, rate), np.where(np.isfinite(line).all(axis=1), gone, np.nan)


def predicted(place: Array, rate: Array, step: Array) -> Array:
    """Places after a step with constant rates."""
    moved = np.empty_like(place)
    moved[..., :2] = place[..., :2] + step[:, None, None] * rate[..., :2]
    turn = step[:, None] * rate[..., 2]
    c, s = np.cos(turn), np.sin(turn)
    moved[..., 2] = c * place[..., 2] - s * place[..., 3]
    moved[..., 3] = s * place[..., 2] + c * place[..., 3]
    return moved


def strides(path: Path, rate: Array) -> Array:
    """Share of the line (n,) in which no link moves further than a stride."""
    speed = np.abs(rate) * path.tracker.weights
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(STRIDE / speed.max(axis=(1, 2), initial=0.0))


class Knots:
    """Poses of a path along its only driver, laid outward from home as far as asked."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.home = float(path.home[0])
        self.rotary = path.structure.driver_joint(path.drivers[0]).rotary
        one = np.ones((1, 1))
        start = path.tracker.at(path.home[None, :], one, path.at_home.place)[0]
        self.sides = {way: _Side(path, way, start) for way in (1, -1)}

    def follow(self, q: Array) -> tuple[Array, Array]:
        """As `Path.follow`, for driver values (n,)."""
        q = self._folded(q)
        away = q - self.home
        place = np.full((len(q), *self.path.at_home.place.shape[1:]), np.nan)
        reached = np.where(np.isfinite(q), 0.0, np.nan)
        for way, side in self.sides.items():
            here = np.flatnonzero(away * way >= 0.0 if way > 0 else away < 0.0)
            if len(here):
                place[here], reached[here] = side.follow(q[here], away[here])
        return place, reached

    def _folded(self, q: Array) -> Array:
        """Driver values of further turns, brought into the first one where it repeats."""
        far = np.abs(q - self.home) >= TURN
        if not (far.any() and self.repeats):
            return q
        return np.where(far, self.home + np.mod(q - self.home, TURN), q)

    @cached_property
    def repeats(self) -> bool:
        """Whether a turn of the driver ends in the pose at home."""
        if not self.rotary:
            return False
        place, _ = self.sides[1].follow(np.array([self.home + TURN]), np.array([TURN]))
        scaled = (place - self.path.at_home.place)[..., :2] * self.path.tracker.weights[..., :2]
        turned = (place - self.path.at_home.place)[..., 2:]
        return bool(np.abs(scaled).max() < SAME and np.abs(turned).max() < SAME)


class _Side:
    """Knots to one side of home."""

    def __init__(self, path: Path, way: int, start: Stand) -> None:
        self.path, self.way = path, way
        self.q = [float(path.home[0])]
        self.stands = [start]
        self.ended = False
        self.step = 1.0
        self._laid: tuple[Array, Stand] | None = None

    def follow(self, q: Array, away: Array) -> tuple[Array, Array]:
        """Places and shares at driver values (n,) on this side."""
        self._grow(float(np.abs(away).max()))
        knots, stands = self._arrays()
        if self.ended:  # one end for all who ask
            q = np.where((q - knots[-1]) * self.way > 0.0, np.nan, q)
        k = np.searchsorted(knots * self.way, q * self.way, side="right") - 1
        start = knots[k]
        line = q - start
        stand = Stand(stands.place[k], stands.rate[k] * line[:, None, None])
        found, share = travel(self.path, start[:, None], stand, q[:, None])
        with np.errstate(invalid="ignore", divide="ignore"):
            gone = np.where(np.isnan(q), knots[-1], start + share * line) - self.path.home[0]
            return found.place, np.where(share >= 1.0, 1.0, np.minimum(gone / away, BEFORE))

    def _grow(self, reach: float) -> None:
        """Lay knots until one is further from home than ``reach``; each by its forerunner."""
        path, home = self.path, float(self.path.home[0])
        while not self.ended and abs(self.q[-1] - home) <= reach and len(self.q) < MOST * 20:
            stand = self.stands[-1]
            limit = float(strides(path, stand.rate)[0])
            step = min(self.step, limit)
            while True:
                q = np.array([[self.q[-1] + self.way * step]])
                ahead = predicted(stand.place, stand.rate, np.array([self.way * step]))
                found, first, sign = path.tracker.at(q, np.ones((1, 1)), ahead)
                if first[0] <= CORRECTION and (sign == path.sign).all():
                    break
                step /= 4
                if step < END * max(1.0, abs(home)):
                    self.ended = True
                    return
            self.q.append(float(q[0, 0]))
            self.stands.append(found)
            self.step = step * min(4.0, 0.7 * math.sqrt(CORRECTION / max(float(first[0]), 1e-6)))
            self._laid = None

    def _arrays(self) -> tuple[Array, Stand]:
        if self._laid is None:
            place = np.concatenate([s.place for s in self.stands])
            rate = np.concatenate([s.rate for s in self.stands])
            self._laid = np.array(self.q), Stand(place, rate)
        return self._laid


class Tracker:
    """The program of one step: from guessed places to places, rates, and how Newton went."""

    def __init__(self, structure: Structure, block: str, drivers: tuple[str, ...]) -> None:
        above = structure.ancestors(block)
        self.groups = [name for name in followed(structure) if name in above]
        links = [LinkRef(n, k) for n in self.groups for k in structure.blocks[n].link_names]
        s = Schedule(structure, Scene(), Friction("none"), guess=_given)
        wanted, last = [], []
        for link in links:
            wanted += list(s.ask(link_position, link))
            if moves(s, link.block, ACTUAL):
                wanted += list(s.ask(link_velocity, link))
            else:
                wanted += ["ZERO", "0.0"]
        for name in self.groups:
            pose, p = s.ask(position, name), s.ask(parameters, name)
            last += [f"{pose}.first", s.emit(orientation, pose, p, name=f"{name}_sign")]
        self.program = s.program([*wanted, *last])
        self.links = links
        sizes = [structure.blocks[link.block].parameters().size for link in links]
        self.weights = np.array([[1 / x, 1 / x, 1.0] for x in sizes])
        columns = {f"q_{structure.drivers.index(d)}": ("q", k) for k, d in enumerate(drivers)}
        columns |= {f"qd_{structure.drivers.index(d)}": ("line", k) for k, d in enumerate(drivers)}
        for j, link in enumerate(links):
            for i, name in enumerate(_unknowns(s, link)):
                columns[name] = ("place", (j, i))  # type: ignore[assignment]
        self._columns = [columns[name] for name in self.program.inputs]

    @cached_property
    def _scalar(self) -> ScalarEngine:
        from blockmech.engines import ScalarEngine

        return ScalarEngine(self.program)

    @cached_property
    def _batch(self) -> NumpyEngine:
        from blockmech.engines import NumpyEngine

        return NumpyEngine(self.program)

    def at(self, q: Array, line: Array, place: Array) -> tuple[Stand, Array, Array]:
        """Corrected places with rates along the line, first corrections (n,), signs (n, g)."""
        n, m = len(q), len(self.links)
        data = {"q": q, "line": line, "place": place}
        given = [data[what][(slice(None), *np.atleast_1d(k))] for what, k in self._columns]
        if n == 1:
            values: Any = [np.array([v]) for v in self._scalar.one([float(x[0]) for x in given])]
        else:
            inputs = dict(zip(self.program.inputs, given, strict=True))
            values = self._batch.run(inputs, n)
        found = Stand(np.empty((n, m, 4)), np.empty((n, m, 3)))
        for j in range(m):
            o, e, v, om = values[4 * j : 4 * j + 4]
            found.place[:, j, 0], found.place[:, j, 1] = o.real, o.imag
            found.place[:, j, 2], found.place[:, j, 3] = e.real, e.imag
            found.rate[:, j, 0], found.rate[:, j, 1] = v.real, v.imag
            found.rate[:, j, 2] = om
        rest = values[4 * m :]
        first = np.max([np.asarray(x) for x in rest[0::2]], axis=0)
        return found, first, np.stack([np.asarray(x) for x in rest[1::2]], axis=1)


def _unknowns(s: Schedule, link: LinkRef) -> list[str]:
    """Names of the inputs that are a link's guessed place."""
    number = s.structure.links[link]
    return [f"{what}_{number}" for what in ("x", "y", "ex", "ey")]


def _given(s: Schedule, block: str) -> str:
    """The guess of a group's pose as inputs of the program."""
    links = (LinkRef(block, name) for name in s.structure.blocks[block].link_names)
    places = [f"({', '.join(s.unknown(x) for x in _unknowns(s, link))})" for link in links]
    return f"(({', '.join(places)},), 1.0)"
