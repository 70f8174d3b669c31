"""Margins of a mechanism along one driver, and what happens where one of them is zero."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from blockmech.analysis.arcs import SEAM, Bound, Margins
from blockmech.analysis.scan import ASIDE, TURN, Span
from blockmech.blocks.contract import BuiltIn, Moving
from blockmech.model.structure import JointRef
from blockmech.series import Floats

if TYPE_CHECKING:
    from blockmech.compiled import Compiled

BEYOND = 2.0**20  # sizes of the mechanism within which a slide's ends are searched
COINCIDENT = 1e-6  # of a group's lengths, below which two pins lie on each other

WORDS = {"RRP": "tangent", "RPR": "tangent", "PRP": "parallel", "RPP": "parallel"}
DEAD = "dead centre"


class _Row(NamedTuple):
    """A margin among the values of a program: ``read`` takes all of them."""

    block: str
    read: Callable[[tuple[Any, ...]], Any]


class Closure:
    """Which groups close, as functions of one driver coordinate with the others held."""

    def __init__(
        self,
        mechanism: Compiled,
        driver: str,
        held: Mapping[str, float],
        groups: tuple[str, ...],
    ) -> None:
        self.mechanism = _sharp(mechanism)
        self.driver = driver
        self.held = held
        self.groups = groups

    def margins(self) -> Margins:
        """The margins of the groups, in formation order."""
        if not self.groups:
            return Margins((), lambda q: np.empty((0, len(q))), _never, self.passable)
        pivots = {g: self._pivots(g) for g in self.groups if self._hides_its_pole(g)}
        want = {f"{g}.margin" for g in self.groups}.union(*pivots.values())
        plan = self.mechanism.plan(tuple(sorted(want)))
        place = {name: plan.layout[name][0] for name in want}
        rows = []
        for g in self.groups:
            rows.append(_Row(g, _margin(place[f"{g}.margin"])))
            if g in pivots:
                rows.append(_Row(g, _apart(*(place[p] for p in pivots[g]))))
        scalar = self.mechanism._engine(plan, "scalar", "")
        batch = self.mechanism._engine(plan, "numpy", "complex128")
        number = {f"q_{i}": d for i, d in enumerate(self.mechanism.drivers)}
        inputs = [number[n] for n in plan.program.inputs]

        seen: dict[bytes, Floats] = {}  # all groups are looked at, one after the other

        def many(q: Floats) -> Floats:
            key = q.tobytes()
            if key not in seen:
                seen[key] = evaluated(q)
            return seen[key]

        def evaluated(q: Floats) -> Floats:
            columns = {
                n: q if d == self.driver else np.full(len(q), self.held[d])
                for n, d in zip(plan.program.inputs, inputs, strict=True)
            }
            values = batch.run(columns, len(q))
            with np.errstate(all="ignore"):
                return np.array([row.read(values) for row in rows], dtype=float)

        def one(k: int) -> Callable[[float], float]:
            def margin(q: float) -> float:
                values = scalar.one([q if d == self.driver else self.held[d] for d in inputs])
                return float(rows[k].read(values))

            return margin

        return Margins(tuple(r.block for r in rows), many, one, self.passable)

    def passable(self, block: str, q: float, d: float) -> bool:
        """Whether the links of a group pass a touch of its margin without a jump.

        A corner or a smooth passage moves as far from -d to d as from -2d to -d and d to 2d
        together; a pole or a flip moves much farther.
        """
        s = self.mechanism.structure
        links = [f"{block}.{link}.angle" for link in s.blocks[block].link_names]
        points = [f"{m}.p" for m in s.markers(block)]
        run = self._run([q - 2 * d, q - d, q + d, q + 2 * d], [*links, *points])
        paths = [np.exp(1j * run[n]) for n in links] + [run[n] for n in points]
        for z in paths:
            step = np.abs(np.diff(z))
            noise = 1e-9 * float(np.abs(z).max())
            if not step[1] <= 1.5 * (step[0] + step[2]) + noise:
                return False
        return True

    def how(self, bound: Bound) -> str:
        """How a group stands where its margin is zero; see `End`."""
        block = self.mechanism.structure.blocks[bound.block]
        if block.kind not in ("RRR", "RPR"):
            return WORDS.get(block.kind, DEAD)
        pivots = self._pivots(bound.block)
        run = self._run([bound.q], list(pivots))
        apart = abs(complex(run[pivots[0]][0] - run[pivots[1]][0]))
        if apart <= COINCIDENT * block.largest_length() or self._hides_its_pole(bound.block):
            return "coincident"
        if block.kind == "RPR":
            return WORDS["RPR"]
        sides: Any = block
        return "extended" if apart > math.hypot(sides.l_i, sides.l_j) else "folded"

    def _hides_its_pole(self, group: str) -> bool:
        """Whether a group's margin is silent where its two outer pins meet.

        RPR: the margin 1 - h^2/r^2 is constant for h = 0, but the guide's direction is
        undefined at r = 0.
        """
        block: Any = self.mechanism.structure.blocks[group]
        return bool(block.kind == "RPR" and block.h_i == block.h_j)

    def _pivots(self, group: str) -> tuple[str, str]:
        """Outputs for the places of the outer pins B and D."""
        feeds = self.mechanism.structure.feeds
        return f"{feeds[JointRef(group, 'B')]}.p", f"{feeds[JointRef(group, 'D')]}.p"

    def _run(self, q: list[float], want: list[str]) -> Any:
        # Rates are given so that laws of motion, which may be by time, are not asked.
        at = {d: q if d == self.driver else self.held[d] for d in self.mechanism.drivers}
        return self.mechanism.run(at=at, rates=dict.fromkeys(at, 0.0), want=want, on_gap="mark")


def _sharp(mechanism: Compiled) -> Compiled:
    """The mechanism without the blind zones beside its change points: margins exist there."""
    s = mechanism.structure
    if not s.followed:
        return mechanism
    sharp = {name: there._replace(scale=0.0) for name, there in s.followed.items()}
    return type(mechanism)(
        replace(s, followed=sharp), mechanism.scene, mechanism.name, mechanism.names
    )


def _never(k: int) -> Callable[[float], float]:
    raise IndexError(k)


def _margin(i: int) -> Callable[[tuple[Any, ...]], Any]:
    return lambda values: values[i]


def _apart(i: int, j: int) -> Callable[[tuple[Any, ...]], Any]:
    """Square of the distance of two points, relative to their distance from the origin."""

    def share(values: tuple[Any, ...]) -> Any:
        a, b = values[i], values[j]
        x, y = a.real - b.real, a.imag - b.imag
        size = a.real * a.real + a.imag * a.imag + b.real * b.real + b.imag * b.imag
        return (x * x + y * y) / (size + (size == 0))

    return share


def one_turn() -> Span:
    """A turn of a crank, from a place that is none of symmetric mechanisms."""
    return Span(SEAM - ASIDE, SEAM - ASIDE + TURN, turn=True)


def travel(mechanism: Compiled, driver: str) -> Span:
    """A slide's way, a million times the size of the mechanism and of its law's range."""
    structure = mechanism.structure
    sizes = [b.largest_length() for b in structure.blocks.values() if isinstance(b, Moving)]
    fixed = [m for _, m in structure.fixed.markers_of().values() if not isinstance(m, BuiltIn)]
    sizes += [2 * max((abs(m.at.z) for m in fixed), default=0.0)]
    law: Any = mechanism.scene.drive.get(driver)
    sizes += [abs(law.start), abs(law.end)] if law is not None and law.by_coordinate else []
    head = structure.blocks[structure.driven[driver].block]
    size = sum([*sizes, abs(getattr(head, "offset", 0.0))]) or 1.0
    return Span(-BEYOND * size, BEYOND * size, size=size)
