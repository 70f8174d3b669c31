"""Execute a notebook without Jupyter, and keep what its cells show: notebooks.py FILE.ipynb.

Cells share one namespace and the current folder. A cell shows what it prints and the value of its
last expression, as HTML or SVG where the value has that form and as text otherwise, as in Jupyter.
"""

import ast
import contextlib
import io
import json
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
FORMS = {"text/html": "_repr_html_", "image/svg+xml": "_repr_svg_", "text/plain": "__repr__"}


def execute(notebook: dict[str, Any]) -> list[list[dict[str, Any]]]:
    """Run the cells of code; the outputs of each, as a notebook keeps them."""
    space: dict[str, Any] = {"__name__": "__main__"}
    return [_outputs("".join(cell["source"]), space) for cell in cells_of_code(notebook)]


def cells_of_code(notebook: dict[str, Any]) -> list[dict[str, Any]]:
    """The cells that are run, in their order."""
    return [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]


def _outputs(source: str, space: dict[str, Any]) -> list[dict[str, Any]]:
    module, value = ast.parse(source), None
    last = module.body.pop() if isinstance(module.body[-1], ast.Expr) else None
    with contextlib.redirect_stdout(io.StringIO()) as out:
        exec(compile(module, "<cell>", "exec"), space)
        if isinstance(last, ast.Expr):
            value = eval(compile(ast.Expression(last.value), "<cell>", "eval"), space)
    outputs: list[dict[str, Any]] = []
    if out.getvalue():
        outputs.append({"output_type": "stream", "name": "stdout", "text": _lines(out.getvalue())})
    if value is not None:
        forms = {form: name for form, name in FORMS.items() if hasattr(value, name)}
        data = {form: _lines(getattr(value, name)()) for form, name in forms.items()}
        outputs.append({"output_type": "display_data", "data": data, "metadata": {}})
    return outputs


def _lines(text: str) -> list[str]:
    return text.splitlines(keepends=True)


def main(path: Path) -> None:
    """Execute a notebook and write it with its outputs."""
    notebook = json.loads(path.read_text("utf-8"))
    with contextlib.chdir(ROOT):
        outputs = execute(notebook)
    for count, (cell, shown) in enumerate(zip(cells_of_code(notebook), outputs, strict=True), 1):
        cell |= {"outputs": shown, "execution_count": count}
    path.write_text(json.dumps(notebook, indent=1, ensure_ascii=False) + "\n", "utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve())
