"""The paper that pictures are drawn on, and answers with a picture (`Pictured`).

Paper is figures, text, legends, units and files.

Figures are matplotlib's, made without pyplot, so drawing leaves no global state
behind. matplotlib is imported when the first picture is drawn. A file is written whole
or not at all; the same picture gives the same bytes.
"""

from __future__ import annotations

import base64
import contextlib
import html
import io
import math
import warnings
from abc import abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from blockmech.figures.palette import COLUMN, DPI, PALE, ROW, SMALL, STYLE, TEXT
from blockmech.ground.arguments import declared
from blockmech.ground.errors import BlockmechError, listed, refused
from blockmech.ground.files import AnyPath, writing
from blockmech.ground.report import Report
from blockmech.ground.units import shown_in
from blockmech.typing import Arguments

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.gridspec import SubplotSpec

STILL = (".png", ".svg", ".pdf")
MOVING = (".gif", ".html", ".mp4")

LEGEND = 3.75 * TEXT  # [pt] beside a word of a legend: its line, and what is between columns
BESIDE = 4.5 * TEXT  # [pt] left of axes: their words
UNBROKEN = str.maketrans(" ", "\u00a0")  # spaces at which no line breaks
TYPESET = str.maketrans("23", "²³")  # powers in units
PREFIXES = {9: "G", 6: "M", 3: "k", 0: "", -3: "m", -6: "µ", -9: "n"}


@contextlib.contextmanager
def styled() -> Iterator[None]:
    """Draw in blockmech's style, whatever the user's own settings are."""
    import matplotlib

    with matplotlib.rc_context(), _any_script():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(STYLE)
        yield


@contextlib.contextmanager
def _any_script() -> Iterator[None]:
    """A script that the font lacks is shown as boxes; that is no reason to warn."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        yield


def new_figure(width: float, height: float, **settings: Any) -> Any:
    """An empty figure of a size in points."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width / 72, height / 72), **settings)
    FigureCanvasAgg(figure)
    return figure


def new_page(width: float, height: float, left_edge: float, top: float) -> tuple[Figure, Axes]:
    """A figure and axes that cover it from a corner on, one unit a point, y downward."""
    figure = new_figure(width, height)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_xlim(left_edge, left_edge + width)
    axes.set_ylim(top + height, top)
    axes.set_axis_off()
    return figure, axes


def arrow(axes: Axes, ends: Any, bend: float, shrink: tuple[float, float], **look: Any) -> None:
    """An arrow between two ends that stops short of them [pt]; ``bend`` is in its length."""
    look |= {"arrowstyle": "-|>", "connectionstyle": f"arc3,rad={bend}"}
    look |= {"shrinkA": shrink[0], "shrinkB": shrink[1]}
    axes.annotate("", ends[1], ends[0], arrowprops=look, zorder=1)


@contextlib.contextmanager
def panelled(
    caption: str,
    height: float,
    rows: int = 1,
    columns: int = 1,
    *,
    ax: Axes | None = None,
    width: float = COLUMN,
    height_ratios: Sequence[float] | None = None,
    sharex: bool | str = "col",
    sharey: bool = False,
) -> Iterator[Any]:
    """Axes (rows, columns) with a grid, to be drawn in.

    They are of a new figure, a column wide and with words below it, which come on top of the
    height [pt]; or they stand in place of ``ax``, without the words.
    """
    shared: Arguments = {"squeeze": False, "sharex": sharex, "sharey": sharey}
    with styled():
        if ax is None:
            lines = wrapped(caption, SMALL, width - 10) if caption else []
            figure = new_figure(width, height + ROW * len(lines), layout="constrained")
            if lines:
                figure.supxlabel("\n".join(lines), x=0.02, ha="left", fontsize=SMALL)
            panels = figure.subplots(rows, columns, height_ratios=height_ratios, **shared)
        elif rows == columns == 1:
            panels = np.array([[ax]])
        else:
            grid = cell_of(ax).subgridspec(rows, columns, height_ratios=height_ratios)
            panels = grid.subplots(**shared)
        for axes in panels.flat:  # those of a user were made in another style
            axes.grid(True, color=PALE, lw=STYLE["grid.linewidth"])
            axes.set_axisbelow(True)
        yield panels


def grow(axes: Any, rows: int, ax: Axes | None) -> None:
    """Make the figure of axes higher by rows of small text, unless it is the user's."""
    if ax is None:
        axes.figure.set_figheight(axes.figure.get_figheight() + rows * ROW / 72)


def cell_of(ax: Axes) -> SubplotSpec:
    """The place of axes in their figure, which are emptied: several stand there."""
    if (cell := ax.get_subplotspec()) is None:
        remedy = "give one of plt.subplots(); it is shared out among the panels"
        raise refused("ax", "these axes stand in no grid of subplots", remedy)
    ax.set_axis_off()
    return cell


def put_in(figure: Any, ax: Any) -> Any:
    """A picture in a user's axes, which get its coordinates; the user's figure.

    Its words have the sizes of a page, so it is put there as a whole, as an image.
    """
    with styled():
        figure.set_dpi(DPI)
        figure.canvas.draw()
        corners = figure.axes[0].transData.inverted().transform([(0.0, 0.0), figure.bbox.max])
        ax.imshow(np.asarray(figure.canvas.buffer_rgba()), extent=corners.T.ravel(), zorder=0)
        ax.set_axis_off()
    return ax.figure


def picture_unit(unit: str, display: Iterable[str] = (), largest: float = 0.0) -> tuple[float, str]:
    """Factor and unit in which a quantity is drawn.

    It is the first of the units of its kind that are displayed; else degrees for an angle, and a
    prefix for a force, power or energy of which the largest is known.
    """
    factor, symbol = shown_in(unit, (*display, "deg"))
    prefix, symbol = scaled_unit(symbol, factor * largest)
    return prefix * factor, symbol.translate(TYPESET).replace("deg", "°")


def amount(x: float, unit: str, display: Iterable[str] = ()) -> str:
    """A number with its unit as it stands in a picture, to four digits."""
    factor, unit = picture_unit(unit, display, abs(x))
    return f"{factor * x:.4g}{'' if unit == '°' else ' '}{unit}"


@lru_cache(maxsize=4096)
def text_width(text: str, size: float, bold: bool = False) -> float:
    """Width [pt] of one line of text."""
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import text_to_path

    font = FontProperties(family="DejaVu Sans", weight="bold" if bold else "normal", size=size)
    with _any_script():
        width, _, _ = text_to_path.get_text_width_height_descent(text, font, False)
    return float(width)


def shown_name(name: str, limit: int = 24) -> str:
    """A name as one line of printable text; long ones lose their middle."""
    line = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in name)
    if len(line) > limit:
        line = f"{line[: limit - limit // 3 - 1]}…{line[-(limit // 3) :]}"
    return line


def wrapped(text: str, size: float, width: float, bold: bool = False) -> list[str]:
    """Text as lines of at most a width [pt], broken at spaces only."""
    lines: list[str] = []
    for word in text.split(" "):
        longer = f"{lines[-1]} {word}" if lines else word
        if lines and text_width(longer, size, bold) <= width:
            lines[-1] = longer
        else:
            lines.append(word)
    return lines


def fitting_columns(labels: Sequence[str], width: float) -> int:
    """Columns of a legend of a width [pt] that is read row by row, each as wide as needed."""
    wide = [text_width(label, SMALL) + LEGEND for label in labels]
    columns = len(labels)
    while columns > 1 and sum(max(wide[k::columns]) for k in range(columns)) > width:
        columns -= 1
    return columns


def legend_above(axes: Axes, width: float) -> int:
    """A legend above axes, of what has a label there, once each; the number of its rows."""
    lines, labels = axes.get_legend_handles_labels()
    entries = dict(zip(labels, lines, strict=True))
    if not entries:
        return 0
    columns = fitting_columns([*entries], width - BESIDE)
    order = [name for k in range(columns) for name in [*entries][k::columns]]  # it fills columns
    handles = [entries[name] for name in order]
    axes.legend(handles, order, bbox_to_anchor=(0.0, 1.0), ncols=columns)
    return -(-len(entries) // columns)


def axis_label(name: str, unit: str, room: float) -> str:
    """A name and its unit, on more lines where one has not the room [pt]."""
    bracketed = f"[{unit or '–'}]"
    breaks = [name.find("(") + 1, *(k for k, sign in enumerate(name) if sign == ".")]
    names = [f"{name[:k]}\n{name[k:]}" for k in breaks if k]
    texts = [f"{name} {bracketed}", f"{name}\n{bracketed}"]
    texts += [f"{text}{gap}{bracketed}" for gap in " \n" for text in names]
    fitting = (t for t in texts if max(text_width(x, TEXT) for x in t.split("\n")) <= room)
    return next(fitting, texts[-1])


def scaled_unit(unit: str, largest: float) -> tuple[float, str]:
    """A factor and a unit with a prefix, so that a force, power or energy reads well.

    >>> scaled_unit("N m", 12000.0)
    (0.001, 'kN m')
    """
    plain = unit.split()[0].split("/")[0] if unit else ""
    if plain not in ("N", "W", "J") or not 0 < largest < math.inf:
        return 1.0, unit
    power = 3 * math.floor(math.log10(largest * 1.0000001) / 3)
    if power == 3 and largest < 5000:
        power = 0  # 1200 N reads as well as 1.2 kN
    power = min(max(power, -9), 9)
    return 10.0**-power, PREFIXES[power] + unit


def rendered(figure: Figure, suffix: str) -> bytes:
    """The picture as the bytes of a .png, .svg or .pdf file; the same for the same picture."""
    from PIL import Image

    date = {".svg": {"Date": None}, ".pdf": {"CreationDate": None, "ModDate": None}}
    buffer, (width, height) = io.BytesIO(), figure.get_size_inches()
    dpi = float(DPI)
    if suffix == ".png":  # less sharp where Pillow would warn of its size
        dpi = min(dpi, math.sqrt((Image.MAX_IMAGE_PIXELS or math.inf) / (width * height)))
    with styled():  # how text and identities are written is settled now, not while drawing
        figure.savefig(buffer, format=suffix[1:], dpi=dpi, metadata=date.get(suffix))
    return buffer.getvalue()


def svg(figure: Figure) -> str:
    """A figure as SVG text; the same picture gives the same text.

    >>> bm.draw.svg(mech.draw(at="30deg"))[:4]
    '<?xm'
    """
    return rendered(figure, ".svg").decode()


def image(figure: Figure, alt: str) -> str:
    """A figure as an image of a page, in which no script runs."""
    data = base64.b64encode(rendered(figure, ".svg")).decode()
    return f'<img alt="{html.escape(alt)}" src="data:image/svg+xml;base64,{data}">'


def write_figure(figure: Figure, path: AnyPath, suffix: str = ".png") -> Path:
    """Write a figure as the suffix says."""
    data = rendered(figure, suffix)
    with writing(path) as stream:
        stream.write(data)
    return Path(path)


def suffix_of(path: AnyPath, subject: str = "a plot", valid: Sequence[str] = STILL) -> str:
    """The suffix of a picture's file; raises `RequestError` for one that is not valid."""
    suffix = Path(path).suffix.lower()
    if suffix not in valid:
        message = f'{subject} cannot be written as "{suffix}"' if suffix else "it has no suffix"
        choices = f"suffixes for {subject}: {listed(valid)}"
        remedy = "name outputs by want=" if subject == "a plot" else "leave kind= out"
        remedy = f"choose one of them, or {remedy}"
        raise refused(str(path), message, remedy, choices, "unknown-suffix")
    return suffix


class Pictured(Report):
    """What people read, with a picture."""

    @abstractmethod
    def figure(self, ax: Axes | None = None) -> Any:
        """matplotlib's figure, in place of the axes ``ax`` if they are given.

        Raises `RequestError` where there is nothing to draw.
        """

    @declared
    def plot(self, path: AnyPath | None = None, *, ax: Axes | None = None) -> Any:
        """The picture as matplotlib's figure; with a path it is written (png, svg or pdf).

        ``ax`` are axes to draw in, which are shared out among several panels; units are those of
        `to`, of angles degrees by default. Raises `RequestError` for another suffix, before
        anything is drawn, and where there is nothing to draw.
        """
        suffix = "" if path is None else suffix_of(path)
        figure = self.figure(ax)
        if path is not None:
            write_figure(figure, path, suffix)
        return figure

    def _repr_html_(self) -> str:
        text = super()._repr_html_()
        with suppress(BlockmechError):
            text += svg(self.figure())
        return text
