"""Pictures and films are formats like others."""

from __future__ import annotations

import pytest

import blockmech as bm
from blockmech.ground.errors import RequestError
from tests.gallery import GRAPHS

BEGIN = {
    ".png": b"\x89PNG",
    ".pdf": b"%PDF",
    ".gif": b"GIF8",
    ".svg": b"<?xml",
    ".html": b"<!doctype html>",
}


@pytest.mark.parametrize(
    ("name", "to", "options"),
    [
        ("poses.png", None, {"at": [0.1, 0.7]}),
        ("poses.svg", "picture", {"trace": "dyad.S", "samples": 3}),
        ("diagram.pdf", None, {"kind": "diagram"}),
        ("drive.png", None, {"kind": "curves", "want": "crank.drive", "samples": 5}),
        ("film.gif", None, {"samples": 3}),
        ("film.html", "film", {"times": [0.0, 0.1]}),
    ],
)
def test_pictures_and_films_are_written_like_other_files(name, to, options, tmp_path):
    fourbar = bm.Graph.load(GRAPHS / "ruiz_fourbar.json")
    (path,) = bm.write(fourbar, tmp_path / name, to, **options)
    assert path.read_bytes()[:20].lower().startswith(BEGIN[path.suffix].lower())


def test_a_film_is_of_the_poses_that_are_asked_for(tmp_path):
    fourbar = bm.Graph.load(GRAPHS / "ruiz_fourbar.json")
    few, many = (
        bm.write(fourbar, tmp_path / f"{n}.html", "film", samples=n)[0].stat().st_size
        for n in (3, 40)
    )
    assert many > few + 37 * 4 * 10  # four places of ten digits in each frame


def test_a_kind_that_there_is_not_is_refused(tmp_path):
    fourbar = bm.Graph.load(GRAPHS / "ruiz_fourbar.json")
    with pytest.raises(RequestError, match='kind: no kind "oil"'):
        bm.write(fourbar, tmp_path / "it.png", kind="oil")
