"""Files written whole or not at all.

Everything is first written beside its final place and moved there at the end, so
a crash, a full disk or Ctrl-C leaves the old file or none, never half of one. No writer
takes the place of a file that a command reads: see `sparing`.
"""

from __future__ import annotations

import errno
import os
import secrets
import shutil
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path
from typing import IO

from blockmech.ground.errors import RequestError, refused

AnyPath = str | os.PathLike[str]

SPARED: ContextVar[tuple[AnyPath, ...]] = ContextVar("spared", default=())


@contextmanager
def sparing() -> Iterator[None]:
    """Inside, files that are named by `spare` are not written to; afterwards they may be again."""
    before = SPARED.set(SPARED.get())
    try:
        yield
    finally:
        SPARED.reset(before)


def spare(path: AnyPath) -> None:
    """Let no writer take the place of this file, whatever name or link it goes by."""
    SPARED.set((*SPARED.get(), path))


def refuse_spared(*targets: AnyPath) -> None:
    """Raise `RequestError` for places at which a file stands that is spared."""
    for target in targets:
        for source in SPARED.get():
            with suppress(OSError, ValueError):  # one of them is not there, or never can be
                if os.path.samefile(target, source):
                    remedy = "give the output another name"
                    raise cannot_write(os.fspath(target), "it is the file that is read", remedy)


@contextmanager
def writing(path: AnyPath) -> Iterator[IO[bytes]]:
    """A stream whose bytes become the file when the block ends without an error.

    A link is followed; a device or pipe, which cannot be replaced, is written to.
    Raises `RequestError` if the path cannot be written.
    """
    name = os.fspath(path)
    refuse_spared(name)
    target = _target(name)
    try:
        if target.is_dir():
            raise cannot_write(name, "it is a directory", "name a file in it")
        if target.exists() and not target.is_file():
            with target.open("wb") as stream:
                yield stream
            return
        draft = _draft_name(target)
        try:
            with draft.open("xb") as stream:
                yield stream
            os.replace(draft, target)
        finally:
            draft.unlink(missing_ok=True)
    except OSError as error:
        raise _refused(name, error) from error


@contextmanager
def folder(path: AnyPath, outdated: Collection[str] = ()) -> Iterator[Path]:
    """An empty directory whose files move to ``path`` when the block ends without an error.

    Missing parents are made then, files of the same names are replaced, ``outdated`` ones
    removed, others stay. Raises `RequestError` if the path cannot be written.
    """
    name = os.fspath(path)
    target = _target(name)
    try:
        if target.exists() and not target.is_dir():
            raise cannot_write(name, "it is a file, not a directory", "choose another name")
        home = target
        while not home.exists():  # the draft must be on the same disk as its place
            home = home.parent
        draft = _draft_name(home / target.name) if home != target else _draft_name(target / "draft")
        draft.mkdir()
        try:
            yield draft
            _move_in(draft, target, outdated)
        finally:
            shutil.rmtree(draft, ignore_errors=True)
    except OSError as error:
        raise _refused(name, error) from error


def cannot_write(where: str, message: str, remedy: str) -> RequestError:
    """The error for a place that cannot be written."""
    return refused(where, message, remedy, code="cannot-write")


def _move_in(draft: Path, target: Path, outdated: Collection[str]) -> None:
    names = sorted(p.name for p in draft.iterdir())
    gone = sorted({*outdated} - {*names})
    refuse_spared(*(target / name for name in (*names, *gone)))
    for name in names:  # before anything moves
        if (target / name).is_dir():
            raise cannot_write(str(target / name), "a directory is in the way", "remove it")
    for name in gone:
        (target / name).unlink(missing_ok=True)
    target.mkdir(parents=True, exist_ok=True)
    for name in names:
        os.replace(draft / name, target / name)


def _draft_name(target: Path) -> Path:
    return target.with_name(f".blockmech-{secrets.token_hex(4)}")  # no longer than most names


def _target(name: str) -> Path:
    """The place that a path leads to, links followed."""
    try:
        return Path(os.path.realpath(name))
    except ValueError:  # a null, or half a character
        raise cannot_write(name, "no file has such a name", "choose another name") from None


def _refused(where: str, error: OSError) -> RequestError:
    message = (error.strerror or str(error)).lower()
    remedy = "choose a place that exists and that you may write to"
    if isinstance(error, PermissionError):
        remedy = "close it in other programs, or choose a place that you may write to"
    if error.errno == errno.ENAMETOOLONG:
        remedy = "choose a shorter name"
    return cannot_write(where, message, remedy)
