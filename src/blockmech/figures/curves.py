"""From a run to what is drawn of it ([R10] Figs. 12, 13 and 14).

The curve without friction stands beside the one with friction.

Sources: [R10] Ruiz, Durango & Calle 2010.
"""

from __future__ import annotations

import fnmatch
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from blockmech.figures.palette import MOST, PANELS
from blockmech.figures.panels import Abscissa, Panel, draw_panels
from blockmech.figures.paper import picture_unit, shown_name, suffix_of, write_figure
from blockmech.ground.arguments import declared
from blockmech.ground.errors import among, as_names, refused
from blockmech.ground.files import AnyPath
from blockmech.model.laws_of_motion import OverRange
from blockmech.result.columns import unwrapped, without_noise
from blockmech.result.result import Result
from blockmech.typing import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Axis = Literal["auto", "coordinate", "time"]
Panels = tuple[Panel, ...]
ASIDE = 1e-3  # of the way to the next sample: a side of a reversal of slip
NOTHING: Mapping[str, Floats] = {}
NAMES: Mapping[str, str] = {}

KINEMATICS = {
    "angle": ("angle", "rad"),
    "omega": ("rate", "rad/s"),
    "alpha": ("angular acceleration", "rad/s2"),
}


def pictures_of(result: Result) -> dict[str, Panels]:
    """Panels by name of the picture: what the run computed and is not zero everywhere."""
    twin = without_friction(result)
    pictures = {
        "drive": drive_panels(result, twin),
        "friction_power": friction_panels(result),
        "reactions": reaction_panels(result, twin),
    }
    if not pictures["drive"] and not pictures["reactions"]:
        pictures["kinematics"] = kinematic_panels(result)
    return {name: in_units(panels, result) for name, panels in pictures.items() if panels}


def without_friction(result: Result) -> Result | None:
    """The forces of the same run without friction; None where there is none to leave out."""
    blocks = result.mechanism.structure.blocks.values()
    forces = [n for n in result if n.endswith((".drive", ".reaction"))]
    friction = result.settings["friction"] != "none" and any(b.friction for b in blocks)
    if not friction or not forces:
        return None
    return result.rerun(*forces, friction="none")


def with_reversals(result: Result) -> Result:
    """The run with a sample on each side of a reversal of slip, where friction jumps.

    A sample at which one pair alone is at rest lacks its friction, and is left out.
    """
    resting = {pair: at_rest for pair, (at_rest, _) in result._reports["rest"].items()}
    if result.motion is not None or not resting or result.n < 3:
        return result
    names = [f"{pair}.slip" for pair in resting]

    def slips(positions: Floats) -> Floats:
        run = result._between(positions)._inside(*names)
        return np.array([run[name] for name in names])

    every = np.arange(float(result.n))
    slip = slips(every)
    rest = np.array([np.broadcast_to(row, result.n) for row in resting.values()]) > 0
    moving = np.pad(~rest, ((0, 0), (1, 1)), constant_values=True)
    alone = rest & moving[:, :-2] & moving[:, 2:]
    pair, low = np.nonzero((slip[:, :-1] * slip[:, 1:] < 0) & ~rest[:, :-1] & ~rest[:, 1:])
    root, rise = low.astype(float), slip[pair, low + 1] - slip[pair, low]
    for _ in range(4 * bool(len(low))):  # by the chord: slip is almost linear between samples
        root = np.clip(root - slips(root)[pair, np.arange(len(root))] / rise, low, low + 1)
    reversals = np.append(root, np.flatnonzero(alone.any(axis=0)))
    positions = [*every[~alone.any(axis=0)], *(reversals - ASIDE), *(reversals + ASIDE)]
    inside = [x for x in sorted(positions) if 0 <= x <= result.n - 1]
    return result._between(np.array(inside)) if len(reversals) else result


def drive_panels(result: Result, twin: Result | None) -> Panels:
    """The driving moment or force of each driver ([R10] Fig. 12)."""
    panels = []
    drivers = result.mechanism.drivers
    for driver in drivers:
        name = result.mechanism._of_driver(driver, "drive")
        drive = _nonzero({"": values(result, name)}) if name in result else {}
        if drive:
            unit = result.unit(name)
            quantity = "driving force" if unit == "N" else "driving moment"
            of = f" of {shown_name(driver)}" if len(drivers) > 1 else ""
            bare = {} if twin is None else {"": values(twin, name)}
            panels.append(Panel(quantity + of, unit, drive, bare))
            if bare:  # often too small to be seen between the two
                panels.append(Panel(f"due to friction{of}", unit, _differences(drive, bare)))
    return tuple(panels)


def friction_panels(result: Result) -> Panels:
    """The power that friction takes, in all and at each joint ([R10] Fig. 13)."""
    joints = _nonzero(_curves_of(result, ".friction_power"))
    total = {"all joints": joints.pop("mechanism")} if "mechanism" in joints else {}
    if len(joints) > PANELS:
        return (Panel("friction power", "W", total), *_panels("friction power", "W", joints))
    curves = joints if len(joints) == 1 else {**total, **joints}
    return (Panel("friction power", "W", curves),) if curves else ()


def reaction_panels(result: Result, twin: Result | None) -> Panels:
    """The magnitude of every joint's reaction ([R10] Fig. 14), and what friction adds to it."""
    bare = NOTHING if twin is None else _curves_of(twin, ".reaction")
    panels = _panels("reaction", "N", _nonzero(_curves_of(result, ".reaction")), bare)
    # Often too small to be seen between two curves, as with the drive.
    return panels + tuple(
        Panel("due to friction", panel.unit, _differences(panel.curves, lines))
        for panel in panels
        if (lines := panel.without)
    )


def _differences(curves: Mapping[str, Floats], bare: Mapping[str, Floats]) -> dict[str, Floats]:
    """What friction adds to curves; what is rounding of them is zero."""
    return {
        name: without_noise(curves[name] - y, float(np.nanmax(np.abs(y), initial=0.0)))
        for name, y in bare.items()
    }


def kinematic_panels(result: Result) -> Panels:
    """Angles, rates and accelerations of links, for a mechanism without forces."""
    panels: Panels = ()
    for suffix, (quantity, unit) in KINEMATICS.items():
        curves = _curves_of(result, f".{suffix}")
        if suffix == "angle":
            curves = {name: unwrapped(angle) for name, angle in curves.items()}
        if _nonzero(curves):
            panels += _panels(quantity, unit, curves)
    return panels


@declared
def plot(
    result: Result,
    path: AnyPath | None = None,
    want: Iterable[str] | str | None = None,
    *,
    over: Axis = "auto",
    components: bool = False,
    label: str = "",
    ax: Axes | None = None,
) -> Any:
    """Draw outputs of a run in one picture, one panel for each quantity, in the units of `to`.

    Parameters
    ----------
    path : .png, .svg or .pdf file; by default none is written
    want : outputs; by default those requested in the run, or, if it requested all, those of
        `blockmech.draw.run_pictures`
    over : driver coordinate or time; "auto" takes the one by which the samples were requested
    components : of vectors x and y with their signs, in place of the magnitude
    label : of the run in the legend, where several runs are drawn in the same axes
    ax : axes to draw in, divided among the panels; one panel goes on with what is drawn in them

    Returns matplotlib's figure. Raises `RequestError` for an unknown suffix or name, or too many
    curves.

    >>> figure = bm.draw.plot(result, want=["crank.drive"])
    """
    suffix, result = "" if path is None else suffix_of(path), with_reversals(result)
    x_axis = abscissa(result, over)
    if want is None and not components and len(result) == len(result.mechanism.outputs):
        panels = tuple(p for group in pictures_of(result).values() for p in group)
    else:
        names = result if want is None else as_names("want", want)
        outputs = [n for name in names for n in _matches(result, name) or [name]]
        panels = chosen_panels(result, outputs, components)
    figure = draw_panels([_labelled(panel, label) for panel in panels], x_axis, ax)
    if path is not None:
        write_figure(figure, path, suffix)
    return figure


def _labelled(panel: Panel, label: str) -> Panel:
    """A panel whose curves have the label of their run, beside their names if there are several."""
    if not label:
        return panel
    names = {name: f"{label}: {name}" if len(panel.curves) > 1 else label for name in panel.curves}
    return _changed(panel, 1.0, panel.unit, names)


def _matches(result: Result, pattern: str) -> list[str]:
    """Outputs of a run that a pattern asks for, case counting on every system."""
    return [name for name in result if fnmatch.fnmatchcase(name, pattern)]


def in_units(panels: Panels, result: Result) -> Panels:
    """Panels in the units of a result, where they are of its kind."""
    units = (picture_unit(panel.unit, result._display) for panel in panels)
    return tuple(_changed(panel, *unit) for panel, unit in zip(panels, units, strict=True))


def _changed(panel: Panel, factor: float, unit: str, names: Mapping[str, str] = NAMES) -> Panel:
    """A panel in another unit, its curves by other names."""
    curves, without = (
        {names.get(name, name): factor * y for name, y in curves.items()}
        for curves in (panel.curves, panel.without)
    )
    return replace(panel, unit=unit, curves=curves, without=without)


def chosen_panels(result: Result, names: Iterable[str], components: bool = False) -> Panels:
    """The named outputs, one panel for each quantity and unit; vectors by size or components.

    Raises `RequestError` where there are more than a picture can hold.
    """
    groups: dict[tuple[str, str], dict[str, Floats]] = {}
    for name in names:
        output = result._output(name)
        if output.kind in ("real", "vector"):
            subject, _, quantity = name.rpartition(".")
            lines = {subject: values(result, name)}
            title = f"|{quantity}|" if output.kind == "vector" else quantity.replace("_", " ")
            if quantity == "p" or (components and output.kind == "vector"):
                z = np.asarray(result[name])  # of a place both coordinates matter
                title, lines = quantity, {f"{subject} x": z.real, f"{subject} y": z.imag}
            groups.setdefault((title, output.unit), {}).update(lines)
    count = sum(map(len, groups.values()))
    if not 0 < count <= MOST:
        message = f"{count} outputs can be drawn over the samples"
        valid = f"a picture holds 1 to {MOST} curves"
        code = "too-many-curves" if count else "nothing-to-draw"
        raise refused("want", message, "name the outputs with want=", valid, code)
    panels = (Panel(title, unit, curves) for (title, unit), curves in groups.items())
    return in_units(tuple(panels), result)


def values(result: Result, name: str) -> Floats:
    """An output (n,) as it is drawn: real numbers, of vectors their size; NaN in gaps.

    What is rounding beside others of its unit, or moments beside forces at a link's length, is 0.
    """
    size, unit = _sizes(result, name), result.unit(name)
    terms = {unit: 1.0, **({"N": reach(result.mechanism)} if unit == "N m" else {})}
    names = [n for n in result if result.unit(n) in terms and result._output(n).kind != "matrix"]
    sizes = [terms[result.unit(n)] * np.abs(_sizes(result, n)) for n in names]
    return without_noise(size, float(np.nanmax(np.concatenate(sizes), initial=0.0)))


def _sizes(result: Result, name: str) -> Floats:
    column = np.atleast_1d(np.asarray(result[name]))
    size = np.abs(column) if np.iscomplexobj(column) else column
    return np.where(np.isfinite(size), size, np.nan).astype(float)


def reach(mechanism: Any) -> float:
    """The largest length [m] of a block; 1 without lengths."""
    return max((b.largest_length() for b in mechanism.structure.blocks.values()), default=0) or 1.0


def _curves_of(result: Result, suffix: str) -> dict[str, Floats]:
    """Curves of all outputs of one sort."""
    return {n.removesuffix(suffix): values(result, n) for n in result if n.endswith(suffix)}


def _nonzero(curves: Mapping[str, Floats]) -> dict[str, Floats]:
    """The curves that are not zero everywhere."""
    return {name: y for name, y in curves.items() if np.any(np.nan_to_num(y) != 0)}


def _panels(
    quantity: str, unit: str, curves: Mapping[str, Floats], bare: Mapping[str, Floats] = NOTHING
) -> Panels:
    """One panel, or of many curves one for each block; blocks with few curves share one."""
    blocks: dict[str, dict[str, Floats]] = {}
    for name, y in curves.items():
        first, *rest = name.split(".")
        # The block of an output, or the joint or link of a joint-based document.
        owner = f"{first}.{rest[0]}" if rest and first in ("joint", "link", "driver") else first
        blocks.setdefault(owner, {})[name] = y
    groups: list[dict[str, Floats]] = []
    for mine in blocks.values():
        if groups and len(groups[-1]) + len(mine) <= PANELS:
            groups[-1] |= mine
        else:
            groups.append(dict(mine))
    return tuple(
        Panel(quantity, unit, group, {name: bare[name] for name in group if name in bare})
        for group in groups
    )


def abscissa(result: Result, over: Axis = "auto") -> Abscissa:
    """What the curves are drawn over: the coordinate of the only driver that moves, or time.

    A motion under loads is drawn over time: its driver may come back to the same place.
    Raises `RequestError` where that is not known.
    """
    drivers, laws = result.mechanism.drivers, result.mechanism.scene.drive
    rows = by_unit(result, "q")
    moving = [d for row in rows.values() for d, q in row.items() if np.ptp(q) > 0] or drivers
    time = result.time if result.time is not None and np.isfinite(result.time).all() else None
    among(("auto", "coordinate", "time"), "abscissa", over, "bad-value", "over")
    by_time = result.motion is not None or len(moving) != 1
    by_time |= any(d in laws and not isinstance(laws[d], OverRange) for d in drivers)
    if over == "time" or (over == "auto" and by_time and time is not None):
        if time is None:
            raise refused("over", "the run does not say times", "use times= in run", code="no-time")
        factor, unit = picture_unit("s", result._display)
        return Abscissa(f"time [{unit}]", factor * time)
    if len(moving) != 1:
        return Abscissa("sample", np.arange(result.n, dtype=float))
    (driver,) = moving
    unit = next(unit for unit, row in rows.items() if driver in row)
    label = f"{shown_name(result.mechanism._of_driver(driver, 'q'))} [{unit}]"
    return Abscissa(label, rows[unit][driver])


def by_unit(result: Result, state: str) -> dict[str, dict[str, Floats]]:
    """Coordinates ``"q"`` or rates ``"rate"`` of the drivers by their unit: driver -> (n,)."""
    rows: dict[str, dict[str, Floats]] = {}
    for driver in result.mechanism.drivers:
        name = result.mechanism._of_driver(driver, state)
        unit = result.mechanism.structure.driver_joint(driver).coordinate_unit
        row = np.asarray(result.drivers[name] if state == "q" else result[name], dtype=float)
        factor, unit = picture_unit(unit if state == "q" else f"{unit}/s", result._display)
        rows.setdefault(unit, {})[driver] = factor * row
    return rows
