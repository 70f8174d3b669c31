"""``blockmech extremes``: what Python finds, as text and as JSON."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

SHAPER = Path(__file__).parents[2] / "graphs" / "whitworth_shaper.json"
SWING = math.asin(0.12 / 0.3)  # [rad] of the lever to either side, crank 0.12 m at 0.3 m


def test_extremes_of_a_shaper_are_those_of_its_closed_form(call):
    said = call("extremes", SHAPER, "lever.j.angle", "ram.C.p.x", "--json")
    lever, ram = json.loads(said.out)["extremes"]
    assert lever["value"]["maximum"]["value"] == pytest.approx(math.pi / 2 + SWING, rel=1e-13)
    along = 0.6 * math.sin(SWING)
    rest = math.sqrt(0.25**2 - (0.65 - 0.6 * math.cos(SWING)) ** 2)
    assert ram["value"]["maximum"]["value"] == pytest.approx(rest + along, rel=1e-13)
    assert ram["value"]["minimum"]["value"] == pytest.approx(rest - along, rel=1e-12)


def test_stroke_of_a_shaper_with_its_time_ratio(call):
    said = call("extremes", SHAPER, "ram.C.p", "--stroke")
    ratio = (math.pi + 2 * SWING) / (math.pi - 2 * SWING)
    assert said.code == 0
    assert "stroke 0.48 m" in said.out
    assert f"time ratio {ratio:.6g}" in said.out
