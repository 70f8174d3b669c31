"""What stands in a joint-based file, section by section.

Loads and drivers take the keys of the blocks and laws that they become, so these models are
made from the registry when they are asked for; nothing is said twice. Names that are not there, and
parts that do not fit together, are found when all sections are read.
"""

from __future__ import annotations

import functools
from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any, ClassVar, Literal, Self, TypeAlias, get_args

from pydantic import ConfigDict, Field, create_model, model_validator
from pydantic_core import PydanticCustomError

from blockmech.blocks.block import REGISTRY, Block, refuse
from blockmech.couplings.contract import Coupling
from blockmech.friction.laws.contract import AnyFriction
from blockmech.ground.errors import Problem, listed, path_text, unknown_name
from blockmech.ground.names import MECHANISM, is_name
from blockmech.ground.validation_errors import mistake
from blockmech.ground.values import (
    POSE,
    Axis,
    Clearance,
    Direction,
    Link,
    Marker,
    Maybe,
    Place,
    Pose,
    StrictModel,
    Units,
    Vector,
    check_direction,
    default,
    no_boolean,
)
from blockmech.loads.contract import Element
from blockmech.model.diagram import Wire, WireEnds
from blockmech.model.expect import Expectation
from blockmech.model.form import Form, Section, bad_name
from blockmech.model.joints.dimensions import KINDS as DIMENSIONS
from blockmech.model.laws_of_motion import AnyLaw
from blockmech.model.scene import PER_DRIVER, Initial, Role, Stops
from blockmech.model.structure import COORDINATE
from blockmech.model.versions import OWNERS, VERSION
from blockmech.model.wires import wire_problems as motion_or_signal
from blockmech.signals.contract import Signal
from blockmech.typing import Data

FRAME = "frame"
"""Name of the fixed link."""

LAWS: tuple[Any, ...] = get_args(get_args(AnyLaw)[0])
# What the types of their blocks begin with.
LOADS, COUPLINGS, SIGNALS = "load.", "coupling.", "signal."


class LinkGiven(Link):
    """A rigid link: mass properties, markers, and where its frame stands.

    Parameters
    ----------
    mass [kg], inertia [kg m2] about the centre of mass, cm [m]
    pose : [x, y, angle] of the link's own frame [m, m, rad]; approximate, it fixes the
        assembly mode
    """

    remade: ClassVar[str] = 'e.g. m = m.replace({"links.rod.mass": "2 kg"})'

    pose: Pose = default(None)

    def units(self, axis: Axis) -> Units:
        """Of the pose."""
        return {"pose": POSE}

    @property
    def at(self) -> tuple[complex, float]:
        """Place [m] and angle [rad] of the pose."""
        x, y, angle = self.pose or (0.0, 0.0, 0.0)
        return complex(x, y), angle


TWO = Field(min_length=2, max_length=2)


class _Joint(StrictModel):
    remade: ClassVar[str] = 'e.g. m = m.replace({"joints.A.friction": law})'

    links: Annotated[list[str], Field(min_length=2)]
    at: Annotated[list[Place], Field(min_length=2)]

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        for key in ("at", "angle", "dir"):
            values = getattr(self, key, None)
            if values is not None and len(values) != len(self.links):
                places = "places" if key == "at" else "directions"
                message = f'"{key}" has {len(values)} {places} for {len(self.links)} links'
                raise mistake("wrong-value", message)
        if len(set(self.links)) < len(self.links):
            raise mistake("wrong-value", "a joint is between different links")
        return self


class _Pair(_Joint):
    friction: AnyFriction | None = None

    def axis(self, outside: Axis) -> Axis:
        """Units along its coordinate."""
        return Axis.of(getattr(self, "type"))._replace(known=outside.known)  # noqa: B009

    @model_validator(mode="after")
    def _rubs_as_it_can(self) -> Self:
        if self.friction is not None:
            try:
                self.friction.check_for(getattr(self, "type"), "the joint")  # noqa: B009
            except PydanticCustomError as error:
                refuse(type(self).__name__, [(("friction",), error)])
        return self


class _Directed(_Joint):
    angle: list[Direction] | None = None
    dir: list[Vector] | None = None

    @model_validator(mode="after")
    def _one_direction(self) -> Self:
        if self.angle is not None and self.dir is not None:
            raise mistake(
                "bad-direction", "the directions are given twice", "", 'keep "angle" or "dir"'
            )
        check_direction("dir", *(self.dir or ()))
        return self

    @property
    def directions(self) -> list[complex]:
        """Unit directions [-] in the frames of the links."""
        none = [None] * len(self.links)
        lines = zip(self.at, self.angle or none, self.dir or none, strict=True)
        return [Marker.model_construct(at=at, angle=x, dir=u).direction for at, x, u in lines]


class PinGiven(_Pair):
    """A revolute joint: the places [m] of two links, or more on one pin, coincide."""

    type: Literal["R"]
    clearance: Maybe[Clearance] = default(None)


class GuideGiven(_Pair, _Directed):
    """A prismatic joint: two directed lines coincide, one on each link.

    Each goes through ``at`` [m] along ``angle`` [rad] or ``dir`` [dx, dy] in its link's
    frame. ``slider`` tells which of the two links carries the point where N acts.
    """

    type: Literal["P"]
    links: Annotated[list[str], TWO]
    angle: Annotated[list[Direction], TWO] | None = None
    dir: Annotated[list[Vector], TWO] | None = None
    slider: Annotated[Literal[0, 1], no_boolean(0, 1)] = 1


class WeldGiven(_Directed):
    """A weld: the links are one rigid link, under names of their own.

    The places ``at`` [m] coincide, and so do the directions ``angle`` [rad] or ``dir`` [dx, dy],
    by default the x axes. A weld has no coordinate and reports no force: where these are of
    interest, a pin with a driver at rest has both.
    """

    type: Literal["weld"]


JointGiven: TypeAlias = PinGiven | GuideGiven | WeldGiven


# Drivers take the keys of their law of motion, loads those of the block that they become.


class _Made(StrictModel):
    """An item whose model is made when asked for: a pickle of it holds what of."""

    made_by: ClassVar[tuple[Any, type[StrictModel]]]

    def __reduce__(self) -> tuple[object, ...]:
        return _blank, type(self).made_by, self.__getstate__()


def _blank(make: Any, of: type[StrictModel]) -> StrictModel:
    model: type[StrictModel] = make(of)
    return model.__new__(model)


class _OfTheFile(_Made):
    """Keys as they stand in files only: ``from``, not ``start``."""

    model_config = ConfigDict(populate_by_name=False)


class DriverGiven(StrictModel):
    """A driver without a given motion: its joint alone."""

    joint: str


@functools.cache
def _driver_model(law: Any) -> type[StrictModel]:
    name, bases = f"{law.__name__}Driver", (law, _OfTheFile)
    model: Any = create_model(name, __base__=bases, __doc__=law.__doc__, joint=(str, ...))
    model.made_by = (_driver_model, law)
    return model  # type: ignore[no-any-return]


@functools.cache
def _load_model(cls: type[Element]) -> type[StrictModel]:
    """The model of a load: its element's keys, and the links it takes hold of."""
    kinds = [terminal.kind for terminal in cls.terminals.values()]
    points, number = "point" in kinds, len(kinds)
    fields: Data = {}
    if number == 1:
        fields["link"] = (str, ...)
        fields |= {"at": (Place, default(Place(0j)))} if points else {}
    else:
        both = Field(min_length=number, max_length=number)
        fields |= {"links": (Annotated[list[str], both], None), "joint": (str, None)}
        fields |= {"at": (Annotated[list[Place], both], None)} if points else {}
    base: Any = (_Made if number == 1 else _BetweenLinks, cls)
    name = f"{cls.__name__}Load"
    model: Any = create_model(name, __base__=base, __doc__=cls.__doc__, **fields)
    model.made_by = (_load_model, cls)
    return model  # type: ignore[no-any-return]


class _BetweenLinks(_Made):
    """A load between two links: named by themselves, or by their joint."""

    def axis(self, outside: Axis) -> Axis:
        """That of its joint, along whose guide it becomes a force."""
        known, inner = outside.known, super().axis(outside)
        axis = known.get(f"joint.{getattr(self, 'joint', None)}", inner)
        driven = getattr(self, "driver", None) in known
        return axis._replace(coordinate=(inner if driven else axis).coordinate)

    @model_validator(mode="after")
    def _links_or_joint(self) -> Self:
        links, joint = getattr(self, "links", None), getattr(self, "joint", None)
        if (links is None) == (joint is None):
            message = (
                "names neither links nor a joint" if links is None else "names links and joint"
            )
            raise mistake("wrong-value", message, 'give "links": [a, b], or "joint" for its two')
        if "at" in type(self).model_fields and (getattr(self, "at", None) is None) != (
            links is None
        ):
            remedy = 'give "links" with "at", or "joint" alone'
            raise mistake("wrong-value", '"links" and "at" belong together', "", remedy)
        if joint is not None and getattr(self, "direction", None) is not None:
            raise mistake("wrong-value", "the guide of a joint is the direction", "", "remove it")
        return self


HOLDS = ("link", "links", "at", "joint")
"""Keys that tell where a load takes hold; the others are those of its block."""


def sections() -> dict[str, Section]:
    """The sections of named items, with all laws, loads and so on that are registered."""
    own = (name for name in REGISTRY if name.startswith((LOADS, COUPLINGS, SIGNALS)))
    return _sections(tuple(REGISTRY[name] for name in own))


@functools.lru_cache(1)
def _sections(types: tuple[Any, ...]) -> dict[str, Section]:
    def registered(prefix: str, base: type[Block]) -> Data:
        kinds = {cls.type_name: cls for cls in types if issubclass(cls, base)}
        return {n.removeprefix(prefix): cls for n, cls in kinds.items() if n.startswith(prefix)}

    loads = {word: _load_model(kind) for word, kind in registered(LOADS, Element).items()}
    driven = {get_args(law.model_fields["law"].annotation)[0]: _driver_model(law) for law in LAWS}
    own = ("mass", "inertia", "cm", "pose", "markers")
    of_joint = ("type", "links", "at", "angle", "dir", "slider", "friction", "clearance")
    pairs, alone = {"R": PinGiven, "P": GuideGiven, "weld": WeldGiven}, "a driver without a law"
    couplings, signals = registered(COUPLINGS, Coupling), registered(SIGNALS, Signal)
    holds = ("type", "link", "links", "joint", "at")
    return {
        "links": Section("link", {}, plain=LinkGiven, plain_said="a link", first=own),
        "joints": Section("joint", pairs, "type", "an {} joint", first=of_joint),
        "drivers": Section(
            "driver", driven, "law", "the law {}", DriverGiven, alone, ("joint", "law")
        ),
        "couplings": Section("coupling", couplings, "type", "a {}", prefix=COUPLINGS),
        "loads": Section("load", loads, "type", "a {}", first=holds, prefix=LOADS),
        "signals": Section("signal", signals, "type", "a {}", prefix=SIGNALS),
        "dimensions": Section("dimension", DIMENSIONS, "type", "a {}", first=("type", "points")),
    }


class JointsDocument(StrictModel):
    """A mechanism as links and joints, in SI units and radians."""

    format: Literal["blockmech/joints"]
    version: Annotated[int, Field(strict=True, ge=VERSION, le=VERSION)]
    name: str = "mechanism"
    title: str = ""
    gravity: Vector = Vector(0j)
    links: Data
    joints: Data
    drivers: Data = {}
    couplings: Data = {}
    loads: Data = {}
    signals: Data = {}
    dimensions: Data = {}
    wires: list[WireEnds] = []
    initial: dict[str, Initial] = {}
    stops: dict[str, Stops] = {}
    motion: dict[str, Role] = {}
    view: Annotated[Data, Field(description="places on a canvas; not computed with")] = {}
    expect: list[Expectation] = []
    source: str = ""
    notes: str | list[str] = ""


LINKAGE_FILE = Form(
    "blockmech/joints", "a joint-based file", JointsDocument, ("joints", "links"), sections
)


Known: TypeAlias = Mapping[str, Collection[str]]
"""Section -> names in it, those of parts that are wrong by themselves included."""


Reference: TypeAlias = tuple[str, str, tuple[str | int, ...]]
"""What a part of a document names, "link", "joint" or "driver"; its name; and where it says so."""
NAMES = {"link": "link", "links": "link", "joint": "joint", "driver": "driver", "driven": "driver"}
"""Key of an item that names other items -> what these are."""
TWO_LINKS = {"drivers": "drives", "loads": "acts between"}
"""Section -> what its items do to the two links of a joint."""


def _references(linkage: Any) -> Iterator[Reference]:
    for section in linkage.form.items():
        for name, item in getattr(linkage, section).items():
            for key in filter(NAMES.get, type(item).model_fields):
                path, kind, value = (section, name, key), NAMES[key], getattr(item, key)
                if isinstance(value, list):
                    yield from ((kind, x, (*path, k)) for k, x in enumerate(value))
                elif section == "couplings" and key == "driver" and "." in value:
                    yield "link", value.partition(".")[0], path
                elif value is not None:
                    yield kind, value, path
    for section in PER_DRIVER[1:]:
        for name in getattr(linkage, section):
            pair = coordinate_of(name) if section == "stops" else None
            kind, named = ("driver", name) if pair is None else ("joint", pair.partition(".")[0])
            yield kind, named, (section, name)


def coordinate_of(name: str) -> str | None:
    """The pair in the name of its coordinate, ``"joint.<pair>.coordinate"``; else None."""
    first, _, rest = name.partition(".")
    pair, _, last = rest.rpartition(".")
    return pair if first == "joint" and last == COORDINATE and pair else None


def no_driver(linkage: Any, path: tuple[str | int, ...], drivers: Collection[str]) -> Problem:
    """The problem of what names no driver; of a joint that nothing drives."""
    *_, name = map(str, path)
    problem = unknown_name("unknown-driver", "driver", name, path_text(path), sorted(drivers))
    if name not in linkage.joints:
        return problem
    remedy = f'drive the joint: add_driver("{name}", "{name}")'
    if path[0] == "stops":
        remedy = f'stops of a joint without a driver are those of "joint.{name}.{COORDINATE}"'
    return replace(problem, remedy=remedy)


def reference_problems(linkage: Any, known: Known) -> Iterator[Problem]:
    """What links, joints, drivers and loads say of each other that is not so."""
    yield from _links(linkage)
    have = {kind: set(known[f"{kind}s"]) for kind in ("link", "joint", "driver")}
    have["link"].add(FRAME)
    for kind, name, path in _references(linkage):
        does = TWO_LINKS.get(str(path[0]))
        if kind == "driver" and name not in have[kind]:
            yield no_driver(linkage, path, have[kind])
        elif name not in have[kind]:
            yield unknown_name(f"unknown-{kind}", kind, name, path_text(path), sorted(have[kind]))
        elif kind == "joint" and does and name in linkage.joints:
            number = len(linkage.joints[name].links)
            pulls = path[0] == "loads" and hasattr(linkage.loads[path[1]], "at")
            if pulls and linkage.joints[name].type == "R":
                message = f"{name} is a pin, along which nothing pulls"
                remedy = "take a motor or torsion_spring, or name a sliding joint"
                yield Problem("wrong-value", path_text(path), message, "", remedy)
            if linkage.joints[name].type == "weld":
                message, number = f"{name} is a weld, in which nothing moves", 0
                yield Problem("wrong-value", path_text(path), message, "", "name another joint")
            message = f"{name} is a pin of {number} links, and it is not said which two it {does}"
            remedy = "write the pin as joints of two links each"
            if number > 2:
                yield Problem("wrong-value", path_text(path), message, "", remedy)
    points = [*linkage.joints]
    points += [f"{link}.{marker}" for link, x in linkage.links.items() for marker in x.markers]
    for name, dimension in linkage.dimensions.items():
        for k, point in enumerate(dimension.points):
            if point not in points:
                where = path_text(("dimensions", name, "points", k))
                yield unknown_name("unknown-joint", "joint or marker", point, where, points)
    yield from _wheels(linkage)
    yield from _signals(linkage, known)
    by_joint: dict[str, list[str]] = defaultdict(list)
    for name, driver in linkage.drivers.items():
        by_joint[driver.joint].append(name)
    for joint, drivers in by_joint.items():
        if len(drivers) > 1:
            message = f"{listed(drivers)} all drive {joint}"
            where = path_text(("drivers", drivers[1]))
            remedy = f"remove {drivers[1]}"
            yield Problem("conflicting-drivers", where, message, "a joint has one driver", remedy)


def _wheels(linkage: Any) -> Iterator[Problem]:
    """Centres of wheels that are fixed to a link, where the link has no such marker."""
    for name, coupling in linkage.couplings.items():
        link, _, marker = coupling.driver.partition(".")
        markers = linkage.links[link].markers if link in linkage.links else {}
        if marker and marker not in markers and (link in linkage.links or link == FRAME):
            where = path_text(("couplings", name, "driver"))
            yield unknown_name(
                "unknown-marker", "marker", marker, where, markers, there=f" of {link}"
            )


def _signals(linkage: Any, known: Known) -> Iterator[Problem]:
    """Loads, couplings, signals named like owners of other outputs; wires that do not fit."""
    names: set[str] = set()
    owners = {"loads": (MECHANISM,), "couplings": OWNERS, "signals": OWNERS}
    for section, reserved in owners.items():
        names |= {*reserved}
        for name in filter(names.__contains__, getattr(linkage, section)):
            message = f"{name} is what other outputs are named after"
            where, remedy = path_text((section, name)), "choose another name"
            yield Problem("taken-name", where, message, f"taken: {listed(sorted(names))}", remedy)
        names |= {*getattr(linkage, section)}
    sections = ("signals", "loads", "couplings")
    wrong = {name for x in sections for name in {*known[x]} - {*getattr(linkage, x)}}
    for k, wire in enumerate(linkage.wires):
        if not wrong & {str(end).partition(".")[0] for end in wire.ends}:
            yield from wire_problems(linkage, wire, linkage.wires[:k])


def wire_problems(linkage: Any, wire: Wire, wires: Sequence[Wire]) -> Iterator[Problem]:
    """What is wrong with a wire of signals beside others that are there."""
    fed = next((w for w in wires if w.target == wire.target), None)
    blocks, owners = {**linkage.signals, **linkage.loads}, (*OWNERS, *linkage.couplings)
    yield from motion_or_signal(blocks, wire, wire.split_ends(blocks), fed, owners)


def _links(linkage: Any) -> Iterator[Problem]:
    """Markers whose names cannot stand, links without a pose, and what the frame has not."""
    for name, link in linkage.links.items():
        for marker in link.markers:
            if not is_name(marker):
                yield bad_name("marker", marker, path_text(("links", name, "markers", marker)))
        if name != FRAME and link.pose is None:
            message = f'{name} needs "pose": [x, y, angle]'
            valid = "an approximate place [m] and angle [rad] of its frame"
            yield Problem("missing-key", path_text(("links", name, "pose")), message, valid)
        for key in sorted(link.model_fields_set - {"markers"}) if name == FRAME else ():
            where, message = path_text(("links", FRAME, key)), f"the fixed link has no {key}"
            yield Problem("unknown-key", where, message, "keys there: markers", "remove it")
