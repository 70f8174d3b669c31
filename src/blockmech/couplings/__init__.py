"""Couplings: one driver's coordinate as a function of another's."""
