"""Derivatives of a program by dual numbers, and by differences in 60 digits.

Both in random directions that change all numbers of the program at once; one direction tells
of every derivative in it.
"""

from __future__ import annotations

import random
from collections.abc import Mapping
from typing import Any

import mpmath
import numpy as np

from blockmech.engines.dual import Dual, DualEngine
from blockmech.engines.numpy import Planar
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
    found = DualEngine(program).run(inputs, parameters, n, m)
    return [z.real.d + 1j * z.imag.d if isinstance(z, Planar) else z.d for z in found]


def by_differences(precise: Precise, inputs: Mapping[str, float], ways: Any, m: int) -> list[Any]:
    """Derivatives (m,) of each value of the program at one sample, from 60 digits."""
    parameters = tuple(precise.plan.program.parameters.values())
    found = []
    with mpmath.workdps(DIGITS):
        exact = moved(parameters, mpmath.mpf)
        for k in range(m):
            ahead, behind = (
                precise.run(inputs, zipped(lambda x, w, h=h: x + h * w[k], exact, ways))
                for h in (STEP, -STEP)
            )
            pairs = zip(ahead, behind, strict=True)
            found.append([complex((a - b) / (2 * STEP)) for a, b in pairs])
    return [np.array(column) for column in zip(*found, strict=True)]


def errors(
    mechanism: Mechanism, request: Mapping[str, Any], seed: int, m: int = 2
) -> dict[str, float]:
    """Output -> largest error of its derivatives over the samples.

    Relative to the largest of the derivatives and of the value itself over the sample's
    smallest margin, which is what rounding of the numbers alone does to it.
    """
    want = outputs(mechanism)
    result = mechanism.run(**request, want=want, on_gap="mark")
    precise = Precise(mechanism, want, "newton")
    inputs = result.samples.given(precise.plan.program.inputs)
    ways = directions(tuple(precise.plan.program.parameters.values()), random.Random(seed), m)
    duals = by_duals(precise, inputs, result.n, ways, m)
    worst = dict.fromkeys(want, 0.0)
    for k in range(result.n):
        if k in result.quality.gaps:
            continue
        one = {name: float(np.broadcast_to(x, result.n)[k]) for name, x in inputs.items()}
        exact = by_differences(precise, one, ways, m)
        margin = min([1.0, *(float(x[k]) for x in result.quality.margin.values())])
        for name in want:
            for i in precise.plan.layout[name]:
                size = max(np.abs(exact[i]).max(), abs(result[name][k]))
                off = np.abs(duals[i][:, k] - exact[i]).max()
                error = off / size * margin if size else off
                worst[name] = max(worst[name], float(error)) if error == error else np.nan
    return worst
