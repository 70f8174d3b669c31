"""The steady state of one driver under loads of place and rate: what the search says."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from blockmech.dynamics.chebyshev import Floats
from blockmech.dynamics.integration.equation import from_kernels
from blockmech.dynamics.motion import Motion
from blockmech.dynamics.path.mesh import View
from blockmech.dynamics.steady.collocation import rotations
from blockmech.dynamics.steady.equilibrium import Rest, equilibrium
from blockmech.dynamics.steady.flow import Flow
from blockmech.dynamics.steady.outcome import ELSEWHERE, Lost, Spent, an, no_steady
from blockmech.dynamics.steady.report import (
    named_others,
    of_cycle,
    of_rest,
    of_rotation,
    rotation_in_words,
)
from blockmech.dynamics.steady.return_map import ENDLESS, Settling, Steadily
from blockmech.dynamics.steady.settling import glided
from blockmech.dynamics.steady.shooting import closed
from blockmech.dynamics.system.claims import splits
from blockmech.dynamics.system.reduced import Metered, ReducedSystem
from blockmech.dynamics.until import Asked

NAMED = 1e-5  # target of one that is only named
FINEST = 1e-10  # target of a collocation if none is given [rad or m]
MORE = 100_000  # evaluations for closing what was found
ONE = 1e-6  # distance of equilibria, in scales, that are one
PLACES = 96  # coordinates between which equilibria are looked for
RETURNS = "return map"
UNDECLARED = (
    "the driver turns on and on, and a load follows its coordinate without a period, so no turn "
    "is known to repeat"
)
GOES_ON = "the driver goes a way without end, so it comes neither to rest nor back to where it was"
DECLARE = 'give that load\'s law "turns", or let it follow an angle of its own'


def settled(meter: Metered, asked: Asked, flow: Flow, method: str) -> Motion:
    """The steady state to which the motion from the start settles; others in the notes.

    Raises `RequestError` where there is none, or none was found.
    """
    system, start = meter.system, asked.start
    around = _Around(meter, asked, asked.accuracy or FINEST)
    known = around.ahead if method == "auto" and around.possible() else None
    scale = 1.0 if system.kind == "rotation" else system.span
    stopped = any(map(math.isfinite, system.stops))
    search = Settling(flow, system.period, scale, stopped, known)
    x = np.array([start.q, start.rate])
    try:
        found = search.found(x)
        at = found if isinstance(found, Rest) else None
        rests = _equilibria(flow, system, start.q, scale)
        others = _elsewhere(rests, system.period, scale, at)
        if known is not None:
            others += [rotation_in_words(r) for way in (1, -1) for r in around.named(way)]
        if isinstance(found, Steadily):
            words = rotation_in_words(found)
            return of_rotation(found, asked, named_others([o for o in others if o != words]))
        ways = dict.fromkeys((*search.tried[:1], *search.tried[-1:]))
        told = (*ways, *named_others(others))
        if isinstance(found, Rest):
            return _resting(meter, asked, flow, found, scale, x, told)
        flow.most += MORE
        if system.period:  # without the turns since the start
            found.x[0] -= system.period * round((found.x[0] - start.q) / system.period)
        cycle = closed(flow, found, (system.kind == "rotation",), system.span)
        if cycle is not None:
            return of_cycle(cycle, asked, RETURNS, told)
        search.tried.append("Newton's method on the return map failed")
        raise _unfound(search)
    except Lost as lost:
        if lost.end == ENDLESS and system.kind == "rotation":
            raise no_steady(UNDECLARED, DECLARE) from None
        if lost.end == ENDLESS:
            raise no_steady(GOES_ON) from None
        after = f" after {lost.t:.6g} s" if math.isfinite(lost.t) else ""
        raise no_steady(
            f"the motion from the start ends in {an(lost.end)}{after}, so no turn repeats for ever"
        ) from None
    except Spent:
        raise _unfound(search) from None


def _unfound(search: Settling) -> Exception:
    tried = "; ".join(search.tried[-4:]) or "following the motion from the start"
    why = f"none was found within {search.flow.used} evaluations; tried: {tried}"
    return no_steady(why, ELSEWHERE)


def _resting(
    meter: Metered,
    asked: Asked,
    flow: Flow,
    found: Rest,
    scale: float,
    x: Floats,
    told: Sequence[str],
) -> Motion:
    """Rest, its place to rounding by the kernels themselves."""
    start = asked.start
    exact = from_kernels(meter, start.q, start.rate, start.t)
    exact = replace(exact, speed=flow.equation.speed)
    if found.kind == "indifferent":
        best = glided(flow, x, found, scale)
    else:
        best = equilibrium(exact, start.t, found.q, np.array([scale]))
    return of_rest(best or found, asked, told)


def _equilibria(flow: Flow, system: ReducedSystem, q: float, scale: float) -> list[Rest]:
    """Stable equilibria around a turn, or within reach."""
    reach = math.pi if system.kind == "rotation" else 3 * system.span
    low, high = max(q - reach, system.bounds[0]), min(q + reach, system.bounds[1])
    places = np.linspace(low, high, PLACES + 1)
    push = np.array([flow.equation.rhs(flow.t0, np.array([p, 0.0, 0.0]))[1] for p in places])
    found = []
    for i in np.flatnonzero((push[:-1] > 0) & (push[1:] <= 0)).tolist():
        middle = np.array([places[i : i + 2].mean()])
        rest = equilibrium(flow.equation, flow.t0, middle, np.array([scale]))
        if rest is not None and rest.kind == "stable":
            found.append(rest)
    return found


def _elsewhere(
    rests: Sequence[Rest], period: float | None, scale: float, at: Rest | None
) -> list[str]:
    """Equilibria other than that ``at`` which the motion rests, in words."""
    kept: list[float] = [] if at is None else [float(at.q[0])]
    said = []
    for rest in rests:
        q = float(rest.q[0])
        gaps = [math.remainder(q - other, period) if period else q - other for other in kept]
        if all(abs(gap) > ONE * scale for gap in gaps):
            kept.append(q)
            said.append(f"at rest at q = {q:.9g}, stable")
    return said


class _Around:
    """Rotations by collocation, looked for once in each direction."""

    def __init__(self, meter: Metered, asked: Asked, accuracy: float) -> None:
        self.meter, self.asked = meter, asked
        self.accuracy = accuracy
        self.known: dict[int, list[Steadily]] = {}

    def possible(self) -> bool:
        """Whether a driver can turn round under smooth loads whose make-up is declared."""
        system, start = self.meter.system, self.asked.start
        unbounded = all(map(math.isinf, system.bounds))
        return bool(
            system.period
            and unbounded
            and not system.knots
            and splits(self.meter, start.q, start.rate, start.t, batch=True)
        )

    def found(self, way: int) -> list[Steadily]:
        """Those in a direction, +1 or -1, to the accuracy asked for."""
        if way not in self.known:
            self.known[way] = self._looked(way, self.accuracy)
        return self.known[way]

    def named(self, way: int) -> list[Steadily]:
        """The same, but good enough to be named only."""
        return self.known[way] if way in self.known else self._looked(way, NAMED)

    def _looked(self, way: int, accuracy: float) -> list[Steadily]:
        view = View(self.meter, self.asked.start.q, float(way))
        return [Steadily(view, r) for r in rotations(view, accuracy)]

    def ahead(self, q: float, rate: float, faster: bool) -> Steadily | None:
        """The next rotation that a motion meets which gets faster, or slower, from turn to turn."""
        found = self.found(1 if rate > 0 else -1)
        rows = []
        for steady in found:
            turn, view = steady.rotation.turn, steady.view
            x = np.array([(view.sign * (q - view.origin)) % turn.period])
            speed = float(turn.place(turn.when(x)).rate[0])
            if (speed > abs(rate)) == faster:
                rows.append((abs(speed - abs(rate)), steady))
        return min(rows, key=lambda row: row[0])[1] if rows else None


def collocated(meter: Metered, asked: Asked) -> Motion:
    """Method "spectral": the rotation in the direction of the start, by collocation alone."""
    start = asked.start
    around = _Around(meter, asked, asked.accuracy or FINEST)
    if not around.possible():
        raise no_steady(
            "collocation needs a driver that can turn round, and loads without kinks whose "
            "dependence on place and rate is declared",
            'use method "auto"',
        )
    push = start.rate or meter.one(start.q, start.rate, start.t).tau or 1.0
    found = around.found(1 if push > 0 else -1)
    if not found:
        raise no_steady("no periodic rotation was found in this direction", 'use method "auto"')

    def distance(steady: Steadily) -> float:
        mean = steady.rotation.turn.period / steady.rotation.turn.total
        return abs(mean - abs(start.rate)) if start.rate else -mean

    chosen = min(found, key=distance)
    rest = [rotation_in_words(r) for r in found if r is not chosen]
    return replace(of_rotation(chosen, asked, named_others(rest)), cost=meter.cost)
