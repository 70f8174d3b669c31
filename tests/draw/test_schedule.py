"""The picture of a schedule: every call is a box, every kind of edge has its colour."""

import pytest

from blockmech.draw import draw
from blockmech.draw.schedule import draw_schedule
from blockmech.ground.errors import RequestError
from tests.machines import watt


def test_every_call_has_a_box_and_every_kind_a_key():
    plan = watt().compile().plan(["crank.drive", "crank.J_red"])
    figure = draw_schedule(plan)
    (axes,) = figure.axes
    labels = [text.get_text().split("\n")[0] for text in axes.texts if text.get_text()]
    stages = [call[1] for call in plan.graph()]
    assert sorted(s for s in labels if s in stages) == sorted(stages)
    assert {"crank", "first", "last"} <= set(labels)
    keys = {text.get_text() for text in axes.get_legend().get_texts()}
    assert keys == {data["kind"] for *_, data in plan.graph().edges(data=True)}


def test_a_schedule_is_a_kind_of_picture_and_has_no_poses(tmp_path):
    draw(watt(), tmp_path / "s.svg", "schedule", want="*.p")
    assert (tmp_path / "s.svg").exists()
    with pytest.raises(RequestError, match='kind "schedule" takes no at='):
        draw(watt(), tmp_path / "s.svg", "schedule", at=1.0)
