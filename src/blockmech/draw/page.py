"""The page that shapes are drawn on: places in metres, axes in a unit of choice, and symbols."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import numpy as np

from blockmech.draw.labels import Crowd, Place
from blockmech.figures import palette as ink
from blockmech.figures.palette import SIZES
from blockmech.figures.paper import (
    BESIDE,
    fitting_columns,
    legend_above,
    new_figure,
    picture_unit,
    wrapped,
)
from blockmech.typing import Arguments, Complex, Vectors

SOLID = {"line": 1.0, "area": 0.7, "disc": 3.0}  # how much a label shuns a shape

Paths: TypeAlias = Mapping[str, Vectors]


@dataclass(frozen=True)
class Shape:
    """A line, a filled area or a disc.

    Attributes
    ----------
    what : what it is, e.g. ``"link:dyad.i"``
    points : complex (p, n) [m] at n samples, (p, 1) of what stands still; one for a disc;
        NaN where it is not there
    order : shapes of higher order lie on lower ones
    """

    what: str
    kind: Literal["line", "area", "disc"]
    points: Vectors
    order: float
    stroke: str = ink.INK
    fill: str = ""
    width: float = 0.8  # [pt]
    radius: float = 0.0  # [pt]
    dash: tuple[float, ...] = ()
    rounded: bool = False  # round ends

    @property
    def still(self) -> bool:
        """Whether it stays where it is."""
        return bool(self.points.shape[1] == 1)

    def at(self, k: int) -> Vectors:
        """Its points (p,) at sample k; none where it is not there."""
        points = self.points[:, 0 if self.still else k]
        return points if np.isfinite(points).all() else points[:0]


def columns_of(wide: bool) -> float:
    """Width [pt] of a page of one column or two."""
    return 2 * ink.COLUMN + 14.0 if wide else ink.COLUMN


def unit_of(points: Vectors, wide: bool) -> float:
    """What a point of a page that places fill is on the ground [m/pt]."""
    room = columns_of(wide) - SIZES.left_margin - SIZES.right - 2 * SIZES.edge
    x, y = float(np.ptp(points.real)), float(np.ptp(points.imag))
    return max(x / room, y / (SIZES.heights[1] - 2 * SIZES.edge), (max(x, y) or 1.0) / room / 3)


class Page:
    """Axes at equal aspect, with paths of markers, and room for captions above.

    ``width`` and ``height`` of the axes are in points; ``unit`` [m/pt] is what a point is on
    the ground, and ``corner`` [m] the lower left one of the axes, which show lengths in the
    first of the units of ``display`` that is one; ``scale`` is how many of it are a metre.
    """

    def __init__(
        self,
        points: Vectors,
        wide: bool,
        paths: Paths,
        captions: Iterable[str],
        display: Iterable[str],
    ) -> None:
        from matplotlib.transforms import Affine2D

        self.scale, self.length_unit = picture_unit("m", display)
        columns = columns_of(wide)
        self.wide = wide
        self.width = columns - SIZES.left_margin - SIZES.right
        low = complex(points.real.min(), points.imag.min())
        size = complex(points.real.max(), points.imag.max()) - low
        self.unit = unit_of(points, wide)
        self.height = float(np.clip(size.imag / self.unit + 2 * SIZES.edge, *SIZES.heights))
        self.corner = low + size / 2 - complex(self.width, self.height) * self.unit / 2
        rows = max((len(self.lines(text)) for text in captions), default=0)
        rows += math.ceil(len(paths) / max(fitting_columns([*paths], self.width), 1))
        total = SIZES.bottom + self.height + SIZES.top + ink.ROW * rows
        left_edge = SIZES.left_margin / columns
        self.figure = new_figure(columns, total)
        self.axes = self.figure.add_axes(
            (left_edge, SIZES.bottom / total, self.width / columns, self.height / total)
        )
        self.ground = Affine2D().scale(self.scale) + self.axes.transData
        self._set_axes(paths)
        style = {"fontsize": ink.SMALL, "va": "top", "label": "caption", "linespacing": 1.35}
        self.caption = self.figure.text(left_edge, 1 - SIZES.top / 2 / total, "", **style)

    def _set_axes(self, paths: Paths) -> None:
        axes, size = self.axes, complex(self.width, self.height)
        low, high = self.scale * self.corner, self.scale * self.metres(size)
        names = {f"{name}label": f"{name} [{self.length_unit}]" for name in "xy"}
        axes.set(**names, aspect="equal", adjustable="box")
        axes.set(xlim=(low.real, high.real), ylim=(low.imag, high.imag))
        axes.xaxis.labelpad, axes.yaxis.labelpad = 1.5, 1.0
        for axis in (axes.xaxis, axes.yaxis):
            axis.label.set_size(ink.SMALL)  # as all words beside a mechanism
        axes.locator_params(nbins=6)
        axes.grid(True)
        for i, (name, path) in enumerate(paths.items()):
            look = {"lw": 0.9, "zorder": 4.9, "label": name, "transform": self.ground}
            axes.plot(path.real, path.imag, **ink.curve_style(i), **look)
        legend_above(axes, self.width + BESIDE)

    def lines(self, text: str) -> list[str]:
        """A caption as lines that fit."""
        return [line for part in text.split("\n") for line in wrapped(part, ink.SMALL, self.width)]

    def write_caption(self, text: str) -> Any:
        """Show a caption; its artist."""
        self.caption.set_text("\n".join(self.lines(text)))
        return self.caption

    def points(self, z: Complex) -> Complex:
        """Places [m] in points of the page, from the axes' lower left corner."""
        return (z - self.corner) / self.unit

    def metres(self, z: Complex) -> Complex:
        """The places [m] of points of the page."""
        return z * self.unit + self.corner

    def draw(self, shape: Shape, k: int = 0) -> Any:
        """Draw a shape at sample k; its artist."""
        from matplotlib.lines import Line2D
        from matplotlib.patches import Polygon

        look: Arguments = {"zorder": shape.order, "label": shape.what, "transform": self.ground}
        if shape.kind == "area":
            look |= {"fc": shape.fill, "ec": shape.stroke, "lw": shape.width}
            artist: Any = Polygon([(0.0, 0.0)], joinstyle="round", **look)
            self.axes.add_patch(artist)
        else:
            look |= {"lw": shape.width, "color": shape.stroke}
            if shape.kind == "disc":
                look |= {"marker": "o", "ms": 2 * shape.radius, "mew": shape.width}
                look |= {"mfc": shape.fill, "ls": ""}
            elif shape.dash:
                look["dashes"] = shape.dash
            look["solid_capstyle"] = "round" if shape.rounded else "butt"
            artist = self.axes.add_line(Line2D([], [], **look))
        move(artist, shape, k)
        return artist

    def write(self, position: Place) -> Any:
        """Write a label at its place."""
        z = self.metres(position.centre())
        style = {"fontsize": ink.SMALL, "color": position.label.colour, "zorder": 9}
        style |= {"transform": self.ground}
        middle = {"ha": "center", "va": "center", "linespacing": 1.1}
        return self.axes.text(z.real, z.imag, position.label.text, label="text", **middle, **style)

    def leader(self, position: Place, frames: int = 1) -> Shape:
        """The line from what a label names to the label, if that stands far off."""
        ways = np.array([position.leader(k) for k in range(frames)], complex).T
        return Shape("leader", "line", self.metres(ways), 8, position.label.colour, width=0.4)

    def crowd(self, shapes: Iterable[Shape], paths: Paths, frames: Sequence[int] = (0,)) -> Crowd:
        """What labels must spare: the shapes at some samples, and the paths."""
        crowd = Crowd(complex(self.width, self.height), frames)
        for k in frames:
            for path in paths.values():
                crowd.add_line(self.points(path), 0.4, k)
            for shape in shapes:
                z, weight = self.points(shape.at(k)), SOLID[shape.kind]
                if shape.kind == "disc":
                    for centre in z:
                        crowd.add_disc(centre, shape.radius + 1, weight, k)
                    continue
                closed = np.append(z, z[:1]) if shape.kind == "area" else z
                half = shape.width / 2 if shape.width > 2 else 0.0
                for shift in dict.fromkeys((-half, 0.0, half)):
                    crowd.add_line(closed + shift * (1 + 1j), weight, k)
        return crowd


def move(artist: Any, shape: Shape, k: int) -> None:
    """Put the artist of a shape where that is at sample k."""
    z = shape.at(k)
    if shape.kind == "area":
        artist.set_xy(np.stack([z.real, z.imag], axis=1))
    else:
        artist.set_data(z.real, z.imag)
