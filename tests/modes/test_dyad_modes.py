"""Modes of the dyads: as many as the table of the port contract says, told by the branch."""

import numpy as np
import pytest

from blockmech import PRP, RPP, RPR, RRP, RRR
from blockmech.blocks.modes import dyad_modes
from blockmech.ground.plane import cross, dot
from blockmech.typing import Guide
from tests.modes import chance

CLOSES = 1e-12  # [m], of sizes about 1


def guide(rng):
    p, u = chance.pose(rng)
    return Guide(p, u)


def point(rng):
    return complex(chance.points(rng, 1)[0])


def test_rrr_has_both_branches_and_each_is_on_its_side():
    rng = np.random.default_rng(1)
    for _ in range(100):
        B, D = point(rng), point(rng)
        dyad = RRR(l_i=abs(D - B) * 0.8, l_j=abs(D - B) * rng.uniform(0.3, 1.7), branch=-1)
        modes = dyad_modes(dyad, [B, D])
        assert [m.branch for m in modes] == [1, -1]
        for m in modes:
            C = B + dyad.l_i * m.links["i"].e
            assert abs(C - D - dyad.l_j * m.links["j"].e) <= CLOSES
            assert np.sign(cross(D - B, C - B)) == m.branch == m.sign
            assert 0 < m.margin <= 1


def test_rrp_has_both_branches_and_each_is_on_its_side():
    rng = np.random.default_rng(2)
    found = 0
    for _ in range(100):
        B, S = point(rng), guide(rng)
        dyad = RRP(l=2.0, h=0.3)
        reach = abs(cross(S.u, S.p - B) - dyad.h)  # of the pin's line from B
        modes = dyad_modes(dyad, [B, S])
        assert [m.branch for m in modes] == ([1, -1] if reach < dyad.l else [])
        for m in modes:
            C = B + dyad.l * m.links["i"].e
            found += 1
            assert abs(C - m.links["j"].o) <= CLOSES
            assert abs(cross(S.u, S.p - C) - dyad.h) <= CLOSES
            assert np.sign(dot(S.u, C - B)) == m.branch
    assert found > 100


def test_rpr_has_both_branches_and_each_is_on_its_side():
    rng = np.random.default_rng(3)
    for _ in range(100):
        B, D = point(rng), point(rng)
        dyad = RPR(h_i=0.3 * abs(D - B), h_j=-0.2 * abs(D - B))
        modes = dyad_modes(dyad, [B, D])
        assert [m.branch for m in modes] == [1, -1]
        for m in modes:
            u = m.links["i"].e
            assert m.links["j"].e == u
            assert abs(dyad.h_i - cross(u, D - B) - dyad.h_j) <= CLOSES
            assert np.sign(dot(u, D - B)) == m.branch


def test_prp_and_rpp_have_one_mode_without_a_branch():
    rng = np.random.default_rng(4)
    for _ in range(50):
        (prp,) = dyad_modes(PRP(h1=0.2, h2=-0.1), [guide(rng), guide(rng)])
        (rpp,) = dyad_modes(RPP(beta=0.8, h_i=0.1), [point(rng), guide(rng)])
        assert prp.branch is None
        assert rpp.branch is None
        assert prp.sign == rpp.sign == 1


def test_dyads_out_of_reach_have_no_mode():
    assert dyad_modes(RRR(l_i=1.0, l_j=1.0), [0j, 3 + 0j]) == ()
    assert dyad_modes(RRR(l_i=1.0, l_j=3.0), [0j, 1 + 0j]) == ()
    assert dyad_modes(RRP(l=1.0), [0j, Guide(2j, 1 + 0j)]) == ()
    assert dyad_modes(RPR(h_i=2.0), [0j, 1 + 0j]) == ()


def test_where_the_outer_pivots_meet_no_mode_is_told():
    assert dyad_modes(RRR(l_i=1.0, l_j=1.0), [1j, 1j]) == ()
    assert dyad_modes(RPR(), [1j, 1j]) == ()
    assert dyad_modes(PRP(), [Guide(0j, 1 + 0j), Guide(1j, 1 + 0j)]) == ()


def test_at_a_dead_centre_both_branches_are_one_double_mode():
    (mode,) = dyad_modes(RRR(l_i=1.0, l_j=2.0), [0j, 3 + 0j])
    assert mode.double
    assert mode.sign == 0
    assert mode.margin == 0
    assert mode.links["i"].e == pytest.approx(1)
