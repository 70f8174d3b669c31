"""The general group: any links and pairs that are determinate together.

`block` declares what a user writes, `equations` what the pairs demand and `kernels`
how links, pairs and one Jacobian answer it.
"""

from blockmech.blocks.general.block import GeneralGroup, Home, InnerPair, OuterPair

__all__ = ["GeneralGroup", "Home", "InnerPair", "OuterPair"]
