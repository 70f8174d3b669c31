"""Talking to the terminal: text that survives pipes and old consoles, and patience."""

from __future__ import annotations

import errno
import json
import os
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any

import typer

from blockmech.files import cannot_write

DONE, NO_ANSWER, WRONG, FAULT, INTERRUPTED = 0, 1, 2, 3, 130  # exit codes
PATIENCE = 1.0  # [s] after which a reader wants to see that something happens


def say(*pieces: str, end: str = "\n") -> None:
    """Write text to standard output; see `pour`."""
    pour([*pieces, end])


def answer(file: str, as_json: bool, data: Mapping[str, Any], text: str) -> None:
    """Write what was found about a file, as JSON or as text."""
    say(json.dumps({"file": file, **data}, indent=2) if as_json else text)


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
        # What is still buffered would fail again when Python ends.
        with suppress(OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if error.errno in (errno.EPIPE, errno.EINVAL):  # EINVAL is how Windows says it
            raise typer.Exit from None
        raise cannot_write("standard output", (error.strerror or "").lower(), "") from error


def note(*lines: str) -> None:
    """Write lines to standard error."""
    for line in lines:
        print(line, file=sys.stderr)


@contextmanager
def progress_bar(
    what: str, quiet: bool = False, still: bool = False
) -> Iterator[Callable[..., None] | None]:
    """A bar on a terminal for work that lasts over a second, and what tells it how far that is.

    ``told(what, done, whole)`` moves the bar; ``whole`` is None where it is not known. None
    where nobody would see it: in a pipe, or where ``quiet`` is asked for. A ``still`` one
    moves only when it is told: one that draws itself would be measured as well.
    """
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    parts = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    console = Console(stderr=True)
    bar = Progress(*parts, console=console, transient=True, auto_refresh=not still)
    task = bar.add_task(what, total=None)

    def tell(said: str, done: float, whole: float | None) -> None:
        far = f"{done:.3g} of {whole:.3g}" if whole else f"{done:.3g}"
        description = f"{what}: {said}, {far}"
        bar.update(task, description=description, completed=done, total=whole, refresh=still)

    timer = threading.Timer(PATIENCE, bar.start)
    timer.daemon = True
    timer.start()
    try:
        yield tell
    finally:
        timer.cancel()
        timer.join()
        bar.stop()
