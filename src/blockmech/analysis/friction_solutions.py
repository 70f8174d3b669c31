"""All solutions of the friction equations at given poses, and what proves that there are no others.

In a given motion the friction of a group loads earlier groups and no later ones, so that the
solutions of a mechanism form a tree: all of the last group, for each of them all of the group
before. The force pass gives each group's equations with the friction of the later ones as input;
`blockmech.friction.enumeration` solves them, branch by branch in one batch. Where the contraction
P is below 1 there is one solution and nothing to look for. Of any law the rate of slip is known, so
that friction is a factor times the load and a drag that joins the loads.

Which one is physical? The one that is connected with zero friction; its index is +1. One of
index -1 is unstable as soon as friction lags behind the load: dt/ds = k g(F(t)) - t grows there.
Index +1 is necessary for a stable one and not sufficient, so all are reported, and none chosen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from blockmech.analysis.friction_answer import (
    CONTRACTION,
    COUNT,
    NO_POSE,
    PROOFS,
    UNDECIDED,
    FrictionSolutions,
)
from blockmech.engines.binding import bind_functions
from blockmech.engines.interpreters import NumpyEngine
from blockmech.engines.numpy import Planar, primitives
from blockmech.friction import enumeration, solvers
from blockmech.friction.continuation import Outcome
from blockmech.friction.equations import existence, load_norm
from blockmech.ground.arguments import declared
from blockmech.ground.errors import as_names, refused
from blockmech.ground.limits import MOST
from blockmech.ground.tolerances import BLUR
from blockmech.model.structure import JointRef
from blockmech.passes import forces, forward, friction, pairs
from blockmech.passes.homotopy import schedule
from blockmech.plan.plan import Friction, Schedule
from blockmech.plan.values import Value
from blockmech.result.result import Result
from blockmech.result.samples import Samples
from blockmech.typing import Complex, Coordinates, Data, Floats, Indices, Numbers, Values, Vectors

if TYPE_CHECKING:
    from blockmech.compiled import Compiled

GIVEN = Friction(friction.GIVEN)
DEFAULT = (".drive", ".reaction")
"""What is computed of each solution where nothing is asked for: outputs that end so."""
BY_LOAD = "its friction law is not linear in the load, so that its solutions are not counted"

BOUND = bind_functions(
    {"newton": solvers.newton, "existence": existence, "load_norm": load_norm},
    primitives(np.float64),
)
Flags = NDArray[np.bool_]


# -- the equations of the groups, by the force pass ----------------------------------------


class Group(NamedTuple):
    """Friction equations of a block: where they stand among the program's values."""

    block: str
    inputs: tuple[int, ...]  # of its pairs, among those of the mechanism
    contacts: tuple[int, ...]
    k: tuple[int, ...]
    drags: tuple[int, ...]
    loads: tuple[int, ...]
    rows: tuple[tuple[int, ...], ...]
    separates: tuple[bool, ...]  # whether a row is a mesh that only adds to its contact
    known: bool  # whether its number `existence` is


class Driven(NamedTuple):
    """A driven pair, whose friction loads no other: its input, signed factor, drag, load."""

    input: int
    edges: bool
    k: int
    drag: int
    load: int


class Equations:
    """The force pass with all friction as input, and the groups' equations in it."""

    def __init__(self, compiled: Compiled, static: bool) -> None:
        structure = compiled.structure
        s = schedule(structure, compiled.scene, GIVEN, static)
        self.joints = s.ask(friction.input_joints)
        for ref in self.joints:
            if structure.friction_law(ref).reads_load:
                remedy = "runs say with their certificate whether theirs is the only one"
                raise refused(structure.pair_name(ref), BY_LOAD, remedy)
        self._values: dict[Value, int] = {}
        self.steps: list[Group | Driven] = []
        for block in reversed(list(structure.blocks)):
            coupled = s.ask(friction.coupled_joints, block)
            if coupled and s.ask(forces.smooth, block) is not None:
                self.steps.append(self._group(s, block, coupled))
            for ref in s.ask(friction.friction_joints, block):
                if ref not in coupled and s.ask(forces.reaction, ref) is not None:
                    edges = pairs.statics(s, ref).edges
                    self.steps.append(Driven(self.joints.index(ref), edges, *self._pair(s, ref)))
        self.rest = [self._at(s.ask(friction.rest, ref)) for ref in self.joints]
        self.slips = [self._at(s.ask(forward.slip, ref)) for ref in self.joints]
        self.engine = NumpyEngine(s.program(self._values))

    def _at(self, value: Value) -> int:
        return self._values.setdefault(value, len(self._values))

    def _pair(self, s: Schedule, ref: JointRef) -> tuple[int, int, int]:
        """Signed factor, drag and load of a pair."""
        pair = s.ask(forces.reaction, ref)
        assert pair is not None
        measured = pairs.statics(s, ref).measure(s, ref, pair)
        law = s.ask(friction.resistance, ref), s.ask(friction.drag, ref)
        return self._at(law[0]), self._at(law[1]), self._at(measured)

    def _group(self, s: Schedule, block: str, joints: tuple[JointRef, ...]) -> Group:
        base = s.ask(forces.smooth, block)
        k, drags, loads = zip(*(self._pair(s, ref) for ref in joints), strict=True)
        rows = tuple(
            tuple(
                self._at(pairs.statics(s, j).measure(s, j, s.ask(pairs.influence, j, unit, base)))
                for unit in joints
            )
            for j in joints
        )
        contacts = tuple(friction.contacts(s.structure, ref) for ref in joints)
        count = enumeration.paths(contacts)
        if count > enumeration.TRACKS:
            why, remedy = f"{count} complex solutions", "leave friction out of some of its pairs"
            raise refused(block, f"the group has {why}", remedy, f"{enumeration.TRACKS}")
        inputs = tuple(self.joints.index(ref) for ref in joints)
        known = friction.knows_existence(s.structure, block, joints)
        fixed = tuple(map(s.structure.separates, joints))
        return Group(block, inputs, contacts, k, drags, loads, rows, fixed, known)

    def poses(self, taken: Samples) -> Samples:
        """The samples with the rates of slip, which laws of friction ask for."""
        columns = {**taken.given(self.engine.program.inputs), "load_share": np.ones(taken.n)}
        if taken.time is not None:
            columns["t"] = taken.time
        names = [f"slip_{i}" for i in range(len(self.joints))]
        still = Samples(
            taken.n, columns | dict.fromkeys(names, np.zeros(taken.n)), columns.get("t")
        )
        values = self.at(still, np.arange(taken.n), np.zeros((taken.n, len(names))))
        slips = (np.broadcast_to(values[i], taken.n) for i in self.slips)
        return replace(still, inputs=columns | dict(zip(names, slips, strict=True)))

    def inputs(self, poses: Samples, pose: Indices, t: Floats) -> Data:
        """Inputs of a program at some of the poses, with friction (s, joints)."""
        columns = {name: np.asarray(column)[pose] for name, column in poses.inputs.items()}
        return columns | {f"friction_{i}": t[:, i] for i in range(t.shape[1])}

    def at(self, poses: Samples, pose: Indices, t: Floats) -> Values:
        """The program's values."""
        return self.engine.run(self.inputs(poses, pose, t), len(pose))


class Tree:
    """The solutions as far as they are found: one row for each branch."""

    def __init__(self, n: int, joints: int, groups: Sequence[str]) -> None:
        self.pose = np.arange(n)
        self.t = np.zeros((n, joints))
        self.connected = np.ones(n, bool)
        self.index = {name: np.ones(n, np.int8) for name in groups}
        self.proof = np.zeros(n, np.intp)  # of the poses, the weakest of their groups
        self.existence: dict[str, Floats] = {}  # of the poses, at any of their branches

    def grow(self, group: Group, found: Solved) -> None:
        """Replace every branch by one for each solution of a group."""
        self.pose, self.t = self.pose[found.of], self.t[found.of]
        self.t[:, group.inputs] = found.t
        self.connected = self.connected[found.of] & found.connected
        self.index = {name: column[found.of] for name, column in self.index.items()}
        self.index[group.block] = found.signs


class Solved(NamedTuple):
    """Solutions (s,) of a group at n branches.

    of : (s,) the branch that each belongs to, in rising order
    t : (s, m) friction
    signs : (s,) indices
    connected : (s,) whether it is the one that is connected with zero friction
    proof : (n,) index in `PROOFS`
    existence : (n,) the number c of each branch; None where it is not known
    """

    of: Indices
    t: Floats
    signs: NDArray[np.int8]
    connected: Flags
    proof: Indices
    existence: Floats | None


def _planar(z: Complex) -> Planar:
    return Planar(np.ascontiguousarray(z.real), np.ascontiguousarray(z.imag))


def _vector(column: Complex, n: int) -> Vectors:
    vector = column.real + 1j * column.imag if isinstance(column, Planar) else column
    return np.broadcast_to(np.asarray(vector, complex), n)


@np.errstate(all="ignore")
def _solved(group: Group, k: Floats, drag: Floats, base: Vectors, rows: Vectors) -> Solved:
    """All solutions of a group at n branches, with what proves them.

    k, base : (n, m) factors, and loads with the friction ``drag`` that does not follow them
    rows : (n, m, m)
    """
    (n, size), edges = k.shape, tuple(count > 0 for count in group.contacts)
    k_ = tuple(np.ascontiguousarray(k[:, j]) for j in range(size))
    base_ = tuple(_planar(base[:, j]) for j in range(size))
    rows_ = tuple(tuple(_planar(rows[:, j, i]) for i in range(size)) for j in range(size))
    c = BOUND["existence"](k_, group.contacts, rows_) if group.known else None
    exists = False if c is None else c < 1.0
    first: solvers.Solution = BOUND["newton"](k_, edges, base_, rows_, exists)
    start = np.stack(first.t, axis=1)
    sound = np.isfinite(base).all(axis=1) & np.isfinite(rows).all(axis=(1, 2))
    sure = sound & (first.outcome == float(Outcome.CERTIFIED))
    rest = np.flatnonzero(sound & ~sure)
    solutions = enumeration.enumerated(k[rest], base[rest], rows[rest], group.contacts)
    of = rest[solutions.system]
    # The solution that continuation reached is one of them.
    reached = first.outcome == float(Outcome.BY_CONTINUATION)
    off, nearest = np.abs(solutions.t - start[of]).max(axis=1, initial=0.0), np.full(n, np.inf)
    np.minimum.at(nearest, of, off)
    same = nearest <= BLUR * np.abs(start).max(axis=1, initial=0.0)
    connected = reached[of] & same[of] & (off == nearest[of])
    total = np.zeros(n)
    np.add.at(total, of, solutions.signs)
    open_ = ~solutions.complete | (reached & ~same)[rest]
    if c is not None:
        open_ |= ((total == 1) != (c < 1.0))[rest]
    proof = np.where(sound, PROOFS.index(CONTRACTION), PROOFS.index(NO_POSE))
    proof[rest] = np.where(open_, PROOFS.index(UNDECIDED), PROOFS.index(COUNT))
    alone = np.flatnonzero(sure)
    every = np.concatenate([alone, of])
    order = np.argsort(every, kind="stable")
    ones = np.ones(len(alone))
    return Solved(
        every[order],
        (np.concatenate([start[alone], solutions.t]) + drag[every])[order],
        np.concatenate([ones.astype(np.int8), solutions.signs])[order],
        np.concatenate([ones > 0, connected])[order],
        proof,
        c,
    )


def _tree(equations: Equations, taken: Samples, scale: Floats) -> Tree:
    """All branches, the last group first."""
    groups = [step.block for step in equations.steps if isinstance(step, Group)]
    tree = Tree(taken.n, len(equations.joints), groups)
    for step in equations.steps:
        n = len(tree.pose)
        values = equations.at(taken, tree.pose, tree.t)
        factor = scale[tree.pose]
        if isinstance(step, Driven):
            k, load = np.broadcast_to(values[step.k], n) * factor, _vector(values[step.load], n)
            g = BOUND["load_norm"](_planar(load), step.edges)
            tree.t[:, step.input] = k * g + np.broadcast_to(values[step.drag], n)
            continue
        factors = np.where(step.separates, 1.0, factor[:, None])
        weights = np.stack([np.broadcast_to(values[i], n) for i in step.k], axis=1) * factors
        drag = np.stack([np.broadcast_to(values[i], n) for i in step.drags], axis=1)
        base = np.stack([_vector(values[i], n) for i in step.loads], axis=1)
        rows = [np.stack([_vector(values[i], n) for i in row], axis=1) for row in step.rows]
        every = np.stack(rows, axis=1)
        base = base + np.einsum("njm,nm->nj", every, drag)
        solved = _solved(step, weights, drag, base, every)
        if solved.existence is not None:
            tree.existence[step.block] = np.full(taken.n, np.nan)
            tree.existence[step.block][tree.pose] = solved.existence
        np.maximum.at(tree.proof, tree.pose, solved.proof)
        if len(solved.of) > MOST:
            why = f"the solutions multiply from group to group: {len(solved.of)} branches"
            remedy = "ask for fewer poses, or for less friction with scale="
            raise refused(step.block, why, remedy, f"at most {MOST}")
        tree.grow(step, solved)
    return tree


@declared
def friction_solutions(
    mechanism: Compiled,
    at: Coordinates | None = None,
    *,
    samples: int | None = None,
    times: Numbers | None = None,
    rates: Coordinates | None = None,
    accelerations: Coordinates | None = None,
    want: Sequence[str] | str | None = None,
    static: bool = False,
    scale: Numbers | float = 1.0,
) -> FrictionSolutions:
    """All solutions of the friction equations at given poses, and a proof of completeness.

    Parameters
    ----------
    at, samples, times, rates, accelerations : the poses, as those of a run
    want : outputs of each solution; by default drives and reactions
    static : without inertia
    scale : factor [-] of all load-dependent friction; with several, each is applied to all poses

    Raises
    ------
    RequestError for unknown names, settings that do not fit, and a group with too many pins and
        guides for its solutions to be counted

    >>> mech.friction_solutions(5.85, scale=270.0).counts
    array([2])
    """
    taken = mechanism.samples(at, samples, times, rates, accelerations)
    factors = np.atleast_1d(np.asarray(scale, float))
    if factors.ndim != 1 or not len(factors) or not (np.isfinite(factors) & (factors >= 0)).all():
        raise refused("scale", "not a row of numbers that are 0 or above", "give for example 1.5")
    names = mechanism.outputs
    outputs = (
        [n for n in names if n.endswith(DEFAULT)]
        if want is None
        else names.match(as_names("want", want))
    )
    still = static or taken.at_rest
    taken = taken.at(np.tile(np.arange(taken.n), len(factors)))
    scales = np.repeat(factors, taken.n // len(factors))
    equations = Equations(mechanism, still)
    poses = equations.poses(taken)
    tree = _tree(equations, poses, scales)
    plan = names.plan(mechanism.scene, outputs, GIVEN, still, quality=False)
    order = np.lexsort((~tree.connected, tree.pose))
    pose, t = tree.pose[order], tree.t[order]
    settings = {"friction": GIVEN.method, "static": still}
    inputs = equations.inputs(poses, pose, t)
    given = Samples(len(pose), inputs, inputs.get("t"))
    values, engine = mechanism._evaluate(plan, given, "numpy")
    answers = Result(mechanism, plan, given, values, engine, settings)
    forces = [answers[name] for name in outputs if name.endswith(DEFAULT)]
    defined = np.isfinite([np.ones(len(pose)), *forces]).all(axis=0)  # loads may be undefined there
    tree.proof[pose[~defined]] = PROOFS.index(NO_POSE)
    order, pose, answers = order[defined], pose[defined], answers.isel(np.flatnonzero(defined))
    every = np.arange(taken.n)
    rest = equations.at(poses, every, np.zeros((taken.n, len(equations.joints))))
    resting = zip(equations.joints, equations.rest, strict=True)
    joint_names = mechanism._joint_names
    return FrictionSolutions(
        answers,
        pose,
        tree.connected[order],
        {name: column[order] for name, column in tree.index.items()},
        tuple(PROOFS[i] for i in tree.proof),
        tree.existence,
        {
            joint_names.get(str(j), str(j)): np.broadcast_to(rest[i], taken.n) > 0
            for j, i in resting
        },
        scales,
        taken,
    )
