"""Which modes of a triad connect along the driver: arcs, dead centres, and the turn.

A *circuit* is a set of poses that the group can move through without being taken apart;
an *arc* is a part of it between two dead centres, where the driver alone decides the
pose: what a mode is along the driver. At a dead centre two arcs of one circuit merge.
After a whole turn of a crank a mode may be another one: the permutation.

All modes are computed at some places of the driver. Between two neighbouring ones, each
mode on one side is predicted from one on the other by its rate, from both sides and by
far nearer than modes are to each other; or it is one of two that merge at a dead centre
between them, which is solved for, and seen from which both stand where its parabola says. A
stretch where that does not hold for every mode is parted, until it does.

The driver coordinate is p in here, 0 to 2 pi over the range or the turn.
Source: [CM93] Chase & Mirth, Circuits and branches of single-degree-of-freedom planar
linkages, J. Mech. Design 115, 1993 (their branch is the arc here).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, TypeAlias

import networkx as nx
import numpy as np

from blockmech.analysis.scan import Span
from blockmech.functions.roots import LONGEST_STEP
from blockmech.functions.series import GOLDEN, fit
from blockmech.ground.errors import refused
from blockmech.ground.plane import EPS
from blockmech.ground.tolerances import EQUAL
from blockmech.modes.closing import (
    DELTA,
    Poses,
    TriadMode,
    apart,
    fold,
    looseness,
    modes_of,
    newton,
    poses,
    solved,
)
from blockmech.modes.report import DEAD, LOST, RANGE, TURN, WHOLE, Arc, ArcEnd
from blockmech.modes.triad import Placed, Support, Triad, placed
from blockmech.typing import Floats

Outer: TypeAlias = Callable[[Floats], Sequence[Support]]
TriadAt: TypeAlias = Callable[[Floats], Triad]
At: TypeAlias = tuple[int, int]  # a node, and a mode there

CHECKS = 48  # nodes to begin with
SHARE = 0.25  # of the distance between modes: what prediction may miss, to be beyond doubt
NARROWEST = EPS**0.75  # stretch; beside it a node is at a dead centre by `DELTA`


@dataclass(frozen=True)
class Connections:
    """How the modes of a triad connect along one driver.

    Attributes
    ----------
    nodes : driver coordinates [rad or m] at which all modes were computed
    modes : the modes at each of them, by rising angle of the platform
    arcs : all arcs, circuit by circuit, each by its first pass
    passes : of each arc, the (node, mode) that it passes, in rising order of the driver
    places : of each arc, the driver coordinate [rad or m] of each pass, which may be a
        turn and more away from that of the node
    turn : whether the driver was followed over a whole turn
    """

    nodes: tuple[float, ...]
    modes: tuple[tuple[TriadMode, ...], ...]
    arcs: tuple[Arc, ...]
    passes: tuple[tuple[At, ...], ...]
    places: tuple[tuple[float, ...], ...]
    turn: bool

    def arc_of(self, at: At) -> int:
        """Number of the arc that a mode at a node is on."""
        return next(n for n, passed in enumerate(self.passes) if at in passed)

    def after_turn(self, at: At) -> int | None:
        """The mode at the same node that a mode is after a turn; None if it ends before."""
        number = self.arc_of(at)
        met = [mode for node, mode in self.passes[number] if node == at[0]]
        later = met.index(at[1]) + 1
        if later < len(met):
            return met[later]
        return met[0] if self.arcs[number].turns else None


def connect(
    triad: Triad | TriadAt,
    outer: Outer,
    low: float = 0.0,
    high: float = TURN,
    *,
    ends: str = WHOLE,
    also: Sequence[float] = (),
) -> Connections:
    """Connect every mode of a triad along the driver.

    Parameters
    ----------
    triad : its legs, or driver coordinates (n,) -> its legs where the driver is in one
    outer : driver coordinates (n,) -> the three supports; smooth, finite on the whole range
    low, high : range of the driver [rad or m]
    ends : "turn" where the supports repeat after the range, "range" where it ends, and
        "earlier group" at dead centres of those, which supports leave with the root
    also : driver coordinates of further nodes, which come after the first ones

    Returns
    -------
    Connections. A circuit that exists only between two neighbouring nodes is missed.

    Raises
    ------
    RequestError for an empty range, and where two modes are one all along
    """
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        wrong = f"a range of the driver is needed, got {low} to {high}"
        raise refused("connect", wrong)
    triad_at: TriadAt = (lambda _: triad) if isinstance(triad, Triad) else triad
    span = Span(low, high, turn=ends == WHOLE)  # in which supports are smooth again at its ends

    def to_q(p: Floats) -> Floats:
        share = p / TURN if span.turn else np.clip(p / TURN, 0.0, 1.0)
        return np.where(p == 0, low, np.where(p == TURN, high, span.place(share)))

    def to_p(q: float) -> float:
        share = (q - low) / (high - low)
        return TURN * (share if span.turn else 2 / math.pi * math.asin(math.sqrt(share)))

    middle = np.array([(low + high) / 2])
    like = placed(triad_at(middle), outer(middle))

    def held(p: Floats) -> Placed:
        q = to_q(p)
        return placed(triad_at(q), outer(q), like, len(q))

    line = _Line(held, ends == WHOLE)
    line.connect([to_p(q) for q in also])
    return line.connections(lambda p: float(to_q(np.array(p))), ends)


class _Node(NamedTuple):
    """A place with all modes (k), their rates (k, 3) by p, and the signs of determinants."""

    p: float
    held: Placed
    found: Poses
    rate: Floats
    sign: list[int]


class _Walk(NamedTuple):
    """The passes of one arc, their places p, and whether the last one leads to the first."""

    passes: list[At]
    places: list[float]
    ring: bool


@dataclass
class _Line:
    """The line of the driver: its nodes, and what is known between them."""

    held: Callable[[Floats], Placed]  # p (n,) -> the triad there
    turn: bool  # whether the line closes
    nodes: list[_Node] = field(default_factory=list)
    # a mode at a node -> the same mode at the next one, and the step to it
    right: dict[At, tuple[At, float]] = field(default_factory=dict)
    # a mode at a node -> the step to a change point before the next one
    passed: dict[At, float] = field(default_factory=dict)
    # a mode and a way (0 back, 1 ahead) -> the step to a dead centre, and what merges there
    merged: dict[tuple[At, int], tuple[float, At]] = field(default_factory=dict)
    borders: tuple[int, int] = (-1, -1)  # nodes where a range begins and ends

    def connect(self, also: Sequence[float]) -> None:
        """Add nodes until it is known how all modes go on from each to the next."""
        first = TURN * (np.arange(CHECKS) + GOLDEN) / CHECKS
        ends = [] if self.turn else [0.0, TURN]
        self._add([*first, *also, *ends], [DELTA * first[0]] * (CHECKS + len(also) + len(ends)))
        order = sorted(range(len(self.nodes)), key=lambda n: self.nodes[n].p)
        self.borders = (-1, -1) if self.turn else (order[0], order[-1])
        stretches = list(itertools.pairwise(order))
        stretches += [(order[-1], order[0])] if self.turn else []
        while stretches := [ends for ends in stretches if not self._joined(*ends)]:
            steps = [GOLDEN * self._step(a, b) for a, b in stretches]
            n = len(self.nodes)
            self._add(
                [self.nodes[a].p + h for (a, _), h in zip(stretches, steps, strict=True)],
                [DELTA * h for h in steps],
            )
            middle = range(n, len(self.nodes))
            parts = zip(stretches, middle, strict=True)
            stretches = [part for (a, b), m in parts for part in ((a, m), (m, b))]

    def _step(self, a: int, b: int) -> float:
        h = self.nodes[b].p - self.nodes[a].p
        return h % TURN if self.turn else h

    def _add(self, positions: Sequence[float], nudges: Sequence[float]) -> None:
        """Nodes at places, or a little beside where a mode is at a dead centre."""
        p, nudge = np.array(positions), np.array(nudges)
        nudge[p >= TURN] *= -1  # the end of a range
        if self.turn:
            p %= TURN
        for _ in range(CHECKS):
            placed = self.held(p)
            poses_at = poses(placed)
            row = np.repeat(np.arange(len(p)), [len(f.x) for f in poses_at])
            x = np.concatenate([f.x for f in poses_at])
            rows = placed.rows(row).conditions(x)[1]
            loose = np.bincount(row, looseness(rows) <= DELTA, len(p)) > 0
            singular = loose | np.isnan(placed.pivots).any(axis=1)
            if not singular.any():
                break
            p[singular] += nudge[singular]
            nudge *= 1 + GOLDEN
        if any(double for f in poses_at for double in f.double):
            doubles = "the modes of the triad could not be followed along the driver without doubt"
            remedy = "ask for a shorter range of the driver"
            raise refused("modes", doubles, remedy, code="not-followed")
        back, forward = (p + d if self.turn else np.clip(p + d, 0, TURN) for d in (-DELTA, DELTA))
        misses = [self.held(q).rows(row).conditions(x)[0] for q in (back, forward)]
        rate = solved(rows, (misses[0] - misses[1]) / (forward - back)[row, None])
        sign = np.sign(np.linalg.det(rows)).astype(int)
        for n, f in enumerate(poses_at):
            mask = row == n
            node = _Node(float(p[n]), placed.rows([n]), f, rate[mask], sign[mask].tolist())
            self.nodes.append(node)

    # -- from one node to the next ---------------------------------------------------------

    def _joined(self, a: int, b: int) -> bool:
        """Whether it is known how the modes go on from node a to node b; it is recorded."""
        first, second, h = self.nodes[a], self.nodes[b], self._step(a, b)
        x, y = first.found.x[:, None], second.found.x[None]
        miss = np.maximum(
            apart(x + h * first.rate[:, None], y), apart(x, y - h * second.rate[None])
        )
        close = miss <= SHARE * np.minimum(_gaps(first)[:, None], _gaps(second)[None])
        on, back = close.sum(axis=1), close.sum(axis=0)
        forward = self._merging(a, np.flatnonzero(on == 0).tolist(), 1, h)
        behind = self._merging(b, np.flatnonzero(back == 0).tolist(), 0, h)
        sure = max(on.max(initial=0), back.max(initial=0)) <= 1
        if (forward is None or behind is None or not sure) and h > NARROWEST:
            return False
        for i, j in np.argwhere(close & (on == 1)[:, None] & (back == 1)).tolist():
            self.right[a, i] = (b, j), h
            if first.sign[i] != second.sign[j]:
                self.passed[a, i] = self._change_point(a, i, b, j, h)
        self.merged |= (forward or {}) | (behind or {})
        return True

    def _merging(
        self, n: int, remaining: list[int], side: int, h: float
    ) -> dict[tuple[At, int], tuple[float, At]] | None:
        """The dead centres within a step h at which modes of a node end; None if in doubt."""
        node, merged = self.nodes[n], dict[tuple[At, int], tuple[float, At]]()
        if len(remaining) % 2:
            return None
        while remaining:
            i = remaining.pop(0)
            gaps = apart(node.found.x[i], node.found.x[remaining])
            gap, j = float(gaps.min()), remaining.pop(int(gaps.argmin()))
            first, second = node.found.x[[i, j]]
            dead_centre = fold(self._system, first + _between(first, second) / 2, node.p)
            if dead_centre is None or node.sign[i] == node.sign[j]:
                return None
            step, half = dead_centre.parameter - node.p, dead_centre.half(node.p)
            both = dead_centre.x + np.outer((half, -half), dead_centre.loose)
            misses = (apart(both, node.found.x[pair]).max() for pair in ([i, j], [j, i]))
            offset = step if side else -step
            if not (-NARROWEST <= offset <= h + NARROWEST and min(misses) <= SHARE * gap):
                return None
            merged |= {((n, i), side): (step, (n, j)), ((n, j), side): (step, (n, i))}
        return merged

    def _system(self, x: Floats, p: Floats) -> tuple[Floats, Floats]:
        return self.held(p).conditions(x)

    def _change_point(self, a: int, i: int, b: int, j: int, h: float) -> float:
        """The step from node a to where the determinant passes zero on the way to node b."""
        first_node, second_node = self.nodes[a], self.nodes[b]
        x, move = first_node.found.x[i], _between(first_node.found.x[i], second_node.found.x[j])

        def determinant(step: Floats) -> Floats:
            s = (step / h)[:, None]  # of the cubic between both, with their rates
            guess = (
                x
                + h * s * (1 - s) ** 2 * first_node.rate[i]
                - h * s**2 * (1 - s) * second_node.rate[j]
            )
            placed = self.held(first_node.p + step)
            pose, _ = newton(placed.conditions, guess + s**2 * (3 - 2 * s) * move)
            return np.asarray(np.linalg.det(placed.conditions(pose)[1]))

        ends = np.array([0.0, h])
        first, last = np.abs(determinant(ends))
        straight = h * float(first / (first + last))
        roots = fit(determinant, ends, levels=0, tolerance=EQUAL).roots().tolist()
        return min(roots, key=lambda step: abs(step - straight), default=straight)

    # -- arcs ------------------------------------------------------------------------------

    def connections(self, q: Callable[[float], float], ends: str) -> Connections:
        """All arcs in the driver's coordinate."""
        every = [(n, k) for n, node in enumerate(self.nodes) for k in range(len(node.sign))]
        entered = {at for at, _ in self.right.values()}
        walk_of: dict[At, _Walk] = {}
        for at in sorted(every, key=lambda at: at in entered):  # rings at last
            if at not in walk_of:
                walk = self._walk(at)
                walk_of |= dict.fromkeys(walk.passes, walk)
        of: dict[At, At] = {at: min(walk.passes) for at, walk in walk_of.items()}
        met: nx.Graph[At] = nx.Graph(
            (of[at], of[partner]) for (at, _), (_, partner) in self.merged.items()
        )
        met.add_nodes_from(of.values())
        circuits = sorted(map(sorted, nx.connected_components(met)))
        number = {at: n for n, at in enumerate(itertools.chain.from_iterable(circuits))}
        arcs, passes, positions = [], [], []
        for circuit, first in ((k, at) for k, part in enumerate(circuits) for at in part):
            walk = walk_of[first]
            (low, *_), (high, *_) = ends_ = [self._end(walk, side) for side in (0, 1)]
            # The middle of one that ends is on the first turn.
            open_turn = self.turn and not walk.ring
            shift = TURN * math.floor((low + high) / 2 / TURN) if open_turn else 0.0
            start, end = (
                ArcEnd(q(p - shift), ends if reason == RANGE else reason, at and number[of[at]])
                for p, reason, at in ends_
            )
            steps = zip(walk.passes, walk.places, strict=True)
            passed = tuple(q(p + self.passed[at] - shift) for at, p in steps if at in self.passed)
            signs = {self.nodes[n].sign[mode] for n, mode in walk.passes}
            sign = signs.pop() if len(signs) == 1 else 0
            turns = round(high / TURN) if walk.ring else 0
            arcs.append(Arc(start, end, None, sign, turns, passed, circuit))
            passes.append(tuple(walk.passes))
            positions.append(tuple(q(p - shift) for p in walk.places))
        return Connections(
            tuple(q(node.p) for node in self.nodes),
            tuple(modes_of(node.held, node.found) for node in self.nodes),
            tuple(arcs),
            tuple(passes),
            tuple(positions),
            self.turn,
        )

    def _walk(self, at: At) -> _Walk:
        passes, positions = [at], [self.nodes[at[0]].p]
        while (on := self.right.get(passes[-1])) and on[0] != at:
            passes.append(on[0])
            positions.append(positions[-1] + on[1])
        return _Walk(passes, positions, on is not None)

    def _end(self, walk: _Walk, side: int) -> tuple[float, str, At | None]:
        """Where an arc ends, backwards (0) or ahead (1): place, why, what it merges with."""
        at, p = walk.passes[-side], walk.places[-side]
        if walk.ring:
            length = walk.places[-1] + self.right[walk.passes[-1]][1] - walk.places[0]
            return TURN * round(length / TURN) * side, WHOLE, None
        if (at, side) in self.merged:
            step, partner = self.merged[at, side]
            return p + step, DEAD, partner
        return (TURN * side, RANGE, None) if at[0] == self.borders[side] else (p, LOST, None)


def _gaps(node: _Node) -> Floats:
    """How far each mode of a node is from the nearest other one, at most `LONGEST_STEP`."""
    x = node.found.x
    apiece = apart(x[:, None], x[None]) + 2 * LONGEST_STEP * np.eye(len(x))
    return np.asarray(apiece.min(axis=1, initial=LONGEST_STEP))


def _between(first: Floats, second: Floats) -> Floats:
    """The way from one pose to another, the shorter way round."""
    difference = second - first
    difference[2] = math.remainder(float(difference[2]), TURN)
    return difference
