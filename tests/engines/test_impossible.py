"""Dead centres, coincident joints and places out of reach: NaN of one pattern, no exception.

`filterwarnings = error` holds for all tests, so a warning fails here too.
"""

import mpmath
import numpy as np
import pytest

import blockmech as bm
from tests.machines import wire
from tests.wiring import EPS, off


def linkage(crank=1.0, pivot=1.0, l_i=2.0, l_j=2.0, friction=True, spring=False):
    """A four-bar with another dyad on it, both heavy and rough."""
    law = bm.friction.Coulomb(coefficient=0.1, radius=0.01)
    pins = dict.fromkeys("BCD", law) if friction else {}
    g = bm.Graph("linkage", gravity=(0.0, -9.81))
    markers = {"A": (0.0, 0.0), "D": (pivot, 0.0), "H": (3.0, 3.0)}
    g.add("frame", bm.Frame(markers=markers))
    heavy = bm.Link(mass=1.0, inertia=0.1, cm=(0.3, 0.1), markers={"E": (0.5, 0.5)})
    g.add("crank", bm.Crank(length=crank, links={"crank": bm.Link(mass=1.0, cm=(0.3, 0.0))}))
    plain = bm.Link(mass=2.0, inertia=0.1, cm=(0.1, 0.1))
    links = {"i": heavy, "j": plain}
    g.add("first", bm.RRR(l_i=l_i, l_j=l_j, links=links, friction=pins))
    g.add("next", bm.RRR(l_i=3.0, l_j=3.0, links={"i": plain}, friction=pins))
    wire(g, "frame.A crank.A", "crank.B first.B", "frame.D first.D")
    wire(g, "first.E next.B", "frame.H next.D")
    if spring:
        g.add("spring", bm.Spring(stiffness=100.0, free_length=0.3, damping=1.0))
        wire(g, "frame.D spring.a", "crank.B spring.b")
    g.drive("crank", bm.motion.ConstantRate(rate=2.0))
    return g


CASES = {
    # at crank 0 joints B and D of the first dyad coincide
    "B on D": linkage(),
    "B on D, spring of no length": linkage(spring=True),
    # at crank 0 the first dyad is folded, exactly
    "folded": linkage(pivot=1.5, l_i=2.0, l_j=1.5),
    # at crank 0 it is stretched, exactly, and out of reach elsewhere
    "stretched": linkage(pivot=4.0, l_i=1.5, l_j=1.5),
    "out of reach": linkage(pivot=4.0, l_i=1.25, l_j=1.5),
}
SAMPLES = np.array([0.0, 0.3, 1.0, 2.0, -1e-9, 1e-8, 3.0])
EACH_ENGINE = pytest.mark.parametrize("engine", ["scalar", "numpy"])


@EACH_ENGINE
@pytest.mark.parametrize("name", CASES)
def test_every_sample_without_an_answer_has_a_reason(name, engine):
    r = CASES[name].run(at=SAMPLES, engine=engine, on_gap="mark")
    for k, status in enumerate(r.quality.status):
        lost = [n for n, v in r.items() if np.ndim(v) and np.isnan(v[k])]
        assert (status != "ok") == bool(lost), (k, lost[:3])


@EACH_ENGINE
def test_coincident_joints_have_no_margin(engine):
    r = CASES["B on D"].run(at=0.0, engine=engine, on_gap="mark")
    assert np.isnan(r["first.margin"][0])
    assert r.quality.status == ("no-assembly",)
    assert r["crank.B.p"][0] == 1 + 0j  # what does not need the dyad stands
    assert r["first.B.v"][0] == 2j
    assert np.isnan(r["first.C.p"][0])
    with pytest.raises(bm.AssemblyError, match="its outer joints coincide"):
        CASES["B on D"].run(at=0.0, engine=engine)


@EACH_ENGINE
@pytest.mark.parametrize("name", ["folded", "stretched"])
def test_margin_exactly_zero_has_a_place_but_no_rates(name, engine):
    r = CASES[name].run(at=0.0, engine=engine, on_gap="mark")
    assert r["first.margin"][0] == 0.0
    assert np.isfinite(r["first.C.p"][0])
    assert np.isnan(r["first.i.omega"][0])
    assert np.isnan(r["first.C.reaction"][0])
    assert ("dead-centre", "first") in {(f.code, f.where) for f in r.quality.flags}


@EACH_ENGINE
@pytest.mark.parametrize("name", ["folded", "stretched"])
def test_dead_centre_is_an_answer_where_only_places_are_wanted(name, engine):
    want = ["first.C.p", "first.j.angle", "first.margin"]
    r = CASES[name].run(at=0.0, engine=engine, want=want)
    assert r.quality.status == ("ok",)
    with pytest.raises(bm.SingularError) as caught:
        CASES[name].run(at=0.0, engine=engine, want=[*want, "first.i.omega"])
    assert caught.value.failure.margin == 0.0
    assert caught.value.problems[0].code == "dead-centre"


@EACH_ENGINE
def test_out_of_reach_has_a_negative_margin_and_is_refused_by_name(engine):
    r = CASES["out of reach"].run(at=0.0, engine=engine, on_gap="mark")
    # (L - r)(L + r)(r - g)(r + g) / (2 l_i l_j)^2 with r = 3, L = 2.75, g = 0.25
    assert r["first.margin"][0] == pytest.approx(-0.25 * 5.75 * 2.75 * 3.25 / 3.75**2, rel=1e-15)
    with pytest.raises(bm.AssemblyError, match=r"first at crank\.q = 0 rad"):
        CASES["out of reach"].run(at=0.0, engine=engine)


def test_later_block_that_cannot_close_is_not_blamed_on_the_friction_before_it():
    # The first dyad's friction is beyond the certificate, the next dyad is out of reach:
    # the loads on the first are unknown, which continuation must not be asked about.
    g = linkage(crank=0.5, pivot=2.0, friction=False)
    rough = bm.friction.Coulomb(coefficient=0.4, radius=3.0)
    first = g.blocks["first"].model_copy(update={"friction": dict.fromkeys("BCD", rough)})
    short_dyad = bm.RRR(l_i=0.1, l_j=0.1, links={"i": bm.Link(mass=1.0)})
    h = bm.Graph("far", gravity=(0.0, -9.81))
    for name, block in g.blocks.items():
        h.add(name, {"first": first, "next": short_dyad}.get(name, block))
    for w in g.wires:
        h.connect(w.source, w.target)
    h.drive("crank", bm.motion.ConstantRate(rate=2.0))
    for engine in ("scalar", "numpy"):
        for friction in ("newton", "successive"):
            r = h.run(at=[0.1, 0.4], engine=engine, friction=friction, on_gap="mark")
            assert r.quality.status == ("no-assembly", "no-assembly")
            assert set(r.quality.blame.values()) == {"next"}
            assert r.quality.flags == ()


@EACH_ENGINE
@pytest.mark.parametrize("q", [1e9, 123456789012345.0, 1e15, -1e15, 1e300])
def test_crank_angle_of_any_size_counts_as_exact(engine, q):
    mech = linkage(crank=0.5, pivot=2.0).compile()
    r = mech.run(at=q, engine=engine)
    with mpmath.workdps(400):
        e = complex(mpmath.expj(mpmath.mpf(q)))
        reduced = float(mpmath.fmod(mpmath.mpf(q), 2 * mpmath.pi))
    assert abs(r["crank.B.p"][0] - 0.5 * e) <= EPS * 0.5
    # The same pose at the rounded remainder: half an ulp of a few radians, times rates.
    same = mech.run(at=reduced, engine=engine)
    conditioning = 1 / np.sqrt(min(same["first.margin"][0], same["next.margin"][0])) ** 2
    for name in ("first.C.p", "next.j.omega", "first.j.alpha", "first.C.reaction", "crank.drive"):
        assert off(r[name], same[name]) <= 100 * EPS * conditioning


@EACH_ENGINE
def test_at_rest_every_rough_pair_is_flagged_and_nothing_breaks(engine):
    r = linkage(crank=0.5, pivot=2.0).run(at=1.0, rates=0.0, engine=engine)
    assert r.quality.status == ("ok",)
    assert {f.where for f in r.quality.flags} == {
        f"{b}.{j}" for b in ("first", "next") for j in "BCD"
    }
    assert r["mechanism.friction_power"][0] == 0.0


def guided_group():
    """Two links as a group without closed form: one slides along the crank, one is on the frame."""
    pairs = {
        "S": {"type": "P", "link": "slider"},
        "C": {"type": "R", "links": ["slider", "arm"], "at": [[0.0, 0.5], [0.6, 0.0]]},
        "D": {"type": "R", "link": "arm"},
    }
    poses = {"slider": [1.52, 0.0, 0.0], "arm": [1.0, 0.2, 0.52]}
    home = {"drivers": {"crank": 0.0}, "poses": poses}
    link = bm.Link(mass=1.0, inertia=0.1)
    g = bm.Graph("guided")
    g.add("frame", bm.Frame(markers={"A": (0.0, 0.0), "D": (1.0, 0.2)}))
    g.add("crank", bm.Crank(length=1.0, links={"crank": link}))
    links = {"slider": link, "arm": link}
    g.add("group", bm.GeneralGroup(links=links, pairs=pairs, home=home))
    return wire(g, "frame.A crank.A", "crank.crank group.S", "frame.D group.D")


def test_a_group_that_does_not_close_has_no_rates_in_any_engine():
    """The slider turns with the crank, but where there is no pose it has no angular velocity."""
    mech, lost = guided_group().compile(), {}
    for engine in ("scalar", "numpy", "llvm"):
        r = mech.run(at=[0.0, 0.1, 0.5], rates=2.0, engine=engine, on_gap="mark")
        assert r.quality.status == ("ok", "ok", "no-assembly")
        lost[engine] = {n for n, v in r.items() if np.ndim(v) and np.isnan(v[2])}
        assert r["group.slider.omega"][:2] == pytest.approx(2.0, rel=1e-14)
    of_slider = {f"group.slider.{x}" for x in ("angle", "omega", "alpha")}
    assert of_slider | {"group.S.N", "group.C.reaction", "crank.drive"} <= lost["numpy"]
    assert lost["scalar"] == lost["numpy"] == lost["llvm"]
