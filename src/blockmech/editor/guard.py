"""Who may speak with the studio: this machine's browser that opened the printed address.

A page of somebody else's in the same browser is refused by the name of the host, by where it
comes from, and because it has no cookie; what every answer says lets no other page show, read or
feed this one, and lets this one run its own scripts alone.
"""

from __future__ import annotations

import asyncio
import secrets
from typing import Any

from starlette.datastructures import MutableHeaders
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response

from blockmech.ground.limits import LARGEST

HOST = "127.0.0.1"
NAMES = (HOST, "localhost")
LARGEST_BODY = 2 * LARGEST  # a file's text is as much longer at most where JSON quotes it
STRANGER = "open the address that blockmech studio printed"
KEYED = "the page comes with the cookie of this answer: open the address in a browser\n"
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; "
    "connect-src 'self'; font-src 'self'; base-uri 'none'; form-action 'none'; "
    "object-src 'none'; frame-ancestors {frames}"
)
HEADERS = {
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cross-Origin-Resource-Policy": "same-origin",
}


class Guard:
    """Stands before an application; ``token`` is the key that the printed address holds.

    ``framed`` lets pages of this machine show it, as a notebook does; a frame gets no cookie, so
    its addresses keep the token.
    """

    def __init__(self, app: Any, token: str, port: int, framed: bool = False) -> None:
        self.app, self.token, self.framed = app, token, framed
        self.hosts = {f"{name}:{port}" for name in NAMES}
        self.origins = {f"http://{host}" for host in self.hosts}
        self.cookie = f"blockmech_{port}"

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        """Let in, or refuse."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        if self.framed and scope["path"].startswith(f"/{self.token}/"):
            scope = {**scope, "path": scope["path"][len(self.token) + 1 :], "keyed": True}
        reply = self._refusal(Request(scope))
        size = 0

        async def counted() -> Any:
            nonlocal size
            message = await receive()
            size += len(message.get("body", b""))
            if size > LARGEST_BODY:
                raise TooLarge
            return message

        async def answered(message: Any) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                frames = "'self' http://localhost:* http://127.0.0.1:*" if self.framed else "'none'"
                headers.setdefault("Content-Security-Policy", POLICY.format(frames=frames))
                for name, value in HEADERS.items():
                    headers[name] = value
                if not self.framed:
                    headers["X-Frame-Options"] = "DENY"
            await send(message)

        try:
            await (reply or self.app)(scope, counted, answered)
        except asyncio.CancelledError:  # the server ends while somebody listens
            return
        except TooLarge:
            await PlainTextResponse("too large", 413)(scope, receive, answered)

    def _refusal(self, request: Request) -> Response | None:
        """The answer to who may not come in, or to who has just shown the token."""
        scope, headers = request.scope, request.headers
        if headers.get("host", "") not in self.hosts:
            return PlainTextResponse(STRANGER, 403)
        origin, site = headers.get("origin"), headers.get("sec-fetch-site", "none")
        if origin is not None and origin not in self.origins:
            return PlainTextResponse(STRANGER, 403)
        if "keyed" in scope:
            return None
        key = scope["path"].strip("/")
        if self._is_key(key):
            where = f"/?{request.query_params}".rstrip("?")
            reply = PlainTextResponse(KEYED, 303, {"Location": where})
            reply.set_cookie(self.cookie, self.token, httponly=True, samesite="strict")
            return reply
        if site not in ("none", "same-origin") and scope["method"] != "GET":
            return PlainTextResponse(STRANGER, 403)
        if not self._is_key(request.cookies.get(self.cookie, "")):
            return PlainTextResponse(STRANGER, 403)
        if int(headers.get("content-length") or 0) > LARGEST_BODY:
            return PlainTextResponse("too large", 413)
        return None

    def _is_key(self, word: str) -> bool:
        return secrets.compare_digest(word.encode(), self.token.encode())


class TooLarge(Exception):
    """A body that is larger than any document."""
