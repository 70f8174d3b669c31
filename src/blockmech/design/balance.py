"""Balancing: the springs or counterweights that leave the least of some outputs.

Outputs such as the effort of the loads are linear in stiffnesses, preloads and masses, so the best
ones are a least-squares problem over the poses; with exact derivatives also where they are not
linear (free lengths, places). SciPy's `least_squares`, with bounds.

Source: Norton, Design of Machinery, 6th ed., ch. 12 (balancing).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from blockmech.compiled import Compiled
from blockmech.figures import palette as ink
from blockmech.figures.curves import abscissa, values
from blockmech.figures.panels import label_coordinate
from blockmech.figures.paper import (
    Pictured,
    axis_label,
    legend_above,
    panelled,
    picture_unit,
    shown_name,
)
from blockmech.ground.arguments import declared
from blockmech.ground.errors import BlockmechError, listed, refused
from blockmech.ground.plane import EPS
from blockmech.ground.progress import with_bar
from blockmech.ground.report import Facts, with_unit
from blockmech.result.result import Result
from blockmech.result.tables import aligned
from blockmech.studies.differentiate import chosen_numbers, sensitivity
from blockmech.studies.family import in_si_by_address, remade
from blockmech.studies.objective import INFEASIBLE, real_parts
from blockmech.studies.sampling import as_sequence
from blockmech.studies.sensitivity import size_of
from blockmech.typing import (
    Arguments,
    Coordinates,
    Data,
    Floats,
    FrictionMethod,
    Numbers,
    Progress,
    Quantity,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PANEL = 13.0 * ink.TEXT  # [pt] height of a panel of a picture


class Left(NamedTuple):
    """The remainder of an output over the poses: rms, largest magnitude, and its sample."""

    rms: float
    largest: float
    sample: int


def left_of(y: Any) -> Left:
    """What is left of an output (n,)."""
    size = np.abs(np.asarray(y))
    k = int(np.argmax(size))
    return Left(float(np.sqrt(np.mean(size**2))), float(size[k]), k)


@dataclass(frozen=True, repr=False)
class Balance(Facts, Pictured):
    """The parameters that balance a mechanism best.

    Attributes
    ----------
    mechanism : with these numbers
    numbers : address -> value
    before, after : output -> its remainder
    runs : the two runs whose outputs these are
    units : address or output -> unit
    linear : whether the outputs are linear in the numbers, so that no better ones exist
    at_bounds : numbers that lie at their bounds
    """

    FACTS = ("numbers", "units", "linear", "at_bounds", "before", "after")

    mechanism: Compiled
    numbers: Mapping[str, float]
    before: Mapping[str, Left]
    after: Mapping[str, Left]
    runs: tuple[Result, Result]
    units: Mapping[str, str]
    linear: bool
    at_bounds: tuple[str, ...]

    def figure(self, ax: Axes | None = None) -> Any:
        """Each output before and after balancing, over the poses."""
        names = [*self.after][: ink.PANELS]
        across = abscissa(self.runs[0].to(*self._display))
        caption = f"{shown_name(self.mechanism.name, 40)}: outputs before and after balancing, "
        caption += "vectors by their size."
        with panelled(caption, len(names) * PANEL + 2 * ink.ROW, len(names), ax=ax) as panels:
            for (axes,), name in zip(panels, names, strict=True):
                factor, unit = picture_unit(
                    self.units[name], self._display, self.before[name].largest
                )
                for n, (label, run) in enumerate(zip(("before", "after"), self.runs, strict=True)):
                    y = factor * values(run, name)
                    axes.plot(across.values, y, label=label, **ink.curve_style(n))
                axes.set_ylabel(axis_label(shown_name(name), unit, PANEL), labelpad=2)
            legend_above(panels[0, 0], ink.COLUMN)
            label_coordinate(axes, across.words)
        return axes.figure

    def lines(self) -> Iterator[str]:
        """The numbers, then the remainder of each output and its largest value."""
        rows = [(a, with_unit(x, self.units[a], self._display)) for a, x in self.numbers.items()]
        yield from aligned(("number", "value"), rows)
        run = self.runs[1]
        for name, left in self.after.items():
            was, unit = self.before[name], self.units[name]
            at = run._place(left.sample, self._display)
            yield (
                f"{name}: rms {left.rms:.4g} {unit} of {was.rms:.4g}, "
                f"largest {left.largest:.4g} of {was.largest:.4g}, at {at}"
            )
        if self.at_bounds:
            yield f"at their bounds: {listed(self.at_bounds)}"
        if not self.linear:
            yield "not linear in these numbers: the best near the start"


@with_bar
@declared
def balance(
    mechanism: Compiled,
    numbers: Iterable[str] | str,
    want: Iterable[str] | str | None = None,
    at: Coordinates | None = None,
    *,
    samples: int | None = None,
    times: Numbers | None = None,
    bounds: Mapping[str, tuple[Quantity, Quantity]] | None = None,
    friction: FrictionMethod | None = "none",
    static: bool | None = None,
    progress: Progress | None = None,
) -> Balance:
    """Springs or counterweights that minimise some outputs over the poses.

    Parameters
    ----------
    numbers : addresses, e.g. ``spring.stiffness``, ``crank.links.crank.mass``
    want : outputs whose sum of squares is minimised, each scaled by its initial magnitude; by
        default the generalised forces of the loads on the drivers, ``crank.tau_red``
    at, samples, times : the poses, as those of a run
    bounds : address -> (lowest, highest); by default the limits of the file format
    friction : as that of a run; by default "none"
    static : without inertia; by default True where ``want`` is omitted
    progress : called as ``progress(task, completed, None)`` after each design that is tried

    Returns
    -------
    Balance, with the mechanism that has these numbers

    Raises
    ------
    RequestError for unknown names, or numbers on which no output depends
    AssemblyError at poses that do not assemble

    >>> balanced = bm.design.balance(mech, "couple.moment", want="crank.drive", samples=13)
    >>> {number: round(value) for number, value in balanced.numbers.items()}
    {'couple.moment': 1236}
    """
    from scipy.optimize import least_squares

    chosen = chosen_numbers(mechanism, as_sequence("numbers", numbers))
    drivers = mechanism.drivers
    names = as_sequence("want", want if want is not None else
                        tuple(mechanism._of_driver(d, "tau_red") for d in drivers))  # fmt: skip
    poses: Arguments = {"samples": samples, "times": times}
    how: Arguments = {
        "friction": friction,
        "static": want is None if static is None else static,
    }
    before = mechanism.run(at, want=names, **poses, **how)
    outputs = [n for n in before if before._output(n).kind in ("real", "vector")]
    scale = {n: left_of(before[n]).rms or 1.0 for n in outputs}
    start = np.array([float(p.value) for p in chosen.values()])
    sizes = np.array([size_of(p, chosen.values()) for p in chosen.values()])
    kept: Data = {}

    def evaluated(u: Floats) -> tuple[Floats, Floats]:
        if kept.get("u") != u.tobytes():
            other = remade(mechanism, dict(zip(chosen, (u * sizes).tolist(), strict=True)))
            derivatives = sensitivity(other, outputs, tuple(chosen), at, **poses, **how)
            y = np.concatenate([real_parts(derivatives.result[n]) / scale[n] for n in outputs])
            J = np.hstack([real_parts(derivatives[n]) / scale[n] for n in outputs]).T * sizes
            kept.update(u=u.tobytes(), y=y, J=J, designs=kept.get("designs", 0) + 1)
            if progress is not None:
                progress("designs tried", float(kept["designs"]), None)
        return kept["y"], kept["J"]

    def residual(u: Floats) -> Floats:
        try:
            return evaluated(u)[0]
        except BlockmechError:
            return np.full(first.shape, INFEASIBLE)

    def without_effect(J: Floats) -> list[str]:
        return [a for a, c in zip(chosen, np.abs(J).max(axis=0), strict=True) if not c > 0]

    first, J = evaluated(start / sizes)
    idle = without_effect(J)
    if idle:  # a mass at a pivot acts as soon as its centre is another
        with suppress(BlockmechError):
            idle = without_effect(evaluated(start / sizes + 1.0)[1])
    if idle:
        remedy = "leave it out, or add the numbers with which it acts"
        raise refused(idle[0], f"none of {listed(outputs)} follows it", remedy)
    limits = in_si_by_address(mechanism, bounds or {}, "bounds")
    ends = np.array([_bounds(mechanism, a, limits) for a in chosen])
    u = np.clip(start, *ends.T) / sizes
    derivatives = least_squares(
        residual, u, lambda v: evaluated(v)[1], bounds=(ends[:, 0] / sizes, ends[:, 1] / sizes),
        xtol=EPS, ftol=EPS, gtol=EPS, x_scale="jac",
    )  # fmt: skip
    values = dict(zip(chosen, (derivatives.x * sizes).tolist(), strict=True))
    best = remade(mechanism, values)
    after = best.run(at, want=names, **poses, **how)
    straight = first + J @ (derivatives.x - start / sizes)
    linear = np.abs(derivatives.fun - straight).max() <= 1e-9 * max(np.abs(first).max(), 1.0)
    units = {a: p.unit for a, p in chosen.items()} | {n: before.unit(n) for n in outputs}
    held = tuple(a for a, side in zip(chosen, derivatives.active_mask, strict=True) if side)
    return Balance(
        best, values, {n: left_of(before[n]) for n in outputs},
        {n: left_of(after[n]) for n in outputs}, (before, after), units, bool(linear), held,
    )  # fmt: skip


def _bounds(
    mechanism: Compiled, address: str, limits: Mapping[str, tuple[float, float]]
) -> tuple[float, float]:
    """Lowest and highest value of a number: as asked, and not below zero where the file says so."""
    if address in limits:
        low, high = limits[address]
        if not low < high:
            raise refused(f"bounds[{address}]", f"got ({low!r}, {high!r})", "lowest, then highest")
        return float(low), float(high)
    try:
        remade(mechanism, {address: -1.0})
    except BlockmechError:
        return 0.0, math.inf
    return -math.inf, math.inf
