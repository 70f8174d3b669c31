"""`function` and `rates` at their border: names, numbers that cannot vary, libraries."""

import types

import numpy as np
import pytest

import blockmech as bm
from tests.gallery import GRAPHS, changed, document, mechanism


def function(
    name="ruiz_fourbar", inputs=("crank.q",), outputs="crank.drive", numbers=(), **options
):
    return mechanism(name).function(inputs, outputs, numbers, library="numpy", **options)


@pytest.mark.parametrize(
    ("request_", "message"),
    [
        ({"inputs": ["crank.w"]}, r"inputs: no number \"crank\.w\".* crank\.q, crank\.rate"),
        ({"inputs": "crank.rate"}, r"inputs: the outputs depend on crank\.q"),
        ({"outputs": "crank.drvie"}, r"crank\.drvie: no output has that name"),
        ({"outputs": "mechanism.friction_efficiency"}, "one number a run"),
        ({"numbers": "dyad.l"}, r"dyad\.l: the mechanism has no parameter with that address"),
        ({"numbers": ["crank.length", "dyad.branch"]}, r"dyad\.branch: a whole number chooses"),
        ({"numbers": "scene.drive.crank.rate"}, "it says how the drivers move"),
        ({"precision": "clongdouble"}, "complex128, complex64"),
    ],
)
def test_what_cannot_be_is_refused_with_what_can(request_, message):
    with pytest.raises(bm.RequestError, match=message):
        function(**request_)


@pytest.mark.parametrize("library", ["tensor", types])
def test_a_library_of_nothing_is_refused(library):
    with pytest.raises(bm.RequestError, match="jax, numpy, or a namespace"):
        mechanism("ruiz_fourbar").function("crank.q", library=library)


def test_a_call_names_what_it_gives():
    f = function(numbers=["dyad.*"])
    with pytest.raises(bm.RequestError, match=r"inputs: missing: crank\.q"):
        f(f.parameters, {})
    with pytest.raises(
        bm.RequestError, match=r"parameters: no number \"crank\.length\".*dyad\.l_i"
    ):
        f({"crank.length": 1.0}, {"crank.q": 0.3})
    assert "crank.q -> crank.drive; " in repr(f)


def test_patterns_leave_out_what_cannot_vary():
    strict = pytest.importorskip("array_api_strict", reason="it holds us to the standard")
    options = {"library": strict, "friction": "none"}
    f = mechanism("engine").function("crank.q", "crank.drive", ["*"], **options)
    parameters = mechanism("engine").parameters()
    assert {"crank.length", "piston.l", "gas.law.values[3]"} & {*f.parameters} == {
        "crank.length",
        "piston.l",
    }
    assert f.parameters == {a: parameters[a].value for a in f.parameters}
    with pytest.raises(bm.RequestError, match="cubic table"):
        mechanism("engine").function("crank.q", "crank.drive", ["gas.law.values[3]"], **options)


def test_a_rate_that_is_not_named_is_that_of_the_law():
    mech, q = mechanism("slider_crank"), np.array([0.2, 1.0])
    f = mech.function("crank.q", "piston.C.v", library="numpy")
    rate = mech.scene.drive["crank"].rate
    assert rate != 0.0
    assert np.array_equal(f({}, {"crank.q": q})["piston.C.v"], mech.run(q)["piston.C.v"])
    data = document("slider_crank")
    data["scene"]["drive"] = {"crank": {"law": "rate_acceleration", "acceleration": 2.0}}
    with pytest.raises(bm.RequestError, match=r"depend on crank\.rate"):
        changed(data).function("crank.q", "piston.C.v", library="numpy")


def test_numbers_of_a_document_are_called_by_its_addresses():
    mech = bm.Linkage.load(GRAPHS / "joints" / "watt_sixbar.json").compile()
    mass = next(a for a in mech.parameters() if a.endswith(".mass"))
    f = mech.function("driver.motor.q", "driver.motor.drive", ["*"], library="numpy")
    heavy = {mass: 2.0 * f.parameters[mass]}
    alone = mech.document.replace(heavy).compile().run([0.3], want="driver.motor.drive")
    ours = f(heavy, {"driver.motor.q": np.array([0.3])})["driver.motor.drive"]
    np.testing.assert_allclose(ours, alone["driver.motor.drive"], rtol=1e-14)
    pose = next(a for a in mech.parameters() if ".at" in a and a not in f.parameters)
    with pytest.raises(bm.RequestError, match="geometry of the document"):
        mech.function("driver.motor.q", "driver.motor.drive", [pose], library="numpy")


@pytest.mark.parametrize("name", ["watt_sixbar", "fivebar_falling", "stephenson_3_triad"])
def test_rates_leave_nothing_for_the_drive(name):
    mech = mechanism(name)
    q = {d: 0.4 + 0.3 * i for i, d in enumerate(mech.drivers)}
    rate = {d: 1.5 - 0.7 * i for i, d in enumerate(mech.drivers)}
    rhs = mech.rates(["scene.gravity.y"], library="numpy", friction="none")
    row = np.array([*q.values()]), np.array([*rate.values()])
    state = row if len(q) > 1 else tuple(float(x[0]) for x in row)
    first, second = rhs(0.0, state, rhs.parameters)
    assert np.array_equal(first, state[1])
    qdd = dict(zip(mech.drivers, np.atleast_1d(second), strict=True))
    motion = {"rates": rate, "accelerations": qdd, "friction": "none"}
    result = mech.run(q, want="*.drive", **motion)
    constrained = mech.run(q, want="*.drive", rates=rate, friction="none")
    for name in result:
        assert abs(result[name][0]) < 1e-11 * max(1.0, abs(constrained[name][0]))
    heavier = rhs(0.0, state, {"scene.gravity.y": -20.0})[1]
    assert not np.allclose(heavier, second)


def test_rates_refuse_what_they_leave_out():
    with pytest.raises(bm.RequestError, match=r'friction="none"'):
        mechanism("ruiz_fourbar").rates(library="numpy")
    data = document("slider_crank")
    for block in data["blocks"].values():
        block.pop("links", None)
    with pytest.raises(bm.RequestError, match="nothing that moves has mass"):
        changed(data).rates(library="numpy", friction="none")
