r"""Solutions of solvers, proved by their own step of Newton's method N.

With N(x0) + N'(X) (X - x0) inside the box X, X holds a solution (Brouwer), and only one, as N is
then a contraction. See `ground.plane.implicit`.

Source: Rump, Verification methods, Acta Numerica 19 (2010), section 13.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable

import numpy as np

from blockmech.engines.enclosed.duals import Dual, dual
from blockmech.engines.enclosed.forms import Form, form, forms_of, planned, unknown
from blockmech.engines.enclosed.primitives import angle, expi, hyp
from blockmech.engines.enclosed.rounding import ROUNDED_UP, TINY, above, below
from blockmech.engines.numpy import Planar, each_part, mul
from blockmech.ground.plane import EPS
from blockmech.typing import Array, Kernel, LinkPosition, Nested, Real, Values

ATTEMPTS = 4  # boxes that are tried for a solution


class _Unknowns:
    """The unknowns of a state: numbers; of links positions, and turns from their directions.

    The length of a direction is no unknown: steps leave it as it is.
    """

    def __init__(self, state: Values) -> None:
        self.state = state
        self.numbers: list[float] = []
        for x in state:
            link = isinstance(x, LinkPosition)
            self.numbers += [x.o.real, x.o.imag, 0.0] if link else [x]

    def state_of(self, numbers: Iterable[Real]) -> Values:
        """The state of some values of the unknowns."""
        values, state = iter(numbers), []
        for x in self.state:
            if isinstance(x, LinkPosition):
                origin = Planar(next(values), next(values))
                state.append(LinkPosition(origin, _unit(x.e) * expi(next(values))))
            else:
                state.append(next(values))
        return tuple(state)

    def numbers_of(self, state: Values) -> list[Real]:
        """The values of the unknowns of a state."""
        numbers: list[Real] = []
        for base, x in zip(self.state, state, strict=True):
            link = isinstance(base, LinkPosition)
            numbers += [x.o.real, x.o.imag, angle(_unit(base.e), x.e)] if link else [x]
        return numbers


def _unit(e: complex) -> Planar:
    z = Planar(form(e.real), form(e.imag))
    return mul(z, hyp(z).inverse())


def implicit(step: Kernel, state: Values, *data: Nested) -> Values:
    """The state that a step of Newton's method proves; without bounds where it proves none."""
    unknowns = _Unknowns(planned(state[0]))
    x0 = unknowns.numbers
    if all(map(math.isfinite, x0)):

        def newton(x: Iterable[Real], *data: Nested) -> list[Real]:
            return unknowns.numbers_of(step((unknowns.state_of(x), *state[1:]), *data)[0])

        first = newton(map(form, x0), *data)
        misfit = [max(abs(y.high - x), abs(x - y.low)) for y, x in zip(first, x0, strict=True)]
        errors = _proved_errors(newton, x0, np.array(misfit), _bounds(data))
        if errors is not None:
            solution = [y.widened(e) for y, e in zip(first, errors.tolist(), strict=True)]
            # It holds the image as well, which is off by the square of their errors.
            both = zip(solution, newton(solution, *data), strict=True)
            solution = [min(x, key=lambda y: y.high - y.low) for x in both]
            return (unknowns.state_of(solution), *state[1:])
    return (without_bounds(unknowns.state), *state[1:])


def _proved_errors(
    newton: Callable[..., list[Real]], x0: list[float], misfit: Array, data: Values
) -> Array | None:
    """Errors of one step from x0, of a box that it maps into its inside; None without one."""
    box = 2.0 * misfit + EPS * misfit.max(initial=0.0) + TINY
    for _ in range(ATTEMPTS):
        errors: Array = box
        if np.isfinite(box).all():
            m, x = len(box), []
            for at, width, seed in zip(x0, box.tolist(), np.eye(m), strict=True):
                x.append(Dual(Form(at, below(at - width), above(at + width)), seed, np.zeros(m)))
            slopes = [np.broadcast_to(abs(y.d) + y.r, (m,)) for y in map(dual, newton(x, *data))]
            errors = np.nan_to_num(np.array(slopes) @ box, nan=math.inf) * ROUNDED_UP + TINY
        image = (misfit + errors) * ROUNDED_UP
        if is_inside(image, box):
            return errors
        box = 2.0 * image
    return None


def is_inside(image: Array, box: Array) -> bool:
    """Whether a step maps a box into its inside."""
    return bool((image < box).all())


def _bounds(data: Values) -> Nested:
    """Nested tuples of numbers without their symbols."""
    return each_part(lambda x: Form(x.at, x.low, x.high) if isinstance(x, Form) else x, data)


def without_bounds(state: Values) -> Nested:
    """A state of which nothing is proved."""
    return each_part(lambda x: unknown(planned(x)), forms_of(state))
