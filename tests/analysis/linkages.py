"""Linkages with closed forms, for the tests of limits and extremes."""

from __future__ import annotations

import math

import mpmath

import blockmech as bm
from blockmech import Graph
from tests import machines
from tests.machines import wire
from tests.wiring import EPS


def short_fourbar(name: str = "short", crank: str = "crank", bar: bm.Link | None = None) -> Graph:
    """A four-bar at 1 rad/s whose dyad, two links of 2.5 m, closes for cos q >= 9.25 / 22 only.

    With B = 2 (cos q, sin q) and D = (5.5, 0), |BD|^2 = 34.25 - 22 cos q <= 25.
    """
    g = Graph(name, drive={crank: bm.motion.ConstantRate(rate=1.0)})
    g.add("frame", bm.Frame(markers={"A": (0.0, 0.0), "D": (5.5, 0.0)}))
    g.add(crank, bm.Crank(length=2.0))
    links = {"i": bar, "j": bar} if bar else {}
    g.add("dyad", bm.RRR(l_i=2.5, l_j=2.5, links=links))
    return wire(g, f"frame.A {crank}.A", f"{crank}.B dyad.B", "frame.D dyad.D")


def slider_crank(crank: float, rod: float, offset: float = 0.0, law: object = None) -> Graph:
    """Guide parallel to x at y = offset; the slider's pin is ``dyad.C``."""
    g = machines.slider_crank(crank, rod, offset)
    if law is not None:
        g.drive("crank", law)  # type: ignore[arg-type]
    return g


def slotted_lever(crank: float, frame: float, h: float = 0.0) -> Graph:
    """A crank's pin in a guide of a lever that turns about D at [frame, 0]."""
    g = Graph("slotted_lever")
    g.add("frame", bm.Frame(markers={"A": (0.0, 0.0), "D": (frame, 0.0)}))
    g.add("crank", bm.Crank(length=crank))
    g.add("dyad", bm.RPR(h_j=h))
    return wire(g, "frame.A crank.A", "crank.B dyad.B", "frame.D dyad.D")


def turning_guide(turn: float = 0.0) -> Graph:
    """PRP between a guide on the crank and one on the frame, turned by ``turn`` [rad]."""
    g = Graph("turning_guide")
    fixed = bm.Marker(at=(0.0, 1.0), angle=turn)
    g.add("frame", bm.Frame(markers={"A": (0.0, 0.0), "G": fixed}))
    body = bm.Link(markers={"U": bm.Marker(at=(0.0, 0.0), angle=0.0)})
    g.add("crank", bm.Crank(links={"crank": body}))
    g.add("dyad", bm.PRP())
    return wire(g, "frame.A crank.A", "crank.U dyad.S1", "frame.G dyad.S2")


def fivebar(bar: bm.Link | None = None, apart: float = 4.0, rod: float = 3.0) -> Graph:
    """Two cranks of 1 m some way apart, and two rods; each link a bar with these masses."""
    return machines.fivebar(1.0, rod, apart, [bar] * 4)


def fourbar_limits(crank: float, coupler: float, rocker: float, frame: float) -> list[float]:
    """Crank angles in (0, pi) at which the dyad is folded or extended, by the cosine law.

    cos q = (a^2 + d^2 - R^2) / (2 a d), R = |b -+ c|, in 40 digits.
    """
    with mpmath.workdps(40):
        a, b, c, d = map(mpmath.mpf, (crank, coupler, rocker, frame))
        cosines = [(a * a + d * d - R * R) / (2 * a * d) for R in (b - c, b + c)]
        return [float(mpmath.acos(x)) for x in cosines if abs(x) < 1]


def end_error(crank: float, frame: float, q: float) -> float:
    """Error [rad] of an arc's end that one relative rounding of |BD| forces.

    |BD|^2 = a^2 + d^2 - 2 a d cos q, so dq = (d|BD| / |BD|) |BD|^2 / (a d |sin q|); the
    angle itself is rounded as well.
    """
    a, d = crank, frame
    square = a * a + d * d - 2 * a * d * math.cos(q)
    return EPS * (square / (a * d * abs(math.sin(q))) + abs(q))
