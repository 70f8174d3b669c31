"""FMUs: FMPy's validation finds nothing, and its CVode moves them as `simulate` does."""

import functools
import itertools
import shutil
import zipfile

import numpy as np
import pytest

import blockmech as bm
from blockmech import signals
from blockmech.builders import opened
from blockmech.testing.strategies import EVERY, Options, Seeded, random_mechanism
from tests import machines
from tests.gallery import GRAPHS, mechanism

fmpy = pytest.importorskip("fmpy", reason="the outside judge of FMUs")
NEEDS_C = pytest.mark.skipif(
    not any(map(shutil.which, ("cc", "gcc", "clang"))), reason="needs a C compiler"
)
AGREE = 1e-7

CASES = {  # graph -> how long [s]: one driver, several, a gear pair
    "watt_sixbar": 1.0,
    "fivebar_falling": 0.2,
    "andrews_squeezer": 0.02,
    "geared_fivebar": 0.2,
}
STEPS = {"watt_sixbar": 1e-3, "fivebar_falling": 1e-4, "andrews_squeezer": 1e-5}


@pytest.fixture(scope="module")
def unit(tmp_path_factory):
    """``unit(name, fmi)``: the FMU of a graph, compiled once for all that is asked of it."""

    @functools.cache
    def written(name, fmi):
        folder = tmp_path_factory.mktemp("unit")
        step = STEPS.get(name, 1e-4)
        (path,) = bm.write(mechanism(name), folder / "m.fmu", step=step, fmi=fmi)
        return path

    return written


@NEEDS_C
@pytest.mark.parametrize(
    ("name", "fmi"),
    [
        *itertools.product(CASES, "23"),
        *(("ruiz_fourbar", "2"), ("stephenson_3_triad", "3"), ("valve_engine", "2")),
    ],
)
def test_fmpy_finds_no_problem(name, fmi, unit):
    """What moves below in both versions, what else there is in one: they share the model's text."""
    from fmpy.validation import validate_fmu

    path = unit(name, fmi)
    assert validate_fmu(str(path)) == []
    with zipfile.ZipFile(path) as archive:
        assert {"sources/unit.h", f"sources/fmi{fmi}.c"} <= set(archive.namelist())
        assert any(n.startswith("binaries/") for n in archive.namelist())


@pytest.mark.parametrize("fmi", ["2", "3"])
def test_variables_have_units_and_say_what_they_are(fmi, tmp_path):
    want = ["crank.drive", "dyad.C.reaction"]
    (path,) = bm.write(mechanism("ruiz_fourbar"), tmp_path / "m.fmu", want=want, fmi=fmi)
    model = fmpy.read_model_description(str(path))
    variables = {v.name: (v.unit, v.description) for v in model.modelVariables}
    assert variables["crank.q"] == ("rad", "coordinate of the driver")
    assert variables["crank.effort"][0] == "N m"
    unit, about = variables["dyad.C.reaction.x"]
    assert (unit, about[:25]) == ("N", "force of dyad.i on dyad.j")
    units = {unit for unit, _ in variables.values() if unit}
    assert units <= {unit.name for unit in model.unitDefinitions}


@NEEDS_C
@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("fmi", ["2", "3"])
@pytest.mark.parametrize("kind", ["ModelExchange", "CoSimulation"])
def test_it_moves_as_simulate_does(name, kind, fmi, unit):
    mech, end, path = mechanism(name), CASES[name], unit(name, fmi)
    times = np.linspace(0.0, end, 11)
    options = {"solver": "CVode", "relative_tolerance": 1e-11} if kind == "ModelExchange" else {}
    names = [mech._of_driver(d, "q") for d in mech.drivers]
    if not mech.scene.initial:
        options["start_values"] = dict.fromkeys(names, 0.5) | {
            mech._of_driver(d, "rate"): 2.0 for d in mech.drivers
        }
    result = fmpy.simulate_fmu(
        str(path), fmi_type=kind, stop_time=end, output_interval=end / 10, output=names, **options
    )
    start = dict.fromkeys(mech.drivers, (0.5, 2.0)) if "start_values" in options else None
    ours = mech.simulate(f"time={end}", times=times, want=names, accuracy=1e-10, start=start)
    for column in names:
        assert np.abs(np.interp(times, result["time"], result[column]) - ours[column]).max() < AGREE


@NEEDS_C
def test_friction_and_an_effort_count(tmp_path):
    mech = mechanism("ruiz_fourbar")
    want = ["crank.drive", "dyad.C.reaction"]
    (path,) = bm.write(mech, tmp_path / "m.fmu", want=want)
    effort = np.array([(0.0, 9000.0), (1.0, 9000.0)], [("time", float), ("crank.effort", float)])
    columns = ["crank.q", "crank.rate", "crank.acceleration", "crank.drive", "dyad.C.reaction.x"]
    start = {"crank.q": 0.3, "crank.rate": 10.0}
    result = fmpy.simulate_fmu(
        str(path),
        stop_time=0.01,
        output_interval=0.005,
        start_values=start,
        input=effort,
        output=columns,
        fmi_type="ModelExchange",
        relative_tolerance=1e-10,
    )
    for row in result:
        again = mech.run(
            at=[row["crank.q"]],
            rates=[row["crank.rate"]],
            accelerations=[row["crank.acceleration"]],
            want=want,
        )
        assert again["crank.drive"][0] == pytest.approx(9000.0, abs=1e-6)
        assert row["crank.drive"] == pytest.approx(9000.0, abs=1e-6)
        assert row["dyad.C.reaction.x"] == pytest.approx(again["dyad.C.reaction"][0].real, rel=1e-9)


def controlled_fivebar(limits=None):
    """Two motors: a continuous controller that is fed, a sampled one after a step."""
    g = bm.Graph("fivebar", gravity=(0.0, -9.81))
    g.add("frame", bm.Frame(markers={"A": (0.0, 0.0), "E": (1.5, 0.0)}))
    link = bm.Link(mass=2.0, inertia=0.3, cm=(0.5, 0.1))
    g.add("left", bm.Crank(length=1.0, links={"crank": link}))
    g.add("right", bm.Crank(length=1.1, links={"crank": link}))
    g.add("dyad", bm.RRR(l_i=1.6, l_j=1.7, branch=1, links={"i": link, "j": link}))
    ends = (("frame.A", "left.A"), ("frame.E", "right.A"), ("left.B", "dyad.B"))
    for start, end in (*ends, ("right.B", "dyad.D")):
        g.connect(start, end)
    g.add("goal", signals.Input(value=2.0))
    g.add("jump", signals.Step(value=1.2, time=0.33, before=1.0))
    controllers = {
        "left": ("goal", "frame.A", {"limits": limits}),
        "right": ("jump", "frame.E", {}),
    }
    controllers["right"][2]["sample"] = 0.01
    for crank, (goal, base, settings) in controllers.items():
        g.add(f"error_{crank}", signals.Sum(signs="+-"))
        g.add(f"pid_{crank}", signals.Pid(kp=200.0, ki=100.0, kd=40.0, **settings))
        g.add(f"motor_{crank}", bm.Motor(law=bm.laws.Signal()))
        g.connect(base, f"motor_{crank}.a")
        machines.wire(
            g,
            f"{crank}.crank motor_{crank}.b",
            f"{goal}.y error_{crank}.u0",
            f"{crank}.q error_{crank}.u1",
            f"error_{crank}.y pid_{crank}.u",
            f"pid_{crank}.y motor_{crank}.law",
        )
    g.start("left", q=1.8)
    g.start("right", q=1.0)
    return g.compile()


CONTROLLED = {  # what moves -> outputs that are compared, how long [s]
    "speed_controlled_fourbar": (["crank.q", "pid.integral", "motor.current"], 0.4),
    "sampled_fourbar": (["crank.q", "motor.current"], 0.215),
    "joints/speed_controlled_pump": (["driver.shaft.q", "pid.integral", "tacho.x1"], 0.3),
    "fivebar": (["left.q", "right.q", "pid_left.integral"], 0.36),
}


@NEEDS_C
@pytest.mark.parametrize("name", CONTROLLED)
@pytest.mark.parametrize("kind", ["ModelExchange", "CoSimulation"])
def test_signal_blocks_are_inside(name, kind, tmp_path):
    from fmpy.validation import validate_fmu

    path = GRAPHS / "control" / f"{name}.json"
    (names, end), fmi = CONTROLLED[name], "2" if kind == "ModelExchange" else "3"
    # CVode refines at the kinks of limits, where Runge-Kutta's fixed steps lose their order.
    limits = (-60, 60) if fmi == "2" else None
    mech = controlled_fivebar(limits) if name == "fivebar" else opened(path).compile()
    (path,) = bm.write(mech, tmp_path / "m.fmu", step=1e-4, fmi=fmi, want=names)
    assert validate_fmu(str(path)) == []
    options = {"solver": "CVode", "relative_tolerance": 1e-10} if fmi == "2" else {}
    result = fmpy.simulate_fmu(
        str(path), fmi_type=kind, stop_time=end, output_interval=end / 40, output=names, **options
    )
    times = np.linspace(0.0, end, 5)
    ours = mech.simulate(f"time={end}", times=times, want=names, accuracy=1e-9)
    for column in names:
        theirs = np.interp(times, result["time"], result[column])
        scale = max(1.0, np.abs(ours[column]).max())
        assert np.abs(theirs - ours[column]).max() < AGREE * scale, column


@NEEDS_C
def test_what_a_controller_outside_gives_comes_in_by_name(tmp_path):
    mech = controlled_fivebar()
    (path,) = bm.write(mech, tmp_path / "m.fmu", step=1e-3, want=["left.q"])
    stepper = mech.stepper(want=["left.q"])
    stepper.reset()
    goals = [2.0, 1.5, 2.2]
    ours = [stepper.step(0.05, {"goal": x})["left.q"][0] for x in goals]
    rows = [(0.05 * k + delay, x) for k, x in enumerate(goals) for delay in (0.0, 0.05)]
    fed = np.array(rows, [("time", float), ("goal", float)])
    result = fmpy.simulate_fmu(
        str(path),
        fmi_type="CoSimulation",
        stop_time=0.15,
        output_interval=0.05,
        input=fed,
        output=["left.q"],
    )
    assert result["left.q"][1:] == pytest.approx(ours, abs=1e-5)
    assert np.ptp(ours) > 0.01


@NEEDS_C
def test_bristles_are_states(tmp_path):
    law = bm.friction.LuGre(
        static=0.3, kinetic=0.2, stribeck_speed=0.2, stiffness=50.0, damping=0.2, radius=0.05
    )
    link = bm.Link(mass=2.0, inertia=0.3, cm=(0.5, 0.0))
    g = machines.crank(1.0, link, law, gravity=9.81, name="rod")
    g.start("rod", q=0.3)
    names = ["rod.q", "rod.A.deflection"]
    (path,) = bm.write(g, tmp_path / "m.fmu", want=names)
    result = fmpy.simulate_fmu(
        str(path),
        fmi_type="ModelExchange",
        stop_time=0.5,
        output_interval=0.01,
        output=names,
        relative_tolerance=1e-10,
    )
    times = np.linspace(0.0, 0.5, 6)
    ours = g.compile().simulate("time=0.5", times=times, want=names, accuracy=1e-9)
    for column in names:
        theirs = np.interp(times, result["time"], result[column])
        assert np.abs(theirs - ours[column]).max() < AGREE, column


def test_without_a_compiler_the_sources_are_all(tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "which", lambda name: None)
    (path,) = bm.write(mechanism("watt_sixbar"), tmp_path / "m.fmu")
    with zipfile.ZipFile(path) as archive:
        assert not any(n.startswith("binaries/") for n in archive.namelist())


def test_a_version_that_does_not_exist_is_refused(tmp_path):
    with pytest.raises(bm.RequestError, match=r'no version "1".*2, 3'):
        bm.write(mechanism("watt_sixbar"), tmp_path / "m.fmu", fmi="1")


def test_a_machine_without_mass_is_refused_as_by_simulate(tmp_path):
    massless = bm.Graph.load(GRAPHS / "slider_crank.json")
    with pytest.raises(bm.RequestError) as simulated:
        massless.compile().simulate("time=1", start={"crank": (0.0, 1.0)})
    with pytest.raises(bm.RequestError) as written:
        bm.write(massless, tmp_path / "unit.fmu")
    assert written.value.problems == simulated.value.problems
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("fmi", ["2", "3"])
def test_a_unit_says_the_units_of_its_variables(fmi, tmp_path):
    fmpy = pytest.importorskip("fmpy", reason="the tool that reads it")
    graph = bm.Graph.load("graphs/watt_sixbar.json")
    (path,) = bm.write(graph, tmp_path / "u.fmu", want=["crank.drive", "*.p"], fmi=fmi)
    description = fmpy.read_model_description(str(path), validate=True)
    units = {variable.name: variable.unit for variable in description.modelVariables}
    assert units["crank.q"] == "rad"
    assert units["crank.acceleration"] == "rad/s2"
    assert units["crank.effort"] == units["crank.drive"] == "N m"
    assert units["first.C.p.x"] == "m"
    bases = {unit.name: unit.baseUnit for unit in description.unitDefinitions}
    torque = bases["N m"]
    assert (torque.kg, torque.m, torque.s) == (1, 2, -2)
    assert bases["rad/s2"].s == -2


@NEEDS_C
def test_an_acceleration_counts_friction_that_doubles_the_slope_of_the_drive(tmp_path):
    """Steps by the reduced inertia alone swing from side to side of such a one."""
    options = Options(groups=(1, 3), kinds=EVERY, drivers=(1, 2))
    case = random_mechanism(Seeded(6), options)
    mech, (driver,) = case.graph.compile(), case.request["at"]
    start = float(np.ravel(case.request["at"][driver])[0]), -2.0
    names = [f"{driver}.{x}" for x in ("q", "rate", "acceleration", "drive")]
    ours = mech.simulate("time=1e-3", times=[0.0], want=names, start={driver: start})
    a = ours[f"{driver}.acceleration"][0]
    drives = [
        mech.run(start[0], rates=start[1], accelerations=x, want=names[3])[names[3]][0]
        for x in (a - 1.0, a + 1.0)
    ]
    inertia = mech.run(start[0], want=f"{driver}.J_red")[f"{driver}.J_red"][0]
    assert abs(drives[1] - drives[0]) / 2.0 > 1.9 * inertia
    (path,) = bm.write(mech, tmp_path / "m.fmu", want=names[3:])
    result = fmpy.simulate_fmu(
        str(path),
        fmi_type="ModelExchange",
        stop_time=1e-3,
        start_values=dict(zip(names, start, strict=False)),
        output=names,
    )
    assert result[names[2]][0] == pytest.approx(a, rel=1e-9)
    assert abs(result[names[3]]).max() < 1e-9 * abs(drives[0])


@NEEDS_C
def test_a_machine_that_locks_at_no_acceleration_moves_at_its_own(tmp_path):
    """Friction has no solution for the loads of a machine without acceleration; it has one."""
    options = Options(groups=(1, 3), kinds=EVERY, drivers=(1, 2))
    case = random_mechanism(Seeded(36), options)
    mech, pose = case.graph.compile(), case.request
    q, rate, acceleration = (
        [f"{d}.{x}" for d in mech.drivers] for x in ("q", "rate", "acceleration")
    )
    coordinates = [float(np.ravel(pose["at"][d])[0]) for d in mech.drivers]
    speeds = [float(np.clip(np.ravel(pose["rates"][d])[0], -2, 2)) for d in mech.drivers]
    at, rates = (dict(zip(mech.drivers, x, strict=True)) for x in (coordinates, speeds))
    locked = mech.run(at, rates=rates, want="*.drive", on_gap="mark")
    assert locked.quality.status == ("jammed",)
    start = {d: (at[d], rates[d]) for d in mech.drivers}
    ours = mech.simulate("time=1e-3", times=[0.0], want=acceleration, start=start)
    (path,) = bm.write(mech, tmp_path / "m.fmu", want=["*.drive"])
    result = fmpy.simulate_fmu(
        str(path),
        fmi_type="ModelExchange",
        stop_time=1e-3,
        start_values=dict(zip(q + rate, coordinates + speeds, strict=True)),
        output=acceleration,
    )
    for name in acceleration:
        assert result[name][0] == pytest.approx(ours[name][0], rel=1e-9)
