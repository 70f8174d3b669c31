"""What is set on a graph, a linkage, a scene or a mechanism has its effect, or is refused."""

import math
import pickle

import numpy as np
import pytest

import blockmech as bm
from blockmech.ground.errors import GraphError
from tests import machines

G = -9.81


def heavy_crank():
    return machines.crank(2.0, bm.Link(mass=3.0, cm=(1.0, 0.0)))


def heavy_link():
    m = bm.Linkage("pendulum")
    m.add_link("crank", pose=(0.0, 0.0, 0.0), mass=3.0, cm=(1.0, 0.0))
    m.add_joint("A", "R", ["frame", "crank"], at=[(0.0, 0.0), (0.0, 0.0)])
    m.add_driver("motor", "A")
    return m


@pytest.mark.parametrize("gravity", [(0.0, G), [0, G], complex(0.0, G), np.array([0.0, G])])
@pytest.mark.parametrize(
    ("make", "output"), [(heavy_crank, "crank.drive"), (heavy_link, "driver.motor.drive")]
)
def test_gravity_can_be_set_afterwards(make, output, gravity):
    m = make()
    m.gravity = gravity
    assert m.gravity.z == complex(0.0, G)
    (tau,) = m.run(at=[0.0], want=[output], rates=0.0)[output]
    assert math.isclose(tau, -3.0 * G * 1.0, rel_tol=1e-15)  # m g x, carried by the drive


def test_setting_gravity_keeps_the_rest_of_the_scene():
    g = heavy_crank()
    g.drive("crank", bm.motion.ConstantRate(rate=1.0))
    g.start("crank", q=1.0)
    g.gravity = (0.0, G)
    assert (list(g.scene.drive), list(g.scene.initial)) == (["crank"], ["crank"])


@pytest.mark.parametrize(("make", "driver"), [(heavy_crank, "crank"), (heavy_link, "motor")])
def test_a_document_that_was_read_is_changed_like_one_that_was_made(make, driver):
    document = make()
    for m in (document, type(document).from_json(document.to_json())):
        m.gravity = (0.0, G)
        m.start(driver, q=1.0)
        m.add_stop(driver, high=2.0)
        assert m.compile().simulate("time=0.1").motion.end == "time"
        assert m.to_data() == document.to_data()


REFUSED = {
    "gravty": (
        '[unknown-attribute] {cls}.gravty: there is no attribute "gravty" to set. '
        'attributes: {known}. did you mean "gravity"?'
    ),
    "check": ("[unknown-attribute] {cls}.check: check() is called, not set. attributes: {known}."),
    "_plans": (
        '[unknown-attribute] {cls}._plans: there is no attribute "_plans" to set. '
        "attributes: {known}."
    ),
}
KNOWN = {
    bm.Graph: "blocks, extras, file, gravity, name, parameters, scene, title, wires",
    bm.Linkage: "couplings, dimensions, drivers, extras, file, gravity, initial, joints, links, "
    "loads, motion, name, signals, stops, title, wires",
}


@pytest.mark.parametrize("cls", KNOWN)
@pytest.mark.parametrize("name", REFUSED)
def test_an_attribute_that_is_none_is_refused_with_those_that_are(cls, name):
    document = cls()
    with pytest.raises(GraphError) as caught:
        setattr(document, name, 0.0)
    assert str(caught.value) == REFUSED[name].format(cls=cls.__name__, known=KNOWN[cls])
    assert name not in vars(document)


def test_what_follows_from_the_rest_is_not_set():
    with pytest.raises(GraphError, match="driven follows from the rest, and is not set"):
        bm.Linkage().driven = {}


@pytest.mark.parametrize("cls", KNOWN)
def test_gravity_that_is_no_vector_is_refused_at_once(cls):
    document = cls()
    with pytest.raises(GraphError, match="gravity must be a vector"):
        document.gravity = -9.81
    assert document.gravity.z == 0


def test_what_is_no_scene_is_refused_and_a_scene_does_not_change():
    g = heavy_crank()
    with pytest.raises(GraphError, match=r"Graph\.scene: dict is no scene. on a graph set gravity"):
        g.scene = {"gravity": [0.0, G]}
    with pytest.raises(GraphError, match=r"Scene\.gravity: .* on a graph set gravity, and call"):
        g.scene.gravity = (0.0, G)


@pytest.mark.parametrize("name", ["gravity", "scene", "name", "anything"])
def test_a_compiled_mechanism_does_not_change(name):
    mech = heavy_crank().compile()
    with pytest.raises(GraphError) as caught:
        setattr(mech, name, 0.0)
    assert str(caught.value) == (
        f"[frozen] Mechanism.{name}: a compiled mechanism does not change. "
        "set it on the graph or linkage, and compile that again."
    )


def test_a_graph_is_the_same_after_pickling():
    g = heavy_crank()
    g.gravity = (0.0, G)
    assert pickle.loads(pickle.dumps(g)).to_json() == g.to_json()
