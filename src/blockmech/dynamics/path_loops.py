r"""The path method as loops: both runs over kept pieces of the path, panel by panel.

    J, tau as series -> K by integration -> standstill? -> clock -> next panel ...

as `PanelRow` does it with arrays for a motion, and the second run beside the first as `second_run`
does: once J and tau are series the path method knows nothing of the mechanism, so that one program
serves all. Functions here are of the language of `blockmech.engines.loops`; run by Python they say
the same.
"""

from __future__ import annotations

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
    ROOT,
    TO_REST,
    basis,
    moment,
    rule,
)
from blockmech.dynamics.path_mesh import COARSE, FINE, KEPT
from blockmech.dynamics.place_data import SHORT, TAU, J
from blockmech.engines.kinds import Counts, Reals
from blockmech.functions.series import LEVEL, NOISE
from blockmech.ground.plane import EPS

LONG = 1 - 4 * EPS  # of a piece: a panel over all of it
TRIES = 8  # of Newton's method for the place of a standstill
HALVED = 4 * SHORT  # panels that a piece is tried in
LARGEST = sys.float_info.max
# A piece of the path: the series of J and tau, of both runs each, in the direction of motion; their
# values at its nodes and its end; and what tau does up to there.
BLOCKS = 5
VALUES, OVER_ALL = 2, 4
# A panel: J and tau at its nodes, of both runs each; what tau does up to there; the series of
# dt/dv; times since its anchor, and dt/dv, at anchor, nodes and end; and where it lies.
PANEL = 7
GAINS, RATE, SINCE, SLOPES, SPAN = range(2, PANEL)
# Of a span: LEFT at its end, WORK to and fro.
BEGIN, END, ENERGY, KIND, TIME, LEFT, WORK, TIME_AT_END = range(8)
PLACE, KINETIC, CLOCK, STOP = range(4)  # of a run
FROM, FROM_THERE, STEP, NOT_AFTER, START, SHARE = range(6)  # of what `beside` is given
OFF, UNKNOWN, LOWEST, HIGHEST, FASTEST, LAST, LATE, ROUGH = range(8)  # and of what it finds
FAILED, GOES_ON, STANDS = range(3)  # how runs leave a piece


class Sizes(NamedTuple):
    """Nodes of both samplings, terms of the second clock, components of a state."""

    n: int
    k: int
    terms: int
    state: int


class Nodes(NamedTuple):
    """What both samplings of a panel are read and integrated by, see `panels.Rule`.

    v, v_there : nodes of the first and of the second
    series, series_there : from values at the nodes to coefficients; spread : and to all nodes
    work, work_from_rest : from values to integrals up to the nodes and the end
    average : over a panel
    leads, leads_from_rest, v_all : of dt/dv and of the place, at anchor, nodes and end
    since : from the series of dt/dv to the times since the anchor
    """

    v: Reals
    v_there: Reals
    series: Reals
    series_there: Reals
    spread: Reals
    work: Reals
    work_from_rest: Reals
    average: Reals
    leads: Reals
    leads_from_rest: Reals
    v_all: Reals
    since: Reals


Row: TypeAlias = Annotated[Reals, "of.n + 2"]
Rows: TypeAlias = Annotated[Reals, "2", "of.n + 2"]  # blocks of a piece or of a panel
Pieces: TypeAlias = Annotated[Reals, "5", "2", "of.n + 2"]
Records: TypeAlias = Annotated[Reals, "7", "2", "of.n + 2"]  # panels
Runs: TypeAlias = Annotated[Reals, "4"]


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
    """What ends a series, as `blockmech.functions.series.tail` says it."""
    q, size = n >> 2, largest(c, 0, n)
    last, before = largest(c, n - q, n), largest(c, n - 2 * q, n - q)
    if size == 0.0 or (last > LEVEL * before and last / size < NOISE):
        return 0.0
    return last / size


def over(
    of: Sizes, nodes: Nodes, low: float, length: float, begin: float, end: float, kind: float,
    series: Row, rows: Row, b: Reals, first: int,
) -> None:  # fmt: skip
    """Rows from the ``first`` on at the nodes of a panel, and at its anchor."""
    v, anchor = nodes.v, end if kind == TO_REST else begin
    way, places = begin - end if kind == TO_REST else end - begin, 2.0 / length
    for i in range(of.n):
        share = v[i] if kind == PLAIN else v[i] * v[i]
        b[i] = min(max(places * (anchor - low + way * share) - 1.0, -1.0), 1.0)
    b[of.n] = min(max(places * (anchor - low) - 1.0, -1.0), 1.0)
    for j in range(first, 2):
        series_at(series[j], of.n, b, rows[j], b[of.n + 2 :], of.n + 1)


def standstill(
    of: Sizes, nodes: Nodes, low: float, length: float, run: Reals, stop: float, series: Row,
    rows: Row, b: Reals,
) -> bool:  # fmt: skip
    """Whether the place is found at which a run has no energy left, near ``stop``."""
    for _ in range(TRIES):
        over(of, nodes, low, length, run[PLACE], stop, PLAIN, series, rows, b, 1)
        mean, way = 0.0, stop - run[PLACE]
        for i in range(of.n):
            mean += nodes.average[i] * rows[TAU, i]
        b[0] = min(max(2.0 * (stop - low) / length - 1.0, -1.0), 1.0)
        series_at(series[TAU], of.n, b, b[1:], b[2:], 1)
        effort = b[1]
        if not effort * way < 0.0:
            return False
        step = (run[KINETIC] + way * mean) / -effort
        stop += step
        run[STOP] = stop
        if abs(step) <= NEAR * NEAR * abs(way) or abs(step) <= EPS * abs(stop):
            return True
    return False


def clock(of: Sizes, nodes: Nodes, now: Rows, r: int) -> None:
    """dt/dv of a panel of run r: at the anchor, the nodes and the end, and its coefficients."""
    gains, slopes, rate = now[GAINS, r], now[SLOPES, r], now[RATE, r]
    energy, way = now[SPAN, r, ENERGY], abs(now[SPAN, r, END] - now[SPAN, r, BEGIN])
    plain = now[SPAN, r, KIND] == PLAIN
    leads = nodes.leads if plain else nodes.leads_from_rest
    by = way if plain else 2.0 * way
    for i in range(of.n):
        slopes[i + 1] = by * sqrt(now[r, J, i] / (2.0 * (energy + gains[i]))) * leads[i]
    product(slopes[1:], nodes.series, rate, of.n, of.n, 1.0)
    first, last, sign = 0.0, 0.0, 1.0
    for i in range(of.n):
        first += sign * rate[i]
        last += rate[i]
        sign = -sign
    slopes[0] = first
    slopes[of.n + 1] = last


def is_smooth(of: Sizes, nodes: Nodes, now: Rows, effort: float, tolerance: float) -> bool:
    """Whether the time of a panel is smooth enough for its nodes, see `Panels.smooth`."""
    gains, rate = now[GAINS, 0], now[RATE, 0]
    energy, way = now[SPAN, 0, ENERGY], abs(now[SPAN, 0, END] - now[SPAN, 0, BEGIN])
    plain = now[SPAN, 0, KIND] == PLAIN
    v, doubt, size = nodes.v, 0.0, largest(rate, 0, of.n)
    for i in range(of.n):
        K = energy + gains[i]
        if not K > 0.0:
            return False
        doubt = max(doubt, (v[i] if plain else v[i] * v[i]) / K)
    if not ending(rate, of.n) <= max(tolerance, EPS * effort * doubt * way):
        return False
    left = max(largest(rate, of.n - (of.n >> 2), of.n), tolerance * size)
    known = way * sqrt(now[0, J, of.n] / (2.0 * energy)) if energy > 0.0 else 0.0
    return not plain or abs(now[SLOPES, 0, 0] - known) <= of.n * left


def emptied(of: Sizes, nodes: Nodes, now: Rows, brake: float, stop: float) -> float:
    """About where the first run's energy is used up on a panel; if nowhere ``stop``, beyond it.

    At the end it is but for rounding: as much as ``brake`` [N m or N] takes on a part of the way.
    """
    first, energy = float(now[SPAN, 0, BEGIN]), float(now[SPAN, 0, ENERGY])
    way, plain = now[SPAN, 0, END] - first, now[SPAN, 0, KIND] == PLAIN
    begin, before = first, energy
    for i in range(of.n + 1):
        share = 1.0
        if i < of.n:
            share = nodes.v[i] if plain else nodes.v[i] * nodes.v[i]
        there, K = first + way * share, energy + now[GAINS, 0, i]
        if K <= 0.0 or (i == of.n and ROOT * brake * abs(way) > K):
            return float(begin + (there - begin) * (before / (before - min(K, 0.0))))
        begin, before = there, K
    return stop


def panel(
    of: Sizes, nodes: Nodes, low: float, length: float, piece: Rows, now: Rows, b: Reals
) -> None:
    """J, tau and gains of a panel of both runs, where its spans say."""
    for r in range(2):
        begin, end, kind = now[SPAN, r, BEGIN], now[SPAN, r, END], now[SPAN, r, KIND]
        if kind == PLAIN and abs(end - begin) >= LONG * length:
            for i in range(of.n + 1):
                now[r, J, i], now[r, TAU, i] = piece[VALUES + r, J, i], piece[VALUES + r, TAU, i]
                now[GAINS, r, i] = piece[OVER_ALL, r, i]
        else:
            energies = nodes.work if kind == PLAIN else nodes.work_from_rest
            over(of, nodes, low, length, begin, end, kind, piece[r], now[r], b, 0)
            along = begin - end if kind == TO_REST else end - begin
            product(now[r, TAU], energies, now[GAINS, r], of.n, of.n + 1, along)


def timed(of: Sizes, nodes: Nodes, now: Rows, r: int, begin: float) -> float:
    """When run r leaves a panel that it enters at a time [s].

    The panel keeps that time, and those since its anchor at anchor, nodes and end.
    """
    if r == 1:
        for i in range(of.terms, of.n):
            now[RATE, 1, i] = 0.0
    product(now[RATE, r], nodes.since, now[SINCE, r], of.n, of.n + 2, 1.0)
    now[SPAN, r, TIME], now[SPAN, r, TIME_AT_END] = begin, begin + now[SINCE, r, of.n + 1]
    return float(now[SPAN, r, TIME_AT_END])


def through(
    of: Sizes, nodes: Nodes, low: float, length: float, far: float, sign: float, rounding: float,
    tolerance: float, piece: Rows, runs: Runs, panels: Records, counts: Counts, b: Reals,
) -> int:  # fmt: skip
    """Both runs over a piece to ``far``: `GOES_ON`, `STANDS` or `FAILED`. ``counts``: of the
    panels so far."""
    effort = largest(piece[VALUES, TAU], 0, of.n)
    end, stands, beyond = far, False, far + 2.0 * sign * length
    for _ in range(HALVED):
        now = panels[counts[0]]
        kind = TO_REST if stands else FROM_REST if runs[0, KINETIC] == 0.0 else PLAIN
        for r in range(2):
            span, run = now[SPAN, r], runs[r]
            span[BEGIN], span[END] = run[PLACE], run[STOP] if stands else end
            span[ENERGY], span[KIND] = 0.0 if stands else run[KINETIC], float(kind)
        panel(of, nodes, low, length, piece, now, b)
        way, stop = end - runs[0, PLACE], beyond
        if stands:
            way = runs[0, STOP] - runs[0, PLACE]
        else:
            brake = max(-sign * now[0, TAU, of.n - 1], 0.0)
            stop = emptied(of, nodes, now, brake, beyond)
        if stop != beyond and kind == FROM_REST:
            end = runs[0, PLACE] + (stop - runs[0, PLACE]) / 2.0
            continue
        if stop != beyond:
            stands = True
            for r in range(2):
                if not standstill(of, nodes, low, length, runs[r], stop, piece[r], now[r], b):
                    return FAILED
            if sign * (runs[0, STOP] - far) > ROOT * abs(runs[0, STOP] - runs[0, PLACE]):
                return FAILED
            continue
        for r in range(2):
            clock(of, nodes, now, r)
        if not is_smooth(of, nodes, now, effort, tolerance):
            end, stands = runs[0, PLACE] + way / 2.0, False
            continue
        for r in range(2):
            runs[r, CLOCK] = timed(of, nodes, now, r, runs[r, CLOCK])
        if not runs[1, CLOCK] <= LARGEST:  # its energy is used up on a panel of no standstill
            return FAILED
        counts[0] += 1
        for r in range(2):
            span, run, mean = now[SPAN, r], runs[r], 0.0
            for i in range(of.n):
                mean += abs(now[r, TAU, i]) / of.n
            span[WORK] = abs(way) * mean
            run[KINETIC] += now[GAINS, r, of.n] + r * rounding * span[WORK]
            if stands:
                run[KINETIC] = 0.0
            run[PLACE], span[LEFT] = span[END], run[KINETIC]
        if stands:
            return STANDS
        if end == far:
            return GOES_ON
        end = end + 2.0 * way if abs(2.0 * way) < abs(far - end) else far
    return FAILED


def over_pieces(
    of: Sizes, nodes: Nodes, pieces: Pieces, which: Counts, lows: Reals, highs: Reals, shift: float,
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
            of, nodes, low, high - low, far, sign, rounding, tolerance, pieces[which[p]], runs,
            panels, counts, b,
        )  # fmt: skip
        if how != GOES_ON or far == goal:
            return how
    return GOES_ON


def beside(
    of: Sizes, nodes: Nodes, panels: Records, others: Records, count: int, backward: int, at: Reals,
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
    v, last, done = nodes.v_all, of.n + 1, False
    off, before, gap, late_before = 0.0, 0.0, LARGEST, 0.0
    for j in range(count):
        now = panels[count - 1 - j if backward == 1 else j]
        other = others[count - 1 - j if backward == 1 else j]
        span, since, slopes = now[SPAN, 0], now[SINCE, 0], now[SLOPES, 0]
        span_there, since_there = other[SPAN, 1], other[SINCE, 1]
        ends_there, plain = span[KIND] == TO_REST, span[KIND] == PLAIN
        onward = backward == (1 if ends_there else 0)  # in the order of the nodes
        anchor, there = span[BEGIN], span_there[BEGIN]
        way, way_there = span[END] - anchor, span_there[END] - there
        speed = way if plain else 2.0 * way
        if ends_there:
            anchor, there, way, way_there = span[END], span_there[END], -way, -way_there
        if backward == 1:
            speed = -speed
        for m in range(last + 1):
            i = m if onward else last - m
            t, late = since[i], since_there[i]
            if ends_there:
                t, late = since[last] - t, since_there[last] - late
            t, late = span[TIME] + t, span_there[TIME] + late
            if backward == 1:
                t, late = -t, -late
            t = at[FROM] + t
            late = at[FROM_THERE] + late - t
            lead = 1.0 if plain else v[i]
            q = anchor + way * (lead * v[i])
            apart = there + way_there * (lead * v[i]) - q
            rate = speed * lead / slopes[i] if slopes[i] > 0.0 else 0.0
            apart = abs(apart - late * rate)
            q += at[STEP]
            near = abs(q - before)
            if not apart <= LARGEST:
                apart = LARGEST
            if off > max(gap, near):
                found[ROUGH] = 1.0
            off = at[SHARE] * max(abs(t), t - at[START]) * abs(rate)
            gap, before = near if m + j > 0 else LARGEST, q
            found[OFF] = max(found[OFF], apart)
            found[UNKNOWN] = max(found[UNKNOWN], off + ROUNDING * abs(q))
            found[LOWEST], found[HIGHEST] = min(found[LOWEST], q), max(found[HIGHEST], q)
            found[FASTEST], found[LAST] = max(found[FASTEST], abs(rate)), t
            found[LATE], late_before = max(abs(late), late_before), abs(late)
            if t >= at[NOT_AFTER]:
                done = True
                break
        if done:
            break
    if off > gap:
        found[ROUGH] = 1.0


def again(of: Sizes, nodes: Nodes, panels: Records, count: int, r: int, energy: float) -> None:
    """Panels of run r with more energy [J], their times from 0 s on."""
    t = 0.0
    for j in range(count):
        now = panels[j]
        now[SPAN, r, ENERGY] += energy
        clock(of, nodes, now, r)
        t = timed(of, nodes, now, r, t)


def lasting(
    of: Sizes, nodes: Nodes, panels: Records, count: int, r: int, energies: Reals, many: int,
    times: Reals,
) -> None:  # fmt: skip
    """Times that panels of run r take together with more energies [J], many of them."""
    weights = nodes.average
    for m in range(many):
        times[m] = 0.0
        for j in range(count):
            now, span = panels[j], panels[j, SPAN, r]
            plain, way = span[KIND] == PLAIN, abs(span[END] - span[BEGIN])
            leads, total = nodes.leads if plain else nodes.leads_from_rest, 0.0
            energy = span[ENERGY] + energies[m]
            for i in range(of.n):
                slope = sqrt(now[r, J, i] / (2.0 * (energy + now[GAINS, r, i])))
                total += weights[i] * leads[i] * slope
            times[m] += total * way * (1.0 if plain else 2.0)


def panel_at(of: Sizes, panels: Records, count: int, r: int, t: float) -> int:
    """The panel of run r that a time is in."""
    low, high = 0, count - 1
    while low < high:
        middle = (low + high + 1) >> 1
        if panels[middle, SPAN, r, TIME] <= t:
            low = middle
        else:
            high = middle - 1
    return low


def integral(c: Reals, n: int, out: Reals) -> None:
    """``out`` (n + 1,) = the integral up to x of a Chebyshev series in 2 x - 1, from x = 0."""
    out[0], sign = 0.0, 1.0
    for k in range(1, n + 1):
        out[k] = c[k - 1] if k > 1 else 2.0 * c[0]
        if k < n - 1:
            out[k] -= c[k + 1]
        out[k] /= 4.0 * k
        out[0] += sign * out[k]
        sign = -sign


def placed(
    of: Sizes, nodes: Nodes, panels: Records, count: int, r: int, times: Reals, many: int, q: Reals,
    rates: Reals, c: Reals,
) -> None:  # fmt: skip
    """Places and rates of run r at many times; ``c``: room for n + 3."""
    v, last, before, at = nodes.v_all, of.n + 1, -1, c[of.n + 1 :]
    for m in range(many):
        p = panel_at(of, panels, count, r, times[m])
        now, span = panels[p], panels[p, SPAN, r]
        rate, since, slopes = now[RATE, r], now[SINCE, r], now[SLOPES, r]
        if p != before:
            integral(rate, of.n, c)
            before = p
        ends_there, plain = span[KIND] == TO_REST, span[KIND] == PLAIN
        t, way = times[m] - span[TIME], span[END] - span[BEGIN]
        t = min(max(since[last] - t if ends_there else t, 0.0), since[last])
        moment(of.n, v, rate, since, slopes, c, t, at)
        x, slope = at[0], at[1]
        lead = 1.0 if plain else x
        rates[m] = way * lead * (1.0 if plain else 2.0) / slope if slope > 0.0 else 0.0
        q[m] = span[END] - way * (x * lead) if ends_there else span[BEGIN] + way * (x * lead)


@cache
def nodes() -> Nodes:
    """Those of the path method."""
    fine, coarse = rule(FINE), rule(COARSE)
    plain, from_rest = fine.leads[[PLAIN, FROM_REST]]
    series = fine.to_series.T, coarse.to_series.T, basis(fine.v, COARSE).T
    work = fine.energy[PLAIN].T, fine.energy[FROM_REST].T, fine.average[-1]
    leads = plain[1:], from_rest[1:], from_rest
    every = fine.v, coarse.v, *series, *work, *leads, fine.since
    return Nodes(*(np.ascontiguousarray(x).ravel() for x in every))


@cache
def sizes(state: int = 0) -> Sizes:
    """Those of the path method, with so many components of a state."""
    return Sizes(FINE, COARSE, int(KEPT * FINE), state)
