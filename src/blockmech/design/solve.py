r"""Inverse questions: which coordinate, load or length gives a wanted value.

**Of a driver**: the output y(q) is followed over its range; between two neighbouring extremes it is
monotone, so it takes a value once or not at all there, and bracketing finds the place to rounding.
All places are found, also those at which the output only touches the value.

**Of several drivers, and of numbers of the design**: as many unknowns x as wanted values,
F(x) = y(x) - wanted = 0 by least squares with a trust region from the poses or numbers at hand;
derivatives of designs are exact, and dx/dy = F'^-1.

Source: Branch, Coleman & Li, SIAM J. Sci. Comput. 21 (1999), the trust region (SciPy's).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from blockmech.analysis.extremes import PART_OF, number_of, parts_of
from blockmech.analysis.ranges import cycle_of
from blockmech.analysis.scan import TURN
from blockmech.analysis.turning_points import ROUNDING, Signal, Turns, signal_of, turns_of
from blockmech.analysis.working_cycle import Cycle
from blockmech.compiled import Compiled
from blockmech.design.efforts import with_efforts
from blockmech.ground.arguments import declared
from blockmech.ground.errors import BlockmechError, as_names, listed, refused
from blockmech.ground.plane import EPS, within_half_turn
from blockmech.ground.report import Facts, Report, places, with_unit
from blockmech.ground.units import NoQuantity, in_si
from blockmech.model.laws_of_motion import OverRange
from blockmech.studies.family import parameters, remade
from blockmech.studies.reductions import TEXT
from blockmech.typing import Arguments, Coordinates, Floats, FrictionMethod, Numbers

STARTS = 5  # values of each of several drivers, between which ways to the wanted pose begin
CLOSE = EPS ** (2 / 3)  # of a size: misfits and steps that count as none
ALIKE = CLOSE**0.5  # of a size: answers that are one; of a double root half the digits are known


@dataclass(frozen=True)
class Solution(Facts):
    """One answer.

    Attributes
    ----------
    values : ``"crank.q"`` or the address of a number -> its value
    units : their units
    slopes : (k, k) derivative of each value by each target; NaN where the target is an extreme
    mode : address of a branch -> 1 or -1, if all assembly modes were searched
    """

    values: Mapping[str, float]
    units: Mapping[str, str]
    slopes: Floats
    mode: Mapping[str, int] = field(default_factory=dict)

    def __getitem__(self, name: str) -> float:
        return self.values[name]


@dataclass(frozen=True, repr=False)
class Solutions(Facts, Report):
    """Every answer to an inverse question, in the order of the range.

    Attributes
    ----------
    wanted : output -> value
    units : their units
    solutions : empty if the output never has the value
    nearest : the nearest value of the output, in words
    """

    wanted: Mapping[str, float]
    units: Mapping[str, str]
    solutions: tuple[Solution, ...]
    nearest: str = ""

    def __len__(self) -> int:
        return len(self.solutions)

    def __iter__(self) -> Iterator[Solution]:
        return iter(self.solutions)

    def __getitem__(self, k: int) -> Solution:
        return self.solutions[k]

    def lines(self) -> Iterator[str]:
        """The targets, then one line for each solution."""
        yield f"{places(self.wanted, self.units, self._display)}:"
        for solution in self.solutions:
            mode = ", ".join(f"{name} = {x}" for name, x in solution.mode.items())
            line = f"  {places(solution.values, solution.units, self._display)}"
            yield f"{line}  ({mode})" if mode else line
        if not self.solutions:
            yield f"  no solution: {self.nearest}"


@declared
def solve(
    mechanism: Compiled,
    wanted: Mapping[str, float | str],
    to: Iterable[str] | str = (),
    *,
    at: Coordinates | None = None,
    samples: int | None = None,
    modes: bool = False,
    friction: FrictionMethod | None = None,
    static: bool = False,
) -> Solutions:
    """Find driver coordinates, loads or lengths for which outputs have target values.

    Parameters
    ----------
    wanted : output -> value in SI, or as text with a unit, e.g. ``{"dyad.j.angle": "80deg"}``
        With ``to`` also reductions as in a study: ``{"max_abs(crank.drive)": 50.0}``.
    to : parameter paths, as many as wanted values, or efforts at other places than the driver:
        ``"dyad.C.moment"`` between the links of a pin, ``"dyad.j.moment"`` on a link,
        ``"dyad.P.force.x"`` at a marker in ground axes (of links and joints ``"joint.C.moment"``,
        ``"joint.S.force"`` along a guide, ``"link.rod.moment"``, ``"link.rod.P.force.x"``); with
        ``{"crank.drive": 0}`` the effort replaces the drive. By default the unknowns are the
        driver coordinates, as many as wanted values
    at, samples : with ``to`` the poses [rad or m] at which outputs are evaluated, as in a run; one
        pose for an output without a reduction
    modes : whether all assembly modes of a graph's dyads are searched
    friction, static : as those of a run

    Returns
    -------
    Solutions
        For one driver all solutions in its range, to rounding; for several drivers those that
        Newton's method reaches from a grid of starts; for parameters the one that it reaches from
        the values of the file.

    Raises
    ------
    RequestError for unknown names, and unless there are as many wanted values as unknowns

    >>> import blockmech as bm
    >>> mech = bm.Graph.load("graphs/ruiz_fourbar.json").compile()
    >>> print(mech.solve({"dyad.j.angle": 1.4}))
    dyad.j.angle = 1.4 rad:
      crank.q = 1.52732558 rad
      crank.q = 5.67017408 rad
    """
    unknowns = as_names("to", to)
    if len(wanted) != len(unknowns or mechanism.drivers):
        what = listed(unknowns) if unknowns else f"driver{'s'[: len(mechanism.drivers) != 1]}"
        found = f"{len(wanted)} wanted for {len(unknowns or mechanism.drivers)} {what}"
        raise refused("wanted", found, "give as many values as there are unknowns")
    values = {name: _in_si(mechanism, name, x) for name, x in wanted.items()}
    if bad := [name for name, x in values.items() if not math.isfinite(x)]:
        raise refused(bad[0], "the target value is not finite", "give a number")
    how: Arguments = {"friction": friction, "static": static}
    if unknowns:
        mechanism, paths = with_efforts(mechanism, unknowns, parameters(mechanism))
        return _of_numbers(mechanism, values, paths, {"at": at, "samples": samples}, how)
    of = _of_driver if len(mechanism.drivers) == 1 else _of_drivers
    if not modes:
        return of(mechanism, values, how, {})
    branches = [a for a in parameters(mechanism) if a.endswith(".branch")]
    parts: list[Solutions] = []
    for signs in itertools.product((1, -1), repeat=len(branches)):
        mode = dict(zip(branches, signs, strict=True))
        try:
            parts.append(of(remade(mechanism, mode), values, how, mode))
        except BlockmechError as error:  # in this mode the mechanism closes nowhere
            nowhere = error
    if not parts:
        raise nowhere
    every = tuple(solution for part in parts for solution in part)
    return Solutions(parts[0].wanted, parts[0].units, every, parts[0].nearest)


# -- one driver ----------------------------------------------------------------------------


def _of_driver(
    mechanism: Compiled, wanted: Mapping[str, float], how: Arguments, mode: Mapping[str, int]
) -> Solutions:
    ((name, value),) = wanted.items()
    output, part = number_of(mechanism, name)
    cycle = cycle_of(mechanism, **how)
    driver, unit = mechanism._of_driver(mechanism.drivers[0], "q"), mechanism.outputs[output].unit
    if cycle.by != "coordinate":
        raise refused(driver, "its law is one of time", "give it a law by its coordinate")
    signal = signal_of(cycle, output, part)
    extremes = turns_of(cycle, signal)
    reach = extremes.low.value, extremes.high.value
    counts: Iterable[int] = (0,)
    turning = mechanism.outputs[output].circular
    if turning:
        room = ROUNDING * max(map(abs, reach))
        first, last = (reach[0] - room - value) / TURN, (reach[1] + room - value) / TURN
        counts = range(math.ceil(first), math.floor(last) + 1)
    targets = (value + TURN * k for k in counts)
    course = cycle, signal, extremes
    closed = extremes.closed or (turning and cycle.turns)
    crossings = (q for target in targets for q in _crossings(*course, target, closed))
    units = {driver: mechanism.outputs[driver].unit}
    solutions = tuple(
        Solution({driver: q}, units, np.array([[1.0 / _slope(cycle, signal, q)]]), mode)
        for q in sorted(crossings)
    )
    low, high = (with_unit(x, unit) for x in reach)
    return Solutions(dict(wanted), {name: unit}, solutions, f"{name} goes from {low} to {high}")


def _crossings(
    cycle: Cycle, signal: Signal, extremes: Turns, value: float, closed: bool
) -> Iterator[float]:
    """Places at which a signal takes a value: at an extreme, or once between neighbours."""
    from scipy.optimize import brentq

    def off(q: float) -> float:
        if math.isnan(y := float(signal.value(np.array([q]))[0])):  # between samples that have one
            raise refused(signal.name, f"it has no value at {q:.9g}", "follow a shorter range")
        return y - value

    for low, high in cycle.stretches(signal.value):
        x = [low, *(turn.s for turn in extremes.inner if low < turn.s < high), high]
        y = [off(q) for q in x]
        at = [abs(d) <= ROUNDING * max(abs(d + value), abs(value)) for d in y]
        for i, q in enumerate(x):
            if at[i] and not (closed and q == high):  # the last place is the first one
                yield q
            elif i and y[i - 1] * y[i] < 0 and not (at[i - 1] or at[i]):
                yield float(brentq(off, x[i - 1], q, xtol=EPS, rtol=4 * EPS))


def _slope(cycle: Cycle, signal: Signal, q: float) -> float:
    """Derivative of a signal, by central differences of fourth order; NaN where it is rounding."""
    h = EPS ** (1 / 5) * (cycle.high - cycle.low) / TURN
    with np.errstate(all="ignore"):
        a, b, c, d = signal.value(q + h * np.array([-2.0, -1.0, 1.0, 2.0])).tolist()
        slope = (a - 8 * b + 8 * c - d) / (12 * h)
    size = max(map(abs, (a, b, c, d)))
    return slope if abs(slope) * h > ROUNDING * size / h**0.5 else math.nan


# -- several drivers, and numbers of the design --------------------------------------------


def _of_drivers(
    mechanism: Compiled, wanted: Mapping[str, float], how: Arguments, mode: Mapping[str, int]
) -> Solutions:
    read, units = _reader(mechanism, wanted, how)
    ranges, rotary = [], []
    for d in mechanism.drivers:
        law = mechanism.scene.drive.get(d)
        joint = mechanism.structure.driver_joint(d)
        if law is None and not joint.rotary:
            raise refused(d, "its range is unknown", "give the driver a law of motion")
        if not isinstance(law, OverRange | None):
            raise refused(d, "its law is one of time", "give it a law by its coordinate")
        ranges.append((0.0, TURN) if law is None else sorted(law.travelled))
        rotary.append(joint.rotary)
    lows, highs = np.array(ranges).T
    sizes = highs - lows
    grid = itertools.product(*(np.linspace(low, high, STARTS) for low, high in ranges))
    roots: list[tuple[Floats, Floats]] = []
    nearest = math.inf
    for start in grid:
        x, slopes, misfit = _solved(read, np.array(start), sizes)
        nearest = min(nearest, misfit)
        offsets = [np.abs(x - root) for root, _ in roots]
        apart = [np.where(rotary, np.abs(within_half_turn(d)), d) for d in offsets]
        inside = (lows - CLOSE * sizes <= x) & (x <= highs + CLOSE * sizes) | rotary
        if misfit <= CLOSE and inside.all() and not any((d <= ALIKE * sizes).all() for d in apart):
            roots.append((x, slopes))
    names = [mechanism._of_driver(d, "q") for d in mechanism.drivers]
    of = {n: mechanism.outputs[n].unit for n in names}
    solutions = tuple(
        Solution(dict(zip(names, x.tolist(), strict=True)), of, slopes, mode)
        for x, slopes in sorted(roots, key=lambda pair: pair[0].tolist())
    )
    return Solutions(dict(wanted), units, solutions, f"it misses by {nearest:.3g} of the values")


def _reader(
    mechanism: Compiled, wanted: Mapping[str, float], how: Arguments
) -> tuple[Callable[[Floats], Floats], dict[str, str]]:
    """Misfits (k,) of wanted outputs at coordinates (k,), and their units."""
    parts = [number_of(mechanism, name) for name in wanted]
    outputs = [output for output, _ in parts]
    units = {n: mechanism.outputs[o].unit for n, o in zip(wanted, outputs, strict=True)}
    values = [*wanted.values()]

    def read(q: Floats) -> Floats:
        at = dict(zip(mechanism.drivers, q[:, None], strict=True))
        run = mechanism.run(at, want=outputs, on_gap="mark", **how)
        computed = [float(PART_OF[part](run[output])[0]) for output, part in parts]
        of = (mechanism.outputs[output] for output in outputs)
        return np.array([o.difference(x, y) for o, x, y in zip(of, computed, values, strict=True)])

    return read, units


def _of_numbers(
    mechanism: Compiled,
    wanted: Mapping[str, float],
    paths: Mapping[str, str],
    poses: Arguments,
    how: Arguments,
) -> Solutions:
    single = [name for name in wanted if not TEXT.fullmatch(name)]
    if single and np.size(next(iter(_columns(poses["at"])), ())) != 1:
        found, remedy = "an output by itself is wanted at one pose", "give at=, or a reduction"
        raise refused(single[0], found, f"{remedy} such as max_abs({single[0]})")
    labels = [f"mean({name})" if name in single else name for name in wanted]
    with_methods: Any = mechanism  # a `Mechanism`
    kept = with_methods.objective([*paths.values()], want=labels, **poses, **how)
    values, start = np.array([*wanted.values()]), kept.start
    sizes = np.where(start == 0, 1.0, np.abs(start))

    def read(x: Floats) -> Floats:
        return np.asarray(np.atleast_1d(kept(x)) - values)

    def jacobian(x: Floats) -> Floats:
        return np.atleast_2d(kept.jacobian(x))

    x, slopes, misfit = _solved(read, start, sizes, jacobian)
    known, names = parameters(mechanism), {path: name for name, path in paths.items()}
    of = {names.get(path, path): known[path].unit for path in kept.addresses}
    values_of = dict(zip(of, x.tolist(), strict=True))
    solutions = (Solution(values_of, of, slopes),) if misfit <= CLOSE else ()
    near = f"{places(values_of, of)} misses by {misfit:.3g} of the values"
    return Solutions(dict(wanted), {n: _unit(mechanism, n) for n in wanted}, solutions, near)


def _columns(at: Coordinates) -> Iterable[Numbers]:
    return at.values() if isinstance(at, Mapping) else () if at is None else (at,)


def _in_si(mechanism: Compiled, name: str, value: float | str) -> float:
    try:
        return float(in_si(value, _unit(mechanism, name)))
    except NoQuantity as error:
        raise refused(f"wanted[{name}]", error.found, "", error.valid) from None
    except (TypeError, ValueError):
        raise refused(f"wanted[{name}]", f"got {value!r:.60}", "give a number") from None


def _unit(mechanism: Compiled, name: str) -> str:
    reduced = TEXT.fullmatch(name)
    output, _ = parts_of(mechanism, reduced["output"].strip() if reduced else name)
    return mechanism.outputs[output].unit


def _solved(
    misfits: Callable[[Floats], Floats],
    start: Floats,
    sizes: Floats,
    jacobian: Callable[[Floats], Floats] | None = None,
) -> tuple[Floats, Floats, float]:
    """A zero of as many misfits as unknowns: where, dx/dy there, and the misfit left.

    The misfit is the step of Newton's method that is left, of the sizes of x: what is known of x.
    """
    from scipy.optimize import least_squares

    slopes: Any = jacobian or "3-point"
    if not np.isfinite(misfits(start)).all():
        return start, np.full((len(start),) * 2, math.nan), math.inf
    tight = {"xtol": EPS, "ftol": EPS, "gtol": EPS}
    try:
        end = least_squares(misfits, start, jac=slopes, x_scale=sizes, **tight)
        inverse = np.linalg.inv(end.jac)
    except (BlockmechError, ValueError):  # there are no slopes, or they are singular
        return start, np.full((len(start),) * 2, math.nan), math.inf
    x = end.x - inverse @ end.fun
    fun = misfits(x)
    if not (np.abs(fun) <= np.abs(end.fun)).all():
        x, fun = end.x, end.fun
    return x, inverse, float(np.max(np.abs(inverse @ fun) / sizes))
