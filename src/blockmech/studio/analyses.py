"""Analyses on the page: the package's own answers, as text and picture, by a press of a button."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
import panel as pn

from blockmech.draw.curves import chosen_panels
from blockmech.draw.panels import Abscissa, Panel, draw_panels
from blockmech.draw.paper import image
from blockmech.errors import BlockmechError
from blockmech.samples import Samples
from blockmech.studies.family import remade
from blockmech.studies.sampling import normal
from blockmech.studies.variation import moves_drivers
from blockmech.studio.looks import TABLE, Plain, beside
from blockmech.studio.session import together
from blockmech.studio.work import Work
from blockmech.typing import FrictionMethod

PICTURE = "picture of the answer"
CURVES = 5  # of a family, the middle one as the sheet has it
EVERY = 10  # of the poses, for what takes long at each
NOTHING = "nothing moves on this sheet yet, or no output is ticked under Curves"


class Asked(NamedTuple):
    """What an analysis is of: a mechanism with the samples that are shown, and the first output."""

    mechanism: Any
    samples: Samples
    at: Mapping[str, Any]
    name: str
    friction: FrictionMethod
    share: float = 0.0


def _tolerance(request: Asked) -> Any:
    """Every length that is not 0 scatters by the share, as a standard deviation."""
    lengths = {
        p.address: normal(p.value, request.share * abs(p.value))
        for p in request.mechanism.parameters().values()
        if p.unit == "m" and p.value and not moves_drivers(p.path)
    }
    return request.mechanism.tolerance(lengths, request.name, friction=request.friction)


def _solutions(request: Asked) -> Any:
    """All solutions of the friction equations at some of the poses."""
    at = {driver: q[::EVERY] for driver, q in request.at.items()}
    return request.mechanism.friction_solutions(at, want=request.name)


def _limits(request: Asked) -> Any:
    """The arcs of the driver that moves, the others held where they are shown."""
    moved, *held = sorted(request.at, key=lambda driver: -np.ptp(request.at[driver]))
    return request.mechanism.limits(
        moved, {driver: float(request.at[driver][0]) for driver in held}
    )


ANALYSES: dict[str, tuple[str, Callable[[Asked], Any]]] = {
    "Limits": ("Where does the driver reach?", _limits),
    "Modes": ("How can it be assembled?", lambda ask: ask.mechanism.modes()),
    "Equilibria": (
        "Where does it rest under its loads?",
        lambda ask: ask.mechanism.equilibria(friction=ask.friction),
    ),
    "Extremes": (
        "What are the least and the largest value of the first output?",
        lambda ask: ask.mechanism.extremes(ask.name, friction=ask.friction),
    ),
    "Friction solutions": ("How many answers do the friction equations have?", _solutions),
    "Sensitivity": (
        "How much does the first output change with each number?",
        lambda ask: ask.mechanism.sensitivity(ask.name, at=ask.at, friction=ask.friction),
    ),
    "Tolerance": ("How does the first output scatter with the lengths?", _tolerance),
    "Verify": ("Do the equations of mechanics hold?", lambda ask: ask.mechanism.verify()),
}


def family(asked: Asked, address: str) -> Panel:
    """The output for several values of a number, from the share below to the share above.

    Each is run at the same samples; what does not close is left out. Raises what
    `remade` raises for values that cannot be.
    """
    value = asked.mechanism.parameters()[address].value
    how = {"friction": asked.friction, "tolerance": None, "iterations": None, "static": False}
    curves: dict[str, Any] = {}
    for x in value * (1 + asked.share * np.linspace(-1, 1, CURVES)):
        other = remade(asked.mechanism, {address: float(x)})
        run = other.answer(asked.samples, (asked.name,), how, None, "auto", None, None, "mark")
        (panel,) = chosen_panels(run, [asked.name])
        curves[f"{address} = {x:.4g}"] = next(iter(panel.curves.values()))
    return Panel(panel.quantity, panel.unit, curves)


class Analyses:
    """Buttons of the analyses, the family of curves of a number, and what they answer."""

    def __init__(
        self, ask: Callable[[], Asked | None], along: Callable[[], Abscissa], work: Work
    ) -> None:
        self.ask, self.along, self.work = ask, along, work
        self.text = Plain("", sizing_mode="stretch_width", stylesheets=[TABLE])
        self.image = pn.pane.HTML("", sizing_mode="stretch_width")
        self.buttons = [
            pn.widgets.Button(label=name, description=words, on_click=self._pressed)
            for name, (words, _) in ANALYSES.items()
        ]
        self.number = pn.widgets.Select(label="Number", options=[], width=170)
        self.share = pn.widgets.FloatInput(
            label="± [%]", value=10.0, start=0.01, end=90.0, width=80
        )
        for widget in (self.number, self.share):
            widget.param.watch(lambda _: self.vary(), "value")

    def panel(self) -> Any:
        """What is asked, and below what is answered."""
        self.renew()
        choices = beside(*self.buttons, self.number, self.share)
        return pn.Column(choices, self.text, self.image, sizing_mode="stretch_width")

    def renew(self) -> None:
        """Offer the numbers of the mechanism; what was answered of another one goes."""
        request = self.ask()
        numbers = {} if request is None else request.mechanism.parameters()
        known = [address for address, number in numbers.items() if number.value]
        options = ["", *known]
        if self.number.options != options:
            value = self.number.value if self.number.value in known else ""
            self.number.param.update(options=options, value=value)
        self.show("", "")
        self.vary()

    def show(self, text: str, picture: str) -> None:
        """Show an answer."""
        self.text.object = text
        self.image.object = picture

    def _pressed(self, event: Any) -> None:
        self.run(event.obj.label)

    def run(self, name: str) -> None:
        """Ask one of the analyses, beside the page."""
        request = self._asked()
        if request is None:
            self.show(NOTHING, "")
            return

        def task(report: Callable[..., None]) -> tuple[str, str]:
            report(f"{name} ...")
            answered = ANALYSES[name][1](request)
            with suppress(BlockmechError):  # of what has no picture the text stands alone
                figure = getattr(answered, "figure", None)
                return str(answered), image(figure(), PICTURE) if figure else ""
            return str(answered), ""

        self.work.begin(task, lambda answered: self.show(*answered))

    @together
    def vary(self) -> None:
        """Draw the first output for several values of the chosen number."""
        request, address = self._asked(), self.number.value
        if not address or request is None:
            return
        try:
            drawn = draw_panels([family(request, address)], self.along())
        except BlockmechError as error:
            self.show(str(error), "")
        else:
            words = f"{request.name} for {CURVES} values of {address}"
            self.show(words, image(drawn, PICTURE))

    def _asked(self) -> Asked | None:
        request = self.ask()
        return request and request._replace(share=(self.share.value or 0.0) / 100)
