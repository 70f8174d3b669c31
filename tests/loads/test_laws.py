"""Laws of forces and moments: their values, their periods, what they refuse."""

from __future__ import annotations

import math

import numpy as np
import pytest

import blockmech as bm
from blockmech.engines.binding import bind_functions
from blockmech.engines.numpy import primitives
from blockmech.loads import laws

ROUNDING = 1e-14  # [-] of the largest value: some ten roundings
X = np.array([-7.0, -0.3, 0.0, 0.5, 1.0, 1.9, 3.0, 6.2, 100.0, 1e6])


def value(law, x):
    """Values of a law by both engines, which must agree to rounding."""
    numbers = law.numbers()
    single = np.array([law.kernel()(float(a), numbers) for a in x])
    batch = bind_functions({"law": law.kernel()}, primitives(np.float64))["law"]
    with np.errstate(all="ignore"):
        many = np.broadcast_to(batch(x, _arrays(numbers)), x.shape)
    assert np.array_equal(np.isnan(single), np.isnan(many))
    scale = np.nanmax(np.abs(single), initial=1e-300)
    assert np.nanmax(np.abs(single - many), initial=0.0) <= ROUNDING * scale
    return single


def _arrays(numbers):
    def cast(x):
        if not isinstance(x, tuple):
            return x
        return np.array(x) if all(isinstance(y, float) for y in x) else tuple(map(cast, x))

    return type(numbers)(*map(cast, numbers))


def test_polynomial_starts_with_the_constant_term():
    law = laws.Polynomial(coefficients=[1.0, -2.0, 0.5])
    expected = 1.0 - 2.0 * X + 0.5 * X**2
    assert np.abs(value(law, X) - expected).max() <= ROUNDING * np.abs(expected).max()


def test_straight_lines_of_a_table_pass_its_points_and_end_with_them():
    law = laws.Table(arguments=[0.0, 1.0, 3.0], values=[2.0, 4.0, 0.0], interpolation="linear")
    x = np.array([-0.1, 0.0, 0.5, 1.0, 2.0, 3.0, 3.1])
    assert value(law, x).tolist()[1:-1] == [2.0, 3.0, 4.0, 2.0, 0.0]
    assert np.isnan(value(law, x)[[0, -1]]).all()


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_an_argument_that_rounding_moves_off_the_table_has_its_last_value(interpolation):
    law = laws.Table(
        arguments=[-0.1, 0.1, 0.3], values=[2.0, 4.0, 1.0], interpolation=interpolation
    )
    value, numbers = law.kernel(), law.numbers()
    for end, expected in ((-0.1, 2.0), (0.3, 1.0)):
        for x in (math.nextafter(end, -1.0), end, math.nextafter(end, 1.0)):
            assert value(x, numbers) == pytest.approx(expected, abs=1e-11)
    assert math.isnan(value(0.3 + 1e-9, numbers))
    assert math.isnan(value(-0.1 - 1e-9, numbers))


def test_cubic_table_passes_a_cubic_exactly():
    x = np.array([0.0, 0.4, 1.1, 1.7, 2.0])
    law = laws.Table(arguments=x.tolist(), values=(x**3 - x).tolist())
    between = np.linspace(0.0, 2.0, 33)
    assert np.abs(value(law, between) - (between**3 - between)).max() <= 10 * ROUNDING * 6.0


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
@pytest.mark.parametrize("turns", [1, 2])
def test_table_over_turns_repeats_at_any_angle(interpolation, turns):
    angles = (0.3 + np.arange(8) * turns * 2 * math.pi / 8).tolist()
    values = [0.0, 1.0, 5.0, 2.0, 0.5, 0.0, -1.0, 0.0]
    law = laws.Table(arguments=angles, values=values, interpolation=interpolation, turns=turns)
    assert np.abs(value(law, np.array(angles)) - values).max() <= 10 * ROUNDING * 5.0
    # Sine and cosine of a double tell where in its turn it is, however large it is.
    large = 1e9
    reduced = math.atan2(math.sin(large / turns), math.cos(large / turns)) * turns
    assert abs(np.diff(value(law, np.array([large, reduced])))) <= 100 * ROUNDING * 5.0


def test_periodic_cubic_table_is_smooth_across_its_end():
    x = np.linspace(0, 2, 12, endpoint=False)
    law = laws.Table(
        of="time", arguments=x.tolist(), values=np.sin(math.pi * x).tolist(), period=2.0
    )
    h = 1e-4
    left, middle, right = value(law, np.array([2.0 - h, 2.0, 2.0 + h]))
    assert abs(middle) <= ROUNDING
    assert right - middle == pytest.approx(middle - left, rel=1e-6)
    assert right / h == pytest.approx(math.pi, rel=1e-3)  # a spline of 12 points
    t = np.linspace(0.1, 1.9, 7)
    for periods in (-3, 5):
        assert np.abs(value(law, t + 2 * periods) - value(law, t)).max() <= 100 * ROUNDING


@pytest.mark.parametrize(("turns", "period"), [(None, None), (1, None), (3, None), (None, 0.7)])
def test_fourier_series_is_the_sum_of_its_harmonics(turns, period):
    law = laws.Fourier(
        mean=1.0, cosines=[2.0, 0.0, 0.5], sines=[0.0, 3.0], turns=turns, period=period
    )
    w = 2 * math.pi / period if period else 1 / (turns or 1)
    expected = 1.0 + 2.0 * np.cos(w * X) + 0.5 * np.cos(3 * w * X) + 3.0 * np.sin(2 * w * X)
    phase = 3 * w * np.abs(X)  # known to half an ulp
    assert np.all(np.abs(value(law, X) - expected) <= 10 * ROUNDING + 1e-15 * phase)


def test_motor_curve_is_a_straight_line():
    law = laws.DC(stall_moment=2.0, no_load_speed=-50.0)
    assert value(law, np.array([0.0, -50.0, 25.0])).tolist() == [2.0, 0.0, 3.0]


@pytest.mark.parametrize("law", [laws.Polynomial(coefficients=[1.0]), laws.Fourier(cosines=[1.0])])
def test_nan_gives_nan(law):
    assert np.isnan(value(law, np.array([math.nan]))).all()


def test_infinite_argument_of_a_repeating_law_gives_nan_and_no_exception():
    law = laws.Table(arguments=[0.0, 1.0], values=[0.0, 1.0], period=2.0, of="time")
    assert np.isnan(value(law, np.array([math.inf, math.nan]))).all()


@pytest.mark.parametrize(
    ("law", "because"),
    [
        (lambda: laws.Table(arguments=[0.0, 1.0], values=[1.0, 2.0, 3.0]), "same length"),
        (lambda: laws.Table(arguments=[0.0, 0.0], values=[1.0, 2.0]), "increase"),
        (lambda: laws.Table(arguments=[0.0, 7.0], values=[1.0, 2.0], turns=1), "one period"),
        (lambda: laws.Table(arguments=[0.0, 2.0], values=[1.0, 1.0], period=2.0), "one period"),
        (lambda: laws.Fourier(cosines=[1.0], turns=1, period=2.0), "twice"),
        (lambda: laws.Fourier(of="time", cosines=[1.0]), 'needs "period"'),
        (lambda: laws.Fourier(of="rate", cosines=[1.0], turns=1), "of an angle"),
        (lambda: laws.DC(stall_moment=1.0, no_load_speed=0.0), "must not be 0"),
        (lambda: laws.Polynomial(coefficients=[]), "at least 1"),
    ],
)
def test_law_that_makes_no_sense_is_refused(law, because):
    with pytest.raises(bm.GraphError, match=because):
        law()
