"""The primitives of the plane on enclosed numbers; see `blockmech.ground.plane`."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

from blockmech.engines.enclosed import duals, forms, rounding
from blockmech.engines.enclosed.duals import Dual, dual
from blockmech.engines.enclosed.forms import (
    Doubt,
    Enclosed,
    Form,
    between,
    form,
    planned,
    unknown,
)
from blockmech.engines.numpy import Planar
from blockmech.ground.plane import EPS, SCALAR_PRIMITIVES, cross, dot
from blockmech.typing import Real, Reals


def enclosed(x: Real) -> Real:
    """A number as an enclosed one."""
    return x if isinstance(x, Enclosed) else form(x)


def where(condition: bool | Doubt, a: Real, b: Real) -> Real:
    """See `blockmech.ground.plane.where`, and so on."""
    if not isinstance(condition, Doubt):
        return a if condition else b
    if isinstance(a, bool | Doubt) or isinstance(b, bool | Doubt):
        return a if a is b else Doubt(planned(a) if condition.at else planned(b))
    if isinstance(a, Dual) or isinstance(b, Dual):
        return duals.select(condition, dual(a), dual(b))
    return forms.either(condition, a, b)


def maximum(a: Real, b: Real) -> Real:
    """The larger of two numbers."""
    if isinstance(a, Dual) or isinstance(b, Dual):
        return duals.maximum(dual(a), dual(b))
    return forms.maximum(a, b)


def minimum(a: Real, b: Real) -> Real:
    """The smaller of two numbers."""
    return -maximum(-enclosed(a), -enclosed(b))


def sqrt(x: Real) -> Real:
    """The square root."""
    return enclosed(x).sqrt()


def exp(x: Real) -> Real:
    """The exponential."""
    return enclosed(x).exp()


def power(x: Real, y: Real) -> Real:
    """A power, between those of its bounds."""
    x, y = form(x), form(y)
    at = SCALAR_PRIMITIVES["power"](x.at, y.at)
    if not (y.exact and x.low >= 0.0 and x.high < math.inf):
        return unknown(at)
    low, high = sorted(rounding.power(bound, y.c) for bound in (x.low, x.high))
    return between(at, max(low * (1.0 - 8 * EPS), 0.0), high * (1.0 + 8 * EPS))


def expi(t: Real) -> Planar:
    """Unit vector at an angle."""
    return Planar(*enclosed(t).expi())


def hyp(z: Planar) -> Real:
    """Length of a vector."""
    return sqrt(z.real * z.real + z.imag * z.imag)


def planar(x: Real, y: Real) -> Planar:
    """A vector from its components."""
    return Planar(enclosed(x), enclosed(y))


def angle(a: Planar, b: Planar) -> Real:
    """Angle from a to b, in (-pi, pi]."""
    y, x = enclosed(cross(a, b)), enclosed(dot(a, b))
    if isinstance(y, Dual) or isinstance(x, Dual):
        return duals.arctangent(dual(y), dual(x))
    return forms.arctangent(y, x)


def modulo(x: Real, period: Real) -> Real:
    """x less whole periods; anything within a period where their number is in doubt."""
    x, period = form(x), form(period)
    at = SCALAR_PRIMITIVES["modulo"](x.at, period.at)
    if math.isfinite(x.at / period.at):
        rest: Form = x - period * float(math.floor(x.at / period.at))
        if rest.low >= 0.0 and rest.high <= period.low:
            return rest.planned_at(at)
    return between(at, 0.0, period.high)


def piecewise(x: Real, knots: Reals, rows: Sequence[Reals]) -> Real:
    """A piecewise polynomial: all values of the pieces in which x may be."""
    x, limits = form(x), [form(k) for k in knots]
    value = SCALAR_PRIMITIVES["piecewise"](x.at, planned(tuple(knots)), planned(tuple(rows)))
    values: list[Form] = []
    for k, (start, end) in enumerate(itertools.pairwise(limits)):
        if x.high < start.low or x.low > end.high or (x.low >= end.high and k < len(limits) - 2):
            continue
        within = x
        if x.low < start.low or x.high > end.high:
            within = Form(x.at, max(x.low, start.low), min(x.high, end.high))
        s, total = within - start, form(rows[0][k])
        for row in rows[1:]:
            total = total * s + row[k]
        values.append(total)
    if not values or not (limits[0].high <= x.low and x.high <= limits[-1].low):
        return unknown(value)
    if len(values) == 1:
        return values[0].planned_at(value)
    return between(value, min(y.low for y in values), max(y.high for y in values))
