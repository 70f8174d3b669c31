"""Programs of the equation of motion, and what they yield.

One driver at many states, all drivers at one state, and the sizes of their loads: each is what
passes leave of a structure in its scene where nothing else is asked for, without joint friction.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from blockmech.dynamics import loads
from blockmech.dynamics.source import FRICTIONLESS, Source, margins
from blockmech.engines.llvm import SingleEvaluator
from blockmech.engines.scalar import AdaptiveEvaluator
from blockmech.passes import friction, reduction, signals
from blockmech.passes.homotopy import schedule
from blockmech.typing import Floats


class Sample(NamedTuple):
    """What a batch of states of one driver yields; arrays (n,)."""

    J: Floats  # [kg m2 or kg]
    tau: Floats  # [N m or N] all loads at (q, q', t)
    margin: Floats  # [-]
    size: Floats | None = None  # [N m or N] see `loads.load_size`, where tau is made of loads

    @property
    def possible(self) -> NDArray[np.bool_]:
        """Where the mechanism closes and everything is a number."""
        return np.asarray((self.margin > 0) & np.isfinite(self.J) & np.isfinite(self.tau))


class ScalarTerms(NamedTuple):
    """What one state of one driver yields; floats."""

    J: float
    tau: float
    dJ: float  # dJ/dq
    margin: float


class Terms(NamedTuple):
    """Equation of motion M q'' + c = Q of k drivers at one state."""

    M: Floats  # (k, k)
    c: Floats  # (k,)
    Q: Floats  # (k,)
    margin: float


def reduced(compiled: Source) -> AdaptiveEvaluator:
    """J, tau, the load's size, then the margins, of one driver; no acceleration is computed."""
    s = schedule(compiled.structure, compiled.scene, FRICTIONLESS)
    (driver,) = compiled.structure.drivers
    values = [s.ask(reduction.inertia, driver, driver), s.ask(reduction.reduced_load, driver)]
    return AdaptiveEvaluator(s.program([*values, loads.load_size(s, driver), *margins(s)]))


def load_sizes(compiled: Source) -> AdaptiveEvaluator:
    """The sizes of the loads on all drivers."""
    s = schedule(compiled.structure, compiled.scene, FRICTIONLESS)
    return AdaptiveEvaluator(
        s.program([loads.load_size(s, driver) for driver in compiled.structure.drivers])
    )


def equation(compiled: Source) -> SingleEvaluator:
    """M, Q, c (one driver: dJ/dq), what signals add, then the margins, at one state."""
    return _equation(compiled, deflections=False)


def equation_with_deflections(compiled: Source) -> SingleEvaluator:
    """The same, with the rates of the states of friction laws behind those of signals."""
    return _equation(compiled, deflections=True)


def _equation(compiled: Source, deflections: bool) -> SingleEvaluator:
    s = schedule(compiled.structure, compiled.scene, FRICTIONLESS)
    drivers = compiled.structure.drivers
    M = [s.ask(reduction.inertia, k, m) for k in drivers for m in drivers]
    Q = [s.ask(reduction.reduced_load, k) for k in drivers]
    rule = reduction.inertia_slope if len(drivers) == 1 else reduction.bias
    c = [s.ask(rule, k) for k in drivers]
    signal_rates = [*signals.rates(s), *(friction.deflection_rates(s) if deflections else ())]
    signal_rates += signals.kinks(s)
    return SingleEvaluator(s.program([*M, *Q, *c, *signal_rates, *margins(s)]))


def load_inputs(compiled: Source) -> tuple[str, ...]:
    """What the loads reduced to the drivers are made of: inputs of a program that gives them."""
    s = schedule(compiled.structure, compiled.scene, FRICTIONLESS)
    loads = [s.ask(reduction.reduced_load, k) for k in compiled.structure.drivers]
    return s.program(loads).inputs
