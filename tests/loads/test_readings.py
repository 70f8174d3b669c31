"""What a load's kernel may read is a closed table: a misspelt name is no silent rate."""

import math

import pytest

import blockmech as bm
from blockmech.blocks.block import REGISTRY
from blockmech.loads.contract import Element, Terminal
from tests import machines

BOTH = {"a": Terminal("link"), "b": Terminal("link")}


def by_link_rates(om_a, om_b, p):
    M = 0.4 * (om_b - om_a)
    return M, -M


def misspelt(omega_a, omega_b, p):
    M = 0.4 * (omega_b - omega_a)
    return M, -M


def position_as_x(x_a, om_b, p):
    return 0.4 * om_b, -0.4 * om_b


def third_terminal(om_a, om_c, p):
    return om_a, -om_c


@pytest.mark.parametrize(
    ("wrong", "name"),
    [(misspelt, "omega_a"), (position_as_x, "x_a"), (third_terminal, "om_c")],
    ids=["rate", "place", "terminal"],
)
def test_a_class_whose_kernel_reads_what_there_is_not_cannot_be_defined(wrong, name):
    with pytest.raises(TypeError, match=rf"{wrong.__name__}: its parameter '{name}' names nothing"):

        class Wrong(Element, type="load.wrong"):
            terminals = BOTH

            def kernel(self):
                return wrong

    assert "load.wrong" not in REGISTRY


def test_a_damper_of_a_stranger_damps():
    class Damper(Element, type="load.stranger"):
        terminals = BOTH

        def kernel(self):
            return by_link_rates

    try:
        ends = []
        for damper in (Damper(), bm.TorsionSpring(stiffness=0.0, damping=0.4)):
            g = machines.crank(body=machines.bar(1.0, 1.0), gravity=9.81)
            machines.load(g, "damper", damper, a="frame.A", b="crank.B")
            g.start("crank", q=0.5 - math.pi / 2, rate=0.0)
            ends.append(g.compile().simulate("time=2").motion.q_end)
        assert ends[0] == pytest.approx(ends[1], abs=1e-11)
    finally:
        REGISTRY._types.pop("load.stranger")
