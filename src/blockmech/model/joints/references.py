"""Names in a joint-based document that are not there, and what does not fit together."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any, TypeAlias

from blockmech.ground.errors import Problem, listed, path_text, unknown_name
from blockmech.ground.names import is_name
from blockmech.model.diagram import Wire
from blockmech.model.form import bad_name
from blockmech.model.joints.contents import FRAME
from blockmech.model.scene import PER_DRIVER
from blockmech.model.structure import COORDINATE
from blockmech.model.versions import OWNERS
from blockmech.model.wires import wire_problems as motion_or_signal

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


def reference_problems(linkage: Any, known: Known) -> Iterator[Problem]:
    """What links, joints, drivers and loads say of each other that is not so."""
    yield from _links(linkage)
    have = {kind: set(known[f"{kind}s"]) for kind in ("link", "joint", "driver")}
    have["link"].add(FRAME)
    for kind, name, path in _references(linkage):
        does = TWO_LINKS.get(str(path[0]))
        if name not in have[kind]:
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
    """Couplings and signal blocks named like the owners of other outputs; wires that do not fit."""
    names = {*OWNERS, *linkage.loads}
    for section in ("couplings", "signals"):
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
