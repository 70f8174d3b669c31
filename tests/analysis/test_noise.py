"""Quantities that are rounding: not followed, shown as nothing."""

from __future__ import annotations

import numpy as np
import pytest

import blockmech as bm
from blockmech.figures.curves import abscissa, chosen_panels, values
from blockmech.figures.panels import draw_panels
from tests.gallery import GRAPHS, JOINTS


@pytest.mark.parametrize("call", ["extremes", "stroke"])
def test_a_quantity_of_rounding_is_not_followed(call, monkeypatch):
    """The moment of two mirrored fingers is 4e-16 N m: looked through, it took 61 s."""
    from blockmech.analysis.working_cycle import Cycle

    calls, run = [], Cycle.run
    monkeypatch.setattr(Cycle, "run", lambda *args: calls.append(1) or run(*args))
    mech = bm.Linkage.load(JOINTS / "rack_gripper.json").compile()
    getattr(mech, call)("mechanism.shaking_moment")
    assert len(calls) < 10
    assert abs(mech.extremes("mechanism.shaking_moment").maximum.value) < 1e-14
    exact = mech.extremes("driver.cylinder.drive")
    run = mech.run(samples=1001, want="driver.cylinder.drive")["driver.cylinder.drive"]
    assert np.isclose(exact.minimum.value, run.min(), rtol=1e-9)


def test_a_table_shows_rounding_as_zero():
    """The yoke's friction and reaction pass through zero beside 80 N."""
    mech = bm.Graph.load(GRAPHS / "scotch_yoke.json").compile()
    run = mech.run(want=["crank.drive", "yoke.S1.reaction"])
    assert np.abs(run["yoke.S1.reaction"].imag).min() > 0 or np.abs(run["crank.drive"]).min() > 0
    cells = [cell for line in str(run).splitlines() for cell in line.split() if "e-" in cell]
    assert [cell for cell in cells if abs(float(cell)) < 1e-12] == []
    assert "<td>-0" not in run._repr_html_()


def test_a_picture_draws_rounding_as_zero():
    """The moment of two mirrored fingers is 4e-16 N m beside forces of 700 N."""
    mech = bm.Linkage.load(JOINTS / "rack_gripper.json").compile()
    names = ["mechanism.shaking_moment", "joint.upper_axle.reaction"]
    run = mech.run(samples=13, want=names)
    assert np.abs(run[names[0]]).max() > 0
    assert (values(run, names[0]) == 0).all()
    figure = draw_panels(chosen_panels(run, names[:1]), abscissa(run))
    assert all((line.get_ydata() == 0).all() for line in figure.axes[0].lines)


def test_a_time_within_rounding_of_the_end_is_the_end():
    mech = bm.Graph.load(GRAPHS / "ruiz_fourbar.json").compile()
    start = {"crank": (0.3, 4.0)}
    run = mech.simulate("time=0.3", start=start, times=[0.0, 0.1 * 3], want="*.q")
    assert 0.1 * 3 > 0.3
    assert run.time.tolist() == [0.0, 0.3]
    assert not any("left out" in note for note in run.notes())
    late = mech.simulate("time=0.3", start=start, times=[0.0, 0.3 + 1e-9], want="*.q")
    assert late.n == 1
