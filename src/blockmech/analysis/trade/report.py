"""The trade: a choice among measured settings; as a table, CSV, JSON and a sentence."""

from __future__ import annotations

import csv
import io
import math
import os
import platform
from dataclasses import dataclass
from typing import Any

import numpy as np

from blockmech.analysis.trade.points import ALIKE, NEARLY, Point, Reference, Skipped, as_fast, front
from blockmech.files import writing

USUAL = 1e-9  # target where neither a target nor a time limit is given
FASTER = 2.0  # an alternative is named if it is this many times faster


@dataclass(frozen=True)
class Trade:
    """Speed against accuracy for one question, measured.

    Attributes
    ----------
    mechanism : its name
    question : what was asked, in words
    measure : what the error is, in words
    counted : what the evaluations are, in words
    reference : what errors are measured against
    points : measured settings, method by method
    skipped : settings left out, with the reason
    notes : what a reader must know
    target, within : the wanted error, and the longest time of a run [s], or None
    spent : time that the whole took [s]
    """

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
        """Points that no other beats in both time and error, from fast to exact."""
        return front(self.points, "seconds")

    @property
    def pareto_by_evaluations(self) -> tuple[Point, ...]:
        """The same with kernel evaluations as the cost."""
        return front(self.points, "evaluations")

    def best(self, target: float | None = None, within: float | None = None) -> Point | None:
        """The setting to take for a target error, a time limit [s], or both; None without any.

        Within the target the fewest evaluations count, and among those within a factor
        1.5 of them the time, as far as it tells them apart: of those whose spreads overlap
        that of the fastest, the fewest evaluations again, then the smaller error if its
        quickest run is as quick. Without a target, 1e-9 is taken, or, if a time limit is
        given, the most exact setting; those within a factor 10 of it count as equal.
        """
        fit = [p for p in self.points if math.isfinite(p.error)]
        fit = [p for p in fit if within is None or p.seconds <= within]
        if target is None and within is None:
            target = USUAL
        if target is None:
            target = 10 * min((p.error for p in fit), default=math.inf)
        fit = [p for p in fit if p.error <= target]
        fewest = min((p.evaluations for p in fit), default=0)
        few = [p for p in fit if p.evaluations <= NEARLY * fewest]
        quickest = min((p.low for p in few), default=0.0)
        return min(
            as_fast(few),
            key=lambda p: (p.evaluations, p.low > ALIKE * quickest, p.error),
            default=None,
        )

    @property
    def recommended(self) -> Point | None:
        """The setting to take for this trade's own target and time limit."""
        return self.best(self.target, self.within)

    @property
    def recommendation(self) -> str:
        """The choice in one sentence, what a faster setting would cost, where errors are known."""
        return sentence(self)

    def series(self) -> dict[str, list[Point]]:
        """Points by method, in the order measured."""
        found: dict[str, list[Point]] = {}
        for point in self.points:
            found.setdefault(point.method, []).append(point)
        return found

    def text(self) -> str:
        """The trade as a table with its recommendation."""
        return text(self)

    def to_dict(self) -> dict[str, Any]:
        """The trade as JSON data; what is not finite is None."""
        return to_dict(self)

    def to_csv(self, path: str | os.PathLike[str] | None = None) -> str:
        """The points as CSV text, written to a file if a path is given."""
        return to_csv(self, path)

    def __str__(self) -> str:
        return self.text()


def duration(seconds: float) -> str:
    """A time with a unit that reads well.

    >>> duration(0.00042)
    '0.42 ms'
    """
    for factor, unit in ((1.0, "s"), (1e3, "ms")):
        if seconds * factor >= (1.0 if unit == "s" else 0.1):
            return f"{seconds * factor:.2g} {unit}" if seconds * factor < 100 else (
                f"{seconds * factor:.0f} {unit}")  # fmt: skip
    return f"{seconds * 1e6:.2g} µs"


def size(error: float) -> str:
    """An error in words of one digit."""
    return f"{error:.0e}".replace("e-0", "e-").replace("e+0", "e") if error else "0"


def sentence(trade: Trade) -> str:
    """The recommendation, and what a faster setting would cost."""
    best = trade.recommended
    if best is None:
        return _nothing(trade)
    head = f"{size(best.error)} in {duration(best.seconds)}: {best.label}"
    if trade.target is not None or trade.within is None:
        head = f"for {size(trade.target or USUAL)}, {head}"
    faster = [
        p for p in trade.pareto if p.seconds * FASTER <= best.seconds and p.error > best.error
    ]
    if not faster:
        return f"{head}; nothing here is twice as fast"
    other = min(faster, key=lambda p: (round(math.log10(p.error / best.error)), p.seconds))
    times = best.seconds / other.seconds
    digits = round(math.log10(other.error / best.error))
    price = f"{digits} digit{'s' * (digits > 1)}" if digits else "less than a digit"
    return f"{head}; {times:.1f} times faster costs {price} ({other.label})"


def _nothing(trade: Trade) -> str:
    sure = [p for p in trade.points if math.isfinite(p.error)]
    if not sure:
        why = f" ({trade.skipped[0].why})" if trade.skipped else ""
        return f"no setting was measured{why}: give a larger budget"
    closest = min(sure, key=lambda p: p.error)
    target = USUAL if trade.target is None and trade.within is None else trade.target
    asked = []
    if target is not None:
        asked.append(f"an error of {size(target)}")
        if trade.reference.floor > target:
            return (
                f"{asked[0]} cannot be confirmed: the reference itself is known to "
                f"{size(trade.reference.floor)} only; the best is {closest.label}"
            )
    if trade.within is not None:
        asked.append(f"a run within {duration(trade.within)}")
    return (
        f"no setting here gives {' and '.join(asked)}; the closest is {closest.label}: "
        f"{size(closest.error)} in {duration(closest.seconds)}"
    )


def text(trade: Trade) -> str:
    """Table with a star at the Pareto front, the reference, what was skipped, the sentence."""
    head = ("", "method", "setting", "time", "spread", "evaluations", "error")
    pareto = set(map(id, trade.pareto))
    rows = [_row(p, id(p) in pareto) for p in trade.points]
    widths = [max(map(len, column)) for column in zip(head, *rows, strict=True)]
    lines = [f"{trade.mechanism}, {trade.question}", ""]
    for row in (head, *rows):
        cells = [
            cell.ljust(w) if i < 3 else cell.rjust(w)
            for i, (cell, w) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append("  ".join(cells).rstrip())
    reference = trade.reference
    lines += [
        "",
        "* no other setting is both faster and more exact",
        f"time: median of at least 5 warm repeats; evaluations: {trade.counted}",
        f"error: {trade.measure}",
    ]
    if math.isfinite(reference.floor):
        lines.append(
            f"reference: {reference.method}; checked by {reference.check}, "
            f"known to {size(reference.floor)} (the floor)"
        )
    lines += [f"note: {note}" for note in trade.notes]
    reasons: dict[str, list[str]] = {}
    for s in trade.skipped:
        reasons.setdefault(s.why, []).append(s.label)
    lines += [f"skipped: {'; '.join(labels)}: {why}" for why, labels in reasons.items()]
    return "\n".join([*lines, f"measured in {trade.spent:.1f} s", "", sentence(trade)])


def _row(p: Point, best: bool) -> tuple[str, ...]:
    error = f"<= {p.error:.1e}" if p.below else f"{p.error:.1e}"
    spread = f"{duration(p.low)} .. {duration(p.high)}"
    cells = (duration(p.seconds), spread, f"{p.evaluations}", error)
    return ("*" if best else "", p.method, p.setting, *cells)


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


def to_dict(trade: Trade) -> dict[str, Any]:
    """The trade as JSON data; what is not finite is None."""
    best = trade.recommended
    pareto = set(map(id, trade.pareto))
    lean = set(map(id, trade.pareto_by_evaluations))
    return {
        "format": "blockmech/trade",
        "version": 1,
        "graph": trade.mechanism,
        "question": trade.question,
        "measure": trade.measure,
        "counted": trade.counted,
        "reference": {
            "method": trade.reference.method,
            "check": trade.reference.check,
            "floor": _finite(trade.reference.floor),
        },
        "points": [
            {
                "method": p.method,
                "setting": p.setting,
                "seconds": p.seconds,
                "fastest": p.low,
                "slowest": p.high,
                "repeats": p.repeats,
                "evaluations": p.evaluations,
                "error": _finite(p.error),
                "at_floor": p.below,
                "pareto": id(p) in pareto,
                "pareto_by_evaluations": id(p) in lean,
                "options": dict(p.options),
            }
            for p in trade.points
        ],
        "skipped": [{"setting": s.label, "why": s.why} for s in trade.skipped],
        "notes": list(trade.notes),
        "target": trade.target,
        "within": trade.within,
        "recommended": None if best is None else best.label,
        "recommendation": sentence(trade),
        "spent": trade.spent,
        "machine": machine(),
    }


def _finite(x: float) -> float | None:
    return x if math.isfinite(x) else None


def to_csv(trade: Trade, path: str | os.PathLike[str] | None = None) -> str:
    """One line a point; written whole or not at all if a path is given."""
    stream = io.StringIO(newline="")
    rows = csv.writer(stream, lineterminator="\n")
    rows.writerow(
        ["method", "setting", "seconds [s]", "fastest [s]", "slowest [s]", "repeats",
         "evaluations", "error", "at floor", "pareto", "floor"]
    )  # fmt: skip
    pareto = set(map(id, trade.pareto))
    for p in trade.points:
        rows.writerow(
            [p.method, p.setting, p.seconds, p.low, p.high, p.repeats, p.evaluations, p.error,
             int(p.below), int(id(p) in pareto), trade.reference.floor]
        )  # fmt: skip
    if path is not None:
        with writing(path) as out:
            out.write(stream.getvalue().encode())
    return stream.getvalue()
