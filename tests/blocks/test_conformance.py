"""Every registered block keeps its contract, and the suite notices blocks that do not."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import pytest

import blockmech as bm
from blockmech.blocks.block import REGISTRY
from blockmech.blocks.rrp import acceleration as rrp_acceleration
from blockmech.blocks.rrp import reactions as rrp_reactions
from blockmech.blocks.rrp import velocity as rrp_velocity
from blockmech.blocks.rrr import position as rrr_position
from blockmech.blocks.rrr import reactions as rrr_reactions
from blockmech.blocks.rrr import velocity as rrr_velocity
from blockmech.ground.plane import hyp, maximum, mul, where
from blockmech.ground.values import Number
from blockmech.loads.contract import Element, Terminal
from blockmech.testing.conformance import ConformanceError, conformance
from blockmech.typing import LinkPosition, Slide

RATE = {"kind": "polynomial", "of": "rate", "coefficients": [1.0, -2.0]}
LINE = {"kind": "polynomial", "coefficients": [0.0, 1.0]}
CONSTANT = {"kind": "constant", "value": 2.0}
TURNS = {"kind": "table", "arguments": [0.0, 2.0], "values": [1.0, 3.0], "turns": 1}
WAVES = {"kind": "fourier", "of": "time", "period": 0.7, "sines": [1.0, 2.0]}

# Both branches, all offsets, sliders' points on either link.
EXAMPLES = {
    "frame": [{}],
    "driver.crank": [{"length": 2.0}, {"offset": 0.3}],
    "driver.slide": [{"offset": 0.2}, {"offset": -0.4, "slider": "earlier"}],
    "dyad.rrr": [
        {"l_i": 3.0, "l_j": 4.0},
        {"l_i": 0.2, "l_j": 0.05, "branch": -1},
    ],
    "dyad.rrp": [
        {"l": 3.0, "h": 0.4, "x_S": 0.5},
        {"l": 0.1, "h": 0.3, "x_S": -0.2, "branch": -1, "slider": "earlier"},
    ],
    "dyad.rpr": [
        {},
        {"h_i": 0.3, "h_j": -0.2, "x_S": 0.4},
        {"h_i": 0.3, "h_j": 0.1, "x_S": -0.6, "branch": -1, "slider": "i"},
    ],
    "dyad.prp": [
        {},
        {"h1": 0.3, "h2": -0.2, "x_S1": 0.4, "x_S2": -0.3},
        {"h1": 2.0, "h2": 1.0, "slider": {"S1": "earlier", "S2": "earlier"}},
    ],
    "dyad.rpp": [
        {"beta": 1.5707963267948966},
        {"beta": -0.7, "h_i": 0.3, "h_j": -0.2, "x_S1": 0.4, "x_S": -0.3},
        {"beta": 2.5, "h_i": 0.3, "x_S1": 1.4, "slider": {"S1": "i", "S": "earlier"}},
    ],
    "driven.rrr": [
        {"l_j": 3.0, "branch": -1, "x_S": 0.4},
        {"l_j": 0.2, "x_S": -0.2, "slider": "i"},
    ],
    "load.force": [
        {"force": (1.0, 2.0)},
        {"force": (1.0, 2.0), "axes": "link"},
        *(
            {"direction": (1.0, 2.0), "law": law, "axes": axes}
            for axes in ("ground", "link")
            for law in (LINE, RATE)
        ),
    ],
    "load.couple": [{"moment": 2.0}],
    "load.spring": [
        {"stiffness": 5.0, "free_length": 0.3},
        {"stiffness": 5.0, "free_length": 0.3, "damping": 2.0},
        {"stiffness": 5.0, "damping": 2.0},
        {"stiffness": 0.0, "free_length": 0.3, "damping": 2.0},
    ],
    "load.torsion_spring": [
        {"stiffness": 3.0, "rest_angle": 0.2},
        {"stiffness": 3.0, "rest_angle": 0.2, "damping": 2.0},
        {"stiffness": 0.0, "damping": 2.0},
    ],
    "load.motor": [
        {"law": CONSTANT},
        {"law": RATE},
        {"law": LINE, "driver": "any"},
        {"law": {"kind": "dc", "stall_moment": 2.0, "no_load_speed": 9.0}},
        {"law": WAVES},
    ],
    "load.thrust": [
        {"law": CONSTANT},
        {"law": RATE},
        {"law": LINE, "direction": (1.0, 2.0)},
        {"law": RATE, "direction": (1.0, 2.0)},
        {"law": TURNS, "driver": "any"},
    ],
}
ENDS = {"driver": "first", "driven": "second"}
LIFT = {
    "kind": "segments",
    "start": -0.1,
    "segments": [
        {"motion": "modified_sine", "over": 0.7, "rise": 0.02},
        {"motion": "dwell", "over": 0.1},
        {"motion": "4-5-6-7", "over": 2.0, "rise": -0.02},
    ],
}
ROWS = {"arguments": [-1.0, 0.0, 1.0, 2.0, 3.0, 4.0], "values": [0.0, 0.1, 0.3, 0.2, 0.1, 0.05]}
EXAMPLES |= {
    "coupling.gear": [
        {**ENDS, "teeth": (20, 30), "phase": 0.4},
        {**ENDS, "teeth": (60, 18), "internal": True, "pressure_angle": 0.35},
        {**ENDS, "teeth": (18, 60), "internal": True, "pressure_angle": 0.35},
        {**ENDS, "teeth": (20, 30), "pressure_angle": 0.35, "efficiency": 0.7},
    ],
    "coupling.rack": [
        {**ENDS, "radius": 0.1, "pressure_angle": 0.3},
        {**ENDS, "radius": 0.1, "side": -1, "phase": 0.2, "efficiency": 0.9},
    ],
    "coupling.belt": [
        {**ENDS, "radii": (0.1, 0.2), "preload": 500.0},
        {**ENDS, "radii": (0.1, 0.2), "crossed": True},
        {**ENDS, "radii": (0.1, 0.2), "preload": 500.0, "efficiency": 0.95},
    ],
    "coupling.ratio": [
        {**ENDS, "law": {"kind": "polynomial", "coefficients": [0.1, 0.5, 0.3]}},
        {**ENDS, "law": LIFT, "phase": 0.1},
        {**ENDS, "law": {"kind": "polynomial", "coefficients": [0.1, 0.5, 0.3]}, "efficiency": 0.6},
        {**ENDS, "law": {"kind": "table", **ROWS, "period": 6.0}},
        {**ENDS, "law": {"kind": "table", **ROWS, "interpolation": "quintic"}},
    ],
    "coupling.geneva": [
        {**ENDS, "slots": 6},
        {**ENDS, "slots": 4, "pin": 0.4},
        {**ENDS, "slots": 5, "internal": True, "efficiency": 0.8},
    ],
    "coupling.cam": [
        {**ENDS, "law": LIFT, "phase": 0.4, "at": (1.0, 0.2)},
        {
            **ENDS,
            "law": LIFT,
            "phase": 0.4,
            "at": (1.0, 0.2),
            "follower": "roller",
            "roller": 0.1,
            "friction": 0.05,
        },
        {
            **ENDS,
            "law": LIFT,
            "phase": 0.4,
            "at": (1.3, 0.2),
            "follower": "flat",
            "face": -0.1,
            "friction": 0.05,
        },
    ],
}
CASES = [
    pytest.param(name, example, id=f"{name} {example}")
    for name, examples in EXAMPLES.items()
    for example in examples
]


def test_every_block_of_the_package_has_an_example_here():
    own = {n for n in REGISTRY if REGISTRY[n].__module__.startswith("blockmech.")}
    # A general group has its joints by instance and needs a home: see test_general. Signals have
    # their examples in tests/signals; what is inside of a graph has its own.
    elsewhere = {n for n in own if n.startswith("signal.")} | {"group.general", "graph"}
    assert own - elsewhere == set(EXAMPLES)


@pytest.mark.parametrize(("name", "example"), CASES)
def test_block_keeps_its_contract(name, example):
    report = conformance(name, example)
    assert report.name == name
    assert report.measured or name == "frame"


def test_report_tells_what_was_measured():
    text = str(conformance("dyad.rrp", {"l": 3.0}))
    assert text.startswith("dyad.rrp keeps its contract")
    assert "power through block with friction" in text


def test_unknown_type_is_named_with_its_nearest():
    with pytest.raises(bm.RequestError, match=r"dyad\.rrr"):
        conformance("dyad.rrx")


# -- blocks that break one rule each ------------------------------------------------------


def broken(block, kernel):
    """A dyad with one kernel replaced; a kernel tells its stage by its name's head."""
    stage = kernel.__name__.split("_")[0]

    class Broken(block):
        pass

    Broken.kernels = replace(block.kernels, **{stage: kernel})
    return Broken(l_i=3.0, l_j=4.0) if block is bm.RRR else Broken(l=3.0, h=0.4, x_S=0.2)


def position_swapped(D, B, p):
    return rrr_position(D, B, p)


CALLS = [0]


def velocity_that_remembers(pose, v_B, v_D, p):
    CALLS[0] += 1
    vel = rrr_velocity(pose, v_B, v_D, p)
    return vel._replace(i=vel.i._replace(om=vel.i.om + CALLS[0]))


def position_beside_its_joint(B, D, p):
    pose = rrr_position(B, D, p)
    return pose._replace(j=LinkPosition(pose.j.o + mul(pose.j.e, 0.01), pose.j.e))


def position_that_always_closes(B, D, p):
    pose = rrr_position(B, D, p)
    return pose._replace(margin=maximum(pose.margin, 0.5))


def position_with_a_jumping_margin(B, D, p):
    pose = rrr_position(B, D, p)
    return pose._replace(margin=where(pose.margin > 0.0, 0.1 + 0.9 * pose.margin, pose.margin))


def velocity_a_bit_too_fast(pose, v_B, v_D, p):
    vel = rrr_velocity(pose, v_B, v_D, p)
    return vel._replace(j=vel.j._replace(om=1.001 * vel.j.om))


def velocity_not_linear(pose, v_B, v_D, p):
    vel = rrr_velocity(pose, v_B, v_D, p)
    return vel._replace(i=vel.i._replace(om=vel.i.om + 1e-6 * vel.i.om * vel.i.om))


def velocity_without_sliding_rate(pose, v_B, v_S, p):
    vel = rrp_velocity(pose, v_B, v_S, p)

    class Motion(NamedTuple):
        i: object
        j: object

    return Motion(vel.i, vel.j)


def acceleration_without_coriolis(pose, vel, a_B, a_S, p):
    return rrp_acceleration(pose, vel._replace(S=0.0 * vel.S), a_B, a_S, p)


def reactions_with_a_load_of_their_own(pose, load_i, load_j, p):
    result = rrr_reactions(pose, load_i, load_j, p)
    return result._replace(B=result.B + mul(pose.u, 1e-3))


def reactions_without_couple(pose, load_i, load_j, p):
    result = rrp_reactions(pose, load_i, load_j, p)
    return result._replace(S=result.S.N)


def reactions_about_the_wrong_point(pose, load_i, load_j, p):
    result = rrp_reactions(pose, load_i, load_j, p)
    return result._replace(S=Slide(result.S.N, result.S.C - p.x_S * result.S.N))


def reactions_out_of_balance(pose, load_i, load_j, p):
    result = rrr_reactions(pose, load_i, load_j, p)
    return result._replace(D=mul(result.D, 1 + 1e-9))


def position_that_looks_at_the_batch(B, D, p):
    pose = rrr_position(B, D, p)
    mean = getattr(hyp(D - B), "mean", lambda: hyp(D - B))()
    return pose._replace(margin=pose.margin * (1 + 1e-9 * mean))


def velocity_that_mends_nan(pose, v_B, v_D, p):
    vel = rrr_velocity(pose, v_B, v_D, p)
    om = where(vel.i.om == vel.i.om, vel.i.om, 0.0)
    return vel._replace(i=vel.i._replace(om=om))


def position_that_never_fails(B, D, p):
    pose = rrr_position(B, D, p)
    e = pose.i.e
    fixed = mul(B, 0.0) + e if isinstance(B, complex) else e
    return pose._replace(i=LinkPosition(B, fixed if fixed == fixed else 1 + 0j))


def position_that_raises(B, D, p):
    raise ValueError(f"cannot close {p.l_i} and {p.l_j}")


BROKEN = [
    (bm.RRR, position_swapped, "rule 1"),
    (bm.RRR, velocity_that_remembers, "rule 2"),
    (bm.RRR, position_beside_its_joint, "rule 3"),
    (bm.RRR, position_that_always_closes, "rule 3"),
    (bm.RRR, position_with_a_jumping_margin, "rule 3"),
    (bm.RRR, velocity_a_bit_too_fast, "rule 4"),
    (bm.RRR, velocity_not_linear, "rule 4"),
    (bm.RRP, velocity_without_sliding_rate, "rule 4"),
    (bm.RRP, acceleration_without_coriolis, "rule 5"),
    (bm.RRR, reactions_with_a_load_of_their_own, "rule 6"),
    (bm.RRP, reactions_without_couple, "rule 6"),
    (bm.RRR, position_that_looks_at_the_batch, "rule 7"),
    (bm.RRR, velocity_that_mends_nan, "rule 8"),
    (bm.RRR, position_that_never_fails, "rule 9"),
    (bm.RRP, reactions_about_the_wrong_point, "rule 10"),
    (bm.RRR, reactions_out_of_balance, "rule 10"),
    (bm.RRR, position_that_raises, "rule 3"),
]


@pytest.mark.parametrize(
    ("block", "kernel", "rule"), BROKEN, ids=[k.__name__ for _, k, _ in BROKEN]
)
def test_broken_rule_is_named(block, kernel, rule):
    with pytest.raises(ConformanceError) as caught:
        conformance(broken(block, kernel))
    assert f"\n{rule} (" in str(caught.value)


def test_a_load_of_ones_own_may_store_energy():
    """Its energy is in the powers; how it should be is nobody else's to know."""

    def attraction(p_a, p_b, p):
        d = p_b - p_a
        F = mul(d, p.k / (hyp(d) * hyp(d) * hyp(d)))
        return F, -F

    class Magnet(Element, type="test.magnet"):
        """Two poles that attract each other with k / d^2."""

        terminals = {"a": Terminal("point"), "b": Terminal("point")}
        k: Number

        def kernel(self):
            return attraction

        def energy(self):
            return lambda p_a, p_b, p: -p.k / hyp(p_b - p_a)

    try:
        report = conformance("test.magnet", {"k": 0.5})
    finally:
        REGISTRY._types.pop("test.magnet")
    assert 0 < report.measured["power from the stored energy"] < 1e-9


def test_a_kernel_that_machine_code_and_c_cannot_have_is_refused():
    class Drag(Element, type="test.drag"):
        """A drag by a power that no primitive says."""

        terminals = {"at": Terminal("point")}

        def kernel(self):
            return lambda v_at, p: (mul(v_at, -((1.0 + hyp(v_at)) ** 0.5)),)

    try:
        with pytest.raises(
            ConformanceError, match=r"machine code and C cannot have it.* \*\* or pow"
        ):
            conformance("test.drag")
    finally:
        REGISTRY._types.pop("test.drag")
