"""`verify` catches every single mistake of a table, and none where there is none."""

import json
import os
from functools import cache

import pytest

import blockmech as bm
from blockmech.testing.strategies import EVERY, Options, Seeded, random_mechanism
from tests.gallery import GRAPHS, SHORT
from tests.mutations.mutations import MUTATIONS, made

ALL = Options(groups=(1, 4), drivers=(1, 3), kinds=EVERY, twists=True)
SEEDS = int(os.environ.get("BLOCKMECH_EXAMPLES", "12"))
COULOMB = {"law": "coulomb", "coefficient": 0.1}
BENCH = {
    "twist": {"type": "load.torsion_spring", "stiffness": 30.0, "rest_angle": 0.4, "damping": 2.0},
    "servo": {"type": "load.motor", "law": {"kind": "polynomial", "coefficients": [3.0, 2.0]}},
    "shock": {
        "type": "load.thrust",
        "direction": [0.0, 2.0],
        "law": {"kind": "polynomial", "of": "rate", "coefficients": [0.0, -40.0, 7.0]},
    },
    "cushion": {
        "type": "load.thrust",
        "direction": [3.0, 0.0],
        "law": {"kind": "polynomial", "coefficients": [5.0, -90.0]},
    },
    "shaker": {
        "type": "load.thrust",
        "direction": [1.0, 0.0],
        "law": {"kind": "fourier", "of": "time", "cosines": [60.0], "period": 0.7},
    },
}
BENCH_WIRES = (
    ("frame.frame", "twist.a"),
    ("crank.crank", "twist.b"),
    ("crank.crank", "servo.a"),
    ("lever.j", "servo.b"),
    ("crank.A", "shock.a"),
    ("lever.T", "shock.b"),
    ("frame.G", "cushion.a"),
    ("ram.C", "cushion.b"),
    ("frame.G", "shaker.a"),
    ("lever.T", "shaker.b"),
)
LOSSY = (
    "rack_leads",
    *(
        f"lossy {name}"
        for name in ("rack_leads", "planetary_hoist", "rack_gripper", "valve_engine")
    ),
)
RACK = {
    "format": "blockmech/graph",
    "version": 1,
    "name": "rack and pinion",
    "blocks": {
        "frame": {
            "type": "frame",
            "markers": {"A": {"at": [0, 0]}, "G": {"at": [0.1, -0.02], "angle": 0.0}},
        },
        "pinion": {"type": "driver.crank", "links": {"crank": {"inertia": 1e-4}}},
        "rack": {"type": "driver.slide", "links": {"slider": {"mass": 2.0, "cm": [0.1, 0.02]}}},
        "mesh": {
            "type": "coupling.rack",
            "driver": "pinion",
            "driven": "rack",
            "radius": 0.02,
            "pressure_angle": 0.3,
        },
    },
    "wires": [{"from": "frame.A", "to": "pinion.A"}, {"from": "frame.G", "to": "rack.S"}],
    "scene": {"gravity": [-3.0, -9.81], "initial": {"pinion": {"q": 0.3}}},
}

CARRIED = {
    "format": "blockmech/graph",
    "version": 1,
    "name": "slide on a crank",
    "blocks": {
        "frame": {"type": "frame", "markers": {"A": {"at": [0, 0]}}},
        "crank": {"type": "driver.crank", "length": 0.5, "links": {"crank": {"inertia": 0.2}}},
        "slide": {"type": "driver.slide", "links": {"slider": {"mass": 2.0, "cm": [0.1, 0.02]}}},
    },
    "wires": [{"from": "frame.A", "to": "crank.A"}, {"from": "crank.B", "to": "slide.S"}],
    "scene": {"initial": {"crank": {"q": 0.3}, "slide": {"q": 0.2}}},
}

LADEN = {"bench": "whitworth_shaper", "trammel": "elliptic_trammel", "oldham": "oldham_coupling"}
MADE = {"rack_leads": RACK, "carried": CARRIED}

SINE = {"law": "harmonic", "mean": 1.2, "amplitude": 0.3, "frequency": 1.5}
BOTH = {"left": {"q": 1.2, "rate": 3.0}, "right": {"q": 1.9, "rate": 1.5}}
SCENES = {
    "shaken": (
        "fivebar_falling",
        {
            "drive": {"left": SINE, "right": SINE | {"mean": 1.9}},
            "initial": {"right": {"q": 1.9, "rate": 1.5}},
        },
    ),
    "braked": (
        "slider_crank",
        {"drive": {"crank": {"law": "rate_acceleration", "rate": 3.0, "acceleration": -0.5}}},
    ),
    "bouncing": (
        "fivebar_falling",
        {"initial": BOTH, "stops": {"left": {"to": 1.3, "restitution": 0.6}}},
    ),
    "rough": (
        "fivebar_falling",
        {"initial": BOTH, "stops": {"left": {"to": 1.3, "restitution": 0.6}}},
    ),
    "cycloidal": ("couplings/indexing_table", {}),
    "struck": ("hammer", {"initial": {"hammer": {"q": 0.2, "rate": -1.0}}}),
    "held": ("motions/sticking_slider", {"initial": {"slider": {"q": 0.1, "rate": 0.0}}}),
}
"""A graph of the gallery in another scene."""
DERIVED = ("ruiz_fourbar", "slider_crank", "bench", "couplings/indexing_table")
MOVING = ("shaken", "bouncing", "rough", "struck", "held", "control/speed_controlled_pump")


def with_masses(block, *links):
    """A block of a document whose links have mass."""
    heavy = {"mass": 2.0, "inertia": 0.1, "cm": [0.1, 0.02]}
    given = block.get("links", {})
    return block | {"links": given | {link: given.get(link, {}) | heavy for link in links}}


@cache
def document(name):
    """A graph of the gallery as data; the bench is a shaper with every kind of load.

    The couplings of one that is lossy have an efficiency, its cams friction.
    """
    if name.startswith("lossy "):
        data = json.loads(json.dumps(document(name.removeprefix("lossy "))))
        for block in data["blocks"].values():
            if block["type"] in ("coupling.gear", "coupling.rack", "coupling.belt"):
                block["efficiency"] = 0.8
            elif block["type"] == "coupling.cam":
                block["friction"] = 0.1
        return data | {"expect": []}
    if name in MADE:
        return MADE[name]
    known = LADEN.get(name, name)
    known = SCENES[name][0] if name in SCENES else known
    data = json.loads((GRAPHS / f"{known}.json").read_text("utf-8"))
    blocks = data["blocks"]
    if name in SCENES:
        data["scene"] |= SCENES[name][1]
    if name == "rough":
        for driver in ("left", "right"):
            blocks[driver]["friction"] = {"A": COULOMB | {"radius": 0.02}}
    if name == "cycloidal":
        for segment in blocks["cam"]["law"]["segments"][::2]:
            segment["motion"] = "cycloidal"
    if name == "held":
        blocks["slider"]["friction"] = {"S": COULOMB | {"coefficient": 2.0}}
    if name == "trammel":
        blocks["bar"] = with_masses(blocks["bar"], "i", "j")
    if name == "oldham":
        blocks["disc"] = with_masses(blocks["disc"], "i", "j")
    if name == "bench":
        rubbed = {"S": COULOMB | {"guide_length": 0.05}, "C": COULOMB | {"radius": 0.02}}
        blocks["ram"] |= {"h": 0.02, "x_S": 0.05, "friction": rubbed}
        blocks["lever"] |= {"h_i": 0.03, "slider": "i", "x_S": 0.02}
        blocks |= {name: with_masses(blocks[name], "i", "j") for name in ("ram", "lever")} | BENCH
        data["wires"] += [{"from": a, "to": b} for a, b in BENCH_WIRES]
    return data | {"expect": []} if known != name else data


def checked(name, samples=4):
    """The verification of a graph, at a few samples of its law, or of places about its start."""
    moving, name = name.startswith("moving "), name.removeprefix("moving ")
    derived, name = name.startswith("derived "), name.removeprefix("derived ")
    mechanism = bm.Graph.from_json(json.dumps(document(name))).compile()
    if moving:  # by plain Python: machine code that is kept does not know of mistakes
        roles = {"left": "prescribed"} if name == "shaken" else {}
        return mechanism.verify(mechanism.simulate("time=0.2", roles=roles, engine="scalar"))
    if derived:
        output = f"{mechanism.drivers[0]}.drive"
        return mechanism.verify(mechanism.sensitivity(output, samples=samples))
    if mechanism.scene.drive:
        return mechanism.verify(samples=samples)
    starts = {d: mechanism.scene.initial[d].q for d in mechanism.drivers}
    at = {d: [q + 0.05, q + 0.4] for d, q in starts.items()}
    return mechanism.verify(at=at, rates=dict.fromkeys(at, 2.0))


OTHERS = ("bench", "trammel", "oldham", "carried", "shaken", "braked", "cycloidal")


@pytest.mark.parametrize("name", [*SHORT, *LOSSY, *OTHERS])
def test_right_graph_is_verified(name):
    result = checked(name)
    assert result.ok, str(result)


@pytest.mark.parametrize("name", MOVING)
def test_right_motion_is_verified(name):
    result = checked(f"moving {name}")
    assert result.ok, str(result)


@pytest.mark.parametrize("name", DERIVED)
def test_right_derivatives_are_verified(name):
    report = checked(f"derived {name}")
    assert report.ok, str(report)
    assert len(report.rows) > 5


@pytest.mark.parametrize("mutation", MUTATIONS, ids=lambda m: m.what.replace(" ", "_"))
def test_a_mistake_is_caught(mutation):
    with made(mutation):
        result = checked(mutation.graph)
    assert not result.ok, str(result)


def test_the_package_is_whole_again_after_a_mistake():
    mutation = MUTATIONS[0]
    with made(mutation):
        assert not checked(mutation.graph).ok
    assert checked(mutation.graph).ok


@pytest.mark.parametrize("seed", range(SEEDS))
def test_random_mechanism_is_verified(seed):
    case = random_mechanism(Seeded(seed), ALL)
    mechanism = case.graph.compile()
    verification = mechanism.verify(**case.request)
    if verification.samples == 0:  # no friction solution
        verification = mechanism.verify(**case.request, friction="none")
    assert verification.ok, f"seed {seed}: {verification}"
