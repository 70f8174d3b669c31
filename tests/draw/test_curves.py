"""Curves of a run: the papers' Figures 12, 13 and 14."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from PIL import Image

import blockmech as bm
from blockmech.draw import draw_result, plot, run_pictures
from blockmech.figures.curves import abscissa, chosen_panels, pictures_of, with_reversals
from blockmech.figures.panels import Abscissa, Panel, draw_panels, of_pi
from blockmech.figures.paper import scaled_unit, styled
from tests.draw.scenes import fourbar, rocking_slide, slider_crank
from tests.gallery import GRAPHS
from tests.machines import chain, ruiz, toggle, watt

UNIT = re.compile(r"\[[^\]]+\]$")
KILO = 1e-3


def drawn(result: bm.Result, kind: str):
    return draw_panels(pictures_of(result)[kind], abscissa(result))


def words(plot) -> list:
    """Texts of the legends."""
    legends = [axes.get_legend() for axes in plot.axes]
    return [text for legend in legends if legend for text in legend.get_texts()]


def line(axes, label: str) -> np.ndarray:
    (curve,) = [x for x in axes.lines if x.get_label() == label]
    return curve.get_ydata()


@pytest.mark.parametrize("scene", [ruiz, toggle, slider_crank, watt, rocking_slide, fourbar])
def test_every_axis_names_its_unit(scene):
    result = scene().run(samples=31, on_gap="mark")
    for panels in pictures_of(result).values():
        figure = draw_panels(panels, abscissa(result))
        assert UNIT.search(figure.axes[-1].get_xlabel())
        assert all(UNIT.search(a.get_ylabel()) for a in figure.axes)


def test_figure_12_shows_the_driving_moment_with_and_without_friction():
    result = ruiz().run(samples=37)
    bare = ruiz(radius=0.0).run(samples=37)
    upper, lower = drawn(result, "drive").axes
    assert upper.get_ylabel() == "driving moment [kN m]"
    assert line(upper, "with friction") == pytest.approx(KILO * result["crank.drive"])
    assert line(upper, "without friction") == pytest.approx(KILO * bare["crank.drive"])
    assert lower.get_ylabel() == "due to friction [N m]"
    assert lower.lines[0].get_ydata() == pytest.approx(result["crank.drive"] - bare["crank.drive"])


def test_figure_13_shows_what_friction_takes_in_all_and_at_each_joint():
    result = ruiz().run(samples=37)
    (axes,) = drawn(result, "friction_power").axes
    assert axes.get_ylabel() == "friction power [W]"
    assert line(axes, "all joints") == pytest.approx(result["mechanism.friction_power"])
    parts = [line(axes, f"{j}") for j in ("crank.A", "dyad.B", "dyad.C", "dyad.D")]
    assert np.sum(parts, axis=0) == pytest.approx(result["mechanism.friction_power"])


def test_figure_14_shows_the_size_of_every_reaction():
    result = ruiz().run(samples=37)
    bare = ruiz(radius=0.0).run(samples=37)
    axes, lower = drawn(result, "reactions").axes
    size = np.abs(result["dyad.D.reaction"])
    assert line(axes, "dyad.D") == pytest.approx(KILO * size)
    assert sum(x.get_label() == "without friction" for x in axes.lines) == 4
    assert lower.get_ylabel() == "due to friction [N]"
    assert line(lower, "dyad.D") == pytest.approx(size - np.abs(bare["dyad.D.reaction"]))


def test_angles_are_multiples_of_pi_in_radians_and_degrees_where_asked():
    result = ruiz().run(samples=37)
    for units, expected in (
        (["rad"], ["0", "π/3", "2π/3", "π"]),
        ([], ["0", "60", "120", "180"]),
        (["deg"], ["0", "60", "120", "180"]),
    ):
        panels = pictures_of(result)["drive"]
        figure = draw_panels(panels, abscissa(result.to(*units)))
        figure.canvas.draw()
        ticks = [t.get_text() for t in figure.axes[-1].get_xticklabels()]
        assert [t for t in ticks if t in expected] == expected
    assert [of_pi(x * math.pi) for x in (-0.5, 1, 1.5, 2)] == [
        "\N{MINUS SIGN}π/2",
        "π",
        "3π/2",
        "2π",
    ]


def test_a_curve_that_is_alone_in_its_panel_says_whose_it_is():
    lone = Panel("reaction", "N", {"dyad.D": np.ones(2)}, {"dyad.D": np.zeros(2)})
    (axes,) = draw_panels([lone], Abscissa("q", np.arange(2.0))).axes
    assert [x.get_label() for x in axes.lines] == ["dyad.D with friction", "without friction"]


def test_a_mechanism_without_forces_shows_its_motion():
    panels = pictures_of(fourbar().run(samples=25))
    assert set(panels) == {"kinematics"}
    assert [(p.quantity, p.unit) for p in panels["kinematics"]] == [
        ("angle", "°"),
        ("rate", "rad/s"),
        ("angular acceleration", "rad/s²"),
    ]


def test_the_abscissa_is_the_drivers_coordinate_in_degrees_or_radians():
    result = ruiz().run(at=[0.0, 1.0, 2.0])
    for run in (result, result.to("deg"), result.to("°")):
        assert abscissa(run).words == "crank.q [°]"
        assert abscissa(run).values == pytest.approx(np.degrees([0, 1, 2]))
    assert abscissa(result.to("rad")).words == "crank.q [rad]"
    assert abscissa(toggle().run(samples=3)).words == "ram.q [m]"


def test_a_motion_under_loads_is_drawn_over_time_for_its_driver_may_come_back():
    swing = watt().compile().simulate("swings=2", start={"crank": (0.0, 0.0)})
    assert abscissa(swing).words == "time [s]"
    assert abscissa(swing, over="coordinate").words.startswith("crank.q")


def test_time_that_is_not_known_cannot_be_the_abscissa():
    g = fourbar()
    g.scene = g.scene.model_copy(update={"drive": {}})
    with pytest.raises(bm.RequestError, match="no-time"):
        abscissa(g.run(at=[0.0, 1.0]), over="time")
    with pytest.raises(bm.RequestError, match="abscissas: auto, coordinate, time"):
        abscissa(g.run(at=[0.0, 1.0]), over="angle")


def test_gaps_are_gaps_and_shaded():
    result = fourbar(rocker=1.8).run(samples=73, on_gap="mark")
    figure = draw_panels(chosen_panels(result, ["dyad.j.omega"]), abscissa(result))
    (axes,) = figure.axes
    missing = ~np.isfinite(result["dyad.j.omega"])
    assert 0 < missing.sum() < 73
    assert (np.isnan(axes.lines[0].get_ydata()) == missing).all()
    shaded = [p for p in axes.patches if p.get_label() == "no answer"]
    assert len(shaded) == 2
    clear = abscissa(result).values[~missing]
    for patch in shaded:
        x0, x1 = patch.get_x(), patch.get_x() + patch.get_width()
        assert not ((clear > x0) & (clear < x1)).any()


def test_samples_in_any_order_make_one_line():
    result = ruiz().run(at=[3.0, 1.0, 2.0])
    (axes, _) = drawn(result, "drive").axes
    assert (np.diff(axes.lines[0].get_xdata()) > 0).all()
    assert line(axes, "with friction")[0] == pytest.approx(result["crank.drive"][1])


def test_peaks_near_a_dead_centre_are_cut_off_and_said():
    values = np.append(np.linspace(1.0, 2.0, 99), 1e6)
    panel = Panel("reaction", "N", {"a": values})
    figure = draw_panels([panel], Abscissa("x [m]", np.arange(100.0)))
    assert figure.axes[0].get_ylim()[1] < 10
    assert [t.get_text() for t in words(figure)] == ["a", "cut-off peaks up to 1 MN"]
    assert not Panel("reaction", "N", {"a": values[:-1]}).peak


@pytest.mark.parametrize("scene", [ruiz, lambda: chain(5, friction=True), watt, toggle])
def test_legends_cover_no_axes_and_stay_on_the_page(scene):
    result = scene().run(samples=9, on_gap="mark")
    for panels in pictures_of(result).values():
        figure = draw_panels(panels, abscissa(result))
        with styled():
            figure.canvas.draw()
            renderer = figure.canvas.get_renderer()
            extents = [t.get_window_extent(renderer) for t in words(figure)]
        frames = [a.get_window_extent() for a in figure.axes]
        page = figure.bbox
        for word in extents:
            assert page.x0 <= word.x0
            assert word.x1 <= page.x1
            assert not any(word.overlaps(frame) for frame in frames)


def test_a_place_is_drawn_by_its_coordinates_and_a_velocity_by_its_size():
    result = ruiz().run(samples=5, want=["dyad.S.p", "dyad.S.v"])
    position, speed = chosen_panels(result, result)
    assert [*position.curves] == ["dyad.S x", "dyad.S y"]
    assert (speed.quantity, speed.unit) == ("|v|", "m/s")
    assert speed.curves["dyad.S"] == pytest.approx(np.abs(result["dyad.S.v"]))


def test_too_many_curves_are_refused():
    result = chain(8).run(samples=3)
    with pytest.raises(bm.RequestError, match="a picture holds 1 to 40 curves"):
        chosen_panels(result, result)


@pytest.mark.parametrize(
    ("unit", "largest", "expected"),
    [
        ("N m", 12000.0, (1e-3, "kN m")),
        ("N", 1200.0, (1.0, "N")),
        ("J", 2e-5, (1e6, "µJ")),
        ("rad/s", 1e5, (1.0, "rad/s")),
        ("", 1e5, (1.0, "")),
    ],
)
def test_units_get_a_prefix_where_numbers_would_be_long(unit, largest, expected):
    factor, word = scaled_unit(unit, largest)
    assert (factor, word) == (pytest.approx(expected[0]), expected[1])


def test_run_pictures_writes_one_picture_a_kind(tmp_path):
    paths = run_pictures(ruiz().run(samples=37), tmp_path / "made" / "here")
    assert [p.name for p in paths] == [
        *("drive.png", "friction_power.png", "reactions.png", "mechanism.png")
    ]
    for path in paths:
        with Image.open(path) as image:
            assert image.width / 300 * 2.54 == pytest.approx(8.5, abs=0.05)
    bare = run_pictures(fourbar().run(samples=5), tmp_path)
    assert [p.name for p in bare] == ["kinematics.png", "mechanism.png"]


def test_the_mechanism_of_a_run_is_drawn_at_poses_of_the_run(tmp_path, monkeypatch):
    """Curves have samples beside reversals of slip; the picture of the mechanism has none."""
    run, subjects = ruiz().run(samples=37), []
    drawing = draw_result(run)
    monkeypatch.setattr("blockmech.draw.draw_result", lambda x: subjects.append(x) or drawing)
    run_pictures(run, tmp_path)
    assert with_reversals(run) is not run
    assert subjects == [run]


def test_a_plot_holds_all_pictures_of_a_run_or_what_was_wanted(tmp_path):
    plot(ruiz().run(samples=37), tmp_path / "all.svg")
    text = (tmp_path / "all.svg").read_text("utf-8")
    for label in ("driving moment [kN m]", "friction power [W]", "reaction [kN]"):
        assert label in text
    some = ruiz().run(samples=37)
    assert some.plot(want=["dyad.j.angle"]).axes[0].get_ylabel() == "angle [°]"
    assert plot(some.to("rad"), None, "dyad.j.angle").axes[0].get_ylabel() == "angle [rad]"
    with pytest.raises(bm.RequestError, match="unknown-suffix"):
        plot(ruiz().run(samples=3), tmp_path / "no.gif")


def test_ticks_of_angles_are_parts_of_a_turn_in_every_picture():
    """Every 60 degrees of a turn, whatever analysis draws it."""
    mechanism = bm.read(GRAPHS / "ruiz_fourbar.json").compile()
    run = mechanism.run(samples=37)
    balanced = bm.design.balance(mechanism, "couple.moment", want="crank.drive", samples=13)
    wheel = bm.design.flywheel(mechanism, speed="300rpm", fluctuation=0.02)
    for answer in (run, run.to("deg"), balanced, wheel, mechanism.equilibria()):
        axes = answer.plot().axes[-1]
        assert axes.get_xlabel().endswith("[°]")
        low, high = axes.dataLim.intervalx
        ticks = [t for t in axes.get_xticks() if low - 1 <= t <= high + 1]
        assert ticks == pytest.approx(np.arange(0, 361, 60))


def test_a_unit_is_chosen_by_the_answer_and_not_by_its_picture():
    run = ruiz().run(samples=3)
    for answer, keyword in ((run, "unit"), (run, "degrees"), (run.mechanism.limits(), "unit")):
        with pytest.raises(TypeError, match=rf"argument '{keyword}'. write .*\.to\(\)"):
            answer.plot(**{keyword: "mm"})


@pytest.mark.parametrize("samples", [37, 38])
def test_friction_jumps_where_slip_reverses(samples):
    """A value on each side; a sample upon a reversal has none of the friction of what rests there.

    The links of the pin C do not turn against each other at 0 and 180 degrees.
    """
    mechanism = ruiz().compile()
    run = mechanism.run(samples=samples, want=["crank.drive", "dyad.C.friction", "dyad.C.slip"])
    fine = with_reversals(run)
    q, slip, friction = (fine[name] for name in ("crank.q", "dyad.C.slip", "dyad.C.friction"))
    assert (np.diff(q) > 0).all()
    assert not [f for f in fine.quality.flags if f.code == "zero-relative-speed"]
    reversals = np.flatnonzero(slip[1:] * slip[:-1] < 0)
    step = run["crank.q"][1]
    assert np.ptp(q[np.array([reversals, reversals + 1])], axis=0) == pytest.approx(step / 500)
    assert q[reversals] == pytest.approx(math.pi, abs=step / 500)
    before, after = friction[reversals], friction[reversals + 1]
    assert (np.abs(before + after) < 1e-2 * np.abs(before)).all(), "it only changes its sense"
    exact = mechanism.run(at=q, want=["crank.drive"])
    assert fine["crank.drive"] == pytest.approx(exact["crank.drive"], rel=1e-9)
    plotted = run.plot(want="crank.drive").axes[0].lines[0]
    assert np.radians(plotted.get_xdata()) == pytest.approx(q)


def test_runs_without_friction_or_slip_are_drawn_as_they_are():
    run = ruiz().run(samples=5, friction="none")
    assert with_reversals(run) is run
    still = ruiz().run(at=[0.1, 0.2, 0.3], rates=[0.0] * 3)
    assert with_reversals(still) is still
