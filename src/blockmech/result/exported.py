"""How a result leaves: JSON, CSV, NumPy and pandas, and a short table for people.

Every format is derived from the result's own declarations (`Output`), so names and units
are the same everywhere. `Exported` are the doors that a result has.
"""

from __future__ import annotations

import json
from importlib import resources

from blockmech.result import data, spreadsheet
from blockmech.result.columns import Labelled
from blockmech.result.tables import html_table, table
from blockmech.typing import Data


class Exported(Labelled):
    """Export methods of a result; each is the function of that name."""

    to_csv = spreadsheet.to_csv
    to_dataframe = data.to_dataframe
    to_dict = data.to_dict
    to_xarray = data.to_xarray
    _repr_html_ = html_table

    def __str__(self) -> str:
        return table(self)


def result_schema() -> Data:
    """JSON Schema (2020-12) of what `to_dict` gives."""
    text = resources.files("blockmech.result").joinpath("result.schema.json").read_text("utf-8")
    schema: Data = json.loads(text)
    return schema
