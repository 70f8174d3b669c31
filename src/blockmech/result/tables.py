"""A short table of a result for people: a few samples, the outputs that matter most."""

from __future__ import annotations

import html
import io
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np

from blockmech.ground.report import LINES, REMARKS, WIDTH
from blockmech.plan.plan import Output, Undefined
from blockmech.result.columns import (
    Column,
    Labelled,
    driver_columns,
    output_columns,
    quiet_columns,
)
from blockmech.result.quality import ADVICE, OK
from blockmech.typing import Arguments

if TYPE_CHECKING:
    from rich.console import Console

ROWS = LINES + 1  # of a turn these are steps of 30 degrees, and its end
NARROWEST = len("[N m]  ")  # of the columns of a table: the unit, and the gap to the next
FRICTION_POWER = "mechanism.friction_power"
FIRST = (".drive", FRICTION_POWER, ".reaction")
"""What a reader looks for first, by the end of the name; then the order of the result."""

FRICTION_ALONE = "  no load keeps work over the run: friction takes all that the drive gives"


@dataclass(frozen=True)
class Selection:
    """What a short table shows.

    Attributes
    ----------
    columns : the columns that fit
    rows : indices of the samples shown
    gaps : whether one of them has no answer
    numbers : outputs that are one number a run
    more : names of the wanted outputs that are not shown
    """

    columns: list[Column]
    rows: list[int]
    gaps: bool
    numbers: list[str]
    more: list[str]


def leading(outputs: Mapping[str, Output]) -> tuple[str, ...]:
    """Of all outputs those that a table has room for, and what it says of each run.

    Where nothing is asked for by name, no others need to be computed. The margins are among
    them: a group that does not close is reported, whatever depends on it.
    """
    ranked = sorted((n for n, o in outputs.items() if o.kind != "number"), key=_rank)
    numbers = (n for n, o in outputs.items() if o.kind == "number" or n.endswith(".margin"))
    return (*ranked[: WIDTH // NARROWEST], *numbers)


def table(result: Labelled, width: int = WIDTH, of: Collection[str] = ()) -> str:
    """A text table: drivers and the outputs that fit, units in the head, gaps named.

    Parameters
    ----------
    width : characters of a line
    of : names of all outputs, where only the `leading` ones were computed
    """
    selection = _select(result, width, of or tuple(result))
    status = result.quality.status if selection.gaps else ()
    lines = _printed(_grid(selection.columns, selection.rows, status), width)
    body = _title(result, len(of or result)), "", *lines
    return "\n\n".join(filter(None, map("\n".join, (body, _footer(result, selection)))))


def html_table(result: Labelled) -> str:
    """The same table as HTML, for notebooks; every name is escaped."""
    selection = _select(result, WIDTH, tuple(result))
    status = result.quality.status
    heads = [*(column.head for column in selection.columns), "status"]
    rows = ([*(_cell(c.values[i]) for c in selection.columns), status[i]] for i in selection.rows)
    footer = (f"<p>{html.escape(line)}</p>" for line in _footer(result, selection))
    return "\n".join([html_grid(heads, rows, _title(result, len(result))), *footer])


def gap_lines(result: Labelled) -> list[str]:
    """One line for neighbouring samples without an answer: why, how many, where."""
    quality = result.quality
    gaps = quality.gaps
    if not gaps:
        return []
    drivers = [c for c in driver_columns(result) if c.output in result.drivers]
    lines = [f"no answer at {len(gaps)} of {counted(result.n, 'sample')}:"]
    groups = groupby(
        enumerate(gaps), lambda g: (g[1] - g[0], quality.status[g[1]], quality.blame[g[1]])
    )
    runs = [(word, block, [i for _, i in run]) for (_, word, block), run in groups]
    for word, block, run in runs[:REMARKS]:
        ranges = [
            " ... ".join(dict.fromkeys(_cell(c.values[i]) for i in (run[0], run[-1])))
            for c in drivers
        ]
        coordinates = [f"{c.name} = {at} {c.unit}" for c, at in zip(drivers, ranges, strict=True)]
        group = f" at {result.mechanism._block_name(block)}" if block else ""
        lines.append(f"  {word}{group}, {counted(len(run), 'sample')}: {', '.join(coordinates)}")
    if len(runs) > REMARKS:
        lines.append(f"  and {counted(len(runs) - REMARKS, 'stretch', 'stretches')} more")
    return lines


# -- what is shown ---------------------------------------------------------------------


def _select(result: Labelled, width: int, of: Collection[str]) -> Selection:
    chosen = driver_columns(result)
    first = {column.output for column in chosen}
    numbers = [name for name in result if result._output(name).kind == "number"]
    rest = [name for name in of if name not in first and name not in numbers]
    step = max(1, -(-(result.n - 1) // (ROWS - 1)))
    rows = sorted({*range(0, result.n, step), *range(result.n)[-1:]})
    quality = result.quality
    gaps = any(quality.status[i] != OK for i in rows)
    status = quality.status if gaps else ()
    omitted: list[str] = []
    has_columns = False
    everything = len(of) == len(result.mechanism.outputs)
    rubs = FRICTION_POWER not in result or bool(np.any(result[FRICTION_POWER]))
    if everything:
        rest.sort(key=lambda name: (name == FRICTION_POWER and not rubs, _rank(name)))
        figures = numbers if result.n > 1 else []  # one pose has no efficiency of its own
        numbers = [name for name in figures if rubs or not name.endswith(".friction_efficiency")]
    for name in rest:  # as they were asked for, but where that is everything
        # Once one does not fit, smaller ones must not jump the queue.
        parts = output_columns(result, name) if name in result and not omitted else []
        if everything and len(parts) == 2 and result._output(name).kind == "vector":
            size = np.hypot(*(part.values for part in parts))
            parts = [replace(parts[0], name=f"|{name}|", values=size)]
        if parts and (not has_columns or _line_width([*chosen, *parts], rows, status) <= width):
            chosen += parts
            has_columns = True
        else:
            omitted.append(name)
    return Selection(quiet_columns(chosen), rows, gaps, numbers, omitted)


def _rank(name: str) -> int:
    return next((i for i, end in enumerate(FIRST) if name.endswith(end)), len(FIRST))


# -- text --------------------------------------------------------------------------------


def aligned(head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Lines of text in columns under their heads."""
    grid = _empty_grid()
    for name in head:
        grid.add_column(name, no_wrap=True)
    for row in rows:
        grid.add_row(*row)
    return _printed(grid, 100 * WIDTH)  # wider than any row


def _empty_grid() -> Any:
    from rich.table import Table

    return Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="")


def _printed(grid: Any, width: int) -> list[str]:
    """The lines of a table."""
    console = _console(width)
    with console.capture() as text:
        console.print(grid)
    return [line.rstrip() for line in text.get().splitlines()]


def _console(width: int) -> Console:
    from rich.console import Console

    plain: Arguments = dict.fromkeys(("markup", "emoji", "highlight", "legacy_windows"), False)
    return Console(file=io.StringIO(), width=max(width, WIDTH), color_system=None, **plain)


def _grid(columns: list[Column], rows: list[int], status: tuple[str, ...]) -> Any:
    """The table, each column under a head of block, quantity and unit."""
    grid = _empty_grid()
    for column in columns:
        block, _, quantity = column.output.rpartition(".")
        sized = column.name.startswith("|")
        quantity = f"|{quantity}|" if sized else quantity + column.name[len(column.output) :]
        head = f"{block}\n{quantity}\n[{column.unit or '-'}]"
        grid.add_column(head, justify="right", no_wrap=True)
    if status:
        grid.add_column("\nstatus\n", no_wrap=True)
    for i in rows:
        cells = [_cell(column.values[i]) for column in columns]
        grid.add_row(*cells, *([status[i]] if status else []))
    return grid


def _line_width(columns: list[Column], rows: list[int], status: tuple[str, ...]) -> int:
    """Characters of a line of the table."""
    from rich.measure import Measurement

    console = _console(WIDTH)
    wide = console.options.update(width=100 * WIDTH)
    return int(Measurement.get(console, wide, _grid(columns, rows, status)).maximum)


def _cell(x: float) -> str:
    # Adding zero turns -0.0 into 0.0.
    return f"{x + 0.0:.6g}" if np.isfinite(x) else "-"


def _title(result: Labelled, outputs: int) -> str:
    settings = result.settings
    name, rubs = result.mechanism.name, bool(result.mechanism.frictional_joints)
    options = f"; friction {settings['friction']}" * rubs + "; static" * bool(settings["static"])
    return f"{name}: {counted(result.n, 'sample')}, {counted(outputs, 'output')}{options}"


def _footer(result: Labelled, selection: Selection) -> Iterator[str]:
    for name in selection.numbers:
        x, unit = result[name], result._output(name).unit
        if isinstance(x, Undefined):
            yield f"{name}: not defined for this run: {x.why}"
        else:
            yield f"{name} = {_cell(float(x))} {unit}".rstrip()
            if name.endswith(".friction_efficiency") and x == 0:
                yield FRICTION_ALONE
    if len(selection.rows) < result.n:
        yield f"{len(selection.rows)} of {result.n} samples shown"
    yield from gap_lines(result)
    yield from flag_lines(result)
    yield from (f"note: {text}" for text in result.notes())
    if selection.more:
        rest = ", ..." if len(selection.more) > REMARKS else ""
        names = ", ".join(selection.more[:REMARKS])
        yield f"{counted(len(selection.more), 'more output')}: {names}{rest}"


def flag_lines(result: Labelled) -> Iterator[str]:
    """The flags of a result by kind and place."""
    flags = result.quality.flags
    counts, codes = Counter((flag.code, flag.where) for flag in flags), set[str]()
    for (code, where), count in list(counts.items())[:REMARKS]:
        first = next(f.sample for f in flags if (f.code, f.where) == (code, where))
        yield f"flag {code} at {where}: {counted(count, 'sample')}, first {first}"
        codes.add(code)
    yield from (f"  {code}: {ADVICE[code]}" for code in ADVICE if code in codes)
    if len(counts) > REMARKS:
        yield f"and flags of {len(counts) - REMARKS} more kinds, see quality"


def counted(n: int, singular: str, plural: str = "") -> str:
    """So many of something, in words."""
    return f"{n} {singular if n == 1 else plural or singular + 's'}"


def html_grid(head: Iterable[str], rows: Iterable[Iterable[str]], caption: str = "") -> str:
    """Rows of texts below their heads as HTML, in which every text is escaped."""

    def line(tag: str, cells: Iterable[str]) -> str:
        return f"<tr>{''.join(f'<{tag}>{html.escape(cell)}</{tag}>' for cell in cells)}</tr>"

    title = f"<caption>{html.escape(caption)}</caption>" * bool(caption)
    body = "".join(line("td", row) for row in rows)
    return f"<table>{title}<thead>{line('th', head)}</thead><tbody>{body}</tbody></table>"
