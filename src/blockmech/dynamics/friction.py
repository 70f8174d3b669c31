r"""Joint friction in motion: the acceleration, and rest, with directions of slip that are given.

At a state every load F_j on a pair is affine in q'', in the friction t_k of the pairs and, where
the loads follow the place alone, in q'^2; so is the equation of motion:

    F_j = f_j + g_j q'' + sum_k R_jk t_k,       J q'' = push + sum_k s_k t_k,
    t_k = -side_k c_k |F_k|

push is the effort of the loads less J' q'^2 / 2, s_k the relative rate of pair k per unit rate
of the driver (virtual work), side_k its sign in the motion, c_k the pair's f' r or mu. With
q'' put into the first equation, the solvers of `blockmech.friction` do the rest; where they
prove that exactly one solution exists there is exactly one acceleration. All of f, g, R, s, J
are read off one program: the force pass with the friction of the pairs, q'' and the share of
the loads as inputs.

At a standstill the driver stays at rest where neither direction of slip lets it start. The
efforts at which it would just start are the ends of the interval of driving moments that hold it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from blockmech.engines.binding import bind_functions
from blockmech.engines.llvm import OneByOne
from blockmech.engines.numpy import NumpyEngine, Planar, primitives
from blockmech.friction import solvers
from blockmech.friction.continuation import Outcome
from blockmech.friction.equations import loads as pair_loads
from blockmech.model.structure import Structure
from blockmech.passes import forces, forward, friction, pairs
from blockmech.passes.homotopy import schedule
from blockmech.plan import Friction, Program
from blockmech.plane import EPS, mul

Floats: TypeAlias = NDArray[np.float64]
Vectors: TypeAlias = NDArray[np.complex128]
Sides: TypeAlias = tuple[int, ...]
GIVEN = Friction(friction.GIVEN)


@dataclass(frozen=True)
class MotionProgram:
    """The force pass of one driver with friction as input.

    The program's values: the driving effort, the load of each pair, its relative rate, margins.
    """

    names: tuple[str, ...]  # (m,) pairs with friction
    factors: Floats  # (m,) f' r [m] or mu [-]
    guides: tuple[bool, ...]  # (m,) whether the load is the larger component of (N, 2 C / L)
    rotary: bool
    program: Program
    rate_loads: bool  # whether a load follows the rate or the time

    @classmethod
    def of(cls, structure: Structure, scene: Any, rate_loads: bool) -> MotionProgram | None:
        """The program of a mechanism; None where no pair has friction that can act."""
        s = schedule(structure, scene, GIVEN)
        joints = s.ask(friction.given_joints)
        if not joints:
            return None
        (driver,) = structure.drivers
        values = [s.ask(forces.drive, driver)]
        for ref in joints:
            pair = s.ask(forces.reaction, ref)
            assert pair is not None  # such a block is active
            values.append(pairs.measure(s, ref, pair))
        values += [s.ask(forward.slip, ref) for ref in joints]
        closing = [e.block for e in s.entries if e.stage == "position"]
        values += [s.ask(forward.margin, b) for b in closing if structure.blocks[b].closes]
        laws = [structure.blocks[ref.block].friction[ref.name] for ref in joints]
        kinds = [structure.joint(ref).kind for ref in joints]
        return cls(
            tuple(map(str, joints)),
            np.array([law.factor for law in laws]),
            tuple(kind == "P" for kind in kinds),
            structure.driver_joint(driver).rotary,
            s.program(values),
            rate_loads,
        )

    @cached_property
    def batch(self) -> NumpyEngine:
        """The program on arrays."""
        return NumpyEngine(self.program)

    @cached_property
    def single(self) -> OneByOne:
        """The program at one state."""
        return OneByOne(self.program)


class State(NamedTuple):
    """One column of inputs of the program, besides q: what is let act."""

    qd: Any = 0.0
    qdd: Any = 0.0
    share: float = 0.0  # of the applied loads
    pair: int = -1  # the one with a unit of friction; -1: none
    t: float = 0.0


class Values(NamedTuple):
    """What the program gives at n samples."""

    drive: Any  # (n,)
    F: Any  # (n, m) complex loads on the pairs
    slip: Any  # (n, m)
    margin: Any  # (n,)


class Responses(NamedTuple):
    """What depends on the place alone, at n places."""

    J: Any  # (n,)
    s: Any  # (n, m)
    g: Any  # (n, m)
    R: Any  # (n, m, m)


class Loads(NamedTuple):
    """What the loads and the rate do at n states, without friction and without q''."""

    push: Any  # (n,) effort less J' q'^2 / 2
    F: Any  # (n, m)


class Placed(NamedTuple):
    """What `JointFriction.rows` says at n places."""

    responses: Responses
    rest: Loads
    square: Loads  # per unit of q'^2

    @classmethod
    def of(cls, rows: Floats, m: int) -> Placed:
        """The rows read."""
        J, tau = rows[:2]
        s, square = rows[3 + m : 3 + 2 * m].T, rows[3 + 2 * m]
        vectors = rows[4 + 2 * m :]
        half = len(vectors) // 2
        F = (vectors[:half] + 1j * vectors[half:]).reshape(3 + m, m, -1)
        F = np.moveaxis(F, 2, 1)  # (states, n, m)
        responses = Responses(J, s, F[2], np.moveaxis(F[3:], 0, -1))
        return cls(responses, Loads(tau, F[0]), Loads(square, F[1]))

    def loads(self, qd2: Floats) -> Loads:
        """Loads of the place alone at squares (n,) of the rate."""
        push = self.rest.push + self.square.push * qd2
        return Loads(push, self.rest.F + self.square.F * qd2[:, None])


class Found(NamedTuple):
    """Solved friction at n states; NaN where no solution is known."""

    effort: Any  # (n,) push and friction together: J q''
    t: Any  # (n, m) friction on the later links [N m or N]
    F: Any  # (n, m) loads on the pairs, friction included


class Resisted(NamedTuple):
    """One state: the acceleration, and what the pairs do."""

    qdd: float
    power: float  # [W] that friction takes, never negative
    loads: Vectors  # (m,)
    margin: float
    outcome: Outcome
    limit: float

    @property
    def locked(self) -> bool:
        """Whether no acceleration satisfies Coulomb's law, in a pose that is possible."""
        return not self.outcome.solved and self.margin > 0


class Resistance(NamedTuple):
    """What friction does at one state, as numbers of any engine.

    slips : (m,) relative rates of the pairs per unit rate of the driver
    taken : [N m or N] magnitude of the effort of friction
    """

    qdd: Any
    solution: solvers.Solution
    slips: Any
    taken: Any
    loads: Any  # (m,)


def resistance(rows: Any, k: Any, guides: Any, solve: Any, options: Any) -> Resistance:
    """Friction at one state, from the program's values, with signed Coulomb factors (m,).

    ``rows`` are those of the loads at the rate, of a unit of q'', of a unit of each friction.
    """
    m = len(k)
    J, push = rows[1][0], -rows[0][0]
    s = [-row[0] for row in rows[2:]]
    a0 = push / J
    base = tuple(rows[0][1 + j] + mul(rows[1][1 + j], a0) for j in range(m))
    matrix = tuple(
        tuple(rows[2 + i][1 + j] + mul(rows[1][1 + j], s[i] / J) for i in range(m))
        for j in range(m)
    )
    found = solve(k, guides, base, matrix, *options)
    effort, taken = push, 0.0
    for x, t in zip(s, found.t, strict=True):
        effort, taken = effort + x * t, taken + abs(x * t)
    return Resistance(effort / J, found, s, taken, pair_loads(found.t, base, matrix))


class Rest(NamedTuple):
    """What a standstill leads to.

    holding : [N m or N] driving efforts that hold the driver at rest; empty (low above high)
        where it may start both ways
    moves : -1 or +1, the direction in which it starts; 0 where it stays
    ambiguous : whether it may start in either direction
    """

    holding: tuple[float, float]
    moves: int
    ambiguous: bool

    @property
    def rests(self) -> bool:
        """Whether it stays where it is."""
        return self.moves == 0 and not self.ambiguous


class JointFriction:
    """Friction of all pairs of a mechanism with one driver.

    ``count`` is told of evaluations (samples, whether they are a batch), and says whether single
    states are machine code's.
    """

    def __init__(
        self, program: MotionProgram, method: Friction, count: Callable[[int, bool], bool]
    ) -> None:
        self.program, self._count = program, count
        self.names = program.names
        self.guides = program.guides
        solver, options = solvers.SOLVERS[method.method]
        self.options = tuple(getattr(method, name) for name in options)
        self.solver = solver
        self._batch = bind_functions({"solve": solver}, primitives(np.float64))["solve"]

    # -- data of the force pass ------------------------------------------------------

    def _columns(self, q: Floats, states: list[State]) -> Values:
        """The program at n places in each of some states: arrays (states, n, ...)."""
        m, n, size = len(self.names), q.size, len(states) * q.size
        self._count(size, True)
        given = {
            "q_0": np.tile(q, len(states)),
            "qd_0": np.concatenate([np.broadcast_to(s.qd, n) for s in states]),
            "qdd_0": np.concatenate([np.broadcast_to(s.qdd, n) for s in states]),
            "t": np.repeat([s.t for s in states], n),
            "load_share": np.repeat([s.share for s in states], n),
        }
        for k in range(m):
            given[f"friction_{k}"] = np.repeat([float(s.pair == k) for s in states], n)
        program = self.program.program
        with np.errstate(all="ignore"):
            values = self.program.batch.run({x: given[x] for x in program.inputs}, size)
            margin = np.minimum.reduce([np.ones(size), *values[1 + 2 * m :]])
        shape = (len(states), n)
        F = np.stack([_complex(z) for z in values[1 : 1 + m]], axis=-1)
        slip = np.stack(values[1 + m : 1 + 2 * m], axis=-1)
        return Values(
            np.reshape(values[0], shape),
            F.reshape(*shape, m),
            slip.reshape(*shape, m),
            margin.reshape(shape),
        )

    def loads(self, q: Floats, qd: Any, t: float = 0.0) -> Loads:
        """What loads and rates do at states (n,)."""
        found = self._columns(q, [State(qd=qd, share=1.0, t=t)])
        return Loads(-found.drive[0], found.F[0])

    def rows(self, q: Floats) -> Floats:
        """All that depends on the place, as real rows (r, n): J, tau, margin, slips, the rest.

        `Placed` reads them. The loads are those at rest, and what a unit of q'^2 adds.
        """
        m = len(self.names)
        acting = [State(share=1.0), State(qd=1.0), State(qdd=1.0)]
        found = self._columns(q, [*acting, *(State(pair=k) for k in range(m))])
        drive, F = found.drive, np.moveaxis(found.F, 2, 1)  # (states, m, n)
        vectors = F.reshape(-1, q.size)
        margin = found.margin.min(axis=0)
        real = [drive[2], -drive[0], margin, *found.slip[1].T, *-drive[3:], -drive[1]]
        return np.concatenate([real, vectors.real, vectors.imag])

    def slips(self, q: Floats) -> Floats:
        """Relative rates (n, m) of the pairs per unit rate of the driver."""
        slip: Floats = self._columns(q, [State(qd=1.0)]).slip[0]
        return slip

    def sides(self, q: float, direction: int) -> Sides:
        """Signs (m,) of the relative rates just beyond q in a direction of motion.

        A slip that vanishes at q, as far as the next place tells, has the sign that it gets.
        """
        here, beyond, vanishes = self._beyond(q, direction)
        at = np.where(vanishes, beyond, here)
        return tuple(int(x) for x in direction * np.sign(np.nan_to_num(at)))  # NaN: no pose

    def reversing(self, q: float) -> list[int]:
        """Pairs whose slip vanishes at q, as far as the next place tells."""
        return np.flatnonzero(self._beyond(q, 1)[2]).tolist()

    def _beyond(self, q: float, direction: int) -> tuple[Floats, Floats, Floats]:
        step = math.sqrt(EPS) * max(1.0, abs(q)) * direction
        here, beyond = self.slips(np.array([q, q + step]))
        return here, beyond, np.abs(here) <= np.abs(beyond - here)

    # -- solutions ------------------------------------------------------------

    def solve(self, r: Responses, loads: Loads, sides: Sides, moving: bool = True) -> Found:
        """Friction at n states with these directions of slip; at rest q'' is zero."""
        push = np.asarray(loads.push)
        if moving:
            with np.errstate(all="ignore"):
                share = r.s / r.J[:, None]
                base = loads.F + r.g * (push / r.J)[:, None]
            rows = r.R + r.g[:, :, None] * share[:, None, :]
        else:
            base, rows = loads.F, r.R
        m, n = len(sides), push.size
        k = tuple(np.full(n, x) for x in -np.array(sides) * self.program.factors)
        columns = tuple(_planar(base[:, j]) for j in range(m))
        matrix = tuple(tuple(_planar(rows[:, j, i]) for i in range(m)) for j in range(m))
        with np.errstate(all="ignore"):
            found = self._batch(k, self.guides, columns, matrix, *self.options)
            t = np.stack([np.broadcast_to(x, n) for x in found.t], axis=-1)
            effort = push + (r.s * t).sum(axis=1)
        F = base + np.einsum("njk,nk->nj", rows, t)
        return Found(effort, t, F)

    def at(self, q: float, qd: float, t: float, sides: Sides) -> Resisted:
        """One state."""
        m = len(self.names)
        states = [State(qd=qd, share=1.0, t=t), State(qdd=1.0)]
        states += [State(pair=k) for k in range(m)]
        engine = self.program.single.engine(self._count(m + 2, False))
        rows = [engine.one(self._inputs(q, state)) for state in states]
        margin = min([1.0, *rows[0][1 + 2 * m :]], key=lambda x: (x == x, x))
        try:
            found = resistance(rows, self.factors(sides), self.guides, self.solver, self.options)
        except (ArithmeticError, ValueError):
            nothing = np.full(m, math.nan)
            return Resisted(math.nan, math.nan, nothing + 0j, margin, Outcome.NOT_CONVERGED, 1.0)
        said, power = found.solution.outcome, found.taken * abs(qd)
        outcome = Outcome(int(said)) if said == said else Outcome.NOT_CONVERGED
        limit = float(found.solution.limit)
        return Resisted(found.qdd, power, np.array(found.loads), margin, outcome, limit)

    def factors(self, sides: Sides) -> tuple[float, ...]:
        """Signed Coulomb factors (m,) of pairs that slip in some directions."""
        return tuple(-side * float(c) for side, c in zip(sides, self.program.factors, strict=True))

    def _inputs(self, q: float, state: State) -> list[float]:
        given = {"q_0": q, "qd_0": state.qd, "qdd_0": state.qdd, "t": state.t}
        given["load_share"] = state.share
        inputs = self.program.program.inputs
        pair = f"friction_{state.pair}"
        return [given.get(x, float(x == pair)) for x in inputs]

    def rest(self, q: float, t: float = 0.0, size: float = 0.0) -> Rest:
        """What a standstill at q leads to; ``size`` [N m or N] is that of the loads' efforts."""
        place = np.array([q])
        r = Placed.of(self.rows(place), len(self.names)).responses
        loads = self.loads(place, 0.0, t)
        holding = []
        for direction in (-1, 1):
            found = self.solve(r, loads, self.sides(q, direction), moving=False)
            start = -float(found.effort[0])
            size += float(np.abs(r.s * found.t).sum()) if math.isfinite(start) else 0.0
            holding.append(start if math.isfinite(start) else direction * math.inf)
        low, high = holding
        least = 8 * EPS * size  # rounding of a sum of some ten terms
        forward, backward = high < -least, low > least
        if forward and backward:
            return Rest((low, high), 0, True)
        return Rest((low, high), 1 if forward else -1 if backward else 0, False)


def _complex(z: Any) -> Vectors:
    """A batch of planar vectors as complex numbers."""
    found: Vectors = np.asarray(z.real) + 1j * np.asarray(z.imag)
    return found


def _planar(z: Vectors) -> Planar:
    """Complex numbers as a batch of planar vectors."""
    return Planar(np.ascontiguousarray(z.real), np.ascontiguousarray(z.imag))
