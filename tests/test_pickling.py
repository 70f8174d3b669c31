"""Mechanisms and results go to other processes and come back with the same bits."""

import os
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import blockmech as bm
from blockmech.builders import opened
from blockmech.dynamics.request import Watch
from blockmech.result.result import Result
from tests.machines import ruiz, wire
from tests.wiring import same_bits

ROOT = Path(__file__).resolve().parents[1]
GRAPHS = ROOT / "graphs"

MECHANISMS = [
    "ruiz_fourbar",  # friction
    "stephenson_3_triad",  # a general group
    "floating_drive_press",  # a general group with a drive inside
    "parallelogram_chain",  # branches that follow the motion
    "excavator",  # several drivers, moved by laws of time
    "joints/engine",  # names of links and joints
    "joints/scissor_lift",  # both
]


def copied(thing):
    """What comes out of a pickle of it."""
    return pickle.loads(pickle.dumps(thing))


def compiled(name):
    """The mechanism in a file of the gallery."""
    return opened(GRAPHS / f"{name}.json").compile()


@pytest.mark.parametrize("name", MECHANISMS)
def test_a_copied_mechanism_and_a_copied_result_have_the_same_bits_and_say_the_same(name):
    mechanism = compiled(name)
    result = mechanism.run(samples=7, on_gap="mark")  # its plans are compiled by now
    duplicate, again = copied(mechanism), copied(result)
    assert repr(duplicate) == repr(mechanism)
    assert duplicate.drivers == mechanism.drivers
    assert list(duplicate.outputs) == list(mechanism.outputs)
    assert list(again) == list(result)
    for run in (again, duplicate.run(samples=7, on_gap="mark")):
        assert same_bits(result, run) == []
    assert again.quality.status == result.quality.status
    assert again.to_dict() == result.to_dict()
    assert str(again) == str(result)
    assert repr(again) == repr(result)


@pytest.mark.parametrize("engine", ["scalar", "numpy"])
def test_a_result_that_was_read_is_copied_as_well(engine):
    result = ruiz().run(at=[0.0, 1.0], engine=engine)
    assert result.quality.status == ("ok", "ok")
    again = copied(copied(result))
    assert same_bits(result, again) == []
    assert same_bits(result.rerun("dyad.C.p"), again.rerun("dyad.C.p")) == []


def test_a_copied_result_of_links_and_joints_still_looks_inside():
    result = compiled("joints/engine").run(samples=5)
    assert same_bits(result._inside("*"), copied(result)._inside("*")) == []


def test_what_was_chosen_for_an_accuracy_is_copied():
    result = ruiz().compile().run(samples=5, accuracy=1e-6)
    assert copied(result).accuracy == result.accuracy


def test_a_graph_that_was_compiled_is_copied_without_its_kernels():
    graph = bm.Graph.load(GRAPHS / "stephenson_3_triad.json")
    result = graph.run(samples=3)
    assert same_bits(result, copied(graph).run(samples=3)) == []


READ = """
import pickle, sys
import numpy as np
mechanism, result = pickle.load(sys.stdin.buffer)
again = mechanism.run(samples=7, on_gap="mark")
pickle.dump([{n: np.asarray(r[n]) for n in r} for r in (result, again)], sys.stdout.buffer)
"""


@pytest.mark.parametrize("name", ["ruiz_fourbar", "joints/scissor_lift"])
def test_another_process_reads_and_computes_the_same_bits(name):
    result = compiled(name).run(samples=7, on_gap="mark")
    read = subprocess.run(
        [sys.executable, "-c", READ],
        input=pickle.dumps((result.mechanism, result)),
        capture_output=True,
        check=True,
        cwd=ROOT,
        env={**os.environ, "PYTHONHASHSEED": "7"},  # sets there have another order
    )
    for answer in pickle.loads(read.stdout):
        assert same_bits(result, answer) == []


def test_numbers_in_another_order_are_refused_and_not_read_as_if_they_were_not():
    result = ruiz().run(at=0.0)
    state = result.__getstate__()
    want, layout = state["_planned"]
    moved = {name: tuple(i + 1 for i in where) for name, where in layout.items()}
    again = object.__new__(Result)
    again.__setstate__({**state, "_planned": (want, moved)})
    with pytest.raises(bm.RequestError, match=r"\[other-version\] ruiz_fourbar: .* run it again"):
        again["crank.drive"]


# ---- loads by functions ------------------------------------------------------------------


def braking(rate):
    """Moment of a fan [N m]."""
    return -0.3 * rate * abs(rate)


def fanned(law):
    """The four-bar with a load by a function on its crank."""
    graph = ruiz(radius=0.0)
    graph.add("fan", bm.Motor(law=law))
    return wire(graph, "frame.A fan.a", "crank.crank fan.b")


def test_a_load_by_a_named_function_is_copied():
    result = fanned(braking).run(at=[0.0, 1.0])
    again = copied(result)
    assert same_bits(result, again) == []
    assert same_bits(result, again.mechanism.run(at=[0.0, 1.0])) == []


def test_a_load_by_a_lambda_is_refused_by_python_itself():
    result = fanned(lambda rate: -0.3 * rate).run(at=[0.0, 1.0])
    with pytest.raises((pickle.PicklingError, AttributeError), match="lambda"):
        pickle.dumps(result)


# ---- motions -----------------------------------------------------------------------------

UNTIL = "time=0.5"
MOTIONS = {
    "a swing, by quadrature": ("watt_sixbar", {"until": "swings=2"}),
    "turns, by quadrature": ("watt_sixbar", {"until": "turns=2", "start": {"crank": (1.0, -30.0)}}),
    "through change points": ("n_four_bar", {"until": UNTIL}),
    "dop853": ("watt_sixbar", {"until": UNTIL, "method": "dop853"}),
    "loads of the rate": ("pump", {"until": UNTIL}),
    "radau to an event": ("watt_sixbar", {"method": "radau"}),
    "radau": ("watt_sixbar", {"until": "time=0.1", "method": "radau"}),
    "rk4": ("watt_sixbar", {"until": UNTIL, "method": "rk4"}),
    "euler_q": ("watt_sixbar", {"until": "swings=1", "method": "euler_q"}),
    "a steady rotation": ("pump", {"until": "steady"}),
    "several drivers": ("fivebar_falling", {"until": "time=0.3"}),
    "links and joints": ("joints/fivebar_falling", {"until": "time=0.3"}),
    "coordinates of the document": ("joints/watt_sixbar", {"until": "swings=1"}),
    "to an event of the user": (
        "watt_sixbar",
        {"until": "event", "watch": [Watch("low", lambda t, q, rate: q + 1.0)]},
    ),
}


@pytest.mark.parametrize("name", MOTIONS)
def test_a_copied_motion_is_the_same_at_any_time(name):
    file, request = MOTIONS[name]
    result = compiled(file).simulate(**request)
    again = copied(result)
    motion = result.motion
    t = np.linspace(motion.t_start, motion.t_end, 77)  # none of the 201 output times but the ends
    assert np.array_equal(again.motion.at(t), motion.at(t))
    assert same_bits(result, again) == []
    assert again.to_dict() == result.to_dict()
    assert repr(again.motion) == repr(motion)


def test_other_outputs_of_a_copied_motion_are_computed_at_its_times():
    result = compiled("watt_sixbar").simulate("time=0.2", method="dop853")
    assert same_bits(result.rerun("*"), copied(result).rerun("*")) == []
