"""How a result leaves: JSON, CSV, NumPy and pandas, and a short table for people.

Every format is derived from the result's own declarations (`Output`), so names and units
are the same everywhere. `Exported` are the doors that a result has.
"""

from __future__ import annotations

from typing import Any

from blockmech.ground.arguments import declared
from blockmech.result.columns import AnyPath, Column, Labelled, columns
from blockmech.result.data import json_chunks, to_dataframe, to_dict, to_npz, to_xarray
from blockmech.result.schema import result_schema
from blockmech.result.spreadsheet import CsvTable, csv_chunks, to_csv, write_csv
from blockmech.result.tables import (
    aligned,
    counted,
    flag_lines,
    gap_lines,
    html_table,
    leading,
    table,
)

__all__ = [
    "Column",
    "CsvTable",
    "Exported",
    "aligned",
    "columns",
    "counted",
    "csv_chunks",
    "flag_lines",
    "gap_lines",
    "html_table",
    "json_chunks",
    "leading",
    "result_schema",
    "table",
    "to_csv",
    "to_dataframe",
    "to_dict",
    "to_npz",
    "to_xarray",
    "write_csv",
]


class Exported(Labelled):
    """What a result can do to leave."""

    def to_dict(self) -> dict[str, Any]:
        """The whole result as JSON data; see `blockmech.result.exported`."""
        return to_dict(self)

    @declared
    def to_csv(self, path: AnyPath | None = None, separator: str = ",", decimal: str = ".") -> str:
        """CSV text, one column per component, units in the head; written if a path is given.

        ``separator=";", decimal=","`` is what spreadsheets of many countries open.
        """
        return to_csv(self, path, separator, decimal)

    @declared
    def to_npz(self, path: AnyPath) -> None:
        """Write all arrays to one NumPy file."""
        to_npz(self, path)

    def to_dataframe(self) -> Any:
        """A pandas DataFrame; raises `MissingEngineError` without pandas."""
        return to_dataframe(self)

    def to_xarray(self) -> Any:
        """An `xarray.Dataset` with units; raises `MissingEngineError` without xarray."""
        return to_xarray(self)

    def __str__(self) -> str:
        return table(self)

    def _repr_html_(self) -> str:
        return html_table(self)
