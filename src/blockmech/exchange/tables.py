"""Formats that a result writes itself: CSV, JSON, NumPy, and Parquet by way of pandas."""

from __future__ import annotations

from pathlib import Path
from typing import IO

from blockmech.exchange.formats import Order, Writer, file_writer
from blockmech.ground.errors import needed
from blockmech.result.data import json_chunks
from blockmech.result.spreadsheet import csv_chunks, write_csv


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
    order.result().to_npz(path)
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
