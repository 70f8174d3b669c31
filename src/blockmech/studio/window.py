"""A figure in metres at equal scales, as large as the browser makes it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from bokeh.core.property.descriptors import UnsetValueError
from bokeh.models import CustomJSTickFormatter, Range1d
from bokeh.plotting import figure

from blockmech.draw.palette import SIZES, TEXT
from blockmech.studio.fields import Shown
from blockmech.studio.plots import PIXELS, dress
from blockmech.studio.session import heard

TICK = "return String(Number((tick * each).toPrecision(5))).replace('-', '\u2212')"
SIZE = 700, 500  # [px] before the browser says


class Window:
    """Axes over places in the plane; ``resized`` is called when the browser changes their size."""

    def __init__(self, dark: bool, resized: Callable[[], None]) -> None:
        self.x, self.y = Range1d(-1, 1), Range1d(-1, 1)
        self.figure = figure(
            x_range=self.x, y_range=self.y, x_axis_label="x [m]", y_axis_label="y [m]",
            tools="pan,wheel_zoom,reset,save", active_scroll="wheel_zoom", min_height=220,
            sizing_mode="stretch_both",
        )  # fmt: skip
        dress(self.figure, dark)
        self.ticks = CustomJSTickFormatter(args={"each": 1.0}, code=TICK)
        self.figure.axis.formatter = self.ticks
        fit = heard(lambda: None if self.size == SIZE else resized())  # both are to be told
        for size in ("inner_width", "inner_height"):
            self.figure.on_change(size, lambda attr, old, new: fit())

    def measured(self, units: Shown) -> None:
        """Write lengths in the unit that the user chose."""
        self.ticks.args = {"each": units.factor("m")}
        for axis, name in zip(self.figure.axis, "xy", strict=True):
            axis.axis_label = f"{name} [{units.length}]"

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the axes [px]."""
        try:
            return max(self.figure.inner_width, 1), max(self.figure.inner_height, 1)
        except UnsetValueError:
            return SIZE

    @property
    def scale(self) -> float:
        """What a pixel is [m]."""
        return float(abs(self.x.end - self.x.start)) / self.size[0]

    def fit(self, low: complex, high: complex) -> None:
        """Show all from the lower left corner to the upper right one [m], with air around."""
        width, height = self.size
        edge, name = 2 * SIZES.edge * PIXELS, 2 * TEXT * PIXELS  # names stand beside joints
        size, middle = high - low, (high + low) / 2
        room = max(width - edge - name, 1), max(height - edge, 1)
        scale = max(size.real / room[0], size.imag / room[1]) or 1.0 / width
        half = complex(width, height) * scale / 2
        for axis, c, h in ((self.x, middle.real, half.real), (self.y, middle.imag, half.imag)):
            axis.update(start=c - h, end=c + h, reset_start=c - h, reset_end=c + h)

    def shows(self, z: Any) -> bool:
        """Whether a place is within the axes."""
        inside = self.x.start <= z.real <= self.x.end and self.y.start <= z.imag <= self.y.end
        return bool(inside)
