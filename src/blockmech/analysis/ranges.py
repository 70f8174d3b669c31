"""Which cycle an output is followed over: a law's range, a turn, or that of a result's samples."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from blockmech.analysis.limits import limits
from blockmech.analysis.scan import TURN
from blockmech.analysis.working_cycle import SAME, Cycle, no_range
from blockmech.result import Result
from blockmech.samples import Samples
from blockmech.series import SCANNED, Floats

if TYPE_CHECKING:
    from blockmech.compiled import Compiled

MOST = 50 * SCANNED  # steps of a range of many turns


def cycle_of(source: Compiled | Result, **given: Any) -> Cycle:
    """The cycle of a mechanism (its law's range, or a turn) or of a result (its samples).

    ``given`` are friction, tolerance, iterations and static; None is what the source has.
    Raises `RequestError` where there is no range to follow.
    """
    settings = {k: x for k, x in given.items() if x is not None}
    if isinstance(source, Result):
        return cycle_through(source.mechanism, source.samples, {**source.settings, **settings})
    drivers, drive = source.drivers, source.scene.drive
    laws: list[Any] = [drive.get(d) for d in drivers]
    if len(drivers) == 1 and (laws[0] is None or laws[0].by_coordinate):
        return _by_coordinate(source, settings, *_range_of(source, laws[0]), laws[0])
    missing = [d for d, law in zip(drivers, laws, strict=True) if law is None]
    if missing or not drivers:
        raise no_range(missing[0] if missing else "mechanism", "give every driver a law of motion")
    if all(law.by_coordinate for law in laws):
        return _by_share(source, settings, [law.travelled for law in laws])
    duration = max(x for law in laws if math.isfinite(x := law.duration()))
    return _by_time(source, settings, 0.0, duration)


def _range_of(mechanism: Compiled, law: Any) -> tuple[float, float]:
    """Ends of the only driver's range: those of its law, or a turn, which cuts no feasible arc."""
    (driver,) = mechanism.drivers
    rotary = mechanism.driver_joint(driver).rotary
    low, high = (0.0, 0.0) if law is None else sorted((float(law.start), float(law.end)))
    if low == high and not rotary:
        raise no_range(driver, 'give the driver a law of motion with "from" and "to"')
    turn = low == high or (law.law == "constant_rate" and abs(high - low - TURN) <= SAME * TURN)
    if rotary and turn:
        closure = limits(mechanism)
        if not closure.whole_turn and closure.arcs:
            low = (closure.arcs[-1].end.q - TURN + closure.arcs[0].start.q) / 2
        return low, low + TURN
    return low, high


def cycle_through(mechanism: Compiled, samples: Samples, settings: Mapping[str, Any]) -> Cycle:
    """The cycle that samples go through. Raises `RequestError` where they are no range."""
    if samples.times is not None:
        low, high = float(samples.times.min()), float(samples.times.max())
        return _by_time(mechanism, settings, low, high, samples.n)
    columns = [samples.coordinate(i) for i in range(len(mechanism.drivers))]
    if len(columns) == 1:
        ends = float(columns[0].min()), float(columns[0].max())
        if samples.clock:
            return _by_coordinate(mechanism, settings, *ends, samples.clock, n=samples.n)
        rates = [np.unique(np.asarray(samples.inputs[name])) for name in ("qd_0", "qdd_0")]
        if any(len(values) > 1 for values in rates):
            raise no_range("rates", "give the driver a law of motion in place of rates")
        rate, acceleration = (float(values[0]) for values in rates)
        more = {"rates": rate, "accelerations": acceleration}
        return _by_coordinate(mechanism, settings, *ends, None, more, samples.n)
    even = [np.linspace(c[0], c[-1], len(c)) for c in columns]
    if not columns or not all(map(np.allclose, columns, even)):
        raise no_range("samples", "sample the drivers at equal steps, or by time")
    ranges = [(float(c[0]), float(c[-1])) for c in columns]
    return _by_share(mechanism, settings, ranges, samples.n)


def _by_coordinate(
    mechanism: Compiled,
    settings: Mapping[str, Any],
    low: float,
    high: float,
    law: Any,
    rates: Mapping[str, float] | None = None,
    n: int = 0,
) -> Cycle:
    """A range of the only driver's coordinate, by its law or at given rates."""
    more = dict(rates or {})
    rotary = mechanism.driver_joint(mechanism.drivers[0]).rotary
    count = (high - low) / TURN if rotary else 0.0
    whole = round(count) >= 1 and abs(count - round(count)) <= SAME * count
    steps = min(MOST, max(SCANNED, n - 1, math.ceil(SCANNED * count)))
    rate = more.get("rates", 0.0) if law is None else getattr(law, "rate", 0.0)

    def request(s: Floats) -> dict[str, Any]:
        return {"at": s, **more}

    return Cycle(
        mechanism, settings, "coordinate", low, high, request, steps, whole, float(rate) < 0
    )


def _by_time(
    mechanism: Compiled, settings: Mapping[str, Any], low: float, high: float, n: int = 0
) -> Cycle:
    steps = 2 * max(SCANNED, n - 1)
    return Cycle(mechanism, settings, "time", low, high, lambda s: {"times": s}, steps)


def _by_share(
    mechanism: Compiled, settings: Mapping[str, Any], ends: list[tuple[float, float]], n: int = 0
) -> Cycle:
    def request(s: Floats) -> dict[str, Any]:
        pairs = zip(mechanism.drivers, ends, strict=True)
        return {"at": {d: a + s * (b - a) for d, (a, b) in pairs}}

    return Cycle(mechanism, settings, "share", 0.0, 1.0, request, max(SCANNED, n - 1))
