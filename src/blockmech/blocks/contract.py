"""What a block is: the contract that every block keeps.

A block declares its joints, links and markers and brings four kernels; wiring
checks, schedules, drawings, schemas and documents are derived from that. The
rules are numbered, and `blockmech.testing.conformance` tests them by number:

 1. Inputs are declared: a kernel gets what its outer joints read, in the order
    of declaration, the coordinates of its driven joints (or their rates), and the
    block's parameters ``p``. Nothing else.
 2. Outputs depend on inputs and parameters only.
 3. ``position`` returns a named tuple with a `LinkPosition` per link, named like
    the link; a group adds ``margin``: at most 1, 0 at dead centre, negative where
    the group cannot close.
 4. ``velocity`` is linear in the velocities it gets. It returns a `LinkVelocity`
    per link and, named like the joint, the sliding rate of each prismatic pair.
 5. ``acceleration`` is affine in the accelerations it gets. It returns a
    `LinkAcceleration` per link.
 6. ``reactions`` is linear in the loads (`Load` per link about the link's own
    origin). It returns, named like the joint, a force for a revolute pair and a
    `Slide` for a prismatic pair (outer: on the group; inner: of link i on link j),
    and ``tau`` for a driven joint. A slide's couple is about the origin of the later
    link, and of an inner slide also about that of link i, each from what that link's own
    loads say best; the core moves the one of the slider's owner to the slider's point.
 7. Kernels are batch-transparent: any batch shape, no loop over samples.
 8. NaN in, NaN out.
 9. Impossible samples are NaN, never an exception.
10. Reactions balance every link, and each wire's power balances: what flows in
    through the outer joints is what the loads take out.
"""

from __future__ import annotations

import functools
import inspect
import math
from collections import namedtuple
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any, ClassVar, Literal, LiteralString, TypeAlias

from pydantic import ValidationError, field_validator
from pydantic_core import InitErrorDetails, PydanticCustomError

from blockmech.blocks.joints import (
    BuiltIn,
    Coordinate,
    Joint,
    Kernels,
    Line,
    inner_joint,
    outer_joint,
)
from blockmech.blocks.registry import REGISTRY
from blockmech.errors import close_match, listed
from blockmech.friction.laws import Coulomb
from blockmech.values import NAME_RULE, Link, Marker, Pair, Strictly, is_name, mistake

__all__ = [
    "AssurGroup",
    "Block",
    "BuiltIn",
    "Coordinate",
    "DrivingLink",
    "Joint",
    "Kernels",
    "Line",
    "Moving",
    "inner_joint",
    "outer_joint",
]

Mistake: TypeAlias = tuple[tuple[str, ...], PydanticCustomError]
"""Where in a model, and what is wrong there."""


class Block(Strictly):
    """Anything that stands in a graph. Concrete classes register under their ``type``."""

    model_config = {"ignored_types": (Joint, Kernels)}

    type_name: ClassVar[str] = ""
    joints: ClassVar[Mapping[str, Joint]] = {}
    link_names: ClassVar[tuple[str, ...]] = ()
    built_in: ClassVar[Mapping[str, BuiltIn]] = {}

    def __init_subclass__(cls, type: str = "", **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)

    @classmethod
    def __pydantic_init_subclass__(cls, type: str = "", **kwargs: Any) -> None:
        if not type:
            return
        if not getattr(cls, "own_form", False):
            _declare(cls)
        REGISTRY.register(type, cls)

    def links_or_default(self) -> dict[str, Link]:
        """Every link of the block with its mass properties and markers."""
        given: dict[str, Link] = getattr(self, "links", {})
        return {name: given.get(name, NO_LINK) for name in self.link_names}

    def own_markers(self) -> dict[str, tuple[str, Marker | BuiltIn]]:
        """The markers that the block brings at its joints: name -> (link, marker)."""
        return {name: (m.link, m) for name, m in self.built_in.items()}

    @functools.cached_property
    def all_markers(self) -> Mapping[str, tuple[str, Marker | BuiltIn]]:
        """All markers: name -> (link, marker). Built-in ones first, a link's name is one."""
        found = self.own_markers()
        for link in self.link_names:
            found.setdefault(link, (link, BuiltIn(link)))
        for link, properties in self.links_or_default().items():
            for name, marker in properties.markers.items():
                found[name] = (link, marker)
        return found

    def place_of(self, marker: Marker | BuiltIn) -> complex:
        """Place [m] of one of the block's markers, in the frame of the marker's link."""
        if isinstance(marker, Marker):
            return marker.at.z
        return complex(getattr(self, marker.along) or 0.0) if marker.along else 0j

    @classmethod
    def parameter_names(cls) -> tuple[str, ...]:
        """The block's own numbers, in the order of declaration."""
        return tuple(n for n in cls.model_fields if n not in NOT_FOR_KERNELS)

    def parameters(self) -> Any:
        """The block's numbers as the named tuple that kernels read as ``p``."""
        values = {n: _number(getattr(self, n)) for n in self.parameter_names()}
        numbers = {n: x for n, x in values.items() if x is not None}
        return _record(type(self).__name__ + "Numbers", tuple(numbers))(*numbers.values())


NO_LINK = Link()
SHARED_FIELDS = frozenset({"links", "markers", "friction", "slider", "useful"})
NOT_FOR_KERNELS = SHARED_FIELDS | {"sign", "offset"}  # the core turns a driver's coordinate


def _number(value: object) -> float | complex | None:
    if isinstance(value, Pair):
        return value.z
    if isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    return None


@functools.cache
def _record(name: str, fields: tuple[str, ...]) -> Any:
    return namedtuple(name, fields)  # the fields are known at run time only


class Moving(Block):
    """A block with links and joints: a driving link or an Assur group."""

    kernels: ClassVar[Kernels]
    group_class: ClassVar[str] = ""
    kind: ClassVar[str] = ""
    closes: ClassVar[bool] = True  # a loop, so it has a margin and may fail to
    own_form: ClassVar[bool] = False  # each instance says its links and joints, not the class
    lengths: ClassVar[tuple[str, ...]] = ()

    links: dict[str, Link] = {}
    friction: dict[str, Coulomb] = {}

    @property
    def driven(self) -> tuple[Joint, ...]:
        """Joints whose coordinates are inputs, in the order of declaration."""
        return tuple(joint for joint in self.joints.values() if joint.driven)

    def driver_name(self, block: str, joint: str) -> str:
        """Name of the driver at a driven joint; ``block`` is what the block is called."""
        return block

    def coordinate(self, joint: str) -> Coordinate:
        """How a driven joint counts, against its driver."""
        return Coordinate(getattr(self, "sign", 1), getattr(self, "offset", 0.0))

    # Where the kernels' named tuples keep what belongs to a link or a joint.

    def link_field(self, link: str) -> str:
        """Field of pose, velocity and acceleration that is of a link."""
        return link

    def joint_field(self, joint: str) -> str:
        """Field of velocity (sliding rate) and reactions that is of a joint."""
        return joint

    def effort_field(self, joint: str) -> str:
        """Field of the reactions that is the driving effort at a driven joint."""
        return "tau"

    @field_validator("links")
    @classmethod
    def _links_exist(cls, links: dict[str, Link]) -> dict[str, Link]:
        refuse(cls.__name__, wrong_links(links, cls.link_names, cls.built_in))
        return links

    @field_validator("friction")
    @classmethod
    def _friction_fits(cls, friction: dict[str, Coulomb]) -> dict[str, Coulomb]:
        refuse(cls.__name__, wrong_friction(friction, cls.joints))
        return friction

    def slider_place(self, joint: str, link: str) -> complex:
        """Place [m] of a slider's point on one of its links, in the link's frame."""
        foot, direction = self.guide_line(joint, link)
        along = self.joints[joint].lines.get(link, Line()).along
        return foot + float(getattr(self, along)) * direction if along else foot

    def guide_line(self, joint: str, link: str) -> tuple[complex, complex]:
        """A place [m] on the guide line of a prismatic pair, and its unit direction.

        Both in the frame of one of the block's own links.
        """
        line = self.joints[joint].lines.get(link, Line())
        offset, turn = (
            float(getattr(self, name)) if name else 0.0 for name in (line.offset, line.turn)
        )
        direction = complex(math.cos(turn), math.sin(turn)) if turn else 1 + 0j
        return 1j * offset * direction, direction

    def largest_length(self) -> float:
        """The largest length [m] that the block's parameters and markers know."""
        sizes = [abs(getattr(self, n) or 0.0) for n in self.lengths]
        sizes += [abs(m.at.z) for k in self.links.values() for m in k.markers.values()]
        return max(sizes, default=0.0)

    def slider_owner(self, joint: str) -> Literal["later", "earlier"]:
        """Which link owns the slider's point of a prismatic pair (inner: j is later)."""
        said: Any = getattr(self, "slider", None)
        if isinstance(said, dict):
            said = said.get(joint)
        return "earlier" if said in ("earlier", "i") else "later"


class DrivingLink(Moving):
    """A class I module: one link and one driven pair; mobility 1."""

    group_class: ClassVar[str] = "I"
    closes: ClassVar[bool] = False


class AssurGroup(Moving):
    """A group that its drivers, if it has any, and its supports determine by themselves."""


def _declare(cls: type[Block]) -> None:
    """Collect the joints of a class and hold its kernels against the contract."""
    cls.joints = {
        name: replace(joint, name=name)
        for name, joint in vars(cls).items()
        if isinstance(joint, Joint)
    }
    for joint in cls.joints.values():
        for link in filter(None, (joint.link, *joint.links)):
            if link not in cls.link_names:
                raise TypeError(f"{cls.__name__}.{joint.name}: no link {link!r} is declared")
    if not issubclass(cls, Moving):
        return
    outer = [j.name for j in cls.joints.values() if j.outer]
    driven = [f"q_{j.name}" for j in cls.joints.values() if j.driven]
    if issubclass(cls, DrivingLink) and len(driven) != 1:
        raise TypeError(f"{cls.__name__}: declare its one joint with driven=True")
    expected = {
        "position": [*outer, *driven, "p"],
        "velocity": ["pose", *outer, *driven, "p"],
        "acceleration": ["pose", "vel", *outer, *driven, "p"],
        "reactions": ["pose", *(f"load_{n}" for n in cls.link_names), "p"],
    }
    for name, wanted in expected.items():
        found = list(inspect.signature(getattr(cls.kernels, name)).parameters)
        if len(found) != len(wanted):
            raise TypeError(
                f"{cls.__name__}: kernel {name} must take ({', '.join(wanted)}), "
                f"it takes ({', '.join(found)})"
            )


# -- what a block refuses, all at once and each at its own place ---------------------


def refuse(title: str, mistakes: Iterable[Mistake]) -> None:
    """Refuse a model with all its mistakes, each at its own place."""
    lines = [InitErrorDetails(type=error, loc=where, input=None) for where, error in mistakes]
    if lines:
        raise ValidationError.from_exception_data(title, lines)


def wrong_links(
    links: Mapping[str, Link], known: Iterable[str], built_in: Iterable[str]
) -> Iterator[Mistake]:
    """Links that the block does not have, and markers whose names cannot stand or are taken."""
    names = tuple(known)
    taken = {*built_in, *names}
    for link, properties in links.items():
        if link not in names:
            yield (link,), unknown_name("unknown-link", "link", link, names)
        for marker in properties.markers:
            where = (link, "markers", marker)
            if not is_name(marker):
                yield where, bad_name("marker", marker)
            elif marker in taken:
                found = f'the marker name "{marker}" is taken in this block'
                yield where, mistake("taken-name", found, f"taken: {listed(sorted(taken))}")
            taken.add(marker)


def unknown_name(
    code: LiteralString, what: str, name: str, valid: tuple[str, ...]
) -> PydanticCustomError:
    """A name that the block does not declare, with the declared ones and the nearest of them."""
    known = f"{what}s there: {listed(valid)}"
    return mistake(code, f'no {what} "{name}"', known, close_match(name, valid))


def bad_name(what: str, name: str) -> PydanticCustomError:
    """A name that could not stand in an address."""
    return mistake("bad-name", f'"{name}" is not a {what} name', NAME_RULE, "choose another name")


def wrong_friction(
    friction: Mapping[str, Coulomb], joints: Mapping[str, Joint], what: str = "joint"
) -> Iterator[Mistake]:
    """Friction of joints that the block does not have, or that does not fit their kind."""
    for joint, law in friction.items():
        if joint not in joints:
            yield (joint,), unknown_name("unknown-joint", what, joint, tuple(joints))
            continue
        try:
            law.check_for(joints[joint].kind, joint)
        except PydanticCustomError as error:
            yield (joint,), error
