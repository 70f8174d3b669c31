"""Labels beside what they name, and on nothing else.

Places are tried around each anchor, near ones first; the one that covers least of
what is drawn already is taken. All numbers are points of the page.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
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


class Rect(NamedTuple):
    """Left, bottom, right and top [pt]."""

    left: float
    bottom: float
    right: float
    top: float

    @property
    def centre(self) -> complex:
        """Its middle."""
        return complex(self.left + self.right, self.bottom + self.top) / 2

    def nearest(self, z: complex) -> complex:
        """Its point nearest to a point."""
        x = min(max(z.real, self.left), self.right)
        return complex(x, min(max(z.imag, self.bottom), self.top))

    def overlap(self, other: Rect) -> float:
        """Area [pt2] that two rectangles share."""
        wide = min(self.right, other.right) - max(self.left, other.left)
        high = min(self.top, other.top) - max(self.bottom, other.bottom)
        return max(wide, 0.0) * max(high, 0.0)


@dataclass(frozen=True)
class Label:
    """A text that wants a place near one of its anchors [pt].

    ``prefer`` is a direction [rad] or None, ``clearance`` the size of what stands at
    the anchor.
    """

    text: str  # lines
    anchors: tuple[complex, ...]
    colour: str = INK
    prefer: float | None = None
    clearance: float = 0.0


@dataclass(frozen=True)
class Spot:
    """A place for a label, and a line to its anchor if it stands far off."""

    rect: Rect
    leader: tuple[complex, complex] | None


@dataclass
class Crowd:
    """What is drawn already: points with weights, and placed labels."""

    page: Rect
    points: list[tuple[complex, float]] = field(default_factory=list)
    labels: list[Rect] = field(default_factory=list)

    def add_line(self, places: Sequence[complex], weight: float = 1.0) -> None:
        """Stand in for a line through places [pt]; NaN interrupts it."""
        for a, b in pairwise(places):
            length = abs(b - a)
            if math.isfinite(length):
                n = max(1, math.ceil(length / STEP))
                self.points += [(a + (b - a) * (t / n), weight) for t in range(n + 1)]

    def add_disc(self, centre: complex, radius: float, weight: float = 3.0) -> None:
        """Stand in for a disc."""
        for r in np.arange(0.0, radius + STEP / 2, STEP):
            n = max(1, math.ceil(2 * math.pi * r / STEP))
            turns = 2 * math.pi * np.arange(n) / n
            self.points += [(complex(z), weight) for z in centre + r * np.exp(1j * turns)]

    def place(self, labels: Iterable[Label]) -> list[tuple[Label, Spot]]:
        """Places [pt] of the labels, in their order."""
        found = []
        for label in labels:
            tried = _Candidates(label)
            best = int(np.argmin(self._costs(label, tried)))
            rect, anchor = tried.rect(best), complex(tried.anchor[best])
            leader = None
            if tried.gap[best] > FAR:
                way = rect.nearest(anchor) - anchor
                leader = (anchor + 0.12 * way, anchor + 0.97 * way)
                self.add_line(leader, COVERED)
            self.labels.append(rect)
            found.append((label, Spot(rect, leader)))
        return found

    def _costs(self, label: Label, tried: _Candidates) -> NDArray[np.float64]:
        cost: NDArray[np.float64] = NEAR * tried.gap + LEADER * (tried.gap > FAR)
        cost += OUTSIDE * (1 - tried.shared(self.page) / tried.area)
        for other in self.labels:
            cost += COVERED * (tried.shared(other) > 0)
            cost += COVERED * (tried.gap > FAR) * tried.leads_over(other)
        if self.points:
            z = np.array([p for p, _ in self.points])
            near = np.abs(z - tried.anchor.mean()) < tried.reach
            weights = np.array([w for _, w in self.points])[near]
            cost += tried.covers(z[near]) @ weights
        if label.prefer is not None:
            cost += 1 - np.cos(np.angle(tried.centre - tried.anchor) - label.prefer)
        return cost


class _Candidates:
    """The places that are tried for a label, as arrays (n,)."""

    def __init__(self, label: Label) -> None:
        lines = label.text.split("\n")
        half = max(text_width(line, SMALL) for line in lines) / 2
        high = LINE * len(lines) / 2
        turn = 2 * math.pi * np.arange(DIRECTIONS) / DIRECTIONS
        reach = np.array(DISTANCES)[:, None] + label.clearance
        c, s = np.cos(turn), np.sin(turn)
        # To the centre of the text, so that its near edge keeps the distance.
        away = (c * (reach + half * np.sqrt(np.abs(c))) + 1j * s * (reach + high)).ravel()
        anchors = np.array(label.anchors, dtype=complex)
        self.anchor = np.repeat(anchors, len(away))
        self.centre = self.anchor + np.tile(away, len(anchors))
        self.half, self.high = half + AIR, high
        self.area = 4 * self.half * self.high
        corner = math.hypot(self.half, self.high)
        self.reach = float(np.abs(self.centre - self.anchor.mean()).max()) + corner
        d = self.centre - self.anchor
        dx = np.maximum(np.abs(d.real) - self.half, 0)
        dy = np.maximum(np.abs(d.imag) - self.high, 0)
        self.gap = np.hypot(dx, dy) - label.clearance

    def rect(self, k: int) -> Rect:
        """The rectangle number k."""
        x, y = self.centre[k].real, self.centre[k].imag
        return Rect(x - self.half, y - self.high, x + self.half, y + self.high)

    def shared(self, r: Rect) -> NDArray[np.float64]:
        """Areas (n,) shared with a rectangle."""
        x, y = self.centre.real, self.centre.imag
        wide = np.minimum(x + self.half, r.right) - np.maximum(x - self.half, r.left)
        tall = np.minimum(y + self.high, r.top) - np.maximum(y - self.high, r.bottom)
        area: NDArray[np.float64] = np.maximum(wide, 0) * np.maximum(tall, 0)
        return area

    def covers(self, z: NDArray[np.complex128]) -> NDArray[np.bool_]:
        """(n, points) whether a point lies on the label."""
        dx = np.abs(self.centre.real[:, None] - z.real)
        dy = np.abs(self.centre.imag[:, None] - z.imag)
        inside: NDArray[np.bool_] = (dx < self.half) & (dy < self.high)
        return inside

    def leads_over(self, r: Rect) -> NDArray[np.bool_]:
        """(n,) whether the way from the anchor to the label runs over a rectangle."""
        steps = self.anchor + (self.centre - self.anchor) * np.linspace(0, 1, 12)[:, None]
        inside = (steps.real > r.left) & (steps.real < r.right)
        inside &= (steps.imag > r.bottom) & (steps.imag < r.top)
        some: NDArray[np.bool_] = inside.any(axis=0)
        return some
