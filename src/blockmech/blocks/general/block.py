"""The general group as a user writes it: links and pairs in any frames, and a home.

Class III and higher, R and P pairs, driven pairs allowed inside: n links and p pairs, k
of them driven, with 3n = 2p + k. Its pose has no closed form, so a *home* is part of
it: a pose and the driver values at which it stands. The pose at other values is the one
that is reached from there along the straight line of driver values.

Sources: [R10] Eq. 17 and [D14] Eq. 7 (structural formula), [D14] section 4 (groups of
higher class as future work).
"""

from __future__ import annotations

from abc import abstractmethod
from collections import namedtuple
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache, cached_property
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self, TypeAlias

from pydantic import Discriminator, Tag, ValidationInfo, field_validator, model_validator

from blockmech.blocks.block import Mistake, bad_name, refuse, unknown_name, wrong_links
from blockmech.blocks.contract import (
    AssurGroup,
    BuiltIn,
    Coordinate,
    Joint,
    Kernels,
    inner_joint,
    outer_joint,
    wrong_clearance,
    wrong_friction,
)
from blockmech.blocks.general.equations import PairPlan
from blockmech.blocks.general.kernels import kernels_of
from blockmech.ground.names import is_name
from blockmech.ground.plane import largest
from blockmech.ground.validation_errors import mistake
from blockmech.ground.values import (
    POSE,
    Angle,
    Axis,
    Direction,
    Finite,
    Marker,
    Maybe,
    Number,
    Place,
    PlaceGiven,
    Sign,
    StrictModel,
    Units,
    Vector,
    VectorOrNoneGiven,
    default,
)
from blockmech.typing import Data, Parameters

if TYPE_CHECKING:
    from blockmech.assur.groups import Pair, Unit

PairType = Literal["R", "P"]
SUPPORTS = "the supports"  # how counting and its messages call all earlier links


@cache
def _numbers(*names: str) -> type[Any]:
    """The record of a group's numbers: groups of one structure share it."""
    return namedtuple("GeneralGroupNumbers", names)


class MayBeDriven(StrictModel):
    """Whether a pair is driven, the driver's name (else ``block.pair``), and how it counts.

    The coordinate of the pair, of the later link against the earlier one, is
    ``sign * q + offset`` [rad or m].
    """

    refers: ClassVar[tuple[str, ...]] = ("driver",)

    driven: bool = False
    driver: str = ""
    sign: Sign = 1
    offset: Number = default(0.0)

    def units(self, axis: Axis) -> Units:
        """The offset has that of the pair's coordinate."""
        return {"offset": Axis.of(getattr(self, "type", "")).coordinate}

    @property
    @abstractmethod
    def sides(self) -> Mapping[str, Marker]:
        """Place and direction by own link, earlier side first."""

    @model_validator(mode="after")
    def _directed(self) -> Self:
        for side in self.sides.values():
            Marker(at=side.at, angle=side.angle, dir=side.dir)  # it refuses two directions
        return self


class OuterPair(MayBeDriven):
    """A pair between an earlier link, which a wire brings, and a link of the group.

    ``at`` and the direction of a guide are in the link's frame.
    """

    type: PairType
    link: str
    at: PlaceGiven = default(Place(0j))
    angle: Maybe[Angle] = default(None)
    dir: VectorOrNoneGiven = default(None)
    slider: Literal["later", "earlier"] = "later"

    @property
    def sides(self) -> Mapping[str, Marker]:
        """Place and direction by own link."""
        return {self.link: Marker.model_construct(at=self.at, angle=self.angle, dir=self.dir)}


class InnerPair(MayBeDriven):
    """A pair between two links of the group: two places, and two directions of a guide.

    Its reaction is of the first link on the second.
    """

    type: PairType
    links: tuple[str, str]
    at: tuple[Place, Place]
    angle: tuple[Direction, Direction] | None = None
    dir: tuple[Vector, Vector] | None = None
    slider: Literal["i", "j"] = "j"

    @property
    def sides(self) -> Mapping[str, Marker]:
        """Place and direction by own link, the first one first."""
        if self.links[0] == self.links[1]:
            raise mistake("same-link", f'joins link "{self.links[0]}" to itself')
        none = (None, None)
        data = zip(self.links, self.at, self.angle or none, self.dir or none, strict=True)
        return {
            link: Marker.model_construct(at=at, angle=angle, dir=u) for link, at, angle, u in data
        }


def _kind(raw: Any) -> str:
    inner = "links" in raw if isinstance(raw, dict) else isinstance(raw, InnerPair)
    return "inner" if inner else "outer"


GroupPair: TypeAlias = Annotated[
    Annotated[OuterPair, Tag("outer")] | Annotated[InnerPair, Tag("inner")], Discriminator(_kind)
]


class Home(StrictModel):
    """A pose of the group and the driver values at which it stands.

    drivers : of every driver that moves the group or is inside it [rad or m]
    poses : x [m], y [m] and angle [rad] of each link in ground axes; refined by Newton
    """

    refers: ClassVar[tuple[str, ...]] = ("drivers",)

    drivers: dict[str, Finite] = {}
    poses: dict[str, tuple[Finite, Finite, Finite]]

    def units(self, axis: Axis) -> Units:
        """The drivers' coordinates, and places and angles."""
        return {"poses": POSE, "drivers": axis.coordinates}


class GeneralGroup(AssurGroup, type="group.general"):
    """An Assur group of any class, by its links and pairs.

    Parameters
    ----------
    links : every link of the group with its mass properties; frames are free
    pairs : outer ones with ``link``, inner ones with ``links``
    home : a pose [m, m, rad] and its driver values; the assembly mode is the one reached
        from there

    >>> group = GeneralGroup(
    ...     links={"a": {}, "b": {}},
    ...     pairs={
    ...         "B": {"type": "R", "link": "a"},
    ...         "C": {"type": "R", "links": ["a", "b"], "at": [[1.0, 0.0], [1.0, 0.0]]},
    ...         "D": {"type": "R", "link": "b"},
    ...     },
    ...     home={"drivers": {}, "poses": {"a": [0.0, 0.0, 0.5], "b": [1.6, 0.0, 2.6]}},
    ... )
    >>> group.group_class, group.kind, list(group.joints)
    ('II', 'group', ['B', 'C', 'D'])
    """

    own_form: ClassVar[bool] = True

    pairs: dict[str, GroupPair]
    home: Home

    # -- what the contract asks, from the pairs ------------------------------------------

    @cached_property
    def link_names(self) -> tuple[str, ...]:  # type: ignore[override]
        """The group's links, in the author's order."""
        return tuple(self.links)

    @cached_property
    def structural(self) -> tuple[Pair, ...]:
        """The pairs without geometry, for counting; earlier links are one, ``SUPPORTS``."""
        from blockmech.assur.groups import Pair

        pairs = []
        for name, pair in self.pairs.items():
            first, second = (SUPPORTS, *pair.sides)[-2:]
            pairs.append(Pair(name, first, second, pair.type))
        return tuple(pairs)

    @cached_property
    def unit(self) -> Unit:
        """Kind and class of the group."""
        from blockmech.assur.groups import classify

        return classify(self.link_names, self.structural, [j.name for j in self.driven])

    @property
    def group_class(self) -> str:  # type: ignore[override]
        """The group's class in Roman numerals."""
        from blockmech.assur.groups import roman

        return roman(self.unit.number)

    @property
    def kind(self) -> str:  # type: ignore[override]
        """ "triad" or "group"."""
        return "triad" if self.unit.kind == "triad" else "group"

    @cached_property
    def joints(self) -> Mapping[str, Joint]:  # type: ignore[override]
        """The pairs as joints."""
        joints = {}
        for name, pair in self.pairs.items():
            if isinstance(pair, InnerPair):
                joint = inner_joint(pair.type, pair.links, driven=pair.driven)
            else:
                reads: Any = "guide" if pair.type == "P" or pair.driven else "point"
                joint = outer_joint(pair.type, pair.link, reads, driven=pair.driven)
            joints[name] = replace(joint, name=name)
        return joints

    @cached_property
    def kernels(self) -> Kernels:  # type: ignore[override]
        """The kernels for these pairs."""
        outer = sum(j.outer for j in self.joints.values())
        return kernels_of(self.plans, len(self.link_names), outer, len(self.driven))

    @cached_property
    def plans(self) -> tuple[PairPlan, ...]:
        """The pairs by numbers of links, inputs and parameters."""
        outer = [j.name for j in self.joints.values() if j.outer]
        drives = [j.name for j in self.driven]
        plans = []
        for k, (name, pair) in enumerate(self.pairs.items()):
            joint, sides = self.joints[name], pair.sides.values()
            at = [f"at{k}_{s}" for s in range(len(sides))]
            directions = [f"u{k}_{s}" if m.direction != 1 else "" for s, m in enumerate(sides)]
            plan = PairPlan(
                prismatic=pair.type == "P",
                earlier=-1 if joint.outer else self.link_names.index(joint.links[0]),
                later=self.link_names.index(joint.later),
                outer=outer.index(name) if joint.outer else -1,
                drive=drives.index(name) if pair.driven else -1,
                at=("", at[-1]) if joint.outer else (at[0], at[1]),
                along=("", directions[-1]) if joint.outer else (directions[0], directions[1]),
                guided=joint.reads == "guide",
            )
            plans.append(plan)
        return tuple(plans)

    def parameters(self) -> Parameters:
        """Places and directions of all pairs, and the group's size."""
        numbers: Data = {"size": self.characteristic_length()}
        for k, pair in enumerate(self.pairs.values()):
            for s, marker in enumerate(pair.sides.values()):
                numbers[f"at{k}_{s}"] = marker.at.z
                numbers[f"u{k}_{s}"] = marker.direction
        return _numbers(*numbers)(**numbers)

    def largest_length(self) -> float:
        """The largest distance [m] of a pair or marker from its link's origin, or of origins."""
        return self.extent([complex(x, y) for x, y, _ in self.home.poses.values()])

    def extent(self, origins: Sequence[complex]) -> float:
        """The largest length [m] with the links' origins at these positions."""
        arms = [m.at.z for pair in self.pairs.values() for m in pair.sides.values()]
        arms += [m.at.z for link in self.links.values() for m in link.markers.values()]
        arms += [z - origins[0] for z in origins[1:]]
        return largest(map(abs, arms))

    def own_markers(self) -> dict[str, tuple[str, Marker | BuiltIn]]:
        """The markers at the pairs, each on its (first) link."""
        return {name: next(iter(pair.sides.items())) for name, pair in self.pairs.items()}

    def slider_place(self, joint: str, link: str) -> complex:
        """Place [m] of a slider's point on one of its links: the pair's place there."""
        return self.pairs[joint].sides[link].at.z

    def guide_line(self, joint: str, link: str) -> tuple[complex, complex]:
        """A place [m] on a guide line and its unit direction, in a link's frame."""
        marker = self.pairs[joint].sides[link]
        return marker.at.z, marker.direction

    def slider_owner(self, joint: str) -> Literal["later", "earlier"]:
        """Which link owns the slider's point of a prismatic pair."""
        return "earlier" if self.pairs[joint].slider in ("earlier", "i") else "later"

    def link_field(self, link: str) -> str:
        """Place of a link in what the kernels return."""
        return f"links[{self.link_names.index(link)}]"

    def joint_field(self, joint: str) -> str:
        """Place of a pair in what the kernels return."""
        return f"pairs[{list(self.pairs).index(joint)}]"

    def driver_name(self, block: str, joint: str) -> str:
        """Name of the driver at a driven pair."""
        return self.pairs[joint].driver or f"{block}.{joint}"

    def coordinate(self, joint: str) -> Coordinate:
        """Sign and offset of a driven pair's coordinate against its driver's."""
        return Coordinate(self.pairs[joint].sign, self.pairs[joint].offset)

    def effort_field(self, joint: str) -> str:
        """Place of a driving effort in the reactions."""
        return f"efforts[{[j.name for j in self.driven].index(joint)}]"

    # -- what is refused ------------------------------------------------------------------

    # Links, friction and clearance are held against the pairs, once these are read.

    @field_validator("links", "friction", "clearance")
    @classmethod
    def _check_names(cls, entries: Data, field: ValidationInfo) -> Data:
        return entries

    @model_validator(mode="after")
    def _check_consistency(self) -> GeneralGroup:
        wrong = [*self._wrong_names(), *self._wrong_pairs(), *self._wrong_home()]
        if not wrong:
            wrong = list(self._wrong_count())
        refuse(type(self).__name__, wrong)
        return self

    def _wrong_names(self) -> Iterator[Mistake]:
        for link in self.links:
            if not is_name(link):
                yield ("links", link), bad_name("link", link)
            if link in self.pairs:
                message = f'a link is called "{link}" as well'
                yield ("pairs", link), mistake("taken-name", message)
        for where, error in wrong_links(self.links, self.links, self.pairs):
            yield ("links", *where), error
        for where, error in wrong_friction(self.friction, self.joints, "pair"):
            yield ("friction", *where), error
        for where, error in wrong_clearance(self.clearance, self.joints, "pair"):
            yield ("clearance", *where), error

    def _wrong_pairs(self) -> Iterator[Mistake]:
        for name, pair in self.pairs.items():
            if not is_name(name):
                yield ("pairs", name), bad_name("pair", name)
            if pair.driver and not is_name(pair.driver):
                yield ("pairs", name, "driver"), bad_name("driver", pair.driver)
            for link in pair.sides:
                if link not in self.links:
                    key = "links" if isinstance(pair, InnerPair) else "link"
                    error = unknown_name("unknown-link", "link", link, tuple(self.links))
                    yield ("pairs", name, key), error

    def _wrong_home(self) -> Iterator[Mistake]:
        for link in self.home.poses:
            if link not in self.links:
                error = unknown_name("unknown-link", "link", link, tuple(self.links))
                yield ("home", "poses", link), error
        missing = [n for n in self.links if n not in self.home.poses]
        if missing:
            message = f"no pose for {', '.join(missing)}"
            valid = "a home has the pose of every link"
            yield ("home", "poses"), mistake("no-pose", message, valid, "add [x, y, angle]")

    def _wrong_count(self) -> Iterator[Mistake]:
        n, p = len(self.links), len(self.pairs)
        k = sum(pair.driven for pair in self.pairs.values())
        if 3 * n != 2 * p + k or not n:
            message = (
                f"{n} links, {p} pairs and {k} driven pairs: 3n = {3 * n}, 2p + k = {2 * p + k}"
            )
            yield ("pairs",), mistake("not-a-group", message, "a group has 3n = 2p + k")
