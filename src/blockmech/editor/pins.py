"""A form of links and joints as it is drawn: its pins, its links' outlines, its cylinders.

A pin that no link carries is a place in ``view``; one that one link carries is a marker of it;
with a second link it becomes a joint. The frame of a new link lies as the ground's, so a drawing
is its own approximate pose.
"""

from __future__ import annotations

import cmath
from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Any, NamedTuple

from blockmech.editor.fields import item_at
from blockmech.ground.tolerances import EQUAL
from blockmech.ground.values import Place
from blockmech.model.joints.contents import FRAME
from blockmech.typing import Record

LOOSE = ("view", "pins")  # where pins stand that no link carries yet


class Drawn(NamedTuple):
    """A pin of the sketch: its place [m], the links that it joins, and its kind."""

    z: complex
    links: tuple[str, ...] = ()
    kind: str = ""  # "R", "P", or "" of what joins nothing yet
    driven: bool = False


def pose_of(form: Record, link: str) -> tuple[complex, complex]:
    """Origin [m] and x axis of a link's frame in the drawing."""
    x, y, angle = form["links"].get(link, {}).get("pose") or (0.0, 0.0, 0.0)
    return complex(x, y), cmath.rect(1.0, angle)


def pins_of(form: Record) -> dict[str, Drawn]:
    """All joints, markers and loose pins of a form where they are drawn."""
    driven = {driver["joint"] for driver in form.get("drivers", {}).values()}
    pins = {name: Drawn(complex(*at)) for name, at in (item_at(form, LOOSE) or {}).items()}
    for link, body in form.get("links", {}).items():
        o, e = pose_of(form, link)
        for name, marker in body.get("markers", {}).items():
            pins[name] = Drawn(o + e * Place.parse(marker["at"]).z, (link,))
    for name, joint in form.get("joints", {}).items():
        o, e = pose_of(form, joint["links"][0])
        z = o + e * Place.parse(joint["at"][0]).z
        pins[name] = Drawn(z, tuple(joint["links"]), joint["type"], name in driven)
    return pins


def standing_at(pins: Mapping[str, Drawn], name: str) -> list[str]:
    """The pins and guides at the place of a pin that share a link with it, without itself."""
    z, links = pins[name].z, {*pins[name].links}
    size = max(abs(pin.z - z) for pin in pins.values())
    return [
        companion
        for companion, pin in pins.items()
        if companion != name
        and (not pin.links or {*pin.links} & links)
        and pin.kind
        and abs(pin.z - z) <= EQUAL * size
    ]


def cylinders_of(form: Record) -> dict[str, tuple[str, str]]:
    """Barrels and rods, with the pins of the two: links that have a pin, and a guide at it."""
    on = dict[str, list[tuple[str, str, complex]]]()
    for name, joint in form.get("joints", {}).items():
        for link, at in zip(joint["links"], joint["at"], strict=True):
            on.setdefault(link, []).append((name, joint["type"], Place.parse(at).z))
    ends = dict[str, tuple[str, str]]()  # link -> its guide and its pin
    for link, joints in on.items():
        kinds = {kind: (name, z) for name, kind, z in joints}
        if link != FRAME and len(joints) == 2 and kinds.keys() == {"P", "R"}:
            (guide, z), (pin, at) = kinds["P"], kinds["R"]
            if z == at:
                ends[link] = guide, pin
    both = {g: [pin for guide, pin in ends.values() if guide == g] for g, _ in ends.values()}
    return {link: (both[g][0], both[g][1]) for link, (g, _) in ends.items() if len(both[g]) == 2}


def ends_of(load: Record) -> list[tuple[str, Any]]:
    """The links of a load, each with the place on it; none of a load without places."""
    links, at = load.get("links"), load.get("at")
    ends: list[Any] = (
        list(zip(links, at or (), strict=False)) if links else [(load.get("link"), at)]
    )
    return [] if any(None in end for end in ends) else ends


def guide_of(form: Record, name: str) -> float:
    """The direction [rad] of a guide in the drawing."""
    joint = form["joints"][name]
    directions = joint.get("angle") or [
        cmath.phase(complex(*d)) for d in joint.get("dir") or [(1, 0)]
    ]
    return float(directions[0]) + cmath.phase(pose_of(form, joint["links"][0])[1])


def outlines_of(pins: Mapping[str, Drawn]) -> dict[str, list[str]]:
    """The pins of each link in the order in which they are joined by its outline."""
    outlines = {}
    for link in dict.fromkeys(x for pin in pins.values() for x in pin.links if x != FRAME):
        ends = {name: pin.z for name, pin in pins.items() if link in pin.links}
        middle = sum(ends.values()) / len(ends)
        around = sorted(ends, key=lambda name: cmath.phase(ends[name] - middle))
        outlines[link] = around if len(ends) > 2 else list(ends)
    return outlines


def sides_of(ends: list[str]) -> Iterator[tuple[str, str]]:
    """Neighbours on an outline."""
    around = [*ends, *ends[:1]] if len(ends) > 2 else ends
    yield from ((min(a, b), max(a, b)) for a, b in pairwise(around))
