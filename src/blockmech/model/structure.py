"""Structure: the formation sequence of a checked graph, frozen.

Sources: [R10] Eq. 17 and [D14] Eq. 7 (structural formula); Chebyshev-Gruebler
mobility 3n - 2p, or 3n - sum (3 - f) with f degrees of freedom of each pair.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from typing import NamedTuple, TypeVar

from blockmech.blocks.contract import Block, BuiltIn, Coordinate, Joint, Moving
from blockmech.couplings.contract import Coupling
from blockmech.friction.laws.contract import FrictionLaw
from blockmech.friction.laws.coulomb import Coulomb
from blockmech.ground.errors import GraphError, Problem, listed
from blockmech.ground.forms import form_of
from blockmech.ground.names import split_address
from blockmech.ground.values import Link, Marker
from blockmech.loads.contract import Element
from blockmech.signals.contract import Signal
from blockmech.typing import Data, Kernel, Record

T = TypeVar("T")
COORDINATE = "coordinate"  # last word of the outputs that are coordinates of pairs
MESH = "/mesh"  # after the name of a coupling: what no user can name, its mesh as a pair
RUB = "/touch"  # the same of its contact, where both links rub on each other
APART = "/apart"  # the same of what its contact adds in either sense of the effort
SAME_CARRIER = "give both pairs markers of one link"


class LinkRef(NamedTuple):
    """A link by the block it belongs to."""

    block: str
    link: str

    def __str__(self) -> str:
        return f"{self.block}.{self.link}"


class MarkerRef(NamedTuple):
    """A marker and the link it is on."""

    block: str
    link: str
    name: str

    @property
    def on(self) -> LinkRef:
        """The link that carries the marker."""
        return LinkRef(self.block, self.link)

    def __str__(self) -> str:
        return f"{self.block}.{self.name}"


class JointRef(NamedTuple):
    """A joint of a moving block, or a terminal of an element."""

    block: str
    name: str

    def __str__(self) -> str:
        return f"{self.block}.{self.name}"


class FollowedBranch(NamedTuple):
    """The branch of a dyad along its driver; see `blockmech.blocks.modes`.

    driver : the one driver that moves the dyad
    points : change points [rad or m], rising; of a crank those of one turn
    first : the branch where every factor of `blockmech.blocks.modes.passed` is +1
    scale : 1 rad, or a length [m] by which distances along a slide are judged
    """

    driver: str
    points: tuple[float, ...] = ()
    first: float = 1.0
    scale: float = 1.0


class Follower(NamedTuple):
    """Where the coordinate of a coupled driver comes from.

    coupling : name of the coupling
    terms : (driver, +1 or -1): the coupling's argument is the sum of these coordinates; of a
        coupling that meshes, of those of their pairs without offsets: the angle of the leading
        link against the carrier
    added : the same for what is added to the coupling's answer: the angle of the carrier
        against the link that the driven one hangs on
    leader : the pair of the driver that leads; None where the wheel is fixed to a link
    centre : the marker that is the centre of what is on the leading link
    """

    coupling: str
    terms: tuple[tuple[str, int], ...]
    added: tuple[tuple[str, int], ...]
    leader: JointRef | None
    centre: MarkerRef


@dataclass(frozen=True)
class Structure:
    """A valid mechanism: who moves whom, in formation order, ties by name.

    Attributes
    ----------
    frame : name of the frame block
    blocks : the moving blocks in formation order
    elements : the loads in name order
    feeds : joint of a moving block -> the marker wired to it
    holds : terminal of an element -> the marker wired to it
    followed : dyad whose branch follows the motion -> where it changes
    couplings : the relations between drivers in name order
    signals : the signal blocks, each after those that it reads at once
    signal_wires : input of a signal block, or law of an element -> address of what it reads
    sensors : address of what signals read -> rule that answers it; see `blockmech.outputs.sensors`
    """

    frame: str
    blocks: Mapping[str, Moving]
    elements: Mapping[str, Element]
    fixed: Block
    feeds: Mapping[JointRef, MarkerRef]
    holds: Mapping[JointRef, MarkerRef]
    followed: Mapping[str, FollowedBranch] = field(default_factory=dict)
    couplings: Mapping[str, Coupling] = field(default_factory=dict)
    signals: Mapping[str, Signal] = field(default_factory=dict)
    signal_wires: Mapping[JointRef, str] = field(default_factory=dict)
    sensors: Record = field(default_factory=dict)

    @cached_property
    def form(self) -> Hashable | None:
        """What it is but for its numbers; None where more than their form decides on a plan."""
        by_numbers = self.followed or self.signals or self.signal_wires  # which rules hold
        return None if by_numbers else form_of(self)

    @cached_property
    def remembering(self) -> tuple[JointRef, ...]:
        """Pairs whose friction law has a state of its own."""
        pairs = (JointRef(n, joint) for n, block in self.blocks.items() for joint in block.friction)
        return tuple(ref for ref in pairs if self.friction_law(ref).remembers)

    @cached_property
    def states(self) -> Mapping[JointRef, int]:
        """State of a signal block, or pair whose friction law has one -> its place among all."""
        names = (JointRef(n, x) for n, block in self.signals.items() for x in block.states)
        return {ref: i for i, ref in enumerate((*names, *self.remembering))}

    @cached_property
    def initial_states(self) -> tuple[float, ...]:
        """Where these states begin, in that order: deflections of pairs at 0."""
        own = [x.initial for b in self.signals.values() for x in b.states.values()]
        return (*own, *(0.0 for _ in self.remembering))

    @cached_property
    def driven(self) -> Mapping[str, JointRef]:
        """Driver -> the pair that it drives, in formation order.

        A driver is named after its block, or ``block.joint`` where a block may have several.
        """
        return {
            block.driver_name(name, joint.name): JointRef(name, joint.name)
            for name, block in self.blocks.items()
            for joint in block.driven
        }

    @cached_property
    def drivers(self) -> tuple[str, ...]:
        """Names of the drivers in formation order, without those that are coupled."""
        return tuple(d for d in self.driven if d not in self.followers)

    @cached_property
    def followers(self) -> Mapping[str, Follower]:
        """Coupled driver -> where its coordinate comes from, in name order of the couplings.

        Raises `GraphError` where a coupling's wheels do not turn about places of one link.
        """
        return {c.driven: self.follower(name) for name, c in self.couplings.items()}

    def follower(self, name: str) -> Follower:
        """Where the coordinate comes from that a coupling gives; see `followers`."""
        coupling = self.couplings[name]
        leader, ref = self.driven.get(coupling.driver), self.driven[coupling.driven]
        if leader is None:
            block, marker = split_address(coupling.driver, {self.frame, *self.blocks})
            centre = MarkerRef(block, self.block(block).all_markers[marker][0], marker)
            link, support = centre.on, centre.on
        else:
            centre, link = self.feeds[leader], self.later_link(leader)
            support = self.earlier_link(leader)
        follower = Follower(name, ((coupling.driver, 1),), (), leader, centre)
        if not coupling.meshes:
            return follower
        own = self.feeds[ref].on
        carriers = [k for k in (support, own) if {support, own} <= set(self.turning(k))]
        if coupling.fixed and support != own:
            carriers = []
        if not carriers:
            message = f"the centres of {coupling.driver} and {coupling.driven} are on {support} "
            message += f"and {own}"
            message += "" if coupling.fixed else ", and neither hangs on the other by driven pairs"
            groups = [k for k in (support, own) if k.block in self.blocks]
            free = [str(k) for k in groups if self.blocks[k.block].closes]
            remedy = f"couple drivers on one link: none counts how {listed(free)} turns"
            remedy = remedy if free else SAME_CARRIER
            raise GraphError(Problem("coupling-mismatch", name, message, "", remedy))
        if leader is not None and not self.joint(leader).rotary:
            if support != own:
                message = f"{coupling.driver} slides on {support}, {coupling.driven} turns on {own}"
                raise GraphError(Problem("coupling-mismatch", name, message, "", SAME_CARRIER))
            return follower
        terms = self._between(name, link, carriers[0])
        return follower._replace(terms=terms, added=self._between(name, carriers[0], own))

    def _between(self, name: str, link: LinkRef, base: LinkRef) -> tuple[tuple[str, int], ...]:
        """Drivers whose coordinates add up to the angle of a link against another one."""
        over, under = self.turning(link), self.turning(base)
        if next(reversed(over)) != next(reversed(under)):
            message = f"no driver turns {next(reversed(over))} by itself, so its turns do not count"
            valid = "wheels and their carrier hang on the frame by driven pairs alone"
            raise GraphError(Problem("coupling-mismatch", name, message, valid))
        mine, others = (set(filter(None, x.values())) for x in (over, under))
        terms = [(d, 1) for d in over.values() if d and d not in others]
        return (*terms, *((d, -1) for d in under.values() if d and d not in mine))

    def turning(self, link: LinkRef) -> dict[LinkRef, str]:
        """A link and those that it hangs on by driven pairs, each with the driver that turns it."""
        drivers: dict[LinkRef, str] = {}
        while link != self.frame_link and not self.blocks[link.block].closes:
            (driver,) = self.drivers_of(link.block)
            drivers[link] = driver if self.driver_joint(driver).rotary else ""
            link = self.earlier_link(self.driven[driver])
        return drivers | {link: ""}

    def coupling_of(self, driver: str) -> Coupling:
        """The coupling that a driver follows."""
        return self.couplings[self.followers[driver].coupling]

    def coupled_pair(self, name: str) -> str:
        """Kinds of the pairs that a coupling joins, e.g. "RP"; a wheel on a link turns."""
        coupling = self.couplings[name]
        leading = self.driven.get(coupling.driver)
        kind = "R" if leading is None else self.joint(leading).kind
        return kind + self.driver_joint(coupling.driven).kind

    def contact(self, driver: str) -> Kernel | None:
        """The contact by which a driver follows; None for a black box."""
        name = self.followers[driver].coupling
        return self.couplings[name].contact(self.coupled_pair(name))

    def touch(self, driver: str) -> Kernel | None:
        """Where a driver's link touches what it follows; None for no one place."""
        name = self.followers[driver].coupling
        return self.couplings[name].touch(self.coupled_pair(name))

    def contact_at(self, ref: JointRef) -> str | None:
        """The driver of a pair whose coupling acts by a contact on its later link; else None."""
        driver = next((d for d in self.followers if self.driven[d] == ref), None)
        return driver if driver and self.contact(driver) else None

    def leading_link(self, follower: Follower) -> LinkRef:
        """The link that a coupled driver follows, or that carries the wheel that it follows."""
        return follower.centre.on if follower.leader is None else self.later_link(follower.leader)

    @cached_property
    def coupled_on(self) -> Mapping[LinkRef, tuple[str, ...]]:
        """Drivers that follow something on a link or, of a black box, stand on its support."""
        leads = [(self.leading_link(f), driven) for driven, f in self.followers.items()]
        boxes = ((d, f.leader) for d, f in self.followers.items() if self.contact(d) is None)
        return self._by_link(*leads, *((self.earlier_link(x), d) for d, x in boxes if x))

    @cached_property
    def tensioned_on(self) -> Mapping[LinkRef, tuple[str, ...]]:
        """Drivers whose coupling loads a link without any effort."""
        tense = [d for d in self.followers if self.coupling_of(d).tension() is not None]
        leads = ((self.leading_link(self.followers[d]), d) for d in tense)
        return self._by_link(*leads, *((self.later_link(self.driven[d]), d) for d in tense))

    def turns(self, driver: str) -> int | None:
        """Turns of a driver after which all coupled links stand as before; None if never."""
        advance = {d: Fraction(d == driver) for d in self.drivers}
        whole = 1
        for name in self.driven:
            if name in advance:
                continue
            follower = self.followers[name]
            by = sum((sign * advance[d] for d, sign in follower.terms), Fraction(0))
            on = self.couplings[follower.coupling].advance(by)
            if on is None or (on and not self.driver_joint(name).rotary):
                return None
            on += sum((sign * advance[d] for d, sign in follower.added), Fraction(0))
            advance[name] = on
            whole = math.lcm(whole, by.denominator, on.denominator)
        return whole

    def drivers_of(self, block: str) -> tuple[str, ...]:
        """Drivers inside a block, in the order of its joints."""
        return tuple(driver for driver, pair in self.driven.items() if pair.block == block)

    def driver_joint(self, driver: str) -> Joint:
        """Declaration of the pair that a driver drives: units, kind."""
        return self.joint(self.driven[driver])

    def coordinate(self, driver: str) -> Coordinate:
        """How the coordinate of the driven joint follows the driver's."""
        block, joint = self.driven[driver]
        return self.blocks[block].coordinate(joint)

    @cached_property
    def paths(self) -> Data:
        """Room for the paths of groups without closed form; see `passes.homotopy`."""
        return {}

    @cached_property
    def frame_link(self) -> LinkRef:
        """The fixed link."""
        return LinkRef(self.frame, self.fixed.link_names[0])

    @cached_property
    def links(self) -> Mapping[LinkRef, int]:
        """All links with their numbers: 0 the frame, then in formation order."""
        numbers = {self.frame_link: 0}
        for name, block in self.blocks.items():
            for link in block.link_names:
                numbers[LinkRef(name, link)] = len(numbers)
        return numbers

    @cached_property
    def upstream(self) -> Mapping[str, frozenset[str]]:
        """Drivers on which each block's motion depends."""
        return {
            name: frozenset(d for d in self.drivers if self.driven[d].block in above)
            for name, above in self._ancestors.items()
        }

    @cached_property
    def carried(self) -> Mapping[LinkRef, tuple[JointRef, ...]]:
        """Joints of later blocks that each link carries, in name order."""
        return self._by_link(*((marker.on, joint) for joint, marker in sorted(self.feeds.items())))

    @cached_property
    def loaded(self) -> Mapping[LinkRef, tuple[JointRef, ...]]:
        """Terminals of elements on each link, in name order."""
        return self._by_link(*((marker.on, end) for end, marker in sorted(self.holds.items())))

    def _by_link(self, *parts: tuple[LinkRef, T]) -> Mapping[LinkRef, tuple[T, ...]]:
        """What each link has, each once."""
        on: dict[LinkRef, dict[T, None]] = {link: {} for link in self.links}
        for link, part in parts:
            on[link][part] = None
        return {link: tuple(of) for link, of in on.items()}

    @property
    def pairs(self) -> int:
        """Number of kinematic pairs; a pin of m links is m - 1 of them."""
        return sum(len(b.joints) for b in self.blocks.values())

    @property
    def mobility(self) -> int:
        """Chebyshev-Gruebler mobility 3n - sum (3 - f) of the moving links.

        What two coupled links have with each other is a pair with two degrees of freedom.
        """
        joints = (joint for block in self.blocks.values() for joint in block.joints.values())
        held = sum(3 - joint.pair.freedoms for joint in joints) + len(self.couplings)
        return 3 * (len(self.links) - 1) - held

    def supports(self, block: str) -> tuple[str, ...]:
        """Blocks that feed a block, in the order of its joints."""
        return tuple(
            self.feeds[JointRef(block, j.name)].block
            for j in self.blocks[block].joints.values()
            if j.outer
        )

    def sources(self, block: str) -> tuple[str, ...]:
        """Blocks from which a block's motion comes: its supports, and those it is coupled to."""
        blocks = dict.fromkeys(self.supports(block))
        for driver in self.drivers_of(block):
            if driver in self.followers:
                follower = self.followers[driver]
                blocks |= {self.driven[d].block: None for d, _ in follower.terms + follower.added}
                blocks[follower.centre.block] = None
        return tuple(blocks)

    def ancestors(self, block: str) -> frozenset[str]:
        """All moving blocks on which a block depends, itself included."""
        return self._ancestors[block]

    @cached_property
    def _ancestors(self) -> Mapping[str, frozenset[str]]:
        ancestors: dict[str, frozenset[str]] = {self.frame: frozenset()}
        for name in self.blocks:
            ancestors[name] = frozenset([name]).union(*(ancestors[s] for s in self.sources(name)))
        return ancestors

    @cached_property
    def meshes(self) -> Mapping[JointRef, str]:
        """Meshes as pairs of the driven block -> the driver that follows by it.

        Those that lose power or rub; and, where there is friction, what a contact adds in either
        sense of the effort, which loads the pins that rub.
        """
        rubs = any(law.acts for b in self.blocks.values() for law in b.friction.values())
        rubs |= any(coupling.rubs for coupling in self.couplings.values())
        found: dict[JointRef, str] = {}
        for driver, follower in self.followers.items():
            coupling, name = self.couplings[follower.coupling], follower.coupling
            kinds = [MESH] * bool(coupling.lost) + [RUB] * bool(coupling.rubs)
            kinds += [APART] * (coupling.sided and rubs)
            found |= {JointRef(self.driven[driver].block, name + kind): driver for kind in kinds}
        return found

    def meshes_of(self, driver: str) -> tuple[JointRef, ...]:
        """The `meshes` by which a driver follows."""
        return tuple(mesh for mesh, follows in self.meshes.items() if follows == driver)

    def separates(self, ref: JointRef) -> bool:
        """Whether a pair is a mesh that only adds to its contact: without slip and work."""
        return ref.name.endswith(APART)

    def signed(self, ref: JointRef) -> bool:
        """Whether the law of a pair says the sign of its friction, whatever the sense of slip."""
        return self.separates(ref) or self.friction_law(ref).remembers

    def pair_name(self, ref: JointRef) -> str:
        """Name of a pair in answers: a mesh has that of its coupling, but for what only adds."""
        name, kind, _ = ref.name.partition("/")
        return name if kind and not self.separates(ref) else str(ref)

    def touches(self, ref: JointRef) -> bool:
        """Whether a pair is the contact of a coupling, whose links rub on each other there."""
        return ref.name.endswith(RUB)

    def joint(self, ref: JointRef) -> Joint:
        """Declaration of a joint."""
        return self.blocks[ref.block].joints[ref.name]

    def friction_law(self, ref: JointRef) -> FrictionLaw:
        """The friction law of a joint that has one; of a mesh its losses."""
        name, mark, _ = ref.name.partition("/")
        if mark:
            coupling = self.couplings[name]
            if ref.name.endswith(MESH):
                return Coulomb.model_construct(coefficient=coupling.lost, guide_length=2.0)
            return Coulomb.model_construct(coefficient=coupling.rubs if self.touches(ref) else 1.0)
        return self.blocks[ref.block].friction[ref.name]

    def block(self, name: str) -> Block:
        """A block by name, the frame included."""
        return self.fixed if name == self.frame else self.blocks[name]

    def marker(self, ref: MarkerRef) -> Marker | BuiltIn:
        """Declaration of a marker."""
        return self.block(ref.block).all_markers[ref.name][1]

    def markers(self, block: str) -> tuple[MarkerRef, ...]:
        """All markers of a block."""
        markers = self.block(block).all_markers.items()
        return tuple(MarkerRef(block, link, name) for name, (link, _) in markers)

    def properties(self, link: LinkRef) -> Link:
        """Mass properties of a link."""
        return self.block(link.block).links_or_default()[link.link]

    def earlier_link(self, ref: JointRef) -> LinkRef:
        """The earlier link of a pair: the support, or link i of an inner pair."""
        joint = self.joint(ref)
        return self.feeds[ref].on if joint.outer else LinkRef(ref.block, joint.links[0])

    def later_link(self, ref: JointRef) -> LinkRef:
        """The later link of a pair, the one on which its reaction is reported."""
        return LinkRef(ref.block, self.joint(ref).later)

    @property
    def formula(self) -> str:
        """Structural formula in the papers' manner, e.g. ``I(crank: 0,1) -> II RRR(dyad: 2,3)``."""
        return " -> ".join(self._term(name) for name in self.blocks)

    def _term(self, name: str) -> str:
        block = self.blocks[name]
        own = [self.links[LinkRef(name, link)] for link in block.link_names]
        if not block.closes:
            joint = next(JointRef(name, j.name) for j in block.joints.values() if j.outer)
            own.insert(0, self.links[self.feeds[joint].on])
            head = block.group_class
        else:
            head = f"{block.group_class} {block.kind}"
        return f"{head}({name}: {','.join(map(str, own))})"
