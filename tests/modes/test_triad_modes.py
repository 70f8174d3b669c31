"""All assembly modes of a triad: their number, their poses, their doubtful cases.

The number is held against an exact count (`tests.modes.exact`): another unknown, another
eliminant, rational arithmetic and Sturm's theorem.
"""

import itertools
import math

import numpy as np
import pytest

from blockmech.ground.errors import RequestError
from blockmech.modes.closing import triad_modes
from blockmech.modes.triad import Triad, eliminant, placed
from blockmech.typing import Guide
from tests.modes import chance
from tests.modes.exact import count_exactly

EPS = 2.0**-52
ROUNDING = 64 * EPS  # of a closed pose: some ten operations on numbers of the triad's size
CLOSES = 1e-12  # relative to the size: what the issue asks for, at dead centres too
SAME_POSE = 1e-7  # [m, of size 1; -]: modes nearer than this are reported as one
MIXES = list(itertools.combinations_with_replacement(("RR", "RP", "PR"), 3))


def rrr(lengths, pins, pivots):
    return triad_modes(Triad.rrr(lengths, pins), pivots)


def misses(mode, pivots, lengths, pins):
    """How far each leg is from its length, by its own formula."""
    return [
        abs(abs(mode.o + mode.e * p - g) - l) for g, l, p in zip(pivots, lengths, pins, strict=True)
    ]


def has(modes, o, e, within=1e-6):
    return any(abs(m.o - o) + abs(m.e - e) <= within for m in modes)


# ---- number and closure ------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(2))
def test_number_of_modes_of_fifty_triads_agrees_with_an_exact_count(seed):
    rng = np.random.default_rng(seed)
    for n in range(50):
        pivots, lengths, pins, (o, e) = chance.triad(rng)
        if n % 2:  # lengths that need not close
            lengths = [
                l * abs(1 + 0.3 * x) for l, x in zip(lengths, rng.normal(size=3), strict=True)
            ]
        modes = rrr(lengths, pins, pivots)
        given = f"seed {seed}, triad {n}: {pivots} {lengths} {pins}"
        assert len(modes) == count_exactly(pivots, lengths, pins), given
        assert n % 2 or has(modes, o, e), given
        for mode in modes:
            assert max(misses(mode, pivots, lengths, pins)) <= ROUNDING * 10, given
            assert mode.residual <= ROUNDING, given
            assert abs(abs(mode.e) - 1) <= 4 * EPS


# ---- known cases -------------------------------------------------------------------------


def test_equal_cranks_on_equal_equilateral_triangles_have_two_modes_and_one_that_moves():
    # The centre can stay: turned by t about it the legs are |1 - e^it| long. At t = 0 they
    # are parallel, and the platform moves on a circle.
    pins = [np.exp(2j * np.pi * k / 3) for k in range(3)]
    turned = 0.7
    l = abs(1 - np.exp(1j * turned))
    modes = rrr([l] * 3, pins, pins)
    centred = [m for m in modes if abs(m.o) < 1e-9]
    assert sorted(m.angle for m in centred) == pytest.approx([-turned, turned], abs=1e-12)
    moving = [m for m in modes if m.double]
    assert len(moving) == 1
    assert moving[0].angle == pytest.approx(0, abs=1e-9)
    assert len(modes) == 3


def collinear(rng):
    """Pins on one line."""
    return sorted(rng.normal(size=3)), chance.points(rng)


def small(rng):
    """A platform far smaller than the legs."""
    return chance.points(rng, size=1e-2), chance.points(rng)


def large(rng):
    """A platform far larger than the legs."""
    return chance.points(rng, size=1e2), chance.points(rng)


@pytest.mark.parametrize("make", [collinear, small, large])
def test_odd_platforms_lose_nothing(make):
    rng = np.random.default_rng(23)
    for _ in range(10):
        (pins, pivots), (o, e) = make(rng), chance.pose(rng)
        lengths = [abs(o + e * p - g) for p, g in zip(pins, pivots, strict=True)]
        modes = rrr(lengths, list(pins), list(pivots))
        assert has(modes, o, e, 1e-6 * max(1.0, *lengths))
        assert len(modes) == count_exactly(pivots, lengths, pins)


def test_a_triad_of_whole_numbers_has_all_six_modes():
    pins, pivots, lengths = [0, 4, 3 + 4j], [0, 5, 1 + 4j], [4.0, 4.0, 4.0]
    modes = rrr(lengths, pins, pivots)
    assert len(modes) == 6 == count_exactly(pivots, lengths, pins)
    assert min(m.margin for m in modes) > 0.05


def test_two_pins_on_each_other_are_two_dyads_one_after_the_other():
    rng = np.random.default_rng(21)
    for _ in range(12):
        pivots, _, pins, (o, e) = chance.triad(rng)
        pins[1] = pins[0]
        lengths = [abs(o + e * p - g) for p, g in zip(pins, pivots, strict=True)]
        expected = [
            (pin, (end - pin) / (pins[2] - pins[0]))
            for pin in circles(pivots[0], lengths[0], pivots[1], lengths[1])
            for end in circles(pin, abs(pins[2] - pins[0]), pivots[2], lengths[2])
        ]
        modes = rrr(lengths, pins, pivots)
        assert len(modes) == len(expected)
        for pin, direction in expected:
            assert has(modes, pin - direction * pins[0], direction, 1e-8)


def circles(a, r, b, s):
    """Where two circles meet."""
    d = b - a
    x = (abs(d) ** 2 + r**2 - s**2) / (2 * abs(d))
    if x * x > r * r:
        return []
    y = math.sqrt(r * r - x * x)
    return [a + (x + side * y * 1j) * d / abs(d) for side in (1, -1)]


def test_two_pivots_on_each_other_are_the_same_seen_from_the_platform():
    rng = np.random.default_rng(22)
    for _ in range(12):
        pivots, _, pins, (o, e) = chance.triad(rng)
        pivots[1] = pivots[0]
        lengths = [abs(o + e * p - g) for p, g in zip(pins, pivots, strict=True)]
        here = rrr(lengths, pins, pivots)
        there = rrr(lengths, pivots, pins)  # platform and frame exchanged
        assert len(here) == len(there)
        for m in here:
            assert has(there, -m.o / m.e, m.e.conjugate(), 1e-8)


def test_pins_and_pivots_on_two_lines_in_proportion_have_modes_in_pairs_of_one_angle():
    # The centres of the three circles are always on one line, so every pose has a mirror
    # image with the same angle, and every root of the eliminant is double.
    rng = np.random.default_rng(24)
    for _ in range(12):
        pins = [0.0, 1.0, 3.0]
        pivots = [p * (2 + 4j) for p in pins]
        o, e = chance.pose(rng)
        lengths = [abs(o + e * p - g) for p, g in zip(pins, pivots, strict=True)]
        modes = rrr(lengths, pins, pivots)
        assert len(modes) == count_exactly(pivots, lengths, pins) == 4
        assert not any(m.double for m in modes)
        angles = sorted(m.angle for m in modes)
        assert angles[::2] == pytest.approx(angles[1::2], abs=1e-12)


def test_two_modes_of_one_angle_are_told_apart_though_the_eliminant_has_a_double_root():
    rng = np.random.default_rng(25)
    for _ in range(12):
        pins, (o, _) = chance.points(rng), chance.pose(rng)
        pivots = np.array([0, 1, 2.5]) * (1 + 1j) + pins  # centres on a line at e = 1
        lengths = np.abs(o + pins - pivots).tolist()
        modes = rrr(lengths, pins.tolist(), pivots.tolist())
        mirrored = (o * (1 - 1j)).conjugate() / (1 - 1j)
        assert has(modes, o, 1, 1e-8)
        assert has(modes, mirrored, 1, 1e-8)
        assert len(modes) == count_exactly(pivots.tolist(), lengths, pins.tolist())


def test_three_equal_parallel_cranks_are_one_movable_mode():
    pins = [0, 1, 0.3 + 1j]
    (mode,) = rrr([1.5] * 3, pins, pins)
    assert mode.double
    assert mode.sign == 0
    assert mode.e == pytest.approx(1, abs=1e-9)
    assert abs(mode.o) == pytest.approx(1.5, abs=1e-12)


# ---- dead centres ------------------------------------------------------------------------


def test_a_dead_centre_is_one_double_mode():
    rng = np.random.default_rng(31)
    for n in range(12):
        pivots, lengths, pins, (o, e) = chance.dead_centre(rng)
        modes = rrr(lengths, pins, pivots)
        double = [m for m in modes if m.double]
        assert len(double) == 1, n
        # lengths are rounded: the pose is good to the root of it
        assert has(double, o, e, 2e-5)
        assert double[0].sign == 0
        assert double[0].margin <= 1e-14
        assert all(m.residual <= CLOSES for m in modes)
        counted = count_exactly(pivots, lengths, pins)
        assert counted in (len(modes) - 1, len(modes) + 1)  # rounding decides: none or two


@pytest.mark.parametrize("apart", [1e-3, 1e-5, 1e-7, 1e-9, 1e-10])
def test_near_a_dead_centre_there_are_two_modes_or_none(apart):
    """A leg longer or shorter by ``apart``: the modes are about its root apart."""
    rng = np.random.default_rng(32)
    for _ in range(6):
        pivots, lengths, pins, _ = chance.dead_centre(rng)
        for sign in (1, -1):
            changed = [*lengths[:2], lengths[2] + sign * apart]
            modes = rrr(changed, pins, pivots)
            assert len(modes) == count_exactly(pivots, changed, pins)
            assert not any(m.double for m in modes)
            assert sum(m.sign for m in modes) == 0
            assert all(m.residual <= ROUNDING for m in modes)


def test_rational_dead_centre_is_double_exactly():
    # Legs along 3-4-5 triangles through the origin, platform at e = 1: no rounding at all.
    pins = [3 + 4j, -4 + 3j, 0.75 - 1j]
    pivots = [2 * p for p in pins]
    modes = rrr([5.0, 5.0, 1.25], pins, pivots)
    (double,) = (m for m in modes if m.double)
    assert double.o == pytest.approx(0, abs=1e-9)
    assert double.e == pytest.approx(1, abs=1e-9)
    assert len(modes) == count_exactly(pivots, [5.0, 5.0, 1.25], pins)  # distinct ones


# ---- invariance --------------------------------------------------------------------------


def mirrored(triad):
    sides = [1 if kind == "RR" else -1 for kind in triad.kinds]
    reaches = [side * h for side, h in zip(sides, triad.reaches, strict=True)]
    return Triad(triad.kinds, np.conj(triad.pins), reaches, np.conj(triad.alongs))


def test_a_mirrored_triad_has_mirrored_modes():
    rng = np.random.default_rng(41)
    for kinds in MIXES:
        triad, supports, _ = mixed(rng, kinds)
        other = [
            Guide(s.p.conjugate(), s.u.conjugate()) if isinstance(s, Guide) else s.conjugate()
            for s in supports
        ]
        here, modes = triad_modes(triad, supports), triad_modes(mirrored(triad), other)
        assert len(here) == len(modes)
        for m in here:
            (image,) = (
                x
                for x in modes
                if abs(x.o - m.o.conjugate()) + abs(x.e - m.e.conjugate()) < SAME_POSE
            )
            # A mirror turns the moments and one of two directions: the force of a leg RR
            # keeps its sense along the leg, the normal of a guide turns over.
            assert image.sign == m.sign * (-1) ** sum(kind != "RR" for kind in kinds)


def test_turned_shifted_and_scaled_triads_have_the_same_modes():
    rng = np.random.default_rng(42)
    for _ in range(30):
        pivots, lengths, pins, _ = chance.triad(rng)
        modes = rrr(lengths, pins, pivots)
        z, at, scale = np.exp(1j * rng.uniform(0, 7)), complex(chance.points(rng, 1)[0]), 1e-3
        moved = rrr(
            [scale * l for l in lengths],
            [scale * p for p in pins],
            [scale * (z * g + at) for g in pivots],
        )
        assert len(moved) == len(modes)
        for m in modes:
            where, error = scale * (z * m.o + at), 1e-13 / math.sqrt(m.margin)
            assert any(
                abs(x.o - where) <= scale * error and abs(x.e - z * m.e) <= error for x in moved
            )


# ---- legs that slide ---------------------------------------------------------------------


def mixed(rng, kinds):
    """A triad with legs of given kinds, its supports, and a pose in which it closes."""
    pins, pivots, (o, e) = chance.points(rng), chance.points(rng), chance.pose(rng)
    reaches, alongs, supports = [], [], []
    for kind, p, g in zip(kinds, pins.tolist(), pivots.tolist(), strict=True):
        d, pin = np.exp(1j * rng.uniform(0, 7)), o + e * p
        if kind == "RR":
            reaches.append(abs(pin - g))
        elif kind == "RP":
            reaches.append(((e * d).conjugate() * (g - pin)).imag)
        else:
            reaches.append((d.conjugate() * (pin - g)).imag)
        alongs.append(d)
        supports.append(Guide(g, complex(d)) if kind == "PR" else g)
    return Triad(kinds, pins, reaches, alongs), supports, (o, e)


@pytest.mark.parametrize("kinds", MIXES)
def test_triads_with_sliding_legs_have_as_many_modes_as_their_eliminant_changes_sign(kinds):
    rng = np.random.default_rng(51)
    scan = np.exp(2j * np.pi * (np.arange(20000) + 0.5) / 20000)
    for _ in range(7):
        triad, supports, (o, e) = mixed(rng, kinds)
        modes = triad_modes(triad, supports)
        assert has(modes, o, e)
        far = max(1.0, *(abs(m.o) for m in modes))  # parallel guides meet far away
        assert all(m.residual <= ROUNDING * far for m in modes)
        f = eliminant(placed(triad, supports), scan[None])[0][0]
        assert len(modes) == np.count_nonzero(np.sign(f) != np.sign(np.roll(f, 1)))


# ---- what is refused ---------------------------------------------------------------------


def test_a_leg_that_is_there_twice_is_refused_in_words():
    with pytest.raises(RequestError, match="can move although its supports stand") as caught:
        rrr([1, 1, 1], [0, 1, 1], [0, 2, 2])
    assert [p.code for p in caught.value.problems] == ["bad-triad"]


def test_legs_that_cannot_reach_have_no_mode():
    assert rrr([0.1, 0.1, 0.1], [0, 1, 1j], [0, 5, 5j]) == ()
