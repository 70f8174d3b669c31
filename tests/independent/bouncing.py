"""A hammer that falls on its stop and bounces, by energy and quadrature in 30 digits."""

from __future__ import annotations

from typing import Any

import mpmath as mp

mp.mp.dps = 30
WEIGHT = mp.mpf(2) * mp.mpf("9.81") * mp.mpf("0.4")  # [N m] of the horizontal hammer
INERTIA = mp.mpf("0.03") + 2 * mp.mpf("0.4") ** 2
START, BACK = mp.mpf("1.2"), mp.mpf("0.5")


def fallen(top: Any, q: Any) -> Any:
    """Time [s] from rest at an angle down to another one."""

    # with q = top - u^2 the integrand has no end point where it grows without bound
    def part(u: Any) -> Any:
        x = top - u**2
        drop = mp.sin(top) - mp.sin(x)
        return 2 * u / mp.sqrt(2 * WEIGHT / INERTIA * drop) if u else mp.mpf(0)

    edge = mp.mpf("1e-12")
    first = mp.sqrt(2 * INERTIA / (WEIGHT * mp.cos(top))) * edge
    return first + mp.quad(part, mp.linspace(edge, mp.sqrt(top - q), 9))


def hammer() -> list[tuple[float, float]]:
    """Rows (time [s], angle [rad]) of ``graphs/hammer.json``: falling, and in three flights."""
    rows, t, top = [(fallen(START, mp.mpf("0.6")), mp.mpf("0.6"))], fallen(START, 0), START
    for _ in range(3):
        top = mp.asin(BACK**2 * mp.sin(top))
        up = fallen(top, 0)
        half = top / 2
        rows.append((t + up - fallen(top, half), half))
        rows.append((t + up + fallen(top, half), half))
        t += 2 * up
    return [(float(a), float(b)) for a, b in rows]
