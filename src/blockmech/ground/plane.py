"""The primitives of the plane: the only functions a kernel may call.

A kernel is written once with these names and runs on every engine: an engine
re-binds them to its own number type (`blockmech.engines`). The definitions here
are those of the scalar engine, Python ``complex`` and ``float``, so a kernel
can be called and tested just as it is written.

Only ``+ - *``, division by reals and these names occur in kernels. Nothing here
fuses or re-associates a multiplication, so one pose and a batch of poses agree
to the last bit wherever sine and cosine do.
"""

from __future__ import annotations

import bisect
import functools
import math
import sys
from collections.abc import Callable, Iterable, Sequence
from types import FunctionType
from typing import TypeVar

from blockmech.typing import Array, Complex, Kernel, Nested, Real, Reals, Record, Values

K = TypeVar("K")
State = TypeVar("State", bound=Values)
NAN = math.nan
EPS = sys.float_info.epsilon  # of the numbers at hand: an engine binds its own precision's
# Of the largest speed: a relative speed below it counts as rest. A rate of zero that rounding
# makes another has lost three quarters of its digits.
REST_SHARE = EPS**0.75
LARGEST_EXPONENT = math.log(sys.float_info.max)


def cross(a: Complex, b: Complex) -> Real:
    """Component of ``a x b`` out of the plane."""
    return a.real * b.imag - a.imag * b.real


def dot(a: Complex, b: Complex) -> Real:
    """Scalar product of two planar vectors."""
    return a.real * b.real + a.imag * b.imag


def mul(z: Complex, x: Real) -> Complex:
    """Vector times real number."""
    return complex(z.real * x, z.imag * x)


def imul(z: Complex, x: Real) -> Complex:
    """Vector turned by +90 degrees, times real number: ``i z x``."""
    return complex(-z.imag * x, z.real * x)


def expi(t: Real) -> Complex:
    """Unit vector at angle ``t`` [rad]; exact to an ulp at any size of ``t``."""
    return complex(math.cos(t), math.sin(t))


def hyp(z: Complex) -> Real:
    """Length of a vector, |z|."""
    return math.sqrt(z.real * z.real + z.imag * z.imag)


def sqrt(x: Real) -> Real:
    """Square root; NaN below zero, because kernels never raise."""
    return math.sqrt(x) if x >= 0.0 else NAN


def exp(x: Real) -> Real:
    """Exponential; infinite beyond the largest number."""
    return math.exp(x) if not x > LARGEST_EXPONENT else math.inf


def power(x: Real, y: Real) -> Real:
    """``x`` to the power ``y``; NaN below zero, infinite beyond the largest number."""
    try:
        return math.pow(x, y) if x >= 0.0 else NAN
    except (ArithmeticError, ValueError):
        return math.inf


def sign(x: Real) -> Real:
    """-1, 0 or +1; NaN for NaN."""
    return (x > 0.0) - (x < 0.0) if x == x else NAN


def where(condition: Real, a: Real, b: Real) -> Real:
    """``a`` where the condition holds, else ``b``."""
    return a if condition else b


def minimum(a: Real, b: Real) -> Real:
    """The smaller of two numbers; NaN if either is NaN."""
    return a if a < b or a != a else b


def maximum(a: Real, b: Real) -> Real:
    """The larger of two numbers; NaN if either is NaN."""
    return a if a > b or a != a else b


def angle(a: Complex, b: Complex) -> Real:
    """Angle [rad] from vector ``a`` to vector ``b``, in (-pi, pi]."""
    return math.atan2(cross(a, b) + 0.0, dot(a, b))  # + 0.0: never -pi from a negative zero


def modulo(x: Real, period: Real) -> Real:
    """``x`` less whole periods, in [0, period]; exact but for the last rounding."""
    if not math.isfinite(x):
        return NAN
    rest = math.fmod(x, period)
    return rest if rest >= 0.0 else rest + period


def piecewise(x: Real, knots: Reals, rows: Sequence[Reals]) -> Real:
    """A piecewise polynomial; NaN before the first and behind the last knot.

    ``rows[d][k]`` is the coefficient of the piece from ``knots[k]`` on, highest power of
    the distance from that knot first.
    """
    if not knots[0] <= x <= knots[-1]:
        return NAN
    k = min(bisect.bisect_right(knots, x), len(knots) - 1) - 1
    s, total = x - knots[k], rows[0][k]
    for row in rows[1:]:
        total = total * s + row[k]
    return total


def repeat(step: Callable[..., State], state: State, cap: int, *data: Nested) -> State:
    """``state = step(state, *data)`` while its last entry holds, at most ``cap`` times.

    ``state`` is a (nested) tuple of batches. Each sample stops by itself and is then left
    alone, so its answer never depends on the batch it came in.
    """
    for _ in range(cap):
        if not state[-1]:
            break
        state = step(state, *data)
    return state


def times(step: Callable[..., State], state: State, count: int, *data: Nested) -> State:
    """``state = step(state, *data)``, so many times for every sample."""
    for _ in range(count):
        state = step(state, *data)
    return state


def implicit(step: Kernel, state: State, *data: Nested) -> State:
    """``state``, at which a step of Newton's method stands still, as it is.

    An engine of derivatives takes this one step: it differentiates the equations that the
    state solves, not the way to it (`blockmech.engines.derivatives`).
    """
    return state


def each(function: Callable[..., float], *x: Real) -> Real:
    """``function(*x)`` for each sample, as Python numbers; for functions that are no kernels."""
    return function(*x)


def planar(x: Real, y: Real) -> Complex:
    """A planar vector from its components, in the engine's precision."""
    return complex(x, y)


def matrix(rows: Sequence[Reals]) -> Array:
    """A square matrix from rows of numbers; what the two functions below take."""
    import numpy as np

    return np.array(rows)


def solve(a: Array, right: Reals) -> tuple[Real, ...]:
    """Solution x of a x = right; not finite where the matrix is singular."""
    import numpy as np

    return tuple(np.linalg.solve(a, right).tolist())


def solve_transposed(a: Array, right: Reals) -> tuple[Real, ...]:
    """Solution x of a^T x = right."""
    import numpy as np

    return tuple(np.linalg.solve(a.T, right).tolist())


def spread(a: Array) -> Real:
    """Ratio of the smallest to the largest singular value; NaN of a matrix with a NaN in it."""
    import numpy as np

    if not np.isfinite(a).all():  # no reason to compute the sample again on arrays
        return NAN
    values = np.linalg.svd(a, compute_uv=False)
    return float(values[-1] / values[0])


SCALAR_PRIMITIVES = {n: f for n, f in vars().items() if isinstance(f, FunctionType)}
"""Name of each primitive and its meaning on Python numbers."""

SCALAR_CONSTANTS = {"ZERO": 0j, "ONE": 1 + 0j, "REST": REST_SHARE}
"""What programs name beside them: no vector, the unit one, and the share that counts as rest."""


def within_half_turn(angle: Real) -> Real:
    """Angles [rad] less whole turns; no primitive of kernels."""
    import numpy as np

    return angle - math.tau * np.rint(angle / math.tau)


def always(kernel: K) -> Callable[..., K]:
    """A method that answers the same kernel, whatever it is asked."""

    def method(declaring: object, *of: object) -> K:
        return kernel

    method.__doc__ = kernel.__doc__
    return method


# -- in the meaning of a design's numbers ---------------------------------------------------
#
# What a block, link or element computes from its fields holds for numbers and for any type
# with arithmetic: arrays of many designs, numbers that carry derivatives. Operators do most
# of it; what they do not say is a primitive in the meaning of its arguments' type. An engine
# that brings a type registers it: ``primitives_of.register(Dual, lambda x: {...})``.


def one_by_one(function: Callable[..., tuple[float, ...]], *x: Real) -> tuple[Real, ...]:
    """A function of numbers that knows no other type, e.g. of SciPy; it returns numbers."""
    return function(*x)


MEANINGS = {**SCALAR_PRIMITIVES, "one_by_one": one_by_one}


@functools.singledispatch
def primitives_of(x: object) -> Record:
    """The meaning of the primitives on numbers of the type of ``x``."""
    return MEANINGS


def has_arithmetic(x: object) -> bool:
    """Whether ``x`` is of a type, other than numbers, that stands for a design's numbers."""
    return primitives_of.dispatch(type(x)) is not primitives_of.dispatch(object)


def apply(primitive: str, *x: Real) -> Real:
    """A primitive of the plane on numbers of which some may be of another type."""
    design_number = next(filter(has_arithmetic, x), None)
    return primitives_of(design_number)[primitive](*x)


def largest(lengths: Iterable[float]) -> float:
    """The largest of some lengths >= 0; zero without any."""
    return functools.reduce(lambda a, b: apply("maximum", a, b), lengths, 0.0)
