"""Running numbered rules: what fails, and what was measured."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

ROUNDING = 1e-11  # [-] of the largest term: some 100 operations, margins down to 1e-4
STEP = 4e-3  # [s] of differences; the motions change over about a second
WEIGHTS = (4 / 5, -1 / 5, 4 / 105, -1 / 280)  # central difference of order 8
DERIVATIVE = 1e-9  # [-] of differences: 8! (STEP / T)^8 for a motion that changes over T = 0.2 s


class ConformanceError(AssertionError):
    """A block breaks its contract; the text names the rules."""


@dataclass(frozen=True)
class Report:
    """What was measured: the largest relative error [-] of each thing compared."""

    name: str
    measured: Mapping[str, float] = field(default_factory=dict)

    def __str__(self) -> str:
        rows = [f"{self.name} keeps its contract"]
        rows += [f"  {what:<60} {error:.1e}" for what, error in self.measured.items()]
        return "\n".join(rows)


class Checks:
    """Runs numbered rules, collects what fails and what was measured."""

    rules: ClassVar[Mapping[str, Callable[..., Iterator[str]]]] = {}

    def __init__(self) -> None:
        self.measured: dict[str, float] = {}

    def report(self, name: str) -> Report:
        """Run every rule. Raises `ConformanceError` with all that fails."""
        failed = []
        for title, rule in self.rules.items():
            try:
                failed += [f"{title}: {what}" for what in rule(self)]
            except Exception as error:  # a broken kernel may fail in any way
                failed.append(f"{title}: raised {type(error).__name__}: {error}")
        if failed:
            raise ConformanceError("\n".join([f"{name} breaks its contract", *failed]))
        return Report(name, self.measured)

    def same(
        self, what: str, found: Any, wanted: Any, scale: float, allowed: float = ROUNDING
    ) -> Iterator[str]:
        """Compare two batches relative to a scale."""
        error = np.abs(np.asarray(found) - np.asarray(wanted))
        worst = float(np.max(error)) / scale if error.size and scale else float(np.max(error))
        self.measured[what] = max(self.measured.get(what, 0.0), worst)
        if not worst <= allowed:
            yield f"{what} is off by {worst:.1e} of its size (allowed {allowed:.0e})"


def derivative(values: Callable[[float], Mapping[str, Any]]) -> dict[str, Any]:
    """Derivative at t = 0 of values of time [s], by differences of order 8."""
    total: dict[str, Any] = {}
    for k, weight in enumerate(WEIGHTS, start=1):
        ahead, behind = values(k * STEP), values(-k * STEP)
        for name in ahead:
            term = weight * (ahead[name] - behind[name]) / STEP
            total[name] = total[name] + term if name in total else term
    return total
