"""Why links, pairs and drivers do not make a determinate mechanism, reason by reason.

The structure is judged by its generic rank twice, without its drivers and with them held
(`rigidity`): what is held too often, which drivers are too many, locked or at odds, and what
still moves.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass

import networkx as nx

from blockmech.assur.groups import Pair, sorted_parts
from blockmech.assur.rigidity import rigidity
from blockmech.ground.errors import listed

TEXTS: Mapping[str, str] = {
    "unconnected-links": "no {pair} leads from {links} to {rest}",
    "over-constrained": "{links} are over-constrained: their {pair}s {pairs} hold them {times} "
    "too often{so}",
    "turning-held-twice": "{links} are joined in a loop by sliding {pair}s alone ({pairs}), which "
    "hold their relative turning {times} too often{so}",
    "too-many-drivers": "mobility {mobility}, drivers {held} ({drivers}): {number} too many",
    "too-few-drivers": "mobility {mobility}, drivers {held}: {number} driver{s} too few",
    "locked-driver": "{drivers} moves nothing: {pairs} cannot move, {links} form a rigid "
    "structure{state}",
    "conflicting-drivers": "{drivers} prescribe the motion of {links} {times} too often{state}",
    "loose-links": "{links} can still move with every driver held: {number} degree{s} of "
    "freedom{state}",
}
"""Every reason why a structure cannot work, in a sentence."""


@dataclass(frozen=True)
class Finding:
    """One reason why a structure cannot work, as data.

    Attributes
    ----------
    code : one of `TEXTS`
    links, pairs : what it is about, by name, sorted; of wrong numbers of drivers the driven pairs
    number : redundant conditions, drivers too many or too few, or degrees of freedom left
    """

    code: str
    links: tuple[str, ...]
    pairs: tuple[str, ...]
    number: int

    def text(self, drivers: Mapping[str, str] | None = None, **phrases: str) -> str:
        """The reason in a sentence; ``drivers`` gives driven pairs other names.

        ``more`` replaces words: "pair", "rest" (what carries the links), and what follows: "so",
        "state".
        """
        names = [(drivers or {}).get(p, p) for p in self.pairs if drivers is None or p in drivers]
        freedoms, many = len(self.pairs), self.number > 1
        fewer = self.code == "too-many-drivers"
        values = {
            "links": listed(self.links),
            "pairs": listed(self.pairs),
            "drivers": listed(names),
            "number": self.number,
            "held": freedoms,
            "mobility": freedoms - self.number if fewer else freedoms + self.number,
            "times": f"{self.number} times" if many else "once",
            "s": "s" * many,
        }
        usual = {"pair": "pair", "rest": "the rest", "so": "", "state": ""}
        return TEXTS[self.code].format(**usual | values | phrases)


def _finding(
    code: str, number: int, links: Iterable[str] = (), pairs: Iterable[str] = ()
) -> Finding:
    return Finding(code, tuple(sorted(links)), tuple(sorted(pairs)), number)


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
    connected = [a for a in moving if a not in away]
    at_hand = [p for p in ordered if not away.intersection(p.links)]
    driven = {p.name: p for p in at_hand if p.name in drivers}
    undriven = rigidity(connected, at_hand, earlier)
    with_drivers = rigidity(connected, at_hand, earlier, driven)
    findings: list[Finding] = []
    if away:
        findings.append(_finding("unconnected-links", len(away), away))
    for o in undriven.overconstrained:
        code = "turning-held-twice" if o.turning_only else "over-constrained"
        findings.append(_finding(code, o.excess, o.links, o.pairs))
    missing = undriven.mobility - len(driven)
    if missing:
        code = "too-few-drivers" if missing > 0 else "too-many-drivers"
        findings.append(_finding(code, abs(missing), (), driven))
    body = {a: part for part in undriven.clusters for a in part}
    for o in with_drivers.overconstrained:
        locked = {
            d for d in o.drivers if body.get(driven[d].first) == body.get(driven[d].second, ())
        }
        findings += [_finding("locked-driver", 1, o.links, [d]) for d in sorted(locked)]
        fighting = set(o.drivers) - locked
        if fighting:
            mobility = rigidity(connected, at_hand, earlier, fighting).mobility
            excess = len(fighting) - (undriven.mobility - mobility)
            findings.append(_finding("conflicting-drivers", excess, o.links, fighting))
    findings += [_finding("loose-links", part.freedom, part.links) for part in with_drivers.loose]
    return tuple(findings)


def _unconnected(moving: list[str], pairs: Iterable[Pair], earlier: Collection[str]) -> set[str]:
    """Links that no chain of pairs joins to the earlier ones."""
    graph: nx.Graph[str] = nx.Graph()
    graph.add_nodes_from([*moving, *earlier])
    graph.add_edges_from(pair.links for pair in pairs)
    nx.add_path(graph, earlier)
    reached = nx.node_connected_component(graph, next(iter(earlier))) if earlier else set()
    return set(moving) - reached
