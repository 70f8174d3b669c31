"""Words that say what was done with a value instead of what it is, among assigned names.

Their share of the names and arguments of a room may only fall: `.ci/words.toml` holds how many
there are, and of how many names. What has no more of them than before has not got worse, even if
other names went. Function names that begin with such a word are counted apart. See
docs/contributing/words.md.

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


def counts(folder: Path) -> dict[str, list[int]]:
    """Room and kind -> names with listed words, and all names."""
    names, hits = Counter[str](), Counter[str]()
    for file in sorted(folder.rglob("*.py")):
        inside = file.relative_to(folder).parts
        room = f"{folder.name}.{inside[0] if len(inside) > 1 else 'top'}"
        for kind, name in names_in(ast.parse(file.read_text("utf-8"))):
            names[f"{room}.{kind}"] += 1
            hits[f"{room}.{kind}"] += tied(name)
    return {key: [hits[key], n] for key, n in sorted(names.items())}


def main() -> int:
    """Print rooms that have more listed words than they had; the number of them."""
    counted = counts(ROOT / "src" / "blockmech") | counts(ROOT / "tests")
    if "--write" in sys.argv:
        lines = (f'"{key}" = {count}\n' for key, count in counted.items())
        LIMITS.write_text("# Written by .ci/words.py --write.\n" + "".join(lines), "utf-8")
        return 0
    before = tomllib.loads(LIMITS.read_text("utf-8"))
    worse = 0
    for key, (hits, names) in counted.items():
        hits_before, names_before = before.get(key, (0, 1))
        if hits > hits_before and hits * names_before > hits_before * names:
            print(f"{key}: {hits} of {names} names say what was done, {hits_before} before")
            worse += 1
    return worse


if __name__ == "__main__":
    sys.exit(main())
