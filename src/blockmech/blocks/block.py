"""What stands in a graph: something with links, markers and joints, found by its type.

Moving blocks (`blockmech.blocks.contract`), the frame and loads are all blocks.
"""

from __future__ import annotations

import functools
from collections import namedtuple
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any, ClassVar, LiteralString, TypeAlias

import numpy as np
from pydantic import ValidationError
from pydantic_core import InitErrorDetails, PydanticCustomError

from blockmech.blocks.joints import BuiltIn, Joint, Kernels
from blockmech.ground.errors import close_match, listed
from blockmech.ground.names import NAME_RULE, is_name
from blockmech.ground.plane import has_arithmetic
from blockmech.ground.registry import Registry
from blockmech.ground.validation_errors import mistake
from blockmech.ground.values import Link, Marker, Pair, StrictModel
from blockmech.typing import Parameters

REGISTRY = Registry(
    "block type",
    code="unknown-block",
    families={"coupling": "blockmech.couplings.kinds", "signal": "blockmech.signals.kinds"},
)
"""Every block type by name: blocks, loads and couplings."""


Mistake: TypeAlias = tuple[tuple[str, ...], PydanticCustomError]
"""Where in a model, and what is wrong there."""


class Block(StrictModel):
    """Base class of everything in a graph. Concrete classes register under their ``type``."""

    model_config = {"ignored_types": (Joint, Kernels)}

    _called: ClassVar[str] = "a block"
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
        cls.declare()
        REGISTRY.register(type, cls)

    @classmethod
    def declare(cls) -> None:
        """Collect the joints that the class declares. Raises `TypeError` for invalid ones."""
        cls.joints = {
            name: replace(joint, name=name)
            for name, joint in vars(cls).items()
            if isinstance(joint, Joint)
        }
        for joint in cls.joints.values():
            for link in filter(None, (joint.link, *joint.links)):
                if link not in cls.link_names:
                    raise TypeError(f"{cls.__name__}.{joint.name}: no link {link!r} is declared")

    def links_or_default(self) -> dict[str, Link]:
        """Every link of the block with its mass properties and markers."""
        properties: dict[str, Link] = getattr(self, "links", {})
        return {name: properties.get(name, NO_LINK) for name in self.link_names}

    def own_markers(self) -> dict[str, tuple[str, Marker | BuiltIn]]:
        """The markers that the block brings at its joints: name -> (link, marker)."""
        return {name: (m.link, m) for name, m in self.built_in.items()}

    @functools.cached_property
    def all_markers(self) -> Mapping[str, tuple[str, Marker | BuiltIn]]:
        """All markers: name -> (link, marker). Built-in ones first, a link's name is one."""
        markers = self.own_markers()
        for link in self.link_names:
            markers.setdefault(link, (link, BuiltIn(link)))
        for link, properties in self.links_or_default().items():
            for name, marker in properties.markers.items():
                markers[name] = (link, marker)
        return markers

    def place_of(self, marker: Marker | BuiltIn) -> complex:
        """Position [m] of a marker of the block, in the frame of the marker's link."""
        if isinstance(marker, Marker):
            return marker.at.z
        position: complex = (getattr(self, marker.along) or 0.0) + 0j if marker.along else 0j
        return position

    @classmethod
    def parameter_names(cls) -> tuple[str, ...]:
        """Names of the block's parameters, in the order of declaration."""
        return tuple(n for n in cls.model_fields if n not in NOT_FOR_KERNELS)

    def parameters(self) -> Parameters:
        """Parameters of the block, the named tuple ``p`` of its kernels."""
        values = {n: _number(getattr(self, n)) for n in self.parameter_names()}
        numbers = {n: x for n, x in values.items() if x is not None}
        return _record(type(self).__name__ + "Numbers", tuple(numbers))(*numbers.values())


NO_LINK = Link()
SHARED_FIELDS = frozenset({"links", "markers", "friction", "clearance", "slider", "useful"})
NOT_FOR_KERNELS = SHARED_FIELDS | {"sign", "offset"}  # the core turns a driver's coordinate


def _number(value: Any) -> Any:
    if isinstance(value, Pair):
        return value.z
    if isinstance(value, int | float | np.floating | np.integer) and not isinstance(value, bool):
        return float(value)
    return value if has_arithmetic(value) else None


@functools.cache
def _record(name: str, fields: tuple[str, ...]) -> Any:
    return namedtuple(name, fields)  # the fields are known at run time only


# -- what a block refuses, all at once and each at its own place ---------------------


def refuse(title: str, mistakes: Iterable[Mistake]) -> None:
    """Refuse a model with all its mistakes, each at its own place."""
    lines = [InitErrorDetails(type=error, loc=where, input=None) for where, error in mistakes]
    if lines:
        raise ValidationError.from_exception_data(title, lines)


def wrong_links(
    links: Mapping[str, Link], valid: Iterable[str], built_in: Iterable[str]
) -> Iterator[Mistake]:
    """Links that the block does not have, and markers whose names cannot stand or are taken."""
    names = tuple(valid)
    reserved = {*built_in, *names}
    for link, properties in links.items():
        if link not in names:
            yield (link,), unknown_name("unknown-link", "link", link, names)
        for marker in properties.markers:
            where = (link, "markers", marker)
            if not is_name(marker):
                yield where, bad_name("marker", marker)
            elif marker in reserved:
                message = f'the marker name "{marker}" is taken in this block'
                yield where, mistake("taken-name", message, f"taken: {listed(sorted(reserved))}")
            reserved.add(marker)


def unknown_name(
    code: LiteralString, kind: str, name: str, valid: tuple[str, ...]
) -> PydanticCustomError:
    """A name that the block does not declare, with the declared ones and the nearest of them."""
    names = f"{kind}s there: {listed(valid)}"
    return mistake(code, f'no {kind} "{name}"', names, close_match(name, valid))


def bad_name(kind: str, name: str) -> PydanticCustomError:
    """A name that could not stand in an address."""
    return mistake("bad-name", f'"{name}" is not a {kind} name', NAME_RULE, "choose another name")
