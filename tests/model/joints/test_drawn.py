"""Joints given where they are in one drawing."""

import cmath
import math

import numpy as np
import pytest

import blockmech as bm

CRANK, ROD, TURN = 0.05, 0.2, 0.7  # [m], [m], [rad] of the whole drawing


def slider_crank(piston: tuple[float, float, float] | None, **guide) -> bm.Linkage:
    """Drawn at dead centre, its guide along a line through the crank's bearing."""
    drawn = bm.Linkage("drawn")
    along = cmath.rect(1.0, TURN)
    for link in ("crank", "rod"):
        drawn.add_link(link)
    drawn.add_link("piston", pose=piston)
    drawn.add_pin("A", ["frame", "crank"], (0.0, 0.0))
    drawn.add_pin("B", ["crank", "rod"], CRANK * 1j * along)
    pin = math.sqrt(ROD**2 - CRANK**2) * along
    drawn.add_pin("C", ["rod", "piston"], pin)
    drawn.add_slider("S", ["frame", "piston"], pin, **guide)
    drawn.add_driver("motor", "A")
    return drawn


@pytest.mark.parametrize("piston", [None, (0.1, -0.3, 2.0)])
@pytest.mark.parametrize(
    "guide", [{"angle": TURN}, {"dir": (3 * math.cos(TURN), 3 * math.sin(TURN))}]
)
def test_a_slider_drawn_moves_as_the_closed_form(piston, guide):
    q = np.linspace(0.0, 6.0, 13)
    found = slider_crank(piston, **guide).run(at=q, want="joint.S.coordinate")["joint.S.coordinate"]
    angle = q + math.pi / 2  # of the crank from the guide
    place = CRANK * np.cos(angle) + np.sqrt(ROD**2 - (CRANK * np.sin(angle)) ** 2)
    assert abs(found - (place - math.sqrt(ROD**2 - CRANK**2))).max() < 8 * np.finfo(float).eps * ROD


def test_a_slider_along_y_is_exact():
    drawn = slider_crank(None, dir=(0.0, 1.0))
    assert drawn.joints["S"].dir[0].z == drawn.joints["S"].dir[1].z == 1j


@pytest.mark.parametrize(
    ("links", "guide", "message"),
    [
        (["frame", "pistom"], {}, r'joints\.T\.links: no link "pistom".* did you mean "piston"'),
        (["frame", "frame"], {}, r"joints\.T: a joint is between different links"),
        (["frame", "piston"], {"angle": 1.0, "dir": (0, 1)}, "direction is given twice"),
        (["frame", "piston"], {"dir": (0, 0)}, r"must not be \[0, 0\]"),
    ],
)
def test_what_does_not_fit_is_one_message_and_adds_nothing(links, guide, message):
    drawn = slider_crank(None)
    with pytest.raises(bm.GraphError, match=message):
        drawn.add_slider("T", links, (0.0, 0.0), **guide)
    assert "T" not in drawn.joints
