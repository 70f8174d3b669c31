"""Programs of arrays let go of what they need no more."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from blockmech.engines import NumpyEngine, bind
from blockmech.engines.numpy import CHUNK, primitives
from blockmech.engines.releasing import releasing
from blockmech.plan import Program
from tests.wiring import chain, ruiz

SHARE = 0.25  # of all arrays of a chain that are needed at one time, at most
PROGRAM = Program(
    source="def program(t, x, P):\n    a, = P\n    e = f(x)\n    y = g(e, 1e-3, a.t)\n"
    "    z = h(y, y.x)\n    return (z, x)\n",
    inputs=("t", "x"),
    angles=frozenset(),
    functions={},
    parameters={"a": 1.0},
    outputs=("z", "x"),
)


def test_a_value_goes_after_its_last_use_and_what_is_returned_stays() -> None:
    lines = releasing(PROGRAM).source.splitlines()
    assert lines[2:5] == ["    e = f(x)", "    y = g(e, 1e-3, a.t)", "    del e"]
    assert lines[5:] == ["    z = h(y, y.x)", "    del y", "    return (z, x, )"]


def test_fields_and_exponents_are_no_names_of_values() -> None:
    # "t" stands behind a dot only, "e" last as a value in line 2: neither is let go again.
    assert releasing(PROGRAM).source.count("del ") == 2


def test_a_name_that_comes_later_is_not_let_go_before() -> None:
    early = replace(PROGRAM, source=PROGRAM.source.replace("f(x)", "f(x, z)"))
    assert "del z" not in releasing(early).source


def test_of_a_value_of_which_a_part_is_returned_the_part_is_kept() -> None:
    part = replace(PROGRAM, outputs=("y.margin", "z", "y[0].o"))
    lines = releasing(part).source.splitlines()
    assert lines[3:9] == [
        "    del x",
        "    y = g(e, 1e-3, a.t)",
        "    del e",
        "    part_0 = y.margin",
        "    part_2 = y[0].o",
        "    z = h(y, y.x)",
    ]
    assert lines[9:] == ["    del y", "    return (part_0, z, part_2, )"]


def highest(run: Callable[[], object]) -> int:
    """The most memory [bytes] in use at one time."""
    run()
    tracemalloc.start()
    run()
    _, found = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return found


def test_a_long_program_of_arrays_needs_little_memory() -> None:
    program = chain(30).compile().plan("dyad00029.C.p").program
    engine = NumpyEngine(program)
    q = np.linspace(-0.01, 0.01, CHUNK)
    given = {"q_0": q}
    keeps = bind(program, primitives(engine.dtype), engine.constants)
    columns = [given[name] for name in program.inputs]
    everything = highest(lambda: keeps(*columns, engine.parameters))
    assert highest(lambda: engine.run(given, CHUNK)) < SHARE * everything


def test_releasing_changes_no_name_that_a_user_reads() -> None:
    plan = ruiz().compile().plan("crank.drive")
    assert "del " not in plan.program.source
