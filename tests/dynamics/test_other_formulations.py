"""Two formulations that the papers name, against the reduction: what they cost and what they lose.

[D14] describes both in words. Hansen (1996) guesses the drivers' accelerations and corrects them
by the efforts that the force pass says they would need; Wang et al. (2008) integrate coordinates
of every unit and hold them together by their accelerations alone. The numbers in docs/papers.md
are those of this file.
"""

from __future__ import annotations

import numpy as np
import pytest

import blockmech as bm
from tests.gallery import document
from tests.independent import multibody as mb
from tests.independent.kept import kept
from tests.independent.test_rubbing import DOCUMENT, FOURBAR

Q, RATE = 1.0, 20.0


def corrected(mech, friction, tolerance=1e-13):
    """q'' by corrections of a guess, and the force passes that it takes."""
    passes = 0

    def needed(guess):
        nonlocal passes
        passes += 1
        run = mech.run(at=Q, rates=RATE, accelerations=guess, friction=friction, want="crank.drive")
        return float(run["crank.drive"][0])

    a, b = 0.0, 1.0
    left, right = needed(a), needed(b)
    while True:
        new = b - right * (b - a) / (right - left)
        if abs(new - b) <= tolerance * abs(new):
            return new, passes
        a, left = b, right
        b, right = new, needed(new)


@pytest.mark.parametrize(("friction", "most"), [("none", 3), ("newton", 5)])
def test_corrections_of_the_acceleration_come_to_that_of_the_reduction(friction, most):
    """Without friction the effort is affine: two passes say all, the others see that it stays."""
    mech = bm.Graph.from_data(document("ruiz_fourbar")).compile()
    moved = mech.simulate(
        "time=0.01", start={"crank": (Q, RATE)}, times=[0.0], friction=friction,
        want="crank.acceleration",
    )  # fmt: skip
    found, passes = corrected(mech, friction)
    assert found == pytest.approx(moved["crank.acceleration"][0], rel=1e-12)
    assert passes <= most


@kept(mb)
def drift(source, step, t_end=2.0):
    """Largest gap of a joint [m], and the crank's angle, after RK4 on all coordinates."""
    system = mb.read(source)
    poses = mb.assemble(system, system.home, [0.7])
    rates = mb.rates(system, poses, [9.0])
    shape, y = poses.shape, np.concatenate([poses.ravel(), rates.ravel()])

    def slope(y):
        q, qd = (part.reshape(shape) for part in np.split(y, 2))
        second, _ = mb.forward_acceleration(system, q, qd, [0.0])
        return np.concatenate([qd.ravel(), second.ravel()])

    for _ in range(round(t_end / step)):
        k1 = slope(y)
        k2 = slope(y + step / 2 * k1)
        k3 = slope(y + step / 2 * k2)
        k4 = slope(y + step * k3)
        y = y + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    poses = y[: poses.size].reshape(shape)
    gaps = mb.Instant(system, poses).rows()[0][: 2 * len(system.joints)]
    return float(np.abs(gaps).max()), float(poses[0, 2])


@pytest.mark.parametrize("source", [DOCUMENT, FOURBAR], ids=["slider-crank", "four-bar"])
def test_joints_of_a_state_space_of_all_units_drift_apart(source):
    """They fall with the step as the scheme does, but are never closed; ours are to rounding."""
    mech = bm.Linkage.from_data(source).compile()
    motion = mech.simulate("time=2", start={"motor": (0.7, 9.0)}, accuracy=1e-11, want=()).motion
    result = [drift(source, step) for step in (4e-3, 2e-3)]
    (coarse, angle), (fine, closer) = result
    assert coarse > 1e-9
    assert 8 < coarse / fine < 32  # fourth order
    assert abs(closer - motion.q_end) < abs(angle - motion.q_end)
    ours = mech.simulate("time=2", start={"motor": (0.7, 9.0)}, times=[2.0])
    assert mech.verify(ours).ok
