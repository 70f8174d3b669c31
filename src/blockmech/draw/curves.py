"""From a run to what is drawn of it ([R10] Figs. 12, 13 and 14).

The curve without friction stands beside the one with friction.

Sources: [R10] Ruiz, Durango & Calle 2010.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Literal

import numpy as np

from blockmech.draw.panels import Abscissa, Array, Curve, Panel
from blockmech.draw.paper import shown_name
from blockmech.errors import Problem, RequestError
from blockmech.result import Result

Axis = Literal["auto", "coordinate", "time"]

TOGETHER = 6  # curves that share a panel; more get a panel for each block
MOST = 40  # curves that a picture can hold
MOTION = {"angle": ("angle", "rad"), "omega": ("rate", "rad/s")}
MOTION |= {"alpha": ("angular acceleration", "rad/s²")}


# -- what is drawn ---------------------------------------------------------------------


def pictures_of(result: Result) -> dict[str, tuple[Panel, ...]]:
    """Panels by name of the picture: what the run computed and is not zero everywhere."""
    twin = without_friction(result)
    found = {
        "drive": drive_panels(result, twin),
        "friction_power": friction_panels(result),
        "reactions": reaction_panels(result, twin),
    }
    if not found["drive"] and not found["reactions"]:
        found["kinematics"] = kinematic_panels(result)
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
    drivers = result.mechanism.drivers
    for name, output in ((d, result.mechanism.of_driver(d, "drive")) for d in drivers):
        if output not in result:
            continue
        curve, unit = _curve(result, twin, output, ""), result.unit(output)
        if not _lives(curve):
            continue
        what = "driving force" if unit == "N" else "driving moment"
        of = f" of {shown_name(name)}" if len(drivers) > 1 else ""
        panels.append(Panel(what + of, unit, (curve,)))
        if curve.without is not None:  # often too small to be seen between the two
            share = Curve("", curve.values - curve.without)
            panels.append(Panel(f"due to friction{of}", unit, (share,)))
    return tuple(panels)


def friction_panels(result: Result) -> tuple[Panel, ...]:
    """The power that friction takes, in all and at each joint ([R10] Fig. 13)."""
    joints = _curves(result, None, ".friction_power")
    total = [Curve("all joints", c.values) for c in joints if c.name == "mechanism" and _lives(c)]
    single = [c for c in joints if c.name != "mechanism" and _lives(c)]
    shown = total if len(single) != 1 else []
    if len(single) > TOGETHER:
        first = _panels("friction power", "W", shown)
        return first + _panels("friction power", "W", single)
    return _panels("friction power", "W", [*shown, *single], by_block=False)


def reaction_panels(result: Result, twin: Result | None) -> tuple[Panel, ...]:
    """The magnitude of every joint's reaction ([R10] Fig. 14)."""
    curves = [c for c in _curves(result, twin, ".reaction") if _lives(c)]
    return _panels("reaction", "N", curves)


def kinematic_panels(result: Result) -> tuple[Panel, ...]:
    """Angles, rates and accelerations of links, for a mechanism without forces."""
    panels: tuple[Panel, ...] = ()
    for suffix, (quantity, unit) in MOTION.items():
        curves = _curves(result, None, f".{suffix}")
        if suffix == "angle":
            curves = [Curve(c.name, _unwrapped(c.values)) for c in curves]
        if any(map(_lives, curves)):
            panels += _panels(quantity, unit, curves)
    return panels


def chosen_panels(result: Result, names: Iterable[str]) -> tuple[Panel, ...]:
    """The named outputs, one panel for each quantity and unit.

    Raises `RequestError` where there are more than a picture can hold.
    """
    groups: dict[tuple[str, str], list[Curve]] = {}
    for name in names:
        output = result.output(name)
        if output.kind in ("real", "vector"):
            shown, _, quantity = name.rpartition(".")
            unit = output.unit.replace("s2", "s²").replace("m2", "m²")
            if quantity == "p":  # of a place both coordinates matter
                z = np.asarray(result[name])
                drawn = [Curve(f"{shown} x", z.real), Curve(f"{shown} y", z.imag)]
            else:
                drawn = [_curve(result, None, name, shown)]
            what = f"|{quantity}|" if output.kind == "vector" and quantity != "p" else quantity
            groups.setdefault((what.replace("_", " "), unit), []).extend(drawn)
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


def _curves(result: Result, twin: Result | None, suffix: str) -> list[Curve]:
    """Curves of all outputs of one sort."""
    names = [n for n in result if n.endswith(suffix)]
    return [_curve(result, twin, n, n.removesuffix(suffix)) for n in names]


def _curve(result: Result, twin: Result | None, name: str, shown: str) -> Curve:
    def real(run: Result) -> Array:
        values = np.asarray(run[name])
        size = np.abs(values) if np.iscomplexobj(values) else values
        return np.where(np.isfinite(size), size, np.nan).astype(float)

    return Curve(shown, real(result), real(twin) if twin is not None else None)


def _lives(curve: Curve) -> bool:
    return bool(np.any(np.nan_to_num(curve.values) != 0))


def _panels(
    quantity: str, unit: str, curves: Sequence[Curve], by_block: bool = True
) -> tuple[Panel, ...]:
    """One panel, or of many curves one for each block; blocks with few curves share one."""
    if not curves:
        return ()
    if len(curves) <= TOGETHER or not by_block:
        return (Panel(quantity, unit, tuple(curves)),)
    blocks: dict[str, list[Curve]] = {}
    for curve in curves:
        blocks.setdefault(_owner(curve.name), []).append(curve)
    groups: list[list[Curve]] = []
    for mine in blocks.values():
        if groups and len(groups[-1]) + len(mine) <= TOGETHER:
            groups[-1] += mine
        else:
            groups.append(mine)
    return tuple(Panel(quantity, unit, tuple(group)) for group in groups)


def _owner(name: str) -> str:
    """The block of an output, or the joint or link of a joint-based document."""
    first, *rest = name.split(".")
    return f"{first}.{rest[0]}" if rest and first in ("joint", "link", "driver") else first


def _unwrapped(angle: Array) -> Array:
    """An angle without jumps of a turn; gaps stay gaps."""
    good = np.isfinite(angle)
    smooth = np.full(angle.shape, np.nan)
    smooth[good] = np.unwrap(angle[good])
    return smooth


# -- the abscissa ----------------------------------------------------------------------


def abscissa(result: Result, over: Axis = "auto", degrees: bool = True) -> Abscissa:
    """What the curves are drawn over: the only driver's coordinate, or time.

    A motion under loads is drawn over time: its driver may come back to the same place.
    Raises `RequestError` where that is not known.
    """
    drivers = result.mechanism.drivers
    time = result.time if result.time is not None and np.isfinite(result.time).all() else None
    if over not in ("auto", "coordinate", "time"):
        raise RequestError(
            Problem("bad-value", "over", f"got {over!r}", "valid: auto, coordinate, time", "")
        )
    laws = result.mechanism.scene.drive
    by_time = result.motion is not None or len(drivers) != 1
    by_time |= any(d in laws and not laws[d].by_coordinate for d in drivers)
    if over == "auto":
        over = "time" if time is not None and by_time else "coordinate"
    if over == "time":
        if time is None:
            raise RequestError(
                Problem("no-time", "over", "the run does not say times", "", "use times= in run")
            )
        return Abscissa("time [s]", time)
    if len(drivers) != 1:
        return Abscissa("sample", np.arange(result.n, dtype=float))
    name = result.mechanism.of_driver(drivers[0], "q")
    q = result.drivers[name]
    unit = result.unit_of_driver(name)
    if unit == "rad" and degrees:
        return Abscissa(f"{shown_name(name)} [°]", np.degrees(q), angle=True)
    return Abscissa(f"{shown_name(name)} [{unit}]", q)
