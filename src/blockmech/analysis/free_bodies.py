"""Free bodies: how each link moves, what acts on it, and how it moves against its neighbours.

Everything is read from the labelled outputs of a run and from what the document declares: places
of joints on their links, guides, centres of mass. The kernels that made the numbers are not
asked; a link here is a rigid body, whatever group it is in.

Source: [R10] Ruiz, Durango & Calle 2010, Eqs. 2-7.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache, cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from blockmech.dynamics.pair_stops import lain_against
from blockmech.model.spots import guide_spots, marker_place
from blockmech.model.structure import JointRef, LinkRef, Structure
from blockmech.result.samples import Samples
from blockmech.typing import Array

if TYPE_CHECKING:
    from blockmech.compiled import Compiled
    from blockmech.result.quality import Quality
    from blockmech.result.result import Result

Side = tuple[complex, complex]
MOTION = ("p", "v", "a", "angle", "omega", "alpha")  # outputs of a link


class Body(NamedTuple):
    """Motion (n,) of a point of a link, and of the link.

    p, v, a : place [m], velocity [m/s] and acceleration [m/s2] of the point, complex
    e, om, al : unit direction of the link, its rate [rad/s] and angular acceleration [rad/s2]
    """

    p: Array
    v: Array
    a: Array
    e: Array
    om: Array
    al: Array

    def at(self, point: complex) -> Body:
        """The same of a place [m] in the link's frame, where self is its origin."""
        arm = self.e * point
        spin = 1j * self.al - self.om**2
        return self._replace(p=self.p + arm, v=self.v + 1j * self.om * arm, a=self.a + spin * arm)

    def seen(self, point: Body) -> tuple[Array, Array, Array]:
        """Place, velocity and acceleration of another point as self's link sees them."""
        d = point.p - self.p
        w = point.v - self.v - 1j * self.om * d
        spin = 1j * self.al - self.om**2
        b = point.a - self.a - spin * d - 2j * self.om * w
        return d, w, b

    def parting(self, partner: Body, slides: bool) -> Array:
        """Acceleration (n,) of another link along self's direction, or of its turning."""
        relative: Array = (np.conj(self.e) * self.seen(partner)[2]).real
        return relative if slides else partner.al - self.al

    def sizes(self, point: Body) -> tuple[Array, Array, Array]:
        """Sums of the absolute terms of `seen`, from the coordinates on."""
        s = np.abs(self.p) + np.abs(point.p)
        rate = np.abs(self.om) + np.abs(point.om)
        v = np.abs(self.v) + np.abs(point.v) + rate * s
        a = np.abs(self.a) + np.abs(point.a) + (np.abs(self.al) + np.abs(point.al)) * s
        return s, v, a + rate * v


class Together:
    """Runs of one mechanism that differ in their friction, read as one with all their samples."""

    def __init__(self, runs: Sequence[Result]) -> None:
        self._runs, (first, *_) = runs, runs
        self.mechanism, self.motion, self.samples = first.mechanism, first.motion, first.samples
        self.settings, self.n = first.settings, sum(run.n for run in runs)
        self.time = None if first.time is None else np.concatenate([run.time for run in runs])
        self._read: dict[str, Array] = {}

    def __getitem__(self, name: str) -> Array:
        if name not in self._read:
            self._read[name] = np.concatenate([run[name] for run in self._runs])
        return self._read[name]

    def __contains__(self, name: str) -> bool:
        return name in self._runs[0]

    @cached_property
    def quality(self) -> Quality:
        """Status of each sample, and the margins."""
        parts = [run.quality for run in self._runs]
        margin = {name: np.concatenate([q.margin[name] for q in parts]) for name in parts[0].margin}
        status = tuple(itertools.chain.from_iterable(q.status for q in parts))
        return replace(parts[0], status=status, margin=margin)


class FreeBodies:
    """The links of a run, each with what acts on it.

    run : a run of blocks with all outputs; arrays are (n,) over its samples
    """

    def __init__(self, run: Result | Together) -> None:
        self.run = run
        self.structure: Structure = run.mechanism.structure
        self.link: Callable[[LinkRef], Body] = cache(self._link)

    def _link(self, link: LinkRef) -> Body:
        """Motion of a link's origin, and of the link."""
        if link == self.structure.frame_link:
            zero = np.zeros(self.run.n)
            still = zero + 0j
            return Body(still, still, still, still + 1, zero, zero)
        r = self.run
        o, v, a, angle, om, al = (r[f"{link}.{quantity}"] for quantity in MOTION)
        return Body(o, v, a, np.exp(1j * angle), om, al)

    # -- pairs ---------------------------------------------------------------------

    def side(self, ref: JointRef, link: LinkRef) -> Side:
        """Place [m] of a pair on one of its links, and its unit direction there; as declared."""
        if link.block != ref.block:
            marker = self.structure.feeds[ref]
            direction = getattr(self.structure.marker(marker), "direction", 1 + 0j)
            return marker_place(self.structure, marker), direction
        block = self.structure.blocks[ref.block]
        if block.own_form or block.joints[ref.name].kind == "P":
            return block.guide_line(ref.name, link.link)
        markers = block.all_markers
        for name in (ref.name, f"{ref.name}j"):
            if name in markers and markers[name][0] == link.link:
                return block.place_of(markers[name][1]), 1 + 0j
        raise KeyError(f"{ref} has no marker on {link}")

    def ends(self, ref: JointRef) -> tuple[Body, Body]:
        """The earlier and the later link of a pair where it sits; e is the pair's direction."""
        links = self.structure.earlier_link(ref), self.structure.later_link(ref)
        bodies = []
        for link in links:
            at, direction = self.side(ref, link)
            end = self.link(link).at(at)
            bodies.append(end._replace(e=end.e * direction))
        return bodies[0], bodies[1]

    # -- what acts -----------------------------------------------------------------

    @cached_property
    def pushes(self) -> dict[JointRef, Array]:
        """What end stops push with along the coordinates of pairs, on their later links."""
        motion = self.run.motion
        lying = () if motion is None else motion.lying
        inputs, refs = self.run.samples.inputs, lain_against(self.run.mechanism, lying).refs
        return {ref: np.asarray(inputs[f"push_{j}"]) for j, ref in enumerate(refs)}

    def terms(self, link: LinkRef) -> Iterator[tuple[Array, Array, Array]]:
        """Everything that acts on a link: force [N], where it acts [m], couple [N m]."""
        yield from self.inertia_and_weight(link)
        yield from self.elements(link)
        yield from self.couplings(link)
        for joint in self.joints_on(link):
            yield from self._pair(joint, link)

    def inertia_and_weight(self, link: LinkRef) -> Iterator[tuple[Array, Array, Array]]:
        """Weight and, unless the run is static, D'Alembert's force and couple."""
        properties = self.structure.properties(link)
        if link == self.structure.frame_link or not properties.massive:
            return
        r, cm = self.run, self.link(link).at(properties.cm.z)
        force = np.full(r.n, properties.mass * r.mechanism.scene.gravity.z)
        couple = np.zeros(r.n)
        if not r.settings["static"]:
            force = force - properties.mass * cm.a
            couple = -properties.inertia * cm.al
        yield force, cm.p, couple

    def elements(self, link: LinkRef) -> Iterator[tuple[Array, Array, Array]]:
        """Forces and couples of springs, dampers and other loads."""
        r, zero = self.run, np.zeros(self.run.n)
        for terminal in self.structure.loaded[link]:
            point = self.held(terminal).p
            if f"{terminal}.force" in r:
                yield r[f"{terminal}.force"], point, zero
            else:
                yield zero + 0j, point, r[f"{terminal}.couple"]

    def couplings(self, link: LinkRef, only: str = "") -> Iterator[tuple[Array, Array, Array]]:
        """What couplings do to a link: contacts, and what black boxes take from the leader.

        ``only`` is a coupled driver whose coupling alone is wanted.
        """
        r, s, zero = self.run, self.structure, np.zeros(self.run.n)
        for driver, (name, terms, _, leader, centre) in s.followers.items():
            if only not in ("", driver):
                continue
            ref, later = s.driven[driver], None if leader is None else s.later_link(leader)
            if f"{name}.force" in r:
                ends = {s.later_link(ref): 1.0, later or centre.on: -1.0}
                if (sign := ends.get(link)) is not None:
                    point = self.ends(ref)[0].p
                    yield sign * r[f"{name}.force"], point, sign * r[f"{name}.moment"]
            elif leader is not None and link in (later, s.earlier_link(leader)):
                x, felt = self.argument(driver), self.felt(driver)
                if f"{name}.loss" in r:
                    felt = felt + r[f"{name}.loss"] / np.where(x == 0, math.inf, x)
                felt *= 1 if s.couplings[name].meshes else s.coordinate(terms[0][0]).sign
                t, end = (-felt if link == later else felt), self.ends(leader)[0]
                yield (zero + 0j, end.p, t) if s.joint(leader).rotary else (t * end.e, end.p, zero)

    def argument(self, driver: str) -> Array:
        """Rate (n,) of what a coupled driver is a function of."""
        r, s = self.run, self.structure
        name, terms = s.followers[driver][:2]
        if not s.couplings[name].meshes:
            return r[f"{terms[0][0]}.rate"]
        rates = (sign * s.coordinate(d).sign * r[f"{d}.rate"] for d, sign in terms)
        return np.asarray(sum(rates))

    def felt(self, driver: str) -> Array:
        """Effort (n,) of a coupled driver along what it is a function of, without losses."""
        r, s = self.run, self.structure
        name = s.followers[driver].coupling
        counted = 1 if s.couplings[name].meshes else s.coordinate(driver).sign
        return np.asarray(counted * r[f"{name}.slope"] * r[f"{name}.effort"])

    def held(self, terminal: JointRef) -> Body:
        """Where an element takes hold of a link."""
        marker = self.structure.holds[terminal]
        return self.link(marker.on).at(marker_place(self.structure, marker))

    def joints_on(self, link: LinkRef) -> list[JointRef]:
        """Pairs of a link, its block's own and those that it carries."""
        pairs = []
        if link != self.structure.frame_link:
            joints = self.structure.blocks[link.block].joints.values()
            pairs = [
                JointRef(link.block, j.name) for j in joints if link.link in (j.link, *j.links)
            ]
        return pairs + list(self.structure.carried[link])

    def _pair(self, ref: JointRef, link: LinkRef) -> Iterator[tuple[Array, Array, Array]]:
        """What a pair does to one of its links: the reported reaction, friction and drive.

        Friction and drive are terms of their own: one may be the answer to the other.
        """
        r, joint = self.run, self.structure.joint(ref)
        sign = 1.0 if self.structure.later_link(ref) == link else -1.0
        earlier, _ = self.ends(ref)
        revolute, point, zero = joint.kind == "R", earlier.p, np.zeros(r.n)
        if not revolute:  # the slider's point
            spot = guide_spots(self.structure, ref)[0]
            point = self.link(spot.link).at(spot.at).p
        yield sign * r[f"{ref}.reaction"], point, zero if revolute else sign * r[f"{ref}.C"]
        efforts = [sign * r[f"{ref}.friction"]]
        efforts += [sign * self.pushes[ref]] if ref in self.pushes else []
        if joint.driven:
            driver = self.structure.blocks[ref.block].driver_name(*ref)
            efforts += [sign * x for x in self._drive(driver)]
        for t in efforts:
            yield (zero + 0j, point, t) if revolute else (t * earlier.e, point, zero)

    def _drive(self, driver: str) -> Iterator[Array]:
        """What drives the later link of a driven pair from its support, if anything does."""
        follower = self.structure.followers.get(driver)
        if follower is None:
            yield self.structure.coordinate(driver).sign * self.run[f"{driver}.drive"]
        elif f"{follower.coupling}.force" not in self.run:
            yield self.run[f"{follower.coupling}.effort"]


def unit_motions(mechanism: Compiled, q: Array) -> FreeBodies:
    """The links at places (k, n) of the drivers: (k n) samples, a driver at unit rate in each.

    The first n are of the first driver, the others stand.
    """
    (k, n), structure = q.shape, mechanism.structure
    links = [link for link in structure.links if link != structure.frame_link]
    want = [f"{link}.{x}" for link in links for x in MOTION]
    want += [f"{JointRef(name, x)}.slip" for name, b in structure.blocks.items() for x in b.joints]
    want += [f"{driver}.rate" for driver in structure.driven]
    inputs: dict[str, Array] = {}
    for i, rates in enumerate(np.repeat(np.eye(k), n, axis=1)):
        inputs |= {f"q_{i}": np.tile(q[i], k), f"qd_{i}": rates, f"qdd_{i}": 0 * rates}
    samples = Samples(k * n, inputs)
    return FreeBodies(mechanism._answer(samples, want, {"friction": "none", "static": False}))
