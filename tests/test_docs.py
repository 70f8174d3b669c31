"""Documentation that a program can hold us to: docstrings, units, sources, examples, README."""

import ast
import importlib
import inspect
import pkgutil
import re
import sys
import tomllib
from pathlib import Path

import pytest

import blockmech as bm
from blockmech.blocks.block import REGISTRY
from blockmech.blocks.contract import Block
from blockmech.cli import COMMANDS
from blockmech.compiled import Compiled
from blockmech.ground.values import StrictModel
from docs.snippets import BrokenPage, run, workplace
from tests.doctests import run_examples
from tests.source import MODULES, trees

ROOT = Path(__file__).resolve().parents[1]
LONGEST_FIRST_LINE = 90  # with its indentation it must fit a line of 100
UNIT = re.compile(r"\[[^\]]+\]")


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


def test_every_module_and_every_public_name_has_a_docstring():
    silent = [name for name, tree in trees().items() if not ast.get_docstring(tree)]
    for module, tree in trees().items():
        silent += [f"{module}.{name}" for name, node in public(tree) if not ast.get_docstring(node)]
    assert silent == []


def test_first_lines_are_short_and_to_the_point():
    wrong = []
    for module, tree in trees().items():
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
        for node in trees()[module].body:
            if isinstance(node, ast.ClassDef) and "NamedTuple" in map(ast.unparse, node.bases):
                fields = [n for n in node.body if isinstance(n, ast.AnnAssign)]
                said = [(ast.unparse(f.annotation), lines[f.lineno - 1]) for f in fields]
                yield f"{module}.{node.name}", ast.get_docstring(node), said


def test_every_quantity_in_a_record_has_its_unit():
    result = list(records())
    assert len(result) > 20
    bare = [
        name
        for name, text, fields in result
        for annotation, line in fields
        if annotation in ("Complex", "Real")
        and not UNIT.search(text)
        and not UNIT.search(line.partition("#")[2])
    ]
    assert bare == []


MODELS = [
    cls
    for name in bm.__all__
    if inspect.isclass(cls := getattr(bm, name)) and issubclass(cls, StrictModel)
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
    ratios = {"margin", "existence", "friction_efficiency", "efficiency", "mechanical_advantage"}
    assert bare <= ratios


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
    for module, tree in trees().items():
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

EXAMPLE = re.compile(r"^ *>>> ", re.MULTILINE)
WITH_EXAMPLES = [m for m, path in MODULES.items() if EXAMPLE.search(path.read_text("utf-8"))]


@pytest.mark.parametrize("module", WITH_EXAMPLES)
def test_examples_in_docstrings_run(module, tmp_path):
    with workplace(tmp_path):
        failed, attempted = run_examples(importlib.import_module(module))
    assert failed == 0
    assert attempted > 0


def test_no_example_is_skipped():
    assert [m for m, path in MODULES.items() if "+SKIP" in path.read_text(encoding="utf-8")] == []


# ---- pages of docs, README --------------------------------------------------------------

PAGES = sorted((ROOT / "docs").rglob("*.md"))
README = (ROOT / "README.md").read_text(encoding="utf-8")


@pytest.mark.slow
@pytest.mark.usefixtures("one_repeat")
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_page_runs_prints_the_numbers_it_says_and_draws_its_pictures(page, tmp_path):
    text = page.read_text(encoding="utf-8")
    for package in re.findall(r"^import (jax|optax|diffrax)$", text, re.MULTILINE):
        pytest.importorskip(package, reason="the page of JAX needs the extra judges")
    with workplace(tmp_path):
        run(text, page.name)
    pictures = {*re.findall(r"!\[[^\]]*\]\(([^)]+)\)", text)}
    stored = {x for x in pictures if (page.parent / x).exists()}  # of the studio: test_views
    assert [name for name in pictures - stored if not (tmp_path / name).stat().st_size] == []


@pytest.mark.parametrize(
    ("snippet", "wrong"),
    [
        ("print(2.5)  # 2.4 m", "prints 2.5 where it says 2.4"),
        ("print(1e-3)  # 1.2e-3 m", "prints 0.001 where it says 1.2e-3"),
        ("x = 1\nraise KeyError(x)", "page:2: KeyError: 1"),
    ],
)
def test_a_page_that_says_another_number_or_fails_is_told(snippet, wrong):
    with pytest.raises(BrokenPage, match=wrong):
        run(f"```python\n{snippet}\n```\n")


def test_numbers_are_held_to_the_digits_that_a_page_says():
    assert run("```python\nprint(0.123456)  # 0.1235 m\nprint(3)\n```\n") == ["3\n"]


def test_the_reference_has_every_public_name_and_every_command():
    names = (ROOT / "docs" / "reference" / "python.md").read_text(encoding="utf-8")
    listed = set(re.findall(r"^::: blockmech\.(\w+)", names, re.MULTILINE))
    assert set(bm.__all__) - {"__version__"} <= listed
    commands = (ROOT / "docs" / "reference" / "commands.md").read_text(encoding="utf-8")
    matches = re.findall(r"^blockmech (\w+) --help$", commands, re.MULTILINE)
    assert matches == [function.__name__ for function in COMMANDS]


@pytest.mark.slow
@pytest.mark.usefixtures("one_repeat")
def test_python_of_the_readme_runs_from_top_to_bottom_and_prints_the_numbers_it_says(tmp_path):
    snippets = re.findall(r"```python\n.*?```", README, re.DOTALL)
    with workplace(tmp_path):
        assert len(run("\n".join(snippets), "README.md")) == len(snippets)
    for picture in ("slider_crank.gif", "turn.png", "blocks.svg"):
        assert (tmp_path / picture).stat().st_size > 10_000
    first = snippets[0].strip("`\n").splitlines()[1:]
    assert len([line for line in first if line]) <= 14  # from pins to stroke, forces and a film


def test_the_readme_has_at_most_900_words_beside_its_code():
    prose = re.sub(r"```.*?```", "", README, flags=re.DOTALL)
    assert len(re.sub(r"\]\([^)]*\)", "]", prose).split()) <= 900


def test_a_citation_names_the_version_of_the_package():
    cited = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert re.findall(r"^version: (.+)$", cited, re.MULTILINE) == [bm.__version__]


@pytest.mark.parametrize("page", [ROOT / "README.md", *PAGES], ids=lambda page: page.stem)
def test_files_that_a_page_names_exist(page):
    text = page.read_text(encoding="utf-8")
    for path in re.findall(r"\]\(([\w./-]+)\)", text):
        is_picture = page.parent != ROOT and path.endswith((".svg", ".png", ".gif", ".html"))
        is_machine = path.startswith("machines/")  # written when the site is built
        assert is_picture or is_machine or (page.parent / path).exists(), path
    for path in re.findall(r"\bgraphs/[\w/]+\.json", text):
        assert (ROOT / path).exists(), path


@pytest.mark.parametrize("page", [ROOT / "README.md", *PAGES], ids=lambda page: page.stem)
def test_commands_that_a_page_names_exist(page):
    text = page.read_text(encoding="utf-8")
    commands = {function.__name__ for function in COMMANDS}
    assert set(re.findall(r"[`/]blockmech (\w+)", text)) <= commands


def test_on_a_package_index_the_readme_links_to_nothing_that_is_not_there():
    build = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["hatch"]
    page = README
    for change in build["metadata"]["hooks"]["fancy-pypi-readme"]["substitutions"]:
        page = re.sub(change["pattern"], change["replacement"], page)
    matches = re.findall(r"\]\(([^)]*)\)", page)
    assert [target for target in matches if not target.startswith("https://")] == []
    assert "walking leg" not in page  # a picture's text without the picture
    assert "`CITATION.cff`" in page


def test_readme_has_its_two_one_line_commands_for_both_systems():
    for start in (
        r"^python3 -m venv .*blockmech run graphs/ruiz_fourbar\.json --out ruiz$",
        r"^py -m venv .*blockmech run graphs\\ruiz_fourbar\.json --out ruiz$",
        r"^python3 -m venv .*pytest",
        r"^py -m venv .*pytest",
    ):
        assert re.search(start, README, re.MULTILINE), start


def test_the_names_of_the_architecture_page_exist():
    text = (ROOT / "docs" / "how" / "architecture.md").read_text("utf-8")
    table = text[text.index("## The walk") : text.index("Try it:")]
    for name in re.findall(r"`((?:[a-z_]+\.)+[A-Za-z_]+)`", table):
        assert pkgutil.resolve_name(f"blockmech.{name}"), name
    for name in re.findall(r"`(Graph|Compiled)\.(\w+)`", table):
        owner = {"Graph": bm.Graph, "Compiled": Compiled}[name[0]]
        assert hasattr(owner, name[1]), name


def test_the_floors_of_the_architecture_page_are_the_rooms_from_door_to_ground():
    text = (ROOT / "docs" / "how" / "architecture.md").read_text("utf-8")
    table = text[text.index("## Floors") : text.index("Three consequences:")]
    rows = [row.split("|")[2] for row in table.splitlines() if row.count("|") > 3]
    rooms = [room for row in rows for room in re.findall(r"`(\w+)`", row)]
    tool = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]
    layers = tool["importlinter"]["contracts"][0]["layers"]
    assert sorted(rooms) == sorted(layers)


def test_files_that_contributing_names_exist():
    text = (ROOT / "CONTRIBUTING.md").read_text("utf-8")
    paths = re.findall(r"`((?:tests|docs|graphs|\.ci|changelog\.d)(?:/[a-z_.]+)*)`", text)
    assert len(paths) > 10
    assert [path for path in paths if not (ROOT / path).exists()] == []


@pytest.mark.parametrize("link", [r"\(tile_(\w+)\.svg\)", r"\(machines/(\w+)\.md\)"])
def test_the_gallery_page_has_every_mechanism(link):
    names = set(re.findall(link, (ROOT / "docs" / "gallery.md").read_text("utf-8")))
    assert names == {path.stem for path in (ROOT / "graphs").glob("*.json")}
