"""Which designs a study is of: a grid, rows of arrays, or points of distributions.

Points of a grid, of Sobol and at random are made where they are asked for, by their places,
so no process of a large study holds them all, and none depends on how a study is parted; a
Latin hypercube is one whole. Sobol points are SciPy's (`scipy.stats.qmc`), which takes longer to
load than most studies to run; so a hypercube, of as many lines, is drawn here as it draws one.

Sources: McKay, Beckman & Conover 1979 (Latin hypercube); Sobol' 1967, Owen 1998 (scrambled).
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from blockmech.ground.errors import Problem, RequestError, as_names, listed, refused
from blockmech.ground.values import is_count
from blockmech.studies.distributions import Distribution, Sample
from blockmech.typing import Floats, Numbers, Record

Sampling = Literal["grid", "paired", "latin", "sobol", "random"]
OF_ARRAYS, OF_DISTRIBUTIONS = ("grid", "paired"), ("latin", "sobol", "random")


@dataclass(frozen=True)
class Designs:
    """The designs of a study.

    Attributes
    ----------
    vary : address -> values (k,), or a distribution
    sampling : how designs are made of them
    count : number of designs
    seed : of what is drawn at random
    first : of a part of a study: the place of its first design
    """

    vary: Record
    sampling: Sampling
    count: int
    seed: int = 0
    first: int = 0

    @property
    def shape(self) -> tuple[int, ...]:
        """Sizes of the grid, or the number of designs."""
        if self.sampling != "grid":
            return (self.count,)
        return tuple(np.size(x) for x in self.vary.values())

    def given(self, spans: Iterable[tuple[int, int]]) -> Iterator[Record]:
        """All values of each number, of distributions those of some designs after the other."""
        if self.sampling in OF_ARRAYS:
            yield self.vary
        else:
            yield from (self.columns(*span) for span in spans)

    def part(self, start: int, stop: int) -> Designs:
        """Some of the designs by themselves, no larger than it takes to make them."""
        if self.sampling in ("paired", "latin"):
            return Designs(self.columns(start, stop), "paired", stop - start)
        return replace(self, count=stop - start, first=self.first + start)

    def columns(self, start: int, stop: int) -> dict[str, Floats]:
        """Values (stop - start,) of each number in some of the designs."""
        if self.sampling == "paired":
            return {a: x[start:stop] for a, x in self.vary.items()}
        start, stop = self.first + start, self.first + stop
        if self.sampling == "grid":
            places = np.unravel_index(np.arange(start, stop), self.shape)
            return {a: x[k] for (a, x), k in zip(self.vary.items(), places, strict=True)}
        tiny = np.finfo(float).eps / 2  # the ends of a normal distribution are far out
        points = np.clip(self._points(start, stop), tiny, 1.0 - tiny)
        rows = zip(self.vary.items(), points.T, strict=True)
        return {a: law.quantile(x) for (a, law), x in rows}

    def _points(self, start: int, stop: int) -> Floats:
        """Shares (stop - start, k) between 0 and 1, the same for the same seed."""
        size = len(self.vary)
        if self.sampling == "latin":
            return self._hypercube[start:stop]
        if self.sampling == "random":
            bits = np.random.PCG64(self.seed).advance(start * size)  # one for each number
            return np.random.Generator(bits).random((stop - start, size))
        from scipy.stats import qmc

        made = qmc.Sobol(size, seed=np.random.default_rng(self.seed))
        if start:
            made.fast_forward(start)
        with warnings.catch_warnings():  # the whole is a power of two, its parts need not be
            warnings.simplefilter("ignore", UserWarning)
            return np.asarray(made.random(stop - start))

    @cached_property
    def _hypercube(self) -> Floats:
        (random,) = np.random.default_rng(self.seed).spawn(1)
        inside = random.random((self.count, len(self.vary)))
        strata = [random.permutation(self.count) for _ in self.vary]
        return np.asarray((np.transpose(strata) + 1 - inside) / self.count)


def designs(vary: Record, sampling: str | Sample | None) -> Designs:
    """The designs that a request names. Raises `RequestError` for what is wrong, all at once."""
    if not isinstance(vary, Mapping) or not vary:
        raise refused("vary", f"got {vary!r:.60}", 'give e.g. {"dyad.l_i": [5.9, 6.0, 6.1]}')
    problems: list[Problem] = []
    random = [a for a, x in vary.items() if isinstance(x, Distribution)]
    if random and len(random) < len(vary):
        rest = listed(a for a in vary if a not in random)
        problems.append(
            _problem(rest, "values beside distributions", "give bm.dist.Uniform(low, high)")
        )
    values = {a: x if a in random else _row(a, x, problems) for a, x in vary.items()}
    sample = sampling if isinstance(sampling, Sample) else Sample(0, sampling)  # type: ignore[arg-type]
    if random and sample is not sampling:
        remedy = "say how many designs: sampling=bm.dist.Sample(1000)"
        problems.append(_problem("sampling", f"got {sampling!r}", remedy))
    elif not random and sample is sampling:
        problems.append(_problem("sampling", "a sample has no meaning for arrays", "leave it out"))
    method = sample.method or OF_ARRAYS[0]
    valid = OF_DISTRIBUTIONS if random else OF_ARRAYS
    if not problems and method not in valid:
        message = f'no sampling "{method}" of {"distributions" if random else "arrays"}'
        problems.append(Problem("bad-value", "sampling", message, f"valid: {listed(valid)}", ""))
    RequestError.raise_for(problems)
    n = _count(sample) if random else _paired(method, {a: len(x) for a, x in values.items()})
    return Designs(values, method, n, sample.seed)


def _count(sample: Sample) -> int:
    """Number of designs of a sample. Raises `RequestError` for a count or seed that is none."""
    n, problems = sample.count, []
    if sample.seed != 0 and not is_count(sample.seed):
        problems.append(_problem("seed", f"got {sample.seed!r}", "give a whole number from 0 on"))
    if not is_count(n):
        message = f"must be a whole number, got {n!r}"
        problems.append(_problem("count", message, "say how many designs"))
    elif sample.method == "sobol" and n & (n - 1):
        message, power = f"{n} Sobol points are out of balance", 1 << int(n).bit_length()
        problems.append(_problem("count", message, f"give a power of two, e.g. {power}"))
    RequestError.raise_for(problems)
    return int(n)


def _paired(method: str, lengths: Mapping[str, int]) -> int:
    """Number of designs of a grid or of pairs. Raises `RequestError` for pairs of two lengths."""
    if method == "grid":
        return math.prod(lengths.values())
    if len(set(lengths.values())) > 1:
        found = f"{listed(f'{a} has {k}' for a, k in lengths.items())} values"
        raise RequestError(_problem("vary", found, "pairs need equally many"))
    return next(iter(lengths.values()))


def _row(address: str, raw: Numbers, problems: list[Problem]) -> Floats:
    try:
        array = np.asarray(raw)
        if array.dtype.kind not in "iuf" or array.ndim > 1 or array.size == 0:
            raise TypeError
    except (TypeError, ValueError):
        remedy = "give a number, a row of numbers or a distribution"
        problems.append(_problem(address, f"got {raw!r:.60}", remedy))
        return np.zeros(1)
    row = np.atleast_1d(array.astype(np.float64))
    invalid = np.flatnonzero(~np.isfinite(row))
    if len(invalid):
        problems.append(
            _problem(f"{address}[{invalid[0]}]", f"not a finite number: {row[invalid[0]]}", "")
        )
    return row


def _problem(where: str, found: str, remedy: str) -> Problem:
    return Problem("bad-request", where, found, "", remedy)


def as_sequence(where: str, x: Any) -> Sequence[str]:
    """One word or several, and not none. Raises `RequestError` for anything else."""
    if not (words := as_names(where, x)):
        raise refused(where, f"got {x!r:.60}", "give a name, or several")
    return words
