"""Mechanisms that the tests of pictures draw, beside those of `tests.machines`."""

from __future__ import annotations

import math

import blockmech as bm
from blockmech import Graph
from blockmech.model.diagram import UnknownBlock
from tests import machines
from tests.machines import chain, wire


def unfinished() -> Graph:
    """Two joints without a wire, a type that is not installed, names that hurt."""
    g = Graph('a <b> & "$x$"')
    g.add("frame", bm.Frame(markers={"A": (0.0, 0.0), "D": (5.0, 0.0)}))
    g.add("crank", bm.Crank(length=2.0))
    g.add("dyad", bm.RRR(l_i=6.0, l_j=3.0))
    g.add("rod", UnknownBlock("geneva.rod", {}))
    g.add("load", bm.Force(force=(0.0, -1.0)))
    return wire(g, "frame.A crank.A", "crank.B dyad.B", "dyad.C rod.X")


def cyclic() -> Graph:
    """Two dyads that wait for each other."""
    g = Graph("cycle")
    g.add("frame", bm.Frame(markers={"A": (0.0, 0.0), "D": (5.0, 0.0)}))
    g.add("crank", bm.Crank(length=2.0))
    g.add("one", bm.RRR(l_i=6.0, l_j=3.0))
    g.add("two", bm.RRR(l_i=6.0, l_j=3.0))
    wires = ("frame.A crank.A", "crank.B one.B", "two.C one.D", "one.C two.B", "frame.D two.D")
    return wire(g, *wires)


def fourbar(rocker: float = 3.0) -> Graph:
    """A four-bar without mass and load; a short rocker cannot follow the whole turn."""
    g = machines.fourbar(2.0, 6.0, rocker, 5.5)
    g.drive("crank", bm.motion.ConstantRate(rate=10.0))
    return g


def slider_crank(slider: str = "later") -> Graph:
    """A crank, a rod and a piston on a guide of the frame 2 cm below the crank's pivot."""
    g = Graph("slider crank", gravity=(0.0, -9.81))
    g.add("frame", bm.Frame(markers={"O": (0.0, 0.0), "G": {"at": (0.5, -0.02), "angle": 0.0}}))
    g.add("crank", bm.Crank(length=0.1))
    g.add("rod", bm.RRP(l=0.3, branch=1, slider=slider, links={"j": bm.Link(mass=1.5)}))
    g.add("gas", bm.Force(force=(-500.0, 0.0)))
    wire(g, "frame.O crank.A", "crank.B rod.B", "frame.G rod.S", "rod.j gas.at")
    g.drive("crank", bm.motion.ConstantRate(rate=10.0))
    return g


def quick_return() -> Graph:
    """A crank in a slotted lever: a prismatic pair between two moving links."""
    g = Graph("quick return")
    g.add("frame", bm.Frame(markers={"O": (0.0, 0.0), "P": (0.0, -0.3)}))
    g.add("crank", bm.Crank(length=0.15))
    g.add("lever", bm.RPR(branch=-1, slider="i", links={"j": bm.Link(markers={"T": (0.6, 0.0)})}))
    wire(g, "frame.O crank.A", "crank.B lever.B", "frame.P lever.D")
    g.drive("crank", bm.motion.ConstantRate(rate=1.0))
    return g


def rocking_slide() -> Graph:
    """A slide that a law of time moves to and fro, with a spring and a couple."""
    g = Graph("rocking slide")
    g.add("frame", bm.Frame(markers={"S": {"at": (0.0, 0.0), "angle": 0.3}, "D": (3.0, 0.2)}))
    g.add("ram", bm.SlideDrive())
    g.add("dyad", bm.RRR(l_i=2.0, l_j=2.0, links={"j": bm.Link(markers={"E": (1.0, 0.6)})}))
    g.add("spring", bm.Spring(stiffness=400.0, free_length=0.5))
    g.add("couple", bm.Couple(moment=3.0))
    wire(g, "frame.S ram.S", "ram.S dyad.B", "frame.D dyad.D")
    wire(g, "dyad.E spring.b", "frame.S spring.a", "dyad.j couple.on")
    g.drive("ram", bm.motion.Harmonic(mean=0.6, amplitude=0.5, frequency=1.0, phase=math.pi / 2))
    return g


def twelve() -> Graph:
    """Twelve blocks: a chain of six dyads with springs, a force and a couple."""
    g = chain(6)
    g.add("spring", bm.Spring(stiffness=100.0))
    g.add("tie", bm.Spring(stiffness=100.0))
    g.add("press", bm.Force(force=(0.0, -10.0)))
    g.add("couple", bm.Couple(moment=-3.0))
    return wire(
        g,
        "dyad00001.E spring.a",
        "dyad00004.E spring.b",
        "frame.D0 tie.a",
        "dyad00003.E tie.b",
        "dyad00005.E press.at",
        "dyad00002.j couple.on",
    )
