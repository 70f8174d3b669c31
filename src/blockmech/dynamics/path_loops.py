r"""The path method as loops: both runs over kept pieces of the path, panel by panel.

    J, tau as series -> K by integration -> standstill? -> clock -> next panel ...

as `Stretch` does it with arrays for a motion, and the second run beside the first as `second_run`
does: once J and tau are series the path method knows nothing of the mechanism, so that one program
serves all. Functions here are of the language of `blockmech.engines.loops`; run by Python they say
the same.
"""

from __future__ import annotations

import math
import sys
from functools import cache
from math import sqrt
from typing import Annotated, NamedTuple, TypeAlias

import numpy as np

from blockmech.dynamics.estimate import ROUNDING
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
from blockmech.dynamics.path_mesh import COARSE, FINE, KEPT
from blockmech.dynamics.place_data import SHORT
from blockmech.engines.loops import Counts, Reals
from blockmech.plane import EPS
from blockmech.series import LEVEL, NOISE

LONG = 1 - 4 * EPS  # of a piece: a panel over all of it
TRIES = 8  # of Newton's method for the place of a standstill
HALVED = 4 * SHORT  # panels that a piece is tried in
MOST = 60  # steps to a place at a time: a double has no more digits to halve
ROOT = math.sqrt(EPS)
LARGEST = sys.float_info.max
# Blocks of a piece of the path, of both runs each: series and values over all of it in the
# direction of motion, both of J and tau, and the gains of the values.
BLOCKS = 5
# Blocks of a panel, of both runs each: J and tau (two blocks), gains, rate, times, dt/dv, and where
# it lies: begin, end, energy, kind, time at the begin, energy at the end, work to and fro.
PANEL = 7


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


Row: TypeAlias = Annotated[Reals, "of.n + 2"]
Rows: TypeAlias = Annotated[Reals, "2", "of.n + 2"]  # blocks of a piece or of a panel
Pieces: TypeAlias = Annotated[Reals, "5", "2", "of.n + 2"]
Records: TypeAlias = Annotated[Reals, "7", "2", "of.n + 2"]  # panels
Runs: TypeAlias = Annotated[Reals, "4"]  # place, energy, time, where it stands still


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


def over(
    of: Sizes, M: Reals, low: float, length: float, begin: float, end: float, kind: int,
    series: Row, rows: Row, b: Reals, first: int,
) -> None:  # fmt: skip
    """Rows from the ``first`` on at the nodes of a panel, and at its anchor."""
    v, anchor = M[of.v :], end if kind == TO_REST else begin
    way, places = begin - end if kind == TO_REST else end - begin, 2.0 / length
    for i in range(of.n):
        share = v[i] if kind == PLAIN else v[i] * v[i]
        b[i] = min(max(places * (anchor - low + way * share) - 1.0, -1.0), 1.0)
    b[of.n] = min(max(places * (anchor - low) - 1.0, -1.0), 1.0)
    for j in range(first, 2):
        series_at(series[j], of.n, b, rows[j], b[of.n + 2 :], of.n + 1)


def standstill(
    of: Sizes, M: Reals, low: float, length: float, run: Reals, stop: float, series: Row,
    rows: Row, b: Reals,
) -> bool:  # fmt: skip
    """Whether the place is found at which a run has no energy left, near ``stop``."""
    for _ in range(TRIES):
        over(of, M, low, length, run[0], stop, PLAIN, series, rows, b, 1)
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
    slopes: Reals, rate: Reals,
) -> None:  # fmt: skip
    """dt/dv of a panel that begins with an energy: at the anchor, the nodes and the end, and its
    coefficients."""
    leads = M[of.leads + 1 :] if kind == PLAIN else M[of.leads + of.n + 3 :]
    by = abs(way) if kind == PLAIN else 2.0 * abs(way)
    for i in range(of.n):
        slopes[i + 1] = by * sqrt(rows[0, i] / (2.0 * (energy + gains[i]))) * leads[i]
    product(slopes[1:], M[of.series :], rate, of.n, of.n, 1.0)
    first, last, sign = 0.0, 0.0, 1.0
    for i in range(of.n):
        first += sign * rate[i]
        last += rate[i]
        sign = -sign
    slopes[0] = first
    slopes[of.n + 1] = last


def is_smooth(
    of: Sizes, M: Reals, way: float, kind: int, energy: float, effort: float, tolerance: float,
    gains: Reals, rows: Row, slopes: Reals, rate: Reals,
) -> bool:  # fmt: skip
    """Whether the time of a panel is smooth enough for its nodes, see `Panels.smooth`."""
    v, doubt, size = M[of.v :], 0.0, largest(rate, 0, of.n)
    for i in range(of.n):
        K = energy + gains[i]
        if not K > 0.0:
            return False
        doubt = max(doubt, (v[i] if kind == PLAIN else v[i] * v[i]) / K)
    if not ending(rate, of.n) <= max(tolerance, EPS * effort * doubt * abs(way)):
        return False
    left = max(largest(rate, of.n - (of.n >> 2), of.n), tolerance * size)
    known = abs(way) * sqrt(rows[0, of.n] / (2.0 * energy)) if energy > 0.0 else 0.0
    return kind != PLAIN or abs(slopes[0] - known) <= of.n * left


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


def panel(
    of: Sizes, M: Reals, low: float, length: float, piece: Rows, runs: Runs, kind: int, lies: Row,
    now: Rows, b: Reals,
) -> None:  # fmt: skip
    """J, tau and gains of a panel of both runs, whose begins and ends ``lies`` says."""
    energies = M[of.plain :] if kind == PLAIN else M[of.rest :]
    for r in range(2):
        begin, end = float(lies[r, 0]), float(lies[r, 1])
        if kind == PLAIN and abs(end - begin) >= LONG * length:
            for i in range(of.n + 1):
                now[r, 0, i], now[r, 1, i] = piece[2 + r, 0, i], piece[2 + r, 1, i]
                now[2, r, i] = piece[4, r, i]
        else:
            over(of, M, low, length, begin, end, kind, piece[r], now[r], b, 0)
            along = begin - end if kind == TO_REST else end - begin
            product(now[r, 1], energies, now[2, r], of.n, of.n + 1, along)


def timed(of: Sizes, M: Reals, now: Rows, r: int, begin: float) -> float:
    """When run r leaves a panel that it enters at time begin [s].

    The panel keeps that time, and those since its anchor at anchor, nodes and end."""
    if r == 1:
        for i in range(of.terms, of.n):
            now[3, 1, i] = 0.0
    product(now[3, r], M[of.since :], now[4, r], of.n, of.n + 2, 1.0)
    now[6, r, 4] = begin
    return float(begin + now[4, r, of.n + 1])


def through(
    of: Sizes, M: Reals, low: float, length: float, far: float, sign: float, rounding: float,
    tolerance: float, piece: Rows, runs: Runs, panels: Records, counts: Counts, b: Reals,
) -> int:  # fmt: skip
    """Both runs over a piece to ``far``: 1 where they go on, 2 where they stand still, 0 for a
    failure. ``counts``: of the panels so far."""
    effort = largest(piece[2, 1], 0, of.n)
    end, stands, beyond = far, False, far + 2.0 * sign * length
    for _ in range(HALVED):
        now = panels[counts[0]]
        kind = TO_REST if stands else FROM_REST if runs[0, 1] == 0.0 else PLAIN
        for r in range(2):
            now[6, r, 0], now[6, r, 1] = runs[r, 0], runs[r, 3] if stands else end
            now[6, r, 2], now[6, r, 3] = 0.0 if stands else runs[r, 1], float(kind)
        panel(of, M, low, length, piece, runs, kind, now[6], now, b)
        way, stop = end - runs[0, 0], beyond
        if stands:
            way = runs[0, 3] - runs[0, 0]
        else:
            brake = max(-sign * now[0, 1, of.n - 1], 0.0)
            stop = emptied(of, M, runs[0], way, kind, now[2, 0], brake, beyond)
        if stop != beyond and kind == FROM_REST:
            end = runs[0, 0] + (stop - runs[0, 0]) / 2.0
            continue
        if stop != beyond:
            stands = True
            for r in range(2):
                if not standstill(of, M, low, length, runs[r], stop, piece[r], now[r], b):
                    return 0
            if sign * (runs[0, 3] - far) > ROOT * abs(runs[0, 3] - runs[0, 0]):
                return 0
            continue
        for r in range(2):
            clock(
                of, M, now[6, r, 1] - now[6, r, 0], kind, now[6, r, 2], now[2, r], now[r],
                now[5, r], now[3, r],
            )  # fmt: skip
        if not is_smooth(
            of, M, way, kind, now[6, 0, 2], effort, tolerance, now[2, 0], now[0], now[5, 0],
            now[3, 0],
        ):  # fmt: skip
            end, stands = runs[0, 0] + way / 2.0, False
            continue
        for r in range(2):
            runs[r, 2] = timed(of, M, now, r, runs[r, 2])
        if not runs[1, 2] <= LARGEST:  # its energy is used up on a panel of no standstill
            return 0
        counts[0] += 1
        for r in range(2):
            mean = 0.0
            for i in range(of.n):
                mean += abs(now[r, 1, i]) / of.n
            now[6, r, 6] = abs(way) * mean
            runs[r, 1] += now[2, r, of.n] + r * rounding * now[6, r, 6]
            if stands:
                runs[r, 1] = 0.0
            runs[r, 0], now[6, r, 5] = now[6, r, 1], runs[r, 1]
        if stands:
            return 2
        if end == far:
            return 1
        end = end + 2.0 * way if abs(2.0 * way) < abs(far - end) else far
    return 0


def stretch(
    of: Sizes, M: Reals, pieces: Pieces, which: Counts, lows: Reals, highs: Reals, shift: float,
    goal: float, many: int, sign: float, rounding: float, tolerance: float, runs: Runs,
    panels: Records, counts: Counts, b: Reals,
) -> int:  # fmt: skip
    """Both runs over pieces ahead to a goal, see `through`; ``shift`` from where they are kept."""
    for p in range(many):
        low, high = lows[p] + shift, highs[p] + shift
        far = high if sign > 0.0 else low
        if sign * (far - goal) >= 0.0:
            far = goal
        how = through(
            of, M, low, high - low, far, sign, rounding, tolerance, pieces[which[p]], runs, panels,
            counts, b,
        )  # fmt: skip
        if how != 1 or far == goal:
            return how
    return 1


def beside(
    of: Sizes, M: Reals, panels: Records, others: Records, count: int, backward: int, at: Reals,
    found: Reals,
) -> None:  # fmt: skip
    """How far the second run, in ``others``, is from the first at the nodes of panels.

    The numbers of `track.Apart`.

    backward : 1 where they are run over from their end to their begin, else 0
    at : what both count times from [s], or back from where they run backward; what is added to
        places; the time after which nothing counts, and that of the start; what rounding leaves
        unknown of times, relative
    found : largest difference, and what rounding leaves; lowest and highest place, largest rate;
        the last time that counts, and by how much the second run is later there; 1 where rates
        change so fast that rounding is to be judged otherwise
    """
    v, last, done = M[of.leads + of.n + 2 :], of.n + 1, False
    off, before, gap, late_before = 0.0, 0.0, LARGEST, 0.0
    for j in range(count):
        now = panels[count - 1 - j if backward == 1 else j]
        other = others[count - 1 - j if backward == 1 else j]
        kind = now[6, 0, 3]
        ends_there, plain = kind == float(TO_REST), kind == float(PLAIN)
        onward = backward == (1 if ends_there else 0)  # in the order of the nodes
        anchor, there = now[6, 0, 1 if ends_there else 0], other[6, 1, 1 if ends_there else 0]
        way, way_there = now[6, 0, 1] - now[6, 0, 0], other[6, 1, 1] - other[6, 1, 0]
        speed = way if plain else 2.0 * way
        if ends_there:
            way, way_there = -way, -way_there
        if backward == 1:
            speed = -speed
        for m in range(last + 1):
            i = m if onward else last - m
            t, late = now[4, 0, i], other[4, 1, i]
            if ends_there:
                t, late = now[4, 0, last] - t, other[4, 1, last] - late
            t, late = now[6, 0, 4] + t, other[6, 1, 4] + late
            if backward == 1:
                t, late = -t, -late
            t = at[0] + t
            late = at[1] + late - t
            lead = 1.0 if plain else v[i]
            q = anchor + way * (lead * v[i])
            apart = there + way_there * (lead * v[i]) - q
            rate = speed * lead / now[5, 0, i] if now[5, 0, i] > 0.0 else 0.0
            apart = abs(apart - late * rate)
            q += at[2]
            near = abs(q - before)
            if not apart <= LARGEST:
                apart = LARGEST
            if off > max(gap, near):
                found[7] = 1.0
            off = at[5] * max(abs(t), t - at[4]) * abs(rate)
            gap, before = near if m + j > 0 else LARGEST, q
            found[0] = max(found[0], apart)
            found[1] = max(found[1], off + ROUNDING * abs(q))
            found[2], found[3] = min(found[2], q), max(found[3], q)
            found[4], found[5] = max(found[4], abs(rate)), t
            found[6], late_before = max(abs(late), late_before), abs(late)
            if t >= at[3]:
                done = True
                break
        if done:
            break
    if off > gap:
        found[7] = 1.0


def again(of: Sizes, M: Reals, panels: Records, count: int, r: int, energy: float) -> None:
    """Panels of run r with more energy [J], their times from 0 s on."""
    t = 0.0
    for j in range(count):
        now = panels[j]
        now[6, r, 2] += energy
        kind = PLAIN if now[6, r, 3] == float(PLAIN) else FROM_REST
        way = now[6, r, 1] - now[6, r, 0]
        clock(of, M, way, kind, now[6, r, 2], now[2, r], now[r], now[5, r], now[3, r])
        t = timed(of, M, now, r, t)


def lasting(
    of: Sizes, M: Reals, panels: Records, count: int, r: int, energies: Reals, many: int,
    times: Reals,
) -> None:  # fmt: skip
    """Times that panels of run r take together with more energies [J], many of them."""
    weights = M[of.average :]
    for m in range(many):
        times[m] = 0.0
        for j in range(count):
            now = panels[j]
            plain, way = now[6, r, 3] == float(PLAIN), abs(now[6, r, 1] - now[6, r, 0])
            leads, total = M[of.leads + 1 :] if plain else M[of.leads + of.n + 3 :], 0.0
            energy = now[6, r, 2] + energies[m]
            for i in range(of.n):
                slope = sqrt(now[r, 0, i] / (2.0 * (energy + now[2, r, i])))
                total += weights[i] * leads[i] * slope
            times[m] += total * way * (1.0 if plain else 2.0)


def panel_at(of: Sizes, panels: Records, count: int, r: int, t: float) -> int:
    """The panel of run r that a time is in."""
    low, high = 0, count - 1
    while low < high:
        middle = (low + high + 1) >> 1
        if panels[middle, 6, r, 4] <= t:
            low = middle
        else:
            high = middle - 1
    return low


def placed(
    of: Sizes, M: Reals, panels: Records, count: int, r: int, times: Reals, many: int, q: Reals,
    rates: Reals, c: Reals,
) -> None:  # fmt: skip
    """Places and rates of run r at many times, by Newton's method for v; ``c``: room for n + 1."""
    v, last, before = M[of.leads + of.n + 2 :], of.n + 1, -1
    for m in range(many):
        p = panel_at(of, panels, count, r, times[m])
        now = panels[p]
        rate, since, slopes, kind = now[3, r], now[4, r], now[5, r], now[6, r, 3]
        if p != before:  # the series of the time
            c[0], sign, before = 0.0, 1.0, p
            for k in range(1, of.n + 1):
                c[k] = rate[k - 1] if k > 1 else 2.0 * rate[0]
                if k < of.n - 1:
                    c[k] -= rate[k + 1]
                c[k] /= 4.0 * k
                c[0] += sign * c[k]
                sign = -sign
        ends_there, plain = kind == float(TO_REST), kind == float(PLAIN)
        t, way = times[m] - now[6, r, 4], now[6, r, 1] - now[6, r, 0]
        t = min(max(since[last] - t if ends_there else t, 0.0), since[last])
        j = 0
        while j < of.n and since[j + 1] <= t:
            j += 1
        h, dv = max(since[j + 1] - since[j], SMALLEST), v[j + 1] - v[j]
        s = (t - since[j]) / h
        left, right = h / max(slopes[j], SMALLEST) - dv, h / max(slopes[j + 1], SMALLEST) - dv
        x = v[j] + s * (dv + (1.0 - s) * ((1.0 - s) * left - s * right))
        low, high, slope = v[j], v[j + 1], 0.0
        x, settled = x if x >= low and x <= high and t > 0.0 else low, t == 0.0
        for _ in range(MOST):
            y, a, b, d, e = 2.0 * x - 1.0, c[of.n], 0.0, 0.0, 0.0
            for k in range(of.n - 1, 0, -1):
                a, b = c[k] + 2.0 * y * a - b, a
                d, e = rate[k] + 2.0 * y * d - e, d
            slope = rate[0] + y * d - e
            if settled:
                break
            miss = c[0] + y * a - b - t
            if miss > 0.0:
                high = x
            else:
                low = x
            new = x - miss / slope
            if not (new >= low and new <= high):
                new = (low + high) / 2.0
            settled = abs(new - x) <= ROOT / 8.0 * new + EPS
            x = new
        lead = 1.0 if plain else x
        rates[m] = way * lead * (1.0 if plain else 2.0) / slope if slope > 0.0 else 0.0
        q[m] = now[6, r, 1] - way * (x * lead) if ends_there else now[6, r, 0] + way * (x * lead)


@cache
def matrices() -> tuple[Floats, tuple[int, ...]]:
    """Nodes and matrices of both samplings in one array, and where each begins."""
    fine, coarse = rule(FINE), rule(COARSE)
    rows = (
        *(fine.v, coarse.v, fine.to_series.T, coarse.to_series.T, basis(fine.v, COARSE).T),
        *(fine.energy[PLAIN].T, fine.energy[FROM_REST].T, fine.average[-1]),
        *(fine.leads[[PLAIN, FROM_REST]], fine.clock.T @ fine.known),
    )
    begins = np.cumsum([0, *(x.size for x in rows[:-1])]).tolist()
    return np.concatenate([x.ravel() for x in rows]), tuple(begins)


@cache
def sizes(state: int = 0) -> Sizes:
    """Those of the path method, with so many components of a state."""
    return Sizes(FINE, COARSE, int(KEPT * FINE), state, *matrices()[1])
