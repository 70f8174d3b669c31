"""Colours and style of the page: those of the pictures, light and dark."""

from __future__ import annotations

import html
from collections.abc import Callable
from typing import Any

import panel as pn
from panel.theme import Inherit, Native

from blockmech.figures import palette as ink
from blockmech.studio.component import style

LIGHT = f"""
--bm-paper: {ink.PAPER}; --bm-ink: {ink.INK}; --bm-grey: #595959; --bm-line: #8a8a8a;
--bm-blue: {ink.FORWARD}; --bm-alarm: {ink.ALARM}; --bm-pale: {ink.PALE};
--bm-frame: {ink.FRAME_FILL}; --bm-driver: {ink.DRIVER_FILL}; --bm-group: {ink.GROUP_FILL};
--bm-element: {ink.ELEMENT_FILL}; --bm-bar: #f2f4f6;
"""
DARK = style("dark.css")
TABLE = "pre { font: 11px/1.35 'DejaVu Sans Mono', monospace; white-space: pre; margin: 0 }"
LINES = "pre { font: 12px system-ui, sans-serif; white-space: pre-wrap; margin: 0 }"


class Look(Native):  # type: ignore[misc]  # panel's own types say nothing of it
    """The studio's style on all parts of a page that is made after `set_style`."""

    modifiers = {pn.viewable.Viewable: {"stylesheets": [Inherit, style("widget.css")]}}


class Plain(pn.pane.Str):  # type: ignore[misc]  # as the sheet
    """Text as it stands; Panel's own pane writes it into the page as markup, `<driver>` too."""

    def _transform_object(self, obj: Any) -> dict[str, Any]:
        return dict(super()._transform_object(html.escape(str(obj or ""))))


def set_style(dark: bool) -> None:
    """Let the parts that are made from here on have the studio's style."""
    pn.config.design, pn.config.theme = Look, "dark" if dark else "default"
    if pn.state.curdoc is not None:
        pn.config.raw_css = ["html, body { margin: 0; height: 100% }"]


def button(label: str, act: Callable[[], Any], **look: Any) -> Any:
    """A button, and what it does."""
    return pn.widgets.Button(label=label, on_click=lambda _: act(), **look)


def row(*parts: Any, **look: Any) -> Any:
    """Parts beside one another, in as many lines as they need, on one foot."""
    for part in parts:
        part.align, part.margin = "end", (2, 3)
    return pn.Row(*parts, styles={"flex-wrap": "wrap"}, **look)


def tabs(parts: dict[str, Callable[[], Any]], shown: str, *head: Any) -> Any:
    """One of some parts, which a row of buttons above them chooses; made when it is first shown.

    ``head`` stands beside the buttons, whatever is shown.

    Bokeh's tabs hide and show what they hold at every change of the page, which lays all of it
    out anew: with a hundred blocks on the canvas that took as long as everything else.
    """
    chosen = pn.widgets.RadioButtonGroup(options=list(parts), value=shown, margin=(4, 3))
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
    colours = f":host {{{DARK if dark else LIGHT}}}\n{style('page.css')}"
    return pn.Column(*parts, stylesheets=[colours], sizing_mode="stretch_both", margin=0)
