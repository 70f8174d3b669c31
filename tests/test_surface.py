"""The surface: what an editor shows of blockmech is what a user may use, described and listed."""

import inspect
import re
import subprocess
import sys
from contextlib import suppress
from functools import reduce
from importlib import import_module
from pathlib import Path

import pytest

import blockmech as bm
from tests.doctests import texts_with_examples

ROOT = Path(__file__).parents[1]
SCREEN = 40  # names that an editor's list shows at once
REFERENCE = (ROOT / "docs" / "reference" / "python.md").read_text(encoding="utf-8")
ENTRY = re.compile(r"^::: (blockmech[\w.]*)\n((?:    .*\n)*)", re.MULTILINE)


def shown(subject):
    """The names of a module or object that an editor shows."""
    return [name for name in dir(subject) if not name.startswith("_")]


def public():
    """Every public name with what it is: those of `blockmech`, and those of its namespaces."""
    for name in bm.__all__:
        subject = getattr(bm, name)
        if hasattr(subject, "__all__"):
            yield from ((f"{name}.{x}", getattr(subject, x)) for x in subject.__all__)
        elif name != "__version__":
            yield name, subject


PUBLIC = {name: x for name, x in public() if inspect.isclass(x) or inspect.isfunction(x)}
NAMESPACES = [x for name in bm.__all__ if hasattr(x := getattr(bm, name), "__all__")]


@pytest.fixture(scope="module")
def mechanism():
    return bm.read(ROOT / "graphs" / "ruiz_fourbar.json").compile()


def test_an_editor_shows_one_screen_of_a_mechanism_and_of_a_result(mechanism):
    assert len(shown(mechanism)) <= SCREEN
    assert len(shown(mechanism.run(at=1.0))) <= 28
    assert len(bm.__all__) <= 60


@pytest.mark.parametrize("name", ["run", "simulate", "study", "stepper", "tolerance", "verify"])
def test_a_call_has_at_most_twelve_keyword_arguments(name):
    parameters = inspect.signature(getattr(bm.Mechanism, name)).parameters.values()
    assert len([p for p in parameters if p.kind is p.KEYWORD_ONLY]) <= 12


def described():
    """What has a docstring to be read: public names, and what the classes of users define."""
    yield from PUBLIC.items()
    for cls in (bm.Mechanism, bm.Result, bm.SimulationResult, bm.Graph, bm.Linkage):
        for name in shown(cls):
            subject = getattr(cls, name)
            definition = getattr(subject, "fget", None) or getattr(subject, "func", subject)
            if callable(definition) and definition.__module__.startswith("blockmech."):
                yield f"{cls.__name__}.{name}", definition


DESCRIBED = dict(described())


@pytest.mark.parametrize("name", DESCRIBED)
def test_a_public_name_is_described_and_has_an_example(name):
    text = inspect.getdoc(DESCRIBED[name])
    assert text
    assert not text.startswith("!!! abstract"), "pydantic's own text shows through"
    assert ">>> " in text
    assert text in texts_with_examples(sys.modules[DESCRIBED[name].__module__])


def resolved(path):
    """What an entry of the reference stands for: in the longest part of it that is a module."""
    parts = path.split(".")
    for n in range(len(parts), 0, -1):
        with suppress(ModuleNotFoundError):
            return reduce(getattr, parts[n:], import_module(".".join(parts[:n])))
    raise AssertionError(path)


def listed():
    """What the reference lists: aliases lead to what they stand for."""
    for path, options in ENTRY.findall(REFERENCE):
        subject = resolved(path)
        yield subject
        members = re.search(r"members: \[(.+?)\]", options)
        yield from (getattr(subject, name) for name in members[1].split(", ")) if members else ()


def test_the_reference_lists_every_public_name():
    entries = {id(inspect.unwrap(x)) for x in listed()}
    methods = {f"Mechanism.{x}": getattr(bm.Mechanism, x) for x in shown(bm.Mechanism)}
    subjects = PUBLIC | {n: x for n, x in methods.items() if inspect.isfunction(x)}
    of_compiled = {"Mechanism.compile", "Mechanism.samples"}  # on every page of the class
    missing = {n for n, x in subjects.items() if id(inspect.unwrap(x)) not in entries}
    assert missing - of_compiled == set()


@pytest.mark.parametrize("namespace", NAMESPACES, ids=lambda x: x.__name__)
def test_a_namespace_says_what_it_holds(namespace):
    assert namespace.__doc__
    assert all(hasattr(namespace, name) for name in namespace.__all__)


def test_an_import_of_a_room_leaves_the_public_names_alone():
    code = (
        "import blockmech as bm, blockmech.editor.server\n"
        "assert bm.studio is blockmech.editor.studio\n"
        "assert all(f'blockmech.{x}' not in sys.modules for x in bm.__all__"
        " if not inspect.ismodule(getattr(bm, x)))"
    )
    process = subprocess.run([sys.executable, "-c", f"import inspect, sys\n{code}"], check=False)
    assert process.returncode == 0
