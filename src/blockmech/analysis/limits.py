"""Limits: the arcs of a driver on which the mechanism closes, and what ends each.

An end is a dead centre of one group: beyond it that group is out of reach. It is found
to rounding, because the margin passes zero there with a slope (it is the *rates* that go
to infinity). A change point is a dead centre that the mechanism can be driven through:
the margin touches zero and grows again. Both are singular poses of the second kind: with
the drivers held, the group still moves. Those of the first kind, where an output stands
while the driver moves, are the ends of a stroke (`blockmech.analysis.stroke`).

What the scan can miss: margins are sampled (720 times a turn) until their Chebyshev series
end, and every extremum of the series is looked at, so a gap or an arc far narrower than the
samples is found, down to a width of some 1e-7 rad where rounding hides it. The margin of an
RRR dyad on a crank and a fixed pivot is a trigonometric polynomial of degree 2: nothing is
missed there.

Sources: [GA90] Gosselin & Angeles, Singularity analysis of closed-loop kinematic chains, IEEE
Trans. Robotics and Automation 6 (1990): the kinds of singular poses.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from blockmech.analysis.arcs import Bound, Known, Nearest, Piece, closed_pieces
from blockmech.analysis.closure import Closure, one_turn, travel, turns_wheels
from blockmech.analysis.scan import TURN, shown_place
from blockmech.figures.panels import Bar, bars_figure
from blockmech.figures.paper import Pictured
from blockmech.functions.roots import SCANNED
from blockmech.ground.arguments import declared
from blockmech.ground.errors import Problem, RequestError, among, listed, refused
from blockmech.ground.report import Facts
from blockmech.ground.tolerances import DOUBLE_ROOT
from blockmech.ground.units import number_in_si, shown_in
from blockmech.model.structure import Structure
from blockmech.result.failures import shortfall
from blockmech.typing import Data, Record

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from blockmech.compiled import Compiled

FEWEST = 16
SECOND_KIND = "singular poses of the second kind (Gosselin, Angeles): driver held, the group moves"


@dataclass(frozen=True)
class End:
    """An end of an arc, or a change point.

    Attributes
    ----------
    q : driver coordinate [rad or m]; infinite where no group ends the travel of a slide
    block : the group whose margin is zero there, or ""
    how : "extended" or "folded" (RRR), "tangent" (RRP, RPR), "parallel" (PRP),
        "coincident" (the outer pins of an RRR or RPR meet), "dead centre" (other
        groups); "turn" where a whole turn begins and ends, also that of the wheels that a slide
        turns; "unlimited" where no group ends the travel within a million times the mechanism's
        size
    """

    q: float
    block: str
    how: str

    def __str__(self) -> str:
        return f"{self.block} {self.how}".strip()


@dataclass(frozen=True)
class Arc:
    """A stretch of the driver on which every group closes, with its change points."""

    start: End
    end: End
    change_points: tuple[End, ...] = ()

    @property
    def length(self) -> float:
        """Length [rad or m] of the arc."""
        return self.end.q - self.start.q

    def __str__(self) -> str:
        return f"[{_shown(self.start.q, 9)}, {_shown(self.end.q, 9)}]"


@dataclass(frozen=True, repr=False)
class Limits(Facts, Pictured):
    """The feasible arcs of one driver.

    Attributes
    ----------
    driver : the driving link
    unit : of its coordinate, "rad" or "m"
    held : the other drivers -> their coordinates
    arcs : in rising order; of a crank, with their middles between -pi/2 and 3 pi/2
    whole_turn : whether a crank turns fully
    nearest : where there is no arc: the group that never closes, and where it nearly does
    spacing : [rad or m] of the samples of the scan
    prefix : prefix of the driver's outputs, "driver." in a document of links and joints
    why : the closure error of the nearest group, in words
    """

    FACTS = ("unit", "whole_turn", "arcs", "nearest", "spacing")

    driver: str
    unit: str
    held: Mapping[str, float]
    arcs: tuple[Arc, ...]
    whole_turn: bool
    nearest: Nearest | None
    spacing: float
    prefix: str = ""
    why: str = ""

    def _q(self, driver: str) -> str:
        """Name of a driver's coordinate."""
        return f"{self.prefix}{driver}.q"

    def arc_at(self, q: float) -> Arc | None:
        """The arc that holds a driver coordinate [rad or m], or None.

        A crank's coordinate may be any number of turns away from the arc.
        """
        for arc in self.arcs:
            middle = (arc.start.q + arc.end.q) / 2
            unwrapped = middle + math.remainder(q - middle, TURN) if self.unit == "rad" else q
            if arc.start.q <= unwrapped <= arc.end.q:
                return arc
        return None

    def sentence(self) -> str:
        """The arcs in one sentence."""
        name = self._q(self.driver)
        if self.whole_turn:
            return f"{name} turns fully"
        if self.nearest:
            return f"no feasible arc of {name}: {self.nearest.block} never closes"
        word = "feasible arc" + ("s" if len(self.arcs) > 1 else "")
        return f"{word} of {name}: {', '.join(map(str, self.arcs))} {self.unit}"

    def figure(self, ax: Axes | None = None) -> Any:
        """The feasible arcs as bars."""
        bars = [
            Bar(
                f"arc {n}",
                arc.start.q,
                arc.end.q,
                (str(arc.start), str(arc.end)),
                tuple(point.q for point in arc.change_points),
            )
            for n, arc in enumerate(self.arcs, start=1)
        ]
        caption = f"{self.sentence()}."
        return bars_figure(bars, self._q(self.driver), self.unit, caption, self._display, ax)

    def lines(self) -> Iterable[str]:
        """The arcs, their ends and change points, one a line."""
        scale, unit = shown_in(self.unit, self._display)
        fixed = ", ".join(f"{self._q(d)} = {q:.9g}" for d, q in self.held.items())
        count = "turns fully" if self.whole_turn else f"{len(self.arcs) or 'no'} feasible arc"
        plural = "s" if len(self.arcs) > 1 else ""
        yield f"{self._q(self.driver)}: {count}{plural}" + (f", with {fixed}" if fixed else "")
        if self.nearest:
            nearest = self.nearest
            position = _shown(nearest.q * scale, 6)
            yield (
                f"  {nearest.block} never closes; it comes nearest at {position} {unit}: {self.why}"
            )
        for arc in self.arcs:
            if not self.whole_turn:
                start, end = (_shown(e.q * scale) for e in (arc.start, arc.end))
                yield (
                    f"  from {start} ({arc.start}) to {end} ({arc.end}), "
                    f"{arc.length * scale:.6g} {unit} long"
                )
            for first, *neighbours in _together(arc.change_points):
                rest = f" and {len(neighbours)} more" if neighbours else ""
                yield f"  change point at {_shown(first.q * scale)} {unit} ({first}{rest})"
        if any(end.block for arc in self.arcs for end in (arc.start, arc.end, *arc.change_points)):
            yield f"  {SECOND_KIND}"

    def to_dict(self) -> Data:
        """The limits as a JSON object, drivers by the names of their coordinates."""
        fixed = {self._q(d): q for d, q in self.held.items()}
        return {"driver": self._q(self.driver), "held": fixed, **super().to_dict()}


@declared
def limits(
    mechanism: Compiled,
    driver: str | None = None,
    at: Mapping[str, float] | None = None,
    *,
    blocks: Iterable[str] | None = None,
    samples: int = SCANNED,
) -> Limits:
    """The feasible arcs of a driver, the others held.

    A crank is searched over one turn. A slide is searched over its law's range, over
    twice the size of the mechanism, and thinly up to a million times that; one that turns
    wheels, as a rack does, as far as it turns one of the mechanism's size.

    Parameters
    ----------
    driver : the driving link; not needed if there is one
    at : driver -> coordinate [rad or m] of those that are held; by default where their
        laws of motion, or else the scene's ``initial``, begin
    blocks : only these groups and their supports; by default all
    samples : of a turn, or of the range of a slide

    Returns
    -------
    Limits. They take a batch of all samples per arc and group, and about 60 single poses per end

    Raises
    ------
    RequestError for an unknown driver, a held driver without a coordinate, or too few samples

    >>> print(mech.limits())
    crank.q: turns fully
    >>> print(m.compile().limits())
    driver.motor.q: turns fully
    """
    if samples < FEWEST:
        raise refused("samples", f"got {samples}", f"give at least {FEWEST}")
    moved = _moved(mechanism, driver)
    return limits_of(mechanism, moved, _held(mechanism, moved, at or {}), blocks, {}, samples)


def limits_of(
    mechanism: Compiled,
    moved: str,
    fixed: Mapping[str, float],
    blocks: Iterable[str] | None,
    pieces_of_groups: Known,
    samples: int = SCANNED,
) -> Limits:
    """The feasible arcs of a driver; ``pieces_of_groups`` of some serve for those after."""
    joint = mechanism.structure.driver_joint(moved)
    closure = Closure(mechanism._of_blocks, moved, fixed, _groups(mechanism.structure, blocks))
    span = one_turn() if joint.rotary else travel(mechanism, moved)
    pieces, nearest = closed_pieces(closure, span, samples, pieces_of_groups)
    why = ""
    if nearest:
        why = shortfall(mechanism, nearest.block, {**fixed, moved: nearest.q}, nearest.margin)
    return Limits(
        driver=moved,
        unit=joint.coordinate_unit,
        held=fixed,
        arcs=tuple(_arc(closure, p) for p in pieces),
        whole_turn=len(pieces) == 1 and pieces[0].start is None,
        nearest=nearest,
        spacing=(TURN if joint.rotary else 2 * span.size) / samples,
        prefix=mechanism._driver_prefix,
        why=why,
    )


def arcs_sentence(
    mechanism: Compiled, drivers: Mapping[str, float], blocks: Iterable[str] | None = None
) -> str:
    """The feasible arcs of every driver in words, the others held where they stand.

    ``drivers`` is driver -> coordinate [rad or m]; ``blocks`` as in `limits`.
    """
    chosen = None if blocks is None else tuple(blocks)
    sentences = []
    for driver in mechanism.drivers:
        rest = {d: q for d, q in drivers.items() if d != driver}
        sentences.append(limits(mechanism, driver, rest, blocks=chosen).sentence())
    return "; ".join(sentences)


def _shown(q: float, digits: int = 15) -> str:
    return f"{shown_place(q):.{digits}g}"


def _together(points: Iterable[End]) -> list[list[End]]:
    """Change points in rising order, those of several groups at one place together."""
    rows: list[list[End]] = []
    for p in points:
        if not rows or abs(p.q - rows[-1][0].q) > DOUBLE_ROOT:
            rows.append([])
        rows[-1].append(p)
    return [sorted(row, key=lambda p: p.block) for row in rows]


def _arc(closure: Closure, piece: Piece) -> Arc:
    """A piece with its ends named."""
    passes = tuple(_end(closure, p) for p in piece.passes)
    if piece.start is None or piece.end is None:
        return Arc(End(0.0, "", "turn"), End(TURN, "", "turn"), passes)
    start, end = _end(closure, piece.start), _end(closure, piece.end)
    structure = closure.mechanism.structure
    if start.how != end.how and turns_wheels(structure, closure.driver):
        start, end = (
            replace(x, q=bound.q, how="turn") if x.how == "unlimited" else x
            for x, bound in ((start, piece.start), (end, piece.end))
        )
    return Arc(start, end, passes)


def _end(closure: Closure, bound: Bound) -> End:
    if not bound.block:
        return End(math.copysign(math.inf, bound.q), "", "unlimited")
    return End(bound.q, bound.block, closure.how(bound.block, bound.q))


def _groups(structure: Structure, blocks: Iterable[str] | None) -> tuple[str, ...]:
    """Groups in formation order: all, or the named ones and their ancestors."""
    selected = set(structure.blocks) if blocks is None else set()
    for name in among(structure.blocks, "block", blocks or ()):
        selected |= structure.ancestors(name)
    return tuple(n for n, b in structure.blocks.items() if n in selected and b.closes)


def _moved(mechanism: Compiled, driver: str | None) -> str:
    """The driver that moves."""
    drivers = mechanism.drivers
    if driver is None and len(drivers) == 1:
        return drivers[0]
    if driver is None:
        message = f"the mechanism has {len(drivers)} drivers" if drivers else "it has no driver"
        remedy = f"name one of: {listed(drivers)}" if drivers else ""
        raise refused("limits", message, remedy)
    return among(drivers, "driver", driver)[0]


def _held(mechanism: Compiled, moved: str, at: Record) -> dict[str, float]:
    """Where the drivers stand that do not move: as asked, or where their motion begins."""
    rest = [d for d in mechanism.drivers if d != moved]
    valid = f"held: {listed(rest)}"
    why = {moved: "this driver is the one that moves"}
    invalid = [d for d in at if d not in rest]
    problems = [_wrong(f"at[{d}]", why.get(d, "there is no such driver"), valid) for d in invalid]
    fixed = {}
    for d in rest:
        q = at[d] if d in at else mechanism.scene.begin(d)
        x = number_in_si(q, mechanism._coordinate_units[d]) if isinstance(q, str) else q
        if isinstance(x, int | float) and math.isfinite(x):
            fixed[d] = float(x)
        elif d in at:
            problems.append(_wrong(f"at[{d}]", f"not a finite number: {q!r}", valid))
        else:
            remedy = f'give at={{"{d}": ...}}, or a law of motion by coordinate'
            problems.append(_wrong(d, "nothing says where this driver is held", "", remedy))
    RequestError.raise_for(problems)
    return fixed


def _wrong(where: str, message: str, valid: str = "", remedy: str = "") -> Problem:
    return Problem("bad-request", where, message, valid, remedy)
