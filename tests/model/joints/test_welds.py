"""Welded links: one rigid link for structure and solution, under names of their own.

What is right is said by a document without welds, whose masses, places and angles are computed
here by hand (parallel axes), and by differences of neighbouring designs.
"""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest

import blockmech as bm

TURN = 0.7  # [rad] of the plate against the rod
OFFSET = 1.2 + 0.3j  # [m] of the plate's origin on the rod
ROD = {"mass": 3.0, "inertia": 0.4, "cm": 1.1 + 0.2j}
PLATE = {"mass": 5.0, "inertia": 0.9, "cm": 0.3 - 0.4j}
ROUNDING = 1e-12  # [-] of the largest value
LAW = bm.motion.ConstantRate(rate=10.0)


def on_rod(z):
    """A position on the plate, on the rod."""
    return OFFSET + z * cmath.exp(1j * TURN)


def on_plate(z):
    """A position on the rod, on the plate."""
    return (z - OFFSET) * cmath.exp(-1j * TURN)


def fourbar(welded, driven="A", names=("rod", "plate")):
    """A four-bar whose pin C is on the plate of its coupler, with a load and a marker there."""
    rod, plate = names
    m = bm.Linkage("fourbar", gravity=(0.0, -9.81))
    m.add_link("crank", pose=(0, 0, 1.0), mass=1.0, inertia=0.1, cm=(0.3, 0))
    m.add_link("rocker", pose=(2.5, 0, 1.9), mass=2.0, inertia=0.2, cm=(1.0, 0))
    m.add_joint("A", "R", ["frame", "crank"], [(0, 0), (0, 0)])
    m.add_joint("B", "R", ["crank", rod], [(1, 0), (0, 0)])
    m.add_joint("D", "R", ["frame", "rocker"], [(2.5, 0), (0, 0)])
    C, P = 2.6 + 0.4j, 0.5 + 0.5j
    if welded:
        m.add_link(rod, pose=(0.5, 0.8, 0.3), **ROD)
        m.add_link(plate, pose=(1.5, 1.4, 1.0), **PLATE, markers={"P": P})
        m.add_joint("W", "weld", [rod, plate], [on_rod(0j), 0j], angle=[TURN, 0.0])
        m.add_joint("C", "R", [plate, "rocker"], [on_plate(C), (2, 0)])
        m.add_load("push", "force", link=plate, at=P, force=(3.0, 40.0), axes="link")
    else:
        total = ROD["mass"] + PLATE["mass"]
        centre = on_rod(PLATE["cm"])
        cm = (ROD["mass"] * ROD["cm"] + PLATE["mass"] * centre) / total
        inertia = ROD["inertia"] + ROD["mass"] * abs(ROD["cm"] - cm) ** 2
        inertia += PLATE["inertia"] + PLATE["mass"] * abs(centre - cm) ** 2
        pose = (0.5, 0.8, 0.3)
        m.add_link(rod, pose=pose, mass=total, inertia=inertia, cm=cm, markers={"P": on_rod(P)})
        m.add_joint("C", "R", [rod, "rocker"], [C, (2, 0)])
        force = (3 + 40j) * cmath.exp(1j * TURN)
        m.add_load("push", "force", link=rod, at=on_rod(P), force=force, axes="link")
    m.add_driver("motor", driven, LAW)
    return m


def agree(a, b):
    assert np.abs(a - b).max() <= ROUNDING * np.abs(b).max()


@pytest.mark.parametrize("names", [("rod", "plate"), ("plate", "rod")])
@pytest.mark.parametrize("general", ["", "groups", "one"])
def test_welded_links_are_one_rigid_link(names, general):
    want = ["driver.motor.drive", "joint.*.reaction", "joint.C.p", "mechanism.kinetic_energy"]
    rod, plate = names
    a, b = (fourbar(x, names=names).decompose(general=general) for x in (True, False))
    welded, merged = (x.compile().run(samples=9) for x in (a, b))
    for name in (*want[:1], *want[2:], "joint.B.reaction", "joint.C.reaction", "joint.D.reaction"):
        agree(welded[name], merged[name])
    agree(welded[f"link.{plate}.P.a"], merged[f"link.{rod}.P.a"])
    agree(welded[f"link.{rod}.p"], merged[f"link.{rod}.p"])
    turn = welded[f"link.{plate}.angle"] - merged[f"link.{rod}.angle"]
    assert np.abs(np.exp(1j * (turn - TURN)) - 1).max() <= ROUNDING
    origin = merged[f"link.{rod}.p"] + OFFSET * np.exp(1j * merged[f"link.{rod}.angle"])
    agree(welded[f"link.{plate}.p"], origin)
    assert a.compile().verify(samples=9).ok


@pytest.mark.parametrize("joint", ["B", "C"])
def test_coordinate_of_a_driver_counts_from_the_axes_of_the_welded_link(joint):
    plate_first = joint == "C"  # C joins the plate, B the rod that carries it or is carried
    for names in (("rod", "plate"), ("plate", "rod")):
        pose = fourbar(True, names=names).compile().run(at=[1.0])
        coordinate = float(pose[f"joint.{joint}.coordinate"][0])
        m = fourbar(True, driven=joint, names=names)
        run = m.compile().run(at=[coordinate], rates=1.0)
        assert abs(run["joint.C.p"][0] - pose["joint.C.p"][0]) <= 1e-9
        first, second = m.joints[joint].links
        angle = run[f"link.{second}.angle"][0] - run[f"link.{first}.angle"][0]
        assert math.remainder(angle - coordinate, math.tau) == pytest.approx(0.0, abs=1e-12)
        assert m.compile().verify(at=[coordinate], rates=1.0).ok
        assert plate_first == (names[1] in (first, second))


def test_links_welded_to_the_frame_stand_still():
    m = bm.Linkage("bracket")
    m.add_link("bracket", pose=(1.0, 0.0, math.pi / 2), mass=7.0, markers={"top": (2.0, 0.0)})
    m.add_link("arm", pose=(1.0, 0.5, 0.0), mass=1.0, cm=(1.0, 0.0))
    m.add_joint("foot", "weld", ["frame", "bracket"], point=(1.0, 0.0))
    m.add_joint("A", "R", ["bracket", "arm"], [(0.5, 0.0), (0.0, 0.0)])
    m.add_driver("motor", "A", LAW)
    run = m.compile().run(at=[0.0], want=["link.arm.p", "link.arm.angle", "link.bracket.top.p"])
    assert run["link.arm.p"][0] == pytest.approx(1.0 + 0.5j, abs=1e-15)
    assert run["link.arm.angle"][0] == pytest.approx(math.pi / 2, abs=1e-15)
    assert run["link.bracket.top.p"][0] == pytest.approx(1.0 + 2.0j, abs=1e-15)


def test_a_frame_of_three_bars_is_drawn_as_one_link():
    """Three bars welded in the world: the arm carries its load at the end of the last one."""
    m = bm.Linkage("hook", gravity=(0.0, -10.0))
    for name in ("upright", "beam", "tip"):
        m.add_link(name)
    m.add_joint("O", "R", ["frame", "upright"], point=(0.0, 0.0))
    m.add_joint("V", "weld", ["upright", "beam", "tip"], point=(0.0, 2.0))
    m.add_load("weight", "force", link="tip", at=(3.0, 1.5), force=(0.0, -20.0))
    m.add_driver("motor", "O", bm.motion.ConstantRate(rate=0.0, start=0.0, end=0.0))
    mechanism = m.compile()
    assert mechanism.run(want="driver.motor.drive")["driver.motor.drive"] == [60.0]
    assert len(mechanism.structure.links) == 2  # the frame, and the three bars as one
    again = bm.Linkage.from_json(m.to_json())
    assert again.to_json() == m.to_json()
    assert m.draw().axes


@pytest.mark.parametrize("path", ["links.plate.mass", "joints.W.at[0].x", "links.plate.cm.y"])
def test_derivatives_pass_the_weld(path):
    mechanism = fourbar(True).compile()
    want = "max_abs(driver.motor.drive)"
    exact = mechanism.sensitivity(want, path, at=[1.0]).ahead[want]
    start, step = mechanism.parameters()[path].value, 1e-6
    high, low = mechanism.study({path: [start + step, start - step]}, want=want, at=[1.0])[want]
    assert float(np.squeeze(exact)) == pytest.approx((high - low) / (2 * step), rel=1e-6)


def test_welded_links_without_mass_have_derivatives_but_by_their_masses():
    data = fourbar(True).to_data()
    for link in ("rod", "plate"):
        data["links"][link] |= {"mass": 0.0, "inertia": 0.0}
    linkage, drive = bm.Linkage.from_data(data), "driver.motor.drive"
    mechanism = linkage.compile()
    parameters = mechanism.sensitivity(drive, at=[1.0]).parameters
    assert "links.plate.cm.y" in parameters
    assert "links.plate.mass" not in parameters
    with pytest.raises(bm.RequestError, match="have no centre of mass: give one of them mass"):
        mechanism.sensitivity(drive, "links.plate.mass", at=[1.0])
    study = mechanism.study({"links.plate.mass": [5.0]}, want=f"max({drive})", at=[1.0])
    heavy = linkage.replace({"links.plate.mass": 5.0}).compile().run(at=[1.0], want=drive)
    assert study[f"max({drive})"][0] == pytest.approx(heavy[drive][0], rel=1e-12)


@pytest.mark.parametrize(
    ("add", "because"),
    [
        (lambda m: m.add_joint("X", "R", ["rod", "plate"], [0j, 0j]), "X joins rod and plate"),
        (lambda m: m.add_joint("X", "weld", ["rod", "plate"], [0j, 0j]), "X joins plate and rod"),
        (lambda m: m.add_driver("second", "W", LAW), "W is a weld, in which nothing moves"),
        (
            lambda m: m.add_load("m", "motor", joint="B", law=lambda coordinate: coordinate),
            "reads the angle of rod, which is welded to",
        ),
    ],
)
def test_what_a_weld_cannot_do_is_refused(add, because):
    m = fourbar(True, names=("rod", "plate"))
    add(m)
    with pytest.raises(bm.GraphError, match=because):
        m.compile()
