"""Machine code kept on disk, from one process to the next.

Programs of one structure share their machine code. The key is known before anything is traced: the
program's text, its kernels by module and name with what they hold, the kinds of its parameters, and
the files of this package, which give all of these their meaning. Files are told apart as Python
tells whether its byte code is old.

Compiling takes a quarter of a second, loading what was compiled a millisecond. A file is named
after all that decides on its code, and signed with a key of this user that lies in another folder:
what others wrote, moved or damaged, or what came with a copied folder, is never loaded. Whatever
goes wrong here means that nothing is kept; then it is compiled as ever.

    folder of caches / blockmech / machine_code / <sha256>.o
    folder of settings / blockmech / machine_code.key

The environment variable BLOCKMECH_CACHE names another folder for the files, or, empty, none.
"""

from __future__ import annotations

import hmac
import os
import secrets
import stat
import sys
from collections.abc import Iterator
from contextlib import suppress
from functools import cache, lru_cache
from hashlib import sha256
from pathlib import Path
from types import FunctionType
from typing import Any

from blockmech.engines.binding import OWN
from blockmech.engines.numpy import Planar
from blockmech.ground.errors import RequestError
from blockmech.ground.files import writing
from blockmech.ground.limits import LARGEST
from blockmech.plan.plan import Program


class _Foreign(Exception):
    """Something that the package's files do not say: a user's function."""


def key_of(program: Program) -> str | None:
    """The key of a program's structure; None where users' functions are a part of it."""
    try:
        functions = [(name, *_identity(f)) for name, f in program.functions.items()]
        kinds = [_kind(value) for value in program.parameters.values()]
    except _Foreign:
        return None
    text = f"{_package()}\n{program.source}\n{functions}\n{kinds}"
    return sha256(text.encode()).hexdigest()


def _identity(value: Any) -> Iterator[Any]:
    """What a kernel, or a value that it holds, is by its module, name and contents."""
    kind = value if isinstance(value, type | FunctionType) else type(value)
    if kind.__module__ not in ("builtins", "blockmech") and not kind.__module__.startswith(OWN):
        raise _Foreign
    yield f"{kind.__module__}.{kind.__qualname__}"
    if isinstance(value, FunctionType):
        yield _contents(value)
    elif isinstance(value, tuple):
        yield tuple([tuple(_identity(x)) for x in value])
    elif hasattr(value, "answer"):  # no kernel: it answers in numbers of this shape
        yield value.answer
    elif isinstance(value, bool | int | float | complex | str | None):
        yield value
    elif not isinstance(value, type):
        raise _Foreign


@lru_cache(1024)
def _contents(function: FunctionType) -> tuple[Any, ...]:
    """The code of a function and what it holds: two lambdas of a line have one name."""
    code = function.__code__
    cells = [cell.cell_contents for cell in function.__closure__ or ()]
    contents = (*cells, function.__defaults__, function.__kwdefaults__)
    identities = tuple([tuple(_identity(x)) for x in contents])
    return code.co_firstlineno, code.co_code, identities


def _kind(value: Any) -> Any:
    """A parameter without its numbers."""
    if isinstance(value, tuple):
        return type(value).__qualname__, [_kind(x) for x in value]
    return "vector" if isinstance(value, complex | Planar) else "number"


@cache
def _package() -> str:
    """The version of the package: its files by place, size and time, as Python knows them too."""
    files = sorted(_files(str(Path(__file__).parents[1])))
    return sha256(repr(files).encode()).hexdigest()


def _files(folder: str) -> Iterator[tuple[str, int, int]]:
    for entry in os.scandir(folder):
        if entry.is_dir():
            yield from _files(entry.path)
        elif entry.name.endswith(".py"):
            status = entry.stat()
            yield entry.path, status.st_size, status.st_mtime_ns


FOLDER = "BLOCKMECH_CACHE"
SIZE = sha256().digest_size  # bytes of a signature, and of the key
MOST = 500  # files, of some ten to a hundred kB each; the oldest go
USER = getattr(os, "geteuid", None)  # none on Windows, which keeps users' folders apart itself
# Where others may not write, and, of what is secret, not read.
OTHERS_WRITE, OTHERS = stat.S_IWGRP | stat.S_IWOTH, stat.S_IRWXG | stat.S_IRWXO
NO_LINK = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0)


def load(text: str) -> bytes | None:
    """The code that was kept for a text; None where there is none to be trusted.

    text : all that decides on the code: its source, the processor, the compiler's version
    """
    folder, key = _folder(), _key()
    if folder is None or key is None:
        return None
    name = sha256(text.encode()).hexdigest()
    signed = _read(folder / f"{name}.o", OTHERS_WRITE)
    if signed is None or not hmac.compare_digest(signed[:SIZE], _signed(key, name, signed[SIZE:])):
        return None
    return signed[SIZE:]


def has(text: str) -> bool:
    """Whether there is a file for a text."""
    folder = _folder()
    return folder is not None and (folder / f"{sha256(text.encode()).hexdigest()}.o").exists()


def keep(text: str, code: bytes) -> None:
    """Keep the code of a text, where there is a place for it."""
    folder, key = _folder(), _key(make=True)
    if folder is None or key is None:
        return
    name = sha256(text.encode()).hexdigest()
    with suppress(OSError, RequestError):
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        with writing(folder / f"{name}.o") as stream:
            if USER is not None:
                os.chmod(stream.fileno(), 0o600)
            stream.write(_signed(key, name, code) + code)
        by_age = sorted(folder.glob("*.o"), key=lambda path: path.stat().st_mtime)
        for path in by_age[:-MOST]:
            path.unlink(missing_ok=True)


def _signed(key: bytes, name: str, code: bytes) -> bytes:
    """The signature of code under its name: moved to another name it does not fit."""
    return hmac.digest(key, name.encode() + code, "sha256")


def _read(path: Path, forbidden: int) -> bytes | None:
    """A file of this user that nobody else may write to (or read); None if it is not that."""
    with suppress(OSError):
        stream = os.fdopen(os.open(path, os.O_RDONLY | NO_LINK), "rb")
        with stream:
            status = os.fstat(stream.fileno())
            is_private = USER is None or (
                status.st_uid == USER() and not status.st_mode & forbidden
            )
            if is_private and stat.S_ISREG(status.st_mode):
                return stream.read(LARGEST)
    return None


def _key(make: bool = False) -> bytes | None:
    """The user's key, made where there is none yet; None where there can be none."""
    folder = _user_folder("APPDATA", "Library/Application Support", "XDG_CONFIG_HOME", ".config")
    if folder is None:
        return None
    path = folder / "blockmech" / "machine_code.key"
    if make and not path.exists():
        with suppress(OSError):
            path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | NO_LINK
            with os.fdopen(os.open(path, flags, 0o600), "wb") as stream:
                stream.write(secrets.token_bytes(SIZE))
    key = _read(path, OTHERS)
    return key if key is not None and len(key) == SIZE else None


def _folder() -> Path | None:
    """Where the files are; None where none are kept."""
    named = os.environ.get(FOLDER)
    if named is not None:
        return Path(named) / "machine_code" if named else None
    folder = _user_folder("LOCALAPPDATA", "Library/Caches", "XDG_CACHE_HOME", ".cache")
    return None if folder is None else folder / "blockmech" / "machine_code"


def _user_folder(windows: str, mac: str, variable: str, unix: str) -> Path | None:
    """A folder of the user's by the custom of the system; None where the user has no home."""
    if sys.platform == "win32":
        named = os.environ.get(windows)
        return Path(named) if named else None
    if sys.platform != "darwin" and os.path.isabs(named := os.environ.get(variable, "")):
        return Path(named)
    try:
        return Path.home() / (mac if sys.platform == "darwin" else unix)
    except RuntimeError:
        return None
