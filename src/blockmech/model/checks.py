"""The checks of a graph, one rule each; every problem is data.

What is locally wrong is refused when it is added; `checked` finds the rest in
one pass, so that a user sees everything at once. Of drivers they say who drives, leads and
follows, and that nobody leads himself.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from itertools import chain
from operator import itemgetter
from typing import TYPE_CHECKING, Any, TypeAlias

from blockmech.blocks.block import REGISTRY
from blockmech.blocks.contract import Block, DrivingLink, Joint, Moving
from blockmech.blocks.frame import Frame
from blockmech.blocks.general import GeneralGroup
from blockmech.blocks.general.block import SUPPORTS
from blockmech.blocks.joints import PAIRS
from blockmech.blocks.modes import TwoModes
from blockmech.couplings.contract import Coupling
from blockmech.ground.errors import GraphError, Problem, listed, unknown_name
from blockmech.ground.limits import COMPARED
from blockmech.ground.names import MECHANISM, NAME_RULE, is_name, split_address
from blockmech.loads.contract import Element, Following
from blockmech.model.diagram import Ends, UnknownBlock, Wire, driven_joints
from blockmech.model.flat import Flat
from blockmech.model.meshing import check_couplings
from blockmech.model.parameters import wrong_units
from blockmech.model.scene import Scene
from blockmech.model.structure import COORDINATE, JointRef, MarkerRef, Structure
from blockmech.model.wires import Blocks, checked_wires, signal_wire, unwired
from blockmech.signals.contract import Signal
from blockmech.typing import Record

if TYPE_CHECKING:
    import networkx as nx

Drivers: TypeAlias = Mapping[str, tuple[str, Joint]]
"""Driver -> its block and the pair that it drives."""


def checked_structure(flat: Flat) -> Structure:
    """The formation sequence of a graph. Raises `GraphError` with every problem of it.

    Of blocks that do not wait for each other the first by name comes first.
    """
    import networkx as nx

    blocks, order = flat.blocks, tuple[str, ...]()
    judged = list(checked_wires(blocks, flat.wires))
    ends = [parts for wire, parts, wrong in judged if wire.target not in (p.where for p in wrong)]
    problems = [*flat.problems, *_block_problems(blocks)]
    problems += chain.from_iterable(wrong for _, _, wrong in judged)
    problems += unwired(blocks, {wire.target for wire, _, _ in judged})
    problems += driver_problems(blocks, flat.scene)
    problems += coupling_problems(blocks, flat.scene)
    problems += _group_problems(blocks)
    problems += _branch_problems(blocks, ends)
    problems += wrong_units({"blocks": blocks, "scene": flat.scene})
    if not any(isinstance(block, UnknownBlock) for block in blocks.values()):
        dag, cycles = block_dag(blocks, ends), list[Problem]()
        add_couplings(dag, blocks)
        try:
            order = tuple(nx.lexicographical_topological_sort(dag, key=str))
        except nx.NetworkXUnfeasible:
            cycles += _cycles(block_dag(blocks, ends), blocks, flat.wires)
        problems += cycles or loop_problems(dag, blocks)
    GraphError.raise_for(problems)
    structure = _formed(blocks, order, zip(flat.wires, ends, strict=True))
    check_couplings(structure)
    return structure


def _formed(blocks: Record, order: Iterable[str], wires: Iterable[tuple[Wire, Ends]]) -> Structure:
    """The structure of a graph with which nothing is wrong, its blocks with links in order."""
    feeds, holds = dict[JointRef, MarkerRef](), dict[JointRef, MarkerRef]()
    read: dict[JointRef, str] = {}
    for wire, ends in wires:
        joint, block = JointRef(ends.target, ends.port), blocks[ends.target]
        if signal_wire(blocks, ends):
            read[joint] = wire.source
        else:
            link, _ = blocks[ends.source].all_markers[ends.marker]
            on = holds if isinstance(block, Element) else feeds
            on[joint] = MarkerRef(ends.source, link, ends.marker)
    named = sorted(blocks.items(), key=itemgetter(0))
    frame = next(n for n, b in named if isinstance(b, Frame))
    return Structure(
        frame,
        {n: blocks[n] for n in order if isinstance(blocks[n], Moving)},
        {n: b for n, b in named if isinstance(b, Element)},
        blocks[frame],
        feeds,
        holds,
        couplings={n: b for n, b in named if isinstance(b, Coupling)},
        signals={n: b for n, b in named if isinstance(b, Signal)},
        signal_wires=read,
    )


def remarks(blocks: Blocks, wires: Iterable[Wire]) -> list[Problem]:
    """Unused and unreachable things of a graph: not wrong, but perhaps forgotten."""
    import networkx as nx

    dag, used = block_dag(blocks, [w.split_ends(blocks) for w in wires]), {w.source for w in wires}
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
        message = f"a second frame beside {frames[0]}"
        yield Problem("two-frames", name, message, one, f"move its markers to {frames[0]}")
    for name, block in blocks.items():
        if name == MECHANISM:
            message = f'outputs of the whole begin with "{MECHANISM}."'
            yield Problem("taken-name", name, message, "", "choose another name")
        if isinstance(block, UnknownBlock):
            yield REGISTRY.unknown(block.type, name)


def _branch_problems(blocks: Blocks, ends: Iterable[Ends]) -> Iterator[Problem]:
    """Branches that follow a motion of several drivers, or of another one than home says."""
    import networkx as nx

    following = {n: b for n, b in blocks.items() if isinstance(b, TwoModes) and b.follows}
    dag = block_dag(blocks, ends) if following else None
    for name, block in following.items():
        above = nx.ancestors(dag, name)
        drivers = list(driven_joints({n: b for n, b in blocks.items() if n in above}))
        named = [*block.home.drivers] if block.home else []
        if len(drivers) != 1:
            message = f"a branch that follows needs exactly one driver, not {len(drivers)}"
            yield Problem("many-drivers", f"{name}.branch", message, "", "give the branch -1 or 1")
        elif named != drivers:
            where, message = f"{name}.home.drivers", f"it names {listed(named)}, not its driver"
            yield Problem("wrong-home", where, message, f"the driver of the dyad is {drivers[0]}")


def _group_problems(blocks: Blocks) -> Iterator[Problem]:
    """General groups whose pairs hold some links twice and leave others loose."""
    for name, block in blocks.items():
        if isinstance(block, GeneralGroup):
            from blockmech.assur.diagnosis import diagnose  # few graphs have such a group
            from blockmech.assur.rigidity import TooTangledError

            driven, where = [joint.name for joint in block.driven], f"{name}.pairs"
            try:
                findings = diagnose(block.link_names, block.structural, {SUPPORTS}, driven)
            except TooTangledError:
                message = f"{len(block.link_names)} links stand in too many loops to be judged"
                yield Problem("too-tangled", where, message, "", "take the group apart")
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
            yield cycles.cycle_problem(blocks, wires, names, told=links <= COMPARED)


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


# -- drivers -------------------------------------------------------------------------------


def couplings_of(blocks: Blocks) -> dict[str, Coupling]:
    """The couplings of a graph."""
    return {name: b for name, b in blocks.items() if isinstance(b, Coupling)}


def driver_problems(blocks: Blocks, scene: Scene) -> Iterator[Problem]:
    """Drivers whose names are taken; sections of the scene and laws of drivers that are none."""
    drivers = driven_joints(blocks)
    groups = {n: b for n, b in blocks.items() if isinstance(b, GeneralGroup)}
    given = [
        (f"{n}.pairs.{p}.driver", x.driver) for n, b in groups.items() for p, x in b.pairs.items()
    ]
    names = [driver for _, driver in given]
    for where, driver in given:
        if driver and (driver in blocks or names.count(driver) > 1):
            yield Problem("taken-name", where, f'"{driver}" is taken', "", "choose another name")
    named = [(f"scene.{key}.{driver}", driver) for key, driver in scene.drivers()]
    following = ((n, b.driver) for n, b in blocks.items() if isinstance(b, Following) and b.driver)
    for where, driver in (*named, *((f"{n}.driver", driver) for n, driver in following)):
        coordinate = where.startswith("scene.stops.") and _is_coordinate(blocks, driver)
        if driver not in drivers and not coordinate:
            yield unknown_name("unknown-driver", "driver", driver, where, drivers)
    for driver, role in scene.motion.items():
        if role == "prescribed" and driver not in scene.drive and driver in drivers:
            message, where = f"{driver} has no law of motion", scene.address("motion", driver)
            remedy = f"give it one in {scene.address('drive', driver)}, or lock it"
            yield Problem("no-law", where, message, "", remedy)


def _is_coordinate(blocks: Blocks, name: str) -> bool:
    """Whether a name is that of the coordinate of a pair, ``block.joint.coordinate``."""
    pair, _, last = name.rpartition(".")
    block, joint = split_address(pair, blocks)
    return last == COORDINATE and joint in getattr(blocks.get(block), "joints", ())


def coupling_problems(blocks: Blocks, scene: Scene) -> Iterator[Problem]:
    """What is wrong with the names, pairs and laws of coupled drivers."""
    drivers, led = driven_joints(blocks), dict[str, str]()
    for name, coupling in couplings_of(blocks).items():
        for key, driver in (("driver", coupling.driver), ("driven", coupling.driven)):
            if driver in drivers:
                yield from _misfits(blocks, drivers, name, key)
            elif not (coupling.meshes and _is_marker(blocks, driver)):
                yield unknown_name("unknown-driver", "driver", driver, f"{name}.{key}", drivers)
            elif key == "driven":
                wrong = unknown_name("unknown-driver", "driver", driver, f"{name}.{key}", drivers)
                message = f"{driver} is a place on a link, not a driver"
                remedy = "a wheel that is fixed leads: name it as the driver"
                yield replace(wrong, found=message, remedy=remedy)
        if coupling.driven in led:
            message = f"{coupling.driven} is already driven by {led[coupling.driven]}"
            valid = "a driver follows at most one coupling"
            remedy = "couple one of them to the other's driver"
            yield Problem("coupled-twice", f"{name}.driven", message, valid, remedy)
        led.setdefault(coupling.driven, name)
    for section, driver in scene.drivers():
        if driver in led:
            message = f"{driver} is driven by {led[driver]}, so it takes no law of motion"
            remedy = f"give the law to the leading driver: {blocks[led[driver]].driver}"  # type: ignore[union-attr]
            yield Problem("coupled-driver", scene.address(section, driver), message, "", remedy)


def _misfits(blocks: Blocks, drivers: Drivers, name: str, key: str) -> Iterator[Problem]:
    """Pairs that a coupling does not couple, on one of its sides."""
    coupling: Any = blocks[name]
    side, driver = key == "driven", getattr(coupling, key)
    block, joint = drivers[driver]
    _, other = drivers.get(coupling.driver if side else coupling.driven, ("", None))
    pairs = {p for p in coupling.pairs if p[side] == joint.kind}
    if not pairs or (side and other and f"{other.kind}{joint.kind}" not in pairs):
        message = f"{driver} is {joint.pair.word}: {coupling.type_name} does not couple it"
        if pairs and other:
            message += f" with {coupling.driver}, which is {other.pair.word}"
        known = (" with ".join(PAIRS[k].word for k in p) for p in coupling.pairs)
        words = f"it couples {', or '.join(known)}"
        yield Problem("coupling-mismatch", f"{name}.{key}", message, words)
    elif coupling.meshes and not isinstance(blocks[block], DrivingLink):
        message = f"{driver} is a driven pair inside the group {block}"
        valid = "cranks and slide drives mesh; coupling.ratio couples any drivers"
        yield Problem("coupling-mismatch", f"{name}.{key}", message, valid)


def _is_marker(blocks: Blocks, address: str) -> bool:
    block, marker = split_address(address, blocks)
    return marker in getattr(blocks.get(block), "all_markers", ())


def _led(dag: nx.DiGraph, blocks: Blocks) -> Iterator[tuple[str, str, str]]:
    """Couplings, each with the block that leads and the one that follows."""
    couplings = couplings_of(blocks)
    drivers = driven_joints(blocks) if couplings else {}
    for name, coupling in couplings.items():
        if coupling.driven in drivers:
            fixed = split_address(coupling.driver, blocks)
            source = drivers.get(coupling.driver, fixed)[0]
            if source in dag:
                yield name, source, drivers[coupling.driven][0]


def add_couplings(dag: nx.DiGraph, blocks: Blocks) -> None:
    """Edges from the blocks that lead to those that follow."""
    dag.add_edges_from((a, b) for _, a, b in [*_led(dag, blocks)] if a != b)


def loop_problems(dag: nx.DiGraph, blocks: Blocks) -> Iterator[Problem]:
    """Couplings by which a driver would follow itself: of those of a loop the first."""
    import networkx as nx

    for name, source, target in _led(dag, blocks):
        if source == target or nx.has_path(dag, target, source):
            way = [target] if source == target else nx.shortest_path(dag, target, source)
            driven = couplings_of(blocks)[name].driven
            message = f"{driven} drives itself: {' -> '.join([*way, way[0]])}"
            valid = "couplings must not form a loop"
            remedy = "remove one, or swap its driver and driven"
            yield Problem("coupling-loop", f"{name}.driven", message, valid, remedy)
            return
