"""A four-bar with a motor and a controller, in coordinates that know nothing of blockmech.

Three angles, of crank, coupler and rocker, with Lagrange's multipliers for the pin that closes
the loop; the controller's equations are written out, a sampled one instant by instant.

Data: Ruiz et al. 2010, the papers' four-bar; motor and gains are those of the tests.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, field

import numpy as np
from scipy.integrate import solve_ivp

EXACT = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-13}


@dataclass
class FourBar:
    """Pivots at 0 and ``ground``; links of lengths a, b, c with masses, inertias and centres."""

    ground: float = 5.5
    lengths: tuple[float, float, float] = (2.0, 6.0, 3.0)
    masses: tuple[float, float, float] = (4.8, 30.0, 7.2)
    inertias: tuple[float, float, float] = (1.7, 48.8, 5.5)
    centres: tuple[complex, complex, complex] = (1.0 + 0j, cmath.rect(2.8, 0.152), 1.5 + 0j)
    gravity: float = 9.81

    def angles(self, q: float) -> np.ndarray:
        """Angles of the three links at a crank angle; the pin is left of B -> D."""
        a, b, c = self.lengths
        B = a * cmath.exp(1j * q)
        d = self.ground - B
        inside = np.arccos((b * b + abs(d) ** 2 - c * c) / (2 * b * abs(d)))
        coupler = cmath.phase(d) + inside
        C = B + b * cmath.exp(1j * coupler)
        return np.array([q, coupler, cmath.phase(C - self.ground)])

    def rates(self, angles: np.ndarray, w: float) -> np.ndarray:
        """Rates of the three links at a rate of the crank."""
        J = self.jacobian(angles)
        return np.concatenate([[w], np.linalg.solve(J[:, 1:], -J[:, 0] * w)])

    def jacobian(self, angles: np.ndarray) -> np.ndarray:
        """Derivative (2, 3) of the gap in the pin."""
        a, b, c = self.lengths
        u = 1j * np.exp(1j * angles) * np.array([a, b, -c])
        return np.array([u.real, u.imag])

    def accelerations(self, angles: np.ndarray, w: np.ndarray, moment: float) -> np.ndarray:
        """Angular accelerations under a moment on the crank."""
        a, b, c = self.lengths
        m, I = self.masses, self.inertias
        e = np.exp(1j * angles)
        r = np.array(self.centres) * e
        u = 1j * a * e[0]  # velocity of B per unit rate of the crank
        v = 1j * r[1]
        M = np.zeros((3, 3))
        M[0, 0] = I[0] + m[0] * abs(r[0]) ** 2 + m[1] * a * a
        M[1, 1] = I[1] + m[1] * abs(r[1]) ** 2
        M[2, 2] = I[2] + m[2] * abs(r[2]) ** 2
        M[0, 1] = M[1, 0] = m[1] * (u * v.conjugate()).real
        centripetal = -a * e[0] * w[0] ** 2, -r[1] * w[1] ** 2
        bias = m[1] * (centripetal[0] + centripetal[1])
        weight = [-self.gravity * m[0] * r[0].real, -self.gravity * m[1] * v.imag]
        weight[0] -= self.gravity * m[1] * u.imag
        Q = np.array([weight[0], weight[1], -self.gravity * m[2] * r[2].real])
        Q -= np.array([(u * bias.conjugate()).real, (v * bias.conjugate()).real, 0.0])
        Q[0] += moment
        J = self.jacobian(angles)
        gap = -(np.exp(1j * angles) * np.array([a, b, -c]) * w**2).sum()
        whole = np.block([[M, J.T], [J, np.zeros((2, 2))]])
        return np.linalg.solve(whole, np.concatenate([Q, [-gap.real, -gap.imag]]))[:3]


@dataclass
class Motor:
    """R [ohm], L [H], k [N m/A]."""

    R: float = 1.0
    L: float = 0.1
    k: float = 10.0


@dataclass
class Sampled:
    """A PI controller of the rate at instants k T, its output between limits and held.

    The integral stays where it would drive the output further beyond a limit.
    """

    kp: float
    ki: float
    setpoint: float
    T: float
    limits: tuple[float, float]
    linkage: FourBar = field(default_factory=FourBar)
    motor: Motor = field(default_factory=Motor)

    def run(self, q: float, t_end: float) -> dict[str, float]:
        """From rest to a time that is an instant; values just before that instant."""
        start = self.linkage.angles(q)
        y, total, held = np.concatenate([start, np.zeros(3), [0.0]]), 0.0, 0.0
        for _ in range(round(t_end / self.T)):
            e = self.setpoint - y[3]
            v = self.kp * e + self.ki * total
            low, high = self.limits
            held = min(max(v, low), high)
            if not ((v > high and self.ki * e > 0) or (v < low and self.ki * e < 0)):
                total += self.T * e

            def rate(t: float, y: np.ndarray, u: float = held) -> np.ndarray:
                moment = self.motor.k * y[6]
                al = self.linkage.accelerations(y[:3], y[3:6], moment)
                di = (u - self.motor.R * y[6] - self.motor.k * y[3]) / self.motor.L
                return np.concatenate([y[3:6], al, [di]])

            y = solve_ivp(rate, (0.0, self.T), y, **EXACT).y[:, -1]
        return {"q": y[0], "rate": y[3], "current": y[6], "integral": total, "output": held}


@dataclass
class Continuous:
    """kp e + ki I + kd n (e - x_f), the trial's controller in continuous time."""

    kp: float
    ki: float
    kd: float
    n: float
    setpoint: float
    linkage: FourBar = field(default_factory=FourBar)
    motor: Motor = field(default_factory=Motor)

    def run(self, q: float, times: list[float]) -> np.ndarray:
        """q, rate, I, x_f and current (5, m) at times, from rest."""
        y0 = np.concatenate([self.linkage.angles(q), np.zeros(6)])

        def rate(t: float, y: np.ndarray) -> np.ndarray:
            e = self.setpoint - y[3]
            u = self.kp * e + self.ki * y[7] + self.kd * self.n * (e - y[8])
            al = self.linkage.accelerations(y[:3], y[3:6], self.motor.k * y[6])
            di = (u - self.motor.R * y[6] - self.motor.k * y[3]) / self.motor.L
            return np.concatenate([y[3:6], al, [di, e, self.n * (e - y[8])]])

        result = solve_ivp(rate, (0.0, times[-1]), y0, t_eval=times, **EXACT).y
        return result[[0, 3, 7, 8, 6]]


@dataclass
class Stopped:
    """A wheel whose angle a PI controller leads beyond a stop at 1 rad, from rest at 0.

    Flight by flight: the rate after a blow is ``-restitution`` times that before; a rate below
    1e-6 rad/s is none any more, and then the wheel lies there until the motor pulls it away.
    With a ``sample`` the controller switches at the instants, its output between limits.
    """

    restitution: float
    sample: float | None = None
    inertia: float = 2.0
    kp: float = 8.0
    ki: float = 6.0
    limits: tuple[float, float] = (-20.0, 20.0)
    motor: Motor = field(default_factory=lambda: Motor(1.0, 0.1, 1.5))

    def setpoint(self, t: float) -> float:
        """Straight lines from 2 rad, back to -1 rad, and to 3 rad."""
        return float(np.interp(t, [0.0, 1.0, 2.0, 3.0, 4.0], [2.0, 2.0, -1.0, -1.0, 3.0]))

    def run(self, t_end: float) -> tuple[np.ndarray, list[float]]:
        """Angle, rate, integral and current (4,) at the end, and the times of all blows."""
        corners = {1.0, 2.0, 3.0, 4.0, t_end}
        if self.sample is not None:
            corners |= {k * self.sample for k in range(1, math.ceil(t_end / self.sample))}
        y, t, lies, held, blows = np.zeros(4), 0.0, False, 0.0, list[float]()
        for corner in sorted(x for x in corners if x <= t_end):
            if self.sample is not None:
                due = abs(t / self.sample - round(t / self.sample)) < 1e-9
                held = self._switched(t, y) if due else held
            while t < corner:
                t, y, lies = self._ahead(t, corner, y, lies, held, blows)
        return y, blows

    def _switched(self, t: float, y: np.ndarray) -> float:
        """The output from an instant on; the integral of y goes on by a sample."""
        e = self.setpoint(t) - y[0]
        v, (low, high) = self.kp * e + self.ki * y[2], self.limits
        if not ((v > high and e > 0) or (v < low and e < 0)):
            y[2] += self.sample * e
        return min(max(v, low), high)

    def _ahead(
        self, t: float, corner: float, y: np.ndarray, lies: bool, held: float, blows: list[float]
    ) -> tuple[float, np.ndarray, bool]:
        """To the next blow, to where the wheel is pulled away, or to the corner."""
        m, free = self.motor, not lies

        def rate(t: float, y: np.ndarray) -> list[float]:
            e = self.setpoint(t) - y[0]
            u = self.kp * e + self.ki * y[2] if self.sample is None else held
            pull = m.k * y[3] / self.inertia
            integral = e if self.sample is None else 0.0
            return [free * y[1], free * pull, integral, (u - m.R * y[3] - m.k * y[1]) / m.L]

        def met(t: float, y: np.ndarray) -> float:
            if lies:
                return -y[3]
            return y[0] - 1.0 if y[1] > 0 else -1.0

        met.terminal, met.direction = True, 1
        if lies and y[3] <= 0:
            return t, y, False
        struck = free and y[0] == 1.0 and y[1] < 0
        flight = 2 * -y[1] * self.inertia / (m.k * abs(y[3])) if struck else np.inf
        steps = {"max_step": flight / 3}  # after a blow: none goes over the next
        trajectory = solve_ivp(
            rate, (t, min(corner, t + 2 * flight)), y, events=met, **EXACT, **steps
        )
        t, y = trajectory.t[-1], trajectory.y[:, -1].copy()
        if trajectory.status == 0:
            return t, y, lies
        if lies:
            y[3] = min(y[3], 0.0)
            return t, y, False
        blows.append(t)
        y[0], y[1] = 1.0, -self.restitution * y[1]
        lies = abs(y[1]) < 1e-6
        y[1] = 0.0 if lies else y[1]
        return t, y, lies


@dataclass
class Pump:
    """A slider-crank pump under speed control, by its crank angle alone.

    Kinetic energy J(q) q'^2 / 2 in closed form, J' by a complex step; a spring and damper push
    on the plunger. The setpoint is a ramp to 60 rad/s in 0.4 s, the tachometer's filter has 10 ms.
    Data: ``graphs/pump.json``.
    """

    crank: float = 0.05
    rod: float = 0.2
    kp: float = 1.0
    ki: float = 8.0
    motor: Motor = field(default_factory=lambda: Motor(0.5, 0.005, 0.25))

    def inertia(self, q: complex) -> complex:
        """On the crank [kg m2]: crank, rod (centre in its middle), plunger."""
        r, l = self.crank, self.rod
        tilt = np.sqrt(1 - (r * np.sin(q) / l) ** 2)  # cosine of the rod's angle
        turn = -r * np.cos(q) / (l * tilt)  # of the rod per turn of the crank
        slide = self.slide(q)
        x = -r * np.sin(q) + (slide + r * np.sin(q)) / 2
        y = r * np.cos(q) / 2
        return 0.02 + 0.8 * (x**2 + y**2) + 0.003 * turn**2 + 1.5 * slide**2

    def slide(self, q: complex) -> complex:
        """How far the plunger goes per turn of the crank [m/rad]."""
        r, l = self.crank, self.rod
        side = r * np.sin(q)
        return -side - side * r * np.cos(q) / np.sqrt(l**2 - side**2)

    def run(self, times: list[float]) -> np.ndarray:
        """q, rate, filtered rate, integral and current (5, m) at times, from rest."""

        def rate(t: float, y: np.ndarray) -> list[float]:
            q, w, seen, total, current = y
            e = min(150.0 * t, 60.0) - seen
            J, bend = self.inertia(q), self.inertia(q + 1e-30j).imag / 1e-30
            x = self.crank * np.cos(q) + np.sqrt(self.rod**2 - (self.crank * np.sin(q)) ** 2)
            slide = self.slide(q)
            push = 3000.0 * (0.2 - x) - 60.0 * slide * w
            m = self.motor
            acc = (m.k * current + push * slide - bend * w * w / 2) / J
            u = self.kp * e + self.ki * total
            di = (u - m.R * current - m.k * w) / m.L
            return [w, acc, (w - seen) / 0.01, e, di]

        y, t, rows = np.zeros(5), 0.0, {}
        for corner in sorted({*times, 0.4}):
            y = solve_ivp(rate, (t, corner), y, **EXACT).y[:, -1]
            t, rows[corner] = corner, y
        return np.array([rows[t] for t in times]).T
