"""Every example runs and yields its number."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path

import pytest

from examples import ten_poses, wire_ruiz

EXAMPLES = Path(ten_poses.__file__).parent
DRIVE_AT_1_RAD = 3775.3501600044997  # [N m] tests/data/ruiz_fourbar.json
ROUNDING = 1e-12
CLOSED_AT = 106.973943409513  # [N m] tests.dynamics.motions.press_moment(0.02, -1)
ASKED = {"gallery": ("sheet.png", "slider_crank", "watt_sixbar")}
SAID = {  # what a script prints, and the pictures that it writes
    "gallery": (["['slider_crank', 'watt_sixbar']"], ["sheet.png"]),
    "papers": (
        ["euler_q: the energy drifts by 0.293 J"],  # Fig. 7b
        ["ruiz_12_to_14.png", "durango_6.png", "durango_7.png"],
    ),
    "press": ([f"{10e3 / CLOSED_AT:.1f}", "must be pulled open", "drives back"], []),
    "walking_leg": (["step: 0.679 m", "lift: 0.225 m"], ["walking_leg.html"]),
    "excavator": (["-3.33          88.3   arm", "2.19         116.3   boom"], []),
    "coupler_curve": (
        ["angles given: largest miss 28.8 mm", "timing free: largest miss 0.0 mm"],
        ["coupler_curve.png"],
    ),
    # the force that is left is the load itself: the inertia forces balance (Berkof & Lowen 1969)
    "counterweight": (["counterweights: 1.00 kN rms"], ["counterweight.png"]),
    "compressor": (["0.1 kg m2: 94.0 rad/s, uneven by 10.3%", "uneven by 5.2%"], []),
}


def test_the_wired_fourbar_gives_the_papers_driving_moment():
    result = wire_ruiz.fourbar().run(at=1.0, want="crank.drive")
    assert result["crank.drive"][0] == pytest.approx(DRIVE_AT_1_RAD, rel=ROUNDING)


def test_three_iterations_are_within_a_thousandth_of_converged_ones():
    differences = ten_poses.largest_differences()
    assert set(differences) == set(ten_poses.REACTIONS)
    assert 0 < max(differences.values()) < 1e-3  # the paper's 0.1 %


@pytest.mark.parametrize("script", sorted(p.stem for p in EXAMPLES.glob("*.py")))
def test_examples_are_short_and_say_what_they_find(script, tmp_path, monkeypatch, capsys):
    path = EXAMPLES / f"{script}.py"
    assert len(path.read_text(encoding="utf-8").splitlines()) <= 45
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(EXAMPLES)
    monkeypatch.setattr(sys, "argv", [str(path), *ASKED.get(script, ())])
    runpy.run_path(str(path), run_name="__main__")
    lines, pictures = SAID.get(script, ([""], []))
    out, err = capsys.readouterr()
    assert out
    assert not err
    assert all(line in out for line in lines)
    assert all((tmp_path / name).stat().st_size > 10_000 for name in pictures)
