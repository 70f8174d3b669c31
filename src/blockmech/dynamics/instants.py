"""What acts at an instant of a motion: loads, accelerations, stops, and friction of pairs.

The terms of M q'' = push + S^T t and F = f + G q'' + R t, see `sticking`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from blockmech.dynamics.contacts import DEPENDENT, Held
from blockmech.friction.continuation import Outcome
from blockmech.result.motion import Floats


class Contact(NamedTuple):
    """What stops that something lies against leave free: q'' = basis z'' + shift; see `Held`.

    Their pushes are an affine function of z'' and of the friction of the pairs. Drivers that are
    not free stand among them.
    """

    basis: Floats  # (..., k, z)
    shift: Floats  # (..., k)
    push: Floats  # (..., a)
    of_z: Floats  # (..., a, z)
    of_t: Floats  # (..., a, m)
    carried: Any = 0.0  # (..., k) rates that drivers have which are not free


class Instant(NamedTuple):
    """What loads, accelerations and friction do at a state, or at n of them (leading axis).

    From M on it is about the z freedoms that stops leave, of the k: all, where nothing lies
    against one (``contact`` None).
    """

    q: Floats  # (..., k)
    rate: Floats  # (..., k)
    M: Floats  # (..., z, z)
    push: Floats  # (..., z) efforts of the loads, less what the rates take
    S: Floats  # (..., m, z) relative rate of a pair per rate of a freedom
    b: Floats  # (..., m) relative acceleration without any of the freedoms'
    w: Floats  # (..., m) relative rate
    f: Any  # (..., m) loads on the pairs without accelerations of freedoms and without friction
    G: Any  # (..., m, z)
    R: Any  # (..., m, m)
    law: Floats  # (..., 2 m) factors and drags at these rates
    margin: Any
    contact: Contact | None = None
    carried: Any = 0.0  # (..., m) relative rates by drivers that are not free

    def against(self, held: Held, loads: Any, lasting: bool = True) -> Instant:
        """The same while it lies against stops, of which a unit push adds ``loads`` (..., m, a).

        ``lasting`` : pairs that stops alone leave no freedom do not move; in a blow they may
        """
        Z, shift, back = held.free()
        at_shift = self.push - (self.M @ shift[..., None])[..., 0]
        push = -(back @ at_shift[..., None])[..., 0]
        of_z, of_t = back @ self.M @ Z, -back @ np.swapaxes(self.S, -1, -2)
        G, turned = self.G + loads @ back @ self.M, np.swapaxes(Z, -1, -2)
        shifted = (self.G @ shift[..., None] + loads @ push[..., None])[..., 0]
        S, b = self.S @ Z, self.b + (self.S @ shift[..., None])[..., 0]
        tied = np.abs(S).max(axis=-1, initial=0.0) <= DEPENDENT * np.abs(self.S).max(axis=-1)
        still = tied & lasting
        rates: Any = 0.0
        carried: Any = 0.0
        if held.speeds is not None:
            rates = (np.swapaxes(back, -1, -2) @ held.speeds[..., None])[..., 0]
            carried = (self.S @ rates[..., None])[..., 0]
            size = np.abs(self.b) + (np.abs(self.S) @ np.abs(shift)[..., None])[..., 0]
            still &= np.abs(b) <= DEPENDENT * size  # a law moves those that it alone moves
        return self._replace(
            M=turned @ self.M @ Z,
            push=(turned @ at_shift[..., None])[..., 0],
            S=np.where(tied[..., None], 0.0, S),
            b=np.where(still, 0.0, b),
            f=self.f + shifted,
            G=G @ Z,
            R=self.R + loads @ of_t,
            contact=Contact(Z, shift, push, of_z, of_t, rates),
            carried=carried,
        )

    def part(self, which: Any) -> Instant:
        """That at one of n states, or those at some, where it lies against nothing."""
        return Instant._make([*(x[which] for x in self[:-3]), self.margin, None, 0.0])

    @property
    def freedoms(self) -> Floats:
        """Rates (..., z) of what is free."""
        if self.contact is None:
            return self.rate
        return (np.swapaxes(self.contact.basis, -1, -2) @ self.rate[..., None])[..., 0]

    @property
    def unheld(self) -> Floats:
        """Accelerations (z,) by the loads alone."""
        return np.asarray(np.linalg.inv(self.M) @ self.push)

    def of_drivers(self, x: Floats, shifted: bool = True) -> Floats:
        """Accelerations (..., k) of the drivers by those of what is free, or rates."""
        if self.contact is None:
            return x
        of_q = (self.contact.basis @ x[..., None])[..., 0]
        return of_q + (self.contact.shift if shifted else self.contact.carried)

    def pushes(self, response: Response) -> Floats:
        """What stops that it lies against give [N m or N] (..., a)."""
        if self.contact is None:
            return np.zeros((*self.push.shape[:-1], 0))
        push, of_z, of_t = self.contact[2:5]
        more = of_z @ response.qdd[..., None] + of_t @ response.t[..., None]
        return np.asarray(push + more[..., 0])

    def norms(self, loads: Any, guides: Sequence[bool]) -> Floats:
        """Loads (..., m) as friction is of them [N]."""
        larger = np.maximum(np.abs(loads.real), np.abs(loads.imag))
        return np.asarray(np.where(guides, larger, np.abs(loads)))


class Response(NamedTuple):
    """Accelerations and friction at an instant, for some sides."""

    qdd: Floats  # (..., z) of what is free
    t: Floats  # (..., m)
    loads: Any  # (..., m)
    outcome: Any = 0.0
    misfit: Any = 0.0

    @property
    def solved(self) -> bool:
        """Whether it satisfies the laws, of one instant."""
        code = float(self.outcome)
        return code == code and Outcome(int(code)).solved
