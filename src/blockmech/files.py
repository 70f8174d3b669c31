"""Files written whole or not at all.

Everything is first written beside its final place and moved there at the end, so
a crash, a full disk or Ctrl-C leaves the old file or none, never half of one.
"""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from blockmech.errors import Problem, RequestError

AnyPath = str | os.PathLike[str]


@contextmanager
def writing(path: AnyPath) -> Iterator[IO[bytes]]:
    """A stream whose bytes become the file when the block ends without an error.

    A link is followed; a device or pipe, which cannot be replaced, is written to.
    Raises `RequestError` where the place cannot be written.
    """
    shown = os.fspath(path)
    target = Path(os.path.realpath(path))
    if target.is_dir():
        raise cannot_write(shown, "it is a directory", "name a file in it")
    try:
        if target.exists() and not target.is_file():
            with target.open("wb") as stream:
                yield stream
            return
        draft = _beside(target)
        try:
            with draft.open("xb") as stream:
                yield stream
            os.replace(draft, target)
        finally:
            draft.unlink(missing_ok=True)
    except OSError as error:
        raise _refused(shown, error) from error


@contextmanager
def folder(path: AnyPath) -> Iterator[Path]:
    """An empty directory whose files move to ``path`` when the block ends without an error.

    Missing parents are made then, files of the same names are replaced, others stay.
    Raises `RequestError` where the place cannot be written.
    """
    shown = os.fspath(path)
    target = Path(os.path.realpath(path))
    if target.exists() and not target.is_dir():
        raise cannot_write(shown, "it is a file, not a directory", "choose another name")
    home = target
    while not home.exists():  # the draft must be on the same disk as its place
        home = home.parent
    try:
        draft = _beside(home / target.name) if home != target else _beside(target / "blockmech")
        draft.mkdir()
        try:
            yield draft
            _move_in(draft, target)
        finally:
            shutil.rmtree(draft, ignore_errors=True)
    except OSError as error:
        raise _refused(shown, error) from error


def cannot_write(where: str, found: str, remedy: str) -> RequestError:
    """The error for a place that cannot be written."""
    return RequestError(Problem("cannot-write", where, found, "", remedy))


def _move_in(draft: Path, target: Path) -> None:
    names = sorted(p.name for p in draft.iterdir())
    for name in names:  # before anything moves
        if (target / name).is_dir():
            raise cannot_write(str(target / name), "a directory is in the way", "remove it")
    target.mkdir(parents=True, exist_ok=True)
    for name in names:
        os.replace(draft / name, target / name)


def _beside(target: Path) -> Path:
    return target.with_name(f".{target.name}-{secrets.token_hex(4)}")


def _refused(where: str, error: OSError) -> RequestError:
    found = (error.strerror or str(error)).lower()
    remedy = "choose a place that exists and that you may write to"
    if isinstance(error, PermissionError):
        remedy = "close it in other programs, or choose a place that you may write to"
    return cannot_write(where, found, remedy)
