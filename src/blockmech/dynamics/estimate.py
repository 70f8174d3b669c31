"""Estimates of errors, one rule for all methods (numerics 14).

A run and one by half its steps, so that their errors are not alike: the finer is returned. Its
stated error is their difference with rounding, and a share of it (`SMOOTH`) where the equation has
no corners: within a step with one, by chance, the coarser run may err less. It is refined until
that meets the target or nothing finer is left. Two runs that end differently, or differ as two
motions do, did not reach what was asked: the motion is given as far as both agree, and says so.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from blockmech.dynamics import ends
from blockmech.dynamics.layout import until
from blockmech.functions.series import GOLDEN
from blockmech.ground import tolerances
from blockmech.ground.plane import EPS
from blockmech.result.motion import Motion, State
from blockmech.typing import Floats, Real, Reals

if TYPE_CHECKING:
    from blockmech.dynamics.system import System

FINER = 20.0  # tolerance of a second run, besides half the steps (numerics 14)
SMOOTH = 1 / 16  # of an error of order 8, of which half the steps leave 1/256
FLOOR = 100 * EPS  # the least relative tolerance that SciPy's integrators take
TARGET = 1e-9  # [rad or m] of the error if none is given
LEAST = tolerances.ROUNDING  # of a target from which on pairs of runs go down one ladder
LOOSE = 1e-8  # tolerance by which a motion is followed that is computed again
LOOSEST = 1e-5  # tolerance: of longer steps errors do not fall as their order says
COMPARED = 129  # times spread over a run at which two runs are compared, beside those wanted
# Of |q| or t: a value is a sum of some fifty terms of a series, which is the integral of one that
# values were summed to. Roundings of up to EPS / 2 each, added like a random walk, twice that.
ROUNDING = math.sqrt(3 * 50) * EPS
UNFINISHED = *ends.STOPPED, ends.TOO_MANY
PARTED = math.radians(1)  # of its way (of an angle at most a radian) or time: parts two motions


class Difference(NamedTuple):
    """How far two runs are apart, or (...) of many designs two runs each.

    q : [rad or m] largest difference at common times
    t : [s] difference of the ends, at least what the states are apart at the fastest: two ends may
        be met at one time by chance
    agree : whether they are one motion: the same end, at a time known to a percent or two, and
        nowhere further apart than ``limits``
    limits : (..., k) [rad or m] within which each driver's runs are one motion
    off, bends : (..., m, k) [rad or m] differences at common times; by what part of the fastest
        rate rates differ
    times, states : (m,) the common times, and what the finer one says there
    """

    q: Real
    t: Real
    agree: Real
    limits: Floats
    off: Floats
    bends: Floats
    times: Floats = np.empty(0)
    states: State = State(np.empty(0), np.empty(0))

    def error_of_finer(self, remainder: float) -> Real:
        r"""[rad or m] What the finer run is off, if what it is late is a share of theirs.

        Most motions are off in proportion to how late they are. Where rates grow without bound, at
        places without inertia and dead centres, a way x is left with :math:`x \dot x` constant, so
        the time left goes as :math:`x^2`. With x of the run farther from there as the unit, 1 - u
        of the other, whose rates differ by u, and the remainder :math:`\rho` of times, of their
        difference u

        .. math:: 1 - u - \sqrt{(1 - u)^2 - \rho u (2 - u)}

        is left; at most 1 - u, the whole way.
        """
        u = self.bends
        root = np.sqrt(np.maximum((1 - u) ** 2 - remainder * u * (2 - u), 0.0))
        share = np.divide(1 - u - root, u, out=np.zeros_like(u), where=u > 0)
        late = (np.maximum(share, remainder) * self.off).max(axis=(-2, -1))
        return np.maximum(remainder * self.q, late)


@lru_cache(maxsize=8)
def common_times(start: float, last: float, requested: tuple[float, ...]) -> Floats:
    """Times [s] at which two runs are compared."""
    return np.union1d(spread(start, last), [t for t in requested if start <= t <= last])


def spread(start: float, end: float) -> Floats:
    """Times (n,) over a run that keep no step with its swings, which stand still together."""
    shares = np.sort(np.arange(COMPARED - 1) * GOLDEN % 1.0)
    # Beyond the end, where the sum of a later start may round to, there is no state.
    return np.minimum(start + (end - start) * np.append(shares, 1.0), end)


def difference(
    coarse: Motion, fine: Motion, rotary: tuple[bool, ...], requested: tuple[float, ...] = ()
) -> Difference:
    """How far two runs of one motion are apart; ``rotary`` (k,): whose coordinate is an angle."""
    times = common_times(fine.t_start, min(coarse.t_end, fine.t_end), requested)
    states = fine.track.state(times)  # the times lie in both runs
    coarse_states = coarse.track.state(times)
    same = coarse.end == fine.end and coarse.status == fine.status
    beyond = np.abs(np.subtract(coarse.q_end, fine.q_end)) if same else 0.0
    runs = states, coarse_states
    fine_run, coarse_run = (State(*(x.reshape(len(times), -1) for x in run)) for run in runs)
    over = fine.t_start, fine.t_end, coarse.t_end
    apart = compared(fine_run, coarse_run, over, beyond, same, rotary)
    return apart._replace(q=float(apart.q), t=float(apart.t), times=times, states=states)


def compared(
    fine: State, coarse: State, over: Reals, beyond: Real, same: Real, rotary: Real
) -> Difference:
    """How far runs with states (..., m, k) are apart.

    over : [s] their start, and the ends of both, at which they are ``beyond`` apart; ``same`` : by
        the same end
    """
    t_start, t_fine, t_coarse = over
    off, span, late = np.abs(coarse.q - fine.q), t_fine - t_start, np.abs(t_coarse - t_fine)
    apart = np.maximum(off.max(axis=-2), beyond)
    fastest, highest = (np.abs(run.qd).max(axis=(-2, -1)) for run in (fine, coarse))
    size = np.abs(fine.q).max(axis=(-2, -1)) + np.abs(t_fine) * fastest
    reach = np.ptp(fine.q, axis=-2)
    limits = same_motion_limit(reach, np.where(rotary, 1.0, math.inf), size[..., None])
    close = (apart <= limits).all(axis=-1) & (late <= PARTED * span)
    farthest = apart.max(axis=-1)
    lateness = farthest / np.where(fastest > 0, fastest, 1.0)
    late = np.maximum(late, np.where(fastest > 0, lateness, 0.0))
    highest = np.maximum(fastest, highest)[..., None, None]
    bends = np.minimum(np.abs(coarse.qd - fine.qd) / np.where(highest > 0, highest, 1.0), 1.0)
    return Difference(farthest, late, same & (close | (span == 0)), limits, off, bends)


def same_motion_limit(travel: Real, longest: float | Floats, size: Real) -> Real:
    """[rad or m] within which two runs that go so far are one motion.

    travel : numbers or arrays; of more than is ``longest``, a radian of angles, no more counts
    size : of the places, and of what the largest rate makes of the whole time
    """
    return PARTED * np.minimum(travel, longest) + ROUNDING * size


def rounding_share(system: System, q: float, moves: bool, t: float, weaker: float = 1.0) -> float:
    """What rounding leaves unknown of the time of what starts there, relative.

    weaker : by how many times the effort of a design that starts from rest may be the smaller
    """
    share = ROUNDING + system.noise
    if moves:
        return share * system.inertia_rounding(q)
    return max(share, weaker * system.push_rounding(q, t))


def rounded(
    share: float, t_start: float, t: Floats, q: Floats, qd: Floats
) -> tuple[Floats, Floats, bool]:
    """How late states are by a share of their time, and how far that takes them.

    t, q, qd : (n,) [s], (n,) or (n, k) states in order of time
    And whether rates change so fast that this is more than the way to both neighbours.
    """
    late = share * np.maximum(np.abs(t), t - t_start)
    off = (late * np.abs(qd).T).T
    beyond = off[1:] > np.abs(q[1:] - q[:-1])
    if np.count_nonzero(beyond):  # also than the way to what follows
        beyond[:-1] &= off[1:-1] > np.abs(q[2:] - q[1:-1])
    travel, usual = np.abs(qd[1:]).T * np.diff(t), np.abs(np.diff(q, axis=0)).T
    sudden = np.any(travel > usual / EPS**0.25)  # a rate without bound
    return late, off, bool(beyond.any() or sudden)


def with_rounding(
    system: System,
    motion: Motion,
    target: float | None,
    by: Difference | None = None,
    states: int = 0,
) -> Motion:
    """The motion; its error with what rounding leaves unknown of all runs alike.

    A coordinate is rounded itself. Inertia and loads, known to rounding or to the `noise` of the
    system, set the time of all; where a motion starts with a small inertia, that has the
    rounding of a usual one, and where it starts from rest by a small effort, that of its parts.
    ``by``: where its states are known already. ``states`` are those that steps in time asked for,
    a dozen each: each step rounds the state once more, which adds like a random walk.
    """
    if motion.error < math.inf and motion.t_end > motion.t_start:
        if by is None or not by.agree or by.times[-1] < motion.t_end:
            times = spread(motion.t_start, motion.t_end)
            sampled = motion.at(times)
        else:
            times, sampled = by.times, by.states
        steps = max(0.0, math.sqrt(states / 12) * EPS - ROUNDING)
        share = ROUNDING + system.noise
        if system.scalar:
            q, qd = (float(x[0]) for x in sampled)
            usual = np.median(np.abs(sampled.qd)) or np.abs(sampled.qd).max()
            moves = abs(qd) > EPS * float(usual)  # a series' 0 is rounded too
            share = rounding_share(system, q, moves, motion.t_start)
        late, off, unsure = rounded(share + steps, motion.t_start, times, *sampled)
        if unsure:
            inside = times <= motion.t_end  # of speeds without bound
            before = np.clip(times - late, motion.t_start, motion.t_end)
            off = np.abs(sampled.q - motion.at(before).q)[inside]
            sampled = State(sampled.q[inside], sampled.qd[inside])
        off += (ROUNDING + steps) * np.abs(sampled.q)
        clock = motion.time_error + (0.0 if motion.end == "time" else float(late[-1]))
        motion = motion.but(error=motion.error + float(off.max()), time_error=clock)
    return motion if target is None else missed(motion, target)


def missed(motion: Motion, target: float, why: str = "") -> Motion:
    """The motion, with a note if its error is above the target, and why."""
    if motion.error <= target or motion.status == "failed" or motion.end in ends.STOPPED:
        return motion
    note = f"accuracy not reached: {motion.error:.1e} instead of {target:.1e}{why}"
    return replace(motion, notes=(*motion.notes, note))


def refined(
    run: Callable[[float, bool], Motion],
    system: System,
    target: float,
    requested: tuple[float, ...],
    remainder: float,
) -> Motion:
    """A motion whose error is estimated, and meets the target if a pair of runs does.

    run : the motion at a tolerance, or by half the steps of the run before; that has no error where
        nothing moves
    remainder : of the difference of two runs the finer one is off by no more

    Targets below `LEAST` go down one ladder of tolerances, so that errors fall with the request.
    """
    tolerance, best = max(min(target, LOOSEST), LEAST), None
    while True:
        coarse = run(tolerance, False)
        if coarse.end in UNFINISHED:
            return missed(stopped(coarse, best), target)
        if not coarse.error:
            return coarse
        fine = run(max(tolerance / FINER, FLOOR), True)
        if fine.end in UNFINISHED and fine.t_end < coarse.t_end:
            return missed(stopped(fine, best or coarse), target)
        apart = difference(coarse, fine, system.rotary, requested)
        steps = judged(coarse, fine, apart, requested, remainder)
        motion = with_rounding(system, steps, None, apart, fine.cost.states - coarse.cost.states)
        if best is None or best.end == ends.UNDECIDED:
            best = motion
        elif apart.agree:
            best = confirmed(best, motion, system.rotary, requested)
        if apart.agree and motion.error <= target:
            return best
        floor = apart.agree and 2 * steps.error <= motion.error
        if floor or tolerance <= FLOOR:
            return missed(best, target, ", at the floor of rounding" if floor else "")
        share = 0.3 * target / motion.error if apart.agree else 0.0
        share = min(share, 0.5) if target >= LEAST and share > 0 else 1 / FINER
        tolerance = max(tolerance * share, FLOOR)


def confirmed(
    before: Motion, motion: Motion, rotary: tuple[bool, ...], requested: tuple[float, ...]
) -> Motion:
    """The motion of two pairs of runs whose error is the smaller.

    Where that is not the finer one rounding is at work, and errors of a pair may cancel by chance:
    it is off by no less than it is from the finer one.
    """
    if motion.error < before.error:
        return motion
    apart = difference(before, motion, rotary, requested)
    return before.but(error=max(before.error, apart.q)) if apart.agree else before


def judged(
    coarse: Motion,
    fine: Motion,
    apart: Difference,
    requested: tuple[float, ...],
    remainder: float = 1.0,
) -> Motion:
    """The finer of two runs with its error, a share of their difference, or what both know."""
    if apart.agree:
        late = 0.0 if fine.end == "time" else remainder * apart.t
        return fine.but(error=apart.error_of_finer(remainder), time_error=fine.time_error + late)
    times = common_times(fine.t_start, min(coarse.t_end, fine.t_end), requested)
    off = np.abs(coarse.at(times).q - fine.at(times).q).reshape(times.size, -1)
    parted = np.flatnonzero(~(off <= apart.limits).all(axis=1))
    last = int(parted[0]) - 1 if parted.size else times.size - 1
    t = float(times[max(last, 0)])
    description = f"they differ by {apart.q:.1e}, in the time of their ends by {apart.t:.1e} s"
    if coarse.end != fine.end:
        description = f"one ends in {coarse.end}, the other in {fine.end}"
    note = f"two runs that differ in accuracy alone part after t = {t:.9g} s: {description}"
    error, notes = float(off[: max(last, 0) + 1].max()), (*fine.notes, note)
    uncertainty = {"error": error, "time_error": math.inf, "notes": notes}
    return until(fine, t).but(status="failed", end=ends.UNDECIDED, **uncertainty)


def stopped(motion: Motion, best: Motion | None) -> Motion:
    """What is kept of a run that was stopped: the better run before it, if there is one."""
    if best is None or best.t_end < motion.t_end:
        note = f"{motion.end}: the error is not judged by another run"
        return replace(motion, error=math.inf, time_error=math.inf, notes=(*motion.notes, note))
    judged = math.isfinite(best.error)
    best = best if judged else replace(best, error=math.inf, time_error=math.inf)
    if motion.end == ends.TOO_MANY:
        return best
    description = "by coarser runs" if judged else "not judged by another run"
    notes = (*best.notes, f"{motion.end}: the error is {description}")
    return replace(best, status=motion.status, end=motion.end, notes=notes)
