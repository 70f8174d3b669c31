"""Synthesis: what is drawn is what is asked, and a design is one step."""

import numpy as np
import pytest

import blockmech as bm
from blockmech.editor.analyses import synthesis, wishes
from tests.studio.hand import Hand


def drawn(places, links=()):
    pane = Hand(bm.Linkage("wanted"))
    pane.add(*places)
    for ends in links:
        pane.act("Link", *ends)
    return pane


def test_positions_of_a_body_are_lone_links():
    pane = drawn([0j, 1j, 2 + 0j, 3 + 0j, 5 + 0j, 5 - 2j, 9 + 9j], ["AB", "CD", "EF"])
    points, positions = wishes(pane.form)
    assert points == [9 + 9j]
    assert positions == [(0.0, 0.0, np.pi / 2), (2.0, 0.0, 0.0), (5.0, 0.0, -np.pi / 2)]


def test_a_candidate_passes_the_points_and_is_taken_as_a_drawing():
    places = [0j, 1 + 0.5j, 2 + 0.6j]
    pane = drawn(places)
    before = pane.form
    made = synthesis(pane.ask())["designs"]
    sizes = [card["size"] for card in made]
    assert sizes == sorted(sizes)  # the smallest is proposed first
    assert made[0]["picture"].startswith("<?xml")
    pane.do("take", form=made[0]["form"])
    (driver,) = pane.mechanism.drivers
    q = np.linspace(0, 2 * np.pi, 7201)
    point = next(name for name in pane.mechanism.outputs if name.endswith(".P.p"))
    run = pane.mechanism.run(at={driver: q}, rates=0.0, want=[point], on_gap="mark")
    step = np.nanmax(np.abs(np.diff(run[point])))
    for z in places:  # the path of the taken drawing passes every point
        assert np.nanmin(np.abs(run[point] - z)) < step
    pane.sheet.undo()
    assert pane.form == before


def test_too_few_points_are_refused_with_the_reason():
    with pytest.raises(bm.RequestError, match="three"):
        synthesis(drawn([0j, 1 + 0j]).ask())
