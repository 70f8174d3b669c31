"""A bar in a notebook for calls that last, where nobody else follows their progress."""

from __future__ import annotations

import functools
import html
import sys
import time
from collections.abc import Callable
from contextvars import ContextVar
from typing import Any, TypeVar, cast

F = TypeVar("F", bound=Callable[..., object])
PATIENCE, REFRESH = 1.0, 0.2  # [s] until a reader wants to see a bar, and between its states

FOLLOWED = ContextVar("followed", default=False)
"""Whether somebody follows the progress of a call around this one."""


def with_bar(function: F) -> F:
    """A function whose ``progress`` is a bar in a notebook, unless a caller gives another.

    Calls inside of it show none.
    """

    @functools.wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
        if FOLLOWED.get() or getattr(shell, "kernel", None) is None:
            return function(*args, **kwargs)
        token, bar = FOLLOWED.set(True), Bar()
        if kwargs.get("progress") is None:
            kwargs["progress"] = bar
        try:
            return function(*args, **kwargs)
        finally:
            FOLLOWED.reset(token)
            bar.close()

    return cast(F, call)


class Bar:
    """A bar of HTML in the output of a cell. It needs no package beside IPython."""

    def __init__(self) -> None:
        self._due = time.monotonic() + PATIENCE
        self._display: Any = None  # IPython's handle of what is shown

    def __call__(self, activity: str, position: float, total: float | None) -> None:
        if time.monotonic() < self._due:
            return
        self._due = time.monotonic() + REFRESH
        share = f' value="{position / total:.3f}"' if total else ""
        amount = f"{position:.3g} of {total:.3g}" if total else f"{position:.3g}"
        self._show(f"<progress{share}></progress> {html.escape(activity)}, {amount}")

    def close(self) -> None:
        """Clear the bar, if it was shown."""
        if self._display is not None:
            self._show("")

    def _show(self, text: str) -> None:
        from IPython.display import HTML, display

        if self._display is None:
            self._display = display(HTML(text), display_id=True)
        else:
            self._display.update(HTML(text))
