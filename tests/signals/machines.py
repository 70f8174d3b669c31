"""Machines under control, for tests of signals."""

from __future__ import annotations

import json

import blockmech as bm
from blockmech import signals
from blockmech.loads import laws
from tests.doors import graph_of
from tests.gallery import GRAPHS
from tests.machines import wire

CONTROL = GRAPHS / "control"


def data_of(name):
    """What stands in a file of ``graphs/control``, without what it expects."""
    data = json.loads((CONTROL / f"{name}.json").read_text("utf-8"))
    data.pop("expect")
    return data


def compiled(data):
    """The mechanism of some data."""
    return graph_of(json.dumps(data)).compile()


def flywheel(blocks, wires, inertia=2.0, start=(0.0, 0.0), load=True):
    """A wheel in the frame, its moment what is wired to ``drive.law``."""
    g = bm.Graph("flywheel")
    g.add("frame", bm.Frame(markers={"A": (0.0, 0.0)}))
    g.add("wheel", bm.Crank(links={"crank": bm.Link(inertia=inertia)}))
    g.connect("frame.A", "wheel.A")
    if load:
        g.add("drive", bm.Motor(law=laws.Signal()))
        wire(g, "frame.A drive.a", "wheel.crank drive.b")
    for name, block in blocks.items():
        g.add(name, block)
    for source, target in wires:
        g.connect(source, target)
    g.start("wheel", *start)
    return g


def speed_control(controller, setpoint=10.0, **machine):
    """A wheel whose rate a controller leads to a setpoint."""
    blocks = {"setpoint": signals.Constant(value=setpoint), "error": signals.Sum(signs="+-")}
    wires = [("setpoint.y", "error.u0"), ("wheel.rate", "error.u1"), ("error.y", "pid.u")]
    return flywheel({**blocks, "pid": controller}, [*wires, ("pid.y", "drive.law")], **machine)
