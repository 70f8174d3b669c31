"""What `explain` tells: what each requested output needs, and what asking for less saves."""

from blockmech.analysis.explain import shares
from tests.machines import ruiz, watt


def test_shares_name_the_blocks_and_stages_that_an_output_drags_in():
    mech = watt().compile()
    result = {s.name: s for s in shares(mech, ["first.C.p", "last.C.v", "crank.drive"])}
    assert result["first.C.p"].blocks == ("crank", "first")
    assert result["first.C.p"].stages == ("position",)
    assert result["last.C.v"].blocks == ("crank", "first", "last")
    assert "force" in result["crank.drive"].stages


def test_the_dearest_output_saves_most_and_one_that_others_need_saves_little():
    result = shares(ruiz().compile(), ["crank.drive", "dyad.j.alpha", "crank.q"])
    assert result[0].name == "crank.drive"
    assert result[0].saves == 2  # reactions of the dyad and of the crank
    assert all(s.saves == 0 for s in result[1:])  # the drive needs it anyway


def test_many_outputs_are_told_by_the_stage_that_they_need():
    names = [s.name for s in shares(ruiz().compile(), "*")]
    assert {"positions", "velocities", "accelerations", "reactions and drives"} <= set(names)


def test_friction_that_is_left_out_costs_nothing():
    assert ruiz().compile().plan("*.friction_power", friction="none").calls == 0


def test_explain_says_what_asking_for_less_would_save():
    text = ruiz().compile().explain(["crank.drive", "dyad.j.alpha"])
    assert "8 kernel calls for 2 outputs" in text
    assert "saved without it" in text
