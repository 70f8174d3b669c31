"""Reductions mean the same everywhere, with exact derivatives."""

from __future__ import annotations

import numpy as np
import pytest

import blockmech as bm
from tests import machines
from tests.gallery import GRAPHS

RUIZ = bm.Graph.load(GRAPHS / "ruiz_fourbar.json")
MECH = RUIZ.compile()
TO = ["dyad.l_i", "crank.length", "dyad.links.i.mass", "frame.D.x"]
WANT = [
    "range(dyad.j.angle)", "max_abs(crank.drive)", "min(dyad.margin)", "rms(crank.drive)",
    "max(dyad.C.p.y)", "mean(dyad.D.reaction)", "at(crank.drive, 1.0)", "stroke(dyad.j.angle)",
]  # fmt: skip
POSES = np.linspace(0.2, 6.0, 59)  # holds 1.0


def rebuilt(label, address, value):
    """A reduction of the mechanism with another number, by a study of one design."""
    study = MECH.study({address: [value]}, want=[label], at=POSES)
    return complex(study[label][0])


def difference(label, address):
    x = MECH.parameters()[address].value
    h = 3e-6 * x
    f = {k: rebuilt(label, address, x + k * h) for k in (-3, -2, -1, 1, 2, 3)}
    return (45 * (f[1] - f[-1]) - 9 * (f[2] - f[-2]) + (f[3] - f[-3])) / (60 * h)


@pytest.mark.parametrize("label", WANT)
def test_derivatives_are_those_of_rebuilt_mechanisms(label):
    derivatives = MECH.sensitivity([label], to=TO, at=POSES)
    assert [*derivatives] == [label]
    for address in TO:
        exact, expected = complex(derivatives[label, address][0]), difference(label, address)
        x = MECH.parameters()[address].value
        size = max(abs(expected), abs(complex(derivatives.value(label)[0]) / x))
        assert abs(exact - expected) <= 1e-9 * size


@pytest.mark.parametrize("label", WANT)
def test_a_study_and_a_sensitivity_keep_the_same_number(label):
    value = complex(MECH.sensitivity([label], to=TO[:1], at=POSES).value(label)[0])
    assert value == pytest.approx(rebuilt(label, TO[0], MECH.parameters()[TO[0]].value), rel=1e-12)


def test_a_stroke_is_followed_between_the_poses():
    """Sixteen poses a turn find the swing that 3,600 find; so does a range."""
    few = MECH.study(
        {"dyad.l_i": [6.0]}, want=["stroke(dyad.j.angle)", "range(dyad.j.angle)"], samples=17
    )
    fine = MECH.study({"dyad.l_i": [6.0]}, want="range(dyad.j.angle)", samples=3601)
    swing = MECH.stroke("dyad.j.angle").length
    assert few["stroke(dyad.j.angle)"][0] == pytest.approx(swing, rel=1e-12)
    assert fine["range(dyad.j.angle)"][0] == pytest.approx(swing, rel=1e-12)
    assert few["range(dyad.j.angle)"][0] == pytest.approx(swing, rel=1e-12)


def test_the_stroke_of_a_slider():
    g = bm.Graph.load(GRAPHS / "slider_crank_offset.json")
    mech = g.compile()
    name = next(n for n in mech.outputs if n.endswith("Cj.p"))
    address = "crank.length"
    derivatives = mech.sensitivity([f"stroke({name})"], to=[address])
    x, h = mech.parameters()[address].value, 1e-4

    def length(v):
        return g.replace({address: v}).compile().stroke(name).length

    expected = (8 * (length(x + h) - length(x - h)) - length(x + 2 * h) + length(x - 2 * h)) / (
        12 * h
    )
    assert derivatives[f"stroke({name})", address][0] == pytest.approx(expected, rel=1e-9)


def test_tolerance_takes_reductions():
    scatter = {"dyad.l_i": bm.dist.Normal(6.0, 0.005), "dyad.l_j": bm.dist.Normal(3.0, 0.005)}
    label = "range(dyad.j.angle)"
    bands = MECH.tolerance(scatter, want=[label, "dyad.C.p.x"], at=POSES, count=800)
    assert bands[label].shape == (1,)
    assert bands["dyad.C.p.x"].shape == (59,)
    sampled = MECH.study(scatter, want=label, at=POSES, sampling=bm.dist.Sample(800))[label]
    assert bands[label][0] == pytest.approx(np.std(sampled, ddof=1), rel=0.1)
    assert bands.sampled[label].deviation[0] == pytest.approx(bands[label][0], rel=0.1)
    assert bands.shares(label)[:, 0].sum() == pytest.approx(1.0)
    assert f"{label}: deviation " in str(bands)


def test_strokes_along_straight_paths_are_those_of_each_design_by_itself(monkeypatch):
    """A slide at 0.4 rad, whose axis no design has from another; none is compiled for it."""
    g = bm.Graph.load(GRAPHS / "slider_crank_offset.json")
    g = g.replace({"frame.G.angle": 0.4})
    name = next(n for n in g.compile().outputs if n.endswith("Cj.p"))
    angles, lengths = np.linspace(0.3, 0.5, 5), np.linspace(0.08, 0.1, 5)
    mech = g.compile()
    with monkeypatch.context() as patch:
        patch.setattr("blockmech.studies.runner.remade", lambda *_: pytest.fail("compiled"))
        study = mech.study(
            {"frame.G.angle": angles, "crank.length": lengths},
            want=f"stroke({name})",
            sampling="paired",
        )
    for angle, length, stroke in zip(angles, lengths, study[f"stroke({name})"], strict=True):
        design = g.replace({"frame.G.angle": angle, "crank.length": length}).compile()
        assert stroke == pytest.approx(design.stroke(name).length, rel=1e-12)


def test_objective_takes_a_stroke():
    f = MECH.objective(["dyad.l_j", "crank.length"], want="stroke(dyad.j.angle)", samples=37)
    h = 1e-4
    for i in range(2):
        e = np.eye(2)[i] * h
        x = f.start
        expected = (8 * (f(x + e) - f(x - e)) - f(x + 2 * e) + f(x - 2 * e)) / (12 * h)
        assert f.jacobian(x)[i] == pytest.approx(expected, rel=1e-8)


def test_pictures_and_tables_have_them(tmp_path):
    scatter = {"dyad.l_i": bm.dist.Normal(6.0, 0.005)}
    MECH.tolerance(scatter, want=["range(dyad.j.angle)"], at=POSES).plot(tmp_path / "a.png")
    MECH.tolerance(scatter, want=["range(dyad.j.angle)", "dyad.C.p.x"], at=POSES).plot(
        tmp_path / "b.png"
    )
    derivatives = MECH.sensitivity(["max_abs(crank.drive)", "dyad.C.p.x"], to=TO, at=POSES)
    derivatives.plot(tmp_path / "c.png")
    assert "max_abs(crank.drive) [N m]" in str(derivatives)
    rows = derivatives.to_csv().splitlines()
    assert sum(r.startswith("max_abs(crank.drive),") for r in rows) == 1
    assert sum(r.startswith("dyad.C.p.x,") for r in rows) == 59


def test_what_is_no_reduction_is_refused():
    with pytest.raises(bm.RequestError, match='no reduction "most"'):
        MECH.sensitivity("most(crank.drive)", to=TO)
    with pytest.raises(bm.RequestError, match="not the position of a marker"):
        MECH.study({"dyad.l_i": [6.0]}, want="stroke(dyad.C.v)")


def test_a_result_is_a_dataset():
    run = MECH.run(at=POSES, want=["crank.drive", "dyad.C.p"])
    dataset = run.to_xarray()
    assert dataset["crank.drive"].attrs["units"] == "N m"
    assert np.array_equal(dataset["dyad.C.p"].values, run["dyad.C.p"])
    assert np.array_equal(dataset["dyad.C.p.x"].values, run["dyad.C.p"].real)
    assert np.array_equal(dataset["dyad.C.p.y"].values, run["dyad.C.p"].imag)
    assert dataset["dyad.C.p.y"].attrs["units"] == "m"
    assert dataset["time"].attrs["units"] == "s"
    assert float(dataset["crank.drive"].sel({"crank.q": POSES[3]})) == run["crank.drive"][3]
    millimetres = run.to("mm", "deg").to_xarray()
    assert np.array_equal(millimetres["dyad.C.p"].values, 1000.0 * run["dyad.C.p"])
    assert millimetres["dyad.C.p.y"].attrs["units"] == "mm"
    assert millimetres["crank.q"].attrs["units"] == "deg"


def test_units_of_a_dataset_are_spelled_as_pint_reads_them():
    dataset = MECH.run(at=POSES, want=["crank.J_red", "crank.acceleration"]).to_xarray()
    assert dataset["crank.J_red"].attrs["units"] == "kg m**2"
    assert dataset["crank.acceleration"].attrs["units"] == "rad/s**2"


# -- where a design rests ------------------------------------------------------------------


def lamp():
    link = bm.Link(mass=0.9, inertia=0.02, cm=(0.32, 0.0), markers={"S": (0.12, 0.0)})
    graph = machines.crank(0.4, link, gravity=9.81, name="arm", W=(0.05, 0.3))
    spring = bm.Spring(stiffness=300.0, free_length=0.05)
    return machines.load(graph, "spring", spring, a="frame.W", b="arm.S")


RESTING = ["arm.q", "arm.B.p.y", "spring.length", "mechanism.potential_energy", "arm.A.reaction.y"]


@pytest.mark.parametrize("output", [n for n in RESTING if n in lamp().compile().outputs])
def test_where_a_design_rests_is_kept_with_exact_derivatives(output):
    """Against equilibria of rebuilt mechanisms."""
    g, label = lamp(), f"rest({output})"
    mech = g.compile()
    to = ["spring.stiffness", "frame.W.y", "arm.links.crank.mass", "spring.free_length"]

    def rebuilt(address, x):
        design = g.replace({address: x}).compile()
        (e,) = design.equilibria().stable
        q = e.q[0] + 2 * np.pi * round((0.3 - e.q[0]) / (2 * np.pi))
        return design.run(at=[q], want=output, rates=0.0, accelerations=0.0)[output][0]

    derivatives = mech.sensitivity(label, to=to, at=[0.3])
    for address in to:
        x = mech.parameters()[address].value
        h = 1e-3 * x
        f = {k: rebuilt(address, x + k * h) for k in (-3, -2, -1, 0, 1, 2, 3)}
        expected = (45 * (f[1] - f[-1]) - 9 * (f[2] - f[-2]) + (f[3] - f[-3])) / (60 * h)
        assert derivatives.value(label)[0] == pytest.approx(f[0], rel=1e-12)
        assert derivatives[label, address][0] == pytest.approx(
            expected, rel=1e-9, abs=1e-9 * abs(f[0] / x)
        )


def test_a_study_and_an_objective_take_where_it_rests():
    """A lamp whose spring holds it level is found by its derivative."""
    mech = lamp().compile()
    rows = mech.study({"spring.stiffness": [200.0, 300.0]}, want="rest(arm.q)", at=[0.3])
    for k, q in zip((200.0, 300.0), rows["rest(arm.q)"], strict=True):
        (e,) = lamp().replace({"spring.stiffness": k}).compile().equilibria().stable
        assert np.exp(1j * q) == pytest.approx(np.exp(1j * e.q[0]), abs=1e-12)
    f = mech.objective(["spring.stiffness"], want="rest(arm.q)", at=[0.3])
    x = np.array([100.0])
    for _ in range(12):
        x = x - f(x) / f.jacobian(x)
    assert f(x) == pytest.approx(0.0, abs=1e-12)
    arm = np.array([0.12, 0.0])
    spring = np.hypot(0.12 - 0.05, 0.3)
    moment = x[0] * (spring - 0.05) * arm[0] * 0.3 / spring  # of the spring about the pin
    assert moment == pytest.approx(0.9 * 9.81 * 0.32, rel=1e-10)


def test_where_nothing_rests_is_a_row_without_a_number():
    g = machines.crank(0.4, bm.Link(mass=1.0, inertia=0.1), name="arm")
    push = bm.Motor(law=bm.laws.Constant(value=2.0))
    mech = machines.load(g, "push", push, a="frame.A", b="arm.crank").compile()
    rows = mech.study({"arm.length": [0.4]}, want="rest(arm.q)", at=[0.0])
    assert np.isnan(rows["rest(arm.q)"]).all()
    with pytest.raises(bm.RequestError, match="no stable equilibrium"):
        mech.sensitivity("rest(arm.q)", to=["arm.length"], at=[0.0])
