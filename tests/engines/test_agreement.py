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

from blockmech.testing.strategies import mechanisms
from tests.wiring import EPS, amplification, chain, ruiz, same_bits, swept, toggle, watt

FAR = 4 * EPS  # times the conditioning and the length of the chain of groups


def sines_agree(angles):
    """Whether NumPy and the standard library round sine and cosine of these angles alike."""
    return all(
        np.array_equal(many(angles), [one(x) for x in angles])
        for many, one in ((np.sin, math.sin), (np.cos, math.cos))
    )


def assert_agreement(mech, **request):
    request["on_gap"] = "mark"
    one = mech.run(**request, engine="scalar")
    many = mech.run(**request, engine="numpy")
    angles = [c for n, c in one.samples.inputs.items() if n in one.plan.program.angles]
    if all(sines_agree(np.asarray(c, float)) for c in angles):
        assert same_bits(one, many) == []
        assert one.quality.status == many.quality.status
        assert one.quality.flags == many.quality.flags
        return
    condition = amplification(many) * len(mech.structure.blocks)
    for name in one:
        a, b = np.atleast_1d(one[name]), np.atleast_1d(many[name])
        assert np.array_equal(np.isnan(a), np.isnan(b)), name
        size = np.nanmax(np.abs(a), initial=0.0)
        assert np.nanmax(np.abs(a - b), initial=0.0) <= FAR * condition * size, name


@pytest.mark.parametrize("friction", ["none", "single", "successive", "newton"])
@pytest.mark.parametrize(
    "make",
    [ruiz, toggle, lambda: watt(spring=2.0, friction=True), lambda: chain(6, friction=True)],
    ids=["ruiz", "toggle", "watt", "chain"],
)
def test_engines_agree_to_the_last_bit_on_hand_made_graphs(make, friction):
    assert_agreement(make().compile(), samples=60, friction=friction)


@given(case=mechanisms())
@settings(max_examples=15)
def test_engines_agree_to_the_last_bit_on_random_graphs(case):
    mech = case.graph.compile()
    assert_agreement(mech, **case.request)
    assert_agreement(mech, **swept(case, 12))


def test_engines_agree_where_friction_is_decided_by_continuation():
    assert_agreement(ruiz(radius=2.0).compile(), at=np.linspace(0.05, 6.2, 25))


def test_one_pose_is_a_batch_of_one():
    mech = ruiz().compile()
    for engine in ("scalar", "numpy"):
        one, batch = mech.run(at=1.3, engine=engine), mech.run(at=[1.3], engine=engine)
        assert same_bits(one, batch) == []


def test_kernel_text_is_the_program_of_both_engines():
    plan = ruiz().compile().plan("crank.drive")
    assert plan.program.source.startswith("def program(q_0, qd_0, qdd_0, P):")
    assert "numpy" not in plan.program.source
