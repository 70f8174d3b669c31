"""The pytest plugin: one ini line makes tests of graph files, and without it nothing happens."""

from __future__ import annotations

import json

import pytest

import blockmech as bm
from tests.model.documents import slider_crank
from tests.testing.conftest import MET, MISSED

pytest_plugins = ["pytester"]


@pytest.fixture
def home(pytester):
    """Files stand in the project that pytest runs in."""
    return pytester.path


@pytest.fixture
def graphs(pytester, file):
    """A project with one ini line, one passing and one failing entry, and a test module."""
    pytester.makeini("[pytest]\nblockmech_graphs = graphs\n")
    pytester.makepyfile(test_own="def test_own():\n    pass\n")
    file("graphs/arm.json", MET, MISSED)


def with_more_tests(pytester):
    """A folder of test paths with one test."""
    path = pytester.mkdir("tests") / "test_more.py"
    path.write_text("def test_more():\n    pass\n", encoding="utf-8")


def run(pytester, *arguments):
    """Run pytest in this process, without a plugin that would import hypothesis each time."""
    return pytester.runpytest("-p", "no:hypothesispytest", *arguments)


def ran(pytester, *arguments):
    """Node ids that a run collects, e.g. ``graphs/arm.json::expect[0]``."""
    result = run(pytester, *arguments, "--collect-only", "-q")
    return [line for line in result.outlines if "::" in line]


# -- outcomes --------------------------------------------------------------------------------


def test_each_expectation_is_a_test(pytester, graphs):
    result = run(pytester, "-v")
    result.assert_outcomes(passed=2, failed=1)
    result.stdout.fnmatch_lines(
        [
            "*graphs/arm.json::expect?0? PASSED*",
            "*graphs/arm.json::expect?1? FAILED*",
            "*test_own.py::test_own PASSED*",
        ]
    )


def test_a_failure_shows_the_numbers_and_no_traceback(pytester, graphs):
    result = run(pytester, "graphs")
    assert result.ret == pytest.ExitCode.TESTS_FAILED
    result.stdout.fnmatch_lines(
        [
            "*1 of 4 numbers are not met (a slip)",
            "output *sample: drivers* expected *got *error *tolerance *margin",
            "crank.q [[]rad[]] *1: crank = 1 *1.5 *1 *0.5 *0.001 *-",
        ]
    )
    result.stdout.no_fnmatch_line("*Traceback*")
    result.stdout.no_fnmatch_line("*.py:*")


def test_a_graph_without_expectations_is_a_test_that_it_closes(pytester, graphs, file):
    file("graphs/arm.json")
    assert ran(pytester, "graphs") == ["graphs/arm.json::closes"]
    run(pytester, "graphs").assert_outcomes(passed=1)


def test_a_graph_that_does_not_close_at_its_start_fails(pytester, graphs, short):
    short.drive("crank", bm.motion.ConstantRate(rate=1.0, start=3.0))
    short.save(pytester.path / "graphs" / "arm.json")
    result = run(pytester, "graphs")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["*no-assembly*dyad*crank.q = 3 rad*"])
    result.stdout.no_fnmatch_line("*Traceback*")


def test_a_wrong_file_fails_alone(pytester, graphs):
    (pytester.path / "graphs" / "spoiled.json").write_text("{", encoding="utf-8")
    result = run(pytester)
    result.assert_outcomes(passed=2, failed=2)
    result.stdout.fnmatch_lines(["*spoiled.json::reads*", "*truncated*line 1, column 2*"])


# -- which files -----------------------------------------------------------------------------


def test_broken_legacy_and_other_files_are_left_out(pytester, graphs, file):
    for name in ("graphs/broken/a.json", "graphs/more/legacy/b.json", "elsewhere/c.json"):
        file(name, MET)
    (pytester.path / "graphs" / "notes.txt").write_text("no graph", encoding="utf-8")
    file("graphs/more/d.json", MET)
    assert ran(pytester) == [
        "graphs/arm.json::expect[0]",
        "graphs/arm.json::expect[1]",
        "graphs/more/d.json::expect[0]",
        "test_own.py::test_own",
    ]


def test_several_folders_may_be_named(pytester, graphs, file):
    pytester.makeini("[pytest]\nblockmech_graphs = graphs other/graphs\n")
    file("other/graphs/a.json", MET)
    assert ran(pytester, "other") == ["other/graphs/a.json::expect[0]"]
    assert len(ran(pytester)) == 4


@pytest.mark.parametrize("words", [[], ["tests"], ["graphs", "tests"]])
def test_the_folders_join_a_run_of_all_test_paths(pytester, graphs, words):
    pytester.makeini("[pytest]\ntestpaths = tests\nblockmech_graphs = graphs\n")
    with_more_tests(pytester)
    assert sorted(ran(pytester, *words)) == [
        "graphs/arm.json::expect[0]",
        "graphs/arm.json::expect[1]",
        "tests/test_more.py::test_more",
    ]


def test_the_folders_do_not_join_a_run_of_some_tests(pytester, graphs):
    pytester.makeini("[pytest]\ntestpaths = tests\nblockmech_graphs = graphs\n")
    with_more_tests(pytester)
    for word in ("tests/test_more.py", "tests/test_more.py::test_more"):
        assert ran(pytester, word) == ["tests/test_more.py::test_more"]


def test_a_folder_inside_the_test_paths_runs_once(pytester, graphs, file):
    pytester.makeini("[pytest]\ntestpaths = tests\nblockmech_graphs = tests/graphs\n")
    file("tests/graphs/a.json", MET)
    assert ran(pytester) == ["tests/graphs/a.json::expect[0]"]


def test_a_folder_that_is_not_there_is_a_usage_error(pytester, graphs):
    pytester.makeini("[pytest]\nblockmech_graphs = grafs\n")
    result = run(pytester)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["*blockmech_graphs names *grafs, which is not a folder*"])


def test_workers_of_xdist_run_the_same_tests(pytester, graphs):
    pytest.importorskip("xdist", reason="it comes with the extra test")
    pytester.makeini("[pytest]\ntestpaths = tests\nblockmech_graphs = graphs\n")
    with_more_tests(pytester)
    run(pytester, "-n", "2").assert_outcomes(passed=2, failed=1)


# -- not configured --------------------------------------------------------------------------


def test_without_the_ini_line_nothing_is_collected(pytester, graphs):
    pytester.makeini("[pytest]\n")
    assert ran(pytester) == ["test_own.py::test_own"]


def test_without_the_ini_line_pytest_does_not_import_blockmech(pytester):
    pytester.makepyfile(
        """
        import sys

        def test_not_imported():
            assert "pytest_blockmech" in sys.modules
            assert "blockmech" not in sys.modules
        """
    )
    pytester.runpytest_subprocess().assert_outcomes(passed=1)


def test_a_document_of_links_and_joints_is_a_test_of_itself(pytester):
    pytester.makeini("[pytest]\nblockmech_graphs = graphs\n")
    folder = pytester.mkdir("graphs")
    document = slider_crank()
    entry = {"source": "the crank's motion, by hand", "at": {"motor": [0.0]}, "atol": 1e-12}
    good, bad = ({"link.rod.p": [[x, 0.0]]} for x in (0.1, 0.2))
    document["expect"] = [entry | {"want": good}, entry | {"want": bad}]
    (folder / "crank.json").write_text(json.dumps(document), encoding="utf-8")
    (folder / "silent.json").write_text(json.dumps(slider_crank()), encoding="utf-8")
    result = run(pytester)
    result.assert_outcomes(passed=2, failed=1)
    result.stdout.fnmatch_lines(["*crank.json::expect[[]1]*", "*link.rod.p*"])
