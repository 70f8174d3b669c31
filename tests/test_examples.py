"""Every example runs and yields its number."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from examples import gallery, ten_poses, wire_ruiz

EXAMPLES = Path(ten_poses.__file__).parent
DRIVE_AT_1_RAD = 3775.3501600044997  # [N m] tests/data/ruiz_fourbar.json
ROUNDING = 1e-12


def test_the_wired_fourbar_gives_the_papers_driving_moment():
    result = wire_ruiz.fourbar().run(at=1.0, want="crank.drive")
    assert result["crank.drive"][0] == pytest.approx(DRIVE_AT_1_RAD, rel=ROUNDING)


def test_three_iterations_are_within_a_thousandth_of_converged_ones():
    differences = ten_poses.largest_differences()
    assert set(differences) == set(ten_poses.REACTIONS)
    assert 0 < max(differences.values()) < 1e-3  # the paper's 0.1 %


@pytest.mark.parametrize("script", sorted(p.name for p in EXAMPLES.glob("*.py")))
def test_examples_are_short_and_run(script, tmp_path):
    assert len((EXAMPLES / script).read_text(encoding="utf-8").splitlines()) < 40
    done = subprocess.run(
        [sys.executable, EXAMPLES / script], capture_output=True, check=True, cwd=tmp_path
    )
    assert done.stdout
    assert not done.stderr


def test_the_second_papers_energy_drift_is_found_again(tmp_path):
    script = EXAMPLES / "papers.py"
    done = subprocess.run(
        [sys.executable, script, tmp_path], capture_output=True, check=True, text=True
    )
    assert "euler_q: the energy drifts by 0.293 J" in done.stdout  # Fig. 7b
    assert {p.name for p in tmp_path.iterdir()} == {
        "ruiz_12_to_14.png",
        "durango_6.png",
        "durango_7.png",
    }


def test_gallery_draws_every_mechanism_it_is_asked_for(tmp_path):
    assert gallery.sheet(tmp_path / "sheet.png", ["slider_crank", "watt_sixbar"]) == [
        "slider_crank",
        "watt_sixbar",
    ]
    assert (tmp_path / "sheet.png").stat().st_size > 10_000
