"""Programs kept by form: what a mechanism has of one before it is what it would have by itself."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import blockmech as bm
from blockmech.ground.memory import Recent
from blockmech.mechanism import Mechanism
from blockmech.passes import homotopy
from blockmech.plan import recipes
from blockmech.plan.plan import Plan, Schedule
from blockmech.studies.family import remade
from tests.gallery import GRAPHS, ROWS

FILES = sorted(
    path
    for folder in (".", "joints", "couplings", "motions", "control")
    for path in (GRAPHS / folder).glob("*.json")
    if path.stem not in ROWS
)
GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0


def changed(mechanism: Mechanism, share: float) -> Mechanism:
    """The mechanism with all its quantities a little different, no two by the same share."""
    values = {
        address: p.value * (1.0 + share * ((k * GOLDEN) % 1.0))
        for k, (address, p) in enumerate(mechanism.parameters().items())
        if p.unit and "cam" not in address  # not signs and teeth, nor a profile that must close
    }
    return remade(mechanism, values)


def content(plan: Plan) -> list[Any]:
    """All that a plan says, but for functions, which are told by their names and numbers."""
    p = plan.program
    return [
        *(plan.want, plan.entries, plan.steps, plan.layout, plan.reports),
        *(p.source, p.inputs, p.angles, list(p.functions), p.parameters, p.outputs, p.calls),
    ]


@pytest.fixture(autouse=True)
def _empty_caches(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recipes, "_RECIPES", Recent())
    monkeypatch.setattr(homotopy, "_PATHS", Recent())


def count_schedules(monkeypatch: pytest.MonkeyPatch) -> list[Schedule]:
    """The schedules that are started from here on."""
    schedules: list[Schedule] = []
    begin = Schedule.__init__

    def counted(self: Schedule, *arguments: Any, **options: Any) -> None:
        schedules.append(self)
        begin(self, *arguments, **options)

    monkeypatch.setattr(Schedule, "__init__", counted)
    return schedules


@pytest.mark.parametrize("path", FILES, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_plan_of_a_known_form_is_the_one_made_anew(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = bm.read(path).compile()
    first.plan()
    neighbour, mech = changed(first, 1e-9), changed(first, 2e-9)
    neighbour.plan()  # numbers that were equal by chance no longer are
    schedules = count_schedules(monkeypatch)
    plan = mech.plan()
    form = mech.structure.form  # None with signals
    assert (not schedules) == (form is not None and form == neighbour.structure.form)
    recipes._RECIPES.clear()
    fresh = type(mech)(mech.structure, mech.scene, mech.name, mech.names, mech.document).plan()
    assert schedules
    assert content(plan) == content(fresh)


def lift(**numbers: float) -> Mechanism:
    """The scissor lift with other numbers."""
    mech = bm.read(GRAPHS / "scissor_lift.json").compile()
    return remade(mech, numbers)


@pytest.mark.parametrize(
    ("address", "value", "same"),
    [("scissors.links.arm1.mass", 40.0, True), ("scissors.pairs.left1.at[0].x", 2.001, False)],
)
def test_mechanisms_that_move_alike_share_their_path(
    address: str, value: float, same: bool
) -> None:
    first, second = lift(), lift(**{address: value})
    paths = [homotopy.path_of(m.structure, "scissors") for m in (first, second)]
    assert (paths[0] is paths[1]) == same
    q = np.linspace(1.6, 1.75, 5)
    result = second.run(q, want="*.p", on_gap="mark")
    homotopy._PATHS.clear()
    fresh = lift(**{address: value}).run(q, want="*.p", on_gap="mark")
    for name in second.plan("*.p").want:
        np.testing.assert_array_equal(result[name], fresh[name])


def test_what_rules_compute_is_judged_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """A marker on its link's origin has no arm: the program of one beside it is another."""
    path = GRAPHS / "ruiz_fourbar.json"
    bm.read(path).compile().plan()
    (key, recipe), *_ = recipes._RECIPES.items()
    formula, form = recipe.computed[0]
    recipes._RECIPES[key] = recipe._replace(computed=((formula, ("other", form)),))
    schedules = count_schedules(monkeypatch)
    bm.read(path).compile().plan()
    assert len(schedules) == 1
    bm.read(path).compile().plan()
    assert len(schedules) == 1


def test_functions_of_users_are_planned_each_for_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    graph = bm.read(GRAPHS / "ruiz_fourbar.json")
    graph.add("gust", bm.Force(direction=(1.0, 0.0), law=lambda time: 30.0 * time))
    graph.connect("dyad.C", "gust.at")
    first, second = graph.compile(), graph.compile()
    assert first.structure.form is None
    first.plan()
    schedules = count_schedules(monkeypatch)
    second.plan()
    assert schedules
