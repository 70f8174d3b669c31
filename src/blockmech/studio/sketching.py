"""A sketch of links and joints, pin by pin, as changes of a joint-based form.

A pin that one link carries is a marker of it; with a second link it becomes a joint. The frame
of a new link lies as the ground's, so a drawing is its own approximate pose.
"""

from __future__ import annotations

import cmath
import copy
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from blockmech.model.joints.contents import FRAME
from blockmech.values import Place

Form = dict[str, Any]


class Drawn(NamedTuple):
    """A pin of the sketch: its place [m], the links that it joins, and its kind."""

    z: complex
    links: tuple[str, ...] = ()
    kind: str = ""  # "R", "P", or "" of what joins nothing yet
    driven: bool = False


def pose_of(form: Mapping[str, Any], link: str) -> tuple[complex, complex]:
    """Origin [m] and x axis of a link's frame in the drawing."""
    x, y, angle = form["links"].get(link, {}).get("pose") or (0.0, 0.0, 0.0)
    return complex(x, y), cmath.rect(1.0, angle)


def pins_of(form: Mapping[str, Any]) -> dict[str, Drawn]:
    """All joints and markers of a form where they are drawn."""
    driven = {driver["joint"] for driver in form.get("drivers", {}).values()}
    found = {}
    for link, given in form.get("links", {}).items():
        o, e = pose_of(form, link)
        for name, marker in given.get("markers", {}).items():
            found[name] = Drawn(o + e * Place.parse(marker["at"]).z, (link,))
    for name, joint in form.get("joints", {}).items():
        o, e = pose_of(form, joint["links"][0])
        z = o + e * Place.parse(joint["at"][0]).z
        found[name] = Drawn(z, tuple(joint["links"]), joint["type"], name in driven)
    return found


def free(taken: Iterable[str], wish: str = "") -> str:
    """The first name that is free: a capital letter, or the wish with a number."""
    known = set(taken)
    letters = (chr(ord("A") + i) for i in range(26))
    wishes = [wish] if wish else list(letters)
    more = (f"{wish or 'P'}{i}" for i in range(1, len(known) + 2))
    return next(name for name in [*wishes, *more] if name not in known)


def attached(form: Form, name: str, z: complex, link: str) -> Form:
    """The form in which a link, new or known, carries a pin that stands at z."""
    made: Form = copy.deepcopy(form)
    pin = pins_of(made).get(name, Drawn(z))
    if link in pin.links:
        return made
    if link != FRAME and link not in made["links"]:
        made["links"][link] = {"pose": [pin.z.real, pin.z.imag, 0.0]}
    at = _on(made, link, pin.z)
    if not pin.links:
        made["links"].setdefault(link, {}).setdefault("markers", {})[name] = {"at": at}
    elif pin.kind:
        joint = made["joints"][name]
        joint["links"].append(link)
        joint["at"].append(at)
    else:
        (first,) = pin.links
        before = _without_marker(made, first, name)
        pair = [(first, before), (link, at)]
        pair = pair[::-1] if link == FRAME else pair  # so that the driver counts from the frame
        made["joints"][name] = {
            "type": "R", "links": [one for one, _ in pair], "at": [place for _, place in pair],
        }  # fmt: skip
    return made


def linked(form: Form, pins: Mapping[str, complex], link: str) -> Form:
    """The form with a link through pins."""
    for name, z in pins.items():
        form = attached(form, name, z, link)
    return form


def moved(form: Form, name: str, z: complex) -> Form:
    """The form in which a pin stands at z on all its links."""
    made: Form = copy.deepcopy(form)
    if name in made["joints"]:
        joint = made["joints"][name]
        joint["at"] = [_on(made, link, z) for link in joint["links"]]
    for link, given in made["links"].items():
        if name in given.get("markers", {}):
            given["markers"][name]["at"] = _on(made, link, z)
    return made


def sliding(form: Form, name: str, angle: float) -> Form:
    """The form in which a joint of two links slides along a line at an angle [rad].

    One that slides already turns again.
    """
    made: Form = copy.deepcopy(form)
    joint = made["joints"][name]
    kept = {"links": joint["links"], "at": joint["at"]}
    if joint["type"] == "P":
        made["joints"][name] = {"type": "R", **kept}
    else:
        turns = [angle - cmath.phase(pose_of(form, link)[1]) for link in joint["links"]]
        made["joints"][name] = {"type": "P", **kept, "angle": turns}
    return made


def driven(form: Form, joint: str) -> Form:
    """The form in which a joint is driven, or no longer; one that turns goes round."""
    made: Form = copy.deepcopy(form)
    drivers = made.setdefault("drivers", {})
    for name in [n for n, driver in drivers.items() if driver["joint"] == joint]:
        del drivers[name]
        return made
    law = {"law": "constant_rate", "rate": 1.0} if made["joints"][joint]["type"] == "R" else {}
    drivers[free(drivers, "motor")] = {"joint": joint, **law}
    return made


def removed(form: Form, name: str) -> Form:
    """The form without a pin, or without a link: its joints become markers of what is left."""
    made: Form = copy.deepcopy(form)
    drivers = made.get("drivers", {})
    if name in made["links"]:
        for joint in [n for n, j in made["joints"].items() if name in j["links"]]:
            pin = pins_of(made)[joint]
            left = [link for link in pin.links if link != name]
            made = removed(made, joint)
            for link in left:
                made = attached(made, joint, pin.z, link)
        del made["links"][name]
        return made
    made["joints"].pop(name, None)
    made["drivers"] = {n: driver for n, driver in drivers.items() if driver["joint"] != name}
    for link in list(made["links"]):
        _without_marker(made, link, name)
    return made


def _without_marker(form: Form, link: str, name: str) -> Any:
    """Take a marker from a link; its place there."""
    markers = form["links"][link].get("markers", {})
    place = markers.pop(name, {}).get("at")
    if not markers:
        form["links"][link].pop("markers", None)
    if link == FRAME and not form["links"][FRAME]:
        del form["links"][FRAME]
    return place


def _on(form: Mapping[str, Any], link: str, z: complex) -> list[float]:
    """A place of the drawing in a link's frame."""
    o, e = pose_of(form, link)
    at = (z - o) / e
    return [at.real, at.imag]
