"""``blockmech check`` and ``blockmech verify``: is the file right, are the numbers."""

from __future__ import annotations

import json as text_of
from typing import Annotated, Any

import typer

from blockmech.builders import Graph, Opened, opened, problems_in
from blockmech.cli.graphs import At, GraphFile, compiled
from blockmech.cli.numbers import coordinates
from blockmech.cli.terminal import note, patience, say

AsJson = Annotated[bool, typer.Option("--json", help="Print as JSON.")]


def check(file: GraphFile, json: AsJson = False) -> None:
    """Find all problems of a file, or say what the mechanism is.

    Of links and joints that is the formation sequence and the mobility, or what keeps them
    from being a mechanism.
    """
    problems = problems_in(file)
    if json:
        facts = {} if problems else _facts(opened(file))
        listed = [p.to_dict() for p in problems]
        found = {"file": file, "ok": not problems, **facts, "problems": listed}
        say(text_of.dumps(found, indent=2))
    elif problems:
        note(*map(str, problems))
    else:
        say("\n".join(_said(opened(file))))
    if problems:
        raise typer.Exit(2)


def verify(file: GraphFile, at: At = None, json: AsJson = False) -> None:
    """Check balances, powers and the two routes to the driving moment."""
    mechanism = compiled(file)
    given = coordinates(mechanism, at or [])
    with patience("verifying"):
        found = mechanism.verify(**({} if given is None else {"at": given}))
    if json:
        rows = [
            {"name": r.name, "value": r.value, "allowed": r.allowed, "ok": r.ok} for r in found.rows
        ]
        say(text_of.dumps({"file": file, "ok": found.ok, "rows": rows}, indent=2))
    else:
        say(str(found))
    if not found.ok:
        raise typer.Exit(1)


def _said(found: Opened) -> list[str]:
    """The mechanism in lines."""
    if isinstance(found, Graph):
        return [repr(found)]
    return [repr(found), f"mobility {found.compile().structure.mobility}"]


def _facts(found: Opened) -> dict[str, Any]:
    if isinstance(found, Graph):
        structure = found.structure()
        formula = structure.formula
    else:
        made = found.decompose()
        structure, formula = made.graph.structure(), str(made.formation)
    return {
        "graph": found.name,
        "links": len(structure.links) - 1,
        "pairs": structure.pairs,
        "mobility": structure.mobility,
        "formula": formula,
    }
