"""Where the random choices of a made mechanism come from: a seed, or hypothesis."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from typing import Any, Protocol, TypeVar

T = TypeVar("T")


class Chance(Protocol):
    """Where random choices come from: hypothesis draws or a seeded generator."""

    def uniform(self, low: float, high: float) -> float:
        """A number between two bounds."""

    def integer(self, low: int, high: int) -> int:
        """A whole number between two bounds, both included."""

    def pick(self, choices: Sequence[T]) -> T:
        """One of several things."""


class Seeded:
    """Choices from a seed; the same seed gives the same mechanism."""

    def __init__(self, seed: int) -> None:
        self._random = random.Random(seed)

    def uniform(self, low: float, high: float) -> float:
        """A number between two bounds."""
        return self._random.uniform(low, high)

    def integer(self, low: int, high: int) -> int:
        """A whole number between two bounds."""
        return self._random.randint(low, high)

    def pick(self, choices: Sequence[T]) -> T:
        """One of several things."""
        return self._random.choice(choices)


class Drawn:
    """Choices that hypothesis draws, so that it can shrink them."""

    def __init__(self, draw: Callable[..., Any]) -> None:
        from hypothesis import strategies

        self._draw, self._of = draw, strategies

    def uniform(self, low: float, high: float) -> float:
        """A number between two bounds."""
        # Round numbers: they shrink well and print short.
        steps = 10_000
        return low + (high - low) * float(self._draw(self._of.integers(0, steps))) / steps

    def integer(self, low: int, high: int) -> int:
        """A whole number between two bounds."""
        return int(self._draw(self._of.integers(low, high)))

    def pick(self, choices: Sequence[T]) -> T:
        """One of several things."""
        found: T = self._draw(self._of.sampled_from(choices))
        return found
