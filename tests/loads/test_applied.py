"""Forces by a law of place, rate, time or signal, in ground axes and in those of the link."""

from __future__ import annotations

import math

import numpy as np
import pytest

import blockmech as bm
from blockmech.loads import laws
from tests.machines import wire

Q = np.array([0.3, 1.1, 2.5, 3.3, 4.7, 11.3])
RATE = 3.0
DIRECTION = 0.6 + 0.8j
SIZE = 40.0  # [N] what the laws below reach
LINE = laws.Polynomial(coefficients=[5.0, -30.0])


def arm(force, position=0.5 + 0.2j):
    """An arm on a pivot at the origin, pushed at a point of it."""
    g = bm.Graph("arm")
    g.add("frame", bm.Frame(markers={"O": (0.0, 0.0)}))
    link = bm.Link(mass=2.0, inertia=0.5, markers={"P": position})
    g.add("crank", bm.Crank(length=1.0, links={"crank": link}))
    g.add("push", force)
    wire(g, "frame.O crank.A", "crank.P push.at")
    g.drive("crank", bm.motion.ConstantRate(rate=RATE))
    return g


def point(q, position=0.5 + 0.2j):
    """Position and velocity of the point, and the link's x axis."""
    e = np.exp(1j * q)
    return e * position, 1j * RATE * e * position, e


@pytest.mark.parametrize("axes", ["ground", "link"])
@pytest.mark.parametrize("of", ["coordinate", "rate"])
@pytest.mark.parametrize("engine", ["scalar", "numpy"])
def test_force_follows_its_own_coordinate_and_rate(axes, of, engine):
    law = LINE.model_copy(update={"of": of})
    mech = arm(bm.Force(direction=DIRECTION * 2, law=law, axes=axes)).compile()
    run = mech.run(at=Q, want=["push.at.force", "crank.drive"], engine=engine)
    p, v, e = point(Q)
    u = DIRECTION * (e if axes == "link" else 1.0)
    expected = u * (5.0 - 30.0 * (np.conj(u) * (p if of == "coordinate" else v)).real)
    assert np.abs(run["push.at.force"] - expected).max() <= 1e-13 * SIZE
    moment = (np.conj(p) * expected).imag
    assert np.abs(run["crank.drive"] + moment).max() <= 1e-13 * SIZE
    assert mech.verify(at=Q).ok


def test_force_follows_a_driver_the_time_and_a_signal():
    by_driver = bm.Force(direction=(0, 1), law=lambda coordinate: coordinate**2, driver="crank")
    run = arm(by_driver).run(at=Q, want="push.at.force")
    assert run["push.at.force"] == pytest.approx(1j * Q**2, rel=1e-14)
    times = np.linspace(0.0, 1.0, 5)
    wave = laws.Fourier(of="time", period=2.0, sines=[7.0])
    run = arm(bm.Force(direction=(0, -2), law=wave)).run(times=times, want="push.at.force")
    assert np.abs(run["push.at.force"] + 7j * np.sin(math.pi * times)).max() <= 1e-13 * 7
    g = arm(bm.Force(direction=(1, 0), law=laws.Signal()))
    g.add("half", bm.signals.Gain(k=0.5))
    wire(g, "crank.rate half.u", "half.y push.law")
    assert g.run(at=[0.4], want="push.at.force")["push.at.force"][0] == 0.5 * RATE


@pytest.mark.parametrize("method", ["energy", "dop853"])
def test_governor_comes_to_rest_where_weight_and_centrifugal_force_balance(method):
    """An arm in the plane of a shaft that turns at w: cos(angle from the shaft) = g / (w^2 l).

    Released at 0.4 rad from the shaft, it swings to the angle of the same
    m w^2 l^2 sin^2 / 2 + m g l cos, which is the other root of a quadratic in cos.
    """
    m, w, length, gravity = 2.0, 6.0, 1.0, 9.81
    centrifugal = laws.Polynomial(coefficients=[0.0, m * w**2])
    g = bm.Graph("governor", gravity=(0.0, -gravity))
    g.add("frame", bm.Frame(markers={"O": bm.Marker(at=(0, 0), dir=(0, -1))}))
    g.add("arm", bm.Crank(length=length, links={"crank": bm.Link(mass=m, cm=(length, 0))}))
    g.add("push", bm.Force(direction=(1.0, 0.0), law=centrifugal))
    wire(g, "frame.O arm.A", "arm.B push.at")
    g.start("arm", 0.4)
    governor = g.compile()
    stable = sorted(
        math.remainder(x.at["arm.q"], math.tau) for x in governor.equilibria() if x.kind == "stable"
    )
    balance = math.acos(gravity / (w**2 * length))
    assert stable == pytest.approx([-balance, balance], abs=1e-9)
    # w^2 l sin(q)^2 / 2 + g cos(q) is constant where the arm stops
    cosine = 2 * gravity / (w**2 * length) - math.cos(0.4)
    motion = governor.simulate("standstill", method=method, accuracy=1e-10).motion
    assert motion.q_end == pytest.approx(math.acos(cosine), abs=1e-9)


def test_document_says_the_same_in_the_axes_of_a_link_that_its_block_turns():
    def linkage(**load):
        m = bm.Linkage("rocker")
        for name in ("crank", "rod", "rocker"):
            m.add_link(name)
        m.add_joint("A", "R", ["frame", "crank"], point=(0, 0))
        m.add_joint("B", "R", ["crank", "rod"], point=(0.6, 0.8))
        m.add_joint("C", "R", ["rod", "rocker"], point=(2.9, 1.9))
        m.add_joint("D", "R", ["frame", "rocker"], point=(2.5, 0))
        m.add_driver("motor", "A", bm.motion.ConstantRate(rate=10.0))
        m.add_load("push", "force", link="rod", at=(2.0, 1.0), **load)
        return m

    law = {"kind": "polynomial", "coefficients": [5.0]}
    want = ["driver.motor.drive", "push.at.force"]
    by_law = linkage(axes="link", direction=(3.0, 4.0), law=law)
    constant = linkage(axes="link", force=(3.0, 4.0))
    runs = [m.compile().run(samples=7, want=want) for m in (by_law, constant)]
    for name in want:
        a, b = (run[name] for run in runs)
        assert np.abs(a - b).max() <= 1e-13 * np.abs(b).max()
    again = bm.Linkage.from_data(by_law.to_data())
    assert again.compile().run(samples=7, want=want)[want[0]].tolist() == runs[0][want[0]].tolist()


def test_derivatives_reach_the_numbers_of_the_law():
    mech = arm(bm.Force(direction=DIRECTION, law=LINE)).compile()
    path = "push.law.coefficients[1]"
    want = "max_abs(crank.drive)"
    exact = mech.sensitivity(want, path, at=Q).ahead[want]
    step = 1e-6
    high, low = mech.study({path: [-30.0 + step, -30.0 - step]}, want=want, at=Q)[want]
    assert float(np.squeeze(exact)) == pytest.approx((high - low) / (2 * step), rel=1e-7)


@pytest.mark.parametrize(
    ("keys", "because"),
    [
        ({}, "has neither force nor law"),
        ({"force": (1, 0), "law": LINE}, "has force and law"),
        ({"force": (1, 0), "direction": (1, 0)}, "has force and direction"),
        ({"law": LINE}, 'give "force", or "direction" and "law"'),
        ({"law": LINE, "direction": (0, 0)}, r'"direction" must not be \[0, 0\]'),
        ({"force": (1, 0), "driver": "crank"}, "is useless: the law is constant"),
    ],
)
def test_force_is_a_constant_vector_or_a_law_in_a_direction(keys, because):
    with pytest.raises(bm.GraphError, match=because):
        bm.Force(**keys)
