r"""Structures of linkages: what there is to choose from before any dimension is chosen.

The kinematic chains of 4, 6, ... links up to isomorphism, each with every frame, crank and
tracing link that its symmetries leave different, as far as their formation sequence is a crank
and dyads, all of which the tracing link needs. Each becomes a graph whose numbers are open.

Source: Mruthyunjaya, Mechanism and Machine Theory 38 (2003) (chains).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from blockmech.assur.chains import Chain, chains, mechanisms
from blockmech.assur.formation import formation
from blockmech.assur.groups import Pair
from blockmech.builders import Graph, Linkage
from blockmech.model.versions import VERSION
from blockmech.typing import Data


class Structure(NamedTuple):
    """A linkage without lengths: a chain, its frame, crank and tracing link.

    chain : networkx graph, vertices 0, 1, ... are links, edges revolute pairs
    frame, crank, tracer : three of its links
    dyads : the dyads in formation order, links (i, j) each

    >>> [(s.frame, s.crank) for s in bm.synthesis.structures(4)]
    [(0, 1)]
    """

    chain: Chain
    frame: int
    crank: int
    tracer: int
    dyads: tuple[tuple[int, int], ...]

    @property
    def links(self) -> int:
        """Number of links."""
        return int(self.chain.number_of_nodes())

    @property
    def name(self) -> str:
        """The neighbours of each link, then frame, crank and tracer."""
        joined = "".join(f"-{a}{b}" for a, b in sorted(tuple(sorted(e)) for e in self.chain.edges))
        return f"{self.links}bar{joined}-f{self.frame}c{self.crank}t{self.tracer}"


def structures(links: int) -> tuple[Structure, ...]:
    """All linkages of a number of links whose groups are a crank and dyads, up to isomorphism.

    The tracing link is one that turns about no pin of the frame, and needs all the dyads.

    Raises `RequestError` for a number of links that has no chains.

    >>> [len(structures(n)) for n in (4, 6)]
    [1, 8]
    """
    import networkx as nx

    known: list[Structure] = []
    for chain in chains(links):
        for frame, crank in mechanisms(chain):
            seen: list[Any] = []
            for tracer in sorted(set(chain) - {frame, crank} - set(chain[frame])):
                dyads = _dyads(chain, frame, crank, tracer)
                roles = chain.copy()
                nx.set_node_attributes(roles, dict.fromkeys(roles, ""), "role")
                for v, role in ((frame, "frame"), (crank, "crank"), (tracer, "tracer")):
                    roles.nodes[v]["role"] = role
                if dyads and not any(
                    nx.is_isomorphic(roles, other, lambda a, b: a["role"] == b["role"])
                    for other in seen
                ):
                    seen.append(roles)
                    known.append(Structure(chain, frame, crank, tracer, dyads))
    return tuple(known)


def _dyads(chain: Chain, frame: int, crank: int, tracer: int) -> tuple[tuple[int, int], ...]:
    """The dyads in formation order; () unless there are dyads alone, and the tracer needs all."""
    name = {v: f"{v:02d}" for v in chain}
    pairs = [Pair(f"{name[a]}-{name[b]}", name[a], name[b]) for a, b in
             (sorted(e) for e in chain.edges)]  # fmt: skip
    motor = "-".join(name[v] for v in sorted((frame, crank)))
    made = formation(name.values(), pairs, {name[frame]}, {motor})
    if not made.complete or any(u.kind != "RRR" for u in made.units[1:]):
        return ()
    dyads = [(int(u.links[0]), int(u.links[1])) for u in made.units[1:]]
    needed, left = {tracer}, []
    for i, j in reversed(dyads):
        if needed & {i, j}:
            needed |= set(chain[i]) | set(chain[j])
            left.append((i, j))
    return tuple(dyads) if len(left) == len(dyads) else ()


def blank(structure: Structure, seed: int = 0) -> Graph:
    """The graph of a structure with joints at random points; ``P`` marks the tracing point."""
    rng = np.random.default_rng(seed)
    s, points = structure, {}
    name = {v: "frame" if v == s.frame else f"link{v}" for v in s.chain}
    joints: Data = {}
    for a, b in (sorted(e) for e in s.chain.edges):
        points[a, b] = rng.normal(size=2).tolist()
        joints[f"J{a}_{b}"] = {"type": "R", "links": [name[a], name[b]], "at": [points[a, b]] * 2}
    links: Data = {name[v]: {"pose": [0.0, 0.0, 0.0]} for v in s.chain if v != s.frame}
    links[name[s.tracer]]["markers"] = {"P": {"at": rng.normal(size=2).tolist()}}
    motor = "J{}_{}".format(*sorted((s.frame, s.crank)))
    drivers = {"crank": {"joint": motor, "law": "constant_rate", "rate": 1.0}}
    data = Linkage.from_data(
        {"format": "blockmech/joints", "version": VERSION, "name": s.name, "links": links,
         "joints": joints, "drivers": drivers}
    ).decompose().data  # fmt: skip
    for block in data["blocks"].values():
        for owner in (block, *block.get("links", {}).values()):
            owner["markers"] = {
                m: {"at": x["at"]} for m, x in owner.get("markers", {}).items() if m[0] in "JP"
            }
            if not owner["markers"]:
                del owner["markers"]
    return Graph.from_data(data)
