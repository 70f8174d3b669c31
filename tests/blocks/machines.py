"""Parts of machines for tests of blocks: rough pairs, massive links, wires as lines."""

from __future__ import annotations

import blockmech as bm

PIN = bm.friction.Coulomb(coefficient=0.2, radius=0.005)
LONG_SHOE = bm.friction.Coulomb(coefficient=0.12, guide_length=0.15)


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
