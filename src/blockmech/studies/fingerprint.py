"""The fingerprint of a study's question: the same word for the same question only.

It is taken of what is computed: the mechanism by value, graphs inside written out, the request,
functions of Python by their code with whatever they read, and the version of the package.
"""

from __future__ import annotations

import functools
import hashlib
import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from types import CodeType, FunctionType, MethodType, ModuleType

import numpy as np

from blockmech.functions.pieces import Function
from blockmech.ground.errors import refused
from blockmech.model.form import EXTRAS
from blockmech.model.graph import Graph
from blockmech.studies.runner import Runner, digest, summary
from blockmech.studies.sampling import Designs

PLAIN = (str, bytes, int, float, complex, bool, type(None), type(...))


def fingerprint(runner: Runner, chosen: Designs) -> str:
    """The word of a question, in any process. Raises `RequestError` as `content_of` does."""
    from importlib.metadata import version  # slow to load

    mechanism = runner.family.mechanism
    document = mechanism.document
    flat = document.flat() if isinstance(document, Graph) else document
    sections = {} if flat is None else flat.to_data()
    question = {
        "version": version("blockmech"),
        "mechanism": {key: x for key, x in sections.items() if key not in EXTRAS}
        or repr((mechanism.structure, mechanism.scene)),
        "vary": {address: summary(x) for address, x in chosen.vary.items()},
        "designs": (chosen.sampling, chosen.count, chosen.seed),
        "want": [w.label for w in runner.want],
        **runner.question(),
        "settings": dict(runner.settings),
    }
    return digest(json.dumps(question, default=content_of).encode())


def content_of(x: object) -> str:
    """What stands for a function of Python, or for what one reads, in a fingerprint.

    Raises `RequestError` for a value that nothing tells from another one.
    """
    sha = hashlib.sha256()
    for piece in _content(x, frozenset()):
        sha.update(piece)
    return sha.hexdigest()


def _content(x: object, above: frozenset[int]) -> Iterator[bytes]:
    """The content of a value, piece by piece; ``above`` is what it stands in."""
    yield type(x).__qualname__.encode()
    if id(x) in above:
        return
    above = above | {id(x)}
    if isinstance(x, PLAIN):
        yield repr(x).encode()
    elif isinstance(x, np.ndarray | np.generic) and x.dtype != object:
        yield f"{x.dtype}{np.shape(x)}".encode() + x.tobytes()
    elif isinstance(x, Mapping):
        for key in sorted(x, key=repr):
            yield from _content((key, x[key]), above)
    elif isinstance(x, Sequence | set | frozenset):
        for item in x if isinstance(x, Sequence) else sorted(x, key=repr):
            yield from _content(item, above)
    elif isinstance(x, Function):
        yield from _content((x.call, x.of), above)
    elif isinstance(x, functools.partial):
        yield from _content((x.func, x.args, x.keywords), above)
    elif isinstance(x, MethodType):
        yield from _content((x.__func__, x.__self__), above)
    elif (name := getattr(x, "__name__", "")) and (released := _package_of(x)):
        yield f"{released.__name__}.{name}{getattr(released, '__version__', '')}".encode()
    elif isinstance(x, FunctionType):
        yield from _of_function(x, above)
    elif isinstance(x, type):
        yield from _content(_class_content(x), above)
    elif isinstance(x, staticmethod | classmethod):
        yield from _content(x.__func__, above)
    elif isinstance(x, property | functools.cached_property):
        yield from _content(x.fget if isinstance(x, property) else x.func, above)
    elif type(x).__module__ != "builtins" and hasattr(x, "__dict__"):
        yield from _content((type(x), vars(x)), above)
    else:
        message = f"a function of Python reads a {type(x).__name__}, whose value cannot be compared"
        remedy = "leave out=... out, or let the function read numbers, arrays and functions"
        raise refused("out", message, remedy, code="no-fingerprint")


def _package_of(x: object) -> ModuleType | None:
    """The package of Python, or an installed one, that holds a module, class or function."""
    module = x.__name__ if isinstance(x, ModuleType) else getattr(x, "__module__", None)
    module = module or (type(x).__module__ if callable(x) else "")  # a function in C has none
    root = module.partition(".")[0]
    package = None if root == "__main__" else sys.modules.get(root)
    installed = "site-packages" in str(getattr(package, "__file__", ""))
    return package if installed or root in (*sys.stdlib_module_names, "blockmech") else None


def _class_content(cls: type) -> dict[str, object]:
    """Methods and values of a class and its bases, without those of packages."""
    return {
        name: x
        for base in reversed(cls.__mro__)
        if not _package_of(base)
        for name, x in vars(base).items()
        if isinstance(x, FunctionType) or not name.startswith(("__", "_abc_"))
    }


def _of_function(call: FunctionType, above: frozenset[int]) -> Iterator[bytes]:
    """Code and defaults of a function, and what it reads of what it closes over, of its module
    and of modules there."""
    code = call.__code__
    cells = (cell.cell_contents for cell in call.__closure__ or ())
    space = {**call.__globals__, **dict(zip(code.co_freevars, cells, strict=True))}
    yield from _code(code)
    read = _read_names(space, {*_global_names(code), *code.co_freevars})
    yield from _content((call.__defaults__, call.__kwdefaults__, read), above)


def _read_names(space: Mapping[str, object], names: set[str]) -> dict[str, object]:
    """What code with these names reads of a module."""
    read = {name: space[name] for name in sorted(names) if name in space}
    return {
        name: _read_names(vars(x), names - {name})
        if isinstance(x, ModuleType) and not _package_of(x)
        else x
        for name, x in read.items()
    }


def _code(code: CodeType) -> Iterator[bytes]:
    yield code.co_code
    yield repr((code.co_names, code.co_varnames, code.co_freevars)).encode()
    for constant in code.co_consts:
        inner = isinstance(constant, CodeType)
        yield from _code(constant) if inner else _content(constant, frozenset())


def _global_names(code: CodeType) -> set[str]:
    """Names of the module that a function's code may read, also in functions inside of it."""
    inner = (x for x in code.co_consts if isinstance(x, CodeType))
    return set(code.co_names).union(*map(_global_names, inner))
