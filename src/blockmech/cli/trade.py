"""``blockmech trade``: what each setting costs and buys, measured on the user's mechanism."""

from __future__ import annotations

import json as text_of
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from blockmech.builders import compiled
from blockmech.cli.numbers import starts
from blockmech.cli.options import (
    AsJson,
    GraphFile,
    Poses,
    Start,
    Static,
    Until,
    at_most_one,
    names_of,
    number_of,
    option,
)
from blockmech.cli.output import check_places, csv_place, fill_folder, write_answer
from blockmech.cli.terminal import Interrupted, pour, progress_bar, reading, say
from blockmech.ground.errors import refused
from blockmech.ground.files import refuse_spared
from blockmech.typing import Arguments

if TYPE_CHECKING:
    from blockmech.analysis.trade import Trade

Question = Annotated[str, option("run or simulate.", "QUESTION")]
Wants = Annotated[
    list[str] | None,
    option("Outputs that matter; given more than once, requests are compared.", "A,B"),
]
Budget = Annotated[
    float, option("Time for the whole, e.g. 30s.", "TIME", parser=number_of("budget", "s"))
]
Target = Annotated[float | None, option("Wanted error (1e-9).", "X")]
Within = Annotated[
    float | None,
    option("Longest time of one run, e.g. 2ms.", "TIME", parser=number_of("within", "s")),
]
Friction = Annotated[str | None, option("Of simulate: one method of joint friction.", "METHOD")]
Csv = Annotated[str | None, option("Write the points (csv); - prints them.", "FILE")]
Out = Annotated[str | None, option("Write trade.csv, trade.json and trade.png.", "DIR")]
Plot = Annotated[str | None, option("Draw it (png, svg, pdf).", "FILE")]

FILES = ("trade.csv", "trade.json", "trade.png")


def trade(
    file: GraphFile,
    poses: Poses,
    question: Question = "run",
    want: Wants = None,
    budget: Budget = 30.0,
    target: Target = None,
    within: Within = None,
    until: Until = None,
    start: Start = None,
    friction: Friction = None,
    static: Static = False,
    json: AsJson = False,
    csv: Csv = None,
    out: Out = None,
    plot: Plot = None,
) -> None:
    """Measure speed against accuracy for this mechanism, and recommend a setting."""
    at_most_one(json=json, csv=csv is not None, out=out is not None, plot=plot is not None)
    csv = csv_place(csv)
    mechanism = reading(file, compiled)
    wants: list[Any] = [names_of([text]) for text in want or ()] or [None]
    if len(wants) > 1 and any(target_file is not None for target_file in (csv, out, plot)):
        raise refused("--want", "pictures and files are of one request", "give --want once")
    # What is wrong is said before anything is measured.
    outputs = [Path(out) / name for name in FILES] if out is not None else []
    refuse_spared(*outputs)
    check_places(csv, plot)
    for names in wants:
        mechanism.outputs.match(names or ())
    request: Arguments = {
        **poses.of(mechanism),
        "until": until,
        "start": starts(mechanism, start),
        "friction": friction,
        "static": static or None,
        "target": target,
        "within": within,
    }
    arguments = {k: v for k, v in request.items() if v is not None}
    share = budget / len(wants)
    with progress_bar("measuring", still=True) as progress:
        trades: list[Trade] = []
        for names in wants:
            if not (trades and _interrupted(trades[-1])):
                trades.append(mechanism.trade(question, names, share, say=progress, **arguments))  # type: ignore[arg-type]
    if json:
        rows = [t.to_dict() for t in trades]
        say(text_of.dumps(rows[0] if len(rows) == 1 else rows, indent=2))
    elif csv == "-":
        pour([trades[0].to_csv()])
    else:
        say("\n\n".join(t.text() for t in trades))
        if len(trades) > 1:
            say("\n\nrequests compared")
            say("\n".join(f"  {t.question}: {t.recommendation}" for t in trades))
        write_answer(trades[0], csv, plot)
        if out is not None:
            say("\n".join(f"wrote {path}" for path in _fill(trades[0], Path(out))))
    if _interrupted(trades[-1]):
        raise Interrupted("what was measured is kept")


def _interrupted(measured: Trade) -> bool:
    return any(s.why == "interrupted" for s in measured.skipped)


def _fill(measured: Trade, out: Path) -> list[Path]:
    """A folder with the numbers and, of what was not interrupted, the picture."""
    data = text_of.dumps(measured.to_dict(), indent=2)
    numbers = {FILES[0]: [measured.to_csv()], FILES[1]: [data]}
    if _interrupted(measured):
        return fill_folder(out, numbers, FILES)
    picture = out / FILES[-1]

    def draw() -> list[Path]:
        measured.plot(picture)
        return [picture]

    return fill_folder(out, numbers, FILES, draw)
