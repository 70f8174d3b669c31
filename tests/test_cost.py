"""The cost model: what each wanted output drags in, and what asking for less saves."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import blockmech as bm
from blockmech.cost import CostModel, price, shares
from blockmech.cost.counting import Counted, Tally
from blockmech.cost.weights import solving, spreading
from tests.wiring import chain, ruiz, watt

GRAPHS = Path(__file__).parents[1] / "graphs"


def test_arrays_count_what_is_done_to_them() -> None:
    Counted.tally = Tally()
    x = np.arange(3.0).view(Counted)
    y = np.sqrt(x * 2.0 + 1.0)
    np.where(y > 1.0, y, x)
    done = {"multiply": 1, "add": 1, "sqrt": 1, "greater": 1, "where": 1}
    assert Counted.tally.operations == done


def test_what_is_not_wanted_costs_nothing() -> None:
    mech = ruiz().compile()
    places, forces = mech.plan("*.p"), mech.plan("*.reaction")
    assert price(mech, places) < price(mech, forces) / 3


def test_shares_name_the_blocks_and_stages_that_an_output_drags_in() -> None:
    mech = watt().compile()
    found = {s.name: s for s in shares(mech, ["first.C.p", "last.C.v", "crank.drive"])}
    assert found["first.C.p"].blocks == ("crank", "first")
    assert found["first.C.p"].stages == ("position",)
    assert found["last.C.v"].blocks == ("crank", "first", "last")
    assert "force" in found["crank.drive"].stages


def test_the_dearest_output_saves_most_and_a_free_one_nothing() -> None:
    found = shares(ruiz().compile(), ["crank.drive", "dyad.j.alpha", "crank.q"])
    assert found[0].name == "crank.drive"
    assert found[0].saves > 3
    last = {s.name: s.saves for s in found}
    assert last["dyad.j.alpha"] == pytest.approx(1.0, abs=0.05)  # the drive needs it anyway


def test_many_outputs_are_told_by_the_stage_that_they_need() -> None:
    names = [s.name for s in shares(ruiz().compile(), "*")]
    assert {"positions", "velocities", "accelerations", "reactions and drives"} <= set(names)


def test_solving_friction_is_counted_with_its_iterations() -> None:
    mech = ruiz().compile()
    few = mech.plan("*.reaction", friction="successive", iterations=2)
    many = mech.plan("*.reaction", friction="successive", iterations=8)
    assert price(mech, many) > 1.3 * price(mech, few)


def test_costs_of_a_chain_grow_with_its_length() -> None:
    short, long = chain(5).compile(), chain(20).compile()
    ratio = price(long, long.plan("*.v")) / price(short, short.plan("*.v"))
    assert 3 < ratio < 4.5  # 41 links against 11


def test_explain_says_what_asking_for_less_would_save() -> None:
    text = ruiz().compile().explain(["crank.drive", "dyad.j.alpha"])
    assert "8 kernel calls for 2 outputs" in text
    assert "without crank.drive:" in text
    assert "without friction:" in text
    assert "times cheaper" in text


def test_explain_works_where_drivers_have_no_law_of_motion() -> None:
    g = bm.Graph("pendulum", gravity=(0.0, -9.81))
    g.add("frame", bm.Frame(markers={"A": (0.0, 0.0)}))
    g.add("crank", bm.Crank(length=1.0, links={"crank": bm.Link(mass=1.0, cm=(0.5, 0.0))}))
    g.connect("frame.A", "crank.A")
    assert "crank.J_red" in g.compile().explain(["crank.J_red", "crank.tau_red"])


def test_lines_that_plans_share_are_counted_once() -> None:
    mech = ruiz().compile()
    model = CostModel(mech)
    whole = model.cost(mech.plan("*"))
    before = dict(model._lines)
    assert model.cost(mech.plan("*.p")) < whole
    assert model._lines == before


@pytest.mark.parametrize("want", ["*.friction_power", "*.friction", "mechanism.friction_power"])
def test_friction_that_is_left_out_costs_nothing(want: str) -> None:
    mech = ruiz().compile()
    assert mech.plan(want, friction="none").calls == 0
    assert mech.plan(want).calls > 0
    values = mech.run(samples=5, want=want, friction="none")
    assert all(np.all(values[name] == 0.0) for name in values)


def test_looking_up_a_table_is_counted() -> None:
    Counted.tally = Tally()
    knots = np.arange(5.0).view(Counted)
    x = np.linspace(0.0, 3.9, 7).view(Counted)
    x - knots[np.searchsorted(knots, x, side="right") - 1]
    assert Counted.tally.operations["searchsorted"] == 1
    assert Counted.tally.operations["take"] == 1


def test_a_request_that_needs_no_kernel_still_costs_its_samples() -> None:
    mech = ruiz().compile()
    nothing = price(mech, mech.plan("*.friction", friction="none"))
    assert 0 < nothing < price(mech, mech.plan("crank.crank.angle"))


def test_every_driver_makes_a_sample_dearer() -> None:
    one, two = ruiz().compile(), bm.Graph.load(GRAPHS / "fivebar_falling.json").compile()
    still = "frame.frame.v"  # needs no kernel
    assert 1.3 < price(two, two.plan(still)) / price(one, one.plan(still)) < 2


def test_the_same_operations_are_dearer_in_a_program_that_keeps_more_arrays() -> None:
    mech = chain(30).compile()
    model = CostModel(mech)
    groups = [name for name in mech.structure.blocks if name not in mech.drivers]
    costs = [model.cost(mech.plan(f"{name}.C.p")) for name in groups]
    early, late = costs[3] - costs[2], costs[29] - costs[28]  # one more group of the same kind
    assert early < late < 2 * early


def test_a_general_group_costs_its_matrices_and_its_following() -> None:
    mech = bm.Graph.load(GRAPHS / "stephenson_3_triad.json").compile()
    places = price(mech, mech.plan("*.p"))
    # Four links: its margin takes singular values of a 12 x 12 matrix, following as many again.
    assert places > 2 * spreading(12)
    whole = price(mech, mech.plan("*"))
    assert whole > places + 2 * solving(12)  # rates and reactions


def test_following_is_timed_once() -> None:
    mech = bm.Graph.load(GRAPHS / "stephenson_3_triad.json").compile()
    model = CostModel(mech)
    assert model.cost(mech.plan("*.p")) == model.cost(mech.plan("*.p"))
    (path,) = model._paths.values()
    kept = path._time
    model.cost(mech.plan("*"))
    assert path._time == kept > 0


def test_samples_whose_friction_nothing_certifies_are_dear() -> None:
    mech = ruiz(radius=3.75).compile()  # many crank angles lock
    smooth = price(mech, mech.plan("*.reaction", friction="none"))
    assert price(mech, mech.plan("*.reaction")) > 1000 * smooth
