"""Outputs of a motion: curves, margins, arrows at pins, and what travels on a wire."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from blockmech.draw.motion import Motion, moves_of_result
from blockmech.draw.sketch import Sketch, sketch_of
from blockmech.dynamics.chart_outputs import result_along
from blockmech.dynamics.simulation import simulate
from blockmech.editor.revision import NOTHING, Question
from blockmech.editor.turn import along_of, motion_data, numbers, poses_of
from blockmech.figures.curves import chosen_panels, without_friction
from blockmech.figures.panels import Panel
from blockmech.figures.paper import scaled_unit, shown_name
from blockmech.ground.errors import BlockmechError, listed, refused
from blockmech.model.spots import Spot, pin_spot
from blockmech.model.structure import JointRef
from blockmech.result.result import Result
from blockmech.result.samples import DEFAULT_SAMPLES
from blockmech.result.wires import wires_of
from blockmech.typing import Arguments, Data

FORWARD = {"p": "m", "v": "m/s", "a": "m/s²", "om": "rad/s", "al": "rad/s²"}
BACK = {"F": "N", "M": "N m", "power": "W"}


def curves(ask: Question) -> Data:
    """The chosen outputs over the motion by quantity, forces without friction beside them."""
    motion, names = ask.motion, ask.names
    axis = along_of(motion.to(*ask.display))
    events = [[float(x), name] for x, name in axis.events]
    axis_data = {"words": axis.words, "values": numbers(axis.values), "events": events}
    data: Data = {"along": axis_data, "panels": [], "said": "", "margins": []}
    if margin := motion.quality.margin:
        name_of = motion.mechanism._block_name
        margins = Panel("margin", "", {name_of(block): m for block, m in margin.items()})
        data["margins"] = [_panel(margins)]
    if names:
        start = time.perf_counter()
        result = ask.result(names)
        data["panels"] = [_panel(panel) for panel in panels_of(result, names)]
        data["said"] = _summary(result, time.perf_counter() - start)
    return data


def curves_or_reason(ask: Question) -> Data:
    """The chosen outputs over the motion, or why there are none."""
    try:
        return curves(ask)
    except BlockmechError as error:
        return {"along": None, "panels": [], "said": str(error), "margins": []}


def panels_of(result: Result, names: Iterable[str]) -> list[Panel]:
    """The named outputs by quantity and unit, forces without friction beside them."""
    result = result.to("rad")  # the page turns them into the units that it shows
    bare = without_friction(result)
    panels = () if bare is None else chosen_panels(bare, bare)
    without = {(panel.quantity, panel.unit): panel.curves for panel in panels}
    return [
        replace(panel, without=without.get((panel.quantity, panel.unit), {}))
        for panel in chosen_panels(result, names)
    ]


def _panel(panel: Panel) -> Data:
    """A panel as the page draws it; what is only rounding of the largest number is none."""
    low, high = panel.shown
    factor, unit = scaled_unit(panel.unit, max(abs(low), abs(high)))

    def rows(curves: Mapping[str, Any]) -> list[Any]:
        return [[shown_name(n) or panel.quantity, numbers(factor * y)] for n, y in curves.items()]

    return {
        "quantity": panel.quantity,
        "unit": unit or "-",
        "shown": [factor * low, factor * high],
        "curves": rows(panel.curves),
        "without": rows(panel.without),
    }


def _summary(result: Result, seconds: float) -> str:
    """What was computed, how, and what it took."""
    cost = f"{result.n} samples, {result._plan.calls} kernel calls a sample, {seconds * 1e3:.1f} ms"
    chosen = f"; {result.accuracy}" if result.accuracy is not None else ""
    gaps = len(result.quality.gaps)
    holes = f"; {gaps} samples without an answer" if gaps else ""
    error = "" if result.motion is None else f"; {result.motion.summary()[0]}"
    return "; ".join([cost + chosen + holes + error, *result.notes()])


def simulation(ask: Question) -> tuple[Motion, Data]:
    """The mechanism moved under its loads; a driver without a start is let go in the shown pose."""
    mechanism = ask.now.mechanism
    if mechanism is None:
        raise refused("motion", NOTHING, "draw what moves first")
    free = {*mechanism.drivers} - {*mechanism.scene.initial}
    start = {driver: (q, 0.0) for driver, q in ask.pose.items() if driver in free}
    settings: Arguments = {"want": (), "friction": ask.friction}
    until = str(ask.data.get("until") or "time=2")
    run = simulate(mechanism, until, start=start, progress=ask.report, **settings)
    result = result_along(mechanism, run.motion, run.motion.times(DEFAULT_SAMPLES), **settings)
    motion = moves_of_result(result)
    return motion, {
        "motion": {**motion_data(motion, {}), "poses": poses_of(motion)},
        "text": "\n".join(result.motion.lines()),
        "curves": curves(replace(ask, computed=motion)),
    }


# -- arrows ------------------------------------------------------------------------------------


def vectors(ask: Question) -> list[Data]:
    """Velocities of pins, or reactions at joints, as places [m] and vectors at all samples.

    Of friction circles the vector's length is the radius [m]: without rates a reaction touches
    the circle of its pin.
    """
    quantity = str(ask.data.get("what", ""))
    if quantity not in ARROWS:
        raise refused("vectors", f"there are none called {quantity!r}", valid=listed(ARROWS))
    motion = ask.motion
    rows = ARROWS[quantity](ask, motion, sketch_of(motion)).items()
    return [
        {"name": name, "at": _rows(motion.at(*spot)), "vector": _rows(vector)}
        for name, (spot, vector) in rows
    ]


def _rows(z: Any) -> list[list[float | None]]:
    return [numbers(part) for part in (z.real, z.imag)]


def _joints(motion: Motion, sketch: Sketch) -> dict[JointRef, Spot]:
    """Where the pairs are."""
    s, sliders = motion.structure, (slider.point for slider in sketch.sliders)
    refs = [JointRef(name, j) for name, block in s.blocks.items() for j in block.joints]
    spots = {r: next(sliders) if s.joint(r).kind == "P" else pin_spot(s, r) for r in refs}
    return {ref: spot for ref, spot in spots.items() if spot is not None}


def _reactions(ask: Question, motion: Motion, sketch: Sketch) -> Arrows:
    """Forces of the earlier links on the later ones, friction included."""
    names = {f"{ref}.reaction": spot for ref, spot in _joints(motion, sketch).items()}
    outputs = motion.result.rerun(friction=ask.friction)._inside(*names)
    return {name: (spot, outputs[name][motion.samples]) for name, spot in names.items()}


def _velocities(ask: Question, motion: Motion, sketch: Sketch) -> Arrows:
    """Velocities of the pins that move, and of the sliders."""
    spots = {pin.names[0]: pin.spot for pin in sketch.pins if not pin.grounded}
    spots |= {slider.name: slider.point for slider in sketch.sliders}
    links = {spot.link for spot in spots.values()} - {motion.structure.frame_link}
    outputs = motion.result._inside(*(f"{link}.{x}" for link in links for x in ("v", "omega")))

    def velocity(spot: Spot) -> Any:
        v, omega = (outputs[f"{spot.link}.{x}"][motion.samples] for x in ("v", "omega"))
        return np.asarray(v + 1j * omega * motion.axis[spot.link] * spot.at)

    return {name: (spot, velocity(spot)) for name, spot in spots.items() if spot.link in links}


def _friction_circles(ask: Question, motion: Motion, sketch: Sketch) -> Arrows:
    blocks, spots = motion.structure.blocks, _joints(motion, sketch)
    laws = {ref: blocks[ref.block].friction.get(ref.name) for ref in spots}
    radii = {ref: law.at_rest().factor for ref, law in laws.items() if law}
    pins = (ref for ref in radii if blocks[ref.block].joints[ref.name].kind == "R")
    n = len(motion.samples)
    return {str(ref): (spots[ref], np.full(n, radii[ref] + 0j)) for ref in pins if radii[ref]}


Arrows = Mapping[str, tuple[Spot, Any]]
ARROWS: dict[str, Callable[[Question, Motion, Sketch], Arrows]] = {
    "velocities": _velocities,
    "reactions": _reactions,
    "friction circles": _friction_circles,
}


def wire_text(ask: Question, name: str) -> str:
    """What travels on a wire in the shown pose, in a few lines; "" where nothing is known.

    Forward place and motion of the marker and its link; back force and moment on that link,
    the power, and the shares of the joint's block in reduced inertia and effort.
    """
    if name not in wires_of(ask.motion.structure):
        return ""
    values = ask.motion.result.rerun(friction=ask.friction).isel(ask.sample).wire(name)
    structure = ask.motion.structure
    rotary = [structure.joint(ref).rotary for ref in structure.driven.values()]
    shares = {"J_red": "kg m²" if rotary[0] else "kg", "tau_red": "N m" if rotary[0] else "N"}
    lines = [("→", FORWARD), ("←", BACK)] + [("reduced", shares)] * ("J_red" in values)
    return "\n".join(
        f"{direction} "
        + "; ".join(_with_unit(key, values[key], unit) for key, unit in units.items())
        for direction, units in lines
    )


def _with_unit(key: str, values: Any, unit: str) -> str:
    """A quantity at one sample, with its unit."""
    value = np.atleast_1d(values)[0]
    if not np.isfinite(value):
        return f"{key} none"
    if np.iscomplexobj(value):
        return f"{key} = ({value.real:.6g}, {value.imag:.6g}) {unit}"
    return f"{key} = {value + 0.0:.6g} {unit}"
