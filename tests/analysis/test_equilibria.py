"""Equilibria against mechanics that know nothing of Assur groups, and against root searches.

Independent numbers: `tests.independent.multibody` (absolute coordinates) gives the effort that a
driver needs at rest; its root and, by central differences of the same in extended precision, its
slope are the equilibrium and K. Watt's first loop is from V'' in mpmath with 40 digits.
"""

from __future__ import annotations

import itertools
import math
import pickle

import numpy as np
import pytest
from scipy.optimize import brentq

import blockmech as bm
from blockmech.analysis.closure import Closure
from blockmech.dynamics.sticking import JointFriction
from blockmech.dynamics.system import System
from blockmech.plan.plan import Friction
from tests.dynamics.test_charts import hanging
from tests.gallery import GRAPHS, document
from tests.independent import multibody as mb
from tests.independent.released import four_bar
from tests.machines import wire

DIGITS = 1e-9
MACHINES = (
    "watt_sixbar", "stephenson_3", "toggle_press", "andrews_squeezer", "ruiz_fourbar",
    "stephenson_2_class_4", "stephenson_3_triad",
)  # fmt: skip


def loop(stiffness=0.0):
    rods = {
        n: {"mass": m, "inertia": m * x * x / 12, "cm": [x / 2, 0.0]}
        for n, m, x in (("crank", 1.0, 1.0), ("i", 1.5, 1.5), ("j", 1.5, 1.5))
    }
    blocks = {
        "frame": {
            "type": "frame",
            "markers": {"O2": {"at": [0, 0]}, "O4": {"at": [1.6, 0]}, "S": {"at": [1.0, 0]}},
        },
        "crank": {"type": "driver.crank", "length": 1.0, "links": {"crank": rods["crank"]}},
        "dyad": {
            "type": "dyad.rrr", "l_i": 1.5, "l_j": 1.5, "branch": 1,
            "links": {"i": rods["i"], "j": rods["j"]},
        },
    }  # fmt: skip
    wires = [
        {"from": "frame.O2", "to": "crank.A"},
        {"from": "crank.B", "to": "dyad.B"},
        {"from": "frame.O4", "to": "dyad.D"},
    ]
    if stiffness:
        blocks["spring"] = {"type": "load.spring", "stiffness": stiffness, "free_length": 0.0}
        wires += [{"from": "frame.S", "to": "spring.a"}, {"from": "dyad.C", "to": "spring.b"}]
    data = {
        "format": "blockmech/graph", "version": 1, "name": "loop", "blocks": blocks,
        "wires": wires, "scene": {"gravity": [0.0, -9.81]},
    }  # fmt: skip
    return bm.Graph.from_data(data).compile()


def test_watts_first_loop_is_that_of_mpmath():
    result = {e.kind: e for e in loop().equilibria()}
    low, high = result["stable"], result["unstable"]
    q = math.remainder(low.q[0], math.tau)
    assert q == pytest.approx(-1.67045867527852, abs=1e-13)
    assert low.K[0, 0] == pytest.approx(17.1229950360555, rel=1e-13)
    assert low.M[0, 0] == pytest.approx(0.850763692295131, rel=1e-13)
    assert low.frequencies[0] ** 2 == pytest.approx(20.1266170513957, rel=1e-12)
    assert high.q[0] == pytest.approx(1.49069100724188, abs=1e-13)
    assert high.K[0, 0] == pytest.approx(-21.2894556012746, rel=1e-13)


def in_pairs(data):
    """A document whose joints join two links each: a pin of n links is n - 1 of them."""
    joints = {}
    for name, joint in data["joints"].items():
        first, *rest = zip(joint["links"], joint["at"], strict=True)
        for i, partner in enumerate(rest):
            (a, b), at = (first[0], partner[0]), [first[1], partner[1]]
            joints[f"{name}{i or ''}"] = {**joint, "links": [a, b], "at": at}
    return {**data, "joints": joints}


def effort(system, q):
    """Effort of a driver at rest by absolute coordinates, in extended precision."""
    poses = mb.assemble(system, system.home, [q], follow=True, refine=True)
    rates = mb.rates(system, poses, [0.0])
    accelerations = mb.accelerations(system, poses, rates, [0.0])
    result = mb.reactions(system, poses, rates, accelerations, friction=False)
    return result.drivers[next(iter(system.drivers))], poses


def inertia(system, q):
    """Effort per unit of acceleration at rest."""
    poses = mb.assemble(system, system.home, [q], follow=True, refine=True)
    rates = mb.rates(system, poses, [0.0])
    loaded, plain = (
        mb.reactions(
            system, poses, rates, mb.accelerations(system, poses, rates, [a]), friction=False
        )
        for a in (1.0, 0.0)
    )
    name = next(iter(system.drivers))
    return float(loaded.drivers[name] - plain.drivers[name])


@pytest.mark.parametrize("name", MACHINES)
def test_equilibria_and_frequencies_are_those_of_absolute_coordinates(name):
    mech = bm.Linkage.load(GRAPHS / "joints" / f"{name}.json").compile()
    system = mb.read(in_pairs(document(f"joints/{name}")))
    equilibria = mech.equilibria(friction="none")
    assert len(equilibria) >= 2
    h = 1e-4
    for e in equilibria:
        q = float(e.q[0])
        rows = [float(effort(system, q + k * h)[0]) for k in (-2, -1, 0, 1, 2)]
        K = (rows[0] - 8 * rows[1] + 8 * rows[3] - rows[4]) / (12 * h)
        size = max(map(abs, (rows[0], rows[4]))) / h
        assert abs(rows[2] / K) < DIGITS
        assert e.K[0, 0] == pytest.approx(K, abs=10 * DIGITS * size)
        J = inertia(system, q)
        assert e.M[0, 0] == pytest.approx(J, rel=DIGITS)
        if e.kind == "stable":
            assert e.frequencies[0] == pytest.approx(math.sqrt(K / J), rel=10 * DIGITS)
        assert (e.kind == "stable") == (K > 0)


def test_nothing_is_missed_over_the_turn():
    """As many as changes of sign of the effort at 20,000 places; stable ones alternate."""
    for name in MACHINES[:4]:
        mech = bm.Graph.load(GRAPHS / f"{name}.json").compile()
        q = np.linspace(0.1, 0.1 + math.tau, 20001)
        arcs = mech.limits()
        if not arcs.whole_turn:
            continue
        tau = mech.run(at=q, want="crank.tau_red", static=True)["crank.tau_red"]
        count = int((tau[:-1] * tau[1:] < 0).sum())
        equilibria = mech.equilibria(friction="none")
        assert len(equilibria) == count
        kinds = [e.kind for e in equilibria]
        assert all(a != b for a, b in itertools.pairwise(kinds))


def test_the_potential_is_that_of_weights():
    mech = bm.Graph.load(GRAPHS / "watt_sixbar.json").compile()
    equilibria = mech.equilibria()
    q = [e.q[0] for e in equilibria]
    energy = mech.run(at=q, want="mechanism.potential_energy")["mechanism.potential_energy"]
    assert np.ptp(energy) == pytest.approx(max(e.potential for e in equilibria), rel=1e-12)


@pytest.mark.parametrize("name", ["ruiz_fourbar", "stephenson_3_triad", "stephenson_2_class_4"])
def test_ends_of_friction_are_two_root_searches(name):
    """The ends of the interval: the two efforts that start it are zero there."""
    mech = bm.Graph.load(GRAPHS / f"{name}.json").compile()
    friction = System(mech, method=Friction("newton")).friction
    assert isinstance(friction, JointFriction)
    equilibria = mech.equilibria()
    assert equilibria.rests
    for low, high in equilibria.rests:
        ends = []
        for side in (0, 1):

            def start(q, side=side):
                return friction.holding(np.array([q]))[side][0]

            a, b = low - 0.01, high + 0.01
            ends.append(brentq(start, a, b, xtol=1e-15, rtol=1e-14))
        assert sorted(ends) == pytest.approx([low, high], abs=1e-12)
        for angle, rests in (((low + high) / 2, True), (low - 1e-6, False), (high + 1e-6, False)):
            begun, qdd, _ = friction.from_state(np.array([angle]), np.zeros(1), 0.0, None)
            assert any(begun.sides) is not rests
            assert (qdd == 0).all() == rests
    inside = [e for e in equilibria if e.interval is not None]
    assert len(inside) == len(equilibria)


def test_several_drivers_are_solved_by_all_of_them():
    mech = bm.Graph.load(GRAPHS / "fivebar_falling.json").compile()
    equilibria = mech.equilibria()
    assert len(equilibria) >= 3
    for e in equilibria:
        at = {d: [e.at[f"{d}.q"]] for d in mech.drivers}
        run = mech.run(at=at, want=["*.tau_red"], static=True)
        for d in mech.drivers:
            assert abs(run[f"{d}.tau_red"][0]) < 1e-10
    again = mech.equilibria(starts=64)
    assert all(any(np.allclose(x.q, y.q, atol=1e-9) for y in equilibria) for x in again)


def test_curves_lead_from_one_equilibrium_to_the_others():
    """Two hanging arms have four equilibria; a handful of starts and the curves find them all."""
    g = bm.Graph("double", gravity=(0.0, -9.81))
    g.add("frame", bm.Frame(markers={"A": (0.0, 0.0), "D": (3.0, 0.0)}))
    for name, at in (("one", "A"), ("two", "D")):
        arm = bm.Link(mass=1.0, inertia=0.1, cm=(0.5, 0.0))
        g.add(name, bm.Crank(length=1.0, links={"crank": arm}))
        g.connect(f"frame.{at}", f"{name}.A")
    g.add("tie", bm.Spring(stiffness=2.0, free_length=3.0))
    wire(g, "one.B tie.a", "two.B tie.b")
    mech = g.compile()
    few, many = mech.equilibria(starts=2), mech.equilibria(starts=512)
    assert len(few) == len(many) == 4
    for a, b in zip(few, many, strict=True):
        assert a.q == pytest.approx(b.q, abs=1e-9)
    assert len(few.stable) == 1


def test_a_stop_that_the_loads_push_against_holds():
    graph = bm.Graph.load(GRAPHS / "watt_sixbar.json")
    graph.add_stop("crank", 1.6, 3.0)
    equilibria = graph.compile().equilibria()
    assert [e.stop for e in equilibria] == [True]
    assert equilibria[0].q[0] == 3.0
    assert "end stop" in str(equilibria)


def test_loads_of_the_time_need_a_time():
    mech = bm.Graph.load(GRAPHS / "motions" / "shaken_slider.json").compile()
    with pytest.raises(bm.RequestError, match=r"time: loads follow the time"):
        mech.equilibria()


def test_loads_that_follow_signals_are_refused():
    graph = next((GRAPHS / "control").glob("*.json"))
    mech = bm.Graph.load(graph).compile()
    for ask in (mech.equilibria, lambda: bm.design.flywheel(mech, 1.0, 0.1)):
        with pytest.raises(bm.RequestError, match="loads follow signals"):
            ask()


def test_a_balanced_mechanism_rests_everywhere():
    graph = bm.Graph.load(GRAPHS / "watt_sixbar.json").replace({"scene.gravity.y": 0.0})
    equilibria = graph.compile().equilibria()
    assert len(equilibria) == 0
    assert len(equilibria.balanced) == 1
    assert "balanced everywhere" in str(equilibria)


def test_the_picture_marks_them(tmp_path):
    equilibria = loop().equilibria()
    equilibria.plot(tmp_path / "e.png")
    assert (tmp_path / "e.png").stat().st_size > 10_000
    figure = equilibria.figure()
    assert [a.get_ylabel().split(" [")[0] for a in figure.axes] == [
        "potential",
        "effort of the loads",
    ]
    several = bm.Graph.load(GRAPHS / "fivebar_falling.json").compile().equilibria(starts=16)
    with pytest.raises(bm.RequestError, match="no picture"):
        several.plot(tmp_path / "x.png")


def test_a_slide_without_ends_is_followed_as_far_as_kinks_are_known():
    """A rack that turns a wheel with a torsion spring: jumps and roots alternate."""
    equilibria = bm.Graph.load(GRAPHS / "rack_gripper.json").compile().equilibria()
    kinds = [e.kind for e in equilibria]
    assert all(a != b for a, b in itertools.pairwise(kinds))
    assert any(e.jump for e in equilibria)
    assert "no group ends the travel" in str(equilibria)


def balanced_wheel(*joints):
    """An arm that hangs, and on it a link balanced on its own pin, which gravity does not feel."""
    m = bm.Linkage("neutral", gravity=(0, -9.81))
    m.add_link("arm", mass=1, inertia=0.01, cm=(0.2, 0))
    m.add_link("wheel", mass=0.5, inertia=0.001, cm=(0.4, 0))
    m.add_joint("O", "R", ["frame", "arm"], point=(0, 0))
    m.add_joint("P", "R", ["arm", "wheel"], point=(0.4, 0))
    m.add_driver("a", "O")
    m.add_driver("w", "P")
    if joints:
        m.add_link("fore", mass=0.3, inertia=0.01, cm=(0.5, 0.1))
        m.add_joint("Q", "R", ["arm", "fore"], point=(0.4, 0.1))
        m.add_driver("f", "Q")
    return m.compile()


def test_a_coordinate_that_the_loads_do_not_feel_is_free():
    below, above = balanced_wheel().equilibria()
    for equilibrium, q in ((below, -math.pi / 2), (above, math.pi / 2)):
        assert equilibrium.at["driver.a.q"] == pytest.approx(q, abs=1e-12)
        assert equilibrium.free == ("driver.w.q",)
    assert (below.kind, above.kind) == ("indifferent", "unstable")
    assert str(below).startswith("driver.a.q = -1.57079633 rad, driver.w.q free  indifferent")
    held = 0.01 + 1 * 0.2**2 + 0.5 * 0.4**2  # about O, of the arm and the wheel's mass
    assert below.frequencies == pytest.approx([math.sqrt(9.81 * (0.2 + 0.5 * 0.4) / held)])


def test_three_drivers_one_of_them_free_are_as_the_two_others_alone():
    equilibria = balanced_wheel("fore").equilibria()
    assert len(equilibria) == 4
    assert all(equilibrium.free == ("driver.w.q",) for equilibrium in equilibria)
    for equilibrium in equilibria:
        q, f = equilibrium.at["driver.a.q"], equilibrium.at["driver.f.q"]
        # moments of the weights about O and about Q, places as drawn: Q (0.4, 0.1), centre beyond
        turn, out = np.exp(1j * q), 0.1 * np.exp(1j * f)
        about_q = (turn * out).real
        about_o = (turn * (1 * 0.2 + 0.5 * 0.4 + 0.3 * (0.4 + 0.1j + out))).real
        assert abs(about_q) < 1e-9
        assert abs(about_o) < 1e-9


def lamp(head):
    """A lamp whose arms two springs carry; its head is balanced on its pin, by itself or fixed."""
    m = bm.Linkage("lamp", gravity=(0, -9.81))
    m.add_link("lower", mass=0.5, inertia=0.01, cm=(0, 0.2))
    m.add_link("upper", mass=0.4, inertia=0.01, cm=(0.2, 0.4))
    m.add_joint("O", "R", ["frame", "lower"], point=(0, 0))
    m.add_joint("E", "R", ["lower", "upper"], point=(0, 0.4))
    m.add_driver("d1", "O")
    m.add_driver("d2", "E")
    if head:
        m.add_link("head", mass=0.6, inertia=0.002, cm=(0.4, 0.4))
        m.add_joint("H", "R", ["upper", "head"], point=(0.4, 0.4))
        m.add_driver("d3", "H")
    spring = bm.Spring(stiffness=150, free_length=0.05)
    m.add_load("s1", spring, links=["frame", "lower"], at=[(-0.08, 0.05), (0, 0.12)])
    m.add_load("s2", spring, links=["lower", "upper"], at=[(-0.02, 0.2), (-0.06, 0.4)])
    return m.compile()


def lamp_potential(q, head):
    """Potential [J] of the lamp's weights and springs at turns of its arms."""
    lower, upper = np.exp(1j * q[0]), np.exp(1j * (q[0] + q[1]))
    elbow = 0.4j * lower
    weights = 0.5 * 0.2j * lower + 0.4 * (elbow + 0.2 * upper) + head * 0.6 * (elbow + 0.4 * upper)
    lengths = abs(0.12j * lower + 0.08 - 0.05j), abs(elbow - 0.06 * upper - (-0.02 + 0.2j) * lower)
    return 9.81 * weights.imag + sum(75.0 * (x - 0.05) ** 2 for x in lengths)


@pytest.mark.parametrize("head", [False, True])
def test_a_head_that_is_balanced_on_its_pin_makes_families_and_no_continuum(head):
    equilibria = lamp(head).equilibria()
    assert len(equilibria) == 4
    for one in equilibria:
        assert one.free == (("driver.d3.q",) if head else ())
        q, h = np.array([one.at["driver.d1.q"], one.at["driver.d2.q"]]), 1e-5
        slopes = [
            lamp_potential(q + h * e, head) - lamp_potential(q - h * e, head) for e in np.eye(2)
        ]
        assert np.abs(slopes).max() / (2 * h) < 1e-8
    kinds = sorted(one.kind for one in equilibria)
    assert kinds == ["indifferent" if head else "stable", *["unstable"] * 3]


def test_without_loads_every_coordinate_is_free():
    m = bm.Linkage("floating")
    for name, at in (("a", 0.0), ("b", 0.3)):
        m.add_link(name, mass=1, inertia=0.01, cm=(at + 0.1, 0))
    m.add_joint("A", "R", ["frame", "a"], point=(0, 0))
    m.add_joint("B", "R", ["a", "b"], point=(0.3, 0))
    m.add_driver("a", "A")
    m.add_driver("b", "B")
    (equilibrium,) = m.compile().equilibria()
    assert equilibrium.free == ("driver.a.q", "driver.b.q")
    assert str(equilibrium) == "driver.a.q free, driver.b.q free  indifferent"


# -- beyond dead centres of the driver -----------------------------------------------------


def extremes_of_potential(case):
    """(angle of the left link, kind) of each pose of a four-bar where its potential is extreme."""
    masses = [case["links"][x]["mass"] for x in "lmr"]
    joints = case["joints"]
    a, (b, c) = joints["B"]["at"][0][0], (x[0] for x in joints["C"]["at"])
    d = joints["D"]["at"][0][0]
    theta = np.linspace(-math.pi, math.pi, 100001)
    B, extremes = a * np.exp(1j * theta), []
    r = np.abs(d - B)
    for side in (1, -1):
        with np.errstate(invalid="ignore"):
            alpha = side * np.arccos((b * b + r * r - c * c) / (2 * b * r))
        C = B + b * (d - B) / r * np.exp(1j * alpha)
        height = (masses[0] * B + masses[1] * (B + C) + masses[2] * C).imag
        rises = np.sign(np.diff(height))
        for i in np.flatnonzero(rises[:-1] * rises[1:] < 0).tolist():
            extremes.append((theta[i + 1], "stable" if rises[i + 1] > 0 else "unstable"))
    return sorted(extremes)


@pytest.mark.parametrize("seed", [3, 4, 7])
def test_equilibria_beyond_dead_centres_are_the_extremes_of_the_potential(seed):
    """Triple rockers: one closed curve of poses, of which the driver has half in each mode."""
    case = four_bar(np.random.default_rng([seed, 6]), "rocker")
    equilibria = bm.Linkage.from_data(case).compile().equilibria()
    turned = [(float(np.angle(np.exp(1j * e.q[0]))), e.kind) for e in equilibria]
    right = extremes_of_potential(case)
    assert [kind for _, kind in sorted(turned)] == [kind for _, kind in right]
    assert [q for q, _ in sorted(turned)] == pytest.approx([q for q, _ in right], abs=1e-4)
    assert sum(e.chart is not None for e in equilibria) == len(equilibria) // 2
    assert [e.kind for e in pickle.loads(pickle.dumps(equilibria))] == [e.kind for e in equilibria]


def test_a_linear_system_stands_about_an_equilibrium_beyond_a_dead_centre():
    """The hanging four-bar of 25, 10, 25 and 30 cm, smaller than a radian: four equilibria."""
    equilibria = hanging().compile().equilibria()
    assert [e.kind for e in equilibria] == ["stable", "unstable", "stable", "unstable"]
    leaning = math.acos(0.8)  # -1.159 + 0.516 rad of the left rocker: the crossed pose
    assert equilibria[1].q[0] == pytest.approx(
        math.atan2(math.sqrt(0.0525), 0.1) - leaning, abs=1e-9
    )
    assert equilibria[1].leads == pytest.approx(
        {"joint.D.coordinate": -equilibria[1].q[0]}
    )  # by symmetry
    assert "where joint.D.coordinate = -0.515778372 rad leads" in str(equilibria[1])
    about = hanging().compile().linearize(equilibria[1])
    assert about.effort == pytest.approx([0.0], abs=1e-12)
    assert about.eigenvalues == pytest.approx(equilibria[1].values)
    assert pytest.approx(equilibria[1].K) == about.K


def test_where_a_group_is_at_dead_centre_all_along_nothing_is_looked_for(monkeypatch):
    """The scissors' rhombi fold beyond the cylinder's dead centre: half a turn of dead centres."""
    looked_at, passable = [], Closure.passable
    monkeypatch.setattr(Closure, "passable", lambda *x: looked_at.append(x) or passable(*x))
    lift = bm.read(GRAPHS / "scissor_lift.json").compile()
    equilibria = lift.equilibria(friction="none")
    assert [(e.kind, e.jump) for e in equilibria] == [("stable", True)]
    assert len(looked_at) < 20


def geared(ratio: float) -> bm.Linkage:
    """Two heavy arms on wheels with a belt between them: the second turns by 1 / ratio."""
    m = bm.Linkage("geared", gravity=(0.0, -9.81))
    m.add_link("arm", pose=(0.0, 0.0, 0.6), mass=1.0, inertia=0.1, cm=(0.1, 0.0))
    m.add_link("wheel", pose=(1.0, 0.0, 0.3), mass=1.0, inertia=0.1, cm=(0.3, 0.0))
    m.add_joint("A", "R", ["frame", "arm"], at=[(0.0, 0.0), (0.0, 0.0)])
    m.add_joint("B", "R", ["frame", "wheel"], at=[(1.0, 0.0), (0.0, 0.0)])
    m.add_driver("d", "A")
    m.add_driver("w", "B")
    m.add_coupling("belt", "belt", driver="d", driven="w", radii=(0.1, 0.1 * ratio))
    return m


def test_a_machine_that_never_repeats_is_seen_over_the_turn_about_its_start():
    golden = geared((1 + math.sqrt(5)) / 2)
    rest = golden.compile().equilibria()
    assert [e.kind for e in rest] == ["stable", "unstable"]
    assert any("no turn is like another" in note for note in rest.notes)
    golden.start("d", q=20.0)
    later = golden.compile().equilibria()
    assert all(abs(e.q[0] - 20.0) <= math.pi for e in later)
    for q in (*rest[0].q, *later[0].q):
        still = golden.run(at=q, rates=0.0, static=True, want="driver.d.drive")
        assert abs(still["driver.d.drive"][0]) < 1e-12


@pytest.mark.parametrize("first", [-1.2, 3.0, 9.0])
def test_a_design_rests_where_its_loads_balance_whatever_turn_it_starts_in(first):
    machine = geared(2.0)
    study = machine.compile().study({"links.arm.mass": [1.1]}, want="rest(driver.d.q)", at=first)
    q = float(study["rest(driver.d.q)"][0])
    still = machine.replace({"links.arm.mass": 1.1}).run(at=q, rates=0.0, want="driver.d.drive")
    assert abs(still["driver.d.drive"][0]) < 1e-12
    assert abs(q - first) <= math.tau
