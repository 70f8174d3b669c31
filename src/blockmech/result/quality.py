"""Quality of a result: which samples have an answer, how good it is, and why not.

Everything is worked out from the plan's own reports (margins, friction) and from
the values themselves, so no sample without a reason is handed out as an answer.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from blockmech.friction.continuation import Outcome
from blockmech.ground.report import Facts, as_json
from blockmech.ground.tolerances import BLUR, ROUNDING
from blockmech.model.structure import Structure
from blockmech.typing import Array, Data, Floats, Real, Record

OK = "ok"
NO_ASSEMBLY = "no-assembly"
NOT_CONVERGED = "not-converged"
SELF_LOCKED = "self-locked"
JAMMED = "jammed"
DEAD_CENTRE, CHANGE_POINT, DIGITS_LOST = "dead-centre", "change-point", "digits-lost"
UNDEFINED = "undefined"
FAILURES = NO_ASSEMBLY, NOT_CONVERGED, SELF_LOCKED, JAMMED, DEAD_CENTRE, CHANGE_POINT, UNDEFINED
WORDS = OK, *FAILURES
REACTION_REVERSAL = "reaction-reversal"  # of a pin with clearance
OTHER_SOLUTIONS = "other-solutions"  # of the friction equations, beside the one that is given
# Near a change point reactions lose EPS / margin^1.5: as much as EPS / margin elsewhere.
NEAR_CHANGE = BLUR ** (2 / 3)
DETAIL = {
    Outcome.BY_CONTINUATION: "by-continuation",
    Outcome.NOT_CONVERGED: "slow",
    Outcome.FOLD: "fold",
    Outcome.ASYMPTOTE: "asymptote",
}


ADVICE = {
    "zero-relative-speed": "nothing slides there; the numbers are without its friction",
    f"near-{DEAD_CENTRE}": "reactions grow without bound towards the dead centre",
    f"near-{CHANGE_POINT}": "two assembly modes nearly meet, and few digits are right",
    OTHER_SOLUTIONS: "friction_solutions() lists them",
    REACTION_REVERSAL: "the pin crosses its clearance, with a knock",
    DIGITS_LOST: "rounding for the most part",
}
"""What a flag means to a reader, by its code."""


@dataclass(frozen=True)
class Flag(Facts):
    """One remark on one sample: code, the block or joint, and its numbers."""

    sample: int
    code: str
    where: str
    interval: tuple[float, float] | None = None
    value: float | None = None

    def to_dict(self) -> Data:
        """The flag as a JSON object."""
        return {name: x for name, x in super().to_dict().items() if x is not None}


@dataclass(frozen=True)
class Quality(Facts):
    """Quality of n samples.

    Attributes
    ----------
    status : n words: "ok", "no-assembly", "not-converged", "self-locked", "jammed",
        "dead-centre", "change-point", "undefined" (a requested value, at a feasible pose)
    blame : sample without an answer -> the block that causes it
    margin, iterations, residual, contraction : block -> (n,) [-]
    existence : block -> (n,) [-], below 1 where its friction has a solution for every load; for
        blocks where it is known (`blockmech.friction.equations`)
    flags : remarks, by sample
    """

    FACTS = ("status", "margin", "residual", "friction_error", "contraction", "existence", "flags")

    status: tuple[str, ...]
    blame: Mapping[int, str]
    margin: Mapping[str, Floats]
    iterations: Mapping[str, Floats]
    residual: Mapping[str, Floats]
    contraction: Mapping[str, Floats]
    flags: tuple[Flag, ...] = field(default=())
    existence: Mapping[str, Floats] = field(default_factory=dict)

    @property
    def gaps(self) -> tuple[int, ...]:
        """Samples without an answer."""
        return tuple(sorted(self.blame))

    @property
    def friction_error(self) -> dict[str, Floats]:
        """Block -> bound (n,) [-] on the error of its friction, relative to the largest."""
        residuals = self.residual.items()
        return {name: left_undone(x, self.contraction[name]) for name, x in residuals}

    def to_dict(self) -> Data:
        """The ``quality`` section of a result."""
        counts = {block: [int(x) for x in row] for block, row in self.iterations.items()}
        return {**super().to_dict(), "iterations": counts}


class Failures(NamedTuple):
    """Which samples have no answer, and why.

    word : (...) index in `WORDS`, 0 where there is an answer
    block : (...) index in ``blocks`` of the block that has none; 0 where it is not one's
    """

    word: NDArray[np.int8]
    block: NDArray[np.int64]
    blocks: tuple[str, ...]


def failures(
    margin: Record, outcome: Record, undefined: NDArray[np.bool_], structure: Structure
) -> Failures:
    """Samples (...) without an answer: the first block that fails is blamed.

    Parameters
    ----------
    margin, outcome : block -> (...) its margin, and how its friction ended
    undefined : (...) whether a wanted value is not finite
    structure : dyads whose branch follows the motion run on where their margin is zero
    """
    following = structure.followed
    blocks = ("", *dict.fromkeys((*margin, *outcome)))
    word, blame = np.zeros(undefined.shape, np.int8), np.zeros(undefined.shape, np.int64)

    def note(failing: NDArray[np.bool_], failure: str, block: str) -> None:
        new = failing & (word == 0)
        if new.any():
            word[new], blame[new] = WORDS.index(failure), blocks.index(block)

    for block, m in margin.items():
        if block not in following and m.min(initial=np.inf) > 0:  # not of NaN
            continue
        failing = ~(m > 0) & ~((m == 0) & ~undefined)
        if block in following:
            failing |= (m > 0) & (m < NEAR_CHANGE) & undefined
            note(failing & ~(m < -ROUNDING), CHANGE_POINT, block)
        note(failing & (m >= -ROUNDING), DEAD_CENTRE, block)
        note(failing, NO_ASSEMBLY, block)
    for block, results in outcome.items():
        if not np.any(results):
            continue
        by, joints = structure.blocks[block].friction, structure.blocks[block].joints
        locked = JAMMED if any(joints[j].kind == "P" for j in by) else SELF_LOCKED
        for outcome_kind in Outcome:
            if not outcome_kind.solved:
                failure = NOT_CONVERGED if outcome_kind == Outcome.NOT_CONVERGED else locked
                note((results == outcome_kind) & np.ones_like(undefined), failure, block)
    note(undefined, UNDEFINED, "")
    return Failures(word, blame, blocks)


def assess(
    n: int,
    reports: Mapping[str, Mapping[Any, tuple[Array, ...]]],
    failed: Failures,
    structure: Structure,
) -> Quality:
    """Work out the quality of a run.

    Parameters
    ----------
    n : number of samples
    reports : as `plan.Plan.reports`, with arrays in place of indices
    failed : samples without an answer
    structure : as that of `failures`
    """
    following = structure.followed
    margin = {block: at_most_one(m) for block, (m,) in reports["margin"].items()}
    friction = reports["friction"]
    gaps = np.flatnonzero(failed.word).tolist()
    status = tuple(np.array(WORDS, object)[failed.word].tolist()) if gaps else (OK,) * n
    blame = {i: failed.blocks[failed.block[i]] for i in gaps}
    flags: list[Flag] = []
    for k, (block, m) in enumerate(margin.items(), 1):
        name = CHANGE_POINT if block in following else DEAD_CENTRE
        threshold = NEAR_CHANGE if block in following else BLUR
        if m.min(initial=np.inf) >= threshold:  # the commonest case at once; not of NaN
            continue
        mine = (failed.word == 0) | (failed.block >= k) | (failed.block == 0)  # no earlier one's
        for i in np.flatnonzero(~(m > 0)):
            if m[i] == 0 or (mine[i] and failed.word[i] == WORDS.index(name)):
                flags.append(Flag(int(i), name, block, value=0.0))
        for i in np.flatnonzero((m > 0) & (m < threshold)):
            lost = failed.word[i] > 0 and failed.block[i] == k
            flags.append(Flag(int(i), name if lost else f"near-{name}", block, value=float(m[i])))
    for block, (share,) in reports["path"].items():  # followed from home, and lost on the way
        for i in np.flatnonzero(share < 1.0):
            flags.append(Flag(int(i), "path-ended", block, value=float(share[i])))
    for block, (_, _, _, outcome, limit) in friction.items():
        for i in np.flatnonzero(outcome > 0):
            failure = Outcome(int(outcome[i]))
            flags.append(Flag(int(i), DETAIL[failure], block, value=as_json(limit[i])))
    for block, (c,) in reports["existence"].items():
        for i in np.flatnonzero((c > 1) & (failed.word == 0)):
            flags.append(Flag(int(i), OTHER_SOLUTIONS, block, value=float(c[i])))
    for joint, (resting, capacity) in reports["rest"].items():
        for i in np.flatnonzero(resting > 0):
            reach = float(capacity[i])
            if np.isfinite(reach):
                flags.append(Flag(int(i), "zero-relative-speed", joint, interval=(-reach, reach)))
    for (coupling, code), (push,) in reports["push"].items():
        low = np.flatnonzero(push < 0.0).tolist()
        flags += [Flag(int(i), code, coupling, value=float(push[i])) for i in low]
    for where, (x, y) in reports["pressing"].items():
        R = np.broadcast_to(x + 1j * y, n)
        flags += [Flag(i, REACTION_REVERSAL, where, value=float(abs(R[i]))) for i in reversals(R)]
    flags += [Flag(i, UNDEFINED, "mechanism") for i, block in blame.items() if not block]
    flags.sort(key=lambda f: (f.sample, f.code, f.where))
    return Quality(
        status,
        blame,
        margin,
        {k: np.nan_to_num(v[0]) for k, v in friction.items()},
        {k: v[1] for k, v in friction.items()},
        {k: v[2] for k, v in friction.items()},
        tuple(flags),
        {k: c for k, (c,) in reports["existence"].items()},
    )


def reversals(R: Array) -> list[int]:
    """Samples at which a reaction (n,) passes near zero, so that a journal crosses its bush.

    It does where it is zero, and where it turns by a right angle or more from one sample to the
    next: there the smaller one of the two is the sample. Samples count in the order of the run.
    """
    size, turned = np.abs(R), (R[1:] * np.conj(R[:-1])).real <= 0.0
    k = np.flatnonzero(turned)
    crossings = np.where(size[k] <= size[k + 1], k, k + 1)
    return sorted({*crossings.tolist(), *np.flatnonzero(size == 0.0).tolist()})


def left_undone(residual: Real, contraction: Real) -> Real:
    """Bound [-] of what iterations of friction left undone, of a group's largest friction.

    The residual over 1 - P; the ratio of changes stands for P where that is observed. Infinite
    where P is 1 or more.
    """
    P = np.asarray(contraction, float)
    with np.errstate(all="ignore"):
        return np.where(P < 1.0, np.asarray(residual, float) / (1.0 - P), np.inf)


def at_most_one(margin: Real) -> Real:
    """A margin [-] without the last bit by which rounding may pass its bound, 1."""
    return np.minimum(margin, 1.0)


@dataclass(frozen=True)
class Accuracy(Facts):
    """The settings chosen for a requested accuracy, and their estimated error.

    Attributes
    ----------
    target : requested error [- or rad]
    estimate : estimated error of the worst output at the worst sample that has an answer
    friction, iterations, precision : the chosen settings
    why : the reason in words
    """

    FACTS = ("target", "estimate", "friction", "iterations", "precision", "why", "reached", "word")

    target: float
    estimate: float
    friction: str
    iterations: int | None
    precision: str
    why: str

    @property
    def reached(self) -> bool:
        """Whether the estimate is within the target."""
        return self.estimate <= self.target

    @property
    def word(self) -> Literal["reached", "missed", "not judged"]:
        """Whether the target is met, in words; "not judged" if the estimate leaves no digit."""
        if self.reached:
            return "reached"
        return "missed" if self.estimate < 1 else "not judged"

    def __str__(self) -> str:
        method = f"friction {self.friction}"
        if self.iterations is not None:
            method += f", {self.iterations} iterations"
        phrases = {"reached": "", "missed": "; accuracy not reached"}
        reached = phrases.get(self.word, f"; accuracy {self.word}")
        return (
            f"accuracy {self.target:.1g}: {method}, {self.precision}; "
            f"estimated error {self.estimate:.1g}, {self.why}{reached}"
        )
