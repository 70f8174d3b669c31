r"""Solutions of solvers, proved by their own step of Newton's method N.

With N(x0) + N'(X) (X - x0) inside the box X, X holds a solution (Brouwer), and only one, as N is
then a contraction. See `ground.plane.implicit`.

Linear systems are solved by the inverse of the matrix in their middle.

Source: Rump, Verification methods, Acta Numerica 19 (2010), sections 10.7 and 13.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence

import numpy as np

from blockmech.engines.enclosed.duals import Dual, dual, scaled
from blockmech.engines.enclosed.forms import Form, affine, form, forms_of, planned, unknown
from blockmech.engines.enclosed.primitives import angle, expi, hyp
from blockmech.engines.enclosed.rounding import ROUNDED_UP, TINY, ULP, above, below
from blockmech.engines.numpy import Planar, each_part, mul
from blockmech.ground.plane import EPS
from blockmech.typing import Array, Kernel, LinkPosition, Nested, Real, Reals, Values

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


def weighted_sum(weights: Iterable[float], forms: Sequence[Form]) -> Form:
    """The sum of forms times weights."""
    terms = [(w, x) for w, x in zip(weights, forms, strict=True) if w != 0.0 and x.magnitude > 0.0]
    at = sum(w * x.at for w, x in terms)
    if any(x.d is None for _, x in terms):
        total = form(0.0)
        for w, x in terms:
            total = total + x * w
        return Form(at, total.low, total.high)
    c = math.fsum(w * x.c for w, x in terms)
    magnitude = sum(abs(w) * (abs(x.c) + len(terms) * x.r) for w, x in terms)
    error = 4 * ULP * magnitude + (TINY if terms else 0.0)
    return affine(at, c, [(w, x.d) for w, x in terms if x.d is not None], error)


class Matrix:
    """A matrix of numbers, perhaps with derivatives, and the inverse of its middle."""

    def __init__(self, rows: Iterable[Reals]) -> None:
        self.rows = tuple(tuple(row) for row in rows)
        self.forms = [[dual(x).x for x in row] for row in self.rows]
        self.low, self.high = (
            np.array([[getattr(x, bound) for x in row] for row in self.forms])
            for bound in ("low", "high")
        )
        self.middle = 0.5 * (self.low + self.high)
        self.width = np.maximum(self.high - self.middle, self.middle - self.low) * ROUNDED_UP
        n = len(self.forms)
        self.inverse, self.residual = np.zeros((n, n)), np.full((n, n), math.inf)

    @property
    def bounded(self) -> bool:
        """Whether all entries have bounds."""
        return bool(np.isfinite(self.low).all() and np.isfinite(self.high).all())

    def invert(self) -> bool:
        """Whether every matrix within the bounds is regular: C A = 1 - residual, which is < 1."""
        if not self.bounded:
            return False
        try:
            self.inverse = C = np.linalg.inv(self.middle)
        except np.linalg.LinAlgError:
            return False
        n = len(C)
        error = abs(C) @ (self.width + (n + 2) * EPS * abs(self.middle)) * ROUNDED_UP
        self.residual = (abs(np.eye(n) - C @ self.middle) + error) * ROUNDED_UP + TINY
        return bool(self.residual.sum(axis=1).max() * ROUNDED_UP < 1.0)

    def error_beside(self, corrections: Array) -> Array:
        """Error of solutions whose corrections (n, ...) from those of the middle have bounds."""
        shares = self.residual.sum(axis=1)
        largest = corrections.max(axis=0) / (1.0 - shares.max() * ROUNDED_UP) * ROUNDED_UP
        error: Array = shares.reshape(-1, *[1] * (corrections.ndim - 1)) * largest * ROUNDED_UP
        return error


def solve(a: Matrix, right: Reals) -> tuple[Form | Dual, ...]:
    """Solution of a x = right: of the middle, then corrected by the residual there.

    With C the inverse of the middle and C a = 1 - E, x = x0 + C (right - a x0) + E (x - x0).
    """
    duals = any(isinstance(x, Dual) for row in (*a.rows, right) for x in row)
    forms = [dual(x).x for x in right]
    if not a.invert() or not all(x.magnitude < math.inf for x in forms):
        return tuple(Dual(unknown(), 0.0, math.inf) if duals else unknown() for _ in right)
    start = a.inverse @ np.array([0.5 * (x.low + x.high) for x in forms])
    residuals = [x - weighted_sum(start, row) for x, row in zip(forms, a.forms, strict=True)]
    corrections = [weighted_sum(row, residuals) for row in a.inverse]
    errors = a.error_beside(np.array([x.magnitude for x in corrections])).tolist()
    solution = [
        form(s) + correction.widened(error)
        for s, correction, error in zip(start.tolist(), corrections, errors, strict=True)
    ]
    return _with_slopes(a, right, solution) if duals else tuple(solution)


def _with_slopes(a: Matrix, right: Reals, solution: Sequence[Form]) -> tuple[Dual, ...]:
    """A solution with its derivatives: a dx = d right - da x."""
    change = [dual(v) for v in right]
    for i, row in enumerate(a.rows):
        for x, entry in zip(solution, row, strict=True):
            if isinstance(entry, Dual):
                change[i] = change[i] - Dual(form(0.0), *scaled(x, entry.d, entry.r))
    shape = np.broadcast_shapes(*(c.d.shape for c in change))
    d, r = (np.array([np.broadcast_to(getattr(c, k), shape) for c in change]) for k in "dr")
    if not np.isfinite(r).all():
        return tuple(Dual(x, 0.0 * d[0], np.full(shape, math.inf)) for x in solution)
    y = a.inverse @ d
    error = (abs(a.inverse) @ (r + (len(y) + 2) * EPS * abs(d))) * ROUNDED_UP + TINY
    error = (error + a.error_beside(abs(y) + error)) * ROUNDED_UP
    return tuple(map(Dual, solution, y, error))


def solve_transposed(a: Matrix, right: Reals) -> tuple[Form | Dual, ...]:
    """Solution of a^T x = right."""
    return solve(Matrix(zip(*a.rows, strict=True)), right)


def spread(a: Matrix) -> Form:
    """Ratio of extreme singular values: those of the middle, as far as its factors are right.

    Of U S V with U and V orthogonal but for errors e they are those of S but for a factor
    1 + e; and no further from those of a than it is from a (Weyl).
    """
    if not a.bounded:
        return unknown()
    u, s, v = np.linalg.svd(a.middle)
    n, identity = len(s), np.eye(len(s))
    tilt = sum(float(np.linalg.norm(x.T @ x - identity)) for x in (u, v)) + 8 * n * n * EPS
    apart = np.linalg.norm(a.middle - (u * s) @ v) + np.linalg.norm(a.width)
    error = (float(apart) + (4 * n * n * EPS + 2 * tilt) * float(s[0])) * ROUNDED_UP
    at, (highest, lowest) = float(s[-1] / s[0]), (float(s[0]), float(s[-1]))
    low = max(lowest - error, 0.0) / (highest + error)
    high = (lowest + error) / (highest - error) if highest > error else 1.0
    return Form(at, max(below(below(low)), 0.0), min(-below(below(-high)), 1.0))
