"""A trade keeps to its budget: what it leaves out, what is coarser for it, and what it says."""

from __future__ import annotations

import json
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import blockmech as bm
from blockmech.analysis.trade import trade
from blockmech.analysis.trade.agreed import Agreed, Question, agreed
from blockmech.analysis.trade.errors import Yardstick, yardstick
from blockmech.analysis.trade.measure import Candidate
from blockmech.analysis.trade.moving import settings_of
from blockmech.analysis.trade.sweep import Request, Sweep
from blockmech.analysis.trade.thinned import thinned
from blockmech.analysis.trade.timing import Clock, Guard, timed
from blockmech.draw.trade import trade_figure
from blockmech.mechanism import Mechanism
from blockmech.result import Result
from blockmech.samples import Samples, make_samples
from tests.wiring import chain, ruiz, watt, wire

GRAPHS = Path(__file__).parents[2] / "graphs"
PLENTY = 90.0  # [s] budget that no setting misses, even on a machine that does much else
FINE, OTHER = ("energy", 1e-14), ("dop853", 1e-13)  # what reference and check are asked for
SLACK = 5.0  # [s] what cannot be stopped: compiling, and one batch


def mechanism(name: str) -> Mechanism:
    return bm.Graph.load(GRAPHS / f"{name}.json").compile()


@pytest.mark.parametrize("graph", ["slider_crank", "parallelogram_chain"])
def test_a_trade_keeps_to_its_budget_and_names_what_it_left_out(graph: str) -> None:
    budget = 15.0
    start = time.perf_counter()
    found = trade(mechanism(graph), budget=budget)
    assert time.perf_counter() - start < budget + SLACK
    assert found.points
    said = {p.label for p in found.points} | {s.label for s in found.skipped}
    assert {"numpy, complex64", "numpy, complex128", "scalar, complex128"} <= said


def test_a_budget_that_is_too_small_skips_and_says_so() -> None:
    found = trade(chain(14).compile(), budget=0.02, samples=2001)
    assert found.skipped
    assert all("budget" in s.why for s in found.skipped)


def test_a_budget_that_ends_during_the_repeats_claims_no_time() -> None:
    clock = Clock.started(0.02)
    assert timed(lambda: time.sleep(0.008), clock) is None
    assert clock.spent < 0.02 + 2 * 0.008 + SLACK


@pytest.mark.parametrize("budget", [1.0, 3.0])
@pytest.mark.parametrize("graph", ["floating_drive_press", "fivebar_falling", "joints/n_four_bar"])
def test_a_trade_of_a_motion_keeps_to_a_budget_that_hardly_holds_its_reference(
    graph: str, budget: float
) -> None:
    mech = linkage(graph) if "/" in graph else mechanism(graph)
    start = dict.fromkeys(mech.drivers, (0.6, 0.05)) if "press" in graph else None
    begun = time.perf_counter()
    found = trade(mech, "simulate", budget=budget, until="time=0.1", start=start)
    assert time.perf_counter() - begun < budget + SLACK
    said = {p.method for p in found.points} | {s.label.split(",")[0] for s in found.skipped}
    assert {"dop853", "lsoda", "radau"} <= said
    assert all(p.error >= found.reference.floor for p in found.points)


def linkage(name: str) -> Mechanism:
    return bm.Linkage.load(GRAPHS / f"{name}.json").compile()


def test_a_trade_of_very_many_outputs_keeps_to_its_budget() -> None:
    mech = chain(100).compile()
    begun = time.perf_counter()
    found = trade(mech, budget=3.0)
    assert time.perf_counter() - begun < 3.0 + SLACK
    assert len(mech.outputs) > 5000
    assert found.points or "budget" in found.recommendation


def test_a_budget_without_a_reference_says_so_and_claims_nothing(tmp_path: Path) -> None:
    start = {"scissors.cylinder": (1.8, 0.06)}
    mech = mechanism("scissor_lift")
    found = trade(mech, "simulate", budget=0.05, until="time=0.1", start=start)
    assert not found.points
    assert "the budget of 0.05 s is too small" in found.recommendation
    assert found.recommended is None
    assert json.loads(json.dumps(found.to_dict()))["reference"]["floor"] is None
    assert "reference:" not in found.text()
    figure = trade_figure(found)
    assert not any(axes.get_xticks().size + axes.get_yticks().size for axes in figure.axes)
    assert "Nothing was measured" in " ".join(t.get_text() for t in figure.texts)
    assert found.plot(tmp_path / "trade.png").read_bytes().startswith(b"\x89PNG")


def test_a_reference_that_was_stopped_is_named_and_its_floor_is_higher() -> None:
    start = {"crank": (0.4, 10.0)}
    mech = mechanism("stephenson_2_class_4")
    asked = {"until": "time=0.1", "start": start}
    short = trade(mech, "simulate", budget=3.0, **asked)
    if any("is too small" in note for note in short.notes):  # a machine that does much else
        return
    stopped = [note for note in short.notes if note.startswith("the budget of 3 s holds no finer")]
    reference = f"{short.reference.method}, {short.reference.check}"
    assert bool(stopped) == ("stopped at an estimate of" in reference)
    assert bool(stopped) or short.reference.floor < 1e-9


def test_of_two_runs_the_surer_one_is_the_reference() -> None:
    request = {"until": "time=0.2", "start": {"crank": (0.4, 3.0)}}
    mech = mechanism("parallelogram_chain")  # its way leads through change points
    runs = [mech.simulate(**request, method=m, accuracy=a) for m, a in (FINE, OTHER)]
    errors = {run.motion.method: run.motion.error for run in runs if run.motion is not None}
    surer, other = sorted(errors, key=lambda method: errors[method])
    found = agreed(Question(mech, request, ("crank.q",)), 21, Clock.started(PLENTY))
    assert isinstance(found, Agreed)
    assert found.reference.method.startswith(surer)
    assert found.reference.check.startswith(other)
    assert errors[surer] <= found.reference.floor < 1e-9


def test_a_check_that_does_not_end_leaves_time_for_a_cheaper_one() -> None:
    # Of loads that depend on time, radau takes longer than all of its share.
    graph = watt()
    graph.add("motor", bm.Motor(law={"kind": "fourier", "of": "time", "period": 0.7, "sines": [9]}))
    wire(graph, "frame.frame motor.a", "crank.crank motor.b")
    question = Question(
        graph.compile(), {"until": "time=2", "start": {"crank": (0.3, 6.0)}}, ("*.q",)
    )
    found = agreed(question, 21, Clock.started(15.0))
    assert isinstance(found, Agreed), found
    assert found.reference.method.startswith("dop853")
    assert "radau" in found.reference.check or "lsoda" in found.reference.check


class Stalling(Request):
    """A request whose second run is held up by something else on the machine."""

    runs = 0

    def at(self, samples: Samples, **options: Any) -> Any:
        """A run, or a long pause for one."""
        Stalling.runs += 1
        if Stalling.runs == 2:
            time.sleep(0.5)


def test_a_stall_while_few_samples_are_timed_is_not_taken_for_the_whole() -> None:
    mech = ruiz().compile()
    samples = make_samples(mech, mech.scene, samples=3601)
    request = Stalling(mech, ("*",), False)
    times = {("numpy", "complex128"): 1e-6}
    sweep = Sweep(request, samples, yardstick_of_nothing(), times, 0.0)
    assert sweep.expected(Candidate("scalar", "complex128", {"engine": "scalar"})) < 0.5


def yardstick_of_nothing() -> Yardstick:
    return Yardstick({}, {}, np.zeros(0, dtype=bool))


def test_of_more_samples_than_the_budget_holds_some_are_compared() -> None:
    found = trade(mechanism("scissor_lift"), budget=4.0, samples=3601)
    assert any("of the 3601 samples" in note for note in found.notes)
    assert found.recommendation.endswith("of the 3601 samples only")
    assert found.reference.floor < 1e-9
    assert found.points


def test_samples_that_nobody_asked_for_are_as_many_as_all_settings_hold() -> None:
    found = trade(mechanism("stephenson_3_triad"), budget=12.0)
    assert {"numpy", "friction none", "friction single", "successive"} <= set(found.series())
    assert not found.judged  # all samples that are run are compared
    assert "only" not in found.recommendation


def test_what_is_compared_at_some_samples_is_what_all_of_them_have_there() -> None:
    mech = ruiz().compile()
    samples = make_samples(mech, mech.scene, samples=501)
    few, index = thinned(samples, 40)
    assert (index[0], index[-1], len(index)) == (0, 500, 40)
    whole, part = (
        Result(mech, mech.plan("*.drive"), x, mech.evaluate(mech.plan("*.drive"), x, "numpy")[0],
               "numpy", {})
        for x in (samples, few)
    )  # fmt: skip
    stick = replace(yardstick(part, part, np.ones(40, dtype=bool)), index=index)
    assert stick.error(whole) == 0.0


def test_a_batch_that_would_outlast_its_limit_is_not_begun() -> None:
    guard = Guard(5.0)
    guard("sampling", 10.0, None)
    time.sleep(0.02)
    guard("sampling", 20.0, None)  # the ten before took 0.02 s or more
    time.sleep(0.02)
    with pytest.raises(KeyboardInterrupt):
        guard("sampling", 20.0 + 10 * 5.0 / 0.02, None)
    assert guard.tripped


def test_steps_of_a_slide_are_lengths() -> None:
    mech = mechanism("floating_drive_press")
    start = {"press.cylinder": (0.6, 0.05)}
    run = mech.simulate("time=0.01", method="lsoda", accuracy=1e-3, start=start, friction="none")
    steps = [c.label for c in settings_of(run) if c.label.startswith("euler_q, step")]
    assert steps
    assert all(label.endswith(" m") for label in steps)


def test_an_interrupt_keeps_what_was_measured() -> None:
    def impatient(what: str, number: int, count: int) -> None:
        if number == 3:
            raise KeyboardInterrupt

    found = trade(ruiz().compile(), samples=51, say=impatient)
    assert len(found.points) == 3
    assert {s.why for s in found.skipped} == {"interrupted"}
