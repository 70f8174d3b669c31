"""What a message suggests for an unknown name: the words of the trade, and never a wrong one."""

from __future__ import annotations

import pytest

import blockmech as bm
from blockmech.ground.errors import close_match

LINK = ("mass", "inertia", "cm", "markers", "pose")
RUBBING = ("law", "coefficient", "radius")
MECHANISM = bm.Graph.load("graphs/ruiz_fourbar.json").compile()


@pytest.mark.parametrize(
    ("word", "valid", "name"),
    [
        ("com", LINK, "cm"),
        ("cog", LINK, "cm"),
        ("m", LINK, "mass"),
        ("I", LINK, "inertia"),
        ("mas", LINK, "mass"),
        ("mu", RUBBING, "coefficient"),
        ("coeff", RUBBING, "coefficient"),
        ("r", RUBBING, "radius"),
        ("l", ("length", "offset", "sign"), "length"),
        ("lj", ("l_i", "l_j", "branch"), "l_j"),
        ("gain", ("k",), "k"),
        ("omega", ("law", "rate", "from", "to"), "rate"),
        ("k", ("stiffness", "free_length", "damping"), "stiffness"),
        ("c", ("stiffness", "free_length", "damping"), "damping"),
        ("coupling.mesh.force", ("joint.A.reaction", "mesh.force"), "mesh.force"),
    ],
)
def test_words_of_the_trade_are_known(word, valid, name):
    assert close_match(word, valid) == f'did you mean "{name}"?'


@pytest.mark.parametrize("word", ["m", "mu", "x", "at"])
def test_a_symbol_is_not_taken_for_one_that_looks_like_it(word):
    assert close_match(word, ("cm", "p", "q", "pose")) == ""


@pytest.mark.parametrize(
    ("want", "name"),
    [
        ("crank.torque", "crank.drive"),
        ("crank.omega", "crank.rate"),
        ("dyad.j.theta", "dyad.j.angle"),
        ("dyad.C.force", "dyad.C.reaction"),
    ],
)
def test_outputs_are_known_by_the_words_of_the_trade(want, name):
    with pytest.raises(bm.RequestError, match=f'did you mean "{name}"'):
        MECHANISM.run(want=want)


def test_a_key_that_is_like_none_is_not_simply_removed():
    with pytest.raises(bm.GraphError, match="write one of these, or remove it"):
        bm.Link(colour=3)
    with pytest.raises(bm.GraphError, match='did you mean "k"'):
        bm.signals.Gain(gain=0.5)
