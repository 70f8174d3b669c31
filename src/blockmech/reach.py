"""By how much a group misses closing, which way, and whether a slip of units explains it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from math import inf, isfinite
from typing import Any, TypeAlias, cast

from blockmech.blocks.contract import Block, Moving
from blockmech.blocks.modes import TwoModes
from blockmech.model.structure import JointRef, LinkRef, Structure
from blockmech.values import MILLI, Place

Places: TypeAlias = Mapping[str, float]
Scaled: TypeAlias = tuple[str, str, Block]  # what it is, its block, the block with it scaled
MOST_TRIED = 8  # slips of units, the likeliest first; a millisecond or two each


def shortfall(mechanism: Any, block: str, drivers: Places, margin: float) -> str:
    """By how much a group misses closing at a place of the drivers [rad or m], in words.

    ``mechanism`` is a `Compiled`, which stands above; ``margin`` [-] is the group's there.
    """
    found = _missed(mechanism, block, drivers, margin)
    found = found or f"its margin is {margin:.4g}, 0 at a dead centre and negative beyond it"
    slip = _slip(mechanism, block, drivers)
    return f"{found}; {slip}" if slip else found


def _missed(mechanism: Any, block: str, drivers: Places, margin: float) -> str:
    structure: Structure = mechanism.structure
    dyad = structure.blocks[block]
    if not isinstance(dyad, TwoModes):
        return ""
    pins = [j.name for j in dyad.joints.values() if j.outer and j.kind == "R"]
    ends = [f"{structure.feeds[JointRef(block, pin)]}.p" for pin in pins]
    run = _at(mechanism.of_blocks, drivers, ends)
    apart = abs(complex(run[ends[0]][0]) - complex(run[ends[-1]][0]))
    what, x, low, high = dyad.reach(apart, margin)
    if not isfinite(x) or low <= x <= high:
        return ""
    said = [mechanism.joint_names.get(f"{block}.{pin}", pin) for pin in pins]
    reach = f"at least {low:.6g} m" if high == inf else f"at most {high:.6g} m"
    reach = f"{low:.6g} to {high:.6g} m" if low > 0 and high < inf else reach
    by, way = (x - high, "large") if x > high else (low - x, "small")
    return f"{what.format(*said)} is {x:.6g} m, {by:.4g} m too {way}: its lengths allow {reach}"


def _at(mechanism: Any, drivers: Places, want: list[str]) -> Any:
    still = dict.fromkeys(drivers, 0.0)
    return mechanism.run(at=drivers, rates=still, want=want, friction="none", on_gap="mark")


def _slip(mechanism: Any, block: str, drivers: Places) -> str:
    """The one length, or lengths of one block, that let the group close in mm or m instead.

    A slip shows in that the lengths of a mechanism are more alike without it.
    """
    structure: Structure = mechanism.structure
    above = structure.ancestors(block)
    blocks = {n: b for n, b in structure.blocks.items() if n in above}
    everything: dict[str, Block] = {structure.frame: structure.fixed, **blocks}
    tried = []
    for factor in MILLI:
        for what, name, other in _scaled(mechanism, everything, factor):
            spread = _spread({**everything, name: other})
            if spread < _spread(everything):
                tried.append((spread, what, factor, name, other))
    followed = any(b.own_form for b in blocks.values())  # from home, which takes longer
    for _, what, factor, name, other in sorted(tried, key=lambda x: x[0])[
        : 1 if followed else MOST_TRIED
    ]:
        if name == structure.frame:
            made = replace(structure, fixed=other)
        else:
            made = replace(structure, blocks={**structure.blocks, name: cast(Moving, other)})
        blocks_only = type(mechanism)(made, mechanism.of_blocks.scene, mechanism.name)
        if float(_at(blocks_only, drivers, [f"{block}.margin"])[f"{block}.margin"][0]) > 0:
            return f"it would close with {what} {MILLI[factor]}: is that in mm? Lengths are in m"
    return ""


def _scaled(mechanism: Any, blocks: Mapping[str, Block], factor: float) -> Iterator[Scaled]:
    """Each length of each block by a factor, and all of a block together."""
    for name, block in blocks.items():
        if isinstance(block, Moving) and block.own_form:
            continue  # its home holds lengths as well
        own = _lengths(block)
        for length in own if len(own) > 1 else ():
            link = length.rpartition("_")[2]
            what = _called(mechanism, name, length, link if link in block.link_names else "")
            yield what, name, block.model_copy(update={length: factor * own[length]})
        what = _called(mechanism, name, " and ".join(own)) if own else f"the markers of {name}"
        yield what, name, _whole(block, own, factor)


def _called(mechanism: Any, name: str, lengths: str, link: str = "") -> str:
    """Lengths of a block as its file calls them."""
    if mechanism.names is None:
        return f"{name}.{lengths}"
    for said, where in mechanism.names.links.items():
        if link and where.link == LinkRef(name, link):
            return f"the lengths of {said}"
    return f"the lengths of {mechanism.said(name)}"


def _lengths(block: Block) -> dict[str, float]:
    names = block.lengths if isinstance(block, Moving) else ()
    return {name: x for name in names if (x := getattr(block, name))}


def _whole(block: Block, own: Mapping[str, float], factor: float) -> Block:
    """A block with its lengths and the markers of its links by a factor."""
    update: dict[str, Any] = {name: factor * x for name, x in own.items()}
    if isinstance(block, Moving):
        links = block.links.items()
        update["links"] = {k: link.model_copy(update=_moved(link, factor)) for k, link in links}
    else:
        update |= _moved(block, factor)
    return block.model_copy(update=update)


def _moved(owner: Any, factor: float) -> dict[str, Any]:
    markers = owner.markers.items()
    return {"markers": {k: m.model_copy(update={"at": Place(factor * m.at.z)}) for k, m in markers}}


def _spread(blocks: Mapping[str, Block]) -> float:
    """The largest length of some blocks and markers by the smallest that is none of zero."""
    sizes = [abs(x) for block in blocks.values() for x in _lengths(block).values()]
    for block in blocks.values():
        placed = [m for _, m in block.all_markers.values() if hasattr(m, "at")]
        sizes += [abs(m.at.z) for m in placed if isinstance(m.at, Place) and m.at.z]
    return max(sizes, default=1.0) / min(sizes, default=1.0)
