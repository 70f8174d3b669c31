"""What a window does when its sheet changes, whichever window changed it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import panel as pn
from panel.io.state import set_curdoc
from tornado.ioloop import IOLoop

Act = TypeVar("Act", bound=Callable[..., Any])


def together(act: Act) -> Act:
    """A function all of whose changes go to the browser as one message, in their order.

    Panel and Bokeh send theirs at different times, and a model has to arrive before it is named.
    """
    made: Act = pn.io.unlocked()(act)
    return made


def heard(do: Callable[[], Any]) -> Callable[..., None]:
    """A watcher that acts in the window in which it was made, whoever changed what it watches.

    A server may change what a window shows only while it holds the window's lock. So what was
    done in the same window is followed at once, `together` with it, and what was done in
    another one at this window's next turn. Outside of a server it acts at once.
    """
    document, whole = pn.state.curdoc, together(do)

    async def locked(document: Any) -> None:
        with set_curdoc(document):
            whole()

    def act(*_: Any) -> None:
        session = document and document.session_context
        if session is None or document is pn.state.curdoc:
            whole()
        else:
            IOLoop.current().add_callback(session.with_locked_document, locked)

    return act


def follow(sheet: Any, do: Callable[[], Any], *names: str, first: bool = False) -> None:
    """Do something in this window when some of a sheet's attributes change, until it closes.

    What the hand has drawn comes ``first``: it is sent, and seen, before anything is computed.
    """
    watcher = sheet.param.watch(heard(do), list(names), precedence=int(not first))
    if pn.state.curdoc is not None and pn.state.curdoc.session_context is not None:
        pn.state.on_session_destroyed(lambda _: sheet.param.unwatch(watcher))
