"""One placer a dyad: from the places of its ends to parameters and places of its links.

A placer ``(chance, least_margin, end, end)`` gets the place and direction of what its outer
joints are wired to, and gives the block's parameters and the pose of its links, or None
where the ends leave no good one.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from blockmech.testing.strategies import Chance

Spot = tuple[complex, complex]
Placed = tuple[dict[str, Any], dict[str, Spot]] | None

OWNERS = ("later", "later", "earlier")  # of a slider's point


def _rrr(chance: Chance, least: float, B: Spot, D: Spot) -> Placed:
    b, d = B[0], D[0]
    side = chance.pick((-1, 1))
    c = b + (d - b) * complex(chance.uniform(-0.3, 1.3), side * chance.uniform(0.2, 2.0))
    u, w = c - b, c - d
    if abs(d - b) < 0.1 or _sine2(u, w) < least:
        return None
    numbers = {"l_i": abs(u), "l_j": abs(w), "branch": side}
    return numbers, {"i": (b, u / abs(u)), "j": (d, w / abs(w))}


def _rrp(chance: Chance, least: float, B: Spot, S: Spot) -> Placed:
    b, (g, u) = B[0], S
    h, x = chance.uniform(-0.4, 0.4), chance.uniform(-1.5, 1.5)
    c = g + x * u - 1j * u * h
    w = c - b
    along = (w * u.conjugate()).real
    if abs(w) < 0.1 or (along / abs(w)) ** 2 < least:
        return None
    numbers: dict[str, Any] = {"l": abs(w), "h": h, "branch": 1 if along > 0 else -1}
    numbers |= {"x_S": chance.uniform(-0.3, 0.3), "slider": chance.pick(OWNERS)}
    return numbers, {"i": (b, w / abs(w)), "j": (c, u)}


def _rpr(chance: Chance, least: float, B: Spot, D: Spot) -> Placed:
    b, d = B[0], D[0]
    u = cmath.rect(1.0, chance.uniform(-math.pi, math.pi))
    s, h = ((d - b) * u.conjugate()).real, ((d - b) * u.conjugate()).imag
    if abs(d - b) < 0.1 or (s / abs(d - b)) ** 2 < least:
        return None
    h_j = chance.uniform(-0.4, 0.4)
    numbers: dict[str, Any] = {"h_i": h + h_j, "h_j": h_j, "branch": 1 if s > 0 else -1}
    numbers |= {"x_S": chance.uniform(-0.3, 0.3), "slider": chance.pick(OWNERS)}
    return numbers, {"i": (b, u), "j": (d, u)}


def _prp(chance: Chance, least: float, S1: Spot, S2: Spot) -> Placed:
    (g1, u1), (g2, u2) = S1, S2
    if _sine2(u1, u2) < least:
        return None
    h1, h2 = chance.uniform(-0.4, 0.4), chance.uniform(-0.4, 0.4)
    base1, base2 = g1 - 1j * u1 * h1, g2 - 1j * u2 * h2
    x = _cross(base2 - base1, u2) / _cross(u1, u2)
    c = base1 + x * u1
    if abs(c) > 20:
        return None
    numbers: dict[str, Any] = {"h1": h1, "h2": h2}
    numbers |= {n: chance.uniform(-0.3, 0.3) for n in ("x_S1", "x_S2")}
    numbers["slider"] = {n: chance.pick(OWNERS) for n in ("S1", "S2")}
    return numbers, {"i": (c, u1), "j": (c, u2)}


def _rpp(chance: Chance, least: float, B: Spot, S: Spot) -> Placed:
    b, (g, u2) = B[0], S
    beta = chance.uniform(0.3, 2.8) * chance.pick((-1, 1))
    if math.sin(beta) ** 2 < least:
        return None
    u1 = u2 * cmath.rect(1.0, beta)
    h_i, h_j = chance.uniform(-0.4, 0.4), chance.uniform(-0.4, 0.4)
    n1 = 1j * u1
    x = (((b - g) * n1.conjugate()).real + h_i - h_j) / _cross(u1, u2)
    numbers: dict[str, Any] = {"beta": beta, "h_i": h_i, "h_j": h_j}
    numbers |= {n: chance.uniform(-0.3, 0.3) for n in ("x_S1", "x_S")}
    numbers["slider"] = {n: chance.pick(OWNERS) for n in ("S1", "S")}
    return numbers, {"i": (b, u1), "j": (g + x * u2, u2)}


def _cross(a: complex, b: complex) -> float:
    return (a.conjugate() * b).imag


def _sine2(a: complex, b: complex) -> float:
    return (_cross(a, b) / (abs(a) * abs(b))) ** 2


PLACERS: dict[str, Callable[..., Placed]] = {
    "dyad.rrr": _rrr,
    "dyad.rrp": _rrp,
    "dyad.rpr": _rpr,
    "dyad.prp": _prp,
    "dyad.rpp": _rpp,
}
"""Block type -> how one is placed at random."""
