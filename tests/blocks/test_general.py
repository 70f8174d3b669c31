"""The general group: any class, R and P, driven pairs inside; against dyads and the judge."""

from __future__ import annotations

import json

import jsonschema
import numpy as np
import pytest

import blockmech as bm
from blockmech.model.schema import graph_schema
from tests.blocks.platforms import HOME, REACH, platform, stacked, triad, triad_and_arc, two_drivers
from tests.blocks.test_against_the_judge import ROUNDING, assert_the_judge_agrees, compared
from tests.doors import graph_of as loads


def moving(mech, rate):
    """Rates and accelerations of all drivers."""
    drivers = mech.drivers
    return {"rates": dict.fromkeys(drivers, rate), "accelerations": dict.fromkeys(drivers, -rate)}


# -- against the judge --------------------------------------------------------------------


def odd(name):
    """A name that is no Python name."""
    return f"Lenker {name} α"


CASES = {
    f"{name} at {q}": (graph, q)
    for name, graph, qs in (
        ("odd names", platform(cylinder=True, names=odd), ((0.9, 1.05),)),
        ("one on the other", stacked(), (0.6, 0.9)),
    )
    for q in qs
}


@pytest.mark.parametrize(("graph", "q"), CASES.values(), ids=list(CASES))
@pytest.mark.parametrize("friction", [False, True], ids=["smooth", "rough"])
def test_motion_and_forces_are_the_judges(graph, q, friction):
    result = compared(graph, q, friction)
    assert_the_judge_agrees(result)
    if friction:
        assert sum(j.friction != 0 for j in result.judge.forces.joints.values()) >= 6


# -- scale, place and precision -------------------------------------------------------------


@pytest.mark.parametrize("far", [1e3, 1e6])
def test_distance_from_the_origin_costs_its_rounding_only(far):
    here, there = platform(), platform(shift=far * (1 + 0.7j))
    q = np.linspace(-0.9, 2.3, 15)
    a, b = (g.run(at=q, want=["*.angle", "*.margin"]) for g in (here, there))
    root = np.sqrt(a.quality.margin["platform"])
    for name in (n for n in a if n.endswith(".angle")):
        off = np.abs(np.exp(1j * (b[name] - a[name])) - 1)
        assert (off * root).max() <= 100 * np.spacing(far)


@pytest.mark.parametrize(
    ("precision", "eps"), [("complex64", 1.2e-7), ("clongdouble", np.finfo(np.longdouble).eps)]
)
@pytest.mark.parametrize("make", [triad, two_drivers, stacked])
def test_other_precisions_agree_to_their_rounding(make, precision, eps):
    mech = make().compile()
    home = dict(zip(mech.drivers, (HOME, REACH - 0.1), strict=False))
    at = {d: q + np.linspace(-0.1, 0.1, 7) for d, q in home.items()}
    given = {"at": at, **moving(mech, 1.5), "friction": "none", "engine": "numpy"}
    want = ["*.p", "*.v", "*.a", "*.alpha", "*.reaction", "*.drive", "*.margin"]
    a, b = (mech.run(**given, want=want, precision=p) for p in ("complex128", precision))
    assert b.quality.status == a.quality.status
    rounding = max(eps, np.finfo(float).eps)  # the double result is no better than double
    condition = 1 / np.min([m.min() for m in a.quality.margin.values()])
    for name in (n for n in a if not n.endswith(".margin")):
        scale = np.abs(a[name]).max() or 1.0
        assert np.abs(a[name] - b[name]).max() <= 100 * rounding * condition * scale, name


# -- what is refused --------------------------------------------------------------------------


def changed(graph, **home):
    """The graph's group with another home."""
    group = graph.blocks["platform"]
    new = group.home.model_copy(update=home)
    graph.blocks["platform"] = group.model_copy(update={"home": new})
    return graph


def poses_of(graph, **moved):
    return {**graph.blocks["platform"].home.poses, **moved}


def near_dead_centre():
    """A home at the very end of its arc."""
    mech, arc = triad_and_arc()
    end = arc.end.q
    run = mech.run(at=end - 1e-15, want=["platform.*.p", "platform.*.angle"], on_gap="mark")
    poses = {}
    for link in mech.structure.blocks["platform"].link_names:
        p, angle = run[f"platform.{link}.p"][0], run[f"platform.{link}.angle"][0]
        poses[link] = (p.real, p.imag, float(angle))
    return changed(triad(), drivers={"crank": end}, poses=poses)


BAD_HOMES = {
    "does not close": (
        lambda: changed(triad(), poses=poses_of(triad(), plate=(30.0, -20.0, 2.0))),
        "do not close",
    ),
    "misses a driver": (
        lambda: changed(two_drivers(), drivers={"crank": HOME}),
        "no value of platform.S",
    ),
    "has a strange driver": (
        lambda: changed(triad(), drivers={"crank": HOME, "wind": 2.0}),
        "wind does not move it",
    ),
    "out of reach": (lambda: changed(triad(), drivers={"crank": HOME + 2.9}), "do not close"),
}


@pytest.mark.parametrize(("make", "message"), BAD_HOMES.values(), ids=list(BAD_HOMES))
def test_bad_home_is_one_problem(make, message):
    with pytest.raises(bm.GraphError) as caught:
        make().compile()
    (problem,) = caught.value.problems
    assert problem.code == "bad-home"
    assert problem.where.startswith("platform.home")
    assert message in problem.found


def test_home_at_a_dead_centre_is_refused():
    with pytest.raises(bm.GraphError) as caught:
        near_dead_centre().compile()
    assert [p.code for p in caught.value.problems] == ["bad-home"]


def test_rough_home_is_refined():
    exact = triad()
    poses = {
        link: (x + 0.02, y - 0.03, a + 0.03)
        for link, (x, y, a) in exact.blocks["platform"].home.poses.items()
    }
    rough = changed(triad(), poses=poses)
    a, b = (g.run(at=1.0, want=["*.p", "*.margin"]) for g in (exact, rough))
    for name in a:
        assert abs(a[name][0] - b[name][0]) <= ROUNDING * 10


def test_wrong_number_of_pairs_is_one_problem():
    with pytest.raises(bm.GraphError) as caught:
        bm.GeneralGroup(
            links={"i": bm.Link()},
            pairs={"A": {"type": "R", "link": "i"}},
            home={"poses": {"i": (0.0, 0.0, 0.0)}},
        )
    (problem,) = caught.value.problems
    assert problem.where == "GeneralGroup.pairs"
    assert problem.valid == "a group has 3n = 2p + k"


# -- everything else that a mechanism can do ---------------------------------------------------


@pytest.mark.parametrize(
    "graph",
    [triad(), platform(cylinder=True, names=odd), stacked()],
    ids=["triad", "odd names", "stacked"],
)
def test_file_comes_back_byte_for_byte(graph):
    text = graph.to_json()
    again = loads(text)
    assert again.to_json() == text
    jsonschema.Draft202012Validator(graph_schema()).validate(json.loads(text))
    home = dict(zip(graph.compile().drivers, (HOME, REACH), strict=False))
    a, b = (g.run(at=home, want="*.p") for g in (graph, again))
    assert all(np.array_equal(a[n], b[n]) for n in a)


def test_limits_are_where_the_path_ends():
    mech, arc = triad_and_arc()
    assert (arc.start.block, arc.end.block) == ("platform", "platform")
    inside = mech.run(at=[arc.start.q + 1e-9, arc.end.q - 1e-9], want="*.p", on_gap="mark")
    assert inside.quality.status == ("ok", "ok")
    outside = mech.run(at=[arc.start.q - 1e-9, arc.end.q + 1e-9], want="*.p", on_gap="mark")
    assert outside.quality.status == ("no-assembly", "no-assembly")


def test_simulation_by_energy_is_the_integrated_one():
    graph = platform(gravity=(0.0, -9.81), crank=0.3)
    graph.start("crank", q=0.2, rate=6.0)
    mech = graph.compile()
    given = {"until": "time=0.1", "friction": "none"}
    a = mech.simulate(**given, method="energy")
    b = mech.simulate(**given, method="dop853")
    assert a["crank.rate"][-1] == pytest.approx(b["crank.rate"][-1], rel=1e-7)
