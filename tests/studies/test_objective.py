"""A study point as a function for SciPy: its values are a study's, its derivatives exact."""

import numpy as np
import pytest
from scipy.optimize import minimize

import blockmech as bm
from blockmech.studies.reductions import SIMPLE
from tests.gallery import mechanism

TURN = {"crank": np.linspace(0.1, 6.2, 24)}
TURN_OF_8 = {"crank": np.linspace(0.0, 2 * np.pi, 8)}
NUMBERS = ["dyad.l_i", "frame.D.y", "dyad.links.i.mass", "dyad.friction.C.radius"]
WANT = [*(f"{how}(crank.drive)" for how in SIMPLE), f"at(crank.drive, {TURN['crank'][3]})"]
WANT += ["max_abs(dyad.C.reaction)", "rms(dyad.C.reaction)", "mean(dyad.C.p)", "poses(dyad.S.p)"]
WANT += ["max(dyad.C.p.x)", "min(dyad.C.p.y)"]


@pytest.fixture(scope="module")
def asked():
    return mechanism("ruiz_fourbar").objective(NUMBERS, want=WANT, at=TURN)


def test_values_are_those_of_a_study(asked):
    x = asked.start * 1.01
    vary = {a: [value] for a, value in asked.numbers(x).items()}
    study = mechanism("ruiz_fourbar").study(vary, want=WANT, at=TURN)
    columns = [np.atleast_1d(row[0]) for row in study.found.values.values()]
    rows = [np.concatenate([r.real, r.imag]) if np.iscomplexobj(r) else r for r in columns]
    np.testing.assert_array_equal(asked(x), np.concatenate(rows))


def test_derivatives_of_every_reduction_are_those_of_differences(asked):
    x = asked.start + np.array([0.01, 0.02, 0.3, 1e-4])
    exact, values = asked.jacobian(x), asked(x)
    assert exact.shape == (len(values), len(x))
    for k in range(len(x)):
        h = 1e-6 * (abs(x[k]) or 1.0)  # steps of differences: error h^2 and rounding / h
        step = h * np.eye(len(x))[k]
        difference = (asked(x + step) - asked(x - step)) / (2 * h)
        allowed = 1e-6 * np.maximum(np.abs(exact[:, k]), np.abs(values) / (abs(x[k]) or 1.0)) + 1e-8
        assert (np.abs(exact[:, k] - difference) <= allowed).all()


def test_of_places_that_tie_the_one_that_goes_ahead_counts():
    """A yoke about the origin goes as far to the left as to the right: shifting it grows either."""
    f = mechanism("scotch_yoke").objective("frame.O.x", want="max_abs(yoke.B.p.x)", at=TURN_OF_8)
    assert f(0.0) == pytest.approx(f(1e-3) - 1e-3, rel=1e-12)
    assert f(0.0) == pytest.approx(f(-1e-3) - 1e-3, rel=1e-12)
    assert f.jacobian([0.0]) == pytest.approx(1.0, rel=1e-12)
    assert f.jacobian([-1e-3]) == pytest.approx(-1.0, rel=1e-12)


def test_a_design_that_does_not_assemble_or_that_a_file_refuses_is_infinitely_bad():
    f = mechanism("ruiz_fourbar").objective("dyad.l_i", want="max_abs(crank.drive)", at=TURN)
    assert np.isfinite(f([6.0]))
    assert f([9.0]) == f([-6.0]) == f([0.0]) == np.inf
    assert f([6.0]) == f(f.start) == f(6.0)
    with pytest.raises(bm.RequestError, match="give those of"):
        f([6.0, 3.0])


def test_scipy_finds_the_best_place_of_a_mass():
    mech = mechanism("ruiz_fourbar")
    f = mech.objective(["crank.links.crank.cm.x"], want="rms(mechanism.shaking_force)", at=TURN)
    optimum = minimize(f, f.start, jac=f.jacobian)
    assert optimum.fun < f(f.start)
    assert abs(f.jacobian(optimum.x)[0]) < 1e-4 * abs(f.jacobian(f.start)[0])
    around = [f(optimum.x + d) for d in (-1e-3, 1e-3)]
    assert min(around) > optimum.fun


def test_of_a_number_a_turn_there_is_no_derivative():
    with pytest.raises(bm.RequestError, match="no-derivative"):
        mechanism("ruiz_fourbar").objective(["dyad.l_i"], want="mechanism.friction_efficiency")
