"""The server of the studio: on this machine only, and only for who knows the address."""

from __future__ import annotations

import secrets
from collections.abc import Callable
from typing import Any

import panel as pn
from tornado.netutil import bind_sockets
from tornado.web import RequestHandler

from blockmech.studio.gallery import picture_of
from blockmech.testing.files import gallery

HOST = "127.0.0.1"


def serve(window: Callable[[], Any], start: str, port: int, told: Callable[[str], None]) -> Any:
    """A server of windows that has begun; ``told`` hears the address when it answers.

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
        {"/": window},
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
