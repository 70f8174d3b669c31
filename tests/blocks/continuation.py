"""An independent way along a mechanism's motion: arc length of the judge's system.

The unknowns are all poses and the share t of a straight line in driver values, so a dead
centre is a point like any other: there dt/ds changes its sign, and the line has its end.
Nothing here knows of groups, homes, singular values or steps in driver values.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from tests.independent import multibody as mb

STRIDE = 0.15  # [-] of arc length: sizes of the mechanism and radians, all links together
BEND = 0.08  # [rad] between tangents of neighbouring points
CLOSED = 1e-13  # [-] correction of Newton at which a point is closed
FAR = 30.0  # sizes of the mechanism: a slide on its way to infinity is not followed further
TRIES = 12  # corrections; a point is reached in three or four


class Point(NamedTuple):
    """Poses (n, 3) at a share t of the line, and the unit tangent (3n + 1,)."""

    t: float
    poses: np.ndarray
    tangent: np.ndarray


class March:
    """The motion through one pose along one line of driver values, both ways."""

    def __init__(self, system, poses, coordinates, line):
        self.system = system
        self.start = np.asarray(coordinates, float)
        self.line = np.asarray(line, float)
        self.size = float(mb.Instant(system, np.asarray(poses, float)).size)
        self.unit = np.append(np.tile([self.size, self.size, 1.0], len(poses)), 1.0)
        self.home = np.append(np.asarray(poses, float).ravel(), 0.0)

    def rows(self, z):
        """Residuals (3n,) and their gradient (3n, 3n + 1) in scaled unknowns."""
        poses, t = z[:-1].reshape(-1, 3), z[-1]
        values, gradients, _ = mb.Instant(self.system, poses).rows()
        d = len(self.start)
        values[len(values) - d :] -= self.start + t * self.line
        slope = np.zeros((len(values), 1))
        slope[len(values) - d :, 0] = -self.line
        return values, np.hstack([gradients, slope]) * self.unit

    def corrected(self, z, along):
        """The point of the motion in the plane through z across a direction."""
        for _ in range(TRIES):
            values, gradient = self.rows(z)
            bordered = np.vstack([gradient, along])
            step = np.linalg.solve(bordered, -np.append(values, 0.0))
            z = z + step * self.unit
            if np.abs(step).max() <= CLOSED:
                break
        else:
            return None
        tangent = np.linalg.solve(bordered, np.append(np.zeros(len(values)), 1.0))
        return Point(z[-1], z[:-1].reshape(-1, 3), tangent / np.linalg.norm(tangent))

    def stepped(self, point, h):
        """The point an arc length h further."""
        z = np.append(point.poses.ravel(), point.t)
        return self.corrected(z + h * point.tangent * self.unit, point.tangent)

    def points(self, sense, until):
        """Points from home until the share ``until`` or the end of the line, and that end.

        ``way`` is +1 or -1, the side of home. The end is None where the line goes on.
        """
        out = np.zeros_like(self.home)
        out[-1] = sense
        point = self.corrected(self.home, out)
        if point.tangent[-1] * sense < 0:
            point = point._replace(tangent=-point.tangent)
        branch, h = [point], STRIDE / 4
        while branch[-1].t * sense < until:
            current = branch[-1]
            following = self.stepped(current, h)
            bend = (
                np.inf if following is None else np.linalg.norm(following.tangent - current.tangent)
            )
            if not bend <= BEND:
                h /= 2
                assert h > 1e-9, "the judge lost its way"
                continue
            if following.tangent[-1] * sense <= 0:  # the line ends between here and there
                return branch, self._end(current, h)
            branch.append(following)
            if np.abs(following.poses[:, :2]).max() > FAR * self.size:
                break
            h = min(STRIDE, h * (1.5 if bend < BEND / 2 else 1.0))
        return branch, None

    def _end(self, here, h):
        def speed(x):
            return self.stepped(here, x).tangent[-1]

        return self.stepped(here, brentq(speed, 0.0, h, xtol=1e-13)).t
