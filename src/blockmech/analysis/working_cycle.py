"""The working cycle over which an output is followed, and the run of any place of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from blockmech.analysis.scan import NODES, TURN, runs
from blockmech.functions.roots import SCANNED, bisect
from blockmech.ground.errors import RequestError, refused
from blockmech.ground.tolerances import ROUNDING
from blockmech.model.laws_of_motion import LawOfMotion
from blockmech.result.remarks import missing_turns
from blockmech.result.result import Result
from blockmech.result.samples import Samples
from blockmech.typing import Arguments, Array, Data, Floats

if TYPE_CHECKING:
    from blockmech.compiled import Compiled

MOST = 50 * SCANNED  # steps of a range of many turns


@dataclass(frozen=True)
class Cycle:
    """A range of one parameter s, and the request that a place s stands for.

    Attributes
    ----------
    mechanism : the mechanism
    settings : friction and the like, for every run
    by : what s is: the only driver's "coordinate" [rad or m], the "time" [s], or the
        "share" [-] of the ranges of several drivers
    low, high : ends of the range
    request : places (n,) -> arguments of `Compiled.run`
    steps : samples of the range
    turns : whether the range is one or more whole turns of the only crank
    backwards : whether the driver's rate is negative
    """

    mechanism: Compiled
    settings: Arguments
    by: Literal["coordinate", "time", "share"]
    low: float
    high: float
    request: Callable[[Floats], Data]
    steps: int
    turns: bool = False
    backwards: bool = False

    def __post_init__(self) -> None:
        if self.low == self.high:
            raise no_range(self.by, "follow more than one place")

    def run(self, s: Floats, want: str) -> Result:
        """The wanted output at places s (n,); gaps are marked."""
        return self.mechanism.run(want=want, on_gap="mark", **(self.request(s) | self.settings))

    @property
    def panels(self) -> int:
        """Panels of a series over the range, with at least so many samples."""
        return math.ceil(self.steps / NODES)

    def places(self) -> Floats:
        """Equally spaced places from end to end."""
        return np.linspace(self.low, self.high, self.steps + 1)

    def places_of(self, samples: Samples) -> Floats:
        """Where samples of the cycle are."""
        if self.by == "coordinate":
            return samples.coordinate(0)
        return np.linspace(0.0, 1.0, samples.n) if samples.times is None else samples.times

    def wrapped(self, s: float) -> float:
        """A place of a whole turn inside the range: one at its very end is at its beginning."""
        span = self.high - self.low
        s = s + span if s < self.low - ROUNDING * span else s
        return s - span if s >= self.high - ROUNDING * span else s

    @property
    def notes(self) -> tuple[str, ...]:
        """What the range leaves out: turns of a mechanism that repeats after several."""
        ends = self.request(np.array([self.low, self.high]))
        names = ("at", "samples", "times", "rates", "accelerations")
        samples = self.mechanism.samples(*map(ends.get, names))
        return tuple(missing_turns(self.mechanism, samples.inputs))

    def stretches(self, value: Callable[[Floats], Array]) -> Iterator[tuple[float, float]]:
        """Ends of the stretches on which a value is finite, to rounding."""
        coordinates = self.places()

        def exists(s: float) -> bool:
            return bool(np.isfinite(value(np.array([s]))[0]))

        def edge(i: int, side: int) -> float:
            inside, last = float(coordinates[i]), not 0 <= i + side < len(coordinates)
            return inside if last else bisect(exists, inside, float(coordinates[i + side]))

        for a, b in runs(np.isfinite(value(coordinates))):
            yield edge(a, -1), edge(b, 1)

    def at(self, s: float) -> tuple[dict[str, float], float | None]:
        """Driver coordinates and, where the request says it, the time of a place."""
        run = self.run(np.array([s]), self.mechanism._of_driver(self.mechanism.drivers[0], "q"))
        time = math.nan if run.time is None else float(run.time[0])
        drivers = {name: float(q[0]) for name, q in run.drivers.items()}
        return drivers, time if math.isfinite(time) else None


def no_range(where: str, remedy: str) -> RequestError:
    """The error of a request over nothing."""
    return refused(where, "there is no range to follow", remedy, code="no-range")


def cycle_through(mechanism: Compiled, samples: Samples, settings: Arguments) -> Cycle:
    """The cycle that samples go through. Raises `RequestError` where they are no range."""
    if samples.times is not None:
        low, high = float(samples.times.min()), float(samples.times.max())
        return by_time(mechanism, settings, low, high, samples.n)
    columns = [samples.coordinate(i) for i in range(len(mechanism.drivers))]
    if len(columns) == 1:
        ends = float(columns[0].min()), float(columns[0].max())
        if samples.clock:
            return by_coordinate(mechanism, settings, *ends, samples.clock, n=samples.n)
        rates = [np.unique(np.asarray(samples.inputs[name])) for name in ("qd_0", "qdd_0")]
        if any(len(values) > 1 for values in rates):
            raise no_range("rates", "give the driver a law of motion in place of rates")
        rate, acceleration = (float(values[0]) for values in rates)
        rates_of_driver = {"rates": rate, "accelerations": acceleration}
        return by_coordinate(mechanism, settings, *ends, None, rates_of_driver, samples.n)
    even = [np.linspace(c[0], c[-1], len(c)) for c in columns]
    if not columns or not all(map(np.allclose, columns, even)):
        raise no_range("samples", "sample the drivers at equal steps, or by time")
    return by_share(mechanism, settings, [(float(c[0]), float(c[-1])) for c in columns], samples.n)


def by_coordinate(
    mechanism: Compiled,
    settings: Arguments,
    low: float,
    high: float,
    law: LawOfMotion | None,
    rates: Mapping[str, float] | None = None,
    n: int = 0,
) -> Cycle:
    """A range of the only driver's coordinate, by its law or at given rates."""
    driver_rates = dict(rates or {})
    rotary = mechanism.structure.driver_joint(mechanism.drivers[0]).rotary
    count = (high - low) / TURN if rotary else 0.0
    turns = round(count) >= 1 and abs(count - round(count)) <= ROUNDING * count
    if NODES * count > MOST:  # less than a panel a turn: what is between samples is not seen
        message = f"{count:.6g} turns take {NODES} samples each, of {MOST} in all"
        raise refused("range", message, f"follow {MOST // NODES} turns at most")
    steps = min(MOST, max(SCANNED, n - 1, math.ceil(SCANNED * count)))
    rate = driver_rates.get("rates", 0.0) if law is None else getattr(law, "rate", 0.0)

    def request(s: Floats) -> Data:
        return {"at": s, **driver_rates}

    return Cycle(
        mechanism, settings, "coordinate", low, high, request, steps, turns, float(rate) < 0
    )


def by_time(mechanism: Compiled, settings: Arguments, low: float, high: float, n: int = 0) -> Cycle:
    """A range of time [s], in which the drivers follow their laws of motion."""
    steps = 2 * max(SCANNED, n - 1)
    return Cycle(mechanism, settings, "time", low, high, lambda s: {"times": s}, steps)


def by_share(
    mechanism: Compiled, settings: Arguments, ends: list[tuple[float, float]], n: int = 0
) -> Cycle:
    """Straight from the first end of each driver [rad or m] to the second; places are shares."""

    def request(s: Floats) -> Data:
        pairs = zip(mechanism.drivers, ends, strict=True)
        return {"at": {d: a + s * (b - a) for d, (a, b) in pairs}}

    return Cycle(mechanism, settings, "share", 0.0, 1.0, request, max(SCANNED, n - 1))
