"""Functions of Python, whose parameters say what they read: what typed data cannot say.

As a law one depends on what its parameters are called, ``lambda rate: -0.3 * rate * abs(rate)``,
and that alone decides which methods apply. It is asked sample by sample and in double precision,
and it is not written to files.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, get_args

from blockmech.functions.pieces import Knotted
from blockmech.ground.errors import RequestError, refused, shown
from blockmech.ground.plane import each
from blockmech.ground.validation_errors import mistake
from blockmech.typing import Argument, Real


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


ARGUMENTS = get_args(Argument)
REMEDY = (
    f"give a number, or {math.nan} where there is no answer: "
    "a load is also asked where the motion may never come"
)
VALID = 'parameters named "coordinate", "rate" or "time"'


@dataclass(frozen=True)
class Function(Knotted):
    """Size of a force [N] or moment [N m] as ``call`` of the arguments in ``of``, in that order.

    >>> import math
    >>> law = Function(math.sin, of=("time",))
    >>> law.kernel()(0.0, law.numbers())
    0.0
    """

    call: Callable[..., float]
    of: tuple[Argument, ...]

    @classmethod
    def of_call(cls, call: Callable[..., float]) -> Function:
        """The law that a function is, by the names of its parameters.

        Raises pydantic's error for other names.
        """
        names = tuple(p.name for p in parameters_of(call) or ())
        if not names or not set(names) <= set(ARGUMENTS):
            message = f"a function of ({', '.join(names)})"
            raise mistake("wrong-function", message, VALID, "e.g. lambda rate: -0.3 * rate")
        return cls(call, names)  # type: ignore[arg-type]

    def variables(self) -> tuple[str, ...]:
        """What the law is a function of."""
        return self.of

    def numbers(self) -> tuple[()]:
        """None: the function holds its numbers."""
        return ()

    def kernel(self) -> Callable[..., Real]:
        """The function, asked sample by sample."""

        def function(*arguments: Real) -> Real:
            return each(self._value, *arguments[:-1])

        return function

    def _value(self, *arguments: float) -> float:
        return numbers_of(self.call, self.of, arguments, 1, REMEDY)[0]
