"""What a request costs, output by output: a model in counted array operations.

The plan's program is run once on a few samples with arrays that count what is done to
them, line by line, iterations of friction included. Three kinds of cost make the price:

    each operation on a chunk       a weight for a sum, a root, a cosine ..., more where a
                                    program keeps more arrays than the cache holds
    each column of the result       copied out of its chunk; dearer where memory is new
    each sample                     made and judged whatever is wanted

Only ratios are used: how much dearer this is than that, on batches of many samples.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from blockmech.engines.binding import bind_functions
from blockmech.engines.numpy import NumpyEngine, Planar, primitives
from blockmech.errors import listed

if TYPE_CHECKING:
    from blockmech.mechanism import Mechanism
    from blockmech.plan import Plan
    from blockmech.samples import Samples

PROBE = 32  # samples on which operations are counted
NEAR = 1e-3  # [rad] or [m] around a start, where the mechanism is sure to close
GROUPS = 12  # wanted outputs above which they are told by quantity
WORTH, MOST_SAID = 1.1, 3  # savings that are said in words, and how many of them
FAMILIES = (  # the dearest stage that outputs need -> what they are called
    ("force", "reactions and drives"),
    ("unit acceleration", "reduced loads with slope"),
    ("unit velocity", "reduced inertia and load"),
    ("acceleration", "accelerations"),
    ("velocity", "velocities"),
    ("position", "positions"),
)
BATCH = 100_000  # samples of the batches that costs are meant for
TWO, ONE, TRUTH = 0.40, 0.31, 0.1  # [ns] a sum or a product; a sign or a comparison; an "and"
LIVE = 32
# [ns] an element of a chunk while a program keeps LIVE arrays; measured one by one with NumPy 2.4
# by tests/benchmarks/weights.py. None is fitted to a mechanism.
WEIGHTS = {
    "add": TWO, "subtract": TWO, "multiply": TWO, "maximum": TWO, "minimum": TWO,
    "divide": 0.47, "sqrt": 1.3, "sin": 8.3, "cos": 8.3, "arctan2": 2.6, "fmod": 4.9,
    "where": 0.8, "sign": 0.7, "searchsorted": 5.0, "take": 0.85,
    "bitwise_and": TRUTH, "bitwise_or": TRUTH, "logical_or": TRUTH,
}  # fmt: skip
CROWD = 0.08  # more for every doubling of the arrays that a program keeps: fewer are in cache
FEWEST = 8  # arrays below which they all are
COLUMN = 0.6  # [ns] an element of a column of the result, copied out of its chunk
REUSED = 32 * 2**20  # [bytes] C libraries hand out freed memory again up to here
FRESH = 0.7  # [ns] more for an element of a larger result: its pages are new
SAMPLES = 4.0  # [ns] a sample itself, measured where no kernel is called: its coordinates


@dataclass(frozen=True)
class Share:
    """What one wanted output, or all of one quantity, costs.

    Attributes
    ----------
    name : output or pattern
    blocks, stages : what it drags in
    alone : cost of it alone, over the cost of the whole request [-]
    saves : how many times cheaper the request is without it [-]
    """

    name: str
    blocks: tuple[str, ...]
    stages: tuple[str, ...]
    alone: float
    saves: float


class Counted(np.ndarray[Any, Any]):
    """An array that counts the operations done to it and to what comes of it."""

    tally: dict[str, int] = {}

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **more: Any) -> Any:
        plain = [x.view(np.ndarray) if isinstance(x, Counted) else x for x in inputs]
        found = getattr(ufunc, method)(*plain, **more)
        _count(self.tally, ufunc.__name__)
        return _counted(found)

    def __array_function__(self, func: Any, types: Any, args: Any, kwargs: Any) -> Any:
        found = func(*(_plain(a) for a in args), **kwargs)
        if func.__name__ in ("where", "searchsorted"):
            _count(self.tally, func.__name__)
        return _counted(found)

    def __getitem__(self, key: Any) -> Any:
        if isinstance(key, np.ndarray):
            _count(self.tally, "take")
        return _counted(_plain(self)[_plain(key)])


def _count(tally: dict[str, int], name: str) -> None:
    tally[name] = tally.get(name, 0) + 1


def _plain(x: Any) -> Any:
    if isinstance(x, Counted):
        return x.view(np.ndarray)
    return tuple(_plain(y) for y in x) if type(x) in (tuple, list) else x


def _counted(x: Any) -> Any:
    return x.view(Counted) if isinstance(x, np.ndarray) and x.ndim else x


def _counting(value: Any) -> Any:
    """A parameter whose arrays count; a plain tuple of them is a table."""
    if type(value) is tuple:
        return tuple(map(_counting, value))
    return _counted(value)


class CostModel:
    """Costs of plans of one mechanism; lines that plans share are counted once."""

    def __init__(self, mechanism: Mechanism) -> None:
        self.mechanism = mechanism
        self._lines: dict[str, float] = {}
        self._kept: dict[str, int] = {}
        self._columns: dict[str, int] = {}

    def cost(self, plan: Plan) -> float:
        """Time per sample [ns] of a batch, by the weights."""
        lines = [_parted(line) for line in plan.program.source.splitlines()[1:-1]]
        texts = [text for name, text in lines if text != "P"]
        known = all(text in self._lines for text in texts)
        if not known or not all(text in self._columns for text in plan.program.outputs):
            self._run(plan)
        columns = sum(self._columns[text] for text in plan.program.outputs)
        fresh = 8 * BATCH * columns > REUSED
        handed = columns * (COLUMN + FRESH * fresh)
        kept = max(sum(self._kept[text] for text in texts), FEWEST)
        crowded = 1.0 + CROWD * math.log2(kept / LIVE)
        return SAMPLES + crowded * sum(self._lines[text] for text in texts) + handed

    def _run(self, plan: Plan) -> None:
        """Run a plan's program line by line on counting arrays."""
        engine = NumpyEngine(plan.program)
        space: dict[str, Any] = dict(engine._program.__globals__)  # the engine's constants
        # The engine's own expi makes plain arrays, which would not count.
        own = primitives(engine.dtype) | {"expi": lambda t: Planar(np.cos(t), np.sin(t))}
        space |= bind_functions(plan.program.functions, own)
        tables = map(_counting, engine.parameters)  # what is looked up in them counts as well
        space |= dict(zip(plan.program.parameters, tables, strict=True))
        probe = self.mechanism.inward(_probe(self.mechanism))
        given = probe.given(plan.program.inputs)
        for name in plan.program.inputs:
            space[name] = np.asarray(given[name], dtype=float).view(Counted)
        with np.errstate(all="ignore"):
            for line in plan.program.source.splitlines()[1:-1]:
                name, text = _parted(line)
                if text == "P":
                    continue
                Counted.tally = {}
                space[name] = eval(text, space)
                self._lines[text] = sum(WEIGHTS.get(op, ONE) * k for op, k in Counted.tally.items())
                self._kept[text] = _columns(space[name])
            for text in plan.program.outputs:
                self._columns[text] = _columns(eval(text, space))


def _columns(value: Any) -> int:
    """Columns of numbers that a value holds; what is the same for all samples is none."""
    if isinstance(value, Planar):
        return _columns(value.real) + _columns(value.imag)
    if isinstance(value, tuple):
        return sum(map(_columns, value))
    return int(np.ndim(value) > 0)


def _parted(line: str) -> tuple[str, str]:
    name, _, text = line.strip().partition(" = ")
    return name, text


def _probe(mechanism: Mechanism) -> Samples:
    """Some samples of the drivers' ranges; near the start where there is no law."""
    from blockmech.errors import RequestError
    from blockmech.samples import make_samples

    drivers, scene = mechanism.drivers, mechanism.scene
    try:
        return make_samples(mechanism, scene, samples=PROBE)
    except RequestError:
        start = {d: scene.initial[d].q if d in scene.initial else 0.0 for d in drivers}
        at = {d: np.linspace(q, q + NEAR, PROBE) for d, q in start.items()}
        return make_samples(mechanism, scene, at, rates=dict.fromkeys(drivers, 1.0))


def shares(mechanism: Mechanism, want: Iterable[str] | str, **settings: Any) -> tuple[Share, ...]:
    """What each wanted output costs; many are told by quantity, as patterns."""
    patterns = (want,) if isinstance(want, str) else tuple(want)
    whole = mechanism.plan(patterns, **settings)
    model = CostModel(mechanism)
    total = model.cost(whole)
    found = []
    for name, members in _groups(mechanism, patterns, whole, settings).items():
        rest = tuple(n for n in whole.want if n not in members)
        alone = mechanism.plan(members, **settings)
        left = model.cost(mechanism.plan(rest, **settings)) if rest else 0.0
        blocks = tuple(dict.fromkeys(e.block for e in alone.entries))
        stages = tuple(dict.fromkeys(e.stage for e in alone.entries))
        saves = total / left if left else float("inf")
        found.append(Share(name, blocks, stages, model.cost(alone) / total, saves))
    return tuple(sorted(found, key=lambda s: -s.saves))


def _groups(
    mechanism: Mechanism, patterns: tuple[str, ...], whole: Plan, settings: Mapping[str, Any]
) -> Mapping[str, tuple[str, ...]]:
    """Outputs one by one, or by the user's patterns, or by the dearest stage they need."""
    names = whole.want
    if len(names) <= GROUPS:
        return {n: (n,) for n in names}
    if len(patterns) > 1:
        return {p: mechanism.outputs.match([p]) for p in patterns}
    by_quantity: dict[str, list[str]] = {}
    for name in names:
        by_quantity.setdefault(name.rpartition(".")[2], []).append(name)
    found: dict[str, tuple[str, ...]] = {}
    for members in by_quantity.values():
        stages = {e.stage for e in mechanism.plan(tuple(members), **settings).entries}
        family = next((words for stage, words in FAMILIES if stage in stages), "inputs")
        found[family] = (*found.get(family, ()), *members)
    return found


def cost_table(mechanism: Mechanism, want: Iterable[str] | str, **settings: Any) -> str:
    """The shares as text: what each output drags in and what asking for less would save."""
    rows = shares(mechanism, want, **settings)
    if not rows:
        return ""
    width = max(max(len(r.name) for r in rows), 6)
    lines = [f"{'output':<{width}}  alone  without it       drags in"]
    for r in rows:
        saves = "nothing left" if r.saves == float("inf") else f"{r.saves:.1f} x cheaper"
        what = f"{listed(r.stages, 6)} of {listed(r.blocks, 4)}" if r.blocks else "nothing"
        lines.append(f"{r.name:<{width}}  {100 * r.alone:3.0f} %  {saves:<15}  {what}")
    savings = [(r.saves, r.name) for r in rows if r.saves < float("inf")]
    smooth = without_friction(mechanism, want, **settings)
    if smooth is not None:
        savings.append((smooth, "friction"))
    said = [f"without {name}: {x:.1f} times cheaper" for x, name in sorted(savings, reverse=True)
            if x >= WORTH]  # fmt: skip
    return "\n".join([*lines, *said[:MOST_SAID]])


def without_friction(
    mechanism: Mechanism, want: Iterable[str] | str, **settings: Any
) -> float | None:
    """How many times cheaper the request is without friction; None if it has none."""
    plan = mechanism.plan(want, **settings)
    if not any(name.startswith("friction/") for name in plan.layout):
        return None
    less = {k: v for k, v in settings.items() if k not in ("tolerance", "iterations")}
    model = CostModel(mechanism)
    return model.cost(plan) / model.cost(mechanism.plan(want, **less | {"friction": "none"}))


def price(mechanism: Mechanism, plan: Plan) -> float:
    """Modelled time of a batch per sample [ns]; only ratios of prices mean anything."""
    return CostModel(mechanism).cost(plan)
