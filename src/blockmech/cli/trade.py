"""``blockmech trade``: what each setting costs and buys, measured on the user's mechanism."""

from __future__ import annotations

import json as text_of
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from blockmech.builders import compiled
from blockmech.cli.numbers import SECONDS, coordinates, row, starts, times
from blockmech.cli.options import (
    At,
    GraphFile,
    Samples,
    Static,
    Times,
    names_of,
    one_of,
    option,
    refused,
    switch,
)
from blockmech.cli.terminal import note, progress_bar, say

if TYPE_CHECKING:
    from blockmech.analysis.trade import Trade

Question = Annotated[str, option("run or simulate.", "QUESTION")]
Wants = Annotated[
    list[str] | None,
    option("Outputs that matter; given more than once, requests are compared.", "A,B"),
]
Budget = Annotated[str, option("Time for the whole.", "TIME")]
Target = Annotated[float | None, option("Wanted error (1e-9).", "X")]
Within = Annotated[str | None, option("Longest time of one run, e.g. 2ms.", "TIME")]
Until = Annotated[str | None, option("Of simulate: standstill, time=2, turns=3 ...", "GOAL")]
Start = Annotated[
    list[str] | None,
    option("Of simulate: where a driver starts, e.g. 60deg,-3deg/s.", "[DRIVER=]Q[,RATE]"),
]
Friction = Annotated[str | None, option("Of simulate: one method of joint friction.", "METHOD")]
Json = Annotated[bool, switch("json", "Print the trade as JSON.")]
Out = Annotated[str | None, option("Write trade.csv, trade.json and trade.png.", "DIR")]
Plot = Annotated[str | None, option("Draw it (png, svg, pdf).", "FILE")]


def trade(
    file: GraphFile,
    question: Question = "run",
    want: Wants = None,
    budget: Budget = "30s",
    target: Target = None,
    within: Within = None,
    at: At = None,
    samples: Samples = None,
    at_times: Times = None,
    until: Until = None,
    start: Start = None,
    friction: Friction = None,
    static: Static = False,
    json: Json = False,
    out: Out = None,
    plot: Plot = None,
) -> None:
    """Measure speed against accuracy for this mechanism, and recommend a setting."""
    from blockmech.analysis.trade import trade as traded
    from blockmech.draw.paper import suffix_of

    one_of(json=json, out=out is not None, plot=plot is not None)
    mechanism = compiled(file)
    wants: list[Any] = [names_of([text]) for text in want or ()] or [None]
    if len(wants) > 1 and (out is not None or plot is not None):
        raise refused("--want", "pictures and files are of one request", "give --want once")
    # What is wrong is said before anything is measured.
    if plot is not None:
        suffix_of(plot)
    for names in wants:
        mechanism.outputs.match(names or ())
    request: dict[str, Any] = {
        "at": coordinates(mechanism, at or []),
        "samples": samples,
        "times": times(at_times),
        "until": until,
        "start": starts(mechanism, start or []),
        "friction": friction,
        "static": static or None,
        "target": target,
        "within": None if within is None else _seconds("--within", within),
    }
    given = {k: v for k, v in request.items() if v is not None}
    each = _seconds("--budget", budget) / len(wants)
    with progress_bar("measuring", still=True) as told:
        found = [
            traded(mechanism, question, names, each, say=told, **given)  # type: ignore[arg-type]
            for names in wants
        ]
    if json:
        rows = [t.to_dict() for t in found]
        say(text_of.dumps(rows[0] if len(rows) == 1 else rows, indent=2))
    else:
        say("\n\n".join(t.text() for t in found))
        if len(found) > 1:
            say("\n\nrequests compared")
            say("\n".join(f"  {t.question}: {t.recommendation}" for t in found))
        with progress_bar("drawing"):
            say("".join(f"wrote {path}\n" for path in _written(found[0], out, plot)), end="")
    if any(s.why == "interrupted" for t in found for s in t.skipped):
        note("interrupted: what was measured is kept")


def _written(found: Trade, out: str | None, plot: str | None) -> list[Path]:
    """The files that are asked for, written."""
    from blockmech.draw.trade import draw_trade
    from blockmech.files import folder

    if plot is not None:
        return [draw_trade(found, plot)]
    if out is None:
        return []
    with folder(out) as draft:
        found.to_csv(draft / "trade.csv")
        (draft / "trade.json").write_text(text_of.dumps(found.to_dict(), indent=2), "utf-8")
        draw_trade(found, draft / "trade.png")
        names = sorted(p.name for p in draft.iterdir())
    return [Path(out) / name for name in names]


def _seconds(where: str, text: str) -> float:
    found = row(f"{where} {text}", text, SECONDS)
    if len(found) != 1 or not found[0] > 0:
        raise refused(f"{where} {text}", "not one time above 0", "write for example 30s")
    return found[0]
