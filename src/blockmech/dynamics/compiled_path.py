"""The loops of the path method, by machine code or interpreted: see `path_loops`."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache, partial
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from blockmech.dynamics import path_loops
from blockmech.dynamics.panel_nodes import COARSE, FINE, Nodes, Sizes, nodes
from blockmech.engines import loops
from blockmech.engines.cost import loops_pay
from blockmech.engines.llvm import has_code, machine_code
from blockmech.ground.errors import MissingEngineError
from blockmech.typing import Array, Real

SAVED = 1e-3  # [s] that a motion takes longer interpreted
LINES = 5_100  # of text that take as long to compile as the loops
LOOPS = path_loops.over_pieces, path_loops.compare, path_loops.again, path_loops.placed


class PathCode(NamedTuple):
    """The loops, called with arrays and numbers, but for nodes and the room T."""

    over_pieces: Callable[..., Real]
    compare: Callable[..., Real]
    again: Callable[..., Real]
    placed: Callable[..., Real] | None  # by arrays `Panels` is quicker
    engine: str

    @staticmethod
    @cache
    def interpreted(n: int = FINE) -> PathCode:
        """The loops by NumPy."""
        of = Sizes(n, COARSE if n == FINE else n)
        functions = (partial(_by_numpy, f, of, nodes(of.n, of.k)) for f in LOOPS[:-1])
        return PathCode._make([*functions, None, "numpy"])

    @staticmethod
    @cache
    def compiled() -> PathCode | None:
        """The loops by machine code; None without the package that makes it."""
        of = Sizes(FINE, COARSE)
        functions = {f.__name__: partial(f, of=of) for f in LOOPS}
        kinds = [(name, loops.signature(f)) for name, f in functions.items()]
        try:
            code = machine_code(partial(loops.text, **functions), *kinds, key=PathCode.key())
        except MissingEngineError:
            return None
        addresses = loops.addresses_of(nodes(of.n, of.k))
        return PathCode._make([*(partial(_by_place, f, addresses) for f in code), "llvm"])

    @staticmethod
    @cache
    def key() -> str:
        """What the text is made of: all files of this room and of the engines'."""
        room = Path(__file__).parent
        files = sorted([*room.glob("*.py"), *(room.parent / "engines").glob("*.py")])
        return f"path {sha256(b''.join(x.read_bytes() for x in files)).hexdigest()}"

    @staticmethod
    def pays(motions: int) -> bool:
        """Whether machine code pays for so many motions of a mechanism."""
        try:
            return loops_pay(SAVED * motions, LINES, lambda: has_code(PathCode.key()))
        except MissingEngineError:
            return False


@np.errstate(all="ignore")  # what is not finite is no panel, and another motion
def _by_numpy(function: Callable[..., Real], of: Sizes, matrices: Nodes, *arguments: Array) -> Real:
    """A function of the loops, run by Python."""
    return function(of, matrices, np.empty((of.n + 2, of.n + 2)), *arguments)


def _by_place(function: Callable[..., Real], matrices: Any, *arguments: Array) -> Real:
    """The same by machine code."""
    begin: Any = ctypes.c_char.from_buffer  # quicker than an array's own word for where it is
    arrays = np.empty((FINE + 2, FINE + 2)), *arguments
    addresses = (ctypes.addressof(begin(x)) if isinstance(x, np.ndarray) else x for x in arrays)
    return function(matrices, *addresses)
