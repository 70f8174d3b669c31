"""Sensors: outputs of a mechanism that its signal blocks read, and the order of the blocks.

Any output that is one real number is a sensor, by its name. Whether it follows an actuator at
once is not declared anywhere: it is seen from the inputs of the program that computes it.
Positions and rates do not; accelerations, reactions and the loads of actuators do, and then a
chain of feedthrough that leads from the sensor back to the actuator is an algebraic loop.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from blockmech.ground.errors import GraphError, Problem
from blockmech.ground.names import MECHANISM, split_address
from blockmech.model.scene import Scene
from blockmech.model.structure import Structure
from blockmech.outputs.by_owner import unknown_output, vector_sensor
from blockmech.passes.homotopy import schedule
from blockmech.passes.signals import NO_NAME, UNKNOWN
from blockmech.plan.plan import Friction, Output, Schedule
from blockmech.plan.values import Value
from blockmech.typing import Data

if TYPE_CHECKING:
    import networkx as nx

REMEDY = "put a block with a state in it, as a filter (signal.transfer_function) or a sample"


Read = Callable[[Output], "Callable[..., Value] | None"]
"""How a program reads an output, see `blockmech.outputs.by_block.in_program`."""


def with_sensors(
    structure: Structure, scene: Scene, outputs: Mapping[str, Output], read: Read
) -> Structure:
    """The structure with its sensors, and its signal blocks in the order of evaluation.

    ``outputs`` are those of the mechanism by name, and ``read`` says how one is read.

    Raises `GraphError` with what is read and is no sensor, and for an algebraic loop.
    """
    sensors, problems = {}, list[Problem]()
    for ref, address in structure.signal_wires.items():
        if split_address(address, structure.signals)[0] in structure.signals:
            continue
        sensor = _sensor(outputs, read, address)
        if isinstance(sensor, Problem):
            problems.append(replace(sensor, where=f"{address} -> {ref}"))
        else:
            sensors[address] = sensor
    GraphError.raise_for(problems)
    signals = {name: structure.signals[name] for name in _ordered(structure, scene, sensors)}
    return replace(structure, sensors=sensors, signals=signals)


def _sensor(outputs: Mapping[str, Output], read: Read, address: str) -> Any:
    """The rule that answers an output, or the problem of what is none."""
    if address not in outputs:
        return unknown_output(address, outputs)
    output = outputs[address]
    if output.kind == "vector":
        return vector_sensor(address)
    reading = read(output)
    if reading is None:
        return Problem("no-sensor", address, "it is not one number at an instant")
    return partial(_value, output, reading)


def _value(output: Output, reading: Callable[..., Value], s: Schedule) -> Value:
    return reading(s, *output.ask(s))


# -- order ---------------------------------------------------------------------------------


def _ordered(structure: Structure, scene: Scene, sensors: Data) -> list[str]:
    """Signal blocks, each after those that it reads at once. Raises `GraphError` for a loop."""
    import networkx as nx

    graph = nx.DiGraph()
    graph.add_nodes_from(structure.signals)
    for source, target in _edges(structure, scene, sensors):
        graph.add_edge(source, target)
    loop = next((c for c in nx.strongly_connected_components(graph) if _turns(graph, c)), None)
    if loop is not None:
        names = [x for edge in nx.find_cycle(graph.subgraph(loop)) for x in edge[:1]]
        start = names.index(min(names))
        names = [*names[start:], *names[:start]]
        where = next(n for n in names if n in structure.signals or n in structure.elements)
        message = f"algebraic loop: {' -> '.join([*names, names[0]])}"
        valid = "each block needs the value of the next one at the same instant"
        raise GraphError(Problem("algebraic-loop", where, message, valid, REMEDY))
    order = nx.lexicographical_topological_sort(graph, key=str)
    return [name for name in order if name in structure.signals]


def _turns(graph: nx.DiGraph, component: set[str]) -> bool:
    return len(component) > 1 or any(graph.has_edge(name, name) for name in component)


def _edges(structure: Structure, scene: Scene, sensors: Data) -> Iterator[tuple[str, str]]:
    """From what gives a value to what needs it at once; sensors and loads are nodes as well."""
    loads = {ref.block for ref in structure.signal_wires if ref.block in structure.elements}
    for ref, address in structure.signal_wires.items():
        source, port = split_address(address, structure.signals)
        if source in structure.signals:
            block = structure.signals[source]
            at_once = port in block.outputs and not block.discrete
            source = source if at_once else ""
        else:
            source = address
        if source and (ref.block in loads or ref.name in structure.signals[ref.block].feedthrough):
            yield source, ref.block
    for address, rule in sensors.items():
        # Inputs of the program of a sensor where every signal is one.
        s = schedule(replace(structure, signals={}, sensors={}), scene, Friction("none"))
        needs = s.program([rule(s)]).inputs
        if any(name.startswith("qdd") for name in needs):
            yield MECHANISM, address
        writers = {
            UNKNOWN + NO_NAME.sub("_", a): r.block for r, a in structure.signal_wires.items()
        }
        for name in needs & writers.keys():
            if writers[name] in loads:
                yield writers[name], address
    for name in loads:
        yield name, MECHANISM
