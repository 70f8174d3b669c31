"""``blockmech trade``: what each setting costs and buys, measured on the user's mechanism."""

from __future__ import annotations

import json as text_of
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from blockmech.cli.graphs import At, GraphFile, compiled
from blockmech.cli.numbers import MOST, coordinates, row, times
from blockmech.cli.terminal import note, patience, say
from blockmech.errors import Problem, RequestError

if TYPE_CHECKING:
    from blockmech.analysis.trade import Trade

SPAN = {"": 1.0, "s": 1.0, "ms": 1e-3}

Question = Annotated[str, typer.Option(help="run or simulate.", metavar="QUESTION")]
Want = Annotated[
    list[str] | None,
    typer.Option(help="Outputs that matter; given more than once, requests are compared.",
                 metavar="A,B"),
]  # fmt: skip
Budget = Annotated[str, typer.Option(help="Time for the whole.", metavar="TIME")]
Target = Annotated[float | None, typer.Option(help="Wanted error (1e-9).", metavar="X")]
Within = Annotated[
    str | None, typer.Option(help="Longest time of one run, e.g. 2ms.", metavar="TIME")
]
Until = Annotated[
    str | None, typer.Option(help="Of simulate: standstill, time=2, turns=3 ...", metavar="GOAL")
]
Json = Annotated[bool, typer.Option("--json", help="Print the trade as JSON.")]
Out = Annotated[
    str | None, typer.Option(help="Write trade.csv, trade.json and trade.png.", metavar="DIR")
]
Plot = Annotated[str | None, typer.Option(help="Draw it (png, svg, pdf).", metavar="FILE")]
Count = Annotated[
    int | None, typer.Option(help="Samples of the file's range.", metavar="N", min=1, max=MOST)
]
Times = Annotated[
    str | None, typer.Option("--times", metavar="TIMES", help="Times [s], e.g. 0:2:201.")
]
Static = Annotated[bool, typer.Option("--static", help="Leave inertia out.")]


def trade(
    file: GraphFile,
    question: Question = "run",
    want: Want = None,
    budget: Budget = "30s",
    target: Target = None,
    within: Within = None,
    at: At = None,
    samples: Count = None,
    at_times: Times = None,
    until: Until = None,
    static: Static = False,
    json: Json = False,
    out: Out = None,
    plot: Plot = None,
) -> None:
    """Measure speed against accuracy for this mechanism, and recommend a setting."""
    from blockmech.analysis.trade import trade as traded

    asked = [n for n, on in (("--json", json), ("--out", out), ("--plot", plot)) if on]
    if len(asked) > 1:
        raise _bad(" ".join(asked), "only one of them at a time", "--out writes all files")
    mechanism = compiled(file)
    request: dict[str, Any] = {
        "at": coordinates(mechanism, at or []),
        "samples": samples,
        "times": times(at_times),
        "until": until,
    }
    wants: list[tuple[str, ...] | None] = [
        tuple(n for n in text.split(",") if n) for text in want or ()
    ]
    wants = wants or [None]
    limits = {
        "budget": _seconds("--budget", budget) / len(wants),
        "target": target,
        "within": None if within is None else _seconds("--within", within),
    }
    if len(wants) > 1 and (out is not None or plot is not None):
        raise _bad("--want", "pictures and files are of one request", "give --want once")
    # What is wrong is said before anything is measured.
    if plot is not None:
        from blockmech.draw.trade import refuse_other_suffixes

        refuse_other_suffixes(plot)
    for names in wants:
        mechanism.outputs.match(names or ())
    found = []
    with _progress() as told:
        for names in wants:
            given = {k: v for k, v in request.items() if v is not None}
            found.append(
                traded(mechanism, question, names, **limits, static=static, say=told, **given)  # type: ignore[arg-type]
            )
    _show(found, json, out, plot)
    if any(s.why == "interrupted" for t in found for s in t.skipped):
        note("interrupted: what was measured is kept")


def _show(found: list[Trade], json: bool, out: str | None, plot: str | None) -> None:
    if json:
        rows = [t.to_dict() for t in found]
        say(text_of.dumps(rows[0] if len(rows) == 1 else rows, indent=2))
        return
    lines = ["\n\n".join(t.text() for t in found)]
    if len(found) > 1:
        lines.append(_compared(found))
    with patience("drawing"):
        if out is not None:
            lines += [f"wrote {path}" for path in _folder(found[0], out)]
        elif plot is not None:
            lines.append(f"wrote {found[0].plot(plot)}")
    say("\n".join(lines))


def _compared(found: list[Trade]) -> str:
    """The recommended settings of several requests beside each other."""
    from blockmech.analysis.trade.report import duration, size

    lines = ["", "requests compared"]
    for t in found:
        best = t.recommended
        said = "nothing fits" if best is None else (
            f"{duration(best.seconds)}, error {size(best.error)}: {best.label}")  # fmt: skip
        lines.append(f"  {t.question}: {said}")
    return "\n".join(lines)


def _folder(found: Trade, out: str) -> list[Path]:
    from blockmech.files import folder

    with folder(out) as draft:
        found.to_csv(draft / "trade.csv")
        (draft / "trade.json").write_text(text_of.dumps(found.to_dict(), indent=2), "utf-8")
        found.plot(draft / "trade.png")
        names = sorted(p.name for p in draft.iterdir())
    return [Path(out) / name for name in names]


@contextmanager
def _progress() -> Iterator[Callable[[str, int, int], None] | None]:
    """A bar on a terminal that says which setting is measured."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    parts = (BarColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    # A bar that redraws itself all the time would be measured as well.
    with Progress(*parts, console=Console(stderr=True), transient=True, auto_refresh=False) as bar:
        task = bar.add_task("", total=None)

        def told(what: str, number: int, count: int) -> None:
            bar.update(task, description=what, completed=number, total=count)
            bar.refresh()

        yield told


def _seconds(where: str, text: str) -> float:
    found = row(f"{where} {text}", text, SPAN)
    if len(found) != 1 or not found[0] > 0:
        raise _bad(f"{where} {text}", "not one time above 0", "write for example 30s")
    return found[0]


def _bad(where: str, found: str, remedy: str) -> RequestError:
    return RequestError(Problem("bad-request", where, found, "", remedy))
