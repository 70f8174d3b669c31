"""C text of a plan: the numbers of the scalar engine, bit by bit, as a compiler makes them."""

import math
import subprocess

import numpy as np
import pytest

import blockmech as bm
from blockmech.exchange.c.program import CProgram, identifier
from blockmech.ground.errors import RequestError
from blockmech.ground.plane import EPS
from blockmech.passes.homotopy import followed
from blockmech.result.quality import WORDS
from blockmech.testing.strategies import EVERY, Options, Seeded, random_mechanism
from tests.exchange.compiled_c import COMPILERS, NEEDS_C, Called, compiled, scalar, states
from tests.gallery import GRAPHS, JOINTS, SHORT, mechanism
from tests.machines import ruiz

GENERAL = 1e-12  # of the largest number of a unit, over the smallest margin's root
ANGLES = (
    "angle",
    "transmission_angle",
    "coordinate",
)  # NumPy's own atan2 is not the mathematical library's


OPTIMISED = ["ruiz_fourbar", "engine", "stephenson_3_triad", "geared_fivebar"]  # the campaign: all


@NEEDS_C
@pytest.mark.parametrize("name", SHORT)
def test_every_graph_of_the_gallery_has_the_bits_of_the_scalar_engine(name, tmp_path):
    mech = mechanism(name)
    program = CProgram(mech)
    general = bool(followed(mech.structure))
    many = 120 if general else 300
    samples = states(mech, many, seed=7)
    level = "-O1" if name in OPTIMISED else "-O0"
    values, statuses = Called(program, tmp_path, level=level)(samples)
    expected = scalar(program, samples)
    assert [WORDS[i] for i in statuses] == list(expected.quality.status)
    good = statuses == 0
    assert good.sum() > 2 * many / 3
    columns = np.stack([np.where(good, program.column(expected, n), 0) for n in program.outputs], 1)
    scales = program._scales(columns)
    for j, column in enumerate(program.outputs):
        at = good & np.isfinite(columns[:, j])
        off = np.abs(values[at, j] - columns[at, j])
        if general:
            margins = [np.asarray(m)[at] for m in expected.quality.margin.values()]
            margin = np.minimum.reduce(margins)
            assert (off <= GENERAL * scales[j] / np.minimum(margin, 1.0)).all(), column
        elif column.endswith(ANGLES):
            assert (off <= np.spacing(math.pi)).all(), column
        else:
            assert (values[at, j] == columns[at, j]).all(), column


@NEEDS_C
def test_the_word_says_why_there_is_no_answer(tmp_path):
    program = CProgram(ruiz(radius=4.0).compile(), "crank.drive")
    samples = program.mechanism.samples(np.linspace(0.0, 6.0, 60), None, None, 10.0, None)
    _, statuses = Called(program, tmp_path, level="-O0")(samples)
    expected = scalar(program, samples).quality.status
    assert {"ok", "self-locked"} <= set(expected)
    assert [WORDS[i] for i in statuses] == list(expected)


@NEEDS_C
@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("real", ["double", "float"])
@pytest.mark.parametrize("name", OPTIMISED)
def test_the_test_program_passes(name, real, compiler, tmp_path):
    """Each compiler and each kind of number with and without optimisation, not all their pairs."""
    level = "-O1" if (real == "float") == (compiler == "gcc") else "-O0"
    files = bm.write(mechanism(name), tmp_path / "machine.c", real=real)
    assert [path.name for path in files] == ["machine.h", "machine.c", "machine_test.c"]
    sources = ("machine.c", "machine_test.c")
    program = compiled(tmp_path, "test", *sources, compiler=compiler, level=level)
    result = subprocess.run([str(program)], capture_output=True, text=True, timeout=60)
    assert result.returncode == 0, result.stdout[:2000]
    assert result.stdout.startswith("machine: 0 of 24 poses")


@NEEDS_C
def test_the_test_program_can_fail(tmp_path):
    bm.write(mechanism("watt_sixbar"), tmp_path / "m.c", want=["crank.drive", "*.p"])
    text = (tmp_path / "m.c").read_text("ascii")
    assert "const real x" in text
    changed = text.replace("SIN(in->", "COS(in->", 1)
    assert changed != text
    (tmp_path / "m.c").write_text(changed, "ascii")
    program = compiled(tmp_path, "test", "m.c", "m_test.c")
    assert subprocess.run([str(program)], capture_output=True, timeout=60).returncode == 1


def test_parameters_inputs_and_outputs_have_names():
    program = CProgram(mechanism("ruiz_fourbar"), ["crank.drive", "dyad.C.reaction"])
    assert [m.name for m in program.inputs] == ["crank_q", "crank_rate", "crank_acceleration"]
    assert [m.name for m in program.outputs.values()] == [
        "crank_drive",
        "dyad_C_reaction_x",
        "dyad_C_reaction_y",
    ]
    assert "[N m]" in program.header
    numbers = {m.name: m.numbers for m in program.parameters}
    assert (2.0,) in numbers.values()  # the crank's length
    assert "malloc" not in program.source
    assert "static real" not in program.source


def test_figures_of_a_run_are_left_out_by_name_and_refused_alone():
    program = CProgram(mechanism("ruiz_fourbar"))
    assert program.left_out == ("mechanism.friction_efficiency",)
    assert "mechanism.friction_efficiency" in program.header
    with pytest.raises(RequestError, match=r"a figure of a whole run"):
        CProgram(mechanism("ruiz_fourbar"), "mechanism.friction_efficiency")


def test_what_no_c_text_can_say_is_refused_by_name():
    with pytest.raises(RequestError, match=r'no format "fmuu".*did you mean "fmu"'):
        bm.write(mechanism("ruiz_fourbar"), "x.c", to="fmuu")
    with pytest.raises(RequestError, match=r'no option "reel".*real'):
        bm.write(mechanism("ruiz_fourbar"), "x.c", reel="float")
    with pytest.raises(RequestError, match=r'no precision "half".*double, float'):
        bm.write(mechanism("ruiz_fourbar"), "x.c", real="half")
    with pytest.raises(RequestError, match=r'no format has the suffix ".nono"'):
        bm.write(mechanism("ruiz_fourbar"), "x.nono")


def test_signals_are_refused_by_name_where_they_count():
    mech = bm.Graph.load(GRAPHS / "control" / "speed_controlled_fourbar.json").compile()
    with pytest.raises(RequestError) as refusal:
        CProgram(mech)
    with pytest.raises(RequestError) as run:
        mech.run(at=[0.1])
    assert refusal.value.problems == run.value.problems
    assert CProgram(mech, "*.p").outputs


def test_names_and_titles_cannot_leave_their_comment():
    data = {"format": "blockmech/graph", "version": 1, "name": "a*/b\\", "title": "*/ #error ??/"}
    data["blocks"] = {
        "frame": {"type": "frame", "markers": {"A": {"at": [0, 0]}}},
        "int*": {"type": "driver.crank", "length": 1.0},
    }
    data["wires"] = [{"from": "frame.A", "to": "int*.A"}]
    program = CProgram(bm.Graph.from_data(data).compile())
    inside = program.header.split("*/")
    assert program.header.count("/*") == len(inside) - 1
    assert program.header.isascii()
    assert identifier("for") == "m_for"
    assert identifier("3 bars") == "m_3_bars"


@NEEDS_C
@pytest.mark.parametrize("name", ["elliptic_trammel", "tangent_generator"])
def test_documents_of_links_and_joints_have_the_numbers_of_the_scalar_engine(name, tmp_path):
    mech = bm.Linkage.load(JOINTS / f"{name}.json").compile()
    program = CProgram(mech)
    samples = states(mech, 60, seed=7)
    values, statuses = Called(program, tmp_path, level="-O0")(samples)
    expected = scalar(program, samples)
    good = statuses == 0
    assert good.sum() > 20
    columns = np.stack([np.where(good, program.column(expected, n), 0) for n in program.outputs], 1)
    scales = program._scales(columns)
    for j, column in enumerate(program.outputs):
        at = good & np.isfinite(columns[:, j])
        assert (np.abs(values[at, j] - columns[at, j]) <= 8 * EPS * scales[j]).all(), column


@NEEDS_C
@pytest.mark.parametrize("name", ["clock", "random"])
def test_a_mechanism_with_the_name_of_a_library_function_is_itself(name, tmp_path):
    graph = ruiz()
    graph.name = name
    program = CProgram(graph.compile(), ["crank.drive", "*.p"])
    samples = states(program.mechanism, 20, seed=1)
    values, statuses = Called(program, tmp_path)(samples)
    expected = scalar(program, samples)
    assert not statuses.any()
    for column, output in zip(values.T, program.outputs, strict=True):
        np.testing.assert_array_equal(column, program.column(expected, output))


def test_matrices_of_drivers_that_are_pairs_of_groups_are_written():
    mech = random_mechanism(Seeded(0), Options(groups=(1, 3), kinds=EVERY)).graph.compile()
    drivers = mech.drivers
    assert any("." in d for d in drivers)
    program = CProgram(mech, ["mechanism.M", "mechanism.Q"])
    samples = states(mech, 5, seed=2)
    expected = scalar(program, samples)
    columns = np.stack([program.column(expected, name) for name in program.outputs], axis=1)
    square = len(drivers) ** 2
    np.testing.assert_array_equal(columns[:, :square], expected["mechanism.M"].reshape(5, square))
    np.testing.assert_array_equal(columns[:, square:], expected["mechanism.Q"])
    assert f"mechanism.M.{drivers[0]}.{drivers[-1]}" in program.outputs
    assert len(program.test(samples).splitlines()) > 5


@NEEDS_C
def test_a_table_is_read_at_a_rate_that_is_always_zero(tmp_path):
    press = bm.Linkage.load(JOINTS / "slider_crank.json")
    guide = next(x for x in press.joints.values() if x.type == "P")
    points = {"arguments": [-1.0, 0.5], "values": [1.0, 2.0], "interpolation": "linear"}
    law = bm.laws.Table(of="rate", **points)
    press.add_load("brake", "motor", links=list(guide.links), law=law)
    mech = press.compile()
    program = CProgram(mech, want=["brake.*"])
    samples = mech.samples([0.3, 0.4], None, None, None, None)
    values, _ = Called(program, tmp_path)(samples)
    run = scalar(program, samples)
    np.testing.assert_array_equal(values, np.array([run[n] for n in program.outputs]).T)
    assert np.isclose(np.abs(values), 5 / 3).any()
