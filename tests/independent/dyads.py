"""Friction equations of random dyads from the balances of their two links, and nothing else.

Six balances of two bodies in the plane, six unknowns of three pairs: solved as one linear system,
for the loads and for a unit of friction in each pair. It knows no closed form, no kernel, no
order of solution. With it stands a search for solutions by brute force: many starts of Newton's
method on t = k g(f + R t).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

KINDS = {  # the pairs: outer of link i, inner, outer of link j
    "RRR": "RRR",
    "RRP": "RRP",
    "RPR": "RPR",
    "PRP": "PRP",
    "RPP": "RPP",
}


class Groups(NamedTuple):
    """n groups of m pairs: signed factors, contacts of each, loads, influences."""

    k: np.ndarray  # (n, m) [m] or [-]
    contacts: tuple[int, ...]
    base: np.ndarray  # (n, m)
    rows: np.ndarray  # (n, m, m)

    def of(self, index):
        return self._replace(k=self.k[index], base=self.base[index], rows=self.rows[index])


def cross(a, b):
    return a.real * b.imag - a.imag * b.real


def random_vectors(chance, n):
    return chance.normal(size=n) + 1j * chance.normal(size=n)


def random_groups(kind, n, arm, chance, guide_length=None):
    """n groups of a kind, friction arms up to ``arm`` of the longest distance between pairs.

    Of guides ``arm`` is the coefficient. ``guide_length`` [m] of all guides, or none.
    """
    pairs = KINDS[kind]
    points = [random_vectors(chance, n) for _ in pairs]
    directions = [x / np.abs(x) for x in (random_vectors(chance, n) for _ in pairs)]
    A = np.zeros((n, 6, 6))  # balances of i (x, y, moment about zero), of j; unknowns by pair
    units = np.zeros((n, 6, 3))  # what a unit of friction in each pair adds to the balances
    for p, (letter, at, u) in enumerate(zip(pairs, points, directions, strict=True)):
        # Onto the later link: outer pairs have one link of the group, the inner one has both.
        signs = {0: ((0, 1.0),), 1: ((1, 1.0), (0, -1.0)), 2: ((1, 1.0),)}[p]
        for link, sign in signs:
            at_link = slice(3 * link, 3 * link + 3)
            one = np.ones(n)
            if letter == "R":
                wrenches = [(one + 0j, 0 * one), (1j * one, 0 * one)]
                friction = (0j * one, one)
            else:
                wrenches = [(1j * u, 0 * one), (0j * one, one)]
                friction = (u, 0 * one)
            for q, (force, couple) in enumerate(wrenches):
                A[:, at_link, 2 * p + q] = sign * wrench(force, couple, at)
            units[:, at_link, p] = sign * wrench(*friction, at)
    loads = chance.normal(size=(n, 6, 1))
    result = -np.linalg.solve(A, np.concatenate([loads, units], axis=2))  # (n, 6, 1 + 3)
    scale = [1.0 if c == "R" else (2.0 / guide_length if guide_length else 0.0) for c in pairs]
    measured = np.stack(
        [result[:, 2 * p] + 1j * s * result[:, 2 * p + 1] for p, s in enumerate(scale)], axis=1
    )
    size = np.max([np.abs(a - b) for a in points for b in points], axis=0)
    arms = chance.uniform(-arm, arm, size=(n, 3))
    k = arms * np.stack([size if c == "R" else np.ones(n) for c in pairs], axis=1)
    contacts = tuple(0 if c == "R" else 4 if guide_length else 2 for c in pairs)
    return Groups(k, contacts, measured[:, :, 0], measured[:, :, 1:])


def wrench(force, couple, at):
    return np.stack([force.real, force.imag, couple + cross(at, force)], axis=1)


def norms(groups, F):
    """Loads (..., m) on the pairs, as Coulomb's law has them."""
    guides = np.array([c > 0 for c in groups.contacts])
    return np.where(guides, np.maximum(np.abs(F.real), np.abs(F.imag)), np.abs(F))


def slopes(groups, F):
    """Gradients of these norms, as vectors."""
    guides = np.array([c > 0 for c in groups.contacts])
    length = np.where(np.abs(F) > 0, np.abs(F), 1.0)
    by_x = np.abs(F.real) >= np.abs(F.imag)
    edge = np.where(by_x, np.sign(F.real) + 0j, 1j * np.sign(F.imag))
    return np.where(guides, edge, F / length)


def brute_force(groups, starts, chance, steps=60):
    """All solutions (list of arrays (s, m)) that Newton's method finds from many starts."""
    n, m = groups.k.shape
    spread = 10.0 ** chance.uniform(-2, 2.5, size=(n, starts, 1))
    size = np.abs(groups.base).max(axis=1)[:, None, None] * spread
    g = size * np.abs(chance.normal(size=(n, starts, m)))
    t = groups.k[:, None] * g
    with np.errstate(all="ignore"):
        for _ in range(steps):
            F = groups.base[:, None] + np.einsum("njm,nsm->nsj", groups.rows, t)
            w = slopes(groups, F)
            r = t - groups.k[:, None] * norms(groups, F)
            dot = (w.conj()[..., None] * groups.rows[:, None]).real
            J = np.eye(m) - groups.k[:, None, :, None] * dot
            bad = ~np.isfinite(J).all(axis=(2, 3)) | (np.abs(np.linalg.det(J)) < 1e-200)
            J[bad] = np.eye(m)
            t = t - np.linalg.solve(J, r[..., None])[..., 0]
        F = groups.base[:, None] + np.einsum("njm,nsm->nsj", groups.rows, t)
        load = norms(groups, F)
        off = np.abs(t - groups.k[:, None] * load) / np.abs(groups.k[:, None])
        good = (off <= 1e-9 * load.max(axis=2, keepdims=True)).all(axis=2)
    return [distinct(t[i][good[i]] / groups.k[i]) * groups.k[i] for i in range(n)]


def distinct(rows, near=1e-6):
    """Rows without doubles."""
    kept = np.zeros((0, rows.shape[1]))
    while len(rows):
        kept = np.vstack([kept, rows[:1]])
        off = np.abs(rows - rows[0]).max(axis=1)
        rows = rows[off > near * np.abs(rows[0]).max()]
    return kept
