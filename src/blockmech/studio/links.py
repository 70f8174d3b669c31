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
from blockmech.draw import diagram_svg
from blockmech.draw import palette as ink
from blockmech.draw.sketch import hull
from blockmech.errors import BlockmechError
from blockmech.model.joints.contents import FRAME
from blockmech.studio import sketching
from blockmech.studio.plots import FONT, PIXELS, coloured
from blockmech.studio.session import follow
from blockmech.studio.sheet import Sheet
from blockmech.studio.sketching import Drawn, Form
from blockmech.studio.window import Window

MARKS = {"R": "circle", "P": "square", "": "x"}


def columns_of(pins: dict[str, Drawn]) -> dict[str, list[Any]]:
    """Pins as columns: circles turn, squares slide, crosses join nothing yet."""
    return {
        "x": [pin.z.real for pin in pins.values()],
        "y": [pin.z.imag for pin in pins.values()],
        "name": list(pins),
        "mark": [MARKS[pin.kind] for pin in pins.values()],
        "color": [ink.DRIVE if p.driven else ink.INK for p in pins.values()],
        "fill": [ink.FRAME_FILL if FRAME in p.links else ink.PAPER for p in pins.values()],
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
        self.loose: dict[str, complex] = {}
        self.pins = pn.widgets.MultiSelect(label="Pins", size=4, sizing_mode="stretch_width")
        self.angle = pn.widgets.FloatInput(label="Slides along [°]", value=0.0, width=110)
        self.place = pn.widgets.TextInput(label="New pin at x, y [m]", value="", width=150)
        acts = {
            "Link": self.link, "To the frame": self.fix, "Slider": self.slide,
            "Driver": self.drive, "Delete": self.remove,
        }  # fmt: skip
        self.buttons = {name: pn.widgets.Button(label=name) for name in acts}
        for name, act in acts.items():
            self.buttons[name].on_click(lambda _, act=act: self._do(act))
        self.begin = pn.widgets.Button(label="Begin a drawing of links and joints")
        self.begin.on_click(lambda _: self._do(self._begin))
        self.place.param.watch(lambda event: self._do(lambda: self._typed(event.new)), "value")
        self.said = pn.pane.HTML("", sizing_mode="stretch_width")
        self.diagram = pn.pane.SVG(None, encode=True, sizing_mode="stretch_width", max_height=300)
        self._make_figure()
        follow(sheet, self.renew, "form")
        self.renew()

    def panel(self) -> Any:
        """The drawing, what is done with chosen pins, and the groups that were found."""
        tools = pn.FlexBox(self.begin, self.place, self.angle, *self.buttons.values())
        drawing = pn.pane.Bokeh(self.figure, sizing_mode="stretch_both")
        return pn.Column(
            tools, self.pins, drawing, self.said, self.diagram, sizing_mode="stretch_both"
        )

    def _make_figure(self) -> None:
        self.window = Window(self.dark, self._fit)
        self.figure = self.window.figure
        pen, line = coloured(ink.INK, self.dark), ink.SIZES.link * PIXELS
        self._links = ColumnDataSource({"xs": [], "ys": [], "fill": []})
        for color, width in ((pen, line + 2), ("fill", line)):
            self.figure.patches(
                source=self._links, fill_color="fill", line_color=color, line_width=width,
                line_join="round",
            )  # fmt: skip
        self._pins = ColumnDataSource(columns_of({}))
        dots = self.figure.scatter(
            source=self._pins, size=2 * line, marker="mark", line_color="color",
            fill_color="fill", line_width=2,
        )  # fmt: skip
        self.figure.text(
            source=self._pins, text_color=pen, text_font={"value": FONT}, text_font_size="12px",
            x_offset=12, y_offset=-8,
        )  # fmt: skip
        pencil = PointDrawTool(renderers=[dots], empty_value="", description="Draw pins")
        self.figure.add_tools(pencil)
        self.figure.toolbar.active_drag = self.figure.toolbar.active_tap = pencil
        self._pins.on_change("data", self._drawn_in_browser)
        self._pins.selected.on_change("indices", self._chosen_in_browser)

    # -- what is shown ---------------------------------------------------------------------

    @property
    def drawn(self) -> dict[str, Drawn]:
        """All pins: those of the form, and those that no link carries yet."""
        pins = sketching.pins_of(self.sheet.form) if "joints" in self.sheet.form else {}
        return pins | {name: Drawn(z) for name, z in self.loose.items()}

    def renew(self) -> None:
        """Show the sheet's links and joints, the groups in them, or why there are none."""
        ours = "joints" in self.sheet.form
        known = sketching.pins_of(self.sheet.form) if ours else {}
        self.loose = {n: z for n, z in self.loose.items() if ours and n not in known}
        pins = self.drawn if ours else {}
        chosen = [name for name in self.pins.value if name in pins]
        self.pins.param.update(options=list(pins), value=chosen)
        self.begin.visible = not ours
        for widget in (self.place, self.angle, *self.buttons.values()):
            widget.disabled = not ours
        outlines = list(outlines_of(pins).values())
        fills = [ink.LINK_FILLS[i % len(ink.LINK_FILLS)] for i in range(len(outlines))]
        self._links.data = {
            "xs": [[z.real for z in row] for row in outlines],
            "ys": [[z.imag for z in row] for row in outlines],
            "fill": [coloured(fill, self.dark) for fill in fills],
        }
        columns = columns_of(pins)
        for name in ("color", "fill"):
            columns[name] = [coloured(c, self.dark) for c in columns[name]]
        self._pins.data = columns
        if not all(self.window.shows(pin.z) for pin in pins.values()):
            self._fit()
        self._tell(ours)

    def _fit(self) -> None:
        """Show the whole drawing; a metre to draw on where there is none."""
        z = np.array([0, 1 + 1j, *(pin.z for pin in self.drawn.values())])
        self.window.fit(complex(z.real.min(), z.imag.min()), complex(z.real.max(), z.imag.max()))

    def _tell(self, ours: bool) -> None:
        """The groups in formation order and the diagram, or the diagnosis."""
        said, svg = "This sheet holds blocks, not links and joints.", None
        if ours:
            said = " ".join(map(str, self.sheet.problems))
            if not said:
                said = str(self.sheet.document.decompose().formation)
                svg = "".join(diagram_svg(self.sheet.document).partition("<svg")[1:])
        self.said.object = f'<p role="status">{html.escape(said)}</p>'
        self.diagram.object = svg

    # -- what is done ----------------------------------------------------------------------

    def _do(self, act: Callable[[], None]) -> None:
        """Do something; what cannot be is said."""
        try:
            act()
        except BlockmechError as error:
            self.said.object = f'<p role="alert">{html.escape(str(error))}</p>'

    def _change(self, form: Form, said: str) -> None:
        self.sheet.change(form, said)

    def _begin(self) -> None:
        self._change(Linkage(self.sheet.form["name"]).to_data(), "links and joints")

    def _typed(self, text: str) -> None:
        """A pin at places typed in: the way of the keyboard."""
        parts = text.replace(",", " ").split()
        try:
            x, y = map(float, parts)
        except ValueError:
            if text:
                self.said.object = '<p role="alert">A place is two numbers, e.g. 0.5, 1.2</p>'
            return
        if math.isfinite(x) and math.isfinite(y):
            self.add(complex(x, y))
            self.place.value = ""

    def add(self, z: complex) -> str:
        """Draw a pin that no link carries yet; its name."""
        name = sketching.free(self.drawn)
        self.loose[name] = z
        self.renew()
        return name

    def link(self) -> None:
        """Join the chosen pins by a new link."""
        pins = {name: self.drawn[name].z for name in self.pins.value}
        if pins:
            name = sketching.free({*self.sheet.form["links"], FRAME}, "link")
            self._change(sketching.linked(self.sheet.form, pins, name), name)

    def fix(self) -> None:
        """Put the chosen pins on the frame."""
        form = self.sheet.form
        for name in self.pins.value:
            form = sketching.attached(form, name, self.drawn[name].z, FRAME)
        self._change(form, "frame")

    def slide(self) -> None:
        """Let the chosen joints slide, or turn again."""
        self._at_joints(lambda form, name: sketching.sliding(form, name, self._turn), "slider")

    def drive(self) -> None:
        """Drive the chosen joints, or no longer."""
        self._at_joints(sketching.driven, "driver")

    def remove(self) -> None:
        """Delete the chosen pins."""
        self._remove(self.pins.value)

    @property
    def _turn(self) -> float:
        return math.radians(self.angle.value or 0.0)

    def _at_joints(self, act: Callable[[Form, str], Form], said: str) -> None:
        form = self.sheet.form
        for name in self.pins.value:
            if name in form["joints"]:
                form = act(form, name)
        self._change(form, said)

    def _remove(self, names: list[str]) -> None:
        form = self.sheet.form
        for name in names:
            if self.loose.pop(name, None) is None:
                form = sketching.removed(form, name)
        self._change(form, f"delete {', '.join(names)}")
        self.renew()

    # -- what the browser says -------------------------------------------------------------

    def _drawn_in_browser(self, attr: str, old: Any, new: Any) -> None:
        """Pins were drawn, dragged or deleted with the tool."""
        if "joints" in self.sheet.form:
            self._do(lambda: self._take(new))

    def _take(self, data: Any) -> None:
        pins = self.drawn
        places = [complex(x, y) for x, y in zip(data["x"], data["y"], strict=True)]
        known = {pin.z: name for name, pin in pins.items()}  # a tap may overtake our answer
        rows = zip(data["name"], places, strict=True)
        names = [name or known.get(self._rounded(z), "") for name, z in rows]
        gone = [name for name in pins if name not in names]
        if gone:
            self._remove(gone)
        form = self.sheet.form
        for name, z in zip(names, places, strict=True):
            if name in pins and z != pins[name].z:
                if name in self.loose:
                    self.loose[name] = z
                else:
                    form = sketching.moved(form, name, z)
        self._change(form, "move pins")
        for z in (z for name, z in zip(names, places, strict=True) if name not in pins):
            self.add(self._rounded(z))

    def _rounded(self, z: complex) -> complex:
        """A place to a thousandth of the drawing."""
        size = max([abs(pin.z) for pin in self.drawn.values()] + [abs(z)]) or 1.0
        digits = 3 - math.ceil(math.log10(size))
        return complex(round(z.real, digits), round(z.imag, digits))

    def _chosen_in_browser(self, attr: str, old: Any, new: list[int]) -> None:
        names = list(self._pins.data["name"])
        self.pins.value = [names[i] for i in np.atleast_1d(new).astype(int) if i < len(names)]
