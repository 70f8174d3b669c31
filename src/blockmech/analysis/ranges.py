"""Which cycle an output is followed over: a law's range, a turn, or that of a result's samples."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from blockmech.analysis.limits import limits
from blockmech.analysis.scan import TURN
from blockmech.analysis.working_cycle import (
    Cycle,
    by_coordinate,
    by_share,
    by_time,
    cycle_through,
    no_range,
)
from blockmech.ground.tolerances import ROUNDING
from blockmech.model.laws_of_motion import ConstantRate, OverRange
from blockmech.result.result import Result

if TYPE_CHECKING:
    from blockmech.compiled import Compiled


def cycle_of(source: Compiled | Result, **options: Any) -> Cycle:
    """The cycle of a mechanism (its law's range, or a turn) or of a result (its samples).

    ``options`` are friction and static; None is what the source has.
    Raises `RequestError` where there is no range to follow.
    """
    settings = {k: x for k, x in options.items() if x is not None}
    if isinstance(source, Result):
        return cycle_through(source.mechanism, source.samples, {**source.settings, **settings})
    drivers, drive = source.drivers, source.scene.drive
    laws = [drive.get(d) for d in drivers]
    if len(drivers) == 1 and isinstance(laws[0], OverRange | None):
        return by_coordinate(source, settings, *_range_of(source, laws[0]), laws[0])
    missing = [d for d, law in zip(drivers, laws, strict=True) if law is None]
    if missing or not drivers:
        raise no_range(missing[0] if missing else "mechanism", "give every driver a law of motion")
    ranges = [law.travelled for law in laws if isinstance(law, OverRange)]
    if len(ranges) == len(laws):
        return by_share(source, settings, ranges)
    duration = max(x for law in laws if law and math.isfinite(x := law.duration()))
    return by_time(source, settings, 0.0, duration)


def _range_of(mechanism: Compiled, law: OverRange | None) -> tuple[float, float]:
    """Ends of the only driver's range: those of its law, or a turn, which cuts no feasible arc."""
    (driver,) = mechanism.drivers
    rotary = mechanism.structure.driver_joint(driver).rotary
    low, high = (0.0, 0.0) if law is None else sorted((float(law.start), float(law.end)))
    if not rotary and (low == high or law is None or "end" not in law.model_fields_set):
        raise no_range(driver, 'give its law of motion a start and end, in a file "from" and "to"')
    constant = isinstance(law, ConstantRate)
    turn = low == high or (constant and abs(high - low - TURN) <= ROUNDING * TURN)
    if rotary and turn:
        closure = limits(mechanism)
        if not closure.whole_turn and closure.arcs:
            low = (closure.arcs[-1].end.q - TURN + closure.arcs[0].start.q) / 2
        return low, low + TURN
    return low, high
