"""The server of the studio: on this machine only, and only for who knows the address."""

from __future__ import annotations

import secrets
import socket
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import panel as pn
from tornado.httputil import HTTPHeaders, HTTPServerRequest
from tornado.ioloop import IOLoop
from tornado.routing import Matcher, PathMatches, Rule
from tornado.web import OutputTransform, RequestHandler

from blockmech.ground.errors import refused
from blockmech.studio.gallery import picture_of
from blockmech.testing.graph_files import gallery

HOST = "127.0.0.1"
DRAWING = ThreadPoolExecutor(1, "pictures")  # one after the other: each is drawn once
UPLOAD = 32 << 20  # bytes of a file that is sent
HEADERS = {
    # Bokeh makes functions of texts and Panel loads components as blobs
    "Content-Security-Policy": "default-src 'self'; object-src 'none'; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'; style-src 'self' 'unsafe-inline'; "
    "script-src 'self' 'unsafe-inline' 'unsafe-eval' blob:; img-src 'self' data: blob:; "
    "font-src 'self' data:; connect-src 'self' ws: blob: data:",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}


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
        title="blockmech studio",
        websocket_origin=[f"{HOST}:{port}", f"localhost:{port}"],
        extra_patterns=[(r"/picture/(.*)\.svg", Picture)],
        show=False,
        start=False,
        verbose=False,
        http_server_kwargs={"max_body_size": UPLOAD},
        websocket_max_message_size=UPLOAD,
    )
    used = ["bokeh", "bokeh-widgets", "bokeh-tables"]  # Panel asks for tables, nobody for WebGL
    scripts = server._tornado.resources().clone(components=used)
    server._tornado.resources = lambda absolute_url=None: scripts
    door = {"token": token, "cookie": f"blockmech_{port}"}
    guard = [Rule(Stranger(**door), Refused), Rule(PathMatches(f"/{token}/"), Door, door)]
    server._tornado.wildcard_router.rules[:0] = guard
    server._tornado.add_transform(Headers)
    server.start()
    told(f"http://{HOST}:{port}/{token}/" + (f"?sheet={start}" if start else ""))
    return server


class Stranger(Matcher):
    """Whoever has neither the token in the address nor the cookie that was given for it.

    The name of the host is looked at too: another that leads to this machine is a page of
    somebody else's in the user's browser.
    """

    def __init__(self, token: str, cookie: str) -> None:
        self.token, self.cookie = token, cookie

    def match(self, request: HTTPServerRequest) -> dict[str, Any] | None:
        """Nothing for who may come in."""
        held = request.cookies.get(self.cookie)
        keys = (request.path.strip("/"), held.value if held else "")
        known = any(secrets.compare_digest(key.encode(), self.token.encode()) for key in keys)
        return None if known and request.host_name in (HOST, "localhost") else {}


class Refused(RequestHandler):
    """Every address of a stranger."""

    def prepare(self) -> None:
        """Refuse."""
        self.set_status(403)
        self.finish("open the address that blockmech studio printed")


class Door(RequestHandler):
    """The printed address: it gives a cookie for the token, which then stands nowhere else."""

    def initialize(self, token: str, cookie: str) -> None:
        """Take what the door gives."""
        self.token, self.cookie = token, cookie

    def get(self) -> None:
        """Let in."""
        self.set_cookie(self.cookie, self.token, httponly=True, samesite="Strict")
        self.redirect(f"/?{self.request.query}")


class Headers(OutputTransform):
    """What every answer says to the browser: no other page may show, read or feed this one."""

    def transform_first_chunk(
        self, status_code: int, headers: HTTPHeaders, chunk: bytes, finishing: bool
    ) -> tuple[int, HTTPHeaders, bytes]:
        """Set the headers."""
        for name, value in HEADERS.items():
            headers[name] = value
        headers.pop("Access-Control-Allow-Origin", None)
        return status_code, headers, chunk


class Picture(RequestHandler):
    """Pictures of the gallery."""

    async def get(self, name: str) -> None:
        """The picture of a mechanism of the gallery, drawn beside what windows ask for."""
        if name not in gallery():
            self.set_status(404)
            return
        picture = await IOLoop.current().run_in_executor(DRAWING, picture_of, name)
        self.set_header("Content-Type", "image/svg+xml")
        self.finish(picture)
