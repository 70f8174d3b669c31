"""The analyses, motions under loads, and the synthesis that the page offers."""

from __future__ import annotations

import cmath
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np

import blockmech
from blockmech.builders import from_data
from blockmech.draw.mechanism import draw_tile
from blockmech.editor.pins import outlines_of, pins_of
from blockmech.editor.redraw import as_links
from blockmech.editor.revision import Question, Revision, svg
from blockmech.editor.turn import along_of
from blockmech.figures.curves import chosen_panels
from blockmech.figures.palette import PANELS
from blockmech.figures.panels import Panel, draw_panels
from blockmech.ground.errors import BlockmechError, refused
from blockmech.studies.differentiate import without_derivative
from blockmech.studies.distributions import Normal
from blockmech.studies.family import remade
from blockmech.typing import Arguments, Data, Record

CURVES = PANELS - 1  # of a family, the middle one as the sheet has it
EVERY = 10  # of the poses, for what takes long at each
STARTS = 1024  # shapes that are tried for a path
SEARCHED = 4 * PANELS  # designs, of which the smallest are shown
NONE = "No four-bar without defects passes these; move them, or ask for fewer."


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


def _family(ask: Question) -> Data:
    """The first output for several values of a number, from the share below to that above.

    Each is run at the same samples; what does not close is left out. Raises what
    `remade` raises for values that cannot be.
    """
    parameters, number = ask.mechanism.parameters(), str(ask.data.get("number"))
    if number not in parameters:
        raise refused("number", "none is chosen", "choose one in the list")
    value, samples = parameters[number].value, ask.motion.result.samples
    family: Data = {}
    settings = {"friction": ask.friction, "static": False}
    for x in value * (1 + ask.share * np.linspace(-1, 1, CURVES)):
        variant: Any = remade(ask.mechanism, {number: float(x)})
        (panel,) = chosen_panels(variant._answer(samples, (ask.first,), settings), (ask.first,))
        family[f"{number} = {x:.4g}"] = next(iter(panel.curves.values()))
    picture = draw_panels([Panel(panel.quantity, panel.unit, family)], along_of(ask.motion))
    return {"text": f"{ask.first} for {CURVES} values of {number}", "picture": svg(picture)}


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


def analysis(ask: Question, name: str) -> Data:
    """The answer of an analysis, as text and picture. Raises `BlockmechError` with the reason."""
    if name not in ANALYSES:
        raise refused("analysis", f"there is none called {name!r}", "choose one on the page")
    answer = ANALYSES[name][1](ask)
    if isinstance(answer, dict):
        return answer
    picture = ""
    with suppress(BlockmechError):  # of what has no picture the text stands alone
        figure = getattr(answer, "figure", None)
        picture = svg(figure()) if figure else ""
    return {"text": str(answer), "picture": picture}


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


def synthesis(ask: Question) -> Data:
    """Four-bars for what is drawn, the smallest first.

    Pins that no link carries are points that a coupler's point shall pass, in their order; lone
    links are positions of a body. Fewer than three of a kind are refused with the reason.
    """
    points, positions = wishes(ask.now.form)
    settings: Arguments = {"count": SEARCHED, "progress": ask.report}
    if len(positions) >= len(points):
        designs = blockmech.synthesis.body_guidance(positions, **settings)
    else:
        designs = blockmech.synthesis.path_generator(points, starts=STARTS, **settings)
    cards = sorted((_card(design) for design in designs), key=lambda card: card["size"])
    return {"designs": cards[:PANELS], "text": "" if cards else NONE}


def _card(design: Any) -> Data:
    """A design with its picture, how large it is, and how near it comes."""
    mechanism = design.graph.compile()
    at = dict.fromkeys(mechanism.drivers, design.at)
    lengths = [p.value for p in mechanism.parameters().values() if p.unit == "m" and p.value]
    shortest, longest = min(map(abs, lengths)), max(map(abs, lengths))
    links = f"links {shortest:.3g} to {longest:.3g} m"
    return {
        "words": f"{links}, miss {design.miss:.2g} m, margin {design.margin:.2g}",
        "size": longest + longest / shortest * 1e-3,
        "picture": svg(draw_tile(mechanism, at)),
        "form": _as_drawing(design.graph),
    }


def _as_drawing(graph: Any) -> Any:
    """A design as links and joints, to be drawn on; its crank counts from the x axis."""
    form = graph.to_data()
    blocks = {
        name: {k: x for k, x in b.items() if k != "offset"} for name, b in form["blocks"].items()
    }
    form = {**form, "blocks": blocks}
    motion, _ = Revision(0, form, from_data(form)).shown_motion()
    return form if motion is None else as_links(form, motion)
