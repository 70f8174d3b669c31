"""What is told about the modes of a mechanism: by group, by sample, with their arcs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass
from typing import Any

from blockmech.errors import Problem, RequestError, close_match, listed

TURN = 2 * math.pi
DEAD, RANGE, WHOLE, LOST, EARLIER = "dead centre", "range", "turn", "lost", "earlier group"


@dataclass(frozen=True)
class ArcEnd:
    """An end of an arc.

    Attributes
    ----------
    q : driver coordinate [rad or m]
    how : "dead centre"; "range" where the range that was asked for ends; "turn" where a
        whole turn begins and ends; "earlier group" where one that holds it closes no
        further; "lost" where the group could not be followed further
    other : at a dead centre, the number of the arc that merges with this one
    """

    q: float
    how: str
    other: int | None = None


@dataclass(frozen=True)
class Arc:
    """A stretch of the driver over which one mode of a group exists.

    Attributes
    ----------
    start, end : its ends, start.q <= end.q; of a whole turn, ``turns`` turns apart
    branch : of a dyad with two modes, else None
    sign : of the determinant along it; 0 where a change point leaves it open
    turns : after how many turns it closes; 0 if it has ends
    change_points : [rad or m] dead centres that it passes
    circuit : number of the circuit; arcs of one connect through dead centres
    """

    start: ArcEnd
    end: ArcEnd
    branch: int | None
    sign: int
    turns: int
    change_points: tuple[float, ...]
    circuit: int


