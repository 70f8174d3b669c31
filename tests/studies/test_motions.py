"""A study of motions keeps of each design what a simulation of it alone says."""

import math
import os
import signal

import numpy as np
import pytest

import blockmech as bm
from blockmech.cli import main
from blockmech.studies.family import remade
from blockmech.studies.motions import MotionRunner, settling
from tests import machines
from tests.dynamics.scenes import bare_rod, slide
from tests.gallery import GRAPHS, mechanism

MASS = "crank.links.crank.mass"
FALL = {"until": "standstill"}


@pytest.mark.parametrize("designs", [3, 40])  # each by itself, and side by side
def test_the_budget_is_that_of_each_design(designs):
    masses, want = np.linspace(1.0, 2.0, designs), "motion.t_end"
    long = {"until": "time=20", "method": "dop853"}
    study = fallen().study({MASS: masses}, want=want, simulate={**long, "budget": 1e-6})
    assert set(study.status) == {"ended-early"}
    assert all(why.startswith("budget, after") for why in study.found.place)
    enough = {**long, "budget": "1 min"}
    assert set(fallen().study({MASS: masses}, want=want, simulate=enough).status) == {"ok"}
    with pytest.raises(bm.RequestError, match="budget"):
        fallen().study({MASS: masses}, want=want, simulate={**long, "budget": -1.0})


def test_columns_are_those_of_single_simulations():
    watt, masses = mechanism("watt_sixbar"), [0.5, 1.0, 2.0]
    reductions = ["max_abs(crank.rate)", "final(first.C.p)", "mean(mechanism.kinetic_energy)"]
    facts = ["motion.t_end", "motion.q_end", "motion.error", "motion.fluctuation"]
    study = watt.study({MASS: masses}, want=[*reductions, *facts], simulate=FALL)
    for k, mass in enumerate(masses):
        outputs = ["crank.rate", "first.C.p", "mechanism.kinetic_energy"]
        run = remade(watt, {MASS: mass}).simulate("standstill", want=outputs)
        m = run.motion
        fine = remade(watt, {MASS: mass}).simulate(
            "standstill", want="crank.rate", times=np.linspace(0.0, m.t_end, 200_001)
        )
        largest = np.abs(fine["crank.rate"]).max()
        assert study["max_abs(crank.rate)"][k] == pytest.approx(largest, rel=1e-8)
        assert np.abs(run["crank.rate"]).max() < largest * (1 - 1e-4)
        assert study["final(first.C.p)"][k] == run["first.C.p"][-1]
        energy = run["mechanism.kinetic_energy"]
        assert study["mean(mechanism.kinetic_energy)"][k] == pytest.approx(energy.mean(), rel=1e-14)
        expected = [m.t_end, m.q_end, m.error, m.fluctuation(0.0, m.t_end)]
        assert [study[name][k] for name in facts] == expected
    assert study.status == ("ok",) * 3
    assert study.unit("motion.t_end") == "s"
    assert study.unit("final(first.C.p)") == "m"


def test_the_period_of_a_pendulum_from_three_lengths():
    """Swings of 5, 60 and 120 degrees: the period by the arithmetic-geometric mean."""
    swings = np.radians([5.0, 60.0, 120.0])
    rod = bare_rod()
    rod.start("crank", q=0.0)
    study = rod.compile().study(
        {"scene.initial.crank.q": -math.pi / 2 + swings},
        want=["motion.t_end", "poses(crank.q)"],
        simulate={**FALL, "times": np.linspace(0.0, 3.0, 31)},
    )
    for swing, half, row in zip(
        swings, study["motion.t_end"], study["poses(crank.q)"], strict=True
    ):
        a, b = 1.0, math.cos(swing / 2)
        while abs(a - b) > 1e-15:
            a, b = (a + b) / 2, math.sqrt(a * b)
        exact = math.pi * math.sqrt(2 / 3 / 9.81) / a
        assert half == pytest.approx(exact, rel=1e-12)
        finite = np.linspace(0.0, 3.0, 31) <= half
        assert np.isfinite(row).tolist() == finite.tolist()


def test_time_to_rest_is_where_friction_stops_it():
    data = bm.Graph.load(GRAPHS / "motions/pin_pendulum.json")
    address = "crank.friction.A.coefficient"
    study = data.compile().study(
        {address: [0.6, 1.0]}, want=["motion.time_to_rest", "motion.standstills"],
        simulate={"until": "time=60"},
    )  # fmt: skip
    for k, mu in enumerate((0.6, 1.0)):
        motion = data.replace({address: mu}).compile().simulate("time=60", want=[]).motion
        rests = [e.t for e in motion.events if e.kind == "rest"]
        assert study["motion.time_to_rest"][k] == rests[-1]
        standstills = sum(e.kind == "standstill" for e in motion.events)
        assert study["motion.standstills"][k] == standstills


def test_settling_of_a_damped_slide():
    """A line through x'' + 2 d x' + w^2 x = 0: where the envelope's last swing leaves the band."""
    t = np.linspace(0.0, 3.0, 3001)
    want = ["settling(slider.q)", "settling(slider.q, 0.1)"]
    study = slide(damping=4.0).study(
        {"spring.damping": [4.0, 8.0]},
        want=want,
        simulate={"times": t, "start": {"slider": (0.2, 0.0)}},
    )
    for k, damping in enumerate((4.0, 8.0)):
        d = damping / 4.0
        w = math.sqrt(25.0 - d * d)
        x = 0.2 * np.exp(-d * t) * (np.cos(w * t) + d / w * np.sin(w * t))
        off = np.abs(x - x[-1])
        for label, share in zip(want, (0.02, 0.1), strict=True):
            last = t[np.flatnonzero(off > share * off.max())[-1]]
            assert last <= study[label][k] <= last + 1e-3
    assert settling(np.array([0.0, 1.0, 2.0, 3.0]), np.array([1.0, 0.5, 0.0, 0.0]), 0.25) == 1.5
    assert settling(np.arange(3.0), np.ones(3)) == 0.0


def test_a_design_without_a_motion_is_a_row_with_its_reason():
    watt = mechanism("watt_sixbar")
    study = watt.study(
        {"first.l_i": [watt.parameters()["first.l_i"].value, 0.3]},
        want=["motion.t_end", "max(crank.rate)"],
        simulate=FALL,
    )
    assert study.status[0] == "ok"
    assert study.status[1] in ("no-motion", "ended-early")
    assert study.reason(1).startswith(study.status[1] + ": ")
    assert np.isnan(study["motion.t_end"][1])
    assert np.isnan(study["max(crank.rate)"][1])
    assert not study.reason(0)
    rod = bare_rod()
    rod.start("crank", q=0.0)
    rod.add_stop("crank", -1.0, 1.0)
    stopped = rod.compile().study({MASS: [1.0]}, want="motion.t_end", simulate=FALL)
    assert stopped.reason(0).startswith("ended-early: end stop, after 0.")
    steady = bare_rod()
    steady.start("crank", q=0.0)
    none = steady.compile().study({MASS: [1.0]}, want="motion.time_to_rest", simulate=FALL)
    assert none.reason(0) == "no-number: motion.time_to_rest"


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"want": "motion.t_end", "simulate": {"untl": "standstill"}}, 'did you mean "until"'),
        ({"want": "motion.t_end", "simulate": {"until": "swing"}}, "no stopping condition"),
        ({"want": "motion.t_end", "simulate": {"method": "verlet"}}, 'no method "verlet"'),
        ({"want": "motion.t_ends", "simulate": FALL}, "motion.t_ends"),
        ({"want": "at(crank.q, 1.0)", "simulate": FALL}, "no reduction"),
        ({"want": "settling(crank.q, 2)", "simulate": FALL}, "between 0 and 1"),
        ({"want": "motion.t_end", "simulate": FALL, "samples": 10}, "samples"),
        ({"want": "motion.t_end", "simulate": {**FALL, "want": "crank.q"}}, 'no argument "want"'),
        ({"want": "motion.t_end", "simulate": FALL, "engine": "numpy"}, "no engine"),
    ],
)
def test_what_cannot_be_is_refused(options, text):
    rod = bare_rod()
    rod.start("crank", q=0.0)
    with pytest.raises(bm.RequestError, match=text):
        rod.compile().study({MASS: [1.0, 2.0]}, **options)


def test_objective_has_derivatives_by_differences():
    """Time of a fall from level to the other side does not hang on mass; on length by a root."""
    rod = bare_rod()
    rod.start("crank", q=0.0)
    addresses = ["crank.links.crank.inertia", "scene.gravity.y"]
    f = rod.compile().objective(addresses, want="motion.t_end", simulate=FALL)
    inertia, g = f.start
    t = f(f.start)
    exact = [t / 2 / (inertia + 0.25), -t / 2 / g]  # t ~ sqrt((I + m l^2 / 4) / g)
    np.testing.assert_allclose(f.jacobian(f.start), exact, rtol=1e-9)
    assert f([-1.0, g]) == math.inf


def test_parts_in_a_folder_and_by_processes(tmp_path):
    pytest.importorskip("pyarrow", reason="the extra study is not installed")
    rod = bare_rod()
    rod.start("crank", q=0.0)
    mech, masses = rod.compile(), np.linspace(1.0, 2.0, 300)
    settings = {"want": ["motion.t_end", "max_abs(crank.rate)"], "simulate": FALL}
    local = mech.study({MASS: masses}, **settings)
    study = mech.study({MASS: masses}, out=tmp_path / "parts", workers=2, **settings)
    for label in settings["want"]:
        np.testing.assert_array_equal(local[label], study[label])
    assert local.status == study.status
    assert len(list((tmp_path / "parts").iterdir())) == 2
    assert "300 designs in motion, until standstill" in repr(local)
    local.to_csv(tmp_path / "table.csv")
    assert (tmp_path / "table.csv").read_text("utf-8").count("\n") == 301


# -- side by side ----------------------------------------------------------------------


def fallen(gravity=9.81):
    rod = bare_rod(gravity)
    rod.start("crank", q=0.3)
    return rod.compile()


SIDE_BY_SIDE = {
    "to a standstill": (lambda: mechanism("watt_sixbar"), MASS, (0.5, 2.0), FALL),
    "some swings": (lambda: mechanism("watt_sixbar"), MASS, (0.5, 2.0), {"until": "swings=3"}),
    "to a place": (lambda: mechanism("watt_sixbar"), MASS, (0.5, 2.0), {"until": "angle=-1.5"}),
    "with a rate": (
        lambda: mechanism("watt_sixbar"),
        "scene.gravity.y",
        (-12.0, -2.0),
        {"until": "time=1", "start": {"crank": (1.0, 2.0)}},
    ),
    "squeezed": (
        lambda: mechanism("andrews_squeezer"),
        "crank.links.crank.inertia",
        (2e-6, 6e-6),
        {"until": "time=0.01"},
    ),
    "damped": (
        slide,
        "spring.damping",
        (0.0, 9.0),
        {"until": "time=2", "start": {"slider": (0.2, 0.0)}},
    ),
    "rubbed to rest": (
        lambda: bm.Graph.load(GRAPHS / "motions/pin_pendulum.json").compile(),
        "crank.friction.A.coefficient",
        (0.5, 1.5),
        {"until": "time=20", "accuracy": 1e-7},
    ),
}


@pytest.mark.parametrize("name", SIDE_BY_SIDE)
def test_motions_side_by_side_are_the_single_ones_within_their_errors(name, monkeypatch):
    pytest.importorskip("llvmlite", reason="the extra fast is not installed")
    make, address, ends, request = SIDE_BY_SIDE[name]
    mech, moved_alone = make(), []
    single = MotionRunner.moved
    monkeypatch.setattr(
        MotionRunner, "moved", lambda self, row: moved_alone.append(row) or single(self, row)
    )
    facts = ("t_end", "q_end", "error", "time_error", "standstills")
    outputs = [f"poses({mech.drivers[0]}.{quantity})" for quantity in ("q", "rate")]
    want = [*(f"motion.{x}" for x in facts), *outputs]
    values = np.linspace(*ends, 16)
    study = mech.study({address: values}, want=want, simulate=request)
    assert not moved_alone
    few = [0, 7, 15]
    alone = mech.study({address: values[few]}, want=want, simulate=request)
    assert len(moved_alone) == len(few)
    assert alone.status == ("ok",) * 3
    error = study["motion.error"][few] + alone["motion.error"]
    late = study["motion.time_error"][few] + alone["motion.time_error"]
    assert (study["motion.error"] <= (request.get("accuracy") or 1e-9)).all()
    assert (np.abs(study["motion.q_end"][few] - alone["motion.q_end"]) <= error).all()
    assert (np.abs(study["motion.t_end"][few] - alone["motion.t_end"]) <= late).all()
    assert (study["motion.standstills"][few] == alone["motion.standstills"]).all()
    moved = np.abs(study[outputs[0]][few] - alone[outputs[0]])
    assert (np.nanmax(moved, axis=1) <= error).all()
    assert (np.isnan(study[outputs[0]][few]) == np.isnan(alone[outputs[0]])).all()


def test_time_to_rest_side_by_side_is_that_of_the_closed_form():
    pytest.importorskip("llvmlite", reason="the extra fast is not installed")
    graph = GRAPHS / "motions/pin_pendulum.json"
    exact = 28.084229257323663  # tests/dynamics/motions.py, in 30 digits
    address = "crank.friction.A.coefficient"
    study = (
        bm.Graph.load(graph)
        .compile()
        .study(
            {address: np.append(0.2, np.linspace(0.3, 1.0, 20))},
            want=["motion.time_to_rest", "motion.q_end", "motion.error"],
            simulate={"until": "time=100"},
        )
    )
    assert study["motion.time_to_rest"][0] == pytest.approx(exact, abs=1e-8)
    assert abs(study["motion.q_end"][0] + 1.5570362062188914) <= study["motion.error"][0]


def test_what_arrays_cannot_decide_goes_by_itself():
    """A start in balance, an end stop, a method by name: as single simulations say."""
    pytest.importorskip("llvmlite", reason="the extra fast is not installed")
    address = "scene.gravity.y"
    g = np.append(np.linspace(-9.0, -8.0, 15), 0.0)  # without gravity the rod stays
    study = fallen().study({address: g}, want="motion.t_end", simulate=FALL)
    assert study.status == ("ok",) * 16
    assert study["motion.t_end"][-1] == 0.0
    rod = bare_rod()
    rod.start("crank", q=0.0)
    rod.add_stop("crank", -1.0, 1.0)
    stopped = rod.compile().study(
        {MASS: np.linspace(1.0, 2.0, 16)}, want="motion.t_end", simulate=FALL
    )
    assert set(stopped.status) == {"ended-early"}
    assert stopped.reason(3).startswith("ended-early: end stop, after 0.")
    bare = machines.crank()
    bare.start("crank", q=0.1)
    lengths = {"crank.length": np.linspace(1.0, 2.0, 16)}
    massless = bare.compile().study(lengths, want="motion.t_end", simulate=FALL)
    assert set(massless.status) == {"no-motion"}
    assert "no link has mass or inertia" in massless.reason(0)
    masses, want = np.linspace(1.0, 2.0, 16), ["motion.t_end", "max_abs(crank.rate)"]
    together = fallen().study({MASS: masses}, want=want, simulate=FALL)
    by_name = fallen().study({MASS: masses}, want=want, simulate={**FALL, "method": "energy"})
    np.testing.assert_allclose(together["motion.t_end"], by_name["motion.t_end"], atol=1e-9)
    assert (together["motion.t_end"] != by_name["motion.t_end"]).any()


@pytest.fixture
def ctrl_c():
    """Ctrl-C interrupts, also in a job in the background, which ignores it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("ctrl_c")
def test_an_interrupted_study_keeps_what_is_done():
    rod = bare_rod()
    rod.start("crank", q=0.0)

    def stop(task, count, total):
        if count >= 32:
            os.kill(os.getpid(), signal.SIGINT) if os.name != "nt" else signal.raise_signal(2)

    study = rod.compile().study(
        {MASS: np.linspace(1.0, 2.0, 96)},
        want="motion.t_end",
        simulate=FALL,
        progress=stop,
        engine="scalar",
    )
    assert study.interrupted
    assert 32 <= study.n < 96
    assert study.n % 16 == 0


def test_sweep_on_the_command_line(capsys):
    graph = str(GRAPHS / "watt_sixbar.json")
    arguments = ["sweep", graph, "--vary", f"{MASS}=0.5:2:4", "--want", "motion.t_end"]
    assert main([*arguments, "--until", "standstill"]) == 0
    text = capsys.readouterr().out
    assert "4 designs in motion, until standstill" in text
    assert "1.42706" in text
    assert main([*arguments, "--accuracy", "1e-6"]) == 2
    assert "--until" in capsys.readouterr().err
