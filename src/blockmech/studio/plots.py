"""What all of bokeh's figures look like: the colours of the palette, light and dark."""

from __future__ import annotations

import colorsys
from typing import Any

from blockmech.figures import palette as ink

FONT = "DejaVu Sans, Verdana, sans-serif"
PIXELS = 12 / ink.SMALL  # of the screen in a point of the page: words 12 px high


def dress(plot: Any, dark: bool) -> None:
    """Give a figure the colours of the palette."""
    line, paper, pale = (coloured(c, dark) for c in (ink.INK, ink.PAPER, ink.PALE))
    plot.background_fill_color = plot.border_fill_color = paper
    plot.outline_line_color = line
    plot.grid.grid_line_color = pale
    plot.axis.axis_line_color = plot.axis.major_tick_line_color = line
    plot.axis.minor_tick_line_color = None
    plot.axis.axis_label_text_color = plot.axis.major_label_text_color = line
    plot.axis.axis_label_text_font = plot.axis.major_label_text_font = FONT
    plot.axis.axis_label_text_font_style = "normal"
    plot.toolbar.logo, plot.toolbar.autohide = None, True
    for legend in plot.legend:
        legend.update(background_fill_color=paper, border_line_color=None, label_text_color=line)
        legend.update(label_text_font=FONT, label_text_font_size="11px")
        legend.update(ncols=2, padding=0, spacing=2, margin=0, glyph_width=16, label_height=12)
        plot.add_layout(legend, "above")


def coloured(colour: str, dark: bool) -> str:
    """A colour of the palette, or on a dark page the one in which ink and paper have swapped."""
    if not dark:
        return colour
    hue, lightness, saturation = _hls(colour)
    swapped = colorsys.hls_to_rgb(hue, 1 - lightness * (1 - _hls(ink.INK)[1]), saturation)
    return "#" + "".join(f"{round(255 * x):02X}" for x in swapped)


def _hls(colour: str) -> tuple[float, float, float]:
    return colorsys.rgb_to_hls(*(x / 255 for x in bytes.fromhex(colour[1:])))
