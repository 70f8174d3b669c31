"""Synthesis on the page: what is drawn is what is asked, and a design is one step."""

import numpy as np

import blockmech as bm
from blockmech.studio.candidates import Candidates, wanted
from blockmech.studio.links import LinksSheet
from blockmech.studio.sheet import Sheet
from blockmech.studio.work import Work


def drawn(places, links=()):
    sheet = Sheet(bm.Linkage("wanted"))
    pane = LinksSheet(sheet)
    for z in places:
        pane.add(z)
    for ends in links:
        pane.act("Link", list(ends))
    return sheet


def found(sheet):
    said = []
    candidates = Candidates(sheet, Work(said.append))
    candidates.search()
    candidates.work.thread.join()
    return candidates, said[-1]


def test_positions_of_a_body_are_lone_links():
    sheet = drawn([0j, 1j, 2 + 0j, 3 + 0j, 5 + 0j, 5 - 2j, 9 + 9j], ["AB", "CD", "EF"])
    points, positions = wanted(sheet.form)
    assert points == [9 + 9j]
    assert positions == [(0.0, 0.0, np.pi / 2), (2.0, 0.0, 0.0), (5.0, 0.0, -np.pi / 2)]


def test_a_candidate_passes_the_points_and_undo_brings_them_back():
    places = [0j, 1 + 0.5j, 2 + 0.6j]
    sheet = drawn(places)
    candidates, _ = found(sheet)
    before, (design, *_) = sheet.form, candidates.designs
    candidates.take(design)
    (driver,) = sheet.mechanism.drivers
    run = sheet.mechanism.run(at={driver: design.at}, rates=0.0, want=["dyad.P.p"])
    assert np.abs(run["dyad.P.p"] - places).max() < 1e-9
    assert "alt=" in candidates.found.objects[0][0].object
    sheet.undo()
    assert sheet.form == before


def test_too_few_points_are_refused_with_the_reason():
    candidates, said = found(drawn([0j, 1 + 0j]))
    assert "three" in said
    assert candidates.found.objects == []
