"""Colours and style of the page: those of the pictures, light and dark."""

from __future__ import annotations

import html
from collections.abc import Callable
from typing import Any

import panel as pn
from bokeh.models import CustomJS
from panel.theme import Inherit, Native

from blockmech.draw import palette as ink

LIGHT = f"""
--bm-paper: {ink.PAPER}; --bm-ink: {ink.INK}; --bm-grey: #595959; --bm-line: #8a8a8a;
--bm-blue: {ink.FORWARD}; --bm-alarm: {ink.ALARM}; --bm-pale: {ink.PALE};
--bm-frame: {ink.FRAME_FILL}; --bm-driver: {ink.DRIVER_FILL}; --bm-group: {ink.GROUP_FILL};
--bm-element: {ink.ELEMENT_FILL};
"""
DARK = """
color-scheme: dark;
--bm-paper: #16181b; --bm-ink: #ececec; --bm-grey: #b4b4b4; --bm-line: #7d848c;
--bm-blue: #6cb8ea; --bm-alarm: #ff8a8a; --bm-pale: #3a3f45;
--bm-frame: #2c3036; --bm-driver: #1d3a4f; --bm-group: #202327; --bm-element: #403523;
"""
PAGE = """
:host { min-height: 100vh; background: var(--bm-paper); color: var(--bm-ink);
  font: 13px/1.4 system-ui, "DejaVu Sans", sans-serif; --design-background-color: var(--bm-paper);
  --design-background-text-color: var(--bm-ink); --design-surface-color: var(--bm-group);
  --design-surface-text-color: var(--bm-ink); --design-primary-color: #005a8f;
  --design-primary-text-color: #fff }
"""
WIDGET = """
:host { color: var(--bm-ink); --bm-field: 26px; font: inherit }
h1 { font-size: 15px; margin: 0 } h2 { font-size: 14px; margin: 0 }
h3 { font-size: 12px; margin: 8px 4px 0; color: var(--bm-grey); font-weight: 600 }
p { margin: 0 } ul { margin: 0; padding-left: 16px; max-height: 52px; overflow: auto }
ul, p[role=alert] { color: var(--bm-alarm) } a { color: var(--bm-blue) }
label, .bk-input-group > label { color: var(--bm-grey); font-size: 12px; margin: 0 }
.bk-input { min-height: 26px; padding: 2px 6px; font-size: 13px; color: var(--bm-ink);
  background-color: var(--bm-paper); border: 1px solid var(--bm-line) }
.bk-input:not([size], [multiple]) { height: 26px }
select.bk-input:not([size], [multiple]) { appearance: auto; background-image: none }
.bk-input::placeholder { color: var(--bm-grey) }
.bk-btn { padding: 3px 10px; font-size: 13px; color: var(--bm-ink); background: var(--bm-group) }
:host(.solid) .bk-btn { border: 1px solid var(--bm-line) }
.bk-btn-primary { background: #005a8f; color: #fff }
.bk-btn.bk-active { color: var(--bm-paper) !important; background: var(--bm-blue) !important }
.bk-btn-danger { background: #a30015; color: #fff }
"""
"""Style of all parts of the page: words, fields and buttons."""

CARDS = """<style>
ul.files { color: inherit; max-height: none }
.cards { display: grid; gap: 12px; grid-template-columns: repeat(auto-fill, minmax(210px, 1fr)) }
.card { border: 1px solid var(--bm-pale); border-radius: 4px; padding: 8px; text-decoration: none;
  text-align: center }
.card img { width: 100%; height: 150px; object-fit: contain; background: #fff }
.card b { display: block; font-weight: 600; color: var(--bm-ink) }
</style>"""
LINES = "pre { font: 12px system-ui, sans-serif; white-space: pre-wrap; margin: 0 }"

NAMES = """
const name = (root) => {
  for (const [word, way] of [["more", "up"], ["less", "down"]])
    for (const spin of root.querySelectorAll(".bk-spin-btn-" + way))
      spin.setAttribute("aria-label", word);
};
const known = new WeakSet();
const all = (root) => {
  name(root);
  if (!known.has(root))
    new MutationObserver(() => all(root)).observe(root, {childList: true, subtree: true});
  known.add(root);
  for (const {shadowRoot: own} of root.querySelectorAll("*")) if (own && !known.has(own)) all(own);
};
all(document);
"""
"""What the libraries leave without a role or a name for a screen reader."""


class Look(Native):  # type: ignore[misc]  # panel's own types say nothing of it
    """The studio's style on all parts of a page that is made after `begin`."""

    modifiers = {pn.viewable.Viewable: {"stylesheets": [Inherit, WIDGET]}}


class Plain(pn.pane.Str):  # type: ignore[misc]  # as the sheet
    """Text as it stands; Panel's own pane writes it into the page as markup, `<driver>` too."""

    def _transform_object(self, obj: Any) -> dict[str, Any]:
        transformed: dict[str, Any] = super()._transform_object(html.escape(str(obj or "")))
        return transformed


def begin(dark: bool) -> None:
    """Let the parts that are made from here on have the studio's style."""
    pn.config.design, pn.config.theme = Look, "dark" if dark else "default"
    if pn.state.curdoc is not None:
        pn.config.raw_css = ["html, body { margin: 0; height: 100% }"]
        pn.state.curdoc.js_on_event("document_ready", CustomJS(code=NAMES))


def beside(*parts: Any, **look: Any) -> Any:
    """Parts beside one another, in as many lines as they need, on one foot."""
    for part in parts:
        part.align, part.margin = "end", (3, 5)
    return pn.Row(*parts, styles={"flex-wrap": "wrap"}, **look)


def either(parts: dict[str, Callable[[], Any]], shown: str, *head: Any) -> Any:
    """One of some parts, which a row of buttons above them chooses; made when it is first shown.

    ``head`` stands beside the buttons, whatever is shown.

    Bokeh's tabs hide and show what they hold at every change of the page, which lays all of it
    out anew: with a hundred blocks on the canvas that took as long as everything else.
    """
    chosen = pn.widgets.RadioButtonGroup(options=list(parts), value=shown)
    wraps = {"sizing_mode": "stretch_width", "styles": {"flex-wrap": "wrap"}}
    first = pn.Row(chosen, *head, **wraps) if head else chosen
    place, made = pn.Column(first, sizing_mode="stretch_both"), dict[str, Any]()

    def show() -> None:
        if (shown := chosen.value) not in made:
            made[shown] = parts[shown]()
            place.append(made[shown])
        for name, part in made.items():
            part.visible = name == shown

    chosen.param.watch(lambda _: show(), "value")
    show()
    return place


def page(parts: list[Any], dark: bool) -> Any:
    """A page of some parts, one below the other, which inherit its colours."""
    colours = f":host {{{DARK if dark else LIGHT}}}\n{PAGE}"
    return pn.Column(*parts, stylesheets=[colours], sizing_mode="stretch_both", margin=0)
