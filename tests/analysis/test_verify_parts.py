"""`verify` names a coupling or a signal block whose own numbers are wrong.

A wrong number reaches every answer alike, so balances and powers hold: only a statement that does
not read it can tell.
"""

import math

import pytest

import blockmech as bm
from blockmech import signals
from blockmech.couplings.belt import Belt
from blockmech.couplings.gear import Gear
from blockmech.couplings.rack import Rack
from tests.analysis.test_verify import failures
from tests.gallery import GRAPHS
from tests.machines import wire
from tests.signals.machines import compiled, data_of

NEARLY = 1 + 1e-9


@pytest.mark.parametrize(
    ("name", "kind", "number", "factor", "row"),
    [
        ("geared_fivebar", Gear, "lean", -1, "line of action of mesh"),
        ("geared_fivebar", Gear, "phase", NEARLY, "law of mesh"),
        ("planetary_hoist", Gear, "lean", NEARLY, "line of action of ring"),
        ("rack_gripper", Rack, "lean", -1, "line of action of upper_mesh"),
        ("valve_engine", Belt, "step", NEARLY, "line of action of belt"),
    ],
)
def test_a_wrong_number_of_a_coupling_is_found(monkeypatch, name, kind, number, factor, row):
    graph = bm.Graph.load(GRAPHS / f"{name}.json")
    right = kind.parameters

    def wrong(self):
        numbers = right(self)
        return numbers._replace(**{number: factor * getattr(numbers, number)})

    monkeypatch.setattr(kind, "parameters", wrong)
    assert row in failures(graph.compile().verify(samples=3))


def pair(coupling, follower):
    """A crank, and what follows it by a coupling."""
    g = bm.Graph("pair")
    g.add("frame", bm.Frame(markers={"A": (0.0, 0.0), "B": (0.1, 0.02)}))
    g.add("one", bm.Crank())
    g.add("two", follower)
    g.add("load", bm.Couple(moment=3.0))
    g.add("mesh", coupling)
    wire(g, "frame.A one.A", "frame.B two.A", "two.crank load.on")
    return g.compile()


AT = {"at": [0.3, 2.2], "rates": 3.0, "accelerations": 2.0}
CUBIC = {"kind": "table", "arguments": [0.0, 0.7, 1.5, 3.0], "values": [0.0, 0.2, 0.3, 0.1]}
LAWS = [
    {"kind": "polynomial", "coefficients": [0.1, 0.5, 0.2]},
    CUBIC,
    {**CUBIC, "period": math.tau, "step": 0.5},
    {**CUBIC, "period": math.tau, "interpolation": "quintic"}
    | {"arguments": [0.0, 0.7, 1.5, 2.0, 3.0, 4.0], "values": [0.0, 0.2, 0.3, 0.1, 0.2, 0.0]},
]


@pytest.mark.parametrize("law", LAWS)
def test_a_wrong_curvature_of_a_law_is_found(monkeypatch, law):
    ratio = bm.Ratio(driver="one", driven="two", law=law, phase=0.4)
    assert pair(ratio, bm.Crank()).verify(**AT).ok
    right = bm.Ratio.numbers

    def wrong(self, *arguments):
        numbers = right(self, *arguments)
        rows = tuple(tuple(NEARLY * x for x in row) for row in numbers.curves)
        return numbers._replace(curves=rows)

    monkeypatch.setattr(bm.Ratio, "numbers", wrong)
    assert "law of mesh" in failures(pair(ratio, bm.Crank()).verify(**AT))


@pytest.mark.parametrize("follower", ["knife", "roller", "flat"])
def test_a_push_that_goes_beside_the_follower_is_found(monkeypatch, follower):
    segments = [{"motion": "3-4-5", "over": 2.0, "rise": x} for x in (0.1, -0.1)]
    cam = bm.Cam(
        driver="one",
        driven="two",
        law={"kind": "segments", "segments": segments},
        follower=follower,
        at=(0.1, 0.0),
        phase=2.6,
        roller=0.004 if follower == "roller" else 0.0,
        face=-math.pi / 2 if follower == "flat" else 0.0,
    )
    assert pair(cam, bm.Crank()).verify(**AT).ok
    right = bm.Cam.numbers

    def wrong(self, *arguments):
        numbers = right(self, *arguments)
        shape = numbers.shape
        moved = shape._replace(at=NEARLY * shape.at, normal=shape.normal * (1 + 1e-9j))
        return numbers._replace(shape=moved)

    monkeypatch.setattr(bm.Cam, "numbers", wrong)
    assert "line of action of mesh" in failures(pair(cam, bm.Crank()).verify(**AT))


@pytest.mark.parametrize(
    ("kind", "number", "row"),
    [
        (signals.Sum, "signs", "signal of error"),
        (signals.Pid, "kp", "signal of pid"),
        (signals.DCMotor, "k", "signal of motor"),
    ],
)
def test_a_wrong_number_of_a_signal_block_is_found(monkeypatch, kind, number, row):
    data, ask = data_of("speed_controlled_pump"), {"samples": 3}
    right = kind.numbers

    def wrong(self):
        numbers = right(self)
        value = getattr(numbers, number)
        off = tuple(-x for x in value) if number == "signs" else 1.001 * value
        changed = {field: getattr(numbers, field) for field in numbers._fields} | {number: off}
        return type(numbers)(**changed)

    monkeypatch.setattr(kind, "numbers", wrong)
    assert row in failures(compiled(data).verify(**ask))
