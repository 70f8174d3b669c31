"""Assemblies of FreeCAD: OndselSolver's own numbers, and what is not planar."""

import cmath
import math

import pytest

import blockmech as bm
from blockmech.ground.errors import FormatError

EYE = ((1, 0, 0), (0, 1, 0), (0, 0, 1))


def block(depth, *lines):
    return [("\t" * depth) + line for line in lines]


def pose(depth, position, axes=EYE):
    rows = ["\t".join(repr(float(x)) for x in row) for row in axes]
    return [
        *block(depth, "Position3D"),
        *block(depth + 1, "\t".join(repr(float(x)) for x in position)),
        *block(depth, "RotationMatrix"),
        *block(depth + 1, *rows),
    ]


def points(depth, markers, z=0.0):
    lines = block(depth, "RefPoints")
    for name, (position, axes) in markers.items():
        lines += block(depth + 1, "RefPoint") + pose(depth + 2, (0, 0, z))
        lines += block(depth + 2, "Markers") + block(depth + 3, "Marker")
        lines += block(depth + 4, "Name") + block(depth + 5, name) + pose(depth + 4, position, axes)
    return lines


def assembly(frame, parts, joints, motions=(), gravity=(0, -9.81, 0), after=()):
    """A text ``.asmt``. Parts: name -> (place, axes, markers, mass, moments, centre)."""
    lines = ["OndselSolver", "Assembly", "\tName", "\t\tOwn", *pose(1, (0, 0, 0))]
    lines += [*points(1, frame), "\tParts"]
    for name, (position, axes, markers, mass, moments, centre) in parts.items():
        lines += block(2, "Part") + block(3, "Name") + block(4, name) + pose(3, position, axes)
        lines += block(3, "PrincipalMassMarker") + pose(4, centre)
        lines += block(4, "Mass") + block(5, repr(mass)) + block(4, "MomentOfInertias")
        lines += block(5, "\t".join(map(repr, moments))) + points(3, markers, 0.1)
    lines += ["\tConstraintSets", "\t\tJoints"]
    for name, (kind, first, second) in joints.items():
        lines += block(3, kind) + block(4, "Name") + block(5, name)
        lines += block(4, "MarkerI") + block(5, f"/Own/{first}")
        lines += block(4, "MarkerJ") + block(5, f"/Own/{second}")
    lines.append("\t\tMotions")
    for name, (joint, formula) in dict(motions).items():
        lines += block(3, "RotationalMotion") + block(4, "Name") + block(5, name)
        lines += block(4, "MotionJoint") + block(5, f"/Own/{joint}")
        lines += block(4, "RotationZ") + block(5, formula)
    lines += ["\t\tGeneralConstraintSets", "\tForceTorques", "\tConstantGravity"]
    lines += ["\t\t" + "\t".join(map(repr, gravity)), *after, "TimeSeries", "Number\tInput\t1"]
    return "\n".join(lines) + "\n"


def turned(angle):
    c, s = math.cos(angle), math.sin(angle)
    return ((c, -s, 0), (s, c, 0), (0, 0, 1))


# Numbers of OndselSolver's testapp/fourbar.asmt; angles are its Bryantz at t = 0.
PARTS = {
    "Part1": (complex(-0.1, -0.1), 0.0, (0.9, 0.1), 0.2, 0.017333333333333, (0.5, 0.1)),
    "Part2": (
        complex(0.80296435866847, -0.1413902845944),
        0.80636087982073,
        (1.9, 0.1),
        0.4,
        0.13466666666667,
        (1.0, 0.1),
    ),
    "Part3": (
        complex(1.9494211444078, 1.4026552603427),
        -1.6060600451779,
        (1.4, 0.1),
        0.3,
        0.05725,
        (0.75, 0.1),
    ),
}
# t [s] -> part -> its place and angle, from the file's TimeSeries
THEIRS = {
    0.14: {
        "Part2": (0.45442821308631 + 0.48633933973924j, 0.382026212757),
        "Part3": (2.095004383962 + 1.4003478735758j, -1.7098434062524),
    },
    0.37: {
        "Part2": (-0.62017324903315 + 0.46177229935752j, 0.24683404509448),
        "Part3": (1.0574079378963 + 1.0399616360516j, -0.90577940536633),
    },
    0.71: {
        "Part2": (-0.17908590450014 - 0.91488560558938j, 0.92633817779122),
        "Part3": (0.74537392759149 + 0.62921651157039j, -0.53616806944798),
    },
}
JOINTS = {
    "Joint1": ("RevoluteJoint", "Marker2", "Part1/Marker1"),
    "Joint2": ("RevoluteJoint", "Part1/Marker2", "Part2/Marker1"),
    "Joint3": ("RevoluteJoint", "Part2/Marker2", "Part3/Marker1"),
    "Joint4": ("RevoluteJoint", "Part3/Marker2", "Marker1"),
}
FRAME = {"Marker1": ((2, 0, 0), EYE), "Marker2": ((0, 0, 0), EYE)}


def fourbar(upright=False, **changes):
    """OndselSolver's four-bar; upright, x and z are the coordinates of its plane."""

    def spatial(z):
        return (z.real, 0.3, z.imag) if upright else (z.real, z.imag, 0.3)

    up = ((1, 0, 0), (0, 0, -1), (0, 1, 0))  # z axis of markers along -y

    def axes(angle):
        own = turned(angle)
        if not upright:
            return own
        return [
            [sum(a * b for a, b in zip(r, c, strict=True)) for c in zip(*own, strict=True)]
            for r in up
        ]

    parts = {
        name: (
            spatial(z),
            axes(angle),
            {"Marker1": ((0.1, 0.1, 0), EYE), "Marker2": ((*end, 0), EYE)},
            mass,
            (0.1, 0.2, inertia),
            (*cm, 0.0),
        )
        for name, (z, angle, end, mass, inertia, cm) in PARTS.items()
    }
    frame = changes.pop("frame", None) or {
        n: (spatial(complex(*p[:2])), axes(0.0)) for n, (p, _) in FRAME.items()
    }
    gravity = (0, 0, -9.81) if upright else (0, -9.81, 0)
    fields = {"joints": JOINTS, "motions": {"Motion1": ("Joint1", "2.0d*pi*time")}}
    return assembly(frame, parts, gravity=gravity, **fields | changes)


@pytest.mark.parametrize("upright", [False, True])
def test_a_fourbar_moves_as_ondsel_moves_it(upright, tmp_path):
    (tmp_path / "fourbar.asmt").write_text(fourbar(upright), "utf-8")
    linkage = bm.read(tmp_path / "fourbar.asmt")
    assert not linkage.check()
    data = linkage.to_data()
    assert data["gravity"] == pytest.approx([0.0, -9.81])
    assert data["drivers"]["motor"]["rate"] == pytest.approx(2 * math.pi)
    for name, (z, angle, _, mass, inertia, cm) in PARTS.items():
        body = data["links"][name]
        assert (body["mass"], body["inertia"]) == pytest.approx((mass, inertia))
        assert complex(*body["cm"]) == pytest.approx(z + complex(*cm) * cmath.exp(1j * angle))
    times = list(THEIRS)
    run = linkage.run(at=[2 * math.pi * t for t in times], want=["link.*.p", "link.*.angle"])
    for k, t in enumerate(times):
        for part, (position, angle) in THEIRS[t].items():
            reference, first = PARTS[part][:2]
            turn = run[f"link.{part}.angle"][k]
            result = run[f"link.{part}.p"][k] + reference * cmath.exp(1j * turn)
            assert abs(result - position) < 1e-9, (part, t)
            assert abs(cmath.phase(cmath.exp(1j * (turn + first - angle)))) < 1e-9


def part(position, mass=1.0, centre=(0, 0, 0), **markers):
    """A part with markers in its own axes: places, or pairs of place and axes."""
    markers = {k: z if isinstance(z[0], tuple) else (z, EYE) for k, z in markers.items()}
    return (position, EYE, markers, mass, (1, 1, 1), centre)


def test_a_cylindrical_joint_in_the_plane_is_a_guide(tmp_path):
    axes = ((0, 0, 1), (1, 0, 0), (0, 1, 0))  # z axis along x
    parts = {
        "crank": part((0, 0, 0), a=(0, 0, 0), b=(0, 1, 0)),
        "rod": part((0, 1, 0), a=(0, 0, 0), b=(2, -1, 0)),
        "piston": part((2, 0, 0), a=(0, 0, 0), g=((0, 0, 0), axes)),
        "cap": part((2, 0, 0), 3.0, (1, 0, 0), a=(0, 0, 0)),
    }
    joints = {
        "A": ("RevoluteJoint", "o", "crank/a"),
        "B": ("RevoluteJoint", "crank/b", "rod/a"),
        "C": ("RevoluteJoint", "rod/b", "piston/a"),
        "S": ("CylindricalJoint", "piston/g", "g"),
        "welded": ("FixedJoint", "piston/a", "cap/a"),
        "flat": ("ScrewJoint", "piston/a", "o"),
    }
    frame = {"o": ((0, 0, 0), EYE), "g": ((5, 0, 0), axes)}
    text = assembly(frame, parts, joints, {"m": ("A", "time*time")})
    (tmp_path / "s.asmt").write_text(text, "utf-8")
    linkage = bm.read(tmp_path / "s.asmt")
    assert not linkage.check()
    assert linkage.to_data()["joints"]["welded"]["links"] == ["piston", "cap"]
    masses = {name: link["mass"] for name, link in linkage.to_data()["links"].items()}
    assert masses == {"crank": 1.0, "rod": 1.0, "piston": 1.0, "cap": 3.0}
    assert linkage.to_data()["links"]["cap"]["cm"] == pytest.approx([3.0, 0.0])
    run = linkage.run(at=[0.0, 0.4], want="link.piston.p")
    x = math.sin(-0.4) + math.sqrt(5 - math.cos(0.4) ** 2)
    assert run["link.piston.p"][1] == pytest.approx(x - 2, abs=1e-12)
    notes = linkage.extras["notes"]
    assert any("ScrewJoint flat: left out" in note for note in notes)
    motor = linkage.to_data()["drivers"]["motor"]
    assert motor["law"] == "rate_acceleration"
    assert motor["acceleration"] == pytest.approx(2.0)


GENERAL = {"rIJI1": "0.3 - 2*time", "rIJI2": "0.1*sin(2*pi*time)", "rIJI3": "0", "angIJJ1": "0"}
GENERAL |= {"angIJJ2": "0", "angIJJ3": "0.5*time"}


@pytest.mark.parametrize("order", ["", "3 1 2"])
def test_a_general_motion_is_two_slides_and_a_pin(order, tmp_path):
    parts = {"boat": part((0.3, 0, 0), a=(0, 0, 0)), "bar": part((0.3, 0, 0), a=(0, 0, 0))}
    joints = {"A": ("RevoluteJoint", "boat/a", "bar/a")}
    lines = block(3, "GeneralMotion") + block(4, "Name", "\tm")
    lines += block(4, "MarkerI", "\t/Own/o", "MarkerJ", "\t/Own/boat/a")
    formulas = GENERAL if not order else GENERAL | {"angIJJ1": "0.5*time", "angIJJ3": "0"}
    for key, formula in (formulas | {"RotationOrder": order or "1 2 3"}).items():
        lines += block(4, key, f"\t{formula}")
    text = assembly({"o": ((0, 0, 0), EYE)}, parts, joints, {"f": ("A", "0")})
    text = text.replace("\t\tMotions\n", "\n".join(["\t\tMotions", *lines, ""]))
    (tmp_path / "g.asmt").write_text(text, "utf-8")
    linkage = bm.read(tmp_path / "g.asmt")
    assert not linkage.check()
    laws = [driver["law"] for driver in linkage.to_data()["drivers"].values()]
    assert laws == ["constant_rate", "constant_rate", "harmonic", "constant_rate"]
    t = 0.2
    run = linkage.run(times=[t], want=["joint.A.p", "link.boat.angle"])
    position = complex(0.3 - 2 * t, 0.1 * math.sin(math.tau * t))
    assert run["joint.A.p"][0] == pytest.approx(position, abs=1e-14)
    assert run["link.boat.angle"][0] == pytest.approx(0.5 * t)


def test_slides_alone_have_a_plane_and_rods_join_pins(tmp_path):
    side, up = ((0, 0, 1), (1, 0, 0), (0, 1, 0)), ((1, 0, 0), (0, 0, 1), (0, -1, 0))
    parts = {
        "x": part((0, 0, 0), s=((0, 0, 0), side), t=((0, 0, 0), up)),
        "y": part((0, 0, 0), t=((0, 0, 0), up), p=(0, 0, 0)),
    }
    joints = {"X": ("TranslationalJoint", "o", "x/s"), "Y": ("TranslationalJoint", "x/t", "y/t")}
    frame = {"o": ((0, 0, 0), side), "q": ((3, 4, 0), EYE)}
    (tmp_path / "xy.asmt").write_text(assembly(frame, parts, joints), "utf-8")
    linkage = bm.read(tmp_path / "xy.asmt")
    assert not linkage.check()
    run = linkage.run(at=dict(zip(linkage.drivers, ([2.0], [-1.0]), strict=True)))
    assert abs(run["link.y.p"][0]) == pytest.approx(math.hypot(2, 1))
    joints["rod"] = ("RevRevJoint", "y/p", "q")
    (tmp_path / "rod.asmt").write_text(assembly(frame, parts, joints), "utf-8")
    linkage = bm.read(tmp_path / "rod.asmt")
    assert not linkage.check()
    assert len(linkage.drivers) == 1
    run = linkage.run(at=[0.5], want="link.y.p")
    assert abs(run["link.y.p"][0] - (3 + 4j)) == pytest.approx(5.0, abs=1e-12)


def leaning():
    """The four-bar with one joint of the frame whose marker leans."""
    frame = {"Marker1": ((2, 0, 0), LEANING), "Marker2": ((0, 0, 0), EYE)}
    return fourbar(frame=frame)


LEANING = ((1, 0, 0), (0, 0.8, -0.6), (0, 0.6, 0.8))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("OndselSolver\nAssembly\n\tName\n", "no joint that turns"),
        ("OndselSolver\nAssembly\n\t\t\tName\n", "deeper than a level"),
        (
            fourbar(joints={**JOINTS, "Joint4": ("RevoluteJoint", "Part3/Marker9", "Marker1")}),
            'no marker "/Own/Part3/Marker9"',
        ),
        (fourbar().replace("\t0.1\t0.2\t", "\tnan\t0.2\t", 1), "not a number"),
        (fourbar().replace("2.0\t0.0\t0.3", "2.0\t0.0", 1), "3 numbers"),
        (
            fourbar(joints={**JOINTS, "Joint3": ("RevoluteJoint", "Part2/Marker2", "leaning")}),
            "no marker",
        ),
        (leaning(), "not parallel"),
        (fourbar().replace("1.0\t0.0\t0.0", "1.0\t0.5\t0.0", 2), "no axes|no joint that turns"),
    ],
)
def test_assemblies_that_cannot_be_read(text, message, tmp_path, capsys):
    from blockmech.cli import main

    (tmp_path / "a.asmt").write_text(text, "utf-8")
    with pytest.raises(FormatError, match=message) as error:
        bm.read(tmp_path / "a.asmt")
    assert len(error.value.problems) == 1
    assert main(["import", str(tmp_path / "a.asmt")]) == 2
    assert "Traceback" not in capsys.readouterr().err
