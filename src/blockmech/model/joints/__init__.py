"""Links and joints: the joint-based document, and its decomposition into blocks."""

from blockmech.model.joints.linkage import Linkage

__all__ = ["Linkage"]
