# ruff: noqa: E501
"""What drawings of other tools say beside their places: units, loads, laws, couplings, masses."""

import math

import numpy as np
import pytest

import blockmech as bm
from blockmech.exchange.asmt import Formula, law_of
from blockmech.exchange.parsing import xml_of
from blockmech.ground.errors import FormatError, RequestError
from tests.exchange.corpus import MACHINES, digits, joint, pmks_plus
from tests.exchange.test_corpus import stamped


def address(joints, links, forces="", head="2O.Fe,1E8.K,0.1011"):
    return stamped(f"{head}.{'.'.join(joints)}..{'.'.join(links)}..{forces}.N_")


BAR = ["YRAB,AB,1jO,Fe,Fe,0,c5cae9,A,B,,"]  # 7000 of mass, 1000 of inertia, in thousandths


# -- PMKS+ -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("enum", "metre", "kg", "inertia", "newton"),
    [
        ("1011", 0.01, 1e-3, 1e-4, 1.0),
        ("2012", 1.0, 1.0, 1.0, 1.0),
        ("0000", 0.0254, 0.45359237, 0.45359237 * 0.0254**2, 4.4482216152605),
        ("101", 0.01, 1e-3, 1e-4, 1.0),
    ],
)
@pytest.mark.parametrize("flags", range(4))
def test_units_and_forces_of_an_address(enum, metre, kg, inertia, newton, flags):
    joints = [joint(6, "A", 0j), joint(0, "B", 2 + 0j)]
    ends = ",".join(map(digits, (2.0, 0.0, 2.0, 1.0, 3.0)))
    linkage = bm.read(address(joints, BAR, f"{flags}F1,AB,F1,{ends}.", f"2O.Fe,1E8.K,0.{enum}"))
    data = linkage.to_data()
    link, load = data["links"]["AB"], data["loads"]["F1"]
    assert link["mass"] == pytest.approx(7.0 * kg)
    assert link["inertia"] == pytest.approx(inertia)
    assert link["cm"] == pytest.approx([metre, 0.0])
    assert data["joints"]["A"]["at"][0] == [0.0, 0.0]
    assert load["at"] == pytest.approx([2 * metre, 0.0])
    sense = 1 if flags & 2 else -1  # the arrow points away from where it acts, or to it
    assert load["force"] == pytest.approx([0.0, sense * 3.0 * newton])
    assert load.get("axes", "ground") == ("link" if flags & 1 else "ground")


@pytest.mark.parametrize(
    ("head", "speed", "rate"),
    [
        ("2O.Fe,1E8.K,0.1011", "", 20 * math.tau / 60),
        ("2P.Fe,1E8.K,0.1011", "", -20 * math.tau / 60),
        ("0P.Fe.A,0.101", "", -10 * math.tau / 60),
        ("2P.Fe,1E8.K,0.1011", ",,,,1E8", 5 * math.tau / 60),
    ],
)
def test_speed_and_sense_of_a_turning_input(head, speed, rate):
    joints = [joint(6, "A", 0j) + speed, joint(0, "B", 2 + 0j)]
    driver = bm.read(address(joints, BAR, head=head)).to_data()["drivers"]["motor"]
    assert driver["rate"] == pytest.approx(rate)


@pytest.mark.parametrize(("head", "sense"), [("2O", 1), ("2P", -1)])
def test_a_sliding_input_has_a_speed_of_its_own(head, sense):
    # rod AB slides along x and drives nothing else; 2.5 cm/s
    joints = [joint(7, "P", 0j, 0.0), joint(8, "A", 0j), joint(0, "B", 2 + 1j)]
    links = [*BAR, "YPAP,AP,0,0,0,0,,A,P,,"]
    linkage = bm.read(address(joints, links, head=f"{head}.Fe,d4.K,0.1011"))
    driver = linkage.to_data()["drivers"]["motor"]
    assert driver["rate"] == pytest.approx(sense * 0.025)
    assert math.copysign(1.0, driver["to"]) == sense
    assert any("has no stroke in the address" in note for note in linkage.extras["notes"])


def test_gravity_is_on_unless_an_address_says_otherwise():
    joints = [joint(6, "A", 0j), joint(0, "B", 2 + 0j)]
    assert bm.read(address(joints, BAR)).to_data()["gravity"] == [0.0, -9.81]
    off = bm.read(address(joints, BAR, head="6P.Fe,1E8.K,0.1011"))
    assert "gravity" not in off.to_data()


def test_a_slot_turns_with_the_link_whose_joints_it_goes_through():
    # the angular rate of an inverted slider-crank in closed form
    b, c = 1.2 + 0.7j, MACHINES["whitworth"].points["C"]
    linkage = bm.read(pmks_plus(MACHINES["whitworth"]))
    q = np.linspace(0.1, 6.0, 24)
    result = linkage.run(at=q, rates=1.0, want="link.CD.omega")["link.CD.omega"]
    e = b * np.exp(1j * q) - c
    right = (e.conj() * 1j * b * np.exp(1j * q)).imag / np.abs(e) ** 2
    assert np.abs(result - right).max() < 1e-12


def test_links_that_are_welded_keep_their_names():
    data = bm.read(pmks_plus(MACHINES["cylinder"])).to_data()
    welds = [joint["links"] for joint in data["joints"].values() if joint["type"] == "weld"]
    assert welds == [["BE", "Ee"]]
    assert list(data["links"]) == ["AB", "CD", "BE", "Ee"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ((",CD,C,D", ",CD,C"), "its slot is CD, C, ?"),
        ((",CD,C,D", ",ZZ,C,D"), "a link and two of its joints"),
        ((",CD,C,D", ",CD,C,C"), "a link and two of its joints"),
        ((",CD,C,D", ",AB,C,D"), "a link and two of its joints"),
        (("YRCD", "YXCD"), "is no link"),
        (("YRCD", "QRCD"), "is no link"),
        ((",A,B,,", ",A,Q,,"), "no joint Q"),
        ((".0B,B,", ".0A,A,"), "is no id, or one of two"),
    ],
)
def test_an_address_that_does_not_fit_is_one_message(change, message):
    code = pmks_plus(MACHINES["whitworth"]).partition("?")[2][:-1]
    assert change[0] in code
    with pytest.raises(FormatError, match=r"address|text") as error:
        bm.read(stamped(code.replace(*change)))
    assert message in str(error.value)


@pytest.mark.parametrize("name", ["slider_crank", "whitworth_shaper", "scotch_yoke", "watt_sixbar"])
def test_an_address_that_was_written_is_the_same_mechanism(name, tmp_path):
    graph = bm.Graph.load(f"graphs/{name}.json")
    (path,) = bm.write(graph, tmp_path / "address")
    mech, back = graph.compile(), bm.read(path)
    assert not back.check()
    again = back.compile()
    (driver,) = mech.drivers
    initial = mech.scene.initial.get(driver)
    start = (
        initial.q if initial is not None else getattr(mech.scene.drive.get(driver), "start", 0.0)
    )
    angles = np.linspace(0.0, 0.3, 5)
    ours = mech.run(at=start + angles, rates=1.0, want="*.omega")
    theirs = again.run(at=angles, rates=1.0, want="link.*.omega")
    right = sorted(np.abs(ours[n]).max() for n in ours if ours[n].any())
    joints = back.to_data()["joints"].values()
    welded = {f"link.{joint['links'][1]}.omega" for joint in joints if joint["type"] == "weld"}
    rates = [np.abs(theirs[n]).max() for n in theirs if n not in welded]
    result = sorted(rate for rate in rates if rate > 1e-9)
    assert result == pytest.approx(right[-len(result) :], rel=2e-3)  # places have 10 micrometres


def test_what_an_address_cannot_say_is_refused_or_told(tmp_path):
    with pytest.raises(RequestError, match="no couplings"):
        bm.write(bm.Graph.load("graphs/geared_fivebar.json"), tmp_path / "a", to="address")
    (path,) = bm.write(bm.Graph.load("graphs/ruiz_fourbar.json"), tmp_path / "a.pmksplus", at=[0.5])
    assert "left out: loads couple" in path.read_text("utf-8")


# -- at a dead centre --------------------------------------------------------------------------


@pytest.mark.parametrize("source", ["pmks+", "pyslvs"])
def test_a_linkage_that_is_drawn_at_its_dead_centre_moves(source):
    joints = [
        joint(4, "A", 0j),
        joint(0, "B", 2 + 0j),
        joint(0, "C", 6 + 0j),
        joint(7, "P", 6 + 0j),
    ]
    links = ["YRAB,AB,0,0,0,0,,A,B,,", "YRBC,BC,0,0,0,0,,B,C,,", "YPCP,CP,0,0,0,0,,C,P,,"]
    text, scale = address(joints, links), 0.01
    if source == "pyslvs":
        text, scale = "ground,a,R,0,0,0,tfff\na,b,R,2,0,0,tfff\nground,b,RP,6,0,0,tfft\n", 1.0
    linkage = bm.read(text)
    assert not linkage.check()
    assert any("drawn at a dead centre of motor" in note for note in linkage.extras["notes"])
    q = np.linspace(-0.8, 0.0, 5)
    b = linkage.run(at=q * scale, want="joint.B.p")["joint.B.p"] / scale
    c = 6 + q  # law of cosines
    assert b.real == pytest.approx((4 + c**2 - 16) / (2 * c), abs=1e-9)
    assert np.abs(b) == pytest.approx(2.0, abs=1e-9)
    assert (b.imag[:-1] > 0).all()  # the mode that the note names


# -- formulas -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("2.0d*pi*time", 2 * math.pi * 0.3),
        ("-(1 + 2)^2/3", -3.0),
        ("2^-1", 0.5),
        ("arctan(1.0) + abs(-2)", math.pi / 4 + 2),
        ("(45.0d + 45.0d*sin((360.0d*time - 90.0d)*pi/180.0d))*pi/180.0d", None),
    ],
)
def test_formulas_are_computed(text, value):
    if value is None:
        value = math.radians(45 + 45 * math.sin(math.radians(360 * 0.3 - 90)))
    assert Formula(text, "here")(time=0.3) == pytest.approx(value, abs=1e-14)


@pytest.mark.parametrize(
    "text",
    ["", "1 +", "__import__('os')", "time.real", "x", "(lambda: 1)()", "1/0", "[1]", "1e999"],
)
def test_what_is_no_formula_is_refused(text):
    with pytest.raises(FormatError, match="here"):
        Formula(text, "here")(time=0.3)


@pytest.mark.parametrize(
    ("text", "law"),
    [
        ("3 - 2*time", "constant_rate"),
        ("0.25", "constant_rate"),
        ("1 + 70*sin(6*time - 2)", "harmonic"),
        ("cos(-3*time)*2", "harmonic"),
        ("time*time - 2*time", "rate_acceleration"),
        ("sin(time) + sin(2*time)", "trajectory"),
    ],
)
def test_laws_of_formulas_are_the_formulas(text, law):
    formula = Formula(text, "here")
    driver = law_of(formula, 2.0, False)
    assert driver["law"] == law
    m = bm.Linkage("m")
    m.add_link("a")
    m.add_joint("A", "R", ["frame", "a"], point=(0, 0))
    data = m.to_data() | {"drivers": {"d": {"joint": "A", **driver}}}
    times = np.linspace(0.0, 1.9, 7)
    q = bm.Linkage.from_data(data).run(times=times, want="driver.d.q")["driver.d.q"]
    right = [formula(time=t) for t in times]
    assert q == pytest.approx(right, abs=1e-6 if law == "trajectory" else 1e-12)


# -- assemblies -----------------------------------------------------------------------------------

EYE = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
X_UP = ((0, 0, 1), (1, 0, 0), (0, 1, 0))  # z axis along x


def gears(joints, motions="", limits="", forces="", tilt=0.0):
    """A wheel A at 0, a wheel or rack B at 3: lines of an assembly."""
    from tests.exchange.test_assemblies import assembly, turned

    rack = "rack" in joints
    at_b = (0.0, 1.0, 0.0) if rack else (3.0, 0.0, 0.0)
    side = X_UP if rack else EYE
    eye = [[x + tilt * (i != j) for j, x in enumerate(row)] for i, row in enumerate(EYE)]
    frame = {"a": ((0, 0, 0), EYE), "b": (at_b, side)}
    markers = {"m": ((0, 0, 0), EYE), "b": ((0, 0, 0), side)}
    parts = {
        "A": ((0, 0, 0), eye, markers, 1.0, (1, 1, 1), (0, 0, 0)),
        "B": (at_b, turned(0.0), markers, 1.0, (1, 1, 1), (0, 0, 0)),
    }
    pairs = {
        "Ja": ("RevoluteJoint", "a", "A/m"),
        "Jb": ("TranslationalJoint" if rack else "RevoluteJoint", "b", "B/b"),
    }
    text = assembly(frame, parts, pairs, {"drive": ("Ja", "2*time")})
    text = text.replace("\t\tMotions\n", f"{joints}\t\tMotions\n").replace(
        "\t\tGeneral", f"{limits}\t\tGeneral"
    )
    return text.replace("\tForceTorques\n", f"\tForceTorques\n{forces}")


def record(kind, name, first, second, **fields):
    lines = [
        f"\t\t\t{kind}",
        "\t\t\t\tName",
        f"\t\t\t\t\t{name}",
        "\t\t\t\tMarkerI",
        f"\t\t\t\t\t/Own/{first}",
    ]
    lines += ["\t\t\t\tMarkerJ", f"\t\t\t\t\t/Own/{second}"]
    for key, value in fields.items():
        lines += [f"\t\t\t\t{key}", f"\t\t\t\t\t{value}"]
    return "\n".join([*lines, ""])


@pytest.mark.parametrize(
    ("first", "second", "ratio"), [(1.0, 2.0, -0.5), (1.0, -2.0, 0.5), (4.0, -1.0, 4.0)]
)
@pytest.mark.parametrize("tilt", [0.0, 6e-6])
def test_a_gear_joint_turns_by_its_radii(first, second, ratio, tilt):
    pair = record("GearJoint", "mesh", "A/m", "B/b", radiusI=first, radiusJ=second)
    linkage = bm.read(gears(pair, tilt=tilt))
    assert not linkage.check()
    run = linkage.run(at=[0.0, 0.7], want="link.B.angle")
    assert run["link.B.angle"][1] == pytest.approx(ratio * 0.7, abs=1e-12)


def test_axes_that_are_none_are_refused():
    with pytest.raises(FormatError, match=r"RotationMatrix.*no axes"):
        bm.read(gears("", tilt=2e-4))


@pytest.mark.parametrize("radius", [0.4, -0.4])
@pytest.mark.parametrize("swapped", [False, True])
def test_a_rack_goes_by_what_the_pinion_rolls(radius, swapped):
    # along the x axis of the rack's marker, which is global x here
    ends = ("A/m", "B/m") if swapped else ("B/m", "A/m")
    linkage = bm.read(gears(record("RackPinionJoint", "rack", *ends, pitchRadius=radius)))
    assert not linkage.check()
    run = linkage.run(at=[0.0, 0.7], want="link.B.p")
    assert run["link.B.p"][1] - run["link.B.p"][0] == pytest.approx(radius * 0.7, abs=1e-12)


def test_limits_and_springs_of_an_assembly():
    limits = "\t\tLimits\n"
    for name, kind, value, sign in (
        ("l1", "Rotation", "-30*pi/180", "=>"),
        ("l2", "Rotation", "1.5", "=<"),
    ):
        limits += record(
            f"{kind}Limit",
            name,
            "a",
            "A/m",
            MotionJoint="/Own/Ja",
            Limit=value,
            Type=sign,
            Tol="1e-9",
        )
    spring = record(
        "InLineForceTorque",
        "spring",
        "A/m",
        "B/b",
        tension="(1 + 10.0d*(rIJ(self) - 0.5d) + 2*vrIJ(self))",
        twist="0",
    )
    pair = record("GearJoint", "mesh", "A/m", "B/b", radiusI=1.0, radiusJ=2.0)
    data = bm.read(
        gears(pair, limits=limits, forces="\n".join(line[1:] for line in spring.split("\n")))
    ).to_data()
    assert data["stops"]["motor"] == pytest.approx({"from": -math.pi / 6, "to": 1.5})
    load = data["loads"]["spring"]
    assert (load["stiffness"], load["free_length"], load["damping"]) == pytest.approx(
        (10.0, 0.4, 2.0)
    )
    assert "notes" not in data or not any("left out" in note for note in data["notes"])


# -- MJCF ------------------------------------------------------------------------------------------

SWING = """<mujoco><default><geom density="{density}"/><joint damping="0.02"/>
<default class="stiff"><joint stiffness="3" springref="20"/></default></default>
<option timestep="1e-4" integrator="RK4"/><worldbody><body name="arm" pos="0 0 1">
<joint name="A" axis="0 -1 0"/><geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02"/>
<geom type="box" size="0.02 0.03 0.04" pos="0.3 0 0.01" euler="0 30 0"/>
<body name="tip" pos="0.3 0 0"><joint name="B" class="stiff" axis="0 1 0" range="-60 80"/>
<geom type="cylinder" fromto="0 0 0 0.1 0 -0.2" size="0.015"/>
<geom type="sphere" size="0.03" pos="0.1 0 -0.2" mass="0.4"/>
<geom type="ellipsoid" size="0.02 0.03 0.05" quat="0.9 0 0.3 0"/></body></body></worldbody></mujoco>"""


@pytest.mark.parametrize("density", [1000, 2700])
def test_a_model_of_geoms_moves_as_mujoco_moves_it(density, tmp_path):
    mujoco = pytest.importorskip("mujoco", reason="the outside judge of motions")
    text = SWING.format(density=density)
    model = mujoco.MjModel.from_xml_string(text)
    state = mujoco.MjData(model)
    linkage = bm.read(text)
    data = linkage.to_data()
    for name in ("arm", "tip"):
        body = model.body(name)
        assert data["links"][name]["mass"] == pytest.approx(float(body.mass[0]), rel=1e-12)
    assert data["stops"]["motor_B"] == pytest.approx(
        {"from": math.radians(-80), "to": math.radians(60)}
    )
    linkage.stops.clear()
    for name in data["drivers"]:
        linkage.start(name)
    for _ in range(3000):
        mujoco.mj_step(model, state)
    run = linkage.compile().simulate("time=0.3", want=["driver.*.q"], accuracy=1e-10)
    result = [run["driver.motor.q"][-1], -run["driver.motor_B.q"][-1]]
    assert abs(state.qpos).min() > 0.05
    assert result == pytest.approx([state.qpos[0], state.qpos[1]], abs=2e-7)


def test_the_masses_of_a_capsule():
    text = '<mujoco><worldbody><body><joint axis="0 1 0"/>'
    text += '<geom type="capsule" size="0.02 0.15"/></body></worldbody></mujoco>'
    (link,) = bm.read(text).to_data()["links"].values()
    assert link["mass"] == pytest.approx(0.41050, abs=5e-6)
    assert link["inertia"] == pytest.approx(0.0036999, abs=5e-8)


HINGED = {  # what is in the model -> before its world, and in its one body
    "two sizes of a box between two ends": (
        "",
        '<geom type="box" fromto="0 0 0 .4 .1 .2" size=".03 .05"/>',
    ),
    "an ellipsoid between two ends": (
        "",
        '<geom type="ellipsoid" fromto="0 0 0 .1 .4 .1" size=".02"/>',
    ),
    "gravity that is off": (
        '<option><flag gravity="disable"/></option>',
        '<geom size=".1" pos="1 0 0"/>',
    ),
    "inertia that is balanced": (
        '<compiler balanceinertia="true"/>',
        '<inertial pos="0 0 1" mass="1" diaginertia="1 5 1"/>',
    ),
    "inertia beside geoms": (
        "",
        '<geom size=".1"/><inertial pos=".3 0 .1" euler="20 0 30" mass="3" diaginertia=".1 .2 .15"/>',
    ),
    "frames": (
        "",
        '<frame pos="0 0 .3" euler="0 30 0"><geom type="capsule" size=".1 .3"/><frame euler="0 0 40">'
        '<geom type="box" size=".1 .2 .3" pos="1 0 0" xyaxes="1 0 1 0 1 0"/></frame></frame>',
    ),
    "classes of frames": (
        '<default><default class="big"><geom size=".3" density="500"/></default></default>',
        '<geom size=".1" pos="1 0 0"/><frame childclass="big" pos="1 0 0"><geom/></frame>',
    ),
    "angles of other axes": (
        '<compiler angle="radian" eulerseq="zYx"/>',
        '<geom type="box" size=".1 .2 .3" pos=".1 0 .5" euler=".3 -.4 .7"/>'
        '<geom type="cylinder" size=".1 .3" axisangle="1 2 3 .5"/>',
    ),
}


@pytest.mark.parametrize("subject", HINGED)
def test_numbers_of_a_model_are_those_of_mujoco(subject):
    mujoco = pytest.importorskip("mujoco", reason="the outside judge of masses")
    before, inside = HINGED[subject]
    body = f'<body name="a"><joint name="A" axis="0 -1 0" damping=".2"/>{inside}</body>'
    text = f"<mujoco>{before}<worldbody>{body}</worldbody></mujoco>"
    model = mujoco.MjModel.from_xml_string(text)
    state = mujoco.MjData(model)
    state.qpos[:], state.qvel[:] = 0.3, 0.8
    mujoco.mj_forward(model, state)
    inertia = np.zeros(1)
    mujoco.mj_mulM(model, state, inertia, np.ones(1))
    outputs = ["driver.motor.J_red", "driver.motor.drive"]
    run = bm.read(text).run(at=[0.3], rates=0.8, want=outputs, static=True)
    assert run["driver.motor.J_red"] == pytest.approx(inertia, rel=1e-12)
    effort = state.qfrc_bias[0] - state.qfrc_passive[0]
    assert run["driver.motor.drive"][0] == pytest.approx(effort, rel=1e-12)


def test_a_hinge_may_stand_in_a_frame():
    text = """<mujoco><worldbody><body name="a" pos="0 0 1"><frame pos=".1 0 0" euler="0 90 0">
    <joint name="A" axis="0 1 0" pos="0 0 .2"/></frame><geom size=".1" pos="1 0 0"/></body></worldbody>
    </mujoco>"""
    at = bm.read(text).to_data()["joints"]["A"]["at"]
    assert at[0] == pytest.approx([0.3, 1.0], abs=1e-15)


def test_an_equality_welds_bodies_by_their_relative_pose():
    # mujoco's pose of b by its weld: 0.5 and 0.2 in the axes of a, turned by 30 degrees about y
    half = math.radians(15)
    slides = (
        '<joint name="X" type="slide" axis="1 0 0"/><joint name="Z" type="slide" axis="0 0 1"/>'
    )
    text = f"""<mujoco><worldbody><body name="a"><joint name="A" axis="0 -1 0"/><geom size=".1"/></body>
    <body name="b" pos="3 0 0">{slides}<joint name="B" axis="0 -1 0"/><geom size=".1" pos="1 0 0"/></body>
    </worldbody><equality><weld body1="a" body2="b" relpose=".5 0 .2 {math.cos(half)!r} 0
    {math.sin(half)!r} 0"/></equality></mujoco>"""
    linkage = bm.read(text)
    assert not linkage.check()
    run = linkage.run(at=[0.4], want=["link.b.p", "link.b.angle"])
    angle = 0.4 - 2 * half
    assert run["link.b.angle"][0] == pytest.approx(angle, abs=1e-12)
    centre = run["link.b.p"][0] + 3 * np.exp(1j * angle)
    assert centre == pytest.approx((0.5 + 0.2j) * np.exp(0.4j), abs=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (('<body name="a">', '<include file="b.xml"/><body name="a">'), "include.*mj_saveLastXML"),
        (("<geom", '<replicate count="2"><geom/></replicate><geom'), "replicate.*mj_saveLastXML"),
        (("<worldbody>", '<compiler coordinate="global"/><worldbody>'), "coordinates are global"),
    ],
)
def test_models_that_are_not_written_out_are_refused(change, message):
    text = '<mujoco><worldbody><body name="a"><joint axis="0 1 0"/><geom size=".1"/></body></worldbody></mujoco>'
    assert bm.read(text).links
    with pytest.raises(FormatError, match=message):
        bm.read(text.replace(*change, 1))


@pytest.mark.parametrize(
    ("attribute", "note"),
    [("gravcomp", "body gravcomp: left out"), ("bound", "compiler boundmass: left out")],
)
def test_what_changes_forces_in_a_model_is_a_note(attribute, note):
    before = '<compiler boundmass="5"/>' * (attribute == "bound")
    own = ' gravcomp="1"' * (attribute == "gravcomp")
    body = f'<body name="a"{own}><joint axis="0 1 0"/><geom size=".1"/></body>'
    linkage = bm.read(f"<mujoco>{before}<worldbody>{body}</worldbody></mujoco>")
    assert note in linkage.extras["notes"]


def test_an_equality_of_joints_is_a_coupling():
    text = """<mujoco><worldbody><body name="a"><joint name="A" axis="0 0 -1"/><inertial pos="0 0 0"
    mass="1" diaginertia="1 1 1"/></body><body name="b" pos="1 0 0"><joint name="B" type="slide"
    axis="1 0 0"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody><equality>
    <joint joint1="B" joint2="A" polycoef="0.1 0.5 0.2 0 0"/></equality>
    <actuator><position joint="A"/></actuator></mujoco>"""
    linkage = bm.read(text)
    assert not linkage.check()
    q = np.array([0.0, 0.4, -0.7])  # counter-clockwise: the hinge counts the other way
    run = linkage.run(at=q, want="link.b.p")["link.b.p"]
    right = 0.1 - 0.5 * q + 0.2 * q**2
    assert run - run[0] == pytest.approx(right - right[0], abs=1e-12)


# -- URDF and SDF -----------------------------------------------------------------------------------


def test_mimic_of_urdf_and_sdf_couples():
    inertia = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>'
    urdf = f"""<robot name="r"><link name="base"/><link name="a">{inertia}</link><link name="b"/>
    <joint name="A" type="continuous"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/></joint>
    <joint name="B" type="revolute"><parent link="base"/><child link="b"/><origin xyz="2 0 0"/>
    <axis xyz="0 0 -1"/><limit lower="-3" upper="3"/><mimic joint="A" multiplier="0.5" offset="0.1"/>
    </joint></robot>"""
    linkage = bm.read(urdf)
    assert not linkage.check()
    run = linkage.run(at=[0.0, 0.6], want="link.b.angle")["link.b.angle"]
    assert run == pytest.approx([-0.1, -0.4], abs=1e-12)
    sdf = """<sdf version="1.11"><model name="r"><link name="a"/><link name="b"><pose>2 0 0 0 0 0</pose>
    </link><joint name="A" type="revolute"><parent>world</parent><child>a</child><axis><xyz>0 0 1</xyz>
    </axis></joint><joint name="B" type="revolute"><parent>world</parent><child>b</child><axis>
    <xyz>0 0 1</xyz><mimic joint="A"><multiplier>0.5</multiplier><reference>0.2</reference></mimic>
    </axis></joint></model></sdf>"""
    linkage = bm.read(sdf)
    assert not linkage.check()
    run = linkage.run(at=[0.2, 0.6], want="link.b.angle")["link.b.angle"]
    assert run == pytest.approx([0.0, 0.2], abs=1e-12)


def test_a_gearbox_of_sdf_turns_by_its_ratio():
    parts = "".join(
        f'<link name="{n}"><pose>{x} 0 0 0 0 0</pose></link><joint name="{n.upper()}" type="revolute">'
        f"<parent>world</parent><child>{n}</child><axis><xyz>0 0 1</xyz></axis></joint>"
        for n, x in (("a", 0), ("b", 3))
    )
    box = '<joint name="G" type="gearbox"><parent>a</parent><child>b</child><gearbox_ratio>2</gearbox_ratio>'
    box += "<gearbox_reference_body>world</gearbox_reference_body><axis><xyz>0 0 1</xyz></axis></joint>"
    linkage = bm.read(f'<sdf version="1.9"><model name="g">{parts}{box}</model></sdf>')
    assert not linkage.check()
    run = linkage.run(at=[0.0, 0.3], want="link.b.angle")["link.b.angle"]
    assert run[1] == pytest.approx(-0.6, abs=1e-12)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            '<robot name="r"><link name="a"/><joint name="j" type="fixed"><parent link="a"/><child link="q"/></joint></robot>',
            "no link q",
        ),
        (
            '<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="floating"><parent link="a"/><child link="b"/></joint></robot>',
            "it is a floating",
        ),
        (
            '<robot name="r" xmlns:xacro="x"><xacro:property name="w" value="1"/></robot>',
            "xacro FILE > robot.urdf",
        ),
        (
            '<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="fixed"><parent link="a"/><child link="b"/></joint><joint name="k" type="fixed"><parent link="b"/><child link="a"/></joint></robot>',
            "its joints and frames go round in a circle. a tree of links",
        ),
        ('<sdf version="1.9"><world name="w"/></sdf>', "it has no model"),
        (
            '<sdf version="1.9"><model name="m"><link name="a"/><joint name="j" type="revolute"><parent>a</parent><child>q</child></joint></model></sdf>',
            "no link, joint or frame q|no link q",
        ),
    ],
)
def test_robots_that_cannot_be_read(text, message, tmp_path):
    path = tmp_path / "robot.xml"
    path.write_text(text, "utf-8")
    with pytest.raises(FormatError, match=message) as error:
        bm.read(path)
    assert len(error.value.problems) == 1


def urdf(*joints, rest=""):
    """A robot of pins, each a name, its two links and its place on the first."""
    parts = [f'<link name="{link}"/>' for link in "abcd"]
    parts += [
        f'<joint name="{name}" type="continuous"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}"/><axis xyz="0 0 1"/></joint>'
        for name, parent, child, xyz in joints
    ]
    return f'<robot name="r">{"".join(parts)}{rest}</robot>'


GAZEBO = """<gazebo><joint name="{}" type="revolute"><parent>a</parent><child>c</child>
  <axis><xyz>0 0 1</xyz></axis></joint></gazebo>"""


@pytest.mark.parametrize(
    ("name", "numbered"), [("j", ["j", "j_2", "j_3"]), ("", ["frame_b", "b_c", "frame_c"])]
)
def test_joints_of_urdf_of_one_name_or_none_are_all_there(name, numbered):
    text = urdf((name, "a", "b", "0 0 0"), (name, "b", "c", "1 0 0"), rest=GAZEBO.format(name))
    joints = bm.read(text).to_data()["joints"]
    assert list(joints) == numbered
    assert [row["links"] for row in joints.values()] == [["frame", "b"], ["b", "c"], ["frame", "c"]]


def test_a_joint_that_closes_a_loop_comes_behind_those_of_the_tree():
    loop = """<loop_joint name="D" type="revolute"><link1 link="a" xyz="4 0 0"/>
      <link2 link="d" xyz="1 -2 0"/><axis xyz="0 0 1"/></loop_joint>"""
    tree = [("A", "a", "b", "0 0 0"), ("B", "b", "c", "0 1 0"), ("C", "c", "d", "3 1 0")]
    data = bm.read(urdf(*tree, rest=loop)).to_data()
    assert list(data["joints"]) == ["A", "B", "C", "D"]
    assert [row["joint"] for row in data["drivers"].values()] == ["A"]


def test_text_of_an_element_ends_where_another_begins_in_it():
    root = xml_of("<a>1 <!-- of many -->2\n3<b>4</b> 5</a>", "text")
    assert root.text == "1 2\n3"
    assert root.get("b") == "4"


def test_a_negative_mass_is_one_message():
    joints = [joint(6, "A", 0j), joint(0, "B", 2 + 0j)]
    with pytest.raises(FormatError, match=r"link AB has the mass -0.007 kg.*0 or more"):
        bm.read(address(joints, [BAR[0].replace(",1jO,", ",01jO,")]))


INERTIAL = "<inertial><pose>0.1 0 0 0 0 0</pose><mass>2</mass></inertial>"


def robot(turn, around="{}", scope=""):
    """A rocker on the coupler of a crank, its links turned about y, names in a scope."""
    axis = "<axis><xyz>0 1 0</xyz><limit><lower>-inf</lower><upper>inf</upper></limit></axis>"
    model = f"""<model name="m"><pose>0 0 1 0 0 0</pose>
      <frame name="D" attached_to="{scope}base"><pose>0.35 0 0 0 0 0</pose></frame>
      <link name="base"/><link name="crank"><pose relative_to="A"/>{INERTIAL}</link>
      <link name="rod"><pose relative_to="B"/></link>
      <joint name="fixed" type="fixed"><parent>world</parent><child>base</child></joint>
      <joint name="A" type="revolute"><pose relative_to="base" {turn}</pose>
        <parent>base</parent><child>crank</child>{axis}</joint>
      <joint name="B" type="revolute"><pose relative_to="crank">0.1 0 0 0 0 0</pose>
        <parent>crank</parent><child>rod</child>{axis}</joint>
      <link name="arm"><pose relative_to="D">0 0 0.2 0 0 0</pose></link>
      <joint name="E" type="revolute"><pose>0 0 -0.2 0 0 0</pose><parent>D</parent>
        <child>arm</child>{axis}</joint>
      <joint name="C" type="revolute"><parent>rod</parent><child>arm</child>{axis}</joint></model>"""
    return f'<sdf version="1.9">{around.format(model.replace(f"{scope}base", "base"))}</sdf>'


TURNS = {
    "radians": ">0 0 0 0 -0.7 0",
    "degrees": f'degrees="true">0 0 0 0 {math.degrees(-0.7)!r} 0',
    "quaternion": f'rotation_format="quat_xyzw">0 0 0 0 {math.sin(-0.35)!r} 0 {math.cos(-0.35)!r}',
}
GROUND = '<model name="ground"><static>true</static><link name="link"/></model>'


@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("around", ["{}", f'<world name="w">{GROUND}{{}}</world>'])
def test_poses_of_sdf(turn, around):
    linkage = bm.read(robot(TURNS[turn], around))
    assert not linkage.check()
    data = linkage.to_data()
    assert data["joints"].pop("fixed")["links"] == ["frame", "base"]
    positions = {name: complex(*joint["at"][0]) for name, joint in data["joints"].items()}
    pin = 1j + 0.1 * np.exp(0.7j)
    expected = {"A": 1j, "B": pin, "E": 0.35 + 1j, "C": 0.35 + 1.2j}
    assert positions == pytest.approx(expected, abs=1e-14)
    assert not data.get("stops")
    assert data["links"]["crank"]["mass"] == 2.0
    assert complex(*data["links"]["crank"]["cm"]) == pytest.approx(pin)
    assert data["links"]["rod"]["mass"] == data["links"]["rod"]["inertia"] == 1.0  # of SDF itself


@pytest.mark.parametrize(
    ("version", "frame", "angle"),
    [
        ("1.4", "", 0.0),
        ("1.6", "<use_parent_model_frame>1</use_parent_model_frame>", 0.0),
        ("1.6", "", 0.7),
        ("1.11", "", 0.7),
    ],
)
def test_axes_of_sdf_are_in_the_frame_that_their_version_has(version, frame, angle):
    text = f"""<sdf version="{version}"><model name="m"><link name="a"><pose>0 0 0 0 -0.7 0</pose></link>
      <joint name="S" type="prismatic"><parent>world</parent><child>a</child><axis>{frame}
      <xyz>1 0 0</xyz></axis></joint><link name="b"/><joint name="B" type="revolute"><parent>a</parent>
      <child>b</child><axis><xyz>0 1 0</xyz></axis></joint></model></sdf>"""
    assert bm.read(text).to_data()["joints"]["S"]["angle"][0] == pytest.approx(angle, abs=1e-15)


def test_a_link_without_gravity_is_a_note():
    text = robot(TURNS["radians"]).replace(
        '<link name="base"/>', '<link name="base"><gravity>0</gravity></link>'
    )
    assert "gravity acts on base, too" in bm.read(text).extras["notes"]


def test_links_of_nested_models_are_told_apart():
    inner = '<model name="in"><pose>0 0 1 0 0 0</pose><link name="a"/></model>'
    joints = """<joint name="j" type="revolute"><parent>a</parent><child>in::a</child>
      <axis><xyz>0 1 0</xyz></axis></joint>"""
    fixed = '<joint name="w" type="fixed"><parent>world</parent><child>a</child></joint>'
    text = (
        f'<sdf version="1.9"><model name="m"><link name="a"/>{inner}{fixed}{joints}</model></sdf>'
    )
    data = bm.read(text).to_data()
    assert list(data["links"]) == ["a", "in::a"]
    assert data["joints"]["w"] | {"type": "weld", "links": ["frame", "a"]} == data["joints"]["w"]
    assert data["joints"]["j"]["at"][0] == [0.0, 1.0]


def test_ros2_control_names_what_is_driven():
    links = '<link name="base"/><link name="a"/><link name="b"/>'
    joints = "".join(
        f'<joint name="{child}" type="continuous"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="1 0 0"/><axis xyz="0 0 1"/></joint>'
        for parent, child in (("base", "a"), ("a", "b"))
    )
    command = '<joint name="b"><command_interface name="velocity"/></joint><joint name="a"/>'
    control = f'<ros2_control name="c" type="system">{command}</ros2_control>'
    linkage = bm.read(f'<robot name="r" xmlns:xacro="x">{links}{joints}{control}</robot>')
    notes = linkage.extras["notes"]
    assert notes == ["not all is driven: a was taken, without a law of motion"]


def test_a_drive_too_many_is_left_out_with_a_note():
    above = '<body name="{0}" pos="{1}"><joint name="{0}"/><geom size=".1"/>{2}</body>'
    bodies = above.format("a", "0 0 0", above.format("b", "0 1 0", ""))
    bodies += above.format("c", "2 0 0", "")
    loop = '<connect body1="b" body2="c" anchor="2 1 0"/>'
    motors = "".join(f'<motor joint="{name}"/>' for name in "ab")
    model = f"<worldbody>{bodies}</worldbody><equality>{loop}</equality>"
    linkage = bm.read(f'<mujoco model="m">{model}<actuator>{motors}</actuator></mujoco>')
    assert not linkage.check()
    assert list(linkage.drivers) == ["motor"]
    assert "drive of b, which follows from the others: left out" in linkage.extras["notes"]
