"""The first page: mechanisms of the gallery to start from, files of the folder, an upload."""

from __future__ import annotations

import html
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any
from urllib.parse import quote

import panel as pn

from blockmech.builders import Opened, opened, read_text
from blockmech.draw.paper import rendered
from blockmech.errors import BlockmechError
from blockmech.graph_files import gallery
from blockmech.studio.component import style


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
    names: Sequence[str], put: Callable[[Opened], str], message: str, dark: bool
) -> list[Any]:
    """What stands on the page, with what went wrong as a message.

    ``names`` are files of the folder, ``put`` makes a sheet and gives its name.
    """
    theme = "&amp;theme=dark" if dark else ""
    cards = "".join(
        f'<a class=card href="?example={quote(name)}{theme}">'
        f'<img loading=lazy alt="" src="picture/{quote(name)}.svg"><b>{html.escape(name)}</b>'
        f"{html.escape(words_of(name))}</a>"
        for name in gallery()
        if "/" not in name
    )
    files = "".join(
        f'<li><a href="?open={quote(name)}{theme}">{html.escape(name)}</a></li>' for name in names
    )
    upload = pn.widgets.FileInput(accept=".json", name="Upload a file")
    line = pn.pane.HTML(_alert(message))

    def take(event: Any) -> None:
        try:
            name = put(read_text(event.new, upload.filename))
        except BlockmechError as error:
            line.object = _alert(str(error))
            return
        line.object = f'<p>read: <a href="?sheet={name}{theme}">open the sheet</a></p>'

    upload.param.watch(take, "value")
    head = f'<h1>blockmech studio</h1><p><a href="?draw{theme}">Draw links and joints</a> '
    head += f'or <a href="?new{theme}">wire blocks</a> on an empty sheet</p>'
    here = f"<h2>In this folder</h2><ul class=files>{files}</ul>" if files else ""
    shown = f"<style>{style('cards.css')}</style><h2>Gallery</h2><div class=cards>{cards}</div>"
    parts = (head, line, upload, here, shown)
    wide = "stretch_width"
    return [pn.pane.HTML(p, sizing_mode=wide) if isinstance(p, str) else p for p in parts]


def _alert(message: str) -> str:
    return f"<p role=alert>{html.escape(message)}</p>" if message else ""
