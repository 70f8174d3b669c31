"""The common period of all loads that follow the time."""

from __future__ import annotations

import math
from collections.abc import Iterable
from fractions import Fraction
from typing import Any

import numpy as np

from blockmech.dynamics.integration.equation import Equation
from blockmech.dynamics.steady.outcome import no_steady
from blockmech.loads.contract import Following
from blockmech.loads.laws import Polynomial
from blockmech.model.structure import Structure

SAME = 1e-9  # relative distance within which two periods fit into one another
MOST = 1000  # periods of one load in the common one
AGREES = 1e-9  # relative difference of the accelerations one period later that is rounding
PROBES = (0.0, 0.137, 0.391, 0.618, 0.853)  # of a period, at which that is looked at
GIVE = 'give the period of the loads: "steady=<s>"'


def forcing_period(structure: Structure, given: float) -> float:
    """The shortest time [s] after which all loads of the time repeat.

    ``given`` [s] is the period that the user names for loads whose law does not tell it
    (functions); 0 if none is named.

    Raises `RequestError` where a load never repeats, does not tell its period, or two
    periods have no common multiple.
    """
    periods: dict[str, float] = {"steady": given} if given else {}
    for name, element in structure.elements.items():
        law: Any = getattr(element, "law", None) if isinstance(element, Following) else None
        if law is None or "time" not in law.variables():
            if law is None and "t" in _reads(element):
                _untold(name, given)
            continue
        if isinstance(law, Polynomial) and not any(law.coefficients[1:]):
            continue
        whole = getattr(law, "whole", None)
        if whole:
            periods[name] = float(whole)
        elif whole is None and not isinstance(law, Polynomial):
            _untold(name, given)
        else:
            raise no_steady(f"the load {name} follows the time and does not repeat")
    return _common(periods)


def _reads(element: Any) -> set[str]:
    return {what for reads in element.reads().values() for what in reads}


def _untold(name: str, given: float) -> None:
    if not given:
        raise no_steady(f"the load {name} follows the time by a law that tells no period", GIVE)


def _common(periods: dict[str, float]) -> float:
    """The least common multiple of periods by the names of their loads; 0 of none."""
    whole, first = 0.0, ""
    for name, period in periods.items():
        if not whole:
            whole, first = period, name
            continue
        ratio = Fraction(period / whole).limit_denominator(MOST)
        fits = ratio > 0 and abs(float(ratio) * whole / period - 1) <= SAME
        if not fits or ratio.numerator > MOST:
            raise no_steady(
                f"the loads {first} and {name} repeat after {whole:.9g} s and {period:.9g} s, "
                "which have no common multiple, so nothing repeats"
            )
        whole *= ratio.numerator
    return whole


def repeats(equation: Equation, states: Iterable[Any], t0: float, period: float) -> bool:
    """Whether the loads really are the same a period later; looked at in a few states."""
    k = equation.drivers
    for y in states:
        for share in PROBES:
            t = t0 + share * period
            here, later = (
                np.asarray(equation.rhs(at, y), dtype=np.float64)[k : 2 * k]
                for at in (t, t + period)
            )
            size = float(np.abs(here).max() + np.abs(later).max())
            if math.isfinite(size) and not np.abs(later - here).max() <= AGREES * (size + 1e-9):
                return False
    return True
