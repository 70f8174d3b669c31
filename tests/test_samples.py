"""Every way of naming samples, and every wrong way."""

import math
import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import blockmech as bm
from blockmech.ground.units import UnitWarning
from tests.machines import crank, ruiz, toggle, wire


def turning(law=None):
    """A bare crank: what comes out of it is what was asked for."""
    graph = crank()
    if law is not None:
        graph.drive("crank", law)
    return graph


def pair(*laws):
    """Two cranks side by side."""
    g = bm.Graph("pair")
    g.add("frame", bm.Frame(markers={"A": (0.0, 0.0), "B": (3.0, 0.0)}))
    for name, marker, law in zip(("left", "right"), "AB", (*laws, None, None), strict=False):
        g.add(name, bm.Crank(length=1.0))
        wire(g, f"frame.{marker} {name}.A")
        if law is not None:
            g.drive(name, law)
    return g


def motion(result, driver="crank"):
    return tuple(list(result[f"{driver}.{x}"]) for x in ("q", "rate", "acceleration"))


WANT = ["*.q", "*.rate", "*.acceleration"]
STEADY = bm.motion.ConstantRate(rate=10.0, start=1.0, end=3.0)
SPEEDING = bm.motion.RateAcceleration(rate=2.0, acceleration=3.0, start=1.0, end=3.0)
TABLE = bm.motion.Trajectory(times=[1.0, 2.0, 4.0], values=[0.0, 1.0, 5.0], interpolation="linear")


# ---- by coordinate -----------------------------------------------------------------------


@pytest.mark.parametrize(
    "at", [0.5, 1, np.float64(0.5), np.float32(0.5), np.int64(2), [0.5], (0.5,), np.array(0.5)]
)
def test_one_coordinate_is_one_sample(at):
    r = turning(STEADY).run(at=at, want=WANT)
    value = float(np.atleast_1d(at)[0])
    assert motion(r) == ([value], [10.0], [0.0])
    assert r.n == 1


@pytest.mark.parametrize("at", [[0, 1, 2], (0.0, 1.0, 2.0), range(3), np.arange(3)])
def test_row_of_coordinates_is_a_row_of_samples(at):
    r = turning(STEADY).run(at=at, want=WANT)
    assert motion(r) == ([0.0, 1.0, 2.0], [10.0] * 3, [0.0] * 3)
    assert r.drivers["crank.q"].tolist() == [0.0, 1.0, 2.0]


def test_without_a_law_the_driver_rests():
    assert motion(turning().run(at=2.0, want=WANT)) == ([2.0], [0.0], [0.0])
    assert motion(turning().run(at=[2.0], want=WANT)) == ([2.0], [0.0], [0.0])


def test_law_of_the_coordinate_gives_rate_and_acceleration():
    r = turning(SPEEDING).run(at=[1.0, 2.0], want=WANT)
    assert motion(r) == ([1.0, 2.0], [2.0, math.sqrt(4 + 6)], [3.0, 3.0])


def test_rates_and_accelerations_replace_those_of_the_law():
    r = turning(STEADY).run(at=[1.0, 2.0], rates=-3.0, accelerations=[5.0, 6.0], want=WANT)
    assert motion(r) == ([1.0, 2.0], [-3.0, -3.0], [5.0, 6.0])
    r = turning(STEADY).run(at=[1.0, 2.0], accelerations=4.0, want=WANT)
    assert motion(r) == ([1.0, 2.0], [10.0, 10.0], [4.0, 4.0])


def test_law_sampled_by_time_may_be_asked_by_coordinate_with_rates():
    g = turning(TABLE)
    r = g.run(at=0.5, rates=1.0, want=WANT)
    assert motion(r) == ([0.5], [1.0], [0.0])
    with pytest.raises(bm.RequestError, match="sampled by time, not by coordinate"):
        g.run(at=0.5)


# ---- several drivers ---------------------------------------------------------------------


def test_each_driver_gets_its_own_row():
    r = pair().run(at={"right": [1.0, 2.0], "left": 0.5}, rates={"left": 3.0}, want=WANT)
    assert motion(r, "left") == ([0.5, 0.5], [3.0, 3.0], [0.0, 0.0])
    assert motion(r, "right") == ([1.0, 2.0], [0.0, 0.0], [0.0, 0.0])
    assert list(r.drivers) == ["left.q", "right.q"]
    assert r.time is None


def test_several_drivers_run_through_their_ranges_together():
    g = pair(STEADY, bm.motion.ConstantRate(rate=1.0, start=0.0, end=8.0))
    r = g.run(samples=5, want=WANT)
    assert r["left.q"].tolist() == [1.0, 1.5, 2.0, 2.5, 3.0]
    assert r["right.q"].tolist() == [0.0, 2.0, 4.0, 6.0, 8.0]


def test_laws_of_coordinate_and_of_time_meet_in_time():
    g = pair(STEADY, bm.motion.Harmonic(amplitude=1.0, frequency=0.5))
    r = g.run(samples=3, want=WANT)
    assert r.time.tolist() == [0.0, 1.0, 2.0]  # the longer of 0.2 s and 2 s
    assert r["left.q"].tolist() == [1.0, 11.0, 21.0]


# ---- by range ----------------------------------------------------------------------------


def test_default_is_the_laws_range_with_361_samples():
    r = turning(bm.motion.ConstantRate(rate=10.0)).run(want=WANT)
    assert r.n == 361
    assert r["crank.q"][0] == 0.0
    assert r["crank.q"][-1] == 2 * math.pi
    assert r["crank.q"][180] == pytest.approx(math.pi, rel=1e-15)


# ---- by time -----------------------------------------------------------------------------


def test_times_sample_the_law_by_time():
    r = turning(STEADY).run(times=[0.0, 0.1, 0.5], want=WANT)
    assert motion(r) == ([1.0, 2.0, 6.0], [10.0] * 3, [0.0] * 3)
    assert r.time.tolist() == [0.0, 0.1, 0.5]


def test_time_of_a_coordinate_is_known_where_the_law_tells_it():
    assert turning(STEADY).run(at=[1.0, 2.0, 3.0], want=WANT).time == pytest.approx([0, 0.1, 0.2])
    r = turning(SPEEDING).run(at=[1.0, 3.0], want=WANT)
    assert r.time == pytest.approx([0.0, (math.sqrt(4 + 12) - 2) / 3])
    assert turning().run(at=[1.0, 2.0], want=WANT).time is None
    assert turning(STEADY).run(at=[1.0, 2.0], rates=3.0, want=WANT).time is None


def test_text_with_a_unit_is_a_number_in_si():
    at = ["90deg", 1.0, "1/4 turn"]
    result = turning().run(at=at, rates="300rpm", want=["crank.q", "crank.rate"])
    assert result["crank.q"] == pytest.approx([math.pi / 2, 1.0, math.pi / 2], rel=1e-15)
    assert result["crank.rate"] == pytest.approx(10 * math.pi, rel=1e-15)
    assert turning(STEADY).run(times=["10ms"], want=WANT).time == pytest.approx([0.01])


@pytest.mark.parametrize(
    "at", [20, 90.0, -180, 3600, [0, 30], [-20, 20], [0, 360], np.linspace(0, 360, 37)]
)
def test_whole_tens_are_surely_degrees(at):
    with pytest.warns(UnitWarning, match=r"these are radians, -?\d+ rad are .* turns") as caught:
        turning().run(at=at, want=WANT)
    assert [w.filename for w in caught] == [__file__]


@pytest.mark.parametrize(
    "at", [90.5, [0, 45], [0, 20], [-20, 0], [0.5, 360], 0, 3610, 1e9, [0, 1e9]]
)
def test_other_numbers_may_well_be_radians(at):
    with warnings.catch_warnings():
        warnings.simplefilter("error", UnitWarning)
        assert turning().run(at=at, want=WANT).n == np.size(at)


def of_whole_tens():
    graph = crank(1.0, bm.Link(mass=2.0, inertia=0.1, cm=(0.5, 0.0)), gravity=9.81)
    graph.drive("crank", bm.motion.ConstantRate(rate=10.0, start=10.0, end=30.0))
    graph.start("crank", q=20.0)
    return graph.compile()


CHOSEN = {
    "extremes": lambda m: m.extremes("crank.q"),
    "stroke": lambda m: m.stroke("crank.crank.omega"),
    "limits": lambda m: m.limits(),
    "equilibria": lambda m: m.equilibria(),
    "simulate": lambda m: m.simulate("time=0.1"),
    "study": lambda m: m.study({"crank.length": [1.0, 1.1]}, want="max(crank.drive)"),
    "draw": lambda m: m.draw(),
}


@pytest.mark.parametrize("ask", CHOSEN.values(), ids=list(CHOSEN))
def test_places_that_an_analysis_chooses_are_no_degrees_of_the_users(ask):
    mechanism = of_whole_tens()
    with warnings.catch_warnings():
        warnings.simplefilter("error", UnitWarning)
        ask(mechanism)


WRITTEN = {
    "run": lambda m, at: m.run(at, want="crank.q"),
    "verify": lambda m, at: m.verify(at=at),
    "sensitivity": lambda m, at: m.sensitivity("crank.drive", "crank.length", at=at),
    "balance": lambda m, at: bm.design.balance(m, "crank.links.crank.mass", "crank.drive", at),
    "study": lambda m, at: m.study({"crank.length": [1.0]}, want="max(crank.drive)", at=at),
}


@pytest.mark.parametrize("ask", WRITTEN.values(), ids=list(WRITTEN))
def test_places_that_the_user_writes_warn_at_the_line_of_the_call(ask):
    with pytest.warns(UnitWarning, match="these are radians") as caught:
        ask(of_whole_tens(), [20, 40])
    assert {w.filename for w in caught} == {__file__}


@pytest.mark.filterwarnings("ignore::blockmech.ground.units.UnitWarning")
@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=30))
def test_samples_come_back_as_they_were_given(at):
    r = turning(STEADY).run(at=at, want=WANT)
    assert r["crank.q"].tolist() == at


# ---- wrong ways --------------------------------------------------------------------------

NOT_A_ROW = "at[crank]: not a row of numbers. give a number or a sequence."
WRONG = [
    ({"at": "1.0"}, 'at[crank]: "1.0" is not a number with a unit. a number, in SI or with rad'),
    ({"at": ["0deg", "1"]}, 'at[crank]: "1" is not a number with a unit'),
    ({"at": "50mm"}, 'at[crank]: "50mm" has another kind of unit. a number, in SI or with rad'),
    ({"at": 0.0, "rates": "50deg"}, 'rates[crank]: "50deg" has another kind of unit'),
    ({"at": True}, NOT_A_ROW),
    ({"at": [True, False]}, NOT_A_ROW),
    ({"at": 1j}, NOT_A_ROW),
    ({"at": np.array([1j, 2.0])}, NOT_A_ROW),
    ({"at": b"1"}, NOT_A_ROW),
    ({"at": [None]}, NOT_A_ROW),
    ({"at": [0, 1, [2]]}, NOT_A_ROW),
    ({"at": 10**400}, NOT_A_ROW),
    ({"at": [10**400]}, NOT_A_ROW),
    ({"at": []}, "at[crank]: has shape (0,). give one row of numbers."),
    ({"at": [[1, 2]]}, "at[crank]: has shape (1, 2). give one row of numbers."),
    ({"at": math.nan}, "at[crank][0]: not a finite number: nan."),
    ({"at": [0.0, math.inf]}, "at[crank][1]: not a finite number: inf."),
    ({"at": {"x": 1.0}}, "at: unknown: x; missing: crank. drivers: crank."),
    ({"at": {1: 2.0}}, "at: unknown: 1; missing: crank. drivers: crank."),
    ({"at": {}}, "at: missing: crank. drivers: crank."),
    ({"at": 1.0, "rates": {"x": 1.0}}, "rates: unknown: x. drivers: crank."),
    ({"at": 1.0, "rates": math.nan}, "rates[crank][0]: not a finite number: nan."),
    ({"at": [1, 2, 3], "rates": [1, 2]}, "crank: has 2 samples where others have 3."),
    ({"at": 1.0, "samples": 3}, "at, samples: name the samples in one way only."),
    ({"at": 1.0, "times": [1.0]}, "at, times: name the samples in one way only."),
    ({"samples": 3, "times": [1.0]}, "samples, times: name the samples in one way only."),
    ({"rates": 3.0}, "rates: rates need coordinates. give at= as well."),
    ({"times": [0.1], "rates": 3.0}, "rates: rates need coordinates. give at= as well."),
    ({"samples": 0}, "samples: must be a positive whole number, got 0."),
    ({"samples": -1}, "samples: must be a positive whole number, got -1."),
    ({"samples": 2.0}, "samples: got 2.0. a whole number is meant."),
    ({"samples": True}, "samples: got True. a whole number is meant."),
    ({"samples": "3"}, "samples: got '3'. a whole number is meant."),
    ({"times": []}, "times: has shape (0,). give one row of numbers."),
    ({"times": [0.0, math.nan]}, "times[1]: not a finite number: nan."),
]


@pytest.mark.parametrize(("request_", "message"), WRONG, ids=lambda x: str(x)[:40])
def test_wrong_request_gets_one_clear_sentence(request_, message):
    with pytest.raises(bm.RequestError) as caught:
        turning(STEADY).run(**request_, want=WANT)
    (problem,) = caught.value.problems
    assert problem.code in ("bad-request", "wrong-type")
    assert message in str(problem)


def test_several_drivers_must_be_named():
    with pytest.raises(bm.RequestError, match="the mechanism has 2 drivers"):
        pair().run(at=1.0)
    with pytest.raises(bm.RequestError, match=r"at: missing: right\. drivers: left, right"):
        pair().run(at={"left": 1.0})


def test_lengths_of_different_drivers_must_agree():
    with pytest.raises(bm.RequestError, match="has 2 samples where others have 3"):
        pair().run(at={"left": [1, 2], "right": [1, 2, 3]})


def test_range_without_a_law_is_refused_for_every_driver_that_has_none():
    with pytest.raises(bm.RequestError) as caught:
        pair().run()
    assert [p.where for p in caught.value.problems] == ["scene.drive.left", "scene.drive.right"]
    assert {p.code for p in caught.value.problems} == {"no-law"}


def test_law_that_never_gets_there_is_refused():
    braking = bm.motion.RateAcceleration(rate=2.0, acceleration=-1.0, start=0.0, end=9.0)
    with pytest.raises(bm.RequestError, match="does not reach sample 2"):
        turning(braking).run(at=[0.0, 2.0, 2.5])
    with pytest.raises(bm.RequestError, match="does not reach sample 0"):
        turning(TABLE).run(times=[0.5])


def test_mechanism_without_drivers_has_one_pose_and_takes_no_coordinates():
    g = bm.Graph("truss")
    g.add("frame", bm.Frame(markers={"B": (0.0, 0.0), "D": (2.0, 0.0)}))
    g.add("dyad", bm.RRR(l_i=1.5, l_j=1.5, links={"i": bm.Link(mass=1.0, cm=(0.5, 0.0))}))
    wire(g, "frame.B dyad.B", "frame.D dyad.D")
    r = g.run()
    assert r.n == 1
    assert r["dyad.C.p"][0] == pytest.approx(1 + 1j * math.sqrt(1.5**2 - 1))
    with pytest.raises(bm.RequestError, match="the mechanism has 0 drivers"):
        g.run(at=1.0)


# ---- settings that go with a request -----------------------------------------------------

SETTINGS = [
    ({"friction": "x"}, "unknown-method", 'no friction method "x"'),
    ({"friction": bm.friction.Successive(tolerance=-1.0)}, "bad-value", "got -1"),
    ({"friction": bm.friction.Successive(tolerance=math.nan)}, "bad-value", "got nan"),
    ({"friction": bm.friction.Successive(tolerance=math.inf)}, "bad-value", "got inf"),
    ({"friction": bm.friction.Successive(iterations=0)}, "bad-value", "at least 1, got 0"),
    ({"friction": bm.friction.Successive(iterations=2.5)}, "bad-value", "whole number"),
    ({"engine": "x"}, "unknown-engine", "engines: auto, scalar, numpy"),
    ({"precision": "x"}, "unknown-engine", "complex64, complex128, clongdouble"),
    ({"engine": "scalar", "precision": "complex64"}, "unknown-engine", 'engine "scalar"'),
    ({"engine": "numpy", "chunk": 0}, "bad-value", "at least 1 sample, got 0"),
    ({"engine": "numpy", "chunk": -5}, "bad-value", "at least 1 sample, got -5"),
    ({"engine": "scalar", "chunk": 0}, "bad-value", "at least 1 sample, got 0"),
    ({"chunk": 0}, "bad-value", "at least 1 sample, got 0"),
    ({"chunk": 2.5}, "wrong-type", "got 2.5. a whole number is meant"),
    ({"chunk": "7"}, "wrong-type", "got '7'. a whole number is meant"),
    ({"on_gap": "x"}, "bad-value", "valid: raise, mark, stop"),
    ({"want": ["crank.drve"]}, "unknown-output", 'did you mean "crank.drive"?'),
    ({"want": ["nothing.*"]}, "unknown-output", "no output has that name"),
    ({"friction": False}, "wrong-type", "friction: "),
    ({"friction": 0}, "wrong-type", "friction: "),
    ({"friction": ""}, "unknown-method", "friction: "),
    ({"friction": ["none"]}, "wrong-type", "friction: "),
    ({"static": "false"}, "wrong-type", "static: "),
    ({"static": None}, "wrong-type", "static: "),
    ({"friction": bm.friction.Successive(iterations=math.nan)}, "bad-value", "iterations: "),
    ({"friction": bm.friction.Successive(iterations=True)}, "bad-value", "iterations: "),
    ({"friction": bm.friction.Successive(tolerance="1e-3")}, "bad-value", "tolerance: "),
    ({"at": np.ma.array([1.0, 2.0], mask=[False, True])}, "bad-request", "at[crank]: "),
    ({"samples": 2**63, "at": None}, "bad-request", "samples: "),
    ({"chunk": True}, "wrong-type", "chunk: "),
]


@pytest.mark.parametrize(("settings", "code", "message"), SETTINGS, ids=lambda x: str(x)[:40])
def test_wrong_setting_gets_one_clear_sentence(settings, code, message):
    with pytest.raises(bm.RequestError) as caught:
        ruiz().run(**{"at": [1.0, 2.0]} | settings)
    (problem,) = caught.value.problems
    assert problem.code == code
    assert message in str(problem)


def test_all_wrong_settings_are_told_at_once():
    with pytest.raises(bm.RequestError) as caught:
        ruiz().run(at=1.0, friction=bm.friction.Successive(tolerance=-1.0, iterations=0))
    assert [p.where for p in caught.value.problems] == ["tolerance", "iterations"]
    with pytest.raises(bm.RequestError) as caught:
        ruiz().run(at=1.0, want=["a.b", "crank.drive", "c.d"])
    assert [p.where for p in caught.value.problems] == ["a.b", "c.d"]


def test_patterns_tell_capital_letters_apart():
    r = ruiz().run(at=1.0, want=["dyad.i*", "dyad.[BC].reaction", "*.?.p"])
    assert "dyad.i.omega" in r
    assert "dyad.C.reaction" in r
    assert "crank.A.p" in r
    assert "dyad.D.reaction" not in r
    with pytest.raises(bm.RequestError):
        ruiz().run(at=1.0, want="DYAD.*")


def test_slide_drive_is_sampled_in_metres():
    r = toggle().run(samples=3, want=["ram.q", "ram.rate"])
    assert r["ram.q"].tolist() == [0.0, 0.3, 0.6]
    assert r.unit("ram.q") == "m"
    assert r.time == pytest.approx([0.0, 0.6, 1.2])


def test_a_slide_has_no_turn_to_go_through():
    """A law without an end goes through a turn; on a slide it would be 2 pi metres."""
    ram = bm.Linkage("ram")
    ram.add_link("ram", mass=1.0, cm=(0.0, 0.0))
    ram.add_joint("guide", "P", ["frame", "ram"], point=(0.0, 0.0))
    ram.add_driver("cylinder", "guide", bm.motion.ConstantRate(rate="50 mm/s"))
    mechanism = ram.compile()
    for ask in (mechanism.run, lambda: mechanism.extremes("driver.cylinder.drive")):
        with pytest.raises(bm.RequestError, match=r"\[no-range\].*start and end"):
            ask()
    assert mechanism.run(times=[0.0, 2.0])["driver.cylinder.q"].tolist() == [0.0, 0.1]
    law = bm.motion.ConstantRate(rate="50 mm/s", end="200 mm")
    ram.drivers.clear()
    ram.add_driver("cylinder", "guide", law)
    assert ram.run(samples=3)["driver.cylinder.q"].tolist() == [0.0, 0.1, 0.2]
