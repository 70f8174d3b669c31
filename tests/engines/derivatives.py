"""Derivatives of a program by dual numbers, and by differences in 60 digits; of a document, too.

Both in random directions that change all numbers of the program at once; one direction tells
of every derivative in it.
"""

from __future__ import annotations

import random
from collections.abc import Mapping
from typing import Any

import mpmath
import numpy as np

import blockmech as bm
from blockmech.engines.derivatives import Dual, DualEngine
from blockmech.engines.numpy import Planar
from blockmech.ground.plane import EPS
from blockmech.mechanism import Mechanism
from tests.extremes.precise import DIGITS, Precise, moved

STEP = mpmath.mpf(10) ** -20  # its square is far below the 16 digits that are compared


def outputs(mechanism: Mechanism) -> list[str]:
    """Outputs that differ from sample to sample and have derivatives."""
    return [name for name, o in mechanism.outputs.items() if o.kind in ("real", "vector")]


def directions(nested: Any, dice: random.Random, m: int) -> Any:
    """The like of the numbers of a program with m random changes of each, of its own size."""
    if isinstance(nested, tuple):
        parts = [directions(x, dice, m) for x in nested]
        return type(nested)(*parts) if hasattr(nested, "_fields") else tuple(parts)
    size = abs(nested) or 1.0
    ways = [size * dice.uniform(-1.0, 1.0) for _ in range(m)]
    if isinstance(nested, complex):
        return [complex(x, size * dice.uniform(-1.0, 1.0)) for x in ways]
    return ways


def zipped(function: Any, nested: Any, ways: Any) -> Any:
    """A function of each number and its changes."""
    if isinstance(nested, tuple):
        parts = [zipped(function, x, w) for x, w in zip(nested, ways, strict=True)]
        return type(nested)(*parts) if hasattr(nested, "_fields") else tuple(parts)
    return function(nested, ways)


def seeded(x: Any, ways: list[Any]) -> Any:
    """A number as a dual one."""
    d = np.array(ways)[:, None]
    if isinstance(x, complex):
        return Planar(Dual(np.float64(x.real), d.real), Dual(np.float64(x.imag), d.imag))
    return Dual(np.float64(x), d)


def by_duals(precise: Precise, inputs: Mapping[str, Any], n: int, ways: Any, m: int) -> list[Any]:
    """Derivatives (m, n) of each value of the program."""
    program = precise.plan.program
    parameters = zipped(seeded, tuple(program.parameters.values()), ways)
    result = DualEngine(program).run(inputs, parameters, n, m)
    return [z.real.d + 1j * z.imag.d if isinstance(z, Planar) else z.d for z in result]


def by_differences(precise: Precise, inputs: Mapping[str, float], ways: Any, m: int) -> list[Any]:
    """Derivatives (m,) of each value of the program at one sample; NaN at a kink."""
    parameters = tuple(precise.plan.program.parameters.values())
    columns = []
    with mpmath.workdps(DIGITS):
        exact = moved(parameters, mpmath.mpf)

        def at(k: int, h: Any) -> tuple[Any, ...]:
            return precise.run(inputs, zipped(lambda x, w: x + h * w[k], exact, ways))

        for k in range(m):
            three = zip(*(at(k, h) for h in (-STEP, mpmath.mpf(0), STEP)), strict=True)
            columns.append([_smooth_slope(*values) for values in three])
    return [np.array(column) for column in zip(*columns, strict=True)]


def _smooth_slope(before: Any, middle: Any, after: Any) -> complex:
    left, right = complex((middle - before) / STEP), complex((after - middle) / STEP)
    noise = 10.0 ** (40 - DIGITS)  # of the values, over the step
    smooth = abs(right - left) <= 1e-12 * (abs(left) + abs(right)) + noise * abs(middle + 1)
    return (left + right) / 2 if smooth else complex(np.nan)


def _opposite(_: Any, ways: Any) -> Any:
    return [-w for w in ways]


def errors(mechanism: Mechanism, request: Mapping[str, Any], seed: int, m: int = 2) -> list[float]:
    """Errors of the derivatives of all outputs at all samples, but for kinks.

    Relative to the largest of the sample's derivatives of one unit over its smallest margin:
    rounding of the numbers alone does that to them.
    """
    want = outputs(mechanism)
    result = mechanism.run(**request, want=want, on_gap="mark")
    precise = Precise(mechanism, want, "newton")
    inputs = result.samples.given(precise.plan.program.inputs)
    numbers = tuple(precise.plan.program.parameters.values())
    ways = directions(numbers, random.Random(seed), m)
    columns = {k: np.asarray(x) for k, x in inputs.items()}
    duals = by_duals(precise, columns, result.n, ways, m)
    back = by_duals(precise, columns, result.n, zipped(_opposite, numbers, ways), m)
    relative = []
    for k in sorted(set(range(result.n)) - set(result.quality.gaps)):
        sample = {x: float(inputs[x][k]) for x in inputs}
        exact = by_differences(precise, sample, ways, m)
        precise_values = precise.run(sample, precise.plan.program.parameters.values())
        margin = min([1.0, *(float(x[k]) for x in result.quality.margin.values())])
        largest: dict[str, float] = {}
        parts = [
            (mechanism.outputs[x].unit.removesuffix("/rad").removesuffix("/m"), i)
            for x in want
            for i in precise.plan.layout[x]
        ]
        for unit, i in parts:
            both = np.append(exact[i], complex(precise_values[i]))
            largest[unit] = max(largest.get(unit, 0.0), np.nanmax(np.abs(both)))
        top = max(largest.values())
        for unit, i in parts:
            forward, backward = duals[i][:, k], -back[i][:, k]
            if np.abs(forward - backward).max() > np.sqrt(EPS) * np.abs(forward).max():
                continue  # a kink, or nearer to one than rounding of the numbers
            off = np.abs(forward - exact[i]).max()
            moves = largest[unit] > EPS * top  # else the whole unit is zero, by structure
            relative.append(float(off / (largest[unit] if moves else top or 1.0) * margin))
    return relative


EIGHTH = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}  # central differences, Fornberg 1988
EDGES = ("mass", "inertia", "damping", "free_length", "coefficient")  # which may not be negative


def of_document(linkage: bm.Linkage, request: Mapping[str, Any], step: float) -> float:
    """The largest error of derivatives by all numbers of a document at once.

    Against central differences of documents that are made, taken apart and run anew: of other
    structures, where places coincide by chance. Relative as `errors`. Outputs that jump or have
    a kink there are left out: differences across it are no derivative.
    """
    mechanism = linkage.compile()
    sensitivity = mechanism.sensitivity("*", **request, on_gap="mark")
    want = list(sensitivity)
    sizes: dict[str, float] = {}
    for p in sensitivity.parameters.values():
        sizes[p.unit] = max(abs(p.value), sizes.get(p.unit, 0.0))
    dice, ways = random.Random(7), {}
    for a, p in sensitivity.parameters.items():
        stays = p.value == 0.0 and any(word in a for word in EDGES)
        size = 0.0 if stays else abs(p.value) or 0.1 * sizes[p.unit] or 1.0
        ways[a] = size * dice.uniform(-1.0, 1.0)
    exact = dict.fromkeys(want, 0.0)
    for k, weight in EIGHTH.items():
        for h in (k * step, -k * step):
            moved = {a: p.value + h * ways[a] for a, p in sensitivity.parameters.items()}
            run = linkage.replace(moved).compile().run(**request, want=want, on_gap="mark")
            exact = {x: d + weight * k / h * run[x] for x, d in exact.items()}
    margin = min([1.0, *(x.min() for x in sensitivity.result.quality.margin.values())])
    largest: dict[str, float] = {}
    units = {x: mechanism.outputs[x].unit.removesuffix("/rad").removesuffix("/m") for x in want}
    for x, unit in units.items():
        size = max(np.abs(exact[x]).max(), np.abs(sensitivity.result[x]).max())
        largest[unit] = max(size, largest.get(unit, 0.0))
    noise = EPS / step * max(largest.values())  # of the differences: a unit below it is zero
    off = (
        np.abs(np.einsum("m,mn->n", list(ways.values()), sensitivity[x]) - exact[x]).max()
        / (largest[unit] if largest[unit] > noise else max(largest.values()))
        for x, unit in units.items()
        if not (sensitivity.jumps[x].any() or sensitivity.kinks(x).any())
    )
    return float(max(off) * margin)
