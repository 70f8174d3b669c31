"""Engines: they bind a program to a number type and run it over samples."""

from blockmech.engines.binding import bind
from blockmech.engines.numpy import PRECISIONS, NumpyEngine
from blockmech.engines.scalar import ScalarEngine

__all__ = ["PRECISIONS", "NumpyEngine", "ScalarEngine", "bind"]
