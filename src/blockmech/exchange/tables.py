"""Tables of a run: CSV, JSON, NumPy, Parquet, MATLAB and Octave, and workbooks.

In MATLAB's format, version 5, ``x.values.crank_drive`` is a column (n, 1), complex for vectors;
``x.names`` and ``x.units`` say what each is, ``x.status`` which samples have an answer. In a
workbook numbers are numbers, a cell without an answer is empty and the status beside it says why;
names and texts are never formulas.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import IO, Any

import numpy as np

from blockmech.exchange.c.program import Names
from blockmech.exchange.formats import Order, Writer, file_writer
from blockmech.figures.palette import PANELS
from blockmech.ground.errors import needed, printable
from blockmech.result.columns import columns
from blockmech.result.data import json_chunks, to_npz
from blockmech.result.result import Result
from blockmech.result.spreadsheet import csv_chunks, write_csv

FIELD = 31  # signs of a field's name in version 5 of MATLAB's format
ROWS = 1_048_000  # rows of a sheet


def write_table(order: Order, path: Path) -> list[Path]:
    """CSV."""
    write_csv(csv_chunks(order.result()), path)
    return [path]


@file_writer
def write_json(order: Order, stream: IO[bytes]) -> None:
    """The result as JSON."""
    stream.writelines(chunk.encode() for chunk in json_chunks(order.result()))


def write_npz(order: Order, path: Path) -> list[Path]:
    """All arrays in one NumPy file."""
    to_npz(order.result(), path)
    return [path]


@file_writer
def write_parquet(order: Order, stream: IO[bytes]) -> None:
    """A column for each component. Raises `MissingEngineError` without pandas or pyarrow."""
    needed("pyarrow", "parquet", "study")
    order.result().to_dataframe().to_parquet(stream)


CSV = Writer("table of a run as text", (".csv",), write_table)
JSON = Writer("a run as JSON", (".json",), write_json)
NPZ = Writer("the arrays of a run for NumPy", (".npz",), write_npz)
PARQUET = Writer("table of a run for pandas, Arrow, DuckDB", (".parquet",), write_parquet)


@file_writer
def write_mat(order: Order, stream: IO[bytes]) -> None:
    """One variable ``run``, a structure."""
    from scipy.io import savemat

    result = order.result()
    names = Names()
    arrays = dict(result.drivers)
    if (time := result._known_time()) is not None:
        arrays["time"] = time
    arrays |= {name: result[name] for name in result}
    fields = {name: names.fresh(name[-FIELD + 4 :].lstrip("._0123456789")) for name in arrays}
    run = {
        "name": result.mechanism.name,
        "values": {fields[name]: np.asarray(x) for name, x in arrays.items()},
        "names": {fields[name]: name for name in arrays},
        "units": {fields[n]: "s" if n == "time" else result._output(n).unit for n in arrays},
        "status": np.array(result.quality.status, object),
    }
    savemat(stream, {"run": run}, oned_as="column", long_field_names=True)


MAT = Writer("MATLAB and Octave: the arrays of a run", (".mat",), write_mat)


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
        for i, x in enumerate(column.values[:ROWS].tolist(), 3):
            if math.isfinite(x):
                sheet.cell(i, j, x)
        sheet.column_dimensions[openpyxl.utils.get_column_letter(j)].width = max(
            12, min(40, len(column.name) + 2)
        )
    last = len(table) + 1
    _text(sheet.cell(1, last), "status").font = bold
    for i, word in enumerate(result.quality.status[:ROWS], 3):
        _text(sheet.cell(i, last), word)
    sheet.freeze_panes = "A3"
    charted = [j for j, c in enumerate(table, 1) if c.output in result][:PANELS]
    if result.n > 1 and charted:
        chart = _chart(openpyxl, sheet, result, charted)
        sheet.add_chart(chart, f"{openpyxl.utils.get_column_letter(last + 2)}2")
    about = book.create_sheet("about")
    lines = [("mechanism", result.mechanism.name), ("samples", str(result.n))]
    lines += [("units", ", ".join(("SI", *result._display)))]
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
    rows = {"min_row": 3, "max_row": min(result.n, ROWS) + 2}
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


XLSX = Writer("workbook of a run, with units and a chart", (".xlsx",), write_xlsx)
