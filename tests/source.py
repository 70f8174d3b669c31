"""The package as text: its modules by name, and what stands in each."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

import blockmech

SOURCE = Path(blockmech.__file__).parent


def _name(path: Path) -> str:
    parts = path.relative_to(SOURCE.parent).with_suffix("").parts
    return ".".join(p for p in parts if p != "__init__")


MODULES = {_name(path): path for path in sorted(SOURCE.rglob("*.py"))}


@cache
def trees() -> dict[str, ast.Module]:
    """The syntax tree of each module, for the tests that ask: not all that collect need them."""
    return {name: ast.parse(path.read_text(encoding="utf-8")) for name, path in MODULES.items()}
