r"""Chebyshev series on a panel: the spectral tools of forward dynamics.

A panel of length L is walked by an angle phi from 0 to pi,

    v = L sin^2(phi/2),      nodes phi_j = (j + 1/2) pi / n,   j = 0 .. n-1,

and a function on it is a cosine series f = sum c_k cos(k phi). With
``sin(phi) f = sum s_m sin(m phi)``, s_1 = c_0 - c_2/2, s_m = (c_{m-1} - c_{m+1})/2,

    integral of f dv from 0 to v  =  (L/2) sum_m (s_m/m) 2 sin^2(m phi/2).

Always this sin^2 form, never 1 - cos and never a difference of two potentials:
it keeps full *relative* accuracy where the integral goes to zero, which is where
a mechanism stands still.

The last samples before such a place are what the square root of the energy
magnifies, so `Rule.integrate` is built with the same care (see `_integrals`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]

GAUSS = 12  # points between two nodes, where the fastest wave is half a wave long
TAIL = 4  # coefficients in each of the two last blocks, which judge a series together:
# more than one, because of even and odd zeros
# A series that crawls goes down in a line to its last sample: its blocks are as 1 to 0.5.
ALIKE, NOISE = 0.4, 1e-9  # ratio of the blocks from which on it does, if it is no noise
STEADY, SLOW = 0.02, 0.5  # least and largest ratio of the blocks that an estimate believes


@dataclass(frozen=True)
class Rule:
    """Matrices of the n-point rule; apply them to samples (..., n) as ``f @ matrix``.

    Attributes
    ----------
    n : number of nodes
    k, k_next : 0 .. n - 1 and 1 .. n + 1
    phi : (n,) [rad] the nodes
    low, high : (n,) [-] sin^2 and cos^2 of phi/2: place seen from either end
    root : (n,) [-] sin(phi/2), the root of ``low``
    cosine : (n, n) samples -> c_0 .. c_{n-1}
    sine : (n, n + 1) samples -> s_1/1 .. s_{n+1}/(n+1) of sin(phi) f, already divided by m
    integrate : (n, n) samples -> integral of f sin(phi) from 0 to every node
    integrate_half : (n, n) samples -> integral of f cos(phi/2) from 0 to every node
    total : (n,) weights of the integral of f sin(phi) from 0 to pi
    total_half : (n,) weights of the integral of f cos(phi/2) from 0 to pi
    tail : (n, 2 TAIL) samples -> the last coefficients
    weights : (n,) of the barycentric formula between the nodes
    ends : (n, 5) samples -> value at phi = 0, at pi, derivative with respect to v/L at
        phi = 0, at pi, integral of f sin(phi)
    """

    n: int
    k: Floats
    k_next: Floats
    phi: Floats
    low: Floats
    high: Floats
    root: Floats
    cosine: Floats
    sine: Floats
    integrate: Floats
    integrate_half: Floats
    total: Floats
    total_half: Floats
    tail: Floats
    weights: Floats
    ends: Floats


@cache
def rule(n: int) -> Rule:
    """The n-point rule, made once per n. Cost: n^3/2 cosines."""
    k = np.arange(n, dtype=np.float64)
    phi = np.asarray((k + 0.5) * (np.pi / n), dtype=np.float64)
    cosine = (2.0 / n) * np.cos(np.outer(k, phi))
    cosine[0] /= 2
    padded = np.vstack([cosine, np.zeros((3, n))])
    m = np.arange(1, n + 2)
    sine = (padded[m - 1] - padded[m + 1]) / (2 * m[:, None])
    sine[0] += padded[0] / 2  # s_1 = c_0 - c_2/2
    total = 2 * sine[::2].sum(axis=0)  # 2 sin^2(m pi/2) is 2 for odd m
    halves = _half_waves(np.append(phi, np.pi), k)
    sign = (-1.0) ** k
    at_ends = np.stack([k * 0 + 1.0, sign, -2.0 * k * k, 2.0 * k * k * sign])
    return Rule(
        n=n,
        k=k,
        k_next=np.arange(1.0, n + 2),
        phi=phi,
        low=np.sin(phi / 2) ** 2,
        high=np.cos(phi / 2) ** 2,
        root=np.sin(phi / 2),
        cosine=np.ascontiguousarray(cosine.T),
        sine=np.ascontiguousarray(sine.T),
        integrate=np.ascontiguousarray(_integrals(n, phi).T),
        integrate_half=np.ascontiguousarray((halves[:-1] @ cosine).T),
        total=total,
        total_half=halves[-1] @ cosine,
        tail=np.ascontiguousarray(cosine[-2 * TAIL :].T),
        weights=sign * np.sin(phi),
        ends=np.vstack([at_ends @ cosine, total]).T.copy(),
    )


def _integrals(n: int, phi: Floats) -> Floats:
    """Integral of sin(phi) times each cardinal function, from 0 to each node: (n, n).

    Gauss-Legendre points between the nodes, summed upward: every row is exact to
    rounding *relative to itself*, however small the angle.
    """
    xi, weights = np.polynomial.legendre.leggauss(GAUSS)
    step = np.diff(phi, prepend=0.0)[:, None]
    inner = phi[:, None] - step * (1 - xi) / 2  # (n, g)
    k = np.arange(1, n)
    cardinal = np.cos(inner[..., None] * k) @ np.cos(np.outer(k, phi))  # (n, g, n)
    share = weights * step / 2 * np.sin(inner)
    rows = np.cumsum(np.einsum("jg,jgk->jk", share, (1 + 2 * cardinal) / n), axis=0)
    whole = 2 * np.sin(phi / 2) ** 2
    return np.asarray(rows * (whole / rows.sum(axis=1))[:, None])  # exact for a constant


def _half_waves(phi: Floats, k: Floats) -> Floats:
    """Integral of cos(k phi) cos(phi/2) from 0 to phi: (phi, k)."""
    up, down = k + 0.5, k - 0.5
    return np.asarray(np.sin(np.outer(phi, up)) / up + np.sin(np.outer(phi, down)) / down) / 2


def remainder(f: Floats, r: Rule) -> Floats:
    """Error of the integral of f sin(phi) that ends the series of samples f (..., n).

    The coefficients that are missing are continued from the two last blocks as a
    geometric series; each counts at most 2/n in the integral.
    """
    before, end = _blocks(f, r)
    ratio = np.minimum(np.maximum(end / (before + 1e-300), STEADY), SLOW)
    return np.asarray((2 * TAIL / r.n) * end * ratio / (1 - ratio))


def _blocks(f: Floats, r: Rule) -> tuple[Floats, Floats]:
    """Largest coefficient in each of the two last blocks, (...)."""
    last = np.maximum.reduceat(np.abs(f @ r.tail), (0, TAIL), axis=-1)
    return last[..., 0], last[..., 1]


def crawls(f: Floats, r: Rule) -> NDArray[np.bool_]:
    """Whether the series of f (..., n) has hardly begun to end: its last blocks are alike.

    `remainder` means nothing then; something narrower than the nodes lies on the panel.
    """
    before, end = _blocks(f, r)
    return np.asarray((end > ALIKE * before) & (end > NOISE * np.abs(f).max(axis=-1)))


def part_of(f: Floats, r: Rule, start: float, share: float) -> Floats:
    """f (m, n) at the n nodes of a part [start, start + share] of the panel, in v/L: (m, n)."""
    dyadic = start * 4 == int(start * 4) and share in (0.5, 0.25)
    return np.asarray(f @ (_half_or_quarter if dyadic else _part)(r.n, start, share))


def _part(n: int, start: float, share: float) -> Floats:
    """Matrix (n, n) of the barycentric formula; the nodes of the part are none of the whole's."""
    r = rule(n)
    pulls = r.weights[:, None] / ((start + share * r.low) - r.low[:, None])
    pulls /= np.add.reduce(pulls, axis=0)
    return np.asarray(pulls)


@cache
def _half_or_quarter(n: int, start: float, share: float) -> Floats:
    """`_part`, kept: panels are cut into halves and quarters again and again."""
    return _part(n, start, share)


def angle(z: Floats) -> Floats:
    """phi of a place z = v/L in [0, 1], exact near 0."""
    return np.asarray(2 * np.arcsin(np.sqrt(np.clip(z, 0.0, 1.0))))


def series(c: Floats, phi: Floats) -> Floats:
    """sum c_k cos(k phi); c (m, n), phi (m,) -> (m,)."""
    k = np.arange(c.shape[-1])
    return np.asarray(np.einsum("ij,ij->i", c, np.cos(phi[:, None] * k)))


def integral(s: Floats, phi: Floats) -> Floats:
    """Integral of f sin(phi) from 0 to phi, from the coefficients of `Rule.sine`.

    s (m, n + 1), phi (m,) -> (m,); relative accuracy is kept as phi goes to 0.
    """
    k = np.arange(1, s.shape[-1] + 1)
    return np.asarray(2 * np.einsum("ij,ij->i", s, np.sin(phi[:, None] * (k / 2)) ** 2))


def half_integral(c: Floats, phi: Floats) -> Floats:
    """Integral of f cos(phi/2) from 0 to phi; c (m, n), phi (m,) -> (m,)."""
    k = rule(c.shape[-1]).k + 0.5
    return np.asarray(np.einsum("ij,ij->i", half_waves(c), np.sin(phi[:, None] * k)))


def half_waves(c: Floats) -> Floats:
    """b_k of  integral of f cos(phi/2) = sum b_k sin((k + 1/2) phi); c and b (..., n)."""
    b = c.copy()
    b[..., :-1] += c[..., 1:]
    b[..., 0] += c[..., 0]
    return np.asarray(b / (2 * rule(c.shape[-1]).k + 1))


def series_one(c: Floats, phi: float) -> float:
    """`series` of one function at one place."""
    return float(np.cos(rule(c.shape[0]).k * phi) @ c)


def integral_one(s: Floats, phi: float) -> float:
    """`integral` of one function at one place."""
    waves = np.sin(rule(s.shape[0] - 1).k_next * (phi / 2))
    return 2 * float(s @ (waves * waves))


Pair: TypeAlias = tuple[float, float]


def crossing(values: Pair, places: Pair, slopes: Pair) -> float:
    """Where a function with values at two places goes through zero, by the inverse cubic.

    ``slopes`` are its derivatives there; where one is zero, a straight line must do.
    """
    (f0, f1), (x0, x1), (d0, d1) = values, places, slopes
    span, width = f1 - f0, x1 - x0
    if span == 0:
        return x0
    u = min(max(-f0 / span, 0.0), 1.0)
    x = x0 + u * width
    if d0 and d1:
        x += u * (1 - u) * ((1 - u) * (span / d0 - width) + u * (width - span / d1))
    return min(max(x, x0), x1)
