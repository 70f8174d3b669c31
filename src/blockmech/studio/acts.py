"""What can be done to a sheet: each act makes a new form of the old one, as one step.

Acts come by name with what they are about, as plain data.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from blockmech.blocks.registry import REGISTRY
from blockmech.builders import Linkage
from blockmech.draw.motion import moves_of_result
from blockmech.draw.sketch import sketch_of
from blockmech.figures.palette import ROW
from blockmech.ground.errors import GraphError, listed, refused
from blockmech.model.diagram import Wire
from blockmech.model.joints.contents import FRAME
from blockmech.studio import edits, sketching
from blockmech.studio.document import Revision, Step
from blockmech.studio.dragging import dragged, handles_of
from blockmech.studio.fields import Shown, item_at
from blockmech.studio.forms import typed
from blockmech.studio.redraw import as_links
from blockmech.studio.sketching import Form
from blockmech.studio.turn import shown_motion

Asked = Mapping[str, Any]
COUPLED = {"Gears": "gear", "Rack": "rack", "Cam": "cam", "Belt": "belt"}
AT_PINS: dict[str, Callable[..., Form]] = {
    "Link": sketching.linked,
    "To the frame": sketching.attached,
    "Slider": sketching.sliding,
    "Driver": sketching.driven,
    "Cylinder": sketching.cylinder,
    **{word: partial(sketching.coupled, kind=kind) for word, kind in COUPLED.items()},
    "Spring": partial(sketching.loaded, kind="spring"),
    "Force": partial(sketching.loaded, kind="force"),
    "Masses": sketching.weighed,
    "Copy": sketching.copied,
    "Delete": sketching.removed,
}
HELD = ("Cylinder", "Spring")  # of which an end that no link holds stands on the frame


def acted(now: Revision, asked: Asked) -> Step:
    """The step that an act makes. Raises `BlockmechError` for what cannot be done."""
    act = str(asked.get("act", ""))
    if act in AT_PINS:
        return _at_pins(now.form, act, list(asked.get("pins", ())), asked)
    if act not in ACTS:
        raise refused("act", f"there is no act {act!r}", valid=listed((*AT_PINS, *ACTS)))
    return ACTS[act](now, asked)


def _at_pins(form: Form, act: str, names: list[str], asked: Asked) -> Step:
    """What is done to pins, or by a tool from one pin to another."""
    known = sketching.pins_of(form) if "links" in form else {}
    pins = [name for name in names if name in known]
    if act == "Masses" and not pins:
        pins = list(known)
    if not pins:
        raise refused(act, "no pin is chosen", "choose pins of a drawing first")
    how: dict[str, Any] = {}
    if act == "Slider":
        how = {"angle": asked.get("angle"), "on": asked.get("on") or FRAME}
    made = AT_PINS[act](form, pins, **how)
    if act == "Driver":
        for problem in Linkage.from_data(made).check():
            if problem.code == "conflicting-drivers":
                raise GraphError(problem)
    said = f"{act}: {', '.join(pins)}"
    if act == "Masses":
        bare = [link for link, x in made["links"].items() if link != FRAME and not x.get("mass")]
        said = "Masses" + (f"; without length: {listed(bare)}" if bare else " of all links")
    return Step(made, said)


def _pin(now: Revision, asked: Asked) -> Step:
    form, pin = sketching.pin_at(now.form, asked)
    return Step(form, f"pin {pin}")


def _draw(now: Revision, asked: Asked) -> Step:
    """A link, or what a tool draws, from one end to the other; new pins are made."""
    form, ends, tool = now.form, [], str(asked.get("tool") or "Link")
    for end in (asked["from"], asked["to"]):
        form, pin = sketching.pin_at(form, end)
        if tool in HELD and not sketching.pins_of(form)[pin].links:
            form = sketching.attached(form, [pin])
        ends.append(pin)
    return _at_pins(form, tool, ends, asked)


def _move(now: Revision, asked: Asked) -> Step:
    """Pins put elsewhere, links first stood in the poses in which they were taken hold of."""
    places = {name: complex(*at) for name, at in asked["pins"].items()}
    form = sketching.posed(now.form, asked.get("poses") or {})
    unknown = places.keys() - sketching.pins_of(form).keys()
    if unknown:
        raise refused(listed(unknown), "no pin is called so", "look at the drawing again")
    return Step(sketching.moved(form, places), f"move {', '.join(places)}")


def _drag(now: Revision, asked: Asked) -> Step:
    """A joint of blocks put elsewhere in a pose; lengths follow."""
    name, new = asked["name"], complex(*asked["to"])
    mechanism = now.mechanism
    if mechanism is None:
        raise refused(name, "the diagram is no mechanism yet", "mend it first")
    at = {d: [float(asked["q"][d])] for d in mechanism.drivers}
    how: dict[str, Any] = {"rates": dict.fromkeys(at, 0.0), "want": (), "friction": "none"}
    motion = moves_of_result(mechanism.run(at=at, on_gap="mark", **how))
    if not motion.feasible.any():
        raise refused(name, "the mechanism does not close in this pose", "choose another pose")
    spot = handles_of(motion, sketch_of(motion)).get(name)
    form = now.form
    if spot is not None:
        form = dragged(form, motion, 0, complex(motion.at(*spot)[0]), new)
    if form == now.form:
        found = "no length and no marker of a block puts it there, so it cannot be dragged"
        raise refused(name, found, "change its block's form", code="not-dragged")
    return Step(form, f"move {name}")


def _dimension(now: Revision, asked: Asked) -> Step:
    a, b = asked["ends"]
    return Step(sketching.dimensioned(now.form, a, b, float(asked["value"])), f"{a} to {b}")


def _angle(now: Revision, asked: Asked) -> Step:
    pins = list(asked["pins"])
    made = sketching.turned(now.form, pins, float(asked["value"]))
    return Step(made, f"angle {', '.join(pins)}")


def _without_link(now: Revision, asked: Asked) -> Step:
    form = now.form
    for link in asked["links"]:
        form = sketching.without_link(form, link)
    return Step(form, f"{listed(asked['links'])} deleted")


def _typed(now: Revision, asked: Asked) -> Step:
    """Fields of a part, in the order in which they were typed."""
    form, part = now.form, tuple(asked["part"])
    shown = Shown.of(asked.get("units", ""))
    for path, text in asked["edits"]:
        form = typed(now.document, form, part, tuple(path), text, shown)
    last = asked["edits"][-1][0]
    return Step(form, " ".join([*part[1:], *last]))


def _remove(now: Revision, asked: Asked) -> Step:
    """An item of a section: a load, a driver, a coupling ..."""
    section, name = asked["part"]
    return Step(sketching.without_item(now.form, section, name), f"{name} deleted")


def _redrawn(now: Revision, asked: Asked) -> Step:
    """Blocks as links and joints; the diagram then follows from these."""
    motion, message = shown_motion(now.form, now.mechanism, (), "", {})
    if motion is None:
        raise refused("blocks", message, "mend them first")
    return Step(as_links(now.form, motion), "drawn as links and joints")


def _taken(now: Revision, asked: Asked) -> Step:
    """A whole document in place of this one, e.g. a design that was proposed."""
    return Step(dict(asked["form"]), "candidate taken")


def _begun(now: Revision, asked: Asked) -> Step:
    return Step(Linkage(now.form["name"]).to_data(), "begun")


# -- of block diagrams ---------------------------------------------------------------------


def _blocks(now: Revision) -> Form:
    """The form of a diagram. Raises `RequestError` for links and joints."""
    if "blocks" not in now.form:
        raise refused("blocks", "the diagram follows from the drawing", "change the drawing")
    return now.form


def _names(now: Revision, asked: Asked) -> list[str]:
    if not asked.get("names"):
        raise refused("blocks", "none are chosen", "click blocks in the diagram first")
    return list(asked["names"])


def _add(now: Revision, asked: Asked) -> Step:
    """A block of a kind at a place [pt], or to the right of all."""
    kind, places = asked["kind"], asked.get("places", {})
    if kind not in REGISTRY:
        raise refused("kind", f"no block is called {kind!r}", "take one of the palette")
    form = edits.placed(_blocks(now), places)
    right = max((x for x, _ in places.values()), default=-10 * ROW)
    name = edits.free_name(form, kind.rsplit(".", 1)[-1])
    at = asked.get("at") or (right + 14 * ROW, ROW)
    return Step(edits.added(form, kind, name, tuple(at)), f"{name} added")


def _wire(now: Revision, asked: Asked) -> Step:
    wire = Wire(asked["from"], asked["to"])
    form = _blocks(now)
    document: Any = now.document
    problems = document.problems_of(wire)
    if problems:
        raise GraphError(problems)
    return Step(edits.wired(form, *wire.ends), str(wire))


def _arrange(now: Revision, asked: Asked) -> Step:
    places = asked["places"]
    return Step(edits.placed(_blocks(now), places), f"{', '.join(asked['names'])} moved")


def _lay_out(now: Revision, asked: Asked) -> Step:
    return Step({**_blocks(now), "view": {}}, "laid out")  # places then follow from the wires


def _cut(now: Revision, asked: Asked) -> Step:
    names = _names(now, asked)
    return Step(edits.without(_blocks(now), names, names), f"{', '.join(names)} deleted")


def _duplicate(now: Revision, asked: Asked) -> Step:
    form = _blocks(now)
    names = [name for name in _names(now, asked) if name in form["blocks"]]
    made = edits.duplicated(form, names, asked["places"])
    return Step(made, f"{', '.join(names)} duplicated")


def _rename(now: Revision, asked: Asked) -> Step:
    old, new = asked["name"], str(asked["to"]).strip()
    if item_at(_blocks(now), ("blocks", old)) is None:
        raise refused(old, "no block is called so", "choose it again")
    return Step(edits.renamed(now.form, old, new), f"{old} renamed to {new}")


ACTS: dict[str, Callable[[Revision, Asked], Step]] = {
    "pin": _pin,
    "draw": _draw,
    "move": _move,
    "drag": _drag,
    "dimension": _dimension,
    "angle": _angle,
    "delete links": _without_link,
    "fields": _typed,
    "remove": _remove,
    "redraw": _redrawn,
    "begin": _begun,
    "take": _taken,
    "add": _add,
    "wire": _wire,
    "arrange": _arrange,
    "lay out": _lay_out,
    "delete blocks": _cut,
    "duplicate": _duplicate,
    "rename": _rename,
}
