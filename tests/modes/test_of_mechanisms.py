"""Modes of whole mechanisms: listed, chosen in the file, and followed by the general group."""

import cmath
import copy
import json
import math
from functools import cache

import numpy as np
import pytest

import blockmech as bm
from blockmech.analysis import arcs
from blockmech.blocks.general import GeneralGroup
from blockmech.ground.errors import RequestError
from blockmech.modes.closing import triad_modes
from blockmech.modes.groups import outline
from blockmech.typing import Guide
from tests.doors import graph_of as loads
from tests.gallery import GRAPHS, JOINTS
from tests.machines import fourbar, ruiz, watt
from tests.modes import machines
from tests.modes.exact import count_exactly

TURN = 2 * math.pi
SAME = 1e-9  # [m; rad]: Newton on either side, and a margin of 1e-3
PLACE = 1e-9  # [rad]
INSIDE = 1e-3  # [rad] from a dead centre, where digits of the pose are lost


def apart(mechanism, group, mode, q):
    """How far the mechanism's own pose is from a mode, over all links of the group."""
    worst = 0.0
    for link, (x, y, turned) in mode.links.items():
        run = mechanism.run(at=q, want=[f"{group}.{link}.p", f"{group}.{link}.angle"])
        worst = max(
            worst,
            abs(run[f"{group}.{link}.p"][0] - complex(x, y)),
            abs(cmath.exp(1j * run[f"{group}.{link}.angle"][0]) - cmath.exp(1j * turned)),
        )
    return worst


@cache
def overturned():
    """The mechanism whose modes change by a turn."""
    return machines.compiled(machines.overturned())


@cache
def modes_at(q):
    return overturned().modes(q)


# ---- triads ------------------------------------------------------------------------------


def test_a_home_put_into_the_file_chooses_its_mode():
    document = machines.overturned()
    at = 2.8
    result = overturned().modes(at, arcs=False)["triad"].samples[0]
    assert len(result) == 4
    for mode in result:
        changed = machines.compiled(machines.with_home(document, mode.put))
        assert apart(changed, "triad", mode, at) <= SAME
        again = changed.modes(at, arcs=False)["triad"].samples[0]
        assert [m.chosen for m in again] == [m is mode for m in result]


def test_the_general_group_keeps_to_its_home_mode_over_the_whole_arc():
    document = machines.overturned()
    at = 5.0
    for mode in modes_at(at)["triad"].samples[0][:2]:
        changed = machines.compiled(machines.with_home(document, mode.put))
        low, high = mode.reach
        told = changed.modes(np.linspace(low + INSIDE, high - INSIDE, 3).tolist())["triad"]
        for modes in told.samples:
            (chosen,) = (m for m in modes if m.chosen)
            assert chosen.reach == pytest.approx((low, high), abs=PLACE)
        # Beyond its arc a group stands as whole turns before, if that is on its arc.
        for outside in (low - INSIDE, high + INSIDE) if high - low < TURN else ():
            beyond = changed.run(at=[outside], want=["triad.margin"], on_gap="mark")
            assert not beyond["triad.margin"][0] > 0


def test_after_a_turn_the_file_s_mode_may_be_another_one():
    result = overturned().modes([2.8, 2.8 + TURN])["triad"]
    now, then = result.samples
    chosen_now = next(m for m in now if m.chosen)
    chosen_then = next(n for n, m in enumerate(then) if m.chosen)
    assert chosen_now.after_turn == chosen_then == 2
    assert now.index(chosen_now) == 0
    assert "after a turn it is mode 3" in modes_at(2.8).text()


def supports_of_sliding(q):
    rail = cmath.exp(0.2j)
    return Guide(rail * (q + 0.1), rail * cmath.exp(1.3j)), 2 + 0.3j, 1 + 2j


def sliding(q=0.1):
    """The mechanism with a leg of each kind, its home the first mode at q."""
    document = machines.sliding()
    group = outline(group_of(document))
    shoe, rod, sleeve = supports_of_sliding(q)
    supports = [{"shoe_guide": shoe, "G": rod, "H": sleeve}[name] for name in group.joints]
    mode = triad_modes(group.at().triad, supports)[0]
    places = group.at().places(supports, mode.o, mode.e)
    poses = {n: [p.o.real, p.o.imag, cmath.phase(p.e)] for n, p in places.items()}
    document["blocks"]["triad"]["home"] = {"drivers": {"ram": q}, "poses": poses}
    return document


def test_a_triad_with_a_leg_of_each_kind_closes_in_every_mode_that_is_listed():
    document = sliding()
    result = machines.compiled(document).modes([0.1, 0.3])["triad"]
    assert result.kind == "III triad"
    for q, listed in zip((0.1, 0.3), result.samples, strict=True):
        assert len(listed) >= 2
        for mode in listed:
            # A home that does not close is refused, and one that does is refined to itself.
            changed = machines.compiled(machines.with_home(document, mode.put))
            assert apart(changed, "triad", mode, q) <= SAME


def test_the_arcs_of_a_slide_end_with_the_range_of_its_law():
    result = machines.compiled(sliding()).modes()["triad"]
    ends = {(e.how, e.q) for arc in result.arcs for e in (arc.start, arc.end)}
    assert {q for how, q in ends if how == "range"} <= {0.0, 0.4}
    assert all(0 <= q <= 0.4 for _, q in ends)


def test_poses_put_into_a_document_of_joints_choose_the_mode():
    document = machines.of_joints(machines.overturned())
    mechanism = machines.compiled(document)
    for q in (-4.0, -2.8):
        (group,) = mechanism.modes(q, arcs=False).groups
        for mode in group.samples[0]:
            changed = copy.deepcopy(document)
            for link, keys in mode.put["links"].items():
                changed["links"][link] |= keys
            run = machines.compiled(changed).run(at=q, want=["link.*"])
            for link, (x, y, turned) in mode.links.items():
                assert abs(run[f"link.{link}.p"][0] - complex(x, y)) <= SAME
                assert abs(math.remainder(run[f"link.{link}.angle"][0] - turned, TURN)) <= SAME


def test_arcs_of_a_document_of_joints_are_in_its_own_coordinate():
    graph = machines.overturned()
    (there,) = modes_at(None).groups
    (here,) = machines.compiled(machines.of_joints(graph)).modes().groups
    assert len(here.arcs) == len(there.arcs)
    for one, other in zip(here.samples[0], there.samples[0], strict=True):
        assert one.reach == pytest.approx([-x for x in other.reach[::-1]], abs=PLACE)
        mine, yours = here.arcs[one.arc], there.arcs[other.arc]
        assert 0 <= (mine.start.q + mine.end.q) / 2 < TURN  # of its own coordinate
        assert math.remainder(mine.start.q + yours.end.q, TURN) == pytest.approx(0, abs=PLACE)
        assert mine.end.q - mine.start.q == pytest.approx(yours.end.q - yours.start.q, abs=PLACE)


def test_a_triad_on_a_rocker_has_its_arcs_within_those_of_the_rocker():
    # The dyad is compiled alone; the triad's home is what its own elimination says.
    document, (frame, pins, lengths) = machines.on_a_rocker()
    rocker = copy.deepcopy(document)
    rocker["wires"] = [w for w in rocker["wires"] if not w["to"].startswith("triad")]
    del rocker["blocks"]["triad"]
    rocker = machines.compiled(rocker)
    held, (around,) = [complex(frame[n]) for n in ("G2", "G3")], rocker.limits().arcs

    def supports(q):
        return complex(rocker.run(at=q, want=["dyad.C.p"])["dyad.C.p"][0]), *held

    def exact(q):
        return count_exactly(supports(q), list(lengths.values()), list(pins.values()))

    q = next(x for x in np.linspace(around.start.q, around.end.q, 40)[1:] if exact(x))
    group = outline(group_of(document))
    order = [("G1", "G2", "G3").index(name) for name in group.joints]
    at = [supports(q)[n] for n in order]
    mode = triad_modes(group.at().triad, at)[0]
    places = group.at().places(at, mode.o, mode.e)
    document["blocks"]["triad"]["home"] = {
        "drivers": {"crank": q},
        "poses": {n: [p.o.real, p.o.imag, cmath.phase(p.e)] for n, p in places.items()},
    }
    result = machines.compiled(document).modes(q)["triad"]
    assert all(around.start.q <= a.start.q < a.end.q <= around.end.q for a in result.arcs)
    for x in np.linspace(around.start.q, around.end.q, 14)[1:-1]:
        assert sum(a.start.q < x < a.end.q for a in result.arcs) == exact(x)
    for arc in result.arcs:
        for end in (arc.start, arc.end):
            ends = (around.start.q, around.end.q)
            assert end.how == "dead centre" or (end.how == "earlier group" and end.q in ends)


def on_cylinders():
    """A platform on three cylinders, its home the first mode at the home lengths."""
    document = machines.on_cylinders()
    drivers = document["blocks"]["triad"]["home"]["drivers"]
    formed = outline(group_of(document)).at(list(drivers.values()))
    mode = triad_modes(formed.triad, machines.FEET)[0]
    places = formed.places(machines.FEET, mode.o, mode.e)
    poses = {n: [p.o.real, p.o.imag, cmath.phase(p.e)] for n, p in places.items()}
    document["blocks"]["triad"]["home"]["poses"] = poses
    return document


def lengths_of(drivers):
    """Pin to pin, by hand: barrel 0.2, rod 0.1 from their pins; the third the other way."""
    return [drivers[0] + 0.2 - 0.1, drivers[1] + 0.2 - 0.1, drivers[2] + 0.1 - 0.2]


def test_a_platform_on_three_cylinders_is_a_triad_at_given_lengths():
    document = on_cylinders()
    result = machines.compiled(document).modes(
        {f"triad.q{n}": [q] for n, q in enumerate(machines.CYLINDERS, start=1)}
    )["triad"]
    lengths = lengths_of(machines.CYLINDERS)
    assert len(result.samples[0]) == count_exactly(machines.FEET, lengths, machines.PINS) >= 2
    assert sum(m.chosen for m in result.samples[0]) == 1
    at = {f"triad.q{n}": q for n, q in enumerate(machines.CYLINDERS, start=1)}
    for mode in result.samples[0]:
        changed = machines.compiled(machines.with_home(document, mode.put))
        assert apart(changed, "triad", mode, at) <= SAME
        for n, l in enumerate(lengths, start=1):
            barrel, rod = mode.links[f"barrel_{n}"], mode.links[f"rod_{n}"]
            assert math.hypot(rod[0] - barrel[0], rod[1] - barrel[1]) == pytest.approx(l, abs=SAME)


def test_arcs_of_a_platform_are_along_the_cylinder_that_is_named():
    mechanism = machines.compiled(on_cylinders())
    at = {f"triad.q{n}": [q] for n, q in enumerate(machines.CYLINDERS, start=1)}
    result = mechanism.modes(at, driver="triad.q2")["triad"]
    one, _, three = machines.CYLINDERS
    for q in np.linspace(0.3, 4.0, 18)[1:-1]:
        there = sum(a.start.q < q < a.end.q for a in result.arcs)
        lengths = lengths_of([one, q, three])
        assert there == count_exactly(machines.FEET, lengths, machines.PINS)
    hows = {e.how for a in result.arcs for e in (a.start, a.end)}
    assert hows == {"dead centre", "range"}
    for mode in result.samples[0]:
        arc = result.arcs[mode.arc]
        assert mode.reach == (arc.start.q, arc.end.q)
        assert mode.after_turn is None


def group_of(document):
    block = document["blocks"]["triad"]
    return GeneralGroup.model_validate({k: v for k, v in block.items() if k != "type"})


# ---- dyads -------------------------------------------------------------------------------


def test_both_branches_of_a_dyad_are_listed_and_the_file_s_is_marked():
    result = ruiz().compile().modes([0.0, 1.0])["dyad"]
    for modes in result.samples:
        assert [m.put for m in modes] == [{"branch": 1}, {"branch": -1}]
        assert [m.chosen for m in modes] == [True, False]
        assert [m.after_turn for m in modes] == [0, 1]


def test_later_groups_stand_on_the_earlier_ones_of_the_file():
    graph = watt()
    mechanism = graph.compile()
    text = graph.to_json()
    for name in mechanism.structure.blocks:
        if not mechanism.structure.blocks[name].closes:
            continue
        for mode in mechanism.modes(1.0, arcs=False)[name].samples[0]:
            document = json.loads(text)
            document["blocks"][name] |= mode.put
            changed = loads(json.dumps(document)).compile()
            assert apart(changed, name, mode, 1.0) <= SAME


def test_a_rocker_s_dyad_has_its_branches_merge_at_both_ends_of_its_arc():
    mechanism = fourbar(3.0, 3.0, 2.0, 4.0).compile()
    result = mechanism.modes(1.0)["dyad"]
    (arc,) = (a for a in mechanism.limits().arcs if a.start.q < 1 < a.end.q)
    for n, mode in enumerate(result.samples[0]):
        mine = result.arcs[mode.arc]
        assert (mine.start.q, mine.end.q) == (arc.start.q, arc.end.q)
        assert mine.start.other == mine.end.other == result.samples[0][1 - n].arc
        assert mode.after_turn is None


def test_out_of_reach_no_mode_is_listed():
    graph = ruiz()
    assert graph.compile().modes(0.0, arcs=False)["dyad"].samples[0]
    graph.blocks["frame"] = bm.Frame(markers={"A": (0, 0), "D": (50, 0)})
    result = graph.compile().modes(0.0)["dyad"]
    assert result.samples == ((),)
    assert result.arcs == ()
    assert "never closes" in result.note


# ---- requests ----------------------------------------------------------------------------


def test_wrong_names_are_refused_with_the_right_ones():
    mechanism = ruiz().compile()
    with pytest.raises(RequestError, match='did you mean "dyad"'):
        mechanism.modes(0.0, groups=["dyd"])
    with pytest.raises(RequestError, match='did you mean "crank"'):
        mechanism.modes(0.0, driver="crnk")
    with pytest.raises(RequestError, match='no group "'):
        mechanism.modes(0.0)["crank"]


def test_json_holds_the_same_as_python():
    result = modes_at(5.0)
    document = json.loads(json.dumps(result.to_dict(), allow_nan=False))
    group = document["groups"][0]
    assert document["drivers"] == {"crank": [5.0]}
    assert [m["margin"] for m in group["samples"][0]] == [
        m.margin for m in result["triad"].samples[0]
    ]
    assert [a["start"]["q"] for a in group["arcs"]] == [a.start.q for a in result["triad"].arcs]


def test_modes_call_a_drivers_coordinate_what_all_else_calls_it():
    mechanism = bm.Linkage.load(GRAPHS / "joints" / "ruiz_fourbar.json").compile()
    modes, (name,) = mechanism.modes(1.0), mechanism.run(at=1.0, want="driver.*.q")
    assert f"  {name} = 1 rad: 2 modes" in modes.text()
    assert f"  along {name}:" in modes.text()
    assert "prefix" not in modes.to_dict()


def test_a_group_is_looked_through_once_for_all_that_stand_on_it(monkeypatch):
    """A chain of thirty was looked through from its first link on for each of them: 90 s."""
    looked = []

    def counted(*given, **named):
        looked.append(given)
        return fit(*given, **named)

    fit = arcs.fit
    monkeypatch.setattr(arcs, "fit", counted)
    mech = watt().compile()
    assert mech.modes(0.0).driver == "crank"
    assert len(looked) == sum(block.closes for block in mech.structure.blocks.values()) == 2


@pytest.mark.parametrize("path", sorted(JOINTS.glob("*.json")), ids=lambda path: path.stem)
def test_every_document_of_links_and_joints_has_its_modes(path):
    mechanism = bm.Linkage.load(path).compile()
    groups = mechanism.modes()
    if any(block.closes for block in mechanism.structure.blocks.values()):
        assert "modes" in str(groups) or "mode" in str(groups)
