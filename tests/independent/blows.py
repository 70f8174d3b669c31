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


# -- a five-bar with joint friction --------------------------------------------------------------

BASE, ROD = 2.0, 2.0  # [m] between the frame's pins, and length of both rods; cranks of 1 m
BODIES = ("left", "right", "i", "j")
WEIGHT = (1.0, 1.0, 1.5, 1.5)  # [kg]
TURNING = (0.1, 0.1, 0.5, 0.5)  # [kg m2]
PLACES = (0.5 + 0.1j, 0.5 + 0.1j, 1.0 + 0.2j, 1.0 + 0.2j)  # [m] of mass, in the axes of the links
PINS = {"A": (None, 0), "E": (None, 1), "B": (0, 2), "C": (2, 3), "D": (1, 3)}


def five_bar_blow(
    q: Any, rates: Any, e: float, stop: tuple[int | None, int], arm: float
) -> dict[str, Any]:
    """Impulses of a stop of the angle between two links of a five-bar, with friction in its pins.

    All at once: twelve velocity jumps, ten force impulses, that of the stop. The friction of a pin
    is ``arm`` [m] times the size of its force impulse against the slip before the blow; what slips
    come to an end in it is followed in stages, each of which is a share of the stop's way.

    Parameters
    ----------
    q, rates : (2,) of both cranks before the blow
    e : restitution [-]
    stop : the two links whose angle (second less first) the stop is of; None is the frame

    Returns
    -------
    "jump" (2,) of the cranks, "P" of the stop, "pins" force impulses on the later links, "T" of the
    friction couples on these, "stages" how many there were
    """
    B, D = np.exp(1j * q[0]), BASE + np.exp(1j * q[1])
    half = (D - B) / 2
    C = B + half + 1j * half / abs(half) * math.sqrt(ROD**2 - abs(half) ** 2)
    axes = (B, D - BASE, (C - B) / ROD, (C - D) / ROD)
    origins = (0j, BASE + 0j, B, D)
    cm = [o + a * c for o, a, c in zip(origins, axes, PLACES, strict=True)]
    at = {"A": 0j, "E": BASE + 0j, "B": B, "C": C, "D": D}
    # velocities from rates of the cranks: both rods by the velocity of C
    vB, vD = 1j * rates[0] * B, 1j * rates[1] * (D - BASE)
    u, w = 1j * (C - B), 1j * (C - D)
    om = np.linalg.solve([[u.real, -w.real], [u.imag, -w.imag]], [(vD - vB).real, (vD - vB).imag])
    spin = np.array([rates[0], rates[1], *om])
    push, T, done, stages = 0.0, np.zeros(5), 0.0, 0
    pins = np.zeros(5, dtype=complex)
    start = spin.copy()
    target = (1 + e) * _between(spin, stop)
    sides = np.sign([_between(spin, PINS[name]) for name in PINS]).astype(int)
    stands: dict[int, int] = {}
    while done < 1 - 1e-13:
        stages += 1
        trials = [dict(zip(stands, x, strict=True)) for x in _signs(len(stands))]
        for trial in trials:
            now = [trial.get(j, side) for j, side in enumerate(sides)]
            try:
                step = _stage(cm, at, stop, target, now, arm)
            except np.linalg.LinAlgError:  # a pin that the stop turns cannot stick
                continue
            rise = np.array([_between(step["spin"], PINS[name]) for name in PINS])
            free = all(s == 0 or s * rise[j] > 0 for j, s in trial.items())
            held = all(abs(step["T"][j]) <= arm * abs(step["pins"][j]) for j in trial if not now[j])
            if free and held:
                break
        else:
            raise AssertionError("no stage")
        slips = np.array([_between(spin, PINS[name]) for name in PINS])
        ends = [-slips[j] / rise[j] if j not in stands and slips[j] * rise[j] < 0 else np.inf
                for j in range(5)]  # fmt: skip
        share = min(1 - done, *ends)
        spin = spin + share * step["spin"]
        push, pins, T = push + share * step["P"], pins + share * step["pins"], T + share * step["T"]
        sides = np.array(now)
        stands = {j: 0 for j in range(5) if ends[j] <= share * (1 + 1e-12) or now[j] == 0}
        done += share
    named = dict(zip(PINS, pins, strict=True))
    return {"jump": (spin - start)[:2], "P": push, "pins": named, "T": T, "stages": stages}


def _between(spin: Any, links: tuple[int | None, int]) -> float:
    one, other = links
    return float(spin[other] - (0.0 if one is None else spin[one]))


def _signs(count: int) -> list[tuple[int, ...]]:
    from itertools import product

    return sorted(product((0, 1, -1), repeat=count), key=lambda x: sum(map(abs, x)))


def _stage(cm: Any, at: Any, stop: Any, target: float, sides: Any, arm: float) -> dict[str, Any]:
    """Jumps and impulses where pins slip in some senses (0: the pin does not turn)."""
    names = list(PINS)
    T = np.zeros(5)
    for _ in range(200):
        n = 28  # 12 jumps, 10 forces, 5 couples, the stop's
        A, b = np.zeros((n, n)), np.zeros(n)
        for k in range(4):
            A[3 * k, 3 * k] = A[3 * k + 1, 3 * k + 1] = WEIGHT[k]
            A[3 * k + 2, 3 * k + 2] = TURNING[k]
        for j, name in enumerate(names):
            for link, sign in zip(PINS[name], (-1.0, 1.0), strict=True):
                if link is None:
                    continue
                r = at[name] - cm[link]
                x, y = 12 + 2 * j, 13 + 2 * j
                A[3 * link, x] -= sign
                A[3 * link + 1, y] -= sign
                A[3 * link + 2, x] += sign * r.imag
                A[3 * link + 2, y] -= sign * r.real
                A[3 * link + 2, 22 + j] -= sign
                A[12 + 2 * j, 3 * link] += sign
                A[12 + 2 * j, 3 * link + 2] -= sign * r.imag
                A[13 + 2 * j, 3 * link + 1] += sign
                A[13 + 2 * j, 3 * link + 2] += sign * r.real
                if sides[j] == 0:
                    A[22 + j, 3 * link + 2] += sign
            if sides[j]:
                A[22 + j, 22 + j], b[22 + j] = 1.0, T[j]
        for link, sign in zip(stop, (-1.0, 1.0), strict=True):
            if link is not None:
                A[3 * link + 2, 27] -= sign
                A[27, 3 * link + 2] += sign
        b[27] = -target
        x = np.linalg.solve(A, b)
        pins = x[12:22:2] + 1j * x[13:22:2]
        last, T = T, np.where(np.array(sides) == 0, x[22:27], -np.array(sides) * arm * np.abs(pins))
        if np.abs(T - last).max() <= 1e-16 * np.abs(pins).max():
            break
    return {"spin": x[2:12:3], "pins": pins, "T": x[22:27], "P": x[27]}
