"""A sketch of links and joints, pin by pin, as changes of a joint-based form.

A pin that no link carries is a place in ``view``; one that one link carries is a marker of it;
with a second link it becomes a joint. The frame of a new link lies as the ground's, so a drawing
is its own approximate pose. Each change takes the names of pins and gives another form.
"""

from __future__ import annotations

import cmath
import copy
from collections.abc import Iterable, Mapping
from string import ascii_uppercase
from typing import Any, NamedTuple

from blockmech.errors import refused
from blockmech.model.joints.contents import FRAME
from blockmech.studio.fields import Path, item_at, with_item
from blockmech.values import Place

Form = dict[str, Any]
LOOSE = ("view", "pins")  # where pins stand that no link carries yet
SAME = 1e-9  # of the drawing's size, within which two pins stand on one place: it has 3 digits


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
    """All joints, markers and loose pins of a form where they are drawn."""
    driven = {driver["joint"] for driver in form.get("drivers", {}).values()}
    found = {name: Drawn(complex(*at)) for name, at in (item_at(form, LOOSE) or {}).items()}
    for link, given in form.get("links", {}).items():
        o, e = pose_of(form, link)
        for name, marker in given.get("markers", {}).items():
            found[name] = Drawn(o + e * Place.parse(marker["at"]).z, (link,))
    for name, joint in form.get("joints", {}).items():
        o, e = pose_of(form, joint["links"][0])
        z = o + e * Place.parse(joint["at"][0]).z
        found[name] = Drawn(z, tuple(joint["links"]), joint["type"], name in driven)
    return found


def free(taken: Iterable[str], words: Iterable[str], wish: str) -> str:
    """The first of some words that is free, or the wish with a number."""
    known = set(taken)
    more = (f"{wish}{i}" for i in range(1, len(known) + 2))
    return next(name for name in [*words, *more] if name not in known)


def drawn(form: Form, z: complex) -> Form:
    """With a new pin that no link carries."""
    name = free(pins_of(form), ascii_uppercase, "P")
    made: Form = with_item(form, (*LOOSE, name), [z.real, z.imag])
    return made


def linked(form: Form, names: Iterable[str]) -> Form:
    """With a new link through pins."""
    return attached(form, names, free([*form["links"], FRAME], ["link"], "link"))


def attached(form: Form, names: Iterable[str], link: str = FRAME) -> Form:
    """With pins on a link, new or known."""
    made = copy.deepcopy(form)
    for name in names:
        pin = pins_of(made)[name]
        if link in pin.links:
            continue
        if link not in made["links"]:
            made["links"][link] = {} if link == FRAME else {"pose": [pin.z.real, pin.z.imag, 0.0]}
        at = _on(made, link, pin.z)
        if not pin.links:
            made = with_item(made, (*LOOSE, name), None)
            made = with_item(made, ("links", link, "markers", name), {"at": at})
        elif pin.kind:
            made["joints"][name]["links"].append(link)
            made["joints"][name]["at"].append(at)
        else:
            (first,) = pin.links
            before = made["links"][first]["markers"][name]["at"]
            made = _without_marker(made, first, name)
            pair = [(first, before), (link, at)]
            pair = pair[::-1] if link == FRAME else pair  # so that the driver counts from the frame
            links, places = map(list, zip(*pair, strict=True))
            made["joints"][name] = {"type": "R", "links": links, "at": places}
    return made


def moved(form: Form, name: str, z: complex) -> Form:
    """With a pin at z on all its links, and whatever pin or guide of theirs stands on it."""
    pins = pins_of(form)
    here = pins[name]
    size = max(abs(pin.z - here.z) for pin in pins.values())
    for other, pin in pins.items():
        shared = not pin.links or {*pin.links} & {*here.links}
        if other == name or (shared and pin.kind and abs(pin.z - here.z) <= SAME * size):
            form = _put(form, other, pin, z)
    return form


def _put(form: Form, name: str, pin: Drawn, z: complex) -> Form:
    """With one pin elsewhere."""
    marker = ("markers", name, "at")
    places: dict[Path, Any] = {("links", link, *marker): _on(form, link, z) for link in pin.links}
    if pin.kind:
        places = {("joints", name, "at"): list(places.values())}
    for path, at in (places or {(*LOOSE, name): [z.real, z.imag]}).items():
        form = with_item(form, path, at)
    return form


def sliding(form: Form, names: Iterable[str], angle: float, on: str = FRAME) -> Form:
    """With joints that slide along lines at an angle [rad]; those that slide turn again.

    A pin that joins nothing yet gets a block: the pin turns on it, and the block slides along
    a guide of link ``on``. Raises `RequestError` for a guide on the pin's own link.
    """
    for name in names:
        joint = form["joints"].get(name)
        if joint is None:
            form = _on_a_block(form, name, angle, on)
        else:
            made = {"type": "R", "links": joint["links"], "at": joint["at"]}
            if joint["type"] == "R":
                made |= {"type": "P", "angle": _angles(form, joint["links"], angle)}
            form = with_item(form, ("joints", name), made)
    return form


def _on_a_block(form: Form, name: str, angle: float, on: str) -> Form:
    """With a pin on a block of its own that slides on a link."""
    pins = pins_of(form)
    if on in pins[name].links:
        raise refused(name, f"is a pin of {on}", "choose another link that it slides on")
    block = free([*form["links"], FRAME], ["slider"], "slider")
    form = attached(form, [name], block)
    if on not in form["links"]:
        form = with_item(form, ("links", on), {})
    links, z = [on, block], pins[name].z
    guide = {
        "type": "P",
        "links": links,
        "at": [_on(form, link, z) for link in links],
        "angle": _angles(form, links, angle),
    }
    made: Form = with_item(form, ("joints", free(pins, [f"{name}_guide"], f"{name}_guide")), guide)
    return made


def _angles(form: Form, links: Iterable[str], angle: float) -> list[float]:
    """A direction [rad] of the drawing in the frames of links."""
    return [angle - cmath.phase(pose_of(form, link)[1]) for link in links]


def driven(form: Form, names: Iterable[str]) -> Form:
    """With joints that are driven, or no longer; one that turns goes round."""
    for name in names:
        drivers = form.get("drivers", {})
        mine = [driver for driver, given in drivers.items() if given["joint"] == name]
        if mine or name not in form["joints"]:
            form = {**form, "drivers": {n: d for n, d in drivers.items() if n not in mine}}
        else:
            turns = form["joints"][name]["type"] == "R"
            law = {"law": "constant_rate", "rate": 1.0} if turns else {}
            motor = free(drivers, ["motor"], "motor")
            form = with_item(form, ("drivers", motor), {"joint": name, **law})
    return form


def removed(form: Form, names: Iterable[str]) -> Form:
    """Without pins."""
    for name in names:
        pin = pins_of(form)[name]
        form = driven(form, [name]) if pin.driven else form
        form = with_item(with_item(form, ("joints", name), None), (*LOOSE, name), None)
        for link in pin.links:
            form = _without_marker(form, link, name)
    return form


def _without_marker(form: Form, link: str, name: str) -> Form:
    """Without a marker of a link, and without the frame if nothing else is there."""
    made = with_item(form, ("links", link, "markers", name), None)
    return {**made, "links": {**made["links"], link: made["links"].get(link, {})}}


def _on(form: Mapping[str, Any], link: str, z: complex) -> list[float]:
    """A place of the drawing in a link's frame."""
    o, e = pose_of(form, link)
    at = (z - o) / e
    return [at.real, at.imag]
