"""Answers of analyses have pictures: each declares where, and all of them honour degrees."""

from __future__ import annotations

import inspect
from importlib import import_module

import pytest

import blockmech as bm
from blockmech.ground.pictured import Pictured
from tests.source import MODULES

for name in MODULES:
    if name.startswith(("blockmech.analysis.", "blockmech.modes.", "blockmech.studies.")):
        import_module(name)
ANSWERS = [cls for cls in Pictured.__subclasses__() if cls.__module__.startswith("blockmech.")]


@pytest.mark.parametrize("cls", ANSWERS, ids=lambda cls: cls.__name__)
def test_an_answer_names_a_function_that_draws_it(cls):
    module, _, name = cls.PICTURE.partition(":")
    answer, degrees = inspect.signature(getattr(import_module(module), name)).parameters.values()
    assert answer.annotation == cls.__name__
    assert degrees.name == "degrees"


def test_an_answer_of_ones_own_names_its_picture(tmp_path, monkeypatch):
    class Spectrum(Pictured):
        PICTURE = "spectra:draw"

        def lines(self, degrees=False):
            yield "two peaks"

    (tmp_path / "spectra.py").write_text(
        "from blockmech.draw.paper import captioned\n"
        "def draw(spectrum, degrees):\n"
        "    with captioned(str(spectrum), 100.0) as figure:\n"
        "        figure.subplots().plot([0, 1], [0, 180 if degrees else 3.14])\n"
        "    return figure\n",
        "utf-8",
    )
    monkeypatch.syspath_prepend(tmp_path)
    assert Spectrum().plot(tmp_path / "s.svg", degrees=True).read_bytes().startswith(b"<?xml")
    assert "<svg" in Spectrum()._repr_html_()


def test_a_run_a_motion_and_a_picture_are_of_the_mechanism_that_was_compiled(tmp_path):
    mech = bm.Graph.load("graphs/ruiz_fourbar.json").compile()
    limits = mech.limits()
    assert type(limits).__module__ == "blockmech.analysis.limits"
    assert limits.figure(degrees=True).axes[0].get_xlabel().endswith("[°]")
    assert mech.run(at=0.5, want="crank.q").mechanism is mech
    assert mech.compile() is mech
