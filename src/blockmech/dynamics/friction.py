r"""Joint friction in motion: the acceleration, and rest, with directions of slip that are given.

At a state every load F_j on a pair is affine in q'', in the friction t_k of the pairs and, where
the loads follow the place alone, in q'^2; so is the equation of motion:

    F_j = f_j + g_j q'' + sum_k R_jk t_k,       J q'' = push + sum_k s_k t_k,
    t_k = -side_k (c_k |F_k| + d_k)

push is the effort of the loads less J' q'^2 / 2, s_k the relative rate of pair k per unit rate
of the driver (virtual work), side_k its sign in the motion, c_k and d_k what the pair's law says
at that rate (`blockmech.friction.laws`). With q'' put into the first equation, the solvers of
`blockmech.friction` do the rest; where they prove that exactly one solution exists there is
exactly one acceleration. All of f, g, R, s, J are read off one program: the force pass with the
friction of the pairs, q'' and the share of the loads as inputs; the laws off another one, of the
relative rates.

At a standstill the driver stays at rest where neither direction of slip lets it start, by what
the laws say at rest. The efforts at which it would just start are the ends of the interval of
driving moments that hold it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, ClassVar, NamedTuple

import numpy as np

from blockmech.dynamics.pair_friction import (
    Floats,
    FrictionState,
    PairFriction,
    PairProgram,
    Row,
    Sides,
    State,
    least,
    outcome_of,
)
from blockmech.engines.llvm import SingleEvaluator
from blockmech.engines.numpy import NumpyEngine, Planar
from blockmech.friction import solvers
from blockmech.friction.continuation import Outcome
from blockmech.friction.equations import loads as pair_loads
from blockmech.friction.laws.contract import FrictionLaw, FrictionTerms
from blockmech.model.structure import JointRef
from blockmech.passes import forces, forward, friction, pairs, signals
from blockmech.passes.homotopy import schedule
from blockmech.plan import Friction, Schedule
from blockmech.plane import EPS, mul, where
from blockmech.quality import left_undone

GIVEN = Friction(friction.GIVEN)


def bearing(load: Any) -> tuple[Any, Any]:
    """Of a load N + 2i C/L on a guide the larger part, and what the first is larger by.

    Friction has kinks where either changes its sign.
    """
    N, C = load.real, load.imag
    return where(abs(N) >= abs(C), N, C), abs(N) - abs(C)


def pair_program(compiled: Any, pushed: tuple[JointRef, ...] = ()) -> PairProgram | None:
    """The force pass of a mechanism with its friction laws; None where none can act.

    ``pushed`` : pairs along whose coordinates stops may push
    """
    structure = compiled.structure
    how = replace(GIVEN, pushed=pushed)  # a push loads pairs that nothing else does
    s = schedule(structure, compiled.scene, how)
    joints = s.ask(friction.given_joints)
    if not joints:
        return None
    values = [s.ask(forces.drive, driver) for driver in structure.drivers]
    for ref in joints:
        pair = s.ask(forces.reaction, ref)
        assert pair is not None  # such a block is active
        values.append(pairs.statics(s, ref).measure(s, ref, pair))
    values += [s.ask(forward.slip, ref) for ref in joints]
    rise = [s.ask(forward.slip_acceleration, ref) for ref in joints]
    program = s.program([*values, *rise, *margins(s)])
    apart = schedule(structure, compiled.scene, how)
    rules = friction.terms, friction.terms_at_rest, friction.terms_standing
    law_terms = [x for rule in rules for x in terms(apart, joints, rule)]
    laws = [structure.friction_law(ref) for ref in joints]
    more = [*signals.rates(s), *friction.deflection_rates(s), *signals.kinks(s)]
    return PairProgram(
        tuple(map(structure.pair_name, joints)),
        tuple(pairs.statics(s, ref).edges for ref in joints),
        program,
        apart.program(law_terms),
        s.program([*values, *margins(s), *more, *terms(s, joints, friction.terms)]),
        tuple(law.remembers for law in laws),
        tuple(map(structure.separates, joints)),
        steepest(laws),
        any(law.drags for law in laws),
        all(law.smooth for law in laws),
        NumpyEngine(program),
        SingleEvaluator(program),
    )


def steepest(laws: Sequence[FrictionLaw]) -> tuple[float, ...]:
    """Largest slopes of friction over the load where a law is not linear in it; 0 of the others."""
    if not any(law.reads_load for law in laws):
        return ()
    return tuple(float(law.parameters().steepest) if law.reads_load else 0.0 for law in laws)


def terms(s: Schedule, joints: Sequence[JointRef], rule: Callable[..., str]) -> list[str]:
    """Factors (m,) and drags (m,) of pairs by a rule that asks their laws."""
    laws = [s.ask(rule, ref) for ref in joints]
    return [f"{law}.{part}" for part in FrictionTerms._fields for law in laws]


def margins(s: Schedule) -> list[str]:
    """Margins of the groups whose poses the schedule needs."""
    blocks = [e.block for e in s.entries if e.stage == "position"]
    return [s.ask(forward.margin, b) for b in blocks if s.structure.blocks[b].closes]


def power_taken(found: FrictionSolution, remembers: Sequence[bool], qd: Any) -> Any:
    """Power [W] that friction takes: of laws with a state, which also store, with its sign."""
    taken, along = found.taken, None
    for s, t, stores in zip(found.slips, found.solution.t, remembers, strict=True):
        if stores:
            taken = taken - abs(s * t)
            along = s * t if along is None else along + s * t
    power = taken * abs(qd)
    return power if along is None else power - along * qd


class FrictionSolution(NamedTuple):
    """What friction does, as numbers or batches of any engine.

    effort : [N m or N] of loads and friction together, J q''
    slips : (m,) relative rates of the pairs per unit rate of the driver
    taken : [N m or N] magnitude of the effort of friction
    """

    effort: Any
    qdd: Any
    solution: solvers.Solution
    slips: Any
    taken: Any
    loads: Any  # (m,)


def resistance(rows: Any, laws: Any, steepest: Any, guides: Any, balance: Any) -> FrictionSolution:
    """Friction from the program's values, with laws and their slopes as of `solvers.balanced`.

    ``rows`` are those of the loads at the rate, of a unit of q'', of a unit of each friction;
    ``balance`` is that function with a solver.
    """
    m = len(guides)
    J, push = rows[1][0], -rows[0][0]
    s = [-row[0] for row in rows[2:]]
    a0 = push / J
    base = tuple(rows[0][1 + j] + mul(rows[1][1 + j], a0) for j in range(m))
    matrix = tuple(
        tuple(rows[2 + i][1 + j] + mul(rows[1][1 + j], s[i] / J) for i in range(m))
        for j in range(m)
    )
    solution = balance(laws, steepest, guides, base, matrix)
    effort, taken = push, 0.0
    for x, t in zip(s, solution.t, strict=True):
        effort, taken = effort + x * t, taken + abs(x * t)
    F = pair_loads(solution.t, base, matrix)
    return FrictionSolution(effort, effort / J, solution, s, taken, F)


class Rest(NamedTuple):
    """What a standstill leads to.

    holding : [N m or N] driving efforts that hold the driver at rest; empty (low above high)
        where it may start both ways
    moves : -1 or +1, the direction in which it starts; 0 where it stays
    ambiguous : whether it may start in either direction
    rounding : relative, of the effort by which it starts
    """

    holding: tuple[float, float]
    moves: int
    ambiguous: bool
    rounding: float = 0.0

    @property
    def rests(self) -> bool:
        """Whether it stays where it is."""
        return self.moves == 0 and not self.ambiguous


class JointFriction(PairFriction):
    """Friction of all pairs of a mechanism with one driver; `sticking` has that of several."""

    kernels: ClassVar[Mapping[str, Any]] = {"resistance": resistance}

    # -- data of the force pass ------------------------------------------------------

    def slips(self, q: Floats) -> Floats:
        """Relative rates (n, m) of the pairs per unit driver rate."""
        m = len(self.names)
        return np.transpose(self._columns(q, [State(qd=1.0)])[0][1 + m : 1 + 2 * m])

    def sides(self, q: float, direction: int) -> Sides:
        """Signs (m,) of the relative rates just beyond q in a direction of motion.

        1 of a pair whose law says the sign itself.
        A slip that vanishes at q, as far as the next place tells, has the sign that it gets.
        """
        here, beyond, vanishes = self._beyond(q, direction)
        at = np.where(vanishes, beyond, here)
        return tuple(map(int, self.senses(direction * np.nan_to_num(at))))  # NaN: no pose

    def reversing(self, q: float) -> list[int]:
        """Pairs whose slip vanishes at q, as far as the next place tells."""
        return np.flatnonzero(self._beyond(q, 1)[2]).tolist()

    def _beyond(self, q: float, direction: int) -> tuple[Floats, Floats, Floats]:
        step = math.sqrt(EPS) * max(1.0, abs(q)) * direction
        here, beyond = self.slips(np.array([q, q + step]))
        return here, beyond, np.abs(here) <= np.abs(beyond - here)

    # -- solutions ------------------------------------------------------------

    def solve(
        self,
        rows: list[Row],
        sides: Sequence[Any],
        law: Sequence[Any],
        rates: Floats | None = None,
    ) -> FrictionSolution:
        """Friction at n states with these directions of slip, see `resistance`.

        ``law`` : (2 m,) factors and drags, see `law`
        ``rates`` : (m, n) at which laws are asked again that are not linear in the load
        """
        n, steepest = np.size(rows[0][0]), () if rates is None else self.program.steepest

        def laws(loads: Any = None) -> tuple[Any, Any]:
            own = law
            if loads is not None and rates is not None:
                own = self.law(rates, None, np.array(loads))
            return self.against(sides, [np.broadcast_to(x, n) for x in own])

        with np.errstate(all="ignore"):
            resist = self._bound["resistance"]
            solution: FrictionSolution = resist(rows, laws, steepest, self.guides, self.balance_all)
        return solution

    def at(self, q: float, qd: float, t: float, sides: Sides, x: Any = None) -> FrictionState:
        """One state; x are states of signal blocks."""
        m = len(self.names)
        states = [State(qd=qd, share=1.0, t=t, x=x), State(qdd=1.0)]
        states += [State(pair=k) for k in range(m)]
        rows = self._one_by_one(q, states)
        margin = least(rows[0][1 + 3 * m :])
        rates = np.array([rows[0][1 + m : 1 + 2 * m]]).T

        def laws(loads: Any = None) -> tuple[Any, Any]:
            column = None if loads is None else np.array([loads]).T
            return self.against(sides, [float(y[0]) for y in self.law(rates, x, column)])

        try:
            resisted = resistance(rows, laws, self.program.steepest, self.guides, self.balance)
        except (ArithmeticError, ValueError):
            nothing = np.full(m, math.nan)
            return FrictionState(
                math.nan, math.nan, nothing + 0j, margin, Outcome.NOT_CONVERGED, 1.0, 0.0, nothing
            )
        solved, power = resisted.solution, power_taken(resisted, self.program.remembers, qd)
        misfit = float(left_undone(solved.residual, solved.contraction))
        outcome, limit = outcome_of(solved.outcome), float(solved.limit)
        F, rubs = np.array(resisted.loads), np.array(solved.t)
        return FrictionState(resisted.qdd, power, F, margin, outcome, limit, misfit, rubs)

    def moving(self, q: float, qd: float, t: float, x: Any = None) -> FrictionState:
        """One state of a motion, each pair slipping in the sense of the rate."""
        return self.at(q, qd, t, self.sides(q, 1 if qd > 0 else -1), x)

    def holding(self, q: Floats, t: float = 0.0) -> tuple[Floats, Floats]:
        """Lowest and highest driving efforts (n,) [N m or N] that hold the driver at places.

        Infinite where nothing starts it. A pair whose slip is zero at a place does not help there;
        bristles help by the most that they carry.
        """
        slips, fixed = np.sign(np.nan_to_num(self.slips(q))).T, self.program.separates
        sides = [
            [1.0 if own else way * s for s, own in zip(slips, fixed, strict=True)]
            for way in (-1, 1)
        ]
        (low, _), (high, _) = self._starting(q, sides, self.static, t, None)
        return low, high

    def _starting(
        self, q: Floats, sides: Sequence[Sequence[Any]], law: Any, t: float, x: Any
    ) -> Iterator[tuple[Floats, Floats]]:
        """Efforts (n,) at which the driver starts back and forth, and those of friction in them."""
        states = [State(share=1.0, t=t, x=x), *(State(pair=k) for k in range(len(self.names)))]
        acting, *pairs = self._columns(q, states)
        still = [np.ones(q.size), *[Planar(0.0 * q, 0.0 * q) for _ in pairs]]  # no load follows q''
        for way, side in zip((-1, 1), sides, strict=True):
            found = self.solve([acting, still, *pairs], side, law)
            start = -np.asarray(found.effort)
            yield np.where(np.isfinite(start), start, way * math.inf), found.taken

    def rest(self, q: float, t: float = 0.0, x: Any = None) -> Rest:
        """What a standstill at q leads to; x are states of signal blocks and laws."""
        sides = [self.sides(q, direction) for direction in (-1, 1)]
        found = list(self._starting(np.array([q]), sides, self.standing(x), t, x))
        low, high = (float(start[0]) for start, _ in found)
        taken = sum(float(rubbed[0]) for start, rubbed in found if np.isfinite(start[0]))
        unknown = self._rounding(q) + 8 * EPS * taken  # as of the effort of the loads
        forward, backward = high < -unknown, low > unknown
        if forward and backward:
            return Rest((low, high), 0, True)
        if not (forward or backward):
            return Rest((low, high), 0, False)
        return Rest((low, high), 1 if forward else -1, False, unknown / max(low, -high))
