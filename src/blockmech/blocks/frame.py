"""Frame: the fixed link; its markers are pivots and guides.

Sources: [R10] Ruiz, Durango & Calle 2010, Fig. 3 (link 0).
"""

from __future__ import annotations

from typing import ClassVar

from pydantic import model_validator

from blockmech.blocks.contract import Block, BuiltIn, refuse
from blockmech.values import Marker


class Frame(Block, type="frame"):
    """The fixed link. All its markers are the user's.

    >>> Frame(markers={"A": (0, 0), "D": (5.5, 0)}).markers["D"].at
    5.5+0j
    """

    link_names: ClassVar[tuple[str, ...]] = ("frame",)

    markers: dict[str, Marker] = {}

    @model_validator(mode="after")
    def _names_are_free(self) -> Frame:
        for marker in self.markers:
            if "." in marker or "/" in marker or not marker:
                refuse(f'marker "{marker}": "." and "/" are reserved in names', "", ())
        return self

    def markers_of(self) -> dict[str, tuple[str, Marker | BuiltIn]]:
        """The frame's markers; ``frame`` itself is the one at its origin."""
        found: dict[str, tuple[str, Marker | BuiltIn]] = {"frame": ("frame", BuiltIn("frame"))}
        return found | {name: ("frame", m) for name, m in self.markers.items()}
