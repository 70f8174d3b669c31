"""Signals in a graph: ports, wires, order, files, pictures, and what is refused."""

from __future__ import annotations

import pickle

import pytest

import blockmech as bm
from blockmech import signals
from blockmech.draw.diagram import draw_diagram
from blockmech.ground.errors import FormatError, GraphError
from blockmech.loads import laws
from tests.signals.machines import compiled, data_of, flywheel, speed_control


def refusal(g):
    with pytest.raises(GraphError) as caught:
        g.compile()
    (problem,) = caught.value.problems
    return problem


def test_blocks_stand_in_the_order_of_feedthrough():
    mech = compiled(data_of("speed_controlled_fourbar"))
    order = list(mech.structure.signals)
    assert order.index("error") < order.index("pid")
    assert list(mech.structure.sensors) == ["crank.rate"]


def test_outputs_and_states_are_outputs_with_units():
    outputs = compiled(data_of("speed_controlled_fourbar")).outputs
    units = {name: outputs[name].unit for name in ("motor.current", "motor.moment", "pid.integral")}
    assert units == {"motor.current": "A", "motor.moment": "N m", "pid.integral": ""}


def test_a_file_comes_back_as_it_was():
    g = bm.Graph.from_data(data_of("speed_controlled_fourbar"))
    assert g.check() == []
    assert bm.Graph.from_json(g.to_json()).to_json() == g.to_json()


def test_a_compiled_machine_travels():
    mech = pickle.loads(pickle.dumps(compiled(data_of("sampled_fourbar"))))
    assert mech.simulate("time=0.02").motion.status == "reached"


def test_verify_holds_the_moment_against_the_signal():
    mech = compiled(data_of("speed_controlled_fourbar"))
    assert mech.verify(at=[0.3, 1.0, 2.0], rates=[1.0, 2.0, 3.0]).ok


def test_the_diagram_shows_signals_as_dashed_lines():
    drawn = draw_diagram(bm.Graph.from_data(data_of("speed_controlled_fourbar")))
    labels = [str(patch.get_label()) for patch in drawn.axes.patches]
    assert sum(label.startswith("signal:") for label in labels) == 6
    assert not any(label.startswith("cycle:") for label in labels)
    assert "box:pid" in labels


def test_a_loop_of_signals_without_a_state_is_named():
    blocks = {"a": signals.Sum(), "b": signals.Gain(k=0.5)}
    wires = [("a.y", "b.u"), ("b.y", "a.u0"), ("wheel.rate", "a.u1"), ("a.y", "drive.law")]
    problem = refusal(flywheel(blocks, wires))
    assert problem.code == "algebraic-loop"
    assert "a -> b -> a" in problem.found


@pytest.mark.parametrize("sensor", ["wheel.acceleration", "wheel.A.reaction.x", "drive.b.couple"])
def test_a_loop_through_the_mechanism_is_named(sensor):
    g = flywheel({"gain": signals.Gain(k=-1.0)}, [(sensor, "gain.u"), ("gain.y", "drive.law")])
    g.blocks["wheel"] = bm.Crank(links={"crank": bm.Link(mass=1.0, cm=(0.1, 0.0), inertia=2.0)})
    problem = refusal(g)
    assert problem.code == "algebraic-loop"
    assert sensor in problem.found


@pytest.mark.parametrize(
    "block",
    [
        signals.TransferFunction(num=[1.0], den=[0.01, 1.0]),
        signals.Delay(sample=0.01),
        signals.StateSpace(A=[[-1.0]], B=[1.0], C=[1.0], D=1.0, sample=0.01),
    ],
)
def test_a_state_in_the_loop_opens_it(block):
    wires = [("wheel.acceleration", "held.u"), ("held.y", "drive.law")]
    assert flywheel({"held": block}, wires).check() == []


def test_a_sensor_that_no_actuator_reaches_opens_no_loop():
    wires = [("wheel.crank.omega", "gain.u"), ("gain.y", "drive.law")]
    assert flywheel({"gain": signals.Gain(k=-1.0)}, wires).check() == []


def wired(*wires):
    g = speed_control(signals.Pid(kp=1.0))
    for source, target in wires:
        g.connect(source, target)
    return g


@pytest.mark.parametrize(
    ("wire", "code", "message"),
    [
        (("setpoint.y", "pid.u"), "double-wire", "already fed by error.y"),
        (("setpoint.y", "wheel.A"), "unknown-joint", "no input"),
        (("setpoint.z", "pid.u"), "unknown-output", "outputs there: y"),
        (("setpoint.y", "pid.v"), "unknown-joint", "inputs there: u"),
        (("setpoint.y", "nobody.u"), "no-such-block", "no block"),
    ],
)
def test_a_wrong_wire_is_refused_at_once(wire, code, message):
    with pytest.raises(GraphError) as caught:
        wired(wire)
    assert code in {p.code for p in caught.value.problems}
    assert message in str(caught.value)


def test_wires_of_a_block_that_cannot_be_read_are_no_problems_of_their_own():
    data = data_of("speed_controlled_fourbar")
    data["blocks"]["pid"]["gain"] = 3.0  # no key of a controller
    with pytest.raises(FormatError) as caught:
        bm.Graph.from_data(data)
    assert [(p.code, p.where) for p in caught.value.problems] == [
        ("unknown-key", "blocks.pid.gain")
    ]


def test_both_ends_of_a_wire_of_signals_are_told_at_once():
    with pytest.raises(GraphError) as caught:
        bm.Graph.from_data(data_of("speed_controlled_fourbar")).connect("error", "pid.")
    assert [(p.code, p.where) for p in caught.value.problems] == [
        ("bad-address", "error"),
        ("bad-address", "pid."),
    ]


def test_an_input_without_a_wire_is_a_problem():
    g = flywheel({"gain": signals.Gain(k=1.0)}, [("gain.y", "drive.law")])
    assert [p.where for p in g.check()] == ["gain.u"]


def test_a_law_that_is_no_signal_takes_none():
    g = flywheel({"one": signals.Constant(value=1.0)}, [], load=False)
    g.add("drive", bm.Motor(law=laws.Constant(value=1.0)))
    with pytest.raises(GraphError, match="its law is no signal"):
        g.connect("one.y", "drive.law")


def test_a_driver_beside_a_signal_is_useless():
    with pytest.raises(GraphError, match="useless"):
        bm.Motor(law=laws.Signal(), driver="wheel")


@pytest.mark.parametrize(
    "make",
    [
        lambda: signals.Pid(kp=1.0, limits=(1.0, -1.0)),
        lambda: signals.TransferFunction(num=[1.0, 0.0], den=[1.0]),
        lambda: signals.TransferFunction(num=[1.0, 0.0, 0.0], den=[1.0, 1.0]),
        lambda: signals.StateSpace(A=[[1.0, 0.0]], B=[1.0], C=[1.0]),
        lambda: signals.Sum(signs="+*"),
        lambda: signals.DCMotor(R=1.0, L=0.0, k=1.0),
        lambda: signals.Delay(sample=0.0),
        lambda: signals.Table(arguments=[1.0, 0.0], values=[0.0, 1.0]),
        lambda: signals.Python(call=lambda *u: 0.0),
    ],
)
def test_numbers_that_cannot_be_are_refused(make):
    with pytest.raises(GraphError):
        make()


def test_a_function_of_python_is_not_written():
    g = speed_control(signals.Python(call=lambda u: 2.0 * u))
    with pytest.raises(FormatError, match="a function of Python is not written"):
        g.to_json()


def test_gains_are_numbers_of_the_design():
    mech = compiled(data_of("speed_controlled_fourbar"))
    assert {"pid.kp", "pid.ki", "motor.R", "setpoint.value"} <= set(mech.parameters())
    assert mech.parameters()["motor.L"].unit == "H"
