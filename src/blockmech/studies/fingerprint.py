"""The fingerprint of a study's question: the same word for the same question only.

It is taken of what is computed: the mechanism by value, graphs inside written out, the request,
functions of Python by their code with whatever they read, and the version of the package.
"""

from __future__ import annotations

import functools
import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from types import BuiltinFunctionType, CodeType, FunctionType, MethodType, ModuleType

import numpy as np

from blockmech.ground.errors import refused
from blockmech.loads.functions import Function
from blockmech.model.form import EXTRAS
from blockmech.model.graph import Graph
from blockmech.studies.runner import Runner, digest, summary
from blockmech.studies.sampling import Designs

PLAIN = (str, bytes, int, float, complex, bool, type(None))


def fingerprint(runner: Runner, chosen: Designs) -> str:
    """The word of a question, in any process. Raises `RequestError` as `content_of` does."""
    from importlib.metadata import version  # slow to load

    mechanism, part = runner.family.mechanism, runner.part(runner.samples_of_design())
    document = mechanism.document
    flat = document.flat() if isinstance(document, Graph) else document
    sections = {} if flat is None else flat.to_data()
    question = {
        "version": version("blockmech"),
        "mechanism": {key: x for key, x in sections.items() if key not in EXTRAS}
        or repr((mechanism.structure, mechanism.scene)),
        "vary": {address: summary(x) for address, x in chosen.vary.items()},
        "designs": (chosen.sampling, chosen.count, chosen.seed, part),
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
    for piece in _content(x, set()):
        sha.update(piece)
    return sha.hexdigest()


def _content(x: object, above: set[int]) -> Iterator[bytes]:
    """The content of a value, piece by piece; ``above`` are the functions that it stands in."""
    yield type(x).__qualname__.encode()
    if id(x) in above:
        return
    if isinstance(x, Function | FunctionType | MethodType | functools.partial):
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
        yield from _content((x.__func__, vars(x.__self__)), above)
    elif isinstance(x, FunctionType):
        yield from _of_function(x, above)
    elif isinstance(x, ModuleType | BuiltinFunctionType | np.ufunc | type):
        module = getattr(x, "__module__", None) or ""
        yield f"{module}.{x.__name__}{getattr(x, '__version__', '')}".encode()
    elif type(x).__module__ != "builtins" and hasattr(x, "__dict__"):
        yield from _content((vars(type(x)).get("__call__"), vars(x)), above)
    else:
        found = f"a function of Python reads a {type(x).__name__}, whose value cannot be compared"
        remedy = "leave out=... out, or let the function read numbers, arrays and functions"
        raise refused("out", found, remedy, code="no-fingerprint")


def _of_function(call: FunctionType, above: set[int]) -> Iterator[bytes]:
    """Code and defaults of a function, what it closes over, and what of its module it reads."""
    code, space = call.__code__, call.__globals__
    cells = [cell.cell_contents for cell in call.__closure__ or ()]
    read = {name: space[name] for name in sorted(_global_names(code)) if name in space}
    yield from _code(code)
    yield from _content((call.__defaults__, call.__kwdefaults__, cells, read), above)


def _code(code: CodeType) -> Iterator[bytes]:
    yield code.co_code
    yield repr((code.co_names, code.co_varnames, code.co_freevars)).encode()
    for constant in code.co_consts:
        yield from _code(constant) if isinstance(constant, CodeType) else [repr(constant).encode()]


def _global_names(code: CodeType) -> set[str]:
    """Names of the module that a function's code may read, also in functions inside of it."""
    inner = (x for x in code.co_consts if isinstance(x, CodeType))
    return set(code.co_names).union(*map(_global_names, inner))
