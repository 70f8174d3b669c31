"""Motions found along the driver's path: energy and time as quadratures, no steps in time."""
