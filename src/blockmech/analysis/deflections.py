r"""Deflections of bristles along a given motion: the states of friction laws that remember.

The rate of a state follows the slip of its pair alone, not the load (rule 8 of
`blockmech.friction.laws.contract`), so in a motion that is given each is one scalar equation

    dz/dt = rate(slip(t), z)

which is solved before the forces are asked for. What z is where a motion begins:

 - in a motion that repeats itself, that after which it comes back: the slip of a period makes
   of z another z, and a pair forgets, so that map has one fixed point, by Aitken's rule at once;
 - else 0, of bristles that were never loaded, where the laws of motion of the drivers begin;
 - where no law of motion says what was before (rates that are given for each sample), the pair
   counts as having slipped at its rate for long: by the steady curve of its law.

The slip is a Chebyshev series of the time, and each piece between its zeros, at which the rate
has a kink, is integrated by LSODA.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

from blockmech.compiled import Compiled
from blockmech.engines.binding import bind_functions
from blockmech.engines.interpreters import NumpyEngine
from blockmech.engines.numpy import primitives
from blockmech.friction.laws.contract import FrictionLaw
from blockmech.functions.series import Series, fit, panels
from blockmech.ground.errors import refused
from blockmech.ground.tolerances import HALVINGS
from blockmech.model.laws_of_motion import ConstantRate, Harmonic
from blockmech.passes import forward
from blockmech.passes.homotopy import schedule
from blockmech.passes.signals import STATE
from blockmech.plan.plan import Friction, Plan
from blockmech.result.samples import Samples
from blockmech.typing import Floats, Kernel, Record

PANELS = 16  # of a motion to begin with
RELATIVE, ABSOLUTE = 1e-11, 1e-13  # tolerances of the integration; the second of the size of z


def _with_deflections(mechanism: Compiled, samples: Samples) -> Samples:
    """Samples with the states of friction laws among their inputs."""
    structure = mechanism.structure
    course: Course = mechanism._once(Course)
    z = course.at(samples)
    names = (f"{STATE}{structure.states[ref]}" for ref in structure.remembering)
    return replace(samples, inputs={**samples.inputs, **dict(zip(names, z, strict=True))})


def refuse_deflections(mechanism: Compiled, plan: Plan, subject: str) -> None:
    """Refuse what would take the deflections of one design for those of others."""
    structure = mechanism.structure
    read = [
        ref
        for ref in structure.remembering
        if f"{STATE}{structure.states[ref]}" in plan.program.inputs
    ]
    if read:
        message = f"{subject} of what friction laws with a state make along a motion"
        remedy = 'leave joint friction out with friction="none", or compare runs of single designs'
        raise refused(str(read[0]), message, remedy, code="friction-state")


class Piece(NamedTuple):
    """The states of one pair between two times, as a function of the time."""

    begin: float
    end: float
    z: Callable[[Floats], Floats]


@dataclass
class Course:
    """The given motion of a mechanism by its drivers' laws, and the states along it."""

    mechanism: Compiled

    def __post_init__(self) -> None:
        structure, scene = self.mechanism.structure, self.mechanism.scene
        self.pairs = structure.remembering
        self.laws: list[FrictionLaw] = [structure.friction_law(ref) for ref in self.pairs]
        s = schedule(structure, scene, Friction("none"))
        self._slips = NumpyEngine(s.program([s.ask(forward.slip, ref) for ref in self.pairs]))
        self._known: dict[tuple[int, float], list[Piece]] = {}

    def at(self, samples: Samples) -> Floats:
        """States (m, n) of the pairs at samples."""
        return np.array([self.of(j, samples) for j in range(len(self.pairs))])

    def of(self, j: int, samples: Samples) -> Floats:
        """States (n,) of one pair at samples."""
        t = samples.time
        if samples.at_rest:
            return np.zeros(samples.n)
        if t is not None and np.isfinite(t).all():
            return self._along(j, t)
        law, slip = self.laws[j], self.slips(samples.inputs, samples.n)[j]
        return np.asarray(_bound(law.steady_kernel())(slip, law.parameters()))

    def slips(self, inputs: Record, n: int) -> Floats:
        """Relative rates (m, n) of the pairs."""
        with np.errstate(all="ignore"):
            columns = self._slips.run({x: inputs[x] for x in self._slips.program.inputs}, n)
        return np.array([np.broadcast_to(w, n) for w in columns], dtype=np.float64)

    def same(self, j: int, course: Course) -> bool:
        """Whether nothing that a pair's states follow from is another one's, under one motion."""
        slips = self._slips.program.parameters == course._slips.program.parameters
        return slips and self.laws[j] == course.laws[j]

    # -- the motion ----------------------------------------------------------------------

    @cached_property
    def begin(self) -> float:
        """Time [s] at which the laws of motion begin."""
        return max(law.begin() for law in self.mechanism.scene.drive.values())

    def slips_at(self, t: Floats) -> Floats:
        """Relative rates (m, n) of the pairs at times (n,) [s]."""
        inputs = dict[str, Any]()
        for i, driver in enumerate(self.mechanism.drivers):
            motion = self.mechanism.scene.drive[driver].at_times(t)
            inputs |= {f"{x}_{i}": y for x, y in zip(("q", "qd", "qdd"), motion, strict=True)}
        return self.slips(inputs, t.size)

    @cached_property
    def period(self) -> float:
        """Time [s] after which all pairs slip again as before; infinite without one."""
        periods = set()
        for driver in self.mechanism.drivers:
            law = self.mechanism.scene.drive[driver]
            rotary = self.mechanism.structure.driver_joint(driver).rotary
            if isinstance(law, Harmonic):
                periods.add(law.duration())
            elif isinstance(law, ConstantRate) and law.rate and rotary:
                periods.add(math.tau / abs(law.rate))
            else:
                return math.inf
        if max(periods) - min(periods) > 1e-12 * max(periods):
            return math.inf
        period = max(periods)
        slips = self.slips_at(self.begin + np.linspace(0.0, period, 16 * PANELS, endpoint=False))
        return period if np.isfinite(slips).all() else math.inf

    def _along(self, j: int, t: Floats) -> Floats:
        """States (n,) of a pair at times (n,) [s]."""
        if math.isfinite(self.period):
            begin, end = self.begin, self.begin + self.period
            t = begin + np.mod(t - begin, self.period)
        else:
            begin, end = min(self.begin, float(t.min())), float(t.max())
        if (j, end) not in self._known:
            self._known[j, end] = list(self._states(j, begin, end))
        pieces = self._known[j, end]
        z = np.full(t.shape, np.nan)
        for piece in pieces:
            inside = (piece.begin <= t) & (t <= piece.end)
            if inside.any():
                z[inside] = piece.z(t[inside])
        z[t == begin] = pieces[0].z(np.array([begin]))[0] if pieces else 0.0
        return z

    def _states(self, j: int, begin: float, end: float) -> Iterator[Piece]:
        """The states of a pair from a time to another one."""
        if not end > begin:
            return
        slip = fit(lambda t: self.slips_at(t)[j], panels(begin, end, PANELS))
        edges = [begin, *slip.roots().tolist(), end]
        law = self.laws[j]
        size = abs(float(law.steady_kernel()(1.0, law.parameters())))
        z = 0.0
        if math.isfinite(self.period):
            z = _periodic(lambda z: _last(_integrated(law, slip, edges, z, size), z), size)
        yield from _integrated(law, slip, edges, z, size)


def _last(pieces: Iterator[Piece], z: float) -> float:
    """Where pieces end."""
    for piece in pieces:
        z = float(piece.z(np.array([piece.end]))[0])
    return z


def _periodic(after: Callable[[float], float], size: float) -> float:
    """The state to which a period leads back.

    Most laws forget within a period where it began. Of others the map ``after`` rises, as states
    of one equation never cross, and leads from far outside back inside: a root between is found.

    Raises `RequestError` for a law whose states grow without bound.
    """
    from scipy.optimize import brentq

    z = after(after(0.0))
    if abs(after(z) - z) <= RELATIVE * size:
        return z
    for bound in size * 2.0 ** np.arange(HALVINGS):
        if after(bound) < bound and after(-bound) > -bound:
            return float(brentq(lambda z: after(z) - z, -bound, bound, xtol=RELATIVE * size))
    message = f"after a period no deflection below {bound:.3g} m or rad is as it was before"
    remedy = "give a law whose bristles slip, or times instead of a periodic law of motion"
    raise refused("friction", message, remedy, code="no-periodic-state")


def _integrated(
    law: FrictionLaw, slip: Series, edges: list[float], z: float, size: float
) -> Iterator[Piece]:
    """The state from one zero of the slip to the next, from z on; none beyond a gap of the slip."""
    from scipy.integrate import solve_ivp

    kernel, p, w = law.rate_kernel(), law.parameters(), _scalar(slip)
    for a, b in pairwise(edges):
        if not b > a:
            continue
        if not math.isfinite(w((a + b) / 2)):
            z = 0.0
            continue
        sense = math.copysign(1.0, w((a + b) / 2))  # beside a zero rounding may have the other one

        def rate(t: float, y: Floats, sense: float = sense) -> float:
            return float(kernel(sense * max(sense * w(t), 0.0), float(y[0]), p))

        leg = solve_ivp(
            rate, (a, b), [z], "LSODA", rtol=RELATIVE, atol=ABSOLUTE * size, dense_output=True
        )
        if not leg.success:
            message = f"bristles cannot be followed: {leg.message}"
            raise refused("friction", message, "check the numbers of the law", code="no-deflection")
        z = float(leg.y[0, -1])
        yield Piece(a, b, lambda t, sol=leg.sol: np.asarray(sol(t)[0]))  # type: ignore[misc]


def _scalar(series: Series) -> Callable[[float], float]:
    """A series as a function of a number: some thousand numbers one by one are asked for."""
    ends, rows = series.edges.tolist(), [chebyshev.chebtrim(c).tolist() for c in series.c]
    last = len(rows) - 1

    def value(t: float) -> float:
        i = min(max(int(np.searchsorted(series.edges, t, "right")) - 1, 0), last)
        low, high = ends[i], ends[i + 1]
        x = min(max((2.0 * t - low - high) / (high - low), -1.0), 1.0)
        c = rows[i]
        b1 = b2 = 0.0
        for a in reversed(c[1:]):  # Clenshaw
            b1, b2 = a + 2.0 * x * b1 - b2, b1
        return float(c[0] + x * b1 - b2)

    return value


def _bound(kernel: Kernel) -> Kernel:
    return bind_functions({"kernel": kernel}, primitives(np.float64))["kernel"]
