"""JSON Schema of a result file; it stands beside this file as ``result.schema.json``."""

from __future__ import annotations

import json
from importlib import resources

from blockmech.typing import Data


def result_schema() -> Data:
    """JSON Schema (2020-12) of what `to_dict` gives."""
    text = resources.files("blockmech.result").joinpath("result.schema.json").read_text("utf-8")
    schema: Data = json.loads(text)
    return schema
