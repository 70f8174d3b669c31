r"""All kinematic chains of a number of links, up to isomorphism.

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
from typing import TypeAlias

import networkx as nx
import numpy as np

from blockmech.ground.errors import refused
from blockmech.typing import Array

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
