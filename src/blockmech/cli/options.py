"""The options that commands share, and what does not go together."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from blockmech.cli.numbers import MOST
from blockmech.errors import refused


def option(help: str, metavar: str | None = None, **more: Any) -> Any:
    """An option with a value."""
    return typer.Option(help=help, metavar=metavar, **more)


def switch(name: str, help: str) -> Any:
    """An option without a value."""
    return typer.Option(f"--{name}", help=help)  # named, or typer adds --no-name


GraphFile = Annotated[
    str, typer.Argument(metavar="FILE", help="A graph of blocks, or links and joints (JSON).")
]
At = Annotated[
    list[str] | None,
    option(
        "Driver coordinates, e.g. 0,1,60deg or 0:360deg:37; once for each driver.",
        "[DRIVER=]NUMBERS",
    ),
]
Samples = Annotated[int | None, option("Samples of the file's range (361).", "N", min=1, max=MOST)]
Times = Annotated[
    str | None, typer.Option("--times", metavar="TIMES", help="Times [s], e.g. 0:2:201.")
]
Want = Annotated[
    list[str] | None, option('Outputs or patterns, e.g. crank.drive,"*.reaction".', "A,B")
]
Friction = Annotated[str | None, option("none, single, successive or newton.", "METHOD")]
Tolerance = Annotated[float | None, option("Stop of successive approximations [N].", "X")]
Iterations = Annotated[int | None, option("Fixed number of successive approximations.", "K")]
Static = Annotated[bool, switch("static", "Leave inertia out.")]
Explain = Annotated[bool, switch("explain", "Only show what would be computed.")]
AsJson = Annotated[bool, switch("json", "Print as JSON.")]
DegreesOfText = Annotated[bool, switch("deg", "Angles in degrees in the text.")]


def names_of(want: list[str] | None) -> tuple[str, ...]:
    """Names and patterns from options that take several, e.g. ``--want``."""
    return tuple(n for part in want or () for n in part.split(",") if n)


def si_only(json: bool, degrees: bool) -> None:
    """Refuse degrees in JSON."""
    if json and degrees:
        raise refused("--deg", "JSON results are in SI units", "leave it out")


def one_of(**given: bool) -> None:
    """Refuse two ways of output at a time."""
    asked = [f"--{name}" for name, on in given.items() if on]
    if len(asked) > 1:
        raise refused(" ".join(asked), "only one of them at a time", "--out writes all files")
