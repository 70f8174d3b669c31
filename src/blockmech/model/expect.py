"""Expected numbers that a graph file carries: the file is a test of itself.

The numbers never come from blockmech; ``source`` says where they come from.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from blockmech.ground.validation_errors import mistake
from blockmech.ground.values import Finite, Maybe, NotNegative, Positive, StrictModel, default
from blockmech.typing import FrictionMethod, FrictionName, Successive

Pair = Annotated[list[Finite], Field(min_length=2, max_length=2)]
Series = Annotated[list[Finite] | list[Pair], Field(min_length=1)]
"""One number or one [x, y] pair a sample."""

Samples = Annotated[list[Finite], Field(min_length=1)]


class Simulation(StrictModel):
    """A free motion from the scene's start: sampled at ``times`` [s], ended by ``until``.

    ``method`` is one of `Mechanism.simulate`, the one that fits best if it is left out.
    """

    until: str | None = None
    method: str = "auto"
    times: Samples


class Expectation(StrictModel):
    """Numbers that some outputs should have, and how near they must be.

    Parameters
    ----------
    source : where the numbers come from
    at : coordinates [rad or m] of the drivers, n samples each; or
    simulate : a free motion, n samples of time
    want : output name -> n numbers or [x, y] pairs; a single one for one number a run
    rtol, atol : relative and absolute tolerance; at least one is given
    friction, tolerance, iterations : how joint friction is solved, see `Mechanism.plan`

    >>> Expectation(source="by hand", at={"crank": [0.0]}, want={"crank.q": [0.0]}, atol=0).samples
    1
    """

    source: str
    at: dict[str, Samples] | None = None
    simulate: Simulation | None = None
    want: Annotated[dict[str, Series], Field(min_length=1)]
    rtol: Maybe[NotNegative] = default(None)
    atol: Maybe[NotNegative] = default(None)
    friction: FrictionName = "newton"
    tolerance: Maybe[Positive] = default(None)
    iterations: Annotated[int, Field(strict=True, ge=1)] | None = None

    @model_validator(mode="after")
    def _complete(self) -> Expectation:
        wrong = ""
        if (self.at is None) == (self.simulate is None):
            wrong = 'an expectation has either "at" or "simulate"'
        elif self.rtol is None and self.atol is None:
            wrong = 'an expectation needs a tolerance: "rtol", "atol" or both'
        elif self.at is not None and len({len(values) for values in self.at.values()}) != 1:
            wrong = '"at" has one or more drivers, with equally many values each'
        odd = [n for n, x in self.want.items() if not wrong and len(x) not in (1, self.samples)]
        if odd:
            wrong = f"{odd[0]} has {len(self.want[odd[0]])} values, "
            wrong += f"the number of samples is {self.samples}"
        if self.friction != "successive" and (self.tolerance or self.iterations):
            wrong = '"tolerance" and "iterations" have no meaning'
            wrong += f" for friction {self.friction!r}"
        if wrong:
            raise mistake("bad-expectation", wrong)
        return self

    @property
    def method(self) -> FrictionMethod:
        """How joint friction is solved, as a run takes it."""
        if self.tolerance is None and self.iterations is None:
            return self.friction
        return Successive(self.tolerance, self.iterations)

    @property
    def samples(self) -> int:
        """Number of samples."""
        if self.simulate is not None:
            return len(self.simulate.times)
        return len(next(iter((self.at or {}).values())))
