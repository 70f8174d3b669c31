"""Branches that follow the motion through change points: closed forms, and what is refused.

A parallelogram translates its coupler; an isosceles slider-crank moves its slider by
2 r cos q (Cardan's circles); a guide through a pin on the crank's circle turns at half the
crank's rate; a kite is the same again only after two turns of its crank.
"""

from __future__ import annotations

import cmath
import json
import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import blockmech as bm
from blockmech.dynamics.change_points import system_of
from blockmech.ground.errors import FormatError, GraphError, SingularError
from tests.doors import graph_of as loads
from tests.dynamics import machines
from tests.machines import G, bar, crank, fourbar, pushed, slider_crank, wire

GRAPHS = Path(__file__).resolve().parents[2] / "graphs"
TURN = 2 * math.pi
EPS = 2.2e-16
UPRIGHT = (math.pi / 2, 1)
# Samples of three turns, none nearer than 0.01 rad to a change point of these linkages;
# rates have lost eps/d^2 there, and links pass on what they have lost.
Q = np.linspace(-7.0, 11.0, 181) + 0.0131
NEAREST = 0.01
PLACE, RATE = 40 * EPS / NEAREST, 40 * EPS / NEAREST**2


def home(q, branch, driver="crank"):
    return {"drivers": {driver: q}, "branch": branch}


def four_bar(a, l_i, l_j, ground, start=UPRIGHT, branch="follow"):
    bodies = [bar(1.0, length) for length in (a, l_i, l_j)]
    options = {"home": home(*start)} if branch == "follow" else {}
    return fourbar(a, l_i, l_j, ground, bodies, gravity=G, branch=branch, **options)


def parallelogram(a=0.25, b=0.4, **options):
    return four_bar(a, b, a, b, **options)


def isosceles(r=1.0):
    bodies = [bar(1.0, r), bar(1.0, r), bm.Link(mass=1.0)]
    return slider_crank(r, r, 0.0, bodies, gravity=G, branch="follow", home=home(0.3, 1))


def half_rate():
    graph = crank(1.0, bar(1.0, 1.0), gravity=G, D=(1.0, 0.0))
    links = {"j": bm.Link(mass=1.0, inertia=0.3)}
    graph.add("dyad", bm.RPR(branch="follow", home=home(1.0, 1), links=links))
    return wire(graph, "crank.B dyad.B", "frame.D dyad.D")


def kite():
    return four_bar(1.0, 2.0, 2.0, 1.0, start=(1.0, 1))


def moved(graph, q, *want, rate=1.0):
    return graph.compile().run(at=q, rates=rate, want=want)


def off(values, expected):
    return float(np.abs(np.asarray(values) - np.asarray(expected)).max())


# -- motions -------------------------------------------------------------------------------


def test_a_parallelogram_stays_one_through_its_change_points():
    r = moved(parallelogram(), Q, "dyad.C.p", "dyad.j.omega", "dyad.i.omega")
    assert off(r["dyad.C.p"], 0.4 + 0.25 * np.exp(1j * Q)) < PLACE
    assert off(r["dyad.j.omega"], 1.0) < RATE
    assert off(r["dyad.i.omega"], 0.0) < RATE


def test_an_antiparallelogram_stays_one_as_well():
    """Its coupler's instantaneous centre: the rates of both cranks are in the ratio e."""
    r = moved(parallelogram(start=(math.pi / 2, -1)), Q, "dyad.C.p", "dyad.j.omega")
    C = np.asarray(r["dyad.C.p"])
    mirrored = np.abs(C - 0.25 * np.exp(1j * Q)) - 0.4  # the coupler keeps its length
    assert off(mirrored, 0.0) < PLACE
    assert (np.asarray(r["dyad.j.omega"]) < 0).all()  # the cranks turn against each other
    assert np.abs(np.diff(C)).max() < 0.25 * 4.5 * 0.1  # its fastest rate is 13/3


def test_a_slider_passes_the_middle_of_cardans_circles():
    r = moved(isosceles(), Q, "dyad.j.p", "dyad.j.v", "dyad.i.omega")
    assert off(r["dyad.j.p"], 2 * np.cos(Q)) < PLACE
    assert off(r["dyad.j.v"], -2 * np.sin(Q)) < RATE
    assert off(r["dyad.i.omega"], -1.0) < RATE


def test_a_guide_through_a_pin_on_the_circle_turns_at_half_the_rate():
    r = moved(half_rate(), Q, "dyad.j.omega", "dyad.j.angle")
    assert off(r["dyad.j.omega"], 0.5) < RATE
    turned = np.exp(1j * (np.asarray(r["dyad.j.angle"]) - Q / 2))
    assert off(turned, turned[0]) < PLACE


def test_a_kite_is_the_same_again_after_two_turns():
    once, twice = (moved(kite(), Q + k * TURN, "dyad.j.angle", "dyad.j.omega") for k in (1, 2))
    result = moved(kite(), Q, "dyad.j.angle", "dyad.j.omega")
    assert off(np.exp(1j * twice["dyad.j.angle"]), np.exp(1j * result["dyad.j.angle"])) < PLACE
    assert off(np.exp(1j * once["dyad.j.angle"]), np.exp(1j * result["dyad.j.angle"])) > 0.1
    path = np.unwrap(result["dyad.j.angle"])
    omega = result["dyad.j.omega"]
    middle = np.diff(path) - np.diff(Q) * (omega[1:] + omega[:-1]) / 2
    assert np.abs(middle).max() < 1e-3  # the trapezium rule at 0.1 rad: no jump anywhere
    assert system_of(kite().compile()).period == pytest.approx(2 * TURN)


def test_a_slide_drives_a_dyad_through_its_change_point():
    """Two rods of 1 m over a base of length q, which the slide shortens to nothing and beyond."""
    graph = pushed(1.0, 1.0, 0j, branch="follow", home=home(1.0, 1, "ram"))
    q = np.linspace(-1.9, 1.9, 40)
    r = moved(graph, q, "dyad.C.p")
    assert off(r["dyad.C.p"], q / 2 - 1j * np.sqrt(1 - q**2 / 4)) < PLACE


@cache
def chain():
    return bm.Graph.load(GRAPHS / "n_four_bar.json").compile()


def test_forty_four_bars_change_at_the_same_two_places():
    points_of_dyads = {followed.points for followed in chain().structure.followed.values()}
    (points,) = points_of_dyads
    assert off(points, (0.0, math.pi)) < 1e-13
    r = chain().run(at=Q, rates=1.0, want=["loop40.C.p", "loop40.j.omega"])
    assert off(r["loop40.C.p"], 40 + np.exp(1j * Q)) < 40 * PLACE
    assert off(r["loop40.j.omega"], 1.0) < 40 * RATE


def test_the_answer_depends_on_the_sample_alone():
    mech = kite().compile()
    want = ["dyad.j.angle", "dyad.j.omega"]
    batch = mech.run(at=Q, rates=1.0, want=want, engine="numpy")
    backward = mech.run(at=Q[::-1], rates=1.0, want=want, engine="numpy", chunk=7)
    single = mech.run(at=Q, rates=1.0, want=want, engine="scalar")
    for name in want:
        assert (batch[name] == backward[name][::-1]).all()
        assert off(batch[name], single[name]) < RATE


def test_home_may_stand_anywhere_on_the_way():
    angles = moved(kite(), Q, "dyad.j.angle")["dyad.j.angle"]
    moved_home = four_bar(1.0, 2.0, 2.0, 1.0, start=(1.0 + TURN, -1))  # one change point further
    assert (moved(moved_home, Q, "dyad.j.angle")["dyad.j.angle"] == angles).all()


# -- at and near a change point ------------------------------------------------------------


@pytest.mark.parametrize("q", [0.0, math.pi, -math.pi, 1e-9, 1e-4, 3 * math.pi])
def test_at_a_change_point_there_is_no_answer_and_a_flag_says_why(q):
    mech = parallelogram().compile()
    r = mech.run(at=[q, 1.0], rates=1.0, want=["dyad.j.omega"], on_gap="mark")
    assert np.isnan(r["dyad.j.omega"][0])
    assert np.isfinite(r["dyad.j.omega"][1])
    assert ("change-point", "dyad") in {(f.code, f.where) for f in r.quality.flags if f.sample == 0}
    with pytest.raises(SingularError, match="its two modes meet there"):
        mech.run(at=[q], rates=1.0, want=["dyad.j.omega"])


@pytest.mark.parametrize("point", [0.0, math.pi])
@pytest.mark.parametrize("d", [1e-1, 3e-2, 1e-3, 5e-4, 2e-4])
def test_near_a_change_point_digits_are_lost_as_documented(point, d):
    """A place loses eps/d, a rate eps/d^2, an acceleration eps/d^3; ten times that at most."""
    want = ("dyad.C.p", "dyad.j.omega", "dyad.j.alpha")
    r = moved(four_bar(1.0, 1.0, 1.0, 1.0), [point - d, point + d], *want)
    assert off(r["dyad.C.p"], 1 + np.exp(1j * np.array([point - d, point + d]))) < 10 * EPS / d
    assert off(r["dyad.j.omega"], 1.0) < 10 * EPS / d**2
    assert off(r["dyad.j.alpha"], 0.0) < 10 * EPS / d**3
    codes = {f.code for f in r.quality.flags}
    assert codes == ({"near-change-point"} if d < 1e-2 else set())


@pytest.mark.parametrize("apart", [1e-6, 1e-9, 1e-11, -1e-9, -1e-11])
def test_a_dyad_that_only_comes_near_keeps_its_branch(apart):
    followed = four_bar(0.25, 0.4 + apart, 0.25, 0.4).compile().structure.followed["dyad"]
    assert followed.points == ()


@pytest.mark.parametrize("apart", [1e-14, -1e-14])
def test_lengths_but_for_rounding_make_a_parallelogram(apart):
    followed = four_bar(0.25, 0.4 + apart, 0.25, 0.4).compile().structure.followed["dyad"]
    assert off(np.array(followed.points), (0.0, math.pi)) < 1e-13


def test_limits_name_the_change_points():
    (arc,) = parallelogram().compile().limits().arcs
    assert [(p.block, p.how) for p in arc.change_points] == [
        ("dyad", "folded"),
        ("dyad", "extended"),
    ]


# -- dynamics ------------------------------------------------------------------------------

SPIN = {"crank": (1.0, 8.0)}


@pytest.mark.parametrize("made", [parallelogram, isosceles, half_rate, kite])
def test_energy_is_kept_through_change_points(made):
    mech = made().compile()
    energies = ["mechanism.kinetic_energy", "mechanism.potential_energy"]
    r = mech.simulate(times=np.linspace(0, 5, 41), start=SPIN, want=[*energies, "crank.q"])
    total = r[energies[0]] + r[energies[1]]
    assert r.motion.method == "energy"
    assert abs(r["crank.q"][-1] - 1.0) > 2 * TURN
    # outputs are poses of their own, which may fall near a change point: 1e-3 rad is not met
    assert np.abs(total / total[0] - 1).max() < 40 * EPS / 1e-3**2


@pytest.mark.parametrize(
    ("made", "method", "accuracy"),
    [
        (parallelogram, "dop853", 1e-9),
        (isosceles, "radau", 1e-6),
        (half_rate, "dop853", 1e-9),
        (kite, "radau", 1e-6),
    ],
)
def test_integrators_pass_change_points_as_energy_does(made, method, accuracy):
    mech = made().compile()
    times = np.linspace(0, 3, 7)
    reference = mech.simulate(times=times, start=SPIN)["crank.q"]
    r = mech.simulate(times=times, start=SPIN, method=method, accuracy=accuracy)
    assert (r.motion.status, r.motion.end) == ("reached", "time")
    assert off(r["crank.q"], reference) <= max(accuracy, r.motion.error)


@pytest.mark.parametrize("method", ["energy", "dop853"])
def test_the_benchmark_turns_for_twenty_seconds(method):
    times = [0.5, 1.0, 5.0, 10.0, 20.0][: 5 if method == "energy" else 2]
    q, rate = machines.n_four_bar(times)
    r = chain().simulate(times=times, method=method)
    tolerance = {"energy": 1e-11, "dop853": 1e-9}[method]
    assert off(r["crank.q"], q) < tolerance
    assert off(r["crank.rate"], rate) < 10 * tolerance  # it speeds up at up to 11 rad/s2
    assert off(r["crank.q"], q) <= r.motion.error


def test_a_given_branch_turns_back_at_the_same_place():
    """Without following, the margin's zero is the end of the motion."""
    mech = parallelogram(branch=1).compile()
    motion = mech.simulate("time=3", method="dop853", start={"crank": (1.0, 8.0)}).motion
    assert motion.end == "dead centre"


# -- what is refused -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("said", "code", "part"),
    [
        ({"branch": "follow"}, "missing-key", 'needs a "home"'),
        ({"branch": 1, "home": home(1.0, 1)}, "unknown-key", "no meaning with branch 1"),
        ({"branch": "folow"}, "wrong-value", 'must be -1, 1 or "follow"'),
        ({"branch": "follow", "home": {"drivers": {}, "branch": 1}}, None, "drivers"),
        ({"branch": "follow", "home": home(1.0, 0)}, "wrong-value", "-1 or 1"),
    ],
)
def test_blocks_that_say_it_wrong_are_refused(said, code, part):
    with pytest.raises(GraphError) as caught:
        bm.RRR(l_i=1.0, l_j=1.0, **said)
    (problem,) = caught.value.problems
    assert problem.code == (code or problem.code)
    assert part in str(problem)


def test_a_home_at_a_change_point_or_beyond_reach_is_refused():
    for q in (0.0, math.pi):
        with pytest.raises(GraphError, match="stands at a change point"):
            parallelogram(start=(q, 1)).compile()
    with pytest.raises(GraphError, match="does not close"):
        four_bar(2.0, 1.0, 1.0, 1.0, start=(2.0, 1)).compile()


def test_several_drivers_and_wrong_names_are_told_by_check():
    graph = crank(0.5, bar(1.0, 0.5), gravity=G, D=(1.0, 0.0))
    graph.add("other", bm.Crank(length=0.5))
    graph.connect("frame.D", "other.A")
    graph.add("dyad", bm.RRR(l_i=1.0, l_j=1.0, branch="follow", home=home(1.0, 1)))
    wire(graph, "crank.B dyad.B", "other.B dyad.D")
    (problem,) = graph.check()
    assert (problem.code, problem.where) == ("many-drivers", "dyad.branch")
    wrong = crank(0.25, bar(1.0, 0.25), gravity=G, D=(0.4, 0.0))
    wrong.add("dyad", bm.RRR(l_i=0.4, l_j=0.25, branch="follow", home=home(1.0, 1, "krank")))
    wire(wrong, "crank.B dyad.B", "frame.D dyad.D")
    (problem,) = wrong.check()
    assert (problem.code, problem.where) == ("wrong-home", "dyad.home.drivers")


def test_it_is_written_and_read_again():
    text = parallelogram().to_json()
    assert '"branch": "follow"' in text
    assert '"home": {"drivers": {"crank": 1.5707963267948966}, "branch": 1}' in text
    assert loads(text).to_json() == text
    data = json.loads(text)
    del data["blocks"]["dyad"]["home"]
    with pytest.raises(FormatError, match='needs a "home"'):
        loads(json.dumps(data))


def test_single_precision_is_blind_where_its_own_digits_end():
    mech = parallelogram().compile()
    d = 1e-3  # eps^(1/4) is 2e-2 in single precision, 1e-4 in double
    request = {"rates": 1.0, "want": ["dyad.j.omega"], "on_gap": "mark", "engine": "numpy"}
    single = mech.run(at=[d, 1.0], precision="complex64", **request)["dyad.j.omega"]
    double = mech.run(at=[d, 1.0], **request)["dyad.j.omega"]
    assert np.isnan(single[0])
    assert abs(single[1] - 1) < 1e-5
    assert off(double, 1.0) < 10 * EPS / d**2


def test_the_pose_at_home_is_the_one_that_home_says():
    r = moved(parallelogram(), [math.pi / 2], "dyad.B.p", "dyad.C.p", "dyad.D.p")
    B, C, D = (complex(r[f"dyad.{name}.p"][0]) for name in "BCD")
    assert ((D - B).conjugate() * (C - B)).imag > 0
    assert cmath.isclose(C, 0.4 + 0.25j)
