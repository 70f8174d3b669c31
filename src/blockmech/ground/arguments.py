"""What a call is given, against what its signature says: one message for all that does not fit.

The signature is the declaration; nothing is said twice. Numbers in arrays, names and values are
checked where they are used, which knows what is valid there.

Not pydantic's ``validate_call``: it takes "3" for 3 and hands arrays on as iterators, and a strict
one refuses NumPy's integers; it finds no type that is imported for type checkers alone; and it
takes 0.46 ms a function when the package is imported, of 64, where this takes 0.01 ms.
"""

from __future__ import annotations

import functools
import inspect
import os
import types
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from itertools import chain, islice, repeat
from numbers import Integral, Real
from traceback import walk_tb
from typing import Any, Literal, TypeVar, Union, cast, get_args, get_origin

import numpy as np

from blockmech.ground.errors import Problem, RequestError, brief, close_match, elsewhere, listed

F = TypeVar("F", bound=Callable[..., object])
T = TypeVar("T")

WORDS: Mapping[Any, str] = {
    str: "a text",
    bool: "True or False",
    int: "a whole number",
    float: "a number",
    os.PathLike: "a path",
    Mapping: "a mapping",
    dict: "a mapping",
}
"""What an argument of a type is called. A class of our own says it itself, as ``called``."""
IN_ORDER = inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.VAR_POSITIONAL


def declared(function: F) -> F:
    """Refuse a call that does not fit the signature, before anything is done.

    Arguments of other types raise `RequestError` with one problem for each of them; a thing of
    ours says what to do with it, as ``instead``. Missing and unknown arguments raise `TypeError`,
    with the arguments that there are and a call from the examples.
    """
    signature = functools.cache(lambda: inspect.signature(function).parameters)
    positional = functools.cache(lambda: _positional(signature().values()))
    hint = functools.cache(lambda name: _hint(signature(), name, function))
    fitting: set[tuple[object, ...]] = set()  # types of calls that fit

    @functools.wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        types_of_call = (*map(type, args), *kwargs, *map(type, kwargs.values()))
        if types_of_call not in fitting:
            names, rest = positional()
            pairs = [*zip(chain(names, repeat(rest)), args, strict=False), *kwargs.items()]
            if wrong := [
                _problem(name, x, hint(name)) for name, x in pairs if not _matches(x, hint(name))
            ]:
                raise RequestError(wrong)
            if not any(hasattr(x, "ndim") for _, x in pairs):  # the shape of an array counts, too
                fitting.add(types_of_call)
        try:
            return function(*args, **kwargs)
        except TypeError as error:
            began = inspect.unwrap(function).__code__
            if any(frame.f_code is began for frame, _ in walk_tb(error.__traceback__)):
                raise
            raise TypeError(_misfit(error, function, signature(), kwargs, *args[:1])) from None

    return cast(F, call)


def constructed(cls: type[T]) -> type[T]:
    """Let a dataclass say its arguments to a call that does not fit them, as functions do."""
    init: Callable[..., None] = cls.__init__

    @functools.wraps(init)
    def __init__(self: T, *args: Any, **kwargs: Any) -> None:
        try:
            init(self, *args, **kwargs)
        except TypeError as error:
            names = inspect.signature(cls).parameters
            raise TypeError(_misfit(error, cls, names, kwargs)) from None

    cls.__init__ = __init__  # type: ignore[assignment, method-assign]
    return cls


def _positional(parameters: Iterable[inspect.Parameter]) -> tuple[tuple[str, ...], str]:
    """Names of the parameters that take arguments by their order, and of that for the rest."""
    names = {kind: [p.name for p in parameters if p.kind is kind] for kind in IN_ORDER}
    return tuple(names[IN_ORDER[0]]), next(iter(names[IN_ORDER[1]]), "")


def _misfit(
    error: TypeError,
    function: Callable[..., object],
    names: Iterable[str],
    kwargs: Iterable[str],
    owner: object = None,
) -> str:
    """What Python says of a call that does not fit, and how the function is called.

    What is no argument may be a method of its owner, or of what the function returns.
    """
    names = [name for name in names if name != "self"]
    answer = _evaluated(inspect.signature(function).return_annotation, function)
    homes = {".{}()": type(owner), f"{function.__name__}(...).{{}}()": answer}
    document, name = function.__doc__ or "", function.__name__
    unknown = [x for x in kwargs if x not in names]
    texts = {x: f'write {name}("{x}=...")' for x in unknown if f'"{x}=' in document}
    hints = (
        texts.get(x) or close_match(x, names) or elsewhere(x, homes).removeprefix(": ")
        for x in unknown
    )
    sentences = [str(error), *dict.fromkeys(hints)]
    sentences.append(f"arguments: {listed(names, 16)}")
    lines = map(str.strip, document.splitlines())
    examples = (x for x in lines if x.startswith(">>> ") and f"{name}(" in x)
    sentences += [f"e.g. {example.removeprefix('>>> ')}" for example in islice(examples, 1)]
    return ". ".join(filter(None, sentences)).replace("?.", "?")


def _problem(name: str, value: object, hint: Any) -> Problem:
    kinds = list(dict.fromkeys(w for part in _parts(hint) if (w := _type_name(part))))
    valid = f"{' or '.join(kinds)} is meant" if kinds else ""
    message = f"got {brief(value)}"
    remedies = (getattr(x, "_remedy", "") for x in _parts(hint) if hasattr(value, "compile"))
    remedy = next(filter(None, remedies), getattr(value, "_instead", ""))
    items = value.values() if isinstance(value, Mapping) else value
    if isinstance(items, Collection) and any(_matches(x, hint) for x in items):
        remedy = next((x._several for x in _parts(hint) if hasattr(x, "_several")), remedy)
    return Problem("wrong-type", name, message, valid, remedy)


def _hint(
    parameters: Mapping[str, inspect.Parameter], name: str, function: Callable[..., object]
) -> Any:
    """The type of an argument; any where it is only known to type checkers."""
    return _evaluated(parameters[name].annotation, function) if name in parameters else Any


def _evaluated(annotation: Any, function: Callable[..., object]) -> Any:
    try:
        return eval(annotation, function.__globals__) if isinstance(annotation, str) else Any
    except NameError:
        return Any


def _parts(hint: Any) -> tuple[Any, ...]:
    """The alternatives of a type."""
    return get_args(hint) if get_origin(hint) in (Union, types.UnionType) else (hint,)


def _type_name(hint: Any) -> str:
    """What a type is called in a message; None is left out, and what is not checked."""
    kind = get_origin(hint) or hint
    if kind in WORDS or hint in (None, type(None)):
        return WORDS.get(kind, "")
    if kind is Literal:
        return " or ".join(dict.fromkeys(WORDS[type(x)] for x in get_args(hint)))
    return str(getattr(kind, "_called", kind.__name__.lower()))


def _matches(value: Any, hint: Any) -> bool:
    """Whether an argument is of a type, as far as its type tells."""
    kind = get_origin(hint) or hint
    if kind in (Union, types.UnionType):
        return any(_matches(value, part) for part in get_args(hint))
    if hint is None or hint is type(None):
        return value is None
    if kind is Literal:
        return any(_matches(value, type(x)) for x in get_args(hint))
    if kind is bool:
        return isinstance(value, bool | np.bool_)
    if kind in (int, float):
        of = Integral if kind is int else Real
        number = value.item() if getattr(value, "ndim", None) == 0 else value  # an array of one
        return isinstance(number, of) and not isinstance(number, bool)
    if hint is Any or kind in (np.ndarray, Iterable, Sequence):  # what is in it tells
        return True
    return isinstance(value, kind) if isinstance(kind, type) else True
