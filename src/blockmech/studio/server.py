"""The server of the studio: on this machine only, and only for who knows the address.

It keeps the sheets, one for each file, so that a window that is loaded again, or a second
one, shows the same sheet with everything that was done to it.
"""

from __future__ import annotations

import html
import secrets
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any
from urllib.parse import quote

import panel as pn
from tornado.netutil import bind_sockets
from tornado.web import RequestHandler

from blockmech.builders import Opened, opened, read_text
from blockmech.draw.paper import rendered
from blockmech.errors import BlockmechError
from blockmech.studio.app import Page
from blockmech.studio.files import Filed, files_of
from blockmech.studio.looks import CARDS, colours, dressed
from blockmech.testing.files import gallery

HOST = "127.0.0.1"


class Desk:
    """The sheets that a server keeps, by name; that of a file goes by the file's."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder.resolve()
        self.sheets: dict[str, Filed] = {}

    def put(self, document: Opened | None = None) -> str:
        """A new sheet; its name."""
        name = secrets.token_hex(4)
        self.sheets[name] = Filed(document, self.folder)
        return name

    def open(self, file: str) -> str:
        """The sheet of a file of the folder. Raises like `Filed.open`."""
        for name, sheet in self.sheets.items():
            if sheet.path is not None and sheet.path == (self.folder / file).resolve():
                return name
        sheet = Filed(None, self.folder)
        sheet.open(file)
        name = secrets.token_hex(4)
        self.sheets[name] = sheet
        return name


def serve(
    desk: Desk, start: str = "", port: int = 0, told: Callable[[str], None] = lambda address: None
) -> Any:
    """A server of a desk that has begun; ``told`` hears the address when it answers.

    ``start`` names the sheet that the address shows; without one it shows the gallery. Port 0
    is one that is free. Run its ``io_loop`` to answer.
    """
    token = secrets.token_urlsafe(16)
    found = [port]
    if not port:
        (held,) = bind_sockets(0, HOST)
        found = [held.getsockname()[1]]
        held.close()
    server = pn.serve(
        {"/": lambda: window(desk)},
        port=found[0],
        address=HOST,
        prefix=token,
        title="blockmech studio",
        websocket_origin=[f"{HOST}:{found[0]}", f"localhost:{found[0]}"],
        extra_patterns=[(r"/picture/(.*)\.svg", Picture)],
        show=False,
        start=False,
        verbose=False,
    )
    server._tornado.add_handlers(r".*", [(rf"(?!/{token}(/|$)).*", Refused)])
    server.start()
    told(f"http://{HOST}:{found[0]}/{token}/" + (f"?sheet={start}" if start else ""))
    return server


class Refused(RequestHandler):
    """Every address without the token."""

    def prepare(self) -> None:
        """Refuse."""
        self.set_status(403)
        self.finish("open the address that blockmech studio printed")


class Picture(RequestHandler):
    """Pictures of the gallery."""

    def get(self, name: str) -> None:
        """The picture of a mechanism of the gallery."""
        if name not in gallery():
            self.set_status(404)
            return
        self.set_header("Content-Type", "image/svg+xml")
        self.finish(picture_of(name))


@cache
def picture_of(name: str) -> bytes:
    """The mechanism of a gallery graph as SVG."""
    from blockmech.draw.mechanism import draw_mechanism

    mechanism = opened(gallery()[name]).compile()
    return rendered(draw_mechanism(mechanism).figure, ".svg")


def window(desk: Desk) -> Any:
    """What a window shows: the sheet that its address names, or the gallery."""
    args = {key: values[0].decode() for key, values in pn.state.session_args.items()}
    dark = args.get("theme") == "dark"
    said, name = "", args.get("sheet", "")
    try:
        if "open" in args:
            name = desk.open(args["open"])
        elif "example" in args and args["example"] in gallery():
            name = desk.put(opened(gallery()[args["example"]]))
        elif "new" in args:
            name = desk.put()
    except BlockmechError as error:
        said = str(error)
    if name not in desk.sheets:
        return _gallery(desk, said, dark)
    if pn.state.location is not None and args.get("sheet") != name:
        theme = "&theme=dark" if dark else ""
        pn.state.location.param.update(search=f"?sheet={name}{theme}", reload=False)
    sheet = desk.sheets[name]
    before = _watchers(sheet)
    page = Page(sheet)
    shown = page.panel(dark)
    mine = [watcher for watcher in _watchers(sheet) if watcher not in before]
    pn.state.on_session_destroyed(lambda _: [sheet.param.unwatch(w) for w in mine])
    return shown


def _watchers(sheet: Filed) -> list[Any]:
    kinds = sheet.param.watchers.values()
    return list(dict.fromkeys(w for kind in kinds for many in kind.values() for w in many))


def _gallery(desk: Desk, said: str, dark: bool) -> Any:
    """Mechanisms to start from, files of the folder, and an upload."""
    theme = "&amp;theme=dark" if dark else ""
    cards = "".join(
        f'<a class=card href="?example={quote(name)}{theme}">'
        f'<img loading=lazy alt="" src="picture/{quote(name)}.svg"><b>{html.escape(name)}</b></a>'
        for name in gallery()
        if "/" not in name
    )
    files = "".join(
        f'<li><a href="?open={quote(name)}{theme}">{html.escape(name)}</a></li>'
        for name in files_of(desk.folder)
    )
    upload = pn.widgets.FileInput(accept=".json", name="Upload a file")
    line = pn.pane.HTML(_alert(said))

    def take(event: Any) -> None:
        try:
            name = desk.put(read_text(event.new, upload.filename))
        except BlockmechError as error:
            line.object = _alert(str(error))
            return
        line.object = f'<p>read: <a href="?sheet={name}{theme}">open the sheet</a></p>'

    upload.param.watch(take, "value")
    head = f'<h1>blockmech studio</h1><p><a href="?new{theme}">Empty sheet</a></p>'
    pn.config.raw_css = [colours(dark)]
    here = f"<h2>In this folder</h2><ul class=files>{files}</ul>" if files else ""
    shown = f"{CARDS}<h2>Gallery</h2><div class=cards>{cards}</div>"
    parts = (head, line, upload, here, shown)
    made = [
        pn.pane.HTML(p, sizing_mode="stretch_width") if isinstance(p, str) else p for p in parts
    ]
    return dressed(pn.Column(*made, sizing_mode="stretch_width"))


def _alert(said: str) -> str:
    return f"<p role=alert>{html.escape(said)}</p>" if said else ""
