"""The numbered rules of a friction law, tested in the pairs of a slider-crank.

The rules stand at the head of `blockmech.friction.laws.contract`.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from pydantic_core import PydanticCustomError

from blockmech.analysis.force_checks import bound_kernel
from blockmech.blocks.crank import Crank
from blockmech.blocks.frame import Frame
from blockmech.blocks.rrp import RRP
from blockmech.friction.laws import FrictionLaw
from blockmech.ground.tolerances import EQUAL
from blockmech.ground.values import Link, Marker, Place, Vector
from blockmech.mechanism import Mechanism
from blockmech.model.graph import Graph
from blockmech.model.laws_of_motion import Harmonic
from blockmech.testing.rules import TIMES, Checks
from blockmech.typing import Array

SPEEDS = np.array([0.0, *np.logspace(-6, 3, 37)])  # [rad/s or m/s]


class LawRules(Checks):
    """Rules 1 to 4, 6 and 8 of a friction law, and that motions obey it as runs do."""

    def __init__(self, law: FrictionLaw) -> None:
        super().__init__()
        self.law = law
        self.kinds = tuple(kind for kind in ("R", "P") if _is_for(law, kind))
        self.rigs = {kind: _rig(law, kind) for kind in self.kinds}

    def _at(self, speeds: Array) -> tuple[Array, Array]:
        """Factors and drags at speeds."""
        terms = self.law.sliding(bound_kernel)(speeds)
        factor, drag = (np.broadcast_to(np.asarray(x, float), speeds.shape) for x in terms)
        return factor, drag

    def kernel(self) -> Iterator[str]:
        """Engines agree, and a sample does not depend on its neighbours; NaN in, NaN out."""
        for kind, rig in self.rigs.items():
            outputs = (f"rod.{joint}.friction" for joint in PAIRS[kind])
            yield from self.engines(rig.run, outputs, f" in {kind}")
        if (self.law.reads_speed or self.law.remembers) and not np.isnan(
            self._at(np.array([np.nan]))
        ).any():
            yield "it says a number for a speed that is NaN"

    def resists(self) -> Iterator[str]:
        """Friction does not drive: neither part is negative, at any speed or at rest."""
        at_rest = np.array(self.law.at_rest(), float)
        for part, values in zip(("factor", "drag"), self._at(SPEEDS), strict=True):
            if not (np.isfinite(values) & (values >= 0.0)).all():
                wrong = SPEEDS[~(np.isfinite(values) & (values >= 0.0))][0]
                yield f"{part} is negative or no number at a speed of {wrong:.3g}"
        if not (np.isfinite(at_rest) & (at_rest >= 0.0)).all():
            yield "what holds it at rest is negative or no number"

    def at_rest(self) -> Iterator[str]:
        """At rest a pair holds no less than what it resists with as it begins to slip."""
        capacity = np.array(self.law.at_rest(), float)
        begins, usual = np.transpose(self._at(np.array([1e-12, 1.0])))
        if (begins > capacity * (1 + 1e-6) + 1e-9 * usual).any():
            yield "it slips with more friction than what holds it"

    def drags(self) -> Iterator[str]:
        """Without ``drags`` there is no friction but by the load."""
        _, drag = self._at(SPEEDS)
        if not self.law.drags and (drag.any() or self.law.at_rest().drag):
            yield "its drag is left out, but it is not 0.0: set drags = True"

    def balances(self) -> Iterator[str]:
        """Links balance, power balances, and friction is what the law says."""
        for kind, rig in self.rigs.items():
            yield from self.verified(rig.verify(times=TIMES), f" in {kind}")

    def state(self) -> Iterator[str]:
        """A state of its own stands still at rest, and at the steady state of each rate."""
        if not self.law.remembers:
            return
        law, p = self.law, self.law.parameters()
        rate, steady = (bound_kernel(k) for k in (law.rate_kernel(), law.steady_kernel()))
        slips = np.concatenate([-SPEEDS[1:], SPEEDS[1:]])
        z = steady(slips, p)
        yield from self.same("rate in steady slip", rate(slips, z, p) / slips, 0.0 * slips, 1.0)
        if np.any(rate(0.0 * slips, z, p)):
            yield "the state of a pair at rest changes"
        if (z * slips <= 0).any():
            yield "the steady state is not in the sense of the slip"

    def motion(self) -> Iterator[str]:
        """A motion obeys the law as a run does: with its accelerations no drive is left over."""
        for kind, rig in self.rigs.items():
            want = ("crank.drive", "crank.drive_by_reduction")
            for rate in (1.3, 9.0):
                moved = rig.simulate(
                    "time=0.05", start={"crank": (0.7, rate)}, times=[0.0, 0.02], want=want
                )
                without = float(np.max(abs(moved["crank.drive_by_reduction"])))
                drive = moved["crank.drive"]
                name = f"drive of the motion in {kind}"
                yield from self.same(name, drive, 0.0 * drive, without or 1.0, EQUAL)

    rules = (kernel, resists, at_rest, drags, state, balances, motion)


PAIRS = {"R": ("B", "C"), "P": ("S",)}


def _is_for(law: FrictionLaw, kind: str) -> bool:
    try:
        law.check_for(kind, "joint")
    except PydanticCustomError:
        return False
    return True


def _rig(law: FrictionLaw, kind: str) -> Mechanism:
    """A slider-crank with weight, the law in its pins or in its guide."""
    graph = Graph("rig", gravity=Vector(-9.81j).z)
    markers = {"O": Marker(at=Place(0j)), "G": Marker(at=Place(0.05j), angle=0.1)}
    graph.add("frame", Frame(markers=markers))
    crank = Link(mass=2.0, inertia=0.4, cm=Place(0.1 + 0.05j))
    pins = {"A": law} if kind == "R" else {}
    graph.add("crank", Crank(length=0.3, links={"crank": crank}, friction=pins))
    rod, ram = Link(mass=1.5, inertia=0.1, cm=Place(0.4 + 0j)), Link(mass=3.0, inertia=0.05)
    friction = dict.fromkeys(PAIRS[kind], law)
    graph.add("rod", RRP(l=0.9, links={"i": rod, "j": ram}, friction=friction))
    graph.connect("frame.O", "crank.A")
    graph.connect("crank.B", "rod.B")
    graph.connect("frame.G", "rod.S")
    graph.drive("crank", Harmonic(mean=0.4, amplitude=1.1, frequency=0.4, phase=0.3))
    return Mechanism._from_graph(graph)
