"""Data walks through the rooms in one direction, and so do the imports.

The order of rooms is a table in pyproject.toml, which import-linter holds.
"""

import ast
import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import networkx as nx
import pytest

from blockmech.blocks.block import REGISTRY
from blockmech.blocks.contract import Moving
from blockmech.ground.plane import SCALAR_PRIMITIVES
from tests.slow import SLOW
from tests.source import MODULES, trees

ROOT = Path(__file__).parents[1]
FLOORS = 24  # of files that import one another, top to bottom
LONGEST = 80  # lines of a function that is one thought
LATE = {
    "scipy",
    "matplotlib",
    "typer",
    "rich",
    "pandas",
    "openpyxl",
    "pylinkage",
    "xarray",
    "pyarrow",
    "distributed",
    "hypothesis",
    "pytest",
    "mpmath",
    "llvmlite",
    "jax",
    "starlette",
    "uvicorn",
}
NEEDED_IN = {
    "typer": "cli",
    "rich": "cli",
    "pytest": "blockmech.testing.pytest_plugin",
    "jax": "blockmech.engines.jax",
    "starlette": "editor",
    "uvicorn": "editor",
    "scipy": "dynamics",  # a room that nothing loads before a motion is asked for
}


def imports(name, late):
    """Names of the modules that a module imports when it is loaded, or, ``late``, ever."""
    loaded = statements(trees()[name].body)  # for types it may look anywhere
    for node in (x for tree in loaded for x in ast.walk(tree)) if late else loaded:
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{name}: imports are absolute"
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                yield inner if inner in MODULES else str(node.module)


def statements(body):
    """What runs when a module is loaded: no functions, nothing for type checkers only."""
    for node in body:
        if isinstance(node, ast.If):
            if "TYPE_CHECKING" not in ast.unparse(node.test):
                yield from statements(node.body)
            yield from statements(node.orelse)
        elif isinstance(node, ast.Try):
            yield from statements([*node.body, *node.orelse, *node.finalbody])
        elif isinstance(node, ast.ClassDef):
            yield from statements(node.body)
        else:
            yield node


def room(module):
    parts = module.split(".")
    return parts[1] if len(parts) > 1 else "__init__"


@cache
def files():
    """What imports what; read when a test asks for it, not by all who collect tests."""
    modules = set(MODULES)
    result = nx.DiGraph((a, b) for a in modules for b in set(imports(a, late=True)) & modules - {a})
    result.remove_nodes_from(["blockmech"])  # the public names, which nothing inside needs
    return result


def test_every_room_imports_from_those_below_it():
    """The order of rooms stands in pyproject.toml, and none is left out there."""
    linter = Path(sys.executable).with_name("lint-imports")
    result = subprocess.run([linter, "--no-cache"], cwd=ROOT, capture_output=True, text=True)
    assert result.returncode == 0, result.stdout


def test_the_top_is_a_short_list():
    top = {path.name for path in (ROOT / "src" / "blockmech").glob("*.py")}
    assert top == {
        "__init__.py",
        "__main__.py",
        *("builders.py", "compiled.py", "mechanism.py", "typing.py"),
    }


def test_no_circle_of_files():
    circles = [c for c in nx.strongly_connected_components(files()) if len(c) > 1]
    assert circles == []


def test_floors_of_files():
    assert len(list(nx.topological_generations(nx.condensation(files())))) <= FLOORS


def test_functions_fit_a_screen():
    long = {
        f"{name}.{node.name}"
        for name, tree in trees().items()
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef) and length(node) > LONGEST
    }
    assert long == set()


def length(function):
    """Lines of a function without its head and its docstring."""
    body = function.body[1:] if ast.get_docstring(function) is not None else function.body
    return function.end_lineno - body[0].lineno + 1 if body else 0


def test_heavy_packages_are_loaded_late():
    early = {
        (name, package)
        for name in MODULES
        for package in {imported.split(".")[0] for imported in imports(name, late=False)} & LATE
        if NEEDED_IN.get(package) not in (room(name), name)
    }
    assert early == set()


@pytest.mark.parametrize(("module", "needed"), [("blockmech", set()), ("blockmech.cli", {"typer"})])
def test_importing_blockmech_loads_no_heavy_package(module, needed):
    code = f"import sys, {module}; print(*sorted(m for m in sys.modules if '.' not in m))"
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert (LATE | {"networkx"}) & set(result.stdout.split()) == needed


def test_a_run_loads_no_polynomials():
    code = (
        "import sys, blockmech as bm; bm.Graph.load('graphs/ruiz_fourbar.json').compile()"
        ".run(at=0.3); print('numpy.polynomial' in sys.modules)"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert result.stdout.split() == ["False"]


@pytest.mark.parametrize("options", ["", ", method='dop853', engine='llvm'"])
def test_a_motion_along_the_path_or_by_machine_code_loads_no_scipy(options):
    if options:
        pytest.importorskip("llvmlite", reason="machine code needs the extra fast")
    code = (
        "import sys, blockmech as bm; bm.Graph.load('graphs/watt_sixbar.json').compile()"
        f".simulate('standstill'{options}); print('scipy' in sys.modules)"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert result.stdout.split() == ["False"]


def test_private_names_stay_in_their_room():
    borrowed = [
        f"{name} takes {alias.name} from {node.module}"
        for name, tree in trees().items()
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and str(node.module).startswith("blockmech")
        for alias in node.names
        if re.match("_[^_]", alias.name) and room(str(node.module)) != room(name)
    ]
    assert borrowed == []


# ---- kernels -----------------------------------------------------------------------------

FORBIDDEN = (ast.Raise, ast.Try, ast.While, ast.If, ast.Global, ast.Await, ast.Yield, ast.Assert)


def kernels(own_form):
    for name in REGISTRY:
        cls = REGISTRY[name]
        at_hand = issubclass(cls, Moving) and cls.__module__.startswith("blockmech.")
        if at_hand and cls.own_form == own_form:
            yield pytest.param(cls, id=name)


def written_in(module, visited=()):
    """Functions and records of a module of kernels, and of those that it takes them from."""
    tree = ast.parse(Path(sys.modules[module].__file__).read_text(encoding="utf-8"))
    functions = {n.name: n for n in tree.body if isinstance(n, ast.FunctionDef)}
    records = {n.name for n in tree.body if isinstance(n, ast.ClassDef)}
    for n in (n for n in tree.body if isinstance(n, ast.ImportFrom)):
        if n.module == "blockmech.typing":
            records |= {alias.asname or alias.name for alias in n.names}
        elif n.module.startswith("blockmech.blocks.") and n.module not in visited:
            inherited, inherited_records = written_in(n.module, (*visited, module))
            functions = {**inherited, **functions}
            records |= inherited_records
    return functions, records


@pytest.mark.parametrize("cls", list(kernels(own_form=False)))
def test_kernels_are_straight_formulas_over_the_primitives(cls):
    functions, records = written_in(cls.__module__)
    allowed = {*SCALAR_PRIMITIVES, *records, *functions, "abs"}
    waiting = [k.__name__ for k in vars(cls.kernels).values() if k is not None]
    visited = set()
    while waiting:
        name = waiting.pop()
        if name in visited:
            continue
        visited.add(name)
        for node in (x for statement in functions[name].body for x in ast.walk(statement)):
            assert not isinstance(node, FORBIDDEN), f"{name}: {ast.unparse(node)}"
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                called = node.func.id
                assert called in allowed, f"{name} calls {called}"
                if called in functions:
                    waiting.append(called)


@pytest.mark.parametrize("module", ["equations", "kernels"])
def test_the_general_group_computes_with_the_primitives_alone(module):
    name = f"blockmech.blocks.general.{module}"
    tree = ast.parse(Path(sys.modules[name].__file__).read_text(encoding="utf-8"))
    loaded = {n.module for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)}
    assert loaded <= {
        "__future__",
        "collections.abc",
        "typing",
        "blockmech.blocks.contract",
        "blockmech.blocks.general.equations",
        "blockmech.blocks.motion",
        "blockmech.ground.plane",
        "blockmech.ground.tolerances",  # numbers
        "blockmech.typing",
    }
    assert not [n for n in ast.walk(tree) if isinstance(n, ast.Import)]


def test_modules_that_are_marked_slow_exist():
    stems = {(path.parent.name, path.stem) for path in (ROOT / "tests").rglob("test_*.py")}
    marked = {
        (room or "tests", f"test_{name}") for room, names in SLOW.items() for name in names.split()
    }
    assert marked <= stems
    assert set(SLOW) - {""} <= {room for room, _ in stems}
