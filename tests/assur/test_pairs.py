"""Pairs of one axis: what coincides for good."""

import math

from blockmech.assur.groups import Side, axes
from blockmech.ground.tolerances import EQUAL

FAR = 3.0 * EQUAL  # [m] apart on a mechanism of 1 m


def direction(angle):
    return complex(math.cos(angle), math.sin(angle))


def test_revolute_pairs_at_one_place_of_a_link_turn_about_one_axis():
    sides = [Side("A", "rod", "R", 1 + 1j), Side("B", "rod", "R", 1 + 1j + EQUAL / 2)]
    assert axes(sides, 1.0) == {"A": "A", "B": "A"}


def test_places_that_are_apart_or_on_other_links_do_not_coincide():
    sides = [
        Side("A", "rod", "R", 1 + 1j),
        Side("B", "rod", "R", 1 + 1j + FAR),
        Side("C", "rocker", "R", 1 + 1j),
        Side("D", "rod", "P", 1 + 1j),
    ]
    assert set(axes(sides, 1.0).values()) == {""}


def test_an_axis_goes_on_from_link_to_link():
    sides = [
        Side("A", "rod", "R", 0j),
        Side("B", "rod", "R", 0j),
        Side("B", "rocker", "R", 2j),
        Side("C", "rocker", "R", 2j),
    ]
    assert axes(sides, 1.0) == {"A": "A", "B": "A", "C": "A"}


def test_guides_of_opposite_directions_are_parallel():
    sides = [Side("S", "rod", "P", direction(0.3)), Side("T", "rod", "P", -direction(0.3))]
    assert axes(sides, 1.0) == {"S": "S", "T": "S"}
    sides[1] = Side("T", "rod", "P", direction(0.3 + FAR))
    assert axes(sides, 1.0) == {"S": "", "T": ""}


def test_places_are_judged_by_the_size_of_the_mechanism():
    sides = [Side("A", "rod", "R", 0j), Side("B", "rod", "R", FAR + 0j)]
    assert axes(sides, 1.0) == {"A": "", "B": ""}
    assert axes(sides, 10.0) == {"A": "A", "B": "A"}
