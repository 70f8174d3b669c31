"""The trade: a choice among measured settings; as a table, CSV, JSON and a sentence."""

from __future__ import annotations

import math
import platform
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from blockmech.analysis.trade.measure import Point, Reference, Skipped, cheaper, front
from blockmech.dynamics.estimate import TARGET
from blockmech.figures import palette as ink
from blockmech.figures.panels import log_ticks, power_of_ten
from blockmech.figures.paper import Pictured, legend_above, panelled, shown_name
from blockmech.ground.report import Facts, as_json
from blockmech.result.spreadsheet import CsvTable
from blockmech.result.tables import aligned
from blockmech.typing import Arguments, Data

if TYPE_CHECKING:
    from matplotlib.axes import Axes

T = TypeVar("T")
FASTER = 2.0  # an alternative is named if it is this many times faster

HEAD = ("", "method", "setting", "time", "spread", "evaluations", "error", "of")
PANEL = 22.5 * ink.TEXT  # [pt] height of a panel of a picture with what is below it
MARKS = "osD^vPX*<>hp"
MARK = 0.425 * ink.TEXT  # [pt] size of a point
LABEL = 0.75 * ink.TEXT  # [pt] size of the settings' labels
SPOTS = ((5, 5), (5, -5), (-5, 5), (-5, -5), (0, 8), (0, -8))  # [pt] of a label, tried in turn
COSTS = {"seconds": "time of one run [s]", "evaluations": "kernel evaluations [–]"}


@dataclass(frozen=True, repr=False)
class Trade(CsvTable, Facts, Pictured):
    """Speed against accuracy for one question, measured.

    Attributes
    ----------
    mechanism : its name
    question : the request, in words measure : definition of the error, in words counted :
    definition of the evaluations, in words reference : the run to which errors refer
    points : measured settings, from coarse to fine
    skipped : settings left out, with the reason
    notes : remarks for the reader
    target, within : the wanted error, and the longest time of a run [s], or None
    spent : total processor time [s]
    """

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
        """Pareto-optimal points in time and error, from fast to exact.

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
        """The setting of the front that fits a target error, a time limit [s], or both.

        The fastest within the target, by default 1e-9; where only a time limit is given, the
        most exact within it. None where no setting fits.
        """
        fit = [p for p in self.pareto if within is None or p.seconds <= within]
        if target is None and within is not None:
            return fit[-1] if fit else None
        largest_error = TARGET if target is None else target
        return next((p for p in fit if p.error <= largest_error), None)

    @property
    def recommended(self) -> Point | None:
        """The recommended setting for the target and time limit of this study."""
        return self.best(self.target, self.within)

    @property
    def recommendation(self) -> str:
        """The recommendation in one sentence, with the error of a faster setting, if known."""
        best = self.recommended
        if best is None:
            return _nothing(self)
        head = f"{size(best.error)} in {duration(best.seconds)}: {best.label}"
        if self.target is not None or self.within is None:
            head = f"for {size(self.target or TARGET)}, {head}"
        faster = [p for p in self.pareto if p.seconds * FASTER <= best.seconds]
        if not faster:
            return f"{head}; nothing here is twice as fast"
        alternative = faster[-1]  # the most exact of them
        digits = round(math.log10(alternative.error / best.error))
        price = f"{digits} digit{'s' * (digits > 1)}" if digits else "less than a digit"
        times = best.seconds / alternative.seconds
        return f"{head}; {times:.1f} times faster costs {price} ({alternative.label})"

    def series(self) -> dict[str, list[Point]]:
        """Points by method, in the order measured."""
        return grouped((p.method, p) for p in self.points)

    def figure(self, ax: Axes | None = None) -> Any:
        """The work-precision diagram: error over cost, log-log, one series a method.

        The Pareto front is a broad line behind, the floor of the reference hatched. Above the
        cost in seconds, below in kernel evaluations.
        """
        series = self.series()
        height = len(COSTS) * PANEL + ink.ROW * len(series) / 2
        layout: Arguments = {"sharex": False, "ax": ax}
        with panelled(self._caption(), height, len(COSTS), **layout) as panels:
            for (axes,), (cost, axis_label) in zip(panels, COSTS.items(), strict=True):
                axes.set_xlabel(axis_label, labelpad=1)
                axes.set_ylabel("error [–]", labelpad=2)
                if series:
                    self._draw(axes, cost)
                else:
                    axes.set(xticks=[], yticks=[])
            legend_above(panels[0, 0], ink.COLUMN)
            axes.figure.figure.draw_without_rendering()  # labels need to know the panels' sizes
            for (axes,), cost in zip(panels, COSTS, strict=True):
                self._label(axes, cost)
        return axes.figure

    def _caption(self) -> str:
        r = self.reference
        head = f"{shown_name(self.mechanism, 40)}, {self.question}."
        if not self.points:
            return f"{head} Nothing was measured: {self.recommendation}."
        unseen = " On the hatching: no difference seen." * any(p.at_floor for p in self.points)
        return (
            f"{head} Error: {self.measure}, against "
            f"{r.method}, checked by {r.check}, which leaves {r.floor:.0e} open (hatched).{unseen} "
            "Time: least processor time, bars to the largest of the warm runs, or of one. "
            f"Evaluations: {self.counted}. Broad grey line: Pareto front. Labels: the setting "
            "(c64: complex64; n: iterations; a number: accuracy asked for, or step)."
        )

    def _draw(self, axes: Axes, cost: str) -> None:
        floor = self.reference.floor
        axes.set_xscale("log")
        axes.set_yscale("log")
        best = front(self.points, cost)
        axes.step(
            [_spent(p, cost) for p in best],
            [p.error for p in best],
            where="post",
            color=ink.PALE,
            lw=5,
            zorder=1,
            solid_capstyle="round",
        )
        axes.axhspan(
            1e-300, floor, facecolor="none", edgecolor=ink.GREY, hatch="////", lw=0, zorder=0
        )
        axes.axhline(floor, color=ink.GREY, lw=0.7, zorder=1.5)
        for i, (name, row) in enumerate(self.series().items()):
            style = ink.curve_style(i)
            row = [p for p in row if math.isfinite(p.error)]
            x, y = [_spent(p, cost) for p in row], [p.error for p in row]
            bars = [[0.0 for _ in row], [p.slowest - p.seconds for p in row]]
            axes.errorbar(
                x,
                y,
                xerr=bars if cost == "seconds" and np.any(bars) else None,
                elinewidth=0.5,
                lw=0.9,
                marker=MARKS[i % len(MARKS)],
                ms=MARK,
                mfc=ink.PAPER,
                mew=0.8,
                label=name,
                **style,
            )
        errors = [p.error for p in self.points if math.isfinite(p.error)]
        axes.set_ylim(floor / 5, max([*errors, floor]) * 5)
        axes.margins(x=0.12)
        for axis, (low, high) in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
            log_ticks(axis, low, high)

    def _label(self, axes: Any, cost: str) -> None:
        """Write settings beside their points, the front's first, where there is room."""
        from matplotlib.transforms import Bbox

        best = front(self.points, cost)
        points = [p for p in self.points if math.isfinite(p.error)]
        positions = axes.transData.transform(
            [(_spent(p, cost), p.error) for p in points] or [(1, 1)]
        )
        half = MARK / 2 * axes.figure.dpi / 72
        boxes = [Bbox([z - half, z + half]) for z in positions]
        room, renderer = axes.get_window_extent(), axes.figure.canvas.get_renderer()
        for p in sorted(points, key=lambda p: p not in best):
            for dx, dy in SPOTS if short(p) else ():
                text = axes.annotate(
                    short(p),
                    (_spent(p, cost), p.error),
                    (dx, dy),
                    textcoords="offset points",
                    fontsize=LABEL,
                    color=ink.INK,
                    in_layout=False,
                    zorder=4,
                    ha={-1: "right", 0: "center", 1: "left"}[(dx > 0) - (dx < 0)],
                    va="bottom" if dy > 0 else "top",
                    bbox={"facecolor": ink.PAPER, "alpha": 0.8, "lw": 0, "pad": 0.2},
                )
                box = text.get_window_extent(renderer)
                inside = (
                    room.x0 < box.x0 and box.x1 < room.x1 and room.y0 < box.y0 < box.y1 < room.y1
                )
                if inside and not box.count_overlaps(boxes):
                    boxes.append(box)
                    break
                text.remove()

    def lines(self) -> Iterator[str]:
        """The table with a star at the front, the reference, what was skipped, the sentence."""
        pareto, reference = self.pareto, self.reference
        rows = [_row(p, p in pareto) for series in self.series().values() for p in series]
        yield from (f"{self.mechanism}, {self.question}", "", *aligned(HEAD, rows), "")
        yield "* no other setting is both faster, beyond the noise, and at least as exact"
        beaten = grouped((q.label, p.label) for p in self.points if (q := self.beaten_by(p)))
        for faster, labels in beaten.items():
            yield f"beaten in time and in error by {faster}: {'; '.join(labels)}"
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
        reasons = grouped((s.why, s.label) for s in self.skipped)
        yield from (f"skipped: {'; '.join(labels)}: {why}" for why, labels in reasons.items())
        yield from (f"measured in {self.spent:.1f} s", "", self.recommendation)

    def to_dict(self) -> Data:
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

    def csv_rows(self) -> tuple[list[str], Iterable[Iterable[object]]]:
        """The points, one a row."""
        rows = [row | {"floor": self.reference.floor} for _, row in self._rows()]
        names = [name for name in (rows[0] if rows else {}) if name != "options"]
        times = ("seconds", "slowest")
        head = [f"{name} [s]" if name in times else name for name in names]
        return head, ([row[name] for name in names] for row in rows)

    def _rows(self) -> list[tuple[Point, Data]]:
        """Points, and each as data."""
        rows, pareto = [], self.pareto
        for p in self.points:
            better = getattr(self.beaten_by(p), "label", "")
            rows.append((p, asdict(p) | {"pareto": p in pareto, "beaten_by": better}))
        return rows


def grouped(pairs: Iterable[tuple[str, T]]) -> dict[str, list[T]]:
    """Second items by the first ones, in their order."""
    groups: dict[str, list[T]] = {}
    for name, item in pairs:
        groups.setdefault(name, []).append(item)
    return groups


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
        target = TARGET
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


def _spent(point: Point, cost: str) -> float:
    """What a point costs; one where it costs nothing, as the axis has no zero.

    A run along the path asks no kernel where all that it needs is kept.
    """
    return float(getattr(point, cost)) or 1.0


def short(p: Point) -> str:
    """A setting in as few letters as tell it from its neighbours."""
    words = p.setting.replace("clongdouble", "long double").replace("complex", "c")
    words = words.removeprefix("accuracy ").removeprefix("step ")
    if words.endswith(" iterations"):
        return f"n = {words.removesuffix(' iterations')}"
    number, _, unit = words.partition(" ")
    try:
        return f"{power_of_ten(float(number))} {unit}".rstrip()
    except ValueError:
        return words
