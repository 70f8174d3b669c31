"""Graphs inside of graphs written out: their blocks, wires and scene as parts of one graph.

A block inside is named after its way in, ``knee.dyad``; so addresses need no translation, and
whatever is found or drawn says where inside it is. What refers to blocks inside (wires, names
of drivers, fields that `StrictModel.refers` names) gets the same name in front.

The frame of a graph inside is no link of its own: its markers go to the outer frame, or to the
link whose marker it stands on, and are called there like in the outer graph: marker ``A`` of
``knee``'s frame is ``frame.knee.A``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from blockmech.blocks.contract import Block, Moving
from blockmech.blocks.frame import Frame
from blockmech.ground.errors import Problem, listed, unknown_name
from blockmech.ground.names import split_address
from blockmech.ground.values import Marker, Place, StrictModel, Vector
from blockmech.model.diagram import AnyBlock, Wire, driven_joints
from blockmech.model.parameters import interface
from blockmech.model.scene import PER_DRIVER, Scene
from blockmech.model.subgraph import Content, Subgraph
from blockmech.model.wires import inlets, no_such_block
from blockmech.typing import Arguments, Data


@dataclass
class Flat:
    """A graph without graphs inside, and what is wrong with the places of those that it had."""

    blocks: dict[str, AnyBlock] = field(default_factory=dict)
    wires: list[Wire] = field(default_factory=list)
    scene: Scene = field(default_factory=Scene)
    problems: list[Problem] = field(default_factory=list)
    moved: dict[str, str] = field(default_factory=dict)  # marker of a frame inside -> where it is

    def address(self, address: str) -> str:
        """An address of the graph as the blocks written out have it."""
        return self.moved.get(address, address)


def flattened(graph: Content) -> Flat:
    """A graph with the blocks of all graphs inside written out."""
    if not any(isinstance(block, Subgraph) for block in graph.blocks.values()):
        return Flat(graph.blocks, graph.wires, graph.scene)
    flat = Flat(scene=graph.scene)
    frames: dict[str, Frame] = {}
    inside: dict[str, Flat] = {}
    per_driver: dict[str, Data] = {section: {} for section in PER_DRIVER}
    for name, block in graph.blocks.items():
        if not isinstance(block, Subgraph):
            flat.blocks[name] = block
            continue
        part = inside[name] = flattened(with_parameters(block))
        for inner, x in part.blocks.items():
            if isinstance(x, Frame):
                frames[f"{name}.{inner}"] = x
            else:
                flat.blocks[f"{name}.{inner}"] = x
    _place_frames(graph, flat, frames)
    for name, part in inside.items():
        within = _inside_of(name, part, flat)
        flat.moved |= {f"{name}.{old}": within(new) for old, new in part.moved.items()}
        for inner in part.blocks:
            if (full := f"{name}.{inner}") in flat.blocks:
                flat.blocks[full] = renamed(flat.blocks[full], within)
        flat.wires += [Wire(*map(within, w.ends)) for w in part.wires]
        for section in PER_DRIVER:
            items = getattr(part.scene, section)
            per_driver[section] |= {within(driver): x for driver, x in items.items()}
    flat.wires += [Wire(*map(flat.address, w.ends)) for w in graph.wires]
    merged = {section: {**x, **getattr(graph.scene, section)} for section, x in per_driver.items()}
    flat.scene = graph.scene.model_copy(update=merged)
    for name in graph.blocks.keys() & flat.blocks.keys():
        flat.blocks[name] = renamed(flat.blocks[name], flat.address)
    return flat


def open_ports(block: Subgraph) -> Iterator[tuple[str, str]]:
    """What nothing feeds inside of a graph, by address there: the kind of a joint, "" of others."""
    if block.content is None:
        return
    flat = block.content.flat()
    fed = {wire.target for wire in flat.wires}
    for name, b in flat.blocks.items():
        for port in inlets(b):
            if (at := f"{name}.{port}") not in fed:
                yield at, str(b.joints[port].kind) if isinstance(b, Moving) else ""


def with_parameters(block: Subgraph) -> Content:
    """The graph inside of a block with the numbers that the block gives it, unchecked."""
    if not block.given:
        return block.content
    settable = interface(block.content)
    numbers = {
        path: int(x) if isinstance(p.value, int) and float(x).is_integer() else x
        for address, x in block.given.items()
        for p, paths in [settable[address]]
        for path in paths
    }
    return block.content.with_numbers(numbers)


def _inside_of(name: str, part: Flat, flat: Flat) -> Callable[[str], str]:
    """What an address or a driver inside of a block is called outside of it.

    What is not there inside is left to the outer graph: the driver at home of a general group
    may be outside, and ``mechanism.*`` are outputs of the whole.
    """
    drivers = driven_joints(part.blocks)

    def called(address: str) -> str:
        is_inside = split_address(address, part.blocks)[0] in part.blocks
        is_inside = is_inside or any(f"{address}.".startswith(f"{driver}.") for driver in drivers)
        return flat.address(f"{name}.{address}") if is_inside else address

    return called


def renamed(x: Any, called: Callable[[str], str]) -> Any:
    """A model with other names wherever it refers to drivers or markers."""
    if isinstance(x, Mapping):
        items = {key: renamed(v, called) for key, v in x.items()}
        return x if all(items[key] is x[key] for key in x) else items
    if not isinstance(x, StrictModel):
        return x
    update = {}
    for name in type(x).model_fields:
        old = getattr(x, name)
        if name not in x.refers:
            new = renamed(old, called)
        elif isinstance(old, Mapping):
            new = {called(key): v for key, v in old.items()}
        else:
            new = called(old) if old else old
        if new is not old:
            update[name] = new
    return x.model_copy(update=update) if update else x


# -- frames of graphs inside ---------------------------------------------------------------


def _place_frames(graph: Content, flat: Flat, frames: dict[str, Frame]) -> None:
    """Give the markers of frames inside to the links that carry them."""
    frame_name = next((n for n, b in graph.blocks.items() if isinstance(b, Frame)), "")
    waiting = dict(frames)
    while waiting:
        for full in waiting:
            name = full.partition(".")[0]
            block = graph.blocks[name]
            assert isinstance(block, Subgraph)
            on = flat.address(block.on)
            if not on or split_address(on, flat.blocks)[0] in flat.blocks:
                break
            if split_address(on, waiting)[0] not in waiting:
                break
        else:
            names = list(waiting)
            message = f"the frames stand on each other: {listed(names)}"
            valid = "a frame stands on a link that moves without it, or on the outer frame"
            flat.problems.append(Problem("cycle", names[0], message, valid))
            full = names[0]
            name, on = full.partition(".")[0], ""
        frame = waiting.pop(full)
        if on and (problem := _no_marker(flat.blocks, on, f"{name}.on")):
            flat.problems.append(problem)
            on = ""
        if on:
            _stand(flat, full, frame, on, name)
        elif frame_name:
            _stand(flat, full, frame, f"{frame_name}.frame", name)
        else:
            frame_name, flat.blocks[full] = full, frame


def _no_marker(blocks: Mapping[str, AnyBlock], address: str, where: str) -> Problem | None:
    name, marker = split_address(address, blocks)
    block = blocks.get(name)
    if block is None:
        return no_such_block(blocks, name, where)
    markers = block.all_markers if isinstance(block, Block) else {}
    if marker not in markers:
        wrong = unknown_name("unknown-marker", "marker", marker, where, markers, there=" there")
        return replace(wrong, found=f"{wrong.found} on {name}")
    return None


def _stand(flat: Flat, full: str, frame: Frame, on: str, name: str) -> None:
    """Put the markers of a frame on the link of a marker, at its place and along its direction."""
    carrier, marker = split_address(on, flat.blocks)
    block = flat.blocks[carrier]
    assert isinstance(block, Block)
    link, declared = block.all_markers[marker]
    at = block.place_of(declared)
    axis = declared.direction if isinstance(declared, Marker) else 1 + 0j
    still = marker == "frame" and isinstance(block, Frame)  # numbers stay as they are
    markers = {
        f"{name}.{m}": x if still else _carried(x, at, axis) for m, x in frame.markers.items()
    }
    for m in frame.markers:
        flat.moved[f"{full}.{m}"] = f"{carrier}.{name}.{m}"
    flat.moved[f"{full}.frame"] = on
    if isinstance(block, Frame):
        update: Arguments = {"markers": {**block.markers, **markers}}
    else:
        links = block.links_or_default()
        body = links[link]
        links[link] = body.model_copy(update={"markers": {**body.markers, **markers}})
        update = {"links": links}
    flat.blocks[carrier] = block.model_copy(update=update)


def _carried(x: Marker, at: complex, axis: complex) -> Marker:
    """A marker on the link that carries its frame; a point stays a point."""
    origin = Place(at + axis * x.at.z)
    if x.angle is None and x.dir is None:
        return Marker.model_construct(at=origin)
    return Marker.model_construct(at=origin, angle=None, dir=Vector(axis * x.direction))
