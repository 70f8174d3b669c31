r"""Swings of many designs along the path, to their first standstill, as machine code.

    J, tau at the nodes of a piece -> series -> K by integration -> clock -> next panel ...

as `Stretch` does it with arrays for one mechanism, and the second run beside the first as in
`second_run`: once J and tau are series the path method knows nothing of the mechanism. Functions
here are of the language of `blockmech.engines.loops`; run by Python they say the same.

A design whose series are not resolved on the pieces of the mechanism that the family is made of,
that comes near a dead centre, does not stand still within a turn, or whose two runs part, is left
out: who asked moves it otherwise.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable
from functools import cache, partial
from math import sqrt
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, TypeAlias

import numpy as np

from blockmech.dynamics.batch import GOAL, UNSURE, Motions, Track, rounding_share
from blockmech.dynamics.estimate import PARTED, ROUNDING, TARGET
from blockmech.dynamics.panels import (
    FROM_REST,
    NEAR,
    PLAIN,
    SMALLEST,
    TO_REST,
    Floats,
    basis,
    rule,
)
from blockmech.dynamics.path_mesh import COARSE, FINE, PathMesh
from blockmech.dynamics.place_data import NOTHING, RESOLVED, SHORT
from blockmech.dynamics.second_run import KEPT
from blockmech.engines import loops
from blockmech.engines.llvm import addresses_of, machine_code, slots_of
from blockmech.engines.loops import Counts, Reals
from blockmech.plane import EPS
from blockmech.series import LEVEL, NOISE

if TYPE_CHECKING:
    from blockmech.dynamics.request import SimulationRequest
    from blockmech.dynamics.system import System
    from blockmech.engines.stages import CompiledRhs

CLEAR = 1 / 64  # of its largest, below which an inertia is left to the single motion; of a margin
LONG = 1 - 4 * EPS  # of a piece: a panel over all of it
TRIES = 8  # of Newton's method for the place of a standstill
HALVED = 4 * SHORT  # panels that a piece is tried in
ROOT = math.sqrt(EPS)


class Sizes(NamedTuple):
    """Nodes of both samplings, terms of the second clock, components of a state; then where the
    nodes and matrices of the path method begin in an array of all of them, see `matrices`."""

    n: int
    k: int
    terms: int
    state: int
    v: int
    v_there: int
    series: int
    series_there: int
    spread: int
    plain: int
    rest: int
    average: int
    leads: int
    since: int
    slope: int


Row: TypeAlias = Annotated[Reals, "of.n + 2"]
Rows: TypeAlias = Annotated[Reals, "2", "of.n + 2"]  # of both runs: J and tau
Runs: TypeAlias = Annotated[Reals, "4"]  # place, energy, time, where it stands still
Fill: TypeAlias = Callable[[Reals, Reals, Reals, int, int, int, int], float]


def product(x: Reals, M: Reals, out: Reals, rows: int, columns: int, by: float) -> None:
    """``out`` = ``by`` x M, of x (rows,) and M (rows, columns)."""
    for i in range(columns):
        out[i] = 0.0
    for j in range(rows):
        factor = by * x[j]
        for i in range(columns):
            out[i] += factor * M[j * columns + i]


def series_at(c: Reals, n: int, x: Reals, out: Reals, b: Reals, m: int) -> None:
    """Values of a series at x (m,) in [-1, 1], by Clenshaw's rule; ``b`` has room for 2 m."""
    for i in range(m):
        b[i] = 0.0
        b[m + i] = 0.0
    for k in range(n - 1, 0, -1):
        for i in range(m):
            now = c[k] + 2.0 * x[i] * b[i] - b[m + i]
            b[m + i] = b[i]
            b[i] = now
    for i in range(m):
        out[i] = c[0] + x[i] * b[i] - b[m + i]


def largest(c: Reals, begin: int, end: int) -> float:
    """The largest magnitude of some numbers."""
    size = 0.0
    for i in range(begin, end):
        size = max(size, abs(c[i]))
    return size


def ending(c: Reals, n: int) -> float:
    """What ends a series, as `blockmech.series.tail` says it."""
    q, size = n >> 2, largest(c, 0, n)
    last, before = largest(c, n - q, n), largest(c, n - 2 * q, n - q)
    if size == 0.0 or (last > LEVEL * before and last / size < NOISE):
        return 0.0
    return last / size


def sampled(
    of: Sizes, fill: Fill, x: Reals, P: Reals, row: Reals, state: Reals, low: float, length: float,
    v: Reals, to_series: Reals, values: Row, series: Row, n: int,
) -> bool:  # fmt: skip
    """J and tau at n nodes of a piece, and their series; whether these are resolved."""
    margin = 1.0
    for i in range(n):
        state[0] = low + length * v[i]
        fill(x, P, row, 1, 1, 0, 1)
        margin = min(margin, row[of.state])
        values[0, i] = row[of.state + 1]
        values[1, i] = row[1] * row[of.state + 1]
        if not (margin > CLEAR and values[0, i] > 0.0):
            return False
    tolerance, size = max(RESOLVED, NOTHING / margin), largest(values[0], 0, n)
    for i in range(n):
        if values[0, i] < CLEAR * size:
            return False
    for j in range(2):
        product(values[j], to_series, series[j], n, n, 1.0)
        if ending(series[j], n) > tolerance:
            return False
    return True


def both_sampled(
    of: Sizes, fill: Fill, M: Reals, x: Reals, P: Reals, row: Reals, state: Reals, low: float,
    length: float, rounding: float, series: Rows, whole: Rows,
) -> bool:  # fmt: skip
    """The same of both samplings, the second one's values at the nodes of the first."""
    if not sampled(
        of, fill, x, P, row, state, low, length, M[of.v :], M[of.series :], whole[0], series[0],
        of.n,
    ):  # fmt: skip
        return False
    if not sampled(
        of, fill, x, P, row, state, low, length, M[of.v_there :], M[of.series_there :], whole[1],
        series[1], of.k,
    ):  # fmt: skip
        return False
    series[1, 0, 0] += rounding * largest(whole[0, 0], 0, of.n)
    for j in range(2):
        for i in range(of.k, of.n):
            series[1, j, i] = 0.0
        product(series[1, j], M[of.spread :], whole[1, j], of.k, of.n, 1.0)
    return True


def over(
    of: Sizes, M: Reals, low: float, length: float, begin: float, end: float, kind: int,
    series: Row, whole: Row, rows: Row, b: Reals, first: int,
) -> None:  # fmt: skip
    """Rows from the ``first`` on at the nodes of a panel, and at its anchor."""
    v, anchor = M[of.v :], end if kind == TO_REST else begin
    way, places = begin - end if kind == TO_REST else end - begin, 2.0 / length
    for i in range(of.n):
        share = v[i] if kind == PLAIN else v[i] * v[i]
        b[i] = min(max(places * (anchor - low + way * share) - 1.0, -1.0), 1.0)
    b[of.n] = min(max(places * (anchor - low) - 1.0, -1.0), 1.0)
    whole_piece = kind == PLAIN and abs(way) >= LONG * length
    done = of.n if whole_piece else 0
    for j in range(first, 2):
        for i in range(done):
            rows[j, i] = whole[j, i] if way > 0.0 else whole[j, of.n - 1 - i]
        series_at(series[j], of.n, b[done:], rows[j][done:], b[of.n + 2 :], of.n + 1 - done)


def standstill(
    of: Sizes, M: Reals, low: float, length: float, run: Reals, stop: float, series: Row,
    whole: Row, rows: Row, b: Reals,
) -> bool:  # fmt: skip
    """Whether the place is found at which a run has no energy left, near ``stop``."""
    for _ in range(TRIES):
        over(of, M, low, length, run[0], stop, PLAIN, series, whole, rows, b, 1)
        mean, way = 0.0, stop - run[0]
        for i in range(of.n):
            mean += M[of.average + i] * rows[1, i]
        b[0] = min(max(2.0 * (stop - low) / length - 1.0, -1.0), 1.0)
        series_at(series[1], of.n, b, b[1:], b[2:], 1)
        effort = b[1]
        if not effort * way < 0.0:
            return False
        step = (run[1] + way * mean) / -effort
        stop += step
        run[3] = stop
        if abs(step) <= NEAR * NEAR * abs(way) or abs(step) <= EPS * abs(stop):
            return True
    return False


def clock(
    of: Sizes, M: Reals, way: float, kind: int, energy: float, gains: Reals, rows: Row,
    speeds: Reals, rate: Reals,
) -> None:  # fmt: skip
    """Coefficients of dt/dv of a panel that begins with an energy."""
    leads = M[of.leads + 1 :] if kind == PLAIN else M[of.leads + of.n + 3 :]
    for i in range(of.n):
        speeds[i] = sqrt(rows[0, i] / (2.0 * (energy + gains[i]))) * leads[i]
    p = 1.0 if kind == PLAIN else 2.0
    product(speeds, M[of.series :], rate, of.n, of.n, p * abs(way))


def is_smooth(
    of: Sizes, M: Reals, way: float, kind: int, energy: float, effort: float, gains: Reals,
    rows: Row, rate: Reals,
) -> bool:  # fmt: skip
    """Whether the time of a panel is smooth enough for its nodes, see `Panels.smooth`."""
    v, doubt, first, size = M[of.v :], 0.0, 0.0, largest(rate, 0, of.n)
    for i in range(of.n):
        K = energy + gains[i]
        if not K > 0.0:
            return False
        doubt = max(doubt, (v[i] if kind == PLAIN else v[i] * v[i]) / K)
        first += rate[i] if i - 2 * (i >> 1) == 0 else -rate[i]
    if not ending(rate, of.n) <= max(RESOLVED, EPS * effort * doubt * abs(way)):
        return False
    left = max(largest(rate, of.n - (of.n >> 2), of.n), RESOLVED * size)
    known = abs(way) * sqrt(rows[0, of.n] / (2.0 * energy)) if energy > 0.0 else 0.0
    return kind != PLAIN or abs(first - known) <= of.n * left


def compared(
    of: Sizes, M: Reals, runs: Runs, ends: Reals, kind: int, rates: Row, since: Row,
    slopes: Reals, share: float, found: Reals,
) -> None:  # fmt: skip
    """How far the second run is from the first on a panel, and what rounding leaves of both.

    Their times go on to its end.
    """
    for i in range(of.terms, of.n):
        rates[1, i] = 0.0
    for r in range(2):
        product(rates[r], M[of.since :], since[r], of.n, of.n + 2, 1.0)
    product(rates[0], M[of.slope :], slopes, of.n, of.n + 2, 1.0)
    v = M[of.leads + of.n + 2 :]
    last, backward, p = of.n + 1, kind == TO_REST, 1.0 if kind == PLAIN else 2.0
    anchor, other = ends[0] if backward else runs[0, 0], ends[1] if backward else runs[1, 0]
    way, way_there = ends[0] - runs[0, 0], ends[1] - runs[1, 0]
    sign = 1.0 if way > 0.0 else -1.0
    if backward:
        way, way_there = -way, -way_there
    for i in range(of.n + 2):
        t, late, lead = since[0, i], since[1, i], 1.0 if kind == PLAIN else v[i]
        if backward:
            t, late = since[0, last] - t, since[1, last] - late
        t += runs[0, 2]
        late += runs[1, 2] - t
        rate = sign * p * abs(way * lead / slopes[i])
        q = anchor + way * (lead * v[i])
        off = other + way_there * (lead * v[i]) - q
        found[2] = max(found[2], abs(off - late * rate))
        found[3] = max(found[3], share * abs(t * rate) + ROUNDING * abs(q))
    runs[0, 2] += since[0, last]
    runs[1, 2] += since[1, last]


def emptied(of: Sizes, M: Reals, run: Reals, way: float, kind: int, gains: Reals, brake: float,
    stop: float) -> float:  # fmt: skip
    """About where a run's energy is used up on a panel; ``stop``, that is beyond it, if nowhere.

    At the end it is but for rounding: as much as ``brake`` [N m or N] takes on a part of the way.
    """
    begin, before = float(run[0]), float(run[1])
    for i in range(of.n + 1):
        share = 1.0
        if i < of.n:
            share = M[of.v + i] if kind == PLAIN else M[of.v + i] * M[of.v + i]
        there, K = float(run[0]) + way * share, float(run[1] + gains[i])
        if K <= 0.0 or (i == of.n and ROOT * brake * abs(way) > K):
            return begin + (there - begin) * (before / (before - min(K, 0.0)))
        begin, before = there, K
    return stop


def piece(
    of: Sizes, M: Reals, low: float, length: float, sign: float, rounding: float, share: float,
    runs: Runs, room: Rows, b: Reals, found: Reals,
) -> int:  # fmt: skip
    """Both runs over a piece: 1 where they go on, 2 where they stand still, 0 for a failure."""
    series, whole, rows, gains = room, room[2:], room[4:], room[6]
    rates, since, slopes, speeds, ends = room[7], room[8], room[9, 0], room[9, 1], room[10, 0]
    effort, far = largest(whole[0, 1], 0, of.n), low + length if sign > 0.0 else low
    end, stands, beyond = far, False, far + 2.0 * sign * length
    for _ in range(HALVED):
        kind = TO_REST if stands else FROM_REST if runs[0, 1] == 0.0 else PLAIN
        energies = M[of.plain :] if kind == PLAIN else M[of.rest :]
        for r in range(2):
            ends[r] = runs[r, 3] if stands else end
            over(of, M, low, length, runs[r, 0], ends[r], kind, series[r], whole[r], rows[r], b, 0)
            along = runs[r, 0] - ends[r] if stands else ends[r] - runs[r, 0]
            product(rows[r, 1], energies, gains[r], of.n, of.n + 1, along)
        way = ends[0] - runs[0, 0]
        stop = beyond
        if not stands:
            brake = max(-sign * rows[0, 1, of.n - 1], 0.0)
            stop = emptied(of, M, runs[0], way, kind, gains[0], brake, beyond)
        if stop != beyond and kind == FROM_REST:
            end = runs[0, 0] + (stop - runs[0, 0]) / 2.0
            continue
        if stop != beyond:
            stands = True
            for r in range(2):
                if not standstill(
                    of, M, low, length, runs[r], stop, series[r], whole[r], rows[r], b
                ):  # fmt: skip
                    return 0
            if sign * (runs[0, 3] - far) > ROOT * abs(runs[0, 3] - runs[0, 0]):
                return 0
            continue
        for r in range(2):
            energy, along = 0.0 if stands else runs[r, 1], ends[r] - runs[r, 0]
            clock(of, M, along, kind, energy, gains[r], rows[r], speeds, rates[r])
        energy = 0.0 if stands else runs[0, 1]
        if not is_smooth(of, M, way, kind, energy, effort, gains[0], rows[0], rates[0]):
            end, stands = runs[0, 0] + way / 2.0, False
            continue
        compared(of, M, runs, ends, kind, rates, since, slopes, share, found)
        if stands:
            return 2
        mean = 0.0
        for i in range(of.n):
            mean += abs(rows[1, 1, i]) / of.n
        runs[0, 1] += gains[0, of.n]
        runs[1, 1] += gains[1, of.n] + rounding * abs(way) * mean
        runs[0, 0], runs[1, 0] = end, end
        if end == far:
            return 1
        end = end + 2.0 * way if abs(2.0 * way) < abs(far - end) else far
    return 0


def swings(
    of: Sizes, fill: Fill, slots: int, x: Reals, numbers: Reals, row: Reals, state: Reals,
    lows: Reals, lengths: Reals, pieces: Counts, start: Reals, M: Reals, runs: Runs, room: Rows,
    b: Reals, found: Annotated[Reals, "6"], designs: int,
) -> None:  # fmt: skip
    """Each design's way to its first standstill.

    lows, lengths, pieces : of the pieces ahead with the coordinate, and behind them against it
    start : coordinate and rate, the least effort that moves it, `ROUNDING` of work and of time
    room : both runs' series, values of whole pieces, rows, gains, rates and times
    found : (designs, 6) time and place of the end, difference of the runs, what rounding leaves,
        difference of their ends, and 1 where all that is known
    """
    for d in range(designs):
        P, q, rate = numbers[d * slots :], start[0], start[1]
        state[0] = q
        fill(x, P, row, 1, 1, 0, 1)
        push, J = row[1] * row[of.state + 1], row[of.state + 1]
        if rate == 0.0 and not abs(push) > start[2]:
            continue
        sign = 1.0 if rate > 0.0 or (rate == 0.0 and push > 0.0) else -1.0
        first, many = 0 if sign > 0.0 else pieces[0], pieces[0 if sign > 0.0 else 1]
        for r in range(2):
            fast = rate * (1.0 + r * ROUNDING)
            runs[r, 0], runs[r, 1], runs[r, 2] = (
                q * (1.0 + r * ROUNDING),
                J * fast * fast / 2.0,
                0.0,
            )
        for p in range(first, first + many):
            how = 0
            if both_sampled(
                of, fill, M, x, P, row, state, lows[p], lengths[p], start[3], room, room[2:]
            ):
                how = piece(
                    of, M, lows[p], lengths[p], sign, start[3], start[4], runs, room, b, found[d]
                )
            if how != 1:
                found[d, 5] = 1.0 if how == 2 else 0.0
                break
        found[d, 0], found[d, 1], found[d, 4] = runs[0, 2], runs[0, 3], abs(runs[1, 2] - runs[0, 2])


@cache
def matrices() -> tuple[Floats, tuple[int, ...]]:
    """Nodes and matrices of both samplings in one array, and where each begins."""
    fine, coarse = rule(FINE), rule(COARSE)
    rows = (
        *(fine.v, coarse.v, fine.to_series.T, coarse.to_series.T, basis(fine.v, COARSE).T),
        *(fine.energy[PLAIN].T, fine.energy[FROM_REST].T, fine.average[-1]),
        *(fine.leads[[PLAIN, FROM_REST]], fine.clock.T @ fine.known, fine.known[:-1]),
    )
    begins = np.cumsum([0, *(x.size for x in rows[:-1])]).tolist()
    return np.concatenate([x.ravel() for x in rows]), tuple(begins)


@cache
def compiled(dimension: int) -> Any:
    """`swings` as machine code, the same for all mechanisms."""
    made = partial(swings, of=Sizes(FINE, COARSE, int(KEPT * FINE), dimension, *matrices()[1]))
    return machine_code(loops.text(swings=made), ("swings", loops.signature(made)))[0]


class FirstSwings(NamedTuple):
    """What moves designs of a family to their first standstill.

    code : `swings` as machine code
    rates : the right-hand side of all
    lows, lengths, pieces, start : as it takes them
    request : what is asked of all
    """

    code: Any
    rates: CompiledRhs
    lows: Floats
    lengths: Floats
    pieces: Any
    start: Floats
    request: SimulationRequest

    @classmethod
    def of(
        cls, system: System, request: SimulationRequest, rates: CompiledRhs
    ) -> FirstSwings | None:
        """That of a request; None where the path is not all that there is to it."""
        (q, rate, t), by_path = request.start, system.depends_on <= {"q"} and not system.friction
        if not by_path or request.until.goal != "standstill" or t or system.period is None:
            return None
        mesh, lows, lengths, pieces = PathMesh(system, q, FINE, RESOLVED), [], [], []
        for sign in (1, -1):
            shift, near = mesh.turn(q, sign)
            first = mesh.row.index(q - shift, sign, near)
            if first is None:
                return None
            course = mesh.row.ahead(first, sign)
            lows += (course.low + shift).tolist()
            lengths += (course.high - course.low).tolist()
            pieces.append(len(course.low))
        share = rounding_share(system, request)
        start = np.array([q, rate, system.rounding(q) / UNSURE, ROUNDING, share])
        arrays = np.array(lows), np.array(lengths), np.array(pieces, np.int64), start
        return cls(compiled(rates.dimension), rates, *arrays, request)

    def moved(self, values: tuple[Any, ...], m: int) -> Motions:
        """Motions of m designs with these numbers of the program, without their tracks."""
        inputs, dimension, slots = self.rates.inputs, self.rates.dimension, slots_of(values)
        slots = np.ascontiguousarray(np.broadcast_to(slots, (m, slots.shape[1])))
        state, row = np.zeros(inputs), np.zeros(len(self.rates.rows))
        state[dimension + 2], state[dimension + 3] = 1.0, SMALLEST
        x = addresses_of(state)
        found, room = np.zeros((m, 6)), np.zeros((11, 2, FINE + 2))
        given = slots, row, state, self.lows, self.lengths, self.pieces, self.start
        own = np.zeros((2, 4)), room, np.zeros(4 * FINE), found
        places = [a.ctypes.data for a in (*given, matrices()[0], *own)]
        self.code(ctypes.cast(self.rates.at, ctypes.c_void_p), slots.shape[1], x, *places, m)
        t, q, apart, rounding, late, good = found.T
        error, nothing = apart + rounding, np.zeros(m)
        way = np.minimum(np.abs(q - self.start[0]), 1.0)
        with np.errstate(invalid="ignore"):
            sure = (apart <= PARTED * way) & (late <= PARTED * t)
            sure &= (good > 0) & (error <= (self.request.accuracy or TARGET))
        kinds = np.full(m, GOAL), t, q, nothing, np.full(m, np.nan), np.ones(m, np.int64)
        clock = late + self.start[-1] * t
        return Motions(~sure, *kinds, nothing, error, clock, Track.of((), m))
