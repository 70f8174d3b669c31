"""The cycle over which an output is followed, and how to ask for any place of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from blockmech.analysis.limits import limits
from blockmech.analysis.scan import NODES, TURN
from blockmech.errors import Problem, RequestError
from blockmech.series import Floats

if TYPE_CHECKING:
    from blockmech.compiled import Compiled
    from blockmech.result import Result

STEPS = 720  # of a turn, or of a range
MOST = 36_000  # steps of a long range
SAME = 1e-12  # of a range, of places and numbers of turns that count as the same

By = Literal["coordinate", "time", "share"]


@dataclass(frozen=True)
class Cycle:
    """A range of one parameter s, and the request that a place s stands for.

    Attributes
    ----------
    mechanism : the mechanism
    low, high : ends of the range
    by : what s is: the only driver's "coordinate" [rad or m], the "time" [s], or the
        "share" [-] of the ranges of several drivers
    request : places (n,) -> arguments of `Compiled.run`
    settings : friction and the like, for every run
    turns : whether the range is one or more whole turns of the only crank
    rate : sign of the driver's rate, +1 where it has none
    steps : samples of the range
    """

    mechanism: Compiled
    low: float
    high: float
    by: By
    request: Callable[[Floats], dict[str, Any]]
    settings: Mapping[str, Any]
    turns: bool
    rate: int
    steps: int

    def run(self, s: Floats, want: str) -> Result:
        """The wanted output at places s (n,); gaps are marked."""
        given = {**self.request(s), **self.settings}
        return self.mechanism.run(want=want, on_gap="mark", **given)

    @property
    def panels(self) -> int:
        """Panels of a series over the range, with at least so many samples."""
        return math.ceil(self.steps / NODES)

    def places(self) -> Floats:
        """Equally spaced places from end to end."""
        return np.linspace(self.low, self.high, self.steps + 1)

    def at(self, s: float) -> tuple[dict[str, float], float | None]:
        """Driver coordinates and, where the request says it, the time of a place."""
        first = self.mechanism.of_driver(self.mechanism.drivers[0], "q")
        run = self.run(np.array([s]), first)
        time = None if run.time is None else float(run.time[0])
        time = time if time is None or math.isfinite(time) else None
        return {name: float(q[0]) for name, q in run.drivers.items()}, time


def cycle_of(source: Compiled | Result, settings: Mapping[str, Any]) -> Cycle:
    """The cycle of a mechanism (its law's range, or a turn) or of a result (its samples).

    Raises `RequestError` where there is no range to follow.
    """
    from blockmech.result import Result

    if isinstance(source, Result):
        return _of_result(source, settings)
    return _of_mechanism(source, settings)


def _of_mechanism(mechanism: Compiled, settings: Mapping[str, Any]) -> Cycle:
    drivers = mechanism.drivers
    laws: dict[str, Any] = {
        d: mechanism.scene.drive[d] for d in drivers if d in mechanism.scene.drive
    }
    if len(drivers) == 1:
        law = laws.get(drivers[0])
        rotary = mechanism.driver_joint(drivers[0]).rotary
        if law is None or (law.by_coordinate and law.start == law.end):
            if not rotary:
                raise _no_range(drivers[0], 'give the driver a law of motion with "from" and "to"')
            start = 0.0 if law is None else float(law.start)
            low = _before_arcs(mechanism, start)
            return _by_coordinate(mechanism, low, low + TURN, settings, STEPS, law)
        if law.by_coordinate:
            low, high = sorted((float(law.start), float(law.end)))
            if rotary and law.law == "constant_rate" and abs(high - low - TURN) <= SAME * TURN:
                low = _before_arcs(mechanism, low)
                high = low + TURN
            return _by_coordinate(mechanism, low, high, settings, STEPS, law)
    missing = [d for d in drivers if d not in laws]
    if missing or not drivers:
        raise _no_range(missing[0] if missing else "mechanism", "give every driver a law of motion")
    if all(law.by_coordinate for law in laws.values()):
        ends = {d: (float(law.start), float(law.end)) for d, law in laws.items()}
        return _by_share(mechanism, ends, settings, STEPS)
    duration = max(x for law in laws.values() if math.isfinite(x := law.duration()))
    return _by_time(mechanism, 0.0, duration, settings, STEPS)


def _before_arcs(mechanism: Compiled, start: float) -> float:
    """Where to begin a turn so that it cuts no feasible arc."""
    found = limits(mechanism)
    if found.whole_turn or not found.arcs:
        return start
    return (found.arcs[-1].end.q - TURN + found.arcs[0].start.q) / 2


def _of_result(result: Result, settings: Mapping[str, Any]) -> Cycle:
    mechanism, samples = result.mechanism, result.samples
    known = {**result.settings, **settings}
    steps = max(STEPS, result.n - 1)
    if samples.times is not None:
        low, high = float(samples.times.min()), float(samples.times.max())
        return _by_time(mechanism, low, high, known, steps)
    columns = [samples.coordinate(i) for i in range(len(mechanism.drivers))]
    if len(columns) == 1:
        low, high = float(columns[0].min()), float(columns[0].max())
        law = samples.clock
        rates = None if law else (_one(samples.inputs["qd_0"]), _one(samples.inputs["qdd_0"]))
        return _by_coordinate(mechanism, low, high, known, steps, law, rates)
    even = [np.linspace(c[0], c[-1], len(c)) for c in columns]
    if not columns or not all(map(np.allclose, columns, even)):
        raise _no_range("samples", "sample the drivers at equal steps, or by time")
    ends = {d: (float(c[0]), float(c[-1])) for d, c in zip(mechanism.drivers, columns, strict=True)}
    return _by_share(mechanism, ends, known, steps)


def _one(column: Any) -> float:
    """The one value of a column. Raises `RequestError` where there are several."""
    values = np.unique(np.asarray(column, dtype=float))
    if len(values) > 1:
        raise _no_range("rates", "give the driver a law of motion in place of rates")
    return float(values[0])


def _by_coordinate(
    mechanism: Compiled,
    low: float,
    high: float,
    settings: Mapping[str, Any],
    steps: int,
    law: Any,
    rates: tuple[float, float] | None = None,
) -> Cycle:
    driver = mechanism.drivers[0]
    if low == high:
        raise _no_range(driver, "follow more than one place")
    rotary = mechanism.driver_joint(driver).rotary
    count = (high - low) / TURN
    whole = rotary and round(count) >= 1 and abs(count - round(count)) <= SAME * count
    steps = min(MOST, max(steps, math.ceil(STEPS * count))) if rotary else steps
    more: dict[str, Any] = {}
    if rates is not None:
        more = {"rates": rates[0], "accelerations": rates[1]}
    rate = float(getattr(law, "rate", 0.0)) if law is not None else more.get("rates", 0.0)
    return Cycle(
        mechanism,
        low,
        high,
        "coordinate",
        lambda s: {"at": s, **more},
        settings,
        whole,
        -1 if rate < 0 else 1,
        steps,
    )


def _by_time(
    mechanism: Compiled, low: float, high: float, settings: Mapping[str, Any], steps: int
) -> Cycle:
    if low == high:
        raise _no_range("times", "follow more than one time")
    return Cycle(
        mechanism, low, high, "time", lambda s: {"times": s}, settings, False, 1, 2 * steps
    )


def _by_share(
    mechanism: Compiled,
    ends: Mapping[str, tuple[float, float]],
    settings: Mapping[str, Any],
    steps: int,
) -> Cycle:
    def request(s: Floats) -> dict[str, Any]:
        return {"at": {d: a + s * (b - a) for d, (a, b) in ends.items()}}

    return Cycle(mechanism, 0.0, 1.0, "share", request, settings, False, 1, steps)


def _no_range(where: str, remedy: str) -> RequestError:
    return RequestError(Problem("no-range", where, "there is no range to follow", "", remedy))
