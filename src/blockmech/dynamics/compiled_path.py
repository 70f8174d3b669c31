"""Motions along the path by machine code: both runs side by side, see `path_loops`.

The program is the same for all mechanisms. What it leaves to others, who go by arrays (`PanelRow`,
`second_run`): dead centres, and whatever is not resolved on the
pieces of the path that are kept.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache, cached_property, partial
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from blockmech.dynamics.estimate import ROUNDING
from blockmech.dynamics.panels import TO_REST, Floats, Panels, Spans, rule
from blockmech.dynamics.path_loops import (
    BEGIN,
    END,
    ENERGY,
    GAINS,
    HALVED,
    KIND,
    LEFT,
    PANEL,
    RATE,
    SHARE,
    SINCE,
    SLOPES,
    SPAN,
    STEP,
    TIME,
    TIME_AT_END,
    WORK,
    again,
    beside,
    lasting,
    nodes,
    over_pieces,
    placed,
    sizes,
)
from blockmech.dynamics.path_mesh import FINE, LeftToArraysError
from blockmech.dynamics.place_data import TAU, J
from blockmech.dynamics.track import Apart, Leg, compared
from blockmech.engines import loops
from blockmech.engines.cost import loops_pay
from blockmech.engines.llvm import has_code, machine_code
from blockmech.ground.errors import MissingEngineError

if TYPE_CHECKING:
    from blockmech.dynamics.panel_builder import PathState
    from blockmech.dynamics.path_mesh import PathMesh

SAVED = 1e-3  # [s] that a motion takes longer by arrays
LINES = 5_100  # of the loops' text
LOOPS = over_pieces, beside, again, placed, lasting
SHAPE = PANEL, 2, FINE + 2  # of a panel's record


class PathCode(NamedTuple):
    """The loops as machine code, and where the nodes of the path method stand."""

    over_pieces: Any
    beside: Any
    again: Any
    placed: Any
    lasting: Any
    nodes: Any

    @staticmethod
    @cache
    def made() -> PathCode | None:
        """The code; None without the package that makes it."""
        functions = {f.__name__: partial(f, of=sizes()) for f in LOOPS}
        kinds = [(name, loops.signature(f)) for name, f in functions.items()]
        try:
            code = machine_code(partial(loops.text, **functions), *kinds, key=PathCode.key())
        except MissingEngineError:
            return None
        return PathCode._make([*code, loops.places_of(nodes())])

    @staticmethod
    @cache
    def key() -> str:
        """What the text is made of: all files of this room and of the engines'."""
        room = Path(__file__).parent
        files = sorted([*room.glob("*.py"), *(room.parent / "engines").glob("*.py")])
        return f"path {sha256(b''.join(x.read_bytes() for x in files)).hexdigest()}"

    @staticmethod
    def pays(motions: int) -> bool:
        """Whether it pays for so many motions of a mechanism."""
        try:
            return loops_pay(SAVED * motions, LINES, lambda: has_code(PathCode.key()))
        except MissingEngineError:
            return False


class BothPanels(Panels):
    """Panels of one of both runs, read from the records (m, 7, 2, n + 2) of `path_loops`."""

    records: Floats
    of: int

    def __init__(self, records: Floats, of: int, t0: float) -> None:
        """Those of the first run (0) or of the second (1)."""
        self.__dict__.update(records=records, of=of, t0=t0)

    @cached_property
    def spans(self) -> Spans:
        """Where they lie."""
        begin, end, energy, kind = self.records[:, SPAN, self.of, : KIND + 1].T
        return Spans(begin, end, energy, kind.astype(np.intp))

    @cached_property
    def w(self) -> Floats:
        """(m, n) dK/dq at the nodes."""
        return self.records[:, self.of, TAU, :FINE]

    @cached_property
    def J(self) -> Floats:
        """(m, n) inertia at the nodes."""
        return self.records[:, self.of, J, :FINE]

    @cached_property
    def K(self) -> Floats:
        """(m, n + 1) [J] at the nodes, and at the end that is not known."""
        records = self.records[:, :, self.of]
        return records[:, SPAN, ENERGY, None] + records[:, GAINS, : FINE + 1]

    @cached_property
    def second(self) -> Floats:
        """(m, 0, 0) nothing that `other` does not hold."""
        return np.empty((len(self.records), 0, 0))

    @cached_property
    def lie(self) -> list[list[float]]:
        """Where they lie, as the records have it: (m, 8)."""
        lie: list[list[float]] = self.records[:, SPAN, self.of, : TIME_AT_END + 1].tolist()
        return lie

    @property
    def t1(self) -> float:
        """[s] when the last ends."""
        return self.t0 + (self.lie[-1][TIME_AT_END] - self.lie[0][TIME])

    @property
    def begin(self) -> float:
        """[rad or m] where the first begins."""
        return self.lie[0][BEGIN]

    @cached_property
    def place(self) -> int:
        """Of the records in memory."""
        return self.records.ctypes.data

    def at_end(self) -> tuple[float, float]:
        """Place [rad or m] and kinetic energy [J] at the end of the last."""
        return self.lie[-1][END], self.lie[-1][LEFT]

    @cached_property
    def rate(self) -> Floats:
        """Chebyshev coefficients (m, n) of dt/dv."""
        return self.records[:, RATE, self.of, :FINE]

    @cached_property
    def durations(self) -> Floats:
        """(m,) [s] that each takes."""
        return self.records[:, SINCE, self.of, -1]

    @cached_property
    def _known(self) -> tuple[Floats, Floats, Floats]:
        times, slopes = self.records[:, SINCE, self.of], self.records[:, SLOPES, self.of]
        return rule(FINE).leads[TO_REST], times, slopes

    @cached_property
    def other(self) -> BothPanels:
        """Those of the second run."""
        return BothPanels(self.records, 1, float(self.records[0, SPAN, 1, TIME]))

    @property
    def left(self) -> float:
        """[J] with which it goes on."""
        return self.lie[-1][LEFT]

    @property
    def size(self) -> float:
        """[J] of all the work to and fro."""
        return math.fsum(lie[WORK] for lie in self.lie)

    def taken_from(self, t0: float, energy: float = 0.0) -> Panels:
        """The same panels at another time and with more kinetic energy [J]."""
        if not energy or (code := PathCode.made()) is None:
            return super().taken_from(t0, energy)
        panels = BothPanels(self.records.copy(), self.of, t0)
        code.again(code.nodes, panels.place, len(panels.records), self.of, energy)
        return panels

    def followed_by(self, row: Sequence[Any]) -> Panels:
        """These and those of a row as one."""
        records = np.concatenate([self.records, *(p.records for p in row)])
        return BothPanels(records, self.of, self.t0)

    def state(self, t: Floats) -> tuple[Floats, Floats]:
        """Driver coordinate and rate (k,) at times (k,) [s]; after the end those of the end."""
        if (code := PathCode.made()) is None:
            return super().state(t)
        since = t - (self.t0 - self.lie[0][TIME])
        q, rate, room = np.empty(t.size), np.empty(t.size), np.empty(FINE + 3)
        given = self.place, len(self.records), self.of, since.ctypes.data, t.size
        code.placed(code.nodes, *given, *(x.ctypes.data for x in (q, rate, room)))
        return q, rate

    def at(self, t: float) -> tuple[float, float]:
        """`state` at one time."""
        if (code := PathCode.made()) is None:
            return super().at(t)
        found = np.array([t - (self.t0 - self.lie[0][TIME]), *[0.0] * (FINE + 5)])
        since, *own = range(first := found.ctypes.data, first + 32, 8)
        code.placed(code.nodes, self.place, len(self.records), self.of, since, 1, *own)
        return float(found[1]), float(found[2])

    def lasting(self, energies: Floats) -> Floats:
        """(k,) [s] that all of them take with so much more kinetic energy (k,) [J]."""
        if (code := PathCode.made()) is None:
            return super().lasting(energies)
        times, given = np.empty(energies.size), (self.place, len(self.records))
        places = energies.ctypes.data, energies.size, times.ctypes.data
        code.lasting(code.nodes, *given, self.of, *places)
        return times


class BothRuns:
    """Where both runs are."""

    def __init__(self, code: PathCode, rounding: float, tolerance: float) -> None:
        self.code, self.rounding, self.tolerance = code, rounding, tolerance
        self.room = np.zeros(9 + 4 * FINE)  # for `over_pieces`; before that its runs, and a count
        self.runs, self.done = self.room[:8].reshape(2, 4), self.room[8:9].view(np.int64)

    def begin(self, q: float, K: float, there: float) -> None:
        """At a place, with kinetic energies [J] of the first and of the second run."""
        self.runs[:] = (q, K, 0.0, 0.0), (q * (1 + ROUNDING), there, 0.0, 0.0)

    def over(self, mesh: PathMesh, at: PathState, goal: float) -> BothPanels:
        """Both over the pieces of the path that are kept, as far as to a standstill or a goal.

        Raises `LeftToArraysError` where that is not all.
        """
        course, shift = mesh.course(at.q, at.sign)
        known = self.runs[0, :2].tolist() == [at.q, at.K]
        if not known or course is None or not len(course.which):
            raise LeftToArraysError
        count, pieces = len(course.which), course.row.blocks(at.sign)
        records, first = np.empty((count * HALVED, *SHAPE)), self.room.ctypes.data
        own, self.done[0] = (first, records.ctypes.data, first + 64, first + 72), 0
        numbers = shift, goal, count, float(at.sign), self.rounding, self.tolerance
        if not self.code.over_pieces(
            self.code.nodes, pieces.ctypes.data, *course.places, *numbers, *own
        ):
            raise LeftToArraysError
        return BothPanels(records[: int(self.done[0])].copy(), 0, at.t)


def apart(
    run: Sequence[Leg], other: Sequence[Leg], t_start: float, t_end: float, share: float
) -> Apart:
    """What `track.apart` says, of runs whose panels are `BothPanels`."""
    code = PathCode.made()
    assert code is not None
    numbers = np.array(
        [0.0, 0.0, 0.0, t_end, t_start, share, 0.0, 0.0, math.inf, -math.inf, *[0.0] * 4]
    )
    at, found = (first := numbers.ctypes.data), first + 48
    one: Any
    there: Any
    for one, there, sign, begin, begin_there, step in compared(run, other, t_end - t_start):
        late = begin_there + sign * (there.t0 - there.lie[0][TIME])
        time = begin + sign * (one.t0 - one.lie[0][TIME])
        numbers[: STEP + 1] = t_start + time, t_start + late, step
        given = one.place, there.place, len(one.records), int(sign < 0), at, found
        code.beside(code.nodes, *given)
    return Apart(*numbers[SHARE + 1 :].tolist())
