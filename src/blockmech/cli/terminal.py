"""Talking to the terminal: text that survives pipes and old consoles, and patience."""

from __future__ import annotations

import errno
import os
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

import typer

from blockmech.files import cannot_write

PATIENCE = 1.0  # [s] after which a reader wants to see that something happens


def say(*pieces: str, end: str = "\n") -> None:
    """Write text to standard output; see `pour`."""
    pour([*pieces, end])


def pour(pieces: Iterable[str]) -> None:
    """Write pieces of text to standard output.

    Ends the program quietly when the reader has left (``blockmech ... | head``).
    Raises `RequestError` where standard output cannot be written, e.g. on a full disk.
    """
    try:
        for piece in pieces:
            sys.stdout.write(piece)
        sys.stdout.flush()
    except OSError as error:
        _drop_output()
        if error.errno in (errno.EPIPE, errno.EINVAL):  # EINVAL is how Windows says it
            raise typer.Exit from None
        raise cannot_write("standard output", (error.strerror or "").lower(), "") from error


def note(*lines: str) -> None:
    """Write lines to standard error."""
    for line in lines:
        print(line, file=sys.stderr)


@contextmanager
def patience(what: str) -> Iterator[None]:
    """Show on a terminal that a block which lasts over a second is at work."""
    with progress_bar(what):
        yield


@contextmanager
def progress_bar(what: str, quiet: bool = False) -> Iterator[Callable[..., None] | None]:
    """A bar on a terminal for work that lasts over a second, and what tells it how far that is.

    ``told(what, done, whole)`` moves the bar; ``whole`` is None where it is not known. None
    where nobody would see it: in a pipe, or where ``quiet`` is asked for.
    """
    if quiet or not sys.stderr.isatty():
        yield None
        return
    bar = _Bar(what)
    timer = threading.Timer(PATIENCE, bar.show)
    timer.daemon = True
    timer.start()
    try:
        yield bar.tell
    finally:
        timer.cancel()
        bar.hide()


class _Bar:
    """A moving bar with the time elapsed, shown from another thread."""

    def __init__(self, what: str) -> None:
        self.what = what
        self._lock = threading.Lock()
        self._over = False
        self._progress: Any = None
        self._task: Any = None

    def tell(self, what: str, done: float, whole: float | None) -> None:
        """How far the work is; the bar draws itself, some times a second."""
        if self._progress is not None and not self._over:
            said = f"{self.what}: {what}"
            self._progress.update(self._task, description=said, completed=done, total=whole)

    def show(self) -> None:
        """Start the bar unless the work is over."""
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

        with self._lock:
            if self._over:
                return
            console = Console(stderr=True)
            parts = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
            progress = Progress(*parts, console=console, transient=True)
            self._task = progress.add_task(self.what, total=None)
            progress.start()
            self._progress = progress

    def hide(self) -> None:
        """Take the bar away."""
        with self._lock:
            self._over = True
            if self._progress is not None:
                self._progress.stop()


def _drop_output() -> None:
    # What is still buffered would fail again when Python ends.
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
