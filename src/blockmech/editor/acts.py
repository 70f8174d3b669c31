"""What can be done to a sheet: each act makes a new form of the old one, as one step.

Acts come by name with what they are about, as plain data. Couplings, loads and masses have at first
the sizes that are drawn.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np

from blockmech.blocks.block import REGISTRY
from blockmech.builders import Linkage
from blockmech.editor import edits, sketching
from blockmech.editor.dragging import Hold, dragged, undraggable
from blockmech.editor.fields import Units, with_item
from blockmech.editor.forms import typed
from blockmech.editor.pins import guide_of, outlines_of, pins_of, sides_of
from blockmech.editor.redraw import as_links
from blockmech.editor.revision import Revision, Step
from blockmech.editor.sketching import Form, both_pins, driven, on_link, with_joint
from blockmech.figures.palette import ROW
from blockmech.ground.errors import GraphError, listed, refused
from blockmech.ground.names import numbered_name
from blockmech.model.diagram import Wire
from blockmech.model.joints.contents import FRAME
from blockmech.typing import Arguments, Record

Request = Record
BAR = 1.0  # [kg/m] of a bar whose mass nobody has said
CAM = 10.0  # distance of a cam's follower from its shaft, over rise and roller of a new one
PAIRS = {"R": "a joint that turns", "P": "a joint that slides"}


def coupled(form: Form, names: Iterable[str], kind: str) -> Form:
    """With a gear, rack, cam or belt by which the first of two joints moves the second.

    Sizes are those of the drawing: wheels of equal size that meet, a pinion that reaches the
    rack, a cam whose roller stands at the follower's joint. A pin of one link is put on the
    frame. Raises `RequestError` for joints of other kinds, and for one that follows another
    already.
    """
    ends, couplings = list(both_pins(names)), form.get("couplings", {})
    for name in ends:
        form = with_joint(form, name)
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
    sizes = _coupling_sizes(form, ends, kinds, kind)
    coupling = {"type": kind, "driver": of[ends[0]], "driven": of[ends[1]], **sizes}
    return dict(with_item(form, ("couplings", numbered_name(kind, couplings)), coupling))


def _coupling_sizes(form: Form, ends: list[str], kinds: str, kind: str) -> Form:
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


def loaded(form: Form, names: Iterable[str], kind: str) -> Form:
    """With a force at each of some pins, or a spring between two; both at rest as drawn."""
    pins = pins_of(form)
    ends = both_pins(names) if kind == "spring" else list(names)
    for name in ends:
        if not pins[name].links:
            raise refused(name, "no link is there to hold it", "draw a link to the pin first")
    on = [next((x for x in reversed(pins[n].links) if x != FRAME), FRAME) for n in ends]
    at = [on_link(form, link, pins[name].z) for link, name in zip(on, ends, strict=True)]
    if kind == "spring":
        free_length = abs(pins[ends[0]].z - pins[ends[1]].z)
        loads = [{"links": on, "at": at, "stiffness": 1000.0, "free_length": free_length}]
    else:
        loads = [{"force": [0.0, -10.0], "link": x, "at": z} for x, z in zip(on, at, strict=True)]
    for load in loads:
        name = numbered_name(kind, form.get("loads", {}))
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
        body = {"mass": mass, "inertia": inertia, "cm": on_link(form, link, cm)}
        form = with_item(form, ("links", link), {**massless, **body})
    return form


COUPLED = {"Gears": "gear", "Rack": "rack", "Cam": "cam", "Belt": "belt"}
AT_PINS: dict[str, Callable[..., Form]] = {
    "Link": sketching.linked,
    "To the frame": sketching.grounded,
    "Slider": sketching.sliding,
    "Weld": sketching.welded,
    "Driver": sketching.driven,
    "Cylinder": sketching.cylinder,
    **{word: partial(coupled, kind=kind) for word, kind in COUPLED.items()},
    "Spring": partial(loaded, kind="spring"),
    "Force": partial(loaded, kind="force"),
    "Dimension": sketching.with_dimension,
    "Masses": weighed,
    "Copy": sketching.copied,
    "Delete": sketching.removed,
}
ON_FRAME = ("Cylinder", "Spring")  # of which an end that no link holds stands on the frame


def acted(now: Revision, request: Request) -> Step:
    """The step that an act makes. Raises `BlockmechError` for what cannot be done."""
    act = str(request.get("act", ""))
    if act in AT_PINS:
        step = _at_pins(now.form, act, list(request.get("pins", ())), request)
    elif act in ACTS:
        step = ACTS[act](now, request)
    else:
        raise refused("act", f"there is no act {act!r}", valid=listed((*AT_PINS, *ACTS)))
    return Step(_fitted(step.form), step.said)


def _fitted(form: Form) -> Form:
    """With the drawing as its dimensions say, where these do not contradict each other."""
    if form.get("dimensions"):
        with suppress(GraphError):
            return Linkage.from_data(form).fit_dimensions().linkage.to_data()
    return form


def _at_pins(form: Form, act: str, names: list[str], request: Request) -> Step:
    """What is done to pins, or by a tool from one pin to another."""
    drawing = pins_of(form) if "links" in form else {}
    pins = [name for name in names if name in drawing]
    if act == "Masses" and not pins:
        pins = list(drawing)
    if not pins:
        raise refused(act, "no pin is chosen", "choose pins of a drawing first")
    options: Arguments = {}
    if act == "Slider":
        options = {"angle": request.get("angle"), "on": request.get("on") or FRAME}
    changed = sketching.with_points(AT_PINS[act](form, pins, **options))
    if act == "Driver":
        for problem in Linkage.from_data(changed).check():
            if problem.code == "conflicting-drivers":
                raise GraphError(problem)
    label = f"{act}: {', '.join(pins)}"
    if act == "Masses":
        bare = [link for link, x in changed["links"].items() if link != FRAME and not x.get("mass")]
        label = "Masses" + (f"; without length: {listed(bare)}" if bare else " of all links")
    return Step(changed, label)


def _pin(now: Revision, request: Request) -> Step:
    form, pin = sketching.pin_at(now.form, request)
    return Step(form, f"pin {pin}")


def _draw(now: Revision, request: Request) -> Step:
    """A link, or what a tool draws, from one end to the other; new pins are made."""
    form, ends, tool = now.form, [], str(request.get("tool") or "Link")
    for end in (request["from"], request["to"]):
        form, pin = sketching.pin_at(form, end)
        if tool in ON_FRAME and not pins_of(form)[pin].links:
            form = sketching.attached(form, [pin])
        ends.append(pin)
    return _at_pins(form, tool, ends, request)


def _move(now: Revision, request: Request) -> Step:
    """Pins put elsewhere, links first stood in the poses in which they were taken hold of."""
    positions = {name: complex(*at) for name, at in request["pins"].items()}
    form = sketching.posed(now.form, request.get("poses") or {})
    unknown = positions.keys() - pins_of(form).keys()
    if unknown:
        raise refused(listed(unknown), "no pin is called so", "look at the drawing again")
    return Step(sketching.moved(form, positions), f"move {', '.join(positions)}")


def _drag(now: Revision, request: Request) -> Step:
    """A joint of blocks put elsewhere in a pose; lengths follow."""
    name, new = request["name"], complex(*request["to"])
    hold = Hold.of(now.mechanism, name, request["q"])
    form = dragged(now.form, hold.motion, 0, hold.z, new).form
    if form == now.form:
        raise undraggable(name)
    return Step(form, f"move {name}")


def _dimension(now: Revision, request: Request) -> Step:
    a, b = request["ends"]
    return Step(sketching.dimensioned(now.form, a, b, float(request["value"])), f"{a} to {b}")


def _angle(now: Revision, request: Request) -> Step:
    pins = list(request["pins"])
    changed = sketching.turned(now.form, pins, float(request["value"]))
    return Step(changed, f"angle {', '.join(pins)}")


def _typed(now: Revision, request: Request) -> Step:
    """Fields of a part, in the order in which they were typed."""
    form, part = now.form, tuple(request["part"])
    units = Units.of(request.get("units", ""))
    for path, text in request["edits"]:
        form = typed(now.document, form, part, tuple(path), text, units)
    return Step(form, " ".join([*part[1:], *request["edits"][-1][0]]))


def _remove(now: Revision, request: Request) -> Step:
    """An item of a section: a link, a load, a driver, a coupling ..."""
    section, name = request["part"]
    form = sketching.without_item(now.form, section, name)
    return Step(sketching.with_points(form), f"{name} deleted")


def _redrawn(now: Revision, request: Request) -> Step:
    """Blocks as links and joints; the diagram then follows from these."""
    motion, message = now.shown_motion()
    if motion is None or now.problems:
        raise refused("blocks", message, "mend them first")
    return Step(as_links(now.form, motion), "drawn as links and joints")


# -- of block diagrams ---------------------------------------------------------------------


def _blocks(now: Revision) -> Form:
    """The form of a diagram. Raises `RequestError` for links and joints."""
    if "blocks" not in now.form:
        raise refused("blocks", "the diagram follows from the drawing", "change the drawing")
    return now.form


def _names(now: Revision, request: Request) -> list[str]:
    if not request.get("names"):
        raise refused("blocks", "none are chosen", "click blocks in the diagram first")
    return list(request["names"])


def _add(now: Revision, request: Request) -> Step:
    """A block of a kind at a place [pt], or to the right of all."""
    kind, positions = request["kind"], request.get("places", {})
    if kind not in REGISTRY:
        raise refused("kind", f"no block is called {kind!r}", "take one of the palette")
    form = edits.placed(_blocks(now), positions)
    right = max((x for x, _ in positions.values()), default=-10 * ROW)
    name = numbered_name(kind.rsplit(".", 1)[-1], form["blocks"])
    at = request.get("at") or (right + 14 * ROW, ROW)
    return Step(edits.added(form, kind, name, tuple(at)), f"{name} added")


def _wire(now: Revision, request: Request) -> Step:
    wire = Wire(request["from"], request["to"])
    form = _blocks(now)
    document: Any = now.document
    GraphError.raise_for(document.problems_of(wire))
    return Step(edits.wired(form, *wire.ends), str(wire))


def _arrange(now: Revision, request: Request) -> Step:
    positions = request["places"]
    return Step(edits.placed(_blocks(now), positions), f"{', '.join(request['names'])} moved")


def _cut(now: Revision, request: Request) -> Step:
    names = _names(now, request)
    return Step(edits.without(_blocks(now), names, names), f"{', '.join(names)} deleted")


def _duplicate(now: Revision, request: Request) -> Step:
    form = _blocks(now)
    names = [name for name in _names(now, request) if name in form["blocks"]]
    return Step(edits.duplicated(form, names, request["places"]), f"{', '.join(names)} duplicated")


def _rename(now: Revision, request: Request) -> Step:
    old, new = request["name"], str(request["to"]).strip()
    document: Any = now.document
    if old not in _blocks(now)["blocks"]:
        raise refused(old, "no block is called so", "choose it again")
    return Step(edits.renamed(document, old, new), f"{old} renamed to {new}")


ACTS: dict[str, Callable[[Revision, Request], Step]] = {
    "pin": _pin,
    "draw": _draw,
    "move": _move,
    "drag": _drag,
    "dimension": _dimension,
    "angle": _angle,
    "fields": _typed,
    "remove": _remove,
    "redraw": _redrawn,
    "begin": lambda now, _: Step(Linkage(now.form["name"]).to_data(), "begun"),
    "take": lambda _, request: Step(dict(request["form"]), "candidate taken"),
    "add": _add,
    "wire": _wire,
    "arrange": _arrange,
    "lay out": lambda now, _: Step({**_blocks(now), "view": {}}, "laid out"),  # by the wires
    "delete blocks": _cut,
    "duplicate": _duplicate,
    "rename": _rename,
}
