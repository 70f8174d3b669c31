"""Structures of linkages: what there is to choose from before any dimension is chosen.

The kinematic chains of 4, 6, ... links up to isomorphism, each with every frame, crank and
tracing link that its symmetries leave different, as far as their formation sequence is a crank
and dyads, all of which the tracing link needs. Each becomes a graph whose numbers are open.

A chain of n links and mobility 1 has (3n - 4)/2 joints; as a graph, links are vertices and joints
edges. No part of it may be rigid: every k of its links carry at most (3k - 4)/2 joints. Such
graphs are connected twice over, so each is a loop with ears, paths between two links that are
there already. They are grown ear by ear, with the rule of the parts kept, and what is alike is
kept once (networkx).

Sources: Whitney 1932 (ears); Mruthyunjaya, Kinematic structure of mechanisms revisited, Mechanism
and Machine Theory 38 (2003): 1, 2, 16, 230 chains of 4, 6, 8, 10 links.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple, TypeAlias

import networkx as nx
import numpy as np

from blockmech.assur.formation import formation
from blockmech.assur.groups import Pair
from blockmech.builders import Graph, Linkage
from blockmech.ground.errors import refused
from blockmech.model.versions import VERSION
from blockmech.typing import Array, Data

Chain: TypeAlias = "nx.Graph[int]"
MOST = 10  # links: of 12 there are 6,856 chains, which take hours


def chains(links: int) -> tuple[Chain, ...]:
    """All kinematic chains of a number of links with mobility 1, up to isomorphism.

    Parameters
    ----------
    links : even, 4 to 10; there are 1, 2, 16, 230

    Returns
    -------
    networkx graphs: vertices 0 .. links - 1 are links, edges are revolute pairs

    Raises `RequestError` for another number of links.

    >>> len(chains(6))  # Watt's and Stephenson's
    2
    """
    if links not in range(4, MOST + 1, 2):
        raise refused("links", f"got {links!r}", f"give an even number from 4 to {MOST}")
    loops = (links - 2) // 2
    level = [nx.cycle_graph(k) for k in range(4, links + 1)]
    for loop in range(1, loops):
        last = loop == loops - 1
        grown: dict[bytes, list[Chain]] = {}
        for chain in level:
            for extended in _with_ear(chain, links, last):
                bucket = grown.setdefault(_key(extended), [])
                if not any(nx.is_isomorphic(extended, isomorph) for isomorph in bucket):
                    bucket.append(extended)
        level = [chain for bucket in grown.values() for chain in bucket]
    complete = [chain for chain in level if chain.number_of_nodes() == links]
    return tuple(sorted(complete, key=lambda c: sorted(d for _, d in c.degree())))


def mechanisms(chain: Chain) -> tuple[tuple[int, int], ...]:
    """The inversions of a chain: its fixed link, and a driven link joined to that.

    Pairs (frame, driver), one for each class under the symmetries of the chain.

    >>> chain = next(iter(bm.synthesis.chains(4)))
    >>> bm.synthesis.mechanisms(chain)
    ((0, 1),)
    """
    symmetries = [*nx.isomorphism.GraphMatcher(chain, chain).isomorphisms_iter()]
    equivalent: set[tuple[int, int]] = set()
    choices = []
    for a, b in sorted((u, v) for e in chain.edges for u, v in (e, e[::-1])):
        if (a, b) not in equivalent:
            choices.append((a, b))
            equivalent |= {(s[a], s[b]) for s in symmetries}
    return tuple(choices)


def _with_ear(chain: Chain, links: int, last: bool) -> Iterator[Chain]:
    """The chain with one more ear: k new links between two that it has, no part of it rigid."""
    n = chain.number_of_nodes()
    free, has = _freedom(chain)
    for u in range(n):
        for w in range(u + 1, n):
            both = has[u] & has[w]
            fewest = 6 - int(free[both].min())  # new links that leave every part movable
            first = max(fewest, 1 if chain.has_edge(u, w) else 0)
            ears = [links - n] if last else range(first, links - n + 1)
            for k in ears:
                if k >= first:
                    extended = chain.copy()
                    nx.add_path(extended, [u, *range(n, n + k), w])
                    yield extended


def _freedom(chain: Chain) -> tuple[Array, Array]:
    """3 links - 2 joints of every part of a chain, and whether (n, parts) it has a link."""
    n = chain.number_of_nodes()
    parts = np.arange(1 << n)
    has = np.array([(parts >> i) & 1 for i in range(n)], bool)
    joints = sum((has[a] & has[b]).astype(int) for a, b in chain.edges)
    return 3 * has.sum(axis=0) - 2 * joints, has


def _key(chain: Chain) -> bytes:
    """A number that is the same for chains that are alike: counts of walks, sorted."""
    A = nx.to_numpy_array(chain, dtype=np.int64, nodelist=sorted(chain))
    walks = np.linalg.matrix_power(A, 4) + 7 * np.linalg.matrix_power(A, 5)
    rows = np.sort(walks, axis=1)
    return bytes(rows[np.lexsort(rows.T)].tobytes())


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
