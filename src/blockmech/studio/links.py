"""Links and joints drawn by hand: the first way to a mechanism, and the groups in it.

The drawing itself is `sketch.js`: it draws what the hand does, and sends what is meant.
"""

from __future__ import annotations

import html
import math
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import panel as pn
import param

from blockmech.builders import Linkage
from blockmech.figures import palette as ink
from blockmech.ground.errors import BlockmechError, GraphError, refused
from blockmech.ground.values import Place, xy
from blockmech.model.joints.contents import FRAME
from blockmech.studio import sketching
from blockmech.studio.component import Component, script, style
from blockmech.studio.fields import PAIR, Shown
from blockmech.studio.looks import button, row
from blockmech.studio.plots import coloured
from blockmech.studio.redraw import as_links
from blockmech.studio.session import follow, heard
from blockmech.studio.sheet import Sheet, Step
from blockmech.studio.sketching import Drawn, Form, outlines_of, sides_of
from blockmech.studio.turn import shown_motion

PAIRS = ["Link", "Cylinder", "Gears", "Rack", "Cam", "Belt", "Spring"]
"""What is drawn from one pin to another."""
COUPLED = {"Gears": "gear", "Rack": "rack", "Cam": "cam", "Belt": "belt"}
MENU = ["To the frame", "Slider", "Driver", "Force", "Copy", "Delete"]
"""What is offered at a pin."""
GUIDE = [
    "Drag: a link is drawn. Type a length while you drag (0.3, or 0.3 @ 45), Enter takes it.",
    "Drag from one of its pins: the next link is joined to it.",
    "Click a pin and press To the frame, or Slider: what carries the mechanism.",
    "Click a pin on the frame and press Driver: what moves it.",
    "Press Play beside the drawing. A number of the drawing is changed by a click on it.",
]
FIRST = "Drag in the drawing to draw the first link."
LINE = {"css_classes": ["line"]}  # name and field on one line


class Canvas(Component):
    """The drawing in the browser.

    ``chosen`` are pins, ``tool`` is what a gesture draws, "" for choosing. It is told a ``text``
    that is shown where the pointer is.
    """

    drawing = param.Dict(default={})
    chosen = param.List(default=[])
    tool = param.String(default="")
    menu = param.List(default=MENU)
    pairs = param.List(default=PAIRS)
    guide = param.List(default=GUIDE)

    _esm = script("trace.js", "sketch.js")
    _stylesheets = [style("sketch.css")]


def drawing_of(form: Form, pins: dict[str, Drawn], dark: bool, units: Shown) -> dict[str, Any]:
    """Pins, links, distances and loads as the browser draws them; places in metres."""
    outlines = outlines_of(pins)
    fills = [coloured(fill, dark) for fill in ink.LINK_FILLS]
    couplings = form.get("couplings", {}).values()
    return {
        "pins": [
            {
                "name": name,
                "at": xy(pin.z),
                "ground": FRAME in pin.links,
                "guide": sketching.guide_of(form, name) if pin.kind == "P" else None,
                "driven": pin.driven,
                "loose": not pin.links,
            }
            for name, pin in pins.items()
        ],
        "links": [
            {"name": link, "pins": ends, "fill": fills[i % len(fills)]}
            for i, (link, ends) in enumerate(outlines.items())
        ],
        "dimensions": [
            {"a": a, "b": b, "value": abs(pins[a].z - pins[b].z)}
            for a, b in dict.fromkeys(pair for ends in outlines.values() for pair in sides_of(ends))
        ],
        "loads": list(_loads(form)),
        "wheels": [wheel for coupling in couplings for wheel in _wheels(form, coupling)],
        "unit": units.factor("m"),  # how many of the unit shown make one of SI
        "degree": units.factor("rad"),
        "length": units.length,
        "angle": "°" if units.angle == "deg" else f" {units.angle}",
    }


def _loads(form: Form) -> Iterator[dict[str, Any]]:
    """Forces with their places, springs with their ends."""
    for name, load in form.get("loads", {}).items():
        links = load.get("links") or [load.get("link")]
        given = load.get("at")
        if given is None or None in links:
            continue
        places = []
        for link, at in zip(links, given if load.get("links") else [given], strict=False):
            o, e = sketching.pose_of(form, link)
            places.append(xy(o + e * Place.parse(at).z))
        force = load.get("force") if load["type"] == "force" else None
        if load["type"] != "force" or isinstance(force, list):
            yield {"name": name, "at": places, "force": force}


def _wheels(form: Form, given: Form) -> Iterator[dict[str, Any]]:
    """The pitch circles of two wheels, of a pinion, or the base circle of a cam."""
    pins, of = sketching.pins_of(form), form.get("drivers", {})
    ends = [of.get(given[end], {}).get("joint") for end in ("driver", "driven")]
    if not all(end in pins for end in ends):
        return
    apart, radii = abs(pins[ends[1]].z - pins[ends[0]].z), [0.0, 0.0]
    if "teeth" in given:
        radii = [apart * abs(z) / sum(map(abs, given["teeth"])) for z in given["teeth"]]
    elif "radii" in given:
        radii = given["radii"]
    elif given["type"] == "rack":
        radii = [given["radius"] * (pins[end].kind == "R") for end in ends]
    elif given["type"] == "cam":
        radii = [apart - given.get("roller", 0.0), given.get("roller", 0.0)]
    for end, radius in zip(ends, radii, strict=True):
        if radius > 0:
            yield {"at": xy(pins[end].z), "radius": radius}


class LinksSheet:
    """A sheet of links and joints: links are drawn from pin to pin, pins are made what they are."""

    def __init__(self, sheet: Sheet, dark: bool = False, view: Any = None) -> None:
        self.sheet, self.dark, self.view = sheet, dark, view
        self.canvas = Canvas(self.meant, sizing_mode="stretch_both")
        self.pins = pn.widgets.MultiSelect(label="Pins", size=2, width=140, **LINE)
        self.angle = pn.widgets.FloatInput(label="along [°]", value=None, width=110, **LINE)
        self.slot = pn.widgets.Select(label="Slides on", options=[FRAME], width=140, **LINE)
        self.place = pn.widgets.TextInput(label="New pin at x, y", width=190, **LINE)
        self.acts: dict[str, Callable[[Form, list[str]], Form]] = {
            "Link": sketching.linked,
            "To the frame": sketching.attached,
            "Slider": self._sliding,
            "Driver": self._driven,
            "Cylinder": sketching.cylinder,
            **{w: partial(sketching.coupled, kind=kind) for w, kind in COUPLED.items()},
            "Spring": partial(sketching.loaded, kind="spring"),
            "Force": partial(sketching.loaded, kind="force"),
            "Masses": sketching.weighed,
            "Copy": sketching.copied,
            "Delete": sketching.removed,
        }
        self.buttons = [button(name, partial(self.act, name)) for name in self.acts]
        redraw = partial(self._change, self._redrawn)
        self.redraw = button("Draw these blocks on as links and joints", redraw)
        empty = Step(Linkage(sheet.form["name"]).to_data(), "begun")
        begin = partial(self._change, lambda: empty)
        self.begin = button("Begin a drawing of links and joints", begin)
        # Panel sends the value twice at Enter, as a change and with the key
        self.place.param.watch(lambda _: self._typed(self.place.value), "enter_pressed")
        self.said = pn.pane.HTML("", sizing_mode="stretch_width", margin=(0, 4))
        self.pins.param.watch(lambda event: self.canvas.param.update(chosen=event.new), "value")
        self.canvas.param.watch(self._chosen_in_browser, "chosen")
        if view is not None:
            view.param.watch(heard(self.renew), "shown")
        follow(sheet, self.renew, "form", first=True)
        self.renew()

    def panel(self) -> Any:
        """The drawing, what is done with chosen pins, and the groups that were found."""
        fields = row(self.redraw, self.begin, self.pins, self.place, self.slot, self.angle)
        tools = row(*self.buttons)
        return pn.Column(tools, self.canvas, fields, self.said, sizing_mode="stretch_both")

    # -- what is shown ---------------------------------------------------------------------

    @property
    def ours(self) -> bool:
        """Whether the sheet holds links and joints."""
        return isinstance(self.sheet.document, Linkage)

    @property
    def units(self) -> Shown:
        """Units in which lengths and angles are shown and typed."""
        return Shown() if self.view is None else self.view.shown

    @property
    def drawn(self) -> dict[str, Drawn]:
        """All pins."""
        return sketching.pins_of(self.sheet.form) if self.ours else {}

    def renew(self) -> None:
        """Show the sheet's links and joints, the groups in them, or why there are none."""
        pins, form = self.drawn, self.sheet.form
        chosen = [name for name in self.pins.value if name in pins]
        self.pins.param.update(options=sorted(pins), value=chosen)  # whatever joins them
        links = [FRAME, *outlines_of(pins)]
        slot = self.slot.value if self.slot.value in links else FRAME
        self.slot.param.update(options=links, value=slot)
        self.begin.visible = not self.ours
        self.redraw.visible = not self.ours and self.sheet.mechanism is not None
        self.pins.visible = self.place.visible = self.slot.visible = self.angle.visible = self.ours
        self.place.label = f"New pin at x, y [{self.units.length}]"
        for widget in (self.place, self.angle, self.slot, *self.buttons):
            widget.disabled = not self.ours
        words = "This sheet holds blocks, not links and joints."
        if self.ours:
            problems = FIRST if self.sheet.empty else " ".join(map(str, self.sheet.problems))
            words = problems or str(self.sheet.document.decompose().formation)
        done = f"{self.sheet.undoable}. " if self.sheet.undoable else ""
        self._say(done + words)
        drawing = drawing_of(form if self.ours else {}, pins, self.dark, self.units)
        self.canvas.param.update(drawing={**drawing, "ours": self.ours}, chosen=chosen)

    def _say(self, text: str, role: str = "status") -> None:
        """Say something below the drawing, and what is wrong where the pointer is, too."""
        self.said.object = f'<p role="{role}">{html.escape(text)}</p>'
        self.canvas.tell(text=text if role == "alert" else "")

    # -- what is done ----------------------------------------------------------------------

    def _change(self, make: Callable[[], Step]) -> None:
        """Change the sheet; what cannot be is said, and drawn no more."""
        try:
            self.sheet.change(*make())
        except BlockmechError as error:
            self.canvas.param.trigger("drawing")
            self._say(str(error), "alert")

    def _redrawn(self) -> Step:
        """The blocks of the sheet as links and joints; the diagram then follows from these."""
        motion, message = shown_motion(self.sheet.form, self.sheet.mechanism, (), "", {})
        if motion is None:
            raise refused("blocks", message, "mend them first")
        return Step(as_links(self.sheet.form, motion), "drawn as links and joints")

    def _sliding(self, form: Form, pins: list[str]) -> Form:
        angle = self.angle.value
        angle = None if angle is None else math.radians(angle)
        return sketching.sliding(form, pins, angle, self.slot.value)

    def _driven(self, form: Form, pins: list[str]) -> Form:
        """Raises the problem of a driver for what another one moves already."""
        made = sketching.driven(form, pins)
        for problem in Linkage.from_data(made).check():
            if problem.code == "conflicting-drivers":
                raise GraphError(problem)
        return made

    def act(self, name: str, pins: list[str] | None = None) -> None:
        """Do with some pins, or the chosen ones, what the button of a name does.

        Where none are chosen the pointer does it from now on, until the button is pressed again.
        """
        pins = self.pins.value if pins is None else [pin for pin in pins if pin in self.drawn]
        if name == "Masses":
            pins = pins or list(self.drawn)
        if not pins:
            self.canvas.tool = "" if self.canvas.tool == name else name
            how = "drag from pin to pin" if name in PAIRS else "click on a pin"
            self._say(f"{name}: {how}, or choose pins first; Esc ends it", "status")
            return
        self._change(lambda: self._acted(self.sheet.form, name, pins))

    def _acted(self, form: Form, name: str, pins: list[str]) -> Step:
        return Step(self.acts[name](form, list(pins)), f"{name}: {', '.join(pins)}")

    def _typed(self, text: str) -> None:
        """A pin at places typed in: the way of the keyboard."""
        place = PAIR.fullmatch(text)
        if place and place[2] != "@":
            self.place.value = ""
            self.add(complex(float(place[1]), float(place[3])) / self.units.factor("m"))
        elif text:
            self._say("A place is two numbers, e.g. 0.5, 1.2", "alert")

    def add(self, z: complex) -> None:
        """Draw a pin that no link carries yet."""
        self.meant({"act": "pin", "at": xy(z)})

    # -- what the browser says -------------------------------------------------------------

    def meant(self, msg: dict[str, Any]) -> None:
        """Do what a gesture means: one step of the sheet."""
        act = msg["act"]
        if not self.ours:
            return
        if act in self.acts:
            self.act(act, msg["pins"])
        elif act in ("undo", "redo"):
            getattr(self.sheet, act)()
        elif act == "wrong":
            self._say(msg["said"], "alert")
        else:
            self._change(lambda: self._step(act, msg))

    def _step(self, act: str, msg: dict[str, Any]) -> Step:
        """What a gesture makes of the sheet."""
        form = self.sheet.form
        if act == "pin":
            form, pin = sketching.pin_at(form, msg)
            return Step(form, f"pin {pin}")
        if act == "draw":
            form, a = sketching.pin_at(form, msg["from"])
            form, b = sketching.pin_at(form, msg["to"])
            return self._acted(form, msg["tool"] or "Link", [a, b])
        if act == "dimension":
            a, b = msg["ends"]
            return Step(sketching.dimensioned(form, a, b, msg["value"]), f"{a} to {b}")
        pins = [name for name in msg["pins"] if name in self.drawn]
        if act == "angle":
            return Step(sketching.turned(form, pins, msg["value"]), f"angle {', '.join(pins)}")
        places = {name: complex(*msg["pins"][name]) for name in pins}
        return Step(sketching.moved(form, places), f"move {', '.join(pins)}")

    def _chosen_in_browser(self, event: Any) -> None:
        self.pins.value = [name for name in event.new if name in self.pins.options]
