"""How a result leaves: JSON, CSV, NumPy and pandas, and a short table for people.

Every format is derived from the result's own declarations (`Output`), so names and
units are the same everywhere.
"""

from blockmech.export.columns import Column, columns
from blockmech.export.data import json_chunks, to_dataframe, to_dict, to_npz
from blockmech.export.files import cannot_write, folder, writing
from blockmech.export.schema import result_schema
from blockmech.export.spreadsheet import csv_chunks, to_csv, write_csv
from blockmech.export.tables import gap_lines, html_table, table

__all__ = [
    "Column",
    "cannot_write",
    "columns",
    "csv_chunks",
    "folder",
    "gap_lines",
    "html_table",
    "json_chunks",
    "result_schema",
    "table",
    "to_csv",
    "to_dataframe",
    "to_dict",
    "to_npz",
    "write_csv",
    "writing",
]
