"""Commands from analysis to design: where it rests, how it vibrates, what was measured."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from blockmech.builders import compiled
from blockmech.cli.numbers import coordinates, rates_of
from blockmech.cli.options import (
    AsJson,
    At,
    DegreesOfText,
    Friction,
    GraphFile,
    Static,
    names_of,
    one_of,
    option,
    quantity,
    si_only,
)
from blockmech.cli.output import check_places, write_found
from blockmech.cli.terminal import answer, progress_bar, reading
from blockmech.told import DEGREES

Plot = Annotated[str | None, option("Draw the answer (png, svg, pdf).", "FILE")]


def equilibria(
    file: GraphFile,
    friction: Friction = None,
    time: Annotated[
        float | None,
        option(
            "Time at which loads that follow it are held [s].", "X", parser=quantity("time", "s")
        ),
    ] = None,
    plot: Plot = None,
    deg: DegreesOfText = DEGREES,
    json: AsJson = False,
) -> None:
    """Find where the mechanism comes to rest, stable or not, and what friction holds."""
    si_only(json, deg)
    one_of(json=json, plot=plot is not None)
    check_places(None, plot)
    with reading(file):
        mechanism = compiled(file)
    with progress_bar("searching"):
        found = mechanism.equilibria(friction=friction, time=time)  # type: ignore[arg-type]
    answer(file, json, found.to_dict(), found.text(degrees=deg))
    write_found(found, None, plot)


def linearize(
    file: GraphFile,
    at: At = None,
    rates: Annotated[
        list[str] | None,
        option("Rates of a steady motion; by default rest.", "[DRIVER=]NUMBER"),
    ] = None,
    inputs: Annotated[
        list[str] | None, option("Numbers that are inputs, besides the drivers' efforts.", "A,B")
    ] = None,
    outputs: Annotated[
        list[str] | None, option("Outputs of the system; by default the coordinates.", "A,B")
    ] = None,
    friction: Friction = None,
    plot: Plot = None,
    deg: DegreesOfText = DEGREES,
    json: AsJson = False,
) -> None:
    """Find how the mechanism vibrates about a pose: frequencies, damping, mode shapes."""
    si_only(json, deg)
    one_of(json=json, plot=plot is not None)
    check_places(None, plot)
    with reading(file):
        mechanism = compiled(file)
    asked: dict[str, Any] = {"rates": rates_of(mechanism, rates or []), "friction": friction}
    asked |= {"inputs": names_of(inputs), "outputs": names_of(outputs)}
    with progress_bar("differentiating"):
        found = mechanism.linearize(coordinates(mechanism, at or []), **asked)
    answer(file, json, found.to_dict(), found.text(degrees=deg))
    write_found(found, None, plot)


def identify(
    file: GraphFile,
    data: Annotated[
        str,
        typer.Argument(metavar="DATA", help="Measured columns (CSV), e.g. crank.q,crank.drive."),
    ],
    to: Annotated[list[str], option("Addresses of the numbers to identify.", "A,B")],
    friction: Friction = None,
    static: Static = False,
    plot: Plot = None,
    json: AsJson = False,
) -> None:
    """Identify numbers of the mechanism from what was measured on it."""
    one_of(json=json, plot=plot is not None)
    check_places(None, plot)
    with reading(file):
        mechanism = compiled(file)
    with progress_bar("fitting"):
        asked: dict[str, Any] = {"friction": friction, "static": static}
        found = mechanism.identify(names_of(to), data, **asked)
    answer(file, json, found.to_dict(), found.text())
    write_found(found, None, plot)
