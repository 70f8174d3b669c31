"""From links and joints to blocks: which blocks, which names, whatever the file's order."""

from __future__ import annotations

import cmath
import copy
import json
import math

import numpy as np
import pytest

from blockmech.ground.plane import EPS
from blockmech.model.joints import decompose as decomposing
from blockmech.model.joints.closing import Closing
from blockmech.model.joints.decompose import sequence
from tests.doors import linkage_of as loads
from tests.model.joints import machines
from tests.model.joints.chance import shuffled
from tests.model.joints.machines import guide, joints_file, pin, turned_round
from tests.proof.chain import document

ROUNDING = 1e-12  # [-] of the largest of a kind: some roundings, twice


def read(data):
    return loads(json.dumps(data))


def blocks(data, general=""):
    return read(data).decompose(general).data["blocks"]


def types(data, general=""):
    return [block["type"] for block in blocks(data, general).values()]


# ---- which blocks -------------------------------------------------------------------------


def dyad_file(letters):
    """A crank at one radian and a dyad between it and the frame, in its own odd frames."""
    outer_1, inner, outer_2 = letters
    tip = cmath.exp(1j)
    i, j = (tip + 0.4 + 0.1j, 0.3), (1.9 + 0.2j, 1.2)

    def on(pose, z):
        w = (z - pose[0]) * cmath.exp(-1j * pose[1])
        return w.real, w.imag

    frame, crank = (0j, 0.0), (0j, 1.0)

    def joint(kind, a, b, names, z, direction):
        if kind == "R":
            return pin(*names, on(a, z), on(b, z))
        at = on(a, z), on(b, z + 0.2 * cmath.exp(1j * direction))
        return guide(*names, *at, (direction - a[1], direction - b[1]))

    joints = {
        "O": pin("frame", "crank", (0, 0), (0, 0)),
        "U": joint(outer_1, crank, i, ("crank", "i"), tip, 0.2),
        "V": joint(inner, i, j, ("i", "j"), 1.7 + 1.4j, 1.0),
        "W": joint(outer_2, frame, j, ("frame", "j"), 2.2 + 0j, 2.2),
    }
    poses = {"crank": (0, 0, 1.0), "i": (i[0].real, i[0].imag, i[1])}
    poses["j"] = (j[0].real, j[0].imag, j[1])
    return joints_file(poses, joints, {"motor": "O"})


@pytest.mark.parametrize("letters", ["RRR", "RRP", "RPR", "PRP", "RPP", "PRR", "PPR"])
def test_a_dyad_is_its_closed_form_block(letters):
    kind = letters if letters not in ("PRR", "PPR") else letters[::-1]
    assert types(dyad_file(letters)) == ["frame", "driver.crank", f"dyad.{kind.lower()}"]


@pytest.mark.parametrize("letters", ["RRR", "RRP", "RPR", "PRP", "RPP"])
def test_lengths_are_those_of_the_document_and_not_of_its_pose(letters):
    exact = dyad_file(letters)
    rough = copy.deepcopy(exact)
    for link in rough["links"].values():
        link["pose"] = [x + 0.003 for x in link["pose"]]
    assert blocks(exact)["i_j"] == blocks(rough)["i_j"]


def test_the_assembly_mode_is_that_of_the_pose():
    up = machines.fourbar()
    down = copy.deepcopy(up)
    down["links"]["rod"]["pose"][2], down["links"]["rocker"]["pose"][2] = -0.97, -2.55
    assert blocks(up)["rocker_rod"]["branch"] == -blocks(down)["rocker_rod"]["branch"]


def test_a_driven_joint_on_a_moving_link_is_a_driving_link_there():
    data = machines.fourbar()
    data["links"]["arm"] = {"pose": [1.7, 1.2, 0.2]}
    data["joints"]["E"] = pin("rod", "arm", (1.2, 0), (0, 0))
    data["drivers"]["wrist"] = {"joint": "E"}
    graph = read(data).decompose()
    assert graph.data["blocks"]["wrist"]["type"] == "driver.crank"
    assert {"from": "rocker_rod.E", "to": "wrist.A"} in graph.data["wires"]


def lift(rod_off=0.0, angle=(0.0, 0.0)):
    """A cylinder between the frame and an arm."""
    u = cmath.exp(1j * cmath.phase(2 + 1j))
    o = 2.0 + 1j - 1.2 * u
    return joints_file(
        {
            "barrel": (0, 0, cmath.phase(u)),
            "rod": (o.real, o.imag, cmath.phase(u)),
            "arm": (2, 0, math.pi / 2),
        },
        {
            "B": pin("frame", "barrel", (0, 0), (0, 0)),
            "S": guide("barrel", "rod", (0.2, 0), (0, 0), angle),
            "C": pin("rod", "arm", (1.2, rod_off), (1, 0)),
            "D": pin("frame", "arm", (2, 0), (0, 0)),
        },
        {"jack": "S"},
    )


def test_a_driven_length_between_pivots_is_a_cylinder():
    graph = read(lift()).decompose()
    name, block = next((n, b) for n, b in graph.data["blocks"].items() if n != "frame")
    assert (name, block["type"]) == ("jack", "driven.rrr")
    sign, offset = graph.graph.structure().coordinate("jack")
    assert sign == 1
    assert offset == pytest.approx(0.2 + 1.2, rel=1e-15)


def test_a_cylinder_whose_line_points_the_other_way_drives_the_same():
    straight = read(lift()).compile()
    turned = read(lift(angle=(math.pi, math.pi))).decompose()
    assert turned.data["blocks"]["jack"]["type"] == "driven.rrr"
    assert turned.names.joints["S"].turned
    for s in (0.7, 0.9):
        result = straight.run(at={"jack": s}, rates={"jack": 1.0})
        mirrored = turned.compile().run(at={"jack": -s}, rates={"jack": -1.0})
        assert result["link.arm.angle"] == pytest.approx(mirrored["link.arm.angle"], abs=ROUNDING)
        assert result["joint.S.slip"] == pytest.approx(-mirrored["joint.S.slip"], abs=ROUNDING)


def test_a_cylinder_pinned_off_its_line_is_a_general_group():
    graph = read(lift(rod_off=0.05)).decompose()
    assert "group.general" in types(lift(rod_off=0.05))
    assert graph.graph.structure().driven == {"jack": ("barrel_rod_arm", "S")}
    assert graph.data["blocks"]["barrel_rod_arm"]["home"]["drivers"].keys() == {"jack"}


def test_a_general_group_knows_all_drivers_on_which_it_depends():
    data = read(machines.fourbar()).decompose("groups").data
    home = data["blocks"]["rocker_rod"]["home"]
    assert home["drivers"] == {"motor": pytest.approx(1.0)}
    assert set(home["poses"]) == {"rod", "rocker"}


def test_a_motor_that_follows_the_angle_of_links_leaves_their_frames_alone():
    """Its law is of an angle between -pi and pi, which depends on the frames."""
    law = {"kind": "polynomial", "coefficients": [0.0, -3.0]}
    data = machines.fourbar()
    data["joints"]["C"]["at"] = [[1.5, 2.0], [0, 2]]
    data["joints"]["D"]["at"][1] = [0, 0]
    data["links"]["rod"]["pose"][2] -= math.atan2(2.0, 1.5)
    data["links"]["rocker"]["pose"][2] -= math.pi / 2
    motor, spring = copy.deepcopy(data), copy.deepcopy(data)
    motor["loads"] = {"m": {"type": "motor", "links": ["rod", "rocker"], "law": law}}
    spring["loads"] = {"m": {"type": "torsion_spring", "joint": "C", "stiffness": 3.0}}
    assert "group.general" in types(motor)
    assert "dyad.rrr" in types(spring)
    values, expected = (
        read(d).compile().run(at={"motor": 1.1}, rates={"motor": 0.0}) for d in (motor, spring)
    )
    for name in ("driver.motor.drive", "joint.B.reaction", "joint.D.reaction"):
        assert (
            np.abs(values[name] - expected[name]).max() <= ROUNDING * np.abs(expected[name]).max()
        )


def test_a_slide_whose_frame_a_law_reads_is_left_alone():
    """A driven slide at an angle has a frame of its own; a law of its angle wants the user's."""
    law = {"kind": "polynomial", "coefficients": [0.0, 2.0]}
    data = {
        "format": "blockmech/joints",
        "version": 1,
        "links": {"slide": {"pose": [0.5, 0, -0.4]}, "arm": {"pose": [0.5, 0, 0.6]}},
        "joints": {
            "S": {
                "type": "P",
                "links": ["frame", "slide"],
                "at": [[0, 0], [0, 0]],
                "angle": [0, 0.4],
            },
            "R": {"type": "R", "links": ["slide", "arm"], "at": [[0, 0], [0, 0]]},
        },
        "drivers": {"push": {"joint": "S"}, "turn": {"joint": "R"}},
        "loads": {"m": {"type": "motor", "links": ["slide", "arm"], "law": law}},
    }
    graph = loads(json.dumps(data)).decompose()
    assert graph.data["blocks"]["slide"]["type"] == "group.general"
    at = {"push": 0.7, "turn": 1.1}
    run = graph.compile().run(at=at, rates=dict.fromkeys(at, 0.0))
    assert run["driver.turn.drive"][0] == pytest.approx(-2.0 * 1.1, rel=1e-12)
    assert run["link.slide.angle"][0] == pytest.approx(-0.4, abs=1e-14)


# ---- laws and coordinates -----------------------------------------------------------------

OF_THE_DRIVER = {
    "polynomial": {"coefficients": [1.0, 2.0, -0.5]},
    "table": {"arguments": [-2.5, -1.5, -0.5, 0.0], "values": [1.0, 3.0, 2.0, 0.0]},
    "fourier": {"mean": 1.0, "cosines": [0.5, 0.2], "sines": [0.3]},
}


@pytest.mark.parametrize("kind", OF_THE_DRIVER)
def test_a_load_follows_the_coordinate_of_the_document(kind):
    data = turned_round(machines.fourbar(), "A")  # the graph counts the opposite
    law = {"kind": kind, **OF_THE_DRIVER[kind]}
    load = {"type": "motor", "links": ["frame", "crank"], "law": law, "driver": "motor"}
    data["loads"] = {"m": load}
    q = np.array([-2.1, -1.2, -0.7])
    run = read(data).compile().run(at={"motor": q}, rates={"motor": 0.0})
    x = {"polynomial": lambda: 1.0 + 2.0 * q - 0.5 * q * q, "fourier": lambda: series(q)}
    expected = x.get(kind, lambda: spline(q))()
    assert run["driver.motor.drive"] == pytest.approx(expected, abs=1e-13)  # drives second on first


def series(q):
    return 1.0 + 0.5 * np.cos(q) + 0.2 * np.cos(2 * q) + 0.3 * np.sin(q)


def spline(q):
    from scipy.interpolate import CubicSpline

    table = OF_THE_DRIVER["table"]
    return CubicSpline(table["arguments"], table["values"])(q)


def test_a_cylinder_s_gas_follows_its_stroke_and_not_the_length_of_the_block():
    law = {"kind": "polynomial", "coefficients": [10.0, 4.0, 2.0]}
    data = lift()
    data["loads"] = {"g": {"type": "motor", "joint": "S", "law": law, "driver": "jack"}}
    s = np.array([0.6, 0.8])
    run = read(data).compile().run(at={"jack": s}, rates={"jack": 0.0})
    assert run["driver.jack.drive"] == pytest.approx(-(10 + 4 * s + 2 * s * s), rel=1e-12)


# ---- names --------------------------------------------------------------------------------


def test_names_that_blocks_use_themselves_do_no_harm():
    """Links, joints, drivers, loads and markers called as blocks call theirs."""
    data = machines.fourbar()
    renamed = {"crank": "B", "rod": "i", "rocker": "j"}
    data["links"] = {renamed[name]: link for name, link in data["links"].items()}
    for joint in data["joints"].values():
        joint["links"] = [renamed.get(name, name) for name in joint["links"]]
    data["links"]["i"]["markers"] = {"C": {"at": [0.5, 0.5]}, "j": {"at": [1, 0], "angle": 0.5}}
    data["links"]["frame"] = {"markers": {"A": {"at": [3, 3]}, "frame": {"at": [1, 1]}}}
    data["drivers"] = {"frame": {"joint": "A"}}
    data["loads"] = {"frame": {"type": "force", "link": "i", "at": [0.5, 0.5], "force": [1, 0]}}
    for general in ("", "groups", "one"):
        run = read(data).decompose(general).compile().run(at={"frame": 1.0}, rates={"frame": 0.0})
        i = run["link.i.p"][0], run["link.i.angle"][0]
        expected = i[0] + (0.5 + 0.5j) * cmath.exp(1j * i[1])
        assert run["link.i.C.p"][0] == pytest.approx(expected, abs=ROUNDING)
        assert run["link.frame.A.p"][0] == 3 + 3j
        assert run["link.frame.frame.p"][0] == 1 + 1j


# ---- size ---------------------------------------------------------------------------------


def test_a_long_chain_in_shuffled_order_is_a_chain_of_dyads():
    number = 30
    result = read(shuffled(machines.chain(number), 5)).decompose()
    graph = result.graph
    assert graph.check() == []
    kinds = [unit.kind for unit in result.formation.units]
    assert kinds == ["driver"] + ["RRR"] * number
    structure = graph.structure()
    assert len(structure.blocks) == number + 1
    assert structure.mobility == 1
    assert len(result.names.links) == 2 * number + 1


def test_whole_turns_in_poses_do_not_lengthen_the_way_from_home():
    """A pose of two turns more is the same pose: no way leads there through dead centres."""
    plain, wound = machines.fourbar(), machines.fourbar()
    wound["links"]["crank"]["pose"][2] += 4 * math.pi
    wound["links"]["rod"]["pose"][2] -= 2 * math.pi
    direct, wound_up = (read(d).decompose("groups") for d in (plain, wound))
    assert wound_up.data["blocks"]["rocker_rod"]["home"]["drivers"] == {"motor": pytest.approx(1.0)}
    at = {"motor": [0.6, 1.4]}
    for name in ("link.rocker.angle", "link.rod.p"):
        values, expected = (
            d.compile().run(at=at, rates={"motor": 0.0})[name] for d in (wound_up, direct)
        )
        assert values == pytest.approx(expected, abs=ROUNDING)


# -- near a dead centre ------------------------------------------------------------------------


@pytest.mark.parametrize("mode", [1, -1])
def test_a_pose_a_millionth_off_a_dead_centre_tells_its_mode(mode):
    """A four-bar whose rod and rocker lie on one line where its crank is at zero."""
    aside, pivot, rod, rocker = 1e-6, 4.0, 1.5, 4.5
    crank = cmath.exp(1j * aside)
    d = pivot - crank
    projection = (rod**2 - rocker**2 + abs(d) ** 2) / (2 * abs(d))
    knee = crank + d / abs(d) * complex(projection, mode * math.sqrt(rod**2 - projection**2))
    turned = cmath.phase(knee - crank)
    links = {"crank": (0, 0, aside), "rod": (crank.real, crank.imag, turned)}
    links["rocker"] = (pivot, 0, cmath.phase(knee - pivot))
    joints = {
        "A": pin("frame", "crank", (0, 0), (0, 0)),
        "B": pin("crank", "rod", (1, 0), (0, 0)),
        "C": pin("rod", "rocker", (rod, 0), (rocker, 0)),
        "D": pin("frame", "rocker", (pivot, 0), (0, 0)),
    }
    mechanism = read(joints_file(links, joints, {"motor": "A"})).compile()
    run = mechanism.run(at=aside, rates=1.0, want=["link.rod.angle"])
    # half the digits are left of what the margin, 1e-12, is made of
    assert run["link.rod.angle"][0] == pytest.approx(turned, abs=1e-9)


def nearly_parallel(turn):
    """A crank, a guide on its pin and one on the frame, ``turn`` [rad] apart: they meet at -2."""
    height = 1.0 - 2.0 * math.sin(turn)
    poses = {"crank": (0.0, 0.0, math.pi / 2), "i": (0.0, 1.0, turn)}
    poses["j"] = (-2.0 * math.cos(turn), height, 0.0)
    joints = {
        "A": pin("frame", "crank", (0, 0), (0, 0)),
        "B": pin("crank", "i", (1, 0), (0, 0)),
        "S1": guide("i", "j", (0, 0), (0, 0), (0.0, turn)),
        "S": guide("frame", "j", (0.0, height), (0, 0), (0.0, 0.0)),
    }
    return joints_file(poses, joints, {"motor": "A"}), height


@pytest.mark.parametrize("turn", [1e-3, 1e-6, 1e-8, 1e-9])
def test_nearly_parallel_guides_are_placed_as_well_as_their_angle_is_known(turn):
    """The guides' angle does not change with the pose, so it can be told down to rounding."""
    data, height = nearly_parallel(turn)
    linkage = read(data)
    assert linkage.check() == []
    result = linkage.run(at=math.pi / 2, want="link.j.p")
    assert result["link.j.p"][0].real == pytest.approx(-2.0 * math.cos(turn), abs=16 * EPS / turn)
    assert result["link.j.p"][0].imag == pytest.approx(height, rel=4 * EPS)
    (margin,) = result.quality.margin.values()
    assert margin[0] == pytest.approx(math.sin(turn) ** 2, rel=1e-6)


def test_parallel_guides_are_refused():
    data, _ = nearly_parallel(0.0)
    assert [p.code for p in read(data).check()] == ["coincident-joints"]


@pytest.mark.parametrize("turn", [0.0, 1e-9, 1e-5, 1e-3])
def test_dyads_are_closed_in_the_mode_that_a_rounded_pose_tells(turn):
    """The same poses as by Newton's method on all joints at once."""
    data = document(6)
    for k, link in enumerate(data["links"].values()):
        link["pose"][2] += turn * (-1) ** k
    order = sequence(read(data))
    layout = order.layout
    angles = {"O": layout.given["crank"].theta}
    closing = Closing(layout.links, tuple(order.pairs.values()), layout.size, angles)
    assert np.abs(closing.conditions(order.poses)[0]).max() < 4e-15
    assert len(order.drafts) == 6
    poses = closing.refine(layout.given)
    assert all(abs(poses[a].theta - order.poses[a].theta) < 1e-13 for a in layout.links)


def test_a_document_is_taken_apart_once_as_long_as_nothing_of_it_changes(monkeypatch):
    calls, original = [], decomposing.decompose
    monkeypatch.setattr(decomposing, "decompose", lambda *x: calls.append(x) or original(*x))
    m = read(document(2))
    m.decompose().data["blocks"].clear()  # what is done to it does not come back
    assert m.compile().structure.blocks
    assert len(calls) == 1
    m.gravity = (0.0, -2.0)
    assert m.compile().scene.gravity.z == -2j
    assert len(calls) == 2
