"""One engine, one sample, one answer: alone, in any batch, order and chunk."""

import random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blockmech.engines.numpy import primitives
from blockmech.ground.plane import SCALAR_PRIMITIVES
from blockmech.testing.strategies import Options, Seeded, mechanisms, random_mechanism
from tests.machines import ruiz, toggle, watt
from tests.wiring import same_bits, swept

EACH_ENGINE = pytest.mark.parametrize("engine", ["scalar", "numpy"])


def picked(request, order):
    return {**request, "at": {d: q[order] for d, q in request["at"].items()}}


def rows(result, order):
    return {k: v[order] for k, v in result.items() if np.ndim(v)}


@EACH_ENGINE
@given(case=mechanisms(Options(groups=(1, 3))), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=5)
def test_sample_is_the_same_alone_in_any_batch_and_in_any_order(engine, case, seed):
    mech, n = case.graph.compile(), 11
    request = swept(case, n, seed)
    result = mech.run(**request, engine=engine)
    order = np.array(random.Random(seed).sample(range(n), n))
    shuffled = mech.run(**picked(request, order), engine=engine)
    assert same_bits(rows(result, order), shuffled) == []
    for k in range(n):
        alone = mech.run(**picked(request, [k]), engine=engine)
        assert same_bits(rows(result, [k]), alone) == []


@pytest.mark.parametrize("chunk", [1, 2, 3, 7, 64, 100, 1000])
@pytest.mark.parametrize("make", [ruiz, toggle, lambda: watt(spring=2.0, friction=True)])
def test_chunks_change_no_bit(make, chunk):
    mech = make().compile()
    result = mech.run(samples=100, engine="numpy")
    assert same_bits(result, mech.run(samples=100, engine="numpy", chunk=chunk)) == []


def test_long_batch_over_the_default_chunk_is_the_short_one():
    mech = ruiz().compile()
    q = np.linspace(0.0, 20.5, 20_001)
    long = mech.run(at=q, want=["crank.drive", "dyad.C.reaction", "frame.D.p", "dyad.j.alpha"])
    for part in (slice(0, 5), slice(8190, 8195), slice(16383, 16386), slice(20_000, 20_001)):
        short = mech.run(at=q[part], engine="numpy", want=list(long))
        assert same_bits(rows(long, part), short) == []


@EACH_ENGINE
def test_impossible_samples_do_not_touch_their_neighbours(engine):
    apart = 0
    for seed in range(12):
        case = random_mechanism(Seeded(seed), Options(groups=(3, 4), kinds=("dyad.rrr",)))
        mech, request = case.graph.compile(), swept(case, 40)
        result = mech.run(**request, engine=engine)
        good = np.array([s == "ok" for s in result.quality.status])
        apart += 3 < good.sum() < 37
        feasible = mech.run(**picked(request, good), engine=engine)
        assert feasible.quality.status == ("ok",) * int(good.sum())
        assert same_bits(rows(result, good), feasible) == []
    assert apart >= 3  # there was something to keep apart


def test_engine_is_chosen_by_the_number_of_samples(fresh):
    mech = ruiz().compile()
    assert mech.run(at=1.0)._engine == "scalar"
    assert mech.run(samples=5)._engine == "scalar"
    assert mech.run(samples=50)._engine == "numpy"
    assert mech.run(at=1.0, precision="complex64")._engine == "numpy"


def test_arrays_of_a_result_are_the_users_own():
    mech = ruiz().compile()
    for engine in ("scalar", "numpy"):
        r = mech.run(at=[1.0, 2.0], engine=engine, want=["crank.drive", "crank.q"])
        r["crank.drive"][0] = 0.0
        again = mech.run(at=[1.0, 2.0], engine=engine, want=["crank.drive"])
        assert again["crank.drive"][0] != 0.0


def halved(state, floor):
    x, steps, _ = state
    return x * 0.5, steps + 1.0, x * 0.5 > floor


def repeated(primitives_, x, floor, cap):
    """How often ``x`` is halved until it is below a floor."""
    return primitives_["repeat"](halved, (x, 0.0 * x, x > floor), cap, floor)


@pytest.mark.parametrize("cap", [0, 3, 100])
def test_repeat_leaves_each_sample_alone_once_it_has_stopped(cap):
    x, floor = np.array([0.5, 1.0, 9.0, 1e9, np.nan]), np.array([1.0, 1.0, 2.0, 1.0, 1.0])
    many = repeated(primitives(np.float64), x, floor, cap)
    for k, sample in enumerate(zip(x.tolist(), floor.tolist(), strict=True)):
        alone = repeated(SCALAR_PRIMITIVES, *sample, cap)
        np.testing.assert_array_equal([column[k] for column in many], alone)
    assert many[1].tolist()[:4] == [0.0, 0.0, min(cap, 3.0), min(cap, 30.0)]
