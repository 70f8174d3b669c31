"""What a request costs, output by output: a model in counted array operations.

The plan's program is run once on a few samples with arrays that count what is done to
them, line by line, iterations of friction included. What makes the price:

    each operation on a chunk       a weight for a sum, a root, a cosine ..., more where a
                                    program has more arrays in use than the cache holds
    each matrix of a general group  solved, or its singular values taken
    following a general group       timed, and told in singular values
    each column of the result       copied out of its chunk; dearer where memory is new
    each sample                     made and judged whatever is wanted

Only ratios are used: how much dearer this is than that, on batches of many samples. What
the model leaves out: samples that are harder than those it runs, and new memory of a
machine that is short of it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from blockmech.cost.model import CostModel
from blockmech.errors import listed

if TYPE_CHECKING:
    from blockmech.compiled import Compiled
    from blockmech.plan import Plan

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


def shares(mechanism: Compiled, want: Iterable[str] | str, **settings: Any) -> tuple[Share, ...]:
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
    mechanism: Compiled, patterns: tuple[str, ...], whole: Plan, settings: Mapping[str, Any]
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


def cost_table(mechanism: Compiled, want: Iterable[str] | str, **settings: Any) -> str:
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
    mechanism: Compiled, want: Iterable[str] | str, **settings: Any
) -> float | None:
    """How many times cheaper the request is without friction; None if it has none."""
    plan = mechanism.plan(want, **settings)
    if not any(name.startswith("friction/") for name in plan.layout):
        return None
    less = {k: v for k, v in settings.items() if k not in ("tolerance", "iterations")}
    model = CostModel(mechanism)
    return model.cost(plan) / model.cost(mechanism.plan(want, **less | {"friction": "none"}))


def price(mechanism: Compiled, plan: Plan) -> float:
    """Modelled time of a batch per sample [ns]; only ratios of prices mean anything."""
    return CostModel(mechanism).cost(plan)
