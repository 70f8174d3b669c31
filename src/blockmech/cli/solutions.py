"""``blockmech solutions``: all solutions of the friction equations at given poses."""

from __future__ import annotations

from typing import Annotated

import typer

from blockmech.builders import compiled
from blockmech.cli.numbers import row
from blockmech.cli.options import GraphFile, Poses, Static, Want, names_of, option
from blockmech.cli.output import TableDisplay
from blockmech.cli.terminal import NO_ANSWER
from blockmech.typing import Arguments

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
    request["scale"] = row(f"--scale {scale}", scale, "")
    report = display.answer_command(
        file,
        compiled,
        "searching",
        lambda m: m.friction_solutions(**poses.of(m, display.deg), **request),
    )
    if not report.complete.all():
        raise typer.Exit(NO_ANSWER)
