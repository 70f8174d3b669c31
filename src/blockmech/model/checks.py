"""The checks of a graph, one rule each; every problem is data.

What is locally wrong is refused when it is added; `checked` finds the rest in
one pass, so that a user sees everything at once.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Mapping
from itertools import chain
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

from blockmech.blocks.contract import Block, Moving
from blockmech.blocks.frame import Frame
from blockmech.blocks.general import GeneralGroup
from blockmech.blocks.general.block import SUPPORTS
from blockmech.blocks.modes import TwoModes
from blockmech.blocks.registry import REGISTRY
from blockmech.couplings.contract import Coupling
from blockmech.ground.errors import Problem, close_match, listed
from blockmech.ground.values import NAME_RULE, Marker, is_name, split_address
from blockmech.loads.contract import LAW, Element, Following
from blockmech.model.couplings import add_couplings, coupling_problems, loop_problems
from blockmech.model.diagram import AnyBlock, Ends, UnknownBlock, Wire
from blockmech.model.scene import Scene
from blockmech.model.signals import signal_ports, signal_wire, signal_wire_problems
from blockmech.model.structure import COORDINATE
from blockmech.signals.contract import Signal

if TYPE_CHECKING:
    import networkx as nx

Blocks: TypeAlias = Mapping[str, AnyBlock]


class Checked(NamedTuple):
    """A graph that was checked.

    problems : all that is wrong with it
    order : where nothing is, its blocks with links in formation order: of those that do not
        wait for each other the first by name comes first
    ends : its wires by the names of their blocks
    """

    problems: list[Problem]
    order: tuple[str, ...]
    ends: list[Ends]


def checked(blocks: Blocks, wires: Iterable[Wire], scene: Scene) -> Checked:
    """Every problem of a graph, and what was found from its wires."""
    import networkx as nx

    problems = list(_block_problems(blocks))
    judged = list(checked_wires(blocks, wires))
    problems += chain.from_iterable(wrong for _, _, wrong in judged)
    ends = [parts for wire, parts, wrong in judged if wire.target not in (p.where for p in wrong)]
    problems += _unwired(blocks, {wire.target for wire, _, _ in judged})
    problems += _driver_problems(blocks, scene)
    problems += coupling_problems(blocks, scene)
    problems += _group_problems(blocks)
    problems += _branch_problems(blocks, ends)
    if any(p.code == "unknown-block" for p in problems):
        return Checked(problems, (), ends)
    dag = block_dag(blocks, ends)
    add_couplings(dag, blocks)
    try:
        order = tuple(nx.lexicographical_topological_sort(dag, key=str))
    except nx.NetworkXUnfeasible:
        cycles = list(_cycles(block_dag(blocks, ends), blocks, wires))
        return Checked(problems + (cycles or list(loop_problems(dag, blocks))), (), ends)
    problems += loop_problems(dag, blocks)  # a driver that is coupled to itself is none of the dag
    return Checked(problems, () if problems else order, ends)


def remarks(blocks: Blocks, wires: Iterable[Wire]) -> list[Problem]:
    """Unused and unreachable things of a graph: not wrong, but perhaps forgotten."""
    import networkx as nx

    dag, used = block_dag(blocks, [w.apart(blocks) for w in wires]), {w.source for w in wires}
    frames = {n: b for n, b in blocks.items() if isinstance(b, Frame)}
    moving = {n: b for n, b in blocks.items() if isinstance(b, Moving)}
    reached = set(frames).union(*(nx.descendants(dag, n) for n in frames))
    reason = "no chain of wires leads to it from the frame"
    problems = [Problem("unreachable", name, reason) for name in moving if name not in reached]
    for name, frame in frames.items():
        ends = [f"{name}.{m}" for m in frame.markers if f"{name}.{m}" not in used]
        problems += [Problem("unused-marker", end, "no wire starts there") for end in ends]
    for name, block in moving.items():
        in_use = block.closes or any(u.startswith(f"{name}.") for u in used)
        if not in_use and not any(link.massive for link in block.links.values()):
            problems.append(Problem("idle-driver", name, "it moves nothing and carries no load"))
    return problems


def name_problem(blocks: Blocks, name: str, block: object) -> Problem | None:
    """What is wrong with adding a block under a name, if anything."""
    other = "choose another name"
    if not isinstance(name, str) or not is_name(name):
        return Problem("bad-name", str(name) or '""', "not a block name", NAME_RULE, other)
    if name in blocks:
        taken = f"taken: {listed(blocks)}"
        return Problem("duplicate-block", name, "the name is taken", taken, other)
    if not isinstance(block, Block | UnknownBlock):
        remedy = 'call the class, e.g. add("crank", Crank(length=2.0))'
        return Problem("not-a-block", name, f"{type(block).__name__} is not a block", "", remedy)
    return None


def _block_problems(blocks: Blocks) -> Iterator[Problem]:
    frames = [n for n, b in blocks.items() if isinstance(b, Frame)]
    one = "a mechanism has one fixed link"
    if not frames:
        remedy = "add a frame with a marker for each pivot and guide"
        yield Problem("no-frame", "blocks", "no block of type frame", one, remedy)
    for name in frames[1:]:
        found = f"a second frame beside {frames[0]}"
        yield Problem("two-frames", name, found, one, f"move its markers to {frames[0]}")
    for name, block in blocks.items():
        if isinstance(block, UnknownBlock):
            yield REGISTRY.unknown(block.type, name)


def checked_wires(
    blocks: Blocks, wires: Iterable[Wire]
) -> Iterator[tuple[Wire, Ends, list[Problem]]]:
    """Wires with their ends, and what is locally wrong with each."""
    fed: dict[str, Wire] = {}
    for wire in wires:
        ends = wire.apart(blocks)
        problems = list(wire_problems(blocks, wire, ends, fed.get(wire.target)))
        yield wire, ends, problems
        if not problems:
            fed.setdefault(wire.target, wire)


def wire_problems(blocks: Blocks, wire: Wire, ends: Ends, fed: Wire | None) -> Iterator[Problem]:
    """What is locally wrong with a wire.

    ``ends`` are its own in these blocks; ``fed`` is an earlier wire to the same joint.
    """
    if fed is None and _joins(blocks, ends):
        return
    if signal_wire(blocks, ends):
        yield from signal_wire_problems(blocks, wire, fed)
        return
    problems = list(_local_problems(blocks, wire, fed))
    turned = Wire(wire.target, wire.source)
    if not problems or any(_local_problems(blocks, turned, None)):
        yield from problems
    elif problems[0].code == "not-a-marker":
        yield problems[0]
    else:
        found, valid = "a wire does not end there", "a wire runs from a marker to a joint"
        remedy = f"turn the wire round: {turned}"
        yield Problem(problems[0].code, wire.target, found, valid, remedy)


def _joins(blocks: Blocks, ends: Ends) -> bool:
    """Whether a wire plainly fits: what the rules below have nothing to say of."""
    source, marker, target, port = ends
    holder, block = blocks.get(source), blocks.get(target)
    if source == target or not isinstance(holder, Moving | Frame) or "." in marker + port:
        return False
    declared = holder.all_markers.get(marker, ("", None))[1]
    if declared is None:
        return False
    if isinstance(block, Element):
        return port in block.terminals and port != LAW
    joint = block.joints.get(port) if isinstance(block, Moving) else None
    if joint is None or not joint.outer:
        return False
    return joint.pair.reads != "guide" or not _pointlike(declared)


def _pointlike(marker: object) -> bool:
    """Whether a marker has no direction of its own."""
    return isinstance(marker, Marker) and marker.angle is None and marker.dir is None


def _local_problems(blocks: Blocks, wire: Wire, fed: Wire | None) -> Iterator[Problem]:
    marker = yield from _source_problems(blocks, wire)
    yield from _target_problems(blocks, wire, marker, fed)


def _source_problems(blocks: Blocks, wire: Wire) -> Any:
    block, name = yield from _end(blocks, wire, wire.source)
    if isinstance(block, Coupling):
        valid, remedy = "a coupling names its drivers, and takes no wires", "remove the wire"
        yield Problem("not-a-marker", wire.source, "a coupling has no markers", valid, remedy)
        return None
    if isinstance(block, Element):
        found = f"{block.type_name} has no markers"
        valid = "a wire starts at a marker of a link and ends at the element"
        remedy = f"turn the wire round: {wire.target} -> {wire.source}"
        yield Problem("not-a-marker", wire.source, found, valid, remedy)
        return None
    if not isinstance(block, Block):
        return None
    markers = block.all_markers
    if name not in markers:
        valid = f"markers there: {listed(markers)}"
        remedy = close_match(name, markers) or "add the marker to a link of the block"
        yield Problem("unknown-marker", wire.source, f'no marker "{name}"', valid, remedy)
        return None
    return markers[name][1]


def _target_problems(
    blocks: Blocks, wire: Wire, marker: Any, fed: Wire | None
) -> Iterator[Problem]:
    block, name = yield from _end(blocks, wire, wire.target)
    if not isinstance(block, Block):
        return
    ports = _ports(block)
    if name not in ports:
        inner = name in block.joints
        found = "an inner joint takes no wire" if inner else f'no joint "{name}"'
        valid = f"joints that take a wire: {listed(ports)}" if ports else "it takes no wires"
        yield Problem("unknown-joint", wire.target, found, valid, close_match(name, ports))
        return
    if fed is not None:
        found = f"already fed by {fed.source}, cannot also take {wire.source}"
        remedy = f"remove one of: {fed}; {wire}"
        yield Problem("double-wire", wire.target, found, "a joint has one source", remedy)
    if split_address(str(wire.source), blocks)[0] == split_address(wire.target, blocks)[0]:
        found = f"fed by {wire.source} of the same block"
        valid = "a joint is fed by an earlier block"
        yield Problem("self-wire", wire.target, found, valid, "wire it to another block")
    guided = isinstance(block, Moving) and block.joints[name].pair.reads == "guide"
    if guided and _pointlike(marker):
        found = f"a prismatic joint needs a guide, {wire.source} is a point"
        valid = "a guide is a marker with a direction"
        remedy = f'give {wire.source} an "angle" [rad] or a "dir" [dx, dy]'
        yield Problem("pair-mismatch", wire.target, found, valid, remedy)


def _end(blocks: Blocks, wire: Wire, end: str) -> Any:
    """The block at an end of a wire, if it is there, and the name after the dot."""
    parts = split_address(end, blocks) if isinstance(end, str) else ("", "")
    if "." in parts[1] and any(name.startswith(f"{parts[0]}.") for name in blocks):  # inside
        name, _, port = end.rpartition(".")
        parts = name, port
    carried = parts[1] in getattr(blocks.get(parts[0]), "all_markers", ())
    if not all(parts) or ("." in parts[1] and not carried):
        found, valid = f'not an address, in wire "{wire}"', '"block.joint" or "block.marker"'
        yield Problem("bad-address", str(end) or '""', found, f"an address is {valid}")
        return None, ""
    if parts[0] not in blocks:
        remedy = close_match(parts[0], blocks) or "add the block first"
        there = f"blocks: {listed(blocks)}"
        yield Problem("no-such-block", end, f'no block "{parts[0]}"', there, remedy)
        return None, ""
    return blocks[parts[0]], parts[1]


def _ports(block: AnyBlock) -> list[str]:
    """Joints and terminals of a block that a wire can end at."""
    if isinstance(block, Element):
        return list(block.terminals)
    if isinstance(block, Signal):
        return []
    return [j.name for j in block.joints.values() if j.outer] if isinstance(block, Moving) else []


def _unwired(blocks: Blocks, fed: Container[str]) -> Iterator[Problem]:
    for end in (f"{name}.{port}" for name, block in blocks.items() for port in signal_ports(block)):
        if end not in fed:
            found, remedy = "nothing is wired to it", f'connect("block.output", "{end}")'
            yield Problem("unwired-joint", end, found, "every input is fed once", remedy)
    for end in (f"{name}.{port}" for name, block in blocks.items() for port in _ports(block)):
        if end not in fed:
            found, remedy = "nothing is wired to it", f'connect("block.marker", "{end}")'
            yield Problem("unwired-joint", end, found, "every joint is fed once", remedy)


def driver_names(blocks: Blocks) -> list[str]:
    """Names of all drivers, in the author's order of blocks."""
    moving = ((n, b) for n, b in blocks.items() if isinstance(b, Moving))
    return [b.driver_name(name, joint.name) for name, b in moving for joint in b.driven]


def _driver_problems(blocks: Blocks, scene: Scene) -> Iterator[Problem]:
    """Drivers whose names are taken; sections of the scene and laws of drivers that are none."""
    drivers = driver_names(blocks)
    for name, block in blocks.items():
        for pair, given in block.pairs.items() if isinstance(block, GeneralGroup) else ():
            if given.driver and (given.driver in blocks or drivers.count(given.driver) > 1):
                where, found = f"{name}.pairs.{pair}.driver", f'"{given.driver}" is taken'
                yield Problem("taken-name", where, found, "", "choose another name")
    sections = ("drive", "initial", "stops", "motion")
    named = [
        (f"scene.{key}.{driver}", driver) for key in sections for driver in getattr(scene, key)
    ]
    for name, block in blocks.items():
        if isinstance(block, Following) and block.driver is not None:
            named.append((f"{name}.driver", block.driver))
    for where, driver in named:
        coordinate = where.startswith("scene.stops.") and _is_coordinate(blocks, driver)
        if driver not in drivers and not coordinate:
            known = f"drivers: {listed(drivers) or 'none'}"
            found, remedy = f'no driver "{driver}"', close_match(driver, drivers)
            yield Problem("unknown-driver", where, found, known, remedy)
    for driver, role in scene.motion.items():
        if role == "prescribed" and driver not in scene.drive and driver in drivers:
            found, where = f"{driver} has no law of motion", scene.address("motion", driver)
            remedy = f"give it one in {scene.address('drive', driver)}, or lock it"
            yield Problem("no-law", where, found, "", remedy)


def _is_coordinate(blocks: Blocks, name: str) -> bool:
    """Whether a name is that of the coordinate of a pair, ``block.joint.coordinate``."""
    pair, _, last = name.rpartition(".")
    block, joint = split_address(pair, blocks)
    return last == COORDINATE and joint in getattr(blocks.get(block), "joints", ())


def _branch_problems(blocks: Blocks, ends: Iterable[Ends]) -> Iterator[Problem]:
    """Branches that follow a motion of several drivers, or of another one than home says."""
    import networkx as nx

    following = {n: b for n, b in blocks.items() if isinstance(b, TwoModes) and b.follows}
    dag = block_dag(blocks, ends) if following else None
    for name, block in following.items():
        above = nx.ancestors(dag, name)
        drivers = driver_names({n: b for n, b in blocks.items() if n in above})
        named = list(block.home.drivers)  # type: ignore[attr-defined]
        if len(drivers) != 1:
            found = f"it is moved by {len(drivers)} drivers, not by one that leads from home"
            yield Problem("many-drivers", f"{name}.branch", found, "", "give the branch -1 or 1")
        elif named != drivers:
            where, found = f"{name}.home.drivers", f"it names {listed(named)}"
            yield Problem("wrong-home", where, found, f"the dyad is moved by {drivers[0]}")


def _group_problems(blocks: Blocks) -> Iterator[Problem]:
    """General groups whose pairs hold some links twice and leave others loose."""
    for name, block in blocks.items():
        if isinstance(block, GeneralGroup):
            from blockmech.assur.diagnosis import diagnose  # few graphs have such a group
            from blockmech.assur.rank import TooTangledError

            driven, where = [joint.name for joint in block.driven], f"{name}.pairs"
            try:
                findings = diagnose(block.link_names, block.structural, {SUPPORTS}, driven)
            except TooTangledError:
                found = f"{len(block.link_names)} links stand in too many loops to be judged"
                yield Problem("too-tangled", where, found, "", "take the group apart")
                continue
            for finding in findings:
                remedy = "move a pair from an over-constrained link to a loose one"
                yield Problem(finding.code, where, finding.text(), "", remedy)


def _cycles(dag: nx.DiGraph, blocks: Blocks, wires: Iterable[Wire]) -> Iterator[Problem]:
    import networkx as nx

    links = 0
    for component in nx.strongly_connected_components(dag):
        if len(component) > 1:
            from blockmech.model import cycles  # only a wrong graph pays for it

            names = sorted(component)
            known = [b for name in names if isinstance(b := blocks[name], Block)]
            links += sum(len(block.link_names) for block in known)
            yield cycles.cycle_problem(blocks, wires, names, told=links <= cycles.MOST_LINKS)


def block_dag(blocks: Blocks, ends: Iterable[Ends]) -> nx.DiGraph:
    """Blocks with links, and an edge from each block to those that it feeds."""
    import networkx as nx

    dag = nx.DiGraph()
    dag.add_nodes_from(
        n for n, b in blocks.items() if not isinstance(b, Element | Coupling | Signal)
    )
    for source, _, target, _ in ends:
        fixed = isinstance(blocks.get(target), Frame)  # nothing can feed it
        if source in dag and target in dag and source != target and not fixed:
            dag.add_edge(source, target)
    return dag
