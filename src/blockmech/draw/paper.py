"""The paper that pictures are drawn on: style, text, figures and files.

Figures are matplotlib's, made without pyplot, so drawing leaves no global state
behind. matplotlib is imported when the first picture is drawn.
"""

from __future__ import annotations

import contextlib
import functools
import io
import os
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from blockmech.draw.palette import DPI, STYLE
from blockmech.errors import Problem, RequestError

STILL = (".png", ".svg", ".pdf")


@contextlib.contextmanager
def styled() -> Iterator[None]:
    """Draw in blockmech's style, whatever the user's own settings are."""
    import matplotlib

    with matplotlib.rc_context(), warnings.catch_warnings():
        # A script that the font lacks is shown as boxes; that is no reason to warn.
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(STYLE)
        yield


def new_figure(width: float, height: float) -> Any:
    """An empty figure of a size in points."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width / 72, height / 72))
    FigureCanvasAgg(figure)
    return figure


def new_page(width: float, height: float) -> tuple[Any, Any]:
    """A figure and axes that cover it, one unit a point, y downward."""
    figure = new_figure(width, height)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_xlim(0, width)
    axes.set_ylim(height, 0)
    axes.set_axis_off()
    return figure, axes


def text_width(text: str, size: float, bold: bool = False) -> float:
    """Width [pt] of one line of text."""
    return _unit_width(text, bold) * size


@functools.cache
def _unit_width(text: str, bold: bool) -> float:
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import text_to_path

    font = FontProperties(family="DejaVu Sans", weight="bold" if bold else "normal", size=100)
    width, _, _ = text_to_path.get_text_width_height_descent(text, font, False)
    return float(width) / 100


def shown_name(name: str, most: int = 24) -> str:
    """A name as one line of printable text; long ones lose their middle."""
    line = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in name)
    if len(line) > most:
        line = f"{line[: most - most // 3 - 1]}…{line[-(most // 3) :]}"
    return line


def wrapped(text: str, size: float, width: float, joint: str = " ") -> list[str]:
    """Text as lines of at most a width [pt], broken at ``joint`` only."""
    lines: list[str] = []
    for word in text.split(joint):
        longer = f"{lines[-1]}{joint}{word}" if lines else word
        if lines and text_width(longer, size) <= width:
            lines[-1] = longer
        else:
            lines.append(word)
    return lines


def rendered(figure: Any, suffix: str, dpi: int = DPI) -> bytes:
    """The picture as the bytes of a .png, .svg or .pdf file; the same for the same picture."""
    date = {".svg": {"Date": None}, ".pdf": {"CreationDate": None, "ModDate": None}}
    buffer = io.BytesIO()
    with styled():  # how text and identities are written is settled now, not while drawing
        figure.savefig(buffer, format=suffix[1:], dpi=dpi, metadata=date.get(suffix))
    return buffer.getvalue()


def suffix_of(path: str | os.PathLike[str], valid: tuple[str, ...], what: str) -> str:
    """The path's suffix in lower case. Raises `RequestError` where it is not among ``valid``."""
    suffix = Path(path).suffix.lower()
    if suffix not in valid:
        raise RequestError(
            Problem(
                "unknown-suffix",
                str(path),
                f'{what} is not written as "{suffix}"' if suffix else "the file has no suffix",
                f"{what}: {', '.join(valid)}",
                "choose one of these suffixes",
            )
        )
    return suffix
