"""Synthesis on the page: four-bars for what is drawn, as thumbnails that are taken by a press.

Pins that no link carries are points that a coupler's point shall pass, in their order; lone links
are positions of a body, from the first pin of each along it.
"""

from __future__ import annotations

import cmath
from collections.abc import Mapping
from functools import partial
from typing import Any

import panel as pn

import blockmech
from blockmech.draw.mechanism import draw_tile
from blockmech.figures.paper import image
from blockmech.studio.looks import LINES, Plain, button, row
from blockmech.studio.sketching import outlines_of, pins_of
from blockmech.studio.work import OnProgress, Work

HOW = """Draw what is wanted with links and joints, three or more of a kind, then press Candidates:
points of a path (a click each, in their order), or positions of a body (a lone link each)."""
STARTS = 1024  # shapes that are tried for a path
THUMB = "img { width: 170px; height: 170px; object-fit: contain; background: #fff }"


def wanted(form: Mapping[str, Any]) -> tuple[list[complex], list[tuple[float, float, float]]]:
    """The points [m] and the positions [m, m, rad] that a drawing asks for."""
    pins = pins_of(form) if "links" in form else {}
    lone = [
        [pins[name].z for name in ends]
        for ends in outlines_of(pins).values()
        if len(ends) == 2 and not any(pins[name].kind for name in ends)
    ]
    positions = [(a.real, a.imag, cmath.phase(b - a)) for a, b in lone]
    return [pin.z for pin in pins.values() if not pin.links], positions


class Candidates:
    """A button, and the designs that it found."""

    def __init__(self, sheet: Any, work: Work) -> None:
        self.sheet, self.work = sheet, work
        self.button = button("Candidates", self.search)
        self.said = Plain(HOW, stylesheets=[LINES], sizing_mode="stretch_width")
        self.designs: list[Any] = []
        self.found = pn.Row(styles={"flex-wrap": "wrap"})

    def panel(self) -> Any:
        """What is asked, and below what is proposed."""
        return pn.Column(row(self.button, self.said), self.found, sizing_mode="stretch_width")

    def search(self) -> None:
        """Search beside the page; fewer than three of a kind are refused with the reason."""
        points, positions = wanted(self.sheet.form)

        def task(report: OnProgress) -> list[tuple[Any, str]]:
            if len(positions) >= len(points):
                found = blockmech.synthesis.body_guidance(positions, progress=report)
            else:
                found = blockmech.synthesis.path_generator(points, starts=STARTS, progress=report)
            return [(design, _thumbnail(design)) for design in found]

        self.work.begin(task, self.show)

    def show(self, designs: list[tuple[Any, str]]) -> None:
        """Show designs, each with a button that takes it as one step."""
        none = "No four-bar without defects passes these; move them, or ask for fewer."
        self.said.object = HOW if designs else none
        self.designs = [design for design, _ in designs]
        self.found.objects = [self._card(k, *found) for k, found in enumerate(designs, 1)]

    def _card(self, k: int, design: Any, picture: str) -> Any:
        """The picture of a design, how good it is, and the button that takes it."""
        words = f"miss {design.miss:.2g} m, margin {design.margin:.2g}"
        take = button(f"Take {k}", partial(self.take, design))
        below = row(take, Plain(words, stylesheets=[LINES]))
        return pn.Column(pn.pane.HTML(picture, stylesheets=[THUMB], margin=2), below)

    def take(self, design: Any) -> None:
        """Put a design on the sheet; *Undo* brings back what was wanted."""
        self.sheet.change(design.graph.to_data(), "candidate taken")


def _thumbnail(design: Any) -> str:
    mechanism = design.graph.compile()
    at = dict.fromkeys(mechanism.drivers, design.at)
    return image(draw_tile(mechanism, at), "a candidate in the wanted positions")
