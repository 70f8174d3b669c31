"""Designs: mechanisms that a synthesis proposes, and how well they do what is wanted of them."""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from blockmech.builders import Graph
from blockmech.ground.report import Facts, Report
from blockmech.ground.tolerances import EQUAL
from blockmech.ground.units import shown_in
from blockmech.model.versions import VERSION
from blockmech.result.tables import aligned
from blockmech.synthesis.fourbar import SHAPE, coupler_point
from blockmech.synthesis.search import Task, search
from blockmech.typing import Floats, Progress

ALIKE = 1e-4  # two designs are one


@dataclass(frozen=True, repr=False)
class Design(Facts, Report):
    """A mechanism, and its deviation from the task.

    Attributes
    ----------
    graph : the mechanism; `Graph.save` writes it, the studio opens it
    at : (n,) coordinates [rad] of the driver at the positions
    output : name of the output that is wanted
    errors : (n,) [m or rad] distance from the positions
    margin : least margin [-] of its groups on the way through them, 0 at a dead centre

    >>> curve = [1 + 1j, 1.4 + 1.3j, 1.1 + 1.7j, 0.7 + 1.4j]
    >>> best = bm.synthesis.path_generator(curve, seed=1)[0]
    >>> best.graph
    <Graph path_generator: 3 moving links, 4 pairs, mobility 1; I(crank: 0,1) -> II RRR(dyad: 2,3)>
    """

    _homes = {"graph.{}": "blockmech.Graph"}

    graph: Graph
    at: Floats
    output: str
    errors: Floats
    margin: float

    @property
    def miss(self) -> float:
        """The largest of the errors."""
        return float(self.errors.max())

    def lines(self) -> Iterator[str]:
        """The miss, and where the driver stands at the positions."""
        factor, unit = shown_in("rad", self._display)
        angles = ", ".join(f"{q + 0.0:.6g}" for q in factor * self.at)
        quality = f"largest miss {self.miss:.6g}, least margin {self.margin:.3g}"
        yield f"{self.output}: {quality}, at {angles} {unit}"


@dataclass(frozen=True, repr=False)
class Synthesis(Facts, Report, Sequence[Design]):
    """Designs, the best first: by their error, and among exact ones by their margin.

    Attributes
    ----------
    designs : the designs
    tried : starting designs that were tried
    left_out : refined designs that change circuit or branch on the way, or take the positions in
        another order

    >>> curve = [1 + 1j, 1.4 + 1.3j, 1.1 + 1.7j, 0.7 + 1.4j]
    >>> designs = bm.synthesis.path_generator(curve, seed=1)
    >>> len(designs)
    5
    """

    designs: tuple[Design, ...]
    tried: int
    left_out: int

    def __getitem__(self, index: Any) -> Any:
        return self.designs[index]

    def __len__(self) -> int:
        return len(self.designs)

    def lines(self) -> Iterator[str]:
        """The designs, one a line."""
        rows = [(str(i), f"{d.miss:.6g}", f"{d.margin:.3g}") for i, d in enumerate(self.designs)]
        yield from aligned(("design", "largest miss", "least margin"), rows)
        yield f"{self.tried} starts tried, {self.left_out} left out for circuit, branch or order"


def proposed(
    task: Task,
    count: int,
    starts: int,
    seed: int,
    progress: Progress | None,
    design_of: Callable[[Floats, int, float], Design],
) -> Synthesis:
    """The best designs of a task; ``design_of(unknowns, branch, margin)`` is that of a row."""
    x, branch, margins, left_out = search(task, count, starts, seed, progress)
    designs: list[Design] = []
    for row, side, margin in zip(x, branch.tolist(), margins.tolist(), strict=True):
        design = design_of(row, side, margin)
        if all(_apart(design, listed_design, task.size) for listed_design in designs):
            designs.append(design)
    best = sorted(designs, key=lambda d: (max(d.miss, EQUAL * task.size), -d.margin))[:count]
    return Synthesis(tuple(best), starts, left_out)


def _apart(first: Design, second: Design, size: float) -> bool:
    gap = np.abs(first.at - second.at).max() + abs(first.miss - second.miss) / size
    return bool(gap + abs(first.margin - second.margin) > ALIKE)


def design_of_path(task: Task, name: str, x: Floats, branch: int, margin: float) -> Design:
    """The design of unknowns (k,) whose coupler point is wanted."""
    assert task.points is not None
    A, B = complex(*x[SHAPE : SHAPE + 2]), complex(*x[SHAPE + 2 : SHAPE + 4])
    theta = x[SHAPE + 5 :]
    miss = np.abs(A * coupler_point(x[:SHAPE], theta, np.asarray(branch)) + B - task.points)
    return Design(fourbar(x[:SHAPE], A, B, branch, name), theta, "dyad.P.p", miss, margin)


def fourbar(shape: Floats, A: complex, B: complex, branch: int, name: str = "fourbar") -> Graph:
    """The graph of a four-bar: its shape with crank 1, then turned and scaled by A, moved by B.

    shape : (6,), or (4,) without a coupler point
    branch : 1 or -1, the side of the dyad

    >>> bm.synthesis.fourbar([0.0, 3.0, 3.0, 3.0, 1.0, 0.5], 1 + 0j, 0j, 1)
    <Graph fourbar: 3 moving links, 4 pairs, mobility 1; I(crank: 0,1) -> II RRR(dyad: 2,3)>
    """
    frame, turn, coupler, rocker, *point = (float(x) for x in shape)
    size, angle = abs(A), cmath.phase(A)
    D = B + A * cmath.exp(frame + 1j * turn)
    markers = {"P": {"at": [size * x for x in point]}} if point else {}
    return Graph.from_data(
        {
            "format": "blockmech/graph",
            "version": VERSION,
            "name": name,
            "blocks": {
                "frame": {
                    "type": "frame",
                    "markers": {"A": {"at": [B.real, B.imag]}, "D": {"at": [D.real, D.imag]}},
                },
                "crank": {"type": "driver.crank", "length": size, "offset": angle},
                "dyad": {
                    "type": "dyad.rrr",
                    "l_i": size * math.exp(coupler),
                    "l_j": size * math.exp(rocker),
                    "branch": int(branch),
                    "links": {"i": {"markers": markers}},
                },
            },
            "wires": [
                {"from": "frame.A", "to": "crank.A"},
                {"from": "crank.B", "to": "dyad.B"},
                {"from": "frame.D", "to": "dyad.D"},
            ],
            "scene": {"drive": {"crank": {"law": "constant_rate", "rate": 1.0}}},
        }
    )


def saved(designs: Sequence[Any], folder: Any) -> Iterator[Any]:
    """Write the designs as files ``design_0.json``, ... into a folder, and give their paths.

    >>> curve = [1 + 1j, 1.4 + 1.3j, 1.1 + 1.7j, 0.7 + 1.4j]
    >>> designs = bm.synthesis.path_generator(curve, seed=1)
    >>> next(bm.synthesis.saved(designs, "designs")).name
    'design_0.json'
    """
    from pathlib import Path

    Path(folder).mkdir(parents=True, exist_ok=True)
    for i, design in enumerate(designs):
        path = Path(folder) / f"design_{i}.json"
        design.graph.save(path)
        yield path
