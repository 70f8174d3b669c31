"""Extremes: the smallest and largest values of an output over a cycle, and where.

The output is sampled (720 times a turn) until its Chebyshev series end. Where it is smooth,
the place is a root of the derivative of a series (`blockmech.analysis.scan`): the value is good
to rounding, the place to about 1e-13 rad times |value| / |second derivative|. At a kink (a
friction moment that changes its sign) minimisation takes over.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from operator import attrgetter, pos
from typing import TYPE_CHECKING, Literal

from blockmech.analysis.ranges import cycle_of
from blockmech.analysis.scan import shown_place
from blockmech.analysis.turning_points import Turn, signal_of, turns_of
from blockmech.analysis.working_cycle import Cycle
from blockmech.ground.arguments import declared
from blockmech.ground.errors import held, listed, refused, shown
from blockmech.ground.report import Facts, Report, places, with_unit
from blockmech.ground.tolerances import ROUNDING
from blockmech.typing import Data, FrictionMethod

if TYPE_CHECKING:
    from blockmech.compiled import Compiled
    from blockmech.result.result import Result

PARTS = ("x", "y", "magnitude")
PART_OF: Data = {"x": attrgetter("real"), "y": attrgetter("imag"), "magnitude": abs, "": pos}

Kind = Literal["minimum", "maximum"]


@dataclass(frozen=True)
class Extreme(Facts):
    """One extreme value and where it is.

    Attributes
    ----------
    kind : "minimum" or "maximum"
    value : in the output's unit; infinite where the output grows without bound
    at : ``"crank.q"`` -> driver coordinate
    units : ``"crank.q"`` -> its unit, rad or m
    time : [s], if the law of motion gives it
    end : whether it is at an end of the range or of an arc, not at a local extreme
    """

    FACTS = ("kind", "value", "time", "end")

    kind: Kind
    value: float
    at: Mapping[str, float]
    units: Mapping[str, str]
    time: float | None
    end: bool

    def place(self, display: Iterable[str] = ()) -> str:
        """Where it is, in words."""
        at = {driver: shown_place(q) for driver, q in self.at.items()}
        return places(at, self.units, display)

    def to_dict(self) -> Data:
        """The extreme as a JSON object; null stands for infinity."""
        return {**super().to_dict(), "drivers": dict(self.at)}


@dataclass(frozen=True)
class Range(Facts):
    """Smallest and largest value of one real quantity, and all its turns in between.

    ``part`` is "x", "y" or "magnitude" of a vector, "" of a real output. ``turns`` are
    the local extremes inside the range, in the order of the cycle.
    """

    FACTS = ("minimum", "maximum", "turns")

    part: str
    minimum: Extreme
    maximum: Extreme
    turns: tuple[Extreme, ...]


@dataclass(frozen=True, repr=False)
class Extremes(Facts, Report):
    """Extremes of one output; for a vector those of x, y and its magnitude.

    ``minimum``, ``maximum`` and ``turns`` are those of a real output, or of a vector's
    magnitude; ``extremes["x"]`` is a part of a vector.
    """

    name: str
    unit: str
    ranges: Mapping[str, Range]
    notes: tuple[str, ...] = ()

    def __getitem__(self, part: str) -> Range:
        return held(self.ranges, part, "the output has no such part", "parts")

    @property
    def _main(self) -> Range:
        return self.ranges[""] if "" in self.ranges else self.ranges["magnitude"]

    @property
    def minimum(self) -> Extreme:
        """The smallest value."""
        return self._main.minimum

    @property
    def maximum(self) -> Extreme:
        """The largest value."""
        return self._main.maximum

    @property
    def turns(self) -> tuple[Extreme, ...]:
        """All local extremes inside the range, in the order of the cycle."""
        return self._main.turns

    def lines(self) -> Iterator[str]:
        """The extremes of each part, one a line."""
        for part, span in self.ranges.items():
            name = f"{self.name}.{part}".rstrip(".")
            for extreme in (span.minimum, span.maximum):
                value = with_unit(extreme.value, self.unit, self._display)
                at = extreme.place(self._display)
                yield f"{name}  {extreme.kind} {value} at {at}"
        yield from (f"note: {text}" for text in self.notes)

    def to_dict(self) -> Data:
        """The extremes as a JSON object."""
        parts = {part or "value": r.to_dict() for part, r in self.ranges.items()}
        return {"output": self.name, "unit": self.unit, **parts, "notes": [*self.notes]}


@declared
def extremes(
    source: Compiled | Result,
    name: str,
    *,
    friction: FrictionMethod | None = None,
    static: bool | None = None,
) -> Extremes:
    """Smallest and largest values of an output over a cycle.

    Parameters
    ----------
    source : a mechanism (followed over its law's range, or over a turn of its crank), or a
        result (followed over its samples, with its settings)
    name : a real output or a vector; ``"dyad.C.p.x"`` is one part of a vector
    friction, static : as in a run; by default those of the result,
        or Newton's method with inertia

    Returns
    -------
    Extremes. They take about five batches of 720 samples per component, more with kinks

    Raises
    ------
    RequestError for an unknown output, one that is not real, or no range to follow
    SampleError where the output exists at no sample

    >>> print(mech.extremes("crank.drive", friction="none"))
    crank.drive  minimum -18759.7405 N m at crank.q = 6.10152741 rad
    crank.drive  maximum 9177.42813 N m at crank.q = 0.420867501 rad
    """
    settings = {"friction": friction}
    cycle = cycle_of(source, **settings, static=static)
    output, parts = parts_of(cycle.mechanism, name)
    turns = {part: turns_of(cycle, signal_of(cycle, output, part)) for part in parts}
    sizes = [abs(end.value) for t in turns.values() for end in (t.low, t.high)]
    noise = ROUNDING * max(filter(math.isfinite, sizes), default=0.0)
    ranges = {
        "" if len(parts) == 1 else part: Range(
            part,
            extreme_at(cycle, t.low, noise),
            extreme_at(cycle, t.high, noise),
            tuple(extreme_at(cycle, turn, noise) for turn in t.inner),
        )
        for part, t in turns.items()
    }
    extremes = Extremes(name, cycle.mechanism.outputs[output].unit, ranges, cycle.notes)
    return extremes.to(*getattr(source, "_display", ()))


def parts_of(mechanism: Compiled, name: str) -> tuple[str, tuple[str, ...]]:
    """The output and the parts of it that a name such as ``"dyad.C.p.x"`` means."""
    if not isinstance(name, str):
        raise refused("name", f"{shown(name)} is not a name", "name one output")
    output, part = name, ""
    head, _, tail = name.rpartition(".")
    if tail in PARTS and head in mechanism.outputs:
        output, part = head, tail
    matches = mechanism.outputs.match([output])
    if output not in matches:
        message = f"it is a pattern, which {len(matches)} outputs fit"
        valid = f"outputs: {listed(matches)}"
        raise refused(name, message, "name one of them", valid)
    kind = mechanism.outputs[output].kind
    if kind not in ("real", "vector") or (part and kind == "real"):
        reason = {"real": "it is a real number without parts"}.get(kind, f"it is a {kind}")
        raise refused(name, reason, "name a real output, or a vector or its part")
    return output, (part,) if part or kind == "real" else PARTS


def number_of(mechanism: Compiled, name: str) -> tuple[str, str]:
    """The output and the part of it that is one number. Raises `RequestError` for a vector."""
    output, parts = parts_of(mechanism, name)
    if len(parts) > 1:
        raise refused(name, "it is a vector", f"name a part: {name}.x, {name}.y, {name}.magnitude")
    return output, parts[0]


def extreme_at(cycle: Cycle, turn: Turn, noise: float = 0.0) -> Extreme:
    """A turn with the driver coordinates at its place; a value within noise is zero."""
    at, time = cycle.at(turn.s)
    kind: Kind = "maximum" if turn.sign > 0 else "minimum"
    units = {d: cycle.mechanism.outputs[d].unit for d in at}
    value = 0.0 if abs(turn.value) <= noise else turn.value
    return Extreme(kind, value, at, units, time, turn.end)
