"""One question of a mechanism: check, verify, limits, modes, extremes, friction solutions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any

import typer

from blockmech.builders import Graph, Opened, compiled, compiled_of, opened
from blockmech.cli import numbers
from blockmech.cli.numbers import coordinates
from blockmech.cli.options import (
    AsJson,
    At,
    GraphFile,
    Poses,
    Static,
    Want,
    names_of,
    option,
    switch,
)
from blockmech.cli.output import Display, PlotDisplay, Reports, TableDisplay
from blockmech.cli.terminal import NO_ANSWER, WRONG, answer, note, reading
from blockmech.ground.errors import (
    BlockmechError,
    FormatError,
    GraphError,
    Problem,
    RequestError,
    in_file,
    refused,
)
from blockmech.typing import Arguments, Data

if TYPE_CHECKING:
    from blockmech.mechanism import Mechanism


def check(file: GraphFile, json: AsJson = False) -> None:
    """List all problems of a file, or describe the mechanism.

    For links and joints the description is the formation sequence and the mobility, or the reason
    why they are not a mechanism.
    """
    doubts: list[Problem] = []
    try:
        model = reading(file, opened)
        problems = in_file(model.check(), file)
        facts, text = ({}, "") if problems else _facts(model)
        doubts = [] if problems else _closing_warnings(model, file)
    except (FormatError, GraphError) as error:
        problems, facts, text = list(error.problems), {}, ""
    if problems and not json:
        note(*map(str, problems))
    else:
        rows = [p.to_dict() for p in problems]
        facts |= {"remarks": [p.to_dict() for p in doubts]} if doubts else {}
        answer(file, json, {"ok": not problems, **facts, "problems": rows}, text)
        note(*(f"note: {p}" for p in doubts if not json))
    if problems:
        raise typer.Exit(WRONG)


def _closing_warnings(model: Opened, file: str) -> list[Problem]:
    """What breaks no rule and is hardly meant: groups that do not close where it starts."""
    from blockmech.testing.expectations import check_closing

    try:
        check_closing(compiled_of(model, file))
    except BlockmechError as error:
        return [replace(p, where=p.where.split(" (sample")[0], remedy="") for p in error.problems]
    return []


def _facts(model: Opened) -> tuple[Data, str]:
    """What a mechanism is, as data and as text."""
    text = repr(model)
    if isinstance(model, Graph):
        structure = model.structure()
        formula = structure.formula
    else:
        decomposition = model.decompose()
        structure, formula = decomposition.graph.structure(), str(decomposition.formation)
        text += f"\nmobility {structure.mobility}"
        text += f"\n{model.fit_dimensions()}" if model.dimensions else ""
    return {
        "graph": model.name,
        "links": len(structure.links) - 1,
        "pairs": structure.pairs,
        "mobility": structure.mobility,
        "formula": formula,
    }, text


def verify(file: GraphFile, display: Display, at: At = None) -> None:
    """Check balances, powers and the two routes to the driving moment."""
    if not display.answer_command(
        file, compiled, "verifying", lambda m: m.verify(coordinates(m, at, display.deg))
    ).ok:
        raise typer.Exit(NO_ANSWER)


def limits(
    file: GraphFile,
    display: Display,
    driver: Annotated[str | None, option("Only this driver; by default each.", "NAME")] = None,
    at: Annotated[
        list[str] | None,
        option("Where another driver is held; by default where its law begins.", "[DRIVER=]NUMBER"),
    ] = None,
) -> None:
    """Find the arcs of each driver on which the mechanism closes."""

    def search(mechanism: Mechanism) -> Reports:
        moving = mechanism.drivers if driver is None else (driver,)
        fixed = {}
        for name, row in (coordinates(mechanism, at, display.deg) or {}).items():
            if len(row) != 1:
                raise refused(f"--at {name}", f"it names {len(row)} places", "give one number")
            if moving == (name,):
                raise refused(
                    f"--at {name}", "this driver is the one that moves", "hold another one"
                )
            fixed[name] = row[0]
        reports = [
            mechanism.limits(moved, {d: q for d, q in fixed.items() if d != moved})
            for moved in moving or (None,)
        ]
        return Reports("limits", reports)

    display.answer_command(file, compiled, "searching", search)


def modes(
    file: GraphFile,
    display: PlotDisplay,
    at: At = None,
    group: Annotated[list[str] | None, option("Only this group; may be repeated.", "NAME")] = None,
    driver: Annotated[
        str | None,
        option("The driver along which arcs are searched for; by default the only one.", "NAME"),
    ] = None,
    no_arcs: Annotated[bool, switch("no-arcs", "Do not search for the arcs of each mode.")] = False,
) -> None:
    """List all assembly modes of each group, what chooses them, and where they exist."""
    request: Arguments = {"driver": driver, "groups": group or None, "arcs": not no_arcs}
    display.answer_command(
        file, compiled, "searching", lambda m: m.modes(coordinates(m, at, display.deg), **request)
    )


def extremes(
    file: GraphFile,
    display: Display,
    names: Annotated[
        list[str],
        typer.Argument(metavar="OUTPUT...", help="Outputs or patterns, e.g. dyad.C.p.x 'crank.*'."),
    ],
    stroke: Annotated[
        bool, switch("stroke", "The stroke and the time ratio of each instead.")
    ] = False,
) -> None:
    """Find extremes of outputs over the cycle, refined beyond the samples."""

    def search(mechanism: Mechanism) -> Reports:
        method: Any = mechanism.stroke if stroke else mechanism.extremes
        reports = [row for name in names for row in _for_each_match(mechanism, name, method)]
        return Reports("strokes" if stroke else "extremes", reports)

    display.answer_command(file, compiled, "searching", search)


def _for_each_match(mechanism: Mechanism, name: str, ask: Callable[[str], Any]) -> list[Any]:
    """What is asked of an output; of a pattern, of all that fit and have an answer."""
    if not any(sign in name for sign in "*?["):
        return [ask(name)]
    reports: list[Any] = []
    problems: list[Problem] = []
    for match in mechanism.outputs.match([name]):
        try:
            reports.append(ask(match))
        except RequestError as refusal:
            problems += refusal.problems
    if not reports:
        raise RequestError(problems)
    return reports


Scale = Annotated[str, option("Factor of all friction, e.g. 1.5 or 0.5:3:51.", "NUMBERS")]


def solutions(
    file: GraphFile,
    poses: Poses,
    display: TableDisplay,
    want: Want = None,
    scale: Scale = "1",
    static: Static = False,
) -> None:
    """List all solutions of the friction equations, and say whether that is proved.

    The exit code is 1 unless the proof holds at all poses.
    """
    request: Arguments = {"want": names_of(want) or None, "static": static}
    request["scale"] = numbers.row(f"--scale {scale}", scale, "")
    report = display.answer_command(
        file,
        compiled,
        "searching",
        lambda m: m.friction_solutions(**poses.of(m, display.deg), **request),
    )
    if not report.complete.all():
        raise typer.Exit(NO_ANSWER)
