"""Dimensions by constraints: lengths, angles and relations that the drawing is moved to fulfil.

What is right follows from geometry: the law of cosines, the nearest points that have a distance,
and a block diagram with the same lengths, whose derivatives are another program's.
"""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest

import blockmech as bm
from tests.machines import fourbar

CRANK, ROD, ROCKER, GROUND = 1.0, 2.5, 2.0, 2.5  # [m]
LAW = bm.motion.ConstantRate(rate=10.0)
CLOSE = 1e-9  # [m] what closing leaves, from a sketch of metres


def sketch():
    """A four-bar as a hand draws it."""
    m = bm.Linkage("fourbar")
    for name in ("crank", "rod", "rocker"):
        m.add_link(name)
    m.add_joint("A", "R", ["frame", "crank"], point=(0.0, 0.0))
    m.add_joint("B", "R", ["crank", "rod"], point=(0.6, 0.75))
    m.add_joint("C", "R", ["rod", "rocker"], point=(2.9, 1.9))
    m.add_joint("D", "R", ["frame", "rocker"], point=(2.4, 0.1))
    m.add_driver("motor", "A", LAW)
    return m


def dimensioned():
    """The same with its lengths, the ground level, and the pose in which it was meant."""
    m = sketch()
    for name, points, value in (
        ("crank", "AB", CRANK),
        ("rod", "BC", "250cm"),
        ("rocker", "CD", ROCKER),
        ("ground", "AD", GROUND),
    ):
        m.add_dimension(name, "length", list(points), value)
    m.add_dimension("level", "angle", ["A", "D"], 0.0)
    m.add_dimension("pose", "angle", ["D", "A", "B"], "60deg")
    return m


def positions(m):
    """Points of a drawing whose links have pose zero."""
    return {name: joint.at[0].z for name, joint in m.joints.items()}


def test_lengths_and_angles_hold_where_the_law_of_cosines_has_them():
    report = dimensioned().fit_dimensions()
    assert (report.redundant, report.free, report.freedoms) == ((), (), 0)
    z = positions(report.linkage)
    b = z["A"] + cmath.rect(CRANK, math.pi / 3)
    diagonal = abs(z["A"] + GROUND - b)
    cosine = (diagonal**2 + ROD**2 - ROCKER**2) / (2 * diagonal * ROD)
    c = b + ROD * (z["A"] + GROUND - b) / diagonal * cmath.exp(1j * math.acos(cosine))
    for name, expected in {"B": b, "C": c, "D": z["A"] + GROUND}.items():
        assert abs(z[name] - expected) <= CLOSE


def test_points_move_no_farther_than_they_must():
    """Of a length on the moving links both ends move by half of what is missing, along the line."""
    m = sketch()
    m.add_dimension("rod", "length", ["B", "C"], ROD)
    report = m.fit_dimensions()
    z = positions(report.linkage)
    line = 2.3 + 1.15j
    step = (ROD / abs(line) - 1) / 2 * line
    assert abs(z["B"] - (0.6 + 0.75j - step)) <= CLOSE
    assert abs(z["C"] - (2.9 + 1.9j + step)) <= CLOSE
    assert report.free == ("B", "C")
    assert report.freedoms == 3  # of four coordinates, and one length
    assert dict(report.moved) == pytest.approx({"B": abs(step), "C": abs(step)}, rel=1e-6)


def crank_rocker():
    """Lengths of the moving links of a drawing whose crank is too short by 5 mm."""
    m = bm.Linkage("crank_rocker")
    for name in ("crank", "coupler", "rocker"):
        m.add_link(name)
    m.add_joint("O2", "R", ["frame", "crank"], point=(0.0, 0.0))
    m.add_joint("A", "R", ["crank", "coupler"], point=(0.04, 0.0))
    m.add_joint("B", "R", ["coupler", "rocker"], point=(0.13, 0.07))
    m.add_joint("O4", "R", ["frame", "rocker"], point=(0.1, 0.0))
    m.add_driver("motor", "O2", LAW)
    m.add_dimension("crank", "length", ["O2", "A"], "45 mm")
    m.add_dimension("coupler", "length", ["A", "B"], "120 mm")
    m.add_dimension("rocker", "length", ["B", "O4"], "80 mm")
    return m


@pytest.mark.parametrize("ground", [None, "100 mm", "110 mm"])
def test_pivots_of_the_frame_stay_unless_a_dimension_names_them(ground):
    """The stroke is that of a crank-rocker with its lengths, by the law of cosines."""
    m = crank_rocker()
    if ground:
        m.add_dimension("ground", "length", ["O2", "O4"], ground)
    report = m.fit_dimensions()
    z, d = positions(report.linkage), 0.11 if ground == "110 mm" else 0.1
    shift = (d - 0.1) / 2  # both ends move alike where the frame's own length is another
    assert abs(z["O2"] + shift) <= CLOSE
    assert abs(z["O4"] - (0.1 + shift)) <= CLOSE
    assert (report.free, report.freedoms, report.frame) == (("A", "B"), 1, ())
    angles = [
        math.acos((d**2 + 0.08**2 - reach**2) / (2 * d * 0.08))
        for reach in (0.12 + 0.045, 0.12 - 0.045)
    ]
    stroke = m.compile().stroke("link.rocker.angle").length
    assert stroke == pytest.approx(angles[0] - angles[1], rel=1e-8)


def slider_crank(turn=1 + 0j):
    """A slider-crank in line, drawn with its guide in a direction."""
    m = bm.Linkage("slider_crank")
    for name in ("crank", "rod", "piston"):
        m.add_link(name)
    m.add_joint("O", "R", ["frame", "crank"], point=(0.0, 0.0))
    m.add_joint("A", "R", ["crank", "rod"], point=turn * (0.03 + 0.03j))
    m.add_joint("B", "R", ["rod", "piston"], point=0.15 * turn)
    m.add_joint("bore", "P", ["frame", "piston"], point=0.15 * turn, dir=turn)
    m.add_driver("motor", "O", LAW)
    return m


@pytest.mark.parametrize("angle", [0.0, 0.6])
def test_a_pin_of_a_slider_stays_on_its_guide(angle):
    """A slider-crank in line remains one whatever its lengths: its stroke is two cranks."""
    turn = cmath.rect(1.0, angle)
    m = slider_crank(turn)
    m.add_dimension("crank", "length", ["O", "A"], "40 mm")
    m.add_dimension("rod", "length", ["A", "B"], "120 mm")
    z = positions(m.fit_dimensions().linkage)
    assert abs((z["B"] / turn).imag) <= CLOSE
    mechanism = m.compile()
    at = mechanism.stroke("joint.bore.coordinate")
    assert at.length == pytest.approx(0.08, rel=1e-8)
    stroke = "stroke(joint.bore.coordinate)"
    slope = mechanism.sensitivity(stroke, "dimensions.crank.value", samples=36)[stroke]
    assert slope[0, 0] == pytest.approx(2.0, rel=1e-7)


def test_a_pin_leaves_its_guide_where_a_dimension_asks_for_an_offset():
    m = slider_crank()
    m.add_dimension("pin", "position", ["B"], (0.14, 0.01))
    z = positions(m.fit_dimensions().linkage)
    assert abs(z["B"] - (0.14 + 0.01j)) <= CLOSE
    assert abs(z["O"]) <= CLOSE


def test_pivots_of_the_frame_move_where_nothing_else_fulfils_the_dimensions():
    m = sketch()
    for name, points, value in (("crank", "AB", 0.3), ("rod", "BC", 0.5), ("rocker", "CD", 0.4)):
        m.add_dimension(name, "length", list(points), value)  # 1.2 m over a ground of 2.4 m
    report = m.fit_dimensions()
    z = positions(report.linkage)
    assert abs(z["A"] - z["B"]) == pytest.approx(0.3, abs=CLOSE)
    assert report.frame == ("A", "D")
    assert "A, D of the frame moved" in str(report)


@pytest.mark.parametrize("turned", [False, True])
def test_a_compiled_drawing_is_the_mechanism_of_its_dimensions(turned):
    m = dimensioned()
    if turned:  # links with frames of their own
        for name, (x, y, angle) in {"rod": (0.5, 0.4, 0.7), "rocker": (2.0, 1.0, -1.1)}.items():
            o, e = complex(x, y), cmath.rect(1.0, angle)
            m.links[name] = m.links[name].model_copy(update={"pose": (x, y, angle)})
            for joint in m.joints.values():
                for k, link in enumerate(joint.links):
                    if link == name:
                        local = (joint.at[k].z - o) / e
                        joint.at[k] = type(joint.at[k])(local)
    g = fourbar(CRANK, ROD, ROCKER, GROUND)
    q = np.array([0.2, 1.0, 3.0])
    run, same = m.run(at=q), g.run(at=q, rates=10.0)
    first = run["joint.A.p"][0]  # the drawing was moved as a whole
    zero = run["driver.motor.q"] - same["crank.q"]
    assert np.abs(zero).max() == 0.0
    turn = math.remainder(m.compile().run(at=[0.0])["link.crank.angle"][0], math.tau)
    assert turn == pytest.approx(0.0, abs=1e-12)
    level = positions(m.fit_dimensions().linkage) if not turned else None
    if level:  # the crank's axes are the drawing's: q counts from the drawn pose
        e = (level["B"] - level["A"]) / CRANK
        same = g.run(at=q + cmath.phase(e), rates=10.0)
        assert np.abs(run["joint.C.p"] - first - same["dyad.C.p"]).max() <= CLOSE


def test_numbers_of_dimensions_are_parameters_with_derivatives():
    """The rod's length turns the rocker as the length of the dyad does."""
    m = dimensioned()
    mechanism = m.compile()
    path = "dimensions.rod.value"
    assert mechanism.parameters()[path].value == ROD
    fitted = m.fit_dimensions().linkage
    q = 0.3
    want = "joint.C.transmission_angle"
    exact = mechanism.sensitivity(want, path, at=[q])[want][0, 0]
    g = fourbar(CRANK, ROD, ROCKER, GROUND)
    z = positions(fitted)
    turn = cmath.phase(z["B"] - z["A"])
    same = g.compile().sensitivity("dyad.transmission_angle", "dyad.l_i", at=[q + turn])
    assert exact == pytest.approx(same["dyad.transmission_angle"][0, 0], rel=1e-7)
    (solution,) = mechanism.solve({want: "70deg"}, to=path, at=q)
    longer = dimensioned()
    longer.dimensions["rod"] = longer.dimensions["rod"].model_copy(update={"value": solution[path]})
    assert longer.run(at=[q], want=want)[want][0] == pytest.approx(math.radians(70), abs=1e-8)


@pytest.mark.parametrize("path", ["joints.B.at[0].x", "joints.A.at[1].y", "joints.D.at[0].x"])
def test_places_on_one_link_have_derivatives_with_all_joints_closed(path):
    """Where a place on one of its links moves, the joint closes, and then the dimensions hold."""
    m = sketch()
    for name, points, value in (("crank", "AB", CRANK), ("rod", "BC", ROD)):
        m.add_dimension(name, "length", list(points), value)
    m, want, q, h = m.fit_dimensions().linkage, "joint.C.p", 0.3, 1e-5
    value = m.compile().parameters()[path].value
    ends = [m.replace({path: value + s * h}).run(at=[q], want=want)[want][0] for s in (1, -1)]
    exact = m.compile().sensitivity(want, path, at=[q])[want][0, 0]
    assert exact == pytest.approx((ends[0] - ends[1]) / (2 * h), rel=1e-6)


@pytest.mark.parametrize("k", [0, 1])
def test_directions_of_guides_have_derivatives_with_all_joints_closed(k):
    """Where a guide turns on one link, the other link turns with it, and dimensions hold then."""
    m = slider_crank()
    guide = m.joints["bore"]
    m.joints["bore"] = guide.model_copy(update={"dir": None, "angle": [0.0, 0.0]})
    for name in ("lever", "arm"):
        m.add_link(name)
    m.add_joint("E", "R", ["piston", "lever"], point=(0.16, 0.05))
    m.add_joint("F", "R", ["lever", "arm"], point=(0.2, 0.12))
    m.add_joint("G", "R", ["frame", "arm"], point=(0.26, 0.1))
    m.add_dimension("across", "length", ["A", "F"], 0.19)
    m, want, path, h = m.fit_dimensions().linkage, "joint.A.p", f"joints.bore.angle[{k}]", 1e-5
    ends = [m.replace({path: s * h}).run(at=[0.7], want=want)[want][0] for s in (1, -1)]
    exact = m.compile().sensitivity(want, path, at=[0.7])[want][0, 0]
    assert abs(exact) > 1e-3
    assert exact == pytest.approx((ends[0] - ends[1]) / (2 * h), rel=1e-6)


@pytest.mark.parametrize("path", ["joints.W.at[0].x", "joints.W.at[1].y", "joints.W.dir[0].y"])
def test_places_of_welds_have_derivatives_under_dimensions(path):
    """The rod hangs on the apron that is welded to it, and its pins are dimensioned."""
    m = sketch()
    m.add_link("apron", pose=(1.0, 1.0, 0.4), markers={"T": (0.3, 0.2)})
    weld = {"at": [(2.0, 1.5), (0.8, 0.1)], "dir": [(1.0, 0.0), (0.8, 0.6)]}
    m.add_joint("W", "weld", ["rod", "apron"], **weld)
    for name, points, value in (("crank", "AB", CRANK), ("rod", "BC", ROD)):
        m.add_dimension(name, "length", list(points), value)
    m, want, q, h = m.fit_dimensions().linkage, ["link.apron.T.p", "joint.C.p"], 0.3, 1e-5
    value = m.compile().parameters()[path].value
    runs = [m.replace({path: value + s * h}).run(at=[q], want=want) for s in (1, -1)]
    exact = m.compile().sensitivity(want, path, at=[q])
    for name in want:
        slope = (runs[0][name][0] - runs[1][name][0]) / (2 * h)
        assert abs(exact[name][0, 0] - slope) <= 1e-6


def test_a_sketch_with_another_dimension_is_the_mechanism_with_that_number():
    """What counts from the drawing counts from the one that fulfils the dimensions."""
    m, want, q = sketch(), ["joint.C.p", "link.rod.angle"], [0.0, 0.4]
    for name, points, value in (("crank", "AB", CRANK), ("rod", "BC", ROD)):
        m.add_dimension(name, "length", list(points), value)
    shorter = {"dimensions.crank.value": 0.7}
    run, same = m.replace(shorter).run(at=q, want=want), m.fit_dimensions().linkage.replace(shorter)
    for name, values in same.run(at=q, want=want).items():
        assert np.abs(run[name] - values).max() <= CLOSE
    study = m.compile().study({"dimensions.crank.value": [0.7]}, want={want[0]: ["poses"]}, at=q)
    assert np.abs(study["poses(joint.C.p)"][0] - run["joint.C.p"]).max() <= CLOSE


def test_an_objective_has_its_own_derivatives_far_from_the_sketch():
    """Each design moves from the sketch to its dimensions: not from that of its neighbour."""
    m = sketch()
    for name, points, value in (("crank", "AB", CRANK), ("rod", "BC", ROD)):
        m.add_dimension(name, "length", list(points), value)
    address, h = "dimensions.rod.value", 1e-4
    f = m.compile().objective([address], want="rms(joint.C.p)", at=[0.0, 0.4])
    for rod in (ROD, 1.1 * ROD):
        slope = (f(np.array([rod + h])) - f(np.array([rod - h]))) / (2 * h)
        assert f.jacobian(np.array([rod]))[0] == pytest.approx(slope, rel=1e-6)


def test_contradicting_dimensions_are_mended_by_another_number():
    m = dimensioned()
    m.add_dimension("again", "length", ["A", "B"], 2 * CRANK)
    assert m.check()
    assert not m.replace({"dimensions.again.value": CRANK}).check()


RELATIONS = [
    ("parallel", "ABDC", lambda a, b, d, c: ((b - a) / (c - d)).imag),
    ("perpendicular", "ABAD", lambda a, b, _, d: ((b - a) / (d - a)).real),
    ("equal", "ABCD", lambda a, b, c, d: abs(b - a) - abs(d - c)),
    ("in_line", "ABC", lambda a, b, c: ((b - a) / (c - a)).imag),
    (
        "on_circle",
        "BACD",
        lambda b, a, c, d: abs(abs(a - b) - abs(c - b)) + abs(abs(a - b) - abs(d - b)),
    ),
]


@pytest.mark.parametrize(("kind", "points", "deviation"), RELATIONS)
def test_relations_hold(kind, points, deviation):
    m = sketch()
    m.add_dimension("relation", kind, list(points))
    z = positions(m.fit_dimensions().linkage)
    assert abs(deviation(*(z[name] for name in points))) <= CLOSE
    assert abs(deviation(*(positions(m)[name] for name in points))) > 0.05


def test_points_have_positions_and_markers_are_points():
    m = sketch()
    m.links["rod"] = bm.Linkage.from_json(m.to_json()).links["rod"].model_copy()
    m.add_link("flag", markers={"top": (1.0, 3.0)})
    m.add_joint("W", "weld", ["flag", "rod"], point=(0.7, 0.8))
    m.add_dimension("A", "position", ["A"], (0.1, 0.2))
    m.add_dimension("top", "angle", ["B", "A", "flag.top"], "90deg")
    fitted = m.fit_dimensions().linkage
    z = positions(fitted)
    assert abs(z["A"] - (0.1 + 0.2j)) <= CLOSE
    top = fitted.links["flag"].markers["top"].at.z
    assert cmath.phase((top - z["A"]) / (z["B"] - z["A"])) == pytest.approx(math.pi / 2, abs=CLOSE)


def test_what_follows_from_the_rest_is_named_and_what_contradicts_is_refused():
    m = dimensioned()
    m.add_dimension("half", "length", ["A", "B"], CRANK)
    assert set(m.fit_dimensions().redundant) == {"crank", "half"}
    assert "crank, half follow from the rest" in str(m.fit_dimensions())
    m.add_dimension("diagonal", "length", ["A", "C"], 9.0)  # no triangle with rod and crank
    with pytest.raises(bm.GraphError, match="cannot hold together: they miss by") as caught:
        m.compile()
    (problem,) = caught.value.problems
    assert problem.code == "conflicting-dimensions"
    assert {"rod", "rocker", "diagonal"} <= set(problem.found.split(" cannot")[0].split(", "))
    assert [p.code for p in m.check()] == ["conflicting-dimensions"]


@pytest.mark.parametrize(
    ("kind", "points", "value"),
    [
        ("length", ["flag.P", "B"], 1.0),
        ("angle", ["flag.P", "B"], 0.5),
        ("angle", ["flag.P", "B", "A"], 0.5),
        ("angle", ["A", "B", "flag.P"], 0.5),
        ("parallel", ["B", "flag.P", "A", "D"], None),
        ("perpendicular", ["A", "D", "B", "flag.P"], None),
        ("equal", ["B", "flag.P", "A", "D"], None),
        ("in_line", ["B", "A", "flag.P"], None),
        ("on_circle", ["B", "flag.P", "A"], None),
    ],
)
def test_lines_whose_ends_coincide_are_refused(kind, points, value):
    """They have no direction, and a length of zero none in which it grows."""
    m = sketch()
    m.add_link("flag", markers={"P": (0.6, 0.75)})
    m.add_joint("W", "weld", ["flag", "rod"], point=(0.7, 0.8))
    m.add_dimension("one", kind, points, *() if value is None else (value,))
    for act in (m.fit_dimensions, m.compile):
        with pytest.raises(bm.GraphError, match="stand at one place") as caught:
            act()
        (problem,) = caught.value.problems
        assert problem.where == "dimensions.one.points"
    assert [problem.where for problem in m.check()] == ["dimensions.one.points"]


def test_dimensions_stand_in_the_document():
    m = dimensioned()
    again = bm.Linkage.from_json(m.to_json())
    assert again.to_json() == m.to_json()
    assert again.run(at=[0.3], want="joint.C.p")["joint.C.p"] == m.run(at=[0.3])["joint.C.p"]


@pytest.mark.parametrize(
    ("keys", "because"),
    [
        (("length", ["A"], 1.0), "points"),
        (("length", ["A", "B"], -1.0), "greater than 0|must be"),
        (("size", ["A", "B"], 1.0), "types: length, angle"),
        (("length", ["A", "X"], 1.0), 'no joint or marker "X"'),
    ],
)
def test_dimensions_that_make_no_sense_are_refused(keys, because):
    def add():
        m = sketch()
        m.add_dimension("one", *keys)
        m.compile()

    with pytest.raises(bm.GraphError, match=because):
        add()
