"""Answers of analyses have pictures, which are figures of matplotlib and stand in any axes."""

from __future__ import annotations

import inspect
from importlib import import_module

import numpy as np
import pytest
from matplotlib.figure import Figure

import blockmech as bm
from blockmech.figures.curves import with_reversals
from blockmech.figures.paper import Pictured, panelled
from tests.source import MODULES

for name in MODULES:
    if name.startswith(
        tuple(f"blockmech.{room}." for room in ("analysis", "design", "modes", "studies"))
    ):
        import_module(name)
ANSWERS = [cls for cls in Pictured.__subclasses__() if cls.__module__.startswith("blockmech.")]


@pytest.mark.parametrize("cls", ANSWERS, ids=lambda cls: cls.__name__)
def test_an_answer_draws_itself(cls):
    assert cls.figure.__module__ == cls.__module__
    assert [*inspect.signature(cls.figure).parameters] == ["self", "ax"]


class Spectrum(Pictured):
    def lines(self):
        yield "two peaks"

    def figure(self, ax=None):
        with panelled(str(self), 100.0, 2, ax=ax) as panels:
            for (axes,) in panels:
                axes.plot([0, 1], [0, 3.14 if "rad" in self._display else 180])
        return panels[0, 0].figure


def test_a_picture_is_a_figure_and_its_file_is_written_on_demand(tmp_path):
    figure = Spectrum().plot(tmp_path / "s.svg")
    assert (tmp_path / "s.svg").read_bytes().startswith(b"<?xml")
    assert [axes.lines[0].get_ydata()[-1] for axes in figure.axes] == [180, 180]
    assert figure._supxlabel.get_text() == "two peaks"
    assert "<svg" in Spectrum()._repr_html_()
    in_radians = Spectrum().to("rad").plot()
    assert [axes.lines[0].get_ydata()[-1] for axes in in_radians.axes] == [3.14, 3.14]


def test_a_picture_stands_in_the_axes_of_a_user():
    mine = Figure()
    left, right = mine.subplots(1, 2)
    assert Spectrum().plot(ax=left) is mine
    above, below = mine.axes[2:]
    assert above.get_position().y0 >= below.get_position().y1
    assert max(x.get_position().x1 for x in (above, below)) <= right.get_position().x0
    assert not right.lines  # nothing else is touched
    with pytest.raises(bm.RequestError, match=r"stand in no grid of subplots"):
        Spectrum().plot(ax=mine.add_axes((0.0, 0.0, 0.5, 0.5)))


RUIZ = bm.Graph.load("graphs/ruiz_fourbar.json")


@pytest.mark.parametrize(
    "draw",
    [
        lambda ax: RUIZ.draw(ax=ax),
        lambda ax: RUIZ.compile().draw(kind="mechanism", at=1.0, ax=ax),
        lambda ax: RUIZ.compile().draw(kind="tile", at=1.0, ax=ax),
        lambda ax: RUIZ.compile().limits().plot(ax=ax),
        lambda ax: RUIZ.run(at=[0.0, 1.0, 2.0], want="*.reaction").plot(ax=ax),
        lambda ax: RUIZ.run(at=[0.0, 1.0, 2.0], want="crank.*").plot(ax=ax, components=True),
    ],
)
def test_every_picture_is_a_figure_also_in_axes(draw):
    assert isinstance(draw(None), Figure)
    mine = Figure()
    assert draw(mine.subplots(1, 2)[0]) is mine
    assert any(axes.images or axes.patches or axes.lines for axes in mine.axes)


def test_runs_in_the_same_axes_have_their_own_colours_labels_and_one_unit():
    axes = Figure().subplots()
    few = RUIZ.run(samples=13, want=["dyad.B.reaction", "dyad.D.reaction"])
    for label, rate in (("slow", 0.1), ("fast", 30.0)):
        run = RUIZ.run(at=np.linspace(0.0, 6.0, 13), rates=rate, want="crank.drive")
        run.plot(ax=axes, label=label)
    assert [line.get_label() for line in axes.lines] == ["slow", "fast"]
    assert len({line.get_color() for line in axes.lines}) == 2
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["slow", "fast"]
    unit = axes.get_ylabel().rpartition("[")[2].rstrip("]")
    drive = with_reversals(run)["crank.drive"] * {"N m": 1.0, "kN m": 1e-3}[unit]
    np.testing.assert_allclose(axes.lines[1].get_ydata(), drive, rtol=1e-12)
    few.plot(ax=(both := Figure().subplots()), label="here")
    assert [line.get_label() for line in both.lines] == ["here: dyad.B", "here: dyad.D"]


def test_axes_with_a_mechanism_are_in_metres():
    mine = Figure()
    ax = mine.subplots()
    RUIZ.compile().draw(kind="mechanism", at=0.0, ax=ax)
    x, y = ax.get_xlim(), ax.get_ylim()
    assert x[0] < -0.5  # the frame's pins stand at x = 0 and 5.5 m
    assert 5.5 < x[1] < 12.0
    assert y[0] < 0.0 < y[1]


def test_a_run_a_motion_and_a_picture_are_of_the_mechanism_that_was_compiled(tmp_path):
    mech = bm.Graph.load("graphs/ruiz_fourbar.json").compile()
    limits = mech.limits()
    assert type(limits).__module__ == "blockmech.analysis.limits"
    assert limits.figure().axes[0].get_xlabel().endswith("[°]")
    assert mech.run(at=0.5, want="crank.q").mechanism is mech
    assert mech.compile() is mech
