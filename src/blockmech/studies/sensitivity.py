"""Sensitivities as they are read: by output and number, ranked, as text, JSON and CSV.

`blockmech.studies.differentiate` makes them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from blockmech.figures import palette as ink
from blockmech.figures.panels import THICK
from blockmech.figures.paper import Pictured, panelled, scaled_unit, shown_name
from blockmech.ground.errors import held, listed
from blockmech.ground.plane import EPS
from blockmech.ground.report import LINES, as_json, sections
from blockmech.model.parameters import Parameter
from blockmech.result.columns import Column, components, driver_columns
from blockmech.result.result import Result
from blockmech.result.spreadsheet import CsvTable
from blockmech.result.tables import aligned, counted, flag_lines
from blockmech.studies.reductions import POSES, Wanted
from blockmech.typing import Arguments, Array, Data, Real

if TYPE_CHECKING:
    from matplotlib.axes import Axes

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
    derivative: Array
    unit: str
    sample: int
    change: float


@dataclass(frozen=True, repr=False)
class Sensitivity(CsvTable, Pictured, Mapping[str, Array]):
    """Derivatives of outputs: ``s["crank.drive"]`` is (m, n), by numbers and samples.

    ``s["crank.drive", "dyad.l_i"]`` is (n,), complex x + iy for vectors, NaN where a sample
    has no answer.

    Attributes
    ----------
    result : the run of the outputs
    parameters : address -> the number, m of them
    ahead, behind : output -> derivatives (m, n) for rising and for falling numbers; they differ at
        kinks
    jumps : output -> whether (m, n) a number starts the slip of a pair at rest, so that its
        friction jumps; the derivative then leaves the jump out
    left_out : address of a number, or output -> why it has no derivative
    reduced : reduction -> its definition and value; its derivatives are (m, 1)
    """

    result: Result
    parameters: Mapping[str, Parameter]
    ahead: Mapping[str, Array]
    behind: Mapping[str, Array]
    jumps: Mapping[str, Array]
    left_out: Mapping[str, str]
    reduced: Mapping[str, tuple[Wanted, Array]] = field(default_factory=dict)

    def __getitem__(self, name: Any) -> Array:
        output, *address = (name,) if isinstance(name, str) else name
        derivatives = held(self.ahead, output, "it was not asked for", "there")
        for x in address:
            held(self.parameters, x, "it was not asked for", "there")
            derivatives = derivatives[list(self.parameters).index(x)]
        return derivatives

    def __iter__(self) -> Iterator[str]:
        return iter(self.ahead)

    def __len__(self) -> int:
        return len(self.ahead)

    def one_number(self, output: str) -> bool:
        """Whether it is a reduction to one number, not an output at every sample."""
        return output in self.reduced and self.reduced[output][0].how != POSES

    def value(self, output: str) -> Array:
        """An output (n,) of the run, or a reduction of it, an array of one."""
        return (
            self.reduced[output][1] if output in self.reduced else np.asarray(self.result[output])
        )

    def unit_of(self, output: str) -> str:
        """Unit of an output or a reduction."""
        return self.reduced[output][0].unit if output in self.reduced else self.result.unit(output)

    def unit(self, output: str, address: str) -> str:
        """Unit of a derivative."""
        above, below = self.unit_of(output), self.parameters[address].unit
        return f"{above or '1'}/{below if below.isalnum() else f'({below})'}" if below else above

    def kinks(self, output: str) -> Array:
        """Whether (m, n) the derivatives of the two sides differ, by more than half the digits."""
        a, b = self[output], self.behind[output]
        size = np.nanmax(np.abs(a), axis=1, initial=0.0, keepdims=True)
        return np.asarray(np.abs(a - b) > np.sqrt(EPS) * size)

    def ranked(self, output: str) -> list[Effect]:
        """The numbers ranked by the largest effect of one percent of each on an output."""
        derivatives, effects = self[output], []
        for (address, p), row in zip(self.parameters.items(), derivatives, strict=True):
            k = int(np.nanargmax(np.abs(row))) if np.isfinite(row).any() else 0
            change = float(abs(row[k])) * PERCENT * size_of(p, self.parameters.values())
            effects.append(Effect(p, row[k], self.unit(output, address), k, change))
        return sorted(effects, key=lambda e: (-np.nan_to_num(e.change), e.parameter.address))

    def doubts(self, output: str) -> Iterator[str]:
        """Places where an output has only one-sided derivatives, in words."""
        n = counted(1 if self.one_number(output) else self.result.n, "sample")
        if kinks := int(self.kinks(output).any(axis=0).sum()):
            yield f"one-sided at {kinks} of {n}: the output has a kink there"
        if jumps := int(self.jumps[output].any(axis=0).sum()):
            names = np.array(list(self.parameters))[self.jumps[output].any(axis=1)]
            yield (
                f"no derivative by {listed(names, 4)} at {jumps} of {n}: "
                "a pair with friction rests there, and begins to slip"
            )

    def doubts_text(self, outputs: Iterable[str]) -> str:
        """The doubts of some outputs as sentences behind a caption."""
        return "".join(f" {name}: {doubt}." for name in outputs for doubt in self.doubts(name))

    # -- shown ------------------------------------------------------------------------

    def figure(self, ax: Axes | None = None) -> Any:
        """The ranked bars of the first outputs."""
        ranked = {name: self._moving(name) for name in list(self)[: ink.PANELS]}
        heights = [(len(effects) + 3.5) * ink.ROW for effects in ranked.values()]
        n = self.result.n
        over = "one sample" if n == 1 else f"{n} samples"
        caption = (
            f"{shown_name(self.result.mechanism.name, 40)}: largest change of an output over "
            f"{over} by a hundredth of a number, of a zero by that of the largest of its unit. "
            "Blue: both grow together; orange, hatched: one shrinks; grey: a vector."
        ) + self.doubts_text(ranked)
        layout: Arguments = {"height_ratios": heights, "sharex": False, "ax": ax}
        with panelled(caption, sum(heights) + ink.ROW / 2, len(ranked), **layout) as panels:
            for (axes,), (name, effects) in zip(panels, ranked.items(), strict=True):
                _bars(axes, name, self.unit_of(name), effects)
        return axes.figure

    def _moving(self, name: str) -> list[Effect]:
        """The strongest numbers of an output, without those that do nothing."""
        ranked = self.ranked(name)[:LINES]
        return [e for e in ranked if e.change > 0.0] or ranked[:1]

    def lines(self) -> Iterator[str]:
        """A ranked table of numbers for each output, then the flags of the run."""
        yield from sections([*map(self._table, self), flag_lines(self.result)])

    def _table(self, output: str) -> Iterator[str]:
        if not np.isfinite(self[output]).any():
            yield f"{output}: no answer"
            return
        unit, effects = self.unit_of(output), self.ranked(output)
        rows = [
            (
                e.parameter.address,
                f"{e.parameter.value:.6g} {e.parameter.unit}".rstrip(),
                f"{_shown(e.derivative)} {e.unit}".rstrip(),
                f"{e.change:.3g}" + self._step_of_zero(e.parameter),
            )
            for e in effects[:LINES]
        ]
        yield f"{output} [{unit or '-'}]"
        yield from aligned(("number", "value", "largest derivative", "by 1 %"), rows)
        if len(effects) > LINES:
            yield f"and {len(effects) - LINES} numbers that do less"
        yield from self.doubts(output)
        if self.left_out:
            yield f"without a derivative: {listed(self.left_out, 4)}"

    def _step_of_zero(self, p: Parameter) -> str:
        """By how much a number of zero changes, which has no hundredth, in words."""
        step = PERCENT * size_of(p, self.parameters.values())
        return "" if p.value else f" by {step:.3g} {p.unit}".rstrip()

    def to_dict(self) -> Data:
        """The rankings as JSON data."""
        return {
            "sensitivity": {
                output: [
                    {
                        "number": e.parameter.address,
                        "value": e.parameter.value,
                        "derivative": as_json(e.derivative),
                        "unit": e.unit,
                        "sample": e.sample,
                        "change": e.change,
                    }
                    for e in self.ranked(output)
                ]
                for output in self
            },
            "doubts": {output: list(self.doubts(output)) for output in self},
            "left_out": dict(self.left_out),
        }

    def csv_rows(self) -> tuple[list[str], Iterable[Iterable[object]]]:
        """One row per output component and sample, one column per number."""
        drivers = driver_columns(self.result)

        def at(column: Column) -> Callable[[int, str], object]:
            return lambda k, output: "" if self.one_number(output) else column.values[k]

        where = [at(column) for column in drivers]
        heads = [Column(a, p.unit, np.empty(0), a).head for a, p in self.parameters.items()]
        rows = (
            [name, self.unit_of(name), *(cells(k, output) for cells in where), *row]
            for output, both in self.ahead.items()
            for name, derivatives in components(output, both).items()
            for k, row in enumerate(derivatives.T.tolist())
        )
        return ["output", "unit", *(c.head for c in drivers), *(f"per {h}" for h in heads)], rows


def size_of(p: Parameter, parameters: Iterable[Parameter]) -> float:
    """A number's own size; of a zero the largest of its unit, or 1."""
    alike = (abs(x.value) for x in parameters if x.unit == p.unit != "")
    return abs(p.value) or max(alike, default=0.0) or 1.0


def _shown(x: Real) -> str:
    x = x + 0.0  # no -0
    return f"({x.real:.4g}, {x.imag:.4g})" if isinstance(x, complex) else f"{x:.6g}"


def _bars(axes: Axes, name: str, unit: str, effects: list[Effect]) -> None:
    factor, scaled = scaled_unit(unit, effects[0].change)
    for row, e in enumerate(effects):
        if isinstance(e.derivative, complex):
            style: Arguments = {"color": ink.GREY}
        elif e.derivative > 0:
            style = {"color": ink.FORWARD}
        else:
            style = {"facecolor": ink.PAPER, "edgecolor": ink.BACK, "hatch": "/////", "lw": 0.8}
        axes.barh(row, factor * e.change, height=THICK, **style)
    axes.set_yticks(range(len(effects)), [e.parameter.address for e in effects])
    axes.tick_params(axis="y", length=0)
    axes.invert_yaxis()
    axes.set_xlabel(f"{name}: change by 1 % [{scaled or '–'}]", labelpad=1)
    axes.grid(False, axis="y")
    axes.spines[["top", "right"]].set_visible(False)
