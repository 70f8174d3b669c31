"""Machines of the graph gallery as the independent judge sees them: links, joints, one system.

Nothing here is computed by blockmech: the motions are integrated in absolute coordinates
(`tests/independent/multibody.py`), or are closed forms. The numbers under ``expect`` in
``graphs/`` come from here: ``python -m tests.dynamics.machines`` prints them.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from mpmath import mp
from scipy.interpolate import CubicHermiteSpline, CubicSpline

from tests.dynamics.linkages import BATCH, watt_parts
from tests.independent import multibody as mb

TURN = 2 * math.pi
GRAVITY = (0.0, -9.81)

GAS_ANGLES = [math.pi / 6 * i for i in range(24)]  # [rad] of two turns, every 30 degrees
GAS_FORCES = [  # [N] on the piston, towards the crank
    *(9000.0, 12000.0, 7000.0, 4000.0, 2600.0, 1600.0),  # expansion
    *(700.0, 250.0, 150.0, 120.0, 120.0, 100.0),  # exhaust
    *(20.0, -60.0, -110.0, -110.0, -80.0, -20.0),  # intake
    *(40.0, 120.0, 300.0, 800.0, 2200.0, 5600.0),  # compression
]
MOTOR = (12.0, 100.0)  # stall moment [N m], no-load speed [rad/s] of the pump's motor


@dataclass(frozen=True)
class Moved:
    """A motion of the judge: times (n,), driver coordinates and rates (n, drivers)."""

    times: Any
    q: Any
    rate: Any
    poses: Any
    rates: Any


def crank_slider(
    crank: tuple[float, float, float],
    rod: tuple[float, float, float],
    piston: float,
    driver: str,
    **loads: Any,
) -> mb.System:
    """An inline slider-crank: (length, mass, inertia) of crank and rod, the piston's mass.

    Centres of mass: the crank's on its pivot, the rod's in the middle, the piston's on its pin.
    """
    r, l = crank[0], rod[0]
    links = {
        "crank": mb.Link(crank[1], crank[2], (0.0, 0.0), (0.0, 0.0, 0.5)),
        "rod": mb.Link(rod[1], rod[2], (l / 2, 0.0), (0.9 * r, 0.5 * r, -0.5 * r / l)),
        "piston": mb.Link(piston, 0.01, (0.0, 0.0), (0.85 * r + l, 0.0, 0.0)),
    }
    joints = {
        "O": mb.Joint("R", ("frame", "crank"), ((0.0, 0.0), (0.0, 0.0))),
        "B": mb.Joint("R", ("crank", "rod"), ((r, 0.0), (0.0, 0.0))),
        "C": mb.Joint("R", ("rod", "piston"), ((l, 0.0), (0.0, 0.0))),
        "S": mb.Joint("P", ("frame", "piston"), ((0.0, 0.0), (0.0, 0.0))),
    }
    return mb.System(links, joints, {driver: mb.Driver(joint=driver)}, loads)


ENGINE = ((0.04, 2.0, 0.06), (0.14, 0.6, 0.0012), 0.5)
PUMP = ((0.05, 1.0, 0.02), (0.2, 0.8, 0.003), 1.5)
PUMP_LOADS = {"spring": mb.Spring(("frame", "piston"), ((0.0, 0.0), (0.0, 0.0)), 3000.0, 0.2, 60.0)}
BRAKE = {"brake": mb.Couple("crank", -60.0)}


def started(system: mb.System, q: float, rate: float) -> tuple[Any, Any]:
    """Poses and rates of a system with its one driver at a coordinate and rate."""
    poses = mb.assemble(system, system.home, [q])
    return poses, mb.rates(system, poses, [rate])


def moved(
    system: mb.System,
    start: tuple[Any, Any],
    times: list[float],
    efforts: Any,
    cranks: tuple[int, ...] = (0,),
) -> Moved:
    """Integrate from a start; the cranks are links by their number."""
    poses, rates = mb.integrate(system, *start, times, efforts)
    picked = list(cranks)
    return Moved(np.array(times), poses[:, picked, 2], rates[:, picked, 2], poses, rates)


def engine(times: list[float], q: float = 0.3, rate: float = 150.0) -> Moved:
    """Slider-crank engine: gas force over two turns of the crank, brake, flywheel."""
    force = CubicSpline([*GAS_ANGLES, 2 * TURN], [*GAS_FORCES, GAS_FORCES[0]], bc_type="periodic")
    by_crank = crank_slider(*ENGINE, "O", **BRAKE)
    by_piston = crank_slider(*ENGINE, "S", **BRAKE)

    def gas(t: float, poses: Any, rates: Any) -> list[float]:
        return [-float(force(poses[0, 2] % (2 * TURN)))]

    # A kink inside a step is not seen by the step's own error estimate, so steps end there.
    start = started(by_crank, q, rate)
    survey = moved(by_piston, start, np.linspace(times[0], times[-1], 401).tolist(), gas)
    clock = CubicHermiteSpline(survey.q[:, 0], survey.times, 1 / survey.rate[:, 0])
    first, last = survey.q[0, 0], survey.q[-1, 0]
    kinks = [i * math.pi / 6 for i in range(math.ceil(6 * last / math.pi))]
    stations = sorted({*times, *(float(clock(k)) for k in kinks if first < k < last)})
    whole = moved(by_piston, start, stations, gas)
    at = [stations.index(t) for t in times]
    return Moved(*(column[at] for column in vars(whole).values()))


def pump(times: list[float], q: float = 0.0, rate: float = 0.0) -> Moved:
    """Slider-crank pump: DC motor on the crank, spring and damper on the plunger."""
    system = crank_slider(*PUMP, "O", **PUMP_LOADS)
    stall, free = MOTOR

    def motor(t: float, poses: Any, rates: Any) -> list[float]:
        return [stall * (1 - rates[0, 2] / free)]

    return moved(system, started(system, q, rate), times, motor)


PUMP_NEAR = 63.86  # [rad/s] a start near the steady state, so that the judge need not wait long
PUMP_TURNS = 18  # a disturbance falls to 0.43 of itself in each


def pump_cycle() -> tuple[float, float]:
    """Period [s] of the pump's steady state and its rate [rad/s] at whole turns.

    The judge integrates until nothing is left of the start; whole turns are met by
    Newton's method on the time.
    """
    system = crank_slider(*PUMP, "O", **PUMP_LOADS)
    stall, free = MOTOR
    state = started(system, 0.0, PUMP_NEAR)

    def motor(t: float, poses: Any, rates: Any) -> list[float]:
        return [stall * (1 - rates[0, 2] / free)]

    def after(dt: float, state: tuple[Any, Any]) -> tuple[Any, Any]:
        poses, rates = mb.integrate(system, *state, [0.0, dt], motor)
        return poses[-1], rates[-1]

    def whole_turn(turn: int, guess: float, state: tuple[Any, Any]) -> tuple[float, Any]:
        t, state = guess, after(guess, state)
        for _ in range(4):
            dt = float((TURN * turn - state[0][0, 2]) / state[1][0, 2])
            if abs(dt) < 1e-15:
                break
            t, state = t + dt, after(dt, state)
        return t, state

    for turn in range(1, PUMP_TURNS + 1):
        before = float(state[1][0, 2])
        period, state = whole_turn(turn, 0.1015, state)  # [s] a guess from below
    rate = float(state[1][0, 2])
    assert abs(rate - before) < 1e-10 * rate, "not settled"
    return period, rate


FIVE_BAR = (1.6, 0.8, 1.2)  # [m] distance of the pivots, cranks, rods
FIVE_BAR_START = (1.2, 2.2)  # [rad]


def five_bar(times: list[float]) -> Moved:
    """Two cranks and two rods, uniform, 1 kg a metre, from rest under gravity."""
    a, r, l = FIVE_BAR

    def rod(length: float, pose: tuple[float, float, float]) -> mb.Link:
        return mb.Link(length, length**3 / 12, (length / 2, 0.0), pose)

    left, right = FIVE_BAR_START
    B = r * np.exp(1j * left)
    D = a + r * np.exp(1j * right)
    half = (D - B) / 2
    C = B + half + 1j * half / abs(half) * math.sqrt(l**2 - abs(half) ** 2)
    links = {
        "left": rod(r, (0.0, 0.0, left)),
        "right": rod(r, (a, 0.0, right)),
        "i": rod(l, (B.real, B.imag, float(np.angle(C - B)))),
        "j": rod(l, (D.real, D.imag, float(np.angle(C - D)))),
    }
    ends = ((0.0, 0.0), (0.0, 0.0))
    joints = {
        "A": mb.Joint("R", ("frame", "left"), ends),
        "E": mb.Joint("R", ("frame", "right"), ((a, 0.0), (0.0, 0.0))),
        "B": mb.Joint("R", ("left", "i"), ((r, 0.0), (0.0, 0.0))),
        "D": mb.Joint("R", ("right", "j"), ((r, 0.0), (0.0, 0.0))),
        "C": mb.Joint("R", ("i", "j"), ((l, 0.0), (l, 0.0))),
    }
    drivers = {"left": mb.Driver(joint="A"), "right": mb.Driver(joint="E")}
    system = mb.System(links, joints, drivers, {}, GRAVITY)
    poses = mb.assemble(system, system.home, list(FIVE_BAR_START))
    return moved(system, (poses, 0 * poses), times, [0.0, 0.0], cranks=(0, 1))


N_LOOPS = 40
N_START = (math.pi / 2, -1.0)  # [rad, rad/s] upright, its upper joints at 1 m/s to the right


def n_four_bar(
    times: list[float], n: int = N_LOOPS, q0: float = N_START[0], rate0: float = N_START[1]
) -> tuple[Any, Any]:
    """Angle and rate of n parallelograms of uniform rods, 1 m and 1 kg, at times [s].

    All rockers are parallel and all couplers translate, so the chain is a pendulum:
    J q'' = -w cos q with J = (n + 1)/3 + n, w = g ((n + 1)/2 + n). With p = q + pi/2 and
    s^2 = w/J it holds p'^2/4 = e - s^2 sin^2(p/2). Where e > s^2 it turns: p/2 = am(W t + u0)
    with W^2 = e; else it swings: sin(p/2) = k sn(s t + u0), k^2 = e/s^2 (Whittaker,
    Analytical Dynamics, section 44). 30 digits.
    """
    with mp.workdps(30):
        J, w = mp.mpf(n + 1) / 3 + n, mp.mpf("9.81") * (mp.mpf(n + 1) / 2 + n)
        p0, s2 = mp.mpf(q0) + mp.pi / 2, w / J
        if q0 == math.pi / 2:
            p0 = mp.pi  # the upright position itself, not its nearest double
        e = mp.mpf(rate0) ** 2 / 4 + s2 * mp.sin(p0 / 2) ** 2
        way = -1 if rate0 < 0 else 1
        moved = _turning if e > s2 else _swinging
        rows = [moved(mp.mpf(t), p0, e, s2, way) for t in times]
        return (
            np.array([float(p - mp.pi / 2) for p, _ in rows]),
            np.array([float(rate) for _, rate in rows]),
        )


def _turning(t: Any, p0: Any, e: Any, s2: Any, way: int) -> tuple[Any, Any]:
    W, m = mp.sqrt(e), s2 / e
    K = mp.ellipk(m)
    u = mp.ellipf(p0 / 2, m) + way * W * t
    half_turns = mp.floor((u + K) / (2 * K))
    rest = u - 2 * K * half_turns
    am = mp.asin(mp.ellipfun("sn", rest, m=m)) + mp.pi * half_turns
    return 2 * am, way * 2 * W * mp.ellipfun("dn", rest, m=m)


def _swinging(t: Any, p0: Any, e: Any, s2: Any, way: int) -> tuple[Any, Any]:
    s, m = mp.sqrt(s2), e / s2
    k = mp.sqrt(m)
    u0 = mp.ellipf(mp.asin(mp.sin(p0 / 2) / k), m)
    u = u0 + way * s * t
    sn, cn, dn = (mp.ellipfun(name, u, m=m) for name in ("sn", "cn", "dn"))
    cos_half = mp.sqrt(1 - m * sn**2)
    return 2 * mp.asin(k * sn), way * 2 * k * s * cn * dn / cos_half


STEP = 0.02  # [s]
COLUMNS = 10  # of the extrapolation table: order 20


def watt_falling(q0: float, times: list[float], step: float = STEP) -> Any:
    """Angle and rate (n, 2) of the Watt six-bar from rest at q0, in extended precision.

    Gragg's midpoint rule extrapolated (Hairer, Norsett & Wanner, II.9) on the hand-written
    linkage of `tests/dynamics/linkages.py`.
    """
    real = np.longdouble

    def slope(y: Any) -> Any:
        J, tau, dJ, _ = watt_parts(BATCH, y[0], True)
        return np.array([y[1], (tau - dJ * y[1] ** 2 / 2) / J], dtype=real)

    def midpoint(y: Any, h: Any, n: int) -> Any:
        a, b = y, y + h / n * slope(y)
        for _ in range(n - 1):
            a, b = b, a + 2 * h / n * slope(b)
        return b

    def ahead(y: Any, h: Any) -> Any:
        table = []
        for j in range(1, COLUMNS + 1):
            row = [midpoint(y, h, 2 * j)]
            for k, before in enumerate(table[-1] if table else [], 1):
                row.append(row[-1] + (row[-1] - before) / ((real(j) / (j - k)) ** 2 - 1))
            table.append(row)
        return table[-1][-1]

    y, t, out = np.array([q0, 0], dtype=real), real(0), []
    for expected in times:
        n = max(1, math.ceil((expected - float(t)) / step))
        h = (real(expected) - t) / n
        for _ in range(n if expected > t else 0):
            y = ahead(y, h)
        t = real(expected)
        out.append(y)
    return np.array(out)


MACHINES: dict[str, tuple[Callable[[list[float]], Moved], list[float]]] = {
    "engine": (engine, [0.0, 0.01, 0.03, 0.06, 0.1]),
    "pump": (pump, [0.0, 0.05, 0.2, 0.5, 1.0]),
    "fivebar": (five_bar, [0.0, 0.2, 0.4, 0.6]),
}

if __name__ == "__main__":
    for name, (machine, times) in MACHINES.items():
        found = machine(times)
        print(
            name,
            json.dumps({"times": times, "q": found.q.T.tolist(), "rate": found.rate.T.tolist()}),
        )
    print("pump in its steady state: period, rate at whole turns", pump_cycle())
    angle, rate = n_four_bar([0.0, 0.25, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0])
    print("n_four_bar", json.dumps({"q": angle.tolist(), "rate": rate.tolist()}))
