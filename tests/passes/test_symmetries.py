"""Mirrored, scaled and shuffled mechanisms give the mirrored, scaled, ... numbers.

Mirroring changes signs and scaling by powers of two changes exponents, no digit of any number:
those answers are the same to the last bit.
"""

import random

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from blockmech.testing.strategies import KINDS, Options, mechanisms
from tests.machines import ruiz, toggle, watt
from tests.wiring import mirrored, rewired, same_bits, scaled

ALL = Options(kinds=KINDS, groups=(1, 3), drivers=(1, 3))
HAND_MADE = {
    "ruiz": (ruiz, {"at": {"crank": 1.3}}),
    "toggle": (toggle, {"at": {"ram": 0.3}}),
    "watt": (lambda: watt(spring=2.0, friction=True), {"at": {"crank": -2.0}}),
}
STEPPED = 1e-11  # [-] rounding, times a condition of the friction equations below 1e4
EACH = pytest.mark.parametrize("name", HAND_MADE)


def hand_made(name):
    make, request = HAND_MADE[name]
    rates = dict.fromkeys(request["at"], 3.0)
    return make(), {**request, "rates": rates, "accelerations": dict.fromkeys(rates, -2.0)}


def solve(graph, request, **settings):
    return graph.compile().run(**request, on_gap="mark", **settings)


def numbers(result):
    return {k: np.asarray(result[k]) for k in result if result._output(k).kind != "number"}


def same(values, expected, result):
    """Equal to the last bit; to rounding where continuation took its steps to the answer.

    Numbers below the least normal one have fewer bits, which scaling alone changes.
    """
    stepped = any(f.code == "by-continuation" for f in result.quality.flags)
    size = STEPPED * np.nanmax(np.abs(expected), initial=0.0) if stepped else 0.0
    floor = np.finfo(float).tiny
    return np.allclose(values, expected, rtol=0, atol=max(size, floor), equal_nan=True)


# ---- mirrored ----------------------------------------------------------------------------

TURNING = ("rad", "rad/s", "rad/s2", "N m", "kg m2/rad")  # odd under mirroring
UNSIGNED = (".transmission_angle",)


def image(result):
    """What a result must become in the mirror."""
    rotary = np.array([-1 if u == "rad" else 1 for u in map(result.unit, result.drivers)])
    images = {}
    for name, values in numbers(result).items():
        output = result._output(name)
        if output.kind == "vector":
            images[name] = values.conj()
        elif name == "mechanism.M":
            images[name] = values * np.outer(rotary, rotary)
        elif name == "mechanism.Q":
            images[name] = values * rotary
        elif name.endswith(UNSIGNED):
            images[name] = values
        else:
            is_odd = output.unit in TURNING or name.endswith(".N")
            images[name] = -values if is_odd else values
    return images


def in_the_mirror(mech, request):
    """The request of the mirror image: angles turn the other way, slides do not."""

    def seen(values):
        joint = mech.structure.driver_joint
        return {d: -x if joint(d).rotary else x for d, x in values.items()}

    return {k: seen(values) for k, values in request.items()}


def check_mirror(graph, request):
    solution = solve(graph, request)
    mirror = solve(mirrored(graph), in_the_mirror(graph.compile(), request))
    assert mirror.quality.status == solution.quality.status
    for name, values in image(solution).items():
        mirrored_values = mirror[name]
        if name.endswith(".angle"):
            mirrored_values, values = half_turns_alike(mirrored_values), half_turns_alike(values)
        assert same(mirrored_values, values, solution), name


def half_turns_alike(angle):
    """Half a turn to the left is one to the right; the sign is that of a rounded zero."""
    return np.where(np.abs(angle) == np.pi, np.pi, angle)


@EACH
def test_mirror_image_of_a_hand_made_mechanism(name):
    check_mirror(*hand_made(name))


@given(mechanisms(ALL))
@settings(max_examples=12)
def test_mirror_image_of_a_random_mechanism(case):
    check_mirror(case.graph, case.request)


# ---- scaled ------------------------------------------------------------------------------


def powers(unit):
    """Powers of length and force in a unit; the unit of time stays, so kg is N / m."""
    length = force = 0
    parts = unit.replace("(", "").replace(")", "").split("/")
    for sign, part in zip((1, -1, -1), parts, strict=False):
        for symbol in part.split():
            letters, power = symbol.rstrip("23"), int(symbol[-1]) if symbol[-1] in "23" else 1
            length += sign * power * {"m": 1, "J": 1, "W": 1, "kg": -1}.get(letters, 0)
            force += sign * power * {"N": 1, "J": 1, "W": 1, "kg": 1}.get(letters, 0)
    return length, force


def test_powers_of_units_are_read_right():
    assert powers("N m") == (1, 1)
    assert powers("m/s2") == (1, 0)
    assert powers("kg m2") == (1, 1)
    assert powers("kg m2/rad") == (1, 1)
    assert powers("kg/m") == (-2, 1)
    assert powers("N/(N m)") == (-1, 0)
    assert powers("rad/s2") == powers("") == (0, 0)


def check_scale(graph, request, length, force):
    mech = graph.compile()
    slides = {d: 1.0 if mech.structure.driver_joint(d).rotary else length for d in mech.drivers}
    expected = solve(graph, request)
    bigger = {k: {d: x * slides[d] for d, x in v.items()} for k, v in request.items()}
    solution = solve(scaled(graph, length, force), bigger)
    assert solution.quality.status == expected.quality.status
    for name, values in numbers(expected).items():
        if expected.unit(name) == "SI":
            continue  # of mixed units; drives and energies stand for it
        a, b = powers(expected.unit(name))
        assert same(solution[name], values * length**a * force**b, expected), name


@EACH
@pytest.mark.parametrize(("length", "force"), [(2.0, 1.0), (1.0, 0.5), (0.125, 1024.0)])
def test_other_units_of_length_and_force_change_no_digit(name, length, force):
    check_scale(*hand_made(name), length, force)


@given(mechanisms(ALL), st.integers(-12, 12), st.integers(-12, 12))
@settings(max_examples=12)
def test_other_units_change_no_digit_of_a_random_mechanism(case, length, force):
    # A block without lengths of its own counts as 1 m long where pairs at rest are looked for.
    resting = solve(case.graph, case.request).quality.flags
    assume(not any(f.code == "zero-relative-speed" for f in resting))
    check_scale(case.graph, case.request, 2.0**length, 2.0**force)


# ---- shuffled ----------------------------------------------------------------------------


@given(mechanisms(ALL), st.integers(0, 2**32 - 1))
@settings(max_examples=12)
def test_order_of_writing_changes_no_bit_of_a_random_mechanism(case, seed):
    solution = solve(case.graph, case.request)
    reordered = solve(rewired(case.graph, random.Random(seed)), case.request)
    assert set(solution) == set(reordered)
    assert same_bits(numbers(solution), numbers(reordered)) == []
    assert str(solution.mechanism) == str(reordered.mechanism)
