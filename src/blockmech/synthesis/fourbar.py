r"""The four-bar that synthesis turns: its shape, and its pose with derivatives.

A shape has crank 1 and its pivot at zero:

    x = (ln frame, angle of the frame, ln coupler, ln rocker, u, v)

with the coupler point u + iv in the axes of the coupler. All functions take shapes (..., 6) and
crank angles (..., n); a pose that does not close is NaN.

With e, g the directions of coupler (B -> C) and rocker (D -> C), closure B + l e = D + m g gives
by the product with conj g (conj e) the derivatives of their angles.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from blockmech.typing import Floats, Real, Reals, Vectors

SHAPE = 6


class Pose(NamedTuple):
    """A four-bar at crank angles (..., n); derivatives (..., n, 7) by its shape and the angle.

    point : coupler point
    coupler, rocker : angles [rad] of B -> C and D -> C, not unwrapped
    """

    point: Vectors
    coupler: Floats
    rocker: Floats
    by_point: Vectors
    by_coupler: Floats
    by_rocker: Floats


def _directions(shape: Real, theta: Real, branch: Real) -> Reals:
    x = np.asarray(shape, float)[..., None, :]
    D = np.exp(x[..., 0] + 1j * x[..., 1])
    l, m = np.exp(x[..., 2]), np.exp(x[..., 3])
    B = np.exp(1j * np.asarray(theta, float))
    d = D - B
    r2 = d.real**2 + d.imag**2
    with np.errstate(invalid="ignore", divide="ignore"):
        a = (r2 + l**2 - m**2) / (2 * r2)
        h = np.sqrt(l**2 / r2 - a**2)
        e = d * (a + 1j * np.asarray(branch)[..., None] * h) / l
        g = (B + l * e - D) / m
    return x, D, B, l, m, e, g


def coupler_point(shape: Real, theta: Real, branch: Real) -> Real:
    """Coupler point (..., n) of shapes (..., 6) in branches (...); NaN where the loop is open.

    >>> bm.synthesis.coupler_point([0.0, 3.0, 3.0, 3.0, 1.0, 0.5], [0.0, 1.0], 1).round(3)
    array([1.376-1.053j, 1.381+0.104j])
    """
    x, _, B, _, _, e, _ = _directions(shape, theta, branch)
    return B + (x[..., 4] + 1j * x[..., 5]) * e


def angles_and_point(shape: Real, theta: Real, branch: Real) -> tuple[Vectors, Floats, Floats]:
    """Coupler point and angles (..., n) [rad] of coupler and rocker."""
    x, _, B, _, _, e, g = _directions(shape, theta, branch)
    return B + (x[..., 4] + 1j * x[..., 5]) * e, np.angle(e), np.angle(g)


def margin(shape: Real, theta: Real, branch: Real) -> Floats:
    """Margin (..., n) of the dyad, sin^2 of its transmission angle; NaN where it is open."""
    *_, e, g = _directions(shape, theta, branch)
    return np.asarray(((np.conj(g) * e).imag) ** 2)


def pose(shape: Real, theta: Real, branch: Real) -> Pose:
    """Poses with exact derivatives."""
    x, D, B, l, m, e, g = _directions(shape, theta, branch)
    uv = x[..., 4] + 1j * x[..., 5]
    none, ones = np.zeros(B.shape), np.ones(B.shape)
    D, l, m = D + none, l + none, m + none
    dB = np.stack([none] * SHAPE + [1j * B], axis=-1)
    dD = np.stack([D, 1j * D, *[none] * 5], axis=-1)
    dl = np.stack([none, none, l, *[none] * 4], axis=-1)
    dm = np.stack([none, none, none, m, *[none] * 3], axis=-1)
    duv = np.stack([none] * 4 + [ones, 1j * ones, none], axis=-1)
    with np.errstate(invalid="ignore", divide="ignore"):
        across = (1j * e * np.conj(g)).real  # sine of the transmission angle
        gap = dB - dD
        by_coupler = (dm - (np.conj(g)[..., None] * (gap + dl * e[..., None])).real) / (l * across)[
            ..., None
        ]
        by_rocker = (dl + (np.conj(e)[..., None] * (gap - dm * g[..., None])).real) / (-m * across)[
            ..., None
        ]
    by_point = dB + (duv + uv[..., None] * 1j * by_coupler) * e[..., None]
    return Pose(B + uv * e, np.angle(e), np.angle(g), by_point, by_coupler, by_rocker)
