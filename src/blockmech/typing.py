"""Names of types that appear in signatures everywhere.

Kernels are written once and run on Python numbers, on NumPy batches and in
several precisions, so their arguments have no single Python type. The aliases
say what a value *means*; its batch shape (...) is written beside it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence, Sized
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray
from typing_extensions import TypeVar

Real: TypeAlias = Any
"""A real number or a batch of them: float, or float array (...).

Also what an engine computes with in its place: a dual number, a node of a trace, an affine form.
"""

Complex: TypeAlias = Any
"""A planar vector x + iy or a batch of them: complex, or `Planar` (...)."""

Kernel: TypeAlias = Callable[..., Any]
"""A function of numbers, vectors and records of them, bound to each engine's kind of number."""

Nested: TypeAlias = Real | Complex | tuple["Nested", ...]
"""What a kernel takes or answers: a number, a vector, or a tuple or record of such, nested."""

Values: TypeAlias = tuple[Any, ...]
"""Such values in a row: what a program computes, the state of a loop, parameters, a record."""

Array: TypeAlias = NDArray[Any]
"""Numbers of any precision, real or complex, or truth values; the shape is written beside it."""

Floats: TypeAlias = NDArray[np.float64]
"""Real numbers in double precision."""

Vectors: TypeAlias = NDArray[np.complex128]
"""Planar vectors x + iy in double precision."""

Indices: TypeAlias = NDArray[np.intp]
"""Where something stands in an array."""

Reals: TypeAlias = Sequence[Real]
"""Real numbers, one for each pair, driver or row."""

Planars: TypeAlias = Sequence[Complex]
"""Planar vectors, one for each pair or row."""

Edges: TypeAlias = Sequence[bool]
"""Whether the load on a pair is the larger of two components, as a guide's, not a length."""

Influences: TypeAlias = Sequence[Planars]
"""Of each pair, what a unit of friction of every pair changes its load by."""

Parameters: TypeAlias = Any
"""Numbers of a block, load or law: the NamedTuple that is made of its model, for its kernels."""

Data: TypeAlias = dict[str, Any]
"""What an object of JSON holds: plain data of a file, of a part of it, or of an answer."""

Record: TypeAlias = Mapping[str, Any]
"""Such data, or values by name, that are only read."""

Arguments: TypeAlias = dict[str, Any]
"""Arguments of a call, by their names."""

Argument: TypeAlias = Literal["coordinate", "rate", "time"]
"""What a law of a load is a function of, if it is not a signal."""

Numbers: TypeAlias = float | str | Sequence[float | str] | NDArray[Any]
"""One number or a row of them (n,), in SI or as text with a unit, "30deg"."""

Coordinates: TypeAlias = Numbers | Mapping[str, Numbers]
"""Numbers for the only driver, or for each driver by its name."""

Points: TypeAlias = Sequence[complex] | Sequence[Sequence[float | str]] | NDArray[Any]
"""Points (n,): complex numbers [m], or rows x, y, in metres or as texts with units."""

Quantity: TypeAlias = float | str
"""A number in SI, or a text with its unit: "300rpm", "50 mm"."""

Progress: TypeAlias = Callable[[str, float, float | None], None]
"""Told now and then in a run: what is at work, how far it is, and the whole where that is known.

It may raise `KeyboardInterrupt` to stop the run, which keeps what was done.
"""


@dataclass(frozen=True)
class Successive:
    """Joint friction by successive approximation ([R10] steps 1-5), with a stopping rule.

    ``friction="successive"`` uses the defaults.

    Parameters
    ----------
    tolerance : largest change of a reaction [N] at which it stops; by default 1e-7 of the largest
    iterations : a fixed number of iterations, in place of ``tolerance``

    >>> method = bm.friction.Successive(iterations=3)
    >>> mech.run(at=0.5, friction=method, want="crank.drive")["crank.drive"].round(3)
    array([8940.66])
    """

    tolerance: float | None = None
    iterations: int | None = None

    def __str__(self) -> str:
        return "successive"


FrictionName: TypeAlias = Literal["none", "single", "successive", "newton"]
FrictionMethod: TypeAlias = FrictionName | Successive
EngineName: TypeAlias = Literal["auto", "scalar", "numpy", "llvm"]
Precision: TypeAlias = Literal["complex64", "complex128", "clongdouble"]
OnGap: TypeAlias = Literal["raise", "mark", "stop"]
FixedStepName: TypeAlias = Literal["rk4", "euler_q"]


@dataclass(frozen=True)
class FixedStep:
    """A textbook integrator for motions, with a fixed step.

    ``method="rk4"`` is this with a step that is fine enough for the accuracy.

    Parameters
    ----------
    method : "rk4", the classic scheme in time, or "euler_q", Euler's in the coordinate
    step : of time [s] for rk4, of the driver's coordinate [rad or m] for euler_q

    >>> import blockmech as bm
    >>> bm.FixedStep("rk4", step=1e-3)
    FixedStep(method='rk4', step=0.001)
    """

    method: FixedStepName
    step: float | str

    def __str__(self) -> str:
        return self.method


MotionName: TypeAlias = Literal["auto", "energy", "dop853", "radau", "rk4", "euler_q"]
MotionMethod: TypeAlias = MotionName | FixedStep


class Named(Protocol):
    """What results and their exports tell of the mechanism that made them."""

    name: str

    @property
    def drivers(self) -> tuple[str, ...]:
        """Drivers in formation order."""

    @property
    def outputs(self) -> Sized:
        """Every output that can be wanted."""

    @property
    def frictional_joints(self) -> tuple[str, ...]:
        """Names of the joints that have friction."""

    def _block_name(self, block: str) -> str:
        """A block in a message."""


M = TypeVar("M", bound=Named, default=Any)
"""What a run is of: a `Mechanism`, or any other `Compiled`."""


class Guide(NamedTuple):
    """What a joint that reads a *guide* gets at the position stage."""

    p: Complex  # (...) [m] the marker's place
    u: Complex  # (...) [-] the marker's unit direction


class LinkPosition(NamedTuple):
    """Origin and unit x axis of a link."""

    o: Complex  # (...) [m]
    e: Complex  # (...) [-]


class LinkVelocity(NamedTuple):
    """Velocity of a link's origin, or of a guide's marker, and the link's rate."""

    v: Complex  # (...) [m/s]
    om: Real  # (...) [rad/s]


class LinkAcceleration(NamedTuple):
    """Acceleration of a link's origin, or of a guide's marker, and the link's angular one."""

    a: Complex  # (...) [m/s2]
    al: Real  # (...) [rad/s2]


class Load(NamedTuple):
    """Resultant of loads on a link, moment about the link's own origin."""

    F: Complex  # (...) [N]
    M: Real  # (...) [N m]


class Slide(NamedTuple):
    """What a prismatic pair transmits, on the later link (inner: on link j)."""

    N: Real  # (...) [N] normal force along n = i u, u the guide's direction
    C: Real  # (...) [N m] guide couple about the origin of the later link
    C_i: Real = 0.0  # (...) [N m] inner: the same about the origin of link i
