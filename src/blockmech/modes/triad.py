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

Everything is computed for n triads at once, in lengths of one size about one place.
Source: [M96] Merlet, Direct kinematics of planar parallel manipulators, ICRA 1996.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from blockmech.errors import Problem, RequestError
from blockmech.plane import cross, dot
from blockmech.typing import Guide

LegKind: TypeAlias = Literal["RR", "RP", "PR"]
Floats: TypeAlias = NDArray[np.float64]
Vectors: TypeAlias = NDArray[np.complex128]
Support: TypeAlias = Any
"""Where an earlier link holds a leg: a pivot [m], or a `Guide` (leg PR); or (n,) of them."""


@dataclass(frozen=True)
class Leg:
    """One leg of a triad, as the platform sees it; each number may be an array (n,).

    Attributes
    ----------
    kind : letters of the outer pair and of the pair at the platform
    pin : place [m] of the pin, or of a point of the guide line (RP), on the platform
    reach : length l (RR), or offset h of the guide (RP, PR) to the left of its direction [m]
    along : unit direction of the guide on the platform (RP)
    """

    kind: LegKind
    pin: Any
    reach: Any
    along: Any = 1.0 + 0j

    def problems(self, where: str) -> list[Problem]:
        """What is wrong with the leg's numbers."""
        if not all(map(_finite, (self.pin, self.reach, self.along))):
            found = f"its numbers must be finite, got {self}"
        elif self.kind == "RR" and not np.all(np.asarray(self.reach) > 0):
            found = f"its length must be positive, got {self.reach}"
        else:
            return []
        return [Problem("bad-triad", where, found)]


@dataclass(frozen=True)
class Triad:
    """A platform and its three legs.

    >>> Triad.rrr(lengths=(2, 2, 2), pins=(0, 1, 0.5 + 1j)).legs[1]
    Leg(kind='RR', pin=1, reach=2, along=(1+0j))
    """

    legs: tuple[Leg, ...]

    def __post_init__(self) -> None:
        problems = [p for n, leg in enumerate(self.legs, 1) for p in leg.problems(f"leg {n}")]
        if len(self.legs) != 3:
            problems.append(Problem("bad-triad", "legs", f"a triad has 3, got {len(self.legs)}"))
        elif not problems and all(leg.kind != "RP" for leg in self.legs):
            first, *others = (leg.pin for leg in self.legs)
            if np.any(np.all([np.equal(first, pin) for pin in others], axis=0)):
                found = "all three pins coincide, so the platform can turn about them"
                remedy = "give it pins at two places at least"
                problems.append(Problem("bad-triad", "platform", found, "", remedy))
        if problems:
            raise RequestError(problems)

    @classmethod
    def rrr(cls, lengths: Sequence[Any], pins: Sequence[Any]) -> Triad:
        """Legs of given lengths [m] at pins [m] of the platform.

        Raises `RequestError` for a wrong number of legs, for lengths that are not
        positive, and for three pins at one place.
        """
        if len(lengths) != 3 or len(pins) != 3:
            found = f"got {len(lengths)} lengths and {len(pins)} pins"
            raise RequestError(Problem("bad-triad", "legs", found, "a triad has 3 legs"))
        return cls(tuple(Leg("RR", p, l) for p, l in zip(pins, lengths, strict=True)))


class Placed(NamedTuple):
    """n triads held by earlier links, in lengths of one size about one place.

    ``o`` of a pose in these numbers is the place of the platform's centre, the middle of
    its pins.
    """

    kinds: tuple[LegKind, ...]
    pins: Vectors  # (n, 3) about the platform's centre
    reaches: Floats  # (n, 3)
    alongs: Vectors  # (n, 3)
    pivots: Vectors  # (n, 3)
    guides: Vectors  # (n, 3) unit directions of earlier guides (PR)
    centres: Vectors  # (n,) [m] of the platform, in its own frame
    size: float  # [m]
    origin: complex  # [m]

    def rows(self, index: Any) -> Placed:
        """Some of the triads."""
        pins, reaches, alongs, pivots, guides, centres = (x[index] for x in self[1:7])
        own = (self.kinds, pins, reaches, alongs, pivots, guides, centres)
        return Placed(*own, self.size, self.origin)

    def pose(self, x: Floats) -> tuple[Vectors, Vectors]:
        """Origins (n,) [m] and directions (n,) of the platform's own frame, from x (n, 3)."""
        e = np.exp(1j * x[:, 2])
        return self.origin + self.size * (x[:, 0] + 1j * x[:, 1]) - e * self.centres, e

    def conditions(self, x: Floats) -> tuple[Floats, Floats]:
        """The conditions (n, 3) and their rates (n, 3, 3) by x (n, 3): centre and angle."""
        o, e = x[:, 0] + 1j * x[:, 1], np.exp(1j * x[:, 2])
        f, rows = np.empty((len(x), 3)), np.empty((len(x), 3, 3))
        for k, kind in enumerate(self.kinds):
            arm, reach = e * self.pins[:, k], self.reaches[:, k]
            at, away = arm, o + arm - self.pivots[:, k]
            if kind == "RR":
                r, force = np.abs(away), away / reach
                f[:, k] = (r - reach) * ((r + reach) / (2 * reach))
            elif kind == "PR":
                force = 1j * self.guides[:, k]
                f[:, k] = dot(force, away) - reach
            else:
                force, at = -1j * e * self.alongs[:, k], self.pivots[:, k] - o
                f[:, k] = dot(force, away) - reach
            rows[:, k] = np.stack([force.real, force.imag, cross(at, force)], axis=-1)
        return f, rows


def placed(
    triad: Triad, supports: Sequence[Support], like: Placed | None = None, n: int = 1
) -> Placed:
    """Hold a triad at three supports, one a leg, in n places.

    Lengths are measured by the largest one at the middle of these places, or as in ``like``.

    Raises `RequestError` if a support does not fit its leg, is not finite where the
    triad is measured, or if all pivots coincide.
    """
    if len(supports) != 3:
        found = f"a triad has 3 legs, got {len(supports)} supports"
        raise RequestError(Problem("bad-triad", "supports", found))
    problems = []
    for k, (leg, support) in enumerate(zip(triad.legs, supports, strict=True), start=1):
        if isinstance(support, Guide) != (leg.kind == "PR"):
            what = "a guide" if leg.kind == "PR" else "a place"
            problems.append(Problem("bad-triad", f"support {k}", f"leg {leg.kind} needs {what}"))
        elif n == 1 and not all(map(_finite, place_of(support))):
            problems.append(Problem("bad-triad", f"support {k}", f"it is not finite: {support}"))
    if problems:
        raise RequestError(problems)
    pins, reaches, alongs = (
        _columns((getattr(leg, name) for leg in triad.legs), n)
        for name in ("pin", "reach", "along")
    )
    pivots, guides = (_columns(row, n) for row in zip(*map(place_of, supports), strict=True))
    centres = pins.mean(axis=1)
    pins = pins - centres[:, None]
    if like is None:
        if "PR" not in (leg.kind for leg in triad.legs) and not np.ptp(pivots[n // 2]):
            found = "all three pivots coincide, so the triad can turn about them"
            raise RequestError(Problem("bad-triad", "supports", found))
        origin = complex(pivots[n // 2, 0])
        size = max(float(np.abs(x[n // 2]).max()) for x in (pivots - origin, pins, reaches))
    else:
        size, origin = like.size, like.origin
    return Placed(
        tuple(leg.kind for leg in triad.legs),
        pins / size,
        reaches.real / size,
        alongs,
        (pivots - origin) / size,
        guides,
        centres,
        size,
        origin,
    )


def place_of(support: Support) -> tuple[Any, Any]:
    """Place [m] and direction of a support; a pivot has the direction 1."""
    return tuple(support) if isinstance(support, Guide) else (support, 1 + 0j)


def _columns(numbers: Any, n: int) -> Vectors:
    """Three numbers, or three arrays (n,) of them, as an array (n, 3)."""
    return np.stack([np.broadcast_to(np.asarray(x, complex), n) for x in numbers], axis=-1)


def _finite(numbers: Any) -> bool:
    return bool(np.isfinite(numbers).all())
