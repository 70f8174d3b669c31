"""Where earlier links hold a group, as a function of the drivers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, TypeAlias

from blockmech.model.structure import JointRef
from blockmech.modes.triad import Support
from blockmech.typing import Guide

if TYPE_CHECKING:
    from blockmech.compiled import Compiled

Supports: TypeAlias = Callable[[Mapping[str, float]], tuple[Support, ...]]
"""Driver of the graph -> coordinate [rad or m], to the supports; NaN where they are not placed."""


def supports_of(mechanism: Compiled, group: str, joints: Sequence[str]) -> Supports:
    """The supports of some outer joints of a group.

    ``mechanism`` is one of a graph (`Compiled.of_blocks`). Earlier groups stand as the file says.
    """
    structure = mechanism.structure
    feeds = [structure.feeds[JointRef(group, joint)] for joint in joints]
    guided = [structure.joint(JointRef(group, joint)).reads == "guide" for joint in joints]
    turning = [
        f"{feed.on}.angle" if guide and feed.on != structure.frame_link else ""
        for feed, guide in zip(feeds, guided, strict=True)
    ]
    want = {f"{feed}.p" for feed in feeds}.union(filter(None, turning))
    plan = mechanism.plan(tuple(sorted(want)))
    place = {name: plan.layout[name][0] for name in want}
    number = {f"q_{i}": d for i, d in enumerate(mechanism.drivers)}
    inputs = [number[name] for name in plan.program.inputs]
    engine = mechanism._engine(plan, "scalar", "")

    def supports(drivers: Mapping[str, float]) -> tuple[Support, ...]:
        values = engine.one([float(drivers[d]) for d in inputs])
        found: list[Support] = []
        for feed, guide, turned in zip(feeds, guided, turning, strict=True):
            p = complex(values[place[f"{feed}.p"]])
            # The program holds an angle as the unit vector that it belongs to.
            e = complex(values[place[turned]]) if turned else 1 + 0j
            direction: complex = getattr(structure.marker(feed), "direction", 1 + 0j)
            found.append(Guide(p, e * direction) if guide else p)
        return tuple(found)

    return supports
