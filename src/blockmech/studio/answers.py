"""Answers beside the mechanism: outputs as curves, what travels on wires, motions, costs."""

from __future__ import annotations

import html
import time
from collections.abc import Callable, Iterable
from typing import Any, get_args

import numpy as np
import panel as pn
import param
from bokeh.models import Div

from blockmech.draw.motion import Motion, moves_of_result
from blockmech.dynamics.chart_outputs import result_along
from blockmech.dynamics.motion_outputs import SimulationResult
from blockmech.dynamics.simulation import simulate
from blockmech.ground.errors import BlockmechError
from blockmech.result.result import Result
from blockmech.result.samples import DEFAULT_SAMPLES
from blockmech.result.wires import on_wires, wires_of
from blockmech.studio.analyses import Analyses, Asked, answered
from blockmech.studio.candidates import Candidates
from blockmech.studio.curves import WIDE, Plots, panels_of
from blockmech.studio.looks import LINES, Plain, button, row
from blockmech.studio.session import heard, together
from blockmech.studio.sheet import Sheet
from blockmech.studio.work import OnProgress, Work
from blockmech.typing import FrictionName

FINDS = {"search_strategy": "includes", "case_sensitive": False, "min_characters": 1}
ACCURACIES = ("1e-3", "1e-6", "1e-9", "1e-12")
TOOLS = "pan,xwheel_zoom,box_zoom,reset,save"
FORWARD = {"p": "m", "v": "m/s", "a": "m/s²", "om": "rad/s", "al": "rad/s²"}
BACK = {"F": "N", "M": "N m", "power": "W"}


def wire_text(result: Result, pose: int, name: str) -> str:
    """What travels on a wire at a sample of a run, in a few lines.

    Forward place and motion of the marker and its link; back force and moment on that link,
    the power, and the shares of the joint's block in reduced inertia and effort.

    Raises `RequestError` where there is no such wire.
    """
    one, structure = result.isel(pose), result.mechanism.structure
    (values,) = on_wires(structure, one._inside, one.n, name).values()
    rotary = [structure.joint(ref).rotary for ref in structure.driven.values()]
    shares = {"J_red": "kg m²" if rotary[0] else "kg", "tau_red": "N m" if rotary[0] else "N"}
    lines = [("→", FORWARD), ("←", BACK)] + [("reduced", shares)] * ("J_red" in values)
    return "\n".join(
        f"{way} " + "; ".join(_told(key, values[key], unit) for key, unit in units.items())
        for way, units in lines
    )


def _told(key: str, values: Any, unit: str) -> str:
    """A quantity at one sample, with its unit."""
    value = np.atleast_1d(values)[0]
    if not np.isfinite(value):
        return f"{key} none"
    if np.iscomplexobj(value):
        return f"{key} = ({value.real:.6g}, {value.imag:.6g}) {unit}"
    return f"{key} = {value + 0.0:.6g} {unit}"


def answer(
    motion: Motion, names: Iterable[str], friction: FrictionName, accuracy: float | None = None
) -> Result:
    """Outputs at the samples of a motion; gaps are marked.

    With an ``accuracy`` the method is chosen by it. Raises `RequestError` for what cannot be.
    """
    result = motion.result
    if accuracy is None or result.motion is not None:
        return result.with_friction(friction, *names)
    chosen: Result = answered(result.mechanism, result.samples, names, friction, accuracy)
    return chosen


def _summary(result: Result, seconds: float) -> str:
    """What was computed, how, and what it took."""
    how = f"{result.n} samples, {result.plan.calls} kernel calls a sample, {seconds * 1e3:.1f} ms"
    chosen = f"; {result.accuracy}" if result.accuracy is not None else ""
    gaps = len(result.quality.gaps)
    holes = f"; {gaps} samples without an answer" if gaps else ""
    error = "" if result.motion is None else f"; {result.motion.summary()[0]}"
    return "; ".join([how + chosen + holes + error, *result.notes()])


class Find(pn.widgets.AutocompleteInput):  # type: ignore[misc]  # as the sheet
    """A field that finds a name, and offers a few at once: a long chain has five thousand."""

    max_completions = param.Integer(default=24)


class Answers:
    """Curves, wires, simulation and costs of what a view, a `MechanismView`, shows."""

    def __init__(self, sheet: Sheet, view: Any) -> None:
        self.sheet, self.view = sheet, view
        self.result: Result | None = None
        self.names = pn.widgets.CheckBoxGroup(sizing_mode="stretch_width")
        self.find = Find(label="Add an output", placeholder="part of its name", width=190, **FINDS)
        self.find.param.watch(lambda event: self._add(event.new), "value")
        known = list(get_args(FrictionName))
        wanted = {"default": 0.0, **{x: float(x) for x in ACCURACIES}}
        self.friction = pn.widgets.Select(label="Friction", options=known, value="newton", width=92)
        self.accuracy = pn.widgets.Select(label="Accuracy", options=wanted, width=100)
        self.until = pn.widgets.TextInput(label="Simulate until", value="time=2", width=100)
        self.said = Plain("", sizing_mode="stretch_width", min_width=160, stylesheets=[LINES])
        self.values = Div(text="", sizing_mode="stretch_width")
        self.plots = Plots(view.dark, view.seek, tools=TOOLS)
        self.work = Work(lambda message: self.said.param.update(object=message))
        self.analyses = Analyses(self._asked, lambda: self.view.along, self.work)
        for widget in (self.names, self.friction, self.accuracy):
            widget.param.watch(lambda _: self.renew(), "value")
        view.param.watch(lambda _: self._begin(), "motion")
        view.param.watch(heard(self.renew), "shown")
        view.param.watch(lambda _: self._show_pose(), "pose")
        self._begin()

    def tabs(self) -> dict[str, Callable[[], Any]]:
        """What is asked and what is answered, by tab; each is made when it is first shown."""

        def curves() -> Any:
            choices = (self.find, self.names, row(self.friction, self.accuracy), self.values)
            return pn.Row(pn.Column(*choices, width=206), self.plots.pane, **WIDE)

        acts = button("Simulate", self.simulate), button("Turn", self.view.turn)

        return {
            "Curves": curves,
            "Motion": lambda: row(self.until, *acts),
            "Margins": self.view.margins,
            "Analyses": self.analyses.panel,
            "Synthesis": Candidates(self.sheet, self.work).panel,
        }

    # -- curves ----------------------------------------------------------------------------

    def _begin(self) -> None:
        """Offer the outputs of what the view shows now; those that were chosen stay."""
        motion = self.view.motion
        self.work.cancel()
        offered = [] if motion is None else list(motion.mechanism.outputs)
        chosen = [name for name in self.names.value if name in offered]
        if not chosen and motion is not None:
            drives = (motion.mechanism._of_driver(d, "drive") for d in motion.mechanism.drivers)
            chosen = [name for name in drives if name in offered]
        self.analyses.renew()
        same = chosen == self.names.value
        self.find.options = offered
        self.names.param.update(options=chosen, value=chosen)
        if same:
            self.renew()

    def _add(self, name: str) -> None:
        """Show one more output; what is not ticked goes."""
        if name in self.find.options:
            chosen = list(dict.fromkeys((*self.names.value, name)))
            self.names.param.update(options=chosen, value=chosen)
            self.find.value = ""

    @together
    def renew(self) -> None:
        """Compute and draw what is chosen; what cannot be is said."""
        self.result, panels, message = None, [], ""
        motion, names = self.view.motion, self.names.value
        if motion is not None and names:
            begun = time.perf_counter()
            try:
                result = answer(motion, names, self.friction.value, self.accuracy.value or None)
                panels = panels_of(result, names)
            except BlockmechError as error:
                message = str(error)
            else:
                message = _summary(result, time.perf_counter() - begun)
                self.result = result
        self.plots.show(panels, self.view.along, self.view.spans)
        self.said.object = message
        self._show_pose()

    @together
    def _show_pose(self) -> None:
        """Put the cursors and the values to the shown pose."""
        k, result, lines = self.view.pose, self.result, []
        if result is not None:
            self.plots.point(self.view.along.values[k])
            outputs = [(name, result.output(name)) for name in result]
            shown = [(name, x.unit) for name, x in outputs if x.kind in ("real", "vector")]
            lines = [_told(name, result[name][k], unit) for name, unit in shown]
        self.values.text = "<br>".join(map(html.escape, lines))

    def _asked(self) -> Asked | None:
        """What the analyses are of: the chosen outputs at the samples that are shown."""
        motion, names = self.view.motion, self.names.value
        if motion is None or not names:
            return None
        result = motion.result
        return Asked(result.mechanism, result.samples, motion.q, tuple(names), self.friction.value)

    def wires(self, name: str) -> str:
        """What travels on a wire in the shown pose, for the diagram; "" where nothing is known."""
        motion = self.view.motion
        if motion is None or name not in wires_of(motion.structure):
            return ""
        try:
            result = motion.result.with_friction(self.friction.value)
            return wire_text(result, self.view.pose, name)
        except BlockmechError as error:
            return str(error)

    # -- long work -------------------------------------------------------------------------

    def simulate(self) -> None:
        """Move the mechanism under its loads, and play that in time.

        A driver for which the document has no start is released from the shown pose.
        """
        mechanism, until, friction = self.sheet.mechanism, self.until.value, self.friction.value
        shown = {} if self.view.motion is None else self.view.coordinates
        free = () if mechanism is None else {*mechanism.drivers} - {*mechanism.scene.initial}
        start = {driver: (q, 0.0) for driver, q in shown.items() if driver in free}

        def task(report: OnProgress) -> SimulationResult:
            simulated = simulate(
                mechanism, until, start=start, want=(), friction=friction, progress=report
            )
            times = simulated.motion.times(DEFAULT_SAMPLES)
            return result_along(mechanism, simulated.motion, times, (), friction=friction)

        def done(result: SimulationResult) -> None:
            self.view.play(moves_of_result(result))
            self.view.pose = 0
            self.said.object = " ".join(result.motion.summary())

        if mechanism is not None:
            self.work.begin(task, done)
