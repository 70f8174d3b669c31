"""The trade: a choice among measured settings; as a table, CSV, JSON and a sentence."""

from __future__ import annotations

import math
import platform
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from blockmech.analysis.trade.measure import Point, Reference, Skipped, cheaper, front
from blockmech.ground.pictured import Pictured
from blockmech.ground.report import DEGREES, Facts, as_json
from blockmech.result.exported import CsvTable, aligned

USUAL = 1e-9  # target where neither a target nor a time limit is given
FASTER = 2.0  # an alternative is named if it is this many times faster

HEAD = ("", "method", "setting", "time", "spread", "evaluations", "error", "of")


@dataclass(frozen=True, repr=False)
class Trade(CsvTable, Facts, Pictured):
    """Speed against accuracy for one question, measured.

    Attributes
    ----------
    mechanism : its name
    question : what was asked, in words
    measure : what the error is, in words
    counted : what the evaluations are, in words
    reference : what errors are measured against
    points : measured settings, from coarse to fine
    skipped : settings left out, with the reason
    notes : what a reader must know
    target, within : the wanted error, and the longest time of a run [s], or None
    spent : processor time that the whole took [s]
    """

    PICTURE = "blockmech.draw.trade:trade_figure"

    FACTS = (
        *("question", "measure", "counted", "reference", "notes", "target", "within", "spent"),
        "recommendation",
    )

    mechanism: str
    question: str
    measure: str
    counted: str
    reference: Reference
    points: tuple[Point, ...]
    skipped: tuple[Skipped, ...] = ()
    notes: tuple[str, ...] = ()
    target: float | None = None
    within: float | None = None
    spent: float = 0.0

    @property
    def pareto(self) -> tuple[Point, ...]:
        """Points that no other beats in both time and error, from fast to exact.

        None of them has an error as large as the answer itself.
        """
        return front(self.points, "seconds")

    @property
    def pareto_by_evaluations(self) -> tuple[Point, ...]:
        """The same with kernel evaluations as the cost."""
        return front(self.points, "evaluations")

    def beaten_by(self, point: Point) -> Point | None:
        """The fastest setting that is both faster, beyond the noise, and more exact than one."""
        better = (p for p in self.points if p.error < point.error and cheaper(p, point))
        return min(better, key=lambda p: p.seconds, default=None)

    def best(self, target: float | None = None, within: float | None = None) -> Point | None:
        """The setting of the front to take for a target error, a time limit [s], or both.

        The fastest within the target, by default 1e-9; where only a time limit is given, the
        most exact within it. None where no setting fits.
        """
        fit = [p for p in self.pareto if within is None or p.seconds <= within]
        if target is None and within is not None:
            return fit[-1] if fit else None
        wanted = USUAL if target is None else target
        return next((p for p in fit if p.error <= wanted), None)

    @property
    def recommended(self) -> Point | None:
        """The setting to take for this trade's own target and time limit."""
        return self.best(self.target, self.within)

    @property
    def recommendation(self) -> str:
        """The choice in one sentence, what a faster setting would cost, where errors are known."""
        best = self.recommended
        if best is None:
            return _nothing(self)
        head = f"{size(best.error)} in {duration(best.seconds)}: {best.label}"
        if self.target is not None or self.within is None:
            head = f"for {size(self.target or USUAL)}, {head}"
        faster = [p for p in self.pareto if p.seconds * FASTER <= best.seconds]
        if not faster:
            return f"{head}; nothing here is twice as fast"
        other = faster[-1]  # the most exact of them
        digits = round(math.log10(other.error / best.error))
        price = f"{digits} digit{'s' * (digits > 1)}" if digits else "less than a digit"
        times = best.seconds / other.seconds
        return f"{head}; {times:.1f} times faster costs {price} ({other.label})"

    def series(self) -> dict[str, list[Point]]:
        """Points by method, in the order measured."""
        by_method: dict[str, list[Point]] = {}
        for point in self.points:
            by_method.setdefault(point.method, []).append(point)
        return by_method

    def lines(self, degrees: bool = DEGREES) -> Iterator[str]:
        """The table with a star at the front, the reference, what was skipped, the sentence."""
        pareto, reference = self.pareto, self.reference
        rows = [_row(p, p in pareto) for series in self.series().values() for p in series]
        yield from (f"{self.mechanism}, {self.question}", "", *aligned(HEAD, rows), "")
        yield "* no other setting is both faster, beyond the noise, and at least as exact"
        beaten: dict[str, list[str]] = {}
        for point in self.points:
            if (better := self.beaten_by(point)) is not None:
                beaten.setdefault(better.label, []).append(point.label)
        for better_one, labels in beaten.items():
            yield f"beaten in time and in error by {better_one}: {'; '.join(labels)}"
        yield (
            "time: least processor time of the warm repeats, which take turns, or of one run; "
            f"evaluations: {self.counted}"
        )
        yield f"error: {self.measure}"
        if math.isfinite(reference.floor):
            yield (
                f"reference: {reference.method}; checked by {reference.check}, "
                f"known to {size(reference.floor)} (the floor)"
            )
        yield from (f"note: {note}" for note in self.notes)
        reasons: dict[str, list[str]] = {}
        for s in self.skipped:
            reasons.setdefault(s.why, []).append(s.label)
        yield from (f"skipped: {'; '.join(labels)}: {why}" for why, labels in reasons.items())
        yield from (f"measured in {self.spent:.1f} s", "", self.recommendation)

    def to_dict(self) -> dict[str, Any]:
        """The trade as JSON data; what is not finite is None."""
        best, lean = self.recommended, self.pareto_by_evaluations
        points = [row | {"pareto_by_evaluations": p in lean} for p, row in self._rows()]
        return {
            "format": "blockmech/trade",
            "version": 1,
            "graph": self.mechanism,
            **super().to_dict(),
            "points": as_json(points),
            "skipped": [{"setting": s.label, "why": s.why} for s in self.skipped],
            "recommended": None if best is None else best.label,
            "machine": machine(),
        }

    def csv_rows(self) -> tuple[list[str], Iterable[Iterable[Any]]]:
        """The points, one a row."""
        rows = [row | {"floor": self.reference.floor} for _, row in self._rows()]
        names = [name for name in (rows[0] if rows else {}) if name != "options"]
        times = ("seconds", "slowest")
        head = [f"{name} [s]" if name in times else name for name in names]
        return head, ([row[name] for name in names] for row in rows)

    def _rows(self) -> list[tuple[Point, dict[str, Any]]]:
        """Points, and each as data."""
        rows, pareto = [], self.pareto
        for p in self.points:
            better = self.beaten_by(p)
            more = {"pareto": p in pareto, "beaten_by": "" if better is None else better.label}
            rows.append((p, asdict(p) | more))
        return rows


def duration(seconds: float) -> str:
    """A time with a unit that reads well.

    >>> duration(0.00042)
    '420 µs'
    """
    factor, unit = next(
        (row for row in ((1, "s"), (1e3, "ms")) if seconds * row[0] >= 1), (1e6, "µs")
    )
    x = seconds * factor
    return f"{x:.2g} {unit}" if x < 100 else f"{x:.0f} {unit}"


def size(error: float) -> str:
    """An error in words of one digit."""
    return f"{error:.0e}".replace("e-0", "e-").replace("e+0", "e") if error else "0"


def machine() -> dict[str, str]:
    """The machine and the versions that a measurement belongs to."""
    from importlib.metadata import version  # slow to load

    return {
        "blockmech": version("blockmech"),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "system": platform.system(),
        "processor": platform.machine(),
    }


def _nothing(trade: Trade) -> str:
    """Why no setting is recommended, and what comes closest within the time."""
    if not trade.points:
        why = f" ({trade.skipped[0].why})" if trade.skipped else ""
        return f"no setting was measured{why}: give a larger budget"
    target, within = trade.target, trade.within
    if target is None and within is None:
        target = USUAL
    in_time = [p for p in trade.points if within is None or p.seconds <= within]
    closest = min(in_time or trade.points, key=lambda p: (p.error, p.seconds))
    if target is not None and trade.reference.floor > target:
        return (
            f"an error of {size(target)} cannot be confirmed: the reference itself is known to "
            f"{size(trade.reference.floor)} only; the best is {closest.label}"
        )
    wishes = [f"an error of {size(target)}"] if target is not None else []
    wishes += [f"a run within {duration(within)}"] if within is not None else []
    return (
        f"no setting here gives {' and '.join(wishes)}; the closest is {closest.label}: "
        f"{size(closest.error)} in {duration(closest.seconds)}"
    )


def _row(p: Point, best: bool) -> tuple[str, ...]:
    error = f"<= {p.error:.1e}" if p.at_floor else f"{p.error:.1e}"
    spread = f"to {duration(p.slowest)}" if p.repeats > 1 else "one run"
    cells = (duration(p.seconds), spread, f"{p.evaluations}", error)
    return ("*" if best else "", p.method, p.span, *cells, "" if p.at_floor else p.worst)
