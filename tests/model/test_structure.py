"""Formation sequence, mobility and formula; the same for any order of writing."""

import math
import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import blockmech as bm
from blockmech.ground.values import Marker
from blockmech.model.structure import JointRef
from blockmech.testing.strategies import mechanisms
from tests.machines import ruiz, squeezer, toggle, watt, wire
from tests.wiring import rewired


def robot():
    """Two drivers on moving links: a carriage, an arm on it, a gripper dyad between both."""
    g = bm.Graph("robot")
    guide = Marker(at=(0.0, 0.0), angle=0.0)
    g.add("frame", bm.Frame(markers={"G": guide}))
    links = {"slider": bm.Link(markers={"A": (0.0, 0.3), "D": (1.0, 0.0)})}
    g.add("carriage", bm.SlideDrive(links=links))
    links = {"crank": bm.Link(markers={"T": (0.5, 0.0)})}
    g.add("arm", bm.Crank(length=0.8, links=links))
    g.add("wrist", bm.Crank(length=0.3))
    g.add("gripper", bm.RRR(l_i=0.9, l_j=0.9))
    return wire(
        g,
        "frame.G carriage.S",
        "carriage.A arm.A",
        "arm.B wrist.A",
        "arm.T gripper.B",
        "carriage.D gripper.D",
    )


MECHANISMS = {
    "ruiz": (ruiz, 3, 4, 1, "I(crank: 0,1) -> II RRR(dyad: 2,3)"),
    "watt": (watt, 5, 7, 1, "I(crank: 0,1) -> II RRR(first: 2,3) -> II RRR(last: 4,5)"),
    "toggle": (toggle, 3, 4, 1, "I(ram: 0,1) -> II RRR(dyad: 2,3)"),
    "squeezer": (
        squeezer,
        7,
        10,
        1,
        "I(crank: 0,1) -> II RRR(first: 2,3) -> II RRR(lower: 4,5) -> II RRR(upper: 6,7)",
    ),
    "robot": (
        robot,
        5,
        6,
        3,
        "I(carriage: 0,1) -> I(arm: 1,2) -> II RRR(gripper: 3,4) -> I(wrist: 2,5)",
    ),
}


@pytest.mark.parametrize("name", MECHANISMS)
def test_links_pairs_mobility_and_formula(name):
    make, links, pairs, mobility, formula = MECHANISMS[name]
    structure = make().structure()
    assert len(structure.links) - 1 == links
    assert structure.pairs == pairs
    assert structure.mobility == 3 * links - 2 * pairs == mobility == len(structure.drivers)
    assert structure.formula == formula


def test_formation_order_is_topological_with_ties_by_name():
    assert list(robot().structure().blocks) == ["carriage", "arm", "gripper", "wrist"]
    g = bm.Graph("names")
    g.add("frame", bm.Frame(markers={"A": (0.0, 0.0)}))
    for name in ("z", "b", "a10", "a9", "B"):
        g.add(name, bm.Crank(length=1.0))
        g.connect("frame.A", f"{name}.A")
    assert list(g.structure().blocks) == ["B", "a10", "a9", "b", "z"]


@given(mechanisms(), st.integers(0, 2**32 - 1))
@settings(max_examples=15)
def test_structure_is_the_same_for_any_order_of_writing(case, seed):
    structure = case.graph.structure()
    two = rewired(case.graph, random.Random(seed)).structure()
    assert list(structure.blocks) == list(two.blocks)
    assert list(structure.elements) == list(two.elements)
    assert structure.links == two.links
    assert structure.formula == two.formula
    assert structure.carried == two.carried
    assert structure.loaded == two.loaded


@given(mechanisms())
@settings(max_examples=15)
def test_every_random_mechanism_has_the_mobility_of_its_drivers(case):
    structure = case.graph.structure()
    assert structure.mobility == len(structure.drivers)
    placed = {structure.frame}
    for name in structure.blocks:
        assert set(structure.supports(name)) <= placed
        placed.add(name)


def test_pair_is_between_the_earlier_and_the_later_link():
    s = watt().structure()

    def links(joint):
        ref = JointRef(*joint.split("."))
        return str(s.earlier_link(ref)), str(s.later_link(ref))

    assert links("crank.A") == ("frame.frame", "crank.crank")
    assert links("last.B") == ("first.i", "last.i")
    assert links("last.C") == ("last.i", "last.j")
    assert links("last.D") == ("first.j", "last.j")


def test_drivers_on_moving_links_add_their_motion():
    r = robot().run(
        at={"carriage": 0.1, "arm": 0.9, "wrist": -0.4},
        rates={"carriage": 2.0, "arm": 3.0, "wrist": 5.0},
    )
    assert r["arm.crank.omega"][0] == 3.0
    assert r["wrist.crank.omega"][0] == 8.0
    assert r["wrist.crank.angle"][0] == pytest.approx(0.5)
    assert r["carriage.slider.v"][0] == 2.0
    tip = 0.1 + 0.3j + 0.8 * complex(*_direction(0.9)) + 0.3 * complex(*_direction(0.5))
    assert r["wrist.B.p"][0] == pytest.approx(tip, rel=1e-15)
    assert r["wrist.A.slip"][0] == 5.0


def _direction(angle):
    return math.cos(angle), math.sin(angle)


def test_effort_of_a_driver_on_a_moving_link_acts_back_on_that_link():
    g = robot()
    g.add("push", bm.Force(force=(0.0, -10.0)))
    g.connect("wrist.B", "push.at")
    r = g.run(at={"carriage": 0.1, "arm": 0.9, "wrist": -0.4}, friction="none")
    lever = (r["wrist.B.p"] - r["wrist.A.p"])[0].real
    assert r["wrist.drive"][0] == pytest.approx(10.0 * lever, rel=1e-14)
    lever = (r["wrist.B.p"] - r["arm.A.p"])[0].real
    assert r["arm.drive"][0] == pytest.approx(10.0 * lever, rel=1e-14)
    for driver in ("arm", "wrist", "carriage"):
        by_reduction = r[f"{driver}.drive_by_reduction"][0]
        assert r[f"{driver}.drive"][0] == pytest.approx(by_reduction, abs=1e-13)
