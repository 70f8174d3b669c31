"""What the loads of a scene depend on: declarations of elements, and functions of a user.

Kinks are driver coordinates and times at which a load is not smooth: rows of tables, and the
half turn at which an angle that does not count turns jumps. Inside a panel or a step they
silently cost the order of a method, so panels and steps end there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from blockmech.couplings.laws import SHARES
from blockmech.dynamics.request import Pairs
from blockmech.dynamics.source import FRICTIONLESS, Source
from blockmech.engines.interpreters import AdaptiveEvaluator
from blockmech.functions.pieces import Function
from blockmech.functions.roots import SCANNED
from blockmech.ground.errors import refused
from blockmech.ground.plane import EPS
from blockmech.ground.tolerances import ROUNDING
from blockmech.loads.contract import VELOCITY_READS, Element, Following
from blockmech.model.structure import Structure
from blockmech.passes.forward import argument, coordinate_of
from blockmech.passes.homotopy import followed, path_of, schedule
from blockmech.passes.loads import kernel_on
from blockmech.plan.plan import Schedule
from blockmech.plan.values import Value
from blockmech.signals.functions import Python
from blockmech.typing import Real

RATE_READS = frozenset({*VELOCITY_READS, "qd"})
SAME = ROUNDING  # relative distance of two places or periods that are one: files have 12 digits
REACH = 8.0  # lengths of a mechanism on either side in which a slide has kinks and stops


def depends_on(structure: Structure) -> frozenset[str]:
    """What the loads depend on: "q" always, "rate" and "time" where declared."""
    variables = {"q"}
    for element in structure.elements.values():
        for reads in element.reads().values():
            variables |= {"rate"} if RATE_READS & set(reads) else set()
            variables |= {"time"} if "t" in reads else set()
    return frozenset(variables)


def lossless(structure: Structure) -> bool:
    """Whether every load has a potential that is the same in the same pose, as weights have."""
    return all(element.conservative for element in structure.elements.values())


def smooth(structure: Structure) -> bool:
    """Whether steps end at all kinks: they do at those in the only driver's place and in time.

    Nobody knows those of a user's function, nor looks for those of a rate.
    """
    alone = len(structure.drivers) == 1
    for element in structure.elements.values():
        law = _law(element)
        if isinstance(law, Function):
            return False
        rows = law is not None and law.rows()
        if rows and "time" not in law.variables() and ("rate" in law.variables() or not alone):
            return False
        if not alone and element.kinks() is not None:
            return False
    if any(isinstance(block, Python) for block in structure.signals.values()):
        return False
    return alone or not structure.followers


def largest_length(structure: Structure) -> float:
    """A length [m] over which things change: the largest that the blocks declare."""
    names = ("length", "l_i", "l_j")
    lengths = [
        float(getattr(block, name, 0.0) or 0.0)
        for block in structure.blocks.values()
        for name in names
    ]
    return max(lengths, default=0.0) or 1.0


def _law(element: Element) -> Any:
    return element.law if isinstance(element, Following) else None


# -- periods -------------------------------------------------------------------------------


def period_of(structure: Structure, driver: str) -> float | None:
    """Period [rad] of everything that depends on the coordinate; None if there is none."""
    turns = structure.turns(driver) if structure.driver_joint(driver).rotary else 0
    if not turns:
        return None
    if not all(path_of(structure, n).repeats for n in followed(structure)):
        return None
    for element in structure.elements.values():
        counted = element.counted
        if counted is None or (counted.driver in structure.drivers and counted.driver != driver):
            continue
        coupled_turns = _turns(counted.period) if counted.driver == driver and counted.period else 0
        if not coupled_turns:  # a coupled driver's coordinate counts, or nobody knows which one
            return None
        turns = math.lcm(turns, coupled_turns)
    return math.tau * turns if turns <= SHARES else None


def _turns(period: float) -> int:
    """Whole turns [-] after which a period fits; 0 if it never does."""
    ratio = period / math.tau
    if ratio >= 0.5:
        return round(ratio) if abs(ratio - round(ratio)) <= SAME * ratio else 0
    return 1 if abs(1 / ratio - round(1 / ratio)) <= SAME / ratio else 0


def time_periods(structure: Structure) -> list[float]:
    """Periods [s] of the loads that follow the time and tell one."""
    laws = (_law(element) for element in structure.elements.values())
    timed = (law for law in laws if law is not None and law.variables() == ("time",))
    return [law.whole for law in timed if law.whole]


# -- kinks ---------------------------------------------------------------------------------


def knots(compiled: Source) -> tuple[float, ...]:
    """Coordinates [rad or m] of the only driver at kinks: of one period from 0, or within reach."""
    structure, driver = compiled.structure, compiled.structure.drivers[0]
    period = period_of(structure, driver)
    span = math.tau if structure.driver_joint(driver).rotary else largest_length(structure)
    low, high = (0.0, period) if period else (-REACH * span, REACH * span)
    q = np.linspace(low, high, SCANNED * max(1, round((high - low) / span)) + 1)

    def planned() -> Schedule:
        return schedule(structure, compiled.scene, FRICTIONLESS)

    coordinates: list[float] = []
    for follower in structure.followers:
        s, levels = planned(), structure.coupling_of(follower).knots
        coordinates += _passings(s, s.ask(argument, follower), levels, q)
    for name, element in structure.elements.items():
        if element.counted is not None and isinstance(element, Following):
            counted, law = element.counted.driver, _law(element)
            if counted not in structure.followers:
                coordinates += law.within(low, high)
            elif law.rows():
                s = planned()
                coordinates += _passings(s, s.ask(coordinate_of, counted), law.within, q)
        elif kinks := element.kinks():
            s = planned()
            measure = kernel_on(s, name, kinks.measure, value="measure")
            coordinates += _passings(s, measure, lambda *_, x=kinks.values: x, q, kinks.turning)
    return tuple(sorted({x % period for x in coordinates} if period else set(coordinates)))


def _passings(
    s: Schedule,
    quantity: Value,
    levels: Callable[[float, float], Iterable[float]],
    q: Real,
    turning: bool = False,
) -> list[float]:
    """Driver coordinates at which a quantity passes levels in its range, between places q."""
    program = s.program([quantity])
    if program.inputs != ("q_0",):
        return []
    from scipy.optimize import brentq

    measure, coordinates = AdaptiveEvaluator(program), []
    values = np.asarray(measure.run({"q_0": q}, q.size)[0])
    if not np.isfinite(values).any():
        return []
    for level in levels(float(np.nanmin(values)), float(np.nanmax(values))):

        def above(x: float, level: float = level) -> float:
            d = float(measure.run({"q_0": [x]}, 1)[0][0]) - level
            return math.remainder(d, math.tau) if turning else d

        with np.errstate(all="ignore"):
            d = values - level
            if turning:
                d = np.remainder(d + math.pi, math.tau) - math.pi
            passed = (d[:-1] * d[1:] < 0) & ((np.abs(np.diff(d)) < math.pi) | (not turning))
        coordinates += [float(x) for x in q[d == 0]]
        for i in np.flatnonzero(passed).tolist():
            coordinates.append(float(brentq(above, q[i], q[i + 1], xtol=EPS, rtol=4 * EPS)))
    return coordinates


def next_time_kink(structure: Structure, t: float) -> float:
    """The first kink in time [s] after a time; infinite if there is none."""
    times = []
    for element in structure.elements.values():
        law = _law(element)
        if law is not None and law.variables() == ("time",):
            times.append(law.next_kink(t))
    return min(times, default=math.inf)


ELSEWHERE = 0.125  # [rad or m, per s, s] or of a signal: where they are evaluated besides


def user_functions(mechanism: Source) -> list[tuple[str, Function | Python, str]]:
    """Names, laws or blocks, and drivers of what functions of a user say."""
    structure = mechanism.structure
    loads = ((n, x) for n, x in structure.elements.items() if isinstance(x, Following))
    laws = ((n, x.law, x.driver or "") for n, x in loads if isinstance(x.law, Function))
    return [*laws, *((n, x, "") for n, x in structure.signals.items() if isinstance(x, Python))]


def refuse_memory(mechanism: Source, starts: Pairs) -> None:
    """Refuse functions of a user that answer the same question in two ways.

    A motion asks a law forth and back in time, and in several runs: what a function keeps from
    one call to the next would be of another run. Each is asked at the start, elsewhere, and at
    the start again.
    """
    first = next(iter(starts.values()), (0.0, 0.0))
    for name, law, driver in mechanism._once(user_functions):
        if isinstance(law, Function):
            at = starts.get(driver, first)
            variables = {"coordinate": at[0], "rate": at[1], "time": 0.0}
            inputs = [variables[x] for x in law.of]
        else:
            inputs = [law.memory.get(x, 0.0) for x in law.names]
        if not _same_again(law.call, inputs):
            fault = "its function gives another value when it is asked the same again"
            valid = "a law is a function of its arguments alone"
            remedy = "let a block signals.Python hold in its memory what it remembers"
            raise refused(name, fault, remedy, valid, "user-function")


def _same_again(call: Callable[..., ArrayLike], inputs: Sequence[float]) -> bool:
    """Whether a function gives the same twice, with another question in between."""
    answers = []
    with suppress(Exception):  # what it raises is reported where the motion calls it
        for step in (0.0, ELSEWHERE, 0.0):
            answers.append(np.asarray(call(*(x + step for x in inputs)), dtype=np.float64))
    return len(answers) < 3 or np.array_equal(answers[0], answers[2], equal_nan=True)
