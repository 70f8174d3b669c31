"""Impacts at end stops, against closed forms and Newton's laws link by link."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

import blockmech as bm
from blockmech.dynamics import simulation
from blockmech.dynamics.contacts import pushing
from blockmech.ground.errors import GraphError, RequestError
from tests import machines
from tests.gallery import GRAPHS
from tests.independent import newton
from tests.independent.bouncing import hammer

J, TAU, E, W = 0.05, 2.0, 0.6, 30.0


def flywheel(restitution=E, moment=TAU, **motor):
    """A wheel that a moment turns against its upper stop."""
    graph = machines.crank(body=bm.Link(inertia=J))
    if motor:
        machines.load(graph, "push", bm.Motor(**motor), a="frame.A", b="crank.crank")
    else:
        machines.load(graph, "push", bm.Couple(moment=moment), on="crank.crank")
    graph.add_stop("crank", high=2.0, restitution=restitution)
    graph.start("crank", q=2.0, rate=-W)
    return graph


@pytest.mark.parametrize(
    ("method", "engine"),
    [*((m, "auto") for m in ("energy", "dop853", "radau", "rk4")), ("dop853", "llvm")],
)
def test_bounces_by_a_constant_moment_end_by_their_sum(method, engine):
    if method == "rk4":
        method = bm.FixedStep(method, 1e-3)
    r = flywheel().compile().simulate("time=5", method=method, want="*", engine=engine)
    motion, flight = r.motion, 2 * W * J / TAU
    assert motion.facts["rest_time"] == pytest.approx(flight / (1 - E), rel=1e-10)
    total = sum(i.impulse for i in motion.impacts)
    assert total == pytest.approx(-J * W * (1 + E) / (1 - E), rel=1e-10)
    assert motion.facts["impact_loss"] == pytest.approx(J * W**2 / 2, rel=1e-10)
    for n, impact in enumerate(motion.impacts[:12]):
        assert impact.t == pytest.approx(flight * (1 - E ** (n + 1)) / (1 - E), rel=1e-9)
        assert impact.after[0] == pytest.approx(-W * E ** (n + 1), rel=1e-8)
    assert motion.facts["contact"] == pytest.approx(-TAU)  # it pushes the wheel back
    assert (motion.status, motion.end, r["crank.rate"][-1]) == ("reached", "time", 0.0)
    rest = r.time > motion.facts["rest_time"]
    assert not r["crank.acceleration"][rest].any()
    np.testing.assert_allclose(r["crank.drive"][rest], -TAU)  # what the stop gives
    np.testing.assert_allclose(r["crank.acceleration"][r.time < 3.7], TAU / J)


def test_without_loss_it_bounces_for_ever_and_with_all_loss_it_stays():
    r = flywheel(1.0).compile().simulate("time=20", times=np.linspace(0.0, 20.0, 81))
    flight = 2 * W * J / TAU
    s = np.mod(r.time, flight)
    inside = (s > 1e-6) & (s < flight - 1e-6)
    q = 2.0 - W * s + TAU / J * s**2 / 2
    np.testing.assert_allclose(r["crank.q"][inside], q[inside], atol=1e-7)
    assert r.motion.facts["impact_loss"] == 0.0
    dead = flywheel(0.0).compile().simulate("time=3").motion
    (blow,) = dead.impacts
    assert blow.t == pytest.approx(flight)
    assert dead.facts["rest_time"] == pytest.approx(flight)


def test_at_the_instant_of_a_blow_it_is_at_its_stop():
    g = machines.crank(body=machines.bar(1.0, 1.0), gravity=9.81)
    low = -1.2 + 6.3 / 11  # where the last step to the instant was a halved one: off by 2e-7
    g.add_stop("crank", low, restitution=0.7)
    motion = g.compile().simulate("time=1.5", start={"crank": (low + 0.6, 0.0)}).motion
    blows = [i.t for i in motion.impacts]
    assert len(blows) > 2
    np.testing.assert_allclose(motion.at(blows).q, low, rtol=1e-14)


@pytest.mark.parametrize("method", ["dop853", "radau"])
def test_a_stop_lets_go_where_it_would_have_to_pull(method):
    law = {"kind": "fourier", "of": "time", "period": 2.0, "mean": 0.5, "cosines": [1.0]}
    g = flywheel(0.0, law=law)
    g.start("crank", q=2.0, rate=0.0)
    motion = g.compile().simulate("time=1.2", method=method).motion
    assert motion.facts["contact"] == pytest.approx(-1.5)
    (free,) = [e for e in motion.events if e.kind == "leaves its stop"]
    assert free.t == pytest.approx(math.acos(-0.5) / math.pi, rel=1e-12)  # 0.5 + cos(pi t) = 0
    s = 1.2
    rate = (0.5 * (s - free.t) + (math.sin(math.pi * s) - math.sin(math.pi * free.t)) / math.pi) / J
    assert motion.qd_end == pytest.approx(rate, rel=1e-8)


def test_the_hammer_is_where_energy_says():
    rows = hammer()
    times = [t for t, _ in rows]
    mech = bm.Graph.load(GRAPHS / "hammer.json").compile()
    for method in ("energy", "dop853"):
        r = mech.simulate(f"time={times[-1]!r}", times=times, method=method)
        np.testing.assert_allclose(r["hammer.q"], [q for _, q in rows], rtol=1e-9)
        assert len(r.motion.impacts) == 3


def test_what_a_scene_says_is_kept_and_what_cannot_be_is_refused():
    g = flywheel()
    again = bm.Graph.from_json(g.to_json())
    assert again.scene.stops["crank"].restitution == E
    assert json.loads(g.to_json())["scene"]["stops"] == {"crank": {"to": 2.0, "restitution": E}}
    with pytest.raises(GraphError, match="restitution"):
        g.add_stop("crank", high=2.0, restitution=1.2)
    for goal in ("turns=2", "steady"):
        with pytest.raises(RequestError, match="let it bounce"):
            g.compile().simulate(goal)
    plain = flywheel(None).compile().simulate("time=5").motion
    assert (plain.end, plain.impacts) == ("end stop", ())


def test_a_mirrored_wheel_bounces_as_its_image():
    single = flywheel().compile().simulate("time=2").motion
    g = flywheel(moment=-TAU)
    g.scene = g.scene.model_copy(update={"stops": {}})
    g.add_stop("crank", low=-2.0, restitution=E)
    g.start("crank", q=-2.0, rate=W)
    two = g.compile().simulate("time=2").motion
    assert [i.t for i in single.impacts] == [i.t for i in two.impacts]
    assert [i.impulse for i in single.impacts] == [-i.impulse for i in two.impacts]


# -- impulses in all joints --------------------------------------------------------------------


def five_bar():
    """Two heavy cranks and a dyad, of which either crank may strike."""
    heavy = bm.Link(mass=1.0, inertia=0.1, cm=(0.5, 0.1))
    rod = bm.Link(mass=1.5, inertia=0.5, cm=(1.0, 0.2))
    graph = machines.fivebar(1.0, 2.0, 2.0, [heavy, heavy, rod, rod], gravity=9.81)
    graph.start("left", q=1.2, rate=0.5)
    graph.start("right", q=2.2, rate=1.5)
    graph.add_stop("right", high=2.6, restitution=0.4)
    return graph


def poses(q):
    """Origins and directions of both cranks and rods, by the two circles."""
    left, right = (np.exp(1j * x) for x in q)
    B, D = left, 2.0 + right
    half = (D - B) / 2
    C = B + half + 1j * half / abs(half) * math.sqrt(4.0 - abs(half) ** 2)
    return {
        "left": (0j, left),
        "right": (2.0 + 0j, right),
        "i": (B, (C - B) / 2),
        "j": (D, (C - D) / 2),
    }


CENTRES = {"left": 0.5 + 0.1j, "right": 0.5 + 0.1j, "i": 1.0 + 0.2j, "j": 1.0 + 0.2j}


def unit_jump(q, k, h=1e-6):
    """Velocities of the centres and rates of all links where driver k turns by one."""
    step = np.zeros(2)
    step[k] = h
    ends = [poses(q + s * step) for s in (-2, -1, 1, 2)]
    accelerations = {}
    for name, c in CENTRES.items():
        points = [e[name][0] + e[name][1] * c for e in ends]
        turned = [np.angle(e[name][1] / poses(q)[name][1]) for e in ends]
        accelerations[name] = tuple(
            (x[0] - 8 * x[1] + 8 * x[2] - x[3]) / (12 * h) for x in (points, turned)
        )
    return accelerations


def test_impulses_of_a_five_bar_are_those_of_newtons_laws():
    mech = five_bar().compile()
    motion = mech.simulate("time=1").motion
    impact = motion.impacts[0]
    assert impact.driver == "right"
    q = impact.q
    assert q[1] == 2.6
    reactions = []
    pushes = newton.pin("frame", "left", 0j, "A") | newton.pin("frame", "right", 2.0 + 0j, "E")
    pose = poses(q)
    points = {"B": pose["i"][0], "D": pose["j"][0], "C": pose["i"][0] + 2 * pose["i"][1]}
    pushes |= newton.pin("left", "i", points["B"], "B") | newton.pin("i", "j", points["C"], "C")
    pushes |= newton.pin("right", "j", points["D"], "D")
    pushes |= {"left": newton.Push("frame", "left"), "right": newton.Push("frame", "right")}
    for k in (0, 1):
        jump = unit_jump(q, k)
        bodies = {
            name: newton.Body(
                *((1.0, 0.1) if name in ("left", "right") else (1.5, 0.5)),
                pose[name][0] + pose[name][1] * CENTRES[name], *jump[name],
            )
            for name in CENTRES
        }  # fmt: skip
        reactions.append(newton.solved(bodies, pushes))
    # The left drive gives nothing, the right rate goes back by the restitution.
    jump = -1.4 * impact.before[1]
    expected = -reactions[1]["left"] / reactions[0]["left"] * jump
    assert impact.after - impact.before == pytest.approx([expected, jump], rel=1e-9)
    total = {n: expected * reactions[0][n] + jump * reactions[1][n] for n in pushes}
    assert impact.impulse == pytest.approx(total["right"], rel=1e-9)
    run = mech.impulses(impact)
    assert run["right.drive"] == pytest.approx(impact.impulse, rel=1e-12)
    assert run["left.drive"] == pytest.approx(0.0, abs=1e-12 * abs(impact.impulse))
    for name, pin in (
        ("left.A", "A"),
        ("right.A", "E"),
        ("dyad.B", "B"),
        ("dyad.D", "D"),
        ("dyad.C", "C"),
    ):
        force = complex(total[f"{pin}.x"], total[f"{pin}.y"])
        assert run[f"{name}.reaction"] == pytest.approx(force, rel=1e-8, abs=1e-9)


def test_a_five_bar_keeps_its_energy_but_for_the_loss():
    mech = five_bar().compile()
    want = ["mechanism.kinetic_energy", "mechanism.potential_energy"]
    impact = mech.simulate("time=1").motion.impacts[0]
    q = dict(zip(mech.drivers, impact.q, strict=True))
    rates = (dict(zip(mech.drivers, w, strict=True)) for w in (impact.before, impact.after))
    ends = [mech.run(at=q, rates=w, want=want) for w in rates]
    before, after = (float(e["mechanism.kinetic_energy"][0]) for e in ends)
    assert before - after == pytest.approx(impact.loss, rel=1e-10)


def test_a_five_bar_lies_against_its_stop_and_goes_on_moving():
    g = five_bar()
    g.add_stop("right", high=2.6, restitution=0.0)
    mech = g.compile()
    ask = {"want": ["left.q", "right.q", "right.drive", "left.drive", "right.acceleration"]}
    explicit, implicit = (mech.simulate("time=0.9", method=m, **ask) for m in ("dop853", "radau"))
    assert explicit["left.q"][-1] == pytest.approx(implicit["left.q"][-1], rel=1e-6)
    rest = explicit.time > explicit.motion.facts["rest_time"] + 1e-9
    lying = [e.t for e in explicit.motion.events if e.kind == "leaves its stop"] or [
        explicit.motion.t_end
    ]
    rest &= explicit.time < lying[0] - 1e-9
    assert rest.sum() > 5
    np.testing.assert_allclose(explicit["right.q"][rest], 2.6, rtol=1e-12)
    assert not explicit["right.acceleration"][rest].any()
    assert (explicit["right.drive"][rest] < 0).all()  # the stop pushes back
    assert np.abs(explicit["left.drive"]).max() < 1e-9
    # With the right crank as part of the frame the rest is a four-bar, from its own start.
    first = float(explicit.time[rest][0])
    fixed = bm.Graph("four", gravity=(0.0, -9.81))
    pivot = 2.0 + np.exp(2.6j)
    fixed.add("frame", bm.Frame(markers={"A": (0.0, 0.0), "D": (pivot.real, pivot.imag)}))
    fixed.add("left", g.blocks["left"])
    fixed.add("dyad", g.blocks["dyad"])
    machines.wire(fixed, "frame.A left.A", "left.B dyad.B", "frame.D dyad.D")
    state = explicit.motion.at(first)
    last = float(explicit.time[rest][-1])
    four = fixed.compile().simulate(
        f"time={last - first!r}", start={"left": (float(state.q[0]), float(state.qd[0]))}
    )
    assert four["left.q"][-1] == pytest.approx(float(explicit.motion.at(last).q[0]), rel=1e-8)


def test_joint_friction_is_followed_through_a_blow_in_which_slips_reverse():
    g = bm.Graph.load(GRAPHS / "hammer.json")
    rub = bm.friction.Coulomb(coefficient=0.1, radius=0.01)
    g.blocks["hammer"] = g.blocks["hammer"].model_copy(update={"friction": {"A": rub}})
    mech = g.compile()
    motions = [mech.simulate("time=1.5", method=m).motion for m in ("dop853", "radau")]
    assert all("followed through" in " ".join(m.notes) for m in motions)
    assert motions[0].impacts[2].t == pytest.approx(motions[1].impacts[2].t, rel=1e-8)
    assert motions[0].facts["rest_time"] == pytest.approx(motions[1].facts["rest_time"], rel=1e-7)


def test_joint_friction_of_a_blow_that_stops_all_follows_its_impulses():
    # a rod on a pin: m d w through the pin, so P = J w + mu r m d |w|, with signs
    mass, d, inertia, mu, r = 2.0, 0.3, 0.1, 0.2, 0.05
    rod = bm.Link(mass=mass, inertia=inertia, cm=(d, 0.0))
    g = machines.crank(1.0, rod, bm.friction.Coulomb(coefficient=mu, radius=r), name="rod")
    g.start("rod", q=0.0, rate=3.0)
    g.add_stop("rod", high=0.4, restitution=0.0)
    mech = g.compile()
    motion = mech.simulate("time=1").motion
    (blow,) = motion.impacts
    w = blow.before[0]
    assert 0 < w < 3.0
    assert motion.notes == ()
    shock = mech.impulses(blow)
    pin = mass * d * w
    assert abs(shock["rod.A.reaction"]) == pytest.approx(pin, rel=1e-9)
    expected = -(inertia + mass * d * d) * w + mu * r * pin
    assert shock["rod.drive"] == pytest.approx(expected, rel=1e-9)
    assert blow.impulse == pytest.approx(expected, rel=1e-9)
    assert blow.friction == {"rod.A": pytest.approx(-mu * r * pin, rel=1e-9)}


def test_who_starts_at_rest_against_a_stop_is_told_of_no_blow():
    rod = bm.Link(mass=1.0, inertia=0.02, cm=(0.25, 0.0))
    rub = bm.friction.Coulomb(coefficient=0.3, radius=0.02)
    g = machines.crank(0.5, rod, rub, gravity=9.81, name="rod")
    g.start("rod", q=-0.4, rate=0.0)
    g.add_stop("rod", low=-0.4, restitution=0.5)
    motion = g.compile().simulate("time=1").motion
    assert (motion.impacts, motion.notes) == ((), ())
    assert [(lain.stop, lain.begin, lain.end) for lain in motion.lying] == [("rod", 0.0, 1.0)]


def test_one_driver_rubs_on_the_way_in_and_on_the_way_out():
    # in the blow of the same rod its slip turns back: mu r m d |w| against either sense
    mass, d, inertia, mu, r, e = 2.0, 0.3, 0.1, 0.2, 0.05, 0.6
    rod = bm.Link(mass=mass, inertia=inertia, cm=(d, 0.0))
    g = machines.crank(1.0, rod, bm.friction.Coulomb(coefficient=mu, radius=r), name="rod")
    g.start("rod", q=0.0, rate=3.0)
    g.add_stop("rod", high=0.4, restitution=e)
    motion = g.compile().simulate("time=0.5").motion
    blow = motion.impacts[0]
    w = blow.before[0]
    assert blow.after[0] == -e * w
    rubbed = mu * r * mass * d * w
    assert blow.friction["rod.A"] == pytest.approx(-(1 - e) * rubbed, rel=1e-9)
    inert = (inertia + mass * d * d) * w
    assert blow.impulse == pytest.approx(-(1 + e) * inert + (1 - e) * rubbed, rel=1e-9)
    g.add_stop("rod", high=0.4, restitution=1.0)  # with friction a stop would have to give for this
    notes = g.compile().simulate("time=0.5").motion.notes
    assert any("too high for the friction" in note for note in notes)


# -- stops of pairs with several drivers --------------------------------------------------------


def test_a_pin_strikes_after_whole_turns_of_one_of_two_drivers():
    bodies = bm.Link(mass=1.0, inertia=1.0), bm.Link(mass=1.0, inertia=0.1)
    g = machines.arms({"arm": 1.0, "wheel": 0.5}, bodies, gravity=0.0)
    g.start("arm", q=0.0, rate=1.0)
    g.start("wheel", q=0.5, rate=7.0)
    g.add_stop("wheel.A.coordinate", high=15.0, restitution=0.5)
    mech = g.compile()
    blow = mech.simulate("time=3").motion.impacts[0]
    assert blow.t == pytest.approx((15.0 - 0.5) / 7.0, rel=1e-12)
    # the arm carries the wheel's mass and its inertia about the wheel's pin: momentum of both stays
    assert blow.after[1] == pytest.approx(-3.5)
    spins = (blow.before, blow.after)
    before, after = ((1.0 + 1.0) * w[0] + 0.1 * (w[0] + w[1]) for w in spins)
    assert before == pytest.approx(after, rel=1e-12)
    assert mech.impulses(blow)["arm.drive"] == pytest.approx(0.0, abs=1e-12)


def test_a_knee_lies_against_its_stop_while_both_arms_move():
    g = five_bar()
    g.scene = g.scene.model_copy(update={"stops": {}})
    g.add_stop("dyad.C.coordinate", high=0.9, restitution=0.0)
    mech = g.compile()
    r = mech.simulate("time=0.6", want="*", times=np.linspace(0.0, 0.6, 61))
    (lain,) = r.motion.lying
    lies = r.time > lain.begin + 1e-9
    assert lies.sum() > 5
    assert lain.push < 0  # it keeps the knee from opening
    np.testing.assert_allclose(r["dyad.C.coordinate"][lies], 0.9, rtol=1e-9)
    for driver in mech.drivers:
        assert np.abs(r[f"{driver}.drive"]).max() < 1e-9
    assert mech.verify(r).ok


def test_a_viscous_knee_has_its_friction_after_it_has_left_its_stop():
    """It sticks while it lies there, though its law holds nothing at rest."""
    g = five_bar()
    g.scene = g.scene.model_copy(update={"stops": {}})
    g.add_stop("dyad.C.coordinate", high=0.9, restitution=0.0)
    friction = {
        "B": bm.friction.Coulomb(coefficient=0.1, radius=0.02),
        "C": bm.friction.Viscous(damping=2.0),
    }
    g.blocks["dyad"] = g.blocks["dyad"].model_copy(update={"friction": friction})
    mech = g.compile()
    r = mech.simulate("time=0.9", want="*", times=np.linspace(0.0, 0.9, 46))
    (lain,) = r.motion.lying
    assert (r.time > lain.end).sum() > 10
    np.testing.assert_allclose(r["dyad.C.friction"], -2.0 * r["dyad.C.slip"], atol=1e-12)
    assert mech.verify(r).ok
    (impact,) = r.motion.impacts
    (rest,) = (e for e in r.motion.events if e.kind == "rest")
    assert rest.t == impact.t == r.motion.facts["rest_time"]  # no bounces are left to sum up
    np.testing.assert_array_equal(rest.qd, impact.after)  # both arms move on


def test_of_several_stops_those_push_that_must():
    """0 <= P, 0 <= n q' after, one of them zero: by a quadratic programme of SciPy."""
    from scipy.optimize import nnls

    rng = np.random.default_rng(7)
    for _ in range(50):
        A, rows = rng.normal(size=(3, 3)), rng.normal(size=(3, 3))
        M, before = A @ A.T + np.eye(3), rng.normal(size=3)
        # least M-norm of the rates after: their change is a sum of pushes
        L = np.linalg.cholesky(M)
        P, _ = nnls(np.linalg.solve(L, rows.T), -L.T @ before)
        chosen = pushing(M, rows, rows @ before)[0]
        assert set(chosen) == set(np.flatnonzero(P > 1e-12).tolist())


@pytest.mark.parametrize("pins", [{}, {"A": bm.friction.Coulomb(coefficient=0.1, radius=0.01)}])
def test_a_push_rubs_in_pairs_that_nothing_else_loads(pins):
    oiled = bm.friction.Stribeck(
        static=0.6, kinetic=0.5, stribeck_speed=0.5, viscous=0.01, radius=0.02
    )

    def blow(mass):
        bodies = bm.Link(mass=1.0, inertia=0.02), None, bm.Link(mass=mass)
        rub = {**pins, "B": oiled}
        g = machines.slider_crank(0.1, 0.3, 0.02, bodies, rub, gravity=9.81)
        machines.load(g, "moment", bm.Couple(moment=-3.0), on="crank.crank")
        g.start("crank", q=1.2)
        g.add_stop("dyad.S.coordinate", high=0.38, restitution=0.5)
        mech = g.compile()
        (hit, *_) = mech.simulate("time=0.1").motion.impacts
        close = mech.simulate(times=[0.0, hit.t - 1e-13, 0.1], want="*")
        assert mech.verify(close).ok  # a time that is the blow's but for rounding
        return hit

    without, nearly = blow(0.0), blow(1e-9)
    assert abs(without.friction["dyad.B"]) > 0.005
    assert without.friction["dyad.B"] == pytest.approx(nearly.friction["dyad.B"], rel=1e-7)
    assert without.impulse == pytest.approx(nearly.impulse, rel=1e-7)


def test_a_blow_through_teeth_that_lose_power_tells_all_friction():
    g = bm.Graph("pair")
    g.add("frame", bm.Frame(markers={"A": (0.0, 0.0), "B": (0.15, 0.0)}))
    rub = {"A": bm.friction.Coulomb(coefficient=0.2, radius=0.02)}
    for name, inertia in (("one", 0.01), ("two", 0.04)):
        g.add(name, bm.Crank(links={"crank": bm.Link(inertia=inertia)}, friction=rub))
        g.connect(f"frame.{'A' if name == 'one' else 'B'}", f"{name}.A")
    teeth = {"teeth": (20, 40), "pressure_angle": 0.35, "efficiency": 0.8}
    g.add("mesh", bm.Gear(driver="one", driven="two", **teeth))
    g.start("one", q=0.0, rate=5.0)
    g.add_stop("one", high=0.5, restitution=0.5)
    mech = g.compile()
    r = mech.simulate("time=0.2", times=[0.0, 0.2])
    (blow,) = r.motion.impacts
    assert mech.verify(r).ok
    assert mech.impulses(blow)["one.drive"] == pytest.approx(blow.impulse, rel=1e-12)


def test_interrupted_between_two_flights_it_keeps_those_before(monkeypatch):
    flights, move = [], simulation.move

    def third_is_stopped(system, request):
        if len(flights) == 2:
            raise KeyboardInterrupt
        flights.append(move(system, request))
        return flights[-1]

    monkeypatch.setattr(simulation, "move", third_is_stopped)
    r = flywheel().compile().simulate("time=5")
    flight = 2 * W * J / TAU
    assert (r.motion.status, r.motion.end) == ("ended", "interrupted")
    assert len(r.motion.impacts) == 2
    assert r.motion.t_end == pytest.approx(flight * (1 + E), rel=1e-12)
    assert r["crank.q"][-1] == 2.0
    assert r["crank.rate"][-1] == pytest.approx(-W * E**2, rel=1e-9)
