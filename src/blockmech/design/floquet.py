r"""Multipliers of Floquet: what a period of a motion makes of small disturbances.

A periodic motion has no constant A; disturbances z grow or fade each period by the eigenvalues of

    Phi' = A(t) Phi,    Phi(0) = 1,

after a period, integrated by Gauss's method of order eight from exact A(t).

Sources: Hairer, Norsett & Wanner, Solving ODEs I, II.7 (Gauss); Floquet 1883; Meirovitch,
Fundamentals of Vibrations, 2001, ch. 7.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from blockmech.analysis.equilibrium import companion
from blockmech.dynamics.programs import tangents
from blockmech.functions.roots import SCANNED
from blockmech.ground.arguments import declared
from blockmech.ground.errors import refused
from blockmech.ground.report import Facts, Report
from blockmech.result.result import Result
from blockmech.typing import Floats

if TYPE_CHECKING:
    from blockmech.compiled import Compiled

STAGES = 4  # of Gauss's method: order eight
STEPS = SCANNED // 2  # of a period


@dataclass(frozen=True, repr=False)
class Floquet(Facts, Report):
    """Growth of small disturbances over a period of a motion.

    Attributes
    ----------
    period : [s]
    monodromy : (2k, 2k), the disturbance (x, x') after a period by that before it
    multipliers : (2k,) its eigenvalues, the largest first
    """

    period: float
    monodromy: Floats
    multipliers: NDArray[np.complex128]

    @property
    def exponents(self) -> NDArray[np.complex128]:
        """Mean rates [1/s] at which disturbances grow: ln(multiplier) / period."""
        with np.errstate(divide="ignore"):
            return np.asarray(np.log(self.multipliers.astype(complex)) / self.period)

    def lines(self) -> Iterator[str]:
        """The period and the multipliers."""
        yield f"period {self.period:.9g} s"
        yield from (f"multiplier {_shown(complex(z))}" for z in self.multipliers.tolist())


def _shown(z: complex) -> str:
    return f"{z.real:.9g}" if not z.imag else f"{abs(z):.9g} at {math.degrees(cmath.phase(z)):.4g}°"


@declared
def floquet(mechanism: Compiled, motion: Result, *, steps: int = STEPS) -> Floquet:
    """Floquet multipliers of a periodic motion, from exact derivatives along it.

    Parameters
    ----------
    motion : a steady state, ``mechanism.simulate("steady")``, whose motion has a period
    steps : number of steps of order eight per period

    Raises `RequestError` for a motion without a period, and for joint friction, which jumps where
    a slip reverses.

    >>> pump = bm.read("graphs/pump.json").compile()
    >>> floquet = bm.design.floquet(pump, pump.simulate("steady"))
    >>> print(abs(floquet.multipliers).max().round(6))
    1.0
    """
    steady = motion.motion
    if steady is None or "period" not in steady.facts:
        raise refused("motion", "it has no period", 'give a steady state: simulate("steady")')
    if mechanism.frictional_joints and motion.settings.get("friction") != "none":
        raise refused(
            "motion", "joint friction jumps where slips reverse", 'simulate with friction="none"'
        )
    period, k = float(steady.facts["period"]), len(mechanism.drivers)
    nodes, weights = np.polynomial.legendre.leggauss(STAGES)
    c, b = (nodes + 1) / 2, weights / 2
    powers = np.vander(c, STAGES, increasing=True)
    a = (c[:, None] ** np.arange(1, STAGES + 1) / np.arange(1, STAGES + 1)) @ np.linalg.inv(powers)
    h = period / steps
    t = steady.t_start + h * (np.arange(steps)[:, None] + c).ravel()
    state = steady.track.state(t)
    q, qd = np.reshape(state.q, (-1, k)), np.reshape(state.qd, (-1, k))
    resting = tangents(mechanism, q, qd, t=t)
    qdd = -np.linalg.solve(resting.M, resting.effort[..., None])[..., 0]
    of = tangents(mechanism, q, qd, qdd, t)
    A = np.array([companion(*row) for row in zip(of.M, of.C, of.K, strict=True)])
    A = A.reshape(steps, STAGES, 2 * k, 2 * k)
    monodromy, identity = np.eye(2 * k), np.eye(STAGES * 2 * k)
    for step in A:
        blocks = np.einsum("ij,jab->iajb", a, step).reshape(identity.shape)
        stages = np.linalg.solve(identity - h * blocks, np.tile(monodromy, (STAGES, 1)))
        rates = np.einsum("jab,jbc->jac", step, stages.reshape(STAGES, 2 * k, 2 * k))
        monodromy = monodromy + h * np.einsum("j,jac->ac", b, rates)
    values = np.linalg.eigvals(monodromy).astype(complex)
    return Floquet(period, monodromy, values[np.argsort(-np.abs(values), kind="stable")])
