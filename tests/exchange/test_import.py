"""Drawings of other tools: the positions that their own distances give, over 24 poses."""

import json
import math

import numpy as np
import pytest

import blockmech as bm
from blockmech.exchange.pmks_plus import DIGITS, code_of
from blockmech.ground.errors import FormatError, RequestError
from tests.exchange import drawings
from tests.exchange.distances import Distances, turn

EXACT = 1e-9  # of the drawing's size


def places(linkage, angles):
    """Every named place of a linkage at driver angles from the drawn pose: joints and markers."""
    result = linkage.run(at=angles, want=["joint.*.p", "link.*.p"])
    positions = {}
    for name in result:
        parts = name.split(".")
        if parts[0] == "joint" or len(parts) == 4:
            positions.setdefault(parts[-2], result[name])
    return positions


def compared(linkage, solver, scale, sense=1.0, rename=lambda p: p):
    """The largest difference of the two, over the size; every moving point is compared."""
    angles = turn()
    expected = solver.follow([sense * q for q in angles])
    result = places(linkage, [sense * q for q in angles])
    compared = 0
    for point in solver.moving:
        name = rename(point)
        assert name in result, (point, sorted(result))
        off = np.abs(result[name] / scale - expected[point]).max() / solver.size
        assert off < EXACT, (point, off)
        compared += 1
    assert compared == len(solver.moving) > 0


def plus(code):
    """A PMKS+ code as points, links and so on, read by splitting alone: the test's own reader."""

    def whole(text):
        sign, digits = (-1, text[1:]) if len(text) > 1 and text[0] == "0" else (1, text)
        value = 0
        for c in digits:
            value = value * 64 + DIGITS.index(c)
        return sign * value / 1000

    parts = code.split(".")[4:]
    end = parts.index("")
    joints, links = parts[:end], parts[end + 1 : parts.index("", end + 1)]
    points, fixed, slots, crank = {}, [], {}, None
    for raw in joints:
        key, _, x, y, angle = raw.split(",")
        flags, key = DIGITS.index(key[0]), key[1:]
        points[key] = complex(whole(x), whole(y))
        if flags & 1:
            slots[key] = (key, whole(angle))
        elif flags & 4:
            fixed.append(key)
        if flags & 2:
            crank = key
    bodies = []
    for raw in links:
        fields = raw.split(",")
        members = [w for w in fields[7:] if w in points]
        if fields[0][1] == "P":  # the piston's points are one
            slots[members[0]] = (members[0], slots.pop(members[1])[1])
            points.pop(members[1])
        else:
            bodies.append(members)
    follower = next(p for body in bodies if crank in body for p in body if p != crank)
    return Distances(points, bodies, fixed, slots, (crank, follower))


@pytest.mark.parametrize("name", sorted(drawings.PMKS_PLUS))
@pytest.mark.parametrize("form", ["code", "address"])
def test_addresses_of_pmks_plus(name, form):
    code = drawings.PMKS_PLUS[name]
    linkage = bm.read(code if form == "code" else f"https://app.pmksplus.com/?{code}")
    assert not linkage.check()
    compared(linkage, plus(code), 0.01)
    assert "unit" not in " ".join(linkage.extras["notes"])  # the address says cm


def test_a_text_of_pmks(tmp_path):
    path = tmp_path / "fourbar.txt"
    path.write_text(drawings.PMKS_TEXT, "utf-8")
    linkage = bm.read(path, unit="mm")
    points = {"A": 100 + 100j, "B": 350 + 100j, "C": 400 + 480j, "D": 600 + 100j, "E": 500 + 125j}
    bodies = [["A", "B"], ["B", "C", "E"], ["C", "D"]]
    # 250, 383, 429 and 500 long: the crank does not turn fully, so small angles of both senses
    solver = Distances(points, bodies, ["A", "D"], {}, ("A", "B"))
    angles = [0.05 * k for k in range(1, 25)]
    expected, positions = solver.follow(angles), places(linkage, angles)
    for point in solver.moving:
        assert np.abs(positions[point] * 1000 - expected[point]).max() < EXACT * solver.size
    assert linkage.extras["notes"] == ["the file names no unit: lengths were taken as mm"]


def linkage_xml(anchors, inputs, points, links, slides):
    """The text of Linkage for a drawing."""
    rows = ['<linkage2><program zoom="1"xoffset="81" units="Millimeters" scalefactor="1"/>']
    for key, (x, y) in points.items():
        attributes = ' anchor="true"' * (key in anchors)
        if key in inputs:
            attributes += f' input="true" rpm="{inputs[key]}"'
        if key in slides:
            a, b = slides[key]
            rows.append(f'<connector id="{key}" x="{x}" y="{y}" slider="true"{attributes}>')
            rows.append(f'<slidelimit id="{a}"/><slidelimit id="{b}"/></connector>')
        else:
            rows.append(f'<connector id="{key}" x="{x}" y="{y}"{attributes}/>')
    for i, corners in enumerate(links):
        rows.append(
            f'<Link id="{i}">' + "".join(f'<connector id="{p}"/>' for p in corners) + "</Link>"
        )
    return "".join([*rows, "</linkage2>"])


@pytest.mark.parametrize("name", sorted(drawings.LINKAGE))
def test_files_of_linkage(name, tmp_path):
    anchors, inputs, points, links, slides = drawings.LINKAGE[name]
    path = tmp_path / f"{name}.linkage2"
    path.write_text(linkage_xml(anchors, inputs, points, links, slides), "utf-8")
    linkage = bm.read(path)
    at = {str(p): complex(x, y) for p, (x, y) in points.items()}
    lines = {}
    for point, (a, b) in slides.items():
        lines[str(point)] = (str(a), str(b))
        line = at[str(b)] - at[str(a)]  # the drawing has the point on its line to a pixel
        off = ((at[str(point)] - at[str(a)]) / line).imag
        at[str(point)] -= 1j * off * line
    crank = str(next(iter(inputs)))
    bodies = [[str(p) for p in corners] for corners in links]
    follower = next(p for body in bodies if crank in body for p in body if p != crank)
    solver = Distances(at, bodies, map(str, anchors), lines, (crank, follower))
    full = name in ("klann", "hoeken", "slider1")
    sense = -math.copysign(1.0, inputs[int(crank)])
    if full:
        compared(linkage, solver, 1e-3, sense)
    else:
        angles = [sense * 0.02 * k for k in range(1, 25)]
        expected, positions = solver.follow(angles), places(linkage, angles)
        for point in solver.moving:
            assert np.abs(positions[point] * 1000 - expected[point]).max() < EXACT * solver.size


def test_documents_come_back_unchanged(tmp_path):
    for code in drawings.PMKS_PLUS.values():
        linkage = bm.read(code)
        linkage.save(tmp_path / "x.json")
        again = bm.read(tmp_path / "x.json")
        assert again.to_json() == linkage.to_json()
        assert isinstance(again, bm.Linkage)


def test_the_last_character_of_an_address_counts_the_rest():
    code = drawings.PMKS_PLUS["4bar"]
    assert code_of(f"https://app.pmksplus.com/?{code}") == code
    with pytest.raises(FormatError, match=r"not whole"):
        bm.read(code[:40] + code[41:])


def test_pyslvs_and_pmks_json_say_the_same_as_the_text(tmp_path):
    rows = [("ground,a", 0, 0), ("a,b", 12.92, 32.53), ("b,c", 73.28, 67.97), ("b", 33.3, 66.95)]
    rows.append(("ground,c", 90, 0))
    text = "".join(
        f"{links},R,{x},{y},0,tff{'t' if i == 0 else 'f'}\n" for i, (links, x, y) in enumerate(rows)
    )
    joints = [
        {"X": x, "Y": y, "Angle": 0, "TypeOfJoint": "R", "Links": links.split(",")}
        for links, x, y in rows
    ]
    expression = ", ".join(f"J[R, color[Green], P[{x}, {y}], L[{links}]]" for links, x, y in rows)
    (tmp_path / "a.txt").write_text(text, "utf-8")
    (tmp_path / "a.pmks").write_text(json.dumps({"Joints": joints, "DrivingIndex": 0}), "utf-8")
    angles = [0.1, 0.2]
    first = places(bm.read(tmp_path / "a.txt", unit="mm"), angles)
    for source in (tmp_path / "a.pmks", f"M[{expression}]"):
        second = places(bm.read(source, unit="mm"), angles)
        for point in "BCD":
            assert np.abs(first[point] - second[point]).max() == 0.0


def test_what_cannot_be_taken_is_a_note_with_its_name():
    gear = "M[J[R, P[0, 0], L[ground, a]], J[R, P[0, 1], L[a, b]], J[R, P[3, 2], L[b, c]], "
    gear += "J[R, P[3, 0], L[ground, c]], J[G, P[1, 1], L[a, c]]]"
    assert (
        "gear joint E between a and c is not on the line of its wheels' centres: left out"
        in bm.read(gear).extras["notes"]
    )
    jansen = linkage_xml(
        [0, 3, 4],
        {0: 10},
        {0: (0, 0), 1: (10, 0), 2: (40, 30), 3: (50, 0), 4: (60, 0)},
        [[0, 1], [1, 2], [2, 3], [3, 4]],
        {},
    )
    jansen = jansen.replace("</linkage2>", '<ratios><ratio type="gears"/></ratios></linkage2>')
    notes = bm.read(jansen).extras["notes"]
    assert "link link_3 joins fixed points: it is part of the frame" in notes
    assert "gears_1 joins no links: left out" in notes


@pytest.mark.parametrize(
    ("kind", "ratio"), [("gears", -40 / 20), ("chain", 40 / 20)], ids=["gears", "chain"]
)
@pytest.mark.parametrize("first", [0, 1])
def test_wheels_of_linkage_turn_by_their_sizes(kind, ratio, first):
    points = {0: (0, 0), 1: (60, 0), 2: (20, 10), 3: (70, 15), 4: (40, 70)}
    text = linkage_xml([0, 1], {first: 30}, points, [[0, 2], [1, 3], [2, 4], [3, 4]], {})
    sizes = '<link id="0" size="40"/><link id="1" size="20"/>'
    pair = f'<ratios><ratio type="{kind}">{sizes}</ratio></ratios></linkage2>'
    linkage = bm.read(text.replace("</linkage2>", pair))
    assert not linkage.check()
    if first:
        ratio = 1 / ratio
    q = np.linspace(0.0, 0.3, 7)
    result = places(linkage, q)
    ends = [complex(*points[k]) for k in (first, 1 - first)]
    tips = [complex(*points[k + 2]) for k in (first, 1 - first)]
    turns = [np.exp(1j * q), np.exp(1j * ratio * q)]
    a, b = (e + (t - e) * z for e, t, z in zip(ends, tips, turns, strict=True))
    names = [str(first + 2), str(3 - first)]
    assert np.abs(result[names[0]] * 1e3 - a).max() < 1e-9
    assert np.abs(result[names[1]] * 1e3 - b).max() < 1e-9
    for end in (a, b):  # and the five-bar closes on both
        lengths = np.abs(result["4"] * 1e3 - end)
        assert np.ptp(lengths) < 1e-9 * lengths[0]


@pytest.mark.parametrize("sign", [1, -1])
def test_a_slot_on_an_arc_of_linkage_keeps_the_distance_from_its_centre(sign):
    centre, radius = 60 - 15j * sign, 55.0
    ends = [centre + radius * np.exp(1j * sign * x) for x in (0.5, 2.2)]
    pin = centre + radius * np.exp(1j * sign * 1.6)
    points = {0: (0, 0), 1: (10, 15), 2: pin, 3: ends[0], 4: ends[1], 5: pin + 20}
    points = {k: (z.real, z.imag) if isinstance(z, complex) else z for k, z in points.items()}
    bars = [[0, 1], [1, 2, 5]]
    text = linkage_xml([0, 3, 4], {0: 10}, points, bars, {2: (3, 4)})
    linkage = bm.read(text.replace('slider="true"', f'slider="true" slideradius="{sign * radius}"'))
    assert not linkage.check()
    assert "connector 2 slides on an arc" in " ".join(linkage.extras["notes"])
    at = {str(k): complex(*xy) for k, xy in points.items()} | {"c": centre}
    bodies = [[str(p) for p in corners] for corners in bars] + [["c", "2"]]
    solver = Distances(at, bodies, ["0", "3", "4", "c"], {}, ("0", "1"))
    angles = [-0.05 * k for k in range(1, 25)]
    expected, positions = solver.follow(angles), places(linkage, angles)
    for point in ("2", "5"):
        assert np.abs(positions[point] * 1000 - expected[point]).max() < EXACT * solver.size


def test_a_link_with_two_pins_on_one_arc_turns_about_its_centre():
    centre = 30 + 0j
    arc = [centre + 20 * np.exp(1j * x) for x in (0.3, 2.8, 1.0, 2.0)]
    points = {0: (0, 0), 1: (5, 15), 2: arc[2], 3: arc[3], 4: arc[0], 5: arc[1], 6: (20 + 30j)}
    points = {k: (z.real, z.imag) if isinstance(z, complex) else z for k, z in points.items()}
    text = linkage_xml(
        [0, 4, 5], {0: 10}, points, [[0, 1], [1, 6], [2, 3, 6]], {2: (4, 5), 3: (4, 5)}
    )
    linkage = bm.read(text.replace('slider="true"', 'slider="true" slideradius="20"'))
    assert not linkage.check()
    result = places(linkage, [-0.1, -0.2])
    for point in ("2", "3"):
        assert np.abs(result[point] * 1e3 - centre) == pytest.approx(20.0, abs=1e-9)


@pytest.mark.parametrize("inside", [False, True])
def test_a_gear_joint_of_pmks_is_the_pitch_point(inside):
    pitch = -0.7 if inside else 1.1  # on the line of centres, beyond the first or between both
    gear = "M[J[R, P[0, 0], L[ground, a]], J[R, P[3, 0], L[ground, b]], J[R, P[1, 1], L[a]], "
    gear += f"J[R, P[3, 2], L[b]], J[G, P[{pitch}, 0], L[a, b]]]"
    linkage = bm.read(gear)
    assert not linkage.check()
    q = np.linspace(0.0, 2.0, 5)
    result = places(linkage, q)
    ratio = pitch / (pitch - 3)  # both rims have one velocity at the pitch point
    assert np.abs(result["C"] - (1 + 1j) * np.exp(1j * q)).max() < 1e-9
    assert np.abs(result["D"] - (3 + 2j * np.exp(1j * ratio * q))).max() < 1e-9


def test_a_planetary_set_of_linkage_turns_on_its_arm():
    points = {0: (0, 0), 1: (30, 0), 2: (35, 8), 3: (5, 5)}
    text = linkage_xml([0], {0: 10}, points, [[0, 1], [1, 2], [0, 3]], {})
    sizes = '<link id="1" size="12"/><link id="2" size="18"/>'
    text = text.replace(
        "</linkage2>", f'<ratios><ratio type="gears">{sizes}</ratio></ratios></linkage2>'
    )
    notes = bm.read(text).extras["notes"]
    assert any(note.startswith("gears_1: no wheel of it is driven") for note in notes)


def test_a_slide_becomes_a_pin_in_a_slot_and_an_actuator_a_driven_length():
    anchors, inputs, points, links, slides = drawings.LINKAGE["slider1"]
    data = bm.read(linkage_xml(anchors, inputs, points, links, slides)).to_data()
    assert data["joints"]["1_slide"]["links"] == ["link_1", "slider_1"]
    lift = linkage_xml([0, 1], {}, {0: (0, 0), 1: (50, 0), 2: (40, 60)}, [[1, 2], [0, 2]], {})
    lift = lift.replace('<Link id="1">', '<Link id="1" actuator="true" throw="20" cpm="6">')
    linkage = bm.read(lift)
    assert not linkage.check()
    driver = linkage.to_data()["drivers"]["motor"]
    assert driver["to"] - driver["from"] == pytest.approx(0.02)
    length = abs(complex(40, 60)) / 1000
    result = linkage.run(at=[length, length + 0.01], want="joint.2.p")["joint.2.p"]
    assert np.abs(result) == pytest.approx([length, length + 0.01], abs=1e-12)


BOMB = '<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;">]><linkage2>&b;</linkage2>'
OUTSIDE = '<!DOCTYPE x [<!ENTITY a SYSTEM "file:///etc/passwd">]><linkage2>&a;</linkage2>'
HOSTILE = {
    "bomb": (BOMB.encode(), "entities"),
    "outside": (OUTSIDE.encode(), "entities"),
    "deep": (b"<linkage2>" + b"<a>" * 5000, "too deep"),
    "large": (b"<linkage2>" + b" " * 20_000_000, "too large"),
    "not utf-8": (b'<linkage2 name="\xff\xfe\xe4"/>', "not UTF-8"),
    "null": (b"<linkage2\0/>", "no text"),
    "empty": (b"  \n", "empty"),
    "cut": (b"<linkage2><connector", "line 1"),
    "nan": (linkage_xml([0], {0: 1}, {0: ("nan", 0), 1: (1, 0)}, [[0, 1]], {}).encode(), "number"),
    "infinite": (b"ground,a,R,1e999,0,0,tfft\na,b,R,1,1,0,tfff\n", "number"),
    "twice": (
        linkage_xml([0], {}, {0: (0, 0)}, [], {})
        .replace("</l", '<connector id="0" x="1" y="1"/></l')
        .encode(),
        "two of this number",
    ),
    "nothing": (b"hello, who is there?", "no format that is read"),
    "json nan": (b'{"joints": [{"id": "a", "position": [NaN, 0]}]}', "not a number"),
    "json type": (b'{"joints": {"position": 3}}', "position has 0 numbers"),
    "topology": (b'{"nodes": [{"joint_type": "R"}]}', "no lengths"),
    "no links": (b"<linkage2></linkage2>", "no links"),
    "unknown encoding": (b'<?xml version="1.0" encoding="foo"?><linkage2/>', '"foo"'),
    "no text encoding": (b"<?xml version='1.0' encoding='hex'?><linkage2/>", '"hex"'),
    "long integer": (
        b'{"joints": [{"id": "a", "position": [1' + b"0" * 5000 + b", 0]}]}",
        "number",
    ),
    "self": (
        b'{"joints": [{"id": "a", "type": "tracker", "position": [0, 0], "ref_joint1_id": "a", '
        b'"ref_joint2_id": "a"}], "links": []}',
        "move against",
    ),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_files_are_one_message(name, tmp_path, capsys):
    from blockmech.cli import main

    raw, message = HOSTILE[name]
    path = tmp_path / "evil.xml"
    path.write_bytes(raw)
    with pytest.raises(FormatError, match=message) as error:
        bm.read(path)
    assert len(error.value.problems) == 1
    assert main(["import", str(path)]) == 2
    err = capsys.readouterr().err
    assert "Traceback" not in err
    assert "evil.xml" in err


def test_wrong_calls_say_what_is_valid(tmp_path):
    with pytest.raises(RequestError, match=r'no unit "parsec".*mm'):
        bm.read(drawings.PMKS_PLUS["4bar"], unit="parsec")
    with pytest.raises(RequestError, match=r'no format "lnk".*linkage'):
        bm.read(drawings.PMKS_PLUS["4bar"], format="lnk")
    with pytest.raises(FormatError, match=r"no such file"):
        bm.read(tmp_path / "none.linkage2")
    with pytest.raises(RequestError, match=r"got int"):
        bm.read(3)


def test_the_command_writes_the_document_and_notes(tmp_path, capsys):
    from blockmech.cli import main

    source = tmp_path / "f.txt"
    source.write_text(drawings.PMKS_TEXT, "utf-8")
    assert main(["import", str(source), "-o", str(tmp_path / "f.json"), "--unit", "mm"]) == 0
    captured = capsys.readouterr()
    assert "note: the file names no unit: lengths were taken as mm" in captured.err
    assert main(["check", str(tmp_path / "f.json")]) == 0
    assert main(["import", str(source), "-o", str(source)]) == 2  # never over the input
    assert source.read_text("utf-8") == drawings.PMKS_TEXT


# -- pylinkage run beside -----------------------------------------------------------------------


def test_live_linkages_of_pylinkage_move_as_pylinkage_moves_them():
    pytest.importorskip("pylinkage", reason="the other tool itself")
    from pylinkage.actuators import Crank
    from pylinkage.components import Ground
    from pylinkage.dyads import FixedDyad, RRPDyad, RRRDyad
    from pylinkage.simulation import Linkage

    a, d = Ground(0.0, 0.0, name="A"), Ground(3.0, 0.0, name="D")
    pivot = Ground(9.0, 0.5, name="E")
    step = math.tau / 24
    crank = Crank(anchor=a, radius=1.0, angular_velocity=step, name="B")
    rocker = RRRDyad(crank.output, d, distance1=3.0, distance2=2.0, name="C")
    eye = FixedDyad(crank.output, rocker, distance=1.5, angle=0.4, name="P")
    slide = RRPDyad(eye, d, pivot, distance=6.0, name="S")
    linkage = Linkage([a, d, pivot, crank, rocker, eye, slide], name="six")
    ours = None
    theirs = []
    for k, positions in enumerate(linkage.step(iterations=25)):
        theirs.append([complex(*p) for p in positions])
        if k == 0:
            ours = bm.read(linkage)
    expected = dict(zip("ADEBCPS", np.array(theirs).T, strict=True))
    result = places(ours, [step * k for k in range(25)])
    for point in "BCPS":
        assert np.abs(result[point] - expected[point]).max() < EXACT * 9, point


PROFILES = {
    "harmonic": ("HarmonicMotionLaw", {}),
    "cycloidal": (
        "CycloidalMotionLaw",
        {"rise_start": 0.3, "rise_end": 2.0, "dwell_high_end": 2.0},
    ),
    "3-4-5": ("polynomial_345", {"rise_end": 2.0, "fall_end": 6.0, "dwell_high_end": 2.6}),
    "4-5-6-7": ("polynomial_4567", {"rise_end": 2.5, "total_lift": -0.2}),
}


@pytest.mark.parametrize("roller", [0.0, 0.1])
@pytest.mark.parametrize("swings", [False, True])
@pytest.mark.parametrize("profile", PROFILES)
def test_cams_of_pylinkage_move_as_pylinkage_moves_them(profile, swings, roller):
    pytest.importorskip("pylinkage", reason="the other tool itself")
    from pylinkage.actuators import Crank
    from pylinkage.cam import FunctionProfile, motion_laws
    from pylinkage.components import Ground
    from pylinkage.dyads import OscillatingCamFollower, RRRDyad, TranslatingCamFollower
    from pylinkage.simulation import Linkage

    law, edges = PROFILES[profile]
    shape = FunctionProfile(getattr(motion_laws, law)(), **{"total_lift": 0.4} | edges)
    centre, base = Ground(0.0, 0.0, name="O"), Ground(0.3 + 2.2 * swings, 0.2, name="G")
    cam = Crank(anchor=centre, radius=0.4, angular_velocity=0.1, initial_angle=0.7, name="cam")
    common = {"cam_driver": cam, "profile": shape, "roller_radius": roller, "name": "F"}
    if swings:
        common |= {"pivot_anchor": base, "arm_length": 1.5, "initial_angle": 2.4}
        follower = OscillatingCamFollower(**common)
    else:
        follower = TranslatingCamFollower(guide=base, guide_angle=1.3, **common)
    far = Ground(4.0, 3.0, name="H")
    rod = RRRDyad(anchor1=follower.output, anchor2=far, distance1=3.0, distance2=2.5, name="D")
    subject = Linkage([centre, cam, base, follower, far, rod], name="valve")
    linkage = bm.read(subject, unit="mm")
    assert not linkage.check()
    expected, angles, start = [], [], np.arctan2(cam.y, cam.x)
    for _ in subject.step(iterations=60):
        angles.append(np.arctan2(cam.y, cam.x) - start)
        expected.append([complex(part.x, part.y) for part in (follower, rod)])
    run = linkage.run(at=np.unwrap(angles), want=["joint.F.p", "joint.D.p"])
    places = np.stack([run["joint.F.p"], run["joint.D.p"]], axis=1)
    assert np.abs(1e3 * places - expected).max() < 1e-12
    assert np.ptp(run["joint.F.p"].imag) > 1e-4


def test_a_cam_of_points_is_a_closed_curve_through_them():
    pytest.importorskip("pylinkage", reason="the other tool itself")
    from pylinkage.actuators import Crank
    from pylinkage.cam import ModifiedTrapezoidalMotionLaw, PointArrayProfile
    from pylinkage.cam.profiles import FunctionProfile
    from pylinkage.components import Ground
    from pylinkage.dyads import TranslatingCamFollower
    from pylinkage.simulation import Linkage
    from scipy.interpolate import CubicSpline

    centre = Ground(0.0, 0.0, name="O")
    cam = Crank(anchor=centre, radius=0.4, angular_velocity=0.1, name="cam")
    x, r = [0.0, 0.8, 1.5, 2.6, 3.4, 4.6, 5.5, math.tau], [1.0, 1.2, 1.5, 1.55, 1.5, 1.2, 1.05, 1.0]

    def valve(profile):
        follower = TranslatingCamFollower(
            cam, profile, guide=centre, guide_angle=np.pi / 2, name="F"
        )
        return Linkage([centre, cam, follower], name="valve")

    angles = np.linspace(0.0, 6.2, 40)
    run = bm.read(valve(PointArrayProfile(x, r))).run(at=angles, want="link.F_follower.F.p")
    # pylinkage itself leaves its own curve behind the last point but one
    right = CubicSpline(x, r, bc_type="periodic")(angles)
    assert run["link.F_follower.F.p"].imag == pytest.approx(right, abs=1e-12)
    with pytest.raises(FormatError, match="its profile is a ModifiedTrapezoidalMotionLaw"):
        bm.read(valve(FunctionProfile(ModifiedTrapezoidalMotionLaw())))


def test_json_of_pylinkage(tmp_path):
    pytest.importorskip("pylinkage", reason="the other tool itself")
    from pylinkage.mechanism import fourbar
    from pylinkage.mechanism.serialization import mechanism_to_json

    mechanism = fourbar(crank=1.0, coupler=3.0, rocker=2.5, ground=3.0)
    mechanism_to_json(mechanism, tmp_path / "m.json")
    for source in (tmp_path / "m.json", mechanism):
        linkage = bm.read(source)
        data = linkage.to_data()
        assert not linkage.check()
        lengths = {
            name: [
                j["at"][j["links"].index(name)]
                for j in data["joints"].values()
                if name in j["links"]
            ]
            for name in data["links"]
        }
        spans = sorted(abs(complex(*b) - complex(*a)) for a, b in lengths.values())
        assert spans == pytest.approx([1.0, 2.5, 3.0], abs=1e-9)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "utf-16-le", "utf-16-be", "iso-8859-1"])
def test_xml_is_read_in_the_encoding_that_it_names(encoding, tmp_path):
    text = linkage_xml([0], {0: 1}, {0: (0, 0), 1: (1, 0), 2: (3, 1), 3: (4, 0)}, [], {})
    text = text.replace("<linkage2>", '<linkage2 name="B\u00fcgel">')
    path = tmp_path / "drawn.linkage2"
    path.write_bytes(f'<?xml version="1.0" encoding="{encoding}"?>{text}'.encode(encoding))
    with pytest.raises(FormatError) as refused:
        bm.read(path)
    plain = tmp_path / "plain.linkage2"
    plain.write_text(text, "utf-8")
    with pytest.raises(FormatError) as same:
        bm.read(plain)
    message, expected = (error.value.problems[0].found for error in (refused, same))
    assert message == expected


def test_a_joint_without_links_is_a_note():
    text = "M[J[R, P[0, 0], L[ground, crank]], J[R, P[10, 20], L[]], J[R, P[60, 50], L[crank]]]"
    notes = bm.read(text).extras["notes"]
    assert [note for note in notes if "on no link" in note] == ["joint B is on no link: left out"]


def test_what_no_reader_expects_is_one_message(monkeypatch):
    from blockmech.exchange import reading

    key, text = "pyslvs", "M[J[R, P[0, 0], L[ground, crank]], J[R, P[60, 50], L[crank]]]"
    broken = reading.READERS[key]._replace(read=lambda text, where: [][0])
    monkeypatch.setattr(reading, "READERS", {key: broken})
    with pytest.raises(FormatError, match="not written as its tool writes files"):
        bm.read(text)


# -- slots on moving links and welded slides, by closed forms ---------------------------------

SLOT_ON_A_LINK = (  # PMKS+ names the slot by two joints of its link; the angle's field is 0 there
    "https://app.pmksplus.com/?2P.Fe.K,0.1012.6A,A,0,0,0.0B,B,Ce,Fw,0.4C,C,d4,6G,0.0D,D,2N,Jh,0."
    "1P,P,Ce,Fw,0,CD,C,D..YRAB,AB,Fe,Fe,0,0,c5cae9,A,B,,.YRCD,CD,Fe,Fe,0,0,c5cae9,C,D,,.YPBP,BP,"
    "Fe,0,0,0,c5cae9,B,P,,...N_w"
)
WELDED_SLIDE = (  # a rod welded to the block that slides in a swinging cylinder
    "https://app.pmksplus.com/?2P.Fe.K,0.1012.4O,O,0,0,0.0C,C,0,r8,0.4G,G,ee,38,0.0N,N,Ot,MY,0."
    "8P,P,Lw,QB,0.3S,S,Lw,QB,0,GN,G,N..YROC,OC,Fe,Fe,0,0,c5cae9,O,C,,.YRGN,GN,Fe,Fe,0,0,c5cae9,G,"
    "N,,.YRPC,PC,Fe,Fe,0,0,c5cae9,P,C,,.YPPS,PS,Fe,0,0,0,c5cae9,P,S,,...N_d"
)


def rate_about(b, pivot, offset=0.0):
    """Rate of a rod whose slot passes a pivot, at the unit rate of the crank to its pin b."""
    along = b - pivot  # at the angle phi; the slot lies at phi - asin(offset / |along|)
    r2 = abs(along) ** 2
    phi, r = ((np.conj(along) * 1j * b).imag / r2), ((np.conj(along) * 1j * b).real / r2)
    return phi + offset * r / math.sqrt(r2 - offset**2)


def test_a_slot_on_a_moving_link_lies_along_it():
    linkage = bm.read(SLOT_ON_A_LINK)
    rate = linkage.run(at=[0.5], rates=1.0, want="link.CD.omega")["link.CD.omega"][0]
    turn = np.exp(0.5j)
    assert rate == pytest.approx(rate_about((0.808 + 1.018j) * turn, 2.5 + 0.4j), rel=1e-12)
    exact = rate_about(1.3 * np.exp(0.9j) * turn, 2.5 + 0.4j)  # before the address rounded
    assert exact == pytest.approx(0.1047130168807448, rel=1e-14)
    assert rate == pytest.approx(exact, rel=2e-3)  # 0.5e-3 of 0.8


def test_a_rod_welded_to_its_slide_is_one_link_with_it():
    linkage = bm.read(WELDED_SLIDE)
    assert str(linkage.decompose()).endswith("II cylinder(GN, PC, OC)>")
    assert linkage.check() == []
    extensions = np.array([-0.4, -0.05, 0.1, 0.7])  # cm
    pins = linkage.run(at=0.01 * extensions, want="joint.C.p")["joint.C.p"] * 100
    length, frame, rocker = abs(2.6 - 3.2j), abs(2.6 + 0.2j), 3.4
    cosine = (frame**2 + rocker**2 - (length + extensions) ** 2) / (2 * frame * rocker)
    angle = np.angle(2.6 + 0.2j) + np.arccos(cosine)  # law of cosines
    # the address gives the slot to 1e-3 cm, so it may miss C by as much: by its square in a length
    assert np.abs(pins - rocker * np.exp(1j * angle)).max() < 1e-7


@pytest.mark.parametrize("at", [0.0, 0.3, -0.8])
def test_a_pin_of_the_frame_in_a_slot_of_a_moving_link_guides_it(at):
    text = "M[J[R, P[0, 0], L[ground, L1]], J[R, P[3, 4], L[L1, L2]], "
    linkage = bm.read(text + "J[RP, A[-33.69], P[12, -2], L[L2, ground]]]", unit="mm")
    assert linkage.check() == []
    assert "I(L1) -> II RPR(L2, slider_C)" in repr(linkage)
    rate = linkage.run(at=[at], rates=1.0, want="link.L2.omega")["link.L2.omega"][0]
    offset = ((3 + 4j - (12 - 2j)) * np.exp(1j * math.radians(33.69 - 180))).imag
    assert rate == pytest.approx(rate_about((3 + 4j) * np.exp(1j * at), 12 - 2j, offset), rel=1e-12)
