"""Why links, pairs and drivers do not make a determinate mechanism, reason by reason.

The structure is judged by its generic rank twice, without its drivers and with them held
(`rigidity`): what is held too often, which drivers are too many, locked or at odds, and what
still moves.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass

import networkx as nx

from blockmech.model.rigidity import Pair, check_names, rigidity


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


def diagnose(
    links: Iterable[str],
    pairs: Iterable[Pair],
    earlier: Collection[str],
    drivers: Collection[str] = (),
    work: int | None = None,
) -> tuple[Finding, ...]:
    """Why links, pairs and drivers do not make a determinate mechanism.

    Parameters as of `rigidity`. No finding: every link is placed by the drivers, none
    twice. Over-constrained links are those of the structure without drivers; a driver
    whose pair cannot move there is locked, and its finding names the links that hold it.
    """
    moving, ordered = set(links) - set(earlier), sorted(pairs, key=lambda p: p.name)
    check_names(sorted(moving), ordered, earlier, drivers)
    away = _unconnected(moving, ordered, earlier)
    at_hand = [p for p in ordered if not away.intersection(p.links)]
    driven = {p.name: p for p in at_hand if p.name in drivers}
    undriven = rigidity(moving - away, at_hand, earlier, (), work)
    held = rigidity(moving - away, at_hand, earlier, driven, work)
    found: list[Finding] = []

    def say(code: str, links: Iterable[str], pairs: Iterable[str], number: int, text: str) -> None:
        names = tuple(sorted(links))
        words = {"links": ", ".join(names), "pairs": ", ".join(pairs), "number": number}
        words |= {"times": "once" if number == 1 else f"{number} times", "s": "s" * (number > 1)}
        found.append(Finding(code, names, tuple(pairs), number, text.format(**words)))

    if away:
        say("unconnected-links", away, (), len(away), "no pair joins {links} to the rest")
    for o in undriven.overconstrained:
        if o.turning_only:
            text = "{links} are joined in a loop by P pairs alone ({pairs}), which hold their"
            text += " relative turning {times} too often"
            say("turning-held-twice", o.links, o.pairs, o.excess, text)
        else:
            text = "{links} are over-constrained: their pairs {pairs} hold them {times} too often"
            say("over-constrained", o.links, o.pairs, o.excess, text)
    missing = undriven.mobility - len(driven)
    count = f"mobility {undriven.mobility}, drivers {len(driven)}: {{number}} driver{{s}} too "
    if missing < 0:
        say("too-many-drivers", (), sorted(driven), -missing, count + "many")
    elif missing > 0:
        say("too-few-drivers", (), sorted(driven), missing, count + "few")
    body = {a: part for part in undriven.clusters for a in part}
    for o in held.overconstrained:
        locked = [
            d for d in o.drivers if body.get(driven[d].first, ()) == body.get(driven[d].second)
        ]
        fighting = [d for d in o.drivers if d not in locked]
        for d in locked:
            say("locked-driver", o.links, (d,), 1, "driver {pairs} moves nothing: {links} lock it")
        if fighting:
            independent = (
                undriven.mobility
                - rigidity(moving - away, at_hand, earlier, fighting, work).mobility
            )
            excess = len(fighting) - independent
            text = "drivers {pairs} prescribe the motion of {links} {times} too often"
            say("conflicting-drivers", o.links, fighting, excess, text)
    for loose in held.loose:
        text = "{links} can still move with every driver held: {number} freedom{s}"
        say("loose-links", loose.links, (), loose.freedom, text)
    return tuple(found)


def _unconnected(moving: set[str], pairs: Iterable[Pair], earlier: Collection[str]) -> set[str]:
    """Links that no chain of pairs joins to the earlier ones."""
    graph: nx.Graph[str] = nx.Graph()
    graph.add_nodes_from([*moving, *earlier])
    graph.add_edges_from(pair.links for pair in pairs)
    nx.add_path(graph, earlier)
    reached = nx.node_connected_component(graph, next(iter(earlier))) if earlier else set()
    return moving - reached
