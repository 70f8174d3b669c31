"""What answers hold leaves as strict JSON, whatever stands in it."""

from __future__ import annotations

import json
from collections import namedtuple
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import blockmech as bm
from blockmech import synthesis
from blockmech.ground.report import Facts, as_json, sections

GRAPHS = Path(__file__).resolve().parents[1] / "graphs"


@dataclass(frozen=True)
class Answer(Facts):
    """Facts of every kind, one of them a property."""

    FACTS = ("table", "roots", "inside", "missing", "twice")

    table: np.ndarray
    roots: np.ndarray
    inside: tuple
    missing: float

    @property
    def twice(self) -> int:
        return 2 * len(self.table)


def test_arrays_complex_numbers_named_tuples_and_what_is_not_finite_become_json():
    left = namedtuple("left", "rms at")(np.float64(0.5), (1, np.inf))
    answer = Answer(np.eye(2), np.array([1 - 2j]), (left, True), float("nan"))
    data = answer.to_dict()
    assert data == {
        "table": [[1.0, 0.0], [0.0, 1.0]],
        "roots": [[1.0, -2.0]],
        "inside": [{"rms": 0.5, "at": [1, None]}, True],
        "missing": None,
        "twice": 4,
    }
    assert json.loads(json.dumps(data, allow_nan=False)) == data


def test_a_document_leaves_as_its_own_data():
    graph = bm.Graph.load(GRAPHS / "ruiz_fourbar.json")
    assert as_json(graph) == graph.to_data()


def test_parts_without_lines_leave_no_gap():
    assert "\n".join(sections([["a", "b"], [], ["c"]])) == "a\nb\n\nc"


def test_designs_leave_with_their_graphs():
    result = synthesis.path_generator([(0, 0), (1, 0.5), (2, 0.2), (1.5, -0.3)], starts=40)
    (first, *_) = json.loads(json.dumps(result.to_dict(), allow_nan=False))["designs"]
    assert bm.Graph.from_data(first["graph"]).compile().name == result[0].graph.name


@pytest.mark.parametrize("name", ["joints/engine", "joints/ruiz_fourbar"])
def test_real_eigenvalues_of_an_equilibrium_are_pairs_as_complex_ones(name):
    mechanism = bm.Linkage.load(GRAPHS / f"{name}.json").compile()
    for equilibrium in mechanism.equilibria().to_dict()["equilibria"]:
        assert all(len(pair) == 2 for pair in equilibrium["values"])
