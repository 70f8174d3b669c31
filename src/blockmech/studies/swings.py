r"""Swings of many designs along the path, to their first standstill, as machine code.

    J, tau at the nodes of a piece -> series -> K by integration -> clock -> next panel ...

by the loops of the path method (`path_loops`), which serve single motions as well. Functions here
are of the language of `blockmech.engines.loops`; run by Python they say the same.

A design whose series are not resolved on the pieces of the mechanism that the family is made of,
that comes near a dead centre, does not stand still within a turn, or whose two runs part, is left
out: who asked moves it otherwise.
"""

from __future__ import annotations

import ctypes
from functools import cache, partial
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import numpy as np

from blockmech.dynamics.batch import share_of_all
from blockmech.dynamics.batch_motions import GOAL, Motions, Track
from blockmech.dynamics.contacts import SETTLED
from blockmech.dynamics.estimate import PARTED, ROUNDING, TARGET
from blockmech.dynamics.panel_nodes import (
    COARSE,
    FINE,
    OVER_ALL,
    PANEL,
    PIECE,
    PLAIN,
    TAU,
    VALUES,
    J,
    Nodes,
    Row,
    Sizes,
    nodes,
)
from blockmech.dynamics.path_loops import (
    CLOCK,
    FAILED,
    GOES_ON,
    HALVED,
    HIGH,
    KINETIC,
    LARGEST_J,
    LARGEST_TAU,
    LIMIT,
    LOW,
    PLACE,
    ROUGH,
    ROUGHLY,
    ROUNDED,
    SMALLEST,
    STANDS,
    Ahead,
    Pieces,
    Records,
    Rows,
    Runs,
    compare,
    ending,
    through,
)
from blockmech.dynamics.path_mesh import PathMesh
from blockmech.dynamics.place_data import NOTHING, RESOLVED
from blockmech.engines import loops
from blockmech.engines.compiled_rates import CompiledRhs
from blockmech.engines.kinds import Counts, Reals
from blockmech.engines.llvm import addresses_of, machine_code, slots_of
from blockmech.engines.stages import Fill
from blockmech.typing import Floats, Values

if TYPE_CHECKING:
    from blockmech.dynamics.request import SimulationRequest
    from blockmech.dynamics.system import System

T_END, Q_END, LATER, KNOWN = range(8, 12)  # of what is found, after what `compare` finds


def sampled(
    of: Sizes, fill: Fill, nodes: Nodes, r: int, x: Reals, P: Reals, row: Reals, state: Reals,
    bounds: Reals, values: Row, series: Row, n: int,
) -> bool:  # fmt: skip
    """J and tau at n nodes of a piece, and their series; whether these are resolved."""
    margin, low, length, size = 1.0, bounds[LOW], bounds[HIGH] - bounds[LOW], 0.0
    values[J], values[TAU] = 0.0, 0.0
    for i in range(1, n + 1):
        state[0] = low + length * nodes.v[r, i]
        fill(x, P, row, 1, 1, 0, 1)
        margin = min(margin, row[of.state])
        values[J, i] = row[of.state + 1]
        values[TAU, i] = row[1] * row[of.state + 1]
        size = max(size, values[J, i])
        if not (margin > ROUGH and values[J, i] > 0.0):
            return False
    tolerance = max(RESOLVED, NOTHING / margin)
    for i in range(1, n + 1):
        if values[J, i] < ROUGH * size:
            return False
    for j in range(2):
        series[j] = values[j] @ nodes.series[r]
        if ending(of, nodes, series, j) > tolerance:
            return False
    return True


def both_sampled(
    of: Sizes, fill: Fill, nodes: Nodes, x: Reals, P: Reals, row: Reals, state: Reals,
    bounds: Reals, sign: float, rounding: float, piece: Rows,
) -> bool:  # fmt: skip
    """A piece of both samplings, the second one's values at the nodes of the first."""
    for r in range(2):
        values, n = piece[VALUES + r], of.n if r == 0 else of.k
        if not sampled(of, fill, nodes, r, x, P, row, state, bounds, values, piece[r], n):
            return False
        if r == 0:
            bounds[LARGEST_J] = np.max(abs(values[J]))
            bounds[LARGEST_TAU] = np.max(abs(values[TAU]))
        else:
            piece[1, J, 0] += rounding * bounds[LARGEST_J]
        for j in range(2):
            values[j] = piece[r, j] @ nodes.values
            for i in range((of.n + 2) >> 1 if sign < 0.0 else 0):  # the nodes lie alike
                there = values[j, of.n + 1 - i]
                values[j, of.n + 1 - i] = values[j, i]
                values[j, i] = there
        way = sign * (bounds[HIGH] - bounds[LOW])
        piece[OVER_ALL, r] = way * (values[TAU] @ nodes.work[PLAIN])
    return True


def swings(
    of: Sizes, fill: Fill, slots: int, x: Reals, numbers: Reals, row: Reals, state: Reals,
    places: Ahead, pieces: Counts, start: Reals, nodes: Nodes, runs: Runs, room: Pieces,
    panels: Records, counts: Counts, T: Row, found: Annotated[Reals, "12"], designs: int,
) -> None:  # fmt: skip
    """Each design's way to its first standstill.

    places, pieces : of the pieces ahead with the coordinate, and behind them against it
    start : coordinate and rate, the least effort that moves it, `ROUNDING` of work and of time
    room, panels, T : a piece, the panels of a design, and what `through` needs
    found : (designs, 12) what `compare` says, then time and place of the end, difference of the
        ends, and 1 where all that is known
    """
    for d in range(designs):
        P, q, rate = numbers[d * slots :], start[0], start[1]
        state[0] = q
        fill(x, P, row, 1, 1, 0, 1)
        push, inertia = row[1] * row[of.state + 1], row[of.state + 1]
        if rate == 0.0 and not abs(push) > start[2]:
            continue
        sign = 1.0 if rate > 0.0 or (rate == 0.0 and push > 0.0) else -1.0
        first, many = 0 if sign > 0.0 else pieces[0], pieces[0 if sign > 0.0 else 1]
        for r in range(2):
            fast = rate * (1.0 + r * ROUNDING)
            run = runs[r]
            run[PLACE], run[CLOCK] = q * (1.0 + r * ROUNDING), 0.0
            run[KINETIC], run[ROUNDED] = inertia * fast * fast / 2.0, r * start[3]
        counts[0], how = 0, FAILED
        for p in range(first, first + many):
            how, bounds = FAILED, places[p]
            if both_sampled(of, fill, nodes, x, P, row, state, bounds, sign, start[3], room[0]):
                far = bounds[HIGH if sign > 0.0 else LOW]
                how = through(
                    of, nodes, bounds, far, sign, RESOLVED, room[0], runs, panels, counts, T
                )
            if how != GOES_ON or runs[0, PLACE] != far:
                break
        if how == STANDS:
            compare(of, nodes, T, panels, panels, counts[0], 0, start[4:], found[d])
            found[d, KNOWN] = 1.0 - found[d, ROUGHLY]
        found[d, T_END], found[d, Q_END] = runs[0, CLOCK], runs[0, PLACE]
        found[d, LATER] = abs(runs[1, CLOCK] - runs[0, CLOCK])


@cache
def compiled(dimension: int) -> Any:
    """`swings` as machine code, the same for all mechanisms."""
    made = partial(swings, of=Sizes(FINE, COARSE, dimension))
    return machine_code(loops.text(swings=made), ("swings", loops.signature(made)))[0]


class FirstSwings(NamedTuple):
    """What moves designs of a family to their first standstill.

    code : `swings` as machine code
    rates : the right-hand side of all
    places, pieces, start : as it takes them
    request : what is asked of all
    """

    code: Any
    rates: CompiledRhs
    places: Floats
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
        mesh, places, pieces = PathMesh(system, q, FINE, RESOLVED), [], []
        for sign in (1, -1):
            ahead = mesh.course(q, sign)
            if isinstance(ahead, str) or ahead[0].bounds[0, LIMIT]:
                return None
            places.append(ahead[0].bounds.copy())
            places[-1][:, [LOW, HIGH]] += ahead[1]
            pieces.append(len(places[-1]))
        share = share_of_all(system, request)
        at = 0.0, 0.0, 0.0, np.inf, 0.0, share, ROUNDING  # as `compare` takes it
        start = np.array([q, rate, system.rounding(q) / SETTLED, ROUNDING, *at])
        arrays = np.concatenate(places), np.array(pieces, np.int64), start
        return cls(compiled(rates.dimension), rates, *arrays, request)

    def moved(self, values: Values, m: int) -> Motions:
        """Motions of m designs with these numbers of the program, without their tracks."""
        inputs, dimension, slots = self.rates.inputs, self.rates.dimension, slots_of(values)
        slots = np.ascontiguousarray(np.broadcast_to(slots, (m, slots.shape[1])))
        state, row = np.zeros(inputs), np.zeros(len(self.rates.rows))
        state[dimension + 2], state[dimension + 3] = 1.0, SMALLEST
        x = addresses_of(state)
        found, room = np.zeros((m, 12)), np.zeros((PIECE, 2, FINE + 2))
        most = HALVED * int(self.pieces.max(initial=1))
        panels, counts = np.empty((most + 1, PANEL, 2, FINE + 2)), np.zeros(1, np.int64)
        given = slots, row, state, self.places, self.pieces, self.start
        own = np.zeros((2, 5)), room, panels, counts, np.zeros((FINE + 2, FINE + 2)), found
        places = [a.ctypes.data for a in given], [a.ctypes.data for a in own]
        fill = ctypes.cast(self.rates.of_designs[0], ctypes.c_void_p)
        self.code(
            fill,
            slots.shape[1],
            x,
            *places[0],
            loops.addresses_of(nodes(FINE, COARSE)),
            *places[1],
            m,
        )
        apart, rounding, *_, t, q, late, good = found.T
        error, nothing = apart + rounding, np.zeros(m)
        way, share = np.minimum(np.abs(q - self.start[0]), 1.0), self.start[-2]
        with np.errstate(invalid="ignore"):
            sure = (apart <= PARTED * way) & (late <= PARTED * t)
            sure &= (good > 0) & (error <= (self.request.accuracy or TARGET))
        kinds = np.full(m, GOAL), t, q, nothing, np.full(m, np.nan), np.ones(m, np.int64)
        clock = late + share * t
        return Motions(~sure, *kinds, nothing, error, clock, Track.of((), m))
