"""Designs that are moved along the path by machine code move as each by itself does."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
import pytest
from numpy.polynomial import chebyshev

from blockmech.dynamics.panels import FROM_REST, PLAIN, TO_REST, rule
from blockmech.dynamics.path_mesh import COARSE, FINE
from blockmech.engines import loops
from blockmech.series import tail
from blockmech.studies import swings
from blockmech.studies.family import remade
from tests.dynamics.honesty import mechanism

WANT = ["motion.t_end", "motion.q_end", "motion.error", "motion.time_error"]
CASES = [  # mechanism, what is varied, start
    ("watt_sixbar", "crank.links.crank.mass", (math.pi / 3, 0.0)),
    ("watt_sixbar", "crank.links.crank.mass", (-2.0, -3.0)),
    ("slider_crank", "piston.links.j.mass", (0.5, 0.0)),
]


@pytest.fixture
def along(monkeypatch):
    """How many designs went along the path, of those asked for."""
    pytest.importorskip("llvmlite", reason="the compiled engine needs the extra fast")
    counts = []
    moved = swings.FirstSwings.moved

    def counted(self, values, m):
        motions = moved(self, values, m)
        counts.append((int((~motions.alone).sum()), m))
        return motions

    monkeypatch.setattr(swings.FirstSwings, "moved", counted)
    return counts


@pytest.mark.parametrize(("name", "address", "start"), CASES)
def test_designs_move_as_each_by_itself(along, name, address, start):
    mech = mechanism(name)
    start = {mech.drivers[0]: start}
    mass = np.linspace(0.5, 2.0, 16)
    simulate = {"until": "standstill", "start": start, "method": "energy"}
    study = mech.study({address: mass}, want=WANT, friction="none", simulate=simulate)
    assert along == [(16, 16)]
    for i in (0, 7, 15):
        own = remade(mech, {address: float(mass[i])})
        motion = own.simulate(friction="none", want=[], **simulate).motion
        q, t = study["motion.q_end"][i], study["motion.t_end"][i]
        assert abs(q - motion.q_end) <= study["motion.error"][i] + motion.error
        assert abs(t - motion.t_end) <= study["motion.time_error"][i] + motion.time_error
        assert motion.error / 10 <= study["motion.error"][i] <= 10 * motion.error


def test_what_never_stands_still_is_left_to_others(along):
    mech = mechanism("watt_sixbar")
    simulate = {"until": "standstill", "start": {"crank": (0.5, 60.0)}, "method": "energy"}
    mass = np.linspace(0.5, 2.0, 16)
    study = mech.study({"crank.links.crank.mass": mass}, want=WANT, simulate=simulate)
    assert along == [(0, 16)]
    assert set(study.status) == {"ended-early"}


def test_a_named_integrator_is_obeyed(along):
    mech = mechanism("watt_sixbar")
    simulate = {"until": "standstill", "start": {"crank": (1.0, 0.0)}, "method": "dop853"}
    mass = np.linspace(0.9, 1.1, 16)
    study = mech.study({"crank.links.crank.mass": mass}, want=WANT, simulate=simulate)
    assert along == []
    assert set(study.status) == {"ok"}


def sizes():
    return swings.Sizes(FINE, COARSE, 32, 3, *swings.matrices()[1])


def test_series_are_read_as_numpy_reads_them():
    rng = np.random.default_rng(1)
    c, x = rng.normal(size=FINE) * 0.7 ** np.arange(FINE), rng.uniform(-1, 1, 5)
    out, scratch = np.zeros(5), np.zeros(10)
    swings.series_at(c, FINE, x, out, scratch, 5)
    np.testing.assert_allclose(out, chebyshev.chebval(x, c), atol=1e-14)
    for series in (c, c * 1e-3 ** np.arange(FINE), rng.normal(size=FINE), np.zeros(FINE)):
        assert swings.ending(series, FINE) == tail(series)


@pytest.mark.parametrize("kind", [PLAIN, FROM_REST, TO_REST])
def test_machine_code_has_the_bits_of_its_python(kind):
    """Place data at the nodes of a panel, and its clock."""
    pytest.importorskip("llvmlite", reason="the compiled engine needs the extra fast")
    from blockmech.engines.llvm import machine_code

    of, M = sizes(), swings.matrices()[0]
    made = {f.__name__: partial(f, of=of) for f in (swings.over, swings.clock)}
    kinds = [(name, loops.signature(f)) for name, f in made.items()]
    over, clock = machine_code(loops.text(**made), *kinds)
    rng = np.random.default_rng(2)
    series = rng.normal(size=(2, FINE + 2)) * 0.5 ** np.arange(FINE + 2)
    series[0, 0] += 4.0  # an inertia
    whole, gains = np.zeros((2, FINE + 2)), rng.uniform(1.0, 2.0, FINE + 2)
    answers = []
    for compiled in (False, True):
        rows, b = np.zeros((2, FINE + 2)), np.zeros(4 * FINE)
        speeds, rate = np.zeros(FINE + 2), np.zeros(FINE + 2)
        first = M, 0.25, 2.0, 0.5, 1.75, kind, series, whole, rows, b, 0
        second = M, 1.25, kind, 0.5, gains, rows, speeds, rate
        if compiled:
            over(*(x.ctypes.data if isinstance(x, np.ndarray) else x for x in first))
            clock(*(x.ctypes.data if isinstance(x, np.ndarray) else x for x in second))
        else:
            swings.over(of, *first)
            swings.clock(of, *second)
        answers.append((rows, rate))
    v = rule(FINE).v if kind == PLAIN else rule(FINE).v ** 2
    places = 1.75 - 1.25 * v if kind == TO_REST else 0.5 + 1.25 * v
    exact = chebyshev.chebval(places - 0.25 - 1.0, series[0, :FINE])
    np.testing.assert_allclose(answers[0][0][0, :FINE], exact, atol=1e-13)
    for by_python, by_code in zip(*answers, strict=True):
        np.testing.assert_array_equal(by_python, by_code)
