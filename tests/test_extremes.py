"""The map of the extremes: measured digits against what half an ulp in the data forces.

``python -m tests.extremes`` prints the whole map as a table (it is kept in tests/extremes/MAP.md).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import blockmech as bm
from tests.extremes import edges, near
from tests.extremes.friction import Press, Rocker, found, presses, rockers, slopes, solved
from tests.extremes.measure import measure
from tests.extremes.motions import Motion, all_motions, moved
from tests.extremes.precise import assert_encloses
from tests.extremes.scenes import Scene, all_scenes, as_general_group, fourbar

TIMES_FORCED = 20.0  # no quantity may be worse than this times what the data force
HIDDEN = 1.5e-7  # [rad] within which two ends of arcs are told to be a change point
FLOOR = 1e-12  # of the largest of its kind, in double; in single the same number of ulps
BOTH = ("complex128", "complex64")
RUBBING = [*presses(), *rockers()]
SCENES = [(s, p) for s in all_scenes() for p in s.precisions]


def floor(precision: str) -> float:
    """Error below which nothing is asked, in units of the largest of its kind."""
    single = np.finfo(np.float32).eps / np.finfo(np.float64).eps
    return FLOOR * (single if precision == "complex64" else 1.0)


@pytest.mark.parametrize(("scene", "precision"), SCENES, ids=[f"{s.name} {p}" for s, p in SCENES])
def test_no_quantity_is_worse_than_its_data_allow(scene: Scene, precision: str) -> None:
    rows = measure(scene, precision)
    assert {r.kind for r in rows} >= {"p", "v", "a"}
    for row in rows:
        assert row.error <= max(TIMES_FORCED * row.forced, floor(precision)), row


DOUBLE = [s for s, precision in SCENES if precision == "complex128"]
# Rounding alone may take these over the dead centre: it is said, and bounds hold all the same.
UNPROVED = {"general, oblique, gap 1e-10", "general, oblique, gap 1e-12", "PRP, angle 1e+15 rad"}


@pytest.mark.parametrize("scene", DOUBLE, ids=[s.name for s in DOUBLE])
def test_dead_centres_and_sizes_are_proved(scene: Scene) -> None:
    mechanism = scene.graph.compile()
    bounds = mechanism.enclose(scene.at, rates=scene.rates, want=scene.want, friction="none")
    assert bounds.proved == bounds.closes == (scene.name not in UNPROVED)
    assert_encloses(bounds, mechanism if scene.twin is None else scene.twin.compile(), "none")


@pytest.mark.parametrize(
    ("case", "engine", "precision"),
    [
        *((case, "numpy", precision) for case in RUBBING for precision in BOTH),
        *((case, "llvm", "complex128") for case in RUBBING[::3]),
    ],
    ids=lambda x: getattr(x, "name", x),
)
def test_friction_is_as_good_as_its_data_allow_or_says_why_not(
    case: Press | Rocker, engine: str, precision: str
) -> None:
    """Every third case, of all kinds, by machine code too: its numbers are NumPy's."""
    if engine == "llvm":
        pytest.importorskip("llvmlite", reason="machine code needs the extra fast")
    cell = found(case, precision, engine)
    assert (cell.status == "ok") == cell.balanced
    assert "zero-relative-speed" not in cell.flags
    if cell.balanced:
        assert cell.error <= max(TIMES_FORCED * cell.forced, floor(precision))


@pytest.mark.parametrize("case", RUBBING, ids=lambda case: case.name)
def test_all_friction_solutions_are_there_and_as_good_as_their_data_allow(
    case: Press | Rocker,
) -> None:
    cell = solved(case)
    assert cell.found == cell.true
    assert cell.error <= max(TIMES_FORCED * cell.forced, FLOOR)


@pytest.mark.parametrize("case", [c for c in RUBBING if c.addresses], ids=lambda case: case.name)
def test_derivatives_with_friction_are_as_good_as_their_data_allow(case: Press | Rocker) -> None:
    if found(case, "complex128").balanced:
        error, forced = slopes(case)
        assert error <= max(TIMES_FORCED * forced, FLOOR)
    else:
        with pytest.raises(bm.FrictionError):
            slopes(case)


@pytest.mark.parametrize("case", list(edges.turning()), ids=lambda case: case.name)
def test_limits_and_modes_are_as_good_as_their_data_allow_or_tell_of_a_change_point(
    case: edges.Turning,
) -> None:
    cell = edges.ends_of(case)
    assert cell.told == (cell.left_out == 0) or (cell.change_point and cell.left_out < HIDDEN)
    if not cell.change_point:
        assert cell.circuits == (2 if cell.told else 1)
        assert cell.error <= max(TIMES_FORCED * cell.forced, FLOOR)


@pytest.mark.parametrize("case", list(edges.wheels()), ids=lambda case: case.name)
def test_a_steady_state_is_as_good_as_it_says(case: edges.Wheel) -> None:
    cell = edges.steady_of(case)
    assert cell.error <= max(TIMES_FORCED * cell.forced, cell.estimate)
    assert cell.estimate <= FLOOR


def test_where_friction_locks_a_motion_no_steady_state_is_looked_for() -> None:
    wheel = edges.Wheel("so rough that its own inertia locks it", 1e6).graph.compile()
    with pytest.raises(bm.RequestError, match="self-locking in motion at the start"):
        wheel.simulate("steady", start={"crank": (0.3, 1.0)})


@pytest.mark.parametrize("case", list(near.cases()), ids=lambda case: case.name)
def test_beside_change_points_and_coincident_joints_it_is_right_or_refused(
    case: near.Near,
) -> None:
    cell = near.found(case)
    if cell.is_answer:
        assert cell.place <= TIMES_FORCED * case.allowed[0]
        assert cell.velocity <= TIMES_FORCED * case.allowed[1]
    else:
        assert cell.told == "change-point"


@pytest.mark.parametrize("case", [m for m in all_motions() if not m.slow], ids=lambda m: m.name)
def test_a_motion_is_as_good_as_it_says_or_says_that_it_is_none(case: Motion) -> None:
    cell = moved(case)
    assert cell.error <= cell.estimate if cell.is_answer else "failed" in cell.told
    honest = cell.estimate < 1e-6 * max(1.0, cell.way) or not cell.is_answer
    assert honest or "accuracy not reached" in cell.told


@pytest.mark.parametrize("kind", ["extended", "folded", "oblique"])
def test_closest_gap_is_finite_and_flagged(kind: str) -> None:
    scene = next(s for s in all_scenes() if s.name == f"{kind}, gap 3e-15")
    mechanism = scene.graph.compile()
    for engine in ("scalar", "numpy"):
        result = mechanism.run(at=scene.at, rates=scene.rates, want=scene.want, engine=engine)
        assert result.quality.status == ("ok",)
        assert [f.code for f in result.quality.flags] == ["near-dead-centre"]
        assert all(np.isfinite(result[name]).all() for name in result)


def test_no_home_of_a_general_group_is_so_near_its_dead_centre() -> None:
    scene = next(s for s in all_scenes() if s.name == "extended, gap 3e-15")
    with pytest.raises(bm.GraphError, match="bad-home"):
        as_general_group(scene.graph, scene.at).compile()


def test_dead_centre_itself_is_refused_by_name() -> None:
    mechanism = fourbar(1.0, 2.0, 2.0, 5.0).compile()
    assert mechanism.run(at=0.0, want=["dyad.C.p"])["dyad.C.p"][0] == 3.0
    with pytest.raises(bm.SingularError) as caught:
        mechanism.run(at=0.0, rates=1.0, want=["dyad.C.v"])
    assert caught.value.failure.block == "dyad"


def test_factored_kernels_keep_six_digits_in_single_precision_at_a_gap_of_1e_4() -> None:
    for scene, precision in SCENES:
        if precision == "complex64" and scene.name.endswith("gap 1e-04"):
            position = next(r for r in measure(scene, precision) if r.kind == "p")
            assert position.error < max(1e-6, position.forced), scene.name


@pytest.mark.parametrize("gap", ["1e-08", "1e-10", "1e-12", "3e-15"])
def test_gap_below_single_precision_is_flagged_or_refused_by_name(gap: str) -> None:
    for scene in (s for s in all_scenes() if s.name.endswith(f"gap {gap}")):
        request = {"at": scene.at, "rates": scene.rates, "want": scene.want}
        run = scene.graph.compile().run(**request, precision="complex64", on_gap="mark")
        flags = {f.code for f in run.quality.flags} & {"near-dead-centre", "dead-centre"}
        refused = run.quality.blame == {0: "dyad"}
        finite = all(np.isfinite(run[name]).all() for name in run)
        assert refused or (flags and finite), scene.name


def test_map_in_the_repository_has_a_row_for_every_scene() -> None:
    rows = (Path(__file__).parent / "extremes" / "MAP.md").read_text(encoding="utf-8").splitlines()
    stored = [[cell.strip() for cell in row.split("|")[1:3]] for row in rows if " | complex" in row]
    pressed = [[case.name, precision] for case in RUBBING for precision in BOTH]
    assert stored == [[s.name, p] for s, p in SCENES] + pressed
