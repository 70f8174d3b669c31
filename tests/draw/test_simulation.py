"""Pictures of a simulation: the second paper's Figures 6 and 7, phase plot, animation."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import blockmech as bm
from blockmech.builders import opened
from blockmech.draw.animation import rests
from blockmech.draw.simulation import (
    _smooth,
    energy_panels,
    motion_panels,
    phase_plots,
    simulation_pictures,
)
from blockmech.figures.panels import Abscissa, Panel, draw_panels
from tests.gallery import GRAPHS
from tests.machines import ruiz

WANT = ("*.q", "*.rate", "*.reaction", "mechanism.kinetic_energy", "mechanism.potential_energy")


def fallen(name, until, want=WANT):
    return bm.Graph.load(GRAPHS / f"{name}.json").compile().simulate(until, want=want)


def test_figure_6_has_the_coordinate_the_rate_and_every_reactions_magnitude():
    result = fallen("watt_sixbar", "standstill")
    angle, rate, *reactions = motion_panels(result.to("rad"))
    assert (angle.unit, rate.unit) == ("rad", "rad/s")
    assert np.array_equal(angle.curves[""], result["crank.q"])
    turned, *_ = motion_panels(result)
    assert np.array_equal(turned.curves[""], np.degrees(result["crank.q"]))
    curves = {name: row for panel in reactions for name, row in panel.curves.items()}
    assert set(curves) == {n.removesuffix(".reaction") for n in result if "reaction" in n}
    for name, values in curves.items():
        assert np.array_equal(values, np.abs(result[f"{name}.reaction"]))


def test_figure_7_shows_that_the_total_energy_is_kept():
    (panel,) = energy_panels(fallen("watt_sixbar", "standstill"))
    kinetic, potential, total = panel.curves.values()
    assert np.array_equal(total, kinetic + potential)
    assert np.ptp(total) < 1e-12 * kinetic.max()


@pytest.mark.parametrize(("name", "drivers"), [("watt_sixbar", 1), ("fivebar_falling", 2)])
def test_the_phase_plot_has_a_curve_for_each_driver_with_its_ends(name, drivers):
    result = fallen(name, "time=0.5")
    (figure,) = phase_plots(result.to("rad")).values()
    curves = [line for line in figure.axes[0].get_lines() if len(line.get_xdata()) > 1]
    assert len(curves) == drivers
    ends = [line for line in figure.axes[0].get_lines() if len(line.get_xdata()) == 1]
    assert len(ends) == 2 * drivers
    first = result.mechanism.drivers[0]
    assert np.array_equal(curves[0].get_xdata(), result[f"{first}.q"])
    assert np.array_equal(curves[0].get_ydata(), result[f"{first}.rate"])


def test_the_animation_lasts_as_long_as_the_motion_and_never_runs_backward(monkeypatch, tmp_path):
    from PIL import Image

    monkeypatch.setattr("blockmech.draw.simulation.FRAME", 0.1)  # [s] fewer pictures to paint
    result = fallen("watt_sixbar", "standstill", ["*.q"])
    files = {path.name for path in simulation_pictures(result, tmp_path)}
    assert files == {"motion.png", "energy.png", "phase.png", "animation.gif", "animation.html"}
    with Image.open(tmp_path / "animation.gif") as film:
        seconds = film.n_frames * film.info["duration"] / 1000
        assert seconds == pytest.approx(result.motion.t_end, abs=0.05)


def test_events_of_friction_are_marked_and_named():
    """A joint that reverses, and rest: dotted lines, with their words in the legend."""
    events = ((0.2, "joint reverses"), (0.5, "joint reverses"), (0.9, "rest"))
    over = Abscissa("time [s]", np.linspace(0, 1, 50), events=events)
    (axes,) = draw_panels([Panel("rate", "rad/s", {"": np.linspace(3, 0, 50)})], over).axes
    marks = [x.get_xdata()[0] for x in axes.lines if x.get_label() in ("joint reverses", "rest")]
    assert marks == [0.2, 0.5, 0.9]
    labels = [text.get_text() for text in axes.get_legend().get_texts()]
    assert labels == ["joint reverses", "rest"]


@pytest.mark.parametrize(
    ("time", "rate", "resting"), [(0.5, 0.0, False), (1.0, 0.0, True), (2.0, 0.1, False)]
)
def test_a_mechanism_rests_where_nothing_moves_after_an_event_that_says_so(time, rate, resting):
    motion = SimpleNamespace(events=[SimpleNamespace(kind="rest", t=1.0)])
    assert rests(SimpleNamespace(motion=motion), time, [rate]) == resting
    assert not rests(SimpleNamespace(motion=None), time, [rate])


def test_a_motion_of_no_duration_has_no_pictures(tmp_path):
    mech = bm.Graph.load(GRAPHS / "watt_sixbar.json").compile()
    assert simulation_pictures(mech.simulate("time=0"), tmp_path) == []


def test_curves_have_their_corners():
    """A hammer's rate jumps within a picture's curve as it does in the motion."""
    motion = bm.Graph.load(GRAPHS / "hammer.json").compile().simulate("time=1.5")
    fine, _ = _smooth(motion, motion.motion, ())
    first = motion.motion.impacts[0]
    k = int(np.searchsorted(fine.time, first.t))
    assert fine.time[k] == first.t
    name = next(name for name in fine if name.endswith(".rate"))
    assert fine[name][k - 1 : k + 1] == pytest.approx([*first.before, *first.after], rel=1e-9)


@pytest.mark.parametrize("name", ["hammer", "stribeck_slider_crank", "joints/rack_gripper"])
def test_tables_have_the_corners_of_a_motion(name):
    result = opened(GRAPHS / f"{name}.json").compile().simulate("time=1.5")
    corners = {x.t for x in (*result.motion.events, *result.motion.impacts)}
    assert {0.0, 0.75, 1.5, *(x.t for x in result.motion.impacts[:3])} <= set(result.time.tolist())
    behind = [t - result.time[result.time <= t][-1] for t in corners]
    assert max(behind) <= (0.25 * 0.0075 if name == "hammer" else 0.0)  # bounces pile up
    assert len(result.to_csv().splitlines()) == 1 + result.n > 202
    assert (np.diff(result.time) > 0).all()


def test_a_curve_has_times_enough_for_every_cycle():
    """A motion of 22 turns: at least 33 times a turn, those of a shorter one among them."""
    motion = ruiz().compile().simulate("turns=22", start={"crank": (0.0, 40.0)}, friction="none")
    turns = motion["crank.q"][-1] / (2 * np.pi)
    assert motion.motion.cycles(201) == pytest.approx(22)
    assert turns == pytest.approx(22)
    assert set(motion.motion.times(201)) <= set(motion.time)
    advance = np.diff(motion["crank.q"])
    assert np.median(2 * np.pi / advance) > 33
    few = motion.mechanism.simulate("turns=3", start={"crank": (0.0, 40.0)}, friction="none")
    assert few.n == 201


def test_a_curve_jumps_where_slip_reverses_in_a_motion():
    motion = fallen("stribeck_slider_crank", "time=1.5", ("*.friction", "*.slip"))
    begins = [x.begin for x in motion.motion.slips[1:]]
    assert begins
    for begin in begins:
        k = int(np.searchsorted(motion.time, begin))
        assert motion.time[k] == begin
        assert begin - 1e-4 < motion.time[k - 1] < begin
