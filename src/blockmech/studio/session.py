"""What a window does when its sheet changes, whichever window changed it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import panel as pn
from panel.io.state import set_curdoc
from tornado.ioloop import IOLoop


def heard(do: Callable[[], Any]) -> Callable[..., None]:
    """A watcher that acts in the window in which it was made, at that window's next turn.

    A server may change what a window shows only while it holds the window's lock, which it
    does at a turn of its own. All that changes there goes to the browser as one message: Panel
    and Bokeh send theirs at different times, and a model has to arrive before it is named.
    Outside of a server it acts at once.
    """
    document = pn.state.curdoc

    async def locked(document: Any) -> None:
        document.hold()  # that of Panel loses what changes before the browser says it is there
        try:
            with set_curdoc(document), document.models.freeze():
                do()
        finally:
            document.unhold()

    def act(*_: Any) -> None:
        if document is None or document.session_context is None:
            do()
        else:
            turn = document.session_context.with_locked_document
            IOLoop.current().add_callback(turn, locked)

    return act
