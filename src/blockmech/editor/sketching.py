"""A sketch of links and joints, pin by pin, as changes of a joint-based form.

Each change takes the names of pins (see `blockmech.editor.pins`) and gives another form.
"""

from __future__ import annotations

import cmath
import copy
from collections.abc import Container, Iterable, Mapping, Sequence
from string import ascii_uppercase
from typing import Any

from blockmech.editor.fields import Path, with_item
from blockmech.editor.pins import (
    LOOSE,
    Drawn,
    cylinders_of,
    ends_of,
    guide_of,
    pins_of,
    pose_of,
    standing_at,
)
from blockmech.exchange.drawing import STEP
from blockmech.ground.errors import listed, refused
from blockmech.ground.names import numbered_name
from blockmech.ground.tolerances import EQUAL
from blockmech.ground.values import Place, xy
from blockmech.model.joints.contents import FRAME
from blockmech.typing import Data, Record

Form = Data
DIMENSIONS = {2: "length", 3: "angle"}  # of so many pins


def linked(form: Form, names: Iterable[str]) -> Form:
    """With a new link through pins. Raises `RequestError` for pins that one link holds already."""
    pins, names = pins_of(form), list(names)
    common = set.intersection(*({*pins[name].links} for name in names)) - {FRAME}
    if len({*names}) < 2:
        raise refused(listed(names), "a link needs two pins", "end it at another pin")
    if common:
        remedy = "choose pins of different links"
        raise refused(listed(names), f"they are on {listed(common)} already", remedy)
    return attached(form, names, _link(form, "link"))


def _link(form: Form, word: str) -> str:
    """A name for a new link."""
    return numbered_name(word, {*form["links"], FRAME})


def attached(form: Form, names: Iterable[str], link: str = FRAME) -> Form:
    """With pins on a link, new or known."""
    changed = copy.deepcopy(form)
    for name in names:
        pin = pins_of(changed)[name]
        if link in pin.links:
            continue
        if link not in changed["links"]:
            changed["links"][link] = (
                {} if link == FRAME else {"pose": [pin.z.real, pin.z.imag, 0.0]}
            )
        at = on_link(changed, link, pin.z)
        if not pin.links:
            changed = with_item(changed, (*LOOSE, name), None)
            changed = with_item(changed, ("links", link, "markers", name), {"at": at})
        elif pin.kind:
            joint = changed["joints"][name]
            if "angle" in joint:
                joint["angle"] += _angles(changed, [link], guide_of(changed, name))
            joint["links"].append(link)
            joint["at"].append(at)
        else:
            (first,) = pin.links
            before = changed["links"][first]["markers"][name]["at"]
            changed = _without_marker(changed, first, name)
            pair = [(first, before), (link, at)]
            pair = pair[::-1] if link == FRAME else pair  # so that the driver counts from the frame
            links, positions = map(list, zip(*pair, strict=True))
            changed["joints"][name] = {"type": "R", "links": links, "at": positions}
    return changed


def grounded(form: Form, names: Iterable[str]) -> Form:
    """With pins on the frame; without it, where all of them are on it already."""
    names = list(names)
    if not all(FRAME in pins_of(form)[name].links for name in names):
        return attached(form, names)
    for name in names:
        form = detached(form, name, FRAME)
    return form


def detached(form: Form, name: str, link: str) -> Form:
    """Without a link at a pin, which stays on what else carries it, or is loose.

    Of a joint that slides nothing stays, and no driver of a joint that changes.
    """
    pin = pins_of(form)[name]
    form = driven(form, [name]) if pin.driven else form
    joint, i = form.get("joints", {}).get(name), pin.links.index(link)
    if joint is None:
        form = with_item(_without_marker(form, link, name), (*LOOSE, name), xy(pin.z))
    elif len(pin.links) > 2:
        sides = {key: x[:i] + x[i + 1 :] for key, x in joint.items() if isinstance(x, list)}
        form = with_item(form, ("joints", name), {**joint, **sides})
    else:
        form = with_item(form, ("joints", name), None)
        if joint["type"] != "P":
            marker = {"at": joint["at"][1 - i]}
            form = with_item(form, ("links", pin.links[1 - i], "markers", name), marker)
    return {**form, "joints": form.get("joints", {})}


def moved(form: Form, positions: Mapping[str, complex]) -> Form:
    """With pins elsewhere on all their links, and whatever pin, guide or load stands there.

    A cylinder is swung about its pins and keeps its numbers. Places may be of any type with
    arithmetic.
    """
    pins = pins_of(form)
    targets = dict(positions)
    for name, z in positions.items():
        for companion in standing_at(pins, name):
            targets.setdefault(companion, z)
    swung = cylinders_of(form)
    for a, b in dict.fromkeys(ends for ends in swung.values() if {*ends} & targets.keys()):
        old, new = ([complex(at.get(end, pins[end].z)) for end in (a, b)] for at in ({}, targets))
        turn = cmath.phase((new[1] - new[0]) * (old[1] - old[0]).conjugate())
        for link in (link for link, ends in swung.items() if ends == (a, b)):
            k = (a, b).index(next(end for end in (a, b) if link in pins[end].links))
            o, e = pose_of(form, link)
            at = new[k] + (o - old[k]) * cmath.rect(1.0, turn)
            pose = [at.real, at.imag, cmath.phase(e) + turn]
            form = with_item(form, ("links", link, "pose"), pose)
    for name, z in targets.items():
        links = [link for link in pins[name].links if link not in swung]
        form = _put(form, name, pins[name], z, links)
    return _loads_put(form, [(pins[name], z) for name, z in targets.items()], swung)


def dimensioned(form: Form, a: str, b: str, value: float) -> Form:
    """With two pins at a distance [m]: the second moves, or the first where that one is fixed.

    Where the drawing has this distance as a dimension, that has another value.
    """
    pins = pins_of(form)
    points = {point_of(pins, a), point_of(pins, b)}
    for name, dimension in form.get("dimensions", {}).items():
        if dimension["type"] == "length" and {*dimension["points"]} == points:
            return dict(with_item(form, ("dimensions", name, "value"), value))
    if FRAME in pins[b].links and FRAME not in pins[a].links:
        a, b = b, a
    off = pins[b].z - pins[a].z
    return moved(form, {b: pins[a].z + value * (off / abs(off) if off else 1.0)})


def point_of(pins: Mapping[str, Drawn], name: str) -> str:
    """A pin as dimensions name it. Raises `RequestError` for one that no link carries."""
    if not pins[name].links:
        raise refused(name, "no link carries it", "draw a link to it first")
    return name if pins[name].kind else f"{pins[name].links[0]}.{name}"


def with_points(form: Form) -> Form:
    """With points of dimensions as they are called now, without dimensions of points not drawn."""
    pins, links = pins_of(form), form.get("links", {})
    points = {*form.get("joints", {})}
    points |= {f"{link}.{marker}" for link, x in links.items() for marker in x.get("markers", {})}

    def called(point: str) -> str | None:
        link, _, name = point.rpartition(".")
        on = pins[name].links if name in pins else ()
        return point_of(pins, name) if on and link in ("", *on) else None

    for name, dimension in form.get("dimensions", {}).items():
        now = [x if x in points else called(x) for x in dimension["points"]]
        item = None if None in now else {**dimension, "points": now}
        form = dict(with_item(form, ("dimensions", name), item))
    return form


def with_dimension(form: Form, names: Iterable[str]) -> Form:
    """With the distance of two pins or the angle of three as a dimension, as it is drawn."""
    names, pins = list(names), pins_of(form)
    if len(names) not in DIMENSIONS:
        raise refused(listed(names), "two pins have a distance, three an angle", "choose these")
    *first, corner, last = (pins[name].z for name in names)
    arms, kind = [z - corner for z in (*first, last)], DIMENSIONS[len(names)]
    if min(map(abs, arms)) <= EQUAL * max(map(abs, arms)):
        raise refused(listed(names), "they stand at one place", "choose pins that stand apart")
    value = cmath.phase(arms[1] / arms[0]) if first else abs(arms[0])
    dimension = {"type": kind, "points": [point_of(pins, name) for name in names], "value": value}
    name = numbered_name(kind, form.get("dimensions", {}))
    return dict(with_item(form, ("dimensions", name), dimension))


def pin_at(form: Form, end: Record) -> tuple[Form, str]:
    """The pin that an end of a gesture names, or a new one at its place ``at``, ``on`` a link."""
    pins = pins_of(form)
    if end.get("pin") in pins:
        return form, end["pin"]
    name = next((x for x in ascii_uppercase if x not in pins), "") or numbered_name("P", pins)
    changed = with_item(form, (*LOOSE, name), list(end["at"]))
    return (
        attached(changed, [name], end["on"]) if end.get("on") in form["links"] else changed
    ), name


def _put(form: Form, name: str, pin: Drawn, z: complex, links: Sequence[str]) -> Form:
    """With one pin elsewhere on links; places that the poses do not bring together stay apart.

    So only what is moved changes where poses are rounded, and so does no coordinate of a slider.
    """
    marker = ("markers", name, "at")
    positions: dict[Path, Any] = {
        ("links", link, *marker): on_link(form, link, z) for link in links
    }
    if pin.kind:
        at = list(form["joints"][name]["at"])
        for link in links:
            i = pin.links.index(link)
            (o, e), local = pose_of(form, link), Place.parse(at[i]).z
            apart = abs(o + e * local - pin.z) > EQUAL * (abs(complex(z)) + abs(pin.z))
            at[i] = (
                xy(local + (z - pin.z) / e) if apart or pin.kind == "P" else on_link(form, link, z)
            )
        positions = {("joints", name, "at"): at}
    elif not pin.links:
        positions = {(*LOOSE, name): xy(z)}
    for path, at in positions.items():
        form = with_item(form, path, at)
    return form


def _loads_put(form: Form, put: Sequence[tuple[Drawn, Any]], fixed: Container[str]) -> Form:
    """With the ends of loads at some pins where these are put, but on links that go as a whole."""
    for name, load in form.get("loads", {}).items():
        ends = ends_of(load)
        at = [position for _, position in ends]
        for i, (link, position) in enumerate(ends):
            o, e = pose_of(form, link)
            z_end = o + e * Place.parse(position).z
            for pin, z in put:
                coincident = abs(z_end - pin.z) <= EQUAL * (abs(o) + abs(z_end))
                if coincident and link in pin.links and link not in fixed:
                    at[i] = on_link(form, link, z)
        if at != [position for _, position in ends]:
            path = ("loads", name, "at")
            form = dict(with_item(form, path, at if load.get("links") else at[0]))
    return form


def sliding(form: Form, names: Iterable[str], angle: float | None = None, on: str = FRAME) -> Form:
    """With joints that slide along lines at an angle [rad]; those that slide turn again.

    A pin that joins nothing yet gets a block: the pin turns on it, and the block slides along
    a guide of link ``on``; without an angle along that link, on the ground along x. Raises
    `RequestError` for a guide on the pin's own link, and for a joint that is driven.
    """
    if angle is None:
        ends = [pin.z for pin in pins_of(form).values() if on in pin.links and on != FRAME]
        angle = cmath.phase(ends[-1] - ends[0]) if len(ends) > 1 else 0.0
    for name in names:
        joins = name in form["joints"]
        form = _of_kind(form, name, "P", angle) if joins else _on_a_block(form, name, angle, on)
    return form


def welded(form: Form, names: Iterable[str]) -> Form:
    """With welds in place of joints, and pins in place of welds.

    A pin of one link is put on the frame. Raises `RequestError` for a pin of none, and for a
    joint that is driven.
    """
    for name in names:
        form = _of_kind(with_joint(form, name), name, "weld", 0.0)
    return form


def _of_kind(form: Form, name: str, kind: str, angle: float) -> Form:
    """With a joint of a kind along an angle [rad] of the drawing; a pin if it was of that kind."""
    joint = form["joints"][name]
    if pins_of(form)[name].driven:
        remedy = "take its driver away first"
        raise refused(name, "it is driven, and its law is one of the kind it has", remedy)
    changed = {"type": "R", "links": joint["links"], "at": joint["at"]}
    if joint["type"] != kind:
        changed |= {"type": kind, "angle": _angles(form, joint["links"], angle)}
    return dict(with_item(form, ("joints", name), changed))


def _on_a_block(form: Form, name: str, angle: float, on: str) -> Form:
    """With a pin on a block of its own that slides on a link."""
    pins = pins_of(form)
    if on in pins[name].links:
        raise refused(name, f"is a pin of {on}", "choose another link that it slides on")
    block = _link(form, "slider")
    form = attached(form, [name], block)
    if on not in form["links"]:
        form = with_item(form, ("links", on), {})
    guide = numbered_name(f"{name}_guide", pins)
    return _guided(form, guide, {on: pins[name].z, block: pins[name].z}, angle)


def _guided(form: Form, name: str, positions: Mapping[str, complex], angle: float) -> Form:
    """With a joint at which two links, each at its place, slide along a direction [rad]."""
    at = [on_link(form, link, z) for link, z in positions.items()]
    guide = {"type": "P", "links": [*positions], "at": at, "angle": _angles(form, positions, angle)}
    return dict(with_item(form, ("joints", name), guide))


def _angles(form: Form, links: Iterable[str], angle: float) -> list[float]:
    """A direction [rad] of the drawing in the frames of links."""
    return [angle - cmath.phase(pose_of(form, link)[1]) for link in links]


def cylinder(form: Form, names: Iterable[str]) -> Form:
    """With a cylinder between two pins, whose rod is driven out of its barrel."""
    (a, b), pins = both_pins(names), pins_of(form)
    barrel = _link(form, "barrel")
    form = attached(form, [a], barrel)
    rod = _link(form, "rod")
    form = attached(form, [b], rod)
    guide = numbered_name("cylinder", pins)
    positions, axis = {barrel: pins[a].z, rod: pins[b].z}, pins[b].z - pins[a].z
    return driven(_guided(form, guide, positions, cmath.phase(axis)), [guide])


def turned(form: Form, names: Iterable[str], angle: float) -> Form:
    """With the last of three pins at an angle [rad] to the first about the second.

    Of two pins the angle of the second about the first is counted from the x axis.
    """
    names, pins = list(names), pins_of(form)
    *first, middle, last = (pins[name].z for name in names)
    base = cmath.phase(first[0] - middle) if first else 0.0
    return moved(form, {names[-1]: middle + cmath.rect(abs(last - middle), base + angle)})


def copied(form: Form, names: Iterable[str]) -> Form:
    """With copies of pins, a little beside, and of the links of which two of them are pins."""
    chosen, pins = list(names), pins_of(form)
    size = max(abs(pin.z - pins[chosen[0]].z) for pin in pins.values()) or 1.0
    by = complex(STEP, -STEP) * size
    links = dict.fromkeys(x for name in chosen for x in pins[name].links if x != FRAME)
    changed, called = form, dict[str, str]()
    for name in chosen:
        changed, called[name] = pin_at(changed, {"at": xy(pins[name].z + by)})
    for link in links:
        members = [called[name] for name in chosen if link in pins[name].links]
        if len(members) > 1:
            copy_ = _link(changed, link)
            x, y, angle = form["links"][link].get("pose") or (0.0, 0.0, 0.0)
            body = {k: v for k, v in form["links"][link].items() if k != "markers"}
            body["pose"] = [x + by.real, y + by.imag, angle]
            changed = attached(with_item(changed, ("links", copy_), body), members, copy_)
    return changed


def both_pins(names: Iterable[str]) -> tuple[str, str]:
    """The two pins that something is between. Raises `RequestError` for any other number."""
    ends = list(dict.fromkeys(names))
    if len(ends) != 2:
        fault = f"it is between two pins, and {len(ends)} are chosen"
        raise refused(listed(ends) or "pins", fault, "choose two pins")
    return ends[0], ends[1]


def driven(form: Form, names: Iterable[str]) -> Form:
    """With joints that are driven, or no longer; one that turns goes round.

    A pin of one link is put on the frame. Raises `RequestError` for a pin of none.
    """
    for name in names:
        drivers = form.get("drivers", {})
        mine = [driver for driver, driver_data in drivers.items() if driver_data["joint"] == name]
        if mine:
            form = _without_drivers(form, mine)
        else:
            form = with_joint(form, name)
            turns = form["joints"][name]["type"] == "R"
            law = {"law": "constant_rate", "rate": 1.0} if turns else {}
            motor = numbered_name("motor", drivers)
            form = with_item(form, ("drivers", motor), {"joint": name, **law})
    return form


def with_joint(form: Form, name: str) -> Form:
    """With a pin of one link on the frame. Raises `RequestError` for a pin of none."""
    if name in form["joints"]:
        return form
    if not pins_of(form)[name].links:
        raise refused(name, "it joins no two links", "draw a link to it first")
    return attached(form, [name])


def _without_drivers(form: Form, gone: Iterable[str]) -> Form:
    """Without drivers, and without what couples them or says where they begin and end."""
    changed, names = dict(form), {*gone}
    for section in ("drivers", "initial", "stops", "motion"):
        changed[section] = {n: x for n, x in form.get(section, {}).items() if n not in names}
    changed["couplings"] = {
        n: x for n, x in form.get("couplings", {}).items() if not names & {x["driver"], x["driven"]}
    }
    return changed


def removed(form: Form, names: Iterable[str]) -> Form:
    """Without pins, and without links to which no two pins are left."""
    touched = {link for name in names for link in pins_of(form)[name].links} - {FRAME}
    for name in names:
        while links := getattr(pins_of(form).get(name), "links", ()):
            form = detached(form, name, links[0])
        form = with_item(form, (*LOOSE, name), None)
    for link in touched & form["links"].keys():
        if sum(link in pin.links for pin in pins_of(form).values()) < 2:
            form = without_link(form, link)
    return form


def without_link(form: Form, link: str) -> Form:
    """Without a link and what acts on it; its pins stay, on what else carries them."""
    if link == FRAME or link not in form["links"]:
        raise refused(link, "no link is called so, or it is the frame", "choose another link")
    for name, pin in pins_of(form).items():
        if link in pin.links:
            form = detached(form, name, link)
    for load, load_data in form.get("loads", {}).items():
        if link in (load_data.get("link"), *(load_data.get("links") or ())):
            form = with_item(form, ("loads", load), None)
    links = {name: x for name, x in form["links"].items() if name != link}
    return {**form, "links": links}


def without_item(form: Form, section: str, name: str) -> Form:
    """Without an item of a section, and what names it."""
    if section == "links":
        return without_link(form, name)
    if section == "joints":
        return removed(form, [name])
    if section == "drivers":
        return _without_drivers(form, [name])
    if name not in form.get(section, {}):
        raise refused(name, f"there is none among {section}", "choose it again")
    return dict(with_item(form, (section, name), None))


def posed(form: Form, poses: Mapping[str, Iterable[float]]) -> Form:
    """With links in other poses [m, m, rad]: the drawing is then of these."""
    for link, pose in poses.items():
        if link in form["links"] and link != FRAME:
            form = with_item(form, ("links", link, "pose"), [float(x) for x in pose])
    return form


def _without_marker(form: Form, link: str, name: str) -> Form:
    """Without a marker of a link, and without the frame if nothing else is there."""
    changed = with_item(form, ("links", link, "markers", name), None)
    return {**changed, "links": {**changed["links"], link: changed["links"].get(link, {})}}


def on_link(form: Record, link: str, z: complex) -> list[float]:
    """A place of the drawing in a link's frame."""
    o, e = pose_of(form, link)
    return xy((z - o) / e)
