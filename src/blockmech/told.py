"""Answers that are told as text: alike at a prompt, in a notebook and on the command line."""

from __future__ import annotations

import html
import json
import math
from abc import ABC, abstractmethod
from typing import Any

from pydantic_core import to_json

DEGREES = False  # angles that are shown, in text, tables and pictures alike: else radians


def with_unit(x: float, unit: str, degrees: bool = DEGREES) -> str:
    """A number to nine digits with its unit, an angle in degrees if asked for."""
    if degrees and unit == "rad":
        x, unit = math.degrees(x), "deg"
    return f"{x:.9g} {unit}".rstrip()


def as_data(found: Any) -> dict[str, Any]:
    """A record as a JSON object, whatever stands in it; null stands for what is not finite."""
    plain: dict[str, Any] = json.loads(to_json(found, inf_nan_mode="null"))
    return plain


class TextReport(ABC):
    """What is told as lines of text wherever it is shown."""

    @abstractmethod
    def text(self, degrees: bool = DEGREES) -> str:
        """The lines; angles in degrees if asked for."""

    def __str__(self) -> str:
        return self.text()

    def __repr__(self) -> str:
        return self.text()

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(self.text())}</pre>"
