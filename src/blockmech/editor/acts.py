"""What can be done to a sheet: each act makes a new form of the old one, as one step.

Acts come by name with what they are about, as plain data.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any

from blockmech.blocks.registry import REGISTRY
from blockmech.builders import Linkage
from blockmech.editor import applied, edits, sketching
from blockmech.editor.dragging import Hold, dragged, undraggable
from blockmech.editor.fields import Units
from blockmech.editor.forms import typed
from blockmech.editor.pins import pins_of
from blockmech.editor.redraw import as_links
from blockmech.editor.revision import Revision, Step
from blockmech.editor.sketching import Form
from blockmech.figures.palette import ROW
from blockmech.ground.errors import GraphError, listed, refused
from blockmech.ground.names import numbered_name
from blockmech.model.diagram import Wire
from blockmech.model.joints.contents import FRAME
from blockmech.typing import Arguments, Record

Request = Record
COUPLED = {"Gears": "gear", "Rack": "rack", "Cam": "cam", "Belt": "belt"}
AT_PINS: dict[str, Callable[..., Form]] = {
    "Link": sketching.linked,
    "To the frame": sketching.grounded,
    "Slider": sketching.sliding,
    "Weld": sketching.welded,
    "Driver": sketching.driven,
    "Cylinder": sketching.cylinder,
    **{word: partial(applied.coupled, kind=kind) for word, kind in COUPLED.items()},
    "Spring": partial(applied.loaded, kind="spring"),
    "Force": partial(applied.loaded, kind="force"),
    "Dimension": sketching.with_dimension,
    "Masses": applied.weighed,
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
    latest = request["edits"][-1][0]
    return Step(form, " ".join([*part[1:], *latest]))


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


def _take(now: Revision, request: Request) -> Step:
    """A whole document in place of this one, e.g. a design that was proposed."""
    return Step(dict(request["form"]), "candidate taken")


def _begin(now: Revision, request: Request) -> Step:
    return Step(Linkage(now.form["name"]).to_data(), "begun")


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
    problems = document.problems_of(wire)
    GraphError.raise_for(problems)
    return Step(edits.wired(form, *wire.ends), str(wire))


def _arrange(now: Revision, request: Request) -> Step:
    positions = request["places"]
    return Step(edits.placed(_blocks(now), positions), f"{', '.join(request['names'])} moved")


def _lay_out(now: Revision, request: Request) -> Step:
    return Step({**_blocks(now), "view": {}}, "laid out")  # places then follow from the wires


def _cut(now: Revision, request: Request) -> Step:
    names = _names(now, request)
    return Step(edits.without(_blocks(now), names, names), f"{', '.join(names)} deleted")


def _duplicate(now: Revision, request: Request) -> Step:
    form = _blocks(now)
    names = [name for name in _names(now, request) if name in form["blocks"]]
    changed = edits.duplicated(form, names, request["places"])
    return Step(changed, f"{', '.join(names)} duplicated")


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
    "begin": _begin,
    "take": _take,
    "add": _add,
    "wire": _wire,
    "arrange": _arrange,
    "lay out": _lay_out,
    "delete blocks": _cut,
    "duplicate": _duplicate,
    "rename": _rename,
}
