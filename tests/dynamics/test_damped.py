"""Damped motions, in time by ``dop853``, against closed forms and an implicit method."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

import blockmech as bm
from blockmech.dynamics.request import Start
from tests.dynamics.linkages import motored
from tests.dynamics.one_chart import in_one_chart
from tests.dynamics.synthetic import Synthetic, move
from tests.gallery import GRAPHS

TURN = 2 * math.pi


def damped_wheel(inertia=2.0, couple=3.0, damper=0.5):
    """J q'' = M - b q': the closed form is exponential."""

    def one(q, qd, t):
        return inertia, couple - damper * qd, 0.0, 1.0

    return Synthetic(one, depends_on=frozenset({"q", "rate"}))


@pytest.mark.parametrize("rate", [0.0, 1.0, 20.0])
def test_damped_wheel_is_exact(rate):
    motion = move(damped_wheel(), Start(0.0, rate), "time=9", "auto", 1e-11)
    t, tau, final = np.linspace(0.1, 9, 20), 4.0, 6.0
    fading = np.exp(-t / tau)
    coordinate = final * t + (rate - final) * tau * (1 - fading)
    state = motion.at(t)
    assert np.abs(state.q - coordinate).max() <= min(1e-11, motion.error)
    assert np.abs(state.qd - (final + (rate - final) * fading)).max() <= 1e-11


def test_motor_spring_and_damper_against_an_implicit_method():
    motion = move(motored(), Start(0.5), "time=1", "auto", 1e-9)
    implicit = move(motored(), Start(0.5), "time=1", "radau", 1e-8)
    times = np.linspace(0.1, 1, 15)
    difference = np.abs(motion.at(times).q - implicit.at(times).q).max()
    assert motion.method == "dop853"
    assert difference <= motion.error + implicit.error
    assert motion.error <= motion.accuracy


def test_turns_and_angles_are_met_exactly():
    motion = move(motored(), Start(0.5), "turns=2", "dop853", 1e-9)
    assert motion.q_end == pytest.approx(0.5 + 2 * TURN, abs=1e-12)
    implicit = move(motored(), Start(0.5), "turns=2", "radau", 1e-8)
    assert abs(motion.t_end - implicit.t_end) <= min(1e-10, motion.time_error + implicit.time_error)


def test_a_driver_that_swings_to_rest_is_followed_through_its_standstills():
    system = motored(stall=0.0, damper=0.5)
    motion = move(system, Start(1.0), "time=6", "dop853", 1e-8)
    implicit = move(system, Start(1.0), "time=6", "radau", 1e-7)
    stood = [[e.t for e in m.events if e.kind == "standstill"] for m in (motion, implicit)]
    assert len(stood[0]) == len(stood[1]) >= 2
    assert abs(motion.q_end - implicit.q_end) <= motion.error + implicit.error


# -- mechanisms --------------------------------------------------------------------------------


def _pump(blocks=None, wires=()):
    document = json.loads((GRAPHS / "pump.json").read_text("utf-8"))
    document["blocks"] |= blocks or {}
    document["wires"] += wires
    return bm.Graph.from_json(json.dumps(document)).compile()


BENT = {"kind": "polynomial", "of": "rate", "coefficients": [12.0, -0.12, 1e-4]}


@pytest.mark.parametrize("bent", [False, True])
def test_motors_whose_law_is_a_straight_line_or_bent(bent):
    mech = _pump(blocks={"motor": {"type": "load.motor", "law": BENT}} if bent else None)
    motion = mech.simulate("time=0.5", want=[]).motion
    implicit = mech.simulate("time=0.5", method="radau", accuracy=1e-9, want=[]).motion
    assert (motion.method, motion.reached) == ("dop853", True)
    t = np.linspace(0.0, 0.5, 51)
    assert np.abs(motion.at(t).q - implicit.at(t).q).max() <= motion.error + implicit.error
    assert motion.error <= 1e-9
    assert motion.facts["energy_balance"] <= 1e-9


def test_a_damper_that_moves_nothing_but_by_rounding_does_not_act():
    """Between a link and itself: what the rates leave of zero is no series to be resolved."""
    damper = {"type": "load.torsion_spring", "stiffness": 0.0, "damping": 0.7}
    wires = [{"from": "crank.crank", "to": f"idle.{end}"} for end in "ab"]
    plain, idle = _pump(), _pump(blocks={"idle": damper}, wires=wires)
    motions = [mech.simulate("time=0.3", want=[]).motion for mech in (plain, idle)]
    assert abs(motions[0].q_end - motions[1].q_end) <= motions[0].error


def test_dampers_up_to_a_dead_centre():
    """There the effort per rate grows like the inertia, without bound."""
    mech = _rocker()
    motion = in_one_chart(mech, "standstill")
    implicit = in_one_chart(mech, "standstill", method="radau", accuracy=1e-9)
    assert motion.method == "dop853"
    assert motion.end == implicit.end == "dead centre"
    straight = math.acos((0.3**2 + 0.5**2 - (0.2 + 0.35) ** 2) / (2 * 0.3 * 0.5))
    for end in (motion.q_end, implicit.q_end):
        assert abs(end - straight) <= 1e-5  # an integrator ends at a margin before it
    assert abs(motion.t_end - implicit.t_end) <= motion.time_error + implicit.time_error
    t = np.linspace(0, min(motion.t_end, implicit.t_end), 9)
    apart = np.abs(motion.at(t).q - implicit.at(t).q).max()
    assert apart <= motion.error + implicit.error
    assert motion.error <= 1e-9


def _rocker():
    """A four-bar whose driver cannot turn, with a damper at the coupler's pin and on the rocker."""
    link = {"mass": 1.0, "inertia": 0.02, "cm": [0.1, 0.0]}
    damper = {"type": "load.torsion_spring", "stiffness": 0.0, "damping": 0.05}
    markers = {
        "A": {"at": [0.0, 0.0]},
        "D": {"at": [0.5, 0.0]},
        "G": {"at": [0.0, 0.0], "angle": 0.0},
    }
    blocks = {
        "frame": {"type": "frame", "markers": markers},
        "crank": {"type": "driver.crank", "length": 0.3, "links": {"crank": link}},
        "dyad": {"type": "dyad.rrr", "l_i": 0.2, "l_j": 0.35, "branch": 1,
                 "links": {"i": link, "j": link}},
        "pin": damper,
        "base": damper,
    }  # fmt: skip
    wires = {"crank.A": "frame.A", "dyad.B": "crank.B", "dyad.D": "frame.D", "pin.a": "dyad.i",
             "pin.b": "dyad.j", "base.a": "frame.G", "base.b": "dyad.j"}  # fmt: skip
    document = {
        "format": "blockmech/graph", "version": 1, "name": "rocker", "blocks": blocks,
        "wires": [{"from": source, "to": to} for to, source in wires.items()],
        "scene": {"initial": {"crank": {"q": 0.9, "rate": 6.0}}},
    }  # fmt: skip
    return bm.Graph.from_json(json.dumps(document)).compile()


@pytest.mark.parametrize("damping", [1.0, 30.0, 1e3])
def test_however_strong_the_damping_an_implicit_method_agrees(damping):
    """From a few hundredths of the energy left after a turn to none at all after a degree."""
    brake = {"type": "load.torsion_spring", "stiffness": 0.0, "damping": damping}
    wires = [{"from": "frame.O", "to": "brake.a"}, {"from": "crank.crank", "to": "brake.b"}]
    mech = _pump(blocks={"brake": brake}, wires=wires)
    request = {"start": {"crank": (0.3, 40.0)}, "want": []}
    motion = mech.simulate("time=0.2", **request).motion
    implicit = mech.simulate("time=0.2", method="radau", accuracy=1e-9, **request).motion
    assert motion.reached
    assert motion.error <= 1e-9
    assert abs(motion.q_end - implicit.q_end) <= motion.error + implicit.error
