"""Pictures of studies: curves, maps, scatter, and designs that have no answer."""

import numpy as np
import pytest

import blockmech as bm
from tests.gallery import mechanism

WANT = ["max_abs(crank.drive)", "min(dyad.margin)"]
CASES = {
    "curves": ({"dyad.l_i": np.linspace(4.0, 6.5, 11)}, {}),
    "maps": ({"dyad.l_i": np.linspace(4.0, 6.5, 5), "dyad.l_j": [2.5, 3.0, 3.5]}, {}),
    "scatter": (
        {"dyad.l_i": bm.dist.Normal(6.0, 0.2), "frame.D.x": bm.dist.Uniform(5.0, 6.0)},
        {"sampling": bm.dist.Sample(40)},
    ),
}


@pytest.mark.parametrize("kind", CASES)
def test_each_kind_of_study_has_its_picture(kind, tmp_path):
    vary, options = CASES[kind]
    study = mechanism("ruiz_fourbar").study(vary, want=WANT, samples=9, friction="none", **options)
    figure = study.figure()
    panels = [axes for axes in figure.axes if axes.get_label() != "<colorbar>"]
    assert len(panels) == {"curves": 2, "maps": 2, "scatter": 6}[kind]
    assert "without an answer" in " ".join(figure._supxlabel.get_text().split())
    labels = " ".join(axes.get_ylabel() + axes.get_xlabel() for axes in figure.axes)
    assert "dyad.l_i [m]" in labels
    assert "margin) [–]" in labels.replace("\n", " ")
    if kind == "scatter":  # a histogram of each result counts its designs
        bars = [sum(bar.get_width() for bar in axes.patches) for axes in panels]
        assert bars[2::3] == [study.status.count("ok"), study.n]
    study.plot(tmp_path / "study.png")
    assert (tmp_path / "study.png").stat().st_size > 10_000


def test_poses_alone_are_no_picture(tmp_path):
    study = mechanism("ruiz_fourbar").study(
        {"dyad.l_i": [6.0]}, want="poses(crank.drive)", samples=5, friction="none"
    )
    with pytest.raises(bm.RequestError, match="no other number was kept"):
        study.plot(tmp_path / "a.png")
