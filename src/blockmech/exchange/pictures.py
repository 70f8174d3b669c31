"""Pictures and films of a mechanism, as `blockmech.draw` makes them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from blockmech.draw import KINDS, animate, draw
from blockmech.exchange.formats import Order, Writer
from blockmech.figures.paper import MOVING, STILL
from blockmech.typing import Arguments, Data

TRACE = {"trace": "markers whose paths are drawn"}


def _coordinates(order: Order) -> Data | None:
    """Coordinates of the drivers at the poses that are asked for."""
    poses = order.samples()
    if poses is None:
        return None
    return {d: poses.coordinate(i) for i, d in enumerate(order.mechanism.drivers)}


def _trace(order: Order) -> Any:
    names = order.options.get("trace")
    return names.split(",") if isinstance(names, str) else names


def write_picture(order: Order, path: Path) -> list[Path]:
    """A picture of the kind that is asked for; curves are of the wanted outputs."""
    kind = order.options.get("kind", "mechanism")
    if kind == "curves":
        order.result().plot(path)
    else:
        takes = KINDS[kind].takes if kind in KINDS else ()
        settings: Arguments = {"want": order.want} if "want" in takes else {}
        at = _coordinates(order) if "at" in takes else None
        draw(order.mechanism, path, kind, at, trace=_trace(order), **settings)
    return [path]


def write_film(order: Order, path: Path) -> list[Path]:
    """An animation over the poses, or the range of the laws of motion."""
    animate(order.mechanism, path, _coordinates(order), trace=_trace(order))
    return [path]


PICTURE = Writer(
    "picture: the mechanism at poses, or another kind",
    tuple(s for s in STILL if s != ".svg"),
    write_picture,
    {"kind": f"curves, {', '.join(k for k in KINDS if k != 'animation')}; default mechanism"}
    | TRACE,
)
FILM = Writer("animation over poses", tuple(s for s in MOVING if s != ".html"), write_film, TRACE)
