"""Joint friction at the extremes: a press and a rocker with a massless rod, in closed form.

The rod carries a force along a line that touches the friction circles of both its pins, whether it
pushes or pulls; the ram is held by its guide, the rocker by its pins. All is worked out in 60
digits (mpmath), and again with the numbers moved by half an ulp: what rounding of the data alone
leaves.
"""

from __future__ import annotations

import math
import random
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from mpmath import mp, mpf

import blockmech as bm
from blockmech import Graph
from blockmech.engines.numpy import PRECISIONS
from tests.machines import wire

from .precise import DIGITS
from .scenes import as_general_group

SHAKES = 6
LOAD = 10000.0  # [N] on the ram, towards the crank, or [N m] on the rocker, against the rod
SIDE = -1  # sense in which the rod, when it pushes, turns the rocker of branch 1


@dataclass(frozen=True)
class Press:
    """A press: crank and rod [m], radius of the friction circles [m], friction of the guide [-].

    ``q`` [rad] is measured from its dead centre, ``sense`` is the way it turns.
    """

    name: str
    q: float
    sense: int = -1
    rho: float = 0.0
    guide: float = 0.0
    crank: float = 0.1
    rod: float = 0.3

    @property
    def graph(self) -> Graph:
        """The press as blocks; pins of coefficient 1 have friction circles of their radius."""
        g = Graph("press")
        g.add("frame", bm.Frame(markers={"O": 0j, "G": bm.Marker(at=0j, angle=0.0)}))
        pins = {j: bm.friction.Coulomb(coefficient=1.0, radius=self.rho) for j in "ABC" if self.rho}
        own = {j: pins.pop(j) for j in ("A",) if self.rho}
        g.add("crank", bm.Crank(length=self.crank, friction=own))
        if self.guide:
            pins["S"] = bm.friction.Coulomb(coefficient=self.guide)
        g.add("ram", bm.RRP(l=self.rod, h=0.0, branch=1, friction=pins))
        g.add("work", bm.Force(force=(-LOAD, 0.0)))
        return wire(g, "frame.O crank.A", "crank.B ram.B", "frame.G ram.S", "ram.j work.at")

    def moments(self, seed: int | None = None, dtype: Any = np.float64) -> list[tuple[int, Any]]:
        """Driving moments [N m] in 60 digits, one for each force that balances the load.

        With each stands 1 where the rod pushes, as it does without friction, -1 where it pulls.
        With a seed, lengths and friction are moved by half a unit in the last place.
        """
        return self.moments_of(moved(self.numbers, seed, dtype))

    @property
    def numbers(self) -> tuple[float, ...]:
        """What the truth is made of."""
        return (self.crank, self.rod, self.rho, self.guide)

    @property
    def addresses(self) -> dict[str, int]:
        """Addresses of numbers of the graph, and their places among `numbers`."""
        guided = {"ram.friction.S.coefficient": 3} if self.guide else {}
        return {"crank.length": 0, "ram.l": 1, **guided}

    def moments_of(self, numbers: Sequence[Any]) -> list[tuple[int, Any]]:
        """Moments of numbers (mpf)."""
        r, l, rho, mu = numbers
        q, sense = mpf(self.q), self.sense
        phi = -mp.asin(r * mp.sin(q) / l)
        rod = -r * mp.cos(q) / (l * mp.cos(phi)) * sense  # its rate at unit rate of the crank
        ram = -sense * mp.sin(q) * r * (1 + r * mp.cos(q) / (l * mp.cos(phi)))
        at_b, at_c = mp.sign(rod - sense), mp.sign(-rod)
        aside = (at_c - at_b) * rho / l
        solutions = []
        for push in (1, -1):
            if abs(aside) >= 1:
                break  # the circles overlap: the rod carries nothing
            along = phi + mp.asin(push * aside)
            remainder = push * mp.cos(along) - mp.sign(ram) * mu * abs(mp.sin(along))
            if remainder > 0:  # else the guide holds whatever presses it
                lever = push * r * mp.sin(along - q) + (sense - at_b) * rho
                solutions.append((push, lever * LOAD / remainder))
        return solutions

    @property
    def at(self) -> float:
        """Coordinate of the crank [rad]."""
        return self.q


@dataclass(frozen=True)
class Rocker:
    """A crank that turns a rocker against a couple by a rod without mass: friction in an RRR dyad.

    Rod and rocker are a relative ``gap`` short of stretched; ``rho`` [m] is the radius of all
    friction circles. ``general``: the dyad as a general group.
    """

    name: str
    gap: float
    rho: float
    sense: int = 1
    general: bool = False
    at: float = 0.7
    crank: float = 0.3
    rod: float = 1.0
    rocker: float = 0.6

    @property
    def pivot(self) -> complex:
        """Of the rocker [m]."""
        tip = self.crank * complex(math.cos(self.at), math.sin(self.at))
        return tip + (self.rod + self.rocker) * (1 - self.gap) * complex(math.cos(2), math.sin(2))

    @property
    def graph(self) -> Graph:
        """The mechanism as blocks."""
        g = Graph("rocker")
        g.add("frame", bm.Frame(markers={"A": 0j, "D": self.pivot}))
        pins = {j: bm.friction.Coulomb(coefficient=1.0, radius=self.rho) for j in "ABCD"}
        g.add("crank", bm.Crank(length=self.crank, friction={"A": pins.pop("A")}))
        links = {name: bm.Link() for name in "ij"}
        g.add("dyad", bm.RRR(l_i=self.rod, l_j=self.rocker, links=links, friction=pins))
        g.add("work", bm.Couple(moment=-LOAD * SIDE))
        wire(g, "frame.A crank.A", "crank.B dyad.B", "frame.D dyad.D", "dyad.j work.on")
        return as_general_group(g, {"crank": self.at}) if self.general else g

    def moments(self, seed: int | None = None, dtype: Any = np.float64) -> list[tuple[int, Any]]:
        """As those of a press."""
        return self.moments_of(moved(self.numbers, seed, dtype))

    @property
    def numbers(self) -> tuple[float, ...]:
        """As those of a press."""
        pivot = self.pivot
        return (self.crank, self.rod, self.rocker, self.rho, pivot.real, pivot.imag)

    @property
    def addresses(self) -> dict[str, int]:
        """As those of a press."""
        places = {"crank.length": 0, "dyad.l_i": 1, "dyad.l_j": 2, "frame.D.x": 4, "frame.D.y": 5}
        return {} if self.general else places

    def moments_of(self, numbers: Sequence[Any]) -> list[tuple[int, Any]]:
        """As those of a press."""
        r, l, c, rho, x, y = numbers
        tip, sense = r * mp.expj(mpf(self.at)), self.sense
        aside = mp.mpc(x, y) - tip
        reach = abs(aside)
        bend = mp.acos((l**2 + reach**2 - c**2) / (2 * l * reach))
        rod = l * aside / reach * mp.expj(-SIDE * bend)
        arm = tip + rod - mp.mpc(x, y)
        turn_i = -sense * _dot(1j * tip, arm) / _dot(1j * rod, arm)
        turn_j = sense * _dot(1j * tip, rod) / _dot(1j * arm, rod)
        at_b, at_c = mp.sign(turn_i - sense), mp.sign(turn_i - turn_j)
        at_d = mp.sign(turn_j)
        solutions = []
        for push in (1, -1):
            sine = -push * (at_b + at_c) * rho / l
            if abs(sine) >= 1:
                break
            force = push * rod / l * mp.expj(mp.asin(sine))  # on the rocker, for each newton
            remainder = SIDE * (_cross(arm, force) + (at_c - at_d) * rho)
            if remainder > 0:
                lever = _cross(tip, force) + (sense - at_b) * rho
                solutions.append((push, lever * LOAD / remainder))
        return solutions


def _dot(a: Any, b: Any) -> Any:
    return a.real * b.real + a.imag * b.imag


def _cross(a: Any, b: Any) -> Any:
    return a.real * b.imag - a.imag * b.real


def moved(numbers: tuple[float, ...], seed: int | None, dtype: Any) -> list[Any]:
    """Numbers as a precision holds them; with a seed half a unit in the last place aside."""
    dice, half = random.Random(seed), 0 if seed is None else mpf(float(np.finfo(dtype).eps)) / 2
    return [mpf(float(dtype(x))) * (1 + half * dice.choice((-1, 1))) for x in numbers]


def rockers() -> Iterator[Rocker]:
    """Friction from almost none to what locks, ever nearer the dead centre of the dyad."""
    for gap in (1e-1, 1e-3, 1e-6):
        for rho in (1e-14, 1e-4, 1e-2, 0.1, 0.4):
            for sense, direction in ((1, "forward"), (-1, "back")):
                name = f"rocker {direction}, {gap:.0e} short of stretched, rho {rho}"
                yield Rocker(name, gap, rho, sense)
                if gap > 1e-6:
                    yield Rocker(f"general, {name}", gap, rho, sense, True)


def presses() -> Iterator[Press]:
    """Near the dead centre, up to friction that locks, and guides about to jam."""
    for gap in (1e-1, 1e-4, 1e-8, 1e-11):  # nearer the ram counts as at rest
        for rho in (0.0, 0.003, 0.1, 0.149, 0.2):
            yield Press(f"press {gap:.0e} rad before its dead centre, rho {rho}", gap, -1, rho, 0.1)
            yield Press(f"press {gap:.0e} rad beyond it, rho {rho}", gap, 1, rho, 0.1)
    tangent = math.tan(math.asin(0.29 * math.sin(1.2) / 0.3))  # of the rod
    for short in (1e-2, 1e-4, 1e-8, 1e-12, -1e-12, -1e-8, -1e-2):
        name = f"guide {abs(short):.0e} {'short of' if short > 0 else 'beyond'} jamming"
        yield Press(name, 1.2, -1, 0.0, (1 - short) / tangent, crank=0.29)


@dataclass(frozen=True)
class Found:
    """What a press gave, and what it was told.

    error : relative; NaN where there is no truth or no answer
    forced : what half an ulp in the data does to the truth, relative
    balanced : whether a force balances the load at all
    """

    error: float
    forced: float
    balanced: bool
    status: str
    flags: tuple[str, ...]


@cache
def found(case: Press | Rocker, precision: str, engine: str = "numpy") -> Found:
    """The driving moment with friction by Newton, against the truth."""
    dtype = PRECISIONS[precision]
    run = case.graph.compile().run(
        at=case.at, rates=float(case.sense), want="crank.drive", static=True,
        engine=engine, precision=precision, on_gap="mark",
    )  # fmt: skip
    with mp.workdps(DIGITS):
        # What the numbers say as they are, as doubtful friction is computed with them.
        truth = dict(case.moments()).get(1)
        error = forced = np.nan
        if truth is not None:
            error = float(abs(mpf(float(run["crank.drive"][0])) / truth - 1))
            shaken = (dict(case.moments(seed, dtype)).get(1) for seed in range(SHAKES))
            forced = max(np.inf if m is None else float(abs(m / truth - 1)) for m in shaken)
    flags = tuple(flag.code for flag in run.quality.flags)
    return Found(error, forced, truth is not None, run.quality.status[0], flags)


@dataclass(frozen=True)
class Solved:
    """All solutions of a case: how many are found, how many there are, and whether it is proved.

    error, forced : largest, relative, of driving moments; forced infinite where noise of the data
        makes a solution or takes one away
    """

    found: int
    true: int
    proof: str
    error: float
    forced: float


def solved(case: Press | Rocker) -> Solved:
    """All solutions of the friction equations, against the truth."""
    rates = float(case.sense)
    answer = case.graph.compile().friction_solutions(
        case.at, rates=rates, static=True, want="crank.drive"
    )
    with mp.workdps(DIGITS):
        mine = [mpf(float(x)) for x in answer["crank.drive"]]
        truth = dict(case.moments())
        errors = [min((abs(x / m - 1) for x in mine), default=mp.inf) for m in truth.values()]
        forced = mpf(0)
        for seed in range(SHAKES):
            shaken = dict(case.moments(seed))
            same = shaken.keys() == truth.keys()
            off = [abs(shaken[s] / m - 1) for s, m in truth.items()] if same else [mp.inf]
            forced = max([forced, *off])
    return Solved(
        len(mine), len(truth), answer.proof[0], float(max(errors, default=0)), float(forced)
    )


def slopes(case: Press | Rocker) -> tuple[float, float]:
    """Error, and what half an ulp in the data forces, of the moment's derivatives by lengths.

    Both relative to the largest derivative; the moment must exist.
    """
    names = case.addresses
    answer = case.graph.compile().sensitivity(
        "crank.drive", to=tuple(names), at=case.at, rates=float(case.sense), static=True
    )

    def truth(numbers: Sequence[Any]) -> list[Any]:
        def along(i: int) -> Any:
            return lambda x: dict(case.moments_of([*numbers[:i], x, *numbers[i + 1 :]]))[1]

        return [mp.diff(along(i), numbers[i], h=mpf(10) ** -25) for i in names.values()]

    with mp.workdps(2 * DIGITS):
        exact = truth(moved(case.numbers, None, np.float64))
        size = max(map(abs, exact))
        mine = [mpf(float(answer["crank.drive", name][0])) for name in names]
        error = max(abs(a - b) for a, b in zip(mine, exact, strict=True)) / size
        shaken = [truth(moved(case.numbers, seed, np.float64)) for seed in range(SHAKES)]
        off = [abs(a - b) for row in shaken for a, b in zip(row, exact, strict=True)]
        return float(error), float(max(off) / size)
