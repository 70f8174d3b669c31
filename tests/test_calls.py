"""Every public call ends in an answer or in an error of ours.

All calls on one machine, whose formats take turns, and on each file of the gallery one of them;
the whole is `tests.campaigns.calls`.
"""

from __future__ import annotations

import sys

import pytest

from blockmech.ground.runnable import LazyMethod
from blockmech.mechanism import Mechanism
from tests.calls import CALLS, METHODS, MORE, Subject, faults, gallery_files
from tests.gallery import GRAPHS

LONG = (
    *("n_four_bar", "parallelogram_chain", "floating_drive_press", "excavator", "scissor_lift"),
    "class_4",
)
DEAR = ("blockmech ", "draw ", "write ", "film", "trade", "mode shapes", "replace")
STEPS = {"_with_deflections"}  # of other methods
FILES = [name for name in gallery_files() if not any(word in name for word in LONG)]
CHEAP = [*METHODS, *MORE]
CHEAP = [call for call in CHEAP if not call.startswith(DEAR)]
FILMS = ("film", "write film", "draw animation", "mode shapes")  # drawn elsewhere
EACH = 1  # calls on each file


def test_a_method_whose_file_cannot_be_loaded_names_what_is_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "blockmech.analysis.peaks", None)
    lazy = LazyMethod("blockmech.analysis.peaks.largest")
    lazy.__set_name__(Mechanism, "largest")
    with pytest.raises(ModuleNotFoundError, match=r"blockmech\.analysis\.peaks"):
        lazy.__get__(None, Mechanism)


def test_every_method_of_a_mechanism_has_a_call():
    methods = {name for name, m in vars(Mechanism).items() if isinstance(m, LazyMethod)}
    loaded = {
        name
        for name, m in vars(Mechanism).items()
        if getattr(m, "__module__", "") != "blockmech.mechanism" and callable(m)
    }
    assert methods | loaded <= {*METHODS, *STEPS}


@pytest.mark.parametrize(
    ("number", "call"),
    list(enumerate(call for call in CALLS if not call.startswith(FILMS))),
    ids=lambda x: str(x),
)
def test_every_call_on_one_machine(number, call, subjects):
    file = ("slider_crank.json", "joints/slider_crank.json")[number % 2]
    assert faults(subjects(file), call) == []


@pytest.mark.parametrize(("number", "file"), list(enumerate(FILES)), ids=FILES)
def test_some_calls_on_every_file(number, file):
    subject = Subject.of(GRAPHS / file)
    calls = [CHEAP[(EACH * number + k) % len(CHEAP)] for k in range(EACH)]
    assert [fault for call in calls for fault in faults(subject, call)] == []


@pytest.fixture(scope="module")
def subjects():
    cache = {}
    return lambda file: cache.setdefault(file, Subject.of(GRAPHS / file))
