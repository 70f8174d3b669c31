"""The compiled engine says what the scalar engine says, to the last bit, or declines."""

import math
import sys

import numpy as np
import pytest

import blockmech as bm
from blockmech.engines import cost, llvm
from blockmech.engines.interpreters import ScalarEngine
from blockmech.engines.llvm import LlvmEngine, SingleEvaluator
from blockmech.engines.nodes import Untraceable
from blockmech.engines.numpy import Whole
from blockmech.ground.plane import (
    angle,
    maximum,
    minimum,
    modulo,
    piecewise,
    planar,
    repeat,
    sign,
    sqrt,
)
from blockmech.plan.plan import Program
from tests.engines.test_agreement import assert_agreement
from tests.gallery import SHORT, mechanism
from tests.loads.test_functions import arm
from tests.machines import ruiz, watt
from tests.wiring import same_bits

pytest.importorskip("llvmlite", reason="the compiled engine needs the extra fast")

FORCES = ("*.reaction", "*.drive", "*.alpha")


def request_of(mech, n):
    """Samples of a mechanism's range, or of a place that it may reach."""
    if all(d in mech.scene.drive for d in mech.drivers):
        return {"samples": n}
    at = {d: k + np.linspace(-0.4, 0.4, n) for k, d in enumerate(mech.drivers)}
    return {"at": at, "rates": dict.fromkeys(mech.drivers, 1.3)}


@pytest.mark.parametrize("name", SHORT)
def test_the_gallery_is_the_same_to_the_last_bit(name):
    mech = mechanism(name)
    request = request_of(mech, 21)
    if any(b.own_form for b in mech.structure.blocks.values()):
        assert_near(mech, **request, want=("*.alpha", "*.drive"), friction="none")
        return
    for method in ("none", "newton") if mech.frictional_joints else ("none",):
        assert_agreement(mech, "llvm", **request, want=FORCES, friction=method)


def assert_near(mech, **request):
    """Both engines' results of groups without closed form: to rounding over the conditioning.

    One linear system answers all rates of a kind, and a solve is off in proportion to the largest
    of its answers: a link that does not turn has rates that are rounding alone.
    """
    scalar, many = (mech.run(**request, engine=e, on_gap="mark") for e in ("scalar", "llvm"))
    assert scalar.quality.status == many.quality.status
    worst = min(float(np.nanmin(m)) for m in scalar.quality.margin.values())
    sizes: dict[str, float] = {}
    for name in scalar:
        kind = name.rpartition(".")[2]
        sizes[kind] = np.nanmax(np.abs(scalar[name]), initial=sizes.get(kind, 0.0))
    for name in scalar:
        size = sizes[name.rpartition(".")[2]]
        gap = 1e3 * np.finfo(float).eps / worst * size  # rates and loads: once each
        np.testing.assert_allclose(many[name], scalar[name], rtol=0, atol=gap, err_msg=name)
    return many


def test_groups_are_followed_with_friction_beyond_their_reach_and_one_by_one():
    mech = mechanism("stephenson_3_triad")
    q = np.linspace(-3.0, 9.0, 25)
    result = assert_near(mech, at=q, want=FORCES)
    alone = mech.run(at=q[7], want=FORCES, engine="llvm", on_gap="mark")
    assert same_bits({k: result[k][7:8] for k in result}, alone) == []


def test_a_function_of_the_time_is_asked_beforehand():
    mech = arm(lambda time: 0.3 * math.sin(time)).compile()
    assert_agreement(mech, "llvm", times=np.linspace(0.0, 5.0, 21))


def test_samples_that_need_continuation_are_done_again():
    q = np.linspace(0.05, 6.2, 13)
    result = assert_agreement(ruiz(radius=2.0).compile(), "llvm", at=q, want=FORCES)
    assert {f.code for f in result.quality.flags} & {"by-continuation"} or result.quality.gaps


def test_a_sample_is_the_same_alone_and_in_any_batch():
    mech = ruiz().compile()
    q = np.linspace(0.0, 6.0, 37)
    result = mech.run(at=q, engine="llvm", want=FORCES)
    for part in (slice(0, 1), slice(3, 10), slice(5, 13), slice(8, 24), slice(20, 37)):
        short = mech.run(at=q[part], engine="llvm", want=FORCES)
        assert same_bits({k: result[k][part] for k in result}, short) == []


def test_threads_change_no_bit(monkeypatch):
    mech, q = ruiz().compile(), np.linspace(0.0, 20.0, 1003)
    alone = mech.run(at=q, engine="llvm", want=FORCES)
    monkeypatch.setattr(llvm, "PARALLEL", 100)
    monkeypatch.setattr(llvm.os, "cpu_count", lambda: 3)
    assert same_bits(alone, mech.run(at=q, engine="llvm", want=FORCES)) == []


def test_values_are_called_whole_where_every_number_is_finite():
    engine = LlvmEngine(program_of(lambda a, b: (a, b / 2.0, 3.0), 2))
    for x in ODD:
        for index in (0, 11, 20):
            column = np.linspace(-1.0, 1.0, 21)
            column[index] = x
            for special, even in (("x0", "x1"), ("x1", "x0")):  # x0 is handed on as it is
                result = engine.run({special: column, even: np.ones(21)}, 21)
                assert isinstance(result, Whole) == math.isfinite(x)
    fixed = LlvmEngine(program_of(lambda a: (a, math.nan), 1))
    assert not isinstance(fixed.run({"x0": np.ones(9)}, 9), Whole)


# -- primitives ----------------------------------------------------------------------------

ODD = [0.0, -0.0, 1.0, -1.0, 2.5, -7.25, 1e-300, 1e300, math.inf, -math.inf, math.nan]
KNOTS, ROWS = (-1.0, 0.0, 2.0), ((1.0, -2.0, 9.0), (0.5, 0.25, 9.0))


def program_of(function, inputs, parameters=()):
    names = tuple(f"x{k}" for k in range(inputs))
    slots = {f"p{k}": value for k, value in enumerate(parameters)}
    head = f"    {', '.join(slots)}, = P\n" if slots else ""
    call = f"f({', '.join((*names, *slots))})"
    source = f"def program({', '.join((*names, 'P'))}):\n{head}    return ({call},)\n"
    return Program(source, names, frozenset(), {"f": function}, {}, slots, (call,), calls=1)


@pytest.mark.parametrize(
    ("function", "inputs", "parameters"),
    [
        (sign, 1, ()),
        (sqrt, 1, ()),
        (minimum, 2, ()),
        (maximum, 2, ()),
        (lambda x, y: modulo(x, abs(y) + 1.0), 2, ()),
        (lambda x, y: angle(planar(x, y), planar(1.0, -0.5)), 2, ()),
        (piecewise, 1, (KNOTS, ROWS)),
        (piecewise, 1, (KNOTS[:2], ROWS[:1])),
        (lambda x, *table: x + piecewise(0.5, *table), 1, (KNOTS, ROWS)),
    ],
)
def test_primitives_are_those_of_the_plane(function, inputs, parameters):
    program = program_of(function, inputs, parameters)
    pairs = [(x,) if inputs == 1 else (x, y) for x in ODD for y in (ODD if inputs == 2 else [0])]
    columns = dict(zip(program.inputs, np.array(pairs).T, strict=True))
    result = LlvmEngine(program).run(columns, len(pairs))[0]
    scalar = ScalarEngine(program)
    assert np.array_equal(result, [scalar.one(x)[0] for x in pairs], equal_nan=True)


def halved(state, floor):
    x, steps, _ = state
    return x * 0.5, steps + 1.0, x * 0.5 > floor


@pytest.mark.parametrize("cap", [0, 1, 3, 100])
def test_each_lane_of_a_loop_stops_by_itself(cap):
    program = program_of(lambda x, y: repeat(halved, (x, 0.0, x > y), cap, y)[:2], 2)
    x, y = np.array([8.0, 0.5, math.nan, 1.0, 1e9, 3.0, 0.0, -1.0, 5.0]), np.full(9, 0.7)
    result = LlvmEngine(program).run({"x0": x, "x1": y}, 9)[0]
    expected = np.array([ScalarEngine(program).one(pair)[0] for pair in zip(x, y, strict=True)])
    assert np.array_equal(np.array(result).T, expected, equal_nan=True)


def test_what_branches_on_a_number_is_declined():
    with pytest.raises(Untraceable, match="branches on a number"):
        LlvmEngine(program_of(lambda x: x if x > 0.0 else -x, 1))


def test_a_kernel_beyond_the_primitives_is_declined():
    with pytest.raises(Untraceable, match="more than the primitives"):
        LlvmEngine(program_of(lambda x: math.sqrt(x), 1))


# -- the choice of the engine --------------------------------------------------------------


def test_a_function_of_python_is_declined_with_its_reason():
    with pytest.raises(bm.RequestError, match="it asks a function of Python") as caught:
        arm(lambda rate: -0.3 * rate).compile().run(samples=3, engine="llvm")
    assert 'use engine="numpy"' in str(caught.value)


def test_a_program_of_great_length_is_declined(fresh, monkeypatch):
    monkeypatch.setattr(llvm, "LONGEST", 10)
    with pytest.raises(bm.RequestError, match="more than 10 operations"):
        watt(friction=True).run(samples=3, engine="llvm", want="crank.drive")


def test_without_the_package_the_extra_is_named(fresh, monkeypatch):
    monkeypatch.setitem(sys.modules, "llvmlite.binding", None)
    llvm.processor.cache_clear()
    with pytest.raises(bm.MissingEngineError, match=r"blockmech\[fast\]"):
        mechanism("pump").run(samples=3, engine="llvm", want="*.omega")
    assert ruiz().run(samples=500_000, want="crank.drive")._engine == "numpy"


def test_auto_compiles_where_it_pays_and_goes_on_with_what_is_compiled(fresh):
    llvm.processor()  # the compiler is loaded
    mech = ruiz().compile()
    want = ("crank.drive",)
    assert mech.run(at=1.0, want=want)._engine == "scalar"
    assert mech.run(samples=1000, want=want)._engine == "numpy"
    assert mech.run(samples=1_000_000, want=want)._engine == "llvm"
    assert mech.run(at=1.0, want=want)._engine == "llvm"
    assert mech.run(at=1.0, want=want, engine="scalar")._engine == "scalar"
    assert mech.run(samples=50, want=want, precision="complex64")._engine == "numpy"
    declined = arm(lambda rate: -0.3 * rate).compile()
    assert declined.run(samples=100, want="motor.*")._engine == "numpy"


def test_many_calls_of_few_samples_are_compiled_too(fresh):
    llvm.processor()
    mech, engines = ruiz().compile(), []
    for _ in range(300):
        engines.append(mech.run(samples=2000, want="crank.drive")._engine)
        if engines[-1] == "llvm":
            break
    program = mech.plan("crank.drive").program
    costs = cost.account(program)
    spent = len(engines) * costs.by_interpreter(program, 2000)[0]
    assert engines[-1] == "llvm"
    assert 1.0 < spent / costs.making(program) < 1.5  # half of the time was machine code's due
    twin = ruiz().compile()  # of the same structure: its code is there
    assert twin.run(samples=2000, want="crank.drive")._engine == "llvm"


@pytest.mark.parametrize("n", [1, 20, 400, 8_000, 160_000, 3_000_000])
def test_the_engine_is_the_one_that_costs_least(fresh, n):
    llvm.processor()
    program = watt(friction=True).compile().plan("*").program
    costs = cost.account(program)
    interpreted, name = costs.by_interpreter(program, n)
    code = costs.by_machine_code(program, n) + costs.making(program)
    assert costs.choice(program, n, has_code=False) == ("llvm" if code < interpreted else name)
    assert costs.choice(program, n, has_code=True) == "llvm"


def test_a_study_of_many_designs_is_compiled(fresh, monkeypatch):
    monkeypatch.setattr(cost, "COMPILING", (0.0, 0.0))
    calls = []
    run = LlvmEngine.run_designs
    monkeypatch.setattr(LlvmEngine, "run_designs", lambda *x: (calls.append(1), run(*x))[1])
    q, lengths = np.linspace(0.0, 6.0, 12), [5.8, 6.0, 6.3]
    want = {"crank.drive": "max_abs"}
    study = ruiz().compile().study({"dyad.l_i": lengths}, at={"crank": q}, want=want)
    assert calls
    for k, length in enumerate(lengths):
        mech = ruiz().replace({"dyad.l_i": length}).compile()
        alone = mech.run(at=q, want="crank.drive", engine="llvm")["crank.drive"]
        assert study["max_abs(crank.drive)"][k] == np.abs(alone).max()


def test_one_state_after_the_other_is_the_same_by_machine_code():
    mech = watt(spring=2.0).compile()
    program = mech.plan("crank.drive").program
    fast, scalar = (SingleEvaluator(program).engine(compiled) for compiled in (True, False))
    states = [[0.1 * k + j for j in range(len(program.inputs))] for k in range(40)]
    assert [fast.one(x) for x in states] == [scalar.one(x) for x in states]
    assert (fast.name, scalar.name) == ("llvm", "scalar")
    assert SingleEvaluator(program_of(lambda x: math.sqrt(x), 1)).engine(True).name == "scalar"


def test_machine_code_lives_as_long_as_the_engine_that_calls_it():
    first = LlvmEngine(program_of(lambda x: x * 3.0, 1))
    llvm._CODES.clear()  # as 64 other structures would
    engines = [LlvmEngine(program_of(lambda x, k=k: x + k, 1)) for k in (1.0, 2.0)]
    assert [engine.one([2.0]) for engine in (first, *engines)] == [(6.0,), (3.0,), (4.0,)]


def test_precisions_are_those_of_numpy():
    with pytest.raises(bm.RequestError, match='no engine "llvm" with precision "complex64"'):
        ruiz().run(samples=3, engine="llvm", precision="complex64")
