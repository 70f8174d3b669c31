"""Extremes of many designs between their poses, found side by side.

The poses start the search (`blockmech.analysis.peaks`), which runs the same program at places of
each design's own. Beside limits of the motion outputs have narrow peaks: there it looks closer.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from blockmech.analysis.peaks import Function, Peaks, Search
from blockmech.analysis.working_cycle import Cycle, cycle_through
from blockmech.compiled import Compiled
from blockmech.engines.numpy import each_part
from blockmech.ground.errors import RequestError
from blockmech.plan.plan import Plan
from blockmech.result.samples import Samples, make_samples
from blockmech.studies.reductions import EXTREMES, SIMPLE, STROKE, Wanted
from blockmech.typing import Array, Nested, Values

NEAR_LIMIT = 0.02  # margin [-] below which outputs may have peaks narrower than usual spacings


@dataclass(frozen=True)
class Range:
    """The range that poses go through, for designs of one program.

    Attributes
    ----------
    mechanism : the one that is planned
    plan, engine : what runs designs
    samples : the poses
    remembers : whether states of friction laws go along with them
    """

    mechanism: Compiled
    plan: Plan
    engine: Any
    samples: Samples
    remembers: bool

    @cached_property
    def cycle(self) -> Cycle | None:
        """The range; None where the poses are one, or none that can be followed."""
        with suppress(RequestError):
            return cycle_through(self.mechanism, self.samples, {})
        return None

    @cached_property
    def places(self) -> tuple[Array, Array | slice]:
        """Places (k,) of poses on the range, rising and each once, and the numbers of the poses."""
        assert self.cycle is not None
        s, order = np.unique(self.cycle.places_of(self.samples), return_index=True)
        return s, slice(None) if np.array_equal(order, range(self.samples.n)) else order

    def output(self, w: Wanted, values: Values, coordinates: Array) -> Array:
        """An output (k, n) of designs with these parameters, at places (k, n) of their own."""
        m = self.mechanism
        assert self.cycle is not None
        samples = make_samples(
            m._coordinate_units, m.scene, **self.cycle.request(coordinates.ravel())
        )
        samples = m._with_deflections(samples) if self.remembers else samples
        inputs = {
            name: np.reshape(np.asarray(x, float), coordinates.shape)
            for name, x in samples.given(self.plan.program.inputs).items()
            if name in self.plan.program.inputs
        }
        outputs = self.engine.run_designs(inputs, values)
        columns = [outputs[i] for i in self.plan.layout[w.output]]
        with np.errstate(all="ignore"):
            return w.poses(m.outputs[w.output], columns, coordinates.shape)

    def extremes(
        self,
        w: Wanted,
        values: Values,
        y: Array,
        margins: Mapping[str, Array],
        axes: Sequence[Array] = (),
    ) -> Peaks:
        """Extremes of an output that is y (m, n) at the poses, all finite; infinite errors where
        there is no range to follow. Of markers on straight paths those along their axes, each a
        place and a direction (m,)."""
        y = projected(y, *axes)
        if self.cycle is None:
            doubt = math.inf if y.shape[1] > 1 else 0.0
            how = "range" if w.how == STROKE else w.how
            return Peaks(SIMPLE[how](y), np.zeros(len(y)), np.full(len(y), doubt))
        s, order = self.places
        y = y[:, order]

        def output(row: Array, coordinates: Array) -> Array:
            x = self.output(w, some_of(values, row), coordinates)
            return projected(x, *(axis[row] for axis in axes))

        circular = self.mechanism.outputs[w.output].circular
        turn, suspects = self.cycle.turns, near_limits(margins, order)
        return extremes_of(w, output, s, y, circular, turn=turn, suspects=suspects)


def projected(z: Array, origin: Array | float = 0.0, direction: Array | None = None) -> Array:
    """Places (m, n) of markers along their axes; other outputs, which have none, as they are."""
    if direction is None:
        return z
    return np.asarray(((z - np.reshape(origin, (-1, 1))) * direction.conj()[:, None]).real)


def extremes_of(
    w: Wanted, output: Function, s: Array, y: Array, circular: bool = False, **search_settings: Any
) -> Peaks:
    """Extremes of outputs that are y (m, n) at places s (n,), by a `Search` for each sign.

    A circular one does not jump by a turn on the way.
    """
    samples = np.unwrap(y, axis=1) if circular else y

    def continued(row: Array, coordinates: Array) -> Array:
        x = output(row, coordinates)
        if not circular:
            return x
        nearest = samples[row[:, None], np.searchsorted((s[1:] + s[:-1]) / 2, coordinates)]
        return x + math.tau * np.round((nearest - x) / math.tau)

    def turned(row: Array, coordinates: Array) -> Array:
        return -continued(row, coordinates)

    signs, absolute = EXTREMES[w.how], w.how == "max_abs"
    searches = (
        Search(continued, s, samples, absolute, **search_settings)
        if sign > 0
        else Search(turned, s, -samples, **search_settings)
        for sign in signs
    )
    first, *second = (search.largest() for search in searches)
    value, error = signs[0] * first.value, first.error
    for opposite in second:
        value, error = value + opposite.value, np.maximum(error, opposite.error)
    return first._replace(value=value, error=error)


def some_of(values: Nested, row: Array) -> Nested:
    """Parameters of some designs: tuples of columns (..., m, 1), or one array of numbers."""
    if isinstance(values, np.ndarray):
        return values.take(row, axis=0)
    return each_part(lambda x: x[..., row, :] if np.ndim(x) > 1 else x, values)


def near_limits(margins: Mapping[str, Array], order: Array | slice) -> Array | None:
    """Samples (m, k) at which a margin is small, and smaller than beside them; None of none."""
    mask = None
    for m in margins.values():
        if m.min() < NEAR_LIMIT:
            m = m[:, order]
            low = m < NEAR_LIMIT
            low[:, 1:] &= m[:, 1:] <= m[:, :-1]
            low[:, :-1] &= m[:, :-1] <= m[:, 1:]
            mask = low if mask is None else mask | low
    return mask


def doubt(label: str, peaks: Peaks, i: int, margins: Mapping[str, float]) -> str:
    """Why the extreme of a design was not found to the end, in words."""
    if not margins:
        return f"{label}: no range leads through the poses"
    block = min(margins, key=margins.__getitem__)
    reason = f"{block} has a margin of {margins[block]:.1g}"
    if np.isinf(peaks.error[i]):
        return f"{block} between the poses, near {peaks.place[i]:.6g}, {reason}"
    return f"{label} may be {peaks.error[i] / abs(peaks.value[i] or 1.0):.1%} larger: {reason}"
