"""Which method is taken, why, and what is refused."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

import blockmech as bm
from blockmech.dynamics.request import Start, Until
from blockmech.ground.errors import RequestError
from tests.dynamics.linkages import motored, pendulum, watt
from tests.dynamics.one_chart import in_one_chart
from tests.dynamics.synthetic import move
from tests.dynamics.test_integrators import double_pendulum
from tests.gallery import GRAPHS, mechanism


def test_auto_says_what_it_took_and_why():
    plain = move(watt(), Start(1.0), "time=1")
    assert (plain.method, plain.why) == (
        "energy",
        "all loads depend on the driver's coordinate alone",
    )
    rated = move(motored(), Start(1.0), "time=1")
    assert rated.method == "dop853"
    assert "rate" in rated.why


def test_cost_and_accuracy_are_in_the_result():
    motion = move(watt(), Start(1.0), "time=1", accuracy=1e-9)
    assert motion.reached
    assert motion.error <= motion.accuracy == 1e-9
    assert motion.cost.evaluations == motion.cost.samples + motion.cost.singles
    assert motion.cost.samples > 0


@pytest.mark.parametrize(
    ("call", "code", "text"),
    [
        (
            lambda: mechanism("watt_sixbar").simulate("time=1", method="enrgy"),
            "method",
            'did you mean "energy"?',
        ),
        (lambda: move(motored(), Start(1.0), "time=1", "energy"), "method", "rate"),
        (
            lambda: move(double_pendulum(), ([0.1, 0.2], [0, 0]), "time=1", "euler_q"),
            "method",
            "it needs one driver",
        ),
        (lambda: move(watt(), Start(1.0), "event"), "until", "no event"),
        (lambda: move(watt(), Start(1.0), "steady", "rk4"), "method", "no steady state"),
        (lambda: move(watt(), Start(1.0), "swing=2"), "until", 'did you mean "swings"?'),
        (lambda: move(watt(), Start(1.0), "time"), "until", "valid: "),
        (
            lambda: move(double_pendulum(), ([0.1, 0.2], [0, 0]), "turns=1"),
            "until",
            "it needs one driver",
        ),
        (
            lambda: move(double_pendulum(), ([0.1, 0.2], [0, 0]), "time=1", "energy"),
            "method",
            "it needs one driver",
        ),
    ],
)
def test_what_does_not_fit_is_refused_by_name(call, code, text):
    with pytest.raises(RequestError) as caught:
        call()
    (problem,) = caught.value.problems
    assert problem.code == code
    assert text in str(problem)


def test_until_reads_its_spellings():
    assert Until.parse("standstill") == Until("standstill")
    assert Until.parse("swings=3") == Until("swings", 3.0)
    assert Until.parse("angle=-6.28") == Until("angle", -6.28)


def test_a_motion_is_printed_without_its_tables():
    assert len(repr(move(pendulum(), Start(1.0), "time=1"))) < 1000
    assert math.isfinite(move(pendulum(), Start(1.0), "time=1").error)


def test_a_path_that_crawls_hands_over_to_integration_in_time():
    """In front of the place where all loops of a chain fold at once panels get ever shorter."""
    data = json.loads((GRAPHS / "joints" / "n_four_bar.json").read_text("utf-8"))
    data["links"]["rod01"]["cm"] = [0.5, 0.2]
    mech, told = bm.Linkage.from_json(json.dumps(data)).compile(), []
    through = mech.simulate("time=2", want=[], progress=lambda *x: told.append(x)).motion
    motion = in_one_chart(mech, "time=2")
    assert (motion.end, motion.method) == ("dead centre", "dop853")
    assert any("no progress" in note for note in motion.notes)
    assert motion.cost.samples < 16_000  # 49,033 when every panel was waited for
    assert len(told) > 20
    assert through.reached  # the dyads follow it over the change point
    t = np.linspace(0.0, motion.t_end, 33)
    assert np.abs(through.at(t).q - motion.at(t).q).max() <= through.error + motion.error


def test_the_path_alone_says_that_it_crawls():
    mech = bm.Linkage.load(GRAPHS / "joints" / "n_four_bar.json").compile()
    motion = mech.simulate("time=2", want=[], method="energy").motion
    assert (motion.status, motion.end) == ("failed", "more evaluations than allowed")
    assert any("no progress" in note for note in motion.notes)


def test_a_motion_that_creeps_is_followed_by_a_method_for_stiff_ones():
    """Behind a strong damper panels stay short for ever, and explicit steps as well."""
    data = json.loads((GRAPHS / "motions" / "damped_rod.json").read_text("utf-8"))
    data["blocks"]["damper"]["law"]["coefficients"] = [0.0, -1000.0]
    mech = bm.Graph.from_json(json.dumps(data)).compile()
    motion = mech.simulate("time=1000", want=[]).motion
    finer = mech.simulate("time=1000", want=[], method="radau", accuracy=1e-11).motion
    assert (motion.end, motion.method) == ("time", "radau")
    assert "it is stiff" in motion.why
    assert abs(motion.q_end - finer.q_end) <= motion.error + finer.error
