"""``blockmech simulate``: let a mechanism move under its loads, and show or write how."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from blockmech.builders import compiled
from blockmech.cli.numbers import roles, starts, times
from blockmech.cli.options import (
    Accuracy,
    Explain,
    FrictionOptions,
    GraphFile,
    Locked,
    Method,
    Prescribed,
    Start,
    Times,
    Until,
    Want,
    names_of,
    number_of,
    option,
)
from blockmech.cli.output import Output
from blockmech.cli.terminal import INTERRUPTED, NO_ANSWER, progress_bar, say
from blockmech.ground.report import LINES
from blockmech.ground.runnable import EVERYTHING
from blockmech.ground.tolerances import ROUNDING
from blockmech.ground.units import shown_in
from blockmech.result.tables import gap_lines
from blockmech.typing import Arguments, FixedStep

if TYPE_CHECKING:
    from blockmech.result.motion import Event
    from blockmech.result.result import Result

DIGITS = math.floor(-math.log10(ROUNDING))  # significant ones of a number: 12
Step = Annotated[
    float | None,
    option(
        "Step of rk4 [s] or euler_q [rad or m], e.g. 1ms.",
        "X",
        parser=number_of("step", "s", "rad", "m"),
    ),
]
Engine = Annotated[str, option("Of the integrators: auto, scalar or llvm (compiled).", "ENGINE")]

Budget = Annotated[
    float | None,
    option("Processor time of the whole, e.g. 10min.", "TIME", parser=number_of("budget", "s")),
]
DRIVERS = ("*.q", "*.rate")  # what is shown where nothing is wanted


def simulate(
    file: GraphFile,
    friction: FrictionOptions,
    output: Output,
    until: Until = None,
    start: Start = None,
    at_times: Times = None,
    prescribed: Prescribed = None,
    locked: Locked = None,
    want: Want = None,
    method: Method = "auto",
    accuracy: Accuracy = None,
    step: Step = None,
    engine: Engine = "auto",
    budget: Budget = None,
    explain: Explain = False,
) -> None:
    """Move a mechanism under its loads from the scene's start or another, and print a table.

    Without --json, --out, --csv or --plot nothing is written. Exit code 1 means that the motion
    ended before a requested time, or could not be computed. Ctrl-C ends the
    run: what was computed until then is shown or written, and the exit code is 130.
    """
    mechanism = output.read(file, compiled)
    names = names_of(want) or (EVERYTHING if output.out is not None else DRIVERS)
    settings: Arguments = {"friction": friction.method}
    if explain:
        from blockmech.dynamics.simulation import evaluation_cost

        say(mechanism.explain(names, **settings), "\n\n", evaluation_cost(mechanism, **settings))
        return
    at, initial = times(at_times), starts(mechanism, start, output.deg)
    fixed: Any = method if step is None else FixedStep(method, step)  # type: ignore[arg-type]
    settings |= {"method": fixed, "engine": engine}
    with progress_bar("simulating") as progress:
        result = mechanism.simulate(
            until,
            accuracy=accuracy,
            times=at,
            start=initial,
            roles=roles(mechanism, prescribed, locked, output.deg),
            want=names,
            budget=budget,
            progress=progress,
            **settings,
        )
        result = output.in_units(result)
        gaps = gap_lines(result)
    output.show(result, gaps, ["", *motion_lines(result)])
    motion = result.motion
    assert motion is not None
    if motion.end == "interrupted":
        raise typer.Exit(INTERRUPTED)
    missed = any(map(math.isnan, motion.reached_times(at or [])))
    if gaps or missed or motion.status in ("failed", "unfinished"):
        raise typer.Exit(NO_ANSWER)


def motion_lines(result: Result) -> list[str]:
    """Lines about a simulation; none for another run."""
    motion = result.motion
    if motion is None:
        return []
    names = list(result.drivers)
    units = [result._unit_of_driver(name) for name in names]
    lines = [f"{e.kind} at {_state(e, names, units, result._display)}" for e in motion.events]
    if len(lines) > LINES:
        lines = [*lines[: LINES - 1], f"... {len(lines) - LINES} events more", lines[-1]]
    return [*lines, *motion.summary()]


def _state(event: Event, names: list[str], units: list[str], outputs: tuple[str, ...]) -> str:
    parts = [f"{event.t:.{DIGITS}g} s"]
    for x, name, unit in zip(np.atleast_1d(event.q).tolist(), names, units, strict=True):
        factor, unit = shown_in(unit, outputs)
        parts.append(f"{name} = {factor * x:.{DIGITS}g} {unit}")
    return ", ".join(parts)
