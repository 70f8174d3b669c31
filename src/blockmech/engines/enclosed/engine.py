"""The engine of enclosures: a program bound to affine forms, one sample at a time.

Loops run on the numbers of the planned design; what they end at is proved by
`blockmech.engines.enclosed.proofs`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from blockmech.engines.binding import Binder, bind
from blockmech.engines.enclosed.forms import Form, form, forms_of, planned, sign, unknown
from blockmech.engines.enclosed.primitives import (
    angle,
    exp,
    expi,
    hyp,
    maximum,
    minimum,
    modulo,
    piecewise,
    planar,
    power,
    sqrt,
    where,
)
from blockmech.engines.enclosed.proofs import (
    Matrix,
    implicit,
    solve,
    solve_transposed,
    spread,
    without_bounds,
)
from blockmech.engines.numpy import imul, mul
from blockmech.ground.plane import (
    EPS,
    REST_SHARE,
    SCALAR_PRIMITIVES,
    cross,
    dot,
    primitives_of,
    times,
)
from blockmech.plan.plan import Program
from blockmech.typing import Data, Kernel, Nested, Record, Values


def each(function: Callable[..., float], *x: Form | float) -> Form:
    """A function of Python, of which nothing is known but its value at a number."""
    (value,) = one_by_one(lambda *numbers: (function(*numbers),), *x)
    return form(value)


def one_by_one(
    function: Callable[..., tuple[float, ...]], *x: Form | float
) -> tuple[Form | float, ...]:
    """A function of numbers, of which nothing is known where they vary."""
    numbers = [form(v) for v in x]
    values = function(*map(planned, numbers))
    return values if all(v.exact for v in numbers) else tuple(map(unknown, values))


def repeat(step: Kernel, state: Values, cap: int, *data: Nested) -> Nested:
    """The state at which the planned design ends: numbers, of which nothing is proved yet."""
    if not planned(state[-1]):
        return state
    numbers, scalar_step = planned(state), Binder(SCALAR_PRIMITIVES)(step)
    try:
        return forms_of(SCALAR_PRIMITIVES["repeat"](scalar_step, numbers, cap, *planned(data)))
    except (ArithmeticError, ValueError):
        return without_bounds(numbers)


_OF_PLANE = (cross, dot, times, where, maximum, minimum, sqrt, exp, sign, power, modulo, piecewise)
_OF_VECTORS = (expi, hyp, planar, mul, imul, angle)
_OF_SOLVERS = (each, repeat, implicit, solve, solve_transposed, spread)
PRIMITIVES: Data = {
    **{f.__name__: f for f in (*_OF_PLANE, *_OF_VECTORS, *_OF_SOLVERS)},
    "matrix": Matrix,
    "EPS": EPS,
}
"""The primitives of the plane on forms."""


def scale(a: Form | float, b: Form | float) -> float:
    """The larger length, of the planned design: a scale does not vary."""
    return float(max(planned(a), planned(b)))


@primitives_of.register(Form)
def _of_forms(x: object) -> Record:
    return {**PRIMITIVES, "maximum": scale, "one_by_one": one_by_one}


class EnclosedEngine:
    """A program bound to forms, one sample at a time."""

    name = "enclosed"

    def __init__(self, program: Program) -> None:
        self.program = program
        constants = {"ZERO": forms_of(0j), "ONE": forms_of(1 + 0j), "REST": REST_SHARE}
        # what is no kernel, such as a group's path from home, is asked of the planned design
        self._program = bind(program, PRIMITIVES, constants, lambda f: lambda *x: f(*planned(x)))

    def one(self, inputs: Sequence[Form | float], parameters: Values) -> Values:
        """Values of one sample, forms or `Planar` pairs of them."""
        with np.errstate(all="ignore"):  # what is not finite has no bounds
            return self._program(*map(form, inputs), tuple(map(forms_of, parameters)))
