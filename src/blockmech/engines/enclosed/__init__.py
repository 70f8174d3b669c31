"""Enclosures: every number with proved bounds, for rounding and for tolerances."""
