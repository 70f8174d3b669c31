"""Signals in links-and-joints documents: the same motion as of the graph, by their own names."""

from __future__ import annotations

import json

import numpy as np
import pytest

import blockmech as bm
from blockmech import signals
from blockmech.ground.errors import FormatError, GraphError, RequestError
from blockmech.loads import laws
from tests.doors import linkage_of
from tests.gallery import JOINTS
from tests.independent.controlled import Pump
from tests.signals.machines import CONTROL

PUMP = "speed_controlled_pump"


def form():
    """What stands in the joint-based file of the pump."""
    return json.loads((CONTROL / "joints" / f"{PUMP}.json").read_text("utf-8"))


@pytest.mark.parametrize("folder", [CONTROL, CONTROL / "joints"], ids=["blocks", "joints"])
def test_the_pump_runs_as_by_its_crank_angle_alone(folder):
    document = bm.read(folder / f"{PUMP}.json")
    (entry,) = json.loads((folder / f"{PUMP}.json").read_text("utf-8"))["expect"]
    r = document.compile().simulate(**entry["simulate"], want=list(entry["want"]))
    again = Pump().run(entry["simulate"]["times"])
    for (name, expected), row in zip(entry["want"].items(), again, strict=True):
        np.testing.assert_allclose(row, expected, rtol=1e-12)
        np.testing.assert_allclose(r[name], expected, rtol=entry["rtol"], atol=entry["atol"])


def test_a_document_says_the_same_in_a_file_and_in_python(tmp_path):
    m = bm.Linkage.load(JOINTS / "pump.json")
    m.loads.pop("motor")
    m.add_load("drive", bm.Motor(law=laws.Signal()), links=["frame", "crank"])
    rows = {"arguments": [0.0, 0.4, 5.0], "values": [0.0, 60.0, 60.0]}
    m.add_signal("ramp", signals.Table(interpolation="linear", **rows))
    m.add_signal("tacho", signals.TransferFunction(num=[1.0], den=[0.01, 1.0]))
    m.add_signal("error", signals.Sum(signs="+-"))
    m.add_signal("pid", signals.Pid(kp=1.0, ki=8.0))
    m.add_signal("motor", signals.DCMotor(R=0.5, L=0.005, k=0.25))
    for wire in form()["wires"]:
        m.connect(wire["from"], wire["to"])
    m.save(tmp_path / "pump.json")
    own = bm.Linkage.load(tmp_path / "pump.json").to_data()
    theirs = bm.Linkage.load(CONTROL / "joints" / f"{PUMP}.json").to_data()
    for section in ("loads", "signals", "wires", "links", "joints", "drivers", "initial"):
        assert own[section] == theirs[section], section
    graph = m.decompose()
    assert bm.Graph.from_json(graph.graph.to_json()).compile().drivers == ("shaft",)


def test_every_output_that_is_a_number_is_read_with_its_own_sign_and_place():
    """An integrator of a sensor is the integral of the output, whatever blocks give it."""
    data = form()
    joint = data["joints"]["barrel"]
    joint["links"] = joint["links"][::-1]
    sensors = {
        "way": "joint.barrel.coordinate",
        "slip": "joint.barrel.slip",
        "angle": "link.rod.angle",
        "inner": "joint.crosshead.coordinate",
        "turn": "link.rod.omega",
        "place": "link.plunger.p.x",
        "power": "spring.power",
        "energy": "mechanism.kinetic_energy",
    }
    for name, output in sensors.items():
        data["signals"][name] = {"type": "integrator"}
        data["wires"].append({"from": output, "to": f"{name}.u"})
    mech = linkage_of(json.dumps(data)).compile()
    t = np.linspace(0.0, 0.5, 2001)
    want = [*sensors.values(), *(f"{name}.integral" for name in sensors)]
    r = mech.simulate("time=0.5", times=t, want=want)
    for name, output in sensors.items():
        whole, size = np.trapezoid(r[output], t), np.abs(r[output]).max() * 0.5
        assert r[f"{name}.integral"][-1] == pytest.approx(whole, abs=1e-5 * size), output
    assert r["way.integral"][-1] < 0
    blocks = linkage_of(json.dumps(data)).decompose().data["blocks"]
    assert blocks["joint_barrel_coordinate"] == {"type": "signal.sum", "signs": "-"}


@pytest.mark.parametrize(
    ("change", "code", "where"),
    [
        (lambda d: d["wires"].pop(), "unwired-joint", "drive.law"),
        (lambda d: d["wires"].append({"from": "ramp.y", "to": "pid.u"}), "double-wire", "pid.u"),
        (lambda d: d["wires"][0].update({"from": "ramp.z"}), "unknown-output", "ramp.z"),
        (lambda d: d["wires"][1].update({"from": "driver.shaft.speed"}), "unknown-output", None),
        (lambda d: d["wires"][1].update({"from": "driver.axle.rate"}), "unknown-output", None),
        (lambda d: d["wires"][1].update({"from": "link.rod.p"}), "no-sensor", "link.rod.p"),
        (lambda d: d["wires"][0].update({"to": "errror.u0"}), "no-such-block", "errror.u0"),
        (lambda d: d["wires"][0].update({"to": "spring.law"}), "unknown-joint", "spring.law"),
        (lambda d: d["signals"].update(drive={"type": "gain", "k": 1.0}), "taken-name", None),
        (lambda d: d["signals"]["pid"].update(kq=1.0), "unknown-key", "signals.pid.kq"),
        (lambda d: d["signals"]["pid"].update(type="pdi"), "wrong-value", "signals.pid.type"),
    ],
)
def test_each_mistake_is_one_message(change, code, where):
    data = form()
    change(data)
    with pytest.raises((FormatError, GraphError)) as caught:
        linkage_of(json.dumps(data)).compile()
    problems = caught.value.problems
    assert [p.code for p in problems] == [code], problems
    assert where in (None, problems[0].where)
    assert problems[0].found
    assert problems[0].valid or problems[0].remedy


def test_an_algebraic_loop_of_a_document_is_told_by_name():
    data = form()
    data["wires"][1]["from"] = "driver.shaft.acceleration"
    data["signals"]["tacho"] = {"type": "gain", "k": 0.01}
    data["signals"]["motor"] = {"type": "gain", "k": 1.0}
    data["wires"] = [w for w in data["wires"] if w["to"] != "motor.rate"]
    data["wires"][-1]["from"] = "motor.y"
    with pytest.raises(GraphError, match=r"algebraic loop: .*tacho -> error -> pid -> motor"):
        linkage_of(json.dumps(data)).compile()


def test_designs_of_a_document_under_control_vary_its_numbers():
    m = bm.Linkage.load(CONTROL / "joints" / f"{PUMP}.json")
    result = (
        m.replace({"signals.pid.ki": 4.0}).compile().simulate("time=0.5", want=["pid.integral"])
    )
    here = m.compile().simulate("time=0.5", want=["pid.integral"])
    assert result["pid.integral"][-1] != here["pid.integral"][-1]


def test_a_study_of_what_follows_states_is_refused_as_a_run_is():
    mech = bm.Graph.load(CONTROL / "speed_controlled_pump.json").compile()
    drive = f"{mech.drivers[0]}.drive"
    name = next(a for a in mech.parameters() if a.endswith(".mass"))
    for ask in (
        lambda: mech.run(samples=3, want=drive),
        lambda: mech.study({name: [1.0, 1.1]}, want=f"max({drive})", samples=3),
    ):
        with pytest.raises(RequestError) as refused:
            ask()
        assert refused.value.problems[0].code == "signal-states"


def test_a_driver_inside_a_group_without_closed_form_is_a_sensor():
    """Such a driver is no block of the graph, and its outputs have its name."""
    linkage = bm.Linkage.load(JOINTS / "floating_drive_press.json")
    linkage.add_signal("brake", "gain", k=-2.0)
    linkage.add_load("brakes", "thrust", joint=linkage.drivers["cylinder"].joint, law=laws.Signal())
    linkage.connect("driver.cylinder.rate", "brake.u")
    linkage.connect("brake.y", "brakes.law")
    graph = bm.Graph.from_json(linkage.decompose().graph.to_json())
    assert graph.check() == []
    (q,) = (law.start for law in graph.scene.drive.values())
    rates = [0.0, 0.1, 0.3]
    request = {"at": [q] * 3, "rates": rates, "static": True, "friction": "none"}
    (drive,) = linkage.compile().run(**request, want="driver.cylinder.drive").values()
    np.testing.assert_allclose(drive - drive[0], 2.0 * np.array(rates), rtol=1e-9)
