"""Evidence of a run: residuals of the equations of mechanics, each with what it is measured by.

A residual is what is left of an equation when the numbers of a run are put into it, and its scale
is the sum of the absolute terms, from the coordinates on: both are of one link, pair or load with
all that its neighbours bring. So no error of another group hides in a residual, and the only
conditioning that it knows is that of the group's own equations, 1 / sqrt(margin).

Integrals of rates over stretches of time, and how far values gape from them, are evidence too:
by Lobatto's rule, so that what happens at an instant is seen by the node beside it. Where a rate is
no smooth function over a stretch its last Legendre coefficients do not die out: of jumps, kinks and
pulses their sum is at least four times what the rule is off by (tried at 20,000 places of each).

Source: Abramowitz & Stegun, Handbook of Mathematical Functions, 1964, 25.4.32.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache, cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.polynomial.legendre import Legendre, legvander

from blockmech.analysis.free_bodies import Body, FreeBodies, Together, unit_motions
from blockmech.functions.series import NODES as OF_PANEL
from blockmech.ground.plane import EPS
from blockmech.loads.laws import Table
from blockmech.model.structure import JointRef, LinkRef
from blockmech.typing import Array

if TYPE_CHECKING:
    from blockmech.result.result import Result

TOLERANCE = 512 * EPS  # of the sum of absolute terms times the conditioning

Part = JointRef | LinkRef | str


class Term(NamedTuple):
    """A term of an equation and its absolute size, factor by factor.

    The size of a moment is |arm| |force|, not its value: rounding of a large force
    along its arm is not seen in the value.
    """

    value: Array
    size: Array


class Residual(NamedTuple):
    """What is left of an equation (n,), and the size (n,) of what it is made of.

    equation, of : the equation in words, and the link, joint, load, driver or block that it is of
    """

    equation: str
    of: Part
    error: Array
    scale: Array


class Sizes(NamedTuple):
    """Sums of absolute forces [N], moments [N m] and powers [W] (n,) of a block."""

    force: Array
    moment: Array
    power: Array


def plain(x: Array) -> Term:
    """A term without factors."""
    return Term(np.asarray(x), np.abs(x))


def moment(arm: Array, force: Array) -> Term:
    """Moment [N m] of a force at an arm."""
    return Term((np.conj(arm) * force).imag, np.abs(arm) * np.abs(force))


def power(force: Array, v: Array) -> Term:
    """Power [W] of a force at a velocity."""
    return Term((np.conj(force) * v).real, np.abs(force) * np.abs(v))


def total(terms: Iterable[Term]) -> Term:
    """Sum of terms, and of their sizes."""
    values, sizes = zip(*terms, strict=True)
    return Term(np.sum(values, axis=0), np.sum(sizes, axis=0))


class Evidence:
    """Runs with their links as free bodies, and what each block's equations are measured by.

    Attributes
    ----------
    run : the run, or several one behind the other
    good : (n,) whether a sample has an answer
    smooth : (n,) whether it was asked for without friction
    exact : (n,) whether friction is solved there, not cut short (``single``, ``successive``)
    """

    def __init__(self, *runs: Result) -> None:
        """``runs`` of one mechanism have all outputs of blocks."""
        run = self.run = runs[0] if len(runs) == 1 else Together(runs)
        methods = np.repeat([r.settings["friction"] for r in runs], [r.n for r in runs])
        self.smooth = methods == "none"
        self.exact = self.smooth | (methods == "newton")
        self.structure = run.mechanism.structure
        self.bodies = FreeBodies(run)
        self.good = np.array([s == "ok" for s in run.quality.status])
        self.sizes = cache(self._sizes)
        self.powers = cache(self._powers)

    def condition(self, block: str) -> Array:
        """Digits that a block's dead centre may cost (n,) [-]: 1 / sqrt(margin)."""
        if block not in self.run.quality.margin:
            return np.ones(self.run.n)
        with np.errstate(all="ignore"):
            condition: Array = 1 / np.sqrt(self.run.quality.margin[block])
        return condition

    # -- forces and moments ----------------------------------------------------------

    @cached_property
    def balances(self) -> dict[LinkRef, tuple[list[Term], list[Term], Array]]:
        """Terms of the force and of the moment balance of each link, about its origin.

        With them the largest sum of coordinates [m] whose difference is an arm: an arm is known
        to the rounding of this. The balance of the frame is that of all it carries.
        """
        terms_of = {}
        for link in self.structure.links:
            o, terms = self.bodies.link(link).p, list(self.bodies.terms(link))
            joints = self.bodies.joints_on(link)  # a guide's point may be far from its slider
            moments = [plain(m) for _, _, m in terms]
            moments += [moment(p - o, f) for f, p, _ in terms]
            points = [p for _, p, _ in terms] + [e.p for j in joints for e in self.bodies.ends(j)]
            reach = np.max([np.abs(p) + np.abs(o) for p in points], axis=0, initial=0.0)
            terms_of[link] = [plain(f) for f, _, _ in terms], moments, reach
        return terms_of

    def _sizes(self, block: str) -> Sizes:
        """Sums of absolute terms of a block.

        Its reactions are solved from all its loads at once, so any of them may carry the rounding
        of the sum of all forces. At its arm that is a moment, at its speed a power, also where
        the terms themselves are nothing: loads that go straight into one pin, or pass it by less
        than coordinates show. So are its rates, and those that wires bring from a block before.
        """
        links = [LinkRef(block, link) for link in self.structure.blocks[block].link_names]
        balances = [self.balances[link] for link in links]
        force = np.sum([total(forces).size for forces, _, _ in balances], axis=0)
        reach = np.max([reach for _, _, reach in balances], axis=0)
        moment = np.sum([total(moments).size for _, moments, _ in balances], axis=0) + force * reach
        v, om = self._speeds(block, self.bodies)
        return Sizes(force, moment, total(self.powers(block)).size + force * v + moment * om)

    def _speeds(self, block: str, bodies: FreeBodies) -> tuple[Array, Array]:
        """Largest speed [m/s] and rate [rad/s] (n,) of a block and those that it hangs on."""
        outer = self.outer(block)
        blocks = {block, *(self.structure.earlier_link(ref).block for ref in outer)}
        moving = [bodies.link(link) for link in self.structure.links if link.block in blocks]
        wired = [end for ref in outer for end in bodies.ends(ref)]
        smallest = float(np.finfo(np.float64).tiny)  # below it digits go, whatever the force
        v = np.max(np.abs([body.v for body in moving + wired]), axis=0, initial=smallest)
        return v, np.max(np.abs([body.om for body in moving]), axis=0, initial=smallest)

    @cached_property
    def efforts(self) -> dict[str, Array]:
        """What the effort (n,) of each driver is made of [N m or N]: powers at its unit rate."""
        drivers, flow = self.structure.drivers, 0.0
        coordinates = np.array([self.run[f"{driver}.q"] for driver in drivers])
        bodies = unit_motions(self.run.mechanism, coordinates)
        for name in self.structure.blocks:
            v, om = (x.reshape(coordinates.shape) for x in self._speeds(name, bodies))
            size = self.sizes(name)
            flow = flow + (size.force * v + size.moment * om) * self.condition(name)
        return dict(zip(drivers, np.asarray(flow), strict=True))

    @cached_property
    def flow(self) -> Array:
        """Powers (n,) [W] that flow through all blocks, times what each may lose of them."""
        flows = [self.sizes(name).power * self.condition(name) for name in self.structure.blocks]
        return np.asarray(np.sum(flows, axis=0))

    def outer(self, block: str) -> list[JointRef]:
        """Joints by which a block hangs on earlier ones."""
        joints = self.structure.blocks[block].joints.values()
        return [JointRef(block, joint.name) for joint in joints if joint.outer]

    # -- powers ----------------------------------------------------------------------

    def _powers(self, block: str) -> list[Term]:
        """Terms of the power balance of a block: what wires bring is taken, lost or stored."""
        r, powers = self.run, []
        for name in self.structure.blocks[block].joints:
            powers.append(plain(-r[f"{block}.{name}.friction_power"]))
            if (push := self.bodies.pushes.get(JointRef(block, name))) is not None:
                powers.append(plain(push * r[f"{block}.{name}.slip"]))
        for ref in self.outer(block):
            powers += self._wire(ref, -1.0)
        for d in self.structure.drivers_of(block):
            powers += self._drive(d)
        for name in self.structure.blocks[block].link_names:
            link = LinkRef(block, name)
            for child in self.structure.carried[link]:
                powers += self._wire(child, 1.0)
            powers += self.power_of_loads(link)
            powers += self._power(self.bodies.link(link), self.bodies.couplings(link))
        return powers

    def _drive(self, driver: str) -> Iterator[Term]:
        """Power that drives a pair from its support: of its driver, or of a black box."""
        r, follower = self.run, self.structure.followers.get(driver)
        if follower is None:
            yield plain(r[f"{driver}.power"])
        elif f"{follower.coupling}.force" not in r:
            sense = self.structure.coordinate(driver).sign
            yield plain(sense * r[f"{follower.coupling}.effort"] * r[f"{driver}.rate"])

    def through_coupling(self, driver: str) -> list[Term]:
        """Powers that a coupling gives to the links that it acts on; their sum is nothing."""
        s, powers = self.structure, list(self._drive(driver))
        links = {s.later_link(s.driven[driver]): None}
        links |= {link: None for link in s.links if driver in s.coupled_on[link]}
        for link in links:
            powers += self._power(self.bodies.link(link), self.bodies.couplings(link, driver))
        return powers

    def _wire(self, ref: JointRef, sign: float) -> list[Term]:
        """Power that a wire gives to its support, times a sign."""
        earlier, _ = self.bodies.ends(ref)
        force, couple = self.run[f"{ref}.wrench_F"], self.run[f"{ref}.wrench_M"]
        return [power(sign * force, earlier.v), plain(sign * couple * earlier.om)]

    def power_of_loads(self, link: LinkRef) -> list[Term]:
        """Power of weight, inertia and elements on a link."""
        body, powers = self.bodies.link(link), []
        for source in (self.bodies.inertia_and_weight(link), self.bodies.elements(link)):
            powers += self._power(body, source)
        return powers

    def _power(self, body: Body, loads: Iterable[tuple[Array, Array, Array]]) -> list[Term]:
        """Powers of forces and couples on a link."""
        powers = []
        for force, point, couple in loads:
            powers.append(power(force, body.v + 1j * body.om * (point - body.p)))
            powers.append(plain(couple * body.om))
        return powers


def table_of(law: Table, x: Array) -> Array:
    """A table (n,) at its argument (n,), by SciPy's splines; NaN beyond its rows."""
    from scipy.interpolate import CubicSpline

    knots, values = np.asarray(law.arguments), np.asarray(law.values)
    if law.whole:
        knots, values = np.append(knots, knots[0] + law.whole), np.append(values, values[0])
        x = knots[0] + (x - knots[0]) % law.whole
    if law.interpolation == "linear":
        return np.asarray(np.interp(x, knots, values, left=math.nan, right=math.nan))
    ends = "periodic" if law.whole else "not-a-knot"
    return np.asarray(CubicSpline(knots, values, bc_type=ends, extrapolate=False)(x))


NODES = OF_PANEL // 2  # of a stretch: exact for degree 29
LAST = NODES // 4  # coefficients that tell what is left of a rate
TERM = 1024 * EPS  # of each term of a quadrature and of a dense output
TINY = float(np.finfo(np.float64).tiny)

TOP = Legendre.basis(NODES - 1)
PLACES = np.concatenate([[-1.0], np.sort(TOP.deriv().roots().real), [1.0]])
WEIGHTS = 2 / (NODES * (NODES - 1) * TOP(PLACES) ** 2)
COEFFICIENTS = WEIGHTS[:, None] * legvander(PLACES, NODES - 1) * (np.arange(NODES) + 0.5)


@dataclass(frozen=True)
class Stretches:
    """Stretches of time (m,), each from ``begin`` to ``end`` [s]."""

    begin: Array
    end: Array

    @classmethod
    def between(cls, begin: float, end: float, kinks: Iterable[float], n: int) -> Stretches:
        """Stretches (n,) over a range, each cut off at the kinks beside its middle."""
        edges, half = np.unique([begin, *kinks, end]), (end - begin) / (2 * n)
        middle = begin + (end - begin) * (np.arange(n) + 0.4) / n
        i = np.searchsorted(edges, middle, "right").clip(1, len(edges) - 1)
        return cls(np.maximum(middle - half, edges[i - 1]), np.minimum(middle + half, edges[i]))

    @cached_property
    def length(self) -> Array:
        """[s]."""
        return np.asarray(self.end - self.begin)

    @cached_property
    def nodes(self) -> Array:
        """Times (m, NODES) [s]; the first and last are within the stretch."""
        t: Array = self.begin[:, None] + self.length[:, None] * (1 + PLACES) / 2
        t[:, 0], t[:, -1] = np.nextafter(self.begin, np.inf), np.nextafter(self.end, -np.inf)
        return t

    def size(self, value: Array, rate: Array) -> Array:
        """What a value (m,) is made of: itself, and what its rate makes of a time's rounding."""
        t = np.maximum(np.abs(self.begin), np.abs(self.end))
        return np.asarray(np.abs(value).max(initial=TINY) + np.abs(rate).max(initial=0.0) * t)

    def gap(self, value: Array, rate: Array) -> Array:
        """By how much values (m, NODES) change beside the integral of rates (m,).

        What the quadrature may be off by is left out.
        """
        unsure = np.abs(rate @ COEFFICIENTS[:, -LAST:]).sum(axis=1) * self.length / 2
        change = rate @ WEIGHTS * self.length / 2
        return np.asarray(np.maximum(np.abs(value[:, -1] - value[:, 0] - change) - unsure, 0.0))

    def worst(self, value: Array, rate: Array, size: Array, share: Array) -> tuple[float, float]:
        """The worst gap relative to a size (m,), and the share (m,) of it that is allowed there."""
        error, allowed = self.gap(value, rate) / size, share + TERM
        i = int(np.argmax(error / allowed))
        return float(error[i]), float(allowed[i])
