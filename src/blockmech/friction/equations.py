"""The friction equations of one sample, in homogeneous unknowns.

Friction is n / eta in the unknowns v = (n, eta, lambda), lambda a scale of all friction
factors, so reactions that go to infinity are an ordinary point:

    G_j(v) = n_j - lambda k_j | eta f_j + sum_m R_jm n_m |,     |n|^2 + eta^2 = 1

The load of a guide, max(|N|, 2 |C| / L), has kinks where its contact changes; between them
it is linear, and the contacts say along which of its sides.

Source: the homogeneous form is blockmech's own.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Equations:
    """The equations of one sample, scaled to unit loads and unit factors."""

    def __init__(
        self,
        k: Sequence[float],
        edges: Sequence[bool],
        base: Sequence[complex],
        rows: Sequence[Sequence[complex]],
    ) -> None:
        self.edges = np.array(edges)
        f = np.array([[z.real, z.imag] for z in base])
        R = np.array([[[z.real, z.imag] for z in row] for row in rows])
        self.load = float(np.abs(f).max()) or 1.0
        self.factor = float(np.abs(k).max()) or 1.0
        self.k = np.array(k) / self.factor
        self.f = f / self.load  # (m, 2)
        self.R = R * self.factor  # (m, m, 2)
        self.m = len(self.k)

    def loads(self, n: Array, eta: float) -> Array:
        """Loads (m, 2) on the pairs."""
        found: Array = eta * self.f + np.einsum("jmc,m->jc", self.R, n)
        return found

    def contacts(self, F: Array, growth: Array | None = None) -> Array:
        """Directions (m, 2) along which the guides are pressed: of +-N or of +-2 C / L.

        Where nothing presses yet, the direction in which the load grows. Rows of
        revolute pairs mean nothing.
        """
        empty: NDArray[np.bool_] = np.abs(F).max(axis=1) == 0
        if growth is not None:
            F = np.where(empty[:, None], growth, F)
        pick = np.abs(F).argmax(axis=1)
        found = np.zeros_like(F)
        found[np.arange(self.m), pick] = np.where(F[np.arange(self.m), pick] < 0, -1.0, 1.0)
        return found

    def spare(self, v: Array, contacts: Array) -> Array:
        """By how much each guide (m,) is pressed more as its contact says than otherwise.

        Negative where the contact has changed; infinite for revolute pairs.
        """
        along, across = self._pressed(v, contacts)
        return np.where(self.edges, along - np.maximum(np.abs(across), -along), np.inf)

    def switched(self, v: Array, contacts: Array) -> Array:
        """The contacts behind a kink: the guide with least to spare has changed its own."""
        along, across = self._pressed(v, contacts)
        j = int(np.argmin(self.spare(v, contacts)))
        x, y = contacts[j]
        found = contacts.copy()
        opposite = across[j] == 0.0 or -along[j] > abs(across[j])  # N changes its sign
        found[j] = (-x, -y) if opposite else np.sign(across[j]) * np.array((-y, x))
        return found

    def _pressed(self, v: Array, contacts: Array) -> tuple[Array, Array]:
        F = self.loads(v[:-2], v[-2])
        along: Array = np.einsum("jc,jc->j", contacts, F)
        return along, contacts[:, 0] * F[:, 1] - contacts[:, 1] * F[:, 0]

    def norm(self, n: Array, eta: float, contacts: Array) -> tuple[Array, Array]:
        """Load norms (m,) and their gradients (m, m + 1) in (n, eta), smooth in a contact."""
        F = self.loads(n, eta)
        size = np.hypot(F[:, 0], F[:, 1])
        unit = np.where(self.edges[:, None], contacts, F / np.maximum(size, 1e-300)[:, None])
        slope = np.empty((self.m, self.m + 1))
        slope[:, :-1] = np.einsum("jc,jmc->jm", unit, self.R)
        slope[:, -1] = np.einsum("jc,jc->j", unit, self.f)
        return np.where(self.edges, np.einsum("jc,jc->j", contacts, F), size), slope

    def value(self, v: Array, contacts: Array) -> tuple[Array, Array]:
        """G (m + 1,) and its Jacobian (m + 1, m + 2)."""
        m, n, eta, lam = self.m, v[:-2], v[-2], v[-1]
        g, slope = self.norm(n, eta, contacts)
        G = np.append(n - lam * self.k * g, n @ n + eta * eta - 1.0)
        J = np.zeros((m + 1, m + 2))
        J[:m, : m + 1] = -lam * self.k[:, None] * slope
        J[:m, :m] += np.eye(m)
        J[:m, -1] = -self.k * g
        J[m, :m], J[m, m] = 2 * n, 2 * eta
        return G, J

    def start(self) -> tuple[Array, Array]:
        """The frictionless solution v (m + 2,) and its contacts (m, 2)."""
        v = np.zeros(self.m + 2)
        v[-2] = 1.0
        contacts = self.contacts(self.f)
        g, _ = self.norm(v[:-2], 1.0, contacts)
        growth = np.einsum("jmc,m->jc", self.R, self.k * g)
        return v, self.contacts(self.f, growth)
