"""The reduced system: all that forward dynamics knows of a mechanism.

The reduction pass turns a scene with one driver into an inertia and an effort on
the driver's coordinate q (an angle or a distance),

    J(q) q'' + J'(q) q'^2 / 2 = tau(q, q', t)

and one with several drivers into  M(q) q'' + c(q, q') = Q(q, q', t).  The numbers
come from functions that a `ReducedSystem` or `ReducedSystems` carries; `Metered`
counts how often they are asked. Contract of those functions:

 1. They never raise on a pose: impossible samples are NaN, or have margin <= 0.
 2. ``margin`` is the smallest squared normalised determinant over all groups.
 3. Batch functions take and return float arrays (n,); scalar ones Python floats.
 4. The effort splits as  tau(q, q', t) = tau(q) - damping(q) q' + rate_load(q, q', t).
    ``tau`` holds weights, springs and whatever else depends on q alone;
    ``damping`` linear dampers; ``rate_load`` the rest, by preference only loads on
    the driver's own coordinate (a motor), which need no kernel.

Units: q [rad] or [m], J [kg m2] or [kg], tau [N m] or [N], damping [N m s] or [N s/m].
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from blockmech.dynamics.chebyshev import Floats
from blockmech.dynamics.until import Progress

TURN = 2 * math.pi
SOME = 8  # single poses between two reports of a search

Kind: TypeAlias = Literal["rotation", "translation"]
Depends: TypeAlias = frozenset[str]  # of {"q", "rate", "time"}

POSITION: Depends = frozenset({"q"})


class Sample(NamedTuple):
    """What a batch of driver coordinates yields; arrays (n,)."""

    J: Floats  # [kg m2 or kg]
    tau: Floats  # [N m or N] the part of the effort that depends on q alone
    margin: Floats  # [-]
    dJ: Floats | None = None  # dJ/dq, where wanted
    damping: Floats | None = None  # where wanted


class One(NamedTuple):
    """What one state yields; floats."""

    J: float
    tau: float  # all loads, at (q, q', t)
    dJ: float
    margin: float


class Terms(NamedTuple):
    """Equation of motion M q'' + c = Q of k drivers at one state."""

    M: Floats  # (k, k)
    c: Floats  # (k,)
    Q: Floats  # (k,)
    margin: float


BatchFunction: TypeAlias = Callable[[Floats, frozenset[str]], Sample]
OneFunction: TypeAlias = Callable[[float, float, float], tuple[float, float, float, float]]
RateLoad: TypeAlias = Callable[[Floats, Floats, float], Floats]
RateLoadOne: TypeAlias = Callable[[float, float, float], float]


@dataclass(frozen=True)
class ReducedSystem:
    """One driver: functions that sample it, and what its loads depend on.

    Attributes
    ----------
    sample : (q (n,), wanted) -> Sample; ``wanted`` is a subset of {"dJ", "damping"}
    one : (q, q', t) -> (J, tau, dJ, margin), floats, with all loads
    pose : the same with dJ = NaN, where that costs less; None: ``one`` serves
    kind : "rotation" or "translation"
    period : period of J, tau and damping in q, or None (a spring on the crank itself)
    arc : feasible driver coordinates where known beforehand; dead centres bound it
    stops : (low, high) end stops of the driver, infinite where there is none
    depends_on : what the loads depend on, of {"q", "rate", "time"}
    damped : whether ``damping`` is not zero
    rate_load, rate_load_one : the effort that is neither tau(q) nor linear damping
    rate_load_kernels : whether ``rate_load`` needs a kernel evaluation per sample
    knots : driver coordinates [rad or m] at which a load has a kink (one period)
    time_knots : times [s] at which a load has a kink
    time_period : [s] after which all loads of the time repeat; 0 where that is not known
    span : a length over which J and tau change, for drivers without a period
    lossless : whether all loads have a potential with that period: no net work in a period
    load_size : q -> sum of the magnitudes of the contributions to tau there
    """

    sample: BatchFunction
    one: OneFunction
    kind: Kind = "rotation"
    period: float | None = TURN
    arc: tuple[float, float] | None = None
    stops: tuple[float, float] = (-math.inf, math.inf)
    depends_on: Depends = POSITION
    damped: bool = False
    rate_load: RateLoad | None = None
    rate_load_one: RateLoadOne | None = None
    rate_load_kernels: bool = False
    knots: tuple[float, ...] = ()
    time_knots: tuple[float, ...] = ()
    time_period: float = 0.0
    span: float = 1.0
    load_size: Callable[[float], float] | None = None
    pose: OneFunction | None = None
    lossless: bool = False

    @property
    def bounds(self) -> tuple[float, float]:
        """Smallest and largest driver coordinate that arc and stops allow [rad or m]."""
        low, high = self.arc or (-math.inf, math.inf)
        return max(low, self.stops[0]), min(high, self.stops[1])


@dataclass(frozen=True)
class ReducedSystems:
    """Several drivers.

    ``terms`` is (q (k,), q' (k,), t) -> Terms. ``time_period`` [s] is that of the loads of
    the time, ``periods`` [rad] those of the place by driver; 0 where there is none or it is
    not known.
    """

    drivers: int
    terms: Callable[[Floats, Floats, float], Terms]
    depends_on: Depends = POSITION
    time_knots: tuple[float, ...] = ()
    time_period: float = 0.0
    periods: tuple[float, ...] = ()


class Cost(NamedTuple):
    """What a run cost in kernel evaluations."""

    samples: int = 0  # samples in batches
    calls: int = 0  # batch calls
    singles: int = 0  # single poses

    @property
    def evaluations(self) -> int:
        """Samples and single poses together."""
        return self.samples + self.singles


@dataclass
class Metered:
    """A reduced system that counts its evaluations; one per run.

    ``interrupted`` is set where a run was stopped and keeps what it has.
    """

    system: ReducedSystem
    samples: int = 0
    calls: int = 0
    singles: int = 0
    _nothing: frozenset[str] = field(default=frozenset(), repr=False)
    progress: Progress | None = field(default=None, repr=False)
    interrupted: bool = False

    def sample(self, q: Floats, wanted: frozenset[str] = frozenset()) -> Sample:
        """A batch of any shape, counted."""
        self.samples += q.size
        self.calls += 1
        if self.progress is not None:
            self.progress("sampling", float(self.samples), None)
        flat = self.system.sample(q.ravel(), wanted)
        if q.ndim == 1:
            return flat
        return Sample(*(None if f is None else f.reshape(q.shape) for f in flat))  # type: ignore[arg-type]

    def one(self, q: float, qd: float = 0.0, t: float = 0.0) -> One:
        """One state, counted."""
        self.singles += 1
        return One(*self.system.one(q, qd, t))

    def pose(self, q: float, qd: float = 0.0, t: float = 0.0) -> One:
        """One state without dJ, counted: no acceleration is computed for it."""
        self.singles += 1
        if self.progress is not None and self.singles % SOME == 0:  # a search may be long
            self.progress("searching", float(self.singles), None)
        return One(*(self.system.pose or self.system.one)(q, qd, t))

    def rate_load(self, q: Floats, qd: Floats, t: float = 0.0) -> Floats | float:
        """The rest of the effort on a batch; counted where it needs kernels."""
        if self.system.rate_load is None:
            return 0.0
        if self.system.rate_load_kernels:
            self.samples += q.size
            self.calls += 1
        return self.system.rate_load(q, qd, t)

    @property
    def cost(self) -> Cost:
        """Evaluations so far."""
        return Cost(self.samples, self.calls, self.singles)


@dataclass
class MeteredSystems:
    """Several drivers, with the evaluations counted; one per run."""

    systems: ReducedSystems
    singles: int = 0

    def terms(self, q: Floats, qd: Floats, t: float) -> Terms:
        """Terms of the equation of motion at one state, counted."""
        self.singles += 1
        return self.systems.terms(q, qd, t)

    @property
    def cost(self) -> Cost:
        """Evaluations so far."""
        return Cost(singles=self.singles)


def feasible(sample: Sample) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """Where a batch is possible: margin above zero and everything finite."""
    return np.asarray(
        (sample.margin > 0) & np.isfinite(sample.J) & (sample.J > 0) & np.isfinite(sample.tau)
    )
