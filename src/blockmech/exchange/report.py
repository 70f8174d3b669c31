"""The format ``report``: one HTML page to be printed, of what a mechanism is and does.

Drawing, formation, dimensions, curves, a table of the wanted outputs and what `verify` finds.
Pictures are images in the page, in which no script runs; the page loads nothing.
"""

from __future__ import annotations

import html
from collections.abc import Iterable
from importlib.resources import files
from string import Template
from typing import IO, Any

import numpy as np

import blockmech
from blockmech.analysis.verify import verify
from blockmech.draw.mechanism import draw_result
from blockmech.exchange.formats import Order, Writer, file_writer
from blockmech.exchange.page.files import requested_outputs, samples_of
from blockmech.figures.curves import abscissa, chosen_panels
from blockmech.figures.panels import draw_panels
from blockmech.figures.paper import image
from blockmech.model.parameters import parameters_of
from blockmech.result.result import Result
from blockmech.typing import Record

ROWS = 13  # of the table: every 30 degrees of a turn


def table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """Rows of words and numbers below their heads."""

    def line(tag: str, cells: Iterable[str]) -> str:
        return f"<tr>{''.join(f'<{tag}>{html.escape(cell)}</{tag}>' for cell in cells)}</tr>"

    body = "".join(line("td", row) for row in rows)
    return f"<table><thead>{line('th', head)}</thead><tbody>{body}</tbody></table>"


@file_writer
def write_report(order: Order, stream: IO[bytes]) -> None:
    """One page; without wanted outputs it shows the drives."""
    mechanism, result = order.mechanism, order.computed
    if result is None:
        settings = {"friction": None, "static": False} | dict(order.settings)
        samples, outputs = samples_of(order), requested_outputs(order)
        result = mechanism._answer(samples, outputs, settings)
    document = mechanism.document
    sections = {} if document is None else document.sections()
    title = getattr(document, "title", "") or mechanism.name
    numbers = [(p.address, f"{p.value:.6g} {p.unit}") for p in parameters_of(sections).values()]
    curves = image(draw_panels(chosen_panels(result, result), abscissa(result)), "curves")
    parts = {
        "": image(draw_result(result).figure, f"{mechanism.name} in some poses"),
        "Structure": f"<p>{html.escape(mechanism.structure.formula.replace('->', '→'))}</p>",
        "Dimensions and loads": f"<div class=numbers>{table(('number', 'value'), numbers)}</div>",
        "Curves": curves,
        "Values": _values(result),
        "Verification": f"<pre>{html.escape(str(verify(mechanism, result)))}</pre>",
    }
    extras: Record = getattr(document, "extras", {})
    texts = [str(extras[key]) for key in ("source", "notes") if extras.get(key)]
    head = "".join(f"<p>{html.escape(text)}</p>" for text in texts)
    body = "".join(
        f"<section>{f'<h2>{name}</h2>' if name else ''}{part}</section>"
        for name, part in parts.items()
    )
    page = Template((files(__package__) / "report.html").read_text("utf-8")).substitute(
        title=html.escape(title), head=head, body=body, version=blockmech.__version__
    )
    stream.write(page.encode(errors="replace"))


def _values(result: Result) -> str:
    """The wanted outputs at some of the samples."""
    axis = abscissa(result)
    indices = np.unique(np.linspace(0, result.n - 1, ROWS, dtype=int))
    head = [axis.words, *(f"{name} [{result.output(name).unit or '–'}]" for name in result)]
    rows = ([_text(x[k]) for x in (axis.values, *result.values())] for k in indices)
    return table(head, rows)


def _text(value: Any) -> str:
    """A number, or the two of a vector; nothing where there is no answer."""
    parts = (value.real, value.imag) if np.iscomplexobj(value) else (value,)
    return ", ".join(f"{float(x):.6g}" for x in parts if np.isfinite(x))


WRITER = Writer(
    "one HTML page to be printed: drawing, dimensions, curves, table, verification",
    (".html",),
    write_report,
)
