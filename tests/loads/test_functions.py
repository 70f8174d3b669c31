"""Laws that are functions of Python: what they depend on, what they refuse, what they give."""

from __future__ import annotations

import math

import numpy as np
import pytest

import blockmech as bm
from blockmech.functions.pieces import Function
from blockmech.ground.errors import FormatError, GraphError, RequestError
from tests import machines

TERMS = [2.0, -0.7]  # [N m, N m s or N m/rad] of a straight line, exact for both spellings
EACH_ENGINE = pytest.mark.parametrize("engine", ["scalar", "numpy"])


def line(x):
    return TERMS[1] * x + TERMS[0]


LINES = {
    "coordinate": lambda coordinate: line(coordinate),
    "rate": lambda rate: line(rate),
    "time": lambda time: line(time),
}


def arm(law, **options):
    """A motor that turns a rod, and with it another one by a dyad."""
    bodies = [bm.Link(mass=1.0, inertia=0.1), bm.Link(mass=2.0, inertia=0.3)]
    graph = machines.fourbar(0.5, 2.0, 1.5, 2.0, bodies, gravity=9.81)
    machines.load(graph, "motor", bm.Motor(law=law, **options), a="frame.A", b="crank.A")
    graph.drive("crank", bm.motion.ConstantRate(rate=3.0))
    graph.start("crank", 0.4)
    return graph


def linkage(law):
    """A rod whose driver is counted from the rod to the frame."""
    m = bm.Linkage("rod")
    m.add_link("rod", pose=(0.0, 0.0, 0.0), mass=1.0, inertia=0.1, cm=(0.5, 0.0))
    m.add_joint("A", "R", ["rod", "frame"], at=[(0.0, 0.0), (0.0, 0.0)])
    m.add_driver("turn", "A")
    m.add_load("motor", "motor", law=law, joint="A", driver="turn")
    m.start("turn", 0.5, 2.0)
    return m


@EACH_ENGINE
@pytest.mark.parametrize("driver", [None, "crank"])
@pytest.mark.parametrize("of", LINES)
def test_a_function_is_worth_what_typed_data_of_the_same_line_are(of, driver, engine):
    options = {"driver": driver} if driver and of != "time" else {}
    typed = arm({"kind": "polynomial", "of": of, "coefficients": TERMS}, **options)
    runs = [g.run(samples=9, engine=engine) for g in (arm(LINES[of], **options), typed)]
    for name in ("crank.drive", "dyad.D.reaction", "motor.b.couple", "crank.tau_red"):
        assert np.array_equal(runs[0][name], runs[1][name]), name


@pytest.mark.parametrize("of", ["coordinate", "rate"])
def test_a_driver_that_a_document_counts_backwards_is_what_its_function_gets(of):
    law = {"kind": "polynomial", "of": of, "coefficients": TERMS}
    ends = [linkage(x).compile().simulate("time=1", accuracy=1e-9) for x in (LINES[of], law)]
    apart = abs(ends[0].motion.q_end - ends[1].motion.q_end)
    assert apart <= ends[0].motion.error + ends[1].motion.error


def test_the_names_of_the_parameters_choose_the_method():
    methods = {
        name: arm(law, driver=driver).compile().simulate("time=0.1").motion.method
        for name, law, driver in (
            ("coordinate", LINES["coordinate"], "crank"),
            ("rate", LINES["rate"], None),
            ("time", LINES["time"], None),
        )
    }
    assert methods == {"coordinate": "energy", "rate": "dop853", "time": "dop853"}


@pytest.mark.parametrize(
    ("law", "remedy"),
    [
        (lambda t: t, 'did you mean "time"'),
        (lambda w: w, 'did you mean "rate"'),
        (math.sin, 'did you mean "coordinate"'),
        (lambda: 1.0, "lambda rate"),
        (lambda rate, torque: rate, "lambda rate"),
    ],
)
def test_a_function_of_something_else_is_refused_and_told_how(law, remedy):
    with pytest.raises(GraphError, match=rf"Motor\.law: a function of .*coordinate.*{remedy}"):
        bm.Motor(law=law)


@EACH_ENGINE
@pytest.mark.parametrize(
    ("law", "message"),
    [
        (lambda rate: 1 / (rate - 3.0), "ZeroDivisionError"),
        (lambda rate: "much", 'it gave "much"'),
        (lambda rate: None, "it gave null"),
    ],
)
def test_a_function_that_fails_is_named_with_its_argument(law, message, engine):
    with pytest.raises(RequestError) as caught:
        arm(law).run(samples=3, engine=engine)
    assert message in str(caught.value)
    assert "<lambda>(rate)" in str(caught.value)
    assert "rate = 3" in str(caught.value)


@EACH_ENGINE
def test_where_a_function_has_no_answer_no_number_is_handed_out(engine):
    law = Function(lambda q: q if q < 1.0 else math.nan, of=("coordinate",))
    r = arm(law, driver="crank").run(at=[0.5, 1.5], engine=engine, on_gap="mark")
    assert np.isfinite(r["crank.drive"]).tolist() == [True, False]
    assert np.isfinite(r["dyad.C.p"]).all()


@pytest.mark.parametrize("machine", [arm, linkage])
def test_a_function_is_not_written_to_a_file_and_the_message_says_what_is(machine, tmp_path):
    file = tmp_path / "arm.json"
    with pytest.raises(FormatError, match=r"motor\.law: a function of Python.*table"):
        machine(LINES["rate"]).save(file)
    assert not file.exists()
