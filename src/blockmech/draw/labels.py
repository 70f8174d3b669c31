"""Labels beside what they name, and on nothing else.

Places are tried around each anchor, near ones first; the one that covers least of
what is drawn already is taken. In an animation a label keeps its place beside what it
names as long as that is free, and slides to another one where a link comes over it: the
shortest path through its places and the frames. All numbers are points of the page.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from blockmech.figures.palette import INK, SMALL, TEXT
from blockmech.figures.paper import text_width
from blockmech.typing import Floats, Vectors

STEP = MARGIN = TEXT / 4  # [pt] between points that stand for a line; free inside the page
DIRECTIONS = np.exp(2j * math.pi * np.arange(16) / 16)
DISTANCES = np.array([4.0, 7.0, 11.0, 16.0, 22.0, 29.0, 37.0, 46.0])  # [pt] to a label's edge
LINE = 1.075 * TEXT  # [pt] height of a line of a label
FAR = 1.5 * TEXT  # [pt] distance from which a label has a leader
# Costs, one point of a line covered being 1: a point of another label; each point of
# distance beyond the page; a leader; each point of distance; each point that it slides from
# one frame to the next.
COVERED, OUTSIDE, LEADER, NEAR, SLID = 1e3, 1e4, 6.0, 0.2, 0.2


@dataclass(frozen=True)
class Label:
    """A text that wants a place near one of its anchors [pt].

    ``anchors`` are (anchors, frames), one column for a still picture; ``prefer`` is a
    direction [rad] or None, ``clearance`` the size of what stands at the anchor.
    """

    text: str  # lines
    anchors: ArrayLike
    colour: str = INK
    prefer: float | None = None
    clearance: float = 0.0


@dataclass(frozen=True)
class Place:
    """A place for a label in each frame: its anchor, its middle from there, and half its size.

    ``anchor``, ``offset`` and ``distant`` are (frames,).
    """

    label: Label
    anchor: Vectors
    offset: Vectors
    half: complex
    distant: NDArray[np.bool_]

    def centre(self, frame: int = 0) -> complex:
        """The middle of the label."""
        return complex(self.anchor[frame] + self.offset[frame])

    @property
    def lines(self) -> list[tuple[str, float]]:
        """The lines of the text, and how far each lies above the middle."""
        lines = self.label.text.split("\n")
        return [(line, LINE * ((len(lines) - 1) / 2 - i)) for i, line in enumerate(lines)]

    def leader(self, frame: int = 0) -> list[complex]:
        """A line from the anchor to the label; NaN where that stands near."""
        if not self.distant[frame]:
            return [complex(math.nan), complex(math.nan)]
        back, h = -complex(self.offset[frame]), self.half
        edge = complex(np.clip(back.real, -h.real, h.real), np.clip(back.imag, -h.imag, h.imag))
        anchor, line = complex(self.anchor[frame]), edge - back
        return [anchor + 0.12 * line, anchor + 0.97 * line]


class Crowd:
    """What is drawn already on a page of a size [pt]: points with weights, in some frames."""

    def __init__(self, size: complex, frames: Sequence[int] = (0,)) -> None:
        self.size = size
        self._points: dict[int, list[tuple[complex, float]]] = {frame: [] for frame in frames}

    def add_line(self, points: ArrayLike, weight: float = 1.0, frame: int = 0) -> None:
        """Stand in for a line through places [pt]; NaN interrupts it."""
        for a, b in pairwise(np.asarray(points, complex).tolist()):
            if cmath.isfinite(b - a):
                n = max(1, math.ceil(abs(b - a) / STEP))
                self._points[frame] += [(a + (b - a) * (t / n), weight) for t in range(n + 1)]

    def add_disc(self, centre: complex, radius: float, weight: float, frame: int = 0) -> None:
        """Stand in for a disc."""
        for r in np.arange(0.0, radius + STEP / 2, STEP):
            self.add_line(centre + r * DIRECTIONS, weight, frame)

    def place(self, label: Label) -> Place:
        """The best place of a label, which is then taken."""
        lines = label.text.split("\n")
        half = complex(max(text_width(line, SMALL) for line in lines), LINE * len(lines)) / 2
        reach = DISTANCES[:, None] + label.clearance
        c, s = DIRECTIONS.real, DIRECTIONS.imag
        # To the centre of the text, so that its near edge keeps the distance.
        x, y = c * (reach + half.real * np.sqrt(np.abs(c))), s * (reach + half.imag)
        offsets: Vectors = (x + 1j * y).ravel()
        half += 1.5  # of air beside the text
        beyond = np.maximum(np.abs(offsets.real) - half.real, 0)
        gap = np.hypot(beyond, np.maximum(np.abs(offsets.imag) - half.imag, 0)) - label.clearance
        anchors = np.asarray(label.anchors, complex)
        costs = NEAR * gap + LEADER * (gap > FAR)
        if label.prefer is not None:
            costs = costs + 1 - np.cos(np.angle(offsets) - label.prefer)
        ways = []
        for anchor in anchors:
            covered = [self._cost(anchor[f], offsets, half, gap > FAR, f) for f in self._points]
            ways.append((*cheapest(np.array(covered) + costs, offsets), anchor))
        _, best, anchor = min(ways, key=lambda candidate: candidate[0])
        frames, every = list(self._points), np.arange(anchor.size)
        offset = np.interp(every, frames, offsets[best])
        distant = np.interp(every, frames, gap[best]) > FAR
        chosen = Place(label, anchor, offset, half, distant)
        for frame in self._points:
            self.add_line(chosen.leader(frame), COVERED, frame)
            for up in np.linspace(-half.imag, half.imag, math.ceil(2 * half.imag / STEP) + 1):
                middle = chosen.centre(frame) + 1j * up
                self.add_line([middle - half.real, middle + half.real], COVERED, frame)
        return chosen

    def _cost(
        self,
        anchor: complex,
        offsets: Vectors,
        half: complex,
        is_far: NDArray[np.bool_],
        frame: int,
    ) -> Floats:
        """What labels around an anchor, and the leaders of far ones, would cover in a frame."""
        centres = anchor + offsets
        aside = centres - self.size / 2  # a label may come up to a margin within the page
        beyond = np.maximum(np.abs(aside.real) + half.real + MARGIN - self.size.real / 2, 0)
        beyond += np.maximum(np.abs(aside.imag) + half.imag + MARGIN - self.size.imag / 2, 0)
        cost: Floats = OUTSIDE * beyond
        if not self._points[frame]:
            return cost
        z, weights = (np.array(column) for column in zip(*self._points[frame], strict=True))
        within_reach = np.abs(z - anchor) < np.abs(offsets).max() + abs(half)
        z, weights = z[within_reach], weights[within_reach]
        apart = centres[:, None] - z
        inside = (np.abs(apart.real) < half.real) & (np.abs(apart.imag) < half.imag)
        cost += inside @ weights
        ways = (z[weights >= COVERED] - anchor) / offsets[:, None]  # 1 is the label's middle
        on = (ways.real > 0.2) & (ways.real < 1)
        on &= np.abs(ways.imag) * np.abs(offsets)[:, None] < STEP
        cost += COVERED * (is_far & on.any(axis=1))
        return cost


def cheapest(cost: Floats, offsets: Vectors) -> tuple[float, NDArray[np.intp]]:
    """Cost and numbers (frames,) of the places that cost least, with the ways between them.

    ``cost`` is (frames, places).
    """
    slid = SLID * np.abs(offsets[:, None] - offsets)
    total, came = cost[0], []
    for row in cost[1:]:
        before = total[:, None] + slid
        came.append(before.argmin(axis=0))
        total = before.min(axis=0) + row
    route = [int(total.argmin())]
    for back in reversed(came):
        route.append(int(back[route[-1]]))
    return float(total.min()), np.array(route[::-1])
