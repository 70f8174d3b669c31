"""Words that say what was done with a value instead of what it is, among assigned names.

The share, of 1,000 names and arguments, may only fall, room by room: `.ci/words.toml` holds it.
Function names that begin with such a word are counted apart. See docs/contributing/words.md.

usage: python3 .ci/words.py [--write]
"""

import ast
import sys
import tomllib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

LISTED = """
found said told asked given made taken known own wanted meant shown kept left here there near far
one other others each what how way place places words odd fits held drawn ended begun done seen
stands whole more most least beside along ahead
"""
WORDS = frozenset(LISTED.split())
ROOT = Path(__file__).parents[1]
LIMITS = ROOT / ".ci" / "words.toml"


def tied(name: str) -> bool:
    """Whether a listed word is the name or one of the words tied together in it."""
    return not WORDS.isdisjoint(name.strip("_").split("_"))


def names_in(tree: ast.AST) -> Iterator[tuple[str, str]]:
    """Kinds and names of what a file assigns and defines."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield "names", node.id
        elif isinstance(node, ast.arg):
            yield "names", node.arg
        elif isinstance(node, ast.FunctionDef):
            yield "functions", node.name.strip("_").split("_")[0]


def shares(folder: Path) -> dict[str, float]:
    """Room and kind -> listed words of 1,000, rounded up to a tenth."""
    names, hits = Counter[str](), Counter[str]()
    for file in sorted(folder.rglob("*.py")):
        inside = file.relative_to(folder).parts
        room = f"{folder.name}.{inside[0] if len(inside) > 1 else 'top'}"
        for kind, name in names_in(ast.parse(file.read_text("utf-8"))):
            names[f"{room}.{kind}"] += 1
            hits[f"{room}.{kind}"] += tied(name)
    return {key: -(-10_000 * hits[key] // n) / 10 for key, n in sorted(names.items())}


def main() -> int:
    """Print rooms that have more listed words than they had; the number of them."""
    counted = shares(ROOT / "src" / "blockmech") | shares(ROOT / "tests")
    if "--write" in sys.argv:
        lines = (f'"{key}" = {share}\n' for key, share in counted.items())
        LIMITS.write_text("# Written by .ci/words.py --write.\n" + "".join(lines), "utf-8")
        return 0
    limits = tomllib.loads(LIMITS.read_text("utf-8"))
    worse = {key: x for key, x in counted.items() if x > limits.get(key, 0.0)}
    for key, share in worse.items():
        print(f"{key}: {share} of 1,000 names say what was done, {limits.get(key, 0.0)} before")
    return len(worse)


if __name__ == "__main__":
    sys.exit(main())
