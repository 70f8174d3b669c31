"""Motions through dead centres of their drivers: other joints lead, nothing else changes.

Numbers of the hanging four-bar are those of absolute coordinates (DOP853 in all poses, projected
onto the joints), eight digits.
"""

from __future__ import annotations

import copy
import math
import pickle

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import blockmech as bm
from blockmech.dynamics.charts import home_chart
from blockmech.dynamics.request import Watch
from blockmech.model.joints.decompose import decompose
from blockmech.testing.strategies import Options, Seeded, random_mechanism
from tests.dynamics.honesty import mechanism as massive
from tests.dynamics.one_chart import in_one_chart
from tests.independent.released import document, five_bar, four_bar, link, pin, truth
from tests.machines import wire

TIMES = [0.1, 0.5, 1.0]  # [s]
LEFT = [0.26861746, -0.05290324, -0.18957268]  # [rad] of the left rocker then
SIDE, COUPLER, APART = 0.25, 0.1, 0.3  # [m]


def hanging(**joints):
    """The hanging four-bar; joints take more keys."""
    x = (APART - COUPLER) / 2
    h = math.sqrt(SIDE**2 - x**2)
    B, C, D = complex(x, -h), complex(APART - x, -h), complex(APART)
    places = {"A": (0j, ("frame", "l")), "B": (B, ("l", "m")), "C": (C, ("m", "r"))}
    places["D"] = D, ("frame", "r")
    linkage = bm.Linkage("hanging", gravity=(0.0, -9.81))
    bars = {
        "l": (0.0025, SIDE, B / 2),
        "m": (0.01, COUPLER, (B + C) / 2),
        "r": (0.0025, SIDE, (C + D) / 2),
    }
    for name, (mass, length, cm) in bars.items():
        linkage.add_link(name, mass=mass, inertia=mass * length**2 / 12, cm=(cm.real, cm.imag))
    for name, (z, links) in places.items():
        linkage.add_joint(name, "R", links, point=(z.real, z.imag), **joints.get(name, {}))
    linkage.add_driver("motor", "A")
    linkage.start("motor", q=0.5)
    return linkage


def of_blocks(direction=0.0, offset=0.0, sign=1):
    """The same as a graph of blocks, the angle of its crank direction + sign q + offset."""
    graph = bm.Graph("hanging", gravity=(0.0, -9.81))
    bar = {"mass": 0.0025, "inertia": 0.0025 * SIDE**2 / 12, "cm": (SIDE / 2, 0.0)}
    middle = {"mass": 0.01, "inertia": 0.01 * COUPLER**2 / 12, "cm": (COUPLER / 2, 0.0)}
    marker = bm.Marker(at=(0.0, 0.0), angle=direction)
    graph.add("frame", bm.Frame(markers={"A": marker, "D": (APART, 0.0)}))
    crank = bm.Crank(length=SIDE, offset=offset, sign=sign, links={"crank": bm.Link(**bar)})
    graph.add("left", crank)
    links = {"i": bm.Link(**middle), "j": bm.Link(**bar)}
    graph.add("loop", bm.RRR(l_i=COUPLER, l_j=SIDE, branch=-1, links=links))
    wire(graph, "frame.A left.A", "left.B loop.B", "frame.D loop.D")
    hangs = sign * (math.atan2(-math.sqrt(SIDE**2 - 0.01), 0.1) - direction - offset)
    graph.start("left", q=hangs + sign * 0.5)
    return graph, hangs


@pytest.fixture(scope="module")
def falling():
    """All outputs of the hanging four-bar over a second."""
    mechanism = hanging().compile()
    times = np.union1d(np.linspace(0.0, 1.0, 401), TIMES)
    return mechanism.simulate(times=times, want="*", accuracy=1e-11)


def test_a_hanging_four_bar_swings_through_the_dead_centres_of_its_driver(falling):
    motion = falling.motion
    assert (motion.status, motion.end) == ("reached", "time")
    assert motion.at(TIMES).q == pytest.approx(LEFT, abs=5e-9)
    assert [joints for _, joints in motion.charts] == [("A",), ("D",), ("A",), ("D",)]
    assert motion.charts[0][0] == 0.0
    assert motion.error < 1e-10
    assert "joints that lead: A from 0 s on, D from" in str(motion)


def test_all_outputs_go_through(falling):
    """Energy stays, rates are those of places, drives are idle, and each leg is in balance."""
    energy = falling["mechanism.kinetic_energy"] + falling["mechanism.potential_energy"]
    assert np.ptp(energy) < 1e-13 * falling["mechanism.kinetic_energy"].max() / 1e-3
    t, q, rate = (falling[f"driver.motor.{x}"] if x else falling.time for x in ("", "q", "rate"))
    h = t[1] - t[0]
    even = slice(0, 40)
    between = (q[even][2:] - q[even][:-2]) / (2 * h)
    assert between == pytest.approx(rate[even][1:-1], abs=5e-3)
    slope = np.gradient(rate, t)[2:-2]
    assert slope == pytest.approx(falling["driver.motor.acceleration"][2:-2], rel=0.02, abs=0.3)
    assert falling["driver.motor.acceleration"] == pytest.approx(falling["link.l.alpha"], abs=1e-9)
    assert np.abs(falling["driver.motor.drive"]).max() < 1e-15
    places = falling["joint.B.p"], falling["joint.C.p"]
    assert np.abs(np.abs(places[1] - places[0]) - COUPLER).max() < 1e-14
    for name in ("joint.B.reaction", "link.r.a", "joint.D.reaction"):
        assert np.isfinite(falling[name]).all()
    assert falling.mechanism.verify(falling).ok


def test_where_a_driver_does_not_lead_nothing_is_reduced_to_it(falling):
    reduced = falling["driver.motor.J_red"]
    begins = [begin for begin, _ in falling.motion.charts]
    second = (falling.time >= begins[1]) & (falling.time < begins[2])
    assert np.isnan(reduced[second]).all()
    assert (reduced[falling.time < begins[1]] > 0).all()


def test_a_charted_result_is_cut_pickled_and_asked_for_more(falling):
    again = pickle.loads(pickle.dumps(falling))
    assert again["joint.C.p"] == pytest.approx(falling["joint.C.p"], abs=0)
    some = falling.isel(np.array([3, 300]))
    assert some["link.m.angle"] == pytest.approx(falling["link.m.angle"][[3, 300]], abs=0)
    assert falling.rerun("link.r.p")["link.r.p"] == pytest.approx(falling["link.r.p"], abs=0)


def test_blocks_move_as_their_links_and_joints(falling):
    graph, hangs = of_blocks()
    result = graph.compile().simulate(times=TIMES, want="*", accuracy=1e-11)
    assert result["left.q"] - hangs == pytest.approx(LEFT, abs=5e-9)
    assert [joints for _, joints in result.motion.charts][:2] == [("left.A",), ("loop.D",)]
    at = np.searchsorted(falling.time, TIMES)
    same = {
        "loop.C.p": "joint.C.p",
        "loop.C.v": "joint.C.v",
        "left.B.a": "joint.B.a",
        "loop.B.reaction": "joint.B.reaction",
        "loop.D.reaction": "joint.D.reaction",
        "left.acceleration": "driver.motor.acceleration",
        "mechanism.shaking_force": "mechanism.shaking_force",
    }
    for block, joint in same.items():
        size = np.abs(falling[joint]).max()
        assert result[block] == pytest.approx(falling[joint][at], abs=1e-8 * size), block
    assert result["loop.C.coordinate"] == pytest.approx(
        np.angle(np.exp(1j * (result["loop.j.angle"] - result["loop.i.angle"]))), abs=1e-12
    )


@pytest.mark.parametrize(
    ("direction", "offset", "sign"), [(0.9, 0.0, 1), (-2.5, 1.1, 1), (0.9, -0.7, -1)]
)
def test_a_crank_counts_as_its_block_says_in_all_charts(falling, direction, offset, sign):
    """It counted from the x axis, as the joint does, from the first change of charts on."""
    graph, hangs = of_blocks(direction, offset, sign)
    mechanism = graph.compile()
    result = mechanism.simulate(times=TIMES, want="*", accuracy=1e-11)
    assert len(result.motion.charts) == 4
    assert sign * (result["left.q"] - hangs) == pytest.approx(LEFT, abs=5e-9)
    assert sign * (result.motion.q_end - hangs) == pytest.approx(LEFT[-1], abs=5e-9)
    coordinate = sign * result["left.q"] + offset
    assert np.array_equal(result["left.A.coordinate"], coordinate)
    assert result["left.crank.angle"] == pytest.approx(coordinate + direction, abs=1e-9)
    pin = falling["joint.C.p"][np.searchsorted(falling.time, TIMES)]
    assert result["loop.C.p"] == pytest.approx(pin, abs=1e-8)
    assert mechanism.verify(result).ok
    stops = {"left": sorted((hangs - sign * 0.1, hangs + sign * 1.0))}
    motion = mechanism.simulate("time=1", stops=stops, want=()).motion
    assert (motion.status, motion.end) == ("ended", "end stop")
    assert motion.q_end == pytest.approx(hangs - sign * 0.1, abs=1e-9)
    rests = [sign * (next(iter(e.at.values())) - hangs) for e in mechanism.equilibria()]
    graph, hangs = of_blocks()
    angles = [next(iter(e.at.values())) - hangs for e in graph.compile().equilibria()]
    assert len(rests) == 4
    for rest in rests:
        assert min(abs(math.remainder(rest - q, math.tau)) for q in angles) < 1e-9


@pytest.mark.parametrize("seed", range(12))
def test_pairs_of_blocks_count_alike_in_all_charts(seed):
    """Slides inside of dyads counted from elsewhere: states were handed over to other poses."""
    case = random_mechanism(Seeded(seed), Options(drivers=(1, 1), groups=(2, 3)))
    mechanism = case.graph.compile()
    q = np.ravel(case.request["at"][mechanism.drivers[0]])[:1]
    home = home_chart(mechanism, q)
    document = bm.Linkage.from_data(home.home.to_data()).compile()

    def coordinates(mech, want):
        at = {mech.drivers[0]: q}
        return mech.run(at, rates=dict.fromkeys(at, 0.0), want=[*want])

    pairs = {f"{ref}.coordinate": joint for ref, joint in home.names.of_joints.items()}
    of_blocks = coordinates(mechanism, pairs)
    of_links = coordinates(document, [f"{joint}.coordinate" for joint in pairs.values()])
    for output, joint in pairs.items():
        off = of_links[f"{joint}.coordinate"] - of_blocks[output]
        if home.layout.pairs[joint.removeprefix("joint.")].kind == "R":
            off = np.angle(np.exp(1j * off))
        assert np.abs(off).max() < 1e-11 * home.layout.size, output


def test_welded_links_pass_dead_centres_as_the_link_that_they_are(falling):
    """A link that another carries has no pose of its own: this was a KeyError."""
    linkage = hanging()
    coupler = linkage.links["m"]
    link_data = {"mass": coupler.mass / 2, "inertia": coupler.inertia / 2, "cm": coupler.cm}
    linkage.links["m"] = coupler.model_copy(update=link_data)
    linkage.add_link("plate", **link_data)
    linkage.add_joint("W", "weld", ["m", "plate"], point=(0.0, 0.0))
    result = linkage.compile().simulate(
        times=TIMES, want=["driver.motor.q", "link.plate.p"], accuracy=1e-11
    )
    assert len(result.motion.charts) == 4
    assert result["driver.motor.q"] == pytest.approx(LEFT, abs=5e-9)
    at = np.searchsorted(falling.time, TIMES)
    assert result["link.plate.p"] == pytest.approx(falling["link.m.p"][at], abs=1e-9)


def test_stops_of_a_call_hold_in_all_charts_and_for_this_call_alone():
    """Charts of an earlier call were taken, with the stops of that call."""
    mechanism = hanging().compile()
    request = {"until": "time=1", "want": "joint.D.coordinate"}
    free = mechanism.simulate(**request)
    result = mechanism.simulate(**request, stops={"joint.D.coordinate": (-0.4, 1.0)})
    assert (result.motion.end, len(result.motion.charts)) == ("end stop", 2)
    assert result["joint.D.coordinate"][-1] == pytest.approx(-0.4, abs=1e-9)
    again = mechanism.simulate(**request)
    assert again.motion.end == free.motion.end == "time"
    assert again.motion.q_end == pytest.approx(free.motion.q_end, abs=1e-9)


def test_signals_act_in_all_charts():
    """A gain from a joint's angle to a moment there is a torsion spring."""
    spring, control = hanging(), hanging()
    spring.add_load("moment", "torsion_spring", joint="D", stiffness=0.002)
    control.add_load("moment", "motor", links=["frame", "r"], law={"kind": "signal"})
    control.add_signal("gain", "gain", k=-0.002)
    control.connect("joint.D.coordinate", "gain.u")
    control.connect("gain.y", "moment.law")
    request = {"times": TIMES, "want": ["*.q", "joint.*.reaction"], "accuracy": 1e-11}
    of_spring, of_control = (x.compile().simulate(**request) for x in (spring, control))
    assert [joints for _, joints in of_control.motion.charts] == [("A",), ("D",)] * 2
    for name in of_spring:
        size = np.abs(of_spring[name]).max()
        assert of_control[name] == pytest.approx(of_spring[name], abs=1e-9 * size)


def test_a_driver_that_a_signal_reads_always_drives():
    linkage = hanging()
    linkage.add_load("moment", "motor", links=["frame", "l"], law={"kind": "signal"})
    linkage.add_signal("gain", "gain", k=-0.002)
    linkage.connect("driver.motor.q", "gain.u")
    linkage.connect("gain.y", "moment.law")
    motion = linkage.compile().simulate("time=1", want=()).motion
    assert motion.end == "dead centre"
    note = "no other joint leads on: loads, couplings, signals or roles name the drivers"
    assert note in motion.notes


def test_a_crank_that_goes_on_leading_counts_from_its_markers_direction():
    def falling(left, right):
        graph = bm.Graph("five", gravity=(0.0, -9.81))
        markers = {"A": bm.Marker(at=(0, 0), angle=left), "E": bm.Marker(at=(2, 0), angle=right)}
        graph.add("frame", bm.Frame(markers=markers))
        crank = bm.Link(mass=1.0, inertia=0.1, cm=(0.5, 0.0))
        for arm in ("left", "right"):
            graph.add(arm, bm.Crank(length=1.0, links={"crank": crank}))
        rods = {x: bm.Link(mass=1.5, inertia=0.5, cm=(0.7, 0.0)) for x in "ij"}
        graph.add("dyad", bm.RRR(l_i=1.4, l_j=1.4, branch=1, links=rods))
        wire(graph, "frame.A left.A", "frame.E right.A", "left.B dyad.B", "right.B dyad.D")
        graph.start("left", q=1.404 - left, rate=1.427)
        graph.start("right", q=1.732 - right, rate=2.738)
        times, want = np.linspace(0.0, 0.8, 9), ["*.q", "dyad.C.p"]
        return graph.compile().simulate(times=times, want=want, accuracy=1e-8)

    plain, turned = falling(0.0, 0.0), falling(0.9, -2.0)
    assert plain.motion.charts[1][1] == turned.motion.charts[1][1] == ("left.A", "dyad.C")
    assert turned["left.q"] == pytest.approx(plain["left.q"] - 0.9, abs=1e-8)
    assert turned["right.q"] == pytest.approx(plain["right.q"] + 2.0, abs=1e-8)
    assert turned["dyad.C.p"] == pytest.approx(plain["dyad.C.p"], abs=1e-8)


def test_one_chart_changes_nothing():
    """To the bit: the motion of a system, and that of `simulate`."""
    mechanism = hanging().compile()
    motion = mechanism.simulate("time=0.2", want=()).motion
    plain = in_one_chart(mechanism, "time=0.2")
    times = np.linspace(0.0, 0.2, 50)
    assert np.array_equal(motion.at(times).q, plain.at(times).q)
    assert (motion.error, motion.legs) == (plain.error, ())
    assert motion.charts == ((0.0, ("A",)),)


@pytest.mark.parametrize(("kind", "seed"), [("rocker", 2), ("near", 5), ("near", 19)])
def test_random_four_bars_move_as_absolute_coordinates_say(kind, seed):
    case = four_bar(np.random.default_rng([seed, len(kind)]), kind)
    times = np.linspace(0.0, 0.8, 5)
    motion = (
        bm.Linkage.from_data(case).compile().simulate(times=times, want=(), accuracy=1e-11).motion
    )
    assert len(motion.charts) > 1
    off = np.abs(motion.at(times).q - truth(case, times)[:, 0]).max()
    assert off < min(1e-9, motion.error + 1e-11)  # what the truth leaves open


def test_energy_stays_where_another_joint_leads_near_a_change_point():
    """Rates by poses there lose twice as many digits; absolute coordinates know q to 1e-12.

    Without the energy that stays both runs were off by 2e-10 alike, and 6e-12 was stated.
    """
    case = four_bar(np.random.default_rng([11, len("near")]), "near")
    result = (
        bm.Linkage.from_data(case)
        .compile()
        .simulate(times=[0.0, 0.2, 0.3, 1.5], want="mechanism.*_energy", accuracy=1e-11)
    )
    energy = result["mechanism.kinetic_energy"] + result["mechanism.potential_energy"]
    assert len(result.motion.charts) == 2
    assert np.ptp(energy) < 5e-13  # [J] of 2.5: it was 2e-12
    assert abs(result.motion.q_end - 0.190322605044) < min(result.motion.error, 2e-11)


def test_two_drivers_go_through_a_stretched_dyad():
    """Beside absolute coordinates; a chart with a general group leads while it is straight."""
    case = five_bar(np.random.default_rng([1, 7]))
    times = np.linspace(0.0, 0.55, 4)
    motion = (
        bm.Linkage.from_data(case).compile().simulate(times=times, want=(), accuracy=1e-8).motion
    )
    assert len(motion.charts) == 3
    assert np.abs(motion.at(times).q - truth(case, times)).max() < motion.error < 1e-8


def geared(case):
    """A five-bar with two wheels in mesh with its first crank, and one that is the same.

    A flywheel on the frame turns twice as fast; a planet on the crank rolls on a fixed sun.
    """
    case, alike = copy.deepcopy(case), copy.deepcopy(case)
    a, _ = case["joints"]["B"]["at"][0]
    case["links"]["frame"] = {"markers": {"sun": {"at": [0.0, 0.0]}}}
    for name, mass, inertia in (("fly", 0.7, 0.02), ("planet", 0.4, 0.01)):
        case["links"][name] = {"mass": mass, "inertia": inertia, "cm": [0, 0], "pose": [0, 0, 0]}
        case["drivers"][f"{name}_turn"] = {"joint": name.upper()}
    case["joints"]["FLY"] = pin("frame", "fly", [-0.3, 0.0], [0.0, 0.0])
    case["joints"]["PLANET"] = pin("l", "planet", [a, 0.0], [0.0, 0.0])
    case["couplings"] = {
        "mesh": {"type": "gear", "driver": "one", "driven": "fly_turn", "teeth": [40, 20]},
        "roll": {"type": "gear", "driver": "frame.sun", "driven": "planet_turn", "teeth": [30, 15]},
    }
    crank = alike["links"]["l"]
    mass, x = crank["mass"], crank["cm"][0]
    middle = (mass * x + 0.4 * a) / (mass + 0.4)
    crank["inertia"] += mass * (x - middle) ** 2 + 0.4 * (a - middle) ** 2
    crank["inertia"] += 0.02 * 2.0**2 + 0.01 * 3.0**2  # as they turn against the ground
    crank |= {"mass": mass + 0.4, "cm": [middle, 0.0]}
    return case, alike


@pytest.mark.parametrize("blocks", [False, True])
def test_gears_go_along_while_other_drivers_change_joints(blocks):
    """Beside absolute coordinates of the same machine without its wheels."""
    case, alike = geared(five_bar(np.random.default_rng([1, 7])))
    times, linkage = np.linspace(0.0, 0.55, 4), bm.Linkage.from_data(case)
    mechanism = (bm.Graph.from_data(decompose(linkage)[0]) if blocks else linkage).compile()
    result = mechanism.simulate(times=times, want="*", accuracy=1e-8)
    assert [joints[0][-1] for _, joints in result.motion.charts] == ["A"] * 3
    q = truth(alike, times)
    assert np.abs(result.motion.at(times).q - q).max() < result.motion.error < 1e-8
    assert mechanism.verify(result).ok
    head, coordinate = ("", ".A") if blocks else ("driver.", "")
    fly = f"fly_turn{coordinate}.coordinate" if blocks else "joint.FLY.coordinate"
    for name, ratio in ((f"{head}fly_turn.q", -2.0), (f"{head}planet_turn.q", 2.0), (fly, -2.0)):
        assert result[name] == pytest.approx(ratio * q[:, 0], abs=1e-8), name
    assert np.isfinite(result["roll.force"]).all()


def test_a_driver_that_couplings_read_always_drives():
    linkage = hanging()
    linkage.add_link("fly", inertia=1e-5)
    linkage.add_joint("F", "R", ["frame", "fly"], point=(-0.1, 0.0))
    linkage.add_driver("flywheel", "F")
    linkage.add_coupling("mesh", "gear", driver="motor", driven="flywheel", teeth=[20, 20])
    motion = linkage.compile().simulate("time=1", want=()).motion
    assert motion.end == "dead centre"
    note = "no other joint leads on: loads, couplings, signals or roles name the drivers"
    assert note in motion.notes


def test_goals_and_events_count_the_users_driver():
    mechanism = hanging().compile()
    turn = mechanism.simulate(want=()).motion
    assert (turn.end, len(turn.charts)) == ("standstill", 2)
    assert turn.t_end == pytest.approx(0.34416456, abs=1e-8)  # half of a period of 0.68832912 s
    assert mechanism.simulate("swings=3", want=()).motion.t_end == pytest.approx(3 * turn.t_end)
    watch = [Watch("mine", lambda t, q, rate: q + 0.18, terminal=False)]
    motion = mechanism.simulate("time=0.5", watch=watch, want=()).motion
    crossed = [(event.t, event.q) for event in motion.events if event.kind == "mine"]
    assert [q for _, q in crossed] == pytest.approx([-0.18] * 4, abs=1e-9)
    assert crossed[0][0] + crossed[3][0] == pytest.approx(2 * turn.t_end)  # the swing is symmetric
    there = mechanism.simulate("angle=-0.15", start={"motor": (-0.2, 1.0)}, want=()).motion
    assert there.end == "angle"
    assert there.q_end == pytest.approx(-0.15, abs=1e-9)


@pytest.mark.parametrize(
    ("until", "start", "end"),
    [
        ("standstill", (-0.26, -2.8), "never reached: rotation"),
        ("angle=10", (0.2134, 0.0), "never reached: libration"),
        ("swings=3", (0.2134, 0.0), "swings"),
    ],
)
def test_a_goal_that_is_never_reached_ends_as_in_one_chart(until, start, end):
    """The trammel turns on and on, or swings: its shoes lead by turns."""
    mechanism = massive("elliptic_trammel")
    motion = mechanism.simulate(until, start={"shoe": start}, want=(), budget=30).motion
    assert motion.end == end
    assert motion.error < 1e-9
    assert len(motion.charts) > 4
    if "period" in motion.facts:
        period = motion.facts["period"]
        times = np.array([0.0, period])
        on = mechanism.simulate(times=times, start={"shoe": start}, want=()).motion.at(times)
        assert np.ptp(on.q) < 1e-8
        assert np.ptp(on.qd) < 1e-7


def test_stops_of_a_call_hold_where_others_lead():
    """Of the driver that does not lead there, and of a pair by its name in the blocks."""
    mechanism = hanging().compile()
    motion = mechanism.simulate("time=1", stops={"motor": (-1.0, 1.0)}, want=()).motion
    assert (motion.end, motion.q_end) == ("time", pytest.approx(LEFT[-1], abs=1e-8))
    graph, _ = of_blocks()
    graph.add_stop("loop.D.coordinate", low=-2.6)
    free = graph.compile().simulate("time=0.4", stops={}, want="loop.D.coordinate")
    low = float(free["loop.D.coordinate"].min())
    stopped = graph.compile().simulate(
        "time=0.4", stops={"loop.D.coordinate": (low + 1e-3, math.inf)}, want="loop.D.coordinate"
    )
    assert stopped.motion.end.startswith("end stop")
    assert stopped["loop.D.coordinate"][-1] == pytest.approx(low + 1e-3, abs=1e-9)


def test_stops_of_any_joint_hold_where_others_lead():
    free = hanging().compile().simulate("time=0.4", want="joint.D.coordinate")
    place = float(free["joint.D.coordinate"].min())
    second = free.motion.charts[1]
    assert second[1] == ("D",)
    linkage = hanging()
    linkage.add_stop("joint.D.coordinate", low=place + 1e-3)
    motion = linkage.compile().simulate("time=1", want=()).motion
    assert motion.end == "end stop"
    at_stop = hanging().compile().simulate(times=[motion.t_end], want="joint.D.coordinate")
    assert at_stop["joint.D.coordinate"] == pytest.approx([place + 1e-3], abs=1e-8)


def test_joint_friction_goes_along():
    """Its work is what the energy loses, and pairs rub by their law in every chart."""
    law = {"friction": bm.friction.Coulomb(coefficient=0.1, radius=0.005)}
    mechanism = hanging(A=law, B=law, C=law, D=law).compile()
    want = ["mechanism.*_energy", "joint.B.*", "driver.motor.drive"]
    result = mechanism.simulate("time=0.5", want=want)
    assert len(result.motion.charts) == 2
    energy = result["mechanism.kinetic_energy"] + result["mechanism.potential_energy"]
    taken = result.motion.facts["friction_work"]
    assert taken == pytest.approx(energy[0] - energy[-1], rel=1e-9)
    assert taken > 1e-4
    load = np.abs(result["joint.B.reaction"])
    rubs = np.abs(result["joint.B.friction"])
    assert rubs[1:-1] == pytest.approx(0.1 * 0.005 * load[1:-1], rel=1e-9)
    assert np.abs(result["driver.motor.drive"]).max() < 1e-14


def test_a_locked_driver_is_a_frame():
    """A five-bar with one crank locked is a four-bar; its other crank goes through dead centres."""
    rng = np.random.default_rng([2, 6])
    four = four_bar(rng, "rocker")
    a, (*_, theta) = 0.3, four["links"]["l"]["pose"]
    pivot = a * np.exp(0.7j)
    links = {"post": link(rng, -pivot, 0j), **four["links"]}
    joints = {
        "P": pin("frame", "post", [-pivot.real, -pivot.imag], [0.0, 0.0]),
        **four["joints"],
        "A": pin("post", "l", [a, 0.0], [0.0, 0.0]),
    }
    start = {"base": (0.7, 0.0), "motor": (theta - 0.7, four["initial"]["motor"]["rate"])}
    five = document(links, joints, {"base": "P", "motor": "A"}, start, "five")
    times = np.linspace(0.0, 0.8, 9)
    locked = (
        bm.Linkage.from_data(five)
        .compile()
        .simulate(
            times=times,
            roles={"base": "locked"},
            want=["driver.*.q", "driver.*.drive"],
            accuracy=1e-10,
        )
    )
    free = (
        bm.Linkage.from_data(four).compile().simulate(times=times, want=(), accuracy=1e-10).motion
    )
    assert len(locked.motion.charts) > 1
    assert all("P" in joints for _, joints in locked.motion.charts)
    assert locked["driver.motor.q"] + 0.7 == pytest.approx(free.at(times).q, abs=1e-8)
    assert locked["driver.base.q"] == pytest.approx(np.full(9, 0.7), abs=1e-12)
    assert np.abs(locked["driver.base.drive"]).min() > 1e-3
    assert np.abs(locked["driver.motor.drive"]).max() < 1e-12


def test_what_is_not_handed_over_ends_with_its_reason():
    linkage = hanging()
    linkage.add_stop("motor", low=-1.0, high=1.0, restitution=0.5)
    motion = linkage.compile().simulate("time=1", want=()).motion
    assert motion.end == "dead centre"
    assert "no other joint than the drivers' leads on: end stops let it bounce" in motion.notes
    linkage = hanging()
    linkage.add_load(
        "motor_load",
        "motor",
        joint="A",
        driver="motor",
        law={"kind": "polynomial", "of": "rate", "coefficients": [0.0, -1e-4]},
    )
    motion = linkage.compile().simulate("time=1", want=()).motion
    assert motion.end == "dead centre"


@pytest.mark.parametrize("count", [2, 3])
def test_dyads_follow_through_change_points_that_a_document_does_not_tell(count):
    """Four-bars in a row (IFToMM A02): bars of 1 m and 1 kg, so the chain is a pendulum.

    M q'' = -m g cos q with M = (N + 1) / 3 + N and m = (N + 1) / 2 + N for N four-bars.
    """
    graph = bm.Graph("four_bars", gravity=(0.0, -9.81))
    bar = bm.Link(mass=1.0, inertia=1 / 12, cm=(0.5, 0.0))
    pivots = {f"D{i}": (i + 1.0, 0.0) for i in range(count)}
    graph.add("frame", bm.Frame(markers={"A": (0.0, 0.0), **pivots}))
    graph.add("crank", bm.Crank(length=1.0, links={"crank": bar}))
    graph.connect("frame.A", "crank.A")
    joint = "crank.B"
    for i in range(count):
        graph.add(f"loop{i}", bm.RRR(l_i=1.0, l_j=1.0, branch=1, links={"i": bar, "j": bar}))
        graph.connect(joint, f"loop{i}.B")
        graph.connect(f"frame.D{i}", f"loop{i}.D")
        joint = f"loop{i}.C"
    graph.start("crank", q=math.pi / 2, rate=-1.0)
    rocker = f"loop{count - 1}.j.angle"
    result = graph.compile().simulate("time=10", want=["crank.q", rocker])

    def slope(t, y):
        mass, moment = (count + 1) / 3 + count, (count + 1) / 2 + count
        return [y[1], -9.81 * moment / mass * math.cos(y[0])]

    exact = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-13, "max_step": 0.01}
    q = solve_ivp(slope, (0.0, 10.0), [math.pi / 2, -1.0], t_eval=result.time, **exact).y[0]
    assert result.motion.end == "time"
    assert any("its dyads follow the motion" in note for note in result.motion.notes)
    error = np.abs(result["crank.q"] - q).max()
    assert error < min(1e-9, result.motion.error + 1e-12)
    assert np.abs(np.exp(1j * result[rocker]) - np.exp(1j * q)).max() < 1e-9
