"""Triads by chance: numbers of a triad that closes in one pose at least."""

import numpy as np


def points(rng, n=3, size=1.0):
    return size * (rng.normal(size=n) + 1j * rng.normal(size=n))


def pose(rng):
    """A place and a direction."""
    return complex(points(rng, 1)[0]), complex(np.exp(1j * rng.uniform(0, 2 * np.pi)))


def triad(rng):
    """Pivots, lengths, pins, and a pose in which they close (lengths rounded once)."""
    pins, pivots = points(rng), points(rng, size=1.5)
    o, e = pose(rng)
    lengths = np.abs(o + e * pins - pivots)
    return pivots.tolist(), lengths.tolist(), pins.tolist(), (o, e)


def dead_centre(rng):
    """The same at a dead centre: all legs on lines through one point."""
    pins = points(rng)
    o, e = pose(rng)
    ends, meet = o + e * pins, complex(points(rng, 1)[0])
    pivots = meet + (ends - meet) * rng.uniform(-2, 3, size=3)
    return pivots.tolist(), np.abs(ends - pivots).tolist(), pins.tolist(), (o, e)
