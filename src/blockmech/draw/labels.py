"""Labels beside what they name, and on nothing else.

Places are tried around each anchor, near ones first; the one that covers least of
what is drawn already is taken, over all frames of an animation, so that its labels
keep their places beside what they name. All numbers are points of the page.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from blockmech.draw.palette import INK, SMALL
from blockmech.draw.paper import text_width

STEP = 2.0  # [pt] between points that stand for a line
DIRECTIONS = 16
DISTANCES = (4.0, 7.0, 11.0, 16.0, 22.0, 29.0, 37.0, 46.0)  # [pt] from anchor to label's edge
AIR = 1.5  # [pt] free around a label
LINE = 8.6  # [pt] height of a line of a label
FAR = 12.0  # [pt] distance from which a label has a leader
# Costs, one point of a line covered being 1: on another label; off the page; a leader;
# each point of distance.
COVERED, OUTSIDE, LEADER, NEAR = 1e3, 1e4, 6.0, 0.2

Reals = NDArray[np.float64]
Places = NDArray[np.complex128]


class Rect(NamedTuple):
    """Left, bottom, right and top [pt]."""

    left: float
    bottom: float
    right: float
    top: float

    def overlap(self, centres: Places, half: complex) -> Reals:
        """Areas [pt2] that rectangles around centres (n,) share with it."""
        x, y = centres.real, centres.imag
        wide = np.minimum(x + half.real, self.right) - np.maximum(x - half.real, self.left)
        high = np.minimum(y + half.imag, self.top) - np.maximum(y - half.imag, self.bottom)
        area: Reals = np.maximum(wide, 0) * np.maximum(high, 0)
        return area


@dataclass(frozen=True)
class Label:
    """A text that wants a place near one of its anchors [pt].

    ``anchors`` are (anchors, frames), one column for a still picture; ``prefer`` is a
    direction [rad] or None, ``clearance`` the size of what stands at the anchor.
    """

    text: str  # lines
    anchors: Sequence[Sequence[complex]]
    colour: str = INK
    prefer: float | None = None
    clearance: float = 0.0


@dataclass(frozen=True)
class Spot:
    """A place for a label: at which anchor, and its middle and half size from there."""

    label: Label
    anchor: int
    offset: complex
    half: complex
    far: bool

    def centre(self, frame: int = 0) -> complex:
        """The middle of the label."""
        return self.label.anchors[self.anchor][frame] + self.offset

    def rect(self, frame: int = 0) -> Rect:
        """What the label covers."""
        low, high = self.centre(frame) - self.half, self.centre(frame) + self.half
        return Rect(low.real, low.imag, high.real, high.imag)

    def leader(self, frame: int = 0) -> list[complex]:
        """A line from the anchor to the label, if that stands far off."""
        anchor, r = self.label.anchors[self.anchor][frame], self.rect(frame)
        x, y = np.clip(anchor.real, r.left, r.right), np.clip(anchor.imag, r.bottom, r.top)
        way = complex(x, y) - anchor
        return [anchor + 0.12 * way, anchor + 0.97 * way] if self.far else []


class Crowd:
    """What is drawn already in each frame: points with weights, and placed labels."""

    def __init__(self, page: Rect, frames: int = 1) -> None:
        self.page = page
        self._points: list[list[tuple[complex, float]]] = [[] for _ in range(frames)]
        self._labels: list[list[Rect]] = [[] for _ in range(frames)]

    def add_line(self, places: Sequence[complex], weight: float = 1.0, frame: int = 0) -> None:
        """Stand in for a line through places [pt]; NaN interrupts it."""
        for a, b in pairwise(places):
            length = abs(b - a)
            if math.isfinite(length):
                n = max(1, math.ceil(length / STEP))
                self._points[frame] += [(a + (b - a) * (t / n), weight) for t in range(n + 1)]

    def add_disc(self, centre: complex, radius: float, weight: float, frame: int = 0) -> None:
        """Stand in for a disc."""
        for r in np.arange(0.0, radius + STEP / 2, STEP):
            n = max(1, math.ceil(2 * math.pi * r / STEP))
            around = centre + r * np.exp(2j * math.pi * np.arange(n) / n)
            self._points[frame] += [(complex(z), weight) for z in around]

    def place(self, labels: Iterable[Label], most: float = math.inf) -> list[Spot]:
        """Places of the labels, in their order; of those none that would cost more."""
        found = (self._place(label, most) for label in labels)
        return [spot for spot in found if spot is not None]

    def _place(self, label: Label, most: float) -> Spot | None:
        lines = label.text.split("\n")
        half = complex(max(text_width(line, SMALL) for line in lines), LINE * len(lines)) / 2
        turn = 2 * math.pi * np.arange(DIRECTIONS) / DIRECTIONS
        reach = np.array(DISTANCES)[:, None] + label.clearance
        c, s = np.cos(turn), np.sin(turn)
        # To the centre of the text, so that its near edge keeps the distance.
        x, y = c * (reach + half.real * np.sqrt(np.abs(c))), s * (reach + half.imag)
        offsets = (x + 1j * y).ravel()
        half += AIR  # beside the text
        beyond = np.maximum(np.abs(offsets.real) - half.real, 0)
        gap = np.hypot(beyond, np.maximum(np.abs(offsets.imag) - half.imag, 0)) - label.clearance
        costs = [
            sum(self._cost(z, offsets, half, gap, f) for f, z in enumerate(anchor))
            for anchor in label.anchors
        ]
        cost = np.array(costs) + NEAR * gap + LEADER * (gap > FAR)
        if label.prefer is not None:
            cost += 1 - np.cos(np.angle(offsets) - label.prefer)
        if cost.min() > most:
            return None
        j, k = divmod(int(np.argmin(cost)), len(offsets))
        spot = Spot(label, j, complex(offsets[k]), half, bool(gap[k] > FAR))
        for frame, placed in enumerate(self._labels):
            placed.append(spot.rect(frame))
            self.add_line(spot.leader(frame), COVERED, frame)
        return spot

    def _cost(self, anchor: complex, offsets: Places, half: complex, gap: Reals, f: int) -> Reals:
        """What labels around an anchor would cover in a frame, as its share of all frames."""
        centres = anchor + offsets
        cost = OUTSIDE * (1 - self.page.overlap(centres, half) / (4 * half.real * half.imag))
        ways = anchor + offsets * np.linspace(0, 1, 12)[:, None]  # of leaders
        for other in self._labels[f]:
            over = (ways.real > other.left) & (ways.real < other.right)
            over &= (ways.imag > other.bottom) & (ways.imag < other.top)
            cost += COVERED * (other.overlap(centres, half) > 0)
            cost += COVERED * (gap > FAR) * over.any(axis=0)
        if self._points[f]:
            z, weights = (np.array(column) for column in zip(*self._points[f], strict=True))
            near = np.abs(z - anchor) < np.abs(offsets).max() + abs(half)
            apart = centres[:, None] - z[near]
            inside = (np.abs(apart.real) < half.real) & (np.abs(apart.imag) < half.imag)
            cost += inside @ weights[near]
        share: Reals = cost / len(self._labels)
        return share
