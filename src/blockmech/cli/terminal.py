"""Talking to the terminal: text that survives pipes and old consoles, patience, and Ctrl-C."""

from __future__ import annotations

import errno
import json
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from typing import IO, Any, TypeVar

import typer

from blockmech.ground.errors import printable
from blockmech.ground.files import cannot_write, spare
from blockmech.ground.progress import PATIENCE
from blockmech.ground.sigint import leave
from blockmech.typing import Record

T = TypeVar("T")
DONE, NO_ANSWER, WRONG, FAULT, INTERRUPTED = 0, 1, 2, 3, 130  # exit codes


def say(*pieces: str, end: str = "\n") -> None:
    """Write text to standard output; see `pour`."""
    pour([*pieces, end])


def answer(file: str, as_json: bool, data: Record, text: str) -> None:
    """Write what was found about a file, as JSON or as text."""
    say(json.dumps({"file": file, **data}, indent=2) if as_json else text)


def pour(pieces: Iterable[str]) -> None:
    """Write pieces of text to standard output.

    Ends the program quietly when the reader has left (``blockmech ... | head``).
    Raises `RequestError` where standard output cannot be written, e.g. on a full disk.
    """
    try:
        _write(sys.stdout, pieces)
    except OSError as error:
        if error.errno in (errno.EPIPE, errno.EINVAL):  # EINVAL is how Windows says it
            raise typer.Exit from None
        raise cannot_write("standard output", (error.strerror or "").lower(), "") from error


def note(*lines: str) -> None:
    """Write lines to standard error, if anybody listens there."""
    with suppress(OSError):
        _write(sys.stderr, (f"{line}\n" for line in lines))


def _write(stream: IO[str] | None, pieces: Iterable[str]) -> None:
    """The one place where text leaves: no sign of it moves a cursor; a closed stream is silent."""
    if stream is None:
        return
    try:
        for piece in pieces:
            stream.write(printable(piece, but="\n\t"))
        stream.flush()
    except OSError:
        # What is still buffered would fail again when Python ends.
        with suppress(OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
        raise


# -- Ctrl-C ------------------------------------------------------------------------------

UNDRAWN = "the numbers are written, the pictures are not"
INSISTS = 3  # times Ctrl-C, after which also what is being saved is given up
SAVING = PATIENCE / 2  # [s] that saving may still take after Ctrl-C: the whole ends in time


class Interrupted(Exception):
    """Ctrl-C, and in words what was kept; typer would lose the words of a KeyboardInterrupt."""


class Interrupts:
    """What Ctrl-C does to a command: it ends the computing, but not the saving of what is done.

    The second one is ignored, as the first is being obeyed; the third is insistence.
    """

    def __init__(self) -> None:
        self.count = 0
        self.saving = False
        self.since = 0.0  # [s] on the clock, of the first while saving

    def __call__(self, signum: int, frame: Any) -> None:
        """Handle the signal."""
        self.count += 1
        if self.count == 1 and self.saving:
            self.since = time.monotonic()
        elif self.count in (1, INSISTS):
            raise KeyboardInterrupt


@contextmanager
def interruptible() -> Iterator[None]:
    """Ctrl-C does what `Interrupts` says, unless this program or its parent has other plans.

    So does the signal to terminate, which a batch system sends before it kills.
    """
    ours = (signal.default_int_handler, leave)
    main = threading.current_thread() is threading.main_thread()
    if not main or (before := signal.getsignal(signal.SIGINT)) not in ours:
        yield
        return
    handler = Interrupts()
    signal.signal(signal.SIGINT, handler)
    on_terminate = signal.getsignal(signal.SIGTERM)
    if on_terminate is signal.SIG_DFL:
        signal.signal(signal.SIGTERM, handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, on_terminate)
        # Nothing that can be lost comes after the command itself.
        signal.signal(signal.SIGINT, signal.SIG_IGN if before is leave else before)


@contextmanager
def saving() -> Iterator[Callable[[Iterable[str]], Iterator[str]]]:
    """Save inside what is done, in pieces that are passed through what is handed out.

    Ctrl-C is raised afterwards, or before a piece that comes too late; what was computed of an
    interrupted run is saved, however long that takes.
    """
    handler: Any = signal.getsignal(signal.SIGINT)
    if not isinstance(handler, Interrupts) or handler.count:
        yield iter
        return

    def passed(pieces: Iterable[str]) -> Iterator[str]:
        for piece in pieces:
            if handler.count and time.monotonic() - handler.since > SAVING:
                raise KeyboardInterrupt
            yield piece

    handler.saving = True
    try:
        yield passed
    finally:
        handler.saving = False
    if handler.count:
        raise Interrupted(UNDRAWN)


# -- patience ----------------------------------------------------------------------------


@contextmanager
def progress_bar(work: str, still: bool = False) -> Iterator[Callable[..., None] | None]:
    """A bar on a terminal for work that lasts over a second, and what tells it how far that is.

    ``tell(text, completed, total)`` moves the bar; ``total`` is None where it is not known. None
    where nobody would see it: in a pipe. A ``still`` one moves only when it is called: one that
    draws itself would be measured as well.
    """
    if sys.stderr is None or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    text = TextColumn("{task.description}", markup=False)
    parts = (text, BarColumn(), TimeElapsedColumn())
    bar = Progress(*parts, console=Console(stderr=True), transient=True, auto_refresh=not still)
    task = bar.add_task(work, total=None)

    def tell(text: str, completed: float, total: float | None) -> None:
        amount = f"{completed:.3g} of {total:.3g}" if total else f"{completed:.3g}"
        description = printable(f"{work}: {text}, {amount}")
        bar.update(task, description=description, completed=completed, total=total, refresh=still)

    timer = threading.Timer(PATIENCE, bar.start)
    timer.daemon = True
    timer.start()
    try:
        yield tell
    finally:
        timer.cancel()
        timer.join()
        bar.stop()


def reading(file: str, reader: Callable[[str], T]) -> T:
    """What ``reader`` reads from a command's file, once, so that a pipe will do.

    No output is written to the file afterwards.
    """
    spare(file)
    with progress_bar("reading"):
        return reader(file)
