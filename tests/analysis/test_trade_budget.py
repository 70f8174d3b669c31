"""A trade spends its budget from cheap to dear, and says what it left out."""

from __future__ import annotations

import json
import re
import time
from pathlib import Path

import pytest

import blockmech as bm
from blockmech.analysis.trade import trade
from blockmech.analysis.trade.free_motion import FreeMotion
from blockmech.analysis.trade.measure import Clock, Question, Reference, Setting, measured
from tests.gallery import GRAPHS, mechanism
from tests.machines import chain, ruiz

PLENTY = 90.0  # [s] budget that no setting misses, even on a machine that does much else
SLACK = 5.0  # [s] what cannot be stopped: compiling, and one batch


def test_times_are_the_least_of_five_warm_repeats_at_least_with_their_spread() -> None:
    result = trade(mechanism("slider_crank"), budget=PLENTY, samples=9)
    assert all(p.repeats >= 5 for p in result.points)
    assert all(0 < p.seconds <= p.slowest for p in result.points)
    assert all(p.evaluations > 0 for p in result.points)


@pytest.mark.parametrize("graph", ["slider_crank", "parallelogram_chain"])
def test_a_trade_keeps_to_its_budget_and_names_what_it_left_out(graph: str) -> None:
    budget = 8.0
    start = time.process_time()
    result = trade(mechanism(graph), budget=budget, samples=91)
    assert time.process_time() - start < budget + SLACK
    assert result.points
    text = {p.label for p in result.points} | {s.label for s in result.skipped}
    assert {"numpy, complex64", "numpy, complex128", "scalar, complex128"} <= text


def test_a_budget_that_is_too_small_skips_and_says_so() -> None:
    result = trade(chain(14).compile(), budget=0.02, samples=2001)
    assert result.skipped
    assert {s.why for s in result.skipped} == {"the budget is spent"}
    assert "no setting was measured (the budget is spent)" in result.recommendation


class Fake:
    """A clock that only goes on where somebody says so."""

    def __init__(self) -> None:
        self.t = 0.0

    def __call__(self) -> float:
        return self.t


class Slow(Question):
    """A question whose settings take what they say."""

    reference = Reference("r", "c", 1e-15)
    takes = {"a": (0.008,)}

    def __init__(self) -> None:
        self.now, self.runs = Fake(), dict.fromkeys(self.takes, 0)
        self.order: list[str] = []

    def settings(self):
        return [Setting(name, options={"name": name}) for name in self.takes]

    def run(self, options, seconds):
        name = options["name"]
        times = self.takes[name]
        self.now.t += times[min(self.runs[name], len(times) - 1)]
        self.runs[name] += 1
        self.order.append(name)
        return ruiz().compile().run(at=0.0, want="crank.drive")

    def evaluations(self, result) -> int:
        return 1

    def error(self, result):
        return 0.0, ""


class Both(Slow):
    """Two settings, the first of which is disturbed now and then."""

    takes = {"a": (0.5, 0.3, 0.02, 0.09, 0.02, 0.3, 0.02), "b": (0.1, 0.03)}


def test_a_budget_that_ends_during_the_repeats_keeps_what_was_measured() -> None:
    question = Slow()
    (point,), skipped = measured(question, Clock(0.03, question.now), lambda *_: None)
    assert skipped == ()
    assert (point.seconds, point.slowest) == (pytest.approx(0.008), pytest.approx(0.008))
    assert point.repeats == question.runs["a"] - 2 == 2


def test_every_setting_is_run_once_before_any_is_repeated() -> None:
    question = Both()
    points, skipped = measured(question, Clock(0.55, question.now), lambda *_: None)
    assert {p.method for p in points} | {s.label for s in skipped} == {"a", "b"}
    assert {p.repeats for p in points} == {1}
    assert question.order == ["a", "b"]


def test_settings_take_turns_and_the_least_time_counts() -> None:
    question = Both()
    a, b = measured(question, Clock(PLENTY, question.now), lambda *_: None)[0]
    assert (a.seconds, b.seconds) == (pytest.approx(0.02), pytest.approx(0.03))
    assert (a.slowest, a.repeats, b.repeats) == (pytest.approx(0.3), 5, 5)
    assert question.order == ["a", "a", "b", "b", *(["b", "a"] * 5)]


def test_what_is_compiled_once_is_no_cost_of_a_run() -> None:
    class Compiled(Slow):
        takes = {"a": (2.0, 0.01), "b": (0.1,), "c": (99.0,)}

    question = Compiled()
    a, b, c = measured(question, Clock(100.0, question.now), lambda *_: None)[0]
    assert (a.seconds, b.seconds, c.seconds) == pytest.approx((0.01, 0.1, 99.0))


def test_what_a_clock_cannot_tell_is_run_until_it_can(monkeypatch) -> None:
    monkeypatch.setattr("blockmech.analysis.trade.measure.COARSEST", 0.1)
    question = Slow()
    (point,), _ = measured(question, Clock(PLENTY, question.now), lambda *_: None)
    assert question.runs["a"] == 13 * 7  # a cold run, a warm one, and five repeats that agree
    assert point.seconds == pytest.approx(0.008)


def test_repeats_go_on_until_a_second_time_confirms_the_least() -> None:
    class Falling(Slow):
        takes = {"a": (0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2)}

    question = Falling()
    (point,), _ = measured(question, Clock(PLENTY, question.now), lambda *_: None)
    assert (point.seconds, point.repeats) == (pytest.approx(0.2), 7)


def test_a_busy_machine_is_not_counted() -> None:
    """The clock of a trade is that of this process."""
    clock = Clock(PLENTY)
    start = time.perf_counter()
    time.sleep(0.2)
    assert time.perf_counter() - start > 0.19
    assert clock.spent < 0.1


def test_settings_that_give_the_same_at_the_same_cost_are_one_row() -> None:
    class Same(Slow):
        def settings(self):
            of = {"name": "a"}
            return [Setting("a", f"accuracy {x}", of) for x in ("0.001", "1e-06", "1e-09")]

    (point,), _ = measured(Same(), Clock(PLENTY), lambda *_: None)
    assert (point.setting, point.same) == ("accuracy 0.001", ("accuracy 1e-06", "accuracy 1e-09"))
    assert point.span == "accuracy 0.001 to 1e-09"


def test_a_motion_that_does_not_end_in_time_is_compared_over_what_it_reaches(monkeypatch) -> None:
    monkeypatch.setattr("blockmech.analysis.trade.free_motion.SHARE", 0.01)  # 0.6 s
    monkeypatch.setattr("blockmech.analysis.trade.measure._is_settled", bool)
    shaken = bm.Graph.load(GRAPHS / "motions" / "shaken_slider.json").compile()
    for method in ("dop853", "radau"):  # their code is kept: the share is for moving
        shaken.simulate("time=0.1", method=method, engine="llvm")
    result = trade(shaken, "simulate", budget=60.0, until="time=1e6")
    assert result.points
    assert "until time=1e6" not in result.question
    message = "the motion did not end within (0.6 s of computing|the evaluations allowed), by which"
    assert re.match(message, result.notes[0])


def test_a_part_without_a_check_is_shortened_once_more() -> None:
    class Unchecked(FreeMotion):
        def __init__(self):
            self.request, self.times, self.parts = {}, None, []

        def run(self, options, seconds):
            self.parts.append(self.request["until"])
            return reached

        def _two_kinds(self, motion, clock):
            return [("auto", reached)] * (len(self.parts) if enough else 1)

    reached = mechanism("watt_sixbar").simulate("time=2")
    for enough in (False, True):
        question = Unchecked()
        finest = question._of_its_begin(reached.motion, Clock(PLENTY))
        assert question.parts == ["time=0.04", "time=0.0008"]
        assert len(finest) == 2 * enough
        assert "until time=0.0008" in question.notes[0]


def test_evaluations_count_the_states_that_kept_series_answer() -> None:
    mech = mechanism("watt_sixbar")
    question = FreeMotion(mech, None, {"until": "time=1"}, Clock(PLENTY))
    runs = [question.run({"method": "radau", "accuracy": a}, PLENTY) for a in (1e-3, 1e-6, 1e-9)]
    counts = [question.evaluations(run) for run in runs]
    assert counts == sorted(set(counts))


@pytest.mark.parametrize("graph", ["floating_drive_press", "fivebar_falling"])
def test_a_trade_of_a_motion_keeps_to_a_budget_that_hardly_holds_its_reference(graph: str) -> None:
    mech, budget = mechanism(graph), 1.0
    start = dict.fromkeys(mech.drivers, (0.6, 0.05)) if "press" in graph else None
    begun = time.process_time()
    result = trade(mech, "simulate", budget=budget, until="time=0.1", start=start)
    assert time.process_time() - begun < budget + SLACK
    text = {p.method for p in result.points} | {s.label.split(",")[0] for s in result.skipped}
    assert {"energy", "dop853", "radau"} <= text or text == {"all settings"}
    assert all(p.error >= result.reference.floor for p in result.points)


def test_a_budget_without_a_reference_says_so_and_claims_nothing(tmp_path: Path) -> None:
    start = {"scissors.cylinder": (1.8, 0.06)}
    result = trade(
        mechanism("scissor_lift"), "simulate", budget=0.05, until="time=0.1", start=start
    )
    assert not result.points
    assert "the budget of 0.05 s is too small" in result.recommendation
    assert result.recommended is None
    assert json.loads(json.dumps(result.to_dict()))["reference"]["floor"] is None
    assert "reference:" not in result.text()
    figure = result.figure()
    assert not any(axes.get_xticks().size + axes.get_yticks().size for axes in figure.axes)
    assert "Nothing was measured" in " ".join(t.get_text() for t in figure.texts)
    result.plot(tmp_path / "trade.png")
    assert (tmp_path / "trade.png").read_bytes().startswith(b"\x89PNG")


def test_of_two_runs_the_surer_one_is_the_reference() -> None:
    mech = mechanism("watt_sixbar")
    result = FreeMotion(mech, None, {"until": "time=1"}, Clock(PLENTY))
    names = (result.reference.method, result.reference.check)
    assert sorted(n.split()[0] for n in names) == ["dop853", "energy"]
    errors = []
    for name in names:
        method, _, accuracy = name.split()
        run = mech.simulate("time=1", method=method, accuracy=float(accuracy))
        errors.append(run.motion.error)
    assert errors[0] <= errors[1]
    assert errors[0] <= result.reference.floor < 1e-9


def test_a_simulation_is_stopped_in_time_and_is_then_no_answer() -> None:
    request = {"until": "turns=30", "start": {"crank": (0.3, 9.0)}}
    question = FreeMotion(mechanism("watt_sixbar"), None, request, Clock(0.0))
    assert question.reference.method == "nothing"
    assert question.run({"method": "radau", "accuracy": 1e-9}, 0.0) is None


def test_a_motion_is_measured_with_every_friction_method() -> None:
    request = {"until": "time=0.05", "start": {"crank": (0.4, 10.0)}}
    request["accuracy"] = 1e-12  # that of the steps, far below what three iterations leave: 4e-11
    question = FreeMotion(ruiz().compile(), None, request, Clock(PLENTY))
    rows = {s.method: s for s in question.settings() if s.method.startswith("friction")}
    assert list(rows) == ["friction none", "friction single", "friction successive"]
    errors = [question.error(question.run(s.options, PLENTY))[0] for s in rows.values()]
    assert errors == sorted(errors, reverse=True)
    assert errors[0] > 1e-4 > 1e-9 > errors[2]


def test_an_interrupt_keeps_what_was_measured() -> None:
    def impatient(label: str, number: int, count: int) -> None:
        if number == 3:
            raise KeyboardInterrupt

    result = trade(ruiz().compile(), samples=51, say=impatient)
    assert len(result.points) == 3
    assert {s.why for s in result.skipped} == {"interrupted"}
