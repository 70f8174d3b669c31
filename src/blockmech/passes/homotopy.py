"""Following a group without closed form from its home to a sample.

The pose of a general group at driver values q is the one reached from its home along the
straight line of driver values, by small steps: predict with the rates, correct with Newton,
shorten what needs a large correction or might have passed a dead centre. So an answer is
a function of the sample alone, in any order, batch or chunk. Groups that it hangs on and
that have no closed form either are followed along the same line.

A step is safe if the Jacobian, its rows of unit length, changes by less than its smallest
singular values at both ends: by Weyl's inequality no singular Jacobian lies between, so
another mode that comes near is not taken for this one, however near it comes.

With one driver all lines lie on one axis: *knots* along it are laid once, outward from
home and the same whoever asks. Between two of them a cubic of places and rates says where the links
stand, where it was seen to be so good a guess that Newton settles at that pose; other samples are
followed from the last knot before them. Behind a dead centre a crank's pose is that of whole turns
before, if the path leads there.

Sources: Allgower & Georg, Introduction to numerical continuation methods, 2003, ch. 2
(Euler-Newton predictor-corrector); Golub & Van Loan, Matrix Computations, 2013, 8.6
(perturbation of singular values).
"""

from __future__ import annotations

import math
import threading
from collections.abc import Hashable
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from blockmech.blocks.general import GeneralGroup
from blockmech.functions.roots import LONGEST_STEP
from blockmech.ground.errors import GraphError, Problem, listed
from blockmech.ground.memory import Recent
from blockmech.ground.plane import EPS
from blockmech.ground.tolerances import DOUBLE_ROOT
from blockmech.model.scene import Scene
from blockmech.model.structure import Structure
from blockmech.passes.tracking import CHANGE, GroupPose, Tracker, cubics, predicted, slopes
from blockmech.plan.plan import Friction, Schedule
from blockmech.plan.values import Value, tuple_of
from blockmech.typing import Floats, Values

CORRECTION = 0.03  # correction of a prediction up to which a step is taken, of `extent`
SMALLEST = (
    64 * EPS
)  # share of a line, or of knots, at which a path ends: a dead centre, to rounding
SURE = 0.01  # of the smallest singular value: a guess that is off by less is one of this mode
FAR = 50.0  # times the reach at home: a slide on its way to infinity is given up there
BEFORE = math.nextafter(1.0, 0.0)  # the largest share that is not all
MOST = 5000  # steps of a line, and knots on one side of home
LAYING = threading.RLock()  # knots are laid by one thread at a time: they grow from each other
MODES = 12  # turns of the driver on which a group may be in another mode each


def schedule(
    structure: Structure, scene: Scene, friction: Friction, static: bool = False
) -> Schedule:
    """A program to be made, which follows groups without closed form from their homes."""
    return Schedule(structure, scene, friction, static, guess=lambda s, b: s.ask(guess, b))


def guess(s: Schedule, block: str) -> Value:
    """The guess of a general group's pose: links' places, and the share of the path."""
    path = path_of(s.structure, block)
    return s.emit(path, tuple_of(s.input("q", d) for d in path.drivers), name=f"{block}_guess")


def path_of(structure: Structure, block: str) -> Path:
    """The path of a general group: one for all mechanisms that move it alike, with its knots."""
    with LAYING:
        if block not in structure.paths:
            structure.paths[block] = _shared(Path(structure, block))
        path: Path = structure.paths[block]
        return path


def _shared(path: Path) -> Path:
    """The path, or that of a mechanism before in which the same group moves alike."""
    structure, tracker = path.structure, path.tracker
    if structure.form is None:
        return path
    groups = map(structure.blocks.__getitem__, tracker.groups)
    homes = [group.home for group in groups if isinstance(group, GeneralGroup)]
    numbers = tuple(tracker.program.parameters.values())
    key = structure.form, path.block, numbers, repr(homes)
    return _PATHS.renew(key, _PATHS.get(key, path))


_PATHS = Recent[Hashable, "Path"]()


def followed(structure: Structure) -> tuple[str, ...]:
    """Groups without closed form, in formation order."""
    return tuple(name for name, block in structure.blocks.items() if block.own_form)


def refuse_open_homes(structure: Structure) -> None:
    """Raise `GraphError` for every general group that does not close at its home."""
    problems: list[Problem] = []
    for name in followed(structure):
        try:
            path_of(structure, name).at_home  # noqa: B018
        except GraphError as error:
            problems += error.problems
    if problems:
        raise GraphError(list(dict.fromkeys(problems)))


class Path:
    """Follows one general group, and those it hangs on, from its home.

    Called by programs with the driver values: numbers, or arrays (...). Programs of one state, such
    as its rows of the force pass, ask for one pose after each other.
    """

    _last: tuple[Values | None, Values] = (None, ())  # numbers asked for last, and their answer

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
        above = structure.ancestors(block)
        groups = [name for name in followed(structure) if name in above]
        self.tracker = Tracker(structure, groups, self.drivers)
        self.size = len(group.link_names)  # of its links, the last ones of the tracker

    def _problems(self) -> None:
        values = self.group.home.drivers
        missing = [d for d in self.drivers if d not in values]
        strange = [d for d in values if d not in self.drivers]
        if missing or strange:
            parts = [f"no value of {listed(missing)}"] * bool(missing)
            parts += [f"{listed(strange)} does not move it"] * bool(strange)
            valid = f"drivers that move it: {listed(self.drivers) or 'none'}"
            where = f"{self.block}.home.drivers"
            raise GraphError(Problem("bad-home", where, "; ".join(parts), valid))

    @cached_property
    def home(self) -> Floats:
        """Driver values at home (k,)."""
        return np.array([self.group.home.drivers[d] for d in self.drivers], float)

    @cached_property
    def at_home(self) -> GroupPose:
        """The refined pose at home, one sample; rates are those of a line that stands still.

        Raises `GraphError` where the links do not close there.
        """
        frames: list[tuple[float, float, float, float]] = []
        for name in self.tracker.groups:
            if name == self.block:
                rows = (self.group.home.poses[link] for link in self.group.link_names)
                frames += [(x, y, math.cos(a), math.sin(a)) for x, y, a in rows]
            else:
                frames += self._of_group(name)
        at_rest = np.zeros((1, len(self.drivers)))
        pose, first = self.tracker.at(self.home[None, :], at_rest, np.array([frames]), single=True)
        closes = np.isfinite(first).all() and (pose.nearest > DOUBLE_ROOT).all()
        if not (closes and self._is_near(np.array(frames), pose.frames[0])):
            raise GraphError(
                Problem(
                    "bad-home",
                    f"{self.block}.home",
                    "the pairs do not close near this pose, or close at a dead centre",
                    "home is a pose of the links [x, y, angle] and its driver values",
                    "give the poses of one assembled position; `decompose` finds them",
                )
            )
        return pose

    def _is_near(self, home: Floats, closed: Floats) -> bool:
        """Whether no link had to move by more than the whole group measures: a slip of units."""
        frames = closed[-self.size :]
        moved = np.abs(frames - home[-self.size :])[:, :2].max()
        extent = self.group.extent((frames[:, 0] + 1j * frames[:, 1]).tolist())
        return bool(moved <= (extent or math.inf))

    def _of_group(self, name: str) -> list[tuple[float, float, float, float]]:
        """Frames at home of a group that this one hangs on."""
        upstream = path_of(self.structure, name)
        links, _ = upstream(tuple(self.home[self.drivers.index(d)] for d in upstream.drivers))
        return [(float(x), float(y), float(c), float(s)) for x, y, c, s in links]

    def of(self, structure: Structure) -> Path:
        """That of the same group in another mechanism."""
        return path_of(structure, self.block)

    @property
    def answer(self) -> Values:
        """Numbers of the shape of an answer."""
        return ((0.0,) * 4,) * self.size, 0.0

    def __call__(self, q: Values) -> Values:
        """Places and directions of the group's links, and the share of the path (1: all)."""
        shape = np.broadcast_shapes(*(np.shape(x) for x in q)) if q else ()
        before, answer = self._last
        if not shape and q == before:
            return answer
        targets = np.empty((math.prod(shape), len(q)))
        for k, x in enumerate(q):
            targets[:, k] = np.broadcast_to(x, shape).ravel()
        frames, reached = self.follow(targets, single=not shape)
        frames = frames[:, -self.size :, :]
        if not shape:
            links = tuple(tuple(row) for row in frames[0].tolist())
            _, answer = self._last = q, (links, float(reached[0]))
            return answer
        columns = np.ascontiguousarray(np.moveaxis(frames, 0, -1)).reshape((self.size, 4, *shape))
        return tuple(tuple(link) for link in columns), reached.reshape(shape)

    def follow(self, q: Floats, single: bool = False) -> tuple[Floats, Floats]:
        """Frames (n, m, 4) near the poses at driver values (n, k), NaN where the path ends before,
        and the share of it (n,) that was possible; by the scalar engine for a ``single`` sample."""
        home, n = self.at_home, len(q)
        if not self.drivers:
            return np.repeat(home.frames, n, axis=0), np.ones(n)
        if len(self.drivers) == 1:
            return self.knots.follow(q[:, 0], single)
        start = np.repeat(self.home[None, :], n, axis=0)
        pose, _ = self.tracker.at(start, q - start, np.repeat(home.frames, n, axis=0), single)
        return travel(self, start, pose, q, single)

    @property
    def repeats(self) -> bool:
        """Whether a turn of the only driver, if it is a rotary one, ends at home again."""
        return not self.drivers or (len(self.drivers) == 1 and self.knots.turns == 1)

    @cached_property
    def knots(self) -> ContinuationNodes:
        """Poses along the axis of the only driver."""
        return ContinuationNodes(self)


def travel(
    path: Path, start: Floats, poses: GroupPose, end: Floats, single: bool
) -> tuple[Floats, Floats]:
    """Follow n samples from poses at their start (n, k) to their end along straight lines.

    Returns frames where they arrived, NaN where the line ends before, and the share of
    the line (n,) that was possible.
    """
    n, line = len(start), end - start
    finite = np.asarray(np.isfinite(line).all(axis=1))
    poses = poses.at(np.arange(n))  # a copy
    share, h = np.zeros(n), np.minimum(1.0, strides(poses.rate))
    active = finite.copy()
    for _ in range(MOST):
        now = np.flatnonzero(active)
        if not len(now):
            break
        remaining = 1.0 - share[now]
        last = h[now] >= remaining
        step = np.where(last, remaining, h[now])
        at = np.where(last, 1.0, share[now] + step)
        q = np.where(last[:, None], end[now], start[now] + at[:, None] * line[now])
        current = poses.at(now)
        frames = predicted(current.frames, current.rate, step)
        # Of where a line ends it need only be known that the last step is safe.
        before = current._replace(nearest=np.where(last[:, None], current.nearest, 0.0))
        pose, first = path.tracker.at(q, line[now], frames, single, before)
        room = room_for_step(path, current, pose, first)
        is_safe = room >= 1.0
        accepted = now[is_safe]
        poses.put(accepted, pose.at(is_safe))
        share[accepted] = at[is_safe]
        h[now] = step * growth(room)
        h[accepted] = np.minimum(h[accepted], strides(pose.rate[is_safe]))
        active[now] = (share[now] < 1.0) & (h[now] > SMALLEST)
    poses.frames[share < 1.0] = np.nan
    return poses.frames, np.where(finite, share, np.nan)


def room_for_step(path: Path, start: GroupPose, end: GroupPose, first: Floats) -> Floats:
    """How much longer each step (n,) might have been; below 1 it was too long, 0 if lost."""
    with np.errstate(divide="ignore", invalid="ignore"):
        room = np.sqrt(CORRECTION * extent(path, end) / first)
        change = np.sqrt(np.square(end.J - start.J).sum(axis=(2, 3)))
        room = np.minimum(room, (CHANGE * (start.nearest + end.nearest) / change).min(axis=1))
        room = np.where(end.reach <= FAR * path.at_home.reach, room, 0.0)
    return np.asarray(np.nan_to_num(room, nan=0.0, posinf=np.inf))


def extent(path: Path, pose: GroupPose) -> Floats:
    """What corrections (n,) are measured by [-]: size and radian, more where slides are far out."""
    moved = (pose.frames - path.at_home.frames)[..., :2] * path.tracker.weights[:, :2]
    displacement = 1.0 + np.abs(moved).max(axis=(1, 2), initial=0.0)
    return np.asarray(np.maximum(displacement, pose.reach))


def growth(room: Floats) -> Floats:
    """Factor (n,) from a step to the next one."""
    return np.clip(0.7 * room, 0.25, 4.0)


def strides(rate: Floats) -> Floats:
    """Share of the line (n,) in which no link turns further than a stride."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(LONGEST_STEP / np.abs(rate[..., 2]).max(axis=1, initial=0.0))


def last_good(path: Path, q: Floats) -> Floats:
    """Driver values (k,) of the last pose on the line from home to q, where that ends before."""
    if len(path.drivers) == 1:
        side = path.knots.sides[1 if q[0] >= path.home[0] else -1]
        return np.array([side.q[-1]])
    reached = path.follow(q[None, :], single=True)[1]
    return np.asarray(path.home + reached * (q - path.home))


class ContinuationNodes:
    """Poses of a path along its only driver, laid outward from home as far as asked."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.home = float(path.home[0])
        self.rotary = path.structure.driver_joint(path.drivers[0]).rotary
        frames, unit_rate = path.at_home.frames, np.ones((1, 1))
        start = path.tracker.at(path.home[None, :], unit_rate, frames, single=True)[0]
        unit = 1.0 if self.rotary else path.group.characteristic_length()
        self.sides = {sense: _Side(path, sense, start, unit) for sense in (1, -1)}

    def follow(self, q: Floats, single: bool) -> tuple[Floats, Floats]:
        """As `Path.follow`, for driver values (n,).

        Behind the end of an arc a crank stands where it also stands whole turns before:
        if that is on the arc, that is its pose.
        """
        q = self._folded(q)
        frames, reached = self._from_home(q, single)
        lost = np.flatnonzero(reached < 1.0)
        if not (self.rotary and len(lost)):
            return frames, reached
        behind = self.home + np.mod(q[lost] - self.home, math.tau)
        for same in (behind, behind - math.tau):
            alternative, share = self._from_home(same, single)
            better = share > reached[lost]
            frames[lost[better]], reached[lost[better]] = alternative[better], share[better]
        return frames, reached

    def _from_home(self, q: Floats, single: bool) -> tuple[Floats, Floats]:
        away = q - self.home
        frames = np.full((len(q), *self.path.at_home.frames.shape[1:]), np.nan)
        reached = np.where(np.isfinite(q), 0.0, np.nan)
        for sense, side in self.sides.items():
            on_side = np.flatnonzero(away * sense >= 0.0 if sense > 0 else away < 0.0)
            if len(on_side):
                frames[on_side], reached[on_side] = side.follow(q[on_side], away[on_side], single)
        return frames, reached

    def _folded(self, q: Floats) -> Floats:
        """Driver values of further turns, brought into the first ones where they repeat."""
        beyond = np.abs(q - self.home) >= math.tau
        if not (beyond.any() and self.turns):
            return q
        return np.where(beyond, self.home + np.mod(q - self.home, self.turns * math.tau), q)

    def laid(self, sense: int, reach: float) -> tuple[Floats, Floats, Floats]:
        """Driver values (k,) of the knots to one side of home (sense +1 or -1), as far as the
        driver's reach or the path's end, frames (k, m, 4) there and rates (k, m, 3)."""
        with LAYING:
            side = self.sides[sense]
            side._grow(reach)
            table = side._table()
        return table.q, table.poses.frames, table.poses.rate

    @cached_property
    def turns(self) -> int:
        """Turns of the driver after which the pose at home is back; 0 if the path ends."""
        if not self.rotary:
            return 0
        home = self.path.at_home.frames
        for k in range(1, MODES + 1):
            away = np.array([k * math.tau])
            q = self.home + away
            frames, _ = self.sides[1].follow(q, away, single=True)
            pose, _ = self.path.tracker.at(q[:, None], np.ones((1, 1)), frames, single=True)
            apart = np.abs(pose.frames - home).max(axis=0) * self.path.tracker.weights
            if not np.isfinite(apart).all():
                return 0
            if apart.max() < DOUBLE_ROOT:
                return k
        return 0


class _Side:
    """Knots to one side of home; ``unit`` is what the driver is measured by [rad or m]."""

    def __init__(self, path: Path, sense: int, start: GroupPose, unit: float) -> None:
        self.path, self.sense, self.unit = path, sense, unit
        self.q = [float(path.home[0])]
        self.poses = [start]
        self.ended = False
        self.step = unit
        self._laid: _Table | None = None

    def follow(self, q: Floats, away: Floats, single: bool) -> tuple[Floats, Floats]:
        """Frames and shares at driver values (n,) on this side."""
        with LAYING:
            self._grow(float(np.abs(away).max()))
            table, is_complete = self._table(), self.ended
        knots = table.q
        if is_complete:  # one end for all samples
            q = np.where((q - knots[-1]) * self.sense > 0.0, np.nan, q)
        k = np.searchsorted(knots * self.sense, q * self.sense, side="right") - 1
        frames, reached = table.guess(k, q), np.ones(len(q))
        if len(rest := np.flatnonzero(~table.sure[k])):
            start, end = knots[k[rest]], q[rest]
            line, poses = end - start, table.poses.at(k[rest])
            poses = poses._replace(rate=poses.rate * line[:, None, None])
            frames[rest], share = travel(self.path, start[:, None], poses, end[:, None], single)
            with np.errstate(invalid="ignore", divide="ignore"):
                last = np.where(np.isnan(end), knots[-1], start + share * line)
                part = np.minimum((last - self.path.home[0]) / away[rest], BEFORE)
                reached[rest] = np.where(share >= 1.0, 1.0, part)
        return frames, reached

    def _grow(self, reach: float) -> None:
        """Lay knots until one is further from home than ``reach``; each by its forerunner."""
        path, home, unit_rate = self.path, float(self.path.home[0]), np.ones((1, 1))
        while not self.ended and abs(self.q[-1] - home) <= reach:
            if len(self.q) > MOST:  # each as short as ever: parts of very unlike sizes
                self.ended = True
                return
            pose = self.poses[-1]
            step = min(self.step, float(strides(pose.rate)[0]))
            while True:
                q = np.array([[self.q[-1] + self.sense * step]])
                frames = predicted(pose.frames, pose.rate, np.array([self.sense * step]))
                end, first = path.tracker.at(q, unit_rate, frames, single=True)
                room = room_for_step(path, pose, end, first)
                if room[0] >= 1.0:
                    break
                step *= float(growth(room)[0])
                if step < SMALLEST * max(self.unit, abs(self.q[-1])):
                    self.ended = True
                    return
            self.q.append(float(q[0, 0]))
            self.poses.append(end)
            self.step = step * float(growth(room)[0])
            self._laid = None

    def _table(self) -> _Table:
        if self._laid is None:
            self._laid = _Table.of(self.path, np.array(self.q), GroupPose.joined(self.poses))
        return self._laid


class _Table(NamedTuple):
    """Poses at k knots q, and between them cubics of frames, the highest power first.

    rows : (4, k, m, 4), sure : (k,) whether the cubic from a knot to the next one is a good guess
    """

    q: Floats
    poses: GroupPose
    rows: Floats
    sure: NDArray[np.bool_]

    @classmethod
    def of(cls, path: Path, q: Floats, poses: GroupPose) -> _Table:
        """Each cubic is held against the pose in its middle."""
        rows = np.zeros((4, *poses.frames.shape))
        rows[:, :-1] = cubics(q, poses.frames, slopes(poses.frames, poses.rate))
        table, k = cls(q, poses, rows, np.zeros(len(q), bool)), np.arange(len(q) - 1)
        if len(k):
            middle = (q[:-1] + q[1:]) / 2
            unit_rate = np.ones((len(k), 1))
            pose, first = path.tracker.at(middle[:, None], unit_rate, table.guess(k, middle))
            nearest = np.minimum(pose.nearest, np.minimum(poses.nearest[:-1], poses.nearest[1:]))
            table.sure[:-1] = first <= SURE * nearest.min(axis=1)
        return table

    def guess(self, k: NDArray[np.intp], q: Floats) -> Floats:
        """Frames (n, m, 4) at driver values (n,) behind knots."""
        x = (q - self.q[k])[:, None, None]
        total: Floats = self.rows[0, k]
        for row in self.rows[1:]:
            total = total * x + row[k]
        return total
