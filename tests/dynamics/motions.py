"""The motions of `graphs/motions` in closed form, or by quadrature, with 30 digits (mpmath).

Nothing here is computed by blockmech. The numbers under ``expect`` come from here:
``python -m tests.dynamics.motions`` prints them.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from itertools import accumulate, pairwise
from typing import Any

from mpmath import mp, mpf
from scipy.integrate import solve_ivp

mp.dps = 30
G = mpf("9.81")  # [m/s2]
Rows = dict[str, list[float]]


def table(rows: Sequence[tuple[Any, Any, Any]], name: str) -> Rows:
    """Rows of time, coordinate and rate of a driver, as an expectation has them."""
    times, q, rate = ([float(x) for x in column] for column in zip(*rows, strict=True))
    return {"times": times, f"{name}.q": q, f"{name}.rate": rate}


# -- a pendulum on a pin with friction (numerics 8.5) ------------------------------------------

XI = mpf("0.02")  # f' r / l
PIN_START = -math.pi / 2 + 1.5  # [rad]


def pin_swings() -> list[tuple[Any, Any, Any]]:
    """Swings up to the last standstill, at which it stays: a point mass, 1 kg at 1 m.

    y as a function of th, and th at both ends of the swing [rad].
    y = th'^2 = C exp(-2 s mu th) + A cos th + s B sin th, th from the lowest place.
    """
    mu = XI / mp.sqrt(1 - XI**2)
    a = 2 * G * (1 - 2 * mu**2) / (1 + 4 * mu**2)
    b = -6 * mu * G / (1 + 4 * mu**2)
    th, swings = mpf(PIN_START) + mp.pi / 2, []
    while abs(mp.sin(th)) > XI:
        s = -1 if th > 0 else 1
        c = -(a * mp.cos(th) + s * b * mp.sin(th)) * mp.exp(2 * s * mu * th)

        def y(x: Any, s: int = s, c: Any = c) -> Any:
            return c * mp.exp(-2 * s * mu * x) + a * mp.cos(x) + s * b * mp.sin(x)

        near = (-th, mpf(0)) if y(0) > 0 else (mpf(0), th * (1 - mpf(10) ** -7))
        end = mp.findroot(y, near, solver="anderson", tol=mpf(10) ** -40)
        swings.append((y, th, end))
        th = end
    return swings


def between_standstills(y: Callable[[Any], Any], start: Any, end: Any) -> Any:
    """Time [s] of a swing with th'^2 = y(th); in s, th = mid + half sin s, its rate is smooth."""
    mid, half = (start + end) / 2, abs(end - start) / 2

    def slowness(s: Any) -> Any:
        return half * mp.cos(s) / mp.sqrt(y(mid + half * mp.sin(s)))

    return mp.quad(slowness, [-mp.pi / 2, mp.pi / 2], method="gauss-legendre")


def pin_pendulum() -> Rows:
    """Standstills of the swings, and the time at which each is."""
    t, rows = mpf(0), []
    for y, th, end in pin_swings():
        t += between_standstills(y, th, end)
        rows.append((t, end - mp.pi / 2, 0))
    return table([*rows, (100, rows[-1][1], 0)], "crank")


# -- a slider that sticks: dry friction under a force that swings ------------------------------

SLIDER, MU, FORCE, BEAT = mpf(2), mpf("0.2"), mpf(5), mpf(1)  # [kg], [-], [N], [s]


def sticking_slider() -> Rows:
    """m x'' = F sin w t - s mu m g while it slides; it sticks until the force outgrows friction."""
    w, held = 2 * mp.pi / BEAT, MU * SLIDER * G
    leaves = mp.asin(held / FORCE) / w

    def rate(t: Any) -> Any:
        drawn = FORCE / w * (mp.cos(w * leaves) - mp.cos(w * t))
        return (drawn - held * (t - leaves)) / SLIDER

    def way(t: Any) -> Any:
        drawn = mp.cos(w * leaves) * (t - leaves) - (mp.sin(w * t) - mp.sin(w * leaves)) / w
        return (FORCE / w * drawn - held * (t - leaves) ** 2 / 2) / SLIDER

    stops = mp.findroot(rate, (0.35 * BEAT, 0.7 * BEAT), solver="anderson", tol=mpf(10) ** -40)
    assert abs(FORCE * mp.sin(w * stops)) < held
    far, half = way(stops), BEAT / 2
    rows = [(leaves / 2, 0, 0), (0.25, way(mpf(0.25)), rate(mpf(0.25))), (stops, far, 0)]
    rows += [((stops + leaves + half) / 2, far, 0)]
    return table(rows + [(t + half, far - q, -v) for t, q, v in rows], "slider")


# -- a slider between spring, damper and a force that swings: steady state ---------------------


def shaken_slider() -> Rows:
    """q = Re(F exp(i w t) / (k - m w^2 + i c w))."""
    m, k, c, F, T = mpf(2), mpf(50), mpf(3), mpf(10), mpf("0.7")
    w = 2 * mp.pi / T
    response = F / (k - m * w**2 + 1j * c * w)
    turned = [(t, response * mp.exp(1j * w * t)) for t in (mpf(0), T / 7, T / 2, T)]
    return table([(t, z.real, (1j * w * z).real) for t, z in turned], "slider")


# -- a press that locks itself -----------------------------------------------------------------

CRANK, ROD, RHO, WAY_MU, LOAD = mpf("0.1"), mpf("0.3"), mpf("0.003"), mpf("0.1"), mpf(10000)
PRESS_START = 0.04  # [rad] beyond the dead centre


def press_moment(q: Any, sense: int) -> Any:
    """Driving moment [N m] of a slow turn one way: friction circles RHO, ram's friction WAY_MU.

    From the balance of crank, massless rod and ram; F acts from the rod on the ram.
    """
    phi = -mp.asin(CRANK * mp.sin(q) / ROD)
    B = CRANK * mp.expj(q)
    rod = ROD * mp.expj(phi)
    turning = -CRANK * mp.cos(q) / (ROD * mp.cos(phi)) * sense  # of the rod
    ram = -sense * mp.sign(mp.sin(q) * CRANK * (1 + CRANK * mp.cos(q) / (ROD * mp.cos(phi))))
    at_b, at_c = mp.sign(turning - sense), mp.sign(-turning)

    def cross(a: Any, b: Any) -> Any:
        return (mp.conj(a) * b).imag

    def left(x: Any, y: Any) -> list[Any]:
        F = mp.mpc(x, y)
        couple = cross(rod, -F) + (at_c - at_b) * RHO * abs(F)
        return [couple, x - LOAD - ram * WAY_MU * abs(y)]

    F = mp.mpc(*mp.findroot(left, (LOAD, LOAD * mp.tan(phi))))
    return cross(B, F) - at_b * RHO * abs(F) + sense * RHO * abs(F)


PRESS_AT = [0.02, 0.04, 0.2, 0.6, 1.2]


def locking_press() -> Rows:
    """Moments of a turn that lets the ram back: positive ones must pull, so it is locked."""
    moments = [float(press_moment(mpf(q), 1)) for q in PRESS_AT]
    assert moments[1] > 0 > float(press_moment(mpf(PRESS_START), -1))
    return {"at": PRESS_AT, "crank.drive": moments}


# -- a crank under a gas law with kinks --------------------------------------------------------

GAS = [(0.04, 3600.0), (0.06, 1800.0), (0.08, 900.0), (0.11, 400.0), (0.16, 150.0)]  # [m], [N]
HEAD, GAS_CRANK, GAS_ROD, FLYWHEEL, GAS_RATE = mpf("0.3"), mpf("0.05"), mpf("0.2"), mpf("0.05"), 30


def gas_crank() -> Rows:
    """K = K0 + work of the gas; its force is a line between rows, so that work a parabola."""

    def gap(q: Any) -> Any:
        x = GAS_CRANK * mp.cos(q) + mp.sqrt(GAS_ROD**2 - (GAS_CRANK * mp.sin(q)) ** 2)
        return HEAD - x

    def work(d: Any) -> Any:
        whole = mpf(0)
        for (a, f), (b, g) in pairwise(GAS):
            to = min(max(d, mpf(str(a))), mpf(str(b))) - mpf(str(a))
            slope = (mpf(g) - mpf(f)) / (mpf(str(b)) - mpf(str(a)))
            whole += mpf(f) * to + slope * to**2 / 2
        return whole

    def rate(q: Any) -> Any:
        return mp.sqrt(mpf(GAS_RATE) ** 2 + 2 * (work(gap(q)) - work(gap(0))) / FLYWHEEL)

    kinks = [
        mp.findroot(lambda q, d=d: gap(q) - mpf(str(d)), (0.1, 3.1), solver="anderson")
        for d, _ in GAS[1:-1]
    ]
    kinks += [2 * mp.pi - q for q in reversed(kinks)]

    def time(a: Any, b: Any) -> Any:
        cuts = [a, *(k for k in kinks if a < k < b), b]
        return mp.quad(lambda x: 1 / rate(x), cuts, method="gauss-legendre")

    places = [*map(mpf, (0, 0.3, 1.0, 2.0, 3.0, 4.0, 5.5)), 2 * mp.pi]
    times = accumulate(time(a, b) for a, b in pairwise(places))
    return table([(t, q, rate(q)) for t, q in zip(times, places[1:], strict=True)], "crank")


# -- a rod that falls on an end stop -----------------------------------------------------------

STOP_START, STOP = 1.0, -0.5  # [rad]


def falling_rod() -> Rows:
    """q'^2 = 3 g/l (sin q0 - sin q): a uniform rod of 1 m."""

    def rate(q: Any) -> Any:
        return mp.sqrt(3 * G * (mp.sin(mpf(STOP_START)) - mp.sin(q)))

    result = [(mp.quad(lambda x: 1 / rate(x), [q, STOP_START]), q) for q in (0.9, 0.5, 0.0, -0.49)]
    return table([(t, q, -rate(mpf(q))) for t, q in result], "crank")


# -- a rod with a damper -----------------------------------------------------------------------


def damped_rod() -> Rows:
    """It comes to rest where it hangs."""
    return table([(0, -mp.pi / 2, 0)], "crank")


# -- a clock: a pendulum that a motor keeps swinging -------------------------------------------

CLOCK = (0.4, -0.3)  # moment [N m] by the rate and its cube


def clock() -> Rows:
    """The limit cycle from its right standstill on, by a long integration (DOP853, 1e-13)."""
    J, weight = 1 / 3, 9.81 / 2

    def slope(t: float, y: Any) -> list[float]:
        moment = CLOCK[0] * y[1] + CLOCK[1] * y[1] ** 3
        return [y[1], (moment - weight * math.cos(y[0])) / J]

    stands: Callable[..., float] = lambda t, y: y[1]  # noqa: E731
    stands.direction = -1  # type: ignore[attr-defined]
    start = [-math.pi / 2 + 0.5, 0.0]
    long = solve_ivp(slope, (0, 80), start, "DOP853", rtol=1e-13, atol=1e-13, events=stands)
    times, places = long.t_events[0], long.y_events[0]
    period, q = times[-1] - times[-2], places[-1][0]
    y = solve_ivp(slope, (0, period), [q, 0.0], "DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
    period -= y[1] / slope(period, y)[1]  # events are known by dense output alone
    return table([(0.0, q, 0.0), (period, q, 0.0)], "crank")


MOTIONS: dict[str, Callable[[], Rows]] = {
    "pin_pendulum": pin_pendulum,
    "sticking_slider": sticking_slider,
    "shaken_slider": shaken_slider,
    "locking_press": locking_press,
    "gas_crank": gas_crank,
    "falling_rod": falling_rod,
    "damped_rod": damped_rod,
    "clock": clock,
}

if __name__ == "__main__":
    for name, motion in MOTIONS.items():
        print(name, json.dumps(motion()))
