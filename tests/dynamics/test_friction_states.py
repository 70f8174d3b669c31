"""Friction laws with a state of their own, against formulations that know nothing of us.

LuGre's pendulum is the one of the design notes (DOP853 and Radau on m, z and w alone agree to
5e-10 there); the other integrations are below, from the equations of the papers.
"""

from __future__ import annotations

import inspect
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

import blockmech as bm
from blockmech.analysis.deflections import Course
from tests import machines
from tests.dynamics.test_friction_laws import HANGING, G, pendulum, wheel
from tests.gallery import changed, document
from tests.independent.kept import kept

CURVE = {"static": 0.3, "kinetic": 0.2, "stribeck_speed": 0.5, "viscous": 0.01}
PIN = 0.05


def lugre(stiffness=1e3, **options):
    damping = 0.03 * math.sqrt(stiffness)
    return bm.friction.LuGre(
        **CURVE, stiffness=stiffness, damping=damping, **{"radius": PIN, **options}
    )


# -- motion ----------------------------------------------------------------------------------

TIMES = [0.5, 1.0, 2.0, 5.0, 6.0]  # [s]
LUGRE = [0.311004697, -1.790552648, 1.630332206, -1.26988580, 1.0243698]  # [rad] from below


@pytest.mark.parametrize("engine", ["auto", "llvm"])
def test_lugres_pendulum_is_where_another_formulation_has_it(engine):
    moved = pendulum(lugre()).simulate(
        "time=6", start={"crank": (2.0 + HANGING, 0.0)}, times=TIMES, engine=engine, want="crank.q"
    )
    assert np.abs(moved["crank.q"] - HANGING - LUGRE).max() <= 7e-8  # the last is rounded there
    assert np.abs(moved["crank.q"] - HANGING - LUGRE)[:3].max() <= 1e-9
    assert "state" in moved.motion.why


def rubbed(law, mu, slipping, t_end, z0=0.0, stop=-math.inf, restitution=0.0):
    """A pendulum's [angle from below, rate, z] at a time, by Radau on the papers' equations.

    Its friction is a coefficient f of the load: (J al + m g l sin)^2 = (f r)^2 |R|^2, where f
    has the sign of the friction; of the two roots that which has it.
    """

    def slope(_, y):
        th, w, z = y
        zdot = w * (1.0 - slipping(w, z) * law.stiffness * abs(z) / mu(abs(w))) if z * w > 0 else w
        if z * w <= 0:
            zdot = w + (law.stiffness * abs(w) * abs(z) / mu(abs(w)) if unloads else 0.0) * np.sign(
                w
            )
        f = (law.stiffness * z + law_damping * zdot + law_viscous * w) * PIN
        pull, Rr = G / 2 * math.sin(th), w * w / 2 + G * math.cos(th)
        # al / 3 + pull = -f sqrt(Rr^2 + (al / 2 + G sin th)^2), by Newton from al without friction
        al = -3 * pull
        for _ in range(60):
            R = math.hypot(Rr, al / 2 + G * math.sin(th))
            change = (al / 3 + pull + f * R) / (1 / 3 + f * (al / 2 + G * math.sin(th)) / (2 * R))
            al -= change
            if abs(change) <= 1e-15 * (1 + abs(al)):
                break
        return w, al, zdot

    law_damping, law_viscous = getattr(law, "damping", 0.0), getattr(law, "viscous", 0.0)
    unloads = not hasattr(law, "breakaway")

    def struck(_, y):
        return y[0] - stop

    struck.terminal, struck.direction = True, -1
    t, y, watch = 0.0, np.array([2.0, 0.0, z0]), struck if stop > -math.inf else None
    while t < t_end:
        trajectory = solve_ivp(slope, (t, t_end), y, "Radau", rtol=1e-11, atol=1e-14, events=watch)
        t, y = (
            trajectory.t[-1],
            trajectory.y[:, -1] * (1.0, -restitution if trajectory.status else 1.0, 1.0),
        )
    return y


DAHL = bm.friction.Dahl(kinetic=0.2, stiffness=200.0, radius=PIN)


@kept(inspect.getsource(rubbed), DAHL, PIN, G)
def by_dahl(t_end, *stop):
    """The same of Dahl's law; stop: where it is, and its restitution."""
    return rubbed(DAHL, lambda w: 0.2, lambda w, z: 1.0, t_end, 0.0, *stop).tolist()


def test_dahls_pendulum():
    expected = by_dahl(1.5)
    moved = pendulum(DAHL).simulate(
        "time=1.5", start={"crank": (2.0 + HANGING, 0.0)}, times=[1.5],
        want=["crank.q", "crank.rate", "crank.A.deflection"],
    )  # fmt: skip
    assert moved["crank.q"][0] - HANGING == pytest.approx(expected[0], abs=1e-8)
    assert moved["crank.rate"][0] == pytest.approx(expected[1], abs=1e-7)
    assert moved["crank.A.deflection"][0] == pytest.approx(expected[2], abs=1e-10)


@pytest.mark.parametrize("method", ["dop853", "radau"])
def test_a_deflection_goes_on_through_blows(method):
    expected = by_dahl(2.0, -0.3, 0.5)
    g = wheel(DAHL, cm=0.5, gravity=G)
    g.add_stop("crank", low=HANGING - 0.3, restitution=0.5)
    moved = g.compile().simulate(
        "time=2", start={"crank": (2.0 + HANGING, 0.0)}, times=[2.0], method=method,
        want=["crank.q", "crank.rate", "crank.A.deflection"],
    )  # fmt: skip
    assert len(moved.motion.impacts) >= 2
    assert moved["crank.q"][0] - HANGING == pytest.approx(expected[0], abs=1e-8)
    assert moved["crank.rate"][0] == pytest.approx(expected[1], abs=1e-7)
    assert moved["crank.A.deflection"][0] == pytest.approx(expected[2], abs=1e-10)


ELASTO_PLASTIC = bm.friction.ElastoPlastic(
    **CURVE, stiffness=200.0, damping=0.3, breakaway=0.08, radius=PIN
)


@kept(inspect.getsource(rubbed), ELASTO_PLASTIC, PIN, G)
def by_elasto_plastic_bristles(t_end):
    """The same of that law."""

    def mu(w):
        return 0.2 + 0.1 * math.exp(-((w / 0.5) ** 2))

    def slipping(w, z):
        f, top = 200.0 * abs(z), mu(abs(w))
        if f <= 0.08:
            return 0.0
        if f >= top:
            return 1.0
        return 0.5 + 0.5 * math.sin(math.pi * (f - (top + 0.08) / 2) / (top - 0.08))

    return rubbed(ELASTO_PLASTIC, mu, slipping, t_end).tolist()


def test_an_elasto_plastic_pendulum():
    expected = by_elasto_plastic_bristles(1.5)
    moved = pendulum(ELASTO_PLASTIC).simulate(
        "time=1.5", start={"crank": (2.0 + HANGING, 0.0)}, times=[1.5],
        want=["crank.q", "crank.A.deflection"],
    )  # fmt: skip
    assert moved["crank.q"][0] - HANGING == pytest.approx(expected[0], abs=1e-8)
    assert moved["crank.A.deflection"][0] == pytest.approx(expected[2], abs=1e-9)


def test_stiff_bristles_are_integrated_by_a_stiff_method_and_tend_to_stribecks_law():
    start = {"crank": (2.0 + HANGING, 0.0)}
    curve = bm.friction.Stribeck(**CURVE, radius=PIN)
    limit = pendulum(curve).simulate("time=0.5", start=start, times=[0.5], want="crank.q")
    off = []
    for stiffness in (1e3, 1e7):
        moved = pendulum(lugre(stiffness)).simulate(
            "time=0.5", start=start, times=[0.5], want="crank.q", accuracy=1e-7
        )
        assert moved.motion.reached
        off.append(abs(moved["crank.q"][0] - limit["crank.q"][0]))
    assert moved.motion.method == "radau"
    assert off[0] == pytest.approx(5.0e-4, rel=0.02)  # the design notes' distance
    assert off[1] <= 2e-5


def block(law, spring=0.0, pull=None):
    """1 kg on a rough floor, on a spring [N/m] or pulled by a force of time."""
    lines = {"spring": {"of": "coordinate", "coefficients": [spring, -spring]}}
    if pull is not None:
        lines["pull"] = pull
    return machines.pulled(bm.Link(mass=1.0, inertia=0.1), law, lines, gravity=G).compile()


def test_what_friction_takes_is_heat_and_what_the_bristles_store():
    """Under a load that is constant the bristles are springs: half their stiffness by z^2."""
    mech = block(bm.friction.Dahl(kinetic=0.2, stiffness=50.0), spring=30.0)
    t = np.linspace(0.0, 1.2, 1201)
    moved = mech.simulate("time=1.2", start={"block": (0.4, 0.0)}, times=t, want="*")
    stored, taken = moved["block.S.stored_power"], moved["block.S.friction_power"]
    z = moved["block.S.deflection"]
    assert (taken - stored).min() >= -1e-9 * taken.max()  # heat, never taken back
    assert taken.min() < -0.01 * taken.max()  # but bristles give back

    def work(power):
        return float(np.sum((power[1:] + power[:-1]) / 2 * np.diff(t)))

    assert work(stored) == pytest.approx(G * 50.0 * z[-1] ** 2 / 2, abs=2e-4 * work(taken))
    assert moved.motion.facts["friction_work"] == pytest.approx(work(taken), rel=1e-4)
    lost = 30.0 * (0.4**2 - moved["block.q"][-1] ** 2) / 2 - moved["block.rate"][-1] ** 2 / 2
    assert moved.motion.facts["friction_work"] == pytest.approx(lost, rel=1e-9)
    again = mech.simulate("time=1.2", start={"block": (0.4, 0.0)}, times=t[::300], want=())
    assert mech.verify(again).ok


def test_small_oscillating_loads_make_a_pair_creep_by_lugre_and_not_by_elasto_plastic_bristles():
    """What the law was made for: Dupont et al. 2002, Fig. 3."""
    pull = {"kind": "fourier", "of": "time", "period": 1.0, "mean": 1.2, "sines": [0.6]}
    curve = {
        "static": 0.3,
        "kinetic": 0.3,
        "stribeck_speed": 0.1,
        "stiffness": 3e3,
        "damping": 30.0,
    }
    drift = {}
    for law in (bm.friction.LuGre(**curve), bm.friction.ElastoPlastic(**curve, breakaway=0.25)):
        moved = block(law, pull=pull).simulate(
            "time=12", start={"block": (0.0, 0.0)}, times=[10.0, 11.0, 12.0], want="block.q"
        )
        drift[law.law] = np.diff(moved["block.q"])
    assert drift["lugre"].min() > 1e-6  # in each period, for ever
    assert np.abs(drift["elasto_plastic"]).max() < 1e-9


def test_a_linkage_with_several_laws_leaves_no_drive_over_and_engines_agree():
    data = document("ruiz_fourbar")
    data["blocks"]["dyad"]["friction"] = {
        "B": {"law": "lugre", **CURVE, "stiffness": 50.0, "damping": 0.2, "radius": 0.05},
        "C": {"law": "coulomb", "coefficient": 0.2, "radius": 0.05},
        "D": {"law": "dahl", "kinetic": 0.2, "stiffness": 30.0, "radius": 0.05},
    }
    mech, ends = changed(data), []
    for engine in ("scalar", "llvm"):
        moved = mech.simulate(
            "time=0.01", start={"crank": (1.0, 20.0)}, method="dop853", engine=engine,
            want=["crank.drive", "crank.drive_by_reduction", "dyad.B.deflection"],
        )  # fmt: skip
        size = np.abs(moved["crank.drive_by_reduction"]).max()
        assert np.abs(moved["crank.drive"]).max() <= 1e-10 * size
        assert moved.motion.facts["energy_balance"] <= 1e-9
        ends.append(moved.motion.q_end)
    assert ends[0] == pytest.approx(ends[1], rel=1e-12)


def test_without_friction_there_is_no_state():
    motion = pendulum(lugre()).simulate(
        "time=1", start={"crank": (2.0 + HANGING, 0.0)}, friction="none", want=()
    ).motion  # fmt: skip
    assert motion.method == "energy"
    assert motion.x_end == ()


# -- given motion ----------------------------------------------------------------------------


def by_hand(law, slip, t0, t1, z):
    """z at the end of a slip of time, by LSODA in another variable: the way."""

    def slope(t, y):
        w = slip(t)
        mu = law.kinetic + 0.1 * math.exp(-((w / 0.5) ** 2))
        return [w - law.stiffness * abs(w) * y[0] / mu]

    return solve_ivp(slope, (t0, t1), [z], "Radau", rtol=1e-11, atol=1e-15).y[0, -1]


def test_a_harmonic_motion_has_the_periodic_deflection():
    """Bristles that are not bent through in a swing still come back to where they were."""
    for amplitude in (0.3, 2e-4):
        law = lugre()
        mech = driven(law, bm.motion.Harmonic(amplitude=amplitude, frequency=0.5))
        times = np.array([0.0, 0.3, 1.1, 2.0])
        z = mech.run(times=times, want="crank.A.deflection")["crank.A.deflection"]
        assert z[0] == pytest.approx(z[-1], abs=1e-11 * abs(z).max() + 1e-16)

        def slip(t, amplitude=amplitude):
            return amplitude * math.pi * math.cos(math.pi * t)

        for a, b, z_begin, z_end in zip(times, times[1:], z, z[1:], strict=False):
            assert by_hand(law, slip, a, b, z_begin) == pytest.approx(z_end, rel=1e-7, abs=1e-12)


def driven(law, motion):
    graph = machines.crank(1.0, machines.bar(1.0, 1.0), law, gravity=G)
    graph.drive("crank", motion)
    return graph.compile()


def test_a_motion_that_does_not_repeat_itself_begins_with_straight_bristles():
    law = lugre()
    mech = driven(law, bm.motion.Cycloidal(start=0.0, end=1e-3, time=1.0))
    t = np.array([0.4, 0.7, 1.0, 5.0])
    z = mech.run(times=t, want="crank.A.deflection")["crank.A.deflection"]

    def slip(t):
        return 1e-3 * (1 - math.cos(2 * math.pi * t))

    expected = [by_hand(law, slip, 0.0, end, 0.0) for end in t[:3]]
    assert z[:3] == pytest.approx(expected, rel=1e-7)
    assert z[3] == pytest.approx(z[2], rel=1e-9)  # in the dwell they stay as they are


def test_slip_at_one_rate_is_on_the_steady_curve():
    """At a constant rate, and where rates are given sample by sample, it is Stribeck's law."""
    crank = driven(lugre(), bm.motion.ConstantRate(rate=0.4))
    same = driven(bm.friction.Stribeck(**CURVE, radius=PIN), bm.motion.ConstantRate(rate=0.4))
    want = "crank.drive"
    assert crank.run(samples=9, want=want)[want] == pytest.approx(
        same.run(samples=9, want=want)[want], rel=1e-9
    )
    request = {"at": [0.1, 2.0], "rates": [0.7, -1.2], "want": want}
    assert crank.run(**request)[want] == pytest.approx(same.run(**request)[want], rel=1e-13)


def four_bar():
    data = document("ruiz_fourbar")
    law = {"law": "lugre", **CURVE, "stiffness": 1e3, "damping": 0.5, "radius": PIN}
    data["blocks"]["dyad"]["friction"] = dict.fromkeys("BCD", law)
    return changed(data)


def test_a_turning_linkage_comes_back_to_the_same_friction():
    mech = four_bar()
    run = mech.run(samples=25, want=["dyad.*.friction", "dyad.*.deflection", "dyad.*.slip"])
    for joint in "BCD":
        for quantity in ("deflection", "friction"):
            row = run[f"dyad.{joint}.{quantity}"]
            assert row[0] == pytest.approx(row[-1], rel=1e-9)
    assert mech.run(at=1.0)["dyad.C.friction"][0] == mech.run(at=[1.0])["dyad.C.friction"][0]
    assert mech.verify(samples=9).ok


def test_a_pair_at_rest_is_held_up_to_static_friction():
    run = four_bar().run(at=1.0, rates=0.0)
    intervals = {f.where: f.interval for f in run.quality.flags if f.code == "zero-relative-speed"}
    assert intervals["dyad.C"][1] == pytest.approx(
        0.3 * PIN * abs(run["dyad.C.reaction"][0]), rel=1e-12
    )
    assert run["dyad.C.friction"][0] == 0.0


def test_links_and_joints_know_the_deflection():
    data = document("joints/ruiz_fourbar")
    law = {"law": "lugre", **CURVE, "stiffness": 1e3, "radius": PIN}
    data["joints"]["C"]["friction"] = law
    mech = bm.Linkage.from_data(data).compile()
    assert "joint.C.deflection" in mech.outputs
    assert mech.verify(samples=5).ok


def test_derivatives_and_studies_of_a_given_motion_follow_its_deflections():
    """Against fourth-order differences of whole runs; a study against runs of its designs."""
    data, times = document("ruiz_fourbar"), np.linspace(0.0, 0.5, 5)
    soft = {"law": "lugre", **CURVE, "stiffness": 2.0, "damping": 0.01, "radius": PIN}
    data["blocks"]["dyad"]["friction"] = {"C": soft}
    mech = changed(data)
    names = ("dyad.l_i", "dyad.friction.C.stiffness")
    exact = mech.sensitivity("crank.drive", names, times=times)
    values = mech.parameters()

    def drive(name, x):
        return mech.document.replace({name: x}).run(times=times, want="crank.drive")["crank.drive"]

    for name in names:
        x = values[name].value
        h = 1e-4 * x
        f = [drive(name, x + k * h) for k in (-2, -1, 1, 2)]
        slope = np.dot([1, -8, 8, -1], f) / (12 * h)
        assert np.abs(exact["crank.drive", name] - slope).max() <= 1e-6 * np.abs(slope).max() > 0
    study = mech.study({names[1]: [2.5, 9.0]}, want="poses(crank.drive)", times=times)
    for row, x in zip(study["poses(crank.drive)"], (2.5, 9.0), strict=True):
        assert row == pytest.approx(drive(names[1], x), rel=1e-12)


def test_all_solutions_have_the_friction_of_the_run():
    mech = four_bar()
    run = mech.run(at=[1.0, 2.0, 4.0], want="dyad.*.friction")
    solutions = mech.friction_solutions([1.0, 2.0, 4.0], want="dyad.*.friction")
    assert len(solutions) == 3
    for name in run:
        assert solutions[name] == pytest.approx(run[name], rel=1e-12)


def test_ways_of_trade_keep_the_states_and_newton_is_exact():
    assert "friction single" in str(four_bar().trade(samples=9))
    run = four_bar().run(samples=9, accuracy=1e-8, want="crank.drive")
    exact = four_bar().run(samples=9, want="crank.drive")
    assert run["crank.drive"] == pytest.approx(exact["crank.drive"], rel=1e-7)


def test_designs_that_move_have_bristles_of_their_own():
    settings = {"until": "time=0.5", "start": {"crank": (2.0 + HANGING, 0.0)}}
    mech = pendulum(lugre(200.0))
    address = "crank.friction.A.stiffness"
    study = mech.study({address: [200.0, 400.0]}, want="motion.q_end", simulate=settings)
    ends = [pendulum(lugre(200.0)).simulate(want=(), **settings).motion.q_end]
    stiffer = lugre(200.0).model_copy(update={"stiffness": 400.0})
    ends.append(pendulum(stiffer).simulate(want=(), **settings).motion.q_end)
    assert study["motion.q_end"].tolist() == pytest.approx(ends, rel=1e-11)
    assert ends[0] != ends[1]


def test_a_stepper_carries_the_deflection_on():
    mech = pendulum(lugre(200.0))
    start = {"crank": (2.0 + HANGING, 0.0)}
    stepper = mech.stepper(["crank.q", "crank.A.deflection"], start=start)
    for _ in range(10):
        outputs = stepper.step(0.05)
    moved = mech.simulate(
        "time=0.5", start=start, times=[0.5], want=["crank.q", "crank.A.deflection"]
    )
    for name in outputs:
        assert outputs[name] == pytest.approx(moved[name], rel=1e-7)


def test_soft_bristles_have_the_deflection_that_a_turn_leaves_as_it_is():
    data = document("ruiz_fourbar")
    bristles = {"static": 0.3, "kinetic": 0.2, "breakaway": 0.1, "stribeck_speed": 0.5}
    law = {"law": "elasto_plastic", **bristles, "stiffness": 0.1, "radius": 0.05}
    data["blocks"]["dyad"]["friction"] = {"C": law}
    course = Course(changed(data))
    begin, end = course.begin, course.begin + course.period
    law, times = course.laws[0], np.linspace(begin, end, 4001)
    slips = CubicSpline(times, course.slips_at(times)[0])
    at = course._along(0, np.array([begin, begin + course.period / 3]))
    kernel, p = law.rate_kernel(), law.parameters()
    rate = lambda t, z: float(kernel(float(slips(t)), float(z[0]), p))  # noqa: E731
    leg = solve_ivp(rate, (begin, end), at[:1], rtol=1e-10, atol=1e-12, dense_output=True)
    assert leg.y[0, -1] == pytest.approx(at[0], abs=1e-7)
    assert leg.sol(begin + course.period / 3)[0] == pytest.approx(at[1], abs=1e-7)
    assert abs(at[0]) > 1e-2
