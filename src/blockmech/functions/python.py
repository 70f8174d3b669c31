"""Functions of Python, whose parameters say what they read: what typed data cannot say."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from typing import Any

from blockmech.ground.errors import RequestError, refused, shown


def parameters_of(call: Callable[..., float]) -> list[inspect.Parameter] | None:
    """The parameters of a function; None where nobody knows them, as of some builtins."""
    try:
        return list(inspect.signature(call).parameters.values())
    except (TypeError, ValueError):
        return None


def numbers_of(
    call: Callable[..., Any], names: Sequence[str], x: Sequence[float], count: int, remedy: str
) -> tuple[float, ...]:
    """The numbers that a function gives. Raises `RequestError` where they are not so many."""

    def refusal(message: str) -> RequestError:
        where = f"{getattr(call, '__name__', 'function')}({', '.join(names)})"
        at = ", ".join(f"{name} = {value:.9g}" for name, value in zip(names, x, strict=True))
        return refused(where, f"{message}, at {at}", remedy, code="user-function")

    try:
        answer = call(*x)
    except Exception as error:
        raise refusal(f"{type(error).__name__}: {error}") from error
    try:
        numbers = (float(answer),) if count == 1 else tuple(map(float, answer))
    except (TypeError, ValueError):
        raise refusal(f"it gave {shown(answer)}") from None
    if len(numbers) != count:
        raise refusal(f"it gave {len(numbers)} numbers, not {count}")
    return numbers
