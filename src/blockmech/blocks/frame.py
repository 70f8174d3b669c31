"""Frame: the fixed link; its markers are pivots and guides.

Sources: [R10] Ruiz, Durango & Calle 2010, Fig. 3 (link 0).
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import ClassVar

from pydantic import field_validator

from blockmech.blocks.block import Block, bad_name, refuse
from blockmech.blocks.joints import BuiltIn
from blockmech.ground.names import is_name
from blockmech.ground.values import Marker, MarkersGiven, default


class Frame(Block, type="frame"):
    """The fixed link. All its markers are the user's.

    >>> Frame(markers={"A": (0, 0), "D": (5.5, 0)}).markers["D"].at
    5.5+0j
    """

    link_names: ClassVar[tuple[str, ...]] = ("frame",)

    markers: MarkersGiven = default({})

    @field_validator("markers")
    @classmethod
    def _names_are_good(cls, markers: dict[str, Marker]) -> dict[str, Marker]:
        wrong = (((name,), bad_name("marker", name)) for name in markers if not is_name(name))
        refuse(cls.__name__, wrong)
        return markers

    @cached_property
    def all_markers(self) -> Mapping[str, tuple[str, Marker | BuiltIn]]:
        """The frame's markers; ``frame`` itself is the one at its origin."""
        markers: dict[str, tuple[str, Marker | BuiltIn]] = {"frame": ("frame", BuiltIn("frame"))}
        return markers | {name: ("frame", m) for name, m in self.markers.items()}
