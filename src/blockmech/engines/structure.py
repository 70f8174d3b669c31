"""What a program is but for its numbers: programs of one structure share their machine code.

The key is known before anything is traced: the program's text, its kernels by module and name with
what they hold, the kinds of its parameters, and the files of this package, which give all of these
their meaning. Files are told apart as Python tells whether its byte code is old.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from functools import cache, lru_cache
from hashlib import sha256
from pathlib import Path
from types import FunctionType
from typing import Any

from blockmech.engines.binding import OWN
from blockmech.engines.numpy import Planar
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
