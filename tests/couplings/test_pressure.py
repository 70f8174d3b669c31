"""Tooth forces at their pressure angle and chains, with friction in the pins that they load.

Friction of the driven pin may turn the sense of what goes through a mesh: the part that pushes
the wheels apart in either sense then loads the pins by the effort that is left. Statics of both
wheels by hand, an iteration of its own, and SciPy's integration of both.
"""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import blockmech as bm
from tests.machines import wire

ANGLE, MU, ROUND_PIN, G = 0.35, 0.3, 0.01, 9.81
CENTRES = 0.05 + 0.02j
TEETH = (20, 41)
ONE, TWO = (1.0, 2e-3, 0.0), (2.0, 3e-2, 0.06)  # mass, inertia, centre of mass along the link
FRICTION = {"A": bm.friction.Coulomb(coefficient=MU, radius=ROUND_PIN)}


def wheels(load, motor=0.0, internal=False):
    g = bm.Graph("wheels", gravity=(0.0, -G))
    g.add("frame", bm.Frame(markers={"A": (0.0, 0.0), "B": CENTRES}))
    for name, (m, J, s), moment in (("one", ONE, motor), ("two", TWO, load)):
        link = bm.Link(mass=m, inertia=J, cm=(s, 0.0))
        g.add(name, bm.Crank(links={"crank": link}, friction=FRICTION))
        g.add(f"{name}_load", bm.Couple(moment=moment))
        g.connect(f"{name}.crank", f"{name}_load.on")
    g.add(
        "mesh",
        bm.Gear(
            driver="one", driven="two", teeth=TEETH, internal=internal, pressure_angle=ANGLE
        ),
    )  # fmt: skip
    return wire(g, "frame.A one.A", "frame.B two.A")


def by_hand(q, rate, acceleration, load, internal, sense):
    """Drive, both pins' reactions and the effort through the mesh."""
    i = TEETH[0] / TEETH[1] * (1 if internal else -1)
    pitch = -i * CENTRES / (1 - i)
    arm = pitch - CENTRES
    apart = pitch / abs(pitch)
    m, J, s = TWO
    cm = s * cmath.exp(1j * i * q)
    inertial = m * (1j * i * acceleration - (i * rate) ** 2) * cm
    rub = 0.0
    for _ in range(60):
        effort = (J + m * s * s) * i * acceleration - load - rub + m * G * cm.real
        size = abs(effort) / abs(arm)
        push = effort / abs(arm) * 1j * arm / abs(arm) + size * math.tan(ANGLE) * apart
        two = inertial + 1j * m * G - push
        last, rub = rub, -sense * np.sign(i) * MU * ROUND_PIN * abs(two)
        if abs(rub - last) <= 1e-16 * abs(rub):
            break
    reaction = push + 1j * ONE[0] * G
    rubbed = -sense * MU * ROUND_PIN * abs(reaction)
    moment = (pitch.conjugate() * -push).imag
    return ONE[1] * acceleration - moment - rubbed, reaction, two, effort


@pytest.mark.parametrize("internal", [False, True])
@pytest.mark.parametrize("rate", [4.0, -4.0])
def test_pins_and_drive_where_friction_may_turn_the_effort(internal, rate):
    turned = 0
    for load in (3.0, -3.0, 1.1, 1.2, -1.15, -0.05):
        mech = wheels(load, internal=internal).compile()
        drive, reaction, two, effort = by_hand(0.3, rate, 2.0, load, internal, np.sign(rate))
        ideal = mech.run(at=[0.3], rates=rate, accelerations=2.0, friction="none")
        turned += effort * ideal["mesh.effort"][0] < 0
        for engine in ("scalar", "numpy", "llvm"):
            run = mech.run(at=[0.3], rates=rate, accelerations=2.0, engine=engine)
            assert run["one.drive"][0] == pytest.approx(drive, abs=1e-12)
            assert run["one.A.reaction"][0] == pytest.approx(reaction, abs=1e-10)
            assert run["two.A.reaction"][0] == pytest.approx(two, abs=1e-10)
            assert run["mesh.effort"][0] == pytest.approx(effort, abs=1e-12)
        (only,) = mech.friction_solutions(at=[0.3], rates=rate, accelerations=2.0)["one.drive"]
        assert only == pytest.approx(drive, abs=1e-12)
        assert mech.verify(at=[0.3], rates=rate, accelerations=2.0).ok
    assert turned or internal or rate < 0


def test_a_wheel_that_falls_moves_as_its_statics_say():
    """By two methods; the sense of the effort turns on the way."""
    motor = 0.05
    g = wheels(0.0, motor=motor)
    g.start("one", q=0.5, rate=0.0)

    def acceleration(q, rate):
        def missing(x):
            return by_hand(q, rate, x, 0.0, False, 1.0)[0] - motor

        a, b = 0.0, 50.0
        fa, fb = missing(a), missing(b)
        while abs(b - a) > 1e-12 * abs(b) and fa != fb:  # secants: straight but where effort turns
            a, b = b, b - fb * (b - a) / (fb - fa)
            fa, fb = fb, missing(b)
        return b

    t_end = 0.4
    trajectory = solve_ivp(
        lambda t, y: [y[1], acceleration(*y)], (0.0, t_end), [0.5, 0.0], "DOP853",
        rtol=1e-11, atol=1e-12, max_step=0.05,
    )  # fmt: skip
    ends = trajectory.y[:, [1, -1]].T
    first, last = (by_hand(*x, acceleration(*x), 0.0, False, 1.0)[3] for x in ends)
    assert first * last < 0
    mech = g.compile()
    for method in ("radau", "dop853"):
        motion = mech.simulate(f"time={t_end}", method=method, accuracy=1e-9).motion
        assert motion.q_end == pytest.approx(trajectory.y[0, -1], abs=1e-9)
        assert motion.qd_end == pytest.approx(trajectory.y[1, -1], abs=1e-8)


def test_several_drivers_rub_under_tooth_forces_and_lose_what_friction_takes():
    g = bm.Graph("differential", gravity=(0.0, -G))
    g.add("frame", bm.Frame(markers={"O": (0.0, 0.0)}))
    g.add(
        "carrier",
        bm.Crank(length=0.042, links={"crank": bm.Link(inertia=3e-3)}, friction=FRICTION),
    )
    g.add("planet", bm.Crank(links={"crank": bm.Link(mass=0.3, inertia=1e-4)}, friction=FRICTION))
    g.add("sun", bm.Crank(links={"crank": bm.Link(inertia=2e-4)}, friction=FRICTION))
    g.add(
        "mesh", bm.Gear(driver="planet", driven="sun", teeth=(18, 24), pressure_angle=ANGLE)
    )  # fmt: skip
    g.add("load", bm.Couple(moment=0.3))
    wire(g, "frame.O carrier.A", "carrier.B planet.A", "frame.O sun.A", "sun.crank load.on")
    g.start("carrier", q=0.0, rate=10.0)
    g.start("planet", q=0.0, rate=30.0)
    mech = g.compile()
    result = mech.simulate("time=0.05", want="*", times=np.linspace(0.0, 0.05, 7))
    assert result.motion.facts["energy_balance"] < 1e-10
    state = {"at": "q", "rates": "rate", "accelerations": "acceleration"}
    request = {k: {d: result[f"{d}.{x}"] for d in ("carrier", "planet")} for k, x in state.items()}
    run = mech.run(**request)
    for driver in ("carrier", "planet"):
        assert np.abs(run[f"{driver}.drive"]).max() < 1e-12
    assert run["sun.A.reaction"] == pytest.approx(result["sun.A.reaction"], rel=1e-12)


@pytest.mark.parametrize("preload", [0.0, 300.0])
def test_chains_and_belts_move_with_friction_by_both_integrators(preload):
    g = bm.Graph("belt", gravity=(0.0, -G))
    g.add("frame", bm.Frame(markers={"A": (0.0, 0.0), "B": (0.3, 0.1)}))
    for name, (m, J, s) in (("one", ONE), ("two", TWO)):
        link = bm.Link(mass=m, inertia=J, cm=(s, 0.0))
        g.add(name, bm.Crank(links={"crank": link}, friction=FRICTION))
        g.connect(f"frame.{'A' if name == 'one' else 'B'}", f"{name}.A")
    g.add("belt", bm.Belt(driver="one", driven="two", radii=(0.05, 0.09), preload=preload))
    g.start("one", q=0.7, rate=0.0)
    mech = g.compile()
    implicit, explicit = (mech.simulate("time=0.5", method=m).motion for m in ("radau", "dop853"))
    assert implicit.q_end == pytest.approx(explicit.q_end, abs=1e-8)
    assert (implicit.q_end == 0.7) == (preload > 0)  # the preload's friction holds it
    assert mech.verify(at=[0.3, 1.0], rates=3.0, accelerations=1.0).ok
