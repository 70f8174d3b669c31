"""The first page: mechanisms of the gallery to start from, files of the folder, an upload."""

from __future__ import annotations

import html
from collections.abc import Callable, Mapping
from functools import cache, partial
from typing import Any
from urllib.parse import quote

import panel as pn

from blockmech.builders import opened
from blockmech.figures.paper import rendered
from blockmech.studio.component import style
from blockmech.testing.graph_files import gallery


@cache
def picture_of(name: str) -> bytes:
    """The mechanism of a gallery graph as SVG."""
    from blockmech.draw.mechanism import draw_tile

    return rendered(draw_tile(opened(gallery()[name]).compile()), ".svg")


@cache
def words_of(name: str) -> str:
    """What a mechanism of the gallery is, in a line."""
    return opened(gallery()[name]).title


def gallery_parts(
    lists: Mapping[str, Mapping[str, str]], take: Callable[..., None], message: str, dark: bool
) -> list[Any]:
    """What stands on the page, with what went wrong as a message.

    ``lists`` are links with their words, by heading; an empty one is not shown. ``take`` gets
    name and content of a file that is uploaded.
    """
    theme = "&amp;theme=dark" if dark else ""
    cards = "".join(
        f'<a class=card href="?example={quote(name)}{theme}">'
        f'<img loading=lazy alt="" src="picture/{quote(name)}.svg"><b>{html.escape(name)}</b>'
        f"{html.escape(words_of(name))}</a>"
        for name in gallery()
        if "/" not in name
    )

    here = ""
    for heading, links in lists.items():
        words = ((to, html.escape(shown)) for to, shown in links.items())
        rows = "".join(f'<li><a href="{to}{theme}">{shown}</a></li>' for to, shown in words)
        here += f"<h2>{heading}</h2><ul class=files>{rows}</ul>" if rows else ""
    upload = pn.widgets.FileInput(accept=".json", name="Upload a file")
    upload.param.watch(lambda event: take(upload.filename, event.new), "value")
    head = f'<h1>blockmech studio</h1><p><a href="?draw{theme}">Draw links and joints</a> '
    head += f'or <a href="?new{theme}">wire blocks</a> on an empty sheet</p>'
    shown = f"<style>{style('cards.css')}</style>{here}"
    shown += f"<h2>Gallery</h2><div class=cards>{cards}</div>"
    alert = f"<p role=alert>{html.escape(message)}</p>" if message else ""
    marked = partial(pn.pane.HTML, sizing_mode="stretch_width")
    return [marked(head), marked(alert), upload, marked(shown)]
