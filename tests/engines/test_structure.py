"""The key of a structure, known before any tracing, stands for one text of machine code."""

from dataclasses import replace

import numpy as np
import pytest

from blockmech.engines import llvm
from blockmech.engines.code_cache import key_of
from blockmech.engines.numpy import each_part
from blockmech.engines.trace import Trace, filled
from tests.engines.test_llvm import program_of
from tests.gallery import SHORT, mechanism
from tests.loads.test_functions import arm
from tests.machines import ruiz
from tests.wiring import same_bits

pytest.importorskip("llvmlite", reason="the compiled engine needs the extra fast")


def programs(name):
    mech = mechanism(name)
    for friction in ("none", "single", "newton") if mech.frictional_joints else ("none",):
        yield mech.plan("*", friction=friction).program
    yield mech.plan("*.p").program


def with_other_numbers(program):
    """The same program of another design: no number of it is the same."""
    numbers = {
        name: each_part(lambda x: 0.7 * x + 0.1, filled_as(value))
        for name, value in program.parameters.items()
    }
    return replace(program, parameters=numbers)


def filled_as(value):
    """A value with vectors as pairs, and its numbers."""
    numbers = iter([float(x) for x in llvm.leaves(value)])
    return filled(value, lambda: next(numbers))


@pytest.mark.parametrize("name", SHORT)
def test_what_a_key_stands_for_is_what_a_trace_says(name):
    keys = {}
    for program in programs(name):
        variant = with_other_numbers(program)
        assert key_of(variant) == key_of(program) is not None
        traced, text = llvm._traced(program)
        assert llvm._traced(variant) == (traced, text)
        keys[key_of(program)] = text
    texts = list(keys.values())
    assert len(set(texts)) == len(texts) == len(list(programs(name)))


def adding(x):
    return lambda y: x + y


def test_what_a_closure_holds_is_a_part_of_the_structure(monkeypatch):
    monkeypatch.setattr("blockmech.engines.code_cache.OWN", "tests.")  # as if of the package
    first, second, again = (program_of(adding(x), 1) for x in (1.0, 2.0, 1.0))
    assert key_of(first) == key_of(again) != key_of(second)
    assert key_of(program_of(adding(1), 1)) != key_of(first)
    assert key_of(program_of(adding((1.0, adding(2.0))), 1)) != key_of(
        program_of(adding((1.0, adding(3.0))), 1)
    )


def test_kinds_of_numbers_are_a_part_of_the_structure():
    program = ruiz().compile().plan("crank.drive").program
    first, *_ = (name for name, x in program.parameters.items() if isinstance(x, float))
    variant = replace(program, parameters={**program.parameters, first: 1 + 1j})
    longer = replace(program, parameters={**program.parameters, first: (1.0, 2.0)})
    assert len({key_of(program), key_of(variant), key_of(longer)}) == 3


def test_functions_of_users_have_no_key_and_are_traced_each_time():
    assert key_of(arm(lambda time: 0.3 * time).compile().plan("*").program) is None
    assert key_of(program_of(lambda x: x, 1)) is None


@pytest.mark.parametrize("name", ["ruiz_fourbar", "scissor_lift"])
def test_a_structure_that_is_known_is_traced_no_more(name, monkeypatch, tmp_path):
    monkeypatch.setenv("BLOCKMECH_CACHE", str(tmp_path))
    mech, traces = mechanism(name), []
    begin = Trace.__init__
    monkeypatch.setattr(Trace, "__init__", lambda *x, **k: (traces.append(1), begin(*x, **k))[1])
    program = mech.plan("*.p").program
    inputs = dict.fromkeys(program.inputs, np.linspace(0.2, 0.4, 9))
    values = []
    for clear in (True, False, True):  # made, of the memory, of the disk
        if clear:
            llvm._CODES.clear()
        values.append(llvm.LlvmEngine(program).run(inputs, 9))
    assert len(traces) == 1
    columns = [dict(enumerate(np.array(llvm.leaves(x)))) for x in values]
    assert same_bits(columns[0], columns[1]) == same_bits(columns[0], columns[2]) == []
