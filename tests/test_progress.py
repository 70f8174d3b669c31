"""A notebook shows a bar for calls that last; nothing is cell elsewhere, or beside a caller's."""

import sys
from types import ModuleType, SimpleNamespace

import pytest

import blockmech as bm
from blockmech.ground import progress
from tests.gallery import GRAPHS

START = {"crank": (0.0, 5.0)}


@pytest.fixture
def cell(monkeypatch):
    """What a notebook's cell shows, one text for each state of its output."""
    texts = []

    def display(item, display_id):
        texts.append(item)
        return SimpleNamespace(update=texts.append)

    packages = {"IPython": ModuleType("IPython"), "IPython.display": ModuleType("display")}
    packages["IPython"].get_ipython = lambda: SimpleNamespace(kernel=object())
    packages["IPython.display"].display, packages["IPython.display"].HTML = display, str
    for name, package in packages.items():
        monkeypatch.setitem(sys.modules, name, package)
    monkeypatch.setattr(progress, "PATIENCE", 0.0)
    monkeypatch.setattr(progress, "REFRESH", 0.0)
    return texts


@pytest.fixture(scope="module")
def mechanism():
    return bm.read(GRAPHS / "ruiz_fourbar.json").compile()


def test_a_motion_and_a_study_show_how_far_they_are_and_clear_it(mechanism, cell):
    mechanism.simulate("time=0.5", start=START)
    assert cell[0].startswith("<progress")
    assert cell[-1] == ""
    del cell[:]
    mechanism.study({"dyad.l_i": [5.9, 6.0]}, want="max(crank.drive)", samples=5)
    assert cell[-2].startswith('<progress value="1.000"></progress> ')
    assert cell[-1] == ""


def test_a_caller_who_follows_the_progress_sees_no_bar(mechanism, cell):
    calls = []
    mechanism.simulate("time=0.5", start=START, progress=lambda *state: calls.append(state))
    assert calls
    assert cell == []


def test_motions_of_a_study_show_no_bars_of_their_own(mechanism, cell):
    masses = {"crank.links.crank.mass": [0.5, 1.0]}
    motion, calls = {"until": "time=0.1", "start": START}, []
    mechanism.study(masses, want="motion.t_end", simulate=motion)
    assert [x for x in cell if "designs" not in x] == [""]
    del cell[:]
    arguments = {"simulate": motion, "progress": lambda *state: calls.append(state)}
    mechanism.study(masses, want="motion.t_end", **arguments)
    assert calls
    assert cell == []
    mechanism.simulate("time=0.5", start=START)
    assert cell[-1] == ""


def test_a_call_that_is_over_at_once_shows_nothing(mechanism, cell, monkeypatch):
    monkeypatch.setattr(progress, "PATIENCE", 1e9)
    mechanism.simulate("time=0.5", start=START)
    assert cell == []


def test_a_terminal_of_ipython_shows_nothing(mechanism, cell):
    sys.modules["IPython"].get_ipython = lambda: SimpleNamespace()
    mechanism.simulate("time=0.5", start=START)
    assert cell == []
