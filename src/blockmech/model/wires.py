"""Wires: what a block gives and takes at its ports, and what is wrong with a wire between two.

A wire of motion runs from a marker of a link to a joint or to a terminal of an element; one of a
signal from an output, of a signal block or of the mechanism, to an input or to the law of a load.
"""

from __future__ import annotations

from collections.abc import Collection, Container, Iterable, Iterator, Mapping
from typing import Any, TypeAlias

from blockmech.blocks.contract import Block, Moving
from blockmech.couplings.contract import Coupling
from blockmech.ground.errors import Problem, close_match, listed, unknown_name
from blockmech.ground.names import MECHANISM, split_address
from blockmech.ground.values import Marker
from blockmech.loads.contract import LAW, Element, Following
from blockmech.model.diagram import AnyBlock, Ends, Wire, driven_joints
from blockmech.signals.contract import Signal

Blocks: TypeAlias = Mapping[str, AnyBlock]
Sensed: TypeAlias = Collection[str] | None
"""What names of outputs begin with that belong to no block; None of a wire of motion."""

SIGNAL = "signal"
OF_SIGNALS = "a signal goes from an output to an input of a signal block, or to the law of a load"


def inlets(block: AnyBlock) -> dict[str, str]:
    """What a wire can end at -> what must come there: a place, a guide, a link or a signal."""
    if isinstance(block, Moving):
        return {joint.name: joint.pair.reads for joint in block.joints.values() if joint.outer}
    if isinstance(block, Signal):
        return dict.fromkeys(block.inputs, SIGNAL)
    takes = {}
    if isinstance(block, Element):
        takes = {name: terminal.kind for name, terminal in block.terminals.items()}
    return takes | dict.fromkeys(block.ports if isinstance(block, Following) else (), SIGNAL)


def signal_wire(blocks: Blocks, ends: Ends) -> bool:
    """Whether a wire has to do with signals: it ends or starts at a signal block, or at a law."""
    target = blocks.get(ends.target)
    if isinstance(blocks.get(ends.source), Signal) or isinstance(target, Signal):
        return True
    return ends.port == LAW and isinstance(target, Element)


def unwired(blocks: Blocks, fed: Container[str]) -> Iterator[Problem]:
    """Joints, terminals and inputs to which nothing is wired."""
    for name, block in blocks.items():
        for port, takes in inlets(block).items():
            if (end := f"{name}.{port}") not in fed:
                one, source = ("input", "output") if takes == SIGNAL else ("joint", "marker")
                message, remedy = "nothing is wired to it", f'connect("block.{source}", "{end}")'
                yield Problem("unwired-joint", end, message, f"every {one} needs one wire", remedy)


def checked_wires(
    blocks: Blocks, wires: Iterable[Wire]
) -> Iterator[tuple[Wire, Ends, list[Problem]]]:
    """Wires with their ends, and what is locally wrong with each."""
    fed: dict[str, Wire] = {}
    for wire in wires:
        ends = wire.split_ends(blocks)
        problems = list(wire_problems(blocks, wire, ends, fed.get(wire.target)))
        yield wire, ends, problems
        if not problems:
            fed.setdefault(wire.target, wire)


def wire_problems(
    blocks: Blocks, wire: Wire, ends: Ends, fed: Wire | None, sensed: Sensed = None
) -> Iterator[Problem]:
    """What is locally wrong with a wire; whether an output is there, compiling finds.

    ``ends`` are its own in these blocks; ``fed`` is an earlier wire to the same joint.
    """
    if fed is None and _joins(blocks, ends):
        return
    if sensed is not None or signal_wire(blocks, ends):
        without_block = {MECHANISM, *driven_joints(blocks)}  # drivers in groups may have a name
        yield from _local_problems(blocks, wire, fed, sensed or without_block)
        return
    problems = list(_local_problems(blocks, wire, fed))
    if not problems or any(_local_problems(blocks, wire.turned, None)):
        yield from problems
    elif problems[0].code == "not-a-marker":
        yield problems[0]
    else:
        message, valid = "a wire does not end there", "a wire runs from a marker to a joint"
        remedy = f"turn the wire round: {wire.turned}"
        yield Problem(problems[0].code, wire.target, message, valid, remedy)


def _joins(blocks: Blocks, ends: Ends) -> bool:
    """Whether a wire of motion plainly fits: what the rules below have nothing to say of."""
    source, marker, target, port = ends
    holder, block = blocks.get(source), blocks.get(target)
    if source == target or not isinstance(holder, Block) or not isinstance(block, Block):
        return False
    takes, declared = inlets(block).get(port, SIGNAL), holder.all_markers.get(marker)
    guided = declared is not None and (takes != "guide" or not _pointlike(declared[1]))
    return guided and takes != SIGNAL


def _pointlike(marker: object) -> bool:
    """Whether a marker has no direction of its own."""
    return isinstance(marker, Marker) and marker.angle is None and marker.dir is None


def _local_problems(
    blocks: Blocks, wire: Wire, fed: Wire | None, sensed: Sensed = None
) -> Iterator[Problem]:
    marker = yield from _source_problems(blocks, wire, sensed)
    yield from _target_problems(blocks, wire, marker, fed, sensed)


def _source_problems(blocks: Blocks, wire: Wire, sensed: Sensed) -> Any:
    block, name = yield from _end(blocks, wire, wire.source, sensed)
    if isinstance(block, Signal):
        if name not in block.ports:
            yield unknown_name(
                "unknown-output", "output", name, wire.source, block.ports, there=" there"
            )
    elif not isinstance(block, Block) or sensed:
        return None
    elif isinstance(block, Coupling | Element):
        message, remedy = f"{block.type_name} has no markers", f"turn the wire round: {wire.turned}"
        valid = "a wire starts at a marker of a link and ends at the element"
        if isinstance(block, Coupling):
            message = "a coupling has no markers"
            valid, remedy = "a coupling names its drivers, and takes no wires", "remove the wire"
        yield Problem("not-a-marker", wire.source, message, valid, remedy)
    elif name not in block.all_markers:
        add = "add the marker to a link of the block"
        yield unknown_name(
            "unknown-marker", "marker", name, wire.source, block.all_markers, add, " there"
        )
    else:
        return block.all_markers[name][1]
    return None


def _target_problems(
    blocks: Blocks, wire: Wire, marker: Any, fed: Wire | None, sensed: Sensed
) -> Iterator[Problem]:
    block, name = yield from _end(blocks, wire, wire.target, sensed)
    if not isinstance(block, Block):
        return
    ports = [port for port, x in inlets(block).items() if (x == SIGNAL) == bool(sensed)]
    if name not in ports:
        message, remedy = f'no joint "{name}"', close_match(name, ports)
        valid = f"joints that take a wire: {listed(ports)}" if ports else "it takes no wires"
        if sensed:
            message, valid = f'no input "{name}" for signals', f"inputs there: {listed(ports)}"
            valid = valid if ports else OF_SIGNALS
            if isinstance(block, Following) and not ports:
                message, remedy = "its law is no signal", 'give it the law {"kind": "signal"}'
        elif name in block.joints:
            message = "an inner joint takes no wire"
        yield Problem("unknown-joint", wire.target, message, valid, remedy)
        return
    if fed is not None:
        message = f"already fed by {fed.source}, cannot also take {wire.source}"
        valid, remedy = "has one source", f"remove one of: {fed}; {wire}"
        valid = f"an input {valid}" if sensed else f"a joint {valid}"
        yield Problem("double-wire", wire.target, message, valid, remedy)
    ends = wire.split_ends(blocks)
    if not sensed and ends.source == ends.target:
        message = f"fed by {wire.source} of the same block"
        valid = "a joint is fed by an earlier block"
        yield Problem("self-wire", wire.target, message, valid, "wire it to another block")
    if inlets(block)[name] == "guide" and _pointlike(marker):
        message = f"a prismatic joint needs a guide, {wire.source} is a point"
        valid = "a guide is a marker with a direction"
        remedy = f'give {wire.source} an "angle" [rad] or a "dir" [dx, dy]'
        yield Problem("pair-mismatch", wire.target, message, valid, remedy)


def _end(blocks: Blocks, wire: Wire, end: str, sensed: Sensed) -> Any:
    """The block at an end of a wire, if it is there, and the name after the dot."""
    name, port = split_address(end, blocks) if isinstance(end, str) else ("", "")
    inside = "." in port and not sensed
    if inside and any(n.startswith(f"{name}.") for n in blocks):
        name, _, port = end.rpartition(".")
    carried = port in getattr(blocks.get(name), "all_markers", ())
    if not (name and port) or ("." in port and not sensed and not carried):
        kinds = '"block.output" or "block.input"' if sensed else '"block.joint" or "block.marker"'
        message, valid = f'not an address, in wire "{wire}"', f"an address is {kinds}"
        yield Problem("bad-address", str(end) or '""', message, valid)
    elif name in blocks:
        return blocks[name], port
    elif end == wire.target or name not in (sensed or ()):
        yield no_such_block(blocks, name, end, "add the block first")
    return None, ""


def no_such_block(blocks: Blocks, name: str, where: str, remedy: str = "") -> Problem:
    """The problem of a name that is no block's."""
    return unknown_name("no-such-block", "block", name, where, blocks, remedy)
