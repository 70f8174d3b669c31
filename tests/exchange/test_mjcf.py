"""MuJoCo moves what is written for it as `simulate` moves the mechanism."""

import re

import numpy as np
import pytest

import blockmech as bm
from tests.gallery import changed, document, mechanism

mujoco = pytest.importorskip("mujoco", reason="the outside judge of motions")
MACHINES = {  # graph -> duration [s] and step [s]
    "watt_sixbar": (0.5, 2e-4),
    "stephenson_3": (0.3, 1e-4),
    "stephenson_3_triad": (0.3, 1e-4),
    "stephenson_2_class_4": (0.3, 1e-4),
    "fivebar_falling": (0.2, 1e-4),
    "ruiz_fourbar": (0.3, 1e-4),
    "pump": (0.2, 1e-4),  # this and those below: guides
    "engine": (0.2, 1e-4),
    "toggle_press": (0.2, 1e-4),
    "slider_crank_offset": (0.2, 1e-4),
    "elliptic_trammel": (0.2, 1e-4),
    "oldham_coupling": (0.2, 1e-4),
    "whitworth_shaper": (0.2, 1e-4),
}
STARTS = {"elliptic_trammel": 0.3, "whitworth_shaper": 0.5}
LIGHT = ("slider_crank_offset", "elliptic_trammel", "oldham_coupling", "whitworth_shaper")
AGREE = 1e-6


def bare(name):
    """A mechanism of the gallery under its weight alone: no loads, no friction."""
    data = document(name)
    gone = {b for b, x in data["blocks"].items() if x["type"].startswith(("load.", "coupling."))}
    data["blocks"] = {b: x for b, x in data["blocks"].items() if b not in gone}
    for block in data["blocks"].values():
        block.pop("friction", None)
    data["wires"] = [
        w for w in data["wires"] if not gone & {w["to"].split(".")[0], w["from"].split(".")[0]}
    ]
    scene = data.setdefault("scene", {})
    scene["gravity"] = [0.0, -9.81]
    scene.pop("stops", None)
    if name in LIGHT:
        for block, block_data in changed(
            data | {"scene": {"gravity": [0, 0]}}
        ).structure.blocks.items():
            for i, link in enumerate(block_data.link_names):
                body = {"mass": 1.0 + 0.3 * i, "inertia": 0.1, "cm": [0.05, 0.02 * i]}
                data["blocks"][block].setdefault("links", {}).setdefault(link, {}).update(body)
    if not scene.get("initial"):
        drivers = changed(data | {"scene": {"gravity": [0, 0]}}).drivers
        scene["initial"] = {d: {"q": STARTS.get(name, 1.0), "rate": 0.0} for d in drivers}
    for start in scene["initial"].values():
        start["rate"] = 0.0
    return changed(data)


@pytest.mark.parametrize("name", MACHINES)
def test_mujoco_agrees(name, tmp_path):
    mech = bare(name)
    end, step = MACHINES[name]
    (path,) = bm.write(mech, tmp_path / "m.xml", step=step)
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    times, positions = [0.0], [np.zeros(len(mech.drivers))]
    joints = [model.joint(str(ref)).qposadr[0] for ref in mech.structure.driven.values()]
    while data.time < end - step / 2:
        mujoco.mj_step(model, data)
        times.append(data.time)
        positions.append(data.qpos[joints].copy())
    some = np.linspace(0, len(times) - 1, 7).astype(int)
    names = [mech._of_driver(d, "q") for d in mech.drivers]
    ours = mech.simulate(
        f"time={times[-1]}", times=np.array(times)[some], want=names, accuracy=1e-9
    )
    for k, column in enumerate(names):
        moved = ours[column] - ours[column][0]
        assert np.ptp(moved) > 0.01
        assert np.abs(np.array(positions)[some, k] - moved).max() < AGREE * max(1.0, np.ptp(moved))


def test_what_is_left_out_is_named(tmp_path):
    (path,) = bm.write(mechanism("ruiz_fourbar"), tmp_path / "m.xml", at=[0.5])
    text = path.read_text("utf-8")
    assert "left out: loads: couple, weightlike" in text
    assert "left out: friction: crank.A" in text
    with pytest.raises(bm.RequestError, match=r"closes at disc.i without mass.*give it mass"):
        bm.write(mechanism("oldham_coupling"), tmp_path / "m.xml", at=[0.5])
    with pytest.raises(bm.RequestError, match=r"coupling"):
        bm.write(mechanism("geared_fivebar"), tmp_path / "m.xml", at=[0.5])


@pytest.mark.parametrize("name", MACHINES)
def test_what_was_written_comes_back_as_the_same_mechanism(name, tmp_path):
    mech = bare(name)
    (path,) = bm.write(mech, tmp_path / "m.xml")
    back = bm.read(path)
    assert not back.check()
    again = back.compile()
    angles = np.linspace(0.0, 0.15, 24)
    starts = {d: mech.scene.initial[d].q for d in mech.drivers}
    ours = mech.run(at={d: q + angles for d, q in starts.items()}, want=["*.p", "*.J_red"])
    theirs = again.run(at=dict.fromkeys(again.drivers, angles), want=["joint.*.p", "*.J_red"])
    compared = 0
    for column in theirs:
        if column.startswith("joint."):
            ref = column.split(".")[1].replace("_", ".", 1) + ".p"
            if ref in ours:
                assert np.abs(theirs[column] - ours[ref]).max() < 1e-9 * 10, column
                compared += 1
    assert compared >= 2
    if len(mech.drivers) == 1:
        first, second = (
            r[f"{m._of_driver(m.drivers[0], 'J_red')}"] for r, m in ((ours, mech), (theirs, again))
        )
        assert second == pytest.approx(first, rel=1e-6)  # links without mass come back with 1e-9


def test_a_model_with_quaternions_and_degrees_in_the_upright_plane(tmp_path):
    text = """<mujoco><worldbody>
    <body name="arm" pos="1 0 2" quat="0.9659258262890683 0 0.25881904510252074 0">
    <joint name="A" axis="0 1 0"/><inertial pos="1 0 0" mass="2" diaginertia="1 0.5 1"/>
    <body name="rod" pos="2 0 0" euler="0 90 0"><joint name="B" axis="0 1 0"/>
    <inertial pos="0.5 0 0" mass="1" diaginertia="1 0.1 1"/></body></body></worldbody>
    <equality><connect body1="rod" anchor="1 0 0"/></equality>
    <actuator><motor joint="A"/></actuator></mujoco>"""
    (tmp_path / "m.xml").write_text(text, "utf-8")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "m.xml"))
    state = mujoco.MjData(model)
    mujoco.mj_forward(model, state)
    data = bm.read(tmp_path / "m.xml").to_data()
    assert data["gravity"] == [0.0, -9.81]
    x, _, z = state.xanchor[1]
    assert data["joints"]["B"]["at"][0] == pytest.approx([x, z], abs=1e-9)
    assert data["links"]["arm"]["inertia"] == 0.5
    cx, _, cz = state.xipos[1]
    assert data["links"]["arm"]["cm"] == pytest.approx([cx, cz], abs=1e-9)


def test_several_joints_of_a_body_are_links_without_mass(tmp_path):
    text = """<mujoco><compiler angle="radian"/><worldbody><body name="crank" pos="0.1 0.2 0">
    <joint name="A" axis="0 0 1"/><inertial pos="0.2 0 0" mass="1" diaginertia="1 1 0.02"/></body>
    <body name="cross" pos="0.5 0.2 0"><joint name="x" type="slide" axis="1 0 0"/>
    <joint name="turn" axis="0 0 1" pos="0.3 0 0"/>
    <inertial pos="0.1 0.05 0" mass="2" diaginertia="1 1 0.05"/></body></worldbody>
    <equality><connect body1="crank" body2="cross" anchor="0.4 0 0"/></equality>
    <option gravity="0 -9.81 0" timestep="1e-4" integrator="RK4" iterations="200"
    tolerance="1e-15"/><default><equality solref="2e-4 1" solimp="0.9999 0.9999 0.001"/></default>
    <actuator><motor joint="A"/></actuator></mujoco>"""
    (tmp_path / "m.xml").write_text(text, "utf-8")
    linkage = bm.read(tmp_path / "m.xml")
    assert not linkage.check()
    mech = linkage.compile()
    (driver,) = mech.drivers
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "m.xml"))
    data = mujoco.MjData(model)
    for _ in range(2000):
        mujoco.mj_step(model, data)
    start, names = {driver: (0.0, 0.0)}, [f"driver.{driver}.q"]
    q = mech.simulate("time=0.2", want=names, accuracy=1e-9, start=start)
    assert q[f"driver.{driver}.q"][-1] == pytest.approx(data.joint("A").qpos[0], abs=1e-6)
    assert abs(data.joint("A").qpos[0]) > 0.05


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<mujoco/>", "no worldbody"),
        (
            "<mujoco><worldbody><body><freejoint/><joint/></body></worldbody></mujoco>",
            "freely in space",
        ),
        (
            '<mujoco><worldbody><body><joint axis="1 1 0"/><joint axis="0 0 1"/><body>'
            '<joint axis="1 1 0"/></body></body></worldbody></mujoco>',
            "not parallel",
        ),
        ('<mujoco><worldbody><body pos="a 0 0"><joint/></body></worldbody></mujoco>', "number"),
    ],
)
def test_models_that_cannot_be_read(text, message, tmp_path):
    (tmp_path / "m.xml").write_text(text, "utf-8")
    with pytest.raises(bm.FormatError, match=message):
        bm.read(tmp_path / "m.xml")


def test_bodies_and_joints_bear_the_names_of_links_and_joints(tmp_path):
    linkage = bm.Linkage.load("graphs/joints/slider_crank.json")
    linkage = linkage.replace({f"links.{name}.mass": 1.0 for name in linkage.links})
    (path,) = bm.write(linkage, tmp_path / "crank.xml")
    names = set(re.findall(r'<(?:body|joint|connect) name="(.*?)"', path.read_text("utf-8")))
    assert names == {*linkage.links, *linkage.joints}
    (path,) = bm.write(linkage, tmp_path / "address")
    again = bm.read(path.read_text("utf-8").splitlines()[0])
    assert {*linkage.links} <= {*again.links}
    assert {*linkage.joints} - {"cylinder"} <= {*again.joints}  # a guide has a pin beside it there
