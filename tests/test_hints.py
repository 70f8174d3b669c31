"""What a message suggests for an unknown name: the words of the trade, and never a wrong one."""

from __future__ import annotations

import inspect
from operator import attrgetter

import pytest

import blockmech as bm
from blockmech.ground.errors import close_match

LINK = ("mass", "inertia", "cm", "markers", "pose")
RUBBING = ("law", "coefficient", "radius")
MECHANISM = bm.Graph.load("graphs/ruiz_fourbar.json").compile()


@pytest.mark.parametrize(
    ("word", "valid", "name"),
    [
        ("com", LINK, "cm"),
        ("cog", LINK, "cm"),
        ("m", LINK, "mass"),
        ("I", LINK, "inertia"),
        ("mas", LINK, "mass"),
        ("mu", RUBBING, "coefficient"),
        ("coeff", RUBBING, "coefficient"),
        ("r", RUBBING, "radius"),
        ("l", ("length", "offset", "sign"), "length"),
        ("lj", ("l_i", "l_j", "branch"), "l_j"),
        ("gain", ("k",), "k"),
        ("omega", ("law", "rate", "from", "to"), "rate"),
        ("k", ("stiffness", "free_length", "damping"), "stiffness"),
        ("c", ("stiffness", "free_length", "damping"), "damping"),
        ("coupling.mesh.force", ("joint.A.reaction", "mesh.force"), "mesh.force"),
    ],
)
def test_words_of_the_trade_are_known(word, valid, name):
    assert close_match(word, valid) == f'did you mean "{name}"?'


@pytest.mark.parametrize("word", ["m", "mu", "x", "at"])
def test_a_symbol_is_not_taken_for_one_that_looks_like_it(word):
    assert close_match(word, ("cm", "p", "q", "pose")) == ""


@pytest.mark.parametrize(
    ("want", "name"),
    [
        ("crank.torque", "crank.drive"),
        ("crank.omega", "crank.rate"),
        ("dyad.j.theta", "dyad.j.angle"),
        ("dyad.C.force", "dyad.C.reaction"),
    ],
)
def test_outputs_are_known_by_the_words_of_the_trade(want, name):
    with pytest.raises(bm.RequestError, match=f'did you mean "{name}"'):
        MECHANISM.run(want=want)


def test_a_key_that_is_like_none_is_not_simply_removed():
    with pytest.raises(bm.GraphError, match="write one of these, or remove it"):
        bm.Link(colour=3)
    with pytest.raises(bm.GraphError, match='did you mean "k"'):
        bm.signals.Gain(gain=0.5)


@pytest.mark.parametrize(
    ("word", "valid", "name"),
    [
        ("revolute", ("R", "P", "weld"), "R"),
        ("prismatic", ("R", "P", "weld"), "P"),
        ("ground", ("frame", "crank", "rod"), "frame"),
        ("offset", ("l", "h", "branch"), "h"),
        ("length", ("l", "h", "branch"), "l"),
        ("torque", ("driver.motor.q", "driver.motor.drive"), "driver.motor.drive"),
        ("link.coupler.P", ("link.coupler.v", "link.coupler.P.p"), "link.coupler.P.p"),
        ("A", ("joint.B.p", "joint.A.p", "joint.A.reaction"), "joint.A.p"),
        ("point", ("type", "at", "links"), "at"),
        ("force", ("joint", "at", "law", "links"), "law"),
        ("links.rod.ineria", ("links.rod.mass", "links.rod.inertia"), "links.rod.inertia"),
    ],
)
def test_the_words_of_other_tools_are_known(word, valid, name):
    assert close_match(word, valid) == f'did you mean "{name}"?'


def test_a_length_is_not_taken_for_the_inertia_of_the_link():
    assert close_match("links.rod.length", ("links.rod.mass", "links.rod.inertia")) == ""
    for address in ("links.rod.length", "link.rod.length"):
        with pytest.raises(bm.RequestError, match="add_dimension"):
            bm.read("graphs/joints/slider_crank.json").replace({address: 0.3})


def test_the_place_that_a_guide_lacks_is_not_taken_for_its_normal_force():
    with pytest.raises(bm.RequestError) as caught:
        bm.read("graphs/joints/slider_crank.json").run(want="joint.cylinder.p.y")
    assert "did you mean" not in str(caught.value)


def test_keys_of_a_model_are_those_of_python_in_python():
    with pytest.raises(bm.GraphError) as caught:
        bm.motion.Cycloidal(start=0.0, rise="90deg")
    text = str(caught.value)
    assert 'needs "end"' in text
    assert 'needs "time"' in text
    assert '"to"' not in text
    with pytest.raises(bm.GraphError, match=r"Cycloidal\.end: end must be a number"):
        bm.motion.Cycloidal(start=0.0, end=None, time=2.0)


def test_a_model_shows_its_fields_as_a_call_takes_them():
    for _ in range(2):  # before and after the first one is made
        signature = str(inspect.signature(bm.Spring))
        assert signature == "(*, stiffness, useful=False, free_length=0.0, damping=0.0)"
        bm.Spring(stiffness=1.0)
    assert str(inspect.signature(bm.motion.ConstantRate)).startswith("(*, rate, start=0.0, end=")


def test_a_model_says_how_it_is_changed():
    crank = bm.Crank(length=0.05)
    with pytest.raises(bm.GraphError) as caught:
        crank.length = 0.06
    assert '.model_copy(update={"length": 0.06})' in str(caught.value)
    assert crank.model_copy(update={"length": 0.06}).length == 0.06


@pytest.mark.parametrize(
    ("lacks", "hint"),
    [
        (lambda: bm.read("graphs/joints/slider_crank.json").animate, "blockmech.draw.animate"),
        (lambda: bm.Graph("empty").show, "run().plot"),
        (lambda: MECHANISM.run(at=0.5).at, "write isel or mechanism.run"),
        (lambda: MECHANISM.replace, "document.replace"),
        (lambda: bm.Graph("empty").grashof, "compile().limits"),
        (lambda: MECHANISM.plot, "run().plot"),
        (lambda: MECHANISM.run(at=0.5).extremes, "mechanism.extremes"),
        (lambda: MECHANISM.run(at=0.5).to_pandas, "to_dataframe"),
        (
            lambda: MECHANISM.study({"dyad.l_i": [6.0]}, want="max(crank.drive)").argmin,
            "write best",
        ),
        (lambda: bm.animate, "blockmech.draw.animate"),
        (lambda: bm.shapes, "blockmech.design.shapes"),
        (lambda: bm.Coulomb, "blockmech.friction.Coulomb"),
        (lambda: bm.Linkage("empty").dof, "compile().structure.mobility"),
        (lambda: MECHANISM.quick_return, "write stroke"),
        (lambda: MECHANISM.run(at=0.5).reactions, '["crank.A.reaction"]'),
        (lambda: MECHANISM.run(at=0.5).torque, '["crank.drive"]'),
        (lambda: MECHANISM.run(at=0.5).save, "write to_csv"),
        (lambda: bm.Graph("empty").wire, "write connect"),
        (lambda: bm.Graph("empty").disconnect, "write replace"),
        (lambda: bm.Linkage("empty").remove_link, "write replace"),
        (lambda: bm.load, "read"),
        (lambda: bm.Slider, "SlideDrive"),
    ],
)
def test_a_missing_attribute_says_what_has_it(lacks, hint):
    with pytest.raises(AttributeError) as caught:
        lacks()
    assert hint in str(caught.value)


def test_what_a_missing_attribute_means_is_looked_up_where_the_message_is_read(monkeypatch):
    monkeypatch.setattr("blockmech.ground.errors.elsewhere", lambda name, homes: 1 / 0)
    assert not hasattr(MECHANISM, "torque")
    with pytest.raises(AttributeError) as caught:
        attrgetter("torque")(MECHANISM)
    with pytest.raises(ZeroDivisionError):
        str(caught.value)


@pytest.mark.parametrize(
    ("call", "phrases"),
    [
        (lambda: MECHANISM.stroke(), ("arguments: source, name", "m.compile().stroke(")),
        (lambda: MECHANISM.run(points=5), ('did you mean "samples"?', 'mech.run(at="30deg"')),
        (lambda: MECHANISM.extremes("crank.q", over=(0, 1)), ("arguments: source, name",)),
        (lambda: MECHANISM.simulate(time=2), ('write simulate("time=...")',)),
        (
            lambda: MECHANISM.study({}, want="max(crank.drive)", constraints="x > 0"),
            ("write study(...).best()",),
        ),
        (lambda: bm.Linkage("a").add_link("rod", com=(0, 1)), ('did you mean "cm"?', "m.add_link")),
        (lambda: bm.Graph("a").add_stop("crank", upper=1.0), ('did you mean "high"?',)),
        (
            lambda: bm.Linkage("a").add_coupling("mesh", "gear", "left", "right"),
            ("takes 3 positional", 'm.add_coupling("mesh", "gear", driver="motor"'),
        ),
    ],
)
def test_a_call_that_does_not_fit_is_answered_by_its_arguments_and_an_example(call, phrases):
    with pytest.raises(TypeError) as caught:
        call()
    assert all(phrase in str(caught.value) for phrase in phrases), str(caught.value)


def test_a_mistake_inside_of_a_call_keeps_its_own_message():
    def follow(t, q):
        raise TypeError("a mistake of the user's own")

    with pytest.raises(TypeError, match=r"^a mistake of the user's own$"):
        MECHANISM.study(
            {"dyad.l_i": [6.0]}, want="max(crank.drive)", progress=lambda *_: follow(1, 2)
        )


def test_a_missing_argument_is_known_by_other_words():
    with pytest.raises(TypeError, match='did you mean "until"'):
        MECHANISM.simulate(t_end=2.0)
    with pytest.raises(TypeError, match='did you mean "dir"'):
        bm.Linkage("guide").add_joint("S", "P", ["frame", "rod"], direction=(1, 0))


def test_one_place_of_a_joint_is_asked_for_as_a_point():
    arm = bm.Linkage("arm")
    arm.add_link("arm")
    with pytest.raises(bm.GraphError, match=r"a place for each link.*or point="):
        arm.add_joint("O", "R", ["frame", "arm"], at=(0, "20 mm"))
    arm.add_joint("O", "R", ["frame", "arm"], at=[(0, 0), (0, "20 mm")])


def test_keys_of_a_driver_without_a_law_ask_for_the_law():
    m = bm.read("graphs/joints/slider_crank.json")
    with pytest.raises(bm.GraphError, match="name its law first: constant_rate"):
        m.add_driver("second", "A", rpm=300)


def test_a_mechanism_is_not_saved_as_json_by_the_name_of_a_drawing(tmp_path):
    with pytest.raises(bm.RequestError, match=r"blockmech\.write"):
        bm.Linkage("drawing").save(tmp_path / "links.dxf")
    assert not list(tmp_path.iterdir())


def test_what_an_angle_of_a_joint_is_names_both_links():
    outputs = bm.read("graphs/joints/ruiz_fourbar.json").compile().outputs
    assert outputs["joint.B.coordinate"].about.startswith("angle of coupler against crank")


def test_a_result_is_not_drawn_but_its_mechanism_is():
    with pytest.raises(bm.RequestError, match=r"the mechanism is its \.mechanism"):
        bm.draw.draw(MECHANISM.run(at=0.5))


def test_a_study_says_how_it_is_written_and_what_it_takes(tmp_path):
    study = MECHANISM.study({"dyad.l_i": [6.0, 6.1]}, want="max(dyad.margin)", samples=9)
    with pytest.raises(bm.RequestError, match=r"is in its \.status"):
        study["status"]
    for where in ("max(dyad.margin) > 0", [True], study["dyad.l_i"]):
        with pytest.raises(bm.RequestError, match="a truth for each design"):
            study.best("max(dyad.margin)", where=where)
    with pytest.raises(bm.RequestError, match=r"its to_csv\(\) writes it"):
        bm.write(study, tmp_path / "designs.csv")


def test_a_stop_of_a_joint_that_nothing_drives_is_refused_at_once():
    m = bm.Linkage.load("graphs/joints/slider_crank.json")
    with pytest.raises(bm.GraphError, match=r'"joint.cylinder.coordinate"'):
        m.add_stop("cylinder", high="250 mm")
    with pytest.raises(bm.GraphError, match=r'add_driver\("cylinder", "cylinder"\)'):
        m.start("cylinder", q=0.1)
    m.add_stop("joint.cylinder.coordinate", high="250 mm")
    assert not m.check()


def test_words_that_are_methods_or_kinds_of_others_are_answered_with_those(tmp_path):
    with pytest.raises(TypeError, match=r"write \.objective\(\)"):
        MECHANISM.study({"dyad.l_i": [6.0, 6.1]}, want="max(crank.drive)", objective="x")
    with pytest.raises(bm.GraphError, match='did you mean "free_length"'):
        bm.Spring(stiffness=1.0, preload=40.0)
    m = bm.Linkage.load("graphs/joints/slider_crank.json")
    with pytest.raises(bm.GraphError, match="import the file that defines it"):
        m.add_load("own", "my_drag", link="piston")
    with pytest.raises(bm.FormatError, match=r"it is a folder.*read_parquet"):
        bm.read(tmp_path)


def test_a_run_without_a_law_of_motion_shows_both_calls():
    m = bm.Linkage.load("graphs/joints/slider_crank.json")
    driver, joint = next((name, x.joint) for name, x in m.drivers.items())
    del m.drivers[driver]
    m.add_driver(driver, joint)
    with pytest.raises(bm.RequestError, match=r'ConstantRate\(.*run\(at=\["0deg", "90deg"\]\)'):
        m.run()
    assert m.run(at=["0deg", "90deg"]).n == 2
