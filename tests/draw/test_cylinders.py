"""Cylinders look like cylinders: a barrel, and a rod whose end stays inside it."""

from __future__ import annotations

import numpy as np
import pytest

import blockmech as bm
from blockmech.draw.mechanism import draw_mechanism
from blockmech.draw.motion import moves
from blockmech.draw.sketch import sketch_of
from blockmech.model.spots import Spot
from blockmech.model.structure import LinkRef
from tests.gallery import GRAPHS

SAMPLES = 25
ROUNDING = 1e-9  # [m] of machines of some metres

CYLINDERS = [
    ("excavator", "boom.barrel", "boom.rod"),
    ("excavator", "curl.barrel", "curl.rod"),
    ("scissor_lift", "scissors.barrel", "scissors.rod"),
    ("floating_drive_press", "press.barrel", "press.rod"),
]


@pytest.mark.parametrize(("name", "barrel", "rod"), CYLINDERS)
def test_the_rod_ends_inside_the_barrel_at_every_length(name, barrel, rod):
    motion = moves(bm.Graph.load(GRAPHS / f"{name}.json").compile(), samples=SAMPLES)
    bodies = {str(body.link): body for body in sketch_of(motion).bodies}
    tube, stem = bodies[barrel], bodies[rod]
    assert tube.width > 1 > stem.width
    a, b = (motion.at(*Spot(_ref(barrel), z)) for z in tube.outline)
    u = (b - a) / abs(b - a)
    ends = np.array([motion.at(*Spot(_ref(rod), z)) - a for z in stem.outline]) * np.conj(u)
    assert np.abs(ends.imag).max() <= ROUNDING
    distances, length = np.sort(np.abs(ends.real), axis=0), abs(b - a)
    assert np.all(distances[0] < length)
    assert np.all(distances[1] > length)


@pytest.mark.parametrize(
    ("name", "blocks"), [("excavator", []), ("floating_drive_press", ["column"])]
)
def test_a_cylinder_shows_no_block_and_other_guides_do(name, blocks):
    picture = draw_mechanism(bm.Linkage.load(GRAPHS / "joints" / f"{name}.json").compile())
    result = [str(artist.get_label()) for artist in picture.axes.patches]
    assert [label for label in result if label.startswith("slider:")] == [
        f"slider:{b}" for b in blocks
    ]


def test_a_slider_on_a_lever_is_no_cylinder():
    shaper = bm.Graph.load(GRAPHS / "whitworth_shaper.json").compile()
    assert not any(slider.inside for slider in sketch_of(moves(shaper, samples=9)).sliders)


def _ref(link):
    return LinkRef(*link.split("."))
