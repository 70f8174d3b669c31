"""The poses that the studio shows: a turn of the drivers, and the part that moves at all."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from blockmech.analysis.limits import limits
from blockmech.builders import Graph
from blockmech.compiled import Compiled
from blockmech.draw.motion import Motion, moves, moves_of_result
from blockmech.errors import BlockmechError, Problem
from blockmech.failures import why_not
from blockmech.mechanism import Mechanism
from blockmech.result import Result
from blockmech.samples import DEFAULT_SAMPLES
from blockmech.studio.edits import without

FRAME = 3  # samples from one frame to the next: as smooth as a screen shows, a third to send


def turn(mechanism: Compiled, at: Mapping[str, float] | None = None) -> Motion:
    """The motion over the laws of the drivers; without laws one driver turns, the others stay.

    Parameters
    ----------
    at : driver -> coordinate [rad or m] of the drivers without a law; the first of them moves
        over a turn from there, or over the arc on which it closes

    Raises `RequestError` where a law cannot be followed.
    """
    laws, starts = mechanism.scene.drive, mechanism.scene.initial
    free = [d for d in mechanism.drivers if d not in laws]
    if not free:
        return moves(mechanism, samples=DEFAULT_SAMPLES)
    given = {d: starts[d].q for d in mechanism.drivers if d in starts} | dict(at or {})
    held = {d: given.get(d, 0.0) for d in mechanism.drivers}
    moved, *_ = free
    if mechanism.driver_joint(moved).rotary:
        low, high = held[moved], held[moved] + 2 * np.pi
    else:
        others = {d: q for d, q in held.items() if d != moved}
        arcs = limits(mechanism, moved, others).arcs
        low, high = (arcs[0].start.q, arcs[0].end.q) if arcs else (held[moved],) * 2
    q = np.linspace(low, high, DEFAULT_SAMPLES)
    how: dict[str, Any] = {"want": (), "on_gap": "mark", "friction": "none"}
    rows = {d: q if d == moved else np.full(q.shape, x) for d, x in held.items()}
    return moves_of_result(mechanism.run(at=rows, rates=dict.fromkeys(rows, 0.0), **how))


def closing(motion: Motion) -> Result:
    """The same samples with the margins of all groups, and which of them fails in a gap."""
    places = (name for name in motion.mechanism.outputs if name.endswith(".p"))
    return motion.result.rerun(*places)


def gaps_of(result: Result) -> list[tuple[int, int, str]]:
    """Runs of samples without an answer: first, last, and why there is none, as a sentence."""
    bad = np.zeros(result.n, bool)
    bad[list(result.quality.gaps)] = True
    edges = np.flatnonzero(np.diff(np.pad(bad.astype(int), 1)))
    return [(int(a), int(b) - 1, _why(result, int(a))) for a, b in edges.reshape(-1, 2)]


def _why(result: Result, sample: int) -> str:
    """Why a sample has no answer."""
    drivers = enumerate(result.mechanism.drivers)
    at = {d: float(result.samples.coordinate(i)[sample]) for i, d in drivers}
    rates = dict.fromkeys(at, 0.0)
    alone = result.mechanism.run(
        at=at, rates=rates, want=tuple(result), friction="none", on_gap="mark"
    )
    return why_not(alone if alone.quality.gaps else result)


def part_of(form: Mapping[str, Any], failing: Iterable[str]) -> dict[str, Any]:
    """A graph's form without some blocks, and without all that hangs on them."""
    gone = set(failing)
    before = -1
    while len(gone) != before:
        before = len(gone)
        for wire in form["wires"]:
            if wire["from"].partition(".")[0] in gone:
                gone.add(wire["to"].partition(".")[0])
    return without({key: x for key, x in form.items() if key not in ("expect", "view")}, gone)


def blamed_blocks(form: Mapping[str, Any], problems: Iterable[Problem]) -> set[str]:
    """The blocks that problems are about."""
    words = {word for p in problems for word in re.split(r", |[.\[]", p.where)}
    return words & set(form["blocks"])


def what_moves(form: Mapping[str, Any], failing: Iterable[str]) -> Mechanism | None:
    """The largest part of a graph without the failing blocks that is a mechanism, or None."""
    gone = set(failing)
    while gone and form["blocks"]:
        form = part_of(form, gone)
        try:
            graph = Graph.from_data(form)
            if not (problems := graph.check()):
                return graph.compile()
        except BlockmechError as error:
            problems = list(error.problems)
        gone = blamed_blocks(form, problems)
    return None
