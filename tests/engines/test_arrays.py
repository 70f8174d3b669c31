"""Programs on arrays of other libraries: JAX, and any that keeps the array API standard.

JAX runs operation by operation here (`jax.disable_jit`), which is the same program without the
time that compiling takes; `test_jax` compiles some.
"""

from functools import cache

import numpy as np
import pytest

import blockmech as bm
from tests.gallery import GRAPHS, mechanism

SAMPLES = 9
CLOSE = 1e-12  # of the largest number of a unit
DECLINED = {  # graph -> why it is no function of its drivers' motion
    "control/sampled_fourbar": "they depend on states",
    "control/speed_controlled_fourbar": "they depend on states",
    "control/speed_controlled_pump": "they depend on states",
}
FOLDERS = {folder: sorted((GRAPHS / folder).glob("*.json")) for folder in ("couplings", "control")}
NAMES = [
    *sorted(path.stem for path in GRAPHS.glob("*.json")),
    *(f"{folder}/{path.stem}" for folder, paths in FOLDERS.items() for path in paths),
    *("motions/gas_crank", "motions/locking_press", "motions/clock", "motions/damped_rod"),
]
FOLLOWED = {  # linear systems are eliminated another way than by LAPACK
    "floating_drive_press",
    "scissor_lift",
    "stephenson_2_class_4",
    "stephenson_3_triad",
}


def library_of(name):
    """A library as `Mechanism.function` takes it, and its namespace."""
    if name == "numpy":
        return name, np
    if name == "jax":
        jax = pytest.importorskip("jax", reason="functions of JAX need the extra jax")
        jax.config.update("jax_enable_x64", True)
        return name, jax.numpy
    strict = pytest.importorskip("array_api_strict", reason="it holds us to the standard")
    return strict, strict


@cache
def request_of(name):
    """A mechanism, its run over a range beyond its dead centres, and the inputs of the samples."""
    mech = mechanism(name)
    drivers = mech.drivers
    try:
        result = mech.run(samples=SAMPLES, want="*", on_gap="mark")
    except bm.RequestError:  # its law is one of time, or there is none
        q = dict.fromkeys(drivers, np.linspace(0.1, 1.0, SAMPLES))
        result = mech.run(q, rates=dict.fromkeys(drivers, 1.0), want="*", on_gap="mark")
    inputs = {
        mech._of_driver(driver, quantity): np.broadcast_to(
            result.samples.inputs[f"{x}_{i}"], result.n
        )
        for i, driver in enumerate(drivers)
        for quantity, x in (("q", "q"), ("rate", "qd"), ("acceleration", "qdd"))
    }
    if result.samples.time is not None and np.isfinite(result.samples.time).all():
        inputs["time"] = result.samples.time
    return mech, result, inputs


def apart(mech, result, outputs):
    """Outputs that differ: by their largest difference of the unit's largest number; or by NaN."""
    size = {}
    for name in outputs:
        unit = mech.outputs[name].unit
        size[unit] = max(size.get(unit, 0.0), np.nanmax(np.abs(result[name]), initial=0.0))
    off = {}
    for name, y in outputs.items():
        a, b = np.asarray(result[name]), np.asarray(y)
        assert a.shape == b.shape, name
        assert np.array_equal(np.isnan(a), np.isnan(b)), name
        off[name] = np.nanmax(np.abs(a - b), initial=0.0) / (size[mech.outputs[name].unit] or 1.0)
    return {name: float(x) for name, x in off.items() if x}


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("library", ["numpy", "strict", "jax"])
def test_all_outputs_are_those_of_a_run_with_friction(library, name, request):
    of, xp = library_of(library)
    if name in DECLINED:
        mech = mechanism(name)
        with pytest.raises(bm.RequestError, match=DECLINED[name]):
            mech.function([*(mech._of_driver(d, "q") for d in mech.drivers), "time"], library=of)
        return
    mech, result, inputs = request_of(name)
    f = mech.function(list(inputs), library=of, static=result.samples.at_rest)
    if library == "jax":
        jit = request.getfixturevalue("without_jit")
        with jit:
            y = f(f.parameters, inputs)
    else:
        y = f(f.parameters, {address: xp.asarray(x) for address, x in inputs.items()})
    ok = np.asarray(y.pop("ok"))
    assert np.array_equal(ok, [word == "ok" for word in result.quality.status])
    assert {*y} == {n for n in mech.outputs if mech.outputs[n].kind != "number"}
    off = apart(mech, result, y)
    assert max(off.values(), default=0.0) <= CLOSE
    if library != "jax" and name not in FOLLOWED:
        assert off == {}  # the same to the last bit


@pytest.fixture
def without_jit():
    import jax

    return jax.disable_jit()


@pytest.mark.parametrize("library", ["numpy", "strict", "jax"])
def test_samples_without_an_answer_are_the_same(library, request):
    of, xp = library_of(library)
    mech = bm.Graph.load(GRAPHS / "ruiz_fourbar.json").replace({"dyad.l_i": 4.0}).compile()
    q = np.linspace(0.0, 6.0, 25)
    result = mech.run(q, want=["*"], on_gap="mark")
    gaps = [word != "ok" for word in result.quality.status]
    assert 0 < sum(gaps) < 25
    f = mech.function(["crank.q"], library=of)
    if library == "jax":
        with request.getfixturevalue("without_jit"):
            y = f({}, {"crank.q": q})
    else:
        y = f({}, {"crank.q": xp.asarray(q)})
    assert np.array_equal(~np.asarray(y.pop("ok")), gaps)
    assert max(apart(mech, result, y).values(), default=0.0) <= CLOSE


@pytest.mark.parametrize("precision", ["complex64", "complex128"])
def test_a_precision_is_that_of_every_output(precision):
    strict, _ = library_of("strict")
    mech = mechanism("ruiz_fourbar")
    f = mech.function(["crank.q"], library=strict, precision=precision)
    y = f({}, {"crank.q": strict.asarray([0.1, 0.7])})
    ok = y.pop("ok")
    assert ok.dtype == strict.bool
    real, pair = (
        (strict.float32, strict.complex64)
        if precision == "complex64"
        else (strict.float64, strict.complex128)
    )
    kinds = {"real": real, "vector": pair}
    assert {n: x.dtype for n, x in y.items()} == {n: kinds[mech.outputs[n].kind] for n in y}


def test_designs_are_those_of_a_study_to_the_last_bit():
    mech = mechanism("watt_sixbar")
    f = mech.function(["crank.q"], ["crank.drive"], ["first.l_i"], library="numpy")
    lengths, q = np.linspace(0.98, 1.02, 4) * f.parameters["first.l_i"], np.linspace(0.0, 6.0, 7)
    y = f({"first.l_i": lengths[:, None]}, {"crank.q": q})["crank.drive"]
    for length, row in zip(lengths, y, strict=True):
        variant = mech.document.replace({"first.l_i": length}).compile()
        assert np.array_equal(
            row, variant.run(q, want="crank.drive", engine="numpy")["crank.drive"]
        )
