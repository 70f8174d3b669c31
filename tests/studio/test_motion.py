"""The motion that is shown: the part that moves, gaps, dead centres, drags of blocks, answers."""

import copy
from pathlib import Path

import numpy as np
import pytest

import blockmech as bm
from blockmech.builders import opened
from blockmech.draw.sketch import sketch_of
from blockmech.editor.analyses import analysis
from blockmech.editor.curves import curves, simulation, wire_text
from blockmech.editor.dragging import dragged, handles_of
from blockmech.editor.drawing import state_of
from blockmech.editor.revision import Question, Revision, blamed_blocks, what_moves
from blockmech.editor.turn import dead_centres, fault_of, travel, turn
from blockmech.ground.errors import BlockmechError
from blockmech.result.wires import wires_of
from tests.studio.hand import Hand

GRAPHS = Path(__file__).parents[2] / "graphs"


def form_of(name="ruiz_fourbar", **lengths):
    form = opened(GRAPHS / f"{name}.json").to_data()
    if lengths:
        form["blocks"]["dyad"] |= lengths
    return form


def now_of(form):
    document = bm.Graph.from_data(form) if "blocks" in form else bm.Linkage.from_data(form)
    return Revision(1, document.to_data(), document)


def state(form):
    now = now_of(form)
    return state_of(Question(now, {}))


def test_a_gap_has_its_sentence():
    ask = Question(now_of(form_of(l_i=3.2)), {})
    assert state_of(ask)["motion"]["gaps"] == [[101, 259]]
    sentence = fault_of(ask.motion)
    assert "too large" in sentence
    assert "(sample 101 of 361)" in sentence
    assert "159 of 361 samples" in sentence


@pytest.mark.parametrize("gone", ["wire", "closing"])
def test_the_part_that_closes_is_drawn(gone):
    form = form_of(l_i=30.0) if gone == "closing" else form_of()
    if gone == "wire":
        form["wires"] = [w for w in form["wires"] if w["to"] != "dyad.B"]
    data = state(form)
    assert [link["name"] for link in data["drawing"]["links"]] == ["crank.crank"]
    assert ("never closes" if gone == "closing" else "nothing is wired to it") in data["said"]


def test_what_hangs_on_a_failing_block_goes_with_it():
    form = form_of("watt_sixbar")
    first = next(name for name, block in form["blocks"].items() if block["type"] == "dyad.rrr")
    assert what_moves(form, {first}).structure.formula == "I(crank: 0,1)"
    assert blamed_blocks(form, [bm.Problem("x", f"blocks.{first}.l_i", "")]) == {first}


def test_dead_centres_are_those_of_limits():
    """A rocker as the driver: its arc ends where coupler and follower are in line."""
    mechanism = now_of(form_of(l_i=3.2)).mechanism
    motion, found = turn(mechanism), mechanism.limits()
    q = motion.q["crank"]
    ends = {end.q % (2 * np.pi): str(end) for arc in found.arcs for end in (arc.start, arc.end)}
    passed = dead_centres(motion)
    assert len(passed) == len(ends) == 2
    for place, name in passed:
        at = np.interp(place, np.arange(len(q)), q)
        (near,) = (x for x in ends if abs(x - at) < 1e-9)
        assert ends[near] == name


def test_a_driver_without_a_law_moves_over_its_arc():
    form = form_of(l_i=3.2)
    del form["scene"]["drive"]
    mechanism = now_of(form).mechanism
    (arc,) = mechanism.limits().arcs
    assert travel(mechanism, "crank", {"crank": 0.0}) == (arc.start.q, arc.end.q)
    assert Question(now_of(form), {}).motion.feasible[1:-1].all()


@pytest.mark.parametrize("name", ["ruiz_fourbar", "watt_sixbar"])
@pytest.mark.parametrize("k", [0, 4])
def test_a_dragged_joint_moves_alone(name, k):
    """The other joints stand where they stood, in the pose in which it was dragged."""
    now = now_of(form_of(name))
    motion = turn(now.mechanism)
    motion = motion.only(np.arange(0, len(motion.samples), 40))
    handles = handles_of(motion, sketch_of(motion))
    assert len(handles) >= 4
    before = places(now.mechanism, motion, k)
    for spot in handles.values():
        old = complex(motion.at(*spot)[k])
        new = old + 0.05 + 0.03j
        mechanism = bm.Graph.from_data(dragged(now.form, motion, k, old, new).form).compile()
        after = places(mechanism, motion, k, angle_of_crank(mechanism, old, new, motion, k))
        for joint, z in before.items():
            near = new if abs(z - old) < 1e-9 else z
            assert abs(after[joint] - near) < 1e-9, joint


def places(mechanism, motion, k, q=None):
    """Places of all revolute joints of a pose."""
    driver = mechanism.drivers[0]
    q = float(motion.q[driver][k]) if q is None else q
    joints = {
        str(ref): marker
        for ref, marker in mechanism.structure.feeds.items()
        if mechanism.structure.joint(ref).kind == "R"
    }
    inner = {f"{n}.C" for n, b in mechanism.structure.blocks.items() if "C" in b.joints}
    want = {*map(str, joints.values()), *inner}
    result = mechanism._of_blocks.run(
        at={driver: q}, rates={driver: 0.0}, want=[f"{n}.p" for n in want], friction="none"
    )
    return {name: complex(result[f"{name}.p"][0]) for name in want}


def angle_of_crank(mechanism, old, new, motion, k):
    """The crank's angle after a joint was dragged: its pin may have moved."""
    driver = mechanism.drivers[0]
    q = float(motion.q[driver][k])
    ref = next(
        r for r in motion.structure.links if r.block == mechanism.structure.driven[driver].block
    )
    A = complex(motion.origin[ref][k])
    B = complex(motion.at(ref, motion.structure.blocks[ref.block].length)[k])
    A2, B2 = (new if abs(z - old) < 1e-9 else z for z in (A, B))
    return q + float(np.angle((B2 - A2) / (B - A)))


def test_what_cannot_be_dragged_says_why():
    hand = Hand(opened(GRAPHS / "elliptic_trammel.json"))
    shown = state_of(Question(hand.sheet.now, {}))
    refused = set()
    for pin in shown["drawing"]["pins"]:
        hand.do("drag", name=pin["name"], to=[1.0, 1.0], q=shown["motion"]["home"])
        refused |= {hand.said} if "cannot be dragged" in hand.said else set()
    assert all("change its block's form" in said for said in refused)


# -- answers -----------------------------------------------------------------------------------


def ask(name, **data):
    document = opened(GRAPHS / f"{name}.json")
    return Question(Revision(1, document.to_data(), document), data)


@pytest.mark.parametrize("name", ["ruiz_fourbar", "engine"])
def test_wires_say_what_travels(name):
    question = ask(name, pose=30)
    for wire in wires_of(question.motion.structure):
        text = wire_text(question, str(wire))
        assert text.startswith("→ p = ("), wire
        assert "\n← F = (" in text
    assert wire_text(question, "a.B -> c.D") == ""


def test_an_accuracy_chooses_the_method():
    answer = curves(ask("excavator", names=["boom.drive"], accuracy=1e-9))
    assert "1e-09" in answer["said"]


@pytest.mark.parametrize("name", ["Limits", "Modes", "Equilibria", "Extremes", "Verify", "Cost"])
def test_analyses_say_what_the_package_says(name):
    falls = name == "Equilibria"
    file, output = ("fivebar_falling", "left.drive") if falls else ("ruiz_fourbar", "crank.drive")
    question = ask(file, names=[output])
    reply = analysis(question, name)
    mechanism = question.mechanism
    if name == "Modes":
        assert reply["text"] == str(mechanism.modes())
    if name == "Extremes":
        assert reply["text"] == str(mechanism.extremes("crank.drive", friction="newton"))
    assert reply["text"]


def test_a_tolerance_is_that_of_the_lengths_by_the_chosen_share():
    question = ask("slider_crank", names=["crank.drive"], share=1.0)
    mechanism = question.mechanism
    lengths = {
        p.address: bm.dist.Normal(p.value, 0.01 * abs(p.value))
        for p in mechanism.parameters().values()
        if p.unit == "m" and p.value
    }
    tolerance = mechanism.tolerance(lengths, "crank.drive", samples=361)
    assert analysis(question, "Tolerance")["text"] == str(tolerance)


def test_a_family_has_the_curves_of_five_designs():
    reply = analysis(ask("ruiz_fourbar", names=["crank.drive"], number="dyad.l_i"), "Family")
    assert reply["text"] == "crank.drive for 5 values of dyad.l_i"
    assert reply["picture"].startswith("<?xml")


def test_a_simulation_is_played_in_time():
    motion, answer = simulation(ask("fivebar_falling", until="time=0.3"))
    assert answer["motion"]["time"][-1] == pytest.approx(0.3)
    assert answer["motion"]["forward"]
    assert motion.result.motion is not None
    assert answer["curves"]["along"]["words"] == "time [s]"


@pytest.mark.parametrize("until", ["lunch", "time=-1"])
def test_what_cannot_be_is_a_sentence(until):
    with pytest.raises(BlockmechError):
        simulation(ask("fivebar_falling", until=until))


def test_masses_are_given_to_all_links_or_it_says_which_have_none():
    hand = Hand(bm.Linkage("drawn"))
    hand.add(0j, 0.1 + 0j, 0.4 + 0j)
    hand.act("Link", "A", "B")
    hand.act("Link", "B", "C")
    hand.act("To the frame", "A")
    hand.act("Slider", "C")
    hand.act("Driver", "A")
    hand.do("Masses", pins=[])
    assert hand.sheet.undoable == "Masses; without length: slider"
    assert all(hand.form["links"][link]["mass"] > 0 for link in ("link", "link_2"))


def test_without_a_link_its_neighbours_keep_their_ends():
    hand = Hand(opened(GRAPHS / "joints" / "ruiz_fourbar.json"))
    before = copy.deepcopy(hand.form)
    hand.do("remove", part=["links", "coupler"])
    assert {*hand.form["links"]} == {*before["links"]} - {"coupler"}
    assert {name for name, pin in hand.drawn.items() if pin.links} == {*"ABCD"}
    hand.do("remove", part=["links", "frame"])
    assert "the frame" in hand.said


def test_a_spring_from_a_free_place_is_held_by_the_frame():
    hand = Hand(opened(GRAPHS / "joints" / "ruiz_fourbar.json"))
    hand.do("draw", tool="Spring", **{"from": {"at": [3.0, 4.0]}, "to": {"pin": "C"}})
    (spring,) = (x for x in hand.form["loads"].values() if x["type"] == "spring")
    assert "frame" in spring["links"]
    assert hand.problems == ()
