"""The format ``xlsx``: a workbook of a run, with units and a chart.

Numbers are numbers, a cell without an answer is empty and the status beside it says why; names and
texts are never formulas.
"""

from __future__ import annotations

import math
from typing import IO, Any

from blockmech.exchange.formats import Order, Writer, file_writer
from blockmech.figures.palette import PANELS
from blockmech.ground.errors import needed, printable
from blockmech.result.columns import columns
from blockmech.result.result import Result

LONGEST = 1_048_000  # rows of a sheet


def workbook(result: Result) -> Any:
    """The workbook of a result: the numbers, a chart, and what is to be known of them.

    Raises `MissingEngineError` without openpyxl.
    """
    openpyxl = needed("openpyxl", "xlsx", "office")
    book = openpyxl.Workbook()
    sheet = book.active
    sheet.title = "results"
    table = columns(result)
    bold = openpyxl.styles.Font(bold=True)
    for j, column in enumerate(table, 1):
        _text(sheet.cell(1, j), column.name).font = bold
        _text(sheet.cell(2, j), column.unit or "-")
        for i, x in enumerate(column.values[:LONGEST].tolist(), 3):
            if math.isfinite(x):
                sheet.cell(i, j, x)
        sheet.column_dimensions[openpyxl.utils.get_column_letter(j)].width = max(
            12, min(40, len(column.name) + 2)
        )
    last = len(table) + 1
    _text(sheet.cell(1, last), "status").font = bold
    for i, word in enumerate(result.quality.status[:LONGEST], 3):
        _text(sheet.cell(i, last), word)
    sheet.freeze_panes = "A3"
    charted = [j for j, c in enumerate(table, 1) if c.output in result][:PANELS]
    if result.n > 1 and charted:
        chart = _chart(openpyxl, sheet, result, charted)
        sheet.add_chart(chart, f"{openpyxl.utils.get_column_letter(last + 2)}2")
    about = book.create_sheet("about")
    lines = [("mechanism", result.mechanism.name), ("samples", str(result.n)), ("units", "SI")]
    lines += [("note", text) for text in result.notes()]
    for i, (word, text) in enumerate(lines, 1):
        _text(about.cell(i, 1), word)
        _text(about.cell(i, 2), text)
    return book


def _text(cell: Any, text: str) -> Any:
    """A cell with a text, whatever that begins with."""
    cell.value = printable(text)
    cell.data_type = "s"
    return cell


def _chart(openpyxl: Any, sheet: Any, result: Result, charted: list[int]) -> Any:
    chart = openpyxl.chart.ScatterChart()
    chart.style, chart.height, chart.width = 2, 9.0, 18.0
    chart.x_axis.title = f"{sheet.cell(1, 1).value} [{sheet.cell(2, 1).value}]"
    chart.y_axis.title = f"[{sheet.cell(2, charted[0]).value}]"
    chart.x_axis.delete = chart.y_axis.delete = False
    rows = {"min_row": 3, "max_row": min(result.n, LONGEST) + 2}
    x = openpyxl.chart.Reference(sheet, min_col=1, **rows)
    unit = sheet.cell(2, charted[0]).value
    for j in charted:
        if sheet.cell(2, j).value != unit:  # another unit has no place on this axis
            continue
        y = openpyxl.chart.Reference(sheet, min_col=j, **rows)
        series = openpyxl.chart.Series(y, x, title=str(sheet.cell(1, j).value))
        series.marker.symbol, series.smooth = "none", False
        chart.series.append(series)
    return chart


@file_writer
def write_xlsx(order: Order, stream: IO[bytes]) -> None:
    """A workbook of the wanted outputs."""
    needed("openpyxl.chart", "xlsx", "office")
    workbook(order.result()).save(stream)


WRITER = Writer("workbook of a run, with units and a chart", (".xlsx",), write_xlsx)
