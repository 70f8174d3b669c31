"""Coordinates of pairs that have end stops: where they are, how they change, and whole turns."""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, Protocol

import numpy as np

from blockmech.dynamics.contacts import Held
from blockmech.engines.scalar import ScalarEngine
from blockmech.ground.values import split_address
from blockmech.model.naming import Names
from blockmech.model.scene import Scene
from blockmech.model.structure import COORDINATE, JointRef, Structure
from blockmech.passes import forward
from blockmech.passes.homotopy import schedule
from blockmech.plan.plan import Friction, Output, Schedule
from blockmech.result.motion import Floats, Lying

SLIPPED = forward.slip_acceleration
SURE = 1.0  # [rad] by which an angle may differ from what its row foretells, over one way
HALVED = 30  # times at most that a way is halved until it does not


class Named(Protocol):
    """A mechanism, e.g. a `Compiled`: a structure in its scene, and its outputs by name."""

    structure: Structure
    scene: Scene
    names: Names | None

    @property
    def outputs(self) -> Mapping[str, Output]:
        """Every output that can be wanted."""

    @property
    def drivers(self) -> tuple[str, ...]:
        """Drivers in formation order."""


@dataclass
class PairStops:
    """Coordinates of some pairs of a mechanism, and how they change.

    pairs : each with +1 or -1, the sense in which its coordinate counts against the pair's own
    """

    mechanism: Named
    names: tuple[str, ...]  # of the outputs that are the coordinates
    pairs: tuple[tuple[JointRef, int], ...]

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickled without its programs."""
        return type(self), (self.mechanism, self.names, self.pairs)

    @property
    def refs(self) -> tuple[JointRef, ...]:
        """The pairs."""
        return tuple(ref for ref, _ in self.pairs)

    @cached_property
    def rotary(self) -> Any:
        """(p,) whether each coordinate is an angle."""
        return np.array([self.mechanism.structure.joint(ref).rotary for ref in self.refs])

    def _schedule(self) -> Schedule:
        return schedule(self.mechanism.structure, self.mechanism.scene, Friction("none"))

    @cached_property
    def _of_places(self) -> tuple[ScalarEngine, list[tuple[Output, int]]]:
        s, outputs = self._schedule(), [self.mechanism.outputs[name] for name in self.names]
        values = [list(output.ask(s)) for output in outputs]
        engine = ScalarEngine(s.program([x for some in values for x in some]))
        return engine, list(zip(outputs, map(len, values), strict=True))

    @cached_property
    def _of_rows(self) -> ScalarEngine:
        s, drivers = self._schedule(), self.mechanism.structure.drivers
        rows = [s.ask(forward.slip, ref, driver) for ref in self.refs for driver in drivers]
        return ScalarEngine(s.program([*rows, *map(partial(s.ask, SLIPPED), self.refs)]))

    def places(self, q: Floats) -> Floats:
        """Coordinates (p,), angles between -pi and pi."""
        engine, outputs = self._of_places
        values, places = _values(engine, q, 0 * q), []
        for output, count in outputs:
            columns = [np.asarray(values.pop(0)) for _ in range(count)]
            places.append(float(output.read(*columns)))
        return np.array(places)

    def rows(self, q: Floats, qd: Floats) -> tuple[Floats, Floats]:
        """Rows (p, k), and drifts (p,) at rates (k,)."""
        senses = np.array([sense for _, sense in self.pairs])
        values = np.array(_values(self._of_rows, q, qd), dtype=np.float64)
        count = len(senses) * len(q)
        rows, drift = values[:count].reshape(len(senses), len(q)), values[count:]
        return senses[:, None] * rows, senses * drift


def rows_of(pairs: PairStops | None, q: Any, rate: Any) -> tuple[Floats, Floats]:
    """Rows (n, k) of all that has stops over the drivers, and drifts (n,): drivers, then pairs."""
    q, rate = np.atleast_1d(q), np.atleast_1d(rate)
    rows, drift = np.eye(len(q)), np.zeros(len(q))
    if pairs is None:
        return rows, drift
    more, pushed = pairs.rows(q, rate)
    return np.vstack([rows, more]), np.append(drift, pushed)


def held_by(pairs: PairStops | None, q: Any, rate: Any, those: Sequence[int]) -> Held:
    """Some of the stops at a state, by their places among all."""
    rows, drift = rows_of(pairs, q, rate)
    k = rows.shape[1]
    senses = [1] * k + ([] if pairs is None else [sense for _, sense in pairs.pairs])
    own = tuple((max(int(i) - k, -1), senses[i]) for i in those)
    return Held(rows[those], drift[those], own)


def _values(engine: ScalarEngine, q: Floats, qd: Floats) -> list[Any]:
    """Values of a program at a state without accelerations."""
    given = dict[str, float]()
    for i, (x, rate) in enumerate(zip(q, qd, strict=True)):
        given |= {f"q_{i}": float(x), f"qd_{i}": float(rate), f"qdd_{i}": 0.0}
    return list(engine.one([given[name] for name in engine.program.inputs]))


class Counted:
    """Those coordinates along a motion, angles with their whole turns.

    They are continued from the last place asked for; `again` goes back to where a motion begins.
    """

    def __init__(self, pairs: PairStops, q: Floats, turns: Floats) -> None:
        self.pairs = pairs
        self.start = q, pairs.places(q) + turns, pairs.rows(q, 0 * q)[0]
        self.again()

    def again(self) -> None:
        """Go back to where a motion begins."""
        self.last = self.start

    def begun(self, q: Floats) -> Counted:
        """The same for motions that begin at a place."""
        other = copy.copy(self)
        other.at(q)
        other.start = other.last
        return other

    def at(self, q: Floats) -> Floats:
        """The coordinates (p,) at a place."""
        self.last = self._from(self.last, np.array(q, dtype=np.float64), HALVED)
        return self.last[1]

    def state(self, q: Any, rate: Any) -> tuple[Any, Any]:
        """The coordinates and their rates at a state of the drivers; floats of the only one."""
        places = self.at(np.atleast_1d(q))
        rates = self.last[2] @ np.atleast_1d(rate)
        return (places, rates) if np.ndim(q) else (places[0], rates[0])

    def _from(self, last: Any, q: Floats, halved: int) -> Any:
        q0, before, rows0 = last
        if (q0 == q).all():
            return last
        places, (rows, _) = self.pairs.places(q), self.pairs.rows(q, 0 * q)
        if self.pairs.rotary.any():
            foretold = before + (rows0 + rows) @ (q - q0) / 2
            turns = math.tau * np.round((foretold - places) / math.tau)
            counted = np.where(self.pairs.rotary, places + turns, places)
            unsure = np.abs(counted - foretold)[self.pairs.rotary].max() > SURE
            if halved and unsure and np.isfinite(counted).all():
                middle = self._from(last, (q0 + q) / 2, halved - 1)
                return self._from(middle, q, halved - 1)
            places = counted
        return q, places, rows


def stopped_pairs(mechanism: Named, names: Sequence[str]) -> PairStops | None:
    """Those of some names that are no drivers'; None without any."""
    of_pairs = tuple(dict.fromkeys(name for name in names if name not in mechanism.drivers))
    pairs = []
    for name in of_pairs:
        pair = name.removesuffix(f".{COORDINATE}")
        if mechanism.names is None:
            pairs.append((JointRef(*split_address(pair, mechanism.structure.blocks)), 1))
        else:
            where = mechanism.names.joints[pair.partition(".")[2]]
            pairs.append((where.joint, -1 if where.flipped != where.turned else 1))
    return PairStops(mechanism, of_pairs, tuple(pairs)) if pairs else None


def lain_against(mechanism: Named, lying: Sequence[Lying]) -> PairStops | None:
    """Those that something lies against in a motion; None without any."""
    pairs = {lain.stop: lain.pair for lain in lying if lain.pair is not None}
    return PairStops(mechanism, tuple(pairs), tuple(pairs.values())) if pairs else None
