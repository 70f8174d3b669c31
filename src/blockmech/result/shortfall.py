"""By how much a group misses closing, which way, and whether a slip of units explains it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from math import inf, isfinite
from typing import Any, TypeAlias, cast

from blockmech.blocks.contract import Block, Moving
from blockmech.blocks.modes import TwoModes
from blockmech.ground.limits import SEARCHED
from blockmech.ground.values import MILLI, Marker, Place
from blockmech.model.structure import JointRef, Structure
from blockmech.typing import Arguments, Data

Places: TypeAlias = Mapping[str, float]


def shortfall(mechanism: Any, block: str, drivers: Places, margin: float) -> str:
    """By how much a group misses closing at a place of the drivers [rad or m], in words.

    ``mechanism`` is a `Compiled`, which stands above; ``margin`` [-] is the group's there.
    """
    reason = _unreachable_distance(mechanism, block, drivers, margin)
    reason = reason or f"its margin is {margin:.4g}, 0 at a dead centre and negative beyond it"
    slip = _unit_slip(mechanism, block, drivers)
    return f"{reason}; {slip}" if slip else reason


def _unreachable_distance(mechanism: Any, block: str, drivers: Places, margin: float) -> str:
    structure: Structure = mechanism.structure
    dyad = structure.blocks[block]
    if not isinstance(dyad, TwoModes):
        return ""
    pins = [j.name for j in dyad.joints.values() if j.outer and j.kind == "R"]
    ends = [f"{structure.feeds[JointRef(block, pin)]}.p" for pin in pins]
    run = _run_at(mechanism._of_blocks, drivers, ends)
    apart = abs(complex(run[ends[0]][0]) - complex(run[ends[-1]][0]))
    description, x, low, high = dyad.reach(apart, margin)
    if not isfinite(x) or low <= x <= high:
        return ""
    names = [mechanism._joint_names.get(f"{block}.{pin}", pin) for pin in pins]
    reach = f"at least {low:.6g} m" if high == inf else f"at most {high:.6g} m"
    reach = f"{low:.6g} to {high:.6g} m" if low > 0 and high < inf else reach
    by, direction = (x - high, "large") if x > high else (low - x, "small")
    length = f"{description.format(*names)} is {x:.6g} m"
    return f"{length}, {by:.4g} m too {direction}: its lengths allow {reach}"


def _run_at(mechanism: Any, drivers: Places, want: list[str]) -> Any:
    still = dict.fromkeys(drivers, 0.0)
    return mechanism.run(at=drivers, rates=still, want=want, friction="none", on_gap="mark")


def _unit_slip(mechanism: Any, block: str, drivers: Places) -> str:
    """The one length, or lengths of one block, that let the group close in mm or m instead.

    A slip shows in that the lengths of a mechanism are more alike without it. Groups that are
    followed from a home are as they are: their homes are lengths as well.
    """
    structure: Structure = mechanism.structure
    above = {n: b for n, b in structure.blocks.items() if n in structure.ancestors(block)}
    blocks: dict[str, Block] = {structure.frame: structure.fixed, **above}
    ranges = {name: _range(b) for name, b in blocks.items()}
    spread, tried = _spread(ranges), []
    for name, original in blocks.items():
        if not (isinstance(original, Moving) and original.own_form):
            for factor, times in MILLI.items():
                for lengths, scaled in _scaled(original, factor):
                    slip = f"{mechanism._block_name(name)}{lengths} {times}"
                    tried.append((_spread({**ranges, name: _range(scaled)}), slip, name, scaled))
    alike = sorted((x for x in tried if x[0] < spread), key=lambda x: x[0])
    followed = any(b.own_form for b in above.values())  # which takes longer
    for _, lengths, name, scaled in alike[: 1 if followed else SEARCHED]:
        if name == structure.frame:
            changed = replace(structure, fixed=scaled)
        else:
            changed = replace(structure, blocks={**structure.blocks, name: cast(Moving, scaled)})
        variant = type(mechanism)(changed, mechanism._of_blocks.scene, mechanism.name)
        if float(_run_at(variant, drivers, [f"{block}.margin"])[f"{block}.margin"][0]) > 0:
            return f"it would close with {lengths}: is that in mm? Lengths are in m"
    return ""


def _scaled(block: Block, factor: float) -> Iterator[tuple[str, Block]]:
    """A block with one of its lengths by a factor, and with all, its markers among them."""
    lengths = _lengths(block)
    for name, x in lengths.items() if len(lengths) > 1 else ():
        yield f".{name}", block.model_copy(update={name: factor * x})
    update: Arguments = {name: factor * x for name, x in lengths.items()}
    if isinstance(block, Moving):
        links = block.links.items()
        update["links"] = {k: link.model_copy(update=_markers(link, factor)) for k, link in links}
    else:
        update |= _markers(block, factor)
    names = " and ".join(lengths) or "markers"
    yield f".{names}", block.model_copy(update=update)


def _lengths(block: Block) -> dict[str, float]:
    names = block.lengths if isinstance(block, Moving) else ()
    return {name: x for name in names if (x := getattr(block, name))}


def _markers(owner: Any, factor: float) -> Data:
    markers = owner.markers.items()
    return {"markers": {k: m.model_copy(update={"at": Place(factor * m.at.z)}) for k, m in markers}}


def _range(block: Block) -> tuple[float, float]:
    """The smallest length [m] of a block and its markers that is not zero, and the largest."""
    placed = [abs(m.at.z) for _, m in block.all_markers.values() if isinstance(m, Marker)]
    sizes = [x for x in (*map(abs, _lengths(block).values()), *placed) if x]
    return min(sizes, default=inf), max(sizes, default=0.0)


def _spread(ranges: Mapping[str, tuple[float, float]]) -> float:
    """The largest length of some blocks by the smallest."""
    smallest, largest = zip(*ranges.values(), strict=True)
    return float(max(largest) / min(smallest))
