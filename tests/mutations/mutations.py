"""Single mistakes in kernels, passes, friction, loads and motions: one sign, term or factor each.

A mutation replaces a piece of a function's text, which must occur there exactly once, and
gives the code to the function itself, so that whoever holds the function runs the mistake.
"""

from __future__ import annotations
import __future__

import inspect
import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from blockmech.engines.binding import Binder
from tests.fresh import without_kept_code


class Mutation(NamedTuple):
    """A mistake, and a graph of the gallery on which it shows."""

    what: str
    function: str  # module.function or module.Class.method, below blockmech
    right: str
    wrong: str
    graph: str


def plain(function: Any) -> Any:
    """The function of a property, or itself."""
    return getattr(function, "fget", None) or getattr(function, "func", function)


@contextmanager
def made(mutation: Mutation) -> Iterator[None]:
    """The package with the mistake in it, and without machine code that was made before."""
    name, _, function = mutation.function.rpartition(".")
    name, _, owner = (
        name.rpartition(".") if name.rpartition(".")[2][0].isupper() else (name, "", "")
    )
    module = import_module(f"blockmech.{name}")
    target = plain(vars(getattr(module, owner) if owner else module)[function])
    text = textwrap.dedent(inspect.getsource(target))
    assert text.count(mutation.right) == 1, f"{mutation.what}: the text has changed, write it anew"
    flags = __future__.annotations.compiler_flag
    space = dict(vars(module))
    exec(compile(text.replace(mutation.right, mutation.wrong), function, "exec", flags), space)
    right, bound = target.__code__, Binder._modules
    target.__code__, Binder._modules = plain(space[function]).__code__, {}
    try:
        with without_kept_code():
            yield
    finally:
        target.__code__, Binder._modules = right, bound


def table() -> Iterator[Mutation]:
    """The mistakes of the file: what | function | right | wrong | graph."""
    for line in (Path(__file__).parent / "mistakes.txt").read_text("utf-8").splitlines():
        yield Mutation(*(cell.strip() for cell in line.split(" | ")))


MUTATIONS = tuple(table())
