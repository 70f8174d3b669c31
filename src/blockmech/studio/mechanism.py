"""The moving mechanism: a figure of the pose, sliders for the drivers, joints to be dragged.

A whole turn is computed when the sheet changes; a pose is a row of it. Looks come from
`blockmech.draw`, columns from `blockmech.studio.film`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import panel as pn
import param

from blockmech.draw.mechanism import caption
from blockmech.draw.motion import Motion
from blockmech.draw.simulation import screen_time
from blockmech.figures.curves import abscissa
from blockmech.figures.panels import Abscissa
from blockmech.ground.errors import BlockmechError, refused
from blockmech.studio.curves import Plots, margins_of
from blockmech.studio.dragging import dragged
from blockmech.studio.fields import Shown
from blockmech.studio.figure import MechanismFigure
from blockmech.studio.film import SHOWN
from blockmech.studio.looks import row
from blockmech.studio.session import follow, heard, together
from blockmech.studio.sheet import Sheet
from blockmech.studio.turn import dead_centres, gaps_of, shown_motion, travel


class MechanismView(param.Parameterized):  # type: ignore[misc]  # as the sheet
    """A sheet's mechanism in motion.

    Attributes (watch them)
    ----------
    motion : the poses of all samples, of a turn or of a simulation; None where nothing moves
    pose : the shown one of the samples
    show : what is drawn beside links and loads, some of `SHOWN`
    shown : units of lengths and angles
    gaps : the runs of samples without an answer
    said : what went wrong as a sentence, "" where nothing did
    """

    motion = param.Parameter()
    pose = param.Integer(default=0)
    show = param.ListSelector(default=["paths", "names"], objects=list(SHOWN))
    gaps = param.List(default=[])
    shown = param.Parameter(default=Shown())
    said = param.String(default="")

    def __init__(self, sheet: Sheet, dark: bool = False, seconds: float = 3.0) -> None:
        super().__init__()
        self.sheet, self.dark, self.seconds = sheet, dark, seconds
        self.along = Abscissa("sample", np.zeros(1))
        self._by_hand: tuple[str, dict[str, float]] = ("", {})
        self._margins: Plots | None = None
        self.figure = MechanismFigure(dark, self.meant)
        follow(sheet, self.renew, "form", "mechanism")
        self.param.watch(lambda *_: self._draw(), ["show"])
        self.param.watch(heard(self._show_units), ["shown"])
        self.param.watch(lambda *_: self._show_pose(), ["pose"])
        self.renew()

    # -- what is shown ---------------------------------------------------------------------

    def turn(self) -> None:
        """Show the turn over the laws of the drivers, whatever was moved by hand."""
        self._by_hand = "", {}
        self.renew()

    def renew(self) -> None:
        """Show the turn of the sheet's mechanism, or of the part of it that moves."""
        sheet = self.sheet
        try:
            motion = shown_motion(
                sheet.form, sheet.mechanism, sheet.problems, *self._by_hand, sheet.document.file
            )
            self.play(*motion)
        except BlockmechError as error:
            self.play(None, str(error))
        if sheet.empty:
            self.play(None)

    @property
    def degrees(self) -> bool:
        """Whether angles are shown in degrees."""
        return bool(self.shown.angle == "deg")

    def _show_units(self) -> None:
        """Write places and angles in the chosen units."""
        self.figure.units = self.shown
        self.play(self.motion, self.said)

    @together
    def play(self, motion: Motion | None, said: str = "") -> None:
        """Show a motion, e.g. that of a simulation, until the sheet changes."""
        last, gaps, pose = 0, [], self.pose
        if motion is not None:
            last, gaps = len(motion.samples) - 1, gaps_of(motion)
            along = abscissa(motion.result, degrees=self.degrees)
            samples = np.arange(last + 1)
            dead = dead_centres(motion)
            events = [(float(np.interp(k, samples, along.values)), name) for k, name in dead]
            self.along = replace(along, events=tuple(events))
            if self.motion is None and pose in dict(dead):
                pose = motion.clearest  # nothing can be released at a dead centre
        self.param.update(gaps=gaps, said=said, pose=min(pose, last))
        self.motion = motion
        self._show_margins()
        self._draw()

    @together
    def _draw(self) -> None:
        """Compute what is drawn in all poses."""
        whole = self.sheet.mechanism and self.sheet.mechanism.structure
        self.figure.seconds = 1.0 if self.motion is None else self.playing
        self.figure.draw(self.motion, self.show, whole)
        self.figure.picture.drivers = self.drivers()
        self._show_pose()

    def margins(self) -> Any:
        """How far every group is from its dead centres, along the poses; made when it is shown."""
        look = {"toolbar_location": None, "tooltips": "@name"}
        self._margins = self._margins or Plots(self.dark, self.seek, **look)
        self._show_margins()
        return self._margins.pane

    def _show_margins(self) -> None:
        if self._margins is not None:
            known = self.motion is not None and self.motion.quality.margin
            panels = [margins_of(self.motion)] if known else []
            self._margins.show(panels, self.along, self.spans)

    def drivers(self) -> list[dict[str, Any]]:
        """A slider for each of several drivers, as the browser shows it."""
        motion, sliders = self.motion, []
        for driver in motion.mechanism.drivers if motion is not None and len(motion.q) > 1 else ():
            low, high = travel(motion.mechanism, driver, self.coordinates)
            si = motion.mechanism.structure.driver_joint(driver).coordinate_unit
            factor = self.shown.factor(si)
            slider = {"name": driver, "start": factor * low, "end": factor * high}
            slider["label"] = f"{motion.mechanism._of_driver(driver, 'q')} [{self.shown.unit(si)}]"
            values = (factor * motion.q[driver]).tolist()
            sliders.append({**slider, "values": values, "disabled": not low < high})
        return sliders

    # -- poses -----------------------------------------------------------------------------

    @property
    def coordinates(self) -> dict[str, float]:
        """Where the drivers are in the shown pose [rad or m]."""
        return {driver: float(q[self.pose]) for driver, q in self.motion.q.items()}

    @property
    def spans(self) -> list[tuple[int, int]]:
        """First and last sample of each gap."""
        return [(gap.first, gap.last) for gap in self.gaps]

    def seek(self, x: float) -> None:
        """Show the pose that is nearest to a place on the axis of the curves."""
        if self.motion is not None:
            self.pose = int(np.argmin(np.abs(self.along.values - x)))

    def drive(self, driver: str, q: float) -> None:
        """Move one driver to a coordinate [rad or m] from the shown pose, the others held."""
        if [name for name, row in self.motion.q.items() if np.ptp(row)] != [driver]:
            self._by_hand = driver, self.coordinates
            self.renew()
        self.pose = int(np.argmin(np.abs(self.motion.q[driver] - q)))

    @property
    def playing(self) -> float:
        """How long the motion is played: one under loads in its own time, or a round multiple."""
        simulated = self.motion.result.motion is not None
        return screen_time(float(np.ptp(self.motion.time))) if simulated else self.seconds

    # -- the page --------------------------------------------------------------------------

    def panel(self) -> Any:
        """The figure with its sliders, play button and choice of what is shown."""
        choice = pn.widgets.CheckButtonGroup.from_param(self.param.show, label="Show")
        return pn.Column(row(choice), self.figure.picture, sizing_mode="stretch_both")

    @together
    def _show_pose(self) -> None:
        """Put everything where it is in the shown pose."""
        self.figure.picture.param.update(said=self.caption(), pose=self.pose)
        if self._margins is not None:
            self._margins.point(self.along.values[self.pose])

    def caption(self) -> list[tuple[str, bool]]:
        """Where the drivers are, the dead centre nearest to the pose, and why there is a gap.

        Each with whether it is something wrong.
        """
        sentences, parts = [words for words in (self.said, self.figure.said) if words], []
        motion, k = self.motion, self.pose
        if motion is not None:
            parts = [caption(motion, [k], self.degrees)]
            if motion.result.motion is not None:
                parts.insert(0, f"t = {motion.time[k]:.3f} s")
            if self.along.events:
                x = self.along.values[k]
                at, name = min(self.along.events, key=lambda event: abs(event[0] - x))
                where, _, unit = self.along.words.partition(" [")
                parts.append(f"nearest dead centre: {name} at {where} = {at:.4g} {unit[:-1]}")
            sentences += [
                gap.why for gap in self.gaps if gap.first <= k <= gap.last and not sentences
            ]
        return [("; ".join(parts), False), *((words, True) for words in sentences)]

    @together
    def meant(self, msg: dict[str, Any]) -> None:
        """Do what was done to the picture."""
        if msg["act"] == "scale":
            self.figure.scaled(msg["scale"])
        elif self.motion is None:
            return
        elif msg["act"] == "pose":
            if msg["seen"] == self.pose:  # else another one was shown after the act
                self.pose = min(max(msg["pose"], 0), len(self.motion.samples) - 1)
        elif msg["act"] == "drive":
            joint = self.motion.mechanism.structure.driver_joint(msg["driver"])
            q = msg["value"] / self.shown.factor(joint.coordinate_unit)
            self.drive(msg["driver"], q)
        elif msg["act"] == "drag" and msg["name"] in self.figure.handles:
            self.drag(msg["name"], complex(*msg["to"]))

    @together
    def drag(self, name: str, new: complex) -> None:
        """Put a joint to another place [m] in the shown pose; lengths follow, as one step."""
        spot, unit = self.figure.handles[name], self.figure.unit
        old = complex(self.motion.at(*spot)[self.pose])
        digits = -int(np.floor(np.log10(unit)))  # a point of the page is the finest step
        new = complex(round(new.real, digits), round(new.imag, digits))
        form = dragged(self.sheet.form, self.motion, self.pose, old, new)
        try:
            if form == self.sheet.form:
                found = "no length and no marker of a block puts it there, so it cannot be dragged"
                raise refused(name, found, "change its block's form", code="not-dragged")
            self.sheet.change(form, f"move {name}")
        except BlockmechError as error:
            self.play(self.motion, str(error))
        else:
            heard(lambda: self._find(name, new))()

    def _find(self, name: str, place: complex) -> None:
        """Show a pose in which a joint is at a place, where a crank was turned by the drag."""
        if name in self.figure.handles:
            apart = np.abs(self.motion.at(*self.figure.handles[name]) - place)
            if apart[self.pose] > self.figure.unit:
                self.pose = int(np.nanargmin(apart))
