"""One sheet with a picture of each mechanism of the gallery: gallery.py [PNG [NAME ...]]."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.image import imread

import blockmech as bm
from blockmech.draw import draw

GRAPHS, COLUMNS = Path(__file__).parents[1] / "graphs", 4


def sheet(target: Path, names: list[str] | None = None) -> list[str]:
    """Draw the mechanisms of these graph files (all by default); the names drawn."""
    files = [f for f in sorted(GRAPHS.glob("*.json")) if names is None or f.stem in names]
    rows = -(-len(files) // COLUMNS)
    figure = Figure(figsize=(2.2 * COLUMNS, 2.4 * rows), dpi=110, layout="constrained")
    with tempfile.TemporaryDirectory() as folder:
        for k, file in enumerate(files):
            picture = Path(folder) / f"{file.stem}.png"
            draw(bm.Graph.load(file), picture, kind="tile")
            axes = figure.add_subplot(rows, COLUMNS, k + 1)
            axes.imshow(imread(picture))
            axes.set_title(file.stem.replace("_", " "), fontsize=9)
            axes.set_axis_off()
    FigureCanvasAgg(figure).print_png(target)
    return [f.stem for f in files]


if __name__ == "__main__":
    print(sheet(Path(sys.argv[1] if len(sys.argv) > 1 else "gallery.png"), sys.argv[2:] or None))
