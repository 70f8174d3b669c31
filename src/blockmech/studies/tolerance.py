"""Tolerances: how an output scatters where numbers of the design do.

Linear from exact sensitivities, sample by sample,

    var f = sum_j |df/dp_j|^2 var p_j,

whose terms are the shares of the numbers; beside it Monte Carlo through all designs of a
family, which knows no linearity. Numbers scatter independently of each other.

Sources: ISO/IEC Guide 98-3 (GUM), 5.1.2; its Supplement 1 for Monte Carlo.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from blockmech.compiled import Compiled
from blockmech.figures import palette as ink
from blockmech.figures.curves import abscissa, values
from blockmech.figures.panels import Abscissa, label_coordinate
from blockmech.figures.paper import Pictured, legend_above, panelled, picture_unit, shown_name
from blockmech.ground.errors import Problem, RequestError
from blockmech.ground.progress import with_bar
from blockmech.ground.report import sections
from blockmech.model.parameters import named
from blockmech.result.tables import aligned
from blockmech.studies.differentiate import sensitivity
from blockmech.studies.distributions import Distribution, Sample
from blockmech.studies.family import Family, in_si_by_address, parameters, remade
from blockmech.studies.runner import Runner
from blockmech.studies.sampling import Designs, designs
from blockmech.studies.sensitivity import Sensitivity
from blockmech.studies.workers import Work
from blockmech.typing import Array, Coordinates, FrictionMethod, Numbers, Progress, Real

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PANEL = 11.0 * ink.TEXT  # [pt] height of a panel of a picture


class Scatter(NamedTuple):
    """What Monte Carlo found of an output.

    mean : (n,), complex of a vector
    deviation : (n,) standard deviation, of a vector that of both components together
    designs : (n,) number of designs with an answer
    """

    mean: Array
    deviation: Array
    designs: Array


@dataclass(frozen=True, repr=False)
class Tolerance(Pictured, Mapping[str, Array]):
    """Standard deviations of outputs: ``t["crank.drive"]`` is (n,), linear.

    Attributes
    ----------
    sensitivity : derivatives at the means of all numbers
    laws : address -> distribution
    sampled : output -> scatter by Monte Carlo; empty without random designs
    """

    sensitivity: Sensitivity
    laws: Mapping[str, Distribution]
    sampled: Mapping[str, Scatter]

    def __getitem__(self, output: str) -> Array:
        return np.asarray(np.sqrt(self._variances(output).sum(axis=0)))

    def __iter__(self) -> Iterator[str]:
        return iter(self.sensitivity)

    def __len__(self) -> int:
        return len(self.sensitivity)

    def shares(self, output: str) -> Array:
        """Share (m, n) [-] of each number in the variance of an output; NaN where it is zero."""
        terms = self._variances(output)
        with np.errstate(invalid="ignore"):
            return np.asarray(terms / terms.sum(axis=0))

    def _variances(self, output: str) -> Array:
        deviations = np.array([law.deviation for law in self.laws.values()])
        variances: Array = np.square(np.abs(self.sensitivity[output]) * deviations[:, None])
        return variances

    # -- shown --------------------------------------------------------------------------

    def figure(self, ax: Axes | None = None) -> Any:
        """The first outputs with their bands and deviations."""
        result = self.sensitivity.result
        curves = [name for name in self if not self.sensitivity.one_number(name)]
        names = (curves or list(self))[: ink.PANELS // 2]
        across = abscissa(result.to(*self._display)) if curves else Abscissa("", np.zeros(1))
        total = sum(np.nan_to_num(self.shares(name)).sum(axis=1) for name in names)
        colours = len(ink.LINK_FILLS) - 1  # the same in all panels
        order = np.argsort(-np.asarray(total), kind="stable")[:colours]
        caption = (
            f"{shown_name(result.mechanism.name, 40)}: outputs with bands of {ink.BAND:g} standard "
            "deviations, a vector by its length; below the deviation, filled by the shares of the "
            "numbers in the variance"
        ) + (", dots by Monte Carlo." if self.sampled else ".")
        caption += self.sensitivity.doubts_text(names)
        rows = 2 * len(names)
        with panelled(caption, rows * PANEL + 2.5 * ink.ROW, rows, ax=ax) as panels:
            for k, name in enumerate(names):
                self._band(panels[2 * k, 0], name, across.values)
                self._draw_shares(panels[2 * k + 1, 0], name, across.values, order)
            legend_above(panels[1, 0], ink.COLUMN)
            if curves:
                label_coordinate(panels[-1, 0], across.words)
        return panels[0, 0].figure

    def _band(self, axes: Axes, name: str, x: Array) -> None:
        run, deviation = self.sensitivity, self[name]
        y = np.abs(run.value(name)) if name in run.reduced else values(run.result, name)
        factor, unit = picture_unit(run.unit_of(name), self._display, float(np.nanmax(np.abs(y))))
        y, band = factor * y, factor * ink.BAND * deviation
        if len(x) == 1:
            axes.errorbar(x, y, band, fmt=".", color=ink.FORWARD, capsize=3)
        axes.fill_between(x, y - band, y + band, color=ink.LINK_FILLS[0], lw=0)
        axes.plot(x, y, color=ink.FORWARD, lw=0.8)
        axes.set_title(shown_name(name, 50), loc="left", fontsize=ink.SMALL)
        axes.set_ylabel(f"[{unit or '–'}]", labelpad=2)

    def _draw_shares(self, axes: Axes, name: str, x: Array, order: Array) -> None:
        deviation, shares = self[name], np.nan_to_num(self.shares(name))
        largest = float(np.nanmax(deviation))
        factor, unit = picture_unit(self.sensitivity.unit_of(name), self._display, largest)
        rows = [factor * deviation * shares[j] for j in order]
        addresses = list(self.laws)
        labels = [addresses[j] for j in order]
        if len(x) == 1:
            axes.set(xticks=[], xlim=(-1.0, 1.0))
            for k, label in enumerate(labels):
                axes.bar(x, rows[k], bottom=sum(rows[:k]), label=label, color=ink.LINK_FILLS[k])
        else:
            axes.stackplot(x, rows, labels=labels, colors=ink.LINK_FILLS, lw=0)
        axes.plot(x, factor * deviation, color=ink.INK, lw=0.8)
        if name in self.sampled:
            axes.plot(x, factor * self.sampled[name].deviation, ".", ms=3, color=ink.ALARM)
        axes.set_ylabel(f"deviation [{unit or '–'}]", labelpad=2)
        axes.set_ylim(bottom=0.0)

    def lines(self) -> Iterator[str]:
        """The largest deviation of each output, and the share of each number in it."""
        yield from sections(self._table(output) for output in self)

    def _table(self, output: str) -> Iterator[str]:
        run = self.sensitivity.result
        deviation, unit = self[output], self.sensitivity.unit_of(output)
        if not np.isfinite(deviation).any():
            yield f"{output}: no answer"
            return
        k = int(np.nanargmax(deviation))
        if self.sensitivity.one_number(output):
            yield f"{output}: deviation {deviation[0]:.4g} {unit}".rstrip()
        else:
            summary = f"{output}: deviation up to {deviation[k]:.4g} {unit}".rstrip()
            yield f"{summary}, at {run._place(k, self._display)}"
        if output in self.sampled:
            sample = self.sampled[output]
            n, off = int(sample.designs[k]), sample.deviation[k]
            text = f"{off:.4g} ± {off / math.sqrt(2 * n):.1g} {unit}" if n > 1 else "too few"
            yield f"{n} designs: {text}".rstrip()
        numbers = self.sensitivity.parameters
        shares = self.shares(output)[:, k]
        order = np.argsort(-np.nan_to_num(shares), kind="stable")
        names, laws = list(numbers), list(self.laws.values())
        percents = ["-" if np.isnan(share) else f"{share:.1%}" for share in shares]
        rows = [
            (names[j], f"{laws[j].deviation:.4g} {numbers[names[j]].unit}", percents[j])
            for j in order.tolist()
        ]
        yield from aligned(("number", "deviation", "share"), rows)
        yield from self.sensitivity.doubts(output)


@with_bar
def tolerance(
    mechanism: Compiled,
    numbers: Mapping[str, Distribution],
    want: Iterable[str] | str,
    at: Coordinates | None = None,
    *,
    samples: int | None = None,
    times: Numbers | None = None,
    count: int | None = None,
    seed: int = 0,
    friction: FrictionMethod | None = None,
    static: bool = False,
    progress: Progress | None = None,
) -> Tolerance:
    """Scatter of outputs: linear about the means, and by Monte Carlo with ``count``.

    Parameters
    ----------
    numbers : address -> distribution (`Normal`, `Uniform`), independent of each other
    want : names or patterns of outputs, or reductions of them, ``range(dyad.j.angle)``
    at, samples, times : the samples, as those of a run
    count, seed : number and seed of Monte Carlo designs; by default none
    friction, static : as those of a run
    progress : called as ``progress(task, completed, total)``

    Returns
    -------
    Tolerance

    Raises
    ------
    RequestError for unknown names, and where an output or a number has no derivative
    AssemblyError, SingularError, FrictionError at gaps of the mean design

    >>> length = bm.dist.Uniform(5.99, 6.01)
    >>> print(mech.tolerance({"dyad.l_i": length}, "crank.drive", at=0.5))
    crank.drive: deviation up to 16.56 N m, at crank.q = 0.5 rad
    number    deviation   share
    dyad.l_i  0.005774 m  100.0%
    """
    distributions = numbers if isinstance(numbers, Mapping) else {}
    wrong = [a for a, law in distributions.items() if not isinstance(law, Distribution)]
    if wrong or not distributions:
        remedy, addresses = "give e.g. bm.dist.Normal(6.0, 1e-4)", wrong or ["numbers"]
        raise RequestError(
            Problem("bad-request", a, "no distribution", "", remedy) for a in addresses
        )
    parameters_of = named(parameters(mechanism), in_si_by_address(mechanism, numbers, "numbers"))
    laws = {p.address: law for p, law in parameters_of.items()}
    moved = {p.address: law.mean for p, law in parameters_of.items() if law.mean != p.value}
    centre = remade(mechanism, moved) if moved else mechanism
    poses = {"at": at, "samples": samples, "times": times}
    linear = sensitivity(centre, want, laws, **poses, friction=friction, static=static)  # type: ignore[arg-type]
    sampled = {}
    if count is not None:
        family, settings = Family(centre, laws, friction), linear.result.settings
        every = [n if n in linear.reduced else f"poses({n})" for n in linear]
        runner = Runner.of(family, every, poses, settings)
        sampled = _drawn(runner, designs(laws, Sample(count, "random", seed)), linear, progress)
    return Tolerance(linear, laws, sampled)


def _drawn(
    runner: Runner, chosen: Designs, linear: Sensitivity, progress: Progress | None
) -> dict[str, Scatter]:
    """Mean and deviation of outputs over random designs, block by block."""
    sums: dict[str, list[Real]] = {name: [0, 0.0, 0.0] for name in linear}
    outputs = runner.family.mechanism.outputs
    runner.check_values(chosen)
    for (_, count), block in Work(runner, chosen).here(runner.spans(0, chosen.count)):
        assert block is not None  # as nothing is written
        for name, column in zip(sums, block.values.values(), strict=True):
            rows = column if column.ndim > 1 else column[:, None]
            difference = np.subtract if name in linear.reduced else outputs[name].difference
            good = np.isfinite(off := difference(rows, linear.value(name)))
            off = np.where(good, off, 0.0)
            terms = good.sum(axis=0), off.sum(axis=0), np.square(np.abs(off)).sum(axis=0)
            sums[name] = [a + b for a, b in zip(sums[name], terms, strict=True)]
        if progress is not None:
            progress(f"{count} of {chosen.count} designs", count, chosen.count)
    sampled = {}
    with np.errstate(invalid="ignore", divide="ignore"):
        for name, (n, first, second) in sums.items():
            mean = first / n
            deviation = np.sqrt((second / n - np.square(np.abs(mean))) * n / (n - 1))
            sampled[name] = Scatter(linear.value(name) + mean, deviation, n)
    return sampled
