r"""The triad: a platform on three legs (class III, third order), its conditions and their rates.

              P3          platform   one link with three pins (or guides) P1, P2, P3
             /  \         legs       a link each, from the platform to an earlier link
           P1----P2
           |      \       leg RR: pin on the platform at the distance l from the pivot G
          G1       G2     leg RP: pivot G at the offset h from a guide line of the platform
                          leg PR: pin of the platform at the offset h from an earlier guide

The letters of a leg are those of its outer and of its platform pair. Given where the
earlier links hold the legs, the platform's origin o and its unit direction e have three
conditions, one a leg:

    RR  |o + e P - G| = l      RP  cross(e d, G - o - e P) = h      PR  cross(u, o + e P - G) = h

Their rows of rates are the unit forces that the legs can exert, so their determinant
is zero where the three lines of action meet in a point or are parallel: a dead centre.

Everything is computed in lengths of the triad's own size, about its first pivot.
Source: [M96] Merlet, Direct kinematics of planar parallel manipulators, ICRA 1996.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from blockmech.errors import Problem, RequestError
from blockmech.plane import cross, dot, expi
from blockmech.typing import Guide

LegKind: TypeAlias = Literal["RR", "RP", "PR"]
Support: TypeAlias = complex | Guide
"""Where an earlier link holds a leg: a pivot [m], or a guide (leg PR)."""

Floats: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True)
class Leg:
    """One leg of a triad, as the platform sees it. Made by `rr`, `rp` or `pr`.

    Attributes
    ----------
    kind : letters of the outer pair and of the pair at the platform
    pin : place [m] of the pin, or of a point of the guide line (RP), on the platform
    reach : length l (RR), or offset h of the guide (RP, PR) [m]
    along : unit direction of the guide on the platform (RP)
    """

    kind: LegKind
    pin: complex
    reach: float
    along: complex = 1.0 + 0j

    @classmethod
    def rr(cls, pin: complex, length: float) -> Leg:
        """A link of a length [m] with a pin at both ends."""
        return cls("RR", complex(pin), float(length))

    @classmethod
    def rp(cls, pin: complex, along: complex, offset: float = 0.0) -> Leg:
        """A link on a pivot that slides along a guide of the platform.

        ``offset`` [m] is that of the pivot from the guide line, to the left of ``along``.
        """
        return cls("RP", complex(pin), float(offset), complex(along) / (abs(along) or math.nan))

    @classmethod
    def pr(cls, pin: complex, offset: float = 0.0) -> Leg:
        """A slider on an earlier guide that carries a pin of the platform.

        ``offset`` [m] is that of the pin from the guide line, to the left of its direction.
        """
        return cls("PR", complex(pin), float(offset))


@dataclass(frozen=True)
class Triad:
    """A platform and its three legs.

    >>> Triad.rrr(lengths=(2, 2, 2), pins=(0, 1, 0.5 + 1j)).legs[1]
    Leg(kind='RR', pin=(1+0j), reach=2.0, along=(1+0j))
    """

    legs: tuple[Leg, Leg, Leg]

    def __post_init__(self) -> None:
        problems = [p for n, leg in enumerate(self.legs) for p in _wrong_leg(leg, f"leg {n + 1}")]
        if len(self.legs) != 3:
            problems.append(Problem("bad-triad", "legs", f"a triad has 3, got {len(self.legs)}"))
        elif not problems and _spins(self.legs):
            problems.append(
                Problem(
                    "bad-triad",
                    "platform",
                    "all three pins coincide, so the platform can turn about them",
                    "",
                    "give it pins at two places at least",
                )
            )
        if problems:
            raise RequestError(problems)

    @classmethod
    def rrr(cls, lengths: Sequence[float], pins: Sequence[complex]) -> Triad:
        """Legs of given lengths [m] at pins [m] of the platform.

        Raises `RequestError` for a wrong number of legs, for lengths that are not
        positive, and for three pins at one place.
        """
        if len(lengths) != 3 or len(pins) != 3:
            found = f"got {len(lengths)} lengths and {len(pins)} pins"
            raise RequestError(Problem("bad-triad", "legs", found, "a triad has 3 legs"))
        one, two, three = (Leg.rr(p, l) for p, l in zip(pins, lengths, strict=True))
        return cls((one, two, three))

    def mirrored(self) -> Triad:
        """The triad's mirror image."""
        one, two, three = (
            Leg(
                leg.kind,
                leg.pin.conjugate(),
                leg.reach if leg.kind == "RR" else -leg.reach,
                leg.along.conjugate(),
            )
            for leg in self.legs
        )
        return Triad((one, two, three))


class Placed(NamedTuple):
    """A triad held by earlier links, in lengths of its own size about its first pivot.

    ``o`` of a pose in these numbers is the place of the platform's centre, the middle of
    its pins.
    """

    kinds: tuple[LegKind, ...]
    pins: tuple[complex, ...]  # about the platform's centre
    reaches: tuple[float, ...]
    alongs: tuple[complex, ...]
    pivots: tuple[complex, ...]
    guides: tuple[complex, ...]  # unit directions of earlier guides (PR)
    size: float  # [m]
    origin: complex  # [m] the first pivot
    centre: complex  # [m] of the platform, in its own frame

    def pose(self, x: Floats) -> tuple[complex, complex]:
        """Origin [m] and direction of the platform's own frame, from x = (o, angle)."""
        e = expi(float(x[2]))
        return self.origin + self.size * complex(x[0], x[1]) - e * self.centre, e

    def coordinates(self, o: complex, e: complex) -> Floats:
        """The inverse of `pose`; the angle is in (-pi, pi]."""
        place = (o + e * self.centre - self.origin) / self.size
        return np.array([place.real, place.imag, cmath.phase(e)])

    def conditions(self, x: Floats) -> tuple[Floats, Floats]:
        """The three conditions (3,) and their rates (3, 3) by x = (o, angle)."""
        o, e = complex(x[0], x[1]), expi(float(x[2]))
        f, rows = np.empty(3), np.empty((3, 3))
        for k, kind in enumerate(self.kinds):
            arm, reach = e * self.pins[k], self.reaches[k]
            if kind == "RR":
                u = o + arm - self.pivots[k]
                r = abs(u)
                f[k] = (r - reach) * ((r + reach) / (2 * reach))
                force, at = u / reach, arm
            elif kind == "PR":
                force, at = 1j * self.guides[k], arm
                f[k] = dot(force, o + arm - self.pivots[k]) - reach
            else:
                normal = 1j * e * self.alongs[k]
                f[k] = dot(normal, self.pivots[k] - o - arm) - reach
                force, at = -normal, self.pivots[k] - o
            rows[k] = force.real, force.imag, cross(at, force)
        return f, rows


def placed(triad: Triad, supports: Sequence[Support]) -> Placed:
    """Hold a triad at three supports, one a leg.

    Raises `RequestError` if a support does not fit its leg, is not finite, or if all
    pivots coincide.
    """
    problems = []
    if len(supports) != 3:
        raise RequestError(
            Problem("bad-triad", "supports", f"a triad has 3 legs, got {len(supports)} supports")
        )
    for n, (leg, support) in enumerate(zip(triad.legs, supports, strict=True), start=1):
        if isinstance(support, Guide) != (leg.kind == "PR"):
            what = "a guide" if leg.kind == "PR" else "a place"
            problems.append(Problem("bad-triad", f"support {n}", f"leg {leg.kind} needs {what}"))
        elif not all(map(cmath.isfinite, place_of(support))):
            problems.append(Problem("bad-triad", f"support {n}", f"it is not finite: {support}"))
    pivots = {place_of(s)[0] for s in supports}
    if not problems and len(pivots) == 1 and all(leg.kind != "PR" for leg in triad.legs):
        found = "all three pivots coincide, so the triad can turn about them"
        problems.append(Problem("bad-triad", "supports", found))
    if problems:
        raise RequestError(problems)
    return hold(triad, supports, place_of(supports[0])[0], size_of(triad, supports))


def size_of(triad: Triad, supports: Sequence[Support]) -> float:
    """The largest length [m] in a triad that is held."""
    pivots, pins = [place_of(s)[0] for s in supports], [leg.pin for leg in triad.legs]
    centre = sum(pins) / 3
    lengths = [abs(g - pivots[0]) for g in pivots] + [abs(p - centre) for p in pins]
    return max(*lengths, *(abs(leg.reach) for leg in triad.legs))


def hold(triad: Triad, supports: Sequence[Support], origin: complex, size: float) -> Placed:
    """The numbers of a triad that is held, about a place and in lengths of a given size [m]."""
    centre = sum(leg.pin for leg in triad.legs) / 3
    places = [place_of(s) for s in supports]
    return Placed(
        tuple(leg.kind for leg in triad.legs),
        tuple((leg.pin - centre) / size for leg in triad.legs),
        tuple(leg.reach / size for leg in triad.legs),
        tuple(leg.along for leg in triad.legs),
        tuple((p - origin) / size for p, _ in places),
        tuple(u for _, u in places),
        size,
        origin,
        centre,
    )


def place_of(support: Support) -> tuple[complex, complex]:
    """Place [m] and direction of a support; a pivot has the direction 1."""
    if isinstance(support, Guide):
        return complex(support.p), complex(support.u)
    return complex(support), 1 + 0j


def residual(triad: Triad, supports: Sequence[Support], o: complex, e: complex) -> float:
    """Largest miss of a leg's condition [-], relative to the triad's size, at a pose."""
    worst = 0.0
    for leg, support in zip(triad.legs, supports, strict=True):
        p, u = place_of(support)
        pin = o + e * leg.pin
        if leg.kind == "RR":
            miss = abs(pin - p) - leg.reach
        elif leg.kind == "PR":
            miss = cross(u, pin - p) - leg.reach
        else:
            miss = cross(e * leg.along, p - pin) - leg.reach
        worst = max(worst, abs(miss))
    return worst / size_of(triad, supports)


def _wrong_leg(leg: Leg, where: str) -> list[Problem]:
    found = []
    numbers = (leg.pin.real, leg.pin.imag, leg.reach, leg.along.real, leg.along.imag)
    if not all(map(math.isfinite, numbers)):
        found.append(Problem("bad-triad", where, f"its numbers must be finite, got {leg}"))
    elif leg.kind == "RR" and not leg.reach > 0:
        found.append(Problem("bad-triad", where, f"its length must be positive, got {leg.reach}"))
    return found


def _spins(legs: Sequence[Leg]) -> bool:
    """Whether all pins of the platform lie on each other."""
    return all(leg.kind != "RP" for leg in legs) and len({leg.pin for leg in legs}) == 1
