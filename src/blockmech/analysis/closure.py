"""Margins of a mechanism along one driver, and what happens where one of them is zero."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from blockmech.analysis.scan import ASIDE, SEAM, TURN, Span
from blockmech.blocks.contract import BuiltIn, Moving
from blockmech.engines.interpreters import NumpyEngine, ScalarEngine
from blockmech.ground.tolerances import BLUR
from blockmech.model.laws_of_motion import OverRange
from blockmech.model.scene import Scene
from blockmech.model.structure import JointRef, LinkRef, Structure
from blockmech.passes import forward
from blockmech.passes.homotopy import schedule
from blockmech.plan.plan import Friction
from blockmech.plan.values import Value
from blockmech.typing import Data, Floats, Real, Values

if TYPE_CHECKING:
    from blockmech.compiled import Compiled

BEYOND = 1 / BLUR  # sizes of the mechanism, which rounding blurs where a slide is farther

WORDS = {"RRP": "tangent", "RPR": "tangent", "PRP": "parallel", "RPP": "parallel"}


class Closure:
    """Which groups close, as functions of one driver coordinate with the others held.

    Attributes
    ----------
    blocks : group of each margin, in formation order; a group may have two margins
    """

    def __init__(
        self, mechanism: Compiled, driver: str, held: Mapping[str, float], groups: tuple[str, ...]
    ) -> None:
        self.mechanism = _without_blind_zones(mechanism)
        self.driver = driver
        self.held = held
        programs = self.mechanism._once(_programs)
        if groups not in programs:
            programs[groups] = _Program(self.mechanism.structure, self.mechanism.scene, groups)
        self._program = programs[groups]
        self.blocks = self._program.rows
        self._known = cache(self._evaluated)
        self._paths_at = cache(self._paths)  # of a chain, all groups touch zero together

    def margins(self, q: Floats) -> Floats:
        """Margins (rows, n) at places (n,); all groups are looked at, one after the other."""
        return self._known(np.asarray(q, dtype=float).tobytes())

    def margin(self, k: int, q: float) -> float:
        """Margin number k at one place."""
        return float(self._program.read(k, self._at(q)))

    def _evaluated(self, coordinates: bytes) -> Floats:
        q = np.frombuffer(coordinates)
        values = self._run(self._program.batch, q)
        with np.errstate(all="ignore"):
            rows = [self._program.read(k, values) for k in range(len(self.blocks))]
            return np.array([np.broadcast_to(row, q.shape) for row in rows], dtype=float)

    def _paths(self, coordinates: bytes) -> list[Any]:
        q = np.frombuffer(coordinates)
        values = self._run(self._program.paths[0], q)
        return [np.broadcast_to(z.real + 1j * z.imag, q.shape) for z in values]

    def _run(self, engine: NumpyEngine, q: Floats) -> Values:
        columns = {n: np.broadcast_to(x, q.shape) for n, x in self._inputs(q).items()}
        return engine.run(columns, len(q))

    def _at(self, q: float) -> Values:
        """Values of the program at one place."""
        return self._program.scalar.one(list(self._inputs(q).values()))

    def _inputs(self, q: Real) -> Data:
        number = {f"q_{i}": d for i, d in enumerate(self.mechanism.drivers)}
        drivers = {n: number[n] for n in self._program.scalar.program.inputs}
        return {n: q if d == self.driver else self.held[d] for n, d in drivers.items()}

    def passable(self, block: str, q: float, d: float) -> bool:
        """Whether the links of a group pass a touch of its margin without a jump.

        A corner or a smooth passage moves as far from -d to d as from -2d to -d and d to 2d
        together; a pole or a flip moves much farther.
        """
        coordinates = np.array([q - 2 * d, q - d, q + d, q + 2 * d])
        if not (self.margins(coordinates)[self.blocks.index(block)] >= 0).all():
            return False
        paths = self._paths_at(coordinates.tobytes())
        for z in paths[self._program.paths[1][block]]:
            step = np.abs(np.diff(z))
            noise = 1e-9 * float(np.abs(z).max())
            if not step[1] <= 1.5 * (step[0] + step[2]) + noise:
                return False
        return True

    def how(self, name: str, q: float) -> str:
        """How a group stands where its margin is zero; see `limits.End`."""
        block: Any = self.mechanism.structure.blocks[name]
        if block.kind not in ("RRR", "RPR"):
            return WORDS.get(block.kind, "dead centre")
        values, (B, D) = self._at(q), self._program.pivots[name]
        apart = abs(complex(values[B] - values[D]))
        if apart <= BLUR * block.largest_length() or _hides_its_pole(block):
            return "coincident"
        if block.kind == "RPR":
            return WORDS["RPR"]
        return "extended" if apart > math.hypot(block.l_i, block.l_j) else "folded"


class _Program:
    """The margins of groups in formation order, and the outer pins of those whose words need them.

    Attributes
    ----------
    rows : group of each margin
    pivots : group -> where its outer pins B and D are among the values
    """

    def __init__(self, structure: Structure, scene: Scene, groups: tuple[str, ...]) -> None:
        self._structure, self._scene, rows = structure, scene, list[str]()
        s = schedule(structure, scene, Friction("none"))
        values: list[Value] = []
        self.pivots: dict[str, tuple[int, int]] = {}
        self._of_rows: list[tuple[int, int]] = []  # where a margin's one or two values are
        for g in groups:
            rows.append(g)
            self._of_rows.append((len(values), 0))
            values.append(s.ask(forward.margin, g))
            if structure.blocks[g].kind in ("RRR", "RPR"):
                self.pivots[g] = len(values), len(values) + 1
                values += [s.ask(forward.joint_position, JointRef(g, pin)) for pin in "BD"]
            if _hides_its_pole(structure.blocks[g]):
                rows.append(g)
                self._of_rows.append(self.pivots[g])
        self.rows = tuple(rows)
        program = s.program(values)
        self.scalar, self.batch = ScalarEngine(program), NumpyEngine(program)

    @cached_property
    def paths(self) -> tuple[NumpyEngine, dict[str, slice]]:
        """Directions of links and places of markers; which of them are of a group."""
        structure, values, of = self._structure, list[Value](), dict[str, slice]()
        s = schedule(structure, self._scene, Friction("none"))
        for g in dict.fromkeys(self.rows):
            first, links = len(values), structure.blocks[g].link_names
            values += [s.ask(forward.link_position, LinkRef(g, x)).scalar for x in links]
            values += [s.ask(forward.marker_place, m) for m in structure.markers(g)]
            of[g] = slice(first, len(values))
        return NumpyEngine(s.program(values)), of

    def read(self, k: int, values: Values) -> Real:
        """A margin; of two pins the square of their distance relative to the origin's."""
        at, other = self._of_rows[k]
        a, b = values[at], values[other]
        if not other:
            return a
        x, y = a.real - b.real, a.imag - b.imag
        size = a.real * a.real + a.imag * a.imag + b.real * b.real + b.imag * b.imag
        return (x * x + y * y) / (size + (size == 0))


def _programs(mechanism: Compiled) -> dict[tuple[str, ...], _Program]:
    """Programs that are made, by their groups."""
    return {}


def _hides_its_pole(block: Any) -> bool:
    """Whether a group's margin is silent where its two outer pins meet.

    RPR: the margin 1 - h^2/r^2 is constant for h = 0, but the guide's direction is
    undefined at r = 0.
    """
    return bool(block.kind == "RPR" and block.h_i == block.h_j)


def _without_blind_zones(mechanism: Compiled) -> Compiled:
    """The mechanism without the blind zones beside its change points: margins exist there."""
    s = mechanism.structure
    if not s.followed:
        return mechanism
    sharp = {name: there._replace(scale=0.0) for name, there in s.followed.items()}
    return type(mechanism)(
        replace(s, followed=sharp), mechanism.scene, mechanism.name, mechanism.names
    )


def one_turn() -> Span:
    """A turn of a crank, from a place that is none of symmetric mechanisms."""
    return Span(SEAM - ASIDE, SEAM - ASIDE + TURN, turn=True)


def travel(mechanism: Compiled, driver: str) -> Span:
    """A slide's way, a million times the size of the mechanism and of its law's range.

    One that turns wheels, after whose turn all repeats: as far as it turns one of that size.
    """
    structure = mechanism.structure
    sizes = [b.largest_length() for b in structure.blocks.values() if isinstance(b, Moving)]
    fixed = [m for _, m in structure.fixed.all_markers.values() if not isinstance(m, BuiltIn)]
    sizes += [2 * max((abs(m.at.z) for m in fixed), default=0.0)]
    law = mechanism.scene.drive.get(driver)
    sizes += [abs(law.start), abs(law.end)] if isinstance(law, OverRange) else []
    head = structure.blocks[structure.driven[driver].block]
    size = sum([*sizes, abs(getattr(head, "offset", 0.0))]) or 1.0
    reach = size * (TURN if turns_wheels(structure, driver) else BEYOND)
    return Span(-reach, reach, size=size)


def turns_wheels(structure: Structure, driver: str) -> bool:
    """Whether a slide leads pairs that turn, as a rack does."""
    followers = (f for f in structure.followers.values() if driver in dict(f.terms))
    return any(structure.coupled_pair(f.coupling) == "PR" for f in followers)
