"""Coordinates of pairs that have end stops: where they are, how they change, and whole turns."""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from blockmech.dynamics.contacts import SETTLED, Constraints
from blockmech.dynamics.source import FRICTIONLESS, Source, by_name
from blockmech.engines.interpreters import ScalarEngine
from blockmech.ground.names import split_address
from blockmech.ground.plane import EPS
from blockmech.model.structure import COORDINATE, JointRef
from blockmech.passes import forward
from blockmech.passes.homotopy import schedule
from blockmech.plan.plan import Output
from blockmech.result.motion import Lying
from blockmech.typing import Floats, Real

Place: TypeAlias = tuple[Floats, Floats, Floats]  # q (k,), coordinates (p,), rows (p, k)
SURE = 1.0  # [rad] by which an angle may differ from what its row foretells, over one way
HALVED = -round(math.log2(EPS)) // 2  # times at most that a way is halved: to half its digits


@dataclass
class PairStops:
    """Coordinates of some pairs of a mechanism, of none as well, and how they change.

    pairs : each with +1 or -1, the sense in which its coordinate counts against the pair's own
    """

    mechanism: Source
    names: tuple[str, ...] = ()  # of the outputs that are the coordinates
    pairs: tuple[tuple[JointRef, int], ...] = ()

    def __reduce__(self) -> tuple[object, ...]:
        """Pickled without its programs."""
        return type(self), (self.mechanism, self.names, self.pairs)

    @property
    def refs(self) -> tuple[JointRef, ...]:
        """The pairs."""
        return tuple(ref for ref, _ in self.pairs)

    @property
    def by_name(self) -> dict[str, tuple[JointRef, int]]:
        """Name of the coordinate -> pair and sense."""
        return dict(zip(self.names, self.pairs, strict=True))

    @cached_property
    def rotary(self) -> NDArray[np.bool_]:
        """(p,) whether each coordinate is an angle."""
        structure = self.mechanism.structure
        return np.array([structure.joint(ref).rotary for ref in self.refs], dtype=bool)

    @cached_property
    def _program(self) -> tuple[ScalarEngine, list[tuple[Output, int]]]:
        structure, drivers = self.mechanism.structure, self.mechanism.structure.drivers
        s = schedule(structure, self.mechanism.scene, FRICTIONLESS)
        by_blocks = [f"{ref}.{COORDINATE}" for ref in self.refs]
        names = by_blocks if self.mechanism.names is None else self.names
        outputs = [self.mechanism.outputs[name] for name in names]
        columns = [list(output.ask(s)) for output in outputs]
        rows = [s.ask(forward.slip, ref, driver) for ref in self.refs for driver in drivers]
        drifts = map(partial(s.ask, forward.slip_acceleration), self.refs)
        engine = ScalarEngine(s.program([*(x for some in columns for x in some), *rows, *drifts]))
        return engine, list(zip(outputs, map(len, columns), strict=True))

    def state(self, q: Floats, qd: Floats) -> tuple[Floats, Floats, Floats]:
        """Coordinates (p,), angles between -pi and pi, rows (p, k), and drifts (p,) at rates."""
        p, k = len(self.pairs), len(q)
        if not p:
            return np.empty(0), np.empty((0, k)), np.empty(0)
        engine, outputs = self._program
        inputs = by_name(q.tolist(), qd.tolist(), [0.0] * k)
        values, coordinates = list(engine.one([inputs[x] for x in engine.program.inputs])), []
        for output, count in outputs:
            columns = [np.asarray(values.pop(0)) for _ in range(count)]
            coordinates.append(float(output.read(*columns)))
        senses = np.array([sense for _, sense in self.pairs])
        changes = np.array(values, dtype=np.float64)
        rows, drifts = changes[: p * k].reshape(p, k), changes[p * k :]
        return np.array(coordinates), senses[:, None] * rows, senses * drifts

    def rows(self, q: ArrayLike, rate: ArrayLike) -> tuple[Floats, Floats]:
        """Rows (n, k) of all that has stops over the drivers, drifts (n,): drivers, then pairs."""
        q, rate = np.atleast_1d(q), np.atleast_1d(rate)
        _, rows, drifts = self.state(q, rate)
        return np.vstack([np.eye(len(q)), rows]), np.append(0.0 * q, drifts)

    def constraints(self, q: ArrayLike, rate: ArrayLike, those: Sequence[int]) -> Constraints:
        """Some of the stops at a state, by their places among all."""
        rows, drift = self.rows(q, rate)
        k = rows.shape[1]
        senses = [1] * k + [sense for _, sense in self.pairs]
        pairs = tuple((max(int(i) - k, -1), senses[i]) for i in those)
        return Constraints(rows[those], drift[those], pairs)


class Counted:
    """Those coordinates along a motion, angles with their whole turns.

    They are continued from the last place asked for; `again` goes back to where a motion begins.
    """

    def __init__(self, pairs: PairStops, q: Floats, at_start: Floats) -> None:
        """``at_start`` (p,) : what they are there; they may count from elsewhere than the pairs."""
        self.pairs = pairs
        coordinates, rows, _ = pairs.state(q, 0 * q)
        apart = at_start - coordinates
        turns = np.where(pairs.rotary, math.tau * np.round(apart / math.tau), 0.0)
        self.zeros = np.where(np.abs(apart - turns) < SETTLED, 0.0, apart - turns)
        self.start = q, coordinates + turns + self.zeros, rows
        self.again()

    def again(self) -> None:
        """Go back to where a motion begins."""
        self.last = self.start

    def restarted(self, q: Floats) -> Counted:
        """The same for motions that begin at a place."""
        counted = copy.copy(self)
        counted.at(q)
        counted.start = counted.last
        return counted

    def at(self, q: Floats) -> Floats:
        """The coordinates (p,) at a place."""
        self.last = self._from(self.last, np.array(q, dtype=np.float64), HALVED)
        return self.last[1]

    def state(self, q: Real, rate: Real) -> tuple[Real, Real]:
        """The coordinates and their rates at a state of the drivers; floats of the only one."""
        coordinates = self.at(np.atleast_1d(q))
        rates = self.last[2] @ np.atleast_1d(rate)
        return (coordinates, rates) if np.ndim(q) else (coordinates[0], rates[0])

    def _from(self, last: Place, q: Floats, halved: int) -> Place:
        q0, before, rows0 = last
        if (q0 == q).all():
            return last
        coordinates, rows, _ = self.pairs.state(q, 0 * q)
        coordinates += self.zeros
        if self.pairs.rotary.any():
            foretold = before + (rows0 + rows) @ (q - q0) / 2
            turns = math.tau * np.round((foretold - coordinates) / math.tau)
            counted = np.where(self.pairs.rotary, coordinates + turns, coordinates)
            unsure = np.abs(counted - foretold)[self.pairs.rotary].max() > SURE
            if halved and unsure and np.isfinite(counted).all():
                middle = self._from(last, (q0 + q) / 2, halved - 1)
                return self._from(middle, q, halved - 1)
            coordinates = counted
        return q, coordinates, rows


def stopped_pairs(mechanism: Source, names: Sequence[str]) -> PairStops:
    """Those of some names that are no drivers'."""
    of_pairs = tuple(dict.fromkeys(name for name in names if name not in mechanism.drivers))
    pairs = []
    for name in of_pairs:
        pair = name.removesuffix(f".{COORDINATE}")
        if mechanism.names is None:
            pairs.append((JointRef(*split_address(pair, mechanism.structure.blocks)), 1))
        else:
            where = mechanism.names.joints[pair.partition(".")[2]]
            pairs.append((where.joint, -1 if where.flipped != where.turned else 1))
    return PairStops(mechanism, of_pairs, tuple(pairs))


def lain_against(mechanism: Source, lying: Sequence[Lying]) -> PairStops:
    """Those that something lies against in a motion."""
    pairs = {lain.stop: lain.pair for lain in lying if lain.pair is not None}
    return PairStops(mechanism, tuple(pairs), tuple(pairs.values()))
