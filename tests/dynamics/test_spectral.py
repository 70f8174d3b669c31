"""Method ``spectral`` against integration and closed forms."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

import blockmech as bm
from blockmech.dynamics.panel_builder import PanelBuilder
from blockmech.dynamics.request import Start
from tests.dynamics.linkages import motored
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
    motion = move(damped_wheel(), Start(0.0, rate), "time=9", "spectral", 1e-11)
    t, tau, final = np.linspace(0.1, 9, 20), 4.0, 6.0
    fading = np.exp(-t / tau)
    place = final * t + (rate - final) * tau * (1 - fading)
    state = motion.at(t)
    assert np.abs(state.q - place).max() <= min(1e-11, motion.error)
    assert np.abs(state.qd - (final + (rate - final) * fading)).max() <= 1e-11


def test_motor_spring_and_damper_against_integration():
    motion = move(motored(), Start(0.5), "time=1", "auto", 1e-9)
    other = move(motored(), Start(0.5), "time=1", "dop853", 1e-11)
    times = np.linspace(0.1, 1, 15)
    difference = np.abs(motion.at(times).q - other.at(times).q).max()
    assert motion.method == "spectral"
    assert difference <= motion.error + other.error
    assert motion.error <= motion.accuracy


def test_turns_and_angles_are_met_exactly():
    motion = move(motored(), Start(0.5), "turns=2", "spectral", 1e-9)
    assert motion.q_end == pytest.approx(0.5 + 2 * TURN, abs=1e-12)
    other = move(motored(), Start(0.5), "turns=2", "dop853", 1e-11)
    assert abs(motion.t_end - other.t_end) <= 1e-10


def test_a_driver_that_swings_to_rest_is_followed_through_its_standstills():
    system = motored(stall=0.0, damper=0.5)
    motion = move(system, Start(1.0), "time=6", "spectral", 1e-8)
    other = move(system, Start(1.0), "time=6", "dop853", 1e-9)
    assert sum(e.kind == "standstill" for e in motion.events) >= 2
    assert abs(motion.q_end - other.q_end) <= motion.error + other.error


# -- loads that are straight lines in the rate ---------------------------------------------------


def _pump(blocks=None, wires=()):
    document = json.loads((GRAPHS / "pump.json").read_text("utf-8"))
    document["blocks"] |= blocks or {}
    document["wires"] += wires
    return bm.Graph.from_json(json.dumps(document)).compile()


def test_motor_and_dampers_ask_for_no_kernel_once_place_data_are_there():
    """Samples are those of a period's place data, at rest and at a rate, however long the run."""
    mech = _pump()
    mech.simulate("time=0.1", want=[])
    costs = [mech.simulate(f"time={span}", want=[]).motion.cost for span in (0.5, 2.0)]
    assert costs[0] == costs[1]
    assert costs[0].calls <= 4


def test_a_law_that_is_bent_in_the_rate_still_asks_the_kernels():
    law = {"kind": "polynomial", "of": "rate", "coefficients": [12.0, -0.12, 1e-4]}
    mech = _pump(blocks={"motor": {"type": "load.motor", "law": law}})
    along = mech.simulate("time=0.5", want=[]).motion
    other = mech.simulate("time=0.5", method="dop853", accuracy=1e-11, want=[]).motion
    assert along.cost.calls > 20
    assert abs(along.q_end - other.q_end) <= along.error + other.error


def test_a_damper_that_moves_nothing_but_by_rounding_does_not_act():
    """Between a link and itself: what the rates leave of zero is no series to be resolved."""
    damper = {"type": "load.torsion_spring", "stiffness": 0.0, "damping": 0.7}
    wires = [{"from": "crank.crank", "to": f"idle.{end}"} for end in "ab"]
    plain, idle = _pump(), _pump(blocks={"idle": damper}, wires=wires)
    found = [mech.simulate("time=0.3", want=[]).motion for mech in (plain, idle)]
    assert abs(found[0].q_end - found[1].q_end) <= found[0].error


def test_dampers_up_to_a_dead_centre():
    """There the effort per rate grows like the inertia, without bound."""
    mech = _rocker()
    along = mech.simulate(want=[]).motion
    other = mech.simulate(method="dop853", accuracy=1e-11, want=[]).motion
    assert along.method == "spectral"
    assert along.end == other.end == "dead centre"
    assert abs(along.q_end - other.q_end) <= 1e-5  # the integrator ends at a margin before it
    t = np.linspace(0, other.t_end, 9)
    apart = np.abs(along.at(t).q - other.at(t).q).max()
    assert apart <= along.error + other.error
    assert along.error <= 1e-9


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


def test_a_turn_under_motor_and_dampers_is_solved_as_a_whole(monkeypatch):
    """Place data say all that acts, so no panel is made by itself."""
    alone = []
    monkeypatch.setattr(PanelBuilder, "panel", lambda *given: alone.append(given))
    motion = _pump().simulate("time=0.5", want=[]).motion
    assert motion.reached
    assert not alone


@pytest.mark.parametrize("damping", [1.0, 30.0, 1e3])
def test_however_strong_the_damping_the_integrators_agree(damping):
    """From a few hundredths of the energy left after a turn to none at all after a degree."""
    brake = {"type": "load.torsion_spring", "stiffness": 0.0, "damping": damping}
    wires = [{"from": "frame.O", "to": "brake.a"}, {"from": "crank.crank", "to": "brake.b"}]
    mech = _pump(blocks={"brake": brake}, wires=wires)
    asked = {"start": {"crank": (0.3, 40.0)}, "want": []}
    along = mech.simulate("time=0.2", method="spectral", **asked).motion
    other = mech.simulate("time=0.2", method="radau", accuracy=1e-9, **asked).motion
    assert along.reached
    assert abs(along.q_end - other.q_end) <= along.error + other.error
