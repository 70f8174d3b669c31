"""Talking to the terminal: text that survives pipes and old consoles, files, and patience."""

from __future__ import annotations

import errno
import json as text_of
import os
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TypeAlias

import typer

from blockmech.export import csv_chunks, json_chunks, table, write_csv
from blockmech.files import cannot_write, folder, writing
from blockmech.result import Result

PATIENCE = 1.0  # [s] after which a reader wants to see that something happens

Pictures: TypeAlias = Callable[..., Any]  # (result, folder, degrees=) -> files drawn


def say(*pieces: str, end: str = "\n") -> None:
    """Write text to standard output; see `pour`."""
    pour([*pieces, end])


def say_data(file: str, data: Mapping[str, Any]) -> None:
    """Write what was found about a file as JSON."""
    say(text_of.dumps({"file": file, **data}, indent=2))


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


def show(
    result: Result,
    spelling: dict[str, Any],
    pictures: Pictures,
    *,
    json: bool,
    out: str | None,
    csv: str | None,
    plot: str | None,
    lines: Sequence[str] = (),
    gaps: Sequence[str] = (),
) -> None:
    """Print a result as data, with notes of its gaps; or write what is asked for, and a table.

    ``spelling`` is how numbers stand, ``pictures`` draws into a folder, ``lines`` follow the
    table.
    """
    if json or csv == "-":
        pour(json_chunks(result) if json else csv_chunks(result, **spelling))
        note(*gaps)
        return
    files = [f"wrote {path}" for path in _written(result, spelling, out, csv, plot, pictures)]
    say("\n".join([table(result, degrees=spelling["degrees"]), *lines, *files]))


def _written(
    result: Result,
    spelling: dict[str, Any],
    out: str | None,
    csv: str | None,
    plot: str | None,
    pictures: Pictures,
) -> list[Path]:
    """Write what is asked for."""
    if csv is not None:
        with patience("writing"):
            write_csv(csv_chunks(result, **spelling), csv)
        return [Path(csv)]
    if plot is not None:
        from blockmech.draw import plot as plotted

        with patience("drawing"):
            return [plotted(result, plot, degrees=spelling["degrees"])]
    if out is None:
        return []
    with patience("writing and drawing"), folder(out) as draft:  # all or none
        write_csv(csv_chunks(result, **spelling), draft / "results.csv")
        with writing(draft / "result.json") as stream:
            for chunk in json_chunks(result):
                stream.write(chunk.encode())
        pictures(result, draft, degrees=spelling["degrees"])
        names = sorted(path.name for path in draft.iterdir())
    return [Path(out) / name for name in names]


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
