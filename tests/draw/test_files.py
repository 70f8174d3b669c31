"""What `draw` accepts, refuses and leaves on the disk."""

from __future__ import annotations

import pytest
from PIL import Image

import blockmech as bm
from blockmech.draw import animate, draw
from tests.draw.scenes import unfinished
from tests.machines import ruiz, watt


@pytest.mark.parametrize(
    ("name", "kind", "code"),
    [
        ("a.jpg", None, "unknown-suffix"),
        ("a", None, "unknown-suffix"),
        ("a.gif", "diagram", "unknown-suffix"),
        ("a.png", "animation", "unknown-suffix"),
        ("a.png", "diagramm", "unknown-kind"),
        ("missing/a.png", None, "cannot-write"),
    ],
)
def test_a_wrong_request_is_one_problem_and_writes_nothing(tmp_path, name, kind, code):
    with pytest.raises(bm.RequestError) as error:
        draw(ruiz(), tmp_path / name, kind=kind)
    assert [p.code for p in error.value.problems] == [code]
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("setting", [{"at": 1.0}, {"trace": ["dyad.C"]}])
def test_a_diagram_has_no_poses_which_are_those_of_a_mechanism(tmp_path, setting):
    with pytest.raises(bm.RequestError, match="useless-setting"):
        draw(ruiz(), tmp_path / "a.png", kind="diagram", **setting)
    assert not list(tmp_path.iterdir())
    scales = [ax.get_aspect() for ax in draw(ruiz(), tmp_path / "a.png", **setting).axes]
    assert scales == [1.0]  # a drawing to scale


def test_an_unfinished_graph_has_a_diagram_but_no_mechanism(tmp_path):
    draw(unfinished(), tmp_path / "a.png")
    assert (tmp_path / "a.png").exists()
    with pytest.raises(bm.GraphError, match="unwired-joint"):
        draw(unfinished(), tmp_path / "b.png", kind="mechanism")
    assert [p.name for p in tmp_path.iterdir()] == ["a.png"]


def test_a_large_picture_in_pixels_is_less_sharp(tmp_path, monkeypatch):
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 10_000)
    draw(ruiz(), tmp_path / "a.png")
    with Image.open(tmp_path / "a.png") as picture:
        width, height = picture.size
    assert 0.9 < width * height / 10_000 <= 1


def test_an_old_picture_survives_a_refused_one(tmp_path):
    path = tmp_path / "a.png"
    draw(ruiz(), path)
    before = path.read_bytes()
    with pytest.raises(bm.RequestError):
        draw(ruiz(), path, kind="mechanism", at="seven")
    assert path.read_bytes() == before


FILES = {
    "mechanism.svg": lambda path: draw(ruiz(), path, "mechanism"),
    "mechanism.png": lambda path: draw(ruiz(), path, "mechanism"),
    "mechanism.pdf": lambda path: draw(ruiz(), path, "mechanism"),
    "schedule.svg": lambda path: draw(watt(), path, "schedule", want="*.p"),
    "film.gif": lambda path: animate(ruiz(), path, frames=4),
    "film.html": lambda path: animate(ruiz(), path, frames=4),
    "arcs.png": lambda path: ruiz().compile().limits().plot(path),
}


@pytest.mark.parametrize("name", FILES)
def test_the_same_subject_gives_the_same_bytes(tmp_path, name):
    first, second = (tmp_path / f"{k}{name}" for k in (1, 2))
    FILES[name](first)
    FILES[name](second)
    assert first.read_bytes() == second.read_bytes()
    assert b"dc:date" not in first.read_bytes()
