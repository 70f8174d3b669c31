"""One step of a path: from guessed places of groups without closed form to their poses.

The tracker runs a program of its own, made of the same rules as any other: its inputs are
driver values, a direction of the line that is followed, and a guess for every link.

Sources: Allgower & Georg, Introduction to numerical continuation methods, 2003, ch. 2.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from blockmech.ground.plane import SCALAR_CONSTANTS, SCALAR_PRIMITIVES
from blockmech.model.scene import Scene
from blockmech.model.structure import LinkRef, Structure
from blockmech.passes.forward import link_position, link_velocity, position
from blockmech.plan.plan import Friction, Schedule
from blockmech.plan.values import UNIT, Value, tuple_of

if TYPE_CHECKING:
    from blockmech.engines.numpy import NumpyEngine

Array = NDArray[Any]
# Of the smallest singular value, by which J may change with a last step known to be safe: that step
# would be by the exact value at the end as well, 2 c / (1 + c) for a share c = 0.7 of both ends.
CALM = 0.8


class GroupPose(NamedTuple):
    """Poses of all m links of the g followed groups at n samples, with their rates.

    place : (n, m, 4) [m, -] origin and direction of each link
    rate : (n, m, 3) [m, rad] of origin and angle by the share of the line
    J : (n, g, N, N) [-] Jacobians, their rows of unit length; zeros fill up smaller ones
    nearest : (n, g) [-] their smallest singular values: how near a singular one is
    reach : (n,) [-] the longest of their rows: at least 1, more where slides are far out
    """

    place: Array
    rate: Array
    J: Array
    nearest: Array
    reach: Array

    def at(self, samples: Any) -> GroupPose:
        """Some of the samples."""
        return GroupPose(*(x[samples] for x in self))

    def put(self, samples: Array, other: GroupPose) -> None:
        """Overwrite some of the samples."""
        for mine, theirs in zip(self, other, strict=True):
            mine[samples] = theirs

    @staticmethod
    def joined(stands: Sequence[GroupPose]) -> GroupPose:
        """All their samples, one after the other."""
        return GroupPose(*map(np.concatenate, zip(*stands, strict=True)))


class Tracker:
    """The program of one step: from guessed places to places, rates, J, and how Newton went."""

    def __init__(
        self, structure: Structure, groups: Sequence[str], drivers: tuple[str, ...]
    ) -> None:
        self.groups = groups
        links = [LinkRef(n, k) for n in self.groups for k in structure.blocks[n].link_names]
        s = Schedule(structure, Scene(), Friction("none"), guess=_given)
        wanted, last = [], []
        for link in links:
            wanted += list(s.ask(link_position, link))
            wanted += list(s.ask(link_velocity, link))
        for name in self.groups:
            pose = s.ask(position, name)
            last += [pose.first, pose.J]
        self.program = s.program([*wanted, *last])
        self.links = links
        sizes = [structure.blocks[link.block].parameters().size for link in links]
        self.weights = np.array([[1 / x, 1 / x, 1.0, 1.0] for x in sizes])
        columns = {f"q_{structure.drivers.index(d)}": ("q", k) for k, d in enumerate(drivers)}
        columns |= {f"qd_{structure.drivers.index(d)}": ("line", k) for k, d in enumerate(drivers)}
        for j, link in enumerate(links):
            for i, name in enumerate(_unknowns(s, link)):
                columns[name] = ("place", (j, i))  # type: ignore[assignment]
        self._columns = [columns[name] for name in self.program.inputs]

    @cached_property
    def _scalar(self) -> Any:
        from blockmech.engines.binding import bind

        return bind(self.program, SCALAR_PRIMITIVES, SCALAR_CONSTANTS)

    @cached_property
    def _batch(self) -> NumpyEngine:
        from blockmech.engines.numpy import NumpyEngine

        return NumpyEngine(self.program)

    def at(
        self,
        q: Array,
        line: Array,
        place: Array,
        one: bool = False,
        before: GroupPose | None = None,
    ) -> tuple[GroupPose, Array]:
        """Corrected places with rates along the line, and first corrections (n,).

        before : poses from which it is enough to know ``nearest`` from below, by Weyl's
            inequality, where J is much the same; of others theirs is 0
        """
        n, m = len(q), len(self.links)
        data = {"q": q, "line": line, "place": place}
        given = [data[what][(slice(None), *np.atleast_1d(k))] for what, k in self._columns]
        values = self._values(given, n, one)
        place, rate = np.empty((n, m, 4)), np.empty((n, m, 3))
        for j in range(m):
            o, e, v, om = values[4 * j : 4 * j + 4]
            place[:, j] = np.stack(np.broadcast_arrays(o.real, o.imag, e.real, e.imag), axis=-1)
            rate[:, j] = np.stack(np.broadcast_arrays(v.real, v.imag, om), axis=-1)
        rest = values[4 * m :]
        first = np.max([np.broadcast_to(x, (n,)) for x in rest[0::2]], axis=0)
        size = max(np.shape(x)[-1] for x in rest[1::2])
        J, nearest, reach = np.zeros((n, len(self.groups), size, size)), [], []
        for g, x in enumerate(rest[1::2]):
            whole = np.asarray(x).reshape((n, *np.shape(x)[-2:]))
            rows = np.sqrt(np.square(whole).sum(axis=-1))
            own = whole / rows[..., None]
            J[:, g, : own.shape[1], : own.shape[2]] = own
            if before is None:
                nearest.append(_smallest(own))
            else:
                nearest.append(_at_least(J[:, g], before.J[:, g], before.nearest[:, g], own))
            reach.append(rows.max(axis=-1))
        return GroupPose(place, rate, J, np.stack(nearest, axis=1), np.max(reach, axis=0)), first

    def _values(self, given: list[Array], n: int, one: bool) -> tuple[Any, ...]:
        if one:
            try:
                numbers = [float(x[0]) for x in given]
                values: tuple[Any, ...] = self._scalar(*numbers, self.program.parameters.values())
                return values
            except (ArithmeticError, ValueError):  # singular: the batch gives NaN
                pass
        inputs = dict(zip(self.program.inputs, given, strict=True))
        return self._batch.run(inputs, n, chunk=max(n, 1))


def _at_least(J: Array, old: Array, nearest: Array, own: Array) -> Array:
    """Bounds (n,) from below of the smallest singular values, exact where J is not much the same.

    The norm of the change is the larger one, of all entries: the decomposition takes ten times
    as long.
    """
    change = np.sqrt(np.square(J - old).sum(axis=(1, 2)))
    found: Array = nearest - change
    open_ = np.flatnonzero(~(change < CALM * nearest))
    if len(open_):
        found[open_] = _smallest(own[open_])
    return found


def _smallest(J: Array) -> Array:
    """The smallest singular value (n,) of each matrix; NaN where an entry is."""
    good: Array = np.asarray(np.isfinite(J).all(axis=(1, 2)))
    values = np.linalg.svd(np.where(good[:, None, None], J, 0.0), compute_uv=False)
    return np.where(good, values[:, -1], np.nan)


def _unknowns(s: Schedule, link: LinkRef) -> list[str]:
    """Names of the inputs that are a link's guessed place."""
    number = s.structure.links[link]
    return [f"{what}_{number}" for what in ("x", "y", "ex", "ey")]


def _given(s: Schedule, block: str) -> Value:
    """The guess of a group's pose as inputs of the program."""
    links = (LinkRef(block, name) for name in s.structure.blocks[block].link_names)
    places = tuple_of(tuple_of(map(s.unknown, _unknowns(s, link))) for link in links)
    return tuple_of((places, UNIT))
