"""The engine of JAX: a program as a pure function that JAX compiles and differentiates.

Loops run on values, and no derivative goes through them: a step of Newton's method at their end
differentiates the equations that they solved (`blockmech.ground.plane.implicit`), to any order.

Source: Griewank & Walther, Evaluating Derivatives, 2nd ed., SIAM 2008, ch. 15 (implicit
functions).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from functools import cache, partial
from typing import Any, NoReturn

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.extend.core import Primitive
from jax.interpreters import ad, batching, mlir
from jax.tree_util import PyTreeDef
from numpy.typing import DTypeLike

from blockmech.engines import arrays
from blockmech.engines.derivatives import underivable
from blockmech.engines.numpy import Planar, leaves
from blockmech.engines.numpy import each as each_of
from blockmech.engines.trace import answer_of, filled
from blockmech.ground.plane import cross, dot, primitives_of
from blockmech.plan.plan import Program
from blockmech.typing import Array, Kernel, Nested, Real, Reals, Record, Values

jax.tree_util.register_pytree_node(
    Planar, lambda z: ((z.real, z.imag), None), lambda _, parts: Planar(*parts)
)

# The identity, whose transpose leaves out what is no number: samples without an answer do not
# count in a gradient by a number that all samples share.
guard = Primitive("guard")
guard.def_impl(lambda x: x)
guard.def_abstract_eval(lambda x: x)
ad.deflinear2(guard, lambda change, _: [jnp.where(jnp.isfinite(change), change, 0.0)])
batching.defvectorized(guard)
mlir.register_lowering(guard, lambda context, x: [x])


def is_array(x: object) -> bool:
    """Whether a leaf of a tree is a batch of numbers that may vary."""
    return isinstance(x, jax.Array | np.ndarray) and jnp.issubdtype(x.dtype, jnp.floating)


def by_value(nested: Nested) -> Nested:
    """The same numbers, without their derivatives."""
    return jax.tree.map(lambda x: lax.stop_gradient(x) if is_array(x) else x, nested)


def shape_of(nested: Nested) -> tuple[int, ...]:
    """The shape to which the batches in a tree broadcast."""
    batches = (x for x in jax.tree.leaves(nested) if isinstance(x, jax.Array | np.ndarray))
    return np.broadcast_shapes((), *map(np.shape, batches))


def implicit(step: Kernel, state: Values, *data: Nested) -> Nested:
    """See `blockmech.ground.plane.implicit`: the step's derivative by the data is the state's.

    By the state itself it has none wherever the state solves the equations, so this holds for
    derivatives of derivatives too.
    """
    parts, form = jax.tree.flatten((by_value(state), data))
    numbers = [i for i, x in enumerate(parts) if is_array(x)]
    of_state = [i for i in numbers if i < len(jax.tree.leaves(state))]
    k, shape = len(of_state), shape_of(parts)

    def unflattened(x: Sequence[jax.Array]) -> Nested:
        filled_ = dict(enumerate(parts)) | dict(zip(numbers, x, strict=True))
        return jax.tree.unflatten(form, filled_.values())

    def rule(x: Sequence[jax.Array], changes: Sequence[jax.Array]) -> tuple[Nested, Nested]:
        solution = solved(*x)

        def stepped(*parameters: jax.Array) -> tuple[jax.Array, ...]:
            state, data = unflattened((*solution, *parameters))
            new = jax.tree.leaves(step(state, *data))
            return tuple(jnp.broadcast_to(new[i], shape) for i in of_state)

        return solution, jax.jvp(stepped, x[k:], changes[k:])[1]

    solved = jax.custom_jvp(lambda *x: x[:k])
    solved.defjvp(rule)
    wide = (jnp.broadcast_to(parts[i], shape) if i in of_state else parts[i] for i in numbers)
    inputs = tuple(wide)
    return unflattened((*solved(*inputs), *inputs[k:]))[0]


def uniform(
    step: Kernel, state: Values, data: Values, dtype: DTypeLike
) -> tuple[list[jax.Array], Kernel, PyTreeDef]:
    """A loop's first state, its step and its form: of shapes and types that stay the same."""
    shape, form = shape_of((state, data)), jax.tree.structure(state)

    def same(parts: Iterable[jax.Array]) -> list[jax.Array]:
        both = zip(parts, types, strict=True)
        return [jnp.broadcast_to(jnp.asarray(x, kind), shape) for x, kind in both]

    first = jax.tree.leaves(state)
    types = [bool if jnp.isdtype(jnp.result_type(x), "bool") else dtype for x in first]

    def following(parts: Sequence[jax.Array]) -> list[jax.Array]:
        return same(jax.tree.leaves(step(jax.tree.unflatten(form, parts), *data)))

    return same(first), following, form


def called(function: Callable[..., Nested], x: Values, like: Nested, dtype: DTypeLike) -> Nested:
    """What a function of Python says, asked while the compiled program runs."""
    numbers, form = jax.tree.flatten(x)
    kind = jax.ShapeDtypeStruct(np.broadcast_shapes(*map(np.shape, numbers)), dtype)

    def answer(*x: jax.Array) -> tuple[Array, ...]:
        doubles = [np.asarray(a, np.float64) for a in x]
        y = leaves(function(*jax.tree.unflatten(form, doubles)))
        shape = np.broadcast(*doubles).shape
        return tuple(np.array(np.broadcast_to(column, shape), dtype) for column in y)

    columns = (jnp.broadcast_to(a, kind.shape) for a in numbers)
    count = len(leaves(like))
    values = jax.pure_callback(answer, (kind,) * count, *columns, vmap_method="broadcast_all")
    return filled(like, iter(values).__next__)


@cache
def primitives(dtype: Any) -> Record:
    """The primitives of the plane on JAX's arrays of one precision, with their derivatives."""
    standard = arrays.primitives(jnp, dtype)
    where = standard["where"]

    def sqrt(x: Real) -> Real:
        good = x > 0.0
        return where(good, jnp.sqrt(where(good, x, 1.0)), where(x == 0.0, 0.0, math.nan))

    def hyp(z: Planar) -> Real:
        return sqrt(z.real * z.real + z.imag * z.imag)

    def hypot(x: Real, y: Real) -> Real:
        return hyp(Planar(x, y))

    def power(x: Real, y: Real) -> Real:
        good = x > 0.0
        at_zero = jnp.power(where(x == 0.0, 0.0, math.nan), lax.stop_gradient(y))
        return where(good, jnp.power(where(good, x, 1.0), y), at_zero)

    def angle(a: Planar, b: Planar) -> Real:
        y, x = cross(a, b) + 0.0, dot(a, b)
        none = (x == 0.0) & (y == 0.0)
        return where(none, 0.0, jnp.arctan2(y, where(none, 1.0, x)))

    def piecewise(x: Real, knots: Reals, rows: Sequence[Reals]) -> Real:
        return guard.bind(standard["piecewise"](x, knots, rows))

    def repeat(step: Kernel, state: Values, cap: int, *data: Nested) -> Nested:
        state, data = by_value((state, data))
        first, following, form = uniform(step, state, data, dtype)

        def stepped(at: tuple[int, list[jax.Array]]) -> tuple[int, list[jax.Array]]:
            new = following(at[1])
            return at[0] + 1, [jnp.where(at[1][-1], *x) for x in zip(new, at[1], strict=True)]

        def going(at: tuple[int, list[jax.Array]]) -> Real:
            return (at[0] < cap) & jnp.any(at[1][-1])

        start = (0, first)
        _, last = stepped(start) if cap == 1 else lax.while_loop(going, stepped, start)
        return jax.tree.unflatten(form, last)

    def times(step: Kernel, state: Nested, count: int, *data: Nested) -> Nested:
        first, following, form = uniform(step, state, data, dtype)
        return jax.tree.unflatten(form, lax.fori_loop(0, count, lambda _, s: following(s), first))

    def each(function: Callable[..., float], *x: Real) -> Real:
        def refuse(x: Sequence[Real], changes: Sequence[Real]) -> NoReturn:
            raise underivable(function)

        answer = jax.custom_jvp(lambda *x: called(partial(each_of, function), x, 0.0, dtype))
        answer.defjvp(refuse)
        return answer(*x)

    functions = (sqrt, hyp, hypot, power, angle, piecewise, repeat, times, implicit, each)
    return {**standard, **{f.__name__: f for f in functions}}


def _of_design(x: jax.Array) -> Record:
    return primitives(jnp.result_type(x.dtype, float))  # of a truth value, the usual ones


for kind in (jax.core.Tracer, type(jnp.zeros(()))):
    primitives_of.register(kind, _of_design)


class JaxEngine(arrays.ArrayEngine):
    """A program bound to JAX's arrays, of double or single precision."""

    name = "jax"

    def __init__(self, program: Program, dtype: DTypeLike) -> None:
        super().__init__(program, jnp, jnp.dtype(dtype))

    def primitives(self) -> Record:
        """The primitives of the plane on these arrays."""
        return primitives(self.dtype)

    def foreign(self, function: Callable[..., Nested]) -> Callable[..., Nested]:
        """The guess of a group's pose, asked by value."""

        def answer(*x: Nested) -> Nested:
            return called(function, by_value(x), answer_of(function, x), self.dtype)

        return answer

    def run(self, inputs: Record, parameters: Values) -> Values:
        """See `arrays.ArrayEngine`; a gradient leaves out samples at which it is no number."""
        columns = {name: jnp.asarray(inputs[name]) for name in self.program.inputs}
        shape = shape_of(columns)

        def guarded(x: Real) -> Real:
            return guard.bind(jnp.broadcast_to(x, shape)) if np.ndim(x) == 0 else x

        slots = jax.tree.map(guarded, self._slots(parameters))
        return self._program(*map(guarded, columns.values()), slots)
