"""The structural graph: a vertex for each group, with its links and the degrees of freedom it adds.

A vertex ``2,0 (5,6)`` is a module of two links, 5 and 6, that adds none: an Assur group.
An edge is where one group hangs on another, by the pairs written at it.

Source: [D14] Durango et al. 2014, section 3.3, graph (7).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from blockmech.compiled import Compiled
from blockmech.figures.palette import DRIVER_FILL, FRAME_FILL, GREY, GROUP_FILL, INK, SMALL, TEXT
from blockmech.figures.paper import arrow, new_page, shown_name, styled
from blockmech.model.structure import LinkRef
from blockmech.typing import Arguments

if TYPE_CHECKING:
    import networkx as nx
    from matplotlib.axes import Axes

COLUMN, ROW = 13 * TEXT, 7 * TEXT  # [pt] from vertex to vertex
BEND = 0.25  # of an edge that passes others, in its length
SIZE = 5.5 * TEXT, 3.2 * TEXT  # [pt] of a vertex


def structural_graph(mechanism: Compiled) -> nx.DiGraph:
    """Blocks with ``links`` (their names or numbers) and ``freedoms``; edges with ``pairs``.

    What follows by a coupling adds none, and has an edge from what leads.
    """
    import networkx as nx

    s, names = mechanism.structure, mechanism.names
    called = {ref: str(number) for ref, number in s.links.items()}
    called |= names.of_links if names is not None else {}
    graph = nx.DiGraph(name=mechanism.name)
    graph.add_node(s.frame, links=(called[s.frame_link],), freedoms=0)
    for name, block in s.blocks.items():
        links = tuple(called[LinkRef(name, link)] for link in block.link_names)
        free = sum(driver not in s.followers for driver in s.drivers_of(name))
        graph.add_node(name, links=links, freedoms=free)
    for joint, marker in s.feeds.items():
        _join(graph, marker.block, joint.block, mechanism._joint_names.get(str(joint), joint.name))
    for driver, follower in s.followers.items():
        _join(graph, follower.centre.block, s.driven[driver].block, follower.coupling)
        if follower.leader is not None:
            _join(graph, follower.leader.block, s.driven[driver].block, follower.coupling)
    return graph


def _join(graph: nx.DiGraph, first: str, then: str, pair: str) -> None:
    if first == then:
        return
    if not graph.has_edge(first, then):
        graph.add_edge(first, then, pairs=())
    graph.edges[first, then]["pairs"] += (pair.removeprefix("joint."),)


def draw_structural_graph(mechanism: Compiled) -> Any:
    """A figure of the structural graph, groups in columns by what they hang on."""
    import networkx as nx
    from matplotlib.patches import Ellipse

    graph = structural_graph(mechanism)
    columns = list(nx.topological_generations(graph))
    tallest = max(map(len, columns))
    at = {
        name: (COLUMN * k, ROW * (row + (tallest - len(names)) / 2))
        for k, names in enumerate(columns)
        for row, name in enumerate(names)
    }
    lowest = max((BEND * (at[b][0] - at[a][0]) / 2 for a, b in graph.edges), default=0.0)
    width, height = COLUMN * len(columns), ROW * tallest + 4 * TEXT + lowest
    with styled():
        figure, axes = new_page(width, height, -COLUMN / 2, -ROW / 2 - 3 * TEXT)
        for first, then, pairs in graph.edges(data="pairs"):
            _edge(axes, at[first], at[then], ", ".join(pairs))
        for name, data in graph.nodes(data=True):
            x, y = at[name]
            fill = DRIVER_FILL if data["freedoms"] else GROUP_FILL
            fill = FRAME_FILL if name == mechanism.structure.frame else fill
            axes.add_patch(Ellipse((x, y), *SIZE, facecolor=fill, edgecolor=INK, zorder=2))
            of = shown_name(",".join(data["links"]), 12).replace("$", r"\$")
            axes.text(x, y, f"{len(data['links'])},{data['freedoms']}", ha="center", va="center")
            axes.text(x + SIZE[0] / 2, y - SIZE[1] / 2, f"({of})", size=SMALL, ha="center")
            below: Arguments = {"size": SMALL, "color": GREY, "ha": "center", "va": "top"}
            axes.text(x, y + SIZE[1] / 2 + 2, shown_name(name, 18), **below)
        caption = "number of links, degrees of freedom added (links); at the edges the pairs"
        axes.text(-COLUMN / 2 + TEXT, -ROW / 2 - 2 * TEXT, caption, size=SMALL, va="center")
    return figure


def _edge(axes: Axes, start: Any, end: Any, word: str) -> None:
    """An arrow from vertex to vertex; one that passes others bends below them."""
    is_long = end[0] - start[0] > COLUMN
    bend = BEND if is_long and start[1] == end[1] else 0.0
    shrink = SIZE[1] if is_long else SIZE[0] / 2
    arrow(axes, (start, end), bend, (shrink, shrink), color=INK, linewidth=0.9)
    x, y = ((a + b) / 2 for a, b in zip(start, end, strict=True))
    y += bend * (end[0] - start[0]) / 2
    below: Arguments = {"va": "top"} if bend else {"va": "bottom"}
    axes.text(x, y + (2 if bend else -3), word, size=SMALL, color=GREY, ha="center", **below)
