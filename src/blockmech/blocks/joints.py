"""What a block declares: its pairs, the guide lines on its links, its markers and kernels."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

from blockmech.typing import Kernel, Real

PairKind = Literal["R", "P"]
Reading = Literal["point", "guide"]


@dataclass(frozen=True)
class Pair:
    """What a kind of pair is, by its letter in files; `passes.pairs` has its forces.

    Attributes
    ----------
    word : what it is called
    freedoms : relative freedoms of its two links in the plane
    reads : what an outer one gives to the kernels, unless the block declares otherwise
    rotary : whether its coordinate is an angle
    """

    word: str
    freedoms: int
    reads: Reading
    rotary: bool

    @property
    def coordinate_unit(self) -> str:
        """Unit of its coordinate."""
        return "rad" if self.rotary else "m"

    @property
    def effort_unit(self) -> str:
        """Unit of what acts along its coordinate."""
        return "N m" if self.rotary else "N"


PAIRS: Mapping[str, Pair] = {
    "R": Pair("revolute", 1, "point", rotary=True),
    "P": Pair("prismatic", 1, "guide", rotary=False),
}


@dataclass(frozen=True)
class Line:
    """Where a guide line lies on a link, by names of parameters ("" is zero).

    The line is parallel to the link's x axis, turned by ``turn`` [rad], at
    ``offset`` [m] along its own normal; a slider's point on it is at ``along`` [m].
    """

    along: str = ""
    offset: str = ""
    turn: str = ""


@dataclass(frozen=True)
class Joint:
    """One kinematic pair of a block, declared in the class body.

    Attributes
    ----------
    kind : "R" or "P"
    link : the block's own link at an outer joint (the later link)
    links : the two own links of an inner joint, (i, j); the reaction is of i on j
    reads : what an outer joint gives to the kernels: the "point" of the wired
        marker, or its "guide" (place, direction and the rate of its link)
    lines : of a prismatic pair, its guide line on own links: link name -> `Line`
    name : filled in from the class body
    driven : whether its coordinate is an input of the block: a driver
    """

    kind: PairKind
    link: str = ""
    links: tuple[str, str] = ("", "")
    reads: Reading = "point"
    lines: Mapping[str, Line] = field(default_factory=dict)
    name: str = ""
    driven: bool = False

    @property
    def pair(self) -> Pair:
        """What its kind of pair is."""
        return PAIRS[self.kind]

    @property
    def rotary(self) -> bool:
        """Whether its coordinate is an angle."""
        return self.pair.rotary

    @property
    def coordinate_unit(self) -> str:
        """Unit of its coordinate."""
        return self.pair.coordinate_unit

    @property
    def effort_unit(self) -> str:
        """Unit of what acts along its coordinate."""
        return self.pair.effort_unit

    @property
    def outer(self) -> bool:
        """Whether an earlier link feeds the joint."""
        return bool(self.link)

    @property
    def later(self) -> str:
        """The own link on which the reported reaction acts."""
        return self.link or self.links[1]


class Coordinate(NamedTuple):
    """How a driven joint's coordinate follows its driver's: ``sign * q + offset``.

    The joint's is that of the later link against the earlier one: an angle [rad] or a
    way [m]; q is the driver's, which laws, stops, results and loads count in.
    """

    sign: int = 1
    offset: float = 0.0

    def of_joint(self, q: Real) -> Real:
        """Coordinate of the joint where the driver's is q, a number or an array."""
        return self.sign * q + self.offset


def outer_joint(
    kind: PairKind,
    link: str,
    reads: Reading | None = None,
    line: Line | None = None,
    driven: bool = False,
) -> Joint:
    """Declare a joint fed by a marker of an earlier link; ``link`` is the own one."""
    reading = reads or PAIRS[kind].reads
    return Joint(kind, link=link, reads=reading, lines={link: line} if line else {}, driven=driven)


def inner_joint(
    kind: PairKind,
    links: tuple[str, str],
    lines: Mapping[str, Line] | None = None,
    driven: bool = False,
) -> Joint:
    """Declare a joint between two own links; its reaction is of the first on the second."""
    return Joint(kind, links=links, lines=lines or {}, driven=driven)


@dataclass(frozen=True)
class BuiltIn:
    """A marker that a block brings: on ``link``, at parameter ``along`` of its x axis."""

    link: str
    along: str = ""  # "" is the link's origin


@dataclass(frozen=True)
class Kernels:
    """The mechanics of a block as pure functions; see the numbered rules.

    ``transmission(pose, p)`` gives two non-negative numbers in the ratio of sine to
    cosine of the transmission angle. ``size(pose, p)`` is the block's largest length
    [m] where no parameter says it. ``margin(pose, p)`` is the margin where the pose does
    not hold it.
    """

    position: Kernel
    velocity: Kernel
    acceleration: Kernel
    reactions: Kernel
    transmission: Kernel | None = None
    size: Kernel | None = None
    margin: Kernel | None = None
