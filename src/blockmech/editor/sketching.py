"""A sketch of links and joints, pin by pin, as changes of a joint-based form.

A pin that no link carries is a place in ``view``; one that one link carries is a marker of it;
with a second link it becomes a joint. The frame of a new link lies as the ground's, so a drawing
is its own approximate pose. Each change takes the names of pins and gives another form.
"""

from __future__ import annotations

import cmath
import copy
import math
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from string import ascii_uppercase
from typing import Any, NamedTuple

import numpy as np

from blockmech.blocks.registry import REGISTRY
from blockmech.editor.fields import Path, item_at, with_item
from blockmech.ground.errors import listed, refused
from blockmech.ground.values import Place, xy
from blockmech.model.joints.contents import FRAME
from blockmech.typing import Data, Record

Form = Data
LOOSE = ("view", "pins")  # where pins stand that no link carries yet
BAR = 1.0  # [kg/m] of a bar whose mass nobody has said
STEP = 0.05  # of the drawing, by which a copy stands beside what it is of
CAM = 10.0  # distance of a cam's follower from its shaft, over rise and roller of a new one
PAIRS = {"R": "a joint that turns", "P": "a joint that slides"}
SAME = 1e-9  # of the drawing's size, within which two pins stand on one place: it has 3 digits


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


def free(names: Iterable[str], preferred: Iterable[str], wish: str) -> str:
    """The first of some words that is free, or the wish with a number."""
    used = set(names)
    numbered = (f"{wish}{i}" for i in range(1, len(used) + 2))
    return next(name for name in [*preferred, *numbered] if name not in used)


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
    return free([*form["links"], FRAME], [word], word)


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
        at = _on(changed, link, pin.z)
        if not pin.links:
            changed = with_item(changed, (*LOOSE, name), None)
            changed = with_item(changed, ("links", link, "markers", name), {"at": at})
        elif pin.kind:
            changed["joints"][name]["links"].append(link)
            changed["joints"][name]["at"].append(at)
        else:
            (first,) = pin.links
            before = changed["links"][first]["markers"][name]["at"]
            changed = _without_marker(changed, first, name)
            pair = [(first, before), (link, at)]
            pair = pair[::-1] if link == FRAME else pair  # so that the driver counts from the frame
            links, positions = map(list, zip(*pair, strict=True))
            changed["joints"][name] = {"type": "R", "links": links, "at": positions}
    return changed


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
        and abs(pin.z - z) <= SAME * size
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


def dimensioned(form: Form, a: str, b: str, value: float) -> Form:
    """With two pins at a distance [m]: the second moves, or the first where that one is fixed."""
    pins = pins_of(form)
    if FRAME in pins[b].links and FRAME not in pins[a].links:
        a, b = b, a
    off = pins[b].z - pins[a].z
    return moved(form, {b: pins[a].z + value * (off / abs(off) if off else 1.0)})


def pin_at(form: Form, end: Record) -> tuple[Form, str]:
    """The pin that an end of a gesture names, or a new one at its place ``at``, ``on`` a link."""
    if end.get("pin") in pins_of(form):
        return form, end["pin"]
    name = free(pins_of(form), ascii_uppercase, "P")
    changed = with_item(form, (*LOOSE, name), list(end["at"]))
    return (
        attached(changed, [name], end["on"]) if end.get("on") in form["links"] else changed
    ), name


def _put(form: Form, name: str, pin: Drawn, z: complex, links: Sequence[str]) -> Form:
    """With one pin elsewhere on links; places that the poses do not bring together stay apart.

    So only what is moved changes where poses are rounded, and so does no coordinate of a slider.
    """
    marker = ("markers", name, "at")
    positions: dict[Path, Any] = {("links", link, *marker): _on(form, link, z) for link in links}
    if pin.kind:
        at = list(form["joints"][name]["at"])
        for link in links:
            i = pin.links.index(link)
            (o, e), local = pose_of(form, link), Place.parse(at[i]).z
            apart = abs(o + e * local - pin.z) > SAME * (abs(complex(z)) + abs(pin.z))
            at[i] = xy(local + (z - pin.z) / e) if apart or pin.kind == "P" else _on(form, link, z)
        positions = {("joints", name, "at"): at}
    elif not pin.links:
        positions = {(*LOOSE, name): xy(z)}
    for path, at in positions.items():
        form = with_item(form, path, at)
    return form


def _loads_put(form: Form, put: Sequence[tuple[Drawn, Any]], fixed: Container[str]) -> Form:
    """With the ends of loads at some pins where these are put, but on links that go as a whole."""
    for name, load in form.get("loads", {}).items():
        on = load.get("links") or [load.get("link")]
        positions = load.get("at") if load.get("links") else [load.get("at")]
        if not positions or None in (*positions, *on):
            continue
        at = list(positions)
        for i, link in enumerate(on):
            o, e = pose_of(form, link)
            z_end = o + e * Place.parse(positions[i]).z
            for pin, z in put:
                coincident = abs(z_end - pin.z) <= SAME * (abs(o) + abs(z_end))
                if coincident and link in pin.links and link not in fixed:
                    at[i] = _on(form, link, z)
        if at != positions:
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
        joint = form["joints"].get(name)
        if pins_of(form)[name].driven:
            remedy = "take its driver away first"
            raise refused(name, "it is driven, and its law is one of the kind it has", remedy)
        if joint is None:
            form = _on_a_block(form, name, angle, on)
        else:
            joint_data = {"type": "R", "links": joint["links"], "at": joint["at"]}
            if joint["type"] == "R":
                joint_data |= {"type": "P", "angle": _angles(form, joint["links"], angle)}
            form = with_item(form, ("joints", name), joint_data)
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
    guide = free(pins, [f"{name}_guide"], f"{name}_guide")
    return _guided(form, guide, {on: pins[name].z, block: pins[name].z}, angle)


def _guided(form: Form, name: str, positions: Mapping[str, complex], angle: float) -> Form:
    """With a joint at which two links, each at its place, slide along a direction [rad]."""
    at = [_on(form, link, z) for link, z in positions.items()]
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
    guide = free(pins, ["cylinder"], "cylinder")
    positions, axis = {barrel: pins[a].z, rod: pins[b].z}, pins[b].z - pins[a].z
    return driven(_guided(form, guide, positions, cmath.phase(axis)), [guide])


def coupled(form: Form, names: Iterable[str], kind: str) -> Form:
    """With a gear, rack, cam or belt by which the first of two joints moves the second.

    Sizes are those of the drawing: wheels of equal size that meet, a pinion that reaches the
    rack, a cam whose roller stands at the follower's joint. A pin of one link is put on the
    frame. Raises `RequestError` for joints of other kinds, and for one that follows another
    already.
    """
    ends, couplings = list(both_pins(names)), form.get("couplings", {})
    for name in ends:
        form = form if name in form["joints"] else _grounded(form, name)
    pairs = REGISTRY[f"coupling.{kind}"].pairs
    kinds = "".join(form["joints"].get(name, {}).get("type", "-") for name in ends)
    if kinds not in pairs:
        needed = " or ".join(" and ".join(PAIRS[kind] for kind in pair) for pair in pairs)
        raise refused(listed(ends), f"a {kind} needs {needed}, in this order", "choose two such")
    for name in ends:
        if not pins_of(form)[name].driven:
            form = driven(form, [name])
    of = {driver_data["joint"]: driver for driver, driver_data in form["drivers"].items()}
    for driver in (of[end] for end in ends):
        if driver in {driver_data["driven"] for driver_data in couplings.values()}:
            raise refused(driver, "it follows another joint already", "choose another joint")
    form = with_item(form, ("drivers", of[ends[1]]), {"joint": ends[1]})  # it has no own law
    sizes = _sizes(form, ends, kinds, kind)
    coupling = {"type": kind, "driver": of[ends[0]], "driven": of[ends[1]], **sizes}
    return dict(with_item(form, ("couplings", free(couplings, [kind], kind)), coupling))


def _sizes(form: Form, ends: list[str], kinds: str, kind: str) -> Form:
    """Sizes of a coupling as it is drawn."""
    a, b = (pins_of(form)[name].z for name in ends)
    if kind == "gear":
        return {"teeth": [20, 20]}
    if kind == "belt":
        return {"radii": [abs(b - a) / 4] * 2}
    if kind == "rack":
        axis = cmath.rect(1.0, guide_of(form, ends[kinds.index("P")]))
        off = ((b - a) * axis.conjugate()).imag
        return {"radius": abs(off) or abs(b - a), "side": 1 if (off > 0) == (kinds == "PR") else -1}
    rise = abs(b - a) / CAM
    up = {"motion": "4-5-6-7", "over": math.pi, "rise": rise}
    law = {"kind": "segments", "segments": [up, {**up, "rise": -rise}]}
    return {"law": law, "follower": "roller", "roller": rise}


def guide_of(form: Record, name: str) -> float:
    """The direction [rad] of a guide in the drawing."""
    joint = form["joints"][name]
    directions = joint.get("angle") or [
        cmath.phase(complex(*d)) for d in joint.get("dir") or [(1, 0)]
    ]
    return float(directions[0]) + cmath.phase(pose_of(form, joint["links"][0])[1])


def turned(form: Form, names: Iterable[str], angle: float) -> Form:
    """With the last of three pins at an angle [rad] to the first about the second.

    Of two pins the angle of the second about the first is counted from the x axis.
    """
    names, pins = list(names), pins_of(form)
    *first, middle, last = (pins[name].z for name in names)
    base = cmath.phase(first[0] - middle) if first else 0.0
    return moved(form, {names[-1]: middle + cmath.rect(abs(last - middle), base + angle)})


def loaded(form: Form, names: Iterable[str], kind: str) -> Form:
    """With a force at each of some pins, or a spring between two; both at rest as drawn."""
    pins = pins_of(form)
    ends = both_pins(names) if kind == "spring" else list(names)
    for name in ends:
        if not pins[name].links:
            raise refused(name, "no link is there to hold it", "draw a link to the pin first")
    on = [next((x for x in reversed(pins[n].links) if x != FRAME), FRAME) for n in ends]
    at = [_on(form, link, pins[name].z) for link, name in zip(on, ends, strict=True)]
    if kind == "spring":
        free_length = abs(pins[ends[0]].z - pins[ends[1]].z)
        loads = [{"links": on, "at": at, "stiffness": 1000.0, "free_length": free_length}]
    else:
        loads = [{"force": [0.0, -10.0], "link": x, "at": z} for x, z in zip(on, at, strict=True)]
    for load in loads:
        name = free(form.get("loads", {}), [kind], kind)
        form = with_item(form, ("loads", name), {"type": kind, **load})
    return form


def weighed(form: Form, names: Iterable[str]) -> Form:
    """With the mass of bars along the outlines of links that have none, of links at pins."""
    pins = pins_of(form)
    for link, ends in outlines_of(pins).items():
        massless = form["links"][link]
        a, b = np.array([(pins[a].z, pins[b].z) for a, b in sides_of(ends)] or [(0j, 0j)]).T
        lengths, middles = np.abs(b - a), (a + b) / 2
        mass = BAR * float(lengths.sum())
        if not {*ends} & {*names} or massless.get("mass") or not mass:
            continue
        cm = complex(np.average(middles, weights=lengths))
        inertia = BAR * float(lengths @ (lengths**2 / 12 + np.abs(middles - cm) ** 2))
        body = {"mass": mass, "inertia": inertia, "cm": _on(form, link, cm)}
        form = with_item(form, ("links", link), {**massless, **body})
    return form


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
            if name not in form["joints"]:
                form = _grounded(form, name)
            turns = form["joints"][name]["type"] == "R"
            law = {"law": "constant_rate", "rate": 1.0} if turns else {}
            motor = free(drivers, ["motor"], "motor")
            form = with_item(form, ("drivers", motor), {"joint": name, **law})
    return form


def _grounded(form: Form, name: str) -> Form:
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
    """Without pins, without links of which they were the last ones, and what acts on these."""
    touched = {link for name in names for link in pins_of(form)[name].links}
    form = _without_pins(form, names)
    gone = touched - {link for pin in pins_of(form).values() for link in pin.links} - {FRAME}
    for load, load_data in form.get("loads", {}).items():
        if gone & {load_data.get("link"), *(load_data.get("links") or ())}:
            form = with_item(form, ("loads", load), None)
    links = {link: load_data for link, load_data in form["links"].items() if link not in gone}
    return {**form, "links": links, "joints": form.get("joints", {})}


def without_link(form: Form, link: str) -> Form:
    """Without a link and what acts on it; its pins stay, on what else carries them."""
    if link == FRAME or link not in form["links"]:
        raise refused(link, "no link is called so, or it is the frame", "choose another link")
    for name, pin in pins_of(form).items():
        if link not in pin.links:
            continue
        form = driven(form, [name]) if pin.driven else form
        joint, i = form["joints"].get(name), pin.links.index(link)
        if joint and len(pin.links) > 2:
            rest = {key: [x for k, x in enumerate(joint[key]) if k != i] for key in ("links", "at")}
            form = with_item(form, ("joints", name), {**joint, **rest})
        elif joint:
            form = with_item(form, ("joints", name), None)
            partner = pin.links[1 - i]
            if joint["type"] == "R":
                marker = {"at": joint["at"][1 - i]}
                form = with_item(form, ("links", partner, "markers", name), marker)
        else:
            form = with_item(form, (*LOOSE, name), xy(pin.z))
    for load, load_data in form.get("loads", {}).items():
        if link in (load_data.get("link"), *(load_data.get("links") or ())):
            form = with_item(form, ("loads", load), None)
    links = {name: x for name, x in form["links"].items() if name != link}
    return {**form, "links": links, "joints": form.get("joints", {})}


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


def _without_pins(form: Form, names: Iterable[str]) -> Form:
    for name in names:
        pin = pins_of(form)[name]
        form = driven(form, [name]) if pin.driven else form
        form = with_item(with_item(form, ("joints", name), None), (*LOOSE, name), None)
        for link in pin.links:
            form = _without_marker(form, link, name)
    return form


def _without_marker(form: Form, link: str, name: str) -> Form:
    """Without a marker of a link, and without the frame if nothing else is there."""
    changed = with_item(form, ("links", link, "markers", name), None)
    return {**changed, "links": {**changed["links"], link: changed["links"].get(link, {})}}


def _on(form: Record, link: str, z: complex) -> list[float]:
    """A place of the drawing in a link's frame."""
    o, e = pose_of(form, link)
    return xy((z - o) / e)
