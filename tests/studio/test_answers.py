"""Answers: curves, wires, motions and costs as the studio shows them."""

import copy
from pathlib import Path

import numpy as np
import pytest

from blockmech.builders import opened
from blockmech.cli import main
from blockmech.figures.curves import abscissa, values
from blockmech.studies.sampling import normal
from blockmech.studio import exports
from blockmech.studio.analyses import family
from blockmech.studio.answers import Answers, answer, wire_text
from blockmech.studio.curves import panels_of
from blockmech.studio.edits import renamed
from blockmech.studio.mechanism import MechanismView
from blockmech.studio.sheet import Sheet
from blockmech.studio.turn import turn
from blockmech.studio.work import Work

GRAPHS = Path(__file__).parents[2] / "graphs"


def answers_of(name="ruiz_fourbar"):
    sheet = Sheet(opened(GRAPHS / f"{name}.json"))
    view = MechanismView(sheet)
    return Answers(sheet, view)


@pytest.mark.parametrize(
    "name", ["ruiz_fourbar", "joints/ruiz_fourbar", "excavator", "slider_crank"]
)
def test_wires_say_what_the_result_says(name):
    mechanism = opened(GRAPHS / f"{name}.json").compile()
    motion = turn(mechanism)
    result = motion.result.with_friction("newton")
    run = mechanism.run(samples=361, want=(), friction="newton", on_gap="mark")
    for joint, marker in mechanism.structure.feeds.items():
        wire = f"{marker} -> {joint}"
        text, found = wire_text(result, 30, wire), run.wire(wire)
        for key in ("p", "v", "a", "F"):
            z = found[key][30]
            assert f"{key} = ({z.real:.6g}, {z.imag:.6g}) " in text
        assert f"M = {found['M'][30]:.6g} N m" in text
        if "J_red" in found:
            assert f"J_red = {found['J_red'][30]:.6g} kg" in text


def test_curves_stand_with_and_without_friction():
    motion = turn(opened(GRAPHS / "ruiz_fourbar.json").compile())
    result = answer(motion, ["crank.drive"], "newton")
    (panel,) = panels_of(result, ["crank.drive"])
    mechanism = motion.mechanism
    for method, curves in (("newton", panel.curves), ("none", panel.without)):
        (drawn,) = curves.values()
        run = mechanism.run(samples=361, want=["crank.drive"], friction=method)
        assert np.array_equal(drawn, run["crank.drive"])
    assert panel.unit == "N m"


def test_an_accuracy_chooses_the_method():
    motion = turn(opened(GRAPHS / "ruiz_fourbar.json").compile())
    result = answer(motion, ["crank.drive"], "none", 1e-6)
    fine = motion.mechanism.run(samples=361, want=["crank.drive"])
    assert result.accuracy is not None
    assert result.compare(fine)["crank.drive"] <= 1e-6


def test_the_drive_is_shown_first_and_every_axis_has_its_unit():
    answers = answers_of()
    assert answers.names.value == ["crank.drive"]
    (plot,) = answers.plots.drawn
    assert plot.figure.yaxis.axis_label == "drive [kN m]"
    assert plot.figure.xaxis.axis_label == abscissa(answers.result).words
    assert plot.figure.xaxis.axis_label.startswith("crank.q [")


def test_the_csv_is_that_of_the_command_line(tmp_path):
    answers = answers_of()
    answers.find.value = "dyad.C.reaction"
    path = tmp_path / "run.csv"
    wanted = ["--want", "crank.drive,dyad.C.reaction", "--csv", str(path)]
    assert main(["run", str(GRAPHS / "ruiz_fourbar.json"), *wanted]) == 0
    _, data = exports.exported("numbers .csv", answers.sheet, answers.view, answers)
    assert data == path.read_bytes()


def test_curves_and_cursor_follow_the_sheet():
    answers = answers_of()
    (plot,) = answers.plots.drawn
    (before,) = plot.source.data["ys"][:1]
    form = copy.deepcopy(answers.sheet.form)
    form["blocks"]["dyad"]["l_j"] = 3.2
    answers.sheet.change(form, "longer")
    assert answers.plots.drawn == [plot]
    assert not np.array_equal(plot.source.data["ys"][0], before)
    answers.view.pose = 30
    assert plot.cursor.location == plot.source.data["xs"][0][30]


def test_a_place_on_a_curve_is_a_pose_with_its_values():
    answers = answers_of()
    answers.view.seek(2.0)
    k = answers.view.pose
    assert abs(answers.view.along.values[k] - 2.0) <= np.pi / 360
    run = answers.sheet.mechanism.run(samples=361, want=["crank.drive"])
    assert answers.values.text == f"crank.drive = {run['crank.drive'][k]:.6g} N m"


def test_an_output_that_is_gone_is_no_longer_shown():
    answers = answers_of()
    answers.find.value = "dyad.C.reaction"
    answers.names.value = ["dyad.C.reaction"]
    answers.sheet.begin(opened(GRAPHS / "slider_crank.json"))
    assert answers.names.value == ["crank.drive"]
    answers.sheet.begin(type(answers.sheet.document)())
    assert answers.names.value == []
    assert answers.result is None


def test_a_simulation_is_played_in_time():
    answers = answers_of("engine")
    answers.until.value = "time=0.05"
    answers.simulate()
    answers.work.thread.join(30)
    motion = answers.view.motion
    assert motion.result.motion.reached
    assert motion.time[-1] == pytest.approx(0.05, abs=1e-12)
    assert answers.view.pose == 0
    answers.view.pose = 360
    assert answers.view.caption()[0][0].startswith("t = 0.050 s")
    assert answers.plots.drawn[0].figure.xaxis.axis_label == "time [s]"
    answers.view.turn()
    assert answers.view.motion.result.motion is None


def test_a_mechanism_without_a_start_is_released_from_the_shown_pose():
    answers = answers_of("scotch_yoke")
    answers.until.value = "time=0.01"
    answers.view.pose = 30
    (q,) = answers.view.coordinates.values()
    answers.simulate()
    answers.work.thread.join(30)
    motion = answers.view.motion.result.motion
    assert (motion.at(0.0).q, motion.at(0.0).qd) == (q, 0.0)


def test_a_simulation_can_be_stopped():
    answers = answers_of("engine")
    answers.until.value = "time=1e5"
    answers.simulate()
    answers.work.cancel()
    answers.work.thread.join(30)
    assert not answers.work.thread.is_alive()
    assert answers.work.stop.disabled
    ended = answers.view.motion.result.motion
    assert answers.said.object == "stopped" or ended.end == "interrupted"


@pytest.mark.parametrize("until", ["lunch", "time=-1"])
def test_what_cannot_be_is_a_sentence(until):
    answers = answers_of("engine")
    answers.until.value = until
    answers.simulate()
    answers.work.thread.join(30)
    assert until.removeprefix("time=") in answers.said.object
    assert "Traceback" not in answers.said.object


def test_an_output_is_added_by_a_part_of_its_name():
    answers = answers_of()
    assert "dyad.C.reaction" in answers.find.options
    answers.find.value = "dyad.C.reaction"
    assert answers.names.value == ["crank.drive", "dyad.C.reaction"]
    assert [plot.figure.yaxis.axis_label for plot in answers.plots.drawn] == [
        "drive [kN m]",
        "|reaction| [kN]",
    ]
    answers.names.value = ["crank.drive"]
    assert answers.names.options == ["crank.drive", "dyad.C.reaction"]  # a tick away


def test_names_are_text():
    """A name with angle brackets, quotes and a right-to-left mark runs nothing."""
    name = "<img src=x onerror='hurt=1'>\u202e"
    sheet = Sheet(opened(GRAPHS / "ruiz_fourbar.json"))
    sheet.change(renamed(sheet.form, "crank", name), "odd name")
    view = MechanismView(sheet)
    answers = Answers(sheet, view)
    assert "<img" in view.caption()[0][0]  # which the browser writes as text
    assert "&lt;img" in answers.values.text
    assert "<img" not in answers.values.text


def test_costs_are_told():
    answers = answers_of()
    assert "kernel calls" in answers.said.object
    answers.analyses.run("Cost")
    answers.work.thread.join(30)
    assert "crank.drive" in answers.analyses.text.object


def test_methods_are_traded():
    answers = answers_of("slider_crank")
    answers.analyses.run("Trade")
    answers.work.thread.join(30)
    told = answers.analyses.text.object
    assert told.startswith("slider_crank, run: crank.drive at 361 samples")
    assert all(precision in told for precision in ("complex64", "complex128"))


def test_analyses_say_what_the_package_says():
    answers = answers_of("slider_crank")
    mechanism, analyses = answers.sheet.mechanism, answers.analyses
    analyses.panel()
    said = {
        "Limits": mechanism.limits("crank", {}),
        "Equilibria": mechanism.equilibria(),
        "Extremes": mechanism.extremes("crank.drive"),
        "Modes": mechanism.modes(),
    }
    for name, found in said.items():
        analyses.run(name)
        analyses.work.thread.join(60)
        assert analyses.text.object == str(found)
        assert ("<img" in analyses.image.object) == hasattr(found, "figure")


def test_a_tolerance_is_that_of_the_lengths_by_the_chosen_share():
    answers = answers_of("slider_crank")
    analyses = answers.analyses
    analyses.share.value = 1.0
    analyses.run("Tolerance")
    analyses.work.thread.join(60)
    lengths = [
        p for p in answers.sheet.mechanism.parameters().values() if p.unit == "m" and p.value
    ]
    given = {p.address: normal(p.value, 0.01 * abs(p.value)) for p in lengths}
    found = answers.sheet.mechanism.tolerance(given, "crank.drive", samples=361)
    assert analyses.text.object == str(found)


def test_a_family_has_the_curves_of_five_designs():
    answers = answers_of("slider_crank")
    asked = answers._asked()._replace(share=0.1)
    panel = family(asked, "crank.length")
    lengths = 0.05 * (1 + 0.1 * np.linspace(-1, 1, 5))
    assert list(panel.curves) == [f"crank.length = {x:.4g}" for x in lengths]
    for x, curve in zip(lengths, panel.curves.values(), strict=True):
        other = answers.sheet.document.replace({"crank.length": x})
        run = other.run(samples=361, want=["crank.drive"])
        assert np.array_equal(curve, values(run, "crank.drive"))  # as drawn: no rounding beside 0
        np.testing.assert_allclose(curve, run["crank.drive"], rtol=0.0, atol=1e-14 * max(curve))
    answers.analyses.panel()
    answers.analyses.number.value = "crank.length"
    assert "<img" in answers.analyses.image.object


def test_an_analysis_of_nothing_says_so():
    answers = answers_of()
    answers.sheet.begin(type(answers.sheet.document)())
    answers.analyses.run("Limits")
    assert "nothing moves" in answers.analyses.text.object


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_work_that_fails_by_an_error_of_ours_leaves_room_for_more():
    heard, done = [], []
    work = Work(heard.append)
    work.begin(lambda told: 1 / 0, done.append)
    work.thread.join(30)
    assert "an error of blockmech" in heard[-1]
    work.begin(lambda told: 7, done.append)
    work.thread.join(30)
    assert (done, heard[-1]) == ([7], "")
