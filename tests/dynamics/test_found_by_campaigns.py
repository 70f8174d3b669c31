"""Runs that campaigns with random starts found: each was wrong, or a waste, once.

The sweep over the gallery, at starts of its own, is in `test_honest_estimates`.
"""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

import blockmech as bm
from blockmech.dynamics.integration import replay
from blockmech.dynamics.methods import move
from blockmech.dynamics.system.reduced import Metered
from blockmech.dynamics.until import Start, Until
from tests.doors import graph_of as loads
from tests.dynamics import linkages
from tests.dynamics.honesty import GRAPHS, RUNS, TARGETS, Run, agree, mechanism, moved, sweep
from tests.dynamics.scenes import motor, rod

FEW_SAMPLES = 6000  # of a run that once took 200,000

# crank, coupler, rocker, base [m]
ONE_STEP = (0.8770989558936463, 1.082890263568129, 0.5967851289435614, 0.6900644851196986)
NOISY = (0.7430780728144555, 0.9552279464559238, 0.5795200552778097, 0.8484641758556702)


def fourbar(lengths):
    return linkages.reduced(linkages.FourBar(*lengths))


@pytest.mark.parametrize("q", [1.4933348780892297, 1.494, 1.492])
def test_a_start_beside_an_unstable_equilibrium_is_honest_and_cheap(q):
    """It comes back to just before the same place, where its energy is but rounding."""
    system, start, until = linkages.watt(), Start(q, 0.0), Until("time", 3.0)
    found = move(Metered(system), start, until, "energy", 1e-12)
    assert found.error < 1e-2
    assert found.cost.evaluations < FEW_SAMPLES
    assert agree(found, move(Metered(system), start, until, "dop853", 1e-9))


def test_a_run_shorter_than_the_first_step_does_not_agree_with_itself():
    """Two runs of one step each were the same, and their difference nothing."""
    system, start, until = fourbar(ONE_STEP), Start(1.8023520301473543, 0.0), Until("time", 0.76)
    exact = move(Metered(system), start, until, "energy", 1e-13)
    for target in TARGETS:
        assert agree(move(Metered(system), start, until, "dop853", target), exact)


def test_a_start_near_a_dead_centre_does_not_chase_the_rounding_of_the_kernels():
    system, start, until = fourbar(NOISY), Start(-2.548591190599865, 0.0), Until("time", 0.56)
    found = move(Metered(system), start, until, "energy", 1e-9)
    assert found.reached
    assert found.cost.evaluations < FEW_SAMPLES
    assert agree(found, move(Metered(system), start, until, "dop853", 1e-9))


def test_the_way_to_a_link_at_infinity_is_looked_at_no_farther_than_asked():
    found = moved("tangent_generator", RUNS["tangent_generator"][1][0], "energy", 1e-12)
    assert found.reached
    assert found.cost.evaluations < FEW_SAMPLES


def test_the_check_of_a_march_is_no_answer_if_its_own_panels_are_longer():
    run = Run(0.8847623623915073, -10.650329852634357, 1.9710918790515062)
    sweep("ruiz_fourbar ", run, "spectral", TARGETS)


# A chain of parallelograms is a pendulum: J q'' = -A cos q, J = 0.76875 kg m2, A = 36.7875 N m.
# Here q(0) = 1.047, q'(0) = 4.327; by Taylor series of order 24 in extended precision.
CHAIN = {
    0.05: 1.2370200347826649768,
    0.1: 1.3875712627962598765,
    0.15: 1.516146033376071472,
    0.2: 1.6381292853035146455,
}


@pytest.mark.parametrize("target", [1e-14, 1e-12, 1e-9])
def test_the_rounding_of_a_coordinate_is_in_the_estimate(target):
    """It was 5.3e-15 where the error is 5.5e-15."""
    found = moved("parallelogram_chain", Run(1.047, 4.327, 0.2), "energy", target)
    error = np.abs(found.at(np.array(list(CHAIN))).q - np.array(list(CHAIN.values()))).max()
    assert error <= found.error


@pytest.mark.parametrize(
    ("q", "rate", "span"), [(0.08165621220174851, 7.374616441766303, 1.508991091676002)]
)
def test_differences_as_large_as_the_way_show_no_order(q, rate, span):
    """Steps of rk4 so long that it is off by half a radian; the differences fell by 20."""
    system, start, until = linkages.watt(), Start(q, rate), Until("time", span)
    exact = move(Metered(system), start, until, "energy", 1e-12)
    assert agree(move(Metered(system), start, until, "rk4"), exact)


@pytest.mark.parametrize("q", [1.4933370530151056, 1.4933372146125636])
def test_rounding_that_grows_beside_an_unstable_equilibrium_counts_for_rk4(q):
    """Three runs with other steps agreed to 1e-14; what they shared had grown to 1e-12."""
    system, start, until = linkages.watt(), Start(q, 0.0), Until("time", 1.0515)
    exact = move(Metered(system), start, until, "dop853", 1e-12)
    found = move(Metered(system), start, until, "rk4")
    assert agree(found, exact)
    assert found.error > 1e-13


def test_energy_tells_the_error_up_to_the_time_asked_and_auto_goes_on_in_time():
    """A start so near an equilibrium that the energy's rounding decides when it leaves."""
    system, start = linkages.watt(), Start(1.49333, 0.0)
    errors, costs = [], []
    for span in (0.5, 3.0, 5.0):
        found = move(Metered(system), start, Until("time", span), "energy", 1e-12)
        errors.append(found.error)
    assert errors == sorted(errors)
    assert errors[0] < errors[-1] / 100
    for target in TARGETS[:3]:
        until = Until("time", 3.0)
        found = move(Metered(system), start, until, "auto", target)
        assert found.reached
        assert agree(found, move(Metered(system), start, until, "dop853", 1e-12))
        costs.append(found.cost.evaluations)
    assert costs == sorted(costs)
    assert found.method == "dop853"
    assert "by energy rounding leaves" in found.why


@pytest.mark.filterwarnings("error")
def test_a_stiff_run_has_an_error_that_is_a_number():
    """What decays within a step seemed to grow, and overflowed to no number."""
    data = json.loads((GRAPHS / "fivebar_falling.json").read_text("utf-8"))
    del data["expect"]
    damper = {"kind": "polynomial", "of": "rate", "coefficients": [0.0, -100.0]}
    for frame, driver in (("A", "left"), ("E", "right")):
        data["blocks"][f"{driver}_damper"] = {"type": "load.motor", "law": damper}
        ((link, _),) = data["blocks"][driver]["links"].items()
        data["wires"] += [
            {"from": f"frame.{frame}", "to": f"{driver}_damper.a"},
            {"from": f"{driver}.{link}", "to": f"{driver}_damper.b"},
        ]
    start = {"left": (1.2, 0.0), "right": (2.2, 0.0)}
    mech = loads(json.dumps(data)).compile()
    found, other = (
        mech.simulate("time=33", method=method, accuracy=1e-6, start=start).motion
        for method in ("dop853", "radau")
    )
    assert found.error < 1e-5
    assert agree(found, other)


def test_states_that_lsoda_did_not_come_to_are_not_handed_out(monkeypatch):
    """It leaves them as the memory was; then the run is made step by step."""
    system, start, until = linkages.watt(), Start(1.0, 0.0), Until("time", 3.0)
    exact = move(Metered(system), start, until, "energy", 1e-12)
    monkeypatch.setattr(replay, "MOST_STEPS", 3)
    found = move(Metered(system), start, until, "lsoda", 1e-6)
    assert found.reached
    assert agree(found, exact)


def test_an_unknown_time_of_a_dead_centre_is_unknown_and_not_no_number():
    run = Run(0.4990985557606928, 0.0, 0.342886892)
    found = moved("elliptic_trammel", run, "euler_q", None)
    assert found.end == "dead centre"
    assert found.time_error == math.inf


def test_damping_beside_large_loads_at_rest_is_not_lost():
    """It was told from the effort at a rate of 1, in which a large moment leaves no digit."""
    system = rod(motor(1.2345678e14, 0.987654321e8)).reduced
    start, until = Start(-1.0, 0.0), Until("time", 8e-8)
    by_poses = move(Metered(system), start, until, "rk4", 1e-11)
    for method in ("spectral", "dop853"):
        assert agree(move(Metered(system), start, until, method, 1e-11), by_poses)


def test_runs_of_a_step_or_two_are_not_believed_to_agree():
    """Beside an unstable equilibrium they were wrong by the same 5e-5, or 7e-3."""
    for name, run in (
        ("slider_crank_offset", Run(0.15006167642591964, 0.0, 0.16557286884728392)),
        ("andrews_squeezer", Run(-0.12456423277082912, 0.0, 0.021322747023621896)),
    ):
        exact = moved(name, run, "dop853", 1e-12)
        assert agree(moved(name, run, "radau", 1e-3), exact)


def test_where_no_table_serves_auto_does_not_pay_lsodas_evaluations():
    """At 1e-6 it took 826 poses by LSODA, at 1e-9 702 by DOP853."""
    data = json.loads((GRAPHS / "stephenson_3_triad.json").read_text("utf-8"))
    data.pop("expect", None)
    law = {"kind": "fourier", "of": "time", "period": 0.05, "mean": 1.0, "cosines": [4.0, 2.0]}
    data["blocks"]["push"] = {"type": "load.motor", "law": law}
    graph = bm.Graph.load(GRAPHS / "stephenson_3_triad.json").compile()
    (driver,) = graph.drivers
    (frame,) = [name for name, block in data["blocks"].items() if block["type"] == "frame"]
    marker = next(iter(data["blocks"][frame]["markers"]))
    link = graph.structure.blocks[driver].link_names[0]
    data["wires"] += [
        {"from": f"{frame}.{marker}", "to": "push.a"},
        {"from": f"{driver}.{link}", "to": "push.b"},
    ]
    mech, start = loads(json.dumps(data)).compile(), {driver: (-1.657, -12.427)}
    found = [
        mech.simulate("time=0.015", accuracy=target, start=start, friction="none").motion
        for target in TARGETS[:3]
    ]
    costs = [motion.cost.evaluations for motion in found]
    assert costs == sorted(costs)
    assert {motion.method for motion in found} == {"dop853"}


# crank, coupler, rocker, base [m] that come to a dead centre from beside an equilibrium
SLOW = (0.6978666058746417, 0.39870893549900593, 0.9786515930390014, 0.4748436190822351)


@pytest.mark.parametrize("target", TARGETS)
def test_a_series_beside_an_equilibrium_falls_slowly_and_its_end_counts_for_more(target):
    """At 1e-3 and 1e-6 the error was 2.5 times the estimate."""
    system = fourbar(SLOW)
    start, until = Start(1.4719618858233996, 2.514979407260259e-05), Until("time", 5.063)
    found = move(Metered(system), start, until, "energy", target)
    assert agree(found, move(Metered(system), start, until, "dop853", 1e-12))


@pytest.mark.parametrize(
    ("name", "run", "target"),
    [
        ("whitworth_shaper", Run(-0.4065048120624324, 0.0, 0.04108965154230994), 1e-3),
        ("parallelogram_chain", Run(-0.4535983199216289, 0.0, 0.5615088749787753), 1e-6),
    ],
)
def test_loose_steps_of_lsoda_are_daring(name, run, target):
    """Its error was 6.06 times the difference of two runs, and 8.01 times that of later ones."""
    exact = moved(name, run, "dop853", 1e-12)
    assert agree(moved(name, run, "lsoda", target), exact)


# crank, coupler, rocker, base [m]
TO_ITS_END = (1.0374947194278807, 1.0955154597462136, 0.5829853492165091, 1.2516675693260673)


def test_a_delay_of_the_end_is_an_error_of_the_place_beside_it():
    """rk4 was off by 6.0e-7 just before a dead centre, and said 3.2e-7."""
    system, start = fourbar(TO_ITS_END), Start(1.3677017033592052, 0.0)
    until = Until("time", 1.3980878796629537)
    exact = move(Metered(system), start, until, "energy", 1e-12)
    assert agree(move(Metered(system), start, until, "rk4", 1e-6), exact)


def with_laws(name, laws, frame="frame.O"):
    """A graph of the gallery with masses, no gravity, and motors between frame and driver."""
    plain = mechanism(name)
    (driver,) = plain.drivers
    data = plain.structure.blocks
    graph = json.loads((GRAPHS / f"{name}.json").read_text("utf-8"))
    del graph["expect"]
    for i, (block, given) in enumerate(data.items()):
        if graph["blocks"][block]["type"] != "frame":
            weight = {"mass": 1.0 + 0.3 * i, "inertia": 0.01, "cm": [0.05, 0.02]}
            links = graph["blocks"][block].setdefault("links", {})
            links |= {link: links.get(link, {}) | weight for link in given.link_names}
    for i, law in enumerate(laws):
        graph["blocks"][f"motor{i}"] = {"type": "load.motor", "law": law}
        graph["wires"] += [
            {"from": frame, "to": f"motor{i}.a"},
            {"from": f"{driver}.{data[driver].link_names[0]}", "to": f"motor{i}.b"},
        ]
    return loads(json.dumps(graph)).compile()


def test_the_widest_steps_are_compared_inside():
    """Its first step took a fiftieth of the time and half of the way, between times compared.

    What a campaign came upon: a motion so fast that gravity is nothing, over in 1e-16 s.
    """
    laws = [
        {"kind": "polynomial", "of": "rate", "coefficients": [0.0, -837581353364726.4]},
        {
            "kind": "fourier",
            "of": "time",
            "period": 7.503911794187734e-16,
            "mean": -1.2007388356949134e32,
            "cosines": [1.1016148926788213e31, 3.2979804196048577e31],
        },
    ]
    mech = with_laws("tangent_generator", laws)
    span = 4.764822728568018e-16
    request = {
        "method": "dop853",
        "start": {"lever": (3.0991524767035523, -1.097467852008847e16)},
        "times": np.linspace(0.0, span, 10)[1:],
    }
    found, exact = (
        mech.simulate(f"time={span!r}", accuracy=accuracy, **request).motion
        for accuracy in (1e-3, 1e-13)
    )
    assert agree(found, exact)


@pytest.mark.parametrize("steps", [150, 200, 333, 1000])
def test_rk4_does_not_take_runs_across_kinks_for_order_4(steps):
    """Differences of such runs are small by luck now and then: it was off by six times as much."""
    corners = {"arguments": [0.0, 0.377, 0.81, 1.3, 50.0], "values": [3.0, -4.0, 5.0, -2.0, 1.0]}
    law = {"kind": "table", "of": "time", "interpolation": "linear", **corners}
    scene, start = rod(law), {"crank": (0.3, 1.0)}
    exact = scene.simulate("time=1.6", method="dop853", accuracy=1e-12, start=start).motion
    found = scene.simulate("time=1.6", method="rk4", step=1.6 / steps, start=start).motion
    assert agree(found, exact)


def test_rk4_leaves_a_dead_centre_that_it_starts_beside():
    press = bm.Linkage.load(GRAPHS / "joints" / "floating_drive_press.json").compile()
    start = {press.drivers[0]: (0.8817793708641581, -21.15239946528852)}
    found, exact = (
        press.simulate("time=0.0164", method=method, start=start, friction="none").motion
        for method in ("rk4", "energy")
    )
    assert found.end == exact.end == "time"
    assert agree(found, exact)
