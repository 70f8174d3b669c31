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
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from blockmech.compiled import Compiled
from blockmech.ground.errors import Problem, RequestError
from blockmech.ground.pictured import Pictured
from blockmech.ground.report import DEGREES, sections
from blockmech.model.parameters import named
from blockmech.result.exported import aligned
from blockmech.studies.differentiate import sensitivity
from blockmech.studies.family import Family, parameters, remade
from blockmech.studies.runner import Runner
from blockmech.studies.sampling import Designs, Distribution, designs
from blockmech.studies.sensitivity import Sensitivity
from blockmech.studies.workers import Work
from blockmech.typing import Coordinates, FrictionMethod, Numbers, Progress

Array = NDArray[Any]


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
    sampled : output -> what Monte Carlo found; empty where no designs were drawn
    """

    PICTURE = "blockmech.draw.tolerance:tolerance_figure"

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

    def lines(self, degrees: bool = DEGREES) -> Iterator[str]:
        """For each output its largest deviation, and what the numbers have in it there."""
        yield from sections(self._table(output, degrees) for output in self)

    def _table(self, output: str, degrees: bool) -> Iterator[str]:
        run = self.sensitivity.result
        deviation, unit = self[output], self.sensitivity.unit_of(output)
        if not np.isfinite(deviation).any():
            yield f"{output}: no answer"
            return
        k = int(np.nanargmax(deviation))
        if self.sensitivity.one_number(output):
            yield f"{output}: deviation {deviation[0]:.4g} {unit}".rstrip()
        else:
            most = f"{output}: deviation up to {deviation[k]:.4g} {unit}".rstrip()
            yield f"{most}, at {run.place(k, degrees)}"
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
    """How outputs scatter: linear about the means, and by Monte Carlo if designs are asked for.

    Parameters
    ----------
    numbers : address -> distribution (`normal`, `uniform`), independent of each other
    want : names or patterns of outputs, or reductions of them, ``range(dyad.j.angle)``
    at, samples, times : the samples, as those of a run
    count, seed : of designs drawn at random for Monte Carlo; by default none
    friction, static : as those of a run
    progress : called as ``progress(what, done, whole)``

    Returns
    -------
    Tolerance

    Raises
    ------
    RequestError for unknown names, and where an output or a number has no derivative
    AssemblyError, SingularError, FrictionError at gaps of the mean design
    """
    given = numbers if isinstance(numbers, Mapping) else {}
    wrong = [a for a, law in given.items() if not isinstance(law, Distribution)]
    if wrong or not given:
        remedy, places = "give e.g. normal(6.0, 1e-4)", wrong or ["numbers"]
        raise RequestError(Problem("bad-request", a, "no distribution", "", remedy) for a in places)
    parameters_of = named(parameters(mechanism), numbers)
    laws = {p.address: law for p, law in parameters_of.items()}
    moved = {p.address: law.mean for p, law in parameters_of.items() if law.mean != p.value}
    centre = remade(mechanism, moved) if moved else mechanism
    poses = {"at": at, "samples": samples, "times": times}
    linear = sensitivity(centre, want, laws, **poses, friction=friction, static=static)  # type: ignore[arg-type]
    sampled = {}
    if count is not None:
        family, how = Family(centre, laws, friction), linear.result.settings
        every = [n if n in linear.reduced else f"poses({n})" for n in linear]
        runner = Runner.of(family, every, poses, how)
        sampled = _drawn(runner, designs(laws, "random", count, seed), linear, progress)
    return Tolerance(linear, laws, sampled)


def _drawn(
    runner: Runner, chosen: Designs, linear: Sensitivity, progress: Progress | None
) -> dict[str, Scatter]:
    """Mean and deviation of outputs over random designs, block by block."""
    sums: dict[str, list[Any]] = {name: [0, 0.0, 0.0] for name in linear}
    for (_, done), block in Work(runner, chosen).here(runner.checked(chosen)):
        assert block is not None  # as nothing is written
        for name, column in zip(sums, block.values.values(), strict=True):
            rows = column if column.ndim > 1 else column[:, None]
            good = np.isfinite(off := rows - linear.value(name))
            off = np.where(good, off, 0.0)
            terms = good.sum(axis=0), off.sum(axis=0), np.square(np.abs(off)).sum(axis=0)
            sums[name] = [a + b for a, b in zip(sums[name], terms, strict=True)]
        if progress is not None:
            progress(f"{done} of {chosen.count} designs", done, chosen.count)
    sampled = {}
    with np.errstate(invalid="ignore", divide="ignore"):
        for name, (n, first, second) in sums.items():
            mean = first / n
            deviation = np.sqrt((second / n - np.square(np.abs(mean))) * n / (n - 1))
            sampled[name] = Scatter(linear.value(name) + mean, deviation, n)
    return sampled
