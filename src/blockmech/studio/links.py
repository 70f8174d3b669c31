"""Links and joints as in a sketch: the second way to a mechanism, and the groups in it."""

from __future__ import annotations

import html
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import panel as pn
from bokeh.models import ColumnDataSource, PointDrawTool

from blockmech.builders import Linkage
from blockmech.draw import palette as ink
from blockmech.draw.sketch import hull
from blockmech.errors import BlockmechError
from blockmech.model.joints.contents import FRAME
from blockmech.studio import sketching
from blockmech.studio.looks import beside
from blockmech.studio.plots import FONT, PIXELS, coloured
from blockmech.studio.session import follow
from blockmech.studio.sheet import Sheet
from blockmech.studio.sketching import Drawn, Form
from blockmech.studio.window import Window

MARKS = {"R": "circle", "P": "square", "": "x"}


def columns_of(pins: dict[str, Drawn], dark: bool = False) -> dict[str, list[Any]]:
    """Pins as columns: circles turn, squares slide, crosses join nothing yet."""
    shown = [(pin, FRAME in pin.links) for pin in pins.values()]
    return {
        "x": [pin.z.real for pin in pins.values()],
        "y": [pin.z.imag for pin in pins.values()],
        "name": list(pins),
        "mark": [MARKS[pin.kind] for pin in pins.values()],
        "color": [coloured(ink.DRIVE if pin.driven else ink.INK, dark) for pin, _ in shown],
        "fill": [coloured(ink.FRAME_FILL if fixed else ink.PAPER, dark) for _, fixed in shown],
        "text": [f"{name} (driven)" if p.driven else name for name, p in pins.items()],
    }


def outlines_of(pins: dict[str, Drawn]) -> dict[str, list[complex]]:
    """Links as outlines through their pins."""
    links = dict.fromkeys(link for pin in pins.values() for link in pin.links if link != FRAME)
    return {link: list(hull(p.z for p in pins.values() if link in p.links)) for link in links}


class LinksSheet:
    """A sheet of links and joints: tap for a pin, choose pins, and join them by a link."""

    def __init__(self, sheet: Sheet, dark: bool = False) -> None:
        self.sheet, self.dark = sheet, dark
        self.pins = pn.widgets.MultiSelect(label="Pins", size=4, sizing_mode="stretch_width")
        self.angle = pn.widgets.FloatInput(label="Slides along [°]", value=0.0, width=110)
        self.slot = pn.widgets.Select(label="Slides on", options=[FRAME], width=110)
        self.place = pn.widgets.TextInput(label="New pin at x, y [m]", value="", width=150)
        self.acts: dict[str, Callable[[Form], Form]] = {
            "Link": lambda form: sketching.linked(form, self.pins.value),
            "To the frame": lambda form: sketching.attached(form, self.pins.value),
            "Slider": lambda form: sketching.sliding(
                form, self.pins.value, math.radians(self.angle.value or 0.0), self.slot.value
            ),
            "Driver": lambda form: sketching.driven(form, self.pins.value),
            "Delete": lambda form: sketching.removed(form, self.pins.value),
        }
        self.buttons = [pn.widgets.Button(label=name) for name in self.acts]
        for button in self.buttons:
            button.on_click(lambda event: self.act(event.obj.label))
        self.begin = pn.widgets.Button(label="Begin a drawing of links and joints")
        self.begin.on_click(lambda _: self._change(Linkage(sheet.form["name"]).to_data(), "begun"))
        # Panel sends the value twice at Enter, as a change and with the key
        self.place.param.watch(lambda _: self._typed(self.place.value), "enter_pressed")
        self.said = pn.pane.HTML("", sizing_mode="stretch_width")
        self._make_figure()
        follow(sheet, self.renew, "form")
        self.renew()

    def panel(self) -> Any:
        """The drawing, what is done with chosen pins, and the groups that were found."""
        tools = beside(self.begin, self.place, self.angle, self.slot, *self.buttons)
        drawing = pn.pane.Bokeh(self.window.figure, sizing_mode="stretch_both")
        return pn.Column(tools, self.pins, drawing, self.said, sizing_mode="stretch_both")

    def _make_figure(self) -> None:
        self.window = Window(self.dark, self._fit)
        figure = self.window.figure
        pen, line = coloured(ink.INK, self.dark), ink.SIZES.link * PIXELS
        self._links = ColumnDataSource({"xs": [], "ys": [], "fill": []})
        for color, width in ((pen, line + 2), ("fill", line)):
            figure.patches(
                source=self._links, fill_color="fill", line_color=color, line_width=width,
                line_join="round",
            )  # fmt: skip
        self._pins = ColumnDataSource(columns_of({}))
        dots = figure.scatter(
            source=self._pins, size=2 * line, marker="mark", line_color="color",
            fill_color="fill", line_width=2,
        )  # fmt: skip
        figure.text(
            source=self._pins, text_color=pen, text_font={"value": FONT}, text_font_size="12px",
            x_offset=12, y_offset=-8,
        )  # fmt: skip
        pencil = PointDrawTool(renderers=[dots], empty_value="", description="Draw pins")
        figure.add_tools(pencil)
        figure.toolbar.active_drag = figure.toolbar.active_tap = pencil
        self._pins.on_change("data", lambda attr, old, new: self.take(new))
        self._pins.selected.on_change("indices", self._chosen_in_browser)

    # -- what is shown ---------------------------------------------------------------------

    @property
    def ours(self) -> bool:
        """Whether the sheet holds links and joints."""
        return isinstance(self.sheet.document, Linkage)

    @property
    def drawn(self) -> dict[str, Drawn]:
        """All pins."""
        return sketching.pins_of(self.sheet.form) if self.ours else {}

    def renew(self) -> None:
        """Show the sheet's links and joints, the groups in them, or why there are none."""
        pins = self.drawn
        chosen = [name for name in self.pins.value if name in pins]
        self.pins.param.update(options=sorted(pins), value=chosen)  # whatever joins them
        links = [FRAME, *(link for link in outlines_of(pins) if self.ours)]
        self.slot.param.update(options=links, value=FRAME)
        self.begin.visible = not self.ours
        for widget in (self.place, self.angle, self.slot, *self.buttons):
            widget.disabled = not self.ours
        words = "This sheet holds blocks, not links and joints."
        if self.ours:
            problems = " ".join(map(str, self.sheet.problems))
            words = problems or str(self.sheet.document.decompose().formation)
        done = f"{self.sheet.undoable}. " if self.sheet.undoable else ""
        self._say(done + words)
        outlines = list(outlines_of(pins).values())
        fills = [ink.LINK_FILLS[i % len(ink.LINK_FILLS)] for i in range(len(outlines))]
        self._links.data = {
            "xs": [[z.real for z in row] for row in outlines],
            "ys": [[z.imag for z in row] for row in outlines],
            "fill": [coloured(fill, self.dark) for fill in fills],
        }
        self._pins.data = columns_of(pins, self.dark)
        if not all(self.window.shows(pin.z) for pin in pins.values()):
            self._fit()

    def _fit(self) -> None:
        """Show the whole drawing; a metre to draw on where there is none."""
        z = np.array([0, 1 + 1j, *(pin.z for pin in self.drawn.values())])
        self.window.fit(complex(z.real.min(), z.imag.min()), complex(z.real.max(), z.imag.max()))

    def _say(self, text: str, role: str = "status") -> None:
        self.said.object = f'<p role="{role}">{html.escape(text)}</p>'

    # -- what is done ----------------------------------------------------------------------

    def _change(self, form: Form, said: str) -> None:
        """Change the sheet; what cannot be is said."""
        try:
            self.sheet.change(form, said)
        except BlockmechError as error:
            self._say(str(error), "alert")
            self._pins.data = columns_of(self.drawn, self.dark)

    def act(self, name: str) -> None:
        """Do with the chosen pins what the button of a name does."""
        if not self.pins.value:
            self._say(f"{name}: choose pins first, in the drawing or in the list", "alert")
            return
        try:
            form = self.acts[name](self.sheet.form)
        except BlockmechError as error:
            self._say(str(error), "alert")
        else:
            self._change(form, f"{name}: {', '.join(self.pins.value)}")

    def add(self, z: complex) -> None:
        """Draw a pin that no link carries yet."""
        self._change(sketching.drawn(self.sheet.form, z), "pin")

    def _typed(self, text: str) -> None:
        """A pin at places typed in: the way of the keyboard."""
        try:
            x, y = map(float, text.replace(",", " ").split())
        except ValueError:
            if text:
                self._say("A place is two numbers, e.g. 0.5, 1.2", "alert")
            return
        if math.isfinite(x) and math.isfinite(y):
            self.add(complex(x, y))
            self.place.value = ""

    # -- what the browser says -------------------------------------------------------------

    def take(self, data: Any) -> None:
        """Pins were drawn, dragged or deleted with the tool: one step of the sheet."""
        form, pins = self.sheet.form, self.drawn
        places = [complex(x, y) for x, y in zip(data["x"], data["y"], strict=True)]
        known = {pin.z: name for name, pin in pins.items()}  # a tap may overtake our answer
        rows = zip(data["name"], places, strict=True)
        names = [name or known.get(self._rounded(z), "") for name, z in rows]
        if not self.ours:
            return
        form = sketching.removed(form, [name for name in pins if name not in names])
        for name, z in zip(names, places, strict=True):
            if name not in pins:
                form = sketching.drawn(form, self._rounded(z))
            elif z != pins[name].z:
                form = sketching.moved(form, name, z)
        self._change(form, "pins")

    def _rounded(self, z: complex) -> complex:
        """A place to a thousandth of the drawing."""
        size = max([abs(pin.z) for pin in self.drawn.values()] + [abs(z)]) or 1.0
        digits = 3 - math.ceil(math.log10(size))
        return complex(round(z.real, digits), round(z.imag, digits))

    def _chosen_in_browser(self, attr: str, old: Any, new: list[int]) -> None:
        names = list(self._pins.data["name"])
        self.pins.value = [names[i] for i in np.atleast_1d(new).astype(int) if i < len(names)]
