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
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np

from blockmech.ground.plane import cross, dot
from blockmech.typing import Array, Complex, Floats, Guide, Planars, Reals, Vectors

LegKind: TypeAlias = Literal["RR", "RP", "PR"]
Support: TypeAlias = Complex | Guide
"""Where an earlier link holds a leg: a pivot [m], or a `Guide` (leg PR); or (n,) of them."""


class Triad(NamedTuple):
    """A platform and its three legs; numbers of legs are (3,), or (n, 3) for n triads.

    kinds : letters of each leg's outer pair and of its pair at the platform
    pins : places [m] of the pins, or of points of the guide lines (RP), on the platform
    reaches : lengths l (RR), or offsets h from the guide (RP, PR) to the left of it [m]
    alongs : unit directions of the guides on the platform (RP)
    """

    kinds: Sequence[LegKind]
    pins: Vectors | Planars
    reaches: Floats | Reals
    alongs: Vectors | Planars = (1, 1, 1)

    @classmethod
    def rrr(cls, lengths: Floats | Reals, pins: Vectors | Planars) -> Triad:
        """Legs of given lengths [m] at pins [m] of the platform."""
        return cls(("RR", "RR", "RR"), pins, lengths)


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
        arrays = (self.kinds, pins, reaches, alongs, pivots, guides, centres)
        return Placed(*arrays, self.size, self.origin)

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

    Lengths are measured by the largest one at the first place, or as in ``like``.
    """
    pins, reaches, alongs = (_three_columns(x, n) for x in triad[1:])
    guided = [isinstance(s, Guide) for s in supports]
    pivots = _three_columns([s.p if g else s for s, g in zip(supports, guided, strict=True)], n)
    guides = _three_columns([s.u if g else 1 for s, g in zip(supports, guided, strict=True)], n)
    centres = pins.mean(axis=1)
    pins = pins - centres[:, None]
    if like is None:
        origin = complex(pivots[0, 0])
        size = max(float(np.abs(x[0]).max()) for x in (pivots - origin, pins, reaches))
    else:
        size, origin = like.size, like.origin
    kinds = tuple(triad.kinds)
    pins, reaches, pivots = pins / size, reaches / size, (pivots - origin) / size
    return Placed(kinds, pins, reaches, alongs, pivots, guides, centres, size, origin)


def _three_columns(numbers: Array | Planars, n: int) -> Array:
    """Three numbers, three arrays (n,) of them, or one (n, 3), as an array (n, 3)."""
    if isinstance(numbers, np.ndarray) and numbers.ndim == 2:
        return numbers
    return np.stack([np.broadcast_to(x, n) for x in numbers], axis=-1)
