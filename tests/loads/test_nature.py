"""What elements declare of themselves serves all: a stranger's spring is as good as ours."""

from __future__ import annotations

import math

import numpy as np
import pytest

import blockmech as bm
from blockmech.blocks.block import REGISTRY
from blockmech.dynamics import loads
from blockmech.dynamics.request import Watch
from blockmech.ground.values import Angle, Number
from blockmech.loads import Element, Terminal
from blockmech.loads.contract import Kinks
from blockmech.loads.springs import pull, stored, turn_back, twist
from tests import machines


@pytest.fixture(scope="module")
def own():
    """A line spring and a torsion spring that somebody else wrote."""

    class Rubber(Element, type="test.rubber"):
        """A spring."""

        terminals = {"a": Terminal("point"), "b": Terminal("point")}
        stiffness: Number
        free_length: Number = 0.0

        def kernel(self):
            """The force."""
            return pull

        def energy(self):
            """Stored."""
            return stored

    class Hinge(Element, type="test.hinge"):
        """A torsion spring."""

        terminals = {"a": Terminal("link"), "b": Terminal("link")}
        stiffness: Number
        rest_angle: Angle = 0.0

        def kernel(self):
            """The moments."""
            return turn_back

        def kinks(self):
            """The half turn."""
            return Kinks(twist, (math.pi,), turning=True)

    yield Rubber, Hinge
    for name in ("test.rubber", "test.hinge"):
        REGISTRY._types.pop(name)


def fourbar(**elements):
    bodies = [bm.Link(mass=2.0, inertia=1.0), bm.Link(mass=3.0, inertia=4.0)]
    graph = machines.fourbar(2.0, 6.0, 3.0, 5.5, bodies, markers={"S": (2.0, 4.0)})
    for name, (element, a, b) in elements.items():
        machines.load(graph, name, element, a=a, b=b)
    graph.start("crank", 0.4, 1.0)
    return graph.compile()


def test_a_spring_with_a_stored_energy_is_lossless_whoever_wrote_it(own):
    ends = "frame.S", "dyad.C"
    numbers = {"stiffness": 40.0, "free_length": 1.0}
    strange, ours = (fourbar(spring=(cls(**numbers), *ends)) for cls in (own[0], bm.Spring))
    assert loads.lossless(strange.structure)
    motions = [m.simulate("time=3").motion for m in (strange, ours)]
    assert motions[0].method == motions[1].method == "energy"
    assert motions[0].q_end == motions[1].q_end
    assert motions[0].cost == motions[1].cost


def test_kinks_that_a_stranger_declares_end_panels_and_steps(own):
    ends = "frame.A", "dyad.j"
    strange, ours = (
        fourbar(hinge=(cls(stiffness=30.0, rest_angle=-1.0), *ends))
        for cls in (own[1], bm.TorsionSpring)
    )
    assert loads.knots(strange) == loads.knots(ours)
    ends = [
        m.simulate("time=2", method="dop853", accuracy=1e-9).motion.q_end for m in (strange, ours)
    ]
    assert ends[0] == ends[1]


@pytest.mark.parametrize(
    ("element", "conservative"),
    [
        (bm.Spring(stiffness=1.0), True),
        (bm.Spring(stiffness=1.0, damping=2.0), False),
        (bm.Force(force=(1.0, 0.0)), True),
        (bm.Force(force=(1.0, 0.0), axes="link"), False),
        (bm.Couple(moment=1.0), False),
        (bm.Motor(law=bm.laws.DC(stall_moment=1.0, no_load_speed=2.0)), False),
        (bm.Motor(law=bm.laws.Polynomial(of="rate", coefficients=[1.0, 2.0, 3.0])), False),
        (bm.Motor(law=bm.laws.Polynomial(coefficients=[1.0, 2.0, 3.0])), False),
        (bm.Motor(law=lambda rate: rate), False),
        (bm.Motor(law=bm.laws.Signal()), False),
    ],
)
def test_what_elements_say_of_themselves(element, conservative):
    assert element.conservative is conservative


@pytest.mark.parametrize("method", ["dop853", "radau"])
def test_an_event_on_a_kink_of_a_load_is_met(method):
    """Integrators step over a kink; what happens at the same place was stepped over, too."""
    knots = np.linspace(0.0, math.tau, 36, endpoint=False)
    law = bm.laws.Table(arguments=knots, values=np.cos(knots), of="coordinate", turns=1)
    g = bm.Graph("wheel")
    g.add("frame", bm.Frame(markers={"A": (0.0, 0.0)}))
    g.add("wheel", bm.Crank(links={"crank": bm.Link(inertia=0.1)}))
    g.add("motor", bm.Motor(law=law))
    machines.wire(g, "frame.A wheel.A", "frame.A motor.a", "wheel.crank motor.b")
    mech, turn = g.compile(), Watch("turn", lambda t, q, rate: q - math.tau)
    for rate in np.linspace(50.0, 100.0, 25):
        request = {"start": {"wheel": (0.0, rate)}, "method": method, "watch": [turn]}
        motion = mech.simulate("event", **request).motion
        assert motion.end == "turn"
        assert motion.q_end == pytest.approx(math.tau, rel=1e-14)
        assert [event.kind for event in motion.events] == ["turn"]
