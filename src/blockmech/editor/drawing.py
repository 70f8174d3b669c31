"""What the page is told of a sheet: its drawing, motion, problems and numbers.

The drawing is of shapes on links, whose poses the page works out.

Of links and joints everything stands on the links of the document, also before they are a
mechanism; of blocks on the links of the part that moves. Places are metres in the frame of a
link, ``[link, x, y]``.
"""

from __future__ import annotations

import cmath
from collections.abc import Iterator
from typing import Any, cast

from blockmech.builders import Linkage, Opened
from blockmech.draw.motion import Motion
from blockmech.draw.sketch import line_kind, line_sign, side_by_side, sketch_of
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
from blockmech.editor.revision import Question, Revision
from blockmech.editor.sketching import Form
from blockmech.editor.turn import motion_data
from blockmech.figures import palette as ink
from blockmech.figures.paper import shown_name
from blockmech.ground.report import REMARKS
from blockmech.ground.tolerances import EQUAL
from blockmech.ground.values import Place, xy
from blockmech.model.joints.closing import coordinate
from blockmech.model.joints.contents import FRAME
from blockmech.model.joints.dimensions import KINDS
from blockmech.model.joints.layout import Layout
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
    loads = form.get("loads", {})
    spots = [[_spot(*end) for end in ends_of(load)] for load in loads.values()]
    offsets = side_by_side([[*map(tuple, ends)] for ends in spots])
    for (name, load), ends, offset in zip(loads.items(), spots, offsets, strict=True):
        force = load.get("force") if load["type"] == "force" else None
        if ends and (load["type"] != "force" or isinstance(force, list)):
            kind = line_kind(bool(load.get("stiffness")), bool(load.get("damping")))
            line = line_sign(kind, offset=offset).tolist()
            yield {"name": name, "ends": ends, "force": force, "line": line}


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
            {
                "name": load.name,
                "ends": [spot(*x) for x in load.spots],
                "line": load.line().tolist(),
            }
            for load in sketch.loads
        ],
        "wheels": [
            {"name": w.name, "link": str(w.link), "points": [xy(z) for z in w.points]}
            for w in sketch.wheels
        ],
    }


FIRST = {
    "joints": "Drag on the sheet to draw the first link.",
    "blocks": "Add a frame and a crank, then wire the crank to a marker of the frame.",
}


def picture_of(ask: Question) -> Data:
    """The drawing with its motion."""
    now, (motion, message) = ask.now, ask.outcome
    picture: Data = {"kind": "blocks", "drawing": None, "motion": None}
    picture["said"] = "" if now.empty else message
    if isinstance(now.document, Linkage):
        picture |= {"kind": "joints", "drawing": of_links(now.form)}
    elif motion is not None:
        picture["drawing"] = of_blocks(motion)
    if motion is not None:
        picture["motion"] = motion_data(motion, _home(now.document, motion))
    return picture


def _home(document: Opened, motion: Motion) -> dict[str, float]:
    """Where the drivers are in the pose of the drawing."""
    if isinstance(document, Linkage):
        layout = Layout.of(document)
        pairs = {d: layout.pairs[p] for p, d in layout.drivers.items()}
        return {d: float(coordinate(layout.given, pair)) for d, pair in pairs.items()}
    return {driver: float(q[motion.clearest]) for driver, q in motion.q.items()}


def state_of(ask: Question) -> Data:
    """All that the page shows of a revision but answers."""
    now, (motion, _) = ask.now, ask.outcome
    return {
        "revision": now.number,
        "name": now.form["name"],
        "problems": [problem.to_dict() for problem in now.problems],
        "status": status_of(now),
        "empty": now.empty,
        "names": [] if motion is None else ask.names or drives_of(motion),
        **picture_of(ask),
    }


def names_of(ask: Question) -> Data:
    """The outputs and the numbers that can be chosen."""
    mechanism, (motion, _) = cast(Any, ask.now.mechanism), ask.outcome
    numbers = {} if mechanism is None else mechanism.parameters()
    return {
        "outputs": [] if motion is None else list(motion.mechanism.outputs),
        "parameters": [name for name, x in numbers.items() if x.value],
    }


def status_of(now: Revision) -> str:
    """What the sheet is, or what comes next, in a line."""
    links = isinstance(now.document, Linkage)
    if now.empty:
        return FIRST["joints" if links else "blocks"]
    if now.problems:
        sentences = [". ".join(filter(None, (p.found, p.remedy))) for p in now.problems[:REMARKS]]
        return "Next: " + " ".join(f"{p.where}: {x}." for p, x in zip(now.problems, sentences))  # noqa: B905
    return now.formation.replace("->", "→")


def drives_of(motion: Motion) -> list[str]:
    """What moves the drivers: the outputs that are shown where none are chosen."""
    m = motion.mechanism
    return [name for name in (m._of_driver(d, "drive") for d in m.drivers) if name in m.outputs]
