"""What the page asks of a mechanism: outputs as curves, analyses, motions, designs, files.

Each question is plain data, each answer too: texts, pictures as SVG, rows of numbers. Those that
take long are asked in a process of their own (`blockmech.editor.jobs`).
"""

from __future__ import annotations

import cmath
import re
import shutil
import tempfile
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

import blockmech
from blockmech.builders import from_data
from blockmech.draw.animation import Animation
from blockmech.draw.mechanism import draw_mechanism, draw_tile
from blockmech.draw.motion import Motion, moves_of_result
from blockmech.draw.simulation import FRAME, screen_time
from blockmech.draw.sketch import Sketch, sketch_of
from blockmech.dynamics.chart_outputs import result_along
from blockmech.dynamics.simulation import simulate
from blockmech.editor.document import Revision
from blockmech.editor.pins import outlines_of, pins_of
from blockmech.editor.redraw import as_links
from blockmech.editor.turn import along_of, motion_data, numbers, poses_of, shown_motion
from blockmech.exchange.formats import WRITERS, Order
from blockmech.figures.curves import chosen_panels, without_friction
from blockmech.figures.panels import Abscissa, Panel, draw_panels
from blockmech.figures.paper import MOVING, STILL, rendered, scaled_unit, shown_name
from blockmech.ground.errors import BlockmechError, listed, refused
from blockmech.ground.runnable import EVERYTHING
from blockmech.model.spots import Spot, pin_spot
from blockmech.model.structure import JointRef
from blockmech.model.writing import canonical_text
from blockmech.result.result import Result
from blockmech.result.samples import DEFAULT_SAMPLES
from blockmech.result.wires import on_wires, wires_of
from blockmech.studies.differentiate import without_derivative
from blockmech.studies.distributions import Normal
from blockmech.studies.family import remade
from blockmech.typing import Data, Record

Report = Callable[..., None]
Answer = Data
CURVES = 5  # of a family, the middle one as the sheet has it
EVERY = 10  # of the poses, for what takes long at each
STARTS = 1024  # shapes that are tried for a path
DESIGNS = 6  # that are shown
SEARCHED = 24  # of which these are the smallest
NOTHING = "nothing moves on this sheet yet"
HINT = "Masses gives links the mass of bars."
FORWARD = {"p": "m", "v": "m/s", "a": "m/s²", "om": "rad/s", "al": "rad/s²"}
BACK = {"F": "N", "M": "N m", "power": "W"}


@dataclass(frozen=True)
class Question:
    """What is asked of a revision of a sheet.

    ``names`` are chosen outputs, ``at`` where drivers were put by hand, ``moved`` which of them
    moves, ``pose`` the shown one of the samples.
    """

    now: Revision
    names: tuple[str, ...] = ()
    friction: Any = "newton"
    accuracy: float | None = None
    moved: str = ""
    at: Mapping[str, float] | None = None
    share: float = 0.1
    number: str = ""
    until: str = "time=2"
    pose: int = 0
    degrees: bool = True
    report: Report | None = None
    computed: Motion | None = None

    @classmethod
    def of(cls, now: Revision, data: Record, **extra: Any) -> Question:
        """A question in plain data."""
        units = str(data.get("units", ""))
        return cls(
            now,
            tuple(map(str, data.get("names", ()))),
            str(data.get("friction") or "newton"),
            float(data["accuracy"]) if data.get("accuracy") else None,
            str(data.get("moved", "")),
            {str(d): float(q) for d, q in (data.get("held") or {}).items()},
            float(data.get("share", 10.0)) / 100,
            str(data.get("number", "")),
            str(data.get("until") or "time=2"),
            int(data.get("pose", 0)),
            "|rad|" not in f"|{units}|",
            **extra,
        )

    @cached_property
    def motion(self) -> Motion:
        """The motion that is shown. Raises `RequestError` where nothing moves."""
        if self.computed is not None:
            return self.computed
        now = self.now
        motion, message = shown_motion(
            now.form, now.mechanism, now.problems, self.moved, self.at or {}, now.document.file
        )
        if motion is None:
            raise refused("mechanism", message or NOTHING, "draw what moves first")
        return motion

    @property
    def mechanism(self) -> Any:
        """What moves."""
        return self.motion.mechanism

    @property
    def first(self) -> str:
        """The first of the chosen outputs. Raises `RequestError` for none."""
        chosen = [name for name in self.names if name in self.mechanism.outputs]
        if not chosen:
            raise refused("outputs", "none is chosen under Curves", "choose one there")
        return chosen[0]

    @property
    def rows(self) -> Record | None:
        """The poses that are shown, where the drivers' laws do not say which."""
        q = self.motion.q
        return None if {*q} <= {*self.mechanism.scene.drive} else q


# -- curves ----------------------------------------------------------------------------------


def result_of(ask: Question, names: Iterable[str]) -> Result:
    """Outputs at the samples of the motion; gaps are marked.

    With an ``accuracy`` the method is chosen by it. Raises `RequestError` for what cannot be.
    """
    result, chosen = ask.motion.result, tuple(names)
    if ask.accuracy is None or result.motion is not None:
        return result.rerun(*chosen, friction=ask.friction)
    m: Any = result.mechanism
    computed: Result = m._run_to(ask.accuracy, {}, result.samples, chosen, False, "auto", None)
    return computed


def curves(ask: Question) -> Answer:
    """The chosen outputs over the motion by quantity, forces without friction beside them."""
    motion = ask.motion
    names = [name for name in ask.names if name in motion.mechanism.outputs]
    abscissa = along_of(motion, ask.degrees)
    data: Answer = {"along": _abscissa_data(abscissa), "panels": [], "said": "", "margins": []}
    margin = motion.quality.margin
    if margin:
        name_of = motion.mechanism._block_name
        margins = Panel("margin", "", {name_of(block): m for block, m in margin.items()})
        data["margins"] = [_panel(margins)]
    if names:
        start = time.perf_counter()
        result = result_of(ask, names)
        data["panels"] = [_panel(panel) for panel in panels_of(result, names)]
        data["said"] = _summary(result, time.perf_counter() - start)
    return data


def panels_of(result: Result, names: Iterable[str]) -> list[Panel]:
    """The named outputs by quantity and unit, forces without friction beside them."""
    bare: dict[tuple[str, str], Panel] = {}
    bare_result = without_friction(result)
    if bare_result is not None:
        bare = {(p.quantity, p.unit): p for p in chosen_panels(bare_result, bare_result)}
    panels = []
    for panel in chosen_panels(result, names):
        frictionless = bare.get((panel.quantity, panel.unit))
        panels.append(
            panel if frictionless is None else replace(panel, without=frictionless.curves)
        )
    return panels


def _abscissa_data(abscissa: Abscissa) -> Answer:
    return {
        "words": abscissa.words,
        "values": numbers(abscissa.values),
        "events": [[float(x), name] for x, name in abscissa.events],
    }


def _panel(panel: Panel) -> Answer:
    """A panel as the page draws it; what is only rounding of the largest number is none."""
    low, high = panel.shown
    factor, unit = scaled_unit(panel.unit, max(abs(low), abs(high)))
    both = {"curves": panel.curves, "without": panel.without}
    return {
        "quantity": panel.quantity,
        "unit": unit or "-",
        "shown": [factor * low, factor * high],
        **{
            key: [
                [shown_name(name) or panel.quantity, numbers(factor * y)] for name, y in of.items()
            ]
            for key, of in both.items()
        },
    }


def _summary(result: Result, seconds: float) -> str:
    """What was computed, how, and what it took."""
    cost = f"{result.n} samples, {result.plan.calls} kernel calls a sample, {seconds * 1e3:.1f} ms"
    chosen = f"; {result.accuracy}" if result.accuracy is not None else ""
    gaps = len(result.quality.gaps)
    holes = f"; {gaps} samples without an answer" if gaps else ""
    error = "" if result.motion is None else f"; {result.motion.summary()[0]}"
    return "; ".join([cost + chosen + holes + error, *result.notes()])


# -- arrows ------------------------------------------------------------------------------------


def vectors(ask: Question, quantity: str) -> list[Answer]:
    """Velocities of pins, or reactions at joints, as places [m] and vectors at all samples.

    Of friction circles the vector's length is the radius [m]: without rates a reaction touches
    the circle of its pin.
    """
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
    sample = ask.motion.result.rerun(friction=ask.friction).isel(ask.pose)
    structure = sample.mechanism.structure
    (values,) = on_wires(structure, sample._inside, sample.n, name).values()
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


# -- analyses ----------------------------------------------------------------------------------


def _tolerance(ask: Question) -> Any:
    """Every length that is not 0 scatters by the share, as a standard deviation."""
    lengths = {
        p.address: Normal(p.value, ask.share * abs(p.value))
        for p in ask.mechanism.parameters().values()
        if p.unit == "m" and p.value and not without_derivative(p)
    }
    return ask.mechanism.tolerance(lengths, ask.first, ask.rows, friction=ask.friction)


def _solutions(ask: Question) -> Any:
    """All solutions of the friction equations at some of the poses."""
    at = {driver: q[::EVERY] for driver, q in ask.motion.q.items()}
    return ask.mechanism.friction_solutions(at, want=ask.first)


def _limits(ask: Question) -> Any:
    """The arcs of the driver that moves, the others held where they are shown."""
    q = ask.motion.q
    moved, *fixed = sorted(q, key=lambda driver: -np.ptp(q[driver]))
    return ask.mechanism.limits(moved, {driver: float(q[driver][0]) for driver in fixed})


def _family(ask: Question) -> Answer:
    """The first output for several values of a number, from the share below to that above.

    Each is run at the same samples; what does not close is left out. Raises what
    `remade` raises for values that cannot be.
    """
    parameters = ask.mechanism.parameters()
    if ask.number not in parameters:
        raise refused("number", "none is chosen", "choose one in the list")
    value, samples = parameters[ask.number].value, ask.motion.result.samples
    family: Data = {}
    settings = {"friction": ask.friction, "static": False}
    for x in value * (1 + ask.share * np.linspace(-1, 1, CURVES)):
        variant: Any = remade(ask.mechanism, {ask.number: float(x)})
        run = variant._answer(samples, (ask.first,), settings)
        (panel,) = chosen_panels(run, (ask.first,))
        family[f"{ask.number} = {x:.4g}"] = next(iter(panel.curves.values()))
    picture = draw_panels([Panel(panel.quantity, panel.unit, family)], along_of(ask.motion, True))
    caption = f"{ask.first} for {CURVES} values of {ask.number}"
    return {"text": caption, "picture": _svg(picture)}


ANALYSES: dict[str, tuple[str, Callable[[Question], Any]]] = {
    "Limits": ("Where does the driver reach?", _limits),
    "Modes": ("How can it be assembled?", lambda ask: ask.mechanism.modes()),
    "Equilibria": (
        "Where does it rest under its loads?",
        lambda ask: ask.mechanism.equilibria(friction=ask.friction),
    ),
    "Extremes": (
        "What are the least and the largest value of the first output?",
        lambda ask: ask.mechanism.extremes(ask.first, friction=ask.friction),
    ),
    "Friction solutions": ("How many answers do the friction equations have?", _solutions),
    "Sensitivity": (
        "How much does the first output change with each number?",
        lambda ask: ask.mechanism.sensitivity(ask.first, at=ask.motion.q, friction=ask.friction),
    ),
    "Tolerance": ("How does the first output scatter with the lengths?", _tolerance),
    "Verify": ("Do the equations of mechanics hold?", lambda ask: ask.mechanism.verify(ask.rows)),
    "Cost": (
        "What does each chosen output cost?",
        lambda ask: ask.mechanism.explain(ask.names, friction=ask.friction),
    ),
    "Trade": (
        "What do methods cost, and how exact are they?",
        lambda ask: ask.mechanism.trade("run", ask.names, say=ask.report),
    ),
    "Family": ("How does the first output change with a number?", _family),
}


def analysis(ask: Question, name: str) -> Answer:
    """The answer of an analysis, as text and picture. Raises `BlockmechError` with the reason."""
    if name not in ANALYSES:
        raise refused("analysis", f"there is none called {name!r}", "choose one on the page")
    answer = ANALYSES[name][1](ask)
    if isinstance(answer, dict):
        return answer
    picture = ""
    with suppress(BlockmechError):  # of what has no picture the text stands alone
        figure = getattr(answer, "figure", None)
        picture = _svg(figure()) if figure else ""
    return {"text": str(answer), "picture": picture}


def _svg(figure: Any) -> str:
    return rendered(figure, ".svg").decode()


def simulation(ask: Question) -> tuple[Motion, Answer]:
    """The mechanism moved under its loads; a driver without a start is let go in the shown pose."""
    mechanism = ask.now.mechanism
    if mechanism is None:
        raise refused("motion", NOTHING, "draw what moves first")
    pose = {driver: float(q[ask.pose]) for driver, q in ask.motion.q.items()}
    free = {*mechanism.drivers} - {*mechanism.scene.initial}
    start = {driver: (q, 0.0) for driver, q in pose.items() if driver in free}
    run = simulate(
        mechanism,
        ask.until,
        start=start,
        want=(),
        friction=ask.friction,
        progress=ask.report or (lambda *_: None),
    )
    times = run.motion.times(DEFAULT_SAMPLES)
    result = result_along(mechanism, run.motion, times, (), friction=ask.friction)
    motion = moves_of_result(result)
    data = motion_data(motion, {})
    data["poses"] = poses_of(motion)
    answered = replace(ask, computed=motion)
    return motion, {
        "motion": data,
        "text": "\n".join(result.motion.lines()),
        "curves": curves(answered),
    }


# -- synthesis ---------------------------------------------------------------------------------


def wishes(form: Record) -> tuple[list[complex], list[tuple[float, float, float]]]:
    """The points [m] and the positions [m, m, rad] that a drawing asks for."""
    pins = pins_of(form) if "links" in form else {}
    lone = [
        [pins[name].z for name in ends]
        for ends in outlines_of(pins).values()
        if len(ends) == 2 and not any(pins[name].kind for name in ends)
    ]
    positions = [(a.real, a.imag, cmath.phase(b - a)) for a, b in lone]
    return [pin.z for pin in pins.values() if not pin.links], positions


def synthesis(ask: Question) -> Answer:
    """Four-bars for what is drawn, the smallest first.

    Pins that no link carries are points that a coupler's point shall pass, in their order; lone
    links are positions of a body. Fewer than three of a kind are refused with the reason.
    """
    points, positions = wishes(ask.now.form)
    count, progress = SEARCHED, ask.report
    if len(positions) >= len(points):
        designs = blockmech.synthesis.body_guidance(positions, count=count, progress=progress)
    else:
        designs = blockmech.synthesis.path_generator(
            points, count=count, starts=STARTS, progress=progress
        )
    cards = sorted((_card(design) for design in designs), key=lambda card: card["size"])
    return {"designs": cards[:DESIGNS], "text": "" if cards else NONE}


NONE = "No four-bar without defects passes these; move them, or ask for fewer."


def _card(design: Any) -> Answer:
    """A design with its picture, how large it is, and how near it comes."""
    mechanism = design.graph.compile()
    at = dict.fromkeys(mechanism.drivers, design.at)
    lengths = [p.value for p in mechanism.parameters().values() if p.unit == "m" and p.value]
    shortest, longest = min(map(abs, lengths)), max(map(abs, lengths))
    links = f"links {shortest:.3g} to {longest:.3g} m"
    return {
        "words": f"{links}, miss {design.miss:.2g} m, margin {design.margin:.2g}",
        "size": longest + longest / shortest * 1e-3,
        "picture": _svg(draw_tile(mechanism, at)),
        "form": _as_drawing(design.graph),
    }


def _as_drawing(graph: Any) -> Any:
    """A design as links and joints, to be drawn on; its crank counts from the x axis."""
    form = graph.to_data()
    blocks = {
        name: {k: x for k, x in b.items() if k != "offset"} for name, b in form["blocks"].items()
    }
    form = {**form, "blocks": blocks}
    motion, _ = shown_motion(form, from_data(form).compile(), (), "", {})
    return form if motion is None else as_links(form, motion)


# -- files ---------------------------------------------------------------------------------------

NUMBERS = ("csv", "xlsx", "mat", "npz", "parquet", "json")
OUTLINES = ("dxf", "svg")


def formats() -> dict[str, list[str]]:
    """What can be written, in groups: each a word and a suffix, or the name of a format."""
    programs = [name for name in WRITERS if name not in (*NUMBERS, *OUTLINES)]
    return {
        "Sheet": ["document .json", *(f"diagram {suffix}" for suffix in STILL)],
        "Pictures": [f"pose {suffix}" for suffix in STILL] + [f"motion {s}" for s in MOVING],
        "Numbers": [f"numbers .{name}" for name in NUMBERS],
        "Programs": [f"outlines .{name}" for name in OUTLINES] + programs,
    }


def exported(kind: str, ask: Question, seconds: float = 3.0) -> tuple[str, bytes]:
    """The name of a file, and its content; of several files a zip.

    Raises `RequestError` where nothing moves yet, and for what a format cannot say.
    """
    category, _, suffix = kind.partition(" ")
    form = ask.now.form
    name = re.sub(r"[^\w-]+", "_", form["name"])  # no name leads out of a folder
    if category == "document":
        return f"{name}.json", canonical_text(form).encode()
    if category == "diagram":
        from blockmech.draw.diagram import draw_diagram

        return f"diagram{suffix}", rendered(draw_diagram(ask.now.blocks).figure, suffix)
    if category == "pose":
        at = {driver: [x] for driver, x in _pose(ask).items()}
        picture = draw_mechanism(ask.mechanism, at, degrees=ask.degrees)
        return f"mechanism{suffix}", rendered(picture.figure, suffix)
    if category == "motion":
        return f"mechanism{suffix}", _film(ask, suffix, seconds)
    return _written(suffix.lstrip(".") or category, name, ask)


def _pose(ask: Question) -> dict[str, float]:
    """Where the drivers are in the shown pose."""
    return {driver: float(q[ask.pose]) for driver, q in ask.motion.q.items()}


def _film(ask: Question, suffix: str, seconds: float) -> bytes:
    """The motion, in the time in which it is played."""
    motion, simulated = ask.motion, ask.motion.result.motion is not None
    time = motion.time if simulated else None
    played = seconds if time is None else screen_time(float(np.ptp(time)))
    every = max(1, round(len(motion.samples) * FRAME / played))
    if not simulated:
        motion, every = motion.only(np.arange(0, len(motion.samples), every)), 0
    film = Animation(motion, played, degrees=ask.degrees, every=every)
    return film.html.encode() if suffix == ".html" else bytes(getattr(film, suffix[1:]))


def _written(to: str, name: str, ask: Question) -> tuple[str, bytes]:
    """The file of a format of `blockmech.exchange`: outlines in the shown pose."""
    motion = ask.motion
    names = [x for x in ask.names if x in motion.mechanism.outputs]
    result = result_of(ask, names) if names else None
    at = _pose(ask) if to in OUTLINES else motion.q
    want = EVERYTHING if result is None else tuple(result)
    order = Order(motion.mechanism, want, {"at": at}, {"friction": ask.friction}, computed=result)
    with tempfile.TemporaryDirectory() as folder:
        outputs = Path(folder, "made")
        outputs.mkdir()
        paths = WRITERS[to].write(order, outputs / f"{name}{WRITERS[to].suffixes[0]}")
        if len(paths) > 1:
            paths = [Path(shutil.make_archive(f"{folder}/{name}-{to}", "zip", outputs))]
        return paths[0].name, paths[0].read_bytes()
