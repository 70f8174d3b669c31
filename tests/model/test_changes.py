"""Parts that are changed, taken out, or put in by hand; units that fit no number there."""

from __future__ import annotations

import pytest

import blockmech as bm
from blockmech.ground.units import NoQuantity, quantity
from tests.gallery import GRAPHS

PIN = bm.friction.Coulomb(coefficient=0.1, radius=0.01)


def arm():
    m = bm.Linkage("arm")
    m.add_link("arm", mass=2.0)
    m.add_joint("O", "R", ["frame", "arm"], point=(0.0, 0.0))
    m.add_driver("motor", "O", bm.motion.ConstantRate(rate="60rpm"))
    m.add_load("wind", bm.Force(force=(0.0, -1.0)), link="arm", at=(1.0, 0.0))
    return m


def codes(call):
    with pytest.raises(bm.BlockmechError) as caught:
        call()
    return [(p.code, p.where) for p in caught.value.problems]


def test_replace_changes_parts_and_takes_them_out():
    m = arm()
    changed = m.replace({"joints.O.friction": PIN, "links.arm.mass": "3 kg", "loads.wind": None})
    assert changed.joints["O"].friction == PIN
    assert changed.links["arm"].mass == 3.0
    assert not changed.loads
    assert (m.joints["O"].friction, m.links["arm"].mass, list(m.loads)) == (None, 2.0, ["wind"])
    assert m.replace({"joint.O.friction": PIN}).joints["O"].friction == PIN  # as outputs say it
    blown = changed.replace({"loads.wind": {"type": "force", "link": "arm", "force": [0, -1]}})
    assert blown.loads["wind"].force.z == -1j


def test_blocks_are_replaced_by_their_names():
    g = bm.Graph("arm")
    g.add("frame", bm.Frame(markers={"O": (0.0, 0.0)}))
    g.add("crank", bm.Crank(length=1.0))
    g.connect("frame.O", "crank.A")
    assert g.replace({"crank.friction": {"A": PIN}}).blocks["crank"].friction["A"] == PIN
    with pytest.raises(bm.GraphError, match='no block "crank"'):
        g.replace({"crank": None})


def test_vectors_are_replaced_whole():
    changed = arm().replace({"loads.wind.force": (1.0, "2 kN"), "links.arm.cm": [0.5, 0]})
    assert changed.loads["wind"].force.z == 1 + 2000j
    assert changed.links["arm"].cm.z == 0.5


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"joints.O.friction.coefficient": 0.1}, r'replace\(\{"joints.O.friction": bm.friction'),
        ({"joints.O.point.x": 0.1}, r"first link is joints.O.at\[0\], .* joints.O.at\[1\]"),
        ({"links.arm.length": 0.1}, "add_dimension"),
        ({"joints.O.at[0].z": 0.1}, r"there: joints.O.at\[0\].x, joints.O.at\[0\].y\.$"),
    ],
)
def test_a_number_that_is_not_there_says_how_to_come_by_it(changes, message):
    with pytest.raises(bm.RequestError, match=message):
        arm().replace(changes)
    rubbing = arm().replace({"joints.O.friction": PIN})
    with pytest.raises(bm.RequestError, match=r'mean "joints\.O\.friction\.coefficient"'):
        rubbing.replace({"joints.O.friction.mu": 0.1})


@pytest.mark.parametrize(
    ("changes", "code", "where"),
    [
        ({"joints.O.fricton": PIN}, "unknown-key", "joints.O.fricton"),
        ({"joints.B.friction": PIN}, "unknown-parameter", "joints.B.friction"),
        ({"loads.gas": None}, "unknown-parameter", "loads.gas"),
        ({"links.arm.mass.x": None}, "unknown-parameter", "links.arm.mass.x"),
        ({"things": {}}, "unknown-parameter", "things"),
        ({"loads.gas": bm.Force(force=(1.0, 0.0))}, "missing-key", "loads.gas.link"),
        ({"links.arm": None}, "unknown-link", "joints.O.links[1]"),
    ],
)
def test_a_part_that_cannot_be_is_refused_where_it_stands(changes, code, where):
    assert codes(lambda: arm().replace(changes))[0] == (code, where)


def test_objects_of_no_kind_are_refused_by_name():
    for section, item in (
        ("loads", bm.Force(force=(1.0, 0.0))),
        ("links", bm.Link(mass=1.0)),
        ("joints", {"type": "R"}),
    ):
        m = arm()
        getattr(m, section)["new"] = item
        assert codes(m.compile) == [("wrong-type", f"{section}.new")]
        assert f'write add_{section[:-1]}("new", ...)' in str(m.check()[0])


def test_a_copy_of_a_model_has_its_fields_alone():
    joint = arm().joints["O"]
    assert codes(lambda: joint.model_copy(update={"fricton": PIN}))[0][0] == "unknown-key"
    assert joint.model_copy(update={"friction": PIN}).friction == PIN
    with pytest.raises(bm.GraphError, match=r"m\.replace"):
        joint.friction = PIN


def test_units_of_another_kind_are_refused_in_parts_from_python():
    m = bm.Linkage("arm")
    m.add_link("arm", mass="3 N", inertia="5 kg", pose=("5 kg", 0.0, "1 m"))
    m.add_joint("O", "R", ["frame", "arm"], point=(0.0, 0.0))  # which poses the link
    m.add_driver("motor", "O", bm.motion.ConstantRate(rate="5 kg"))
    wrong = {p.where: p.code for p in m.check()}
    links = ["links.arm.mass", "links.arm.inertia", "links.arm.pose[0]", "links.arm.pose[2]"]
    assert wrong == dict.fromkeys([*links, "drivers.motor.rate"], "wrong-unit")
    driver = m.drivers["motor"]
    m.drivers["motor"] = driver.model_copy(update={"rate": 5.0})  # the text went with its number
    assert "drivers.motor.rate" not in {p.where for p in m.check()}


def test_a_stop_of_a_slide_is_a_length():
    m = bm.read(GRAPHS / "joints" / "slider_crank.json")
    m.add_stop("joint.cylinder.coordinate", high="20 mm")
    assert not m.check()
    m.stops.clear()
    m.add_stop("joint.cylinder.coordinate", high="1 deg")
    assert [p.code for p in m.check()] == ["wrong-unit"]


def test_a_square_is_not_written_as_the_symbol_twice():
    assert quantity("5 kg mm2", "kg m2") == 5e-6
    assert quantity("2 kg m m", "kg m2") == 2.0
    with pytest.raises(NoQuantity):
        quantity("5 kg mm", "kg m2")


def test_the_file_that_a_mechanism_was_read_from_is_not_overwritten_by_a_run(tmp_path):
    path = tmp_path / "arm.json"
    arm().save(path)
    text = path.read_text(encoding="utf-8")
    for subject in (bm.read(path), bm.read(path).compile()):
        assert codes(lambda: bm.write(subject, path)) == [("cannot-write", str(path))]  # noqa: B023
    assert path.read_text(encoding="utf-8") == text
    assert bm.write(bm.read(path), tmp_path / "run.json") == [tmp_path / "run.json"]
