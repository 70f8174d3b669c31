"""All solutions of the friction equations as an answer: table, facts and pictures."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from blockmech.figures import palette as ink
from blockmech.figures.panels import label_coordinate
from blockmech.figures.paper import (
    Pictured,
    grow,
    legend_above,
    panelled,
    picture_unit,
    shown_name,
)
from blockmech.ground.errors import listed, refused
from blockmech.ground.report import LINES, WIDTH, Facts, as_json, places
from blockmech.ground.units import shown_in
from blockmech.result.columns import Column, output_columns
from blockmech.result.result import Result
from blockmech.result.samples import Samples
from blockmech.result.spreadsheet import CsvTable
from blockmech.result.tables import aligned, counted
from blockmech.typing import Array, Data, Floats, Indices

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Flags = NDArray[np.bool_]

CONTRACTION, COUNT, UNDECIDED, NO_POSE = PROOFS = (
    *("contraction", "count", "undecided", "no-assembly"),
)
HEIGHT = 17 * ink.TEXT  # [pt] of the axes
FILLS = (ink.GREY, ink.PAPER, ink.LINK_FILLS[0], ink.LINK_FILLS[1])
"""By number of solutions: none, one, two, three or more."""
WORDS = ("none: it jams", "one solution", "two", "three or more")


@dataclass(frozen=True, repr=False)
class FrictionSolutions(CsvTable, Facts, Pictured):
    """All solutions of the friction equations at n poses.

    ``found["crank.drive"]`` is an array (s,), one number for each of s solutions; those of a
    pose follow one another, the one that is connected with zero friction first.

    Attributes
    ----------
    pose : (s,) index of the pose
    connected : (s,) whether every group reaches it by continuation from zero friction
    index : group -> (s,) +1 or -1, sign of det(1 - diag(k) dg R); 0 where rounding hides it
    complete : (n,) whether it is proved that there are no others
    proof : n words: "contraction" (P < 1 in all groups: one solution), "count" (all complex
        solutions found and apart, and the sum of indices what `existence` demands),
        "undecided" (a double solution within rounding, or one at infinity), "no-assembly"
    existence : group -> (n,) the number c [-]; NaN where the pose has no solution to judge it by
    at_rest : joint -> (n,) whether its pair has no relative speed: its friction is taken as 0, but
        may have any value in an interval
    scale : (n,) [-] factor of all friction
    samples : the poses
    """

    answers: Result
    pose: Indices
    connected: Flags
    index: Mapping[str, NDArray[np.int8]]
    proof: tuple[str, ...]
    existence: Mapping[str, Floats]
    at_rest: Mapping[str, Flags]
    scale: Floats
    samples: Samples

    def __getitem__(self, name: str) -> Any:
        return self.answers[name]

    def __len__(self) -> int:
        return len(self.pose)

    @property
    def n(self) -> int:
        """Number of poses."""
        return self.samples.n

    @property
    def complete(self) -> Flags:
        """(n,) whether it is proved that there are no other solutions."""
        return np.isin(self.proof, (CONTRACTION, COUNT))

    @property
    def counts(self) -> Indices:
        """(n,) number of solutions."""
        return np.bincount(self.pose, minlength=self.n)

    @property
    def number(self) -> Indices:
        """(s,) number of each solution among those of its pose, from 1 on."""
        first = np.searchsorted(self.pose, self.pose)
        return np.arange(1, len(self.pose) + 1) - first

    @property
    def drivers(self) -> dict[str, Floats]:
        """``"crank.q"`` -> its coordinates (n,) [rad or m] at the poses."""
        m = self.answers.mechanism
        return {m._of_driver(d, "q"): self.samples.coordinate(i) for i, d in enumerate(m.drivers)}

    def figure(self, ax: Axes | None = None) -> Any:
        """The first real output over the driver; of several scales the number of solutions.

        Raises `RequestError` where not exactly one coordinate varies, or nothing is there to draw.
        """
        moving = {name: q for name, q in self.drivers.items() if np.ptp(q) > 0}
        if len(moving) != 1:
            message = f"{len(moving)} driver coordinates vary"
            raise refused("friction_solutions", message, "give several poses of one driver")
        ((name, q),) = moving.items()
        factor, unit = picture_unit(self.answers._unit_of_driver(name), self._display)
        draw = self._map if np.ptp(self.scale) > 0 else self._curves
        return draw(factor * q, f"{shown_name(name)} [{unit}]", ax)

    def _curves(self, q: Array, axis_label: str, ax: Axes | None) -> Any:
        """One output of each solution, and where there is none."""
        real = [name for name in self.answers if self.answers._output(name).kind == "real"]
        if not real:
            raise refused("friction_solutions", "no real output is there", "name one in want=")
        name, x = real[0], q[self.pose]
        largest = float(np.abs(self[name]).max(initial=0))
        factor, unit = picture_unit(self.answers.unit(name), self._display, largest)
        y = factor * self[name]
        low = np.any([np.zeros(len(x), bool), *(s < 0 for s in self.index.values())], axis=0)
        hollow = {"mfc": "none", "ms": 3.2}
        kinds = (
            (self.connected, "connected with zero friction", {"color": ink.SERIES[0], "ms": 2.2}),
            (~self.connected & ~low, "another one", {"color": ink.SERIES[2], **hollow}),
            (~self.connected & low, "another one, unstable", {"color": ink.SERIES[1], **hollow}),
        )
        caption = f"{shown_name(name)}: all solutions of Coulomb's equations."
        if undecided := self.proof.count(UNDECIDED):
            caption += f" At {undecided} poses it is not proved that these are all."
        with panelled(caption, HEIGHT + 2 * ink.ROW, ax=ax) as ((axes,),):
            for mask, label, style in kinds:
                if mask.any():
                    axes.plot(x[mask], y[mask], "o", mew=0.7, label=label, **style)
            order = np.argsort(q, kind="stable")
            cells, none = _edges(q[order]), (self.counts == 0)[order]
            for i in np.flatnonzero(none):
                axes.axvspan(cells[i], cells[i + 1], color=ink.PALE, lw=0, label="none: it jams")
            label_coordinate(axes, axis_label)
            axes.set_ylabel(f"{shown_name(name)} [{unit or '–'}]")
            grow(axes, legend_above(axes, ink.COLUMN), ax)
        return axes.figure

    def _map(self, q: Array, label: str, ax: Axes | None) -> Any:
        """The number of solutions over a coordinate and the scale of friction."""
        from matplotlib.colors import ListedColormap

        coordinates, scales = np.unique(q), np.unique(self.scale)
        if len(coordinates) < 2 or len(coordinates) * len(scales) != self.n:
            raise refused("friction_solutions", "its poses are no grid", "give each pose once")
        at = np.searchsorted(scales, self.scale), np.searchsorted(coordinates, q)
        counts = np.zeros((len(scales), len(coordinates)), int)
        counts[at] = np.minimum(self.counts, len(FILLS) - 1)
        caption = (
            "Number of solutions of Coulomb's equations. At the red line (existence 1) reactions "
        )
        caption += "grow without bound; where two solutions end without it they meet in a fold."
        with panelled(caption, HEIGHT + 2 * ink.ROW, ax=ax) as ((axes,),):
            axes.grid(False)
            look = {"cmap": ListedColormap(FILLS), "vmin": 0, "vmax": 3, "rasterized": True}
            axes.pcolormesh(_edges(coordinates), _edges(scales), counts, **look)
            for c in self.existence.values():
                lines = np.full(counts.shape, np.nan)
                lines[at] = c
                with np.errstate(invalid="ignore"):
                    crossed = np.nanmin(lines) < 1.0 < np.nanmax(lines)
                if crossed:
                    red = {"colors": ink.ALARM, "linewidths": 1.0}
                    axes.contour(coordinates, scales, lines, [1.0], **red)
            for i in np.unique(counts):
                axes.fill([], [], facecolor=FILLS[i], edgecolor=ink.INK, lw=0.6, label=WORDS[i])
            grow(axes, legend_above(axes, ink.COLUMN), ax)
            label_coordinate(axes, label)
            axes.set_ylabel("scale of friction [–]")
        return axes.figure

    def lines(self) -> Iterator[str]:
        """The solutions as a table, and what proves that there are no others."""
        columns, hidden = self._fitting(self._columns(self._display))
        head = [column.head for column in columns]
        texts = [
            [f"{x + 0.0:.7g}" if math.isfinite(x) else "-" for x in column.values[:LINES].tolist()]
            for column in columns
        ]
        index = [[f"{x:+d}" for x in column[:LINES]] for column in self.index.values()]
        counts = self.counts
        chosen = zip(self.number[:LINES], self.pose[:LINES], strict=True)
        which = [f"{i} of {counts[p]}" for i, p in chosen]
        linked = ["yes" if x else "no" for x in self.connected[:LINES]]
        rows = zip(*texts[: self._led], which, linked, *index, *texts[self._led :], strict=True)
        names = [f"{self._said(group)} index" for group in self.index]
        title = [*head[: self._led], "solution", "connected", *names, *head[self._led :]]
        name = self.answers.mechanism.name
        yield f"{name}: {counted(self.n, 'pose')}, {counted(len(self), 'solution')}"
        yield from ("", *aligned(title, rows))
        yield from self._foot(hidden)

    def _fitting(self, columns: list[Column]) -> tuple[list[Column], list[str]]:
        """The columns that a line has room for, one at least, and the names of the others."""
        room = WIDTH - sum(len(f"{self._said(group)} index  ") for group in self.index)
        wide = np.cumsum([max(len(c.head), len("-1.234567e+08")) + 2 for c in columns])
        count = max(self._led + 1, int(np.sum(wide <= room - len("solution  connected  "))))
        return columns[:count], [column.name for column in columns[count:]]

    @property
    def _led(self) -> int:
        """Number of columns that say where a solution is: drivers, and the scale if it is used."""
        return len(self.drivers) + bool((self.scale != 1.0).any())

    def _columns(self, display: Sequence[str] = ()) -> list[Column]:
        """Coordinates and the wanted outputs, one value for each solution."""
        columns, answers = [], self.answers.to(*display)
        for name, q in self.drivers.items():
            factor, unit = shown_in(self.answers._unit_of_driver(name), answers._display)
            columns.append(Column(name, unit, factor * q[self.pose], name))
        if (self.scale != 1.0).any():
            columns.append(Column("scale", "", self.scale[self.pose], "scale"))
        for name in answers:
            columns += output_columns(answers, name)
        return columns

    def _foot(self, hidden: Sequence[str]) -> Iterator[str]:
        if hidden:
            yield f"{counted(len(hidden), 'more column')}: {listed(hidden, 3)}"
        if len(self) > LINES:
            yield f"{LINES} of {len(self)} solutions shown"
        counts = Counter(self.counts.tolist())
        several = (
            f"{counted(n, 'pose')} with {x or 'no solution'}" for x, n in sorted(counts.items())
        )
        yield f"solutions: {', '.join(several)}"
        proofs = Counter(self.proof)
        complete = [
            f"{counted(proofs[word], 'pose')} by {word}" for word in PROOFS[:2] if proofs[word]
        ]
        if complete:
            yield f"complete: {', '.join(complete)}"
        for word in (UNDECIDED, NO_POSE):
            if proofs[word]:
                yield f"{word}: {counted(proofs[word], 'pose')}, first {self._place(word)}"
        for group, c in self.existence.items():
            if np.isfinite(c).any():
                low, high = np.nanmin(c), np.nanmax(c)
                yield f"existence of {self._said(group)}: {low:.4g} to {high:.4g}"
        resting = [joint for joint, at in self.at_rest.items() if at.any()]
        if resting:
            yield f"at zero relative speed, friction there taken as 0: {listed(resting, 4)}"

    def _place(self, word: str) -> str:
        i, drivers = self.proof.index(word), self.drivers
        units = {name: self.answers._unit_of_driver(name) for name in drivers}
        return places({name: float(q[i]) for name, q in drivers.items()}, units, self._display)

    def _said(self, group: str) -> str:
        return str(self.answers.mechanism._block_name(group))

    def to_dict(self) -> Data:
        """The solutions by pose, as JSON data in SI units."""
        columns, first = self._columns(), np.searchsorted(self.pose, np.arange(self.n + 1))
        solutions = [
            {
                "connected": self.connected[j],
                "index": {name: column[j] for name, column in self.index.items()},
                "outputs": {column.name: column.values[j] for column in columns[self._led :]},
            }
            for j in range(len(self))
        ]
        poses = [
            {
                "drivers": {name: q[i] for name, q in self.drivers.items()},
                "scale": self.scale[i],
                "complete": self.complete[i],
                "proof": self.proof[i],
                "existence": {name: c[i] for name, c in self.existence.items()},
                "at_rest": [name for name, at in self.at_rest.items() if at[i]],
                "solutions": solutions[first[i] : first[i + 1]],
            }
            for i in range(self.n)
        ]
        units = {c.name: c.unit for c in columns}
        return {"name": self.answers.mechanism.name, "units": units, "poses": as_json(poses)}

    def csv_rows(self) -> tuple[list[str], Iterable[Iterable[object]]]:
        """One row per solution."""
        columns, complete = self._columns(), self.complete
        names = [f"{self._said(group)} index" for group in self.index]
        where, values = columns[: self._led], columns[self._led :]
        head = [
            *("pose", *(c.head for c in where), "solution", "connected", "complete"),
            *(*names, *(c.head for c in values)),
        ]
        rows = [
            [
                *(int(p), *(float(c.values[j]) for c in where), int(self.number[j])),
                *("yes" if self.connected[j] else "no", "yes" if complete[p] else "no"),
                *(int(column[j]) for column in self.index.values()),
                *(float(c.values[j]) for c in values),
            ]
            for j, p in enumerate(self.pose)
        ]
        return head, rows


def _edges(x: Array) -> Array:
    """Borders of cells around places in rising order."""
    middle = (x[1:] + x[:-1]) / 2
    return np.concatenate([[2 * x[0] - middle[0]], middle, [2 * x[-1] - middle[-1]]])
