"""Mechanisms with prismatic pairs, massive and loaded, for comparison with the judge."""

from __future__ import annotations

import blockmech as bm

PIN = bm.Coulomb(coefficient=0.2, radius=0.005)
SHOE = bm.Coulomb(coefficient=0.12)
LONG_SHOE = bm.Coulomb(coefficient=0.12, guide_length=0.15)


def wired(name, blocks, wires, gravity=(0.4, -9.81)):
    """A graph from named blocks and ``"marker joint"`` lines."""
    graph = bm.Graph(name, gravity=gravity)
    for key, block in blocks.items():
        graph.add(key, block)
    for line in wires:
        graph.connect(*line.split())
    return graph


def guide(x, y, angle):
    """A directed line."""
    return bm.Marker(at=(x, y), angle=angle)


def body(mass, inertia, cm, **markers):
    """A massive link."""
    return bm.Link(mass=mass, inertia=inertia, cm=cm, markers=markers)


def crank(length=0.1, **markers):
    """A driving link on a rough pin."""
    links = {"crank": body(1.0, 0.01, (0.05, 0.01), **markers)}
    return bm.Crank(length=length, links=links, friction={"A": PIN})


def slider_crank(shoe):
    """An offset slider-crank on an oblique guide, pin and slider's point off the line."""
    links = {
        "i": body(2.0, 0.05, (0.15, 0.01)),
        "j": body(1.5, 0.002, (0.01, 0.02), P=(0.05, 0.03)),
    }
    dyad = bm.RRP(
        l=0.3,
        h=0.02,
        x_S=0.2,
        links=links,
        friction={"B": PIN, "C": PIN, "S": shoe},
    )
    blocks = {
        "frame": bm.Frame(markers={"O": (0.0, 0.0), "G": guide(0.1, 0.02, 0.2)}),
        "crank": crank(),
        "dyad": dyad,
        "gas": bm.Force(force=(-500.0, 100.0)),
    }
    wires = ["frame.O crank.A", "crank.B dyad.B", "frame.G dyad.S", "dyad.P gas.at"]
    return wired("slider_crank", blocks, wires)


def whitworth(shoe):
    """A Whitworth quick return, the sliding block and the slot off their lines."""
    links = {
        "i": body(0.4, 0.001, (0.01, 0.02)),
        "j": body(3.0, 0.05, (0.2, -0.01), P=(0.4, 0.0)),
    }
    dyad = bm.RPR(
        h_i=0.01,
        h_j=-0.02,
        x_S=0.02,
        links=links,
        friction={"B": PIN, "D": PIN, "S": shoe},
    )
    blocks = {
        "frame": bm.Frame(markers={"O": (0.0, 0.0), "D": (0.0, -0.25)}),
        "crank": crank(),
        "dyad": dyad,
        "cut": bm.Force(force=(-500.0, 100.0)),
    }
    wires = ["frame.O crank.A", "crank.B dyad.B", "frame.D dyad.D", "dyad.P cut.at"]
    return wired("whitworth", blocks, wires)


def slotted_crank(shoe):
    """A PRP dyad between a slot in the crank and a slot in the frame."""
    links = {
        "i": body(0.4, 0.001, (0.01, 0.02)),
        "j": body(3.0, 0.05, (0.2, -0.01), P=(0.1, 0.0)),
    }
    dyad = bm.PRP(
        h1=0.03,
        h2=-0.02,
        x_S1=0.04,
        x_S2=-0.05,
        links=links,
        friction={"S1": shoe, "C": PIN, "S2": shoe},
    )
    blocks = {
        "frame": bm.Frame(markers={"O": (0.0, 0.0), "G": guide(0.3, 0.1, 2.0)}),
        "crank": crank(None, g=guide(0.02, 0.03, 0.3)),
        "dyad": dyad,
        "cut": bm.Force(force=(-50.0, 100.0)),
    }
    wires = ["frame.O crank.A", "crank.g dyad.S1", "frame.G dyad.S2", "dyad.P cut.at"]
    return wired("slotted_crank", blocks, wires)


def yoke(shoe):
    """A scotch yoke with an oblique slot."""
    links = {
        "i": body(0.4, 0.001, (0.01, 0.02)),
        "j": body(3.0, 0.05, (0.2, -0.01), P=(0.1, 0.0)),
    }
    dyad = bm.RPP(
        beta=1.4,
        h_i=0.03,
        h_j=-0.02,
        x_S1=0.04,
        x_S=-0.05,
        links=links,
        friction={"B": PIN, "S1": shoe, "S": shoe},
    )
    blocks = {
        "frame": bm.Frame(markers={"O": (0.0, 0.0), "G": guide(0.3, 0.1, 0.3)}),
        "crank": crank(),
        "dyad": dyad,
        "cut": bm.Force(force=(-50.0, 100.0)),
    }
    wires = ["frame.O crank.A", "crank.B dyad.B", "frame.G dyad.S", "dyad.P cut.at"]
    return wired("yoke", blocks, wires)
