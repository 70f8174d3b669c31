"""The checks of couplings: who leads, who follows, and that nobody leads himself."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, TypeAlias

from blockmech.blocks.contract import DrivingLink, Joint, Moving
from blockmech.blocks.joints import PAIRS
from blockmech.couplings.contract import Coupling
from blockmech.ground.errors import Problem, close_match, listed
from blockmech.ground.values import split_address
from blockmech.model.diagram import AnyBlock
from blockmech.model.scene import Scene

if TYPE_CHECKING:
    import networkx as nx

Blocks: TypeAlias = Mapping[str, AnyBlock]


def couplings_of(blocks: Blocks) -> dict[str, Coupling]:
    """The couplings of a graph."""
    return {name: b for name, b in blocks.items() if isinstance(b, Coupling)}


def driven_joints(blocks: Blocks) -> dict[str, tuple[str, Joint]]:
    """Driver -> its block and the pair that it drives."""
    moving = ((n, b) for n, b in blocks.items() if isinstance(b, Moving))
    return {b.driver_name(n, j.name): (n, j) for n, b in moving for j in b.driven}


def coupling_problems(blocks: Blocks, scene: Scene) -> Iterator[Problem]:
    """What is wrong with the names, pairs and laws of coupled drivers."""
    drivers, led = driven_joints(blocks), dict[str, str]()
    valid = f"drivers: {listed(drivers) or 'none'}"
    for name, coupling in couplings_of(blocks).items():
        ends = {"driver": coupling.driver, "driven": coupling.driven}
        for key, driver in ends.items():
            if driver not in drivers:
                found, remedy = f'no driver "{driver}"', close_match(driver, drivers)
                if coupling.meshes and _is_marker(blocks, driver):
                    if key == "driver":
                        continue
                    found = f"{driver} is a place on a link, not a driver"
                    remedy = "a wheel that is fixed leads: name it as the driver"
                yield Problem("unknown-driver", f"{name}.{key}", found, valid, remedy)
                continue
            joint = drivers[driver]
            side = key == "driven"
            other = drivers.get(ends["driver" if side else "driven"])
            pairs = {p for p in coupling.pairs if p[side] == joint[1].kind}
            if not pairs or (side and other and f"{other[1].kind}{joint[1].kind}" not in pairs):
                found = f"{driver} is {joint[1].pair.word}: {coupling.type_name} does not couple it"
                if pairs and other:
                    found += f" with {ends['driver']}, which is {other[1].pair.word}"
                known = (" with ".join(PAIRS[k].word for k in p) for p in coupling.pairs)
                words = f"it couples {', or '.join(known)}"
                yield Problem("coupling-mismatch", f"{name}.{key}", found, words)
            elif coupling.meshes and not isinstance(blocks[joint[0]], DrivingLink):
                found = f"{driver} is a driven pair inside the group {joint[0]}"
                valid = "cranks and slide drives mesh; coupling.ratio couples any drivers"
                yield Problem("coupling-mismatch", f"{name}.{key}", found, valid)
        if coupling.driven in led:
            found = f"{coupling.driven} follows already by {led[coupling.driven]}"
            remedy = "let one of them drive the other's driver"
            yield Problem(
                "coupled-twice", f"{name}.driven", found, "a driver follows one coupling", remedy
            )
        led.setdefault(coupling.driven, name)
    for section in ("drive", "initial", "stops", "motion"):
        for driver in getattr(scene, section):
            if driver in led:
                found = f"{driver} follows by {led[driver]}, and has no motion of its own"
                remedy = f"give it to the driver that leads: {blocks[led[driver]].driver}"  # type: ignore[union-attr]
                yield Problem("coupled-driver", scene.address(section, driver), found, "", remedy)


def _is_marker(blocks: Blocks, address: str) -> bool:
    block, marker = split_address(address, blocks)
    return marker in getattr(blocks.get(block), "all_markers", ())


def add_couplings(dag: nx.DiGraph, blocks: Blocks) -> None:
    """Edges from the blocks that lead to those that follow."""
    couplings = couplings_of(blocks)
    drivers = driven_joints(blocks) if couplings else {}
    for coupling in couplings.values():
        if coupling.driven in drivers:
            known = drivers.get(coupling.driver)
            source = known[0] if known else split_address(coupling.driver, blocks)[0]
            target = drivers[coupling.driven][0]
            if source in dag and source != target:
                dag.add_edge(source, target)


def loop_problems(dag: nx.DiGraph, blocks: Blocks) -> Iterator[Problem]:
    """Couplings by which a driver would follow itself."""
    import networkx as nx

    couplings = couplings_of(blocks)
    drivers = driven_joints(blocks) if couplings else {}
    for name, coupling in couplings.items():
        if coupling.driven not in drivers:
            continue
        known = drivers.get(coupling.driver)
        source = known[0] if known else split_address(coupling.driver, blocks)[0]
        target = drivers[coupling.driven][0]
        if source not in dag or not (source == target or nx.has_path(dag, target, source)):
            continue
        way = [target] if source == target else nx.shortest_path(dag, target, source)
        found = f"{coupling.driven} leads back to itself: {' -> '.join([*way, way[0]])}"
        remedy = "take a coupling out, or turn one round"
        yield Problem("coupling-loop", f"{name}.driven", found, "couplings lead one way", remedy)
        return  # the others of the loop say the same
