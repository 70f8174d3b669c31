"""Loads of the time that repeat: their common period."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from blockmech.dynamics.contacts import SETTLED
from blockmech.ground.errors import RequestError, refused
from blockmech.loads.contract import Following
from blockmech.loads.functions import Function
from blockmech.loads.laws import Polynomial
from blockmech.model.structure import Structure

COMMON = 1000  # periods of one load in the common one at most
TIMED = 'ask for "time=<s>" to see how it goes on'
ELSEWHERE = f"start elsewhere, or {TIMED}"
GIVE = 'give the period of the loads: "steady=<s>"'


def no_steady(why: str, remedy: str = TIMED) -> RequestError:
    """The error that says why there is no steady state, or why none was found."""
    return refused("until", f'"steady": {why}', remedy, code="until")


def forcing_period(structure: Structure, declared: float) -> float:
    """The shortest time [s] after which all loads of the time repeat.

    ``declared`` [s] is the period that the user names for loads whose law does not tell it.
    """
    common, first = declared, "steady"
    for name, element in structure.elements.items():
        law: Any = element.law if isinstance(element, Following) else None
        if law is None or "time" not in law.variables():
            continue
        if isinstance(law, Polynomial) and not any(law.coefficients[1:]):
            continue
        if period := getattr(law, "whole", 0.0):
            common, first = _common(common, first, float(period), name), name
        elif not isinstance(law, Function):
            raise no_steady(f"the load {name} follows the time and does not repeat")
        elif not declared:
            raise no_steady(f"the load {name} follows the time by a law that tells no period", GIVE)
    if not common:
        raise no_steady("the loads follow the time, and their period is not known", GIVE)
    return common


def _common(period: float, name: str, second: float, second_name: str) -> float:
    """The least common multiple of two periods [s]; the first may be 0: not known."""
    ratio = Fraction(second / period if period else 1.0).limit_denominator(COMMON)
    is_common = 0 < ratio.numerator <= COMMON
    is_common &= abs(float(ratio) * period / second - 1) <= SETTLED
    if period and not is_common:
        raise no_steady(
            f"the loads {name} and {second_name} repeat after {period:.9g} s and {second:.9g} s, "
            "which have no common multiple, so nothing repeats"
        )
    return period * ratio.numerator or second
