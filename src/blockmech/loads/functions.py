"""A law that is a function of Python: whatever typed data cannot say.

The names of its parameters declare what it depends on, and that alone decides which
methods apply: ``lambda rate: -0.3 * rate * abs(rate)``. It is asked sample by sample and
in double precision, and it is not written to files.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, get_args

from blockmech.ground.errors import RequestError, refused, shown
from blockmech.ground.plane import each
from blockmech.ground.values import mistake
from blockmech.typing import Argument, Real

ARGUMENTS = get_args(Argument)
VALID = 'parameters named "coordinate", "rate" or "time"'


@dataclass(frozen=True)
class Function:
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
        try:
            names = tuple(inspect.signature(call).parameters)
        except (TypeError, ValueError):  # of some builtins
            names = ()
        if not names or not set(names) <= set(ARGUMENTS):
            found = f"a function of ({', '.join(names)})"
            raise mistake("wrong-function", found, VALID, "e.g. lambda rate: -0.3 * rate")
        return cls(call, names)  # type: ignore[arg-type]

    def variables(self) -> tuple[str, ...]:
        """What the law is a function of."""
        return self.of

    @property
    def repeats_after(self) -> float:
        """Nothing is known of a user's function."""
        return 0.0

    def rows(self) -> tuple[()]:
        """None is known."""
        return ()

    def kinks_of_angle(self) -> tuple[float, ...]:
        """The half turn, where the angle jumps."""
        return (math.pi,)

    def within(self, low: float, high: float) -> tuple[()]:
        """No kinks are known."""
        return ()

    def next_kink(self, x: float) -> float:
        """None is known."""
        return math.inf

    def numbers(self) -> tuple[()]:
        """None: the function has its own."""
        return ()

    def kernel(self) -> Callable[..., Real]:
        """The function, asked sample by sample."""

        def function(*given: Any) -> Real:
            return each(self._value, *given[:-1])

        return function

    def _value(self, *given: float) -> float:
        try:
            answer = self.call(*given)
        except Exception as error:
            raise self._refused(f"{type(error).__name__}: {error}", given) from error
        try:
            return float(answer)
        except (TypeError, ValueError):
            raise self._refused(f"it gave {shown(answer)}", given) from None

    def _refused(self, found: str, given: Iterable[float]) -> RequestError:
        name = getattr(self.call, "__name__", "function")
        at = ", ".join(f"{what} = {x:.9g}" for what, x in zip(self.of, given, strict=True))
        remedy = f"give a number, or {math.nan} where there is no answer: "
        remedy += "a load is also asked where the motion may never come"
        where = f"{name}({', '.join(self.of)})"
        return refused(where, f"{found}, at {at}", remedy, code="user-function")
