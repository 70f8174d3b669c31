"""Names of a document survive: what a user reads does not depend on the blocks behind it.

The same mechanism is written in other orders, with the links of a joint named the other way
round, guides pointed back and frames moved; outputs then change by what was said differently
and by nothing else. Whether they are right is told by `tests/proof/test_joint_documents.py` and by
graphs wired by hand.
"""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest

from blockmech.ground.errors import AssemblyError, RequestError
from tests.model.documents import (
    DOCUMENTS,
    flipped,
    four_bar,
    linkage,
    pointed_back,
    reframed,
    slider_crank,
)

SAMPLES = 7
ROUNDING = 1e-12
"""Of the largest output of a unit: what two ways of writing may differ by."""

ON_SECOND = ("reaction", "N", "C", "friction", "coordinate", "slip")
ALONG_GUIDE = ("N", "friction", "coordinate", "slip")
ALONG_DRIVER = ("q", "rate", "acceleration", "drive", "drive_by_reduction", "tau_red", "dJ_red")


def run(document, **options):
    return linkage(document).run(samples=SAMPLES, **options)


def joints_of(kind=""):
    for name, make in DOCUMENTS.items():
        for joint, data in make()["joints"].items():
            if len(data["links"]) == 2 and kind in ("", data["type"]):
                yield pytest.param(name, joint, id=f"{name}-{joint}")


def links_of():
    for name, make in DOCUMENTS.items():
        yield from (pytest.param(name, link, id=f"{name}-{link}") for link in make()["links"])


def largest(result):
    """Unit -> the largest size of an output in it."""
    maxima = {}
    for name in result:
        values = np.abs(np.atleast_1d(result[name]))
        values = values[np.isfinite(values)]
        unit = result.unit(name)
        maxima[unit] = max(maxima.get(unit, 0.0), float(values.max(initial=0.0)))
    return maxima


def differing(result, reference, sign=None, skip=()):
    """Outputs that differ by more than rounding; ``sign`` tells which are negated."""
    assert set(result) == set(reference)
    scale, differences = largest(result), {}
    for name in result:
        if name in skip:
            continue
        expected = np.asarray(result[name]) * (sign(name) if sign else 1)
        got = np.asarray(reference[name])
        assert (np.isnan(expected) == np.isnan(got)).all(), name
        off = float(np.nan_to_num(np.abs(expected - got)).max(initial=0.0))
        if name.endswith(".angle") or (name.endswith(".coordinate") and result.unit(name) == "rad"):
            turns = (expected - got) / (2 * math.pi)
            off = float(np.nan_to_num(np.abs(turns - np.round(turns))).max(initial=0.0))
        if off > ROUNDING * (scale[result.unit(name)] or 1.0):
            differences[name] = off / (scale[result.unit(name)] or 1.0)
    return differences


def driver_of(document, joint):
    return next((n for n, d in document["drivers"].items() if d["joint"] == joint), None)


def signs(document, joint, of_joint):
    """The sign that each output gets where a joint is said the other way round."""
    driver = driver_of(document, joint)
    order = [linkage(document).compile().drivers.index(driver)] if driver else []

    def sign(name):
        head, _, quantity = name.rpartition(".")
        if head == f"joint.{joint}" and quantity in of_joint:
            return -1
        if driver and head == f"driver.{driver}" and quantity in ALONG_DRIVER:
            return -1
        if driver and name in ("mechanism.M", "mechanism.Q"):
            turned = np.ones(len(document["drivers"]))
            turned[order] = -1
            return np.outer(turned, turned) if name.endswith("M") else turned
        return 1

    return sign


# -- the same mechanism written another way ---------------------------------------------


@pytest.mark.parametrize(("name", "joint"), list(joints_of()))
def test_a_joint_named_the_other_way_round_changes_its_own_signs(name, joint):
    document = DOCUMENTS[name]()
    plain, flipped_run = run(document), run(flipped(document, joint))
    assert differing(plain, flipped_run, signs(document, joint, ON_SECOND)) == {}


@pytest.mark.parametrize(("name", "joint"), list(joints_of("P")))
def test_a_guide_that_points_back_changes_what_is_measured_along_it(name, joint):
    document = DOCUMENTS[name]()
    plain, reversed_run = run(document), run(pointed_back(document, joint))
    assert differing(plain, reversed_run, signs(document, joint, ALONG_GUIDE)) == {}


@pytest.mark.parametrize(("name", "link"), list(links_of()))
def test_a_frame_that_is_moved_on_its_link_moves_its_own_outputs_only(name, link):
    document, origin, turn = DOCUMENTS[name](), 0.03 - 0.02j, 2.5
    plain, moved = run(document), run(reframed(document, link, origin, turn))
    local = {f"link.{link}.{quantity}" for quantity in ("p", "v", "a", "angle")}
    drivers = {f"driver.{d}.q" for d in document["drivers"]}
    pins = {n for n in plain if n.endswith(".coordinate") and plain.unit(n) == "rad"}
    assert differing(plain, moved, skip=local | drivers | pins) == {}
    for pin in pins:  # angles of one link's axes against another's
        changes = np.exp(1j * (moved[pin] - plain[pin]))
        options = [np.abs(changes - np.exp(1j * x)).max() for x in (0.0, turn, -turn)]
        mine = link in document["joints"][pin.split(".")[1]]["links"]
        assert (min(options) if mine else options[0]) <= ROUNDING, pin
    scale = largest(plain)
    e = np.exp(1j * plain[f"link.{link}.angle"])
    p = plain[f"link.{link}.p"] + e * origin
    assert np.abs(moved[f"link.{link}.p"] - p).max() <= ROUNDING * scale["m"]
    turned = np.exp(1j * moved[f"link.{link}.angle"]) - e * cmath.exp(1j * turn)
    assert np.abs(turned).max() <= ROUNDING
    v = plain[f"link.{link}.v"] + 1j * plain[f"link.{link}.omega"] * e * origin
    assert np.abs(moved[f"link.{link}.v"] - v).max() <= ROUNDING * scale["m/s"]


# -- right by the document's own links ----------------------------------------------------


def guide(document, result, joint):
    """Unit direction (n,) of the directed line of a P joint on its first link."""
    joint_data = document["joints"][joint]
    first, angle = joint_data["links"][0], joint_data["angle"][0]
    turn = 0.0 if first == "frame" else result[f"link.{first}.angle"]
    return np.exp(1j * (turn + angle)) * np.ones(result.n)


def placed(document, result, joint):
    """Where each link of a pin has it, (links, n)."""
    joint_data = document["joints"][joint]
    for link, (x, y) in zip(joint_data["links"], joint_data["at"], strict=True):
        position = complex(x, y) + np.zeros(result.n)
        if link != "frame":
            position = (
                result[f"link.{link}.p"] + np.exp(1j * result[f"link.{link}.angle"]) * position
            )
        yield position


@pytest.mark.parametrize("name", DOCUMENTS)
def test_a_pin_is_where_each_of_its_links_has_it(name):
    document = DOCUMENTS[name]()
    result = run(document)
    scale = largest(result)
    pins = [joint for joint, data in document["joints"].items() if data["type"] == "R"]
    for pin in pins:
        for position in placed(document, result, pin):
            assert np.abs(result[f"joint.{pin}.p"] - position).max() <= ROUNDING * scale["m"]
    sliders = set(document["joints"]) - set(pins)
    assert not {f"joint.{slider}.p" for slider in sliders} & set(result)


def test_the_transmission_angle_is_that_at_the_pin_between_coupler_and_rocker():
    document = four_bar()
    result = run(document)
    B, C, D = (result[f"joint.{pin}.p"] for pin in "BCD")
    between = np.abs(np.angle((B - C) / (D - C)))
    acute = np.minimum(between, math.pi - between)
    angle = result["joint.C.transmission_angle"]
    assert np.abs(angle - acute).max() <= ROUNDING
    assert [name for name in result if name.endswith("transmission_angle")] == [
        "joint.C.transmission_angle"
    ]


# -- what can be asked for, and what is said ------------------------------------------------


def test_only_names_of_the_document_are_listed_and_matched():
    mechanism = linkage(slider_crank()).compile()
    heads = {name.split(".")[0] for name in mechanism.outputs}
    assert heads == {"driver", "link", "joint", "gas", "mechanism"}
    with pytest.raises(RequestError, match=r"unknown-output.*rod_piston\.B\.reaction"):
        mechanism.run(at=0.0, want=["rod_piston.B.reaction"])
    assert "rod_piston.B.reaction" in mechanism._of_blocks.outputs


def test_who_acts_on_whom_is_said_by_links_of_the_document():
    document = slider_crank()
    outputs = linkage(document).compile().outputs
    assert (outputs["joint.A.reaction"].by, outputs["joint.A.reaction"].on) == ("crank", "rod")
    assert (outputs["driver.motor.drive"].by, outputs["driver.motor.drive"].on) == (
        "frame",
        "crank",
    )
    assert outputs["gas.at.force"].on == "piston"
    turned = linkage(flipped(document, "O")).compile().outputs
    assert (turned["driver.motor.drive"].by, turned["joint.O.friction"].on) == ("crank", "frame")


def test_the_force_of_a_pin_of_three_links_is_named_after_each_further_link():
    result = run(DOCUMENTS["arm"]())
    assert result._output("joint.knot.strut.reaction").by == "tie"
    assert result._output("joint.knot.strut.reaction").on == "strut"
    assert result._output("joint.knot.rocker.reaction").on == "rocker"
    assert "joint.knot.reaction" not in result.mechanism.outputs


def test_flags_name_the_joint_of_the_document():
    document = four_bar()
    result = linkage(document).run(at=[0.0], want=["joint.C.friction"])
    assert {f.where for f in result.quality.flags} == {"joint.C"}


def test_a_gap_is_told_in_words_of_the_document():
    document = slider_crank()
    document["joints"]["A"]["at"][0] = [0.4, 0.0]  # the crank is longer than the rod reaches
    document["links"]["rod"]["pose"] = [0.4, 0.0, -0.1]
    document["links"]["piston"]["pose"] = [0.7, 0.0, 0.0]
    document["drivers"]["motor"].update({"from": 0.0, "to": 3.0})
    document["links"]["crank"]["pose"] = [0, 0, 0.0]
    with pytest.raises(AssemblyError) as caught:
        linkage(document).run(at=1.6)
    (problem,) = caught.value.problems
    assert problem.where.startswith("rod_piston (rod, piston) at driver.motor.q = 1.6 rad")
    assert "feasible arcs of driver.motor.q" in problem.valid.replace("arc of", "arcs of")


def test_drivers_are_named_as_in_the_document():
    mechanism = linkage(DOCUMENTS["arm"]()).compile()
    assert set(mechanism.drivers) == {"lift", "bend"}
    result = mechanism.run(at={"lift": [1.0, 1.1], "bend": -1.4}, want=["driver.bend.q"])
    assert set(result.drivers) == {"driver.lift.q", "driver.bend.q"}
    assert np.array_equal(result.drivers["driver.lift.q"], [1.0, 1.1])
    with pytest.raises(RequestError, match="drivers: lift, bend"):
        mechanism.run(at={"left": 1.0, "bend": -1.4})


def test_a_load_keeps_its_name_beside_a_driver_or_a_group_of_that_name():
    document = slider_crank()
    document["loads"] = {
        "motor": {"type": "couple", "link": "crank", "moment": 2.0},
        "rod_piston": {"type": "force", "link": "piston", "at": [0, 0], "force": [-50, 4]},
    }
    result = run(document, want=["motor.*", "rod_piston.*", "driver.motor.drive"])
    assert np.array_equal(result["motor.on.couple"], np.full(SAMPLES, 2.0))
    assert np.array_equal(result["rod_piston.at.force"], np.full(SAMPLES, -50 + 4j))
    assert result._output("rod_piston.at.force").by == "rod_piston"


def test_a_damped_spring_along_a_guide_is_one_load():
    document = slider_crank()
    k, rest, c = 300.0, 0.05, 12.0
    numbers = {"stiffness": k, "rest_angle": rest, "damping": c}
    document["loads"]["damper"] = {"type": "torsion_spring", "joint": "S"} | numbers
    result = run(document)
    u = guide(document, result, "S")
    anchor = complex(*document["joints"]["S"]["at"][0])
    e = np.exp(1j * result["link.piston.angle"])
    s = result["link.piston.p"] + e * complex(*document["joints"]["S"]["at"][1]) - anchor
    force = -k * ((s * np.conj(u)).real - rest) - c * result["joint.S.slip"]
    assert np.abs(result["damper.b.force"] - force * u).max() <= ROUNDING * np.abs(force).max()
    power = force * result["joint.S.slip"]
    assert np.abs(result["damper.power"] - power).max() <= ROUNDING * np.abs(power).max()


@pytest.mark.parametrize("general", ["", "groups", "one"])
def test_a_driver_inside_a_group_moves_and_is_verified_under_its_own_name(general):
    document = DOCUMENTS["boom"]()
    document["loads"] = {}
    document["initial"] = {"ram": {"q": 0.9, "rate": 0.0}}
    mechanism = linkage(document).decompose(general).compile()
    assert mechanism.drivers == ("ram",)
    checked = mechanism.verify()
    assert checked.ok, str(checked)
    assert "two routes to driver.ram.drive" in {row.name for row in checked.rows}
    energies = ["mechanism.kinetic_energy", "mechanism.potential_energy"]
    accuracy = 1e-10  # [m] of the coordinate; the weights are 100 N, so 1e-8 J with room
    moved = mechanism.simulate("time=0.05", friction="none", want=energies, accuracy=accuracy)
    E = moved[energies[0]] + moved[energies[1]]
    assert moved[energies[0]].max() > 0.01
    assert np.ptp(E) <= 100 * accuracy
