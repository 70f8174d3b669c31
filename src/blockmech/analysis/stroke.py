"""Stroke: how far a marker or an output goes to and fro, and how long each way takes.

A marker's extreme positions are the ends of its path: the farthest ones on a straight
line, the reversals on a curve that it runs to and fro. The stroke is measured along the
path. The time ratio is that of the slow stroke to the quick one at constant driver rate,
so it is a ratio of driver travel.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from blockmech.analysis.cycle import Cycle, cycle_of
from blockmech.analysis.extremes import Extreme, extreme_at, parts_of
from blockmech.analysis.follow import ALIKE, Signal, Turn, signal_of, stretches, turns_of
from blockmech.analysis.scan import NODES, Span, scan
from blockmech.errors import Problem, RequestError
from blockmech.series import EPS, Floats, fit, panels

if TYPE_CHECKING:
    from blockmech.compiled import Compiled
    from blockmech.result import Result

STANDS = 1e-6  # of the largest speed: below it a marker may reverse

Path = Literal["scalar", "straight", "curved"]


@dataclass(frozen=True)
class Stroke:
    """A stroke between two extreme positions.

    Attributes
    ----------
    name, unit : of the output
    length : along the path
    low, high : the extreme positions; of a marker, ``value`` is measured along the path
        from ``low``
    path : "scalar" output, "straight" or "curved" path of a marker
    chord : straight distance [m] of a marker's extreme positions
    out, back : driver travel [rad] from low to high and from high to low; None unless the
        driver is one crank that makes a whole turn
    """

    name: str
    unit: str
    length: float
    low: Extreme
    high: Extreme
    path: Path
    chord: float | None
    out: float | None
    back: float | None

    @property
    def time_ratio(self) -> float | None:
        """Time of the slow stroke over that of the quick one at constant driver rate [-]."""
        if self.out is None or self.back is None:
            return None
        return max(self.out, self.back) / min(self.out, self.back)

    def __str__(self) -> str:
        def place(at: Mapping[str, float]) -> str:
            return ", ".join(f"{d} = {q:.9g}" for d, q in at.items())

        text = (
            f"{self.name}  stroke {self.length:.9g} {self.unit}, from {place(self.low.at)} "
            f"to {place(self.high.at)}"
        )
        ratio = self.time_ratio
        return text if ratio is None else f"{text}; time ratio {ratio:.6g}"

    def to_dict(self) -> dict[str, Any]:
        """The stroke as a JSON object."""
        return {
            "output": self.name,
            "unit": self.unit,
            "length": self.length,
            "path": self.path,
            "chord": self.chord,
            "low": self.low.to_dict(),
            "high": self.high.to_dict(),
            "out": self.out,
            "back": self.back,
            "time_ratio": self.time_ratio,
        }


def stroke(source: Compiled | Result, name: str, **settings: Any) -> Stroke:
    """Distance between the extreme positions of a marker or of a real output.

    Parameters
    ----------
    source : a mechanism or a result, as in `extremes`
    name : a place such as ``"slider.C.p"``, or a real output or part such as
        ``"dyad.j.angle"``, ``"dyad.C.p.x"``
    settings : as in `extremes`

    Raises
    ------
    RequestError for an output that is neither, a marker that never reverses, a path that
        is not run to and fro, or no range to follow
    SampleError where the output exists at no sample
    """
    cycle = cycle_of(source, settings)
    output, parts = parts_of(cycle.mechanism, name)
    unit = cycle.mechanism.outputs[output].unit
    if len(parts) == 1:
        found = turns_of(cycle, signal_of(cycle, output, parts[0]))
        if not math.isfinite(found.high.value - found.low.value):
            raise _error(name, "it grows without bound", "")
        ends = _Ends(found.low, found.high, "scalar", None, found.closed)
        return _made(cycle, name, unit, ends)
    if not output.endswith(".p"):
        raise _error(name, "it is no place of a marker", "name a place, a real output or a part")
    return _made(cycle, name, unit, _of_marker(cycle, output))


class _Ends(NamedTuple):
    """Extreme positions, by their value along the path."""

    low: Turn
    high: Turn
    path: Path
    chord: float | None
    closed: bool  # whether the cycle is a whole turn after which the path repeats


def _made(cycle: Cycle, name: str, unit: str, ends: _Ends) -> Stroke:
    low, high = ends.low, ends.high
    out = back = None
    if ends.closed and low.s != high.s:
        out = math.fmod(cycle.rate * (high.s - low.s), 2 * math.pi)
        out = out + 2 * math.pi if out < 0 else out
        back = 2 * math.pi - out
    return Stroke(
        name,
        unit,
        high.value - low.value,
        extreme_at(cycle, low),
        extreme_at(cycle, high),
        ends.path,
        ends.chord,
        out,
        back,
    )


def _of_marker(cycle: Cycle, output: str) -> _Ends:
    def read(s: Floats) -> NDArray[np.complex128]:
        return np.asarray(cycle.run(s, output)[output])

    z = read(cycle.places())
    if not np.isfinite(z).any():
        turns_of(cycle, signal_of(cycle, output, "x"))  # says what fails, and where
    z = z[np.isfinite(z)]
    middle = complex(z[np.argmax(np.abs(z - z[0]))] + z[0]) / 2
    spread = float(np.abs(z - middle).max())
    if spread <= EPS * float(np.abs(z).max()):
        raise _error(output, "the marker does not move", "")
    # The principal axis of the samples: the square forgets which way along it they lie.
    u = complex(np.sqrt(((z - middle) ** 2).sum()))
    u /= abs(u)
    if float(np.abs(((z - middle) * u.conjugate()).imag).max()) > ALIKE * spread:
        return _along_curve(cycle, output)

    def along(s: Floats) -> Floats:
        return np.asarray(((read(s) - middle) * u.conjugate()).real)

    found = turns_of(cycle, Signal(output, along, along))
    chord = float(abs(np.diff(read(np.array([found.low.s, found.high.s])))[0]))
    low, high = found.low._replace(value=0.0), found.high._replace(value=chord)
    return _Ends(low, high, "straight", chord, found.closed)


# -- curved paths ------------------------------------------------------------------------


def _along_curve(cycle: Cycle, output: str) -> _Ends:
    """The reversals of a marker on a curve, with the length of the path between them."""
    path = _Curve(cycle, output)
    marks = path.marks()
    place = [0.0]
    for i, (a, b) in enumerate(pairwise(marks)):
        place.append(place[-1] + (-1) ** i * path.length(a, b))
    if path.closed:
        way = sum(abs(b - a) for a, b in pairwise(place))
        if abs(place[-1] - place[0]) > ALIKE * way:
            raise _error(
                output,
                "the marker does not return on the path it came on",
                "ask for the extremes of its x or y",
            )
        marks, place = marks[:-1], place[:-1]
    i, j = int(np.argmin(place)), int(np.argmax(place))
    ends = np.array([marks[i], marks[j]])
    chord = float(abs(np.diff(cycle.run(ends, output)[output])[0]))
    turn = [Turn(path.wrapped(marks[k]), place[k] - place[i], 1, False) for k in (i, j)]
    return _Ends(turn[0]._replace(sign=-1), turn[1], "curved", chord, path.closed)


class _Curve:
    """The path of one marker, run through along a cycle."""

    def __init__(self, cycle: Cycle, output: str) -> None:
        if cycle.by == "share":
            raise _error(
                output,
                "a curved path needs one driver, or laws of motion by time",
                "ask for the extremes of its x or y",
            )
        self.cycle = cycle
        self.output = output
        self.rate = output.removesuffix("p") + "v"
        good = np.isfinite(self.velocity(cycle.places()))
        whole = list(stretches(cycle, good, self.velocity))
        if len(whole) > 1:
            raise _error(output, "its path is not in one piece", "ask for the extremes of x or y")
        self.ends = whole[0]
        self.closed = cycle.turns and bool(good.all())

    def velocity(self, s: Floats) -> NDArray[np.complex128]:
        """Derivative of the place with respect to s: the velocity at unit rate."""
        given = self.cycle.request(s)
        if self.cycle.by == "coordinate":
            given |= {"rates": 1.0, "accelerations": 0.0}
        run = self.cycle.mechanism.run(want=self.rate, on_gap="mark", **given)
        return np.asarray(run[self.rate])

    def marks(self) -> list[float]:
        """Reversals in order; with the ends of an open path, or the first one again.

        The speed vanishes there, and the velocity before and after points opposite ways.
        """
        span, count = Span(*self.ends, turn=self.closed), self.cycle.panels
        found = scan(lambda s: np.abs(self.velocity(s)) ** 2, span, panels(0.0, 1.0, count))
        x, y = found.x, found.y
        if self.closed:  # before the first place comes the last but one, a turn earlier
            turn = self.cycle.high - self.cycle.low
            x, y = np.append(x[-2] - turn, x), np.append(y[-2], y)
        still = (y[1:-1] <= y[:-2]) & (y[1:-1] <= y[2:]) & (y[1:-1] <= STANDS**2 * np.nanmax(y))
        i = np.flatnonzero(still) + 1
        around = zip(x[i].tolist(), x[i - 1].tolist(), x[i + 1].tolist(), strict=True)
        turned = [s for s, low, high in around if self._turns(s, low, high)]
        if not self.closed:
            return [self.ends[0], *turned, self.ends[1]]
        if len(turned) < 2:
            raise _error(
                self.output,
                "the marker runs round a closed path and never reverses",
                "ask for the extremes of its x or y",
            )
        return [*turned, turned[0] + self.cycle.high - self.cycle.low]

    def _turns(self, s: float, low: float, high: float) -> bool:
        """Whether the marker comes back where it stands still, between two other places."""
        before, after = self.velocity(np.array([(low + s) / 2, (s + high) / 2]))
        return bool((before * after.conj()).real < 0)

    def length(self, a: float, b: float) -> float:
        """Length of the path between two reversals."""
        span = Span(a, b)

        def speed(u: Floats) -> Floats:
            return np.asarray(np.abs(self.velocity(span.place(u))) * span.slope(u))

        return float(fit(speed, panels(0.0, 1.0, 1), n=NODES).integral()(np.array([1.0]))[0])

    def wrapped(self, s: float) -> float:
        """A place of a closed cycle inside its range."""
        span = self.cycle.high - self.cycle.low
        if not self.closed or self.cycle.low <= s < self.cycle.high:
            return s
        return s + span if s < self.cycle.low else s - span


def _error(where: str, found: str, remedy: str) -> RequestError:
    return RequestError(Problem("bad-request", where, found, "", remedy))
