"""Mass properties of shapes beside closed forms and one another."""

from __future__ import annotations

import math

import numpy as np
import pytest

import blockmech as bm

shapes = bm.design.shapes


def test_a_polygon_is_the_plate_that_it_outlines():
    corners = [(0.0, 0.0), (0.4, 0.0), (0.4, 0.1), (0.0, 0.1)]
    for outline in (corners, corners[::-1]):
        a = shapes.polygon(outline, thickness=0.01, density=2700.0)
        b = shapes.plate(0.4, 0.1, mass=2700.0 * 0.4 * 0.1 * 0.01).at(0.2, 0.05)
        assert (a.mass, a.inertia) == pytest.approx((b.mass, b.inertia), rel=1e-14)
        assert a.cm == pytest.approx(b.cm, rel=1e-14)


def test_a_polygon_of_many_corners_is_a_disc_also_far_from_the_origin():
    n, r = 2000, 0.1
    turn = 2 * math.pi * np.arange(n) / n
    outline = [(1e3 + r * math.cos(x), -2e3 + r * math.sin(x)) for x in turn]
    a = shapes.polygon(outline, mass=2.0)
    # the inertia of a regular polygon: m r^2 (2 + cos(2 pi / n)) / 6
    assert a.inertia == pytest.approx(2.0 * r**2 * (2 + math.cos(2 * math.pi / n)) / 6, rel=1e-8)
    assert a.cm == pytest.approx((1e3, -2e3), rel=1e-12)


def test_holes_are_taken_away():
    ring = shapes.disc(0.1, 0.04, thickness=0.02)
    bored = shapes.disc(0.1, thickness=0.02) - shapes.disc(0.04, thickness=0.02)
    assert (bored.mass, bored.inertia) == pytest.approx((ring.mass, ring.inertia), rel=1e-14)


def test_bodies_add_up_about_their_common_centre():
    dumbbell = shapes.point(1.0) + shapes.point(3.0, at=(0.4, 0.0))
    assert dumbbell.cm == pytest.approx((0.3, 0.0))
    assert dumbbell.inertia == pytest.approx(1.0 * 0.3**2 + 3.0 * 0.1**2)
    turned = shapes.bar(0.4, mass=1.0).at(0.1, 0.2, math.pi / 2)
    assert turned.cm == pytest.approx((0.1, 0.4))


def test_links_take_them():
    rod = bm.Link(**shapes.bar(0.4, 0.03, thickness=0.01), markers={"E": (0.2, 0.0)})
    assert rod.mass == pytest.approx(7850.0 * 0.4 * 0.03 * 0.01)
    linkage = bm.Linkage("pendulum")
    linkage.add_link("rod", **shapes.bar(0.4, mass=1.2))
    assert linkage.to_data()["links"]["rod"]["inertia"] == pytest.approx(1.2 * 0.4**2 / 12)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: shapes.bar(0.4), "mass=, or thickness="),
        (lambda: shapes.bar(0.4, thickness=0.01), "area: must be > 0"),
        (lambda: shapes.bar(-1.0, mass=1.0), "length: must be > 0, got -1.0"),
        (lambda: shapes.disc(0.1, 0.2, mass=1.0), "wall: must be > 0"),
        (lambda: shapes.polygon([(0, 0), (1, 1), (2, 2)], mass=1.0), "no area"),
        (lambda: shapes.polygon([(0, 0), (1, 1)], mass=1.0), "2 corners"),
        (lambda: shapes.point(1.0) - shapes.point(2.0), "leave no mass"),
    ],
)
def test_what_is_no_shape_is_refused(make, message):
    with pytest.raises(bm.RequestError, match=message):
        make()


def test_sizes_are_texts_with_units_as_well_and_links_take_a_shape():
    rod = shapes.bar("400 mm", "2 cm", mass="1200 g")
    assert rod.inertia == pytest.approx(shapes.bar(0.4, 0.02, mass=1.2).inertia, rel=1e-15)
    thick = shapes.disc("5 cm", thickness="10 mm", density="2.7 g/cm3")
    assert thick.mass == pytest.approx(shapes.disc(0.05, thickness=0.01, density=2700.0).mass)
    linkage = bm.Linkage("arm")
    linkage.add_link("arm", rod, pose=(0.0, 0.0, 0.0))
    assert (linkage.links["arm"].mass, linkage.links["arm"].cm.z) == (1.2, 0.2)
    with pytest.raises(bm.RequestError, match="length: must be > 0, got '4 kg'"):
        shapes.bar("4 kg", mass=1.0)
