"""Stroke: how far a marker or an output goes to and fro, and how long each way takes.

A marker's extreme positions are the ends of its path: the farthest ones on a straight
line, the reversals on a curve that it runs to and fro. The stroke is measured along the
path. There the marker stands while the driver moves: singular poses of the first kind
([GA90] of `blockmech.analysis.limits`, whose dead centres are those of the second). The time
ratio is that of the slow stroke to the quick one at constant driver rate, so it is a ratio
of driver travel.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from blockmech.analysis.extremes import Extreme, extreme_at, parts_of
from blockmech.analysis.instant_centres import principal_axes
from blockmech.analysis.ranges import cycle_of
from blockmech.analysis.scan import NODES, TURN, Span, scan
from blockmech.analysis.turning_points import Turn, Turns, signal_of, turns_of
from blockmech.analysis.working_cycle import Cycle
from blockmech.functions.series import fit, panels
from blockmech.ground.arguments import declared
from blockmech.ground.errors import refused
from blockmech.ground.report import Facts, Report, with_unit
from blockmech.ground.tolerances import BLUR, EQUAL
from blockmech.typing import Data, Floats, FrictionMethod

if TYPE_CHECKING:
    from blockmech.compiled import Compiled
    from blockmech.result.result import Result


ASK = "ask for the extremes of its x or y"

Path = Literal["scalar", "straight", "curved"]
Velocity = Callable[[Floats], NDArray[np.complex128]]


@dataclass(frozen=True, repr=False)
class Stroke(Facts, Report):
    """A stroke between two extreme positions.

    Attributes
    ----------
    name, unit : of the output
    length : distance along the path
    low, high : the extreme positions; of a marker, ``value`` is measured along the path
        from ``low``
    path : "scalar" output, "straight" or "curved" path of a marker
    chord : straight distance [m] of a marker's extreme positions
    out, back : driver travel [rad] from low to high and from high to low; None unless the
        driver is one crank that makes a whole turn
    """

    FACTS = ("unit", "length", "path", "chord", "low", "high", "out", "back", "time_ratio", "notes")

    name: str
    unit: str
    length: float
    low: Extreme
    high: Extreme
    path: Path
    chord: float | None
    out: float | None
    back: float | None
    notes: tuple[str, ...] = ()

    @property
    def time_ratio(self) -> float | None:
        """Time of the slow stroke over that of the quick one at a constant driver rate [-]."""
        if not (self.out and self.back):
            return None
        return max(self.out, self.back) / min(self.out, self.back)

    def lines(self) -> Iterator[str]:
        """The stroke as a sentence."""
        length = with_unit(self.length, self.unit, self._display)
        low, high = (end.place(self._display) for end in (self.low, self.high))
        text = f"{self.name}  stroke {length}, from {low} to {high}"
        if not (self.path == "scalar" or self.low.end or self.high.end):
            text += ", where it stands: singular poses of the first kind (Gosselin, Angeles)"
        ratio = self.time_ratio
        yield text if ratio is None else f"{text}; time ratio {ratio:.6g}"
        yield from (f"note: {note}" for note in self.notes)

    def to_dict(self) -> Data:
        """The stroke as a JSON object."""
        return {"output": self.name, **super().to_dict()}


@declared
def stroke(
    source: Compiled | Result,
    name: str,
    *,
    friction: FrictionMethod | None = None,
    static: bool | None = None,
) -> Stroke:
    """Distance between the extreme positions of a marker or of a real output.

    Parameters
    ----------
    source : a mechanism or a result, as in `extremes`
    name : a place such as ``"slider.C.p"``, or a real output or part such as
        ``"dyad.j.angle"``, ``"dyad.C.p.x"``
    friction, static : as in `extremes`

    Raises
    ------
    RequestError for an output that is neither, a marker that never reverses or does not retrace
        its path, and a missing range
    SampleError where the output exists at no sample

    >>> print(m.compile().stroke("link.piston.p"))
    link.piston.p  stroke 0.1 m, from driver.motor.q = 3.14159265 rad to driver.motor.q = 0 ...
    """
    settings = {"friction": friction}
    cycle = cycle_of(source, **settings, static=static)
    output, parts = parts_of(cycle.mechanism, name)
    path: Path = "scalar"
    chord: float | None = None
    if len(parts) == 1:
        ends = turns_of(cycle, signal_of(cycle, output, parts[0]))
        if not math.isfinite(ends.high.value - ends.low.value):
            raise refused(name, "it grows without bound")
    elif output.endswith(".p"):
        ends, path, chord = _of_marker(cycle, output)
    else:
        raise refused(name, "not the position of a marker", "name a place, a real output or a part")
    low, high = ends.low, ends.high
    out = back = None
    if ends.closed and low.s != high.s:
        out = (-1 if cycle.backwards else 1) * (high.s - low.s) % TURN
        back = TURN - out
    unit, length = cycle.mechanism.outputs[output].unit, high.value - low.value
    extremes = extreme_at(cycle, low), extreme_at(cycle, high)
    stroke = Stroke(name, unit, length, *extremes, path, chord, out, back, cycle.notes)
    return stroke.to(*getattr(source, "_display", ()))


def _of_marker(cycle: Cycle, output: str) -> tuple[Turns, Path, float]:
    """Extreme positions of a marker by their value along its path, its kind, and the chord."""

    def read(s: Floats) -> NDArray[np.complex128]:
        return np.asarray(cycle.run(s, output)[output])

    z = read(cycle.places())
    if not np.isfinite(z).any():
        turns_of(cycle, signal_of(cycle, output, "x"))  # says what fails, and where
    z = z[np.isfinite(z)]
    middle, u, is_straight = (x[0] for x in principal_axes(z[None]))
    if not u:
        raise refused(output, "the marker does not move")

    def along(s: Floats) -> Floats:
        return np.asarray(((read(s) - middle) * u.conjugate()).real)

    signal = signal_of(cycle, output, "magnitude")._replace(value=along, smooth=along)
    turns = turns_of(cycle, signal) if is_straight else _curve(cycle, output)
    chord = float(abs(np.diff(read(np.array([turns.low.s, turns.high.s])))[0]))
    high = turns.high._replace(value=chord) if is_straight else turns.high
    path: Path = "straight" if is_straight else "curved"
    return turns._replace(low=turns.low._replace(value=0.0), high=high), path, chord


def _curve(cycle: Cycle, output: str) -> Turns:
    """The reversals of a marker on a curve, with the length of the path between them."""
    if cycle.by == "share":
        raise refused(output, "a curved path needs one driver, or laws of motion by time", ASK)

    def velocity(s: Floats) -> NDArray[np.complex128]:
        """Derivative of the place with respect to s: the velocity at unit rate."""
        request = cycle.request(s)
        request |= {"rates": 1.0, "accelerations": 0.0} if cycle.by == "coordinate" else {}
        return np.asarray(cycle.mechanism.run(want=rate, on_gap="mark", **request)[rate])

    rate = output.removesuffix("p") + "v"
    ends, *stretches = cycle.stretches(velocity)
    if stretches:
        raise refused(output, "its path consists of several pieces", ASK)
    closed = cycle.turns and ends == (cycle.low, cycle.high)
    marks = _reversals(cycle, velocity, ends, closed)
    if closed and len(marks) < 2:
        raise refused(output, "the marker runs round a closed path and never reverses", ASK)
    marks = [*marks, marks[0] + cycle.high - cycle.low] if closed else [ends[0], *marks, ends[1]]
    lengths = [0.0]
    for i, (a, b) in enumerate(pairwise(marks)):
        lengths.append(lengths[-1] + (-1) ** i * _length(velocity, Span(a, b)))
    if closed:
        distance = sum(abs(b - a) for a, b in pairwise(lengths))
        if abs(lengths[-1] - lengths[0]) > EQUAL * distance:
            raise refused(output, "the marker does not return along the same path", ASK)
        marks, lengths = [cycle.wrapped(s) for s in marks[:-1]], lengths[:-1]
    low, high = int(np.argmin(lengths)), int(np.argmax(lengths))
    last = Turn(marks[high], lengths[high] - lengths[low], 1)
    return Turns(Turn(marks[low], 0.0, -1), last, (), closed)


def _reversals(
    cycle: Cycle, velocity: Velocity, ends: tuple[float, float], closed: bool
) -> list[float]:
    """Where the speed vanishes and the velocity before and after points opposite ways."""
    span = Span(*ends, turn=closed)
    x, y = scan(lambda s: np.abs(velocity(s)) ** 2, span, panels(0.0, 1.0, cycle.panels))
    if closed:  # before the first place comes the last but one, a turn earlier
        x, y = np.append(x[-2] - (cycle.high - cycle.low), x), np.append(y[-2], y)
    still = (y[1:-1] <= y[:-2]) & (y[1:-1] <= y[2:]) & (y[1:-1] <= BLUR**2 * np.nanmax(y))
    i = np.flatnonzero(still) + 1
    if not len(i):
        return []
    before, after = velocity((x[i - 1] + x[i]) / 2), velocity((x[i] + x[i + 1]) / 2)
    turned: list[float] = x[i[(before * after.conj()).real < 0]].tolist()
    return turned


def _length(velocity: Velocity, span: Span) -> float:
    """Length of the path between two reversals."""

    def speed(u: Floats) -> Floats:
        return np.asarray(np.abs(velocity(span.place(u))) * span.slope(u))

    return float(fit(speed, panels(0.0, 1.0, 1), n=NODES).integral()(np.array([1.0]))[0])
