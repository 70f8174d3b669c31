"""The error of a run: one number, relative, against a reference at the same samples."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blockmech.result import Result

Array = NDArray[Any]
SMALL = 1e-9  # outputs this much smaller than others of their unit are measured by those
UNSURE = 1e-3  # disagreement of the references above which an output has no sure value


@dataclass(frozen=True)
class Yardstick:
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

    def each(self, result: Result) -> dict[str, Array]:
        """Relative errors (n,) of every compared output; infinite where it has no answer."""
        return {
            name: _off(_read(result, name), values, _is_angle(result, name)) / self.scale[name]
            for name, values in self.values.items()
        }

    def error(self, result: Result) -> float:
        """The largest relative error over the compared outputs and samples."""
        return max(
            (float(np.max(e[self.good] if len(e) == len(self.good) else e, initial=0.0))
             for e in self.each(result).values()),
            default=0.0,
        )  # fmt: skip


def yardstick(reference: Result, check: Result, angle: Any, good: NDArray[np.bool_]) -> Yardstick:
    """The yardstick that two runs agree on; ``check`` is of the mechanism turned by an angle."""
    values = {n: _read(reference, n) for n in reference if reference.output(n).kind != "matrix"}
    sizes = {n: float(_top(v, good)) for n, v in values.items()}
    by_unit: dict[str, float] = {}
    for name, size in sizes.items():
        unit = reference.unit(name)
        by_unit[unit] = max(by_unit.get(unit, 0.0), size)
    scale, left_out, kept = {}, [], {}
    for name, value in values.items():
        angular = _is_angle(reference, name)
        largest = by_unit[reference.unit(name)]
        size = sizes[name] if sizes[name] > SMALL * largest else largest
        scale[name] = 1.0 if angular else size or 1.0
        other = turned_back(check, name, angle)
        gap = _off(other, value, angular)
        gap = gap[good] if len(gap) == len(good) else gap
        if float(np.max(gap, initial=0.0)) / scale[name] < UNSURE:
            kept[name] = value
        else:
            left_out.append(name)
    return Yardstick(kept, scale, good, tuple(left_out))


def turned_back(check: Result, name: str, angle: Any) -> Array:
    """An output of a turned mechanism, turned back."""
    values = _read(check, name)
    if check.output(name).kind == "vector":
        real = values.real.dtype.type
        return np.asarray(values * (np.cos(real(angle)) - 1j * np.sin(real(angle))))
    if name.endswith(".angle"):
        return np.asarray(values - angle)
    return values


class TurnedBack(Mapping[str, Any]):
    """A run of a turned mechanism, read as if it had not been turned."""

    def __init__(self, check: Result, angle: Any) -> None:
        self.check, self.angle = check, angle

    def __getitem__(self, name: str) -> Any:
        return turned_back(self.check, name, self.angle)

    def __iter__(self) -> Any:
        return iter(self.check)

    def __len__(self) -> int:
        return len(self.check)

    def output(self, name: str) -> Any:
        """Declaration of an output."""
        return self.check.output(name)


def _read(result: Any, name: str) -> Array:
    return np.atleast_1d(np.asarray(result[name]))


def _is_angle(result: Any, name: str) -> bool:
    output = result.output(name)
    return bool(output.unit == "rad" and output.kind == "real")


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
