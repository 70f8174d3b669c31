"""Positions of a drawing by distances alone: no link frames, no groups, nothing of blockmech.

Unknown are the places of the moving points. Points of one link keep their distances (and the sense
of their triangles), a point in a slot stays on the line through two others, the driven link is at
its angle. Newton follows the drawn pose in small steps of the crank.
"""

from __future__ import annotations

import cmath
import math

import numpy as np
from scipy.optimize import least_squares


class Distances:
    """A drawing as points (name -> complex), links (lists of names), fixed points, slots (name ->
    two points, or a point and an angle) and the crank (its centre, a point of the driven link)."""

    def __init__(self, points, links, fixed, slots, crank):
        self.drawn, self.fixed, self.slots = points, set(fixed), slots
        self.centre, self.pin = crank
        self.size = max(abs(a - b) for a in points.values() for b in points.values())
        self.moving = sorted(p for p in points if p not in self.fixed)
        self.links = links
        self.conditions = list(self._rigid())

    def _rigid(self):
        for link in self.links:
            first, *rest = link
            for k, other in enumerate(rest):
                yield "length", (first, other), abs(self.drawn[first] - self.drawn[other])
                if k:  # the third point keeps its place against the first two
                    base = self.drawn[rest[0]] - self.drawn[first]
                    yield (
                        "area",
                        (first, rest[0], other),
                        _cross(base, self.drawn[other] - self.drawn[first]),
                    )
        for point, line in self.slots.items():
            yield "slot", (point, line), 0.0

    def residuals(self, x, q):
        z = dict(self.drawn)
        z |= dict(zip(self.moving, x[::2] + 1j * x[1::2], strict=True))
        misfits = []
        for kind, at, value in self.conditions:
            if kind == "length":
                misfits.append((abs(z[at[0]] - z[at[1]]) - value) / self.size)
            elif kind == "area":
                a, b, c = (z[p] for p in at)
                misfits.append((_cross(b - a, c - a) - value) / self.size**2)
            else:
                point, line = at
                a, direction = self._line(z, line)
                misfits.append(_cross(direction, z[point] - a) / self.size)
        arm = self.drawn[self.pin] - self.drawn[self.centre]
        off = z[self.pin] - z[self.centre] - arm * cmath.exp(1j * q)
        return np.array([*misfits, off.real / self.size, off.imag / self.size])

    def _line(self, z, line):
        a, b = line
        if isinstance(b, str):
            vector = z[b] - z[a]
            return z[a], vector / abs(vector)
        return self.drawn[a], cmath.exp(1j * b)

    def follow(self, angles, steps=12):
        """Places (name -> list) at crank angles from the drawn one, in order."""
        x = np.array([v for p in self.moving for v in (self.drawn[p].real, self.drawn[p].imag)])
        q, paths = 0.0, {p: [] for p in self.drawn}
        for target in angles:
            for k in range(1, steps + 1):
                angle = q + (target - q) * k / steps
                solved = least_squares(
                    self.residuals, x, args=(angle,), xtol=1e-15, ftol=1e-15, gtol=1e-15
                )
                x = solved.x
            assert np.abs(solved.fun).max() < 1e-12, (target, solved.fun)
            q = target
            z = dict(self.drawn) | dict(zip(self.moving, x[::2] + 1j * x[1::2], strict=True))
            for p in paths:
                paths[p].append(z[p])
        return {p: np.array(values) for p, values in paths.items()}


def _cross(a, b):
    return (a.conjugate() * b).imag


def turn(n=24):
    """n crank angles of a turn, the first one a step from the drawn pose."""
    return [math.tau * k / n for k in range(1, n + 1)]
