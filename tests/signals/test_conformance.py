"""Signal blocks keep their contract, and what breaks it is named by its rule."""

from __future__ import annotations

import pytest

from blockmech import signals
from blockmech.blocks.block import REGISTRY
from blockmech.signals import Signal, State
from blockmech.testing.conformance import ConformanceError, conformance

BLOCKS = [
    signals.Constant(value=2.0),
    signals.Input(value=1.0),
    signals.Step(value=2.0, time=0.5),
    signals.Table(arguments=[0.0, 0.5, 1.0], values=[0.0, 2.0, 1.0]),
    signals.Table(of="input", arguments=[0.0, 0.5, 1.0], values=[0.0, 2.0, 1.0]),
    signals.Sum(signs="+-+"),
    signals.Gain(k=-3.0),
    signals.Product(),
    signals.Saturation(limits=(0.2, 0.6)),
    signals.DeadZone(limits=(0.2, 0.6)),
    signals.Integrator(initial=1.0),
    signals.Pid(kp=1.0, ki=2.0, kd=0.3),
    signals.Pid(kp=1.0, ki=2.0, kd=0.3, limits=(0.5, 1.5)),
    signals.Pid(kp=1.0, ki=2.0, kd=0.3, limits=(0.5, 1.5), sample=0.01),
    signals.TransferFunction(num=[1.0, 2.0, 3.0], den=[2.0, 0.4, 4.0]),
    signals.StateSpace(A=[[0.0, 1.0], [-2.0, -3.0]], B=[0.0, 1.0], C=[1.0, 0.0], D=0.5, sample=0.1),
    signals.Delay(sample=0.1, steps=3),
    signals.DCMotor(R=1.0, L=0.1, k=2.0),
    signals.Python(call=lambda a, b, t, m: (a * b + t + m, a - b), memory={"m": 0.5}),
]


def test_every_signal_of_the_package_has_an_example_here():
    own = {n for n in REGISTRY if REGISTRY[n].__module__.startswith("blockmech.signals")}
    assert own - {b.type_name for b in BLOCKS} == set()


@pytest.mark.parametrize("block", BLOCKS, ids=lambda block: block.type_name)
def test_every_block_keeps_its_contract(block):
    assert "keeps its contract" in str(conformance(block))


def wrong_name(speed, p):
    return (speed,)


def too_few(u, p):
    return ()


def neighbours(u, p):
    return (u + sum(u) if hasattr(u, "shape") else u,)


@pytest.mark.parametrize(
    ("kernel", "rule"),
    [(wrong_name, "rule 1"), (too_few, "rule 2"), (neighbours, "rule 2")],
)
def test_what_breaks_it_is_named(kernel, rule):
    class Broken(Signal):
        def output(self):
            return kernel

    with pytest.raises(ConformanceError, match=rule):
        conformance(Broken())


def test_a_rate_for_each_state_is_asked():
    class Two(Signal):
        @property
        def block_states(self):
            return {"a": State(), "b": State()}

        def output(self):
            return lambda x_a, p: (x_a,)

        def rates(self):
            return lambda u, p: (u,)

    with pytest.raises(ConformanceError, match="rule 2"):
        conformance(Two())
