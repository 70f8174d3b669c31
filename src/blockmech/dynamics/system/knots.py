"""Kinks of loads: driver coordinates and times at which a load is not smooth.

A kink inside a panel or a step silently costs the order of a method, so panels and steps
end there. Kinks are the rows of tables, and the half turn at which an angle that does not
count turns jumps.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from blockmech.dynamics.system.reduced import TURN
from blockmech.dynamics.system.split import FREE
from blockmech.engines import NumpyEngine, ScalarEngine
from blockmech.loads.contract import Element, Following
from blockmech.loads.laws import Constant, Fourier, Table
from blockmech.loads.motor import Motor
from blockmech.loads.torsion_spring import TorsionSpring, twist
from blockmech.model.structure import JointRef, Structure
from blockmech.passes.loads import element_parameters, readings, terminal_reading
from blockmech.plan import Schedule

GRID = 720  # samples of a period between which a crossing is looked for
MOST = 4000  # repetitions of a table of the time


def knots_of(
    structure: Structure, scene: Any, driver: str, period: float | None, span: float
) -> tuple[float, ...]:
    """Driver coordinates [rad or m] of kinks: of one period from 0, or within reach."""
    low, high = (0.0, period) if period else (-3 * span, 3 * span)
    found: list[float] = []
    for name, element in structure.elements.items():
        law = element.law if isinstance(element, Following) else None
        if law is not None and "coordinate" not in law.variables():
            continue
        if isinstance(element, Following) and element.driver is not None:
            if isinstance(law, Table):
                found += _repeated(law, low, high)
            continue
        measured = _measured(structure, scene, name, element)
        if measured is not None:
            found += _crossings(structure, measured, _breaks(element), _turning(element), low, high)
    if period:
        found = [x % period for x in found]
    return tuple(sorted(set(found)))


def time_knots_of(structure: Structure, latest: float) -> tuple[float, ...]:
    """Times [s] of kinks, up to the latest."""
    found: list[float] = []
    for element in structure.elements.values():
        law = element.law if isinstance(element, Following) else None
        if isinstance(law, Table) and law.variables() == ("time",):
            most = min(latest, MOST * law.whole) if law.whole else latest
            found += _repeated(law, 0.0, most)
    return tuple(sorted(set(found)))


def _repeated(law: Table, low: float, high: float) -> list[float]:
    """Arguments of a table, repeated as it repeats, from low to high."""
    numbers = law.numbers()
    rows = [float(numbers.start + x) for x in numbers.knots]
    if not law.whole:
        return [x for x in rows if low <= x <= high]
    first = math.floor((low - rows[-1]) / law.whole)
    last = math.ceil((high - rows[0]) / law.whole)
    return [
        y
        for k in range(first, last + 1)
        for x in rows[:-1]
        if low <= (y := x + k * law.whole) <= high
    ]


def _turning(element: Element) -> bool:
    """Whether what the law measures is an angle in (-pi, pi]."""
    return isinstance(element, Motor | TorsionSpring)


def _breaks(element: Element) -> list[float]:
    """Values of an element's own measure at which its load has a kink."""
    if isinstance(element, TorsionSpring):
        return [math.pi] if element.stiffness else []
    assert isinstance(element, Following)
    law = element.law
    if isinstance(law, Constant):
        return []
    whole_turn = isinstance(law, Table | Fourier) and law.turns == 1
    whole_turn |= isinstance(law, Fourier) and law.period is None and law.turns is None
    wrap = [math.pi] if _turning(element) and not whole_turn else []
    if not isinstance(law, Table):
        return wrap
    return [*_repeated(law, -math.pi, math.pi), *wrap] if _turning(element) else _rows(law)


def _rows(law: Table) -> list[float]:
    numbers = law.numbers()
    return [float(numbers.start + x) for x in numbers.knots]


def _measured(structure: Structure, scene: Any, name: str, element: Element) -> Any:
    """The program that gives an element's own measure; None where it has none with kinks."""
    if isinstance(element, TorsionSpring | Following):
        if not _breaks(element):
            return None
    else:
        return None
    s = Schedule(structure, scene, FREE)
    if isinstance(element, TorsionSpring):
        args = [s.ask(terminal_reading, JointRef(name, terminal), "e") for terminal in ("a", "b")]
        measure: Any = twist
    else:
        measure, reads = element.own_measure(rate=False)
        args = readings(s, name, reads)
    value = s.emit(measure, *args, s.ask(element_parameters, name), name="measure")
    return s.program([value])


def _crossings(
    structure: Structure,
    program: Any,
    breaks: Iterable[float],
    turning: bool,
    low: float,
    high: float,
) -> list[float]:
    """Driver coordinates in [low, high] at which a measure passes one of its breaks."""
    from scipy.optimize import brentq

    q = np.linspace(low, high, GRID * max(1, round((high - low) / TURN)) + 1)
    many, single = NumpyEngine(program), ScalarEngine(program)
    if program.inputs != ("q_0",):
        return []
    values = np.asarray(many.run({"q_0": q}, q.size)[0])
    found = []
    for level in breaks:

        def above(x: float, level: float = level) -> float:
            d = float(single.one([x])[0]) - level
            return math.remainder(d, TURN) if turning else d

        d = values - level
        if turning:
            d = np.remainder(d + math.pi, TURN) - math.pi
        with np.errstate(all="ignore"):
            crossed = (d[:-1] * d[1:] < 0) & ((np.abs(d[1:] - d[:-1]) < math.pi) | (not turning))
        found += [float(x) for x in q[d == 0]]
        for i in np.flatnonzero(crossed).tolist():
            found.append(float(brentq(above, q[i], q[i + 1], xtol=1e-15, rtol=1e-15)))
    return found
