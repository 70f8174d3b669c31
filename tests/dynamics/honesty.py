"""Motions of every graph of the gallery with one driver, and whether their estimates hold.

The truth is the finest run of what `auto` takes: `energy` (conservative scenes) or DOP853; what
makes it trustworthy is that a method of another kind agrees with it within the sum of both
estimates, which shares the kernels only: DOP853 beside `energy`, Radau beside DOP853 (of places
without inertia there is a closed form in `test_massless_places`).
"""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

import blockmech as bm
from tests.doors import graph_of as loads
from tests.dynamics.one_chart import in_one_chart

GRAPHS = Path(__file__).resolve().parents[2] / "graphs"

DEAR = (  # a pose takes a millisecond
    "n_four_bar",
    "stephenson_3_triad",
    "stephenson_2_class_4",
    "scissor_lift",
    "floating_drive_press",
)
TARGETS = (1e-3, 1e-9)
FINEST = 1e-14  # target of the reference: it gets as near as the data allow
FINE = 1e-12  # of a dear one: it gets to 1e-14 as well
SECOND = 1e-9  # of the second method
REQUESTED, BETWEEN = 9, 41  # times asked for, which count in an estimate, and others


class Run(NamedTuple):
    """Start of the only driver [rad or m, per s] and length of the run [s]."""

    q: float
    rate: float
    span: float


# Gravity and masses are added where a graph has none: ("gravity", "masses").
RUNS: dict[str, tuple[tuple[str, ...], list[Run]]] = {
    "watt_sixbar": ((), [Run(1.5, 0.0, 2.5), Run(5.1028, 0.0, 2.8), Run(0.5, 15.0, 1.0)]),
    "andrews_squeezer": ((), [Run(-0.0617, 0.0, 0.03), Run(2.0, -300.0, 0.02)]),
    "engine": ((), [Run(0.3, 150.0, 0.05), Run(2.4502, 0.0, 0.06)]),
    "pump": ((), [Run(0.0, 0.0, 0.3), Run(2.9638, -149.25, 0.045)]),
    "n_four_bar": ((), [Run(-0.3, 0.0, 1.0)]),
    "parallelogram_chain": ((), [Run(1.0, 0.0, 0.2)]),
    "oldham_coupling": ((), [Run(1.0, 20.0, 0.1)]),
    "oldham_coupling ": (("gravity",), [Run(4.1327, -9.1719, 0.06), Run(1.7, 0.0, 0.15)]),
    "ruiz_fourbar": ((), [Run(5.92, 1.09, 5.0)]),
    "ruiz_fourbar ": (("gravity",), [Run(1.0, 0.0, 4.0), Run(4.78, -15.4, 0.5)]),
    "scotch_yoke": ((), [Run(0.3, -40.0, 0.01), Run(4.3184, 0.0, 0.04)]),
    "stephenson_3_triad": ((), [Run(0.0, 20.0, 0.03)]),
    "stephenson_2_class_4": ((), [Run(3.1, 0.0, 0.05)]),
    "scissor_lift": ((), [Run(1.9, 0.0, 0.04)]),
    "floating_drive_press": ((), [Run(0.7, 0.0, 0.01)]),
    "stephenson_3": ((), [Run(2.6076, 0.2368, 2.6), Run(0.3, 12.0, 0.8)]),
    "toggle_press": ((), [Run(1.0, 0.0, 0.1), Run(0.5, 30.0, 0.05)]),
    "elliptic_trammel": (
        ("gravity", "masses"),
        [Run(0.2134, 0.0, 0.575), Run(-0.1155, -3.8787, 0.565)],
    ),
    "slider_crank": (("gravity", "masses"), [Run(1.41, 189.2, 0.09), Run(0.5, 0.0, 0.1)]),
    "slider_crank_offset": (("gravity", "masses"), [Run(1.0618, -4.4726, 0.043)]),
    "stribeck_slider_crank": ((), [Run(0.7, 9.0, 1.2), Run(3.0, 0.0, 0.6)]),
    "tangent_generator": (("gravity", "masses"), [Run(1.2, 3.0, 0.05)]),
    "geared_fivebar": ((), [Run(0.3, 0.0, 1.0), Run(1.0, 5.0, 0.5)]),
    "planetary_hoist": ((), [Run(0.0, 10.0, 1.0)]),
    "hammer": ((), [Run(1.2, 0.0, 0.4)]),
    "valve_engine": ((), [Run(0.5, 120.0, 0.1)]),
    "rack_gripper": ((), [Run(0.0, 0.05, 0.02)]),
    "whitworth_shaper": (("gravity", "masses"), [Run(2.4, 360.0, 0.0176), Run(5.24, -5.5, 0.03)]),
}


@cache
def mechanism(name):
    """The graph with what it lacks to move: gravity, or masses of the links as well."""
    added = RUNS[name][0]
    path = GRAPHS / f"{name.strip()}.json"
    data = json.loads(path.read_text("utf-8"))
    if "gravity" in added:
        data["scene"]["gravity"] = [0.0, -9.81]
    if "masses" in added:
        blocks = bm.Graph.load(path).compile().structure.blocks
        for i, (block, given) in enumerate(blocks.items()):
            if data["blocks"][block]["type"] == "frame":
                continue
            links = data["blocks"][block].setdefault("links", {})
            for link in given.link_names:
                weight = {"mass": 1.0 + 0.3 * i, "inertia": 0.01, "cm": [0.05, 0.02]}
                links[link] = links.get(link, {}) | weight
    return loads(json.dumps(data)).compile()


def moved(name, run, method, accuracy, step=None, *, alone=False):
    """The motion; ``alone`` in the chart of its driver, up to where no pose is ahead of that."""
    mech = mechanism(name)
    (driver,) = mech.drivers
    until, asked = f"time={run.span!r}", {"method": method, "accuracy": accuracy}
    if step is not None:
        asked["method"] = bm.FixedStep(method, step)
    asked["times"] = np.linspace(0.0, run.span, REQUESTED + 1)[1:]
    asked |= {"start": {driver: (run.q, run.rate)}, "friction": "none"}
    if alone:
        return in_one_chart(mech, until, **asked)
    return mech.simulate(until, want=[f"{driver}.q"], **asked).motion


def apart(a, b):
    """Largest difference of two motions, as far as both go: at times requested and others."""
    end = min(a.t_end, b.t_end)
    t = np.concatenate([np.linspace(0.0, end, BETWEEN + 1)[:-1], [end * (1 - 1e-15)]])
    return float(np.abs(a.at(t).q - b.at(t).q).max())


@cache
def reference(name, run, alone=False):
    """The finest motion there is, believed because another kind of method agrees."""
    finest = moved(name, run, "auto", FINE if name in DEAR else FINEST, alone=alone)
    other = "radau" if finest.method == "dop853" else "dop853"
    second = moved(name, run, other, SECOND, alone=alone)
    assert finest.end == second.end
    assert apart(finest, second) <= finest.error + second.error
    assert abs(finest.t_end - second.t_end) <= finest.time_error + second.time_error
    return finest


def assert_honest(motion, truth):
    assert motion.end == truth.end
    assert apart(motion, truth) <= motion.error + truth.error
    if truth.end != "time":
        assert abs(motion.t_end - truth.t_end) <= motion.time_error + truth.time_error
    if motion.accuracy is not None and not motion.error <= motion.accuracy:
        assert any("accuracy not reached" in note for note in motion.notes)


def assert_honest_at_all(name, run, method, targets):
    """Honest at every target; fixed steps end where the chart does."""
    truth = reference(name, run, method == "rk4")
    for target in targets:
        assert_honest(moved(name, run, method, target), truth)


def agree(a, b):
    """Whether two motions are as near as their estimates say."""
    return apart(a, b) <= a.error + b.error
