"""Eight machines drawn by hand: how many acts each takes, and where its pins landed.

An act is a drag, a click, a pressed tool or a typed word. Positions [m] are those at which the
hand aimed, on crossings of the grid; the document is compiled, and run at the drawn pose.
"""

import pytest

pytest.importorskip("playwright.sync_api", reason="it is no browser's driver")

import blockmech as bm
from blockmech.editor.drawing import coordinate
from blockmech.model.joints.layout import Layout
from tests.studio.page import Sheet


def four_bar(hand, links):
    """Links A-B, B-C, C-D, of which A is driven and D stands on the frame."""
    chain(hand, *links)
    hand.take("To the frame", "D")
    hand.take("Driver", "A")


def chain(hand, first, *rest):
    hand.link(hand.to(*first), hand.to(*rest[0]))
    for name, end in zip("BCEFGH", rest[1:], strict=False):
        hand.link(hand.pin(name), hand.to(*end))


def draw_four_bar(hand):
    four_bar(hand, [(0, 0), (0.03, 0.05), (0.15, 0.09), (0.18, 0)])
    return {"A": 0, "B": 0.03 + 0.05j, "C": 0.15 + 0.09j, "D": 0.18}


def draw_slider_crank(hand):
    """Aimed three pixels beside the line of the crank's pin: the offset is 0."""
    chain(hand, (0, 0), (0.03, 0.05))
    x, y = hand.to(0.2, 0)
    hand.link(hand.pin("B"), (x, y + 3))
    hand.take("Slider", "C")
    hand.take("Driver", "A")
    return {"A": 0, "B": 0.03 + 0.05j, "C": 0.2}


def draw_watt(hand):
    chain(hand, (0, 0), (0.02, 0.06), (0.14, 0.12), (0.18, 0))
    hand.link(hand.to(0.08, 0.09), hand.to(0.1, 0.2))
    hand.link(hand.pin("F"), hand.to(0.16, 0.06))
    hand.take("To the frame", "D")
    hand.take("Driver", "A")
    return {
        "A": 0, "B": 0.02 + 0.06j, "C": 0.14 + 0.12j, "D": 0.18,
        "E": 0.08 + 0.09j, "F": 0.1 + 0.2j, "G": 0.16 + 0.06j,
    }  # fmt: skip


def draw_quick_return(hand):
    """The crank's pin slides on the lever below it; the ram slides on the frame."""
    chain(hand, (0.1, 0.1), (0.15, 0.15))
    hand.link(hand.to(0.1, 0), hand.to(0.17, 0.21))
    hand.link(hand.pin("D"), hand.to(0.3, 0.21))
    hand.take("Slider", "B", "E")
    hand.take("To the frame", "C")
    hand.take("Driver", "A")
    return {"A": 0.1 + 0.1j, "B": 0.15 + 0.15j, "C": 0.1, "D": 0.17 + 0.21j, "E": 0.3 + 0.21j}


def draw_bucket(hand):
    chain(hand, (0.2, 0), (0.22, 0.08), (0.32, 0.08), (0.34, 0))
    hand.take("To the frame", "A", "D")
    hand.tool("Cylinder")
    hand.link(hand.to(0.04, 0.1), hand.pin("B"))
    return {"A": 0.2, "B": 0.22 + 0.08j, "C": 0.32 + 0.08j, "D": 0.34, "E": 0.04 + 0.1j}


def draw_cam(hand):
    chain(hand, (0, 0), (0.06, 0))
    hand.link(hand.to(0, 0.1), hand.to(0, 0.2))
    hand.take("To the frame", "C")
    hand.acts += 1
    hand.field("along [deg]").fill("90")
    hand.take("Slider", "C")
    hand.tool("Cam")
    hand.link(hand.pin("A"), hand.pin("C"))
    return {"A": 0, "B": 0.06, "C": 0.1j, "D": 0.2j}


def draw_gears(hand):
    chain(hand, (0, 0), (0.06, 0.04))
    hand.link(hand.to(0.1, 0), hand.to(0.16, 0.04))
    hand.tool("Gears")
    hand.link(hand.pin("A"), hand.pin("C"))
    return {"A": 0, "B": 0.06 + 0.04j, "C": 0.1, "D": 0.16 + 0.04j}


def draw_stephenson(hand):
    chain(hand, (0, 0), (0.02, 0.06), (0.14, 0.12), (0.18, 0))
    hand.link(hand.to(0.08, 0.09), hand.to(0.04, 0.2))
    hand.link(hand.pin("F"), hand.to(-0.1, 0.14))
    hand.take("To the frame", "D", "G")
    hand.take("Driver", "A")
    return {
        "A": 0, "B": 0.02 + 0.06j, "C": 0.14 + 0.12j, "D": 0.18,
        "E": 0.08 + 0.09j, "F": 0.04 + 0.2j, "G": -0.1 + 0.14j,
    }  # fmt: skip


MACHINES = {
    "four-bar": (draw_four_bar, 9, "RRR"),
    "slider-crank": (draw_slider_crank, 7, "RRP"),
    "Watt": (draw_watt, 11, "RRR"),
    "quick return": (draw_quick_return, 10, "RPR"),
    "bucket with cylinder": (draw_bucket, 9, "cylinder"),
    "cam and valve": (draw_cam, 11, ""),
    "gears": (draw_gears, 7, ""),
    "Stephenson III": (draw_stephenson, 12, "RRR"),
}


@pytest.mark.parametrize("name", MACHINES)
def test_a_machine_drawn_by_hand_stands_where_it_was_aimed(page, studio, name):
    draw, limit, group = MACHINES[name]
    hand = Sheet(page, studio, {"new": "joints"})
    aimed = draw(hand)
    print(f"{name}: {hand.acts} acts")
    assert hand.acts <= limit
    pins = hand.places()
    assert {pin: pins[pin] for pin in aimed} == aimed
    linkage = bm.Linkage.from_data(hand.form())
    assert linkage.check() == []
    mechanism = linkage.compile()
    assert group in str(linkage.decompose().formation)
    layout = Layout.of(linkage)
    at = {
        driver: [coordinate(layout.given, layout.pairs[pair])]
        for pair, driver in layout.drivers.items()
        if driver in mechanism.drivers
    }
    outputs = [f"joint.{pin}.p" for pin in aimed if f"joint.{pin}.p" in mechanism.outputs]
    result = mechanism.run(at=at, rates=dict.fromkeys(at, 0.0), want=outputs, friction="none")
    for output in outputs:
        assert result[output][0] == pytest.approx(aimed[output.split(".")[1]], abs=1e-12)
