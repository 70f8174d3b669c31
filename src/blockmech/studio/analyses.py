"""Analyses on the page: the package's own answers, as text and picture, by a press of a button."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import panel as pn

from blockmech.figures.curves import chosen_panels
from blockmech.figures.panels import Abscissa, Panel, draw_panels
from blockmech.figures.paper import image
from blockmech.ground.errors import BlockmechError
from blockmech.result.samples import Samples
from blockmech.studies.differentiate import without_derivative
from blockmech.studies.family import remade
from blockmech.studies.sampling import normal
from blockmech.studio.looks import TABLE, Plain, button, row
from blockmech.studio.session import together
from blockmech.studio.work import OnProgress, Work
from blockmech.typing import FrictionName

PICTURE = "picture of the answer"
BESIDE = "img { height: 205px; max-width: none }"  # px, of the drawer below the tabs
CURVES = 5  # of a family, the middle one as the sheet has it
EVERY = 10  # of the poses, for what takes long at each
NOTHING = "nothing moves on this sheet yet, or no output is ticked under Curves"


class Asked(NamedTuple):
    """What an analysis is of: a mechanism with the samples that are shown, and chosen outputs."""

    mechanism: Any
    samples: Samples
    at: Mapping[str, Any]
    names: tuple[str, ...]
    friction: FrictionName
    share: float = 0.0
    report: OnProgress | None = None


def answered(
    mechanism: Any, samples: Samples, names: Iterable[str], friction: str, accuracy: Any = None
) -> Any:
    """Outputs at samples, gaps marked; with an ``accuracy`` the method is chosen by it."""
    if accuracy is not None:
        return mechanism.run_to(accuracy, {}, samples, tuple(names), False, "auto", None)
    how = {"friction": friction, "static": False}
    return mechanism._answer(samples, tuple(names), how)


def _at(request: Asked) -> Mapping[str, Any] | None:
    """The poses that are shown, where the drivers' laws do not say which."""
    return None if {*request.at} <= {*request.mechanism.scene.drive} else request.at


def _tolerance(request: Asked) -> Any:
    """Every length that is not 0 scatters by the share, as a standard deviation."""
    lengths = {
        p.address: normal(p.value, request.share * abs(p.value))
        for p in request.mechanism.parameters().values()
        if p.unit == "m" and p.value and not without_derivative(p)
    }
    name, friction = request.names[0], request.friction
    return request.mechanism.tolerance(lengths, name, _at(request), friction=friction)


def _solutions(request: Asked) -> Any:
    """All solutions of the friction equations at some of the poses."""
    at = {driver: q[::EVERY] for driver, q in request.at.items()}
    return request.mechanism.friction_solutions(at, want=request.names[0])


def _limits(request: Asked) -> Any:
    """The arcs of the driver that moves, the others held where they are shown."""
    moved, *held = sorted(request.at, key=lambda driver: -np.ptp(request.at[driver]))
    at = {driver: float(request.at[driver][0]) for driver in held}
    return request.mechanism.limits(moved, at)


ANALYSES: dict[str, tuple[str, Callable[[Asked], Any]]] = {
    "Limits": ("Where does the driver reach?", _limits),
    "Modes": ("How can it be assembled?", lambda ask: ask.mechanism.modes()),
    "Equilibria": (
        "Where does it rest under its loads?",
        lambda ask: ask.mechanism.equilibria(friction=ask.friction),
    ),
    "Extremes": (
        "What are the least and the largest value of the first output?",
        lambda ask: ask.mechanism.extremes(ask.names[0], friction=ask.friction),
    ),
    "Friction solutions": ("How many answers do the friction equations have?", _solutions),
    "Sensitivity": (
        "How much does the first output change with each number?",
        lambda ask: ask.mechanism.sensitivity(ask.names[0], at=ask.at, friction=ask.friction),
    ),
    "Tolerance": ("How does the first output scatter with the lengths?", _tolerance),
    "Verify": ("Do the equations of mechanics hold?", lambda ask: ask.mechanism.verify(_at(ask))),
    "Cost": (
        "What does each chosen output cost?",
        lambda ask: ask.mechanism.explain(ask.names, friction=ask.friction),
    ),
    "Trade": (
        "What do methods cost, and how exact are they?",
        lambda ask: ask.mechanism.trade("run", ask.names, say=ask.report),
    ),
}


def family(asked: Asked, address: str) -> Panel:
    """The output for several values of a number, from the share below to the share above.

    Each is run at the same samples; what does not close is left out. Raises what
    `remade` raises for values that cannot be.
    """
    value = asked.mechanism.parameters()[address].value
    curves: dict[str, Any] = {}
    for x in value * (1 + asked.share * np.linspace(-1, 1, CURVES)):
        other = remade(asked.mechanism, {address: float(x)})
        run = answered(other, asked.samples, asked.names[:1], asked.friction)
        (panel,) = chosen_panels(run, asked.names[:1])
        curves[f"{address} = {x:.4g}"] = next(iter(panel.curves.values()))
    return Panel(panel.quantity, panel.unit, curves)


class Analyses:
    """Buttons of the analyses, the family of curves of a number, and what they answer."""

    def __init__(
        self, ask: Callable[[], Asked | None], along: Callable[[], Abscissa], work: Work
    ) -> None:
        self.ask, self.along, self.work = ask, along, work
        self.text = Plain("", sizing_mode="stretch_width", stylesheets=[TABLE])
        self.image = pn.pane.HTML("", visible=False, stylesheets=[BESIDE])
        asked = {name: words for name, (words, _) in ANALYSES.items()}
        self.buttons = [button(n, partial(self.run, n), description=w) for n, w in asked.items()]
        self.number = pn.widgets.Select(label="Number", options=[""], width=170)
        bounds = {"start": 0.01, "end": 90.0}
        self.share = pn.widgets.FloatInput(label="± [%]", value=10.0, width=80, **bounds)
        for widget in (self.number, self.share):
            widget.param.watch(lambda _: self.vary(), "value")

    def panel(self) -> Any:
        """What is asked, below it what is answered, and beside both its picture."""
        choices = row(*self.buttons, self.number, self.share)
        wide = {"sizing_mode": "stretch_width", "scroll": "x-auto"}
        return pn.Row(pn.Column(choices, self.text, **wide), self.image, **wide)

    def renew(self) -> None:
        """Offer the numbers of the mechanism; what was answered of another one goes."""
        request = self.ask()
        numbers = {} if request is None else request.mechanism.parameters()
        options = ["", *(address for address, number in numbers.items() if number.value)]
        value = self.number.value if self.number.value in options else ""
        self.number.param.update(options=options, value=value)
        self.show()
        self.vary()

    def show(self, text: str = "", picture: str = "") -> None:
        """Show an answer."""
        self.text.object = text
        self.image.param.update(object=picture, visible=bool(picture))

    def run(self, name: str) -> None:
        """Ask one of the analyses, beside the page."""
        request = self._asked()
        if request is None:
            self.show(NOTHING)
            return

        def task(report: OnProgress) -> tuple[str, str]:
            report(f"{name} ...")
            answer = ANALYSES[name][1](request._replace(report=report))
            with suppress(BlockmechError):  # of what has no picture the text stands alone
                figure = getattr(answer, "figure", None)
                return str(answer), image(figure(), PICTURE) if figure else ""
            return str(answer), ""

        self.work.begin(task, lambda answer: self.show(*answer))

    @together
    def vary(self) -> None:
        """Draw the first output for several values of the chosen number."""
        request, address = self._asked(), self.number.value
        if not address or request is None:
            return
        try:
            drawn = draw_panels([family(request, address)], self.along())
        except BlockmechError as error:
            self.show(str(error))
        else:
            words = f"{request.names[0]} for {CURVES} values of {address}"
            self.show(words, image(drawn, PICTURE))

    def _asked(self) -> Asked | None:
        request = self.ask()
        return request and request._replace(share=(self.share.value or 0.0) / 100)
