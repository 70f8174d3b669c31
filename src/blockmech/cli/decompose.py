"""``blockmech decompose``: links and joints as a graph of blocks."""

from __future__ import annotations

from collections.abc import Iterator
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated

import typer

from blockmech.builders import Graph, opened
from blockmech.cli.options import FILE_OR_NAME, AsJson
from blockmech.cli.terminal import answer, reading
from blockmech.ground.errors import refused
from blockmech.model.naming import JointName
from blockmech.model.structure import Structure
from blockmech.result.tables import aligned
from blockmech.typing import Data

if TYPE_CHECKING:
    from blockmech.builders import Decomposition


class General(StrEnum):
    """Which Assur groups become general ones."""

    groups = "groups"
    one = "one"


def decompose(
    file: Annotated[str, typer.Argument(help="Links and joints (JSON).", **FILE_OR_NAME)],
    output: Annotated[
        str | None,
        typer.Option("--output", "-o", metavar="GRAPH", help="Write the graph of blocks."),
    ] = None,
    general: Annotated[
        General | None,
        typer.Option(help="Make every group a general one, or one of all; for comparison."),
    ] = None,
    json: AsJson = False,
) -> None:
    """Find drivers and Assur groups in formation order, and which block each link became.

    Without -o nothing is written.
    """
    model = reading(file, opened)
    if isinstance(model, Graph):
        raise refused(file, "it is a graph of blocks already", "name a file of links and joints")
    decomposition = model.decompose(general.value if general else "")
    if output is not None:
        decomposition.graph.save(output)
    lines = [*as_text(decomposition), *([f"wrote {output}"] if output is not None else [])]
    answer(file, json, as_data(decomposition), "\n".join(lines))


def as_data(decomposition: Decomposition) -> Data:
    """A decomposition as a JSON object."""
    names, structure = decomposition.names, decomposition.graph.structure()
    return {
        "graph": decomposition.graph.name,
        "formation": str(decomposition.formation),
        "links_moving": len(structure.links) - 1,
        "pairs": structure.pairs,
        "mobility": structure.mobility,
        "links": {name: str(where.link) for name, where in names.links.items()},
        "joints": {
            name: {"pairs": _pairs(where), "turned": _is_turned(where)}
            for name, where in names.joints.items()
        },
        "drivers": {
            name: {"joint": str(joint), **structure.coordinate(name)._asdict()}
            for name, joint in structure.driven.items()
        },
    }


def as_text(decomposition: Decomposition) -> Iterator[str]:
    """A decomposition as lines: the formula, then what became of links, joints and drivers."""
    structure = decomposition.graph.structure()
    yield f"{decomposition.graph.name}: {decomposition.formation}"
    yield (
        f"{len(structure.links) - 1} moving links, {structure.pairs} pairs, "
        f"mobility {structure.mobility}"
    )
    yield from _table(
        ("link", "block.link"), {n: [str(w.link)] for n, w in decomposition.names.links.items()}
    )
    joints = {
        name: [
            " + ".join(_pairs(where)),
            structure.joint(where.joint).kind,
            "second link first" if _is_turned(where) else "",
        ]
        for name, where in decomposition.names.joints.items()
    }
    yield from _table(("joint", "block.joint", "kind", ""), joints)
    drivers = {n: [str(j), _counted(structure, n)] for n, j in structure.driven.items()}
    yield from _table(("driver", "block.joint", "coordinate of the joint"), drivers)


def _table(head: tuple[str, ...], rows: dict[str, list[str]]) -> Iterator[str]:
    if rows:
        yield from ("", *aligned(head, [[name, *row] for name, row in rows.items()]))


def _pairs(where: JointName) -> list[str]:
    return [str(where.joint), *(str(ref) for ref, _ in where.others)]


def _is_turned(where: JointName) -> bool:
    """Whether the graph's earlier link is the joint's second."""
    return where.flipped and not where.others


def _counted(structure: Structure, driver: str) -> str:
    sign, offset = structure.coordinate(driver)
    q = f"{'-' if sign < 0 else ''}{driver}.q"
    return f"{q} {offset:+.9g}" if offset else q
