"""Judges: a mechanism checked against itself, its limits and its trades."""
