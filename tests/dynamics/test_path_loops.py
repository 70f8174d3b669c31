"""Motions along the path by machine code are those by arrays."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest
from numpy.polynomial import chebyshev

import blockmech as bm
from blockmech.dynamics import compiled_path, path_loops
from blockmech.dynamics.compiled_path import PathCode
from blockmech.dynamics.panel_nodes import (
    COARSE,
    FINE,
    FROM_REST,
    PANEL,
    PLAIN,
    TO_REST,
    Sizes,
    nodes,
    rule,
)
from blockmech.dynamics.panels import Panels
from blockmech.dynamics.path_mesh import PathMesh
from blockmech.dynamics.place_data import RESOLVED
from blockmech.dynamics.system import System
from blockmech.functions.series import tail
from tests.dynamics.honesty import GRAPHS, mechanism
from tests.dynamics.one_chart import in_one_chart

MOTIONS = [  # from rest and from a rate, with the coordinate and against it, all ways to end
    ("watt_sixbar", (math.pi / 3, 0.0), "time=2"),
    ("watt_sixbar", (0.7, 0.0), "swings=81"),
    ("watt_sixbar", (-2.0, -3.0), "standstill"),
    ("watt_sixbar", (0.5, 2.0), "time=50"),
    ("watt_sixbar", (1.0, 40.0), "turns=12.5"),
    ("watt_sixbar", (1.0, -40.0), "angle=-3rad"),
    ("watt_sixbar", (0.7, 0.0), "angle=3rad"),
    ("andrews_squeezer", (-0.0617138900142764496358948458001, 0.0), "time=0.03"),
    ("andrews_squeezer", (0.5, -90.0), "time=0.3"),
    ("slider_crank", (0.5, 0.0), "swings=2"),
    ("slider_crank", (0.5, 50.0), "turns=3"),
]


@pytest.fixture
def llvm():
    pytest.importorskip("llvmlite", reason="machine code needs the extra fast")


@pytest.mark.parametrize(("name", "start", "until"), MOTIONS)
def test_a_motion_by_machine_code_is_that_by_arrays(llvm, name, start, until):
    mech = mechanism(name)
    request = {"start": {mech.drivers[0]: start}, "method": "energy", "want": []}
    arrays, code = (
        mech.simulate(until, engine=engine, **request).motion for engine in ("scalar", "llvm")
    )
    assert (arrays.engine, code.engine) == ("numpy", "llvm")
    assert (code.status, code.end, code.regime) == (arrays.status, arrays.end, arrays.regime)
    assert [e.kind for e in code.events] == [e.kind for e in arrays.events]
    assert code.notes == arrays.notes
    assert code.facts == pytest.approx(arrays.facts, rel=1e-11)
    assert arrays.error / 3 <= code.error <= 3 * arrays.error
    assert abs(code.t_end - arrays.t_end) <= arrays.time_error + 4e-16 * arrays.t_end
    t = np.linspace(0.0, min(code.t_end, arrays.t_end), 501)
    by_arrays, by_code = arrays.at(t), code.at(t)
    assert np.abs(by_arrays.q - by_code.q).max() <= arrays.error
    assert np.abs(by_arrays.qd - by_code.qd).max() <= 1e-10 * np.abs(by_arrays.qd).max()


@pytest.mark.parametrize(
    ("name", "start", "end"),
    [
        ("elliptic_trammel", (-0.26, -2.8), "dead centre"),
        ("rack_gripper", (0.116, 0.064), "swings"),
        ("tangent_generator", (1.05, 2.7), "not decided"),
    ],
)
def test_dead_centres_and_pieces_made_on_the_way(llvm, name, start, end):
    mech = mechanism(name)
    request = {"start": {mech.drivers[0]: start}, "method": "energy", "friction": "none"}
    arrays, code = (
        in_one_chart(mech, "swings=3", engine=engine, **request) for engine in ("scalar", "llvm")
    )
    assert code.end == arrays.end == end
    assert (arrays.engine, code.engine) == ("numpy", "llvm")
    assert abs(code.q_end - arrays.q_end) <= arrays.error + 4e-16 * abs(arrays.q_end)
    if end == "dead centre":
        assert abs(code.t_end - arrays.t_end) <= arrays.time_error
    assert arrays.error / 3 <= code.error <= 3 * arrays.error


def test_auto_makes_code_once_a_mechanism_has_moved_often(llvm, monkeypatch):
    monkeypatch.setattr(compiled_path.PathCode, "pays", staticmethod(lambda motions: motions > 2))
    mech = bm.Graph.load(GRAPHS / "watt_sixbar.json").compile()
    request = {"start": {"crank": (1.0, 0.0)}, "want": []}
    motions = [mech.simulate(**request).motion for _ in range(4)]
    assert [motion.engine for motion in motions] == ["numpy", "numpy", "llvm", "llvm"]
    assert motions[2].q_end == motions[3].q_end
    assert abs(motions[3].q_end - motions[0].q_end) <= motions[0].error


def test_a_motion_is_read_where_there_is_no_code(llvm, monkeypatch):
    mech = mechanism("andrews_squeezer")
    motion = mech.simulate("time=0.03", want=[], method="energy", engine="llvm").motion
    t = np.linspace(0.0, 0.03, 101)
    by_code = motion.at(t)
    monkeypatch.setattr(compiled_path.PathCode, "compiled", staticmethod(lambda: None))
    elsewhere = pickle.loads(pickle.dumps(motion))
    np.testing.assert_allclose(elsewhere.at(t).q, by_code.q, rtol=0, atol=1e-13)
    np.testing.assert_allclose(elsewhere.at(t).qd, by_code.qd, rtol=1e-10, atol=1e-10)
    assert mech.simulate("time=0.03", want=[], method="energy").motion.engine == "numpy"


@pytest.mark.parametrize("engine", ["scalar", "llvm"])
@pytest.mark.parametrize(("name", "start", "until"), [MOTIONS[0], MOTIONS[4], MOTIONS[8]])
def test_one_time_is_read_as_many_are(llvm, engine, name, start, until):
    """Swings and the swings back, turns that gain, begins and ends of panels."""
    mech = mechanism(name)
    request = {"start": {mech.drivers[0]: start}, "method": "energy", "want": []}
    motion = mech.simulate(until, engine=engine, **request).motion
    leg = motion.track.legs[-1]
    panels = getattr(leg, "panels", leg)
    times = np.append(np.linspace(0.0, motion.t_end, 23), leg.t0 + panels.times)
    times = times[times <= motion.t_end]
    many, singles = motion.at(times), [motion.at(t) for t in times]
    scale = np.abs(many.qd).max()
    for t, q, qd, single in zip(times, *many, singles, strict=True):
        assert abs(single.q - q) <= 4e-15 * (1.0 + abs(q) + t * scale)
        assert abs(single.qd - qd) <= 1e-12 * scale


def test_a_clock_that_stands_still_is_halved_to_its_end():
    n, at = 4, [0.0, 0.0]
    v = [0.0, *rule(n).v.tolist(), 1.0]
    of = Sizes(n, n)
    path_loops.moment(of, v, v, [0.0] * (n + 2), [0.0] * (n + 1), [0.0] * n, 0.5, at)
    assert v[2] <= at[0] <= v[3]
    assert at[1] == 0.0


@pytest.mark.parametrize("K", [0.0, 900.0])
def test_machine_code_says_what_its_python_says(llvm, K):
    """Both runs over a swing or a turn, and all that is read from their panels."""
    mesh = PathMesh(System(mechanism("watt_sixbar")), 1.0, FINE, RESOLVED)
    sign, goal = (-1, -math.inf) if not K else (1, 1.0 + math.tau)
    course, shift = mesh.course(1.0, sign)
    times, answers = np.linspace(0.0, 2.0, 7), []
    for code in (PathCode.interpreted(), PathCode.compiled()):
        records, counts = np.zeros((99, PANEL, 2, FINE + 2)), np.zeros(2, np.int64)
        runs = np.array([[1.0, K, 0.0, 0.0, 0.0], [1.0 + 4e-16, K, 0.0, 0.0, 1e-14]])
        at, totals = np.array([0.0, 0.0, 0.0, 9.0, 0.0, 1e-15, 3e-15]), np.zeros(8)
        numbers = shift, goal, len(course.which), float(sign), RESOLVED
        pieces = course.blocks, course.which, course.bounds
        outcome = code.over_pieces(*pieces, *numbers, runs, records, counts)
        assert outcome == (1 if K else 2)
        n = int(counts[0])
        code.compare(records, records, n, 1, at, totals)
        copies = records.copy()
        code.again(copies, n, 0, 1.0)
        code.again(copies, n, 1, 1.25)
        states = Panels(records[:n], 1, compiled=code.engine == "llvm").state(times)
        answers.append((runs, records[:n], totals[2:7], copies[:n], *states))
        assert 1e-16 < totals[0] < 1e-12
        assert 1e-16 < totals[1] < 1e-13
    for by_python, by_code in zip(*answers, strict=True):
        size = np.abs(by_python).max()
        np.testing.assert_allclose(by_code, by_python, rtol=1e-11, atol=1e-13 * size)


@pytest.mark.parametrize("kind", [PLAIN, FROM_REST, TO_REST])
def test_series_of_a_piece_are_read_as_numpy_reads_them(kind):
    of, some = Sizes(FINE, COARSE), nodes(FINE, COARSE)
    rng = np.random.default_rng(2)
    series = rng.normal(size=(2, FINE + 2)) * 0.5 ** np.arange(FINE + 2)
    series[:, FINE:] = 0.0
    rows, room, bounds = np.zeros((2, FINE + 2)), np.zeros((FINE + 2, FINE + 2)), np.zeros(6)
    bounds[:2] = 0.25, 2.25
    path_loops.over(of, some, bounds, 0.5, 1.75, kind, series, rows, 0, room)
    v = rule(FINE).v if kind == PLAIN else rule(FINE).v ** 2
    coordinates = 1.75 - 1.25 * v if kind == TO_REST else 0.5 + 1.25 * v
    exact = chebyshev.chebval(coordinates - 0.25 - 1.0, series[0, :FINE])
    np.testing.assert_allclose(rows[0, 1:-1], exact, atol=1e-13)
    for c in (series[0, :FINE], rng.normal(size=FINE), np.zeros(FINE)):
        padded = np.append(c, [0.0, 0.0])[None]
        assert path_loops.ending(of, some, padded, 0) == tail(c)
