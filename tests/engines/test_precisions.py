"""Single, double and extended precision: one kernel text, no number of another width inside."""

from dataclasses import replace

import numpy as np
import pytest

from blockmech.engines.binding import bind
from blockmech.engines.interpreters import NumpyEngine
from blockmech.engines.numpy import Planar, primitives
from tests.machines import ruiz, toggle, watt

SINGLE = float(np.finfo(np.float32).eps)
DOUBLE = float(np.finfo(float).eps)
EXTENDED = float(np.finfo(np.longdouble).eps)
WIDTH = {"complex64": np.float32, "complex128": np.float64, "clongdouble": np.longdouble}
MAKERS = {"ruiz": ruiz, "toggle": toggle, "watt": lambda: watt(spring=2.0, friction=True)}
EACH_GRAPH = pytest.mark.parametrize("name", MAKERS)
# Errors of a long formula in ulps of the precision: some 50 operations, each times a
# condition below 10 (margins of these mechanisms are above 0.02).
ULPS = 500


def leaves(value, where=""):
    """All arrays and NumPy numbers in a nested value; Python numbers adapt to any width."""
    if isinstance(value, Planar):
        yield f"{where}.x", value.real
        yield f"{where}.y", value.imag
    elif isinstance(value, tuple):
        names = getattr(value, "_fields", range(len(value)))
        for name, part in zip(names, value, strict=True):
            yield from leaves(part, f"{where}.{name}")
    elif isinstance(value, np.ndarray | np.generic):
        yield where, value


def every_value(plan, precision, inputs):
    """Name -> value of every line of a program, the parameters included."""
    head, _, _ = plan.program.source.rpartition("    return ")
    traced = replace(plan.program, source=f"{head}    return (locals(),)\n")
    engine = NumpyEngine(plan.program, precision)  # its own program lets go of values
    columns = [engine._rounded(name, inputs[name]) for name in plan.program.inputs]
    with np.errstate(all="ignore"):
        run = bind(traced, primitives(engine.dtype), engine.constants)
        return run(*columns, engine.parameters)[0]


@pytest.mark.parametrize("friction", ["none", "single", "successive", "newton"])
@pytest.mark.parametrize("precision", WIDTH)
@EACH_GRAPH
def test_no_number_of_another_width_gets_in(name, precision, friction):
    mech = MAKERS[name]().compile()
    plan = mech.plan("*", friction=friction)
    inputs = mech.run(samples=7, want="*.q").samples.inputs
    for line, value in every_value(plan, precision, inputs).items():
        if line in plan.program.angles:
            assert value.dtype == np.float64  # until sine and cosine are taken
            continue
        for where, part in leaves(value, line):
            assert part.dtype in (WIDTH[precision], np.bool_), where


def test_no_double_gets_in_where_continuation_decides():
    mech = ruiz(radius=2.0).compile()  # f' r = 0.8 m: beyond the certificate
    plan = mech.plan("*")
    q = {"q_0": np.linspace(0.05, 6.2, 9), "qd_0": np.full(9, 10.0), "qdd_0": np.zeros(9)}
    for line, value in every_value(plan, "complex64", q).items():
        for where, part in leaves(value, line):
            assert line in plan.program.angles or part.dtype in (np.float32, np.bool_), where


def relative(result, exact):
    return {
        k: np.max(np.abs(result[k] - exact[k])) / (np.max(np.abs(exact[k])) or 1.0)
        for k in exact
        if np.ndim(exact[k])
    }


@EACH_GRAPH
@pytest.mark.parametrize(("precision", "eps"), [("complex64", SINGLE), ("clongdouble", DOUBLE)])
def test_other_precisions_agree_with_double_to_the_coarser_one(name, precision, eps):
    mech = MAKERS[name]().compile()
    exact = mech.run(samples=9, engine="numpy")
    result = mech.run(samples=9, precision=precision)
    worst = relative(result, exact)
    assert max(worst.values()) <= ULPS * eps, max(worst, key=worst.get)
    assert result.quality.status == exact.quality.status


@pytest.mark.skipif(EXTENDED > 1e-18, reason="long double is no wider than double here")
@EACH_GRAPH
def test_extended_precision_is_extended(name):
    # Two routes to the driving effort part at the precision they are computed in.
    r = MAKERS[name]().run(samples=9, precision="clongdouble", friction="none")
    driver = r.mechanism.drivers[0]
    drive, reduced = r[f"{driver}.drive"], r[f"{driver}.drive_by_reduction"]
    assert drive.dtype == np.longdouble
    assert np.max(np.abs(drive - reduced)) <= ULPS * EXTENDED * np.max(np.abs(drive))
    assert r["mechanism.shaking_force"].dtype == np.clongdouble


def test_crank_angle_stays_double_in_single_precision():
    # 1e8 + 0.3 rad has no sense in single precision: neighbours there are 8 rad apart.
    q = 1e8 + 0.3
    exact = ruiz().run(at=q, want=["dyad.C.p", "crank.q"])
    result = ruiz().run(at=q, want=["dyad.C.p", "crank.q"], precision="complex64")
    assert abs(result["dyad.C.p"][0] - exact["dyad.C.p"][0]) < 20 * SINGLE * 7.0
    assert result["crank.q"][0] == q


def test_pair_without_load_has_no_friction_in_single_precision():
    # Newton divides by the load of each pair: 1e-300 N is not a single-precision number.
    graph = ruiz()
    graph.blocks.pop("weightlike")
    graph.blocks.pop("couple")
    graph.wires[:] = graph.wires[:3]
    r = graph.run(at=1.0, rates=10.0, static=True, precision="complex64")
    assert r.quality.status == ("ok",)
    g = watt(massive=False, gravity=False, friction=True)
    import blockmech as bm

    g.add("nothing", bm.Force(force=(0.0, 0.0)))
    g.connect("last.K6", "nothing.at")
    for precision in WIDTH:
        r = g.run(at=[1.0, 2.0], precision=precision, engine="numpy")
        assert r.quality.status == ("ok", "ok")
        assert np.all(r["last.C.reaction"] == 0)
