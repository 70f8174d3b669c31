"""The modules of signal blocks; importing this one registers their kinds."""

from blockmech.signals import algebra, dynamic, functions, sources

MODULES = algebra, dynamic, functions, sources
