"""Exact motions of a pendulum q'' = -sin q, by elliptic functions in 40 digits."""

from __future__ import annotations

import mpmath as mp

DIGITS = 40


def pendulum(q0: float, rate0: float, t: float) -> tuple[mp.mpf, mp.mpf]:
    """q and q' after t, from q0 and rate0."""
    with mp.workdps(DIGITS):
        q0, rate0, t = mp.mpf(q0), mp.mpf(rate0), mp.mpf(t)
        m = mp.sin(q0 / 2) ** 2 + rate0**2 / 4
        k = mp.sqrt(m)
        if m < 1:  # sin(q/2) = k sn
            u = mp.ellipf(mp.atan2(mp.sin(q0 / 2) / k, rate0 / (2 * k)), m) + t
            sn, cn = mp.ellipfun("sn", u, m=m), mp.ellipfun("cn", u, m=m)
            return 2 * mp.asin(k * sn), 2 * k * cn
        way = mp.sign(rate0)  # q/2 = am(k t)
        u = mp.ellipf(q0 / 2, 1 / m) * way + k * t
        half = mp.ellipk(1 / m)
        turns = mp.nint(u / (2 * half))
        angle = mp.asin(mp.ellipfun("sn", u - 2 * half * turns, m=1 / m)) + turns * mp.pi
        return way * 2 * angle, way * 2 * k * mp.ellipfun("dn", u, m=1 / m)


def pendulum_period(amplitude: float) -> mp.mpf:
    """Period of the swing with an amplitude [rad]."""
    with mp.workdps(DIGITS):
        return 4 * mp.ellipk(mp.sin(mp.mpf(amplitude) / 2) ** 2)
