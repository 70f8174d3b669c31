"""Samples of a request: driver coordinates, rates and accelerations, checked."""

from __future__ import annotations

import json
import math
import sys
import warnings
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from inspect import CO_VARARGS, CO_VARKEYWORDS
from itertools import takewhile
from traceback import walk_stack
from types import FrameType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blockmech.functions.roots import SCANNED
from blockmech.ground.errors import Problem, RequestError, listed, refused
from blockmech.ground.units import NoQuantity, UnitWarning, in_si, seem_degrees
from blockmech.ground.values import is_count, is_number
from blockmech.model.laws_of_motion import ConstantRate, LawOfMotion, OverRange
from blockmech.model.scene import Scene
from blockmech.typing import Coordinates, Floats, Numbers, Record

ANY = CO_VARARGS | CO_VARKEYWORDS  # flags of functions that take any arguments
DEFAULT_SAMPLES = SCANNED // 2 + 1  # of a turn: every degree, and the end


@dataclass(frozen=True)
class Samples:
    """n samples of all drivers.

    Attributes
    ----------
    n : number of samples
    inputs : program input -> (n,), see `Schedule.input`
    times : (n,) [s] where the request is by time
    clock : the only driver's law, which tells the time of a coordinate
    """

    n: int
    inputs: Record
    times: Floats | None = None
    clock: OverRange | None = None

    @property
    def time(self) -> Floats | None:
        """Times (n,) [s], or None where the request does not say."""
        if self.times is None and self.clock is not None:
            return self.clock.times(self.coordinate(0))
        return self.times

    @property
    def at_rest(self) -> bool:
        """Whether no driver moves or accelerates at any sample."""
        motions = (x for name, x in self.inputs.items() if name[:2] == "qd")
        return not any(x[0] or np.any(x) for x in motions)  # the first mostly tells

    def spread(self, count: int) -> NDArray[np.intp]:
        """Indices of at most so many samples, equally spread and ends included."""
        if self.n <= count:
            return np.arange(self.n)
        return np.unique(np.linspace(0, self.n - 1, count).round().astype(np.intp))

    def at(self, index: NDArray[np.intp]) -> Samples:
        """The samples of these indices."""
        times = None if self.times is None else self.times[index]
        return Samples(len(index), _Some(self.inputs, index), times, self.clock)

    def between(self, positions: Floats) -> Samples:
        """Samples at positions (m,) among these, counted from 0; between two of them on a line."""
        rows = {name: np.asarray(x, dtype=float) for name, x in self.inputs.items()}
        if self.times is not None:
            rows["t"] = self.times
        rows = {name: np.interp(positions, np.arange(self.n), x) for name, x in rows.items()}
        return Samples(len(positions), rows, rows.pop("t", None), self.clock)

    def given(self, names: Iterable[str]) -> Record:
        """The inputs of a program.

        Raises `RequestError` where it needs the time and the request does not say it.
        """
        if "t" not in names:
            return self.inputs
        if self.time is None or not np.isfinite(self.time).all():
            raise refused(
                "times",
                "a load depends on the time, which the request does not give",
                "name the samples with times=, or give the driver a law with a rate",
            )
        return {**self.inputs, "t": self.time}

    def coordinate(self, i: int) -> Floats:
        """Coordinates (n,) of the driver number i [rad or m]."""
        return np.asarray(self.inputs[f"q_{i}"], dtype=float)

    def weights(self, drivers: int) -> Floats:
        """Trapezoidal weights (n,) [s] for integrals over time; NaN where time is unknown."""
        if self.n < 2:
            return np.full(self.n, np.nan)
        time = self.time
        if time is not None and np.isfinite(time).all():
            return _forward(_trapezoids(time))
        if drivers == 1:
            rate = np.asarray(self.inputs["qd_0"], dtype=float)
            rate = np.where(rate == 0.0, np.nan, rate)  # at rest no time passes that is known
            return _forward(_trapezoids(self.coordinate(0)) / rate)
        return np.full(self.n, np.nan)


class _Some(Record):
    """Inputs at some samples, each taken when it is asked for: accelerations may cost much."""

    def __init__(self, inputs: Record, index: NDArray[np.intp]) -> None:
        self.inputs, self.index = inputs, index

    def __getitem__(self, name: str) -> Floats:
        return np.ascontiguousarray(np.asarray(self.inputs[name])[self.index])

    def __iter__(self) -> Iterator[str]:
        return iter(self.inputs)

    def __len__(self) -> int:
        return len(self.inputs)


def _trapezoids(x: Floats) -> Floats:
    steps: Floats = np.diff(x)
    return np.append(steps, 0) / 2 + np.append(0, steps) / 2


def _forward(weights: Floats) -> Floats:
    """The weights; samples named against the motion are summed in its sense all the same."""
    return -weights if weights.sum() < 0 else weights


def make_samples(
    units: Mapping[str, str],
    scene: Scene,
    at: Coordinates | None = None,
    samples: int | None = None,
    times: Numbers | None = None,
    rates: Coordinates | None = None,
    accelerations: Coordinates | None = None,
) -> Samples:
    """The samples that a request names; see `Mechanism.run`.

    ``units`` are those of the drivers' coordinates, in their order.

    Raises `RequestError` where drivers are unknown or missing, lengths differ,
    numbers are not finite, or the law of motion does not fit the way of asking.
    """
    arguments = [
        n for n, x in (("at", at), ("samples", samples), ("times", times)) if x is not None
    ]
    if len(arguments) > 1:
        raise refused(listed(arguments), "name the samples in one way only", "at, samples or times")
    if isinstance(at, int | float) and is_number(at) and rates is None and accelerations is None:
        pose = _one_pose(units, scene, at)
        if pose is not None:
            return pose
    with np.errstate(all="ignore"):  # inputs that are not finite have no answer
        return _of_many(units, scene, at, samples, times, rates, accelerations)


def _of_many(
    units: Mapping[str, str],
    scene: Scene,
    at: Coordinates | None,
    samples: int | None,
    times: Numbers | None,
    rates: Coordinates | None,
    accelerations: Coordinates | None,
) -> Samples:
    if at is not None:
        return _by_coordinate(units, scene, at, rates, accelerations)
    if rates is not None or accelerations is not None:
        raise refused("rates", "rates need coordinates", "give at= as well")
    laws = _laws(units, scene)
    if times is not None:
        return _by_time(scene, laws, _column("times", times, "s"))
    for driver, law in laws.items():
        endless = isinstance(law, OverRange) and "end" not in law.model_fields_set
        if endless and units[driver] == "m":  # its default is a turn
            where, message = scene.address("drive", driver), "its law does not say how far it goes"
            remedy = 'give it a start and end, in a file "from" and "to", or name samples with at='
            raise refused(where, message, remedy, code="no-range")
    n = DEFAULT_SAMPLES if samples is None else samples
    if not is_count(n):
        raise refused("samples", f"must be a positive whole number, got {n!r}", "")
    try:
        return _by_range(scene, laws, int(n))
    except (MemoryError, IndexError, ValueError):  # what NumPy makes of so many
        raise refused("samples", f"{n} samples exceed the memory", "ask for fewer") from None


def _one_pose(units: Mapping[str, str], scene: Scene, q: float) -> Samples | None:
    """The commonest request without arrays: one coordinate of one driver at constant rate."""
    if len(units) != 1:
        return None
    ((driver, unit),) = units.items()
    law = scene.drive.get(driver)
    if unit == "rad" and q % 10 == 0:
        warn_of_degrees(f"at[{driver}]", q, q)
    if type(law) is ConstantRate:
        return Samples(1, {"q_0": [float(q)], "qd_0": [law.rate], "qdd_0": [0.0]}, clock=law)
    return Samples(1, {"q_0": [float(q)], "qd_0": [0.0], "qdd_0": [0.0]}) if law is None else None


def _by_coordinate(
    units: Mapping[str, str], scene: Scene, at: Coordinates, rates: Any, accelerations: Any
) -> Samples:
    q = _per_driver(units, "at", at)
    qd = _per_driver(units, "rates", rates, "/s") if rates is not None else {}
    qdd = {}
    if accelerations is not None:
        qdd = _per_driver(units, "accelerations", accelerations, "/s2")
    n = max((len(x) for part in (q, qd, qdd) for x in part.values()), default=1)
    motions, clock = {}, None
    for driver, unit in units.items():
        if unit == "rad":
            warn_of_degrees(f"at[{driver}]", q[driver].min(), q[driver].max())
        column = _stretched(driver, q[driver], n)
        law = scene.drive.get(driver)
        rate = acceleration = np.zeros(n)
        if isinstance(law, OverRange):
            _, rate, acceleration = law.at_coordinates(column)
            if driver not in qd and len(units) == 1:
                clock = law
        elif law is not None and driver not in qd:
            raise refused(
                scene.address("drive", driver),
                f'the law "{law.law}" is sampled by time, not by coordinate',
                "use times=, or give rates= and accelerations=",
            )
        motions[driver] = (
            column,
            _stretched(driver, qd[driver], n) if driver in qd else rate,
            _stretched(driver, qdd[driver], n) if driver in qdd else acceleration,
        )
    return _collected(scene, n, motions, clock=clock)


def _by_time(scene: Scene, laws: Mapping[str, LawOfMotion], t: Floats) -> Samples:
    return _collected(scene, len(t), {d: law.at_times(t) for d, law in laws.items()}, t)


def _by_range(scene: Scene, laws: Mapping[str, LawOfMotion], n: int) -> Samples:
    ranged = {d: x for d, x in laws.items() if isinstance(x, OverRange)}
    if len(ranged) < len(laws):
        begin = max(x.begin() for x in laws.values())
        end = max(x.begin() + x.duration() for x in laws.values() if np.isfinite(x.duration()))
        return _by_time(scene, laws, np.linspace(begin, end, n))
    if all(x.start == x.end for x in ranged.values()):
        n = 1
    motions = {d: x.at_coordinates(np.linspace(*x.travelled, n)) for d, x in ranged.items()}
    clock = next(iter(ranged.values())) if len(ranged) == 1 else None
    return _collected(scene, n, motions, clock=clock)


def _collected(
    scene: Scene,
    n: int,
    motions: Mapping[str, tuple[Floats, Floats, Floats]],
    times: Floats | None = None,
    clock: OverRange | None = None,
) -> Samples:
    """Samples of coordinates, rates and accelerations by driver, in the drivers' order."""
    inputs = {}
    for i, (driver, motion) in enumerate(motions.items()):
        for name, column in zip(("q", "qd", "qdd"), motion, strict=True):
            inputs[f"{name}_{i}"] = column
            good = np.isfinite(column)
            if not good.all():
                raise refused(
                    scene.address("drive", driver),
                    f"the law of motion does not reach sample {good.argmin()}",
                    "give samples inside its range",
                )
    return Samples(n, inputs, times, clock)


def _laws(units: Mapping[str, str], scene: Scene) -> dict[str, LawOfMotion]:
    missing = [d for d in units if d not in scene.drive]
    if missing:
        message = "the driver has no law of motion"
        examples = {"rad": ["0deg", "90deg"], "m": ["0mm", "50mm"]}
        poses = {d: examples[unit] for d, unit in units.items()}
        at = json.dumps(poses if len(units) > 1 else poses[missing[0]])
        law = f'bm.motion.ConstantRate(rate="{poses[missing[0]][1]}/s")'
        remedy = f"give it one, e.g. {law}, or name the poses: run(at={at})"
        addresses = (scene.address("drive", d) for d in missing)
        raise RequestError(Problem("no-law", where, message, "", remedy) for where in addresses)
    return {d: scene.drive[d] for d in units}


def _per_driver(
    units: Mapping[str, str], argument: str, raw: Coordinates, per: str = ""
) -> dict[str, Floats]:
    drivers = [*units]
    if not isinstance(raw, Mapping):
        if len(drivers) != 1:
            raise refused(
                argument,
                f"the mechanism has {len(drivers)} drivers",
                f"give a mapping driver -> values for: {listed(drivers)}",
            )
        raw = {drivers[0]: raw}
    unknown = [d for d in raw if d not in drivers]
    missing = [d for d in drivers if d not in raw] if argument == "at" else []
    if unknown or missing:
        problems = [f"unknown: {listed(map(str, unknown))}"] if unknown else []
        problems += [f"missing: {listed(missing)}"] if missing else []
        raise refused(argument, "; ".join(problems), f"drivers: {listed(drivers)}")
    return {d: _column(f"{argument}[{d}]", x, units[d] + per) for d, x in raw.items()}


def _column(where: str, raw: Numbers, unit: str) -> Floats:
    try:
        array = np.asarray(in_si(raw, unit))
        if array.dtype.kind not in "iuf" or np.ma.is_masked(raw):  # text, complex, holes: slips
            raise TypeError
        column = np.atleast_1d(array.astype(np.float64, order="C"))
    except NoQuantity as error:
        raise refused(where, error.found, "", error.valid) from None
    except (TypeError, ValueError):
        raise refused(where, "not a row of numbers", "give a number or a sequence") from None
    if column.ndim != 1 or len(column) == 0:
        raise refused(where, f"has shape {column.shape}", "give one row of numbers")
    good = np.isfinite(column)
    if not good.all():
        bad = good.argmin()
        raise refused(f"{where}[{bad}]", f"not a finite number: {column[bad]}", "")
    return column


def warn_of_degrees(where: str, low: float, high: float) -> None:
    """Warn of angles that are surely degrees: they are taken as they are, in radians.

    Only arguments of the user's call are looked at: other places an analysis has chosen.
    """
    if not seem_degrees(low, high):
        return
    stack = [*takewhile(_is_ours, (frame for frame, _ in walk_stack(sys._getframe())))]
    call = next(frame for frame in reversed(stack) if not _hands_on(frame))
    if call.f_locals.get(where.partition("[")[0]) is not None:
        last = max(low, high, key=abs)
        warnings.warn(
            f"{where}: these are radians, {last:g} rad are {abs(last) / math.tau:.3g} turns; "
            f'degrees are written "{last:g}deg"',
            UnitWarning,
            stacklevel=len(stack) + 1,
        )


def _is_ours(frame: FrameType) -> bool:
    """Whether a line is of this package, or between two of it."""
    return str(frame.f_globals.get("__name__")).startswith("blockmech.") or _hands_on(frame)


def _hands_on(frame: FrameType) -> bool:
    """Whether a call hands on the arguments that the user wrote: of a decorator, or a command."""
    is_command = str(frame.f_globals.get("__name__")).startswith("blockmech.cli")
    return is_command or not ANY & ~frame.f_code.co_flags


def _stretched(driver: str, column: Floats, n: int) -> Floats:
    if len(column) == n:
        return column
    if len(column) == 1:
        return np.full(n, column[0])
    raise refused(driver, f"has {len(column)} samples where others have {n}", "give equal numbers")
