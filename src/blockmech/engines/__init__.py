"""Engines: they bind a program to a number type and run it over samples."""
