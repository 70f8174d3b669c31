"""Machines drawn as a person draws them, counted; each file equals one made in Python."""

import math

import networkx as nx
import pytest

import blockmech as bm
from tests.studio.page import drawing, save

TURNS = bm.ConstantRate(rate=1.0)


def structure(linkage):
    """Links, joints, drivers, couplings and loads of a linkage without their places and names."""
    data, g = linkage.to_data(), nx.DiGraph()
    law_of = {d["joint"]: d.get("law", "none") for d in data.get("drivers", {}).values()}
    for name, joint in data["joints"].items():
        g.add_node(("joint", name), kind=joint["type"], law=law_of.get(name))
        for link in joint["links"]:
            g.add_node(("link", link), kind="frame" if link == "frame" else "link")
            g.add_edge(("joint", name), ("link", link))
    for name, coupling in data.get("couplings", {}).items():
        g.add_node(("coupling", name), kind=coupling["type"])
        for role in ("driver", "driven"):
            joint = data["drivers"][coupling[role]]["joint"]
            g.add_edge(("coupling", name), ("joint", joint), role=role)
    for name, load in data.get("loads", {}).items():
        g.add_node(("load", name), kind=load["type"])
        g.add_edge(("load", name), ("link", load["link"]))
    return g


def alike(one, other):
    return nx.is_isomorphic(
        structure(one),
        structure(other),
        node_match=lambda a, b: a == b,
        edge_match=lambda a, b: a == b,
    )


def linkage(pins, guides=()):
    """A linkage of pins (their links) and guides (their two links); what it drives is added."""
    made = bm.Linkage("python")
    used = {x for ends in (*pins, *guides) for x in ends.split()} - {"frame"}
    for name in sorted(used):
        made.add_link(name)
    for k, ends in enumerate(pins):
        made.add_pin(f"p{k}", ends.split(), k + 1j * k * k)
    for k, ends in enumerate(guides):
        at = [0.0, 0.0], [0.0, 0.0]
        made.add_joint(f"g{k}", "P", ends.split(), at, angle=[0.0, 0.0])
    return made


def on_the_frame(hand, *pins):
    """Choose pins and put them on the frame."""
    hand.click(pins[0])
    for pin in pins[1:]:
        hand.click(pin, modifiers=["Control"])
    hand.press("To the frame", f"To the frame: {', '.join(pins)}.")


def watt(hand):
    """A four-bar, and a dyad between its coupler and its rocker."""
    hand.link(hand.at(0.2, 0.7), hand.at(0.3, 0.45), "B")
    hand.link(hand.pin("B"), hand.at(0.6, 0.3), "C")
    hand.link(hand.pin("C"), hand.at(0.7, 0.7), "D")
    hand.press("Link", "Link: drag from pin to pin")
    b, c, d = map(hand.pin, "BCD")
    hand.link(hand.at(0.6, 0.1), ((b[0] + c[0]) / 2, (b[1] + c[1]) / 2), "F")
    hand.link(hand.pin("E"), ((c[0] + d[0]) / 2, (c[1] + d[1]) / 2), "G")
    hand.key("Escape")
    on_the_frame(hand, "A", "D")
    hand.click("A")
    hand.press("Driver", "RRR")
    made = linkage(["frame a", "a b", "b c", "c frame", "b d", "d e", "e c"])
    made.add_driver("motor", "p0", TURNS)
    return made, 14


def quick_return(hand):
    """A crank, and a rocker in whose slot its pin slides."""
    hand.link(hand.at(0.5, 0.4), hand.at(0.6, 0.25), "B")
    hand.press("Link", "Link: drag from pin to pin")
    hand.link(hand.at(0.4, 0.8), hand.at(0.75, 0.1), "D")
    hand.key("Escape")
    on_the_frame(hand, "A", "C")
    hand.acts += 1
    hand.page.get_by_label("Slides on").select_option("link1")
    hand.click("B")
    hand.press("Slider", "Slider: B.")
    hand.click("A")
    hand.press("Driver", "RPR")
    made = linkage(["frame a", "frame b", "a c"], ["b c"])
    made.add_driver("motor", "p0", TURNS)
    return made, 12


def bucket(hand):
    """A bucket on an arm that stands: rocker and link, moved by a cylinder."""
    hand.link(hand.at(0.3, 0.75), hand.at(0.6, 0.65), "B")
    hand.link(hand.pin("B"), hand.at(0.55, 0.35), "C")
    hand.link(hand.pin("C"), hand.at(0.25, 0.5), "D")
    hand.press("Cylinder", "Cylinder: drag")
    hand.link(hand.at(0.1, 0.15), hand.pin("C"), "E")
    hand.key("Escape")
    on_the_frame(hand, "A", "D", "E")
    made = linkage(["frame a", "a b", "b c d", "c frame", "frame e"], ["e d"])
    made.add_driver("motor", "g0")
    return made, 10


def valve(hand):
    """A cam whose roller lifts a valve."""
    hand.link(hand.at(0.5, 0.8), hand.at(0.65, 0.8), "B")
    hand.press("Link", "Link: drag from pin to pin")
    hand.link(hand.at(0.5, 0.45), hand.at(0.5, 0.15), "D")
    hand.key("Escape")
    on_the_frame(hand, "A", "C")
    hand.acts += 1
    hand.page.get_by_label("along [°]").fill("90")
    hand.page.keyboard.press("Tab")
    hand.click("C")
    hand.press("Slider", "Slider: C.")
    hand.click("A")
    hand.click("C", modifiers=["Control"])
    hand.press("Cam", "Cam: A, C.")
    made = linkage(["frame a"], ["frame b"])
    made.add_driver("motor", "p0", TURNS)
    made.add_driver("valve", "g0")
    up = {"motion": "4-5-6-7", "over": math.pi, "rise": 0.1}
    law = {"kind": "segments", "segments": [up, {**up, "rise": -0.1}]}
    cam = bm.Cam(driver="motor", driven="valve", law=law, follower="roller", roller=0.1)
    made.add_coupling("lift", cam)
    return made, 14


def gears(hand):
    """Two wheels that mesh."""
    hand.link(hand.at(0.3, 0.5), hand.at(0.35, 0.3), "B")
    hand.press("Link", "Link: drag from pin to pin")
    hand.link(hand.at(0.7, 0.5), hand.at(0.75, 0.3), "D")
    hand.key("Escape")
    on_the_frame(hand, "A", "C")
    hand.press("Gears", "Gears: A, C.")
    made = linkage(["frame a", "frame b"])
    made.add_driver("motor", "p0", TURNS)
    made.add_driver("second", "p1")
    made.add_coupling("mesh", bm.Gear(driver="motor", driven="second", teeth=(20, 20)))
    return made, 9


@pytest.mark.parametrize(
    "draw", [watt, quick_return, bucket, valve, gears], ids=lambda f: f.__name__
)
def test_a_machine_is_drawn_by_hand(page, studio, draw):
    hand = drawing(page, studio)
    made, most = draw(hand)
    print(f"{draw.__name__}: {hand.acts} actions")
    assert hand.acts <= most
    save(page, f"{draw.__name__}.json")
    drawn = bm.Linkage.load(studio[1] / f"{draw.__name__}.json")
    assert drawn.check() == []
    assert alike(drawn, made)
