"""Stepping under a controller of one's own is the motion that blocks would give."""

from __future__ import annotations

import numpy as np
import pytest

from blockmech import signals
from blockmech.ground.errors import RequestError
from tests.gallery import mechanism
from tests.signals.machines import compiled, data_of, flywheel


def fed(**machine):
    """A wheel whose moment is fed."""
    return flywheel({"moment": signals.Input()}, [("moment.y", "drive.law")], **machine).compile()


def fourbar():
    """The four-bar whose voltage is fed."""
    data = data_of("sampled_fourbar")
    del data["blocks"]["pid"], data["blocks"]["setpoint"], data["blocks"]["error"]
    data["blocks"]["volts"] = {"type": "signal.input"}
    wires = [w for w in data["wires"] if w["to"].split(".")[0] in data["blocks"]]
    data["wires"] = [
        w if w["to"] != "motor.u" else {"from": "volts.y", "to": "motor.u"} for w in wires
    ]
    return compiled(data)


def test_a_sampled_controller_in_a_loop_of_steps_is_the_sampled_block():
    block = compiled(data_of("sampled_fourbar"))
    names = ["crank.q", "crank.rate", "motor.current"]
    expected = block.simulate("time=0.2", times=[0.2], want=names, accuracy=1e-10)
    env = fourbar().stepper(names, accuracy=1e-12)
    state, total = env.observe(), 0.0
    for _ in range(20):
        e = 10.0 - state["crank.rate"][0]
        v = 20.0 * e + 40.0 * total
        beyond = (v > 150.0 and e > 0) or (v < -150.0 and e < 0)
        total += 0.0 if beyond else 0.01 * e
        state = env.step(0.01, {"volts": min(max(v, -150.0), 150.0)})
    assert env.t == pytest.approx([0.2])
    for name in names:
        assert state[name][0] == pytest.approx(expected[name][0], rel=1e-9)


def test_copies_go_their_own_ways_and_come_back():
    env = fed().stepper(["wheel.q", "wheel.rate", "wheel.acceleration"], copies=3)
    state = env.step(0.5, {"moment": np.array([1.0, 0.0, -2.0])})
    assert state["wheel.rate"] == pytest.approx([0.25, 0.0, -0.5])
    assert state["wheel.acceleration"] == pytest.approx([0.5, 0.0, -1.0])
    state = env.step(0.5)  # what was fed stays
    assert state["wheel.q"] == pytest.approx([0.25, 0.0, -0.5])
    state = env.reset(copies=2, start={"wheel": (1.0, 2.0)})
    assert state["wheel.q"] == pytest.approx([0.25, 0.0, 1.0])
    assert env.t.tolist() == [1.0, 1.0, 0.0]
    assert env.step(0.5)["wheel.q"][2] == pytest.approx(2.0)  # nothing is fed any more


def test_a_copy_that_met_its_stop_stays_until_it_is_reset():
    env = fed().stepper(copies=2, stops={"wheel": (-1.0, 0.1)})
    env.step(1.0, {"moment": [1.0, -0.5]})
    assert env.ended == ["end stop", ""]
    assert env.t[0] == pytest.approx(np.sqrt(0.4))
    env.reset()
    assert env.ended == ["", ""]


def test_in_a_simulation_an_input_has_its_own_value():
    g = flywheel({"moment": signals.Input(value=3.0)}, [("moment.y", "drive.law")])
    assert g.compile().simulate("time=1").motion.q_end == pytest.approx(0.75)


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (lambda env: env.step(0.1, {"momnt": 1.0}), 'did you mean "moment"'),
        (lambda env: env.step(0.1, {"moment": [1.0, 2.0, 3.0]}), "a finite number, or 2 of them"),
        (lambda env: env.step(0.1, {"moment": float("nan")}), "a finite number"),
        (lambda env: env.step(0.0), "is not a number above zero"),
        (lambda env: env.reset(copies=5), "there is no copy 5"),
        (lambda env: env.reset(start={"weel": (0.0, 0.0)}), "weel"),
    ],
)
def test_what_cannot_be_is_refused(ask, message):
    with pytest.raises(RequestError) as caught:
        ask(fed().stepper(copies=2))
    assert message in str(caught.value)


def test_without_an_input_a_mechanism_steps_under_its_loads():
    env = mechanism("fivebar_falling").stepper("*.q")
    first = env.observe()
    assert all((env.step(0.01)[name] != first[name]).all() for name in first)
