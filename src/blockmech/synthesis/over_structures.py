r"""Synthesis over structures: every linkage of a number of links, each tried and refined.

Random designs of a structure run in batches through one program (`Mechanism.study`); the best are
laid over the points by size, turn and place, and refined on exact derivatives of the whole
mechanism (dual numbers), crank angles too where the timing is free. What has no defect stands in
one table, of which the Pareto front counts; with a folder a search that was interrupted goes on
where it stopped.

Source: Norton, Design of Machinery, 6th ed., ch. 4 (defects).
"""

from __future__ import annotations

import hashlib
import itertools
import json
import math
import time as clock
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from blockmech.builders import Graph
from blockmech.engines.derivatives import Dual, DualEngine, slope, value
from blockmech.functions.roots import SCANNED
from blockmech.ground.arguments import declared
from blockmech.ground.errors import BlockmechError
from blockmech.ground.files import AnyPath, writing
from blockmech.ground.progress import with_bar
from blockmech.ground.report import Facts, Report
from blockmech.ground.tolerances import BLUR, EQUAL
from blockmech.model.joints.varied import Varied
from blockmech.plan.plan import Plan
from blockmech.result.tables import aligned
from blockmech.studies.variation import Variation
from blockmech.synthesis.designs import Design
from blockmech.synthesis.search import FAR, HIGH, LOW, path_of, similar, size_of
from blockmech.synthesis.structures import Structure, blank, structures
from blockmech.typing import Array, Data, Floats, Numbers, Points, Progress, Vectors

if TYPE_CHECKING:
    from blockmech.mechanism import Mechanism

STARTS = 1024  # random designs of each structure, assembly mode and timing
TRIED = 3  # of them are refined
TIMINGS = (0.3, -0.3, 0.55, -0.55, 0.85, -0.85)  # turns from the first point to the last
STEPS = 200  # of the refinement
SMALL, LARGE = 0.02, 30.0  # of the size of the path: numbers of a design
POSES = SCANNED // 4 + 1  # from the first point to the last, at which designs are judged


class _Family:
    """The designs of a structure in one assembly mode."""

    def __init__(self, graph: Graph, branches: Sequence[int]) -> None:
        dyads = [name for name, b in graph.blocks.items() if hasattr(b, "branch")]
        modes = {f"{d}.branch": b for d, b in zip(dyads, branches, strict=True)}
        self.graph = graph.replace(modes)
        self.mechanism: Mechanism = self.graph.compile()
        parameters = self.mechanism.parameters()
        self.lengths = [a for a in parameters if a.endswith((".l_i", ".l_j"))]
        self.places = [
            a[:-2]
            for a in parameters
            if a.endswith(".x") and ".links." not in a and not a.startswith("scene")
        ]
        self.output = next(o for o in self.mechanism.outputs if o.endswith(".P.p"))
        self.margins = [f"{d}.margin" for d in dyads]

    @property
    def addresses(self) -> list[str]:
        """Lengths, then places by x and y."""
        return [*self.lengths, *(f"{a}.{x}" for a in self.places for x in "xy")]

    def random(self, draw: Floats) -> Floats:
        """Numbers (m, k) of designs from Sobol's points (m, k)."""
        from scipy.stats import norm

        n = len(self.lengths)
        lengths = np.exp(LOW + (HIGH - LOW) * draw[:, :n])
        return np.hstack([lengths, 1.5 * norm.ppf(np.clip(draw[:, n:], 1e-9, 1 - 1e-9))])

    def laid(self, x: Floats, A: complex, B: complex) -> Floats:
        """Numbers of a design that is turned and scaled by A, and moved by B."""
        n, laid_out = len(self.lengths), x * abs(A)
        z = x[n::2] + 1j * x[n + 1 :: 2]
        for i, a in enumerate(self.places):
            head = a.partition(".")[0]
            at = A * z[i] + B if head == "frame" else A * z[i] if head == "crank" else abs(A) * z[i]
            laid_out[n + 2 * i : n + 2 * i + 2] = at.real, at.imag
        return laid_out

    def tried(self, x: Floats, theta: Floats) -> Vectors:
        """The tracing point (m, n) of designs at crank angles, NaN where they do not close."""
        column = f"poses({self.output})"
        vary = dict(zip(self.addresses, x.T, strict=True))
        study = self.mechanism.study(
            vary, want=column, at=theta, sampling="paired", friction="none"
        )
        return np.asarray(study[column])

    @cached_property
    def _near(self) -> tuple[Variation, Plan]:
        """The mechanism as its numbers vary, and the plan of the tracing point."""
        parameters = self.mechanism.parameters()
        variation = Variation.of(self.mechanism, [parameters[a] for a in self.addresses])
        return variation, variation.general.plan((self.output,), friction="none")

    def traced(self, x: Floats, theta: Floats) -> tuple[Vectors, Array]:
        """The tracing point (n,) at crank angles, and derivatives (n, k + 1) by numbers and angle.

        NaN where the design does not close.
        """
        variation, plan = self._near
        k, n = len(x), len(theta)
        seeds = np.eye(k + 1, k)
        rows = zip(variation.numbers, x.tolist(), np.eye(k), strict=True)
        design = replace(variation, numbers={path: Varied(v, e) for path, v, e in rows})
        angle = np.zeros((k + 1, n))
        angle[-1] = 1.0
        with np.errstate(all="ignore"):
            values = DualEngine(plan.program).run(
                {"q_0": Dual(theta, angle)}, plan.program.values(*design.design(seeds)), n, k + 1
            )
            point = design.outputs(seeds)[self.output].read(
                *(values[i] for i in plan.layout[self.output])
            )
            z = value(point.real) + 1j * value(point.imag)
            return z, np.asarray(slope(point.real) + 1j * slope(point.imag)).T

    def refined(
        self, x: Floats, theta: Floats, targets: Vectors, free: bool
    ) -> tuple[Floats, Floats]:
        """Numbers and crank angles nearest to the points, by least squares."""
        from scipy.optimize import least_squares

        size, k = size_of(targets), len(x)
        last: Data = {}

        def at(u: Floats) -> tuple[Floats, Floats]:
            if last.get("u") != u.tobytes():
                z, d = self.traced(u[:k], np.append(theta[0], u[k:]) if free else theta)
                d = np.hstack([d[:, :k], np.diag(d[:, k])[:, 1:]]) if free else d[:, :k]
                closes = np.isfinite(z) & np.isfinite(d).all(axis=1)
                gap = np.where(closes, z - targets, FAR * size) / size
                d = np.where(closes[:, None], d, 0.0) / size
                r, J = np.concatenate([gap.real, gap.imag]), np.vstack([d.real, d.imag])
                last.update(u=u.tobytes(), r=r, J=J)
            return last["r"], last["J"]

        low, high = self._bounds(targets, size)
        start = np.clip(x, low, high)
        if free:
            turns = np.full(len(theta) - 1, np.inf)
            start, low, high = (
                np.append(u, v) for u, v in ((start, theta[1:]), (low, -turns), (high, turns))
            )
        optimum = least_squares(
            lambda u: at(u)[0], start, lambda u: at(u)[1], bounds=(low, high), x_scale="jac",
            max_nfev=STEPS, xtol=1e-12, ftol=1e-12, gtol=1e-14,
        )  # fmt: skip
        return optimum.x[:k], np.append(theta[0], optimum.x[k:]) if free else theta

    def _bounds(self, targets: Vectors, size: float) -> tuple[Floats, Floats]:
        """Lowest and highest numbers (k,): what can be built about a path of a size [m]."""
        n, middle = len(self.lengths), targets.mean()
        low, high = np.full((2, n), [[SMALL * size], [LARGE * size]])
        for a in self.places:
            at = middle if a.startswith("frame.") else 0j
            low = np.append(low, np.array([at.real, at.imag]) - LARGE * size)
            high = np.append(high, np.array([at.real, at.imag]) + LARGE * size)
        return low, high

    def judged(
        self, x: Floats, theta: Floats, targets: Vectors, load: _Load
    ) -> tuple[Design, float] | None:
        """A design and its largest driving moment; None where it has a defect on the way."""
        steps = np.diff(theta)
        if not ((steps > 0).all() or (steps < 0).all()) or abs(theta[-1] - theta[0]) > math.tau:
            return None
        graph = self.graph.replace(dict(zip(self.addresses, x.tolist(), strict=True)))
        graph = _with_bars(graph, load.density, load.gravity)
        angles = np.linspace(theta[0], theta[-1], POSES)
        try:
            run = graph.run(at=angles, rates=load.rate, accelerations=0.0,
                            want=["crank.drive", *self.margins])  # fmt: skip
            z = graph.run(at=theta, want=self.output)[self.output]
        except BlockmechError:
            return None
        margin = min(float(run[m].min()) for m in self.margins)
        if not margin > BLUR:
            return None
        moment = float(np.abs(run["crank.drive"]).max())
        return Design(graph, theta, self.output, np.abs(z - targets), margin), moment


class _Load(NamedTuple):
    """What the drive is judged by: bars [kg/m], rate [rad/s], gravity [m/s2]."""

    density: float
    rate: float
    gravity: tuple[float, float]


def _with_bars(graph: Graph, density: float, gravity: tuple[float, float]) -> Graph:
    """The graph with links that are bars of a mass per length [kg/m]."""
    data = graph.to_data()
    data.setdefault("scene", {})["gravity"] = [*gravity]
    for name, block in data["blocks"].items():
        links = block.setdefault("links", {}) if name != "frame" else {}
        ends = {k: complex(block[f"l_{k}"]) for k in "ij" if f"l_{k}" in block}
        if name == "crank":
            marks = [complex(*m["at"]) for m in links["crank"]["markers"].values()]
            ends = {"crank": max(marks, key=abs)}
        for link, end in ends.items():
            mass = density * abs(end)
            bar = {"mass": mass, "inertia": mass * abs(end) ** 2 / 12}
            links[link] = {**links.get(link, {}), **bar, "cm": [end.real / 2, end.imag / 2]}
    return Graph.from_data(data)


@dataclass(frozen=True, repr=False)
class Candidate(Facts, Report):
    """A design of a structure.

    Attributes
    ----------
    structure : its name
    links : number of its links
    design : the design
    moment : largest driving moment [N m] on the way
    met : error [m] below which the task counts as met

    >>> task = [0.0, 1.0, 2.0 + 0.1j]
    >>> best = bm.synthesis.path_over_structures(task, links=[4], starts=64, refined=1)[0]
    >>> best.structure, best.links
    ('4bar-01-03-12-23-f0c1t2', 4)
    """

    FACTS = ("structure", "links", "moment", "design")

    structure: str
    links: int
    design: Design
    moment: float
    met: float

    @property
    def graph(self) -> Graph:
        """The mechanism."""
        return self.design.graph

    @property
    def measures(self) -> tuple[float, ...]:
        """Quantities to minimise: error [m], moment [N m], -margin, links."""
        error = max(self.design.miss, self.met)
        return error, self.moment, -self.design.margin, float(self.links)

    def lines(self) -> Iterator[str]:
        """Structure, moment and design."""
        yield f"{self.structure}: moment {self.moment:.4g} N m, {self.design.to(*self._display)}"


@dataclass(frozen=True, repr=False)
class Candidates(Facts, Report, Sequence[Candidate]):
    """Designs over structures, those with the least error first.

    Attributes
    ----------
    candidates : all designs without a defect
    tried : structure -> random designs of it that were tried
    unfinished : structures that were not tried within the budget

    >>> task = [0.0, 1.0, 2.0 + 0.1j]
    >>> designs = bm.synthesis.path_over_structures(task, links=[4], starts=64, refined=1)
    >>> designs.unfinished
    ()
    """

    FACTS = ("tried", "unfinished", "designs")

    candidates: tuple[Candidate, ...]
    tried: Mapping[str, int]
    unfinished: tuple[str, ...] = ()

    def __getitem__(self, index: Any) -> Any:
        return self.candidates[index]

    def __len__(self) -> int:
        return len(self.candidates)

    @property
    def pareto(self) -> tuple[Candidate, ...]:
        """The Pareto-optimal designs in error, moment, margin and links."""
        return tuple(
            c
            for c in self.candidates
            if not any(
                other.measures != c.measures
                and all(a <= b for a, b in zip(other.measures, c.measures, strict=True))
                for other in self.candidates
            )
        )

    @property
    def designs(self) -> tuple[Candidate, ...]:
        """The same as ``candidates``, as JSON names them."""
        return self.candidates

    def lines(self) -> Iterator[str]:
        """A table; * marks the Pareto-optimal designs."""
        best = {id(c) for c in self.pareto}
        rows = [
            (f"{i}{'*' * (id(c) in best)}", f"{c.design.miss:.4g}", f"{c.moment:.4g}",
             f"{c.design.margin:.3g}", str(c.links), c.structure)
            for i, c in enumerate(self.candidates)
        ]  # fmt: skip
        head = ("design", "error [m]", "moment [N m]", "margin", "links", "structure")
        yield from aligned(head, rows)
        yield f"{sum(self.tried.values())} designs of {len(self.tried)} structures tried"
        if self.unfinished:
            yield f"not tried: {', '.join(self.unfinished)}"


@with_bar
@declared
def path_over_structures(
    points: Points,
    angles: Numbers | None = None,
    *,
    links: Iterable[int] = (4, 6),
    starts: int = STARTS,
    refined: int = TRIED,
    density: float = 1.0,
    rate: float = 1.0,
    gravity: tuple[float, float] = (0.0, -9.81),
    seed: int = 0,
    budget: float = math.inf,
    out: AnyPath | None = None,
    progress: Progress | None = None,
) -> Candidates:
    """Linkages of all structures whose point passes through points, as a Pareto table.

    Parameters
    ----------
    points, angles : as those of `path_generator`
    links : numbers of links, 4, 6 or 8, whose structures are tried (`structures`)
    starts : random designs of each structure, assembly mode and timing
    refined : number of designs of each structure that are refined
    density : [kg/m] of the links, which are bars, for the driving moment
    rate : [rad/s] of the crank, for the driving moment
    gravity : [m/s2]
    seed : of the random designs
    budget : [s] after which no further structure is started
    out : folder for the designs of each structure, one file each, which the studio opens; a
        repeated search continues from them
    progress : called as ``progress(task, completed, total)``

    Returns
    -------
    Candidates, those with the least error first; after Ctrl-C those of the completed structures

    Raises `RequestError` for invalid points or angles

    >>> found = path_over_structures([0.0, 1.0, 2.0 + 0.1j], links=[4], starts=64, refined=1)
    >>> found[0].links
    4
    """
    P, theta = path_of(points, angles)
    chosen = [s for n in links for s in structures(n)]
    load = _Load(density, rate, gravity)
    request = [P.tolist(), None if theta is None else theta.tolist(), starts, refined, load, seed]
    question = hashlib.sha256(repr(request).encode()).hexdigest()
    candidates: list[Candidate] = []
    tried: dict[str, int] = {}
    end = clock.monotonic() + budget
    try:
        for i, s in enumerate(chosen):
            if progress is not None:
                progress(f"{s.name}, {len(candidates)} designs", i, len(chosen))
            stored = None if out is None else _kept(Path(out), s, question)
            if stored is None:
                if clock.monotonic() > end:
                    break
                count, rows = _of_structure(s, P, theta, starts, refined, load, seed)
                if out is not None:
                    _keep(Path(out), s, question, count, rows)
            else:
                count, rows = stored
            tried[s.name] = count
            candidates += rows
    except KeyboardInterrupt:
        pass
    untried = tuple(s.name for s in chosen if s.name not in tried)
    return Candidates(tuple(sorted(candidates, key=lambda c: c.measures)), tried, untried)


def _of_structure(
    s: Structure,
    P: Vectors,
    theta: Floats | None,
    starts: int,
    refined: int,
    load: _Load,
    seed: int,
) -> tuple[int, list[Candidate]]:
    """How many designs of a structure were tried, and the best ones refined."""
    from scipy.stats import qmc

    graph = blank(s, seed)
    length = np.append(0.0, np.cumsum(np.abs(np.diff(P))))
    timings = (
        [theta] if theta is not None else [math.tau * p * length / length[-1] for p in TIMINGS]
    )
    rows: list[tuple[float, _Family, Floats, Floats]] = []
    count = 0
    for modes in itertools.product((1, -1), repeat=len(s.dyads)):
        family = _Family(graph, modes)
        sobol = qmc.Sobol(len(family.addresses), seed=np.random.default_rng(seed))
        for at in timings:
            x = family.random(sobol.random(starts))
            z = family.tried(x, at)
            A, B = similar(z, P)
            with np.errstate(invalid="ignore"):
                cost = (np.abs(A[:, None] * z + B[:, None] - P) ** 2).mean(axis=1)
            count += len(x)
            best = np.argsort(np.where(np.isfinite(cost), cost, np.inf), kind="stable")[:refined]
            rows += [
                (float(cost[i]), family, family.laid(x[i], complex(A[i]), complex(B[i])), at)
                for i in best
                if np.isfinite(cost[i])
            ]
    candidates: list[Candidate] = []
    for _, family, x, at in sorted(rows, key=lambda row: row[0])[:refined]:
        numbers, angles = family.refined(x, at, P, theta is None)
        judged = family.judged(numbers, angles, P, load)
        if judged is not None:
            candidates.append(Candidate(s.name, s.links, *judged, EQUAL * size_of(P)))
    return count, candidates


def _keep(out: Path, s: Structure, question: str, count: int, rows: Sequence[Candidate]) -> None:
    """Write the designs of a structure, then what they are; so it is there whole or not at all."""
    out.mkdir(parents=True, exist_ok=True)
    for i, c in enumerate(rows):
        c.graph.save(out / f"{s.name}-{i}.json")
    designs = [
        {"at": c.design.at.tolist(), "errors": c.design.errors.tolist(), "met": c.met,
         "moment": c.moment,
         "margin": c.design.margin, "output": c.design.output}
        for c in rows
    ]  # fmt: skip
    text = json.dumps({"question": question, "tried": count, "designs": designs}, indent=1)
    with writing(out / f"{s.name}.designs") as stream:
        stream.write(text.encode())


def _kept(out: Path, s: Structure, question: str) -> tuple[int, list[Candidate]] | None:
    """The designs of a structure that are in a folder already; None where they are not."""
    try:
        data = json.loads((out / f"{s.name}.designs").read_text(encoding="utf-8"))
        if data["question"] != question:
            return None
        rows = []
        for i, row in enumerate(data["designs"]):
            graph = Graph.load(out / f"{s.name}-{i}.json")
            at, errors = np.array(row["at"]), np.array(row["errors"])
            design = Design(graph, at, row["output"], errors, row["margin"])
            rows.append(Candidate(s.name, s.links, design, row["moment"], row["met"]))
    except (OSError, ValueError, KeyError, BlockmechError):
        return None
    return int(data["tried"]), rows
