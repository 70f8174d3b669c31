"""One step of a path: from guessed places of groups without closed form to their poses.

The tracker runs a program of its own, made of the same rules as any other: its inputs are
driver values, a direction of the line that is followed, and a guess for every link.

Sources: Allgower & Georg, Introduction to numerical continuation methods, 2003, ch. 2.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from blockmech.engines.interpreters import NumpyEngine, ScalarEngine
from blockmech.model.scene import Scene
from blockmech.model.structure import LinkRef, Structure
from blockmech.passes.forward import link_position, link_velocity, position
from blockmech.plan.plan import Friction, Schedule
from blockmech.plan.recipes import program_of
from blockmech.plan.values import UNIT, Value, tuple_of
from blockmech.typing import Floats

# Of what the singular values allow: how much J may change in one step. Of the smallest one, by
# which it may with a last step known to be safe, which is so by the value at the end as well.
CHANGE = 0.7
CALM = 2 * CHANGE / (1 + CHANGE)


class GroupPose(NamedTuple):
    """Poses of all m links of the g followed groups at n samples, with their rates.

    frames : (n, m, 4) [m, -] origin and direction of each link
    rate : (n, m, 3) [m, rad] of origin and angle by the share of the line
    J : (n, g, N, N) [-] Jacobians, their rows of unit length; zeros fill up smaller ones
    nearest : (n, g) [-] their smallest singular values: how near a singular one is
    reach : (n,) [-] the longest of their rows: at least 1, more where slides are far out
    """

    frames: Floats
    rate: Floats
    J: Floats
    nearest: Floats
    reach: Floats

    def at(self, samples: NDArray[np.intp] | NDArray[np.bool_]) -> GroupPose:
        """Some of the samples."""
        return GroupPose(*(x[samples] for x in self))

    def put(self, samples: NDArray[np.intp], poses: GroupPose) -> None:
        """Overwrite some of the samples."""
        for column, update in zip(self, poses, strict=True):
            column[samples] = update

    @staticmethod
    def joined(poses: Sequence[GroupPose]) -> GroupPose:
        """All their samples, one after the other."""
        return GroupPose(*map(np.concatenate, zip(*poses, strict=True)))


def predicted(frames: Floats, rate: Floats, step: Floats) -> Floats:
    """Frames after a step with constant rates."""
    moved = np.empty_like(frames)
    moved[..., :2] = frames[..., :2] + step[:, None, None] * rate[..., :2]
    turn = step[:, None] * rate[..., 2]
    c, s = np.cos(turn), np.sin(turn)
    moved[..., 2] = c * frames[..., 2] - s * frames[..., 3]
    moved[..., 3] = s * frames[..., 2] + c * frames[..., 3]
    return moved


def slopes(frames: Floats, rates: Floats) -> Floats:
    """Rates (k, m, 4) of frames, from those of origins and angles."""
    slope = np.empty_like(frames)
    slope[..., :2] = rates[..., :2]
    slope[..., 2] = -frames[..., 3] * rates[..., 2]
    slope[..., 3] = frames[..., 2] * rates[..., 2]
    return slope


def cubics(knots: Floats, y: Floats, slope: Floats) -> Floats:
    """Coefficients (4, k - 1, ...) of Hermite's cubics, the highest power first."""
    h = np.diff(knots)[:, None, None]
    a, b = y[:-1], y[1:]
    s, t = slope[:-1], slope[1:]
    rise = (b - a) / h
    return np.stack([(s + t - 2 * rise) / h**2, (3 * rise - 2 * s - t) / h, s, a])


class Tracker:
    """The program of one step: from guessed places to places, rates, J, and how Newton went."""

    def __init__(
        self, structure: Structure, groups: Sequence[str], drivers: tuple[str, ...]
    ) -> None:
        self.groups = groups
        links = [LinkRef(n, k) for n in self.groups for k in structure.blocks[n].link_names]
        scene, question = Scene(), (Tracker, tuple(groups))

        def make() -> tuple[Schedule, list[Value], list[list[str]]]:
            s = Schedule(structure, scene, Friction("none"), guess=_guessed_frames)
            rules = link_position, link_velocity
            outputs = [x for link in links for rule in rules for x in s.ask(rule, link)]
            for name in groups:
                pose = s.ask(position, name)
                outputs += [pose.first, pose.J]
            return s, outputs, [_unknowns(s, link) for link in links]

        self.program, unknowns = program_of(structure, scene, question, make)
        self.links = links
        sizes = {name: structure.blocks[name].characteristic_length() for name in self.groups}
        weights = {name: [1 / x, 1 / x, 1.0, 1.0] for name, x in sizes.items()}
        self.weights = np.array([weights[link.block] for link in links])
        indices = {f"q_{structure.drivers.index(d)}": ("q", (k,)) for k, d in enumerate(drivers)}
        indices |= {
            f"qd_{structure.drivers.index(d)}": ("line", (k,)) for k, d in enumerate(drivers)
        }
        for j, names in enumerate(unknowns):
            for i, name in enumerate(names):
                indices[name] = "frames", (j, i)  # type: ignore[assignment]
        self._indices = [indices[name] for name in self.program.inputs]
        self._single = ScalarEngine(self.program)

    @cached_property
    def _batch(self) -> NumpyEngine:
        return NumpyEngine(self.program)

    def at(
        self,
        q: Floats,
        line: Floats,
        frames: Floats,
        single: bool = False,
        before: GroupPose | None = None,
    ) -> tuple[GroupPose, Floats]:
        """Corrected frames with rates along the line, and first corrections (n,).

        single : for one sample, by Python's numbers
        before : poses from which it is enough to know ``nearest`` from below, by Weyl's
            inequality, where J is much the same; of others theirs is 0
        """
        n, m = len(q), len(self.links)
        data = {"q": q, "line": line, "frames": frames}
        columns = [data[kind][:, *index] for kind, index in self._indices]
        inputs = dict(zip(self.program.inputs, columns, strict=True))
        values = self._single.run(inputs, 1) if single else self._batch.run(inputs, n, max(n, 1))
        frames, rate = np.empty((n, m, 4)), np.empty((n, m, 3))
        for j in range(m):
            o, e, v, om = values[4 * j : 4 * j + 4]
            for k, x in enumerate((o.real, o.imag, e.real, e.imag)):
                frames[:, j, k] = x
            for k, x in enumerate((v.real, v.imag, om)):
                rate[:, j, k] = x
        rest = values[4 * m :]
        first = np.max([np.broadcast_to(x, (n,)) for x in rest[0::2]], axis=0)
        size = max(np.shape(x)[-1] for x in rest[1::2])
        J, nearest, reach = np.zeros((n, len(self.groups), size, size)), [], []
        for g, x in enumerate(rest[1::2]):
            matrices = np.asarray(x).reshape((n, *np.shape(x)[-2:]))
            rows = np.sqrt(np.square(matrices).sum(axis=-1))
            scaled = matrices / rows[..., None]
            J[:, g, : scaled.shape[1], : scaled.shape[2]] = scaled
            if before is None:
                nearest.append(_smallest(scaled))
            else:
                nearest.append(_at_least(J[:, g], before.J[:, g], before.nearest[:, g], scaled))
            reach.append(rows.max(axis=-1))
        return GroupPose(frames, rate, J, np.stack(nearest, axis=1), np.max(reach, axis=0)), first


def _at_least(J: Floats, old: Floats, nearest: Floats, scaled: Floats) -> Floats:
    """Bounds (n,) from below of the smallest singular values, exact where J is not much the same.

    The norm of the change is the larger one, of all entries: the decomposition takes ten times
    as long.
    """
    change = np.sqrt(np.square(J - old).sum(axis=(1, 2)))
    bounds: Floats = nearest - change
    open_ = np.flatnonzero(~(change < CALM * nearest))
    if len(open_):
        bounds[open_] = _smallest(scaled[open_])
    return bounds


def _smallest(J: Floats) -> Floats:
    """The smallest singular value (n,) of each matrix; NaN where an entry is."""
    good = np.asarray(np.isfinite(J).all(axis=(1, 2)))
    values = np.linalg.svd(np.where(good[:, None, None], J, 0.0), compute_uv=False)
    return np.where(good, values[:, -1], np.nan)


def _unknowns(s: Schedule, link: LinkRef) -> list[str]:
    """Names of the inputs that are a link's guessed place."""
    number = s.structure.links[link]
    return [f"{component}_{number}" for component in ("x", "y", "ex", "ey")]


def _guessed_frames(s: Schedule, block: str) -> Value:
    """The guess of a group's pose as inputs of the program."""
    links = (LinkRef(block, name) for name in s.structure.blocks[block].link_names)
    frames = tuple_of(tuple_of(map(s.unknown, _unknowns(s, link))) for link in links)
    return tuple_of((frames, UNIT))
