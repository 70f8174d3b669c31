"""The block types that this process knows."""

from __future__ import annotations

from blockmech.ground.registry import Registry

REGISTRY = Registry(
    "block type",
    code="unknown-block",
    families={"coupling": "blockmech.couplings.kinds", "signal": "blockmech.signals.kinds"},
)
"""Every block type by name: blocks, loads and couplings."""
