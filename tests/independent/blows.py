"""A blow on a slider-crank in maximal coordinates: nine velocity jumps and nine impulses at once.

Every link has its own m dv = sum of impulses and J dom = sum of their moments about its centre
of mass; every pair keeps its constraint in the jumps; the stop turns its own rate to -e of it.
Nothing here knows of drivers, groups or reduced inertia.

Source: Brach, Mechanical Impact Dynamics, 1991, ch. 2 and 6 (impulse and momentum of planar
bodies with joints).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

R, L, GUIDE = 0.1, 0.3, 0.02  # [m] crank, rod, height of the guide
MASS = (1.0, 0.7, 1.3)  # [kg] crank, rod, slider
INERTIA = (0.02, 0.006, 0.01)  # [kg m2]
CENTRE = (0.04 + 0.01j, 0.13 + 0.004j, 0.01 + 0.015j)  # [m] of mass, in the axes of the links


def slider_crank_blow(q: float, rate: float, e: float, pin: bool) -> dict[str, Any]:
    """Impulses of a stop of the slider's way, or of the pin between rod and slider.

    Parameters
    ----------
    q, rate : angle of the crank [rad] and its rate before the blow [rad/s]
    e : restitution [-]
    pin : whether the stop is between rod and slider, and not of the slider on the guide

    Returns
    -------
    by pair: force impulses (complex) on the later link [N s], "C" of the guide [N m s], "P" of the
    stop along the coordinate of its pair, "jump" of the crank's rate [rad/s]
    """
    B = R * np.exp(1j * q)
    s = math.asin((GUIDE - B.imag) / L)
    e_rod = np.exp(1j * s)
    C = B + L * e_rod
    axes, origin = (np.exp(1j * q), e_rod, 1 + 0j), (0j, B, C)
    cm = [o + a * c for o, a, c in zip(origin, axes, CENTRE, strict=True)]
    # unknowns: (dvx, dvy, dom) of three links, then A, B, C forces, N and couple of the guide, P
    A, b = np.zeros((18, 18)), np.zeros(18)

    def force(link: int, column: int, at: complex, sign: float) -> None:
        """A force impulse of two components on a link at a place."""
        arm = at - cm[link]
        for part in (0, 1):
            A[3 * link + part, column + part] -= sign
        A[3 * link + 2, column] -= sign * -arm.imag
        A[3 * link + 2, column + 1] -= sign * arm.real

    for k in range(3):
        A[3 * k, 3 * k] = A[3 * k + 1, 3 * k + 1] = MASS[k]
        A[3 * k + 2, 3 * k + 2] = INERTIA[k]
    force(0, 9, 0j, 1.0)
    force(0, 11, B, -1.0)  # of the crank on the rod
    force(1, 11, B, 1.0)
    force(1, 13, C, -1.0)  # of the rod on the slider
    force(2, 13, C, 1.0)
    A[7, 15] -= 1.0  # N at the slider's point C
    A[8, 15] -= (C - cm[2]).real
    A[8, 16] -= 1.0  # couple of the guide
    if pin:
        A[5, 17] += 1.0  # P on the slider, the opposite on the rod
        A[8, 17] -= 1.0
    else:
        A[6, 17] -= 1.0  # P along x on the slider, through C
        A[8, 17] -= -(C - cm[2]).imag

    def speed(row: int, link: int, at: complex, sign: float) -> None:
        """Velocity of a place of a link, in two rows."""
        arm = at - cm[link]
        A[row, 3 * link] += sign
        A[row, 3 * link + 2] += sign * -arm.imag
        A[row + 1, 3 * link + 1] += sign
        A[row + 1, 3 * link + 2] += sign * arm.real

    speed(9, 0, 0j, 1.0)
    speed(11, 0, B, -1.0)
    speed(11, 1, B, 1.0)
    speed(13, 1, C, -1.0)
    speed(13, 2, C, 1.0)
    A[15, 7] = 1.0  # the slider stays on its guide, and does not turn
    A[15, 8] = (C - cm[2]).real
    A[16, 8] = 1.0
    om_rod = -rate * B.real / (L * e_rod.real)
    v_slider = (1j * rate * B + 1j * om_rod * L * e_rod).real
    if pin:
        A[17, 8], A[17, 5], b[17] = 1.0, -1.0, (1 + e) * om_rod  # of slider against rod
    else:
        A[17, 6], A[17, 8], b[17] = 1.0, -(C - cm[2]).imag, -(1 + e) * v_slider
    x = np.linalg.solve(A, b)
    found: dict[str, Any] = {
        n: complex(x[k], x[k + 1]) for n, k in (("A", 9), ("B", 11), ("C", 13))
    }
    return found | {"N": x[15], "C_guide": x[16], "P": x[17], "jump": x[2]}
