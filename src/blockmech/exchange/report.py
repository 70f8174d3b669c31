"""The format ``report``: one HTML page to be printed, of what a mechanism is and does.

The first sheet of paper says all in short: the drawing with its dimensions, one line of
verification, the data of links, joints and loads, and the curves. Then come forces, values at
some poses, and every number and check. Pictures are images in the page, in which no script
runs; the page loads nothing.
"""

from __future__ import annotations

import html
from collections.abc import Iterable, Iterator
from importlib.resources import files
from string import Template
from typing import IO, Any

import numpy as np

import blockmech
from blockmech.analysis.verify import Verification, verify
from blockmech.draw.mechanism import draw_result
from blockmech.exchange.formats import Order, Writer, file_writer
from blockmech.exchange.page.files import requested_outputs, samples_of
from blockmech.figures.curves import abscissa, chosen_panels, reaction_panels, without_friction
from blockmech.figures.panels import draw_panels
from blockmech.figures.paper import image
from blockmech.ground.errors import BlockmechError
from blockmech.ground.units import shown_in
from blockmech.model.parameters import Parameter, number_at, parameters_of
from blockmech.result.columns import output_columns, quiet_columns
from blockmech.result.result import Result
from blockmech.result.tables import ROWS, html_grid
from blockmech.typing import Record


@file_writer
def write_report(order: Order, stream: IO[bytes]) -> None:
    """One page; without wanted outputs it shows the drives."""
    mechanism, result = order.mechanism, order.computed
    if result is None:
        settings = {"friction": None, "static": False} | dict(order.settings)
        result = mechanism._answer(samples_of(order), requested_outputs(order), settings)
    document = mechanism.document
    sections = {} if document is None else document.sections()
    title = getattr(document, "title", "") or mechanism.name
    numbers = list(parameters_of(sections).values())
    checks = verify(mechanism, result)
    picture = draw_result(result.to(*result._display, "mm"), sheet=True)
    lists = ((p.address, f"{p.value:.6g} {p.unit}") for p in numbers)
    parts = {
        "": image(picture.figure, f"{mechanism.name} in some poses, lengths in mm"),
        "Verification": f"<p>{html.escape(verdict(checks))}</p>",
        "Structure": f"<p>{html.escape(mechanism.structure.formula.replace('->', '→'))}</p>",
        "Data": "".join(_data({} if document is None else document.to_data(), numbers, result)),
        "Curves": image(draw_panels(chosen_panels(result, result), abscissa(result)), "curves"),
        **_forces(result),
        "Values": _values(result),
        "All numbers": f"<div class=numbers>{html_grid(('number', 'value'), lists)}</div>",
        "All checks": f"<pre>{html.escape(str(checks))}</pre>",
    }
    extras: Record = getattr(document, "extras", {})
    words = [str(extras[key]) for key in ("source", "notes") if extras.get(key)]
    head = "".join(f"<p>{html.escape(text)}</p>" for text in words)
    body = "".join(
        f"<section>{f'<h2>{name}</h2>' if name else ''}{part}</section>"
        for name, part in parts.items()
    )
    page = Template((files(__package__) / "report.html").read_text("utf-8")).substitute(
        title=html.escape(title), head=head, body=body, version=blockmech.__version__
    )
    stream.write(page.encode(errors="replace"))


def verdict(checks: Verification) -> str:
    """Whether the equations of mechanics hold, in a line."""
    failing = [check.name for check in checks.rows if not check.ok]
    if failing or not checks.samples:
        return f"Not verified: {', '.join(failing) or 'no sample has an answer'}."
    worst = max(checks.rows, key=lambda check: check.value / check.allowed)
    return (
        f"Verified: {len(checks.rows)} equations of mechanics hold at {checks.samples} samples; "
        f"the largest relative error is {worst.value:.1e} ({worst.name}), allowed is "
        f"{worst.allowed:.1e}."
    )


def _data(data: Record, numbers: Iterable[Parameter], result: Result) -> Iterator[str]:
    """A table of each kind of part: its texts and numbers, but approximate poses.

    Units are those of the result, of angles by default degrees; a column of zeros is left out.
    """
    kinds: dict[str, dict[str, dict[str, str]]] = {}
    for number in numbers:
        path = list(number.path)
        if path[-1] in ("x", "y") or isinstance(path[-1], int):  # of a vector or a list
            path.pop()
        first, begin = path[0] == "scene", max(k for k, x in enumerate(path) if isinstance(x, str))
        begin -= (begin - first) % 2  # sections and names of parts alternate
        where, name = path[:begin], path[begin:]
        if name[0] == "pose":
            continue
        entry = number_at(data, tuple(where))
        items = entry.items() if where and isinstance(entry, dict) else ()
        lists = ((k, x if isinstance(x, list) else [x]) for k, x in items)
        texts = {k: ", ".join(x) for k, x in lists if all(isinstance(word, str) for word in x)}
        kind = " ".join([*map(str, where[-2:-1]), *filter(None, [texts.pop("type", "")])])
        part = ".".join(map(str, where[first + 1 :: 2]))
        row = kinds.setdefault(kind, {}).setdefault(part, texts)
        factor, unit = shown_in(number.unit, (*result._display, "deg"))
        tokens = (str(x + 1) if isinstance(x, int) else x for x in name)
        head = f"{' '.join(tokens)} [{unit or '–'}]"
        row[head] = ", ".join(filter(None, (row.get(head), f"{factor * number.value:.5g}")))
    for kind, table_rows in kinds.items():
        heads = dict.fromkeys(head for row in table_rows.values() for head in row)
        nonzero = [
            h for h in heads if any(row.get(h, "").strip("0, ") for row in table_rows.values())
        ]
        if nonzero:
            cells = ([part, *(row.get(h, "") for h in nonzero)] for part, row in table_rows.items())
            yield html_grid([kind, *nonzero], cells)


def _forces(result: Result) -> dict[str, str]:
    """Reactions of the joints over the motion, and their largest; nothing where there are none."""
    names = [name for name in result.mechanism.outputs if name.endswith(".reaction")]
    try:
        forces = result.rerun(*names)
    except BlockmechError:  # of what has no forces
        return {}
    along, panels = abscissa(result), reaction_panels(forces, without_friction(forces))
    if not panels:
        return {}
    sizes = {name: np.abs(forces[name]) for name in names}
    largest = {name: int(np.nanargmax(f)) for name, f in sizes.items() if np.isfinite(f).any()}
    rows = ([name, _text(sizes[name][k]), _text(along.values[k])] for name, k in largest.items())
    head = ("joint", "largest reaction [N]", f"at {along.words}")
    return {"Forces": html_grid(head, rows) + image(draw_panels(panels, along), "reactions")}


def _values(result: Result) -> str:
    """The wanted outputs at some of the samples."""
    along = abscissa(result)
    shown = np.unique(np.linspace(0, result.n - 1, ROWS, dtype=int))
    columns = quiet_columns([c for name in result for c in output_columns(result, name)])
    groups = {name: [c for c in columns if c.output == name] for name in result}
    head = [along.words, *(f"{name} [{c[0].unit or '–'}]" for name, c in groups.items())]
    parts = groups.values()
    rows = (
        [_text(along.values[k]), *(", ".join(_text(c.values[k]) for c in x) for x in parts)]
        for k in shown
    )
    return html_grid(head, rows)


def _text(value: Any) -> str:
    """A number; nothing where there is no answer."""
    return f"{float(value):.6g}" if np.isfinite(value) else ""


WRITER = Writer(
    "one HTML page to be printed: drawing with dimensions, data, curves, forces, verification",
    (".html",),
    write_report,
)
