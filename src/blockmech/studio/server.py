"""The server of the studio: on this machine only, and only for who knows the address."""

from __future__ import annotations

import secrets
import socket
from collections.abc import Callable
from typing import Any

import panel as pn
from tornado.web import RequestHandler

from blockmech.errors import refused
from blockmech.studio.gallery import picture_of
from blockmech.testing.files import gallery

HOST = "127.0.0.1"


def serve(window: Callable[[], Any], start: str, port: int, told: Callable[[str], None]) -> Any:
    """A server of windows that has begun; ``told`` hears the address when it answers.

    ``start`` names the sheet that the address shows; without one it shows the gallery. Port 0
    is one that is free. Run its ``io_loop`` to answer. Raises `RequestError` for a port that
    cannot be had.
    """
    token = secrets.token_urlsafe(16)
    try:
        with socket.create_server((HOST, port)) as free:
            port = free.getsockname()[1]
    except OSError as error:
        raise refused("port", f"{port}: {error}", "choose another, or leave it out") from None
    server = pn.serve(
        {"/": window},
        port=port,
        address=HOST,
        prefix=token,
        title="blockmech studio",
        websocket_origin=[f"{HOST}:{port}", f"localhost:{port}"],
        extra_patterns=[(r"/picture/(.*)\.svg", Picture)],
        show=False,
        start=False,
        verbose=False,
    )
    server._tornado.add_handlers(r".*", [(rf"(?!/{token}(/|$)).*", Refused)])
    server.start()
    told(f"http://{HOST}:{port}/{token}/" + (f"?sheet={start}" if start else ""))
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
