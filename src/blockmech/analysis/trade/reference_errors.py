"""The error of a run: one number, relative, against a reference at the same samples."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blockmech.result import Result

Array = NDArray[Any]
DOUBLE = float(np.finfo(np.float64).eps)
LONG = float(np.finfo(np.longdouble).eps)
WIDER = LONG < DOUBLE
MOST_ITERATIONS = 6  # successive ones: beyond, Newton's method is cheaper
SMALL = 1e-9  # outputs this much smaller than others of their unit are measured by those
NATURAL = {
    "rad/s2": ("rad/s", "rad/s"),
    "m/s2": ("m/s", "rad/s"),
    "kg m2/rad": ("kg m2",),
    "W": ("N m", "rad/s"),
}
UNSURE = 1e-3  # disagreement of the references above which an output has no sure value


@dataclass(frozen=True)
class ReferenceErrors:
    """Reference values of the compared outputs, and what errors are relative to.

    Attributes
    ----------
    values : output -> array of the reference, in its precision
    scale : output -> its unit of error: 1 for angles, else the largest magnitude
    good : (n,) samples that are compared
    left_out : outputs without a sure value
    """

    values: Mapping[str, Array]
    scale: Mapping[str, float]
    good: NDArray[np.bool_]
    left_out: tuple[str, ...] = ()

    def each(self, result: Any) -> dict[str, Array]:
        """Relative errors (n,) of every compared output; infinite where it has no answer."""
        return {
            name: _off(_read(result, name), values, _turns(result, name)) / self.scale[name]
            for name, values in self.values.items()
        }

    def without(self, names: tuple[str, ...]) -> ReferenceErrors:
        """The same for fewer outputs."""
        values = {n: v for n, v in self.values.items() if n not in names}
        return replace(self, values=values, left_out=names)

    def error(self, result: Any) -> float:
        """The largest relative error over the compared outputs and samples."""
        return max(
            (float(np.max(e[self.good] if len(e) == len(self.good) else e, initial=0.0))
             for e in self.each(result).values()),
            default=0.0,
        )  # fmt: skip


def reference_errors(
    reference: Result,
    check: Any,
    good: NDArray[np.bool_],
    unsure: float = UNSURE,
) -> ReferenceErrors:
    """The errors against what two runs agree on.

    Parameters
    ----------
    reference, check : runs of the same samples, or what reads like one
    good : (n,) samples that are compared
    unsure : disagreement from which an output is left out
    """
    values = {n: _read(reference, n) for n in compared(reference)}
    sizes = {n: float(_top(v, good)) for n, v in values.items()}
    by_unit = _unit_sizes(reference, sizes)
    scale, left_out, kept = {}, [], {}
    for name, value in values.items():
        angular = _is_angle(reference, name)
        largest = by_unit[reference.unit(name)]
        size = sizes[name] if sizes[name] > SMALL * largest else largest
        scale[name] = 1.0 if angular else size or 1.0
        gap = _off(_read(check, name), value, _turns(reference, name))
        gap = gap[good] if len(gap) == len(good) else gap
        if float(np.max(gap, initial=0.0)) / scale[name] < unsure:
            kept[name] = value
        else:
            left_out.append(name)
    return ReferenceErrors(kept, scale, good, tuple(left_out))


def compared(result: Any) -> list[str]:
    """Outputs whose errors count.

    Ratios that have poles, and those of a whole run, count only where nothing else is
    wanted: over a cycle without net work they are zero over zero.
    """
    names = [n for n in result if result.output(n).kind != "matrix"]
    return [n for n in names if not ratio(result, n)] or names


def ratio(result: Any, name: str) -> bool:
    """Whether an output divides by something that may vanish."""
    whole: bool = result.output(name).kind == "number"
    return whole or name.endswith("mechanical_advantage")


def _unit_sizes(reference: Result, sizes: Mapping[str, float]) -> dict[str, float]:
    """Largest magnitude of each unit.

    An acceleration that is zero throughout is not measured by its own rounding but by
    the square of the rates, a slope of the inertia by the inertia, a power likewise.
    """
    rates = [float(np.max(np.abs(v))) for k, v in reference.samples.inputs.items()
             if k.startswith("qd_")]  # fmt: skip
    found: dict[str, float] = {"rad/s": max(rates, default=0.0)}
    for name, size in sizes.items():
        unit = reference.unit(name)
        found[unit] = max(found.get(unit, 0.0), size)
    for unit, factors in NATURAL.items():
        product = float(np.prod([found.get(f, 0.0) for f in factors]))
        found[unit] = max(found.get(unit, 0.0), product)
    return found


def comparable(result: Result, friction: bool) -> NDArray[np.bool_]:
    """(n,) samples with a sure answer: not at a dead centre, no friction between two signs."""
    good = np.array([word == "ok" for word in result.quality.status], dtype=bool)
    unsure = ["dead-centre", "near-dead-centre", "change-point", "near-change-point"]
    unsure += ["zero-relative-speed"] * friction
    good[[f.sample for f in result.quality.flags if f.code in unsure]] = False
    return good


def _read(result: Any, name: str) -> Array:
    return np.atleast_1d(np.asarray(result[name]))


def _is_angle(result: Any, name: str) -> bool:
    output = result.output(name)
    return bool(output.unit == "rad" and output.kind == "real")


def _turns(result: Any, name: str) -> bool:
    """Whether an output is an angle that is known up to whole turns."""
    return _is_angle(result, name) and not name.endswith(".q")


def _off(found: Array, wanted: Array, angular: bool) -> Array:
    with np.errstate(invalid="ignore"):
        gap = found - wanted
        if angular:
            turn = 8 * np.arctan(np.ones((), gap.dtype))
            gap = gap - turn * np.round(gap / turn)
        size = np.abs(gap)
    size = np.where(np.isfinite(size), size, np.inf)
    return np.where(~np.isfinite(found) & ~np.isfinite(wanted), 0.0, size)


def _top(values: Array, good: NDArray[np.bool_]) -> Any:
    part = np.abs(values[good] if len(values) == len(good) else values)
    return np.max(part[np.isfinite(part)], initial=0.0)
