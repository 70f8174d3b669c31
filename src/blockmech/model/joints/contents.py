"""What stands in a joint-based file, section by section.

Loads and drivers take the keys of the blocks and laws that they become, so these models are
made from the registry when they are asked for; nothing is said twice.
"""

from __future__ import annotations

import cmath
import functools
import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal, NamedTuple, TypeAlias, get_args

from pydantic import ConfigDict, Field, create_model, model_validator
from pydantic_core import PydanticCustomError

from blockmech.blocks.mistakes import refuse
from blockmech.blocks.registry import REGISTRY
from blockmech.errors import Problem, close_match, listed, shown
from blockmech.friction.laws import Coulomb
from blockmech.loads.contract import Element
from blockmech.model.expect import Expectation
from blockmech.model.laws_of_motion import AnyLaw
from blockmech.model.migrations import VERSION
from blockmech.model.scene import Initial, Stops
from blockmech.values import (
    NAME_RULE,
    Angle,
    Link,
    Number,
    Place,
    Strictly,
    Vector,
    default,
    mistake,
)

FORMAT = "blockmech/joints"
FRAME = "frame"
"""Name of the fixed link."""

LAWS: tuple[Any, ...] = get_args(get_args(AnyLaw)[0])
EXTRAS = ("view", "expect", "source", "notes")
"""Sections that travel with a document and are not computed with."""


class LinkGiven(Link):
    """A rigid link: mass properties, markers, and where its frame stands.

    Parameters
    ----------
    mass [kg], inertia [kg m2] about the centre of mass, cm [m]
    pose : [x, y, angle] of the link's own frame [m, m, rad]; approximate, it fixes the
        assembly mode
    """

    pose: tuple[Number, Number, Number] | None = None

    @property
    def at(self) -> tuple[complex, float]:
        """Place [m] and angle [rad] of the pose."""
        x, y, angle = self.pose or (0.0, 0.0, 0.0)
        return complex(x, y), angle


class _Joint(Strictly):
    links: Annotated[list[str], Field(min_length=2)]
    at: Annotated[list[Place], Field(min_length=2)]
    friction: Coulomb | None = None

    @model_validator(mode="after")
    def _fits(self) -> Any:
        if len(self.at) != len(self.links):
            raise mistake("wrong-value", f'"at" has {_places(len(self.at))} for {self._count}')
        if self.friction is not None:
            try:
                self.friction.check_for(getattr(self, "type"), "the joint")  # noqa: B009
            except PydanticCustomError as error:
                refuse(type(self).__name__, [(("friction",), error)])
        return self

    @property
    def _count(self) -> str:
        return f"{len(self.links)} links"


def _places(number: int) -> str:
    return f"{number} place{'s' * (number != 1)}"


class PinGiven(_Joint):
    """A revolute joint: the places [m] of two links, or more on one pin, coincide."""

    type: Literal["R"]


class GuideGiven(_Joint):
    """A prismatic joint: two directed lines coincide, one on each link.

    Each goes through ``at`` [m] along ``angle`` [rad] or ``dir`` [dx, dy] in its link's
    frame. ``slider`` tells which of the two links carries the point where N acts.
    """

    type: Literal["P"]
    angle: Annotated[list[Angle], Field(min_length=2)] | None = None
    dir: Annotated[list[Vector], Field(min_length=2)] | None = None
    slider: Literal[0, 1] = 1

    @model_validator(mode="before")
    @classmethod
    def _slider_is_a_number(cls, raw: Any) -> Any:
        if isinstance(raw, dict) and isinstance(raw.get("slider"), bool):
            wrong = mistake("wrong-value", "must be 0 or 1: which of the two links carries S")
            refuse(cls.__name__, [(("slider",), wrong)])
        return raw

    @model_validator(mode="after")
    def _two_lines(self) -> Any:
        if len(self.links) != 2:
            raise mistake("wrong-value", f"a P joint has two links, not {len(self.links)}")
        if self.angle is not None and self.dir is not None:
            raise mistake(
                "bad-direction", "the directions are given twice", "", 'keep "angle" or "dir"'
            )
        for name in ("angle", "dir"):
            said = getattr(self, name)
            if said is not None and len(said) != 2:
                raise mistake("wrong-value", f'"{name}" has {len(said)} values for 2 links')
        if any(d.z == 0 for d in self.dir or ()):
            raise mistake("bad-direction", '"dir" must not be [0, 0]')
        return self

    @property
    def directions(self) -> tuple[complex, complex]:
        """Unit directions [-] of the line in the frames of both links."""
        if self.dir is not None:
            first, second = (_unit(d.z) for d in self.dir)
        else:
            first, second = (cmath.rect(1.0, angle) for angle in self.angle or (0.0, 0.0))
        return first, second


def _unit(z: complex) -> complex:
    r = math.hypot(z.real, z.imag)
    return complex(z.real / r, z.imag / r)


JointGiven: TypeAlias = PinGiven | GuideGiven


# Drivers take the keys of their law of motion, loads those of the block that they become.


class _OfTheFile(Strictly):
    """Keys as they stand in files only: ``from``, not ``start``."""

    model_config = ConfigDict(populate_by_name=False)


class DriverGiven(Strictly):
    """A driver without a given motion: its joint alone."""

    joint: str


@functools.cache
def _driver_model(law: Any) -> type[Strictly]:
    bases: tuple[type[Strictly], ...] = (law, _OfTheFile)
    return create_model(
        f"{law.__name__}Driver", __base__=bases, __doc__=law.__doc__, joint=(str, ...)
    )


LOADS = "load."


def load_kinds() -> list[str]:
    """Kinds of loads, without the prefix of their block types."""
    return [name.removeprefix(LOADS) for name in REGISTRY if name.startswith(LOADS)]


@functools.cache
def _load_model(cls: type[Element]) -> type[Strictly]:
    """The model of a load: its element's keys, and the links it takes hold of."""
    kinds = [terminal.kind for terminal in cls.terminals.values()]
    points, number = "point" in kinds, len(kinds)
    fields: dict[str, Any] = {}
    if number == 1:
        fields["link"] = (str, ...)
        fields |= {"at": (Place, default(Place(0j)))} if points else {}
    else:
        both = Field(min_length=number, max_length=number)
        fields["links"] = (Annotated[list[str], both], ... if points else None)
        fields |= {"at": (Annotated[list[Place], both], ...)} if points else {"joint": (str, None)}
    base: Any = (cls, _OnLinks) if kinds == ["link", "link"] else cls
    name = f"{cls.__name__}Load"
    found: type[Strictly] = create_model(name, __base__=base, __doc__=cls.__doc__, **fields)
    return found


class _OnLinks(Strictly):
    """A couple between two links: named by themselves, or by their joint."""

    @model_validator(mode="after")
    def _links_or_joint(self) -> Any:
        links, joint = getattr(self, "links", None), getattr(self, "joint", None)
        if (links is None) == (joint is None):
            found = "names neither links nor a joint" if links is None else "names links and joint"
            raise mistake("wrong-value", found, 'give "links": [a, b], or "joint" for its two')
        return self


HOLDS = ("link", "links", "at", "joint")
"""Keys that tell where a load takes hold; the others are those of its block."""


class Section(NamedTuple):
    """What the items of a section of a file are.

    key : the key by which their kinds are told apart, "" where there is one kind
    models : word of the file -> model of that kind
    said : what an item is called in messages, "{}" for its word
    plain : kind without the key, where it may be left out; or the only kind
    plain_said : what that is called
    """

    key: str
    models: Mapping[str, type[Strictly]]
    said: str = ""
    plain: type[Strictly] | None = None
    plain_said: str = ""


def sections() -> dict[str, Section]:
    """The sections of a file by name, with all laws and loads that are registered."""
    laws = {get_args(law.model_fields["law"].annotation)[0]: law for law in LAWS}
    loads = {kind: REGISTRY[f"{LOADS}{kind}"] for kind in load_kinds()}
    elements = {kind: cls for kind, cls in loads.items() if issubclass(cls, Element)}
    return {
        "links": Section("", {}, "", LinkGiven, "a link"),
        "joints": Section("type", {"R": PinGiven, "P": GuideGiven}, "an {} joint"),
        "drivers": Section(
            "law",
            {word: _driver_model(law) for word, law in laws.items()},
            "the law {}",
            DriverGiven,
            "a driver without a law",
        ),
        "loads": Section(
            "type", {kind: _load_model(cls) for kind, cls in elements.items()}, "a {}"
        ),
    }


def bad_name(what: str, name: str, where: str = "") -> Problem:
    """The problem of a name that could not stand in an address."""
    found = f"{shown(name)} is not a {what} name"
    return Problem("bad-name", where or name or '""', found, NAME_RULE, "choose another name")


def unknown_kind(word: Any, where: str, section: Section) -> Problem:
    """The problem that names an unknown kind of an item and its nearest relatives."""
    remedy = close_match(word, section.models) if isinstance(word, str) else ""
    found, valid = f"no {section.key} {shown(word)}", f"{section.key}s: {listed(section.models)}"
    return Problem("wrong-value", where, found, valid, remedy)


class JointsDocument(Strictly):
    """A mechanism as links and joints, in SI units and radians."""

    format: Literal["blockmech/joints"]
    version: Annotated[int, Field(strict=True, ge=1, le=VERSION)]
    name: str = "mechanism"
    title: str = ""
    gravity: Vector = Vector(0j)
    links: dict[str, LinkGiven]
    joints: dict[str, Annotated[PinGiven | GuideGiven, Field(discriminator="type")]]
    drivers: dict[str, Any] = {}
    loads: dict[str, Any] = {}
    initial: dict[str, Initial] = {}
    stops: dict[str, Stops] = {}
    view: Annotated[dict[str, Any], Field(description="places on a canvas; not computed with")] = {}
    expect: list[Expectation] = []
    source: str = ""
    notes: str | list[str] = ""
