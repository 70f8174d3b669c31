"""What is drawn of a document: shapes on links, whose poses the page works out.

Of links and joints everything stands on the links of the document, also before they are a
mechanism; of blocks on the links of the part that moves. Places are metres in the frame of a
link, ``[link, x, y]``.
"""

from __future__ import annotations

import cmath
from collections.abc import Iterator
from typing import Any

from blockmech.draw.motion import Motion
from blockmech.draw.sketch import sketch_of
from blockmech.editor.dragging import handles_of
from blockmech.editor.pins import (
    Drawn,
    cylinders_of,
    ends_of,
    guide_of,
    outlines_of,
    pins_of,
    pose_of,
    sides_of,
)
from blockmech.editor.sketching import Form
from blockmech.figures import palette as ink
from blockmech.figures.paper import shown_name
from blockmech.ground.tolerances import EQUAL
from blockmech.ground.values import Place, xy
from blockmech.model.joints.contents import FRAME
from blockmech.model.joints.dimensions import KINDS
from blockmech.model.spots import Spot
from blockmech.typing import Data, Record

Drawing = Data


def of_links(form: Form) -> Drawing:
    """A form of links and joints where it is drawn."""
    pins = pins_of(form)
    outlines, inside = outlines_of(pins), cylinders_of(form)
    return {
        "fixed": FRAME,
        "poses": {link: _pose(form, link) for link in (FRAME, *outlines)},
        "pins": [_pin(form, name, pin, inside) for name, pin in pins.items()],
        "links": [
            {"name": link, "fill": fill_of(i), "ends": ends, "slim": link in inside}
            for i, (link, ends) in enumerate(outlines.items())
        ],
        "dimensions": list(
            dict.fromkeys(pair for ends in outlines.values() for pair in sides_of(ends))
        ),
        "stated": [
            {
                **stated,
                "name": name,
                "sign": KINDS[stated["type"]].sign,
                "points": [x.rpartition(".")[2] for x in stated["points"]],
            }
            for name, stated in form.get("dimensions", {}).items()
        ],
        "loads": list(_loads(form)),
        "wheels": [wheel for c in form.get("couplings", {}).items() for wheel in _wheels(form, *c)],
    }


def fill_of(i: int) -> str:
    """The colour of a link."""
    return ink.LINK_FILLS[i % len(ink.LINK_FILLS)]


def _pose(form: Form, link: str) -> list[float]:
    o, e = pose_of(form, link)
    return [o.real, o.imag, cmath.phase(e)]


def _pin(form: Form, name: str, pin: Drawn, inside: Record) -> Drawing:
    """A pin on the link that has its point; a slide also with its guide on the other one."""
    joint = form.get("joints", {}).get(name)
    guide, at = None, [FRAME, *xy(pin.z)]
    if joint:
        i = int(joint.get("slider", 1)) if joint["type"] == "P" else 0
        at = _spot(joint["links"][i], joint["at"][i])
        if joint["type"] == "P":
            partner = 1 - i
            o = pose_of(form, joint["links"][partner])[1]
            turn = guide_of(form, name) - cmath.phase(o)
            hidden = {*joint["links"]} <= inside.keys()
            on = _spot(joint["links"][partner], joint["at"][partner])
            guide = {"at": on, "angle": turn, "hidden": hidden}
    elif pin.links:
        link = pin.links[0]
        at = _spot(link, form["links"][link]["markers"][name]["at"])
    return {
        "name": name,
        "at": at,
        "links": list(pin.links),
        "ground": FRAME in pin.links,
        "guide": guide,
        "driven": pin.driven,
        "kind": pin.kind,
    }


def _spot(link: str, at: Any) -> list[Any]:
    return [link, *xy(Place.parse(at).z)]


def _loads(form: Form) -> Iterator[Drawing]:
    """Forces with their places, springs with their ends."""
    for name, load in form.get("loads", {}).items():
        force = load.get("force") if load["type"] == "force" else None
        ends = [_spot(*end) for end in ends_of(load)]
        if ends and (load["type"] != "force" or isinstance(force, list)):
            yield {"name": name, "ends": ends, "force": force}


def _wheels(form: Form, name: str, coupling: Form) -> Iterator[Drawing]:
    """The pitch circles of two wheels, of a pinion, or the base circle of a cam."""
    pins, of = pins_of(form), form.get("drivers", {})
    ends = [of.get(coupling.get(end), {}).get("joint") for end in ("driver", "driven")]
    if not all(end in pins for end in ends):
        return
    apart, radii = abs(pins[ends[1]].z - pins[ends[0]].z), [0.0, 0.0]
    if "teeth" in coupling:
        radii = [apart * abs(z) / sum(map(abs, coupling["teeth"])) for z in coupling["teeth"]]
    elif "radii" in coupling:
        radii = coupling["radii"]
    elif coupling["type"] == "rack":
        radii = [coupling["radius"] * (pins[end].kind == "R") for end in ends]
    elif coupling["type"] == "cam":
        radii = [apart - coupling.get("roller", 0.0), coupling.get("roller", 0.0)]
    for end, radius in zip(ends, radii, strict=True):
        if radius > 0:
            turns = next((x for x in pins[end].links if x != FRAME), FRAME)
            yield {"name": name, "pin": end, "radius": radius, "link": turns}


def of_blocks(motion: Motion) -> Drawing:
    """The part of a diagram that moves, link by link as the printed pictures have it."""
    s, sketch = motion.structure, sketch_of(motion)
    handles, k = handles_of(motion, sketch), motion.clearest
    driven = {str(ref) for ref in s.driven.values()}

    at_pins = {name: complex(motion.at(*handle)[k]) for name, handle in handles.items()}
    size = max(map(abs, at_pins.values()), default=1.0)

    def spot(link: Any, z: complex) -> list[Any]:
        return [str(link), *xy(complex(z))]

    def end(link: Any, z: complex) -> Any:
        """A corner of a link: the pin there, which may be dragged, or a place."""
        corner = complex(motion.at(link, z)[k])
        names = (name for name, at in at_pins.items() if abs(at - corner) <= EQUAL * size)
        return next(names, spot(link, z))

    def pin(
        name: str, at: Spot, ground: bool = False, guide: Any = None, names: tuple[str, ...] = ()
    ) -> Drawing:
        marks = {"driven": not driven.isdisjoint(names), "held": name in handles}
        label = {"name": name, "label": shown_name(name), "kind": "R", "links": []}
        return {**label, "at": spot(*at), "ground": ground, "guide": guide, **marks}

    pins = {x.names[0]: pin(x.names[0], x.spot, x.grounded, None, x.names) for x in sketch.pins}
    for x in sketch.sliders:
        guide = {"at": spot(*x.guide), "angle": cmath.phase(x.direction), "hidden": x.inside}
        guide["ends"] = [spot(x.guide.link, x.end(which)) for which in (0, 1)]
        pins[x.name] = pin(x.name, x.point, False, guide, (x.name,))
    pins |= {name: pin(name, at) for name, at in handles.items() if name not in pins}
    return {
        "fixed": str(s.frame_link),
        "poses": {
            str(link): [*xy(complex(o[k])), cmath.phase(complex(motion.axis[link][k]))]
            for link, o in motion.origin.items()
        },
        "pins": list(pins.values()),
        "links": [
            {
                "name": str(body.link),
                "fill": fill_of(i),
                "ends": [end(body.link, z) for z in body.outline],
                "slim": body.width < 1,
            }
            for i, body in enumerate(sketch.bodies)
        ],
        "loads": [
            {"name": load.name, "ends": [spot(*x) for x in load.spots]} for load in sketch.loads
        ],
        "wheels": [
            {"name": w.name, "link": str(w.link), "points": [xy(z) for z in w.points]}
            for w in sketch.wheels
        ],
    }
