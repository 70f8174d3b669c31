"""Doubles and halves every module-level number, one at a time, and runs tests: a script.

    python -m tests.campaigns.thresholds FOLDER [--room dynamics] [--only NAME]
        [--change halved] --tests PYTEST-ARGS

The package is copied to FOLDER and changed there; lines tell which tests a change breaks.
Numbers that round, like counts, stay whole. What breaks needs its derivation beside it.
"""

from __future__ import annotations

import argparse
import ast
import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SOURCE = ROOT / "src"
HALF = "(x // 2 or 1) if isinstance(x, int) else x / 2"
CHANGES = {"doubled": "x * 2", "halved": HALF}


def is_number(value: ast.expr | None, names: set[str]) -> bool:
    """Whether an expression is a number, a row of them, or made with ``known`` names."""
    match value:
        case ast.Constant(value=x):
            return type(x) in (int, float)
        case ast.Name(id=name):
            return name in names
        case ast.UnaryOp(operand=x):
            return is_number(x, names)
        case ast.BinOp(left=a, right=b):
            return is_number(a, names) and is_number(b, names)
        case ast.Tuple(elts=parts):
            return bool(parts) and all(is_number(x, names) for x in parts)
    return False


def numbers(path: Path) -> list[tuple[str, int]]:
    """Names of a module's numbers, and the line of each."""
    constants = []
    for statement in ast.parse(path.read_text("utf-8")).body:
        if isinstance(statement, ast.Assign | ast.AnnAssign) and is_number(
            statement.value, {"EPS"}
        ):
            target = statement.targets[0] if isinstance(statement, ast.Assign) else statement.target
            named = [node.id for node in ast.walk(target) if isinstance(node, ast.Name)]
            line = statement.end_lineno or statement.lineno
            constants += [(name, line) for name in named if name != "TURN"]
    return constants


def broken(folder: Path, tests: list[str]) -> list[str]:
    """Tests that fail with the package of a folder."""
    env = os.environ | {"PYTHONPATH": str(folder)}
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *tests]
    try:
        output = subprocess.run(
            command, cwd=ROOT, env=env, capture_output=True, text=True, timeout=600, check=False
        ).stdout
    except subprocess.TimeoutExpired:
        return ["(ten minutes are not enough)"]
    lines = [line for line in output.splitlines() if line.startswith(("FAILED", "ERROR"))]
    return lines or ([] if " passed" in output else output.splitlines()[-3:])


def main() -> None:
    """Read the arguments and go."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--room", default="dynamics")
    parser.add_argument("--only", default="")
    parser.add_argument("--change", choices=CHANGES, nargs="*", default=list(CHANGES))
    parser.add_argument("--tests", nargs=argparse.REMAINDER, required=True)
    options = parser.parse_args()
    shutil.rmtree(options.folder, ignore_errors=True)
    shutil.copytree(SOURCE, options.folder)
    before = broken(options.folder, options.tests)
    print("unchanged:", before or "all pass", flush=True)
    room = options.folder / "blockmech" / options.room
    for path in sorted(room.rglob("*.py")) if room.is_dir() else [room.with_suffix(".py")]:
        text = path.read_text("utf-8")
        for name, line in numbers(path):
            if options.only not in name:
                continue
            for word in options.change:
                lines = text.splitlines()
                change = f"(lambda x: {CHANGES[word]})"
                row = f"tuple(map({change}, {name})) if isinstance({name}, tuple)"
                new = f"{name} = {row} else {change}({name})"
                path.write_text("\n".join([*lines[:line], new, *lines[line:]]) + "\n", "utf-8")
                failed = [t for t in broken(options.folder, options.tests) if t not in before]
                where = path.relative_to(options.folder)
                print(f"{where} {name} {word}: {len(failed)} broken", flush=True)
                for test in failed[:5]:
                    print("   ", test[:150], flush=True)
            path.write_text(text, "utf-8")


if __name__ == "__main__":
    main()
