"""Both engines run one kernel text: what they say must be the same.

Every operation of a kernel is rounded alike on Python floats and on float64 arrays, so the
engines agree to the last bit wherever sine and cosine of the driver angles do. Where a
platform's NumPy rounds those differently, an ulp at the start may grow with the
conditioning of the groups, and `FAR` bounds it.
"""

import math

import numpy as np
import pytest
from hypothesis import given, settings

import blockmech as bm
from blockmech.testing.strategies import mechanisms
from tests.engines.test_impossible import CASES, SAMPLES
from tests.machines import chain, ruiz, toggle, watt
from tests.wiring import EPS, amplification, same_bits, swept

FAR = 4 * EPS  # times the conditioning and the length of the chain of groups


def sines_agree(angles):
    """Whether NumPy and the standard library round sine and cosine of these angles alike."""
    return all(
        np.array_equal(many(angles), [single(x) for x in angles])
        for many, single in ((np.sin, math.sin), (np.cos, math.cos))
    )


def assert_agreement(mech, engine, **request):
    """What an engine says is what the scalar engine says."""
    request["on_gap"] = "mark"
    scalar, many = (mech.run(**request, engine=name) for name in ("scalar", engine))
    assert many._engine == engine
    angles = [c for n, c in scalar.samples.inputs.items() if n in scalar._plan.program.angles]
    if engine == "llvm" or all(sines_agree(np.asarray(c, float)) for c in angles):
        assert same_bits(scalar, many) == []
        assert scalar.quality.status == many.quality.status
        assert scalar.quality.flags == many.quality.flags
        return many
    condition = amplification(many) * len(mech.structure.blocks)
    for name in scalar:
        a, b = np.atleast_1d(scalar[name]), np.atleast_1d(many[name])
        assert np.array_equal(np.isnan(a), np.isnan(b)), name
        size = np.nanmax(np.abs(a), initial=0.0)
        assert np.nanmax(np.abs(a - b), initial=0.0) <= FAR * condition * size, name
    return many


@pytest.fixture(params=["numpy", "llvm"], scope="module")
def engine(request):
    """Engines that are held against the scalar one."""
    if request.param == "llvm":
        pytest.importorskip("llvmlite", reason="the compiled engine needs the extra fast")
    return request.param


@pytest.mark.parametrize("friction", ["none", "single", "successive", "newton"])
@pytest.mark.parametrize(
    "make",
    [ruiz, toggle, lambda: watt(spring=2.0, friction=True), lambda: chain(6, friction=True)],
    ids=["ruiz", "toggle", "watt", "chain"],
)
def test_engines_agree_to_the_last_bit_on_hand_made_graphs(make, friction):
    assert_agreement(make().compile(), "numpy", samples=60, friction=friction)


@pytest.mark.parametrize("make", [toggle, lambda: watt(spring=2.0, friction=True)])
def test_every_output_and_every_load_is_the_same_by_machine_code(make):
    pytest.importorskip("llvmlite", reason="the compiled engine needs the extra fast")
    assert_agreement(make().compile(), "llvm", samples=60)


@given(case=mechanisms())
@settings(max_examples=5)
def test_engines_agree_to_the_last_bit_on_random_graphs(engine, case):
    mech = case.graph.compile()
    want = "*" if engine == "numpy" else ("*.reaction", "*.drive", "*.alpha")
    assert_agreement(mech, engine, **swept(case, 12), want=want)


@pytest.mark.parametrize(
    ("engine", "friction"),
    [("numpy", "none"), ("numpy", "successive"), ("numpy", "newton"), ("llvm", "newton")],
    indirect=["engine"],
)
@pytest.mark.parametrize("name", CASES)
def test_engines_lose_the_same_impossible_values(engine, name, friction):
    assert_agreement(CASES[name].compile(), engine, at=SAMPLES, friction=friction)


def test_engines_agree_where_friction_is_decided_by_continuation():
    assert_agreement(ruiz(radius=2.0).compile(), "numpy", at=np.linspace(0.05, 6.2, 25))


def test_one_pose_is_a_batch_of_one():
    mech = ruiz().compile()
    for engine in ("scalar", "numpy"):
        single, batch = mech.run(at=1.3, engine=engine), mech.run(at=[1.3], engine=engine)
        assert same_bits(single, batch) == []


def test_kernel_text_is_the_program_of_both_engines():
    plan = ruiz().compile().plan("crank.drive")
    assert plan.program.source.startswith("def program(q_0, qd_0, qdd_0, P):")
    assert "numpy" not in plan.program.source


@pytest.mark.parametrize(
    "how",
    [
        {"friction": "single"},
        *({"friction": bm.friction.Successive(iterations=n)} for n in (1, 2, 7)),
    ],
)
def test_a_fixed_number_of_iterations_is_the_same_on_every_engine(how):
    request = {"samples": 25, "want": "*.reaction", **how}
    for engine in ("numpy", "llvm"):
        many = assert_agreement(ruiz().compile(), engine, **request)
        counts = many.quality.iterations["dyad"]
        assert set(counts) == {getattr(how["friction"], "iterations", 1)}


def test_a_fixed_number_of_iterations_is_differentiated_as_it_is_taken():
    mech, step = ruiz().compile(), 1e-4
    request = {
        "want": "crank.drive",
        "at": [0.4, 2.0],
        "friction": bm.friction.Successive(iterations=2),
    }
    slope = mech.sensitivity(**request, to="dyad.l_i")["crank.drive", "dyad.l_i"]
    ends = [
        mech.document.replace({"dyad.l_i": mech.parameters()["dyad.l_i"].value + side * step})
        .compile()
        .run(**request)["crank.drive"]
        for side in (1, -1)
    ]
    assert slope == pytest.approx((ends[0] - ends[1]) / (2 * step), rel=1e-7)
