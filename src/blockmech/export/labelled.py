"""What can be exported: labelled arrays of a run, such as a `Result`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Protocol

from blockmech.evaluator import Evaluator
from blockmech.outputs import Output
from blockmech.quality import Quality


class Labelled(Protocol):
    """Arrays by name with units, status and quality; see `Result`, which is one."""

    mechanism: Evaluator
    settings: dict[str, Any]
    motion: Any
    accuracy: Any

    def __getitem__(self, name: str) -> Any: ...
    def __iter__(self) -> Iterator[str]: ...
    def __len__(self) -> int: ...
    def output(self, name: str) -> Output: ...
    def unit(self, name: str) -> str: ...
    def unit_of_driver(self, name: str) -> str: ...
    @property
    def n(self) -> int: ...
    @property
    def time(self) -> Any: ...
    @property
    def drivers(self) -> dict[str, Any]: ...
    @property
    def quality(self) -> Quality: ...
