"""What a request costs: its kernel calls counted, and the plans of less timed on the spot.

Each wanted output's plan, and the plan of all the others, run on samples of the drivers'
ranges, and the best of a few runs counts. So what is said is about this machine and these
samples, and good for a tenth or so.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from blockmech.compiled import Compiled
from blockmech.errors import RequestError, listed
from blockmech.plan import Plan
from blockmech.samples import Samples, make_samples

GROUPS = 12  # wanted outputs above which they are told by quantity
SAMPLES = 512  # of a timed run: enough that the kernels count, not the calling of them
ROUNDS = 4  # of which the fastest counts; the first binds the program
NEAR = 1e-3  # [rad] or [m] around a start, where the mechanism is sure to close
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
    alone : time of it alone, over that of the whole request [-]
    saves : how many times faster the request is without it [-]
    """

    name: str
    blocks: tuple[str, ...]
    stages: tuple[str, ...]
    alone: float
    saves: float


def _time(mechanism: Compiled, plan: Plan, samples: Samples) -> float:
    """Processor time [s] of a plan's program."""
    spent = []
    for _ in range(ROUNDS):
        start = time.process_time()
        mechanism.evaluate(plan, samples, "numpy")
        spent.append(time.process_time() - start)
    return min(spent)


def explain(mechanism: Compiled, want: Iterable[str] | str, **settings: Any) -> str:
    """The schedule of some outputs, and what each of them drags in and costs, as text."""
    patterns = (want,) if isinstance(want, str) else tuple(want)
    plan = mechanism.plan(patterns, **settings)
    rows = shares(mechanism, patterns, **settings)
    if not rows:
        return f"{plan.explain()}\n\n"
    width = max(max(len(r.name) for r in rows), len("output"))
    lines = [f"{'output':<{width}}  alone  without it       drags in"]
    for r in rows:
        saves = "nothing left" if r.saves == float("inf") else f"{r.saves:.1f} x faster"
        what = f"{listed(r.stages, 6)} of {listed(r.blocks, 4)}" if r.blocks else "nothing"
        lines.append(f"{r.name:<{width}}  {100 * r.alone:3.0f} %  {saves:<15}  {what}")
    smooth = without_friction(mechanism, patterns, **settings)
    if smooth is not None:
        lines.append(f"without friction: {smooth:.1f} times faster")
    return "\n".join([plan.explain(), "", *lines])


def shares(mechanism: Compiled, want: Iterable[str] | str, **settings: Any) -> tuple[Share, ...]:
    """What each wanted output costs; many are told by quantity, as patterns."""
    patterns = (want,) if isinstance(want, str) else tuple(want)
    whole = mechanism.plan(patterns, **settings)
    samples = _samples(mechanism)
    total = _time(mechanism, whole, samples)
    found = []
    for name, members in _groups(mechanism, patterns, whole, settings).items():
        rest = tuple(n for n in whole.want if n not in members)
        plan = mechanism.plan(members, **settings)
        left = _time(mechanism, mechanism.plan(rest, **settings), samples) if rest else 0.0
        alone = _time(mechanism, plan, samples) / total if rest else 1.0
        blocks = tuple(dict.fromkeys(e.block for e in plan.entries))
        stages = tuple(dict.fromkeys(e.stage for e in plan.entries))
        found.append(Share(name, blocks, stages, alone, total / left if left else float("inf")))
    return tuple(sorted(found, key=lambda s: -s.saves))


def without_friction(
    mechanism: Compiled, want: Iterable[str] | str, **settings: Any
) -> float | None:
    """How many times faster the request is without friction; None if it has none."""
    plan = mechanism.plan(want, **settings)
    if not any(name.startswith("friction/") for name in plan.layout):
        return None
    less = {k: v for k, v in settings.items() if k not in ("tolerance", "iterations")}
    smooth, samples = mechanism.plan(want, **less | {"friction": "none"}), _samples(mechanism)
    return _time(mechanism, plan, samples) / _time(mechanism, smooth, samples)


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


def _samples(mechanism: Compiled) -> Samples:
    """Samples of the drivers' ranges; near the start where there is no law."""
    drivers, scene = mechanism.drivers, mechanism.scene
    try:
        return make_samples(mechanism, scene, samples=SAMPLES)
    except RequestError:
        start = {d: scene.initial[d].q if d in scene.initial else 0.0 for d in drivers}
        at = {d: np.linspace(q, q + NEAR, SAMPLES) for d, q in start.items()}
        return make_samples(mechanism, scene, at, rates=dict.fromkeys(drivers, 1.0))
