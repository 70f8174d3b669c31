"""Parts of the page that are our own: a text of JavaScript and one of CSS beside this file each."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import panel as pn
import param

HERE = Path(__file__).parent


def script(*names: str) -> str:
    """The text of a part, behind what all of them share."""
    return "\n".join((HERE / name).read_text("utf-8") for name in ("shared.js", *names))


def style(name: str) -> str:
    """The style of a part."""
    return (HERE / name).read_text("utf-8")


class Component(pn.custom.JSComponent):  # type: ignore[misc]  # panel's own types say nothing of it
    """A part that draws what its parameters hold; ``meant`` gets what a gesture means.

    ``done`` counts the messages that were followed: a browser that moves something quickly sends
    the next one when the last was.
    """

    done = param.Integer(default=0)

    def __init__(self, meant: Callable[[Any], None] = lambda _: None, **given: Any) -> None:
        super().__init__(**given)
        self._meant = meant

    def _handle_msg(self, msg: Any) -> None:
        try:
            self._meant(msg)
        finally:
            self.done += 1

    def tell(self, **msg: Any) -> None:
        """Send something that is to be done once."""
        self._send_msg(msg)
