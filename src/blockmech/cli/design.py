"""Commands from analysis to design: where it rests, how it vibrates, what was measured."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

import blockmech as bm
from blockmech.builders import compiled
from blockmech.cli.numbers import coordinates, number_in, rates_of, texts_by_name
from blockmech.cli.options import At, Friction, GraphFile, Static, names_of, number_of, option
from blockmech.cli.output import PlotDisplay
from blockmech.cli.terminal import note
from blockmech.ground.files import refuse_spared
from blockmech.typing import Arguments

if TYPE_CHECKING:
    from blockmech.mechanism import Mechanism


def equilibria(
    file: GraphFile,
    display: PlotDisplay,
    friction: Friction = None,
    time: Annotated[
        float | None,
        option(
            "Time at which loads that follow it are held [s].", "X", parser=number_of("time", "s")
        ),
    ] = None,
) -> None:
    """Find the static equilibria, their stability, and the intervals in which friction holds."""
    options: Arguments = {"friction": friction, "time": time}
    display.answer_command(file, compiled, "searching", lambda m: m.equilibria(**options))


def solve(
    file: GraphFile,
    display: PlotDisplay,
    want: Annotated[
        list[str], option("Output and its value, e.g. dyad.j.angle=80deg.", "OUTPUT=VALUE")
    ],
    to: Annotated[
        list[str] | None,
        option("Parameters or efforts such as dyad.C.moment; by default the drivers.", "A,B"),
    ] = None,
    at: At = None,
    modes: Annotated[bool, option("Go through all assembly modes.")] = False,
    friction: Friction = None,
    static: Static = False,
) -> None:
    """Find the driver coordinates, parameters or loads that give wanted values."""
    options: Arguments = {"modes": modes, "friction": friction, "static": static}

    def question(m: Mechanism) -> Any:
        targets = texts_by_name("--want", want, "dyad.j.angle=80deg")
        values = {name: _number_or_quantity(text) for name, text in targets}
        return m.solve(values, names_of(to) or (), at=coordinates(m, at, display.deg), **options)

    display.answer_command(file, compiled, "solving", question)


def linearize(
    file: GraphFile,
    display: PlotDisplay,
    at: At = None,
    rates: Annotated[
        list[str] | None,
        option("Rates of a steady motion; by default rest.", "[DRIVER=]NUMBER"),
    ] = None,
    states: Annotated[
        list[str] | None,
        option("States of signal blocks, e.g. pid.integral=0.3; by default at rest.", "STATE=X"),
    ] = None,
    inputs: Annotated[
        list[str] | None, option("Numbers that are inputs, besides the drivers' efforts.", "A,B")
    ] = None,
    outputs: Annotated[
        list[str] | None, option("Outputs of the system; by default the coordinates.", "A,B")
    ] = None,
    friction: Friction = None,
) -> None:
    """Find how the mechanism vibrates about a pose: frequencies, damping, mode shapes."""
    request: Arguments = {"inputs": names_of(inputs), "outputs": names_of(outputs)}
    starts = texts_by_name("--states", states, "pid.integral=0.3")
    at_start = {name: number_in(f"--states {name}", text, "") for name, text in starts}
    request |= {"friction": friction, "states": at_start}

    def ask(m: Mechanism) -> Any:
        return m.linearize(coordinates(m, at, display.deg), rates=rates_of(m, rates), **request)

    display.answer_command(file, compiled, "differentiating", ask)


def balance(
    file: GraphFile,
    display: PlotDisplay,
    numbers: Annotated[
        list[str], option("Addresses of springs and counterweights, e.g. spring.stiffness.", "A,B")
    ],
    want: Annotated[
        list[str] | None,
        option("Outputs that are to be least; by default the efforts of the loads.", "A,B"),
    ] = None,
    at: At = None,
    bounds: Annotated[
        list[str] | None, option("Lowest and highest value of a number.", "ADDRESS=LOW:HIGH")
    ] = None,
    save: Annotated[str | None, option("Write the mechanism with these numbers.", "FILE")] = None,
) -> None:
    """Find the springs or counterweights that minimise the driving effort over the poses."""
    refuse_spared(*filter(None, (save,)))
    ends = {}
    for name, text in texts_by_name("--bounds", bounds, "spring.stiffness=0:5000"):
        low, _, high = text.partition(":")
        ends[name] = _number_or_quantity(low), _number_or_quantity(high)
    targets = names_of(want) or None

    def ask(m: Mechanism) -> Any:
        return bm.design.balance(
            m, names_of(numbers), targets, coordinates(m, at, display.deg), bounds=ends
        )

    balanced = display.answer_command(file, compiled, "balancing", ask)
    if save is not None:
        balanced.mechanism.document.save(save)
        note(f"wrote {save}")


def _number_or_quantity(text: str) -> float | str:
    """A number in SI units, or a text with a unit."""
    try:
        return float(text)
    except ValueError:
        return text


def identify(
    file: GraphFile,
    display: PlotDisplay,
    data: Annotated[
        str,
        typer.Argument(metavar="DATA", help="Measured columns (CSV), e.g. crank.q,crank.drive."),
    ],
    to: Annotated[list[str], option("Addresses of the numbers to identify.", "A,B")],
    friction: Friction = None,
    static: Static = False,
) -> None:
    """Identify parameters of the mechanism from measurements."""
    request: Arguments = {"friction": friction, "static": static}
    display.answer_command(
        file, compiled, "fitting", lambda m: bm.design.identify(m, names_of(to), data, **request)
    )
