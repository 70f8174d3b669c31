"""Drivers that are free, prescribed by their laws of motion, or locked, in one motion."""

import math

import numpy as np
import pytest

import blockmech as bm
from blockmech import laws, signals
from tests import machines

SINE = bm.motion.Harmonic(amplitude=1.0, frequency=0.7)
CYCLOID = bm.motion.Cycloidal(start=0.0, end=1.0, time=1.0)
WANT = ["*.q", "*.rate", "*.drive", "*.friction"]
FINE = np.linspace(0.0, 1.2, 601)


def arm(law=None, friction=(0.0, 0.0), b=0.3, gravity=9.81, stop=None):
    """An arm on an arm, each 1 m, 1 kg, 0.1 kg m2 about its centre at 0.5 m."""
    link = bm.Link(mass=1.0, inertia=0.1, cm=(0.5, 0.0))
    pins = [bm.friction.Coulomb(coefficient=mu, radius=0.05) if mu else None for mu in friction]
    graph = machines.arms({"a": 1.0, "b": 1.0}, [link, link], pins, gravity=gravity)
    if law is not None:
        graph.drive("a", law)
    graph.start("b", q=b)
    if stop is not None:
        graph.add_stop("b", *stop)
    return graph


def energy(r):
    """Kinetic and potential energy (n,) [J] of the arms."""
    a, b, wa, wb = (r[n] for n in ("a.q", "b.q", "a.rate", "b.rate"))
    elbow, w = np.exp(1j * a), wa + wb
    half = 0.5 * np.exp(1j * (a + b))
    v = 1j * wa * elbow + 1j * w * half
    kinetic = 0.5 * (0.1 + 0.25) * wa**2 + 0.5 * np.abs(v) ** 2 + 0.05 * w**2
    return kinetic + 9.81 * (0.5 * elbow.imag + (elbow + half).imag)


def inertia(b):
    """M (2, 2) of the arms."""
    c = 0.35 + 0.5 * math.cos(b)
    return np.array([[0.35 + 1.35 + math.cos(b), c], [c, 0.35]])


def at_time(name, t, **then):
    return bm.Watch(name, lambda time, q, rate: time - t, then=then)


def test_one_arm_is_prescribed_and_the_other_free():
    m = arm(bm.motion.ConstantRate(rate=5.0)).compile()
    r = m.simulate("time=1", roles={"a": "prescribed"}, want=WANT, accuracy=1e-11)
    assert r["a.q"][-1] == pytest.approx(5.0, abs=1e-14)
    # explicit integration to 1e-12, of the equation written out by hand
    assert r["b.q"][-1] == pytest.approx(1.095716533108803, abs=5e-12)
    assert r["a.drive"][-1] == pytest.approx(-11.834670, abs=5e-7)
    assert np.abs(r["b.drive"]).max() < 1e-13
    assert [(x.begin, dict(x.of)) for x in r.motion.roles] == [
        (0.0, {"a": "prescribed", "b": "free"})
    ]
    gained = energy(r)[-1] - energy(r)[0]
    assert gained == pytest.approx(r.motion.facts["drive_work"], rel=1e-11)
    assert r.motion.facts["energy_balance"] < 1e-12
    assert r.motion.notes == ()


def test_a_law_that_a_motion_does_not_use_is_a_note():
    m = arm(bm.motion.ConstantRate(rate=5.0)).compile()
    (note,) = m.simulate("time=0.1", start={"a": (0.0, 5.0)}).motion.notes
    law = "the law of motion of a is not used"
    assert note == f"{law}: roles={{'a': 'prescribed'}} lets the motion follow it"
    assert f"note: {note}" in str(m.simulate("time=0.1", start={"a": (0.0, 5.0)}))
    (note,) = m.simulate("time=0.1", roles={"a": 0.0}).motion.notes
    assert "law of motion of a" in note
    g = bm.Graph.load("graphs/watt_sixbar.json")
    g.drive("crank", bm.motion.ConstantRate(rate=1.0))
    notes = g.compile().simulate("standstill").motion.notes
    assert notes == ("the law of motion of crank is not used: the loads alone move it",)


@pytest.mark.parametrize("friction", [(0.0, 0.0), (0.2, 0.1)])
def test_roles_that_are_all_free_change_no_bit(friction):
    g = arm(None, friction)
    g.start("a", q=0.4, rate=1.0)
    plain = g.compile().simulate("time=0.5", want=WANT)
    g.drive("a", SINE)
    g.prescribe("a")
    single = g.compile().simulate("time=0.5", want=WANT, roles={})
    assert all(np.array_equal(plain[n], single[n], equal_nan=True) for n in plain)
    assert plain.motion.roles == single.motion.roles == ()
    assert plain.motion.facts == single.motion.facts


def test_places_of_locks_and_stops_may_have_units():
    m, moves = arm(gravity=0.0).compile(), {"start": {"a": (0.4, 3.0)}, "want": WANT}
    texts = m.simulate(
        "time=0.1", roles={"b": "30deg"}, stops={"a": ("-90deg", "0.5turns")}, **moves
    )
    stops = {"a": (-np.pi / 2, np.pi)}
    numbers = m.simulate("time=0.1", roles={"b": np.pi / 6}, stops=stops, **moves)
    assert all(np.array_equal(texts[name], numbers[name], equal_nan=True) for name in texts)


def test_the_free_motion_as_a_law_needs_no_drive():
    g = arm(gravity=0.0)  # both turn as one, at a constant rate, while b is locked
    g.start("a", q=0.4, rate=3.0)
    free = g.compile().simulate("time=1", roles={"b": 0.0}, want=WANT)
    assert free["a.q"] == pytest.approx(0.4 + 3.0 * np.linspace(0, 1, 201), abs=1e-12)
    g.drive("a", bm.motion.ConstantRate(rate=3.0, start=0.4, end=1.0))
    both = g.compile().simulate("time=1", roles={"a": "prescribed", "b": 0.0}, want=WANT)
    assert np.abs(both["a.drive"]).max() < 1e-13
    assert both["b.drive"] == pytest.approx(free["b.drive"], abs=1e-11)
    let_go = at_time("off", 0.5, a="free")
    off = g.compile().simulate(
        "time=1", roles={"a": "prescribed", "b": 0.0}, want=WANT, watch=[let_go]
    )
    assert off["a.q"] == pytest.approx(both["a.q"], abs=1e-12)
    assert off.motion.impacts == ()


def test_the_drive_that_follows_a_free_motion_vanishes_with_the_steps_of_its_table():
    g = arm()
    g.start("a", q=0.4, rate=0.3)
    free = g.compile()
    off = []
    for n in (31, 61):
        t = np.linspace(0.0, 0.6, n)
        law = bm.motion.Trajectory(
            times=t, values=free.simulate(times=t, want=["a.q"], accuracy=1e-11)["a.q"]
        )
        r = arm(law).compile().simulate(times=[0.3, 0.6], roles={"a": "prescribed"}, want=WANT)
        right = free.simulate(times=[0.3, 0.6], want=["b.q"], accuracy=1e-10)["b.q"]
        off.append((np.abs(r["b.q"] - right).max(), abs(r["a.drive"][0])))
    assert off[1][0] < off[0][0] / 6  # the spline errs with the third power of its steps at an end
    assert off[1][1] < off[0][1] / 3  # and its second derivative with the second
    assert off[1][0] < 1e-4


def test_a_five_bar_with_a_locked_crank_is_a_four_bar():
    def linkage(five):
        m = bm.Linkage("bars", gravity=(0.0, -9.81))
        bars = {"l1": 1.0, "l2": 2.0, "l3": 2.2, **({"l4": 0.8} if five else {})}
        for name, length in bars.items():
            m.add_link(
                name, mass=length, inertia=length**3 / 12, cm=CENTRES[name], pose=(0.0, 0.0, 0.0)
            )
        m.add_joint("A", "R", ["frame", "l1"], at=[POINTS["A"]] * 2)
        m.add_joint("B", "R", ["l1", "l2"], at=[POINTS["B"]] * 2)
        m.add_joint("C", "R", ["l2", "l3"], at=[POINTS["C"]] * 2)
        m.add_joint("D", "R", ["l3", "l4" if five else "frame"], at=[POINTS["D"]] * 2)
        m.add_driver("one", "A")
        m.start("one")
        if five:
            m.add_joint("E", "R", ["frame", "l4"], at=[POINTS["E"]] * 2)
            m.add_driver("two", "E")
            m.lock("two", 0.0)
            m.start("two")
        return m

    POINTS = {"A": (0, 0), "B": (0.6, 0.8), "C": (2.2, 2.0), "D": (2.5, 0.2), "E": (3.0, -0.3)}
    ends = {"l1": "AB", "l2": "BC", "l3": "CD", "l4": "DE"}
    CENTRES = {
        k: tuple((np.array(POINTS[a]) + np.array(POINTS[b])) / 2) for k, (a, b) in ends.items()
    }
    want = ["link.l1.omega", "link.l3.omega", "joint.B.reaction", "joint.D.reaction"]
    five = linkage(True)
    read = bm.Linkage.from_data(five.to_data())
    assert five.to_data()["motion"] == {"two": {"locked": 0.0}} == read.to_data()["motion"]
    t = np.linspace(0.0, 1.0, 11)
    a = read.compile().simulate(times=t, want=want, accuracy=1e-11)
    b = linkage(False).compile().simulate(times=t, want=want, accuracy=1e-11, method="dop853")
    for name in want:
        size = np.abs(b[name]).max()
        assert np.abs(a[name] - b[name]).max() < 1e-9 * size, name


# -- changes of roles ----------------------------------------------------------------------


def test_a_latch_takes_along_what_it_holds_and_lets_it_go():
    m = arm(bm.motion.ConstantRate(rate=5.0)).compile()
    watch = [at_time("latch", 0.4, b="locked"), at_time("release", 0.8, b="free")]
    r = m.simulate("time=1", roles={"a": "prescribed"}, watch=watch, want=WANT, accuracy=1e-10)
    t = np.asarray(r.time)
    roles = [(x.begin, x.of["b"]) for x in r.motion.roles]
    assert [role for _, role in roles] == ["free", "locked", "free"]
    assert [begin for begin, _ in roles] == pytest.approx([0.0, 0.4, 0.8], abs=1e-12)
    locked = (t > 0.4) & (t < 0.8)
    b = r["b.q"][locked]
    assert np.ptp(b) == 0.0
    # the moment at the elbow of a bar that turns with the upper arm at 5 rad/s
    right = 9.81 * 0.5 * np.cos(5 * t[locked] + b) + 12.5 * np.sin(b)
    assert r["b.drive"][locked] == pytest.approx(right, abs=1e-9)
    assert np.abs(r["b.drive"][~locked & (t != 0.4) & (t != 0.8)]).max() < 1e-12
    (jolt,) = r.motion.impacts
    assert jolt.driver == "b"
    jump = jolt.after - jolt.before
    assert jolt.after.tolist() == [5.0, 0.0]
    M = inertia(jolt.q[1])
    assert [jolt.pushes["a"], jolt.pushes["b"]] == pytest.approx(M @ jump, rel=1e-10)
    assert jolt.impulse == jolt.pushes["b"]
    assert jolt.loss == pytest.approx(0.5 * jump @ M @ jump, rel=1e-10)  # Carnot
    assert r.motion.facts["impact_loss"] == jolt.loss
    assert m.impulses(jolt)["b.drive"] == pytest.approx(jolt.impulse, rel=1e-10)
    gained = energy(r)[-1] - energy(r)[0]
    assert gained == pytest.approx(r.motion.facts["drive_work"] - jolt.loss, rel=1e-10)
    assert m.verify(r).ok
    assert r.motion.facts["energy_balance"] < 1e-10


@pytest.mark.parametrize("friction", [(0.0, 0.0), (0.2, 0.1)])
def test_a_change_of_role_leaves_the_momentum_of_the_others(friction):
    g = arm(None, friction)
    g.start("a", q=0.4, rate=3.0)
    g.start("b", q=0.3, rate=-7.0)
    watch = [at_time("brake", 0.1, b="locked"), at_time("break", 0.5, b="free")]
    r = g.compile().simulate("time=1", watch=watch, want=WANT, accuracy=1e-10)
    (jolt,) = r.motion.impacts
    M, jump = inertia(jolt.q[1]), jolt.after - jolt.before
    friction_impulses = jolt.friction.get("a.A", 0.0), jolt.friction.get("b.A", 0.0)
    assert (M @ jump)[0] == pytest.approx(friction_impulses[0], abs=1e-11)
    assert (M @ jump)[1] == pytest.approx(friction_impulses[1] + jolt.pushes["b"], abs=1e-11)
    if friction[0]:  # against its slip
        assert friction_impulses[0] * jolt.after[0] < 0
    assert np.abs(r["a.drive"]).max() < 1e-12
    f = r.motion.facts
    gained = energy(r)[-1] - energy(r)[0]
    assert gained == pytest.approx(-f["impact_loss"] - f.get("friction_work", 0.0), abs=1e-9)


def test_a_driver_follows_its_law_from_where_it_meets_it():
    g = arm(bm.motion.ConstantRate(rate=2.0))
    g.start("a", q=0.3, rate=1.0)
    meets = bm.Watch("meets", lambda t, q, rate: q[0] - 2.0 * t, then={"a": "prescribed"})
    r = g.compile().simulate("time=1", watch=[meets], want=WANT)
    begin = r.motion.roles[1].begin
    late = np.asarray(r.time) > begin
    assert r["a.q"][late] == pytest.approx(2.0 * np.asarray(r.time)[late], abs=1e-12)
    (jolt,) = r.motion.impacts
    assert jolt.after[0] == 2.0
    assert jolt.before[0] != 2.0
    with pytest.raises(bm.RequestError, match=r"watch\.early\.then\.a: at t = 0\.01 s a\.q is"):
        g.compile().simulate("time=1", watch=[at_time("early", 0.01, a="prescribed")])


# -- friction and stops --------------------------------------------------------------------


@pytest.mark.parametrize("friction", [(0.1, 0.0), (0.3, 0.3)])
def test_prescribed_by_a_sine_with_friction_work_is_energy(friction):
    m = arm(SINE, friction).compile()
    r = m.simulate(times=FINE, roles={"a": "prescribed"}, want=WANT)
    assert m.verify(r).ok
    assert r["a.q"] == pytest.approx(np.sin(1.4 * math.pi * FINE), abs=1e-14)
    f = r.motion.facts
    gained = energy(r)[-1] - energy(r)[0]
    assert gained == pytest.approx(f["drive_work"] - f["friction_work"], abs=1e-8)
    by_hand = np.trapezoid(r["a.drive"] * r["a.rate"], FINE)  # over the jumps of friction
    assert f["drive_work"] == pytest.approx(by_hand, abs=1e-2)
    assert np.abs(r["b.drive"]).max() < 1e-12
    turns = [e.t for e in r.motion.events if e.kind == "reversal of a.A"]
    at = [(n + 0.5) / 1.4 for n in range(2)] if friction[0] else []
    assert turns == pytest.approx(at, abs=1e-10)


def test_what_a_lock_holds_needs_no_friction_and_the_free_pin_holds_by_statics():
    g = arm(None, (0.3, 0.3))
    hanging = {"b": (-math.pi - 0.002, 0.0)}
    r = g.compile().simulate("time=1", roles={"a": math.pi / 2}, start=hanging, want=WANT)
    assert (r.motion.end, r.motion.events[0].kind) == ("time", "rest")
    moment = 9.81 * 0.5 * math.cos(math.pi / 2 + hanging["b"][0])  # within 0.3 * 0.05 * 9.81
    assert r["b.A.friction"][-1] == pytest.approx(moment, abs=1e-13)
    assert r["b.drive"][-1] == pytest.approx(0.0, abs=1e-15)
    assert r["a.A.friction"][-1] == 0.0
    assert r["a.drive"][-1] == pytest.approx(moment, abs=1e-12)
    both = g.compile().simulate("time=1", roles={"a": 0.1, "b": 0.3}, want=WANT)
    fore = 9.81 * 0.5 * math.cos(0.4)
    assert both["b.drive"][-1] == pytest.approx(fore, rel=1e-13)
    assert both["a.drive"][-1] == pytest.approx(fore + 9.81 * 1.5 * math.cos(0.1), rel=1e-13)


def test_a_pin_that_a_law_alone_moves_rubs_while_that_moves():
    m = arm(CYCLOID, (0.3, 0.1)).compile()
    r = m.simulate(times=FINE, roles={"a": "prescribed"}, want=WANT)
    moves = (FINE > 0) & (FINE < 1)
    assert (r["a.A.friction"][moves] != 0).all()
    assert (r["a.A.friction"][FINE > 1] == 0).all()
    assert "sticking of a.A" in [e.kind for e in r.motion.events]
    prescribed = m.simulate(times=FINE, roles={"a": "prescribed", "b": 0.3}, want=WANT)
    assert prescribed["a.q"] == pytest.approx(r["a.q"], abs=0)
    f = prescribed.motion.facts
    gained = energy(prescribed)[-1] - energy(prescribed)[0]
    assert gained == pytest.approx(f["drive_work"] - f["friction_work"], abs=1e-10)


@pytest.mark.parametrize("friction", [(0.0, 0.0), (0.1, 0.1)])
def test_blows_on_stops_while_another_driver_is_prescribed(friction):
    m = arm(SINE, friction, stop=(-0.5, 0.8, 0.6)).compile()
    r = m.simulate(times=FINE, roles={"a": "prescribed"}, want=WANT)
    assert len(r.motion.impacts) == 4
    for blow in r.motion.impacts:
        M, jump = inertia(blow.q[1]), blow.after - blow.before
        assert jump[0] == 0.0
        assert blow.after[1] == pytest.approx(-0.6 * blow.before[1], rel=1e-12)
        rubs = blow.friction.get("b.A", 0.0)
        assert blow.impulse + rubs == pytest.approx((M @ jump)[1], rel=1e-10)
    f = r.motion.facts
    lost = f["impact_loss"] + f.get("friction_work", 0.0)
    gained = energy(r)[-1] - energy(r)[0]
    assert gained == pytest.approx(f["drive_work"] - lost, abs=1e-7)


def test_a_prescribed_driver_ends_at_its_own_stop():
    g = arm(SINE)
    g.add_stop("a", -0.5, 0.8, 0.6)
    motion = g.compile().simulate("time=2", roles={"a": "prescribed"}).motion
    assert motion.end == "end stop of a"
    assert motion.t_end == pytest.approx(math.asin(0.8) / (1.4 * math.pi), abs=1e-10)


def test_a_motion_ends_where_a_law_does():
    g = arm(bm.motion.Trajectory(**TABLE))
    never = bm.Watch("never", lambda t, q, rate: 1.0)
    motion = g.compile().simulate("event", watch=[never], roles={"a": "prescribed"}).motion
    assert (motion.end, motion.status) == ("law of motion ends", "ended")
    assert motion.t_end == 2.0


# -- signals, steps, documents, the command line -------------------------------------------


def driven():
    graph = arm(SINE, (0.0, 0.1))
    machines.load(graph, "motor", bm.Motor(law=laws.Signal()), a="a.B", b="b.crank")
    graph.add("moment", signals.Input())
    graph.connect("moment.y", "motor.law")
    graph.prescribe("a")
    return graph.compile()


def test_a_stepper_knows_the_roles_of_the_scene():
    m = driven()
    env = m.stepper(copies=2)
    for _ in range(4):
        env.step(0.1, {"moment": [0.0, 0.0]})
    reference = m.simulate("time=0.4", want=["*.q", "*.rate"])
    for name, x in env.observe().items():
        assert x == pytest.approx(reference[name][-1], abs=1e-7), name
    assert env.observe()["a.q"] == pytest.approx(math.sin(0.56 * math.pi), abs=1e-14)
    outputs = m.stepper(roles={"a": "prescribed", "b": "locked"}).step(0.3, {"moment": 5.0})
    assert outputs["b.q"] == [0.3]


def test_a_study_moves_designs_by_their_roles():
    m = arm(SINE).compile()
    settings = {"until": "time=0.3", "roles": {"a": "prescribed"}}
    want = ["final(b.q)", "motion.drive_work"]
    study = m.study({"b.links.crank.mass": [1.0, 2.0]}, want=want, simulate=settings)
    alone = m.simulate("time=0.3", roles={"a": "prescribed"}, want=["b.q"])
    assert study["final(b.q)"][0] == pytest.approx(alone["b.q"][-1], abs=1e-12)
    work = study["motion.drive_work"]
    assert work[0] == pytest.approx(alone.motion.facts["drive_work"], rel=1e-12)
    assert work[1] != work[0]


def test_roles_stand_in_the_scene():
    g = arm(SINE)
    g.prescribe("a")
    g.lock("b", 0.3)
    data = g.to_data()
    assert data["scene"]["motion"] == {"a": "prescribed", "b": {"locked": 0.3}}
    read = bm.Graph.from_data(data)
    assert read.to_data() == data
    motion = read.compile().simulate("time=0.5").motion
    assert motion.roles[0].of == {"a": "prescribed", "b": "locked"}
    assert motion.q_end[1] == 0.3
    assert read.replace({"scene.motion.b.locked": 0.5}).to_data()["scene"]["motion"]["b"] == {
        "locked": 0.5
    }
    data["scene"]["motion"] = {"c": "locked", "b": "prescribed"}
    with pytest.raises(bm.GraphError) as raised:
        bm.Graph.from_data(data).compile()
    text = str(raised.value)
    assert 'scene.motion.c: no driver "c"' in text
    assert "scene.motion.b: b has no law of motion" in text


TABLE = {"times": [0, 1, 2], "values": [0, 1, 0]}
MISTAKES = {
    "unknown": ({"roles": {"c": "prescribed"}}, SINE, 'roles.c: no driver "c"'),
    "no role": ({"roles": {"b": "loked"}}, SINE, "no role .loked."),
    "no driver": ({"roles": ["a"]}, SINE, "names no drivers"),
    "no names": ({"watch": [bm.Watch("w", abs, then="locked")]}, SINE, "names no driver"),
    "no law": ({"roles": {"b": "prescribed"}}, SINE, "roles.b: b has no law of motion"),
    "no number": ({"roles": {"b": "3 x"}}, SINE, "roles.b: '3 x' is no coordinate"),
    "start": (
        {"roles": {"a": "prescribed"}, "start": {"a": (1.0, 0.0)}},
        SINE,
        "start.a: .* contradicts",
    ),
    "stop": ({"roles": {"a": "prescribed", "b": 5.0}}, SINE, "b.* 5 .*stop"),
    "steady": (
        {"roles": {"a": "prescribed"}, "until": "steady"},
        SINE,
        "no steady state is looked for",
    ),
    "corner": (
        {"roles": {"a": "prescribed"}},
        bm.motion.Trajectory(**TABLE, interpolation="linear"),
        "the rate of the law of a jumps at 1 s",
    ),
    "short law": (
        {"roles": {"a": "prescribed"}, "until": "time=5"},
        bm.motion.Trajectory(**TABLE),
        "says nothing at 5",
    ),
    "role": (
        {"watch": [bm.Watch("w", lambda *_: 1.0, then={"b": "loked"})]},
        SINE,
        'no role "loked"',
    ),
}


@pytest.mark.parametrize("case", MISTAKES)
def test_roles_that_cannot_be_are_refused(case):
    arguments, law, fault = MISTAKES[case]
    g = arm(law, stop=(-1.0, 1.0))
    if case == "role":
        g.start("a")
    with pytest.raises(bm.RequestError, match=fault):
        g.compile().simulate(**{"until": "time=1", **arguments})


# -- the only driver -------------------------------------------------------------------------


def braked(friction=0.0):
    """A pendulum of 1 kg, 0.35 kg m2 about its pin."""
    g = bm.Graph("pendulum", gravity=(0.0, -9.81))
    g.add("frame", bm.Frame(markers={"O": (0.0, 0.0)}))
    pin = {"A": bm.friction.Coulomb(coefficient=friction, radius=0.02)} if friction else {}
    link = bm.Link(mass=1.0, inertia=0.1, cm=(0.5, 0.0))
    g.add("arm", bm.Crank(length=1.0, links={"crank": link}, friction=pin))
    g.connect("frame.O", "arm.A")
    g.start("arm", q=0.0)
    return g.compile()


BRAKE = bm.Watch("brake", lambda t, q, rate: t - 0.3, then={"arm": "locked"})
RELEASE = bm.Watch("release", lambda t, q, rate: t - 0.6, then={"arm": "free"})


@pytest.mark.parametrize("method", ["auto", "radau", bm.FixedStep("rk4", 1e-3)])
def test_a_brake_holds_the_only_driver_to_the_end_with_its_impulse_and_moment(method):
    mechanism = braked()
    free = mechanism.simulate("time=0.3", want=["*.q", "*.rate"])
    run = mechanism.simulate("time=1", watch=[BRAKE], method=method, want=["*.q", "*.drive"])
    q = free["arm.q"][-1]
    assert run.motion.t_end == 1.0
    assert run["arm.q"][-1] == pytest.approx(q, abs=1e-8)
    (jolt,) = run.motion.impacts
    assert jolt.impulse == pytest.approx(-0.35 * free["arm.rate"][-1], abs=1e-8)
    drive = run["arm.drive"][run.samples.time > 0.31]
    assert drive == pytest.approx(np.full(len(drive), 0.5 * 9.81 * math.cos(q)), abs=1e-7)
    assert run.motion.facts["energy_balance"] < 1e-10
    assert type(run.motion.q_end) is float
    assert mechanism.verify(run).ok


@pytest.mark.parametrize("friction", [0.0, 0.2])
def test_a_brake_is_released_and_the_pendulum_swings_on(friction):
    mechanism = braked(friction)
    run = mechanism.simulate("time=1", watch=[BRAKE, RELEASE], want=["*.q", "*.rate"])
    still = (run.samples.time > 0.3) & (run.samples.time < 0.6)
    assert np.ptp(run["arm.q"][still]) == 0.0
    assert run["arm.rate"][-1] < -1.0
    assert mechanism.verify(run).ok


def test_the_only_driver_follows_its_law_in_a_motion_as_in_a_run():
    g = bm.Graph.from_data(braked().document.to_data())
    g.drive("arm", bm.motion.Trajectory(times=[0, 1, 2], values=[0, 1, 0]))
    g.start("arm", q=0.0, rate=2.0)
    mechanism, times = g.compile(), [0.2, 0.5, 0.9]
    run = mechanism.run(times=times, want=["arm.q", "arm.drive"])
    motion = mechanism.simulate(
        times=times, roles={"arm": "prescribed"}, want=["arm.q", "arm.drive"]
    )
    assert max(run.compare(motion).values()) < 1e-13
