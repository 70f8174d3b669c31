"""``blockmech blocks``, ``schema``, ``outputs``: what a file can hold, and what it can be asked."""

from __future__ import annotations

import fnmatch
import json
from collections.abc import Iterator
from enum import StrEnum
from typing import Annotated

import typer

from blockmech.blocks.block import REGISTRY, SHARED_FIELDS, Block
from blockmech.blocks.contract import Moving
from blockmech.builders import compiled
from blockmech.cli.options import AsJson, GraphFile
from blockmech.cli.terminal import answer, reading, say
from blockmech.ground.errors import RequestError
from blockmech.ground.runnable import EVERYTHING
from blockmech.loads.contract import Element, Following
from blockmech.result.data import result_schema
from blockmech.result.tables import aligned
from blockmech.signals.contract import Signal
from blockmech.typing import Data


class Document(StrEnum):
    """Documents that have a schema."""

    graph = "graph"
    joints = "joints"
    result = "result"


def blocks(
    types: Annotated[
        list[str] | None, typer.Argument(metavar="TYPE...", help="Only these, e.g. 'load.*'.")
    ] = None,
) -> None:
    """List the block types with their joints, links and parameters."""
    chosen = {pattern: fnmatch.filter(REGISTRY, pattern) for pattern in types or ["*"]}
    unknown = [REGISTRY.unknown(pattern, "TYPE") for pattern, names in chosen.items() if not names]
    RequestError.raise_for(unknown)
    named = dict.fromkeys(name for names in chosen.values() for name in names)
    say("\n\n".join("\n".join(_describe(name, REGISTRY[name])) for name in named))


def schema(
    document: Annotated[Document, typer.Argument(help="Which document.")] = Document.graph,
) -> None:
    """Print the JSON Schema of a document."""
    from blockmech.model.schema import graph_schema, joints_schema

    schemas = {"graph": graph_schema, "joints": joints_schema, "result": result_schema}
    say(json.dumps(schemas[document](), indent=2))


def outputs(
    file: GraphFile,
    names: Annotated[
        list[str] | None, typer.Argument(metavar="NAME...", help="Only these, e.g. 'crank.*'.")
    ] = None,
    json: AsJson = False,
) -> None:
    """List the outputs of a mechanism: names, units and meanings.

    For a vector, .x and .y after its name are its components.
    """
    catalogue = reading(file, compiled).outputs
    chosen = [catalogue[name] for name in catalogue.match(names or EVERYTHING)]
    rows = [(o.name, o.unit or "-", o.about) for o in chosen]
    data = [{"name": o.name, "unit": o.unit, "kind": o.kind, "about": o.about} for o in chosen]
    answer(file, json, {"outputs": data}, "\n".join(aligned(("output", "unit", "what"), rows)))


def _describe(name: str, block: type[Block]) -> Iterator[str]:
    doc = (block.__doc__ or "").strip().splitlines()
    yield f"{name}  {doc[0] if doc else ''}".replace("``", "").rstrip()
    if issubclass(block, Moving) and block.own_form:
        yield "  links       and pairs are the user's: see the keys links, pairs and home"
        return
    if block.link_names:
        yield f"  links       {', '.join(block.link_names)}"
    for joint in block.joints.values():
        between = f"on {joint.link}" if joint.outer else f"between {' and '.join(joint.links)}"
        wired = f", wired to a {'guide' if joint.pair.reads == 'guide' else 'marker'}"
        remarks = (wired if joint.outer else "") + (", driven" if joint.driven else "")
        yield f"  joint       {joint.name}: {joint.kind}, {between}{remarks}"
    if block.built_in:
        yield f"  markers     {', '.join(block.built_in)}"
    if issubclass(block, Element):
        for terminal, quantity in block.terminals.items():
            yield f"  wire        {terminal}: a {quantity.kind}, takes {quantity.unit}"
    if issubclass(block, Following):
        yield f"  coordinate  of the law: {block.coordinate_text}; or the driver's"
    if issubclass(block, Signal):
        yield f"  outputs     {', '.join(block.outputs)}, and its states"
    yield from _parameters(block)
    if issubclass(block, Moving):
        yield f"  friction    of joints {', '.join(block.joints)}"


def _parameters(block: type[Block]) -> Iterator[str]:
    properties: Data = block.model_json_schema().get("properties", {})
    for name, field in block.model_fields.items():
        if name in SHARED_FIELDS:
            continue
        about = properties.get(name, {})
        unit = next((x["unit"] for x in (about, *about.get("anyOf", ())) if "unit" in x), "")
        default = "" if field.is_required() else f" = {field.get_default()}"
        if not field.is_required() and field.get_default() is None:
            default = ", optional"
        yield f"  parameter   {name}{f' [{unit}]' if unit else ''}{default}"
