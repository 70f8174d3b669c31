"""Laws of motion of a driver: coordinate, rate and acceleration.

Two laws give rate and acceleration as functions of the coordinate, so their samples may be given
by it; all laws can be sampled by time.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from functools import cached_property
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import ConfigDict, Field, model_validator

from blockmech.ground.tolerances import ROUNDING
from blockmech.ground.validation_errors import check_table
from blockmech.ground.values import (
    Angle,
    Axis,
    Number,
    NumbersGiven,
    Positive,
    StrictModel,
    Units,
    default,
)
from blockmech.typing import Floats

__all__ = [
    "ConstantRate",
    "Cycloidal",
    "Harmonic",
    "LawOfMotion",
    "RateAcceleration",
    "Trajectory",
]
__dir__ = __all__.copy  # completion shows these alone

Motion = tuple[Floats, Floats, Floats]


class LawOfMotion(StrictModel):
    """Coordinate of a driver as a given function; [rad] for a crank, [m] for a slide.

    >>> isinstance(bm.motion.ConstantRate(rate=1.0), bm.motion.LawOfMotion)
    True
    """

    model_config = ConfigDict(populate_by_name=True)
    kind_key: ClassVar[str] = "law"
    _called: ClassVar[str] = "a law of motion such as bm.motion.ConstantRate(rate=10.0)"

    def units(self, axis: Axis) -> Units:
        """Coordinates, rates and accelerations of the driver, and times."""
        q = axis.coordinate
        coordinates = dict.fromkeys(("start", "end", "mean", "amplitude", "values"), q)
        rates = {"rate": f"{q}/s", "acceleration": f"{q}/s2"}
        return {**coordinates, **rates, "times": "s", "frequency": "Hz"}

    @abstractmethod
    def at_times(self, t: Floats) -> Motion:
        """Coordinate, rate and acceleration (n,) at times (n,) [s]."""

    @abstractmethod
    def duration(self) -> float:
        """Time [s] from the start to the end of the law's range."""

    def begin(self) -> float:
        """Time [s] at the start of the law's range."""
        return 0.0

    @property
    def kinks(self) -> tuple[float, ...]:
        """Times [s] at which a derivative of the law jumps, or at which it ends."""
        return ()

    @property
    def corners(self) -> tuple[float, ...]:
        """The kinks at which its rate jumps."""
        return ()


class OverRange(LawOfMotion):
    """Constant acceleration over a range of the coordinate; zero is a constant rate."""

    start: Annotated[Number, Field(alias="from")] = default(0.0)
    end: Annotated[Number, Field(alias="to")] = default(2 * math.pi)

    @property
    @abstractmethod
    def _course(self) -> tuple[float, float]:
        """Rate at ``from`` and acceleration."""

    @property
    def travelled(self) -> tuple[float, float]:
        """Coordinates at which the range is entered and left.

        Time runs forward: a constant rate that points from ``to`` to ``from`` enters at ``to``.
        """
        rate, acceleration = self._course
        back = not acceleration and rate * (self.end - self.start) < 0
        return (self.end, self.start) if back else (self.start, self.end)

    def coordinates(self, n: int) -> Floats:
        """n equally spaced coordinates over the range, as it is travelled; one if it is a point."""
        if self.start == self.end:
            return np.array([self.start])
        return np.linspace(*self.travelled, n)

    def at_coordinates(self, q: Floats) -> Motion:
        """rate^2 = rate_from^2 + 2 acceleration (q - from); NaN where q is not reached."""
        rate, acceleration = self._course
        if not acceleration:
            return q, np.full(q.shape, rate), np.zeros(q.shape)
        direction = math.copysign(1.0, rate or acceleration)
        with np.errstate(invalid="ignore"):
            rates = direction * np.sqrt(rate**2 + 2 * acceleration * (q - self.start))
        return q, rates, np.full(q.shape, acceleration)

    def at_times(self, t: Floats) -> Motion:
        """q = from + rate t + acceleration t^2 / 2."""
        rate, acceleration = self._course
        if not acceleration:
            return self.at_coordinates(self.travelled[0] + rate * t)
        q = self.start + rate * t + acceleration * t * t / 2
        return q, rate + acceleration * t, np.full(t.shape, acceleration)

    def times(self, q: Floats) -> Floats:
        """First time [s] since the range is entered at which q is passed; NaN where never."""
        rate, acceleration = self._course
        if acceleration:
            return (self.at_coordinates(q)[1] - rate) / acceleration
        with np.errstate(over="ignore"):  # later than any number is never
            return (q - self.travelled[0]) / rate if rate else np.full(q.shape, np.nan)

    def duration(self) -> float:
        """Time over the range; infinite where its end is never reached."""
        t = float(self.times(np.array([self.travelled[1]]))[0])
        return t if math.isfinite(t) else math.inf


class ConstantRate(OverRange):
    """Constant rate [rad/s or m/s] over a range of the coordinate.

    A negative rate travels a rising range from its upper end.

    >>> bm.motion.ConstantRate(rate="300rpm").duration()
    0.2
    """

    law: Literal["constant_rate"] = "constant_rate"
    rate: Number

    @property
    def _course(self) -> tuple[float, float]:
        return self.rate, 0.0


class RateAcceleration(OverRange):
    """Constant acceleration [rad/s2 or m/s2]; ``rate`` [rad/s or m/s] is the one at ``from``.

    >>> bm.motion.RateAcceleration(acceleration=2.0, end=4.0).duration()
    2.0
    """

    law: Literal["rate_acceleration"] = "rate_acceleration"
    rate: Number = default(0.0)
    acceleration: Number

    @property
    def _course(self) -> tuple[float, float]:
        return self.rate, self.acceleration


class Harmonic(LawOfMotion):
    """q = mean + amplitude sin(2 pi frequency t + phase); frequency [Hz], phase [rad].

    >>> bm.motion.Harmonic(amplitude=0.1, frequency=2.0).duration()
    0.5
    """

    law: Literal["harmonic"] = "harmonic"
    mean: Number = default(0.0)
    amplitude: Number
    frequency: Positive
    phase: Angle = default(0.0)

    def at_times(self, t: Floats) -> Motion:
        """The harmonic and its derivatives."""
        w = 2 * math.pi * self.frequency
        s, c = np.sin(w * t + self.phase), np.cos(w * t + self.phase)
        return (
            self.mean + self.amplitude * s,
            self.amplitude * w * c,
            -self.amplitude * w * w * s,
        )

    def duration(self) -> float:
        """One period [s]."""
        return 1 / self.frequency


class Cycloidal(LawOfMotion):
    """A rise from ``start`` to ``end`` [rad or m] without jerk at its ends, then a dwell.

    ``time`` [s] is that of the rise; in a file the keys are "from", "to" and "duration".

    >>> bm.motion.Cycloidal(start=0.0, end=1.0, time=2.0).at_times(np.array([1.0]))[0]
    array([0.5])
    """

    law: Literal["cycloidal"] = "cycloidal"
    start: Annotated[Number, Field(alias="from")]
    end: Annotated[Number, Field(alias="to")]
    time: Annotated[Positive, Field(alias="duration", json_schema_extra={"unit": "s"})]

    def at_times(self, t: Floats) -> Motion:
        """q = from + rise (s - sin(2 pi s) / 2 pi), s = t / duration."""
        s = np.clip(t / self.time, 0.0, 1.0)
        rise, w = self.end - self.start, 2 * math.pi
        inside = (t >= 0) & (t < self.time)
        q = self.start + rise * (s - np.sin(w * s) / w)
        rate = np.where(inside, rise / self.time * (1 - np.cos(w * s)), 0.0)
        return q, rate, np.where(inside, rise * w / self.time**2 * np.sin(w * s), 0.0)

    def duration(self) -> float:
        """Time [s] of the rise."""
        return self.time

    @property
    def kinks(self) -> tuple[float, ...]:
        """Where the rise begins and ends."""
        return (0.0, self.time)


class Trajectory(LawOfMotion):
    """Values [rad or m] at times [s], joined by a cubic spline (not-a-knot) or straight lines.

    >>> motion = bm.motion.Trajectory(times=[0.0, 1.0, 3.0], values=[0.0, 0.5, 0.0])
    >>> motion.duration()
    3.0
    """

    law: Literal["trajectory"] = "trajectory"
    times: Annotated[NumbersGiven, Field(min_length=2)]
    values: Annotated[NumbersGiven, Field(min_length=2)]
    interpolation: Literal["cubic", "linear"] = "cubic"

    @model_validator(mode="after")
    def _ordered(self) -> Trajectory:
        check_table("times", self.times, self.values)
        return self

    def at_times(self, t: Floats) -> Motion:
        """The interpolant and its derivatives; NaN outside its times."""
        return self._curve(t), self._curve(t, 1), self._curve(t, 2)

    @cached_property
    def _curve(self) -> Any:
        from scipy.interpolate import CubicSpline, PPoly

        x, y = np.asarray(self.times), np.asarray(self.values)
        if self.interpolation == "cubic":
            return CubicSpline(x, y, extrapolate=False)
        return PPoly(np.array([np.diff(y) / np.diff(x), y[:-1]]), x, extrapolate=False)

    def duration(self) -> float:
        """Time [s] from its first to its last value."""
        return self.times[-1] - self.times[0]

    def begin(self) -> float:
        """Its first time [s]."""
        return self.times[0]

    @property
    def kinks(self) -> tuple[float, ...]:
        """Its times: the spline has a third derivative that jumps there."""
        return tuple(self.times)

    @property
    def corners(self) -> tuple[float, ...]:
        """Where straight lines meet at an angle."""
        if self.interpolation == "cubic":
            return ()
        slopes = np.diff(self.values) / np.diff(self.times)
        jumps = np.abs(np.diff(slopes)) > ROUNDING * np.abs(slopes).max()
        return tuple(np.asarray(self.times)[1:-1][jumps].tolist())


AnyLaw = Annotated[
    ConstantRate | RateAcceleration | Harmonic | Cycloidal | Trajectory, Field(discriminator="law")
]
