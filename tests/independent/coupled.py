"""Coupled machines of the gallery by energy alone, in 30 digits.

One coordinate, the energy of everything as a function of it, and Lagrange's equation

    tau = J q'' + J' q'^2 / 2 + V' - Q,   Q = sum of forces times velocities at unit rate

with derivatives by mpmath. Knows nothing of blocks, couplings, groups or passes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import mpmath as mp

mp.mp.dps = 30

Function = Callable[[Any], Any]


def drive(J: Function, V: Function, work: Function, q: Any, rate: Any, acceleration: Any) -> Any:
    """Driving effort; ``work`` is what given forces do from some place on."""
    J1 = mp.diff(J, q)
    return J(q) * acceleration + J1 * rate**2 / 2 + mp.diff(V, q) - mp.diff(work, q)


# -- engine with a timing belt, a cam and a valve ------------------------------------------------

LIFT, OVER = mp.mpf("0.008"), mp.mpf("1.2")
BASE, ASIDE = mp.mpf("0.026"), mp.mpf("0.002")  # of the roller's centre above the cam, beside it
STIFFNESS, SPRING, REACH = mp.mpf(9000), mp.mpf("0.09"), mp.mpf("0.1")


def lift(x: Any) -> Any:
    """Rise and return by the polynomial 4-5-6-7, x from 0 to 2.4 rad; elsewhere the base circle."""
    x = mp.fmod(x, 2 * mp.pi)
    x = 2 * OVER - x if x > OVER else x
    if x < 0:
        return mp.mpf(0)
    u = x / OVER
    return LIFT * (35 * u**4 - 84 * u**5 + 70 * u**6 - 20 * u**7)


def valve_engine(q: float, rate: float) -> Mapping[str, Any]:
    """Outputs of ``graphs/valve_engine.json`` at a constant rate."""
    q, rate = mp.mpf(q), mp.mpf(rate)
    r, rod, half = mp.mpf("0.04"), mp.mpf("0.14"), mp.mpf(1) / 2

    def piston(q: Any) -> Any:
        return r * mp.cos(q) + mp.sqrt(rod**2 - (r * mp.sin(q)) ** 2)

    def cm(q: Any) -> tuple[Any, Any]:
        return (r * mp.cos(q) + piston(q)) / 2, r * mp.sin(q) / 2

    def slant(q: Any) -> Any:
        return -mp.asin(r * mp.sin(q) / rod)

    def J(q: Any) -> Any:
        x1, y1 = (mp.diff(lambda t, k=k: cm(t)[k], q) for k in (0, 1))
        total = mp.mpf("0.06") + mp.mpf("0.6") * (x1**2 + y1**2)
        total += mp.mpf("0.0012") * mp.diff(slant, q) ** 2 + half * mp.diff(piston, q) ** 2
        valve = mp.diff(lambda t: lift(half * t), q)
        return total + mp.mpf("0.0002") * half**2 + mp.mpf("0.09") * valve**2

    def squeeze(q: Any) -> Any:
        return SPRING - (REACH - BASE - lift(half * q))

    tau = drive(
        J, lambda t: STIFFNESS * squeeze(t) ** 2 / 2, lambda t: -400 * piston(t), q, rate, 0
    )
    x = half * q
    s, s1, s2 = (mp.diff(lift, x, k) for k in (0, 1, 2))
    force = mp.mpf("0.09") * s2 * (half * rate) ** 2 + STIFFNESS * squeeze(q)
    angle = mp.atan((s1 - ASIDE) / (BASE + s))
    tight = force * s1 / (2 * mp.mpf("0.06"))
    return {
        "valve.q": s,
        "valve.acceleration": s2 * (half * rate) ** 2,
        "cam.pressure_angle": angle,
        "cam.contact": force / mp.cos(angle),
        "belt.slack": 200 - abs(tight),
        "crank.drive": tau,
        "crank.J_red": J(q),
    }


# -- gripper with a rack between two pinions -----------------------------------------------------


def rack_gripper(q: float, acceleration: float) -> Mapping[str, Any]:
    """Outputs of ``graphs/rack_gripper.json`` from rest."""
    q, acceleration = mp.mpf(q), mp.mpf(acceleration)
    r, arm = mp.mpf("0.015"), mp.mpf("0.06")
    turned = mp.mpf("0.6") + q / r
    # Pinion and rocker turn, the finger between them moves on a circle without turning.
    inertia = mp.mpf("0.00006") + mp.mpf("0.00004") + mp.mpf("0.08") * arm**2
    J = mp.mpf("0.2") + 2 * inertia / r**2
    grip = 50 * arm * mp.cos(turned) / r
    effort = inertia * acceleration / r - 50 * arm * mp.cos(turned)
    return {
        "upper.q": q / r,
        "lower.q": -q / r,
        "rack.J_red": J,
        "rack.drive": J * acceleration - 2 * grip,
        "upper_mesh.effort": effort,
    }
