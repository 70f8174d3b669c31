"""The mechanism in motion: GIF and HTML."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from itertools import pairwise

import matplotlib
import numpy as np
import pytest
from imageio_ffmpeg import get_ffmpeg_exe
from PIL import Image

import blockmech as bm
from blockmech.draw import Animation, animate, draw
from blockmech.draw.animation import player_data
from tests.draw.scenes import fourbar, rocking_slide, slider_crank
from tests.machines import ruiz, watt

FRAMES = 12
GRAIN = 0.011  # [pt] places are rounded to hundredths of a point


def opened(path) -> tuple[int, list[np.ndarray]]:
    """Number of frames of a GIF, and its pictures."""
    with Image.open(path) as image:
        count = image.n_frames
        pictures = []
        for k in range(count):
            image.seek(k)
            pictures.append(np.asarray(image.convert("RGB")))
    return count, pictures


def data_of(html: str) -> dict:
    """The numbers that a page carries."""
    match = re.search(r'<script id="data" type="application/json">(.*?)</script>', html, re.DOTALL)
    assert match is not None
    return json.loads(match.group(1))


def test_a_gif_has_the_frames_and_the_time_that_were_asked_for_on_axes_that_stay(tmp_path):
    path = animate(ruiz(), tmp_path / "a.gif", frames=FRAMES, seconds=1.2).path
    count, pictures = opened(path)
    assert count == FRAMES
    assert all((a != b).any() for a, b in pairwise(pictures))
    bottom = [p[-55:] for p in pictures]  # the numbers of the x axis
    assert all((p == bottom[0]).all() for p in bottom)
    with Image.open(path) as image:
        assert (image.info["loop"], image.info["duration"]) == (0, 100)


def test_poses_that_do_not_close_are_left_out():
    film = animate(fourbar(rocker=1.8), frames=40)
    assert film.motion.feasible.all()
    assert 2 < len(film.motion.samples) < 41
    assert len(film.order) == 2 * len(film.motion.samples) - 2


class Addresses(HTMLParser):
    """Collects what a browser would fetch."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []
        self.scripts = 0

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.scripts += tag == "script"
        fetching = {"src", "href", "srcset", "data", "action", "poster"}
        self.found += [f"{tag} {k}={v}" for k, v in attrs if k in fetching]
        self.found += [tag] * (tag in {"link", "iframe", "object", "embed", "img"})


@pytest.mark.parametrize("scene", [ruiz, rocking_slide, slider_crank, watt])
def test_the_html_page_loads_nothing_from_anywhere(scene):
    html = animate(scene(), frames=FRAMES).html
    reader = Addresses()
    reader.feed(html)
    assert reader.found == []
    assert not re.search(r"https?:|//[a-z]|@import|url\(|fetch\(|XMLHttp|WebSocket", html)
    assert {"play", "frame", "speed"} <= set(re.findall(r'id="(\w+)"', html))


def test_the_html_page_carries_every_frame(tmp_path):
    path = tmp_path / "a.html"
    assert draw(ruiz(), path).path == path
    data = data_of(path.read_text("utf-8"))
    assert len(data["frames"]) == 72
    captions = [f["caption"] for f in data["frames"]]
    assert captions[18].startswith("crank at\u00a090°; t\u00a0=\u00a00.157\u00a0s")
    assert "weightlike 1000 N" in captions[0]


def test_the_players_pins_follow_the_run():
    mechanism = ruiz().compile()
    film = animate(mechanism, frames=FRAMES)
    data = json.loads(json.dumps(player_data(film)))
    run = mechanism.run(samples=FRAMES + 1, want=["dyad.C.p"])["dyad.C.p"]
    for k, frame in enumerate(data["frames"]):
        discs = [
            complex(row[1], row[2])
            for row in frame["shapes"]
            if data["styles"][row[0]]["kind"] == "disc"
        ]
        assert min(abs(z - film.page.points(run[k])) for z in discs) < GRAIN


def test_a_name_cannot_break_out_of_the_page():
    g = fourbar()
    g.name = "</title><script>alert(1)</script>"
    g.add("<!--<script>", bm.Couple(moment=1.0))
    g.connect("dyad.j", "<!--<script>.on")
    html = animate(g, frames=FRAMES).html
    reader = Addresses()
    reader.feed(html)
    assert reader.scripts == 2
    numbers = html.split('type="application/json">')[1].split("</script>")[0]
    assert "<" not in numbers, "a browser reads <!--<script> as the start of another script"
    assert "<!--<script>" in data_of(html)["frames"][0]["caption"]


def test_a_result_is_animated_at_its_own_samples():
    run = ruiz().run(at=[0.1, 0.4, 0.9], want=["crank.drive"])
    data = data_of(animate(run).html)
    captions = [f["caption"].split(";")[0] for f in data["frames"]]
    assert captions == [f"crank at\u00a0{a}°" for a in ("5.73", "22.92", "51.57", "22.92")]


def test_a_notebook_shows_the_player():
    film = animate(ruiz(), frames=FRAMES)
    assert isinstance(film, Animation)
    assert film.path is None
    assert film._repr_html_().startswith('<iframe srcdoc="')
    assert "<script" not in film._repr_html_()


@pytest.mark.parametrize(
    "wrong", [{"frames": 1}, {"frames": 1.5}, {"seconds": 0}, {"frames": 10**6}]
)
def test_numbers_without_sense_are_refused(wrong):
    with pytest.raises(bm.RequestError, match=next(iter(wrong))):
        animate(ruiz(), **wrong)


def test_a_film_has_its_time_and_its_pictures(tmp_path):
    program = shutil.which("ffmpeg") or get_ffmpeg_exe()
    film = animate(ruiz(), frames=FRAMES, seconds=1.2)
    path = film.save(tmp_path / "a.mp4").path
    raw = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    result = subprocess.run([program, "-v", "error", "-i", path, *raw], capture_output=True)
    height, width, _ = film.pictures[0].shape
    size = (height // 2 * 2, width // 2 * 2, 3)
    frames = np.frombuffer(result.stdout, np.uint8).reshape(-1, *size).astype(float)
    assert len(frames) == 30  # 1.2 s of 25 pictures a second
    for k in (0, 14, 29):
        expected = film.pictures[film.order[k * len(film.order) // 30]][: size[0], : size[1]]
        assert np.abs(frames[k] - expected).mean() < 4  # of 255: the film is compressed
        picture = film.pictures[film.order[(k * len(film.order) // 30 + 8) % len(film.order)]]
        moved = np.abs(frames[k] - picture[: size[0], : size[1]]).mean()
        assert moved > 1.1 * np.abs(frames[k] - expected).mean()


def test_without_ffmpeg_a_film_is_refused_and_nothing_is_written(tmp_path, monkeypatch):
    monkeypatch.setitem(matplotlib.rcParams, "animation.ffmpeg_path", "no_such_program")
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(bm.MissingEngineError, match=r"ffmpeg.*\.gif and \.html.*blockmech\[film\]"):
        animate(ruiz(), tmp_path / "a.mp4", frames=4)
    assert not list(tmp_path.iterdir())
