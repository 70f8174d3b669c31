"""A law that is a function of Python: whatever typed data cannot say.

The names of its parameters declare what it depends on, and that alone decides which
methods apply: ``lambda rate: -0.3 * rate * abs(rate)``. It is asked sample by sample and
in double precision, and it is not written to files.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import get_args

from blockmech.functions.pieces import Knotted
from blockmech.functions.python import numbers_of, parameters_of
from blockmech.ground.mistakes import mistake
from blockmech.ground.plane import each
from blockmech.typing import Argument, Real

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
