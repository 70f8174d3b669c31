"""Why links, pairs and drivers do not make a determinate mechanism, reason by reason.

The structure is judged by its generic rank twice, without its drivers and with them held
(`rigidity`): what is held too often, which drivers are too many, locked or at odds, and what
still moves.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass

import networkx as nx

from blockmech.assur.pairs import Pair, sorted_parts
from blockmech.assur.rigidity import rigidity


@dataclass(frozen=True)
class Finding:
    """One reason why a structure cannot work, as data.

    Attributes
    ----------
    code : "unconnected-links", "over-constrained", "turning-held-twice", "too-many-drivers",
        "too-few-drivers", "locked-driver", "conflicting-drivers" or "loose-links"
    links, pairs : what it is about, by name, sorted
    number : redundant conditions, drivers too many or too few, or freedoms left
    text : the same as a sentence
    """

    code: str
    links: tuple[str, ...]
    pairs: tuple[str, ...]
    number: int
    text: str


def _finding(
    code: str, text: str, number: int, links: Iterable[str] = (), pairs: Iterable[str] = ()
) -> Finding:
    names, joints = tuple(sorted(links)), tuple(sorted(pairs))
    words = {"links": ", ".join(names), "pairs": ", ".join(joints), "number": number}
    words |= {"times": "once" if number == 1 else f"{number} times", "s": "s" * (number > 1)}
    return Finding(code, names, joints, number, text.format(**words))


def diagnose(
    links: Iterable[str],
    pairs: Iterable[Pair],
    earlier: Collection[str],
    drivers: Collection[str] = (),
) -> tuple[Finding, ...]:
    """Why links, pairs and drivers do not make a determinate mechanism.

    Parameters as of `rigidity`. No finding: every link is placed by the drivers, none
    twice. Over-constrained links are those of the structure without drivers; a driver
    whose pair cannot move there is locked, and its finding names the links that hold it.
    """
    moving, ordered = sorted_parts(links, pairs, earlier, drivers)
    away = _unconnected(moving, ordered, earlier)
    near = [a for a in moving if a not in away]
    at_hand = [p for p in ordered if not away.intersection(p.links)]
    driven = {p.name: p for p in at_hand if p.name in drivers}
    undriven = rigidity(near, at_hand, earlier)
    held = rigidity(near, at_hand, earlier, driven)
    found: list[Finding] = []
    if away:
        text = "no pair joins {links} to the rest"
        found.append(_finding("unconnected-links", text, len(away), away))
    for o in undriven.overconstrained:
        if o.turning_only:
            code, text = "turning-held-twice", "{links} are joined in a loop by P pairs alone "
            text += "({pairs}), which hold their relative turning {times} too often"
        else:
            code, text = "over-constrained", "{links} are over-constrained: their pairs {pairs} "
            text += "hold them {times} too often"
        found.append(_finding(code, text, o.excess, o.links, o.pairs))
    missing = undriven.mobility - len(driven)
    count = f"mobility {undriven.mobility}, drivers {len(driven)}: {{number}} driver{{s}} too "
    if missing < 0:
        found.append(_finding("too-many-drivers", count + "many", -missing, (), driven))
    elif missing > 0:
        found.append(_finding("too-few-drivers", count + "few", missing, (), driven))
    body = {a: part for part in undriven.clusters for a in part}
    for o in held.overconstrained:
        locked = {
            d for d in o.drivers if body.get(driven[d].first) == body.get(driven[d].second, ())
        }
        text = "driver {pairs} moves nothing: {links} lock it"
        found += [_finding("locked-driver", text, 1, o.links, [d]) for d in sorted(locked)]
        fighting = set(o.drivers) - locked
        if fighting:
            left = rigidity(near, at_hand, earlier, fighting).mobility
            excess = len(fighting) - (undriven.mobility - left)
            text = "drivers {pairs} prescribe the motion of {links} {times} too often"
            found.append(_finding("conflicting-drivers", text, excess, o.links, fighting))
    text = "{links} can still move with every driver held: {number} freedom{s}"
    found += [_finding("loose-links", text, part.freedom, part.links) for part in held.loose]
    return tuple(found)


def _unconnected(moving: list[str], pairs: Iterable[Pair], earlier: Collection[str]) -> set[str]:
    """Links that no chain of pairs joins to the earlier ones."""
    graph: nx.Graph[str] = nx.Graph()
    graph.add_nodes_from([*moving, *earlier])
    graph.add_edges_from(pair.links for pair in pairs)
    nx.add_path(graph, earlier)
    reached = nx.node_connected_component(graph, next(iter(earlier))) if earlier else set()
    return set(moving) - reached
