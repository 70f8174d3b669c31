"""Sensitivities as they are read: by output and number, ranked, as text, JSON and CSV.

`blockmech.studies.differentiate` makes them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from blockmech.errors import NotComputedError, Problem, close_match, listed
from blockmech.export import Column, aligned, csv_of
from blockmech.export.columns import AnyPath, driver_columns
from blockmech.model.parameters import Parameter
from blockmech.plane import EPS
from blockmech.result import Result

Array = NDArray[Any]
SHOWN = 12  # numbers of a ranking that are shown
PERCENT = 0.01  # of a number's size: the change by which numbers are ranked


class Effect(NamedTuple):
    """What one number does to one output.

    Attributes
    ----------
    parameter : the number
    derivative : the largest over the samples, complex x + iy of a vector
    unit : of the derivative
    sample : where that is
    change : of the output by a hundredth of the number's size, which is its own, or of a
        zero the largest of its unit (1 where that is not known)
    """

    parameter: Parameter
    derivative: Any
    unit: str
    sample: int
    change: float


@dataclass(frozen=True)
class Sensitivity(Mapping[str, Array]):
    """Derivatives of outputs: ``s["crank.drive"]`` is (m, n), by numbers and samples.

    ``s["crank.drive", "dyad.l_i"]`` is (n,), complex x + iy for vectors, NaN where a sample
    has no answer.

    Attributes
    ----------
    result : the run whose outputs they are of
    parameters : address -> the number, m of them
    ahead, behind : output -> derivatives (m, n) for growing and for shrinking numbers; they
        differ at kinks
    left_out : address -> why it has no derivative
    """

    result: Result
    parameters: Mapping[str, Parameter]
    ahead: Mapping[str, Array]
    behind: Mapping[str, Array]
    left_out: Mapping[str, str]

    def __getitem__(self, name: Any) -> Array:
        output, *address = (name,) if isinstance(name, str) else name
        asked = ((output, self.ahead), *((x, self.parameters) for x in address))
        for x, known in asked:
            if x not in known:
                found, valid = "it was not asked for", f"there: {listed(known, 16)}"
                remedy = close_match(x, known)
                raise NotComputedError(Problem("not-wanted", x, found, valid, remedy))
        whole = self.ahead[output]
        found_: Array = whole[list(self.parameters).index(address[0])] if address else whole
        return found_

    def __iter__(self) -> Iterator[str]:
        return iter(self.ahead)

    def __len__(self) -> int:
        return len(self.ahead)

    def unit(self, output: str, address: str) -> str:
        """Unit of a derivative."""
        above, below = self.result.unit(output), self.parameters[address].unit
        return f"{above or '1'}/{below if below.isalnum() else f'({below})'}" if below else above

    def kinks(self, output: str) -> Array:
        """Whether (m, n) the derivatives of the two sides differ, by more than half the digits."""
        a, b = self.ahead[output], self.behind[output]
        size = np.nanmax(np.abs(a), axis=1, initial=0.0, keepdims=True)
        return np.asarray(np.abs(a - b) > np.sqrt(EPS) * size)

    def ranked(self, output: str) -> list[Effect]:
        """The numbers by what a hundredth of them does to an output at most, largest first."""
        whole, found = self[output], []
        for (address, p), row in zip(self.parameters.items(), whole, strict=True):
            k = int(np.nanargmax(np.abs(row))) if np.isfinite(row).any() else 0
            change = float(abs(row[k])) * PERCENT * self._size(p)
            found.append(Effect(p, row[k], self.unit(output, address), k, change))
        return sorted(found, key=lambda e: (-np.nan_to_num(e.change), e.parameter.address))

    def _size(self, p: Parameter) -> float:
        alike = (abs(x.value) for x in self.parameters.values() if x.unit == p.unit != "")
        return abs(p.value) or max(alike, default=0.0) or 1.0

    # -- shown ------------------------------------------------------------------------

    def text(self, shown: int = SHOWN) -> str:
        """For each output a table of its numbers, ranked."""
        return "\n\n".join("\n".join(self._table(output, shown)) for output in self)

    def __repr__(self) -> str:
        return self.text()

    def _table(self, output: str, shown: int) -> Iterator[str]:
        unit, effects = self.result.unit(output), self.ranked(output)
        rows = [
            (
                e.parameter.address,
                f"{e.parameter.value:.6g} {e.parameter.unit}".rstrip(),
                f"{_shown(e.derivative)} {e.unit}".rstrip(),
                f"{e.change:.3g}",
            )
            for e in effects[:shown]
        ]
        yield f"{output} [{unit or '-'}]"
        yield from aligned(("number", "value", "largest derivative", "by 1 %"), rows)
        if len(effects) > shown:
            yield f"and {len(effects) - shown} numbers that do less"
        kinks = int(self.kinks(output).any(axis=0).sum())
        if kinks:
            yield f"one-sided at {kinks} of {self.result.n} samples: the output has a kink there"
        if self.left_out:
            yield f"without a derivative: {listed(self.left_out, 4)}"

    def to_dict(self) -> dict[str, Any]:
        """The rankings as JSON data."""
        return {
            "sensitivity": {
                output: [
                    {
                        "number": e.parameter.address,
                        "value": e.parameter.value,
                        "derivative": _parts(e.derivative),
                        "unit": e.unit,
                        "sample": e.sample,
                        "change": e.change,
                    }
                    for e in self.ranked(output)
                ]
                for output in self
            },
            "left_out": dict(self.left_out),
        }

    def to_csv(self, path: AnyPath | None = None) -> str:
        """CSV text: a row an output (component) and sample, a column a number, units in the head.

        Written if a path is given. Raises `RequestError` where the place cannot be written.
        """
        drivers = driver_columns(self.result, False)
        heads = [Column(a, p.unit, np.empty(0), a).head for a, p in self.parameters.items()]
        rows = (
            [name, self.result.unit(name), *(c.values[k] for c in drivers), *row]
            for name, whole in self._real()
            for k, row in enumerate(whole.T.tolist())
        )
        head = ["output", "unit", *(c.head for c in drivers), *(f"per {h}" for h in heads)]
        return csv_of(head, rows, path)

    def _real(self) -> Iterator[tuple[str, Array]]:
        for name, whole in self.ahead.items():
            if np.iscomplexobj(whole):
                yield f"{name}.x", whole.real
                yield f"{name}.y", whole.imag
            else:
                yield name, whole


def _parts(x: Any) -> Any:
    return [x.real, x.imag] if isinstance(x, complex) else float(x)


def _shown(x: Any) -> str:
    return f"({x.real:.4g}, {x.imag:.4g})" if isinstance(x, complex) else f"{x:.6g}"
