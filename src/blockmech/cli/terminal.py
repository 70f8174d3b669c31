"""Talking to the terminal: text that survives pipes and old consoles, files, and patience."""

from __future__ import annotations

import errno
import json
import os
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TypeAlias

import typer

from blockmech.export import csv_chunks, json_chunks, write_csv
from blockmech.files import cannot_write, folder, writing
from blockmech.result import Result

PATIENCE = 1.0  # [s] after which a reader wants to see that something happens

Pictures: TypeAlias = Callable[..., Any]  # (result, folder, degrees=) -> files drawn


def say(*pieces: str, end: str = "\n") -> None:
    """Write text to standard output; see `pour`."""
    pour([*pieces, end])


def say_data(file: str, data: Mapping[str, Any]) -> None:
    """Write what was found about a file as JSON."""
    say(json.dumps({"file": file, **data}, indent=2))


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


# ---- files of a result -------------------------------------------------------------------


def written(
    result: Result,
    spelling: dict[str, Any],
    out: str | None,
    csv: str | None,
    plot: str | None,
    pictures: Pictures,
) -> list[str]:
    """Write what is asked for; lines about it. ``pictures`` draws into a folder."""
    paths: list[Path] = []
    if csv is not None:
        with patience("writing"):
            write_csv(csv_chunks(result, **spelling), csv)
        paths = [Path(csv)]
    elif plot is not None:
        from blockmech.draw import plot as plotted

        with patience("drawing"):
            paths = [plotted(result, plot, degrees=spelling["degrees"])]
    elif out is not None:  # all or none
        with patience("writing and drawing"), folder(out) as draft:
            write_csv(csv_chunks(result, **spelling), draft / "results.csv")
            with writing(draft / "result.json") as stream:
                for chunk in json_chunks(result):
                    stream.write(chunk.encode())
            pictures(result, draft, degrees=spelling["degrees"])
            names = sorted(path.name for path in draft.iterdir())
        paths = [Path(out) / name for name in names]
    return [f"wrote {path}" for path in paths]


# ---- patience ----------------------------------------------------------------------------


@contextmanager
def patience(what: str) -> Iterator[None]:
    """Show on a terminal that a block which lasts over a second is at work."""
    with progress_bar(what):
        yield


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
    shown: list[Any] = []

    def show() -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

        parts = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
        console = Console(stderr=True)
        bar = Progress(*parts, console=console, transient=True, auto_refresh=not still)
        bar.add_task(what, total=None)
        bar.start()
        shown.append(bar)

    def tell(said: str, done: float, whole: float | None) -> None:
        for bar in shown:
            description = f"{what}: {said}"
            bar.update(bar.task_ids[0], description=description, completed=done, total=whole)
            if still:
                bar.refresh()

    timer = threading.Timer(PATIENCE, show)
    timer.daemon = True
    timer.start()
    try:
        yield tell
    finally:
        timer.cancel()
        timer.join()
        for bar in shown:
            bar.stop()
