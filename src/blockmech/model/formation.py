"""The formation sequence: links and pairs taken apart into drivers and Assur groups.

Every pair (two conditions, a driven one three) is given to the links that it places,
three conditions a link (`pebbles`). Links that wait for each other, the strongly connected
sets, are exactly the drivers and the minimal Assur groups, whichever way the pebbles came to
lie ([S11]). Linear for chains of dyads.

Source: [S11] Sljoka, Shai & Whiteley, Checking mobility and decomposition of linkages via
pebble game algorithm, ASME IDETC 2011.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from contextlib import suppress
from dataclasses import dataclass

from blockmech.model.assur import DYADS, Unit, classify, roman
from blockmech.model.elimination import MOST_WORK, TooTangledError
from blockmech.model.pebbles import GROUND, condense, in_order, place_pebbles, waits_for
from blockmech.model.pins import carriers
from blockmech.model.rigidity import Loose, Overconstraint, Pair, check_names, rigidity


@dataclass(frozen=True)
class Formation:
    """Units in formation order, and what could not be placed.

    A unit comes as soon as the links that it waits for are there; of several, drivers
    first, then by the name of the first link.

    Attributes
    ----------
    units : drivers and groups in order
    rest : links that are not placed, sorted: over-constrained, loose, or waiting for such
    spare : pairs with a condition that no link is left to take, sorted
    """

    units: tuple[Unit, ...]
    rest: tuple[str, ...]
    spare: tuple[str, ...]

    @property
    def complete(self) -> bool:
        """Every link is placed and no pair is left over."""
        return not self.rest and not self.spare

    def __str__(self) -> str:
        return " -> ".join(map(str, self.units))


def formation(
    links: Iterable[str],
    pairs: Iterable[Pair],
    earlier: Collection[str],
    drivers: Collection[str] = (),
) -> Formation:
    """Drivers and minimal Assur groups in formation order.

    Parameters
    ----------
    links : the moving links; earlier ones among them are passed over
    pairs : the pairs between links and earlier links
    earlier : the frame and everything already placed
    drivers : names of the driven pairs; one between two links of which neither is placed
        before the other is part of a group

    Notes
    -----
    If the structure is not sound, the units are those that can be placed all the same;
    `diagnose` says what is wrong with the rest. Counting finds the groups; each is then
    checked by the rank of its own conditions, and one that is over-constrained inside
    (3n = 2p all the same) goes to the rest with everything that waits for it.
    """
    moving = sorted(set(links) - set(earlier))
    ordered = sorted(pairs, key=lambda p: p.name)
    check_names(moving, ordered, earlier, drivers)
    index = {a: k for k, a in enumerate(moving)}
    edges = [
        (index.get(p.first, GROUND), index.get(p.second, GROUND), 3 if p.name in drivers else 2)
        for p in ordered
    ]
    pebbles = place_pebbles([3] * len(moving), edges)
    unplaceable = pebbles.crowded.union(pebbles.short)
    parts, ahead = condense(waits_for(pebbles, edges, len(moving)))
    part_of = {v: n for n, part in enumerate(parts) for v in part}
    own: list[list[Pair]] = [[] for _ in parts]
    for pair, (a, b, _), (at_a, at_b) in zip(ordered, edges, pebbles.taken, strict=True):
        if at_a or at_b:  # by both: then they wait for each other and are one part
            own[part_of[a if at_a else b]].append(pair)
    units: dict[int, Unit] = {}
    for n, part in enumerate(parts):
        if not unplaceable.intersection(part):
            unit = classify([moving[v] for v in part], own[n], drivers)
            if _holds(unit):
                units[n] = unit
    rank = {n: (unit.number > 1, parts[n][0]) for n, unit in units.items()}
    order = in_order({n: ahead[n] for n in units}, rank)
    placed = {a for n in order for a in units[n].links}
    return Formation(
        units=tuple(units[n] for n in order),
        rest=tuple(a for a in moving if a not in placed),
        spare=tuple(p.name for p, n in zip(ordered, pebbles.left, strict=True) if n),
    )


@dataclass(frozen=True)
class Waiting:
    """What links that wait for each other are.

    Attributes
    ----------
    units : the groups that they are, if they can be placed: one Assur group as a rule
    overconstrained, loose : what is wrong otherwise
    text : the same as a sentence
    """

    units: tuple[Unit, ...]
    overconstrained: tuple[Overconstraint, ...]
    loose: tuple[Loose, ...]
    text: str

    @property
    def is_group(self) -> bool:
        """Whether the links are one Assur group."""
        return len(self.units) == 1


def waiting(
    links: Iterable[str],
    pairs: Iterable[Pair],
    earlier: Collection[str],
    drivers: Collection[str] = (),
    work: int | None = None,
) -> Waiting:
    """Whether links that wait for each other are an Assur group, and if not why.

    Parameters as of `rigidity`: the links of a cycle of blocks, the pairs between them
    and to earlier links (of which only those that they are wired to matter).
    """
    moving, ordered = sorted(set(links) - set(earlier)), list(pairs)
    found = formation(moving, ordered, earlier, drivers)
    names = ", ".join(moving)
    if found.complete:
        text = f"the links can be placed in the order {found}"
        if len(found.units) == 1:
            unit = found.units[0]
            text = f"{names} are one Assur group of class {roman(unit.number)}"
            text += f" with {len(unit.links)} links and {len(unit.pairs)} pairs"
        return Waiting(found.units, (), (), text)
    state = rigidity(moving, ordered, earlier, drivers, work)
    reasons = []
    for o in state.overconstrained:
        held = [p for p in ordered if p.name in o.pairs]
        aside = set() if o.drivers else carriers(held, earlier)
        reasons.append(f"over-constrained: {', '.join(a for a in o.links if a not in aside)}")
    reasons += [f"loose: {', '.join(part.links)}" for part in state.loose]
    text = f"{names} are no Assur group; {'; '.join(reasons)}"
    return Waiting((), state.overconstrained, state.loose, text)


def _holds(unit: Unit) -> bool:
    """Whether the unit's own conditions place its links, for generic lengths.

    By their rank, unless they are so many that counting must do.
    """
    if unit.kind == "driver":
        return True
    axes = [(p.kind, p.axis) for p in unit.pairs if p.axis]
    if unit.kind in DYADS and len(axes) == len(set(axes)):
        return True
    others = {a for p in unit.outer for a in p.links}.difference(unit.links)
    with suppress(TooTangledError):
        return rigidity(unit.links, unit.pairs, others, unit.driven, MOST_WORK).determinate
    return True
