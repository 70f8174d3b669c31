"""Documentation that a program can hold us to: docstrings, units, sources, examples, README."""

import ast
import contextlib
import doctest
import importlib
import inspect
import io
import re
import sys
from pathlib import Path

import pytest

import blockmech as bm
from blockmech.blocks.contract import Block
from blockmech.blocks.registry import REGISTRY
from blockmech.values import Strictly

ROOT = Path(__file__).resolve().parents[1]
SOURCE = Path(bm.__file__).parent
LONGEST_FIRST_LINE = 90  # with its indentation it must fit a line of 100
UNIT = re.compile(r"\[[^\]]+\]")


def modules():
    for path in sorted(SOURCE.rglob("*.py")):
        parts = path.relative_to(SOURCE.parent).with_suffix("").parts
        yield ".".join(p for p in parts if p != "__init__"), path


MODULES = dict(modules())
TREES = {name: ast.parse(path.read_text(encoding="utf-8")) for name, path in MODULES.items()}


def public(tree, prefix=""):
    """Public classes, functions and methods of a module: name and node."""
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
            if "overload" in map(ast.unparse, node.decorator_list):
                continue  # the function itself follows
            yield f"{prefix}{node.name}", node
            if isinstance(node, ast.ClassDef):
                yield from public(node, f"{prefix}{node.name}.")


# ---- docstrings --------------------------------------------------------------------------


def test_every_module_says_what_it_is():
    silent = [name for name, tree in TREES.items() if not ast.get_docstring(tree)]
    assert silent == []


def test_every_public_name_has_a_docstring():
    silent = [
        f"{module}.{name}"
        for module, tree in TREES.items()
        for name, node in public(tree)
        if not ast.get_docstring(node)
    ]
    assert silent == []


def test_first_lines_are_short_and_to_the_point():
    wrong = []
    for module, tree in TREES.items():
        for name, node in public(tree):
            first = (ast.get_docstring(node) or "").partition("\n")[0]
            if len(first) > LONGEST_FIRST_LINE or first.startswith(("This ", "Returns ")):
                wrong.append(f"{module}.{name}: {first}")
    assert wrong == []


# ---- units and sources -------------------------------------------------------------------


def records():
    """Named tuples that carry quantities: class, its docstring, its fields with their comments."""
    for module in MODULES:
        if module.split(".")[1:2] not in (["blocks"], ["typing"]):
            continue
        lines = MODULES[module].read_text(encoding="utf-8").splitlines()
        for node in TREES[module].body:
            if isinstance(node, ast.ClassDef) and "NamedTuple" in map(ast.unparse, node.bases):
                fields = [n for n in node.body if isinstance(n, ast.AnnAssign)]
                said = [(ast.unparse(f.annotation), lines[f.lineno - 1]) for f in fields]
                yield f"{module}.{node.name}", ast.get_docstring(node), said


def test_every_quantity_in_a_record_has_its_unit():
    found = list(records())
    assert len(found) > 20
    bare = [
        name
        for name, text, fields in found
        for annotation, line in fields
        if annotation in ("Complex", "Real")
        and not UNIT.search(text)
        and not UNIT.search(line.partition("#")[2])
    ]
    assert bare == []


MODELS = [
    cls
    for name in bm.__all__
    if inspect.isclass(cls := getattr(bm, name)) and issubclass(cls, Strictly)
]
NUMBERS = re.compile(r"float|Place|Vector|list")
NO_QUANTITY = {"coefficient", "law", "branch", "angle", "dir", "markers", "at"}


@pytest.mark.parametrize("cls", MODELS, ids=lambda cls: cls.__name__)
def test_every_number_of_a_public_model_has_its_unit(cls):
    text = f"{inspect.getdoc(cls)}\n{inspect.getdoc(sys.modules[cls.__module__])}"
    schema = cls.model_json_schema()["properties"]
    for name, field in cls.model_fields.items():
        if name in NO_QUANTITY or not NUMBERS.search(str(field.annotation)):
            continue
        written = field.alias or name
        in_schema = "unit" in str(schema.get(written, ""))
        assert in_schema or UNIT.search(text), f"{cls.__name__}.{name} has no unit"


def test_requests_say_their_units():
    text = inspect.getdoc(type(ruiz_mechanism()).run)
    for name, unit in (("at", "[rad or m]"), ("times", "[s]")):
        (line,) = [x for x in text.splitlines() if x.startswith(f"{name} :")]
        assert unit in line


def ruiz_mechanism():
    return bm.Graph.load(ROOT / "graphs" / "ruiz_fourbar.json").compile()


def test_every_output_has_a_unit_or_is_a_ratio():
    bare = {name.rsplit(".", 1)[-1] for name, o in ruiz_mechanism().outputs.items() if not o.unit}
    assert bare <= {"margin", "friction_efficiency", "efficiency", "mechanical_advantage"}


def test_every_block_and_load_names_its_source():
    silent = []
    for name in REGISTRY:
        cls = REGISTRY[name]
        text = sys.modules[cls.__module__].__doc__ or ""
        if cls.__module__.startswith("blockmech.") and "Source" not in text:
            silent.append(name)
    assert silent == []


@pytest.mark.parametrize("room", ["passes", "friction"])
def test_mechanics_name_their_sources(room):
    for module, tree in TREES.items():
        parts = module.split(".")
        if parts[1:2] == [room] and len(parts) > 2:
            text = ast.get_docstring(tree)
            assert re.search(r"\[R10\]|\[D14\]|Sources?:|by analogy|rules? \d", text), module


def test_block_types_are_described_by_their_own_docstring():
    for name in REGISTRY:
        cls = REGISTRY[name]
        assert issubclass(cls, Block)
        assert cls.__doc__, name
        assert cls.__doc__ != Block.__doc__, name


# ---- public names ------------------------------------------------------------------------


def test_public_names_exist_and_star_import_works():
    space: dict = {}
    exec("from blockmech import *", space)
    assert set(bm.__all__) <= set(space)
    assert len(bm.__all__) == len(set(bm.__all__))
    assert re.fullmatch(r"\d+\.\d+\.\d+.*", bm.__version__)


@pytest.mark.parametrize("name", [n for n in bm.__all__ if inspect.isclass(getattr(bm, n))])
def test_every_public_class_is_documented_as_its_own(name):
    cls = getattr(bm, name)
    assert cls.__doc__
    assert not cls.__doc__.startswith("!!! abstract"), "pydantic's own text shows through"


# ---- examples that run -------------------------------------------------------------------

WITH_EXAMPLES = [m for m, path in MODULES.items() if ">>>" in path.read_text(encoding="utf-8")]


@pytest.mark.parametrize("module", WITH_EXAMPLES)
def test_examples_in_docstrings_run(module):
    result = doctest.testmod(importlib.import_module(module), optionflags=doctest.ELLIPSIS)
    assert result.failed == 0
    assert result.attempted > 0


def test_public_blocks_and_loads_have_an_example():
    without = [
        name
        for name in bm.__all__
        if inspect.isclass(cls := getattr(bm, name))
        and issubclass(cls, Block)
        and ">>>" not in (cls.__doc__ or "")
    ]
    assert without == []


# ---- pages of docs -----------------------------------------------------------------------


def test_the_page_on_extending_runs_from_top_to_bottom(monkeypatch, tmp_path, capsys):
    """What stands under a file's name is that file; the rest is typed at the prompt."""
    page = (ROOT / "docs" / "extending.md").read_text(encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    space: dict = {}
    for file, snippet in re.findall(r"(?:`(\w+\.py)`:\n\n)?```python\n(.*?)```", page, re.DOTALL):
        if file:
            (tmp_path / file).write_text(snippet, encoding="utf-8")
        else:
            exec(compile(snippet, "<docs/extending.md>", "exec"), space)
    promised = re.findall(r"^print\(.*\)  # (-?[\d.]+|slow)", page, re.MULTILINE)
    printed = capsys.readouterr().out.split()
    assert len(promised) == 4
    for said in promised:
        digits = len(said.partition(".")[2])
        assert any(said == (w if said == "slow" else rounded(w, digits)) for w in printed), said


def rounded(word, digits):
    with contextlib.suppress(ValueError):
        return f"{float(word):.{digits}f}"


# ---- README ------------------------------------------------------------------------------

README = (ROOT / "README.md").read_text(encoding="utf-8")
SNIPPETS = re.findall(r"```python\n(.*?)```", README, re.DOTALL)


def test_python_of_the_readme_runs_from_top_to_bottom_and_prints_the_numbers_it_says(monkeypatch):
    monkeypatch.chdir(ROOT)  # the reader stands in a checkout
    before = {p for p in ROOT.iterdir() if p.name != "__pycache__"}
    space: dict = {}
    promised = 0
    for snippet in SNIPPETS:
        for node in ast.parse(snippet).body:
            line = snippet.splitlines()[node.end_lineno - 1]
            said = re.search(r"#\s+(-?\d[\d.]*)", line)
            with contextlib.redirect_stdout(io.StringIO()) as out:
                exec(compile(ast.Module([node], []), "<README.md>", "exec"), space)
            if said and line.startswith("print("):
                promised += 1
                digits = len(said[1].split(".")[-1]) if "." in said[1] else 0
                found = float(out.getvalue().split()[0])
                assert found == pytest.approx(float(said[1]), abs=0.51 * 10.0**-digits), line
    assert len(SNIPPETS) >= 3
    assert promised >= 1
    assert {p for p in ROOT.iterdir() if p.name != "__pycache__"} == before


def test_files_that_the_readme_names_exist():
    for path in re.findall(r"\]\(([\w./-]+)\)", README):
        assert (ROOT / path).exists(), path
    for path in re.findall(r"\bgraphs/\w+\.json", README):
        assert (ROOT / path).exists(), path


def test_commands_that_the_readme_names_exist():
    from blockmech.cli import COMMANDS

    known = {function.__name__ for function in COMMANDS}
    named = set(re.findall(r"`blockmech (\w+)", README)) | set(
        re.findall(r"/blockmech (\w+)", README)
    )
    assert named <= known


def test_readme_has_its_two_one_line_commands_for_both_systems():
    for start in (
        r"^python3 -m venv .*blockmech run graphs/ruiz_fourbar\.json --out ruiz$",
        r"^py -m venv .*blockmech run graphs\\ruiz_fourbar\.json --out ruiz$",
        r"^python3 -m venv .*pytest",
        r"^py -m venv .*pytest",
    ):
        assert re.search(start, README, re.MULTILINE), start
