r"""The path method as loops: both runs over pieces of the path, panel by panel.

    J, tau as series -> K by integration -> standstill? -> clock -> next panel ...

Once J and tau are series the path method knows nothing of the mechanism, so that one program
serves all. The second run goes over the panels of the first, with place data that were sampled
elsewhere (see `PathMesh`), fewer terms in its clock, and some roundings more in its start, its
inertia and the work of each panel: how far both are apart is the estimate of a motion's error.

Functions here are of the language of `blockmech.engines.loops`; run by Python they say the same.
"""

from __future__ import annotations

import math
import sys
from typing import Annotated, TypeAlias

import numpy as np

from blockmech.dynamics.panel_nodes import (
    BEGIN,
    CLOSE,
    END,
    ENERGY,
    FROM_REST,
    GAINS,
    KIND,
    LEFT,
    OVER_ALL,
    PLAIN,
    RATE,
    SHORT,
    SINCE,
    SLOPES,
    SPAN,
    TAU,
    TIME,
    TIME_AT_END,
    TO_LIMIT,
    TO_REST,
    VALUES,
    WORK,
    J,
    Nodes,
    Row,
    Sizes,
)
from blockmech.engines.kinds import Counts, Reals
from blockmech.functions.series import LEVEL
from blockmech.ground.plane import EPS
from blockmech.ground.tolerances import EQUAL

ROOT = EPS**0.5
ROUGH = 1 / SHORT**2  # of a piece's inertia or effort: what is below has two digits less
HALVED = 8 * SHORT  # panels that a piece is tried in
LARGEST, SMALLEST = sys.float_info.max, math.ulp(0.0)
DIGITS = 8 - round(math.log2(EPS))  # halvings of an interval: a double has no more
LOW, HIGH, LIMIT, UNKNOWN_OF, LARGEST_J, LARGEST_TAU = range(6)  # of a piece ahead
PLACE, KINETIC, CLOCK, STOP, ROUNDED = range(5)  # of a run
FROM, FROM_THERE, STEP, NOT_AFTER, START, SHARE, OF_PLACES = range(7)  # of what `compare` is given
OFF, UNKNOWN, LOWEST, HIGHEST, FASTEST, LAST, LATE, ROUGHLY = range(8)  # and of what it finds
FAILED, GOES_ON, STANDS, SHORTER = range(4)  # how runs leave a piece

Rows: TypeAlias = Annotated[Reals, "2", "of.n + 2"]  # blocks of a piece or of a panel
Pieces: TypeAlias = Annotated[Reals, "5", "2", "of.n + 2"]
Records: TypeAlias = Annotated[Reals, "7", "2", "of.n + 2"]  # panels
Runs: TypeAlias = Annotated[Reals, "5"]
Ahead: TypeAlias = Annotated[Reals, "6"]


def ending(of: Sizes, nodes: Nodes, rows: Row, j: int) -> float:
    """What ends a series, as `blockmech.functions.series.tail` says it."""
    size, last = np.max(abs(rows[j])), np.max(abs(rows[j]) * nodes.parts[0])
    before = np.max(abs(rows[j]) * nodes.parts[1])
    if size == 0.0 or (last > LEVEL * before and last / size < EQUAL):
        return 0.0
    return float(last / size)


def over(
    of: Sizes, nodes: Nodes, bounds: Reals, begin: float, end: float, kind: int, series: Row,
    rows: Row, first: int, T: Row,
) -> None:  # fmt: skip
    """Rows of a panel from the ``first`` on: J and tau."""
    anchor, span = begin, end - begin
    if kind >= TO_REST:
        anchor, span = end, -span
    base, length = bounds[HIGH if bounds[LIMIT] > 0.0 else LOW], bounds[HIGH] - bounds[LOW]
    share = (anchor - base + span * nodes.shares[0 if kind == PLAIN else 1]) / length
    if bounds[LIMIT] != 0.0:
        share = np.sqrt(abs(share))
        share = np.where(share > EPS, share, EPS)
    last, before, twice = 2.0 * share - 1.0, 0.0 * share + 1.0, 4.0 * share - 2.0
    T[0] = before
    for k in range(1, of.n):
        T[k] = last
        last, before = twice * last - before, last
    for i in range(first, 2):
        rows[i] = series[i] @ T
        if bounds[LIMIT] != 0.0:  # they grow without bound there
            rows[i] = rows[i] / (share * share if i == J else share)


def laid(
    of: Sizes, nodes: Nodes, bounds: Reals, kind: int, piece: Rows, runs: Runs, end: float,
    now: Rows, r: int, T: Row,
) -> None:  # fmt: skip
    """A panel of run r from where it is: its span, J, tau and gains."""
    span, run, begin = now[SPAN, r], runs[r], runs[r, PLACE]
    if kind == TO_REST:
        end = run[STOP]
    span[BEGIN], span[END], span[KIND] = begin, end, float(kind)
    span[ENERGY] = 0.0 if kind == TO_REST else run[KINETIC]
    length = (bounds[HIGH] - bounds[LOW]) * (1.0 - CLOSE)
    if kind == PLAIN and bounds[LIMIT] == 0.0 and abs(end - begin) >= length:
        now[r, J], now[r, TAU] = piece[VALUES + r, J], piece[VALUES + r, TAU]
        now[GAINS, r] = piece[OVER_ALL, r]
    else:
        over(of, nodes, bounds, begin, end, kind, piece[r], now[r], J, T)
        travel = begin - end if kind >= TO_REST else end - begin
        now[GAINS, r] = travel * (now[r, TAU] @ nodes.work[kind])


def clock(of: Sizes, nodes: Nodes, now: Rows, r: int) -> None:
    """dt/dv of a panel of run r, and its coefficients."""
    span = now[SPAN, r]
    slope = np.sqrt(now[r, J] / (2.0 * (span[ENERGY] + now[GAINS, r])))
    slope = abs(span[END] - span[BEGIN]) * slope * nodes.leads[0 if span[KIND] == PLAIN else 1]
    now[SLOPES, r] = np.where(nodes.inside[0] > 0.0, slope, 0.0)
    now[RATE, r] = now[SLOPES, r] @ nodes.series[0]
    now[SLOPES, r] = now[RATE, r] @ nodes.values


def timed(of: Sizes, nodes: Nodes, now: Rows, r: int, begin: float) -> float:
    """When run r leaves a panel that it enters at a time [s]."""
    if r == 1:
        now[RATE, r] = now[RATE, r] * nodes.parts[2]
    now[SINCE, r] = now[RATE, r] @ nodes.since
    now[SPAN, r, TIME], now[SPAN, r, TIME_AT_END] = begin, begin + now[SINCE, r, of.n + 1]
    return float(now[SPAN, r, TIME_AT_END])


def is_smooth(of: Sizes, nodes: Nodes, now: Rows, effort: float, tolerance: float) -> bool:
    """Whether the time of a panel is smooth enough for its nodes.

    Of a plain panel dt/dv begins with the rate that is known there, else a layer hides between the
    nodes. The energy cannot be smoother than the rounding of the largest effort.
    """
    span, inside = now[SPAN, 0], nodes.inside[0] > 0.0
    length, energy, plain = abs(span[END] - span[BEGIN]), span[ENERGY], span[KIND] == PLAIN
    shares = nodes.shares[0 if plain else 1]
    doubt = np.max(np.where(inside, shares / (energy + now[GAINS, 0]), 0.0))
    rounding, end = EPS * effort * doubt * length, ending(of, nodes, now[RATE], 0)
    if not end <= max(tolerance, rounding):
        return False
    if not plain:
        return True
    off = abs(now[SLOPES, 0, 0] - length * np.sqrt(now[0, J, 0] / (2.0 * energy)))
    if off <= of.n * tolerance * abs(now[SLOPES, 0, 0]):
        return True
    tail = np.max(abs(now[RATE, 0]) * nodes.parts[0])
    return not off > of.n * max(tail, tolerance * np.max(abs(now[RATE, 0])))


def emptied(of: Sizes, nodes: Nodes, now: Rows, sign: float, stop: float) -> float:
    """About where the first run's energy is used up on a panel; if nowhere ``stop``, beyond it.

    At the end it is but for rounding: as much as its brake takes on a part of the way.
    """
    first, length, energy = now[SPAN, 0, BEGIN], now[SPAN, 0, END], now[SPAN, 0, ENERGY]
    length, kind = length - first, now[SPAN, 0, KIND]
    limit, effort = kind == TO_LIMIT, sign * now[0, TAU, of.n]
    remaining = energy + now[GAINS, 0, of.n + 1]
    braked = not limit and effort < 0.0 and remaining < -ROOT * effort * abs(length)
    if not (braked or np.any(energy + now[GAINS, 0] < 0.0)):
        return stop
    if limit:  # closer first
        return float(first + length / 2.0)
    before, at_before, p = energy, 0.0, 0 if kind == PLAIN else 1
    for i in range(1, of.n + 2):
        K, share = energy + now[GAINS, 0, i], nodes.shares[p, i]
        if K <= 0.0 or i > of.n:
            part = before / (before - min(K, 0.0)) if before > 0.0 else 0.5
            brake = length * now[0, TAU, i - 1]
            bend = length * (now[0, TAU, i] - now[0, TAU, i - 1])
            for _ in range(2):  # of an effort that is a line between nodes
                slope = (share - at_before) * (brake + bend * part)
                if slope < 0.0:
                    off = before + (share - at_before) * (brake + bend * part / 2.0) * part
                    part = min(max(part - off / slope, 0.0), 1.0)
            return float(first + length * (at_before + (share - at_before) * part))
        before, at_before = K, share
    return stop


def standstill(
    of: Sizes, nodes: Nodes, bounds: Reals, run: Reals, stop: float, series: Row, now: Rows, r: int,
    T: Row,
) -> bool:  # fmt: skip
    """Whether the place is found at which a run has no energy left, near ``stop``."""
    for _ in range(DIGITS):
        travel, span = stop - run[PLACE], now[SPAN, r]
        span[BEGIN], span[END] = run[PLACE], stop
        over(of, nodes, bounds, run[PLACE], stop, PLAIN, series, now[r], TAU, T)
        now[GAINS, r] = travel * (now[r, TAU] @ nodes.work[PLAIN])
        effort = now[r, TAU, of.n + 1]
        if not effort * travel < 0.0:
            return False
        step = (run[KINETIC] + now[GAINS, r, of.n + 1]) / -effort
        stop += step
        run[STOP] = stop
        if abs(step) <= ROOT / 8.0 * abs(travel) or abs(step) <= EPS * abs(stop):
            return True
    return False


def through(
    of: Sizes, nodes: Nodes, bounds: Reals, goal: float, sign: float, tolerance: float, piece: Rows,
    runs: Runs, panels: Records, counts: Counts, T: Row,
) -> int:  # fmt: skip
    """Both runs over a piece to ``goal``: how they leave it. ``counts``: of the panels so far.

    `SHORTER` asks for a piece of the size of what happens, whose way is where the first run stops.
    Where the second run has no time it takes another path.
    """
    effort, inertia = bounds[LARGEST_TAU], bounds[LARGEST_J]
    length, begin, end, at_rest = bounds[HIGH] - bounds[LOW], runs[0, PLACE], goal, False
    before = counts[0]
    for tried in range(HALVED):
        now, begin = panels[counts[0]], runs[0, PLACE]
        to = runs[0, STOP] if at_rest else end
        travel, kind = to - begin, PLAIN
        if sign * travel <= CLOSE * max(abs(begin), abs(to)):
            if at_rest:  # what goes no further than rounding of its place stands
                return STANDS
            runs[0, PLACE] = end if tried == 0 else begin
            return GOES_ON if tried == 0 else FAILED
        if at_rest:
            kind = TO_REST
        elif runs[0, KINETIC] == 0.0:
            kind = FROM_REST
        elif end == goal and sign * bounds[LIMIT] > 0.0:
            kind = TO_LIMIT
        laid(of, nodes, bounds, kind, piece, runs, end, now, 0, T)
        half = begin + travel / 2.0
        if not at_rest:
            stop = emptied(of, nodes, now, sign, goal + 2.0 * sign * length)
            if sign * (stop - goal) < length:
                remaining = abs(bounds[HIGH if sign > 0.0 else LOW] - stop)
                if sign * bounds[LIMIT] > 0.0 and remaining > ROOT * abs(stop - begin):
                    runs[0, STOP] = stop
                    return SHORTER
                if kind == PLAIN and standstill(
                    of, nodes, bounds, runs[0], stop, piece[0], now, 0, T
                ):
                    stop = runs[0, STOP]
                    rough = abs(now[0, TAU, of.n + 1]) < ROUGH * effort
                    if rough and abs(stop - begin) < length / SHORT:
                        return SHORTER
                    at_rest = sign * (stop - end) <= ROOT * abs(stop - begin)
                if not at_rest:
                    end = begin + sign * min(abs(stop - begin), abs(travel)) / 2.0
                elif not standstill(of, nodes, bounds, runs[1], stop, piece[1], now, 1, T):
                    runs[1, CLOCK], runs[1, STOP] = LARGEST * LARGEST, stop
                continue
        clock(of, nodes, now, 0)
        accuracy = max(tolerance, min(bounds[UNKNOWN_OF], ROOT)) if kind == TO_LIMIT else tolerance
        if not is_smooth(of, nodes, now, effort, accuracy):
            end, at_rest = half, False
            rough = np.min(now[0, J]) < ROUGH * inertia
            if (
                rough
                and CLOSE * abs(begin) < abs(travel / 2.0)
                and abs(travel / 2.0) < length / SHORT
            ):
                runs[0, STOP] = half
                return SHORTER
            continue
        laid(of, nodes, bounds, kind, piece, runs, end, now, 1, T)
        clock(of, nodes, now, 1)
        for r in range(2):
            span, run = now[SPAN, r], runs[r]
            run[CLOCK] = timed(of, nodes, now, r, run[CLOCK])
            T[0] = abs(now[r, TAU]) @ nodes.work[PLAIN if kind == PLAIN else TO_REST]
            span[WORK] = abs(travel) * T[0, of.n + 1]
            run[KINETIC] = span[ENERGY] + now[GAINS, r, 0 if kind == TO_LIMIT else of.n + 1]
            run[KINETIC] = max(run[KINETIC] + run[ROUNDED] * span[WORK], 0.0)
            if at_rest:
                run[KINETIC] = 0.0
            run[PLACE], span[LEFT] = span[END], run[KINETIC]
        counts[0] += 1
        if at_rest:
            return STANDS
        if end == goal:
            return GOES_ON
        end = end + 2.0 * travel if abs(2.0 * travel) < abs(goal - end) else goal
    if counts[0] == before:  # the way to what happens is far below the piece
        runs[0, STOP] = end
        return SHORTER
    return GOES_ON


def over_pieces(
    of: Sizes, nodes: Nodes, T: Row, pieces: Pieces, which: Counts, bounds: Ahead, shift: float,
    goal: float, many: int, sign: float, tolerance: float, runs: Runs, panels: Records,
    counts: Counts,
) -> int:  # fmt: skip
    """Both runs over pieces ahead to a goal, see `through`; ``shift`` from where they are kept.

    counts : panels, and the piece that was the last
    """
    piece_bounds = T[of.n]
    T[of.n], T[of.n + 1] = 0.0, 0.0
    for p in range(many):
        if counts[0] > HALVED:
            return GOES_ON
        counts[1] = p
        for i in range(6):
            piece_bounds[i] = bounds[p, i] + (shift if i <= HIGH else 0.0)
        end = piece_bounds[HIGH if sign > 0.0 else LOW]
        if sign * (end - goal) >= 0.0:
            end = goal
        outcome = through(
            of, nodes, piece_bounds, end, sign, tolerance, pieces[which[p]], runs, panels, counts, T
        )
        if outcome != GOES_ON or runs[0, PLACE] != end or end == goal:
            return outcome
    return GOES_ON


def compare(
    of: Sizes, nodes: Nodes, room: Row, panels: Records, seconds: Records, count: int,
    backward: int, at: Reals, totals: Reals,
) -> None:  # fmt: skip
    """How far the second run, in ``seconds``, is from the first at the nodes of panels.

    Both are read at the nodes, so that no time is inverted: where one is late by dt the other is
    ahead by q' dt.

    backward : 1 where they are run over from their end to their begin, else 0
    at : what both count times from [s], or back from where they run backward; what is added to
        places; the time after which nothing counts, and that of the start; what rounding leaves
        unknown of times, and of places, relative
    totals : largest difference, and what rounding leaves; lowest and highest place, largest rate;
        the last time that counts, and by how much the second run is later there; 1 where rates
        change so fast that rounding is to be judged otherwise
    """
    last, direction = of.n + 1, -1.0 if backward == 1 else 1.0
    for j in range(count):
        now = panels[count - 1 - j if backward == 1 else j]
        second = seconds[count - 1 - j if backward == 1 else j]
        span = now[SPAN, 0]
        span_second = second[SPAN, 1]
        p = 0 if now[SPAN, 0, KIND] == PLAIN else 1
        from_end, sign, begin, begin_second = span[KIND] >= TO_REST, direction, 0.0, 0.0
        length = span[END] - span[BEGIN]
        late_by = span_second[BEGIN] - span[BEGIN]
        stretch = span_second[END] - span_second[BEGIN] - length
        if from_end:
            late_by, stretch, sign = span_second[END] - span[END], -stretch, -direction
            begin, begin_second = now[SINCE, 0, last], second[SINCE, 1, last]
        begin, begin_second = span[TIME] + begin, span_second[TIME] + begin_second
        t = at[FROM] + direction * begin + sign * now[SINCE, 0]
        later = at[FROM_THERE] + direction * begin_second + sign * second[SINCE, 1] - t
        rate = direction * length * nodes.leads[p] / now[SLOPES, 0]
        rate = np.where(now[SLOPES, 0] > 0.0, rate, 0.0)
        apart = abs(late_by + stretch * nodes.shares[p] - later * rate)
        room[0] = t
        room[1] = later
        step = 1 if sign > 0.0 else -1
        first, end = 0 if step > 0 else last, last if step > 0 else 0
        i = end
        if room[0, end] >= at[NOT_AFTER]:
            i = first
            while i != end and room[0, i] < at[NOT_AFTER]:
                i += step
            counts = (nodes.number[0] - float(i)) * sign <= 0.0
            rate, apart = np.where(counts, rate, 0.0), np.where(counts, apart, 0.0)
        rate = abs(rate)
        off = at[SHARE] * (abs(t) + max(-at[START], 0.0)) * rate
        if np.any(off > abs(length) * nodes.gaps[p]):
            totals[ROUGHLY] = 1.0
        q, last_q = span[BEGIN] + at[STEP], length * nodes.shares[p, i]
        if from_end:
            q, last_q = span[END] + at[STEP], -last_q
        q, last_q = q + (0.0 if first == 0 else length if not from_end else -length), q + last_q
        totals[LOWEST] = min(totals[LOWEST], min(q, last_q))
        totals[HIGHEST] = max(totals[HIGHEST], max(q, last_q))
        unknown = np.max(off) + at[OF_PLACES] * max(abs(q), abs(last_q))
        totals[OFF] = max(totals[OFF], np.max(apart))
        totals[UNKNOWN] = max(totals[UNKNOWN], unknown)
        totals[FASTEST] = max(totals[FASTEST], np.max(rate))
        totals[LAST], totals[LATE] = room[0, i], abs(room[1, i])
        if i != first:
            totals[LATE] = max(totals[LATE], abs(room[1, i - step]))
        if room[0, i] >= at[NOT_AFTER]:
            break


def again(
    of: Sizes, nodes: Nodes, _: Row, panels: Records, count: int, r: int, energy: float
) -> None:
    """Panels of run r with more energy [J], their times from 0 s on."""
    t = 0.0
    for j in range(count):
        now = panels[j]
        now[SPAN, r, ENERGY] += energy
        clock(of, nodes, now, r)
        t = timed(of, nodes, now, r, t)


def moment(
    of: Sizes, v: Reals, times: Reals, slopes: Reals, clock: Reals, rate: Reals, t: float,
    at: Reals,
) -> None:  # fmt: skip
    """Where a panel is at a time [s] since its anchor, by Newton's method within a bracket.

    v, times, slopes : (n + 2,) the anchor, the nodes and the end; times and dt/dv there
    clock, rate : (n + 1,) and (n,) coefficients of the time since the anchor and of dt/dv
    at : v and dt/dv there, as found
    """
    n, j = of.n, 0
    while j < n and times[j + 1] <= t:
        j += 1
    h, dv = max(times[j + 1] - times[j], SMALLEST), v[j + 1] - v[j]
    s = (t - times[j]) / h
    slope_low, slope_high = h / max(slopes[j], SMALLEST) - dv, h / max(slopes[j + 1], SMALLEST) - dv
    x = v[j] + s * (dv + (1.0 - s) * ((1.0 - s) * slope_low - s * slope_high))
    low, high, slope, settled = v[j], v[j + 1], 0.0, t <= 0.0 or t >= times[n + 1]
    x = (low if t <= 0.0 else high) if settled else min(max(low, x), high)
    for _ in range(DIGITS):
        y, a, b, d, e = 2.0 * x - 1.0, clock[n], 0.0, 0.0, 0.0
        for k in range(n - 1, 0, -1):
            a, b = clock[k] + 2.0 * y * a - b, a
            d, e = rate[k] + 2.0 * y * d - e, d
        slope = rate[0] + y * d - e
        if settled:
            break
        miss = clock[0] + y * a - b - t
        if miss > 0.0:
            high = x
        else:
            low = x
        new, tolerance = x - miss / slope if slope > 0.0 else -1.0, ROOT / 8.0 * x + EPS
        inside = new >= low - tolerance and new <= high + tolerance  # but for rounding
        new = min(max(new, low), high) if inside else (low + high) / 2.0
        settled = inside and abs(new - x) <= tolerance
        x = new
    at[0], at[1] = x, slope


def placed(
    of: Sizes, nodes: Nodes, T: Row, panels: Records, count: int, r: int, times: Reals, many: int,
    q: Reals, rates: Reals,
) -> None:  # fmt: skip
    """Places and rates of run r at many times, those of the records."""
    p, of_panel, clock, at = 0, -1, T[0], T[1]
    for m in range(many):
        while p + 1 < count and panels[p + 1, SPAN, r, TIME] <= times[m]:
            p += 1
        while p > 0 and panels[p, SPAN, r, TIME] > times[m]:
            p -= 1
        now, span = panels[p], panels[p, SPAN, r]
        rate, since = now[RATE, r], now[SINCE, r]
        if p != of_panel:  # the integral of a series from v = 0
            clock[0], sign, of_panel = 0.0, 1.0, p
            for k in range(1, of.n + 1):
                term = (2.0 * rate[0] if k == 1 else rate[k - 1]) - rate[k + 1]
                clock[k] = term / (4.0 * k)
                clock[0] += sign * clock[k]
                sign = -sign
        from_end, plain = span[KIND] >= TO_REST, span[KIND] == PLAIN
        t, length = times[m] - span[TIME], span[END] - span[BEGIN]
        t = min(max(since[of.n + 1] - t if from_end else t, 0.0), since[of.n + 1])
        moment(of, nodes.shares[0], since, now[SLOPES, r], clock, rate, t, at)
        lead = 1.0 if plain else at[0]
        rates[m] = length * (1.0 if plain else 2.0) * lead / at[1] if at[1] > 0.0 else 0.0
        travel = length * (at[0] * lead)
        q[m] = span[END] - travel if from_end else span[BEGIN] + travel
