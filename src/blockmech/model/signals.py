"""The checks of signal wires: from an output to an input, and no marker in between."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import TypeAlias

from blockmech.ground.errors import Problem, close_match, listed
from blockmech.ground.values import split_address
from blockmech.loads.contract import LAW, Element, Following
from blockmech.model.diagram import AnyBlock, Ends, Wire
from blockmech.signals.contract import Signal

Blocks: TypeAlias = Mapping[str, AnyBlock]
VALID = "a signal goes from an output to an input of a signal block, or to the law of a load"


def signal_ports(block: AnyBlock) -> tuple[str, ...]:
    """Names of a block's inputs for signals."""
    if isinstance(block, Signal):
        return block.inputs
    return block.ports if isinstance(block, Following) else ()


def signal_wire(blocks: Blocks, ends: Ends) -> bool:
    """Whether a wire has to do with signals: it ends or starts at a signal block, or at a law."""
    target = blocks.get(ends.target)
    if isinstance(blocks.get(ends.source), Signal) or isinstance(target, Signal):
        return True
    return ends.port == LAW and isinstance(target, Element)


def signal_wire_problems(
    blocks: Blocks, wire: Wire, fed: Wire | None, sensed: Collection[str] = ("mechanism",)
) -> Iterator[Problem]:
    """What is wrong with a signal wire; whether an output is there, compiling finds.

    ``sensed`` is what names of outputs begin with that belong to no block.
    """
    for end in (wire.source, wire.target):
        name, port = split_address(str(end), blocks)
        if not (name and port):
            found, valid = f'not an address, in wire "{wire}"', '"block.output" or "block.input"'
            yield Problem("bad-address", str(end) or '""', found, f"an address is {valid}")
            return
        if name not in blocks and (end == wire.target or name not in sensed):
            remedy = close_match(name, blocks) or "add the block first"
            there = f"blocks: {listed(blocks)}"
            yield Problem("no-such-block", str(end), f'no block "{name}"', there, remedy)
            return
    yield from _source_problems(blocks, wire)
    yield from _target_problems(blocks, wire, fed)


def _source_problems(blocks: Blocks, wire: Wire) -> Iterator[Problem]:
    name, port = split_address(wire.source, blocks)
    block = blocks.get(name)
    if isinstance(block, Signal) and port not in block.ports:
        found, valid = f'no output "{port}"', f"outputs there: {listed(block.ports)}"
        yield Problem("unknown-output", wire.source, found, valid, close_match(port, block.ports))


def _target_problems(blocks: Blocks, wire: Wire, fed: Wire | None) -> Iterator[Problem]:
    name, port = split_address(wire.target, blocks)
    block = blocks[name]
    ports = signal_ports(block)
    if isinstance(block, Following) and not ports:
        found, remedy = "its law is no signal", 'give it the law {"kind": "signal"}'
        yield Problem("unknown-joint", wire.target, found, VALID, remedy)
        return
    if port not in ports:
        found = f'no input "{port}" for signals'
        valid = f"inputs there: {listed(ports)}" if ports else VALID
        yield Problem("unknown-joint", wire.target, found, valid, close_match(port, ports))
        return
    if fed is not None:
        found = f"already fed by {fed.source}, cannot also take {wire.source}"
        remedy = f"remove one of: {fed}; {wire}"
        yield Problem("double-wire", wire.target, found, "an input has one source", remedy)
