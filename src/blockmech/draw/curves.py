"""Results over the driver coordinate or over time ([R10] Figs. 12, 13 and 14).

A picture is a column of panels; a panel is one quantity with its unit. The curve
without friction stands beside the one with friction, and a gap is a gap.

Sources: [R10] Ruiz, Durango & Calle 2010.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from blockmech.blocks.contract import DrivingLink
from blockmech.draw import palette as ink
from blockmech.draw.paper import new_figure, shown_name, styled, text_width
from blockmech.errors import Problem, RequestError
from blockmech.result import Result

Axis = Literal["auto", "coordinate", "time"]
Array = NDArray[np.float64]

PANEL = 118.0  # [pt] height of a panel's axes
LEFT, RIGHT, TOP, BOTTOM, BETWEEN = 42.0, 10.0, 6.0, 29.0, 14.0  # [pt] around panels
FEW = 25  # samples up to which they are marked
TOGETHER = 6  # curves that share a panel; more get a panel for each block
USUAL, PEAK = 0.95, 20.0  # peaks are what exceeds 20 times what 95 % of the samples stay below
MOST = 40  # curves that a picture can hold
PEAKS = "cut-off peaks up to"
PREFIXES = {9: "G", 6: "M", 3: "k", 0: "", -3: "m", -6: "µ", -9: "n"}


@dataclass(frozen=True)
class Curve:
    """One line of a panel; ``without`` is the same without friction, if that differs."""

    name: str
    values: Array
    without: Array | None = None


@dataclass(frozen=True)
class Panel:
    """One quantity: its words, its SI unit, its curves."""

    quantity: str
    unit: str
    curves: tuple[Curve, ...]

    @property
    def rows(self) -> list[Array]:
        """All values, those without friction included."""
        both = [(c.values, c.without) for c in self.curves]
        return [row for pair in both for row in pair if row is not None]

    @property
    def shown(self) -> tuple[float, float]:
        """The range that is shown: all of it, but peaks near a dead centre are cut off."""
        y = np.concatenate([row[np.isfinite(row)] for row in self.rows])
        if not len(y):
            return 0.0, 0.0
        usual = float(np.quantile(np.abs(y), USUAL))
        if usual > 0 and np.abs(y).max() > PEAK * usual:
            y = y[np.abs(y) <= 2 * usual]
        return float(y.min()), float(y.max())

    @property
    def peak(self) -> float:
        """Largest value that is cut off; 0 if none is."""
        largest = max((float(np.nanmax(np.abs(r), initial=0.0)) for r in self.rows), default=0.0)
        return largest if largest > max(map(abs, self.shown)) else 0.0


@dataclass(frozen=True)
class Abscissa:
    """What the curves are drawn over."""

    words: str
    values: Array
    angle: bool = False  # in degrees


@dataclass
class Plot:
    """A drawn picture: the figure, its axes from top to bottom, its panels."""

    figure: Any
    axes: list[Any]
    panels: tuple[Panel, ...]


# -- what is drawn ---------------------------------------------------------------------


def pictures_of(result: Result) -> dict[str, tuple[Panel, ...]]:
    """Panels by name of the picture: what the run computed and is not zero everywhere."""
    twin = without_friction(result)
    found = {
        "drive": drive_panels(result, twin),
        "friction_power": friction_panels(result),
        "reactions": reaction_panels(result, twin),
    }
    found = {name: panels for name, panels in found.items() if panels}
    if not {"drive", "reactions"} & found.keys():
        found |= {"kinematics": kinematic_panels(result)}
    return {name: panels for name, panels in found.items() if panels}


def without_friction(result: Result) -> Result | None:
    """The forces of the same run without friction; None where there is none to leave out."""
    blocks = result.mechanism.structure.blocks.values()
    if result.settings["friction"] == "none" or not any(b.friction for b in blocks):
        return None
    forces = [n for n in result if n.endswith((".drive", ".reaction"))]
    if not forces:
        return None
    settings = {**result.settings, "friction": "none", "tolerance": None, "iterations": None}
    # The same samples under other settings: an empty result of those settings, run again.
    empty = Result(result.mechanism, result.plan, result.samples, (), result.engine, settings)
    return empty.rerun(*forces)


def drive_panels(result: Result, twin: Result | None) -> tuple[Panel, ...]:
    """The driving moment or force of each driver ([R10] Fig. 12)."""
    panels = []
    for name, block in result.mechanism.structure.blocks.items():
        if isinstance(block, DrivingLink) and f"{name}.drive" in result:
            curve = _curve(result, twin, f"{name}.drive", name)
            if not _lives(curve):
                continue
            what = "driving moment" if block.rotary else "driving force"
            of = f" of {shown_name(name)}" if len(result.mechanism.drivers) > 1 else ""
            panels.append(Panel(what + of, block.effort_unit(), (curve,)))
            if curve.without is not None:  # often too small to be seen between the two
                share = Curve("", curve.values - curve.without)
                panels.append(Panel(f"due to friction{of}", block.effort_unit(), (share,)))
    return tuple(panels)


def friction_panels(result: Result) -> tuple[Panel, ...]:
    """The power that friction takes, in all and at each joint ([R10] Fig. 13)."""
    names = [n for n in result if n.endswith(".friction_power")]
    joints = [_curve(result, None, n, n.removesuffix(".friction_power")) for n in names]
    total = [c for c in joints if c.name == "mechanism"]
    single = [c for c in joints if c.name != "mechanism" and _lives(c)]
    if not single and not any(map(_lives, total)):
        return ()
    shown = tuple(Curve("all joints", c.values) for c in total) if len(single) != 1 else ()
    if len(single) > TOGETHER:
        first = (Panel("friction power", "W", shown),) if shown else ()
        return first + _by_block("friction power", "W", single)
    return (Panel("friction power", "W", shown + tuple(single)),)


def reaction_panels(result: Result, twin: Result | None) -> tuple[Panel, ...]:
    """The magnitude of every joint's reaction ([R10] Fig. 14)."""
    names = [n for n in result if n.endswith(".reaction")]
    curves = [_curve(result, twin, n, n.removesuffix(".reaction")) for n in names]
    curves = [c for c in curves if _lives(c)]
    if len(curves) > TOGETHER:
        return _by_block("reaction", "N", curves)
    return (Panel("reaction", "N", tuple(curves)),) if curves else ()


def kinematic_panels(result: Result) -> tuple[Panel, ...]:
    """Angles, rates and accelerations of links, for a mechanism without forces."""
    panels: tuple[Panel, ...] = ()
    for suffix, quantity, unit in (
        (".angle", "angle", "rad"),
        (".omega", "rate", "rad/s"),
        (".alpha", "angular acceleration", "rad/s²"),
    ):
        names = [n for n in result if n.endswith(suffix)]
        curves = [_curve(result, None, n, n.removesuffix(suffix)) for n in names]
        if suffix == ".angle":
            curves = [Curve(c.name, _unwrapped(c.values)) for c in curves]
        if len(curves) > TOGETHER:
            panels += _by_block(quantity, unit, curves)
        elif any(map(_lives, curves)):
            panels += (Panel(quantity, unit, tuple(curves)),)
    return panels


def chosen_panels(result: Result, names: Iterable[str]) -> tuple[Panel, ...]:
    """The named outputs, one panel for each quantity and unit.

    Raises `RequestError` where there are more than a picture can hold.
    """
    groups: dict[tuple[str, str], list[Curve]] = {}
    for name in names:
        output = result.output(name)
        if output.kind in ("real", "vector"):
            quantity = name.rpartition(".")[2]
            what = f"|{quantity}|" if output.kind == "vector" else quantity
            curve = _curve(result, None, name, name.rpartition(".")[0])
            unit = output.unit.replace("s2", "s²").replace("m2", "m²")
            groups.setdefault((what.replace("_", " "), unit), []).append(curve)
    count = sum(map(len, groups.values()))
    if not 0 < count <= MOST:
        raise RequestError(
            Problem(
                "too-many-curves" if count else "nothing-to-draw",
                "want",
                f"{count} outputs can be drawn over the samples",
                f"a picture holds 1 to {MOST} curves",
                "name the outputs with want=",
            )
        )
    return tuple(Panel(what, unit, tuple(curves)) for (what, unit), curves in groups.items())


def _curve(result: Result, twin: Result | None, name: str, shown: str) -> Curve:
    def real(run: Result) -> Array:
        values = np.asarray(run[name])
        size = np.abs(values) if np.iscomplexobj(values) else values
        return np.where(np.isfinite(size), size, np.nan).astype(float)

    return Curve(shown, real(result), real(twin) if twin is not None else None)


def _lives(curve: Curve) -> bool:
    return bool(np.any(np.nan_to_num(curve.values) != 0))


def _by_block(quantity: str, unit: str, curves: Sequence[Curve]) -> tuple[Panel, ...]:
    """One panel for each block; blocks with few curves share one."""
    groups: list[list[Curve]] = []
    for curve in curves:
        block = curve.name.split(".")[0]
        mine = [c for c in curves if c.name.split(".")[0] == block]
        if curve is not mine[0]:
            continue
        if groups and len(groups[-1]) + len(mine) <= TOGETHER:
            groups[-1] += mine
        else:
            groups.append(mine)
    return tuple(Panel(quantity, unit, tuple(group)) for group in groups)


def _unwrapped(angle: Array) -> Array:
    """An angle without jumps of a turn; gaps stay gaps."""
    good = np.isfinite(angle)
    smooth = np.full(angle.shape, np.nan)
    smooth[good] = np.unwrap(angle[good])
    return smooth


# -- the abscissa ----------------------------------------------------------------------


def abscissa(result: Result, over: Axis = "auto", degrees: bool = True) -> Abscissa:
    """What the curves are drawn over: the only driver's coordinate, or time.

    Raises `RequestError` where that is not known.
    """
    drivers = result.mechanism.drivers
    time = result.time if result.time is not None and np.isfinite(result.time).all() else None
    if over not in ("auto", "coordinate", "time"):
        raise RequestError(
            Problem("bad-value", "over", f"got {over!r}", "valid: auto, coordinate, time", "")
        )
    laws = result.mechanism.scene.drive
    by_time = any(d in laws and not laws[d].by_coordinate for d in drivers)
    if over == "auto":
        over = "time" if time is not None and (by_time or len(drivers) != 1) else "coordinate"
    if over == "time":
        if time is None:
            raise RequestError(
                Problem("no-time", "over", "the run does not say times", "", "use times= in run")
            )
        return Abscissa("time [s]", time)
    if len(drivers) != 1:
        return Abscissa("sample", np.arange(result.n, dtype=float))
    name = f"{drivers[0]}.q"
    q = result.drivers[name]
    unit = result.unit_of_driver(name)
    if unit == "rad" and degrees:
        return Abscissa(f"{shown_name(name)} [°]", np.degrees(q), angle=True)
    return Abscissa(f"{shown_name(name)} [{unit}]", q)


# -- ink -------------------------------------------------------------------------------


def draw_panels(panels: Sequence[Panel], along: Abscissa) -> Plot:
    """Draw panels below one another, a column wide, legends above their axes."""
    with styled():
        rows = [_legend_rows(p) for p in panels]
        heads = [9.5 * len(r) + (3 if r else 0) for r in rows]
        height = TOP + BOTTOM + PANEL * len(panels) + sum(heads) + BETWEEN * (len(panels) - 1)
        figure = new_figure(ink.COLUMN, height)
        plot = Plot(figure, [], tuple(panels))
        top = height - TOP
        for panel, legend, head in zip(panels, rows, heads, strict=True):
            top -= head
            box = (LEFT, top - PANEL, ink.COLUMN - LEFT - RIGHT, PANEL)
            w, h = ink.COLUMN, height
            axes = figure.add_axes((box[0] / w, box[1] / h, box[2] / w, box[3] / h))
            plot.axes.append(axes)
            lines = _draw_panel(axes, panel, along)
            _draw_legend(figure, lines, legend, top + head - 2, height)
            last = panel is panels[-1]
            axes.tick_params(labelbottom=last)
            if last:
                axes.set_xlabel(along.words, labelpad=2)
            top -= PANEL + BETWEEN
        figure.align_ylabels(plot.axes)
    return plot


def _draw_panel(axes: Any, panel: Panel, along: Abscissa) -> dict[str, Any]:
    """Draw the curves of a panel; label in the legend -> its line."""
    order = np.argsort(along.values, kind="stable") if _unsorted(along.values) else slice(None)
    x = along.values[order]
    factor, unit = scaled_unit(panel.unit, [np.array(panel.shown)])
    lines: dict[str, Any] = {}
    for i, (curve, label) in enumerate(zip(panel.curves, _labels(panel), strict=True)):
        colour, dashes = ink.curve_style(i)
        if curve.without is not None:
            dashes = ()  # dashes mean "without friction" here
            y = curve.without[order] * factor
            if len(panel.curves) == 1:
                style = {"color": ink.SERIES[1], "lw": 1.1, "zorder": 3}
            else:
                style = {"color": colour, "lw": 0.8, "zorder": 2}
            (line,) = axes.plot(x, y, label="without friction", **style, **_marks(y, "s"))
            line.set_dashes((4, 1.8))
            lines["without friction"] = line
        y = curve.values[order] * factor
        (line,) = axes.plot(x, y, color=colour, lw=1.2, label=label, zorder=2.5, **_marks(y, "o"))
        if dashes:
            line.set_dashes(dashes)
        lines[label] = line
    _shade_gaps(axes, x, np.vstack([row[order] for row in panel.rows]))
    quantity = f"{panel.quantity} [{unit}]" if unit else f"{panel.quantity} [–]"
    axes.set_ylabel(quantity, labelpad=3)
    axes.margins(x=0.01 if len(x) > 1 else 0.5)
    axes.grid(True, color=ink.PALE, lw=0.3)
    axes.set_axisbelow(True)
    _ticks(axes, along, x)
    if panel.peak:
        low, high = (factor * y for y in panel.shown)
        air = 0.05 * (high - low or 1.0)
        axes.set_ylim(low - air, high + air)
    return lines


def _labels(panel: Panel) -> list[str]:
    """Legend texts; one curve that has a frictionless twin is "with friction"."""
    if len(panel.curves) == 1 and panel.curves[0].without is not None:
        return ["with friction"]
    names = [c.name for c in panel.curves]
    short = [n.rpartition(".")[2] for n in names]
    one_block = len({n.partition(".")[0] for n in names}) == 1
    unique = len(set(short)) == len(short)
    return [shown_name(n) for n in (short if one_block and unique else names)]


def _unsorted(x: Array) -> bool:
    step = np.diff(x)
    return bool(np.any(step > 0) and np.any(step < 0))


def _marks(y: Array, marker: str) -> dict[str, Any]:
    """Few samples are marked, and so is one that stands alone between gaps."""
    good = np.isfinite(y)
    if len(y) <= FEW:
        return {"marker": marker, "ms": 2.6, "markevery": None}
    left, right = np.append(False, good[:-1]), np.append(good[1:], False)
    alone = np.flatnonzero(good & ~left & ~right)
    return {"marker": marker, "ms": 2.0, "markevery": alone.tolist()} if len(alone) else {}


def _shade_gaps(axes: Any, x: Array, y: NDArray[Any]) -> None:
    """Shade where a curve has no answer."""
    bad = ~np.isfinite(y).all(axis=0)
    starts = np.flatnonzero(bad & ~np.append(False, bad[:-1]))
    ends = np.flatnonzero(bad & ~np.append(bad[1:], False))
    for a, b in zip(starts, ends, strict=True):
        left, right = x[max(a - 1, 0)], x[min(b + 1, len(x) - 1)]
        style = {"facecolor": "#EFEFEF", "edgecolor": ink.PALE, "hatch": "////", "lw": 0}
        axes.axvspan(left, right, zorder=0.5, label="no answer", **style)


def _ticks(axes: Any, along: Abscissa, x: Array) -> None:
    from matplotlib.ticker import MaxNLocator, MultipleLocator

    span = float(np.ptp(x)) if len(x) else 0.0
    if along.angle and span >= 90:
        steps = (15, 30, 60, 90, 180, 360, 720, 1800, 3600)
        step = next((s for s in steps if span / s <= 7), None)
        axes.xaxis.set_major_locator(MultipleLocator(step) if step else MaxNLocator(6))
    else:
        axes.xaxis.set_major_locator(MaxNLocator(6))
    axes.yaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 2.5, 5, 10]))


def scaled_unit(unit: str, rows: Iterable[Array]) -> tuple[float, str]:
    """A factor and a unit with a prefix, so that axes show numbers from 1 to 999.

    >>> scaled_unit("N m", [np.array([12000.0])])
    (0.001, 'kN m')
    """
    largest = max((float(np.nanmax(np.abs(r), initial=0.0)) for r in rows), default=0.0)
    plain = unit.split()[0].split("/")[0] if unit else ""
    if plain not in ("N", "W", "J") or largest <= 0:
        return 1.0, unit
    power = 3 * math.floor(math.log10(largest * 1.0000001) / 3)
    if power == 3 and largest < 5000:
        power = 0  # 1200 N reads as well as 1.2 kN
    power = min(max(power, -9), 9)
    return 10.0**-power, PREFIXES[power] + unit


# -- legend ----------------------------------------------------------------------------


def _legend_rows(panel: Panel) -> list[list[tuple[str, float]]]:
    """Rows of legend texts with their x [pt]; nothing for a single nameless curve."""
    labels = _labels(panel)
    twins = any(c.without is not None for c in panel.curves)
    if len(labels) == 1 and not twins:
        labels = [n for n in labels if n]
    if twins:
        labels.append("without friction")
    if panel.peak:
        factor, unit = scaled_unit(panel.unit, [np.array([panel.peak])])
        labels.append(f"{PEAKS} {panel.peak * factor:.3g} {unit}")
    if not labels:
        return []
    rows: list[list[tuple[str, float]]] = [[]]
    x = LEFT
    for label in labels:
        wide = (0 if label.startswith(PEAKS) else 22) + text_width(label, ink.SMALL) + 9
        if rows[-1] and x + wide > ink.COLUMN - 2:
            rows.append([])
            x = LEFT
        rows[-1].append((label, x))
        x += wide
    return rows


def _draw_legend(
    figure: Any, lines: dict[str, Any], rows: Sequence[Any], top: float, height: float
) -> None:
    from matplotlib.lines import Line2D

    for k, row in enumerate(rows):
        y = (top - 9.5 * (k + 0.5)) / height
        for label, x in row:
            style = {"fontsize": ink.SMALL, "va": "center_baseline", "label": "legend"}
            if label.startswith(PEAKS):
                figure.text(x / ink.COLUMN, y, label, color=ink.GREY, **style)
                continue
            line = lines[label]
            many = label == "without friction" and len(lines) > 2
            sample = Line2D(
                [x / ink.COLUMN, (x + 19) / ink.COLUMN],
                [y, y],
                color=ink.GREY if many else line.get_color(),
                lw=line.get_linewidth(),
                transform=figure.transFigure,
                label="legend",
            )
            if line.is_dashed():
                sample.set_dashes(line._unscaled_dash_pattern[1])
            figure.add_artist(sample)
            figure.text((x + 22) / ink.COLUMN, y, label, **style)
