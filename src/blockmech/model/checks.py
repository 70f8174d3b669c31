"""The checks of a graph, one rule each; every problem is data.

What is locally wrong is refused when it is added; `all_problems` finds the rest in
one pass, so that a user sees everything at once.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, TypeAlias

from blockmech.blocks.contract import Block, Moving
from blockmech.blocks.frame import Frame
from blockmech.blocks.general import GeneralGroup
from blockmech.blocks.general.block import SUPPORTS
from blockmech.blocks.modes import TwoModes
from blockmech.blocks.registry import REGISTRY
from blockmech.errors import Problem, close_match, listed
from blockmech.loads.contract import Element, Following
from blockmech.model.diagram import AnyBlock, UnknownBlock, Wire
from blockmech.values import Marker

if TYPE_CHECKING:
    import networkx as nx

    from blockmech.model.graph import Graph

Markers: TypeAlias = dict[str, tuple[str, Any]]
"""Markers of a block by name, each with its link."""


def all_problems(graph: Graph) -> list[Problem]:
    """Every problem of a graph."""
    problems = list(_block_problems(graph))
    fed: dict[str, Wire] = {}
    markers: dict[str, Markers] = {}
    for wire in graph.wires:
        problems += wire_problems(graph, wire, fed.get(wire.target), markers)
        fed.setdefault(wire.target, wire)
    problems += _unwired(graph)
    problems += _driver_name_problems(graph)
    problems += _scene_problems(graph)
    problems += _driver_problems(graph)
    problems += _group_problems(graph)
    problems += _branch_problems(graph)
    if not any(p.code == "unknown-block" for p in problems):
        problems += _cycles(graph)
    return problems


def remarks(graph: Graph) -> list[Problem]:
    """Unused and unreachable things of a graph: not wrong, but perhaps forgotten."""
    import networkx as nx

    dag, found = block_dag(graph), []
    frames = [n for n, b in graph.blocks.items() if isinstance(b, Frame)]
    reached = set(frames).union(*(nx.descendants(dag, n) for n in frames))
    for name, block in graph.blocks.items():
        if isinstance(block, Moving) and name not in reached:
            found.append(
                Problem("unreachable", name, "no chain of wires leads to it from the frame")
            )
    used = {w.source for w in graph.wires}
    for name in frames:
        block = graph.blocks[name]
        assert isinstance(block, Frame)
        for marker in block.markers:
            if f"{name}.{marker}" not in used:
                found.append(Problem("unused-marker", f"{name}.{marker}", "no wire starts there"))
    for name, block in graph.blocks.items():
        drives = isinstance(block, Moving) and not block.closes
        if not drives or any(u.startswith(f"{name}.") for u in used):
            continue
        assert isinstance(block, Moving)
        if not any(link.massive for link in block.links.values()):
            found.append(Problem("idle-driver", name, "it moves nothing and carries no load"))
    return found


def name_problem(graph: Graph, name: str, block: object) -> Problem | None:
    """What is wrong with adding a block under a name, if anything."""
    if not isinstance(name, str) or not name or "." in name or "/" in name:
        return Problem(
            "bad-name",
            str(name) or '""',
            "not a block name",
            'a name is not empty and has no "." or "/"',
            "choose another name",
        )
    if name in graph.blocks:
        return Problem(
            "duplicate-block",
            name,
            "the name is taken",
            f"taken: {listed(graph.blocks)}",
            "choose another name",
        )
    if not isinstance(block, Block | UnknownBlock):
        return Problem(
            "not-a-block",
            name,
            f"{type(block).__name__} is not a block",
            "",
            'call the class, e.g. add("crank", Crank(length=2.0))',
        )
    return None


def _block_problems(graph: Graph) -> Iterable[Problem]:
    frames = [n for n, b in graph.blocks.items() if isinstance(b, Frame)]
    if not frames:
        yield Problem(
            "no-frame",
            "blocks",
            "no block of type frame",
            "a mechanism has one fixed link",
            "add a frame with a marker for each pivot and guide",
        )
    for name in frames[1:]:
        yield Problem(
            "two-frames",
            name,
            f"a second frame beside {frames[0]}",
            "a mechanism has one fixed link",
            f"move its markers to {frames[0]}",
        )
    for name, block in graph.blocks.items():
        if isinstance(block, UnknownBlock):
            yield REGISTRY.unknown(block.type, name)


def wire_problems(
    graph: Graph, wire: Wire, fed: Wire | None, known: dict[str, Markers] | None = None
) -> Iterable[Problem]:
    """What is locally wrong with a wire.

    ``fed`` is an earlier wire to the same joint; ``known`` keeps the markers of each block
    from wire to wire, for a frame may have thousands.
    """
    marker = yield from _source(graph, wire, {} if known is None else known)
    yield from _target(graph, wire, marker, fed)


def _source(graph: Graph, wire: Wire, known: dict[str, Markers]) -> Any:
    block, problem = _end(graph, wire, wire.source)
    if problem:
        yield problem
    if not isinstance(block, Block):
        return None
    name = wire.source.split(".")[1]
    if isinstance(block, Element):
        yield Problem(
            "not-a-marker",
            wire.source,
            f"{block.type_name} has no markers",
            "a wire starts at a marker of a link and ends at the element",
            f"turn the wire round: {wire.target} -> {wire.source}",
        )
        return None
    owner = wire.source.split(".")[0]
    if owner not in known:
        known[owner] = block.markers_of()
    markers = known[owner]
    if name not in markers:
        yield Problem(
            "unknown-marker",
            wire.source,
            f'no marker "{name}"',
            f"markers there: {listed(markers)}",
            close_match(name, markers) or "add the marker to a link of the block",
        )
        return None
    return markers[name][1]


def _target(graph: Graph, wire: Wire, marker: Any, fed: Wire | None) -> Iterable[Problem]:
    block, problem = _end(graph, wire, wire.target)
    if problem:
        yield problem
    if not isinstance(block, Block):
        return
    name = wire.target.split(".")[1]
    if isinstance(block, Element):
        ports = list(block.terminals)
    else:
        ports = [j.name for j in block.joints.values() if j.outer]
    if name not in ports:
        inner = name in block.joints
        yield Problem(
            "unknown-joint",
            wire.target,
            "an inner joint takes no wire" if inner else f'no joint "{name}"',
            f"joints that take a wire: {listed(ports)}" if ports else "it takes no wires",
            close_match(name, ports),
        )
        return
    if fed is not None:
        yield Problem(
            "double-wire",
            wire.target,
            f"already fed by {fed.source}, cannot also take {wire.source}",
            "a joint has one source",
            f"remove one of: {fed}; {wire}",
        )
    if wire.source.split(".")[0] == wire.target.split(".")[0]:
        yield Problem(
            "self-wire",
            wire.target,
            f"fed by {wire.source} of the same block",
            "a joint is fed by an earlier block",
            "wire it to another block",
        )
    pointlike = isinstance(marker, Marker) and marker.angle is None and marker.dir is None
    if pointlike and isinstance(block, Moving) and block.joints[name].kind == "P":
        yield Problem(
            "pair-mismatch",
            wire.target,
            f"a prismatic joint needs a guide, {wire.source} is a point",
            "a guide is a marker with a direction",
            f'give {wire.source} an "angle" [rad] or a "dir" [dx, dy]',
        )


def _end(graph: Graph, wire: Wire, end: str) -> tuple[AnyBlock | None, Problem | None]:
    parts = end.split(".") if isinstance(end, str) else []
    if len(parts) != 2 or not all(parts):
        return None, Problem(
            "bad-address",
            str(end) or '""',
            f'not an address, in wire "{wire}"',
            'an address is "block.joint" or "block.marker"',
            "",
        )
    if parts[0] not in graph.blocks:
        return None, Problem(
            "no-such-block",
            end,
            f'no block "{parts[0]}"',
            f"blocks: {listed(graph.blocks)}",
            close_match(parts[0], graph.blocks) or "add the block first",
        )
    return graph.blocks[parts[0]], None


def _unwired(graph: Graph) -> Iterable[Problem]:
    fed = {w.target for w in graph.wires}
    for name, block in graph.blocks.items():
        if isinstance(block, Moving):
            ports = [j.name for j in block.joints.values() if j.outer]
        elif isinstance(block, Element):
            ports = list(block.terminals)
        else:
            continue
        for port in ports:
            if f"{name}.{port}" not in fed:
                yield Problem(
                    "unwired-joint",
                    f"{name}.{port}",
                    "nothing is wired to it",
                    "every joint is fed once",
                    f'connect("block.marker", "{name}.{port}")',
                )


def driver_names(graph: Graph) -> list[str]:
    """Names of all drivers, in the author's order of blocks."""
    moving = ((n, b) for n, b in graph.blocks.items() if isinstance(b, Moving))
    return [b.driver_name(name, joint.name) for name, b in moving for joint in b.driven]


def _driver_name_problems(graph: Graph) -> Iterable[Problem]:
    """Drivers of general groups that are called like a block or like each other."""
    names = driver_names(graph)
    for name, block in graph.blocks.items():
        for pair, given in block.pairs.items() if isinstance(block, GeneralGroup) else ():
            if given.driver and (given.driver in graph.blocks or names.count(given.driver) > 1):
                where, found = f"{name}.pairs.{pair}.driver", f'"{given.driver}" is taken'
                yield Problem("taken-name", where, found, "", "choose another name")


def _scene_problems(graph: Graph) -> Iterable[Problem]:
    drivers = driver_names(graph)
    for section in ("drive", "initial", "stops"):
        for name in getattr(graph.scene, section):
            if name not in drivers:
                yield Problem(
                    "unknown-driver",
                    f"scene.{section}.{name}",
                    f'no driver "{name}"',
                    f"drivers: {listed(drivers) or 'none'}",
                    close_match(name, drivers),
                )


def _driver_problems(graph: Graph) -> Iterable[Problem]:
    """Elements whose law is of a driver that is none."""
    drivers = driver_names(graph)
    for name, block in graph.blocks.items():
        if isinstance(block, Following) and block.driver not in (None, *drivers):
            yield Problem(
                "unknown-driver",
                f"{name}.driver",
                f'no driver "{block.driver}"',
                f"drivers: {listed(drivers) or 'none'}",
                close_match(str(block.driver), drivers),
            )


def _branch_problems(graph: Graph) -> Iterable[Problem]:
    """Branches that follow a motion of several drivers, or of another one than home says."""
    import networkx as nx

    following = {n: b for n, b in graph.blocks.items() if isinstance(b, TwoModes) and b.follows}
    dag = block_dag(graph) if following else None
    for name, block in following.items():
        above = nx.ancestors(dag, name)
        moving = {n: b for n, b in graph.blocks.items() if n in above and isinstance(b, Moving)}
        drivers = [b.driver_name(n, j.name) for n, b in moving.items() for j in b.driven]
        said = list(block.home.drivers)  # type: ignore[attr-defined]
        if len(drivers) != 1:
            found = f"it is moved by {len(drivers)} drivers, not by one that leads from home"
            yield Problem("many-drivers", f"{name}.branch", found, "", "give the branch -1 or 1")
        elif said != drivers:
            where, found = f"{name}.home.drivers", f"it names {listed(said)}"
            yield Problem("wrong-home", where, found, f"the dyad is moved by {drivers[0]}")


def _group_problems(graph: Graph) -> Iterable[Problem]:
    """General groups whose pairs hold some links twice and leave others loose."""
    for name, block in graph.blocks.items():
        if isinstance(block, GeneralGroup):
            from blockmech.model.determinacy import diagnose  # few graphs have such a group

            driven = [joint.name for joint in block.driven]
            for finding in diagnose(block.link_names, block.structural, {SUPPORTS}, driven):
                remedy = "move a pair from an over-constrained link to a loose one"
                yield Problem(finding.code, f"{name}.pairs", finding.text, "", remedy)


def _cycles(graph: Graph) -> Iterable[Problem]:
    import networkx as nx

    links = 0
    for component in nx.strongly_connected_components(block_dag(graph)):
        if len(component) > 1:
            from blockmech.model import cycles  # only a wrong graph pays for it

            blocks = sorted(component)
            known = [b for name in blocks if isinstance(b := graph.blocks[name], Block)]
            links += sum(len(block.link_names) for block in known)
            few = links <= cycles.MOST_LINKS
            yield cycles.diagnose_cycle(graph, blocks) if few else cycles.cycle(blocks)


def block_dag(graph: Graph) -> nx.DiGraph:
    """Blocks with links, and an edge from each block to those that it feeds."""
    import networkx as nx

    dag = nx.DiGraph()
    dag.add_nodes_from(n for n, b in graph.blocks.items() if not isinstance(b, Element))
    for wire in graph.wires:
        source, target = wire.source.split(".")[0], wire.target.split(".")[0]
        fixed = isinstance(graph.blocks.get(target), Frame)  # nothing can feed it
        if source in dag and target in dag and source != target and not fixed:
            dag.add_edge(source, target)
    return dag
