"""The checks of drivers: who drives, leads and follows, and that nobody leads himself."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeAlias

from blockmech.blocks.contract import DrivingLink, Joint
from blockmech.blocks.general import GeneralGroup
from blockmech.blocks.joints import PAIRS
from blockmech.couplings.contract import Coupling
from blockmech.ground.errors import Problem, unknown_name
from blockmech.ground.names import split_address
from blockmech.loads.contract import Following
from blockmech.model.diagram import AnyBlock, driven_joints
from blockmech.model.scene import Scene
from blockmech.model.structure import COORDINATE

if TYPE_CHECKING:
    import networkx as nx

Blocks: TypeAlias = Mapping[str, AnyBlock]
Drivers: TypeAlias = Mapping[str, tuple[str, Joint]]
"""Driver -> its block and the pair that it drives."""


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
