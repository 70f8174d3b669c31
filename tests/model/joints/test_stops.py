"""End stops of pairs in documents of links and joints, by the names and in the sense of those."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

import blockmech as bm
from blockmech.ground.errors import FormatError, GraphError
from tests.gallery import GRAPHS

STOPS = {
    "cylinder": {"to": 0.2471, "restitution": 0.5},
    "A": {"to": -0.4, "restitution": 0.5},
    "B": {"from": 0.08, "restitution": 0.4},
}
OTHER = {"from": "to", "to": "from"}


def document(stops, reverse="", turn=0.0):
    """A slider-crank that swings; a joint's links in the other order, the rod's axes turned."""
    data = json.loads((GRAPHS / "joints" / "slider_crank.json").read_text(encoding="utf-8"))
    data["links"]["crank"]["inertia"] = 0.02
    data["links"]["piston"]["mass"] = 1.3
    data["drivers"]["motor"] = {"joint": "O"}
    data["initial"] = {"motor": {"q": 0.5, "rate": -20.0}}
    rod, end = data["links"]["rod"]["pose"], data["joints"]["B"]["at"][0]
    data["links"]["rod"]["pose"] = [*rod[:2], rod[2] + turn]
    data["joints"]["B"]["at"][0] = [end[0] * math.cos(turn), -end[0] * math.sin(turn)]
    if reverse:
        for key in ("links", "at", "angle"):
            data["joints"][reverse].get(key, []).reverse()
    data["stops"] = stops
    return bm.Linkage.from_json(json.dumps(data))


@pytest.mark.parametrize("turn", [0.0, 1.1])
@pytest.mark.parametrize("joint", STOPS)
def test_a_file_names_them_and_the_request_says_the_same(joint, turn):
    """Strikes where the joint is at its bound, as its own output says."""
    name, stops = f"joint.{joint}.coordinate", dict(STOPS[joint])
    shift = {"A": turn, "B": -turn}.get(joint, 0.0)  # of the second link against the first
    stops |= {key: stops[key] + shift for key in OTHER if key in stops}
    mech = document({name: stops}, turn=turn).compile()
    motion = mech.simulate("time=0.02").motion
    blow = motion.impacts[0]
    assert blow.driver == name
    at = mech.run(at=[float(blow.q[0])], want=[name])[name][0]
    bound = next(stops[key] for key in OTHER if key in stops)
    assert at == pytest.approx(bound, abs=1e-12)
    assert blow.after[0] == pytest.approx(-stops["restitution"] * blow.before[0], rel=1e-12)
    plain = document({name: STOPS[joint]}).compile().simulate("time=0.02").motion
    assert motion.q_end == pytest.approx(plain.q_end, rel=1e-10)


@pytest.mark.parametrize("joint", STOPS)
def test_links_in_the_other_order_are_the_mirror_image(joint):
    name, stops = f"joint.{joint}.coordinate", STOPS[joint]
    mirrored = {OTHER.get(key, key): -x if key in OTHER else x for key, x in stops.items()}
    motion = document({name: stops}).compile().simulate("time=0.02").motion
    two = document({name: mirrored}, reverse=joint).compile().simulate("time=0.02").motion
    assert two.q_end == pytest.approx(motion.q_end, rel=1e-12)
    assert two.impacts[0].impulse == pytest.approx(-motion.impacts[0].impulse, rel=1e-10)


@pytest.mark.parametrize("turn", [0.0, 1.1])
@pytest.mark.parametrize("reverse", ["", "same"])
@pytest.mark.parametrize("joint", STOPS)
def test_the_graph_that_it_becomes_strikes_at_the_same_place(joint, reverse, turn):
    name, stops = f"joint.{joint}.coordinate", dict(STOPS[joint])
    shift = {"A": turn, "B": -turn}.get(joint, 0.0)
    stops |= {key: stops[key] + shift for key in OTHER if key in stops}
    if reverse:
        stops = {OTHER.get(key, key): -x if key in OTHER else x for key, x in stops.items()}
    linkage = document({name: stops}, joint if reverse else "", turn)
    motion = linkage.compile().simulate("time=0.02").motion
    graph = bm.Graph.from_json(json.dumps(linkage.decompose().data)).compile()
    result = graph.simulate("time=0.02").motion
    np.testing.assert_allclose(result.q_end, motion.q_end, rtol=1e-10)
    assert result.impacts[0].driver.endswith(".coordinate")


@pytest.mark.parametrize("joint", STOPS)
def test_a_motion_that_lies_against_one_is_verified(joint):
    linkage = document({f"joint.{joint}.coordinate": STOPS[joint] | {"restitution": 0.0}})
    linkage.add_load("push", "couple", link="crank", moment=-300.0)
    mech = linkage.compile()
    result = mech.simulate("time=0.02", times=np.linspace(0.0, 0.02, 9))
    assert result.motion.lying
    verification = mech.verify(result)
    assert verification.ok, str(verification)


@pytest.mark.parametrize("joint", STOPS)
def test_numbers_have_the_same_derivatives_with_stops_as_without(joint):
    """Turned axes of the rod let the stop of a pin count from numbers of the document."""
    drives = [
        document(stops, turn=1.1).compile().sensitivity("driver.motor.drive", at=[0.5], rates=-20.0)
        for stops in ({f"joint.{joint}.coordinate": STOPS[joint]}, {})
    ]
    stopped, plain = drives
    assert list(stopped) == list(plain)
    for address, derivative in plain.items():
        np.testing.assert_allclose(stopped[address], derivative, rtol=1e-12, err_msg=address)


def test_what_has_no_stops_of_its_own_is_refused_with_what_has():
    with pytest.raises(FormatError, match='no joint "Z"'):
        document({"joint.Z.coordinate": {"to": 1.0}})
    with pytest.raises(GraphError, match=r"motor drives O\. stop the driver"):
        document({"joint.O.coordinate": {"to": 1.0}}).compile()
