r"""The equation of motion as a right-hand side y' = f(t, y), for integrators in time.

One driver:       y = (q, q', W),       J q'' = tau_all - J' q'^2 / 2
k drivers:        y = (q, q', W),       M q'' = Q - c,    q and q' of length k

W is the work of all loads since the start: the kinetic energy must have grown by as
much, so the balance of energy is at hand at no cost.

The right-hand side of one driver reads either the kernels, one pose at a time, or the
reduced table. Impossible poses give NaN, never an exception.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from blockmech.dynamics.chebyshev import Floats
from blockmech.dynamics.integration.table import Table, tabulated
from blockmech.dynamics.system.claims import splits, typical_speed
from blockmech.dynamics.system.reduced import (
    TURN,
    Metered,
    MeteredSystems,
    One,
    ReducedSystem,
    Terms,
)

RightSide: TypeAlias = Callable[[float, Any], Any]

AROUND = 7  # poses that tell the size of the inertia


@dataclass(frozen=True)
class Equation:
    """A right-hand side, and what an integrator has to know of it.

    Attributes
    ----------
    drivers : k
    rhs : (t, y) -> y', sequences of 2k + 1 floats
    margin : y -> smallest margin, or None where it stays safely above zero
    inertia : y -> J over its largest value [-], or None where it is known to be no trouble
    kinetic : y -> kinetic energy [J]
    speed : [rad/s or m/s] a typical speed, for the tolerances
    source : "kernels" or "table", and the table's error where there is one
    """

    drivers: int
    rhs: RightSide
    margin: Callable[[Any], float] | None
    kinetic: Callable[[Any], float]
    speed: float
    source: str
    table_error: float = 0.0
    inertia: Callable[[Any], float] | None = None


def from_kernels(meter: Metered, q0: float, qd0: float, t0: float) -> Equation:
    """One driver, every evaluation by the scalar kernels."""
    one = meter.one
    last: tuple[float, float, One] = (math.nan, math.nan, One(*4 * [math.nan]))
    typical = _typical_inertia(meter, q0)

    def here(y: Any) -> One:
        """The pose of a state; surfaces ask for the same one, one after the other."""
        nonlocal last
        q, qd = float(y[0]), float(y[1])
        if last[:2] != (q, qd):
            last = q, qd, one(q, qd, t0)
        return last[2]

    def rhs(t: float, y: Any) -> tuple[float, float, float]:
        nonlocal last
        q, qd = float(y[0]), float(y[1])
        J, tau, dJ, margin = found = one(q, qd, t)
        last = q, qd, found  # margin and inertia of a state do not depend on the time
        if not (margin > 0 and J > 0):
            return math.nan, math.nan, math.nan
        return qd, (tau - 0.5 * dJ * qd * qd) / J, tau * qd

    def margin(y: Any) -> float:
        return here(y).margin

    def inertia(y: Any) -> float:
        return here(y).J / typical

    def kinetic(y: Any) -> float:
        return 0.5 * one(float(y[0]), 0.0, t0).J * float(y[1]) ** 2

    speed = typical_speed(one(q0, qd0, t0), qd0)
    return Equation(1, rhs, margin, kinetic, speed, "kernels", inertia=inertia)


def _typical_inertia(meter: Metered, q0: float) -> float:
    """Usual inertia at a few poses around the start [kg m2 or kg]; it may have no bound."""
    system = meter.system
    span = system.period or (TURN if system.kind == "rotation" else system.span)
    found = [meter.pose(q0 + span * k / AROUND).J for k in range(AROUND)]
    good = [J for J in found if math.isfinite(J) and J > 0]
    return float(np.median(good)) if good else 1.0


def from_table(meter: Metered, table: Table, qd0: float) -> Equation:
    """One driver, the position-dependent parts from the reduced table."""
    parts = table.parts()
    extra = meter.system.rate_load_one
    if extra is None:

        def rhs(t: float, y: Any) -> tuple[float, float, float]:
            q, qd, _ = y.tolist()
            J, dJ, tau, damping = parts(q)
            tau -= damping * qd
            return qd, _over(tau - 0.5 * dJ * qd * qd, J), tau * qd

    else:

        def rhs(t: float, y: Any) -> tuple[float, float, float]:
            q, qd, _ = y.tolist()
            J, dJ, tau, damping = parts(q)
            tau += extra(q, qd, t) - damping * qd
            return qd, _over(tau - 0.5 * dJ * qd * qd, J), tau * qd

    def kinetic(y: Any) -> float:
        return 0.5 * parts(float(y[0]))[0] * float(y[1]) ** 2

    J = min(row[0][0] for row in table.rows)
    tau = max(abs(row[2][0]) for row in table.rows)
    speed = abs(qd0) + (math.sqrt(2 * tau / J) if J > 0 else 0.0)
    return Equation(1, rhs, None, kinetic, speed or 1.0, "table", table.error)


def _over(effort: float, J: float) -> float:
    """Acceleration; none where the reduced inertia vanishes, e.g. of a yoke at its end."""
    return effort / J if J else math.nan


def one_driver(
    meter: Metered, q0: float, qd0: float, t0: float, accuracy: float, span: float = 0.0
) -> Equation:
    """The cheaper right-hand side that is good enough: the table, else the kernels.

    ``span`` [s] is the length of the run where it is known: the error of the table's
    effort adds up along the way.
    """
    if may_be_tabulated(meter.system) and splits(meter, q0, qd0, t0):
        way = max(1.0, span * typical_speed(meter.one(q0, qd0, t0), qd0))
        table = tabulated(meter, max(accuracy / way / 100, 1e-13))
        if table is not None:
            return from_table(meter, table, qd0)
    return from_kernels(meter, q0, qd0, t0)


def may_be_tabulated(system: ReducedSystem) -> bool:
    """Whether a table could serve: of a period that repeats, of parts that are known."""
    free = all(map(math.isinf, system.bounds)) and not system.knots
    depends = system.depends_on
    told = depends <= {"q"} or system.rate_load_one is not None
    told |= system.damped and "time" not in depends
    return system.period is not None and free and told


def several_drivers(meter: MeteredSystems, q0: Floats, qd0: Floats, t0: float) -> Equation:
    """k drivers: M q'' = Q - c by Cholesky, in plain Python."""
    k = meter.systems.drivers
    terms = meter.terms

    def rhs(t: float, y: Any) -> list[float]:
        q, qd = y[:k], y[k : 2 * k]
        M, c, Q, margin = terms(q, qd, t)
        if not margin > 0:
            return [math.nan] * (2 * k + 1)
        loads, rates = Q.tolist(), qd.tolist()
        right = [a - b for a, b in zip(loads, c.tolist(), strict=True)]
        power = sum(a * b for a, b in zip(loads, rates, strict=True))
        return [*rates, *cholesky_solved(M.tolist(), right), power]

    def margin(y: Any) -> float:
        return terms(y[:k], y[k : 2 * k], t0).margin

    def kinetic(y: Any) -> float:
        found: Terms = terms(y[:k], y[k : 2 * k], t0)
        return 0.5 * float(y[k : 2 * k] @ found.M @ y[k : 2 * k])

    first = terms(q0, qd0, t0)
    falls = np.abs(first.Q) / np.diag(first.M)
    speed = float(np.abs(qd0).max() + np.sqrt(2 * falls.max()))
    return Equation(k, rhs, margin, kinetic, speed or 1.0, "kernels")


def cholesky_solved(M: list[list[float]], right: list[float]) -> list[float]:
    """Solve M x = right, M symmetric and positive definite; NaN where it is not."""
    k = len(right)
    L = [[0.0] * k for _ in range(k)]
    x = list(right)
    for i in range(k):
        for j in range(i + 1):
            s = M[i][j] - sum(L[i][m] * L[j][m] for m in range(j))
            if i > j:
                L[i][j] = s / L[j][j]
            elif s > 0:
                L[i][i] = math.sqrt(s)
            else:
                return [math.nan] * k
        x[i] = (x[i] - sum(L[i][m] * x[m] for m in range(i))) / L[i][i]
    for i in reversed(range(k)):
        x[i] = (x[i] - sum(L[m][i] * x[m] for m in range(i + 1, k))) / L[i][i]
    return x
