"""What a request costs: its kernel calls, and how many of them each requested output needs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from blockmech.compiled import Compiled
from blockmech.ground.arguments import declared
from blockmech.ground.errors import as_names, listed
from blockmech.ground.report import LINES
from blockmech.ground.runnable import EVERYTHING
from blockmech.plan.plan import Plan
from blockmech.typing import Arguments, FrictionMethod

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
    blocks, stages : what it needs
    alone : kernel calls of it alone
    saves : kernel calls that the request needs for nothing else
    """

    name: str
    blocks: tuple[str, ...]
    stages: tuple[str, ...]
    alone: int
    saves: int


@declared
def explain(
    mechanism: Compiled,
    want: Iterable[str] | str = EVERYTHING,
    *,
    friction: FrictionMethod | None = None,
    static: bool = False,
) -> str:
    """The schedule of some outputs as text: their calls, and what each output adds.

    ``want``, ``friction``, ``static`` are those of a run.
    Raises `RequestError` for unknown names or settings that do not fit.

    >>> print(mech.explain("dyad.C.p"))
    2 kernel calls for 1 output
      position             2  crank, dyad
    <BLANKLINE>
    output    calls alone  saved without it  also computes
    dyad.C.p            2                 2  position of crank, dyad
    """
    settings: Arguments = {"friction": friction, "static": static}
    patterns = as_names("want", want)
    plan = mechanism.plan(patterns, **settings)
    rows = shares(mechanism, patterns, **settings)
    width = max([len(r.name) for r in rows] + [len("output")])
    lines = [f"{'output':<{width}}  calls alone  saved without it  also computes"] * bool(rows)
    for r in rows:
        contents = f"{listed(r.stages, 6)} of {listed(r.blocks, 4)}" if r.blocks else "nothing"
        lines.append(f"{r.name:<{width}}  {r.alone:>11}  {r.saves:>16}  {contents}")
    return "\n".join([plan.explain(), "", *lines])


def shares(mechanism: Compiled, want: Iterable[str] | str, **settings: Any) -> tuple[Share, ...]:
    """What each wanted output costs, the dearest first; many are told by quantity or pattern."""
    patterns = as_names("want", want)
    full_plan = mechanism.plan(patterns, **settings)
    rows = []
    for name, members in _groups(mechanism, patterns, full_plan, settings).items():
        plan = mechanism.plan(members, **settings)
        rest = tuple(n for n in full_plan.want if n not in members)
        remaining_calls = mechanism.plan(rest, **settings).calls if rest else 0
        blocks = tuple(dict.fromkeys(e.block for e in plan.entries))
        stages = tuple(dict.fromkeys(e.stage for e in plan.entries))
        rows.append(Share(name, blocks, stages, plan.calls, full_plan.calls - remaining_calls))
    return tuple(sorted(rows, key=lambda s: -s.saves))


def _groups(
    mechanism: Compiled, patterns: tuple[str, ...], plan: Plan, settings: Arguments
) -> Mapping[str, tuple[str, ...]]:
    """Outputs one by one, or by the user's patterns, or by the dearest stage they need."""
    names = plan.want
    if len(names) <= LINES:
        return {n: (n,) for n in names}
    if len(patterns) > 1:
        return {p: mechanism.outputs.match([p]) for p in patterns}
    by_quantity: dict[str, list[str]] = {}
    for name in names:
        by_quantity.setdefault(name.rpartition(".")[2], []).append(name)
    members_of: dict[str, tuple[str, ...]] = {}
    for members in by_quantity.values():
        stages = {e.stage for e in mechanism.plan(tuple(members), **settings).entries}
        family = next((family_name for stage, family_name in FAMILIES if stage in stages), "inputs")
        members_of[family] = (*members_of.get(family, ()), *members)
    return members_of
