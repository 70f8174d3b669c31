"""Driver coordinates of a joint-based document, and of the graph made of it.

The two differ where the document names the links of a driven joint in the other order than
the graph (sign -1), or counts from another place (offset). What a user says and reads is
of the document; the graph computes in its own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

from blockmech.model.laws_of_motion import (
    ConstantRate,
    Cycloidal,
    Harmonic,
    LawOfMotion,
    RateAcceleration,
    Table,
)
from blockmech.model.naming import DriverName, Names
from blockmech.model.scene import Initial, Scene, Stops
from blockmech.model.structure import Structure

Law = TypeVar("Law", bound=LawOfMotion)


def drivers_in_order(structure: Structure, names: Names) -> dict[str, DriverName]:
    """The document's drivers in the formation order of the graph."""
    named = {where.driver: name for name, where in names.drivers.items()}
    return {named[d]: names.drivers[named[d]] for d in structure.drivers}


def same(name: DriverName) -> bool:
    """Whether document and graph count the coordinate alike."""
    return name.sign == 1 and name.offset == 0


def to_document(name: DriverName, q: Any) -> Any:
    """Coordinate [rad or m] of the document, a number or an array, from that of the graph."""
    return q if same(name) else name.sign * q + name.offset


def to_graph(name: DriverName, q: Any) -> Any:
    """Coordinate [rad or m] of the graph, a number or an array, from that of the document."""
    return q if same(name) else name.sign * (q - name.offset)


def signed(name: DriverName, rate: Any) -> Any:
    """A rate, acceleration or effort of the one from that of the other, either way."""
    return rate if name.sign == 1 else -rate


def law_to_graph(name: DriverName, law: Law) -> Law:
    """The law of motion of the graph's driver from that of the document's."""
    return law_turned(law, name.sign, -name.sign * name.offset)


def law_to_document(name: DriverName, law: Law) -> Law:
    """The law of motion of the document's driver from that of the graph's."""
    return law_turned(law, name.sign, name.offset)


def law_turned(law: Law, sign: int, offset: float) -> Law:
    """The law of ``sign * q + offset`` where ``law`` is that of q."""

    def place(q: float) -> float:
        return sign * q + offset

    if sign == 1 and offset == 0:
        return law
    more: dict[str, Any] = {}
    match law:
        case ConstantRate():
            more = {"rate": sign * law.rate, **_ends(law, place)}
        case RateAcceleration():
            more = {"rate": sign * law.rate, "acceleration": sign * law.acceleration}
            more |= _ends(law, place)
        case Harmonic():
            more = {"mean": place(law.mean), "amplitude": sign * law.amplitude}
        case Cycloidal():
            more = _ends(law, place)
        case Table():
            more = {"values": [place(q) for q in law.values]}
    return law.model_copy(update=more)


def _ends(law: Any, place: Any) -> dict[str, float]:
    return {"start": place(law.start), "end": place(law.end)}


class SceneOfLinks(Scene):
    """The scene of a joint-based document, which says laws of motion with the drivers."""

    def address(self, section: str, driver: str = "") -> str:
        """Where the file says something of a driver: ``"drivers.motor"``."""
        return f"{'drivers' if section == 'drive' else section}.{driver}".rstrip(".")


def scene_of_document(scene: Scene, names: Names) -> Scene:
    """The scene of a graph with the document's drivers: their names and their coordinates."""
    known = names.drivers.items()
    drive = {
        name: law_to_document(d, scene.drive[d.driver])
        for name, d in known
        if d.driver in scene.drive
    }
    initial = {
        name: Initial(
            q=to_document(d, scene.initial[d.driver].q),
            rate=signed(d, scene.initial[d.driver].rate),
        )
        for name, d in known
        if d.driver in scene.initial
    }
    stops = {
        name: _stops_turned(scene.stops[d.driver], d)
        for name, d in known
        if d.driver in scene.stops
    }
    return SceneOfLinks(gravity=scene.gravity, drive=drive, initial=initial, stops=stops)


def _stops_turned(stops: Stops, name: DriverName) -> Stops:
    ends = (None if q is None else to_document(name, q) for q in (stops.low, stops.high))
    low, high = ends if name.sign > 0 else tuple(ends)[::-1]
    return Stops(**{"from": low, "to": high})


class GraphInputs(Mapping[str, Any]):
    """Inputs of a program (``q_0``, ``qd_0``, ...), turned from a document's when asked for."""

    def __init__(self, given: Mapping[str, Any], drivers: Sequence[DriverName]) -> None:
        self._given = given
        self._drivers = drivers

    def __getitem__(self, name: str) -> Any:
        values = self._given[name]
        quantity, _, number = name.partition("_")
        if not number:
            return values
        driver = self._drivers[int(number)]
        if same(driver):
            return values
        if isinstance(values, list):
            turn = to_graph if quantity == "q" else signed
            return [turn(driver, x) for x in values]
        return to_graph(driver, values) if quantity == "q" else signed(driver, values)

    def __iter__(self) -> Any:
        return iter(self._given)

    def __len__(self) -> int:
        return len(self._given)
