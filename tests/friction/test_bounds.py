"""What iterations of friction leave undone is bounded, and said with the answer."""

from __future__ import annotations

import numpy as np
import pytest

import blockmech as bm
from blockmech.result.quality import left_undone
from tests.gallery import changed, document

HOW = {
    "single": ({"friction": "single"}, 1.0),
    "successive": ({"friction": "successive"}, 1.2),  # by the observed ratio of changes
    "three iterations": ({"friction": bm.friction.Successive(iterations=3)}, 1.2),
}


def four_bar(radius):
    data = document("ruiz_fourbar")
    for block in ("crank", "dyad"):
        for pin in data["blocks"][block]["friction"].values():
            pin["radius"] = radius
    return changed(data)


@pytest.mark.parametrize("radius", [0.0075, 0.05, 0.2])
@pytest.mark.parametrize("name", HOW)
def test_the_bound_of_an_iteration_holds(name, radius):
    how, allowed = HOW[name]
    mech, joints = four_bar(radius), [f"dyad.{x}.friction" for x in "BCD"]
    exact, found = mech.run(samples=90), mech.run(samples=90, **how)
    expected = np.array([exact[j] for j in joints])
    off = np.abs(np.array([found[j] for j in joints]) - expected).max(axis=0)
    true = off / np.abs(expected).max(axis=0)
    quality = found.quality
    bound = left_undone(quality.residual["dyad"], quality.contraction["dyad"])
    assert (true <= allowed * bound + 1e-15).all()
    assert bound.max() <= 3 * true.max()
    (note,) = (note for note in found.notes() if note.startswith("friction"))
    assert f"{bound.max():.1e}" in note
    assert not any(note.startswith("friction") for note in exact.notes())


def test_no_certificate_is_no_bound():
    assert left_undone(1e-9, 1.2) == np.inf
    assert np.isinf(left_undone(np.array([0.1]), np.array([1.0]))).all()


def test_a_motion_says_what_its_way_to_solve_friction_leaves_undone():
    mech, start = four_bar(0.0075), {"crank": (1.0, 20.0)}
    for method in ("dop853", "radau"):
        rough, exact = (
            mech.simulate("time=0.1", start=start, method=method, friction=f, want=()).motion
            for f in ("single", "newton")
        )
        misfit = rough.facts["friction_misfit"]
        assert 1e-5 < misfit < 1e-2
        assert any("miss their laws" in note and f"{misfit:.1e}" in note for note in rough.notes)
        assert "friction_misfit" not in exact.facts
        lost = [m.facts["friction_work"] for m in (rough, exact)]
        assert abs(lost[0] - lost[1]) <= 2 * misfit * lost[1]
