"""Equilibria of one driver beyond its dead centres, where other joints lead.

Every end of an arc at a dead centre of the driver is left for the arc of the joint that moves most
there, until no end leads anywhere new.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from blockmech.analysis.equilibria_one import Line, Piece, equilibria_of_one
from blockmech.analysis.equilibrium import Equilibria, Equilibrium
from blockmech.dynamics.charts import Chart, home_chart
from blockmech.dynamics.request import Pairs
from blockmech.dynamics.system import System
from blockmech.ground.errors import BlockmechError
from blockmech.ground.tolerances import HALVINGS
from blockmech.model.structure import COORDINATE
from blockmech.typing import Floats

MOST = 32  # arcs that are looked at


@dataclass(frozen=True)
class _Leading:
    """A chart, and the effort along its arcs."""

    chart: Chart
    line: Line

    def left_at(self, piece: Piece) -> Iterator[_Leading]:
        """Where others lead on beyond the ends of an arc."""
        for side, end in ((-1, piece.low), (1, piece.high)):
            stop = self.line.system.stops[0][side > 0]
            if not piece.closed and end != stop and (on := self._beyond(piece, end)) is not None:
                yield on

    def _beyond(self, piece: Piece, end: float) -> _Leading | None:
        """The joint that leads best near an end of an arc, where one leads better."""
        chart, middle = self.chart, (piece.low + piece.high) / 2
        for j in range(HALVINGS):
            q = np.array([end + (middle - end) * 0.5**j])
            T = chart.tangent(q)
            if (
                not chart.better(T)
                or (on := chart.successor(q, (), partial(_at_rest, chart, q))) is None
            ):
                continue
            successor, starts = on
            stops = successor.mechanism.scene.stops.get(successor.mechanism.drivers[0])
            bounds = (-math.inf, math.inf) if stops is None else stops.bounds
            system = System(successor.mechanism, stops=(bounds,), method=None)  # no intervals
            return _Leading(
                successor,
                Line(successor.mechanism, system, self.line.t, next(iter(starts.values()))[0]),
            )
        return None


def _at_rest(chart: Chart, q: Floats, joints: Sequence[str]) -> Pairs:
    """Joint -> coordinate and rate."""
    states = chart.states(q, 0 * q)
    return {joint: states[joint] for joint in joints}


def equilibria_through_charts(line: Line) -> Equilibria:
    """All equilibria of the only driver, those beyond its dead centres among them."""
    answer, pieces = equilibria_of_one(line), list(line.arcs())
    if not pieces or all(piece.closed for piece in pieces):
        return answer
    try:
        home = home_chart(line.mechanism, np.array([(pieces[0].low + pieces[0].high) / 2]))
    except BlockmechError:  # links and joints do not say these blocks
        return answer
    if home.home.couplings:
        return answer
    poses = [home.poses(e.q) for e in answer]
    equilibria, queue, visited = list(answer.found), [(_Leading(home, line), pieces)], set[object]()
    while queue and len(visited) < MOST:
        at, pieces = queue.pop()
        for on in (on for piece in pieces for on in at.left_at(piece)):
            next_pieces = list(on.line.arcs())
            arcs = tuple(round(x, 6) for piece in next_pieces for x in piece[:2])
            key = on.chart.joints if on.chart.is_general else id(on.chart), arcs
            if not next_pieces or key in visited:
                continue
            visited.add(key)
            queue.append((on, next_pieces))
            for e in equilibria_of_one(on.line):
                pose = on.chart.poses(e.q)
                if not e.stop and not any(home.alike(pose, earlier) for earlier in poses):
                    poses.append(pose)
                    equilibria += _said(e, on.chart, home, line)
    return replace(answer, found=tuple(sorted(equilibria, key=lambda e: e.q[0])))


def _said(e: Equilibrium, chart: Chart, home: Chart, line: Line) -> Iterator[Equilibrium]:
    """An equilibrium of a chart in the user's words, if it is between the stops of the driver."""
    (driver,) = home.mechanism.drivers
    (joint,) = home.users
    coordinate = float(chart.pairs([joint]).state(e.q, 0 * e.q)[0][0])
    low, high = line.system.stops[0]
    if line.system.rotary[0] and math.isfinite(low):
        coordinate = low + (coordinate - low) % math.tau
    if low <= coordinate <= high:
        name = home.mechanism._of_driver(driver, "q")
        leads = {
            f"{home.in_outputs(joint=joint)}.{COORDINATE}": float(e.q[0])
            for joint in chart.joints
            if joint not in home.joints
        }
        unit = home.mechanism.structure.driver_joint(driver).coordinate_unit
        units = {name: unit, **dict.fromkeys(leads, next(iter(e.units.values())))}
        described = replace(e, at={name: coordinate}, units=units, leads=leads, chart=chart)
        yield replace(described, potential=None, interval=None)
