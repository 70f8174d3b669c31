"""A driver's coordinate is the document's, also where its joint counts another way."""

from __future__ import annotations

import copy
import math

import numpy as np
import pytest

import blockmech as bm
from tests.model.documents import DOCUMENTS, flipped, linkage, reframed, slider_crank
from tests.wiring import recorded

ROUNDING = 1e-13  # [rad or m] of coordinates of size 1, a few operations apart


def test_a_single_pose_is_named_by_the_documents_coordinate():
    document = slider_crank()
    want = ["link.piston.*", "joint.B.reaction", "driver.motor.rate"]
    result = linkage(document).run(at=0.4, want=want)
    mirrored = linkage(flipped(document, "O")).run(at=-0.4, want=want)
    assert result._engine == mirrored._engine == "scalar"
    assert mirrored.drivers["driver.motor.q"].tolist() == [-0.4]
    assert mirrored["driver.motor.rate"].tolist() == [-3.0]
    same = [name for name in want if name != "driver.motor.rate"]
    for name in linkage(document).compile().outputs.match(same):
        assert np.array_equal(result[name], mirrored[name])


def test_samples_of_a_cycle_are_the_same_whatever_the_frame_of_the_crank():
    """Extremes and strokes are found at the same poses, told in the document's coordinate."""
    document = slider_crank()
    document["drivers"]["motor"].update({"from": 0.0, "to": 2 * math.pi})
    turned = flipped(reframed(document, "crank", 0j, 0.7), "O")  # q -> -0.7 - q
    original, rotated = (linkage(d).compile() for d in (document, turned))
    low, same = (m.extremes("joint.B.reaction.magnitude") for m in (original, rotated))
    for mine, theirs in ((low.minimum, same.minimum), (low.maximum, same.maximum)):
        assert theirs.value == pytest.approx(mine.value, rel=1e-11)
        apart = theirs.at["driver.motor.q"] - (-0.7 - mine.at["driver.motor.q"])
        assert abs(math.remainder(apart, 2 * math.pi)) <= 1e-7  # a flat place: half the digits
    strokes = [m.stroke("link.piston.p") for m in (original, rotated)]
    assert strokes[0].length == pytest.approx(strokes[1].length, rel=1e-12)
    assert strokes[0].time_ratio == pytest.approx(strokes[1].time_ratio, rel=1e-7)


def rocker():
    """A four-bar whose crank cannot turn fully."""
    links = {"crank": (2.0, 0.0, 0.5), "rod": (1.76, 0.96, 0.2), "rocker": (5.5, 0.0, 2.4)}
    document = {
        "format": "blockmech/joints",
        "version": 1,
        "name": "rocker",
        "links": {
            name: {"pose": [0, 0, a] if name == "crank" else [x, y, a]}
            for name, (x, y, a) in links.items()
        },
        "joints": {},
        "drivers": {"arm": {"joint": "A", "law": "constant_rate", "rate": 1.0}},
    }
    for name, first, at, second, second_position in (
        ("A", "frame", (0, 0), "crank", (0, 0)),
        ("B", "crank", (2, 0), "rod", (0, 0)),
        ("C", "rod", (2.5, 0), "rocker", (2.5, 0)),
        ("D", "frame", (5.5, 0), "rocker", (0, 0)),
    ):
        positions = [list(at), list(second_position)]
        document["joints"][name] = {"type": "R", "links": [first, second], "at": positions}
    document["drivers"]["arm"] |= {"from": 0.0, "to": 6.0}
    return document


def test_feasible_arcs_are_told_in_the_documents_coordinate():
    document = rocker()
    (arc,) = linkage(document).compile().limits().arcs
    turned = flipped(reframed(document, "crank", 0j, 0.3), "A")  # q -> -0.3 - q
    limits = linkage(turned).compile().limits()
    (mirrored,) = limits.arcs
    for end, expected in ((mirrored.start, arc.end), (mirrored.end, arc.start)):
        assert abs(end.q - (-0.3 - expected.q)) <= 4 * ROUNDING
        assert (end.block, end.how) == (expected.block, expected.how)
    assert limits.sentence().startswith("feasible arc of driver.arm.q: [")
    assert limits.arc_at((mirrored.start.q + mirrored.end.q) / 2) == mirrored


# -- free motion --------------------------------------------------------------------------


def watt():
    document = copy.deepcopy(recorded("watt_sixbar")["document"])
    document["initial"]["crank"]["q"] = math.pi / 3
    document["links"]["2"]["pose"][2] = math.pi / 3
    for link in "3456":
        document["links"][link].pop("pose")
    document["links"]["3"]["pose"] = [0.5, 0.87, 1.06]
    document["links"]["4"]["pose"] = [1.6, 0.0, 1.79]
    document["links"]["5"]["pose"] = [0.87, 1.52, 0.56]
    document["links"]["6"]["pose"] = [1.44, 0.73, 1.34]
    return document


def agree(motion, expected, within):
    """Two motions that are one, each as exact as it says."""
    assert np.abs(np.asarray(motion) - np.asarray(expected)).max() <= within


def test_a_free_motion_is_the_same_in_the_other_coordinate():
    document = watt()
    result = linkage(document).compile().simulate("time=2", want=["driver.crank.*", "link.6.p"])
    mechanism = linkage(flipped(document, "O2")).compile()
    mirrored = mechanism.simulate("time=2", want=["driver.crank.*", "link.6.p"])
    within = result.motion.error + mirrored.motion.error
    assert within < 1e-12
    agree(mirrored["driver.crank.q"], -result["driver.crank.q"], within)
    sway = np.abs(np.diff(result["driver.crank.acceleration"])).max()
    sway /= np.abs(np.diff(result["driver.crank.q"])).max()  # [1/s2] how errors of the angle show
    agree(
        mirrored["driver.crank.acceleration"], -result["driver.crank.acceleration"], sway * within
    )
    agree(mirrored["link.6.p"], result["link.6.p"], within)
    assert len(result.motion.events) > 0
    agree([e.q for e in mirrored.motion.events], [-e.q for e in result.motion.events], within)
    agree(mirrored.motion.q_end, -result.motion.q_end, within)
    agree(mirrored.motion.at(1.0).qd, -result.motion.at(1.0).qd, sway * within)
    assert set(mirrored.to_dict()["events"][0]) >= {"driver.crank.q", "driver.crank.rate"}


def test_a_free_motion_of_several_drivers_is_told_by_each_drivers_coordinate():
    document = DOCUMENTS["arm"]()
    document["initial"] = {"lift": {"q": 1.0, "rate": 0.2}, "bend": {"q": -1.4, "rate": 0.0}}
    want = ["driver.*.q", "link.lid.p"]
    options = {"until": "time=0.05", "friction": "none", "want": want}
    result = linkage(document).compile().simulate(**options)
    mechanism = linkage(flipped(document, "elbow")).compile()
    mirrored = mechanism.simulate(**options)
    within = result.motion.error + mirrored.motion.error
    agree(mirrored["driver.lift.q"], result["driver.lift.q"], within)
    agree(mirrored["driver.bend.q"], -result["driver.bend.q"], within)
    agree(mirrored["link.lid.p"], result["link.lid.p"], within)
    k = mechanism.drivers.index("bend")
    agree(mirrored.motion.q_end[k], -result.motion.q_end[k], within)
    stopped = mechanism.simulate(**options, stops={"bend": (1.39, 1.41)})
    assert stopped.motion.end == "end stop of bend"


# -- the graph of a document ----------------------------------------------------------------


def test_a_saved_graph_counts_as_its_document(tmp_path):
    """Its drivers have the document's names and coordinates, in general groups as well."""
    document = flipped(DOCUMENTS["boom"](), "bore")
    for general in ("", "groups"):
        decomposed = linkage(document).decompose(general)
        decomposed.graph.save(tmp_path / "boom.json")
        graph = bm.Graph.load(tmp_path / "boom.json").compile()
        ours, read = decomposed.compile(), graph
        (driver,) = ours.drivers
        assert graph.drivers == (driver,)
        want = [
            f"{driver}.{quantity}"
            for quantity in ("q", "rate", "drive", "J_red", "tau_red", "dJ_red")
        ]
        at = {"at": -0.9, "rates": -0.3, "accelerations": 0.1}
        mine = ours.run(**at, want=[f"driver.{name}" for name in want])
        theirs = read.run(**at, want=want)
        assert [mine[f"driver.{name}"] for name in want] == [theirs[name] for name in want]
        assert theirs[f"{driver}.q"] == [-0.9]
