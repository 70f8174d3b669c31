"""A short table of a result for people: a few samples, the outputs that matter most."""

from __future__ import annotations

import html
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from blockmech.export.columns import Column, driver_columns, output_columns
from blockmech.quality import OK

if TYPE_CHECKING:
    from blockmech.export.labelled import Labelled

ROWS = 13  # of a turn in 361 samples these are steps of 30 degrees
WIDTH = 100  # characters of a terminal line
LINES = 4  # remarks of one kind, names of further outputs
FIRST = (".drive", "mechanism.friction_power", ".reaction")
"""What a reader looks for first, by the end of the name; then the order of the result."""


@dataclass(frozen=True)
class Selection:
    """What a short table shows.

    Attributes
    ----------
    columns : the columns that fit
    rows : indices of the samples shown
    numbers : outputs that are one number a run
    more : names of the wanted outputs that are not shown
    """

    columns: list[Column]
    rows: list[int]
    numbers: list[str]
    more: list[str]


def table(result: Labelled, degrees: bool = False, width: int = WIDTH) -> str:
    """A text table: drivers and the outputs that fit, units in the head, gaps named.

    Parameters
    ----------
    degrees : angles in deg in place of rad
    width : characters of a line
    """
    shown = _select(result, degrees, width)
    status = result.quality.status
    gaps = any(status[i] != OK for i in shown.rows)
    blocks = [_block(column, shown.rows) for column in shown.columns]
    lines = ["  ".join(cells).rstrip() for cells in zip(*blocks, strict=True)]
    if gaps:
        words = ["", "status", "", *(status[i] for i in shown.rows)]
        lines = [f"{line}  {word}".rstrip() for line, word in zip(lines, words, strict=True)]
    footer = list(_footer(result, shown, degrees))
    return "\n".join([_title(result), "", *lines, *([""] if footer else []), *footer])


def html_table(result: Labelled, degrees: bool = False) -> str:
    """The same table as HTML, for notebooks; every name is escaped."""
    shown = _select(result, degrees, WIDTH)
    status = result.quality.status
    heads = [*(column.head for column in shown.columns), "status"]
    lines = [
        "<table>",
        f"<caption>{html.escape(_title(result))}</caption>",
        _html_row("th", heads),
    ]
    for i in shown.rows:
        lines.append(_html_row("td", [*(_cell(c.values[i]) for c in shown.columns), status[i]]))
    lines.append("</table>")
    lines += [f"<p>{html.escape(line)}</p>" for line in _footer(result, shown, degrees)]
    return "\n".join(lines)


def gap_lines(result: Labelled, degrees: bool = False) -> list[str]:
    """One line per stretch of samples without an answer: why, how many, where."""
    quality = result.quality
    gaps = quality.gaps
    if not gaps:
        return []
    drivers = [c for c in driver_columns(result, degrees) if c.output in result.drivers]
    lines = [f"no answer at {len(gaps)} of {_count(result.n, 'sample')}:"]
    stretches = list(_stretches([(i, quality.status[i], quality.blame[i]) for i in gaps]))
    for (first, word, block), last in stretches[:LINES]:
        places = [
            f"{c.name} = {_cell(c.values[first])}"
            + (f" ... {_cell(c.values[last])}" if last > first else "")
            + f" {c.unit}"
            for c in drivers
        ]
        place = f" at {result.mechanism.said(block)}" if block else ""
        lines.append(f"  {word}{place}, {_count(last - first + 1, 'sample')}: {', '.join(places)}")
    if len(stretches) > LINES:
        lines.append(f"  and {_count(len(stretches) - LINES, 'stretch', 'stretches')} more")
    return lines


def _select(result: Labelled, degrees: bool, width: int) -> Selection:
    chosen = driver_columns(result, degrees)
    first = {column.output for column in chosen}
    rest = [name for name in result if name not in first]
    numbers = [name for name in rest if result.output(name).kind == "number"]
    rows = _some(result.n, ROWS)
    more = []
    status = result.quality.status
    gaps = max((len(status[i]) + 2 for i in rows if status[i] != OK), default=0)
    room = width - gaps - sum(_width(c, rows) for c in chosen)
    shown_any = False
    for name in sorted((n for n in rest if n not in numbers), key=_rank):
        if room <= 0 and shown_any:  # reading every output of a long run takes time
            more.append(name)
            continue
        parts = output_columns(result, name, degrees)
        need = sum(_width(c, rows) for c in parts)
        if need <= room or not shown_any:
            chosen += parts
            shown_any = True
        else:
            more.append(name)
        room -= need  # once one does not fit, smaller ones must not jump the queue
    return Selection(chosen, rows, numbers, more)


def _rank(name: str) -> int:
    return next((i for i, end in enumerate(FIRST) if name.endswith(end)), len(FIRST))


def _some(n: int, most: int) -> list[int]:
    """Equally spaced indices of n samples and the last one, about that many."""
    step = max(1, -(-(n - 1) // (most - 1)))
    return sorted({*range(0, n, step), *range(n)[-1:]})


def _width(column: Column, rows: list[int]) -> int:
    return len(_block(column, rows)[0]) + 2


def _block(column: Column, rows: list[int]) -> list[str]:
    """Cells of a column, aligned right, under a head of block, quantity and unit."""
    block, _, quantity = column.output.rpartition(".")
    quantity += column.name[len(column.output) :]
    cells = [block, quantity, f"[{column.unit or '-'}]", *(_cell(column.values[i]) for i in rows)]
    size = max(map(len, cells))
    return [cell.rjust(size) for cell in cells]


def _cell(x: float) -> str:
    # Adding zero turns -0.0 into 0.0.
    return f"{x + 0.0:.6g}" if np.isfinite(x) else "-"


def _title(result: Labelled) -> str:
    settings = result.settings
    how = f"friction {settings['friction']}" + (", static" if settings["static"] else "")
    name = result.mechanism.name
    return f"{name}: {_count(result.n, 'sample')}, {_count(len(result), 'output')}; {how}"


def _footer(result: Labelled, shown: Selection, degrees: bool) -> Iterator[str]:
    for name in shown.numbers:
        unit = result.unit(name)
        x = float(result[name])
        value = f"{_cell(x)} {unit}".rstrip() if np.isfinite(x) else "not defined for this run"
        yield f"{name} = {value}" if np.isfinite(x) else f"{name}: {value}"
    if len(shown.rows) < result.n:
        yield f"{len(shown.rows)} of {result.n} samples shown"
    yield from gap_lines(result, degrees)
    yield from _flag_lines(result)
    if shown.more:
        rest = ", ..." if len(shown.more) > LINES else ""
        yield f"{_count(len(shown.more), 'more output')}: {', '.join(shown.more[:LINES])}{rest}"


def _flag_lines(result: Labelled) -> Iterator[str]:
    counts: dict[tuple[str, str], list[int]] = {}
    for flag in result.quality.flags:
        counts.setdefault((flag.code, flag.where), []).append(flag.sample)
    for (code, where), samples in list(counts.items())[:LINES]:
        yield f"flag {code} at {where}: {_count(len(samples), 'sample')}, first {samples[0]}"
    if len(counts) > LINES:
        yield f"and flags of {len(counts) - LINES} more kinds, see quality"


def _stretches(
    gaps: list[tuple[int, str, str]],
) -> Iterator[tuple[tuple[int, str, str], int]]:
    """Runs of neighbouring samples with one reason: (first gap, last index)."""
    start, last = gaps[0], gaps[0]
    for gap in gaps[1:]:
        if gap[0] != last[0] + 1 or gap[1:] != start[1:]:
            yield start, last[0]
            start = gap
        last = gap
    yield start, last[0]


def _count(n: int, one: str, many: str = "") -> str:
    return f"{n} {one if n == 1 else many or one + 's'}"


def _html_row(tag: str, cells: list[str]) -> str:
    inner = "".join(f"<{tag}>{html.escape(cell)}</{tag}>" for cell in cells)
    return f"<tr>{inner}</tr>"
