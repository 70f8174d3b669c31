"""Batches of numbers and of motions, as the conformance suite compares and mixes them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blockmech.engines.numpy import Planar
from blockmech.testing.rig import DriveMotion, MarkerMotion, Motions

Array = NDArray[Any]
Leaves = Mapping[str, Array]


def leaves(value: Any, name: str = "") -> dict[str, Array]:
    """All numbers of a kernel's result by dotted name: complex or real arrays."""
    if isinstance(value, Planar):
        return {name: vectors(value)}
    if isinstance(value, tuple):
        names = getattr(value, "_fields", range(len(value)))
        return {
            k: x
            for n, v in zip(names, value, strict=True)
            for k, x in leaves(v, f"{name}.{n}" if name else str(n)).items()
        }
    return {name: np.asarray(value)}


def vectors(z: Any) -> Array:
    """Complex array of a batch of vectors."""
    found: Array = np.asarray(z.real) + 1j * np.asarray(z.imag)
    return found


def count(motions: Motions) -> int:
    """Number of samples."""
    return len(next(iter(vars(next(iter(motions.values()))).values())))


def finite(values: Leaves) -> NDArray[np.bool_]:
    """(n,) whether all values of a sample are finite."""
    masks = np.broadcast_arrays(*(np.isfinite(x) for x in values.values()))
    found: NDArray[np.bool_] = np.all(masks, axis=0)
    return found


def largest(values: Leaves) -> float:
    """Largest size of any number."""
    return max((float(np.max(abs(x))) for x in values.values()), default=0.0)


def same_bits(one: Any, other: Any) -> bool:
    """Whether two batches are the same to the last bit, after broadcasting."""
    a, b = np.broadcast_arrays(one, other)
    return bool(np.array_equal(a, b, equal_nan=True))


def identical(one: Leaves, other: Leaves) -> bool:
    """Whether all numbers are the same to the last bit."""
    return one.keys() == other.keys() and all(same_bits(one[k], other[k]) for k in one)


def at_sample(x: Array, k: int, n: int) -> Any:
    """The value at sample k of n."""
    return np.broadcast_to(x, (n,))[k]


def as_number(value: Any) -> Any:
    """A batch of one sample as Python numbers."""
    if isinstance(value, Planar):
        return complex(as_number(value.real), as_number(value.imag))
    if isinstance(value, tuple):
        parts = [as_number(x) for x in value]
        return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
    return float(np.asarray(value).ravel()[0])


def spoilt(value: Any, name: str = "") -> Iterator[tuple[Any, str]]:
    """The value with one of its numbers made NaN after the other, and which."""
    if isinstance(value, Planar):
        nan = np.full(np.shape(value.real), np.nan)
        yield Planar(nan, nan), name
    elif isinstance(value, tuple):
        for field, part in value._asdict().items():  # type: ignore[attr-defined]
            for bad, what in spoilt(part, field):
                yield value._replace(**{field: bad}), what  # type: ignore[attr-defined]
    else:
        yield np.full(np.shape(value), np.nan), name


def combined(one: Motions, two: Motions, x: float, y: float) -> Motions:
    """Places of the first; rates x times those of the first plus y times those of the other."""
    found: dict[str, MarkerMotion | DriveMotion] = {}
    for name, m in one.items():
        k = two[name]
        if isinstance(m, MarkerMotion) and isinstance(k, MarkerMotion):
            rates = (x * a + y * b for a, b in ((m.v, k.v), (m.om, k.om), (m.a, k.a), (m.al, k.al)))
            found[name] = MarkerMotion(m.p, m.phi, *rates)
        elif isinstance(m, DriveMotion) and isinstance(k, DriveMotion):
            found[name] = DriveMotion(m.q, x * m.qd + y * k.qd, x * m.qdd + y * k.qdd)
    return found


def halfway(one: Motions, two: Motions) -> Motions:
    """The motions between two, sample by sample."""
    return _mapped(lambda a, b: (a + b) / 2, one, two)


def chosen(condition: Array, one: Motions, two: Motions) -> Motions:
    """Samples of the first where the condition holds, else of the second."""
    return _mapped(lambda a, b: np.where(condition, a, b), one, two)


def joined(parts: Sequence[Motions]) -> Motions:
    """Samples of all parts, one after the other."""
    return _mapped(lambda *x: np.concatenate(x), *parts)


def _mapped(function: Any, *parts: Motions) -> Motions:
    return {
        name: type(m)(
            *(function(*x) for x in zip(*(vars(p[name]).values() for p in parts), strict=True))
        )
        for name, m in parts[0].items()
    }
