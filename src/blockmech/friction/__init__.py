"""Friction of joints: the laws, and the solvers of a group's friction equations."""
