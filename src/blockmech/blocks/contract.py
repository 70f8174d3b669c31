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

import inspect
from collections.abc import Iterator, Mapping
from typing import Any, ClassVar, Literal

from pydantic import Field, ValidationInfo, field_validator
from pydantic_core import PydanticCustomError

from blockmech.blocks.block import Block, Mistake, refuse, unknown_name, wrong_links
from blockmech.blocks.joints import (
    BuiltIn,
    Coordinate,
    Joint,
    Kernels,
    Line,
    inner_joint,
    outer_joint,
)
from blockmech.friction.laws.contract import AnyFriction, FrictionLaw
from blockmech.ground.errors import listed
from blockmech.ground.plane import apply, largest, primitives_of
from blockmech.ground.validation_errors import mistake
from blockmech.ground.values import Axis, Link, Play
from blockmech.typing import Data

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


class Moving(Block):
    """A block with links and joints: a driving link or an Assur group."""

    kernels: ClassVar[Kernels]
    group_class: ClassVar[str] = ""
    kind: ClassVar[str] = ""
    closes: ClassVar[bool] = True  # a loop, so it has a margin and may fail to
    own_form: ClassVar[bool] = False  # each instance says its links and joints, not the class
    lengths: ClassVar[tuple[str, ...]] = ()

    links: dict[str, Link] = {}
    friction: dict[str, AnyFriction] = {}
    clearance: dict[str, Play] = Field(default={}, repr=False)  # [m] radial, of pins

    @classmethod
    def declare(cls) -> None:
        """Collect the joints of the class, and check its kernels against the contract."""
        if cls.own_form:
            return
        super().declare()
        outer = [j.name for j in cls.joints.values() if j.outer]
        driven = [f"q_{j.name}" for j in cls.joints.values() if j.driven]
        expected = {
            "position": [*outer, *driven, "p"],
            "velocity": ["pose", *outer, *driven, "p"],
            "acceleration": ["pose", "vel", *outer, *driven, "p"],
            "reactions": ["pose", *(f"load_{n}" for n in cls.link_names), "p"],
        }
        for name, arguments in expected.items():
            parameters = list(inspect.signature(getattr(cls.kernels, name)).parameters)
            if len(parameters) != len(arguments):
                raise TypeError(
                    f"{cls.__name__}: kernel {name} must take ({', '.join(arguments)}), "
                    f"it takes ({', '.join(parameters)})"
                )

    @property
    def driven(self) -> tuple[Joint, ...]:
        """Joints whose coordinates are inputs, in the order of declaration."""
        return tuple(joint for joint in self.joints.values() if joint.driven)

    def driver_name(self, block: str, joint: str) -> str:
        """Name of the driver at a driven joint; ``block`` is the name of the block."""
        return block

    def coordinate(self, joint: str) -> Coordinate:
        """Sign and offset of a driven joint's coordinate against its driver's."""
        return Coordinate(getattr(self, "sign", 1), getattr(self, "offset", 0.0))

    def axis(self, outside: Axis) -> Axis:
        """Units along the coordinates of its joints, for the friction and loads there."""
        axes = {joint.name: Axis.of(joint.kind) for joint in self.joints.values()}
        return outside._replace(known={**outside.known, **axes})

    # Where the kernels' named tuples keep what belongs to a link or a joint.

    def link_field(self, link: str) -> str:
        """Field of pose, velocity and acceleration that belongs to a link."""
        return link

    def joint_field(self, joint: str) -> str:
        """Field of the velocities (sliding rate) and reactions that belongs to a joint."""
        return joint

    def effort_field(self, joint: str) -> str:
        """Field of the reactions with the generalised force that drives a joint."""
        return "tau"

    @field_validator("links", "friction", "clearance")
    @classmethod
    def _check_names(cls, entries: Data, field: ValidationInfo) -> Data:
        mistakes = {
            "links": lambda: wrong_links(entries, cls.link_names, cls.built_in),
            "friction": lambda: wrong_friction(entries, cls.joints),
            "clearance": lambda: wrong_clearance(entries, cls.joints),
        }
        refuse(cls.__name__, mistakes[str(field.field_name)]())
        return entries

    def slider_place(self, joint: str, link: str) -> complex:
        """Place [m] of a slider's point on one of its links, in the link's frame."""
        foot, direction = self.guide_line(joint, link)
        parameter = self.joints[joint].lines.get(link, Line()).along
        point: complex = (
            foot + apply("mul", direction, getattr(self, parameter)) if parameter else foot
        )
        return point

    def guide_line(self, joint: str, link: str) -> tuple[complex, complex]:
        """A place [m] on the guide line of a prismatic pair, and its unit direction.

        Both in the frame of one of the block's own links.
        """
        line = self.joints[joint].lines.get(link, Line())
        direction = apply("expi", getattr(self, line.turn)) if line.turn else 1 + 0j
        offset = getattr(self, line.offset) if line.offset else 0.0
        return apply("imul", direction, offset), direction

    def largest_length(self) -> float:
        """The largest length [m] among the block's parameters and markers."""
        markers = [abs(m.at.z) for k in self.links.values() for m in k.markers.values()]
        return largest([*self._parameter_lengths, *markers])

    @property
    def _parameter_lengths(self) -> list[float]:
        return [abs(x) for name in self.lengths if (x := getattr(self, name)) is not None]

    def characteristic_length(self) -> float:
        """The largest length [m] among the parameters, or else the markers; 1 m without any.

        What acts far out on a link does not say how exactly its pairs are placed.
        """
        lengths = self._parameter_lengths
        length = largest(lengths) if lengths else self.largest_length()
        size: float = primitives_of(length)["where"](length > 0.0, length, 1.0)
        return size

    def slider_owner(self, joint: str) -> Literal["later", "earlier"]:
        """Which link owns the slider's point of a prismatic pair (inner: j is later)."""
        slider: Any = getattr(self, "slider", None)
        if isinstance(slider, dict):
            slider = slider.get(joint)
        return "earlier" if slider in ("earlier", "i") else "later"


class DrivingLink(Moving):
    """A class I module: one link and one driven pair; mobility 1."""

    group_class: ClassVar[str] = "I"
    closes: ClassVar[bool] = False

    @classmethod
    def declare(cls) -> None:
        """The same, and its one driven joint."""
        super().declare()
        if sum(joint.driven for joint in cls.joints.values()) != 1:
            raise TypeError(f"{cls.__name__}: declare its one joint with driven=True")


class AssurGroup(Moving):
    """A group whose pose follows from its supports and from its drivers, if it has any."""


def wrong_friction(
    friction: Mapping[str, FrictionLaw], joints: Mapping[str, Joint], kind: str = "joint"
) -> Iterator[Mistake]:
    """Friction of joints that the block does not have, or that does not fit their kind."""
    for joint, law in friction.items():
        if joint not in joints:
            yield (joint,), unknown_name("unknown-joint", kind, joint, tuple(joints))
            continue
        try:
            law.check_for(joints[joint].kind, joint)
        except PydanticCustomError as error:
            yield (joint,), error


def wrong_clearance(
    clearance: Mapping[str, float], joints: Mapping[str, Joint], kind: str = "joint"
) -> Iterator[Mistake]:
    """Clearance of joints that the block does not have, or that are no pins."""
    for joint in clearance:
        if joint not in joints:
            yield (joint,), unknown_name("unknown-joint", kind, joint, tuple(joints))
        elif not joints[joint].rotary:
            pins = listed([name for name, x in joints.items() if x.rotary]) or "none"
            message = f"{kind} {joint} is a guide"
            valid = f"only pins have a (radial) clearance; pins there: {pins}"
            yield (joint,), mistake("clearance-mismatch", message, valid, "remove it")
