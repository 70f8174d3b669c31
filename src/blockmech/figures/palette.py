"""Colours, line styles and sizes of all pictures, said once.

The colours are those of Okabe & Ito (2008), distinguished with any colour vision;
what matters never hangs on colour alone (line style, symbol or word go with it).
Sizes are in points of the printed picture; a paper's column is 8.5 cm wide.
"""

from __future__ import annotations

from dataclasses import dataclass

from blockmech.typing import Data

COLUMN = 8.5 / 2.54 * 72  # [pt] width of a paper's column
DPI = 300  # of pixel pictures

IN_DEGREES = True  # of angles on axes and in captions of pictures; else radians

TEXT = 8.0  # [pt] what all sizes around words are derived from
SMALL = 7 / 8 * TEXT
ROW = 11 / 8 * TEXT  # height of a line of small text, and of a row of a diagram
MOST = 40  # things with a name that one picture can hold
PANELS = 6  # or curves in a panel, that one picture can hold
DOT = 3.0  # [pt2] of a sample or a design
BAND = 3.0  # standard deviations: 99.7 % of a normal distribution


@dataclass(frozen=True)
class Sizes:
    """Sizes of symbols and of what is around them [pt].

    They are the page's, not the mechanism's, so that a print shows links and joints alike
    whatever the machine is; whoever wants another look changes them here.
    """

    # a mechanism
    link: float = 5.0  # width
    pin: float = 2.5  # radius of a revolute joint, and of a centre of mass
    marker: float = 1.6  # radius of a marker
    slider: tuple[float, float] = (8.0, 4.6)  # half length and half height
    force: tuple[float, float] = (12.0, 30.0)  # smallest that is shown, and largest
    couple: float = 10.0  # radius
    label_gap: float = 5.0  # of a link's name from the middle of the link
    left_margin: float = 41.0  # of the axes
    right: float = 8.0
    bottom: float = 27.0
    top: float = 8.0
    heights: tuple[float, float] = (110.0, 330.0)  # of the axes, lowest and tallest
    edge: float = 16.0  # free inside the axes
    # a diagram
    margin: float = 6.0  # around everything
    pad: float = 5.0  # between a box's edge and its words
    port: float = 2.6  # radius
    aside: float = 1.35  # half the distance of a wire's two lines
    track: float = 8.0  # distance of two wires that climb
    stub: float = 13.0  # free way between a box and the nearest track, room for an arrowhead


SIZES = Sizes()

INK = "#1A1A1A"
GREY = "#6B6B6B"
PALE = "#D9D9D9"
PAPER = "#FFFFFF"

FORWARD = "#0072B2"  # what flows forward: p, v, a
BACK = "#DB7A00"  # what flows back: F, M
ALARM = "#C4001A"  # unwired joints, cycles, missing blocks

LOAD = "#C4001A"
DRIVE = FORWARD
SPRING = "#006B4F"

SERIES = ("#0072B2", "#D55E00", "#009E73", "#AA4499", "#56B4E9", "#E69F00", "#1A1A1A", "#8C6D1F")
DASHES = ((), (5, 1.6), (1.2, 1.4), (6, 1.5, 1.2, 1.5), (9, 2), (3, 1.2))

FRAME_FILL = "#ECECEC"
DRIVER_FILL = "#DCEBF5"
GROUP_FILL = "#FFFFFF"
ELEMENT_FILL = "#FBF1E3"
LINK_FILLS = ("#A9CFE6", "#F3CE93", "#9AD6C1", "#E3B9D3", "#C9C9E8", "#E8E2A0")

STYLE = {
    # DejaVu Sans comes with matplotlib; a viewer of SVG that lacks it takes its own sans-serif.
    "font.family": ["DejaVu Sans", "sans-serif"],
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": TEXT,
    "text.parse_math": False,  # names are text, dollar signs included
    "axes.titlesize": TEXT,
    "axes.labelsize": TEXT,
    "axes.linewidth": 0.6,
    "axes.edgecolor": INK,
    "axes.unicode_minus": True,
    "xtick.labelsize": SMALL,
    "ytick.labelsize": SMALL,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "axes.axisbelow": True,
    "grid.color": PALE,
    "grid.linewidth": 0.3,
    "legend.fontsize": SMALL,
    "legend.frameon": False,
    "legend.loc": "lower left",
    "legend.borderaxespad": 0.1,
    "legend.borderpad": 0.1,
    "legend.labelspacing": 0.3,
    "legend.handlelength": 2.5,
    "legend.columnspacing": 1.2,
    "lines.linewidth": 1.2,
    "hatch.linewidth": 0.5,
    "svg.fonttype": "none",  # text stays text: small, searchable, and of any script
    "svg.hashsalt": "blockmech",
    "pdf.fonttype": 42,
}


def curve_style(i: int) -> Data:
    """Colour and dashes of the curve number i, for `plot`; 48 different ones."""
    return {
        "color": SERIES[i % len(SERIES)],
        "dashes": DASHES[(i + i // len(SERIES)) % len(DASHES)],
    }
