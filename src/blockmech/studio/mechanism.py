"""The moving mechanism: a figure that plays in the browser, and whose joints can be dragged.

The server computes a whole turn when the sheet changes; after that the slider and the play
button do not need it. Looks come from `blockmech.draw`, columns from `blockmech.studio.film`.
"""

from __future__ import annotations

import html
import math
from typing import Any

import numpy as np
import panel as pn
import param
from bokeh.events import RangesUpdate
from bokeh.layouts import column, row
from bokeh.models import (
    ColumnDataSource,
    CustomJS,
    Div,
    HoverTool,
    PointDrawTool,
    Slider,
    Toggle,
)

from blockmech.draw.curves import abscissa
from blockmech.draw.mechanism import caption
from blockmech.draw.motion import Motion
from blockmech.draw.palette import INK
from blockmech.errors import BlockmechError
from blockmech.result import Result
from blockmech.studio.curves import CURVE, Plot, labels_of, margins_of, places_of
from blockmech.studio.dragging import dragged, handles_of
from blockmech.studio.fields import Shown
from blockmech.studio.film import FONT, PIXELS, SHOWN, Layer, Scene, coloured, names_of, scene_of
from blockmech.studio.looks import WIDGET
from blockmech.studio.session import follow, heard, together
from blockmech.studio.sheet import Sheet
from blockmech.studio.turn import FRAME, blamed_blocks, closing, gaps_of, turn, what_moves
from blockmech.studio.window import Window

SHOW_FRAME = """
const k = Math.min(pose.value, captions.length - 1);
for (const {source, x, y, starts, frames, rows} of film) {
  if (frames < 2) continue;
  const n = x.length / frames;
  const [u, v] = [x, y].map((a) => new Float32Array(a.buffer, a.byteOffset + 4 * k * n, n));
  const cut = (a) => starts.slice(1).map((end, i) => a.subarray(starts[i], end));
  if (rows) { source.data.xs = cut(u); source.data.ys = cut(v); }
  else { source.data.x = Array.from(u); source.data.y = Array.from(v); }
  if (source.data.frame) source.data.frame = Array(n).fill(k);
  source.change.emit();
}
for (const {span, at} of cursors)
  span.setv({location: at[Math.min(k, at.length - 1)]}, {sync: false});
said.setv({text: captions[k]}, {sync: false});
"""
PLAY = """
const each = 1000 * seconds / order.length;
let start = null, shown = pose.value;
const step = (now) => {
  if (!play.active) {  // the server was told of no frame while they ran
    pose.setv({value: shown ? 0 : 1}, {sync: false, silent: true});
    pose.value = shown;
    return;
  }
  if (start === null) start = now - each * Math.max(0, order.indexOf(shown));
  shown = order[Math.floor((now - start) / each) % order.length];
  pose.setv({value: shown}, {sync: false});
  requestAnimationFrame(step);
};
play.label = play.active ? "❚❚ Pause" : "▶ Play";
if (play.active) requestAnimationFrame(step);
"""


class MechanismView(param.Parameterized):  # type: ignore[misc]  # as the sheet
    """A sheet's mechanism in motion.

    Attributes (watch them)
    ----------
    motion : the poses of all samples, of a turn or of a simulation; None where nothing moves
    frame : the shown one of the frames; the sample is `sample`
    show : what is drawn beside links and loads, some of `SHOWN`
    shown : units of lengths and angles
    gaps : first and last sample of each gap, and the sentence of its diagnosis
    said : what went wrong as a sentence, "" where nothing did
    """

    motion = param.Parameter()
    frame = param.Integer(default=0)
    show = param.ListSelector(default=["paths", "names"], objects=list(SHOWN))
    gaps = param.List(default=[])
    shown = param.Parameter(default=Shown())
    said = param.String(default="")

    def __init__(self, sheet: Sheet, dark: bool = False, seconds: float = 3.0) -> None:
        super().__init__()
        self.sheet, self.dark, self.seconds = sheet, dark, seconds
        self._scene: Scene | None = None
        self._handles: dict[str, Any] = {}
        self._unit = 0.0
        self._cursors: dict[str, list[dict[str, Any]]] = {}
        self._margins: Plot | None = None
        self._strip = pn.pane.Bokeh(sizing_mode="stretch_width")
        self._make_figure()
        self._make_controls()
        follow(sheet, self.renew, "form", "mechanism")
        self.param.watch(lambda *_: self._draw(), ["show"])
        self.param.watch(heard(self._show_units), ["shown"])
        self.renew()

    # -- what is shown ---------------------------------------------------------------------

    @property
    def sample(self) -> int:
        """The sample of `motion` that is shown."""
        return 0 if self.motion is None else min(FRAME * self.frame, len(self.motion.samples) - 1)

    def renew(self) -> None:
        """Show the turn of the sheet's mechanism, or of the part of it that moves."""
        sheet = self.sheet
        said = " ".join(map(str, sheet.problems))
        mechanism = sheet.mechanism
        if mechanism is None and "blocks" in sheet.form:
            mechanism = what_moves(sheet.form, blamed_blocks(sheet.form, sheet.problems))
        try:
            motion = None if mechanism is None else turn(mechanism)
            if motion is not None and not motion.feasible.any():
                closed = closing(motion)
                said = gaps_of(closed)[0][2]
                blamed = set(closed.quality.blame.values())
                part = what_moves(sheet.form, blamed) if "blocks" in sheet.form else None
                motion = None if part is None else turn(part)
        except BlockmechError as error:
            motion, said = None, str(error)
        self.play(motion, said)

    @property
    def degrees(self) -> bool:
        """Whether angles are shown in degrees."""
        return bool(self.shown.angle == "deg")

    def _show_units(self) -> None:
        """Write places and angles in the chosen units."""
        self.window.measured(self.shown)
        self.play(self.motion, self.said)

    @together
    def play(self, motion: Motion | None, said: str = "") -> None:
        """Show a motion, e.g. that of a simulation, until the sheet changes."""
        self._scene = None
        closed = None if motion is None else closing(motion)
        self.param.update(gaps=[] if closed is None else gaps_of(closed), said=said)
        self.motion = motion
        self._draw()
        self._show_margins(closed)

    def follow(self, owner: str, cursors: list[dict[str, Any]]) -> None:
        """Let cursors go with the pose: each a ``span``, and where it is ``at`` in every frame."""
        self._cursors[owner] = cursors
        k = self.frame
        for cursor in cursors:
            cursor["span"].location = cursor["at"][min(k, len(cursor["at"]) - 1)]
        every = [cursor for found in self._cursors.values() for cursor in found]
        self._shower.args = self._shower.args | {"cursors": every}

    def _show_margins(self, closed: Result | None) -> None:
        """How far every group is from its dead centres, along the poses."""
        cursors = []
        self._strip.visible = closed is not None and bool(closed.quality.margin)
        if closed is not None and self._strip.visible:
            panel, along = margins_of(closed), abscissa(closed, degrees=self.degrees)
            if self._margins is None or self._margins.curves != labels_of(panel):
                self._margins = Plot(panel, self.dark, height=CURVE // 2, toolbar_location=None)
                self._margins.figure.legend.visible = False
                self._margins.figure.add_tools(HoverTool(tooltips=[("", "$name")]))
                self._strip.object = self._margins.figure
            self._margins.show(panel, along, self.gaps)
            cursors = [{"span": self._margins.cursor, "at": places_of(along, FRAME)}]
        self.follow("margins", cursors)

    # -- the figure ------------------------------------------------------------------------

    def _make_figure(self) -> None:
        self.window = Window(self.dark, self._fit)
        self.figure = self.window.figure
        self._pins = ColumnDataSource({"x": [], "y": [], "name": [], "frame": []})
        style = {"size": 16, "fill_alpha": 0.0, "line_width": 1.5, "line_dash": "dotted"}
        ring = self.figure.scatter(
            source=self._pins, line_color=coloured(INK, self.dark), level="overlay", **style
        )
        drag = PointDrawTool(renderers=[ring], add=False, description="Drag joints")
        self.figure.add_tools(drag)
        self.figure.toolbar.active_drag = drag
        self._words = ColumnDataSource({"x": [], "y": [], "text": [], "color": []})
        self.figure.text(
            source=self._words, text_color="color", text_font={"value": FONT},
            text_font_size="12px", text_align="center", text_baseline="middle",
            level="annotation",
        )  # fmt: skip
        self._fixed = list(self.figure.renderers)
        self._layers: list[tuple[str, Any]] = []
        self._pins.on_change("data", self._dropped)
        zoomed = heard(self._zoomed)
        self.figure.on_event(RangesUpdate, lambda _: zoomed())

    def _make_controls(self) -> None:
        self._said = Div(text="", sizing_mode="stretch_width", styles={"min-height": "2.6em"})
        self.pose = Slider(
            start=0, end=1, value=0, step=1, title="Pose", show_value=False,
            sizing_mode="stretch_width", stylesheets=[WIDGET],
        )  # fmt: skip
        self._play = Toggle(label="▶ Play", width=90, align="end", stylesheets=[WIDGET])
        parts = {"pose": self.pose, "said": self._said, "film": [], "captions": [""], "cursors": []}
        self._shower = CustomJS(args=parts, code=SHOW_FRAME)
        parts = {"pose": self.pose, "play": self._play, "order": [0], "seconds": self.seconds}
        self._player = CustomJS(args=parts, code=PLAY)
        self.pose.js_on_change("value", self._shower)
        self._play.js_on_change("active", self._player)
        self.pose.on_change("value", self._posed)

    def panel(self) -> Any:
        """The figure with its slider, play button and choice of what is shown."""
        choice = pn.widgets.CheckButtonGroup.from_param(self.param.show, label="Show")
        plot = column(
            self.figure, row(self._play, self.pose, sizing_mode="stretch_width"), self._said,
            sizing_mode="stretch_both",
        )  # fmt: skip
        return pn.Column(
            choice,
            pn.pane.Bokeh(plot, sizing_mode="stretch_both", min_height=340),
            self._strip,
            sizing_mode="stretch_both",
        )

    # -- drawing ---------------------------------------------------------------------------

    @property
    def frames(self) -> Motion:
        """The poses that are shown, each so many sample."""
        motion: Motion = self.motion
        return motion.only(np.arange(0, len(motion.samples), FRAME))

    @together
    def _draw(self) -> None:
        """Compute what is drawn, and fit it into the window."""
        self._scene, self._handles = None, {}
        if self.motion is not None:
            try:
                self._scene = scene_of(self.frames, self.show)
            except BlockmechError as error:
                self.said = str(error)
            else:
                if self.motion.time is None or self.motion.result.motion is None:
                    self._handles = handles_of(self.sheet.form, self.frames, self._scene.sketch)
        self._fit()

    def _fit(self) -> None:
        """Fit the window around all that moves, at equal scales."""
        if self._scene is None:
            self._send([])
            return
        self.window.fit(*self._scene.bounds)
        self._show_at(self.window.scale * PIXELS)

    def _posed(self, attr: str, old: int, new: int) -> None:
        self.frame = int(new)

    def _zoomed(self) -> None:
        """Symbols keep their size on the screen."""
        unit = self.window.scale * PIXELS
        if self._scene is not None and not math.isclose(
            unit, self._unit, rel_tol=1 / self.window.size[0]
        ):
            self._show_at(unit)

    def _show_at(self, unit: float) -> None:
        assert self._scene is not None
        self._unit = unit
        self._send(self._scene.layers(unit, self.dark))

    def _send(self, layers: list[Layer]) -> None:
        """Give the browser all frames."""
        captions = self._captions()
        k = min(self.frame, len(captions) - 1)
        glyphs = [layer.glyph for layer in layers]
        if glyphs != [name for name, _ in self._layers]:
            self._layers = [(name, self._renderer(name)) for name in glyphs]
            self.figure.renderers = [*(r for _, r in self._layers), *self._fixed]
        sources = [r.data_source for _, r in self._layers]
        film = [_film(s, x.places, x.starts, x.glyph) for s, x in zip(sources, layers, strict=True)]
        for source, layer in zip(sources, layers, strict=True):
            source.data = layer.at(k)
        film += [self._send_names(k), self._send_handles(k)]
        self._shower.args = self._shower.args | {"film": film, "captions": captions}
        self._player.args = self._player.args | {"order": self._order(), "seconds": self.seconds}
        self.pose.update(end=max(len(captions) - 1, 1), value=k, disabled=len(captions) < 2)
        self._said.text = captions[k]

    def _renderer(self, glyph: str) -> Any:
        """A renderer of a kind of glyph whose looks are columns."""
        looks = {"line_width": "line_width", "line_color": "line_color"}
        if glyph == "multi_line":
            looks |= {"line_cap": "line_cap", "line_dash": "line_dash", "line_join": "round"}
        else:
            looks["fill_color"] = "fill_color"
        looks |= {"size": "size"} if glyph == "scatter" else {}
        places = {"x": "x", "y": "y"} if glyph == "scatter" else {"xs": "xs", "ys": "ys"}
        if glyph == "patches":
            looks["line_join"] = "round"
        empty: dict[str, list[Any]] = {
            column: [] for key, column in (places | looks).items() if key == column
        }
        draw = getattr(self.figure, glyph)
        return draw(source=ColumnDataSource(empty), **places, **looks)

    def _send_names(self, k: int) -> dict[str, Any]:
        """Put the names beside the joints at frame k; their places in all frames.

        They never get fewer: bokeh asks new data for the colours of as many as there were.
        """
        wanted = self._scene is not None and "names" in self.show
        names = names_of(self._scene, self._unit) if self._scene and wanted else []
        spare = max(len(self._words.data["x"]) - len(names), 0)
        places = _beside([name.places for name in names])
        places = np.pad(places, ((0, 0), (0, spare)), constant_values=np.nan)
        row = places[min(k, len(places) - 1)]
        colours = [coloured(name.colour, self.dark) for name in names] + ["transparent"] * spare
        texts = [name.text for name in names] + [""] * spare
        self._words.data = {"x": row.real, "y": row.imag, "text": texts, "color": colours}
        return _film(self._words, places)

    def _send_handles(self, k: int) -> dict[str, Any]:
        """Put rings around what can be dragged."""
        places = _beside([self.frames.at(*spot) for spot in self._handles.values()])
        row = places[min(k, len(places) - 1)]
        names, frames = list(self._handles), [k] * len(row)
        self._pins.data = {"x": row.real, "y": row.imag, "name": names, "frame": frames}
        return _film(self._pins, places)

    def _order(self) -> list[int]:
        """The frames as they are played: round, or to and fro where they do not return."""
        if self.motion is None:
            return [0]
        n = len(self.frames.samples)
        moving = self.motion.result.motion is not None
        if moving or n < 2 or not self.motion.feasible.all() or self.motion.returns:
            return list(range(n - (n > 1 and not moving)))
        return [*range(n), *range(n - 2, 0, -1)]

    def _captions(self) -> list[str]:
        """What stands under each frame: where the drivers are, or why there is a gap."""
        said = f"<b>{html.escape(self.said)}</b>" if self.said else ""
        if self.motion is None:
            return [said]
        frames, time = self.frames, self.frames.time
        told = [html.escape(caption(frames, [k], self.degrees)) for k in range(len(frames.samples))]
        if self.motion.result.motion is not None and time is not None:
            told = [f"t = {t:.3f} s; {words}" for t, words in zip(time, told, strict=True)]
        for first, last, why in [] if self.said else self.gaps:
            for k in range(-(-first // FRAME), min(last // FRAME + 1, len(told))):
                told[k] += f"<br><b>{html.escape(why)}</b>"
        return [f"{words}<br>{said}" if said else words for words in told]

    # -- dragging --------------------------------------------------------------------------

    def _dropped(self, attr: str, old: Any, new: Any) -> None:
        """A joint was dragged in the browser: what follows from it goes to the sheet."""
        if not self._handles or len(new["x"]) != len(self._handles):
            return
        k = min(int(new["frame"][0]), len(self.frames.samples) - 1)
        for i, (name, spot) in enumerate(self._handles.items()):
            old = complex(self.frames.at(*spot)[k])
            place = complex(new["x"][i], new["y"][i])
            if abs(place - old) > self._unit:  # a point of the page: a click moves nothing
                self.drag(name, k, place)
                return

    def drag(self, name: str, k: int, new: complex) -> None:
        """Put a joint that stands at a place in frame k to another one [m]; lengths follow."""
        old = complex(self.frames.at(*self._handles[name])[k])
        digits = -int(np.floor(np.log10(self._unit)))  # a point of the page is the finest step
        new = complex(round(new.real, digits), round(new.imag, digits))
        self.frame = k
        try:
            self.sheet.change(dragged(self.sheet.form, self.frames, k, old, new), f"move {name}")
        except BlockmechError as error:
            self.said = str(error)
            self._fit()


def _beside(columns: list[Any]) -> Any:
    """Places (frames, p) of p points."""
    return np.stack(columns, axis=1) if columns else np.zeros((1, 0), complex)


def _film(
    source: Any, places: Any, starts: tuple[int, ...] = (), glyph: str = ""
) -> dict[str, Any]:
    """What the browser needs to show any frame: places (frames, p) in single precision."""
    rows = glyph in ("multi_line", "patches")
    flat = {"x": places.real, "y": places.imag}
    columns = {name: np.ascontiguousarray(z, np.float32).ravel() for name, z in flat.items()}
    told = {"source": source, "starts": list(starts), "rows": rows, "frames": len(places)}
    return told | columns
