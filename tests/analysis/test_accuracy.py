"""Asked for an accuracy, a run chooses its settings and tells the error it estimates."""

from __future__ import annotations

import math
from functools import cache

import mpmath
import numpy as np
import pytest
from mpmath import mp

import blockmech as bm
from blockmech.analysis import accuracy
from blockmech.analysis.trade import trade
from blockmech.analysis.trade.rotated import rotated_run
from blockmech.mechanism import Mechanism
from blockmech.result.samples import make_samples
from blockmech.testing.strategies import KINDS, Options, Seeded, random_mechanism
from tests.gallery import JOINTS, SHORT, mechanism
from tests.machines import fourbar, ruiz, watt, wire

TARGETS = (1e-3, 1e-7, 1e-12)
SAMPLES = 121
WANT = ("*.drive", "*.omega", "*.alpha", "*.reaction", "*.J_red")
DOUBLE = float(np.finfo(np.float64).eps)
LONG = bool(np.finfo(np.longdouble).eps < DOUBLE)
NOISE = 1e-9  # outputs this much smaller than others of their unit are zero up to rounding


@cache
def reference(name: str):
    """The turned mechanism in the widest numbers, friction by 60 successive approximations."""
    mech = mechanism(name)
    samples = make_samples(mech._coordinate_units, mech.scene, samples=SAMPLES)
    settings = {"want": WANT, "static": False, "friction": bm.friction.Successive(iterations=60)}
    rotated = rotated_run(mech, samples, "clongdouble", settings)
    unsure = {f.sample for f in rotated.quality.flags}
    good = [i for i in range(SAMPLES) if i not in unsure and rotated.quality.status[i] == "ok"]
    return rotated, good


def true_error(name: str, run: bm.Result) -> float:
    rotated, good = reference(name)
    rate = max(float(np.max(np.abs(v))) for k, v in run.samples.inputs.items() if k[:3] == "qd_")
    result = {n: np.abs(rotated[n][good]) for n in run}
    size = {n: float(np.max(x, initial=0.0)) for n, x in result.items()}
    worst = 0.0
    for name_, exact in result.items():
        unit = run.unit(name_)
        largest = max(size[n] for n in run if run.unit(n) == unit)
        largest = max(largest, rate**2 if unit == "rad/s2" else 0.0)
        scale = size[name_] if size[name_] > NOISE * largest else largest
        # Magnitudes do not turn with the mechanism; the direction is judged by `trade`.
        gap = np.abs(np.abs(run[name_][good]) - exact)
        worst = max(worst, float(np.max(gap, initial=0.0)) / (scale or 1.0))
    return worst


@pytest.mark.parametrize("target", TARGETS[::2])  # those between: of what a trade recommends
@pytest.mark.parametrize("name", SHORT)
def test_the_true_error_is_within_the_estimate_and_that_within_the_target(
    name: str, target: float
) -> None:
    mech = mechanism(name)
    if any(d not in mech.scene.drive for d in mech.drivers):
        with pytest.raises(bm.RequestError, match="no law of motion"):
            mech.run(samples=SAMPLES, want=WANT, accuracy=target)
        return
    run = mech.run(samples=SAMPLES, want=present(mech), accuracy=target, on_gap="mark")
    assert true_error(name, run) <= run.accuracy.estimate
    assert run.accuracy.reached == (run.accuracy.estimate <= target)
    assert run.accuracy.reached or target < 1e-9


@pytest.mark.usefixtures("one_repeat")
@pytest.mark.parametrize("name", ["ruiz_fourbar", "engine", "whitworth_shaper"])
def test_a_sweep_as_recommended_by_a_trade_is_within_its_target(name: str) -> None:
    mech = mechanism(name)
    result = trade(mech, want=present(mech), budget=60.0, samples=SAMPLES)
    for target in TARGETS:
        best = result.best(target)
        assert best in result.pareto if best else target < 1e-9
        if best:
            fresh = mech.run(samples=SAMPLES, want=present(mech), on_gap="mark", **best.options)
            assert true_error(name, fresh) <= target


def present(mech: Mechanism) -> tuple[str, ...]:
    """The wanted patterns that match an output of this mechanism."""
    return tuple(w for w in WANT if any(n.endswith(w[1:]) for n in mech.outputs))


def test_a_loose_target_takes_fewer_approximations_than_a_tight_one() -> None:
    mech = ruiz().compile()
    chosen = [mech.run(samples=73, accuracy=a).accuracy for a in (1e-1, 1e-4, 1e-8, 1e-13)]
    counts = {"none": 0, "single": 1, "newton": 99}
    steps = [c.iterations or counts[c.friction] for c in chosen if c is not None]
    assert steps == sorted(steps)
    assert steps[0] <= 1
    assert steps[-1] > 5


def test_single_precision_is_taken_for_long_sweeps_without_friction_only() -> None:
    mech = watt().compile()
    sweep = mech.run(samples=5001, want="*.omega", accuracy=1e-3)
    assert sweep.accuracy.precision == "complex64"
    exact = mech.run(samples=5001, want="*.omega")
    scale = max(float(np.abs(exact[n]).max()) for n in exact)
    assert max(float(np.abs(sweep[n] - exact[n]).max()) for n in exact) / scale <= 1e-3
    short = mech.run(samples=101, want="*.omega", accuracy=1e-3)
    assert short.accuracy.precision == "complex128"


def test_a_sweep_that_is_compiled_stays_in_double_precision() -> None:
    pytest.importorskip("llvmlite", reason="the compiled engine needs the extra fast")
    mech, want = watt().compile(), "first.i.omega"
    mech.run(samples=3, want=want, engine="llvm")
    run = mech.run(samples=5001, want=want, accuracy=1e-3)
    assert (run._engine, run.accuracy.precision) == ("llvm", "complex128")


def test_a_request_that_comes_again_costs_its_run_alone(monkeypatch) -> None:
    mech = ruiz().compile()
    request = {"samples": 37, "want": "crank.drive", "accuracy": 1e-6}
    first, finer = (mech.run(**request | options) for options in ({}, {"samples": 38}))
    first = mech.run(**request)
    monkeypatch.setattr(accuracy, "look", lambda *arguments: 1 / 0)
    again = mech.run(**request)
    assert again.accuracy == first.accuracy != finer.accuracy
    np.testing.assert_array_equal(again["crank.drive"], first["crank.drive"])
    for options in ({"samples": 38}, {"accuracy": 1e-7}, {"static": True}, {"want": "*.reaction"}):
        with pytest.raises(ZeroDivisionError):
            mech.run(**request | options)


@pytest.mark.skipif(not LONG, reason="no number here is wider than double")
def test_rounding_is_estimated_with_the_friction_that_amplifies_it() -> None:
    case = random_mechanism(Seeded(111), Options(kinds=KINDS, groups=(1, 4)))
    mech = case.graph.compile()
    home = {name: np.ravel(x)[0] for name, x in case.request["at"].items()}
    request = {**case.request, "at": {d: q + np.linspace(-0.3, 0.3, 3001) for d, q in home.items()}}
    run = mech.run(**request, want="*", accuracy=1e-6)
    exact = mech.run(**request, want="*", precision="clongdouble", engine="numpy")
    assert max(float(c.max()) for c in run.quality.contraction.values()) > 0.8
    name = "mechanism.shaking_moment"
    error = np.abs(run[name] - exact[name]).max() / np.abs(exact[name]).max()
    assert 2 * DOUBLE < error <= run.accuracy.estimate <= 1e-6


def test_what_cannot_be_reached_is_said() -> None:
    run = ruiz().compile().run(samples=73, accuracy=1e-25)
    assert not run.accuracy.reached
    assert run.accuracy.word != "reached"
    assert str(run.accuracy).endswith(("accuracy not reached", "accuracy not judged"))
    assert run.accuracy.estimate > 1e-25


@pytest.mark.skipif(not LONG, reason="no numbers here are wider than double precision")
def test_a_document_gives_its_lengths_no_more_digits_than_double_precision() -> None:
    """The press as a graph has its lengths as they are meant; the document derives them."""
    want = ("crank.drive", "driver.motor.drive")
    intended = mechanism("toggle_press").run(samples=65, want=want[0], precision="clongdouble")
    document = bm.Linkage.load(JOINTS / "toggle_press.json").compile()
    run = document.run(samples=65, want=want[1], accuracy=1e-15)
    off = np.abs(run[want[1]] - intended[want[0]]).max() / np.abs(intended[want[0]]).max()
    assert run.accuracy.precision == "clongdouble"
    assert DOUBLE / 4 < off <= run.accuracy.estimate  # beyond what the numbers could hold
    assert not run.accuracy.reached


def test_where_iterations_may_not_converge_newton_is_taken() -> None:
    run = ruiz(radius=1.0).compile().run(samples=37, accuracy=1e-2, on_gap="mark")
    assert run.accuracy.friction == "newton"


def test_the_choice_stands_in_the_json() -> None:
    data = ruiz().compile().run(samples=5, want="crank.drive", accuracy=1e-6).to_dict()
    assert data["accuracy"]["target"] == 1e-6
    assert data["accuracy"]["estimate"] <= 1e-6
    assert data["accuracy"]["friction"] == "successive"


@pytest.mark.parametrize(
    "setting",
    [
        {"friction": "none"},
        {"friction": bm.friction.Successive(iterations=3)},
        {"precision": "complex64"},
    ],
)
def test_an_accuracy_and_a_setting_that_it_chooses_exclude_each_other(setting) -> None:
    with pytest.raises(bm.RequestError, match="give the accuracy or the setting"):
        ruiz().compile().run(at=1.0, accuracy=1e-6, **setting)


@pytest.mark.parametrize("accuracy", [0.0, -1.0, math.nan, math.inf])
def test_an_accuracy_is_a_positive_number(accuracy: float) -> None:
    with pytest.raises(bm.RequestError, match="must be > 0"):
        ruiz().compile().run(at=1.0, accuracy=accuracy)


def test_a_looser_accuracy_of_a_simulation_is_met_wherever_a_tighter_one_is() -> None:
    graph = watt()
    graph.add("motor", bm.Motor(law={"kind": "fourier", "of": "time", "period": 0.7, "sines": [9]}))
    wire(graph, "frame.frame motor.a", "crank.crank motor.b")
    mech, start = graph.compile(), {"crank": (0.3, 6.0)}
    runs = [mech.simulate("time=1", start=start, accuracy=a) for a in (1e-3, 1e-6, 1e-9)]
    motions = [run.motion for run in runs if run.motion is not None]
    assert [m.reached for m in motions] == [True] * 3
    rough = mech.simulate("time=1", start=start, accuracy=1e-6, method="radau").motion
    assert rough is not None
    assert abs(rough.q_end - motions[-1].q_end) <= rough.error + motions[-1].error


@pytest.mark.parametrize("request_", [{"at": 0.0}, {"at": [0.0, math.pi]}, {"samples": 3}])
def test_friction_is_judged_also_where_a_joint_stands_still(request_) -> None:
    mech = ruiz().compile()
    run = mech.run(**request_, want="crank.drive", accuracy=1e-6)
    exact = mech.run(**request_, want="crank.drive", friction="newton")
    assert run.accuracy.reached
    error = np.abs(run["crank.drive"] - exact["crank.drive"]).max()
    assert error <= run.accuracy.estimate * np.abs(exact["crank.drive"]).max()


@pytest.mark.parametrize("off", [1e-7, 1e-9, 1e-11])
def test_what_stands_beside_a_dead_centre_only_is_judged_there(off: float) -> None:
    """Its error was infinite, by its own word."""
    mech = fourbar(4.0, 3.0, 2.0, 3.5).compile()
    q = mech.limits().arcs[0].end.q - off
    exact = rocker_rate(q)
    for target in (1e-4, 1e-12):
        run = mech.run(at=q, rates=1.0, want="dyad.j.omega", accuracy=target)
        assert abs(float(run["dyad.j.omega"][0]) / exact - 1) <= run.accuracy.estimate < 1e-4
        assert run.accuracy.reached == (target == 1e-4)


def rocker_rate(q: float) -> float:
    """Rate of the rocker of the linkage above, at the rate 1 of its crank, by 50 digits."""
    with mpmath.workdps(50):
        B = 4 * mpmath.expj(q)
        d = mpmath.mpf("3.5") - B
        r = abs(d)
        projection = (9 - 4 + r**2) / (2 * r)
        u = d / r * (projection + 1j * mpmath.sqrt(9 - projection**2))
        w = u - d
        return float(mpmath.re(1j * B * mpmath.conj(u)) / mpmath.re(1j * w * mpmath.conj(u)))


def test_what_stands_at_a_dead_centre_itself_is_not_judged_and_taken_most_exactly() -> None:
    run = mechanism("elliptic_trammel").run(at=0.5, rates=0.0, want="bar.C.p", accuracy=1e-12)
    assert not run.accuracy.reached
    assert run.accuracy.friction == "newton"
    assert run.accuracy.word == "not judged"
    assert "at or near a dead centre, so by their margins: 1 sample" in str(run.accuracy)


@pytest.mark.parametrize("off", [1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-10, 1e-13])
def test_beside_a_change_point_no_error_is_understated(off: float) -> None:
    q = math.pi - off
    g = fourbar(1.0, 2.0, 4.0, 5.0)
    run = g.run(at=[q], rates=1.0, want="dyad.j.omega", accuracy=1e-9, on_gap="mark")
    with mp.workdps(60):
        b = mp.expj(mp.mpf(q))
        offset = 5 - b
        r, toward = abs(offset), offset / abs(offset)
        x = (4 - 16 + r * r) / (2 * r)
        up = toward * mp.mpc(x, mp.sqrt(4 - x * x))  # from B to C, left of B -> D
        down = up - offset  # from D to C
        v = mp.mpc(0, 1) * b
        right = float((mp.conj(up) * v).real / (mp.conj(up) * mp.mpc(0, 1) * down).real)
    got = float(run["dyad.j.omega"][0])
    if run.accuracy.word == "not judged":
        assert run.accuracy.estimate >= 1
    else:
        assert abs(got / right - 1) <= run.accuracy.estimate


@pytest.mark.parametrize("accuracy", [None, 1e-15])
def test_states_of_a_controller_are_refused_with_an_accuracy_as_without(accuracy):
    mech = mechanism("control/speed_controlled_fourbar")
    with pytest.raises(bm.RequestError, match="states of signal blocks"):
        mech.run(at=[0.1, 0.7], accuracy=accuracy)
