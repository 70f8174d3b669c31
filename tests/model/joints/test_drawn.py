"""Joints given where they are in one drawing."""

import cmath
import math

import numpy as np
import pytest

import blockmech as bm

CRANK, ROD, TURN = 0.05, 0.2, 0.7  # [m], [m], [rad] of the whole drawing


def slider_crank(piston: tuple[float, float, float] | None, **guide) -> bm.Linkage:
    """Drawn at dead centre, its guide along a line through the crank's bearing."""
    linkage = bm.Linkage("drawn")
    direction = cmath.rect(1.0, TURN)
    for link in ("crank", "rod"):
        linkage.add_link(link)
    linkage.add_link("piston", pose=piston)
    linkage.add_joint("A", "R", ["frame", "crank"], point=(0.0, 0.0))
    linkage.add_joint("B", "R", ["crank", "rod"], point=CRANK * 1j * direction)
    pin = math.sqrt(ROD**2 - CRANK**2) * direction
    linkage.add_joint("C", "R", ["rod", "piston"], point=pin)
    linkage.add_joint("S", "P", ["frame", "piston"], point=pin, **guide)
    linkage.add_driver("motor", "A")
    return linkage


@pytest.mark.parametrize("piston", [None, (0.1, -0.3, 2.0)])
@pytest.mark.parametrize(
    "guide", [{"angle": TURN}, {"dir": (3 * math.cos(TURN), 3 * math.sin(TURN))}]
)
def test_a_slider_drawn_moves_as_the_closed_form(piston, guide):
    q = np.linspace(0.0, 6.0, 13)
    result = slider_crank(piston, **guide).run(at=q, want="joint.S.coordinate")[
        "joint.S.coordinate"
    ]
    angle = q + math.pi / 2  # of the crank from the guide
    position = CRANK * np.cos(angle) + np.sqrt(ROD**2 - (CRANK * np.sin(angle)) ** 2)
    assert (
        abs(result - (position - math.sqrt(ROD**2 - CRANK**2))).max()
        < 8 * np.finfo(float).eps * ROD
    )


def test_a_slider_along_y_is_exact():
    linkage = slider_crank(None, dir=(0.0, 1.0))
    assert linkage.joints["S"].dir[0].z == linkage.joints["S"].dir[1].z == 1j


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
    linkage = slider_crank(None)
    with pytest.raises(bm.GraphError, match=message):
        linkage.add_joint("T", "P", links, point=(0.0, 0.0), **guide)
    assert "T" not in linkage.joints


def test_parts_are_added_by_their_kind_as_by_an_object():
    by_object, by_kind = bm.Linkage("geared"), bm.Linkage("geared")
    for m in (by_object, by_kind):
        for name, x in (("a", 0.0), ("b", 0.3)):
            m.add_link(name, pose=(x, 0.0, 0.0), inertia=1.0)
            m.add_joint(name, "R", ["frame", name], point=(x, 0.0))
    by_object.add_driver("first", "a", bm.motion.ConstantRate(rate=2.0, start=0.0, end=1.0))
    by_kind.add_driver("first", "a", "constant_rate", rate=2.0, start=0.0, end=1.0)
    by_object.add_driver("second", "b")
    by_kind.add_driver("second", "b")
    pair = {"driver": "first", "driven": "second"}
    law = {"kind": "polynomial", "coefficients": [0.0, -2.0]}
    by_object.add_coupling("mesh", bm.Ratio(law=law, **pair))
    by_kind.add_coupling("mesh", "ratio", law=law, **pair)
    by_object.add_load("brake", bm.TorsionSpring(stiffness=3.0), joint="b")
    by_kind.add_load("brake", "torsion_spring", stiffness=3.0, joint="b")
    by_object.add_signal("pull", bm.signals.Constant(value=2.0))
    by_kind.add_signal("pull", "constant", value=2.0)
    assert by_kind.to_data() == by_object.to_data()
    assert by_kind.run(at=0.5)["driver.second.q"] == by_object.run(at=0.5)["driver.second.q"]
    with pytest.raises(bm.GraphError, match='did you mean "gear"'):
        by_kind.add_coupling("second", "gaer", driver="first")
    g = bm.Graph("blocks")
    g.add("crank", "driver.crank", length=2.0)
    assert g.blocks["crank"] == bm.Crank(length=2.0)
    with pytest.raises(bm.GraphError, match=r"driver\.crank"):
        g.add("other", "driver.crnk", length=2.0)


@pytest.mark.parametrize("position", [{}, {"at": [(0, 0), (0, 0)], "point": (0, 0)}])
def test_a_joint_has_one_place(position):
    m = bm.Linkage()
    m.add_link("crank")
    with pytest.raises(bm.GraphError, match="give at=, a place in the frame of each link, or"):
        m.add_joint("A", "R", ["frame", "crank"], **position)
