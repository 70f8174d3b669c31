"""At a prompt and in a notebook: answers are tables, mechanisms draw themselves."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import blockmech as bm
from blockmech.draw import animate
from tests.gallery import GRAPHS

RUIZ = bm.Graph.load(GRAPHS / "ruiz_fourbar.json")


def moved(mechanism: bm.Mechanism) -> bm.Result:
    return mechanism.simulate("time=0.1", start={"crank": (0.0, 5.0)}, friction="none")


ANSWERS: dict[str, tuple[Callable[[bm.Mechanism], Any], str]] = {
    "limits": (lambda m: m.limits(), "crank.q: turns fully"),
    "modes": (lambda m: m.modes(arcs=False), "2 modes"),
    "verify": (lambda m: m.verify(samples=3), "allowed"),
    "extremes": (lambda m: m.extremes("dyad.margin"), "minimum"),
    "equilibria": (lambda m: m.equilibria(), "stable"),
    "linearize": (lambda m: m.linearize(1.0), "keeps it up"),
    "stroke": (lambda m: m.stroke("dyad.j.angle"), "stroke 1.62"),
    "motion": (
        lambda m: m.simulate("time=0.1", start={"crank": (0.0, 5.0)}, friction="none").motion,
        "method",
    ),
}


@pytest.mark.parametrize("name", ANSWERS)
def test_an_answer_is_its_text_wherever_it_is_shown(name: str) -> None:
    ask, word = ANSWERS[name]
    outcome = ask(RUIZ.compile())
    assert word in str(outcome)
    assert repr(outcome).startswith(f"<{type(outcome).__name__}: {str(outcome).splitlines()[0]}")
    assert "\n" not in repr(outcome)
    assert word in outcome._repr_html_()
    assert "(" + name not in repr(outcome).lower()  # no dump of fields


@pytest.mark.parametrize("name", ["ruiz_fourbar", "fivebar_falling"])
def test_linkages_and_mechanisms_draw_themselves(name: str) -> None:
    linkage = bm.Linkage.load(GRAPHS / "joints" / f"{name}.json")
    svg = linkage._repr_svg_()
    assert svg is not None
    assert svg == linkage.compile()._repr_svg_()
    assert svg.count("<path") > 10
    linkage.joints.clear()
    assert linkage._repr_svg_() is None  # of an unfinished one a notebook shows its words


# ---- pictures below the words -------------------------------------------------------------


def said_in(figure: Any) -> str:
    return " ".join(text.get_text() for axes in figure.axes for text in axes.texts)


def short_crank_and_long_coupler() -> bm.Mechanism:
    """A crank of 2 m that its dyad of 6 and 1 m lets swing, but not turn."""
    return RUIZ.replace({"dyad.l_j": 1.0}).compile()


def test_limits_show_their_arcs_and_what_ends_them(tmp_path: Any) -> None:
    limits: Any = short_crank_and_long_coupler().limits()
    markup, figure = limits._repr_html_(), limits.to("rad").figure()
    assert markup.startswith("<pre>")
    assert "<svg" in markup
    (axes,) = figure.axes
    assert len(axes.patches) == len(limits.arcs) > 0
    for arc, bar in zip(limits.arcs, axes.patches, strict=True):
        assert (bar.get_x(), bar.get_width()) == pytest.approx((arc.start.q, arc.length))
        assert f"{arc.start}" in said_in(figure)
    turned = limits.figure().axes[0].patches[0]
    assert turned.get_x() == pytest.approx(np.degrees(limits.arcs[0].start.q))
    limits.plot(tmp_path / "arcs.png")
    assert (tmp_path / "arcs.png").read_bytes().startswith(b"\x89PNG")


def test_modes_show_their_arcs_and_which_one_the_file_has() -> None:
    modes: Any = short_crank_and_long_coupler().modes({"crank": 0.0})
    assert "<svg" in modes._repr_html_()
    figure = modes.figure()
    (group,) = modes.groups
    assert len(figure.axes[0].patches) == len(group.arcs)
    assert "branch +1" in said_in(figure)
    dots = [x for x in figure.axes[0].lines if x.get_marker() == "o" and len(x.get_xdata())]
    chosen = [mode.arc for mode in group.samples[0] if mode.chosen]
    assert [int(dot.get_ydata()[0]) for dot in dots] == chosen
    without: Any = RUIZ.compile().modes({"crank": 0.0}, arcs=False)
    assert "<svg" not in without._repr_html_()
    with pytest.raises(bm.RequestError, match="no arc to draw"):
        without.figure()


def test_a_motion_shows_its_course_below_its_table() -> None:
    fallen = RUIZ.compile().simulate("time=0.1", start={"crank": (0.0, 5.0)}, friction="none")
    markup = fallen._repr_html_()
    assert "<table" in markup
    assert "coordinate of crank" in markup[markup.index("<svg") :]
    assert "<svg" not in RUIZ.compile().run(samples=3)._repr_html_()


# ---- names in an animation ----------------------------------------------------------------


def boxes(film: Any, frame: int) -> list[tuple[complex, complex]]:
    return [(label.centre(frame), label.half) for label in film.names]


@pytest.mark.parametrize("name", ["joints/ruiz_fourbar", "watt_sixbar"])
def test_names_in_an_animation_lie_neither_on_each_other_nor_on_pins(name: str) -> None:
    kind: Any = bm.Linkage if "/" in name else bm.Graph
    film = animate(kind.load(GRAPHS / f"{name}.json"), frames=24)
    page, frames = film.page, len(film.captions)
    pins = [shape for shape in film.shapes if shape.what.startswith("pin:")]
    assert len(pins) >= 4
    for k in range(0, frames, 2):
        result = boxes(film, k)
        for i, (a, half) in enumerate(result):
            for b, second in result[i + 1 :]:
                apart, room = a - b, half + second
                assert abs(apart.real) >= room.real - 3 or abs(apart.imag) >= room.imag - 3
            for pin in pins:
                z = complex(page.points(pin.at(k))[0]) - a
                assert abs(z.real) > half.real - 1.5 or abs(z.imag) > half.imag - 1.5


# ---- pins in the world --------------------------------------------------------------------


def test_pins_in_the_world_are_joints_in_the_links_own_frames() -> None:
    poses = {"crank": (0.0, 0.0, 1.0), "rod": (0.5, 0.8, 0.3), "rocker": (2.5, 0.0, 1.9)}
    pins = {
        "A": (["frame", "crank"], (0.0, 0.0)),
        "B": (["crank", "rod"], (0.54, 0.84)),
        "C": (["rod", "rocker"], 1.9 + 1.8j),
        "D": (["frame", "rocker"], (2.5, 0.0)),
    }
    runs = []
    for bases in (poses, dict.fromkeys(poses)):  # in frames of their own, and drawn in one
        m = bm.Linkage("drawn")
        for link, pose in bases.items():
            m.add_link(link, pose=pose)
        for name, (links, point) in pins.items():
            m.add_joint(name, "R", links, point=point)
        m.add_driver("motor", "A")
        first = m.links["crank"].pose
        assert first is not None
        q = first[2]
        run = m.run(at=[q, q + 0.5], rates=1.0, want=["link.rod.p", "link.*.omega"])
        x, y, _ = m.links["rod"].pose or (np.nan, np.nan, 0.0)
        assert run["link.rod.p"][0] == pytest.approx(complex(x, y), abs=1e-12)
        runs.append(run)
    for name in list(runs[0])[1:]:
        np.testing.assert_allclose(runs[0][name], runs[1][name], rtol=0, atol=1e-12)


def test_a_pin_of_a_link_that_is_not_there_names_those_that_are() -> None:
    m = bm.Linkage("drawn")
    m.add_link("crank")
    with pytest.raises(bm.GraphError, match=r'joints\.A\.links: no link "crnk".*"crank"'):
        m.add_joint("A", "R", ["frame", "crnk"], point=(0.0, 0.0))


def test_recorded_outputs_hold_a_file_to_what_it_does(call: Any, tmp_path: Any) -> None:
    file = tmp_path / "ruiz.json"
    RUIZ.save(file)
    assert call("test", file, "--record", "crank.drive,dyad.C.p").code == 0
    assert [list(e.want) for e in bm.Graph.load(file).extras["expect"]] == [
        ["crank.drive"],
        ["dyad.C.p"],
    ]
    assert call("test", file).code == 0
    heavier = bm.Graph.load(file)
    heavier.gravity = (0.0, -0.001)
    heavier.save(file)
    outcome = call("test", file)
    assert outcome.code == 1
    assert "FAILS" in outcome.out


def test_what_is_no_table_says_in_a_line_what_it_is() -> None:
    mechanism = RUIZ.compile()
    linkage = bm.Linkage.load(GRAPHS / "joints" / "ruiz_fourbar.json")
    answers = {
        "<Plan of crank.drive: 8 kernel calls": mechanism.plan("crank.drive"),
        "<Objective of ruiz_fourbar: by dyad.l_i>": mechanism.objective(
            ["dyad.l_i"], want="max(crank.q)", at=1.0
        ),
        "<Animation of ruiz_fourbar: 2 frames>": animate(mechanism, at=[0.5, 1.0]),
        "<Decomposition of ruiz_fourbar: I(": linkage.decompose(),
    }
    for beginning, answer in answers.items():
        assert repr(answer).startswith(beginning)
        assert "\n" not in repr(answer)
