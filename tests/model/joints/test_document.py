"""The joint-based file: strict when read, canonical when written, and made in Python as well."""

from __future__ import annotations

import ast
import gc
import json
import weakref
from pathlib import Path

import jsonschema
import pytest

import blockmech as bm
from blockmech.model.joints import diagnosis
from blockmech.model.joints.diagnosis import REMEDIES
from blockmech.model.schema import joints_schema
from tests.codes import FILE_CODES
from tests.codes import LINKAGE_CODES as CODES
from tests.doors import linkage_of
from tests.model.joints import machines
from tests.model.joints.chance import document as random_document
from tests.wiring import recorded


def read(data):
    return linkage_of(json.dumps(data))


def problems_of(data):
    with pytest.raises(bm.FormatError) as caught:
        read(data)
    return list(caught.value.problems)


GOOD = {
    "slider-crank": machines.SLIDER_CRANK,
    "andrews": recorded("andrews_squeezer")["document"],
    "random": random_document(3),
}


@pytest.mark.parametrize("data", GOOD.values(), ids=list(GOOD))
def test_a_file_keeps_its_content_and_then_its_bytes(data):
    text = read(data).to_json()
    document = json.loads(text)
    for section in ("links", "joints", "drivers", "loads"):
        assert document.get(section, {}) == data.get(section, {})
    assert linkage_of(text).to_json() == text


def test_saving_and_loading_a_file(tmp_path):
    path = tmp_path / "linkage.json"
    document = read(machines.SLIDER_CRANK)
    document.save(path)
    loaded = bm.Linkage.load(path)
    assert loaded.file == str(path)
    assert loaded.to_json() == document.to_json()


def test_the_sections_that_are_not_computed_with_travel_along():
    sections = {
        "title": "An example",
        "initial": {"motor": {"q": 0.5, "rate": 2.0}},
        "stops": {"motor": {"from": -1.0, "to": 4.0}},
        "expect": [
            {
                "source": "by hand",
                "at": {"motor": [0]},
                "want": {"link.crank.angle": [0]},
                "atol": 0,
            }
        ],
        "source": "a book",
        "notes": ["one", "two"],
    }
    document = json.loads(read(machines.SLIDER_CRANK | sections).to_json())
    assert {key: document[key] for key in sections} == sections


def test_made_in_python_it_is_the_same_document():
    data = machines.SLIDER_CRANK
    linkage = bm.Linkage("slider_crank", gravity=(0.0, -9.81))
    for name, link in data["links"].items():
        linkage.add_link(name, **link)
    for name, joint in data["joints"].items():
        rest = {key: value for key, value in joint.items() if key not in ("type", "links", "at")}
        linkage.add_joint(name, joint["type"], joint["links"], joint["at"], **rest)
    law = bm.motion.ConstantRate(rate=100.0, **{"from": 0.0, "to": 6.283185307179586})
    linkage.add_driver("motor", "O", law)
    linkage.add_load("gas", "force", link="piston", at=(0.0, 0.0), force=(-500.0, 0.0))
    assert linkage.to_json() == read(data).to_json()


def test_a_mistake_in_python_names_its_place_in_the_document():
    linkage = bm.Linkage()
    with pytest.raises(bm.GraphError) as caught:
        linkage.add_link("rod", mass=-1.0, pose=[0, 0, "x"])
    assert {p.where for p in caught.value.problems} == {"links.rod.mass", "links.rod.pose[2]"}
    linkage.add_link("rod", pose=(0, 0, 0))
    with pytest.raises(bm.GraphError, match="taken-name"):
        linkage.add_link("rod", pose=(0, 0, 0))
    with pytest.raises(bm.GraphError, match="no type"):
        linkage.add_load("wind", "storm", link="rod")


def test_all_mistakes_of_a_file_are_said_at_once_with_file_and_key():
    data = machines.slider_crank()
    data["links"]["rod"]["mas"] = 2.0
    data["links"]["piston"]["inertia"] = -1
    data["joints"]["O"]["type"] = "Q"
    data["joints"]["S"]["angle"] = [0.0]
    data["joints"]["A"]["links"][1] = "rodd"
    data["drivers"]["motor"]["rte"] = 1.0
    data["loads"]["gas"]["forc"] = 1.0
    data["loads"]["wind"] = {"type": "storm"}
    data["initial"] = {"engine": {"q": 0.0}}
    with pytest.raises(bm.FormatError) as caught:
        linkage_of(json.dumps(data), "mine.json")
    problems = caught.value.problems
    assert {p.file for p in problems} == {"mine.json"}
    assert [(p.code, p.where) for p in problems] == [
        ("unknown-key", "links.rod.mas"),
        ("wrong-value", "links.piston.inertia"),
        ("wrong-value", "joints.O.type"),
        ("wrong-value", "joints.S.angle"),
        ("unknown-link", "joints.A.links[1]"),
        ("unknown-key", "drivers.motor.rte"),
        ("unknown-key", "loads.gas.forc"),
        ("wrong-value", "loads.wind.type"),
        ("unknown-driver", "initial.engine"),
    ]
    assert 'did you mean "rod"?' in str(caught.value)


def changed(path, to):
    """The slider-crank with something else at a path."""
    data = machines.slider_crank()
    *keys, last = path.split("/")
    box = data
    for key in keys:
        box = box.setdefault(key, {})
    box[last] = to
    return data


SPRING = {"type": "spring", "links": ["rod"], "at": [[0, 0]]}
MOTOR = {"type": "motor", "law": {"kind": "constant", "value": 1.0}}
OLD_LAW = {"joint": "O", "law": "constant_rate", "rate": 1, "start": 0}  # a name of Python
ONE_MISTAKE = {
    "a link without a pose": ("links/rod", {}, "missing-key"),
    "mass of the frame": ("links/frame", {"mass": 1.0}, "unknown-key"),
    "a dot in a name": ("links/a.b", {"pose": [0, 0, 0]}, "bad-name"),
    "a joint of one link": ("joints/O/links", ["frame"], "wrong-value"),
    "a joint of a link with itself": ("joints/O/links", ["crank", "crank"], "wrong-value"),
    "three places for two links": ("joints/O/at", [[0, 0], [0, 0], [1, 1]], "wrong-value"),
    "an angle of a pin": ("joints/O/angle", [0, 0], "unknown-key"),
    "two directions": ("joints/S/dir", [[1, 0], [1, 0]], "bad-direction"),
    "a slider that is no number": ("joints/S/slider", True, "wrong-value"),
    "friction without a radius": ("joints/O/friction", {"coefficient": 0.1}, "friction-mismatch"),
    "a driver of no joint": ("drivers/motor/joint", "Q", "unknown-joint"),
    "a second driver of a joint": ("drivers/hand", {"joint": "O"}, "conflicting-drivers"),
    "an unknown law": ("drivers/motor", {"joint": "O", "law": "x"}, "wrong-value"),
    "a law's name in Python": ("drivers/motor", OLD_LAW, "unknown-key"),
    "a load on no link": ("loads/gas/link", "cylinder", "unknown-link"),
    "a spring to one link": ("loads/s", SPRING, "missing-key"),
    "a motor between nothing": ("loads/m", MOTOR, "wrong-value"),
    "a marker with a dot": ("links/rod/markers", {"a.b": {"at": [0, 0]}}, "bad-name"),
    "a graph": ("format", "blockmech/graph", "wrong-format"),
    "a newer file": ("version", 7, "newer-version"),
    "an unknown section": ("springs", {}, "unknown-key"),
    "joints that are a list": ("joints", [], "wrong-type"),
}


@pytest.mark.parametrize("name", ONE_MISTAKE)
def test_one_mistake_is_named(name):
    path, to, code = ONE_MISTAKE[name]
    problems = problems_of(changed(path, to))
    assert code in {p.code for p in problems}
    assert {p.code for p in problems} <= set(FILE_CODES) | set(CODES)


@pytest.fixture(scope="module")
def validator():
    schema = joints_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


@pytest.mark.parametrize("data", GOOD.values(), ids=list(GOOD))
def test_good_files_are_valid_by_the_schema(data, validator):
    assert list(validator.iter_errors(data)) == []


BEYOND_A_SCHEMA = {
    *("a joint of a link with itself", "three places for two links", "two directions"),
    *("friction without a radius", "a driver of no joint", "a second driver of a joint"),
    *("a load on no link", "a motor between nothing", "a marker with a dot"),
}
"""Mistakes in how parts of a file fit each other."""


@pytest.mark.parametrize("name", sorted(set(ONE_MISTAKE) - BEYOND_A_SCHEMA))
def test_the_schema_finds_what_reading_finds(name, validator):
    path, to, _ = ONE_MISTAKE[name]
    assert list(validator.iter_errors(changed(path, to)))


def test_every_code_in_the_source_is_declared():
    source = Path(diagnosis.__file__).parent
    result = {
        call.args[0].value
        for path in source.glob("*.py")
        for call in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(call, ast.Call)
        and getattr(call.func, "id", "") in {"Problem", "mistake"}
        and call.args
        and isinstance(call.args[0], ast.Constant)
    }
    assert result <= {*FILE_CODES, *CODES}
    assert set(CODES) <= result | set(REMEDIES)


def test_what_is_added_as_an_object_is_what_its_keys_say():
    by_objects, by_keys = bm.Linkage("arm"), bm.Linkage("arm")
    body = bm.Link(mass=2.0, inertia=0.3, cm=(0.1, 0.0), markers={"tip": (0.5, 0.0)})
    by_objects.add_link("arm", body, pose=(0.0, 0.0, "30deg"), mass=3.0)
    by_keys.add_link(
        "arm",
        pose=(0.0, 0.0, "30deg"),
        mass=3.0,
        inertia=0.3,
        cm=(0.1, 0.0),
        markers={"tip": (0.5, 0.0)},
    )
    for arm in (by_objects, by_keys):
        arm.add_joint("O", "R", ["frame", "arm"], point=(0.0, 0.0))
    by_objects.add_driver("motor", "O", bm.motion.ConstantRate(rate=2.0, end=1.0))
    by_keys.add_driver("motor", "O", "constant_rate", rate=2.0, to=1.0)
    by_objects.add_load("wind", bm.Force(force=(1.0, 0.0)), link="arm", at=(0.5, 0.0))
    by_keys.add_load("wind", "force", force=(1.0, 0.0), link="arm", at=(0.5, 0.0))
    assert by_objects.to_data() == by_keys.to_data()


@pytest.mark.parametrize("link", [5, "bar", bm.Gear(driver="a", driven="b", teeth=(1, 2))])
def test_an_object_that_is_no_link_is_refused(link):
    m = bm.Linkage("m")
    with pytest.raises(bm.RequestError, match=r"link: got .* a bm.Link or a body"):
        m.add_link("rod", link)
    assert "rod" not in m.links


def test_a_load_named_like_the_outputs_of_the_whole_is_refused_and_a_link_is_not():
    m = bm.Linkage("swing")
    m.add_link("mechanism", mass=2.0)
    m.add_joint("O", "R", ["frame", "mechanism"], point=(0.0, 0.0))
    m.add_driver("motor", "O")
    assert {"link.mechanism.p", "mechanism.kinetic_energy"} < {*m.compile().outputs}
    m.add_load("mechanism", "force", link="mechanism", force=(1.0, 0.0))
    (problem,) = m.check()
    assert (problem.code, problem.where) == ("taken-name", "loads.mechanism")


def test_names_that_are_taken_are_told_in_the_order_of_the_document():
    data = machines.slider_crank()
    names = ["mechanism", "joint", "driver", "link"]
    data["signals"] = {name: {"type": "gain", "k": 1.0} for name in names}
    with pytest.raises(bm.FormatError) as refused:
        linkage_of(json.dumps(data))
    assert [p.where for p in refused.value.problems] == [f"signals.{name}" for name in names]


def test_a_compiled_document_is_released_with_its_last_name():
    """A program that edits and compiles for hours holds the documents that it still names."""
    document = read(machines.slider_crank())
    document.compile()
    kept = weakref.ref(document)
    del document
    gc.collect()
    assert kept() is None
