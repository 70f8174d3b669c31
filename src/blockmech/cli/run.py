"""``blockmech run``: compute a mechanism's outputs and show or write them."""

from __future__ import annotations

from collections.abc import Collection
from typing import Annotated

import typer

from blockmech.builders import compiled
from blockmech.cli.options import (
    Explain,
    FrictionOptions,
    GraphFile,
    Poses,
    Static,
    Want,
    names_of,
    option,
)
from blockmech.cli.output import Output
from blockmech.cli.terminal import NO_ANSWER, note, progress_bar, say
from blockmech.ground.runnable import EVERYTHING
from blockmech.result.tables import gap_lines, leading
from blockmech.typing import Arguments

Accuracy = Annotated[
    float | None, option("Wanted relative error; chooses friction method and precision.", "X")
]
Engine = Annotated[str, option("auto, scalar, numpy or llvm (compiled).", "ENGINE")]
Precision = Annotated[str | None, option("complex64, complex128 or clongdouble (numpy).", "TYPE")]
OnGap = Annotated[str, option("Samples without an answer: mark, raise or stop.", "WHAT")]


def run(
    file: GraphFile,
    poses: Poses,
    friction: FrictionOptions,
    output: Output,
    want: Want = None,
    accuracy: Accuracy = None,
    static: Static = False,
    engine: Engine = "auto",
    precision: Precision = None,
    on_gap: OnGap = "mark",
    explain: Explain = False,
) -> None:
    """Compute a mechanism over its range and print a table.

    Without --json, --out, --csv or --plot nothing is written. Exit code 1 means that some sample
    has no answer.
    """
    mechanism = output.read(file, compiled)
    request: Arguments = {
        "want": names_of(want) or EVERYTHING,
        "static": static,
        "friction": friction.method,
    }
    if explain:
        say(mechanism.explain(**request))
        return
    everything: Collection[str] = ()
    if output.is_table and not want:
        everything = mechanism.outputs
        request["want"] = leading(mechanism.outputs)  # the table has no room for more
    request |= poses.of(mechanism, output.deg) | {"engine": engine, "precision": precision}
    from blockmech.result.failures import why_not, without_gaps  # brings what runs

    with progress_bar("computing"):
        result = mechanism.run(**request, accuracy=accuracy, on_gap="mark")
        result = output.in_units(result)
        gaps = gap_lines(result)
        why = [why_not(result)] if gaps else []
        result = without_gaps(result, on_gap)
    if result.accuracy is not None:
        note(str(result.accuracy))
    output.show(result, [*gaps, *why], ["", *why] if why else [], everything)
    if on_gap == "stop" and not output.is_data:  # the table does not reach them
        note(*gaps)
    if gaps:
        raise typer.Exit(NO_ANSWER)
