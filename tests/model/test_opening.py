"""A file is opened as what its format says: a graph of blocks, or links and joints."""

from __future__ import annotations

import json

import pytest

import blockmech as bm
from blockmech import Graph
from blockmech.builders import opened, problems_in
from blockmech.ground.errors import FormatError
from tests.machines import ruiz
from tests.model.documents import slider_crank


@pytest.fixture
def write(tmp_path):
    def writing(data):
        path = tmp_path / "mechanism.json"
        path.write_text(data if isinstance(data, str) else json.dumps(data), encoding="utf-8")
        return path

    return writing


def test_each_format_is_opened_by_its_reader(write, tmp_path):
    joints = opened(write(slider_crank()))
    assert isinstance(joints, bm.Linkage)
    assert joints.file.endswith("mechanism.json")
    ruiz().save(tmp_path / "graph.json")
    assert isinstance(opened(tmp_path / "graph.json"), Graph)


def test_a_file_without_a_format_is_told_to_name_the_one_it_looks_like(write):
    document = slider_crank()
    del document["format"]
    with pytest.raises(FormatError, match=r"has no format.*blockmech/joints"):
        opened(write(document))
    with pytest.raises(FormatError, match=r"has no format.*blockmech/graph"):
        opened(write({"version": 1, "blocks": {}}))


@pytest.mark.parametrize("text", ["", "{", "[1]", '{"format": 3}', '{"format": "blockmech/joint"}'])
def test_what_is_neither_is_one_clear_problem(write, text):
    (problem,) = problems_in(write(text))
    assert problem.file.endswith("mechanism.json")


def test_problems_of_both_kinds_come_with_the_file(write):
    document = slider_crank()
    document["joints"].pop("B")
    result = problems_in(write(document))
    assert result
    assert all(p.file.endswith("mechanism.json") for p in result)
    assert problems_in(write(slider_crank())) == []
