"""Paths from home: one mode over its whole arc, and nothing but the sample decides.

The march along the arc length of the judge's system (`continuation`) knows of no home and
no steps in driver values; poses, ends of arcs and what lies behind them are held against it.
"""

from __future__ import annotations

import cmath
import functools
import os

import numpy as np
import pytest

import blockmech as bm
from blockmech.passes import homotopy, tracking
from blockmech.testing.strategies import Options, Seeded, random_mechanism
from tests.blocks.continuation import March
from tests.blocks.platforms import platform, triad, triad_and_arc, two_drivers
from tests.blocks.twin import Twin
from tests.machines import wire

EXAMPLES = int(os.environ.get("BLOCKMECH_EXAMPLES", "4"))  # 200 is the full run
TURN = 2 * np.pi
POSES = 1e-14  # [-] of size and radians, over the root of the margin: tens of roundings
ENDS = 1e-10  # [rad or m]
ENGINES = pytest.mark.parametrize("engine", ["scalar", "numpy"])

PLAIN = {"groups": (1, 1), "drivers": (1, 1), "kinds": ("group.general",), "min_margin": 1e-2}
BARE = {"friction": False, "springs": False, "loads": False, "masses": False}
TRIADS = Options(sizes=((4, 0),), **PLAIN, **BARE)
BIGGER = Options(sizes=((6, 0), (3, 1), (4, 2), (5, 1)), **PLAIN, **BARE)


class Followed:
    """A random group and the march of the judge's system from its home."""

    def __init__(self, seed, options):
        case = random_mechanism(Seeded(seed), options)
        self.mech = case.graph.compile()
        self.drivers = self.mech.drivers
        self.home = np.array([case.request["at"][d] for d in self.drivers])
        several = len(self.drivers) > 1
        self.line = np.random.default_rng(seed).normal(size=len(self.home)) if several else [1.0]
        twin = Twin(self.mech)
        poses = twin._guess(self.home)
        coordinates = twin._coordinates(self.home, poses)
        self.march = March(twin.system, poses, coordinates, self.line)
        self.links = list(twin.system.links)

    def run(self, shares, want=("*.p", "*.angle", "*.margin"), **options):
        """blockmech at shares of the line."""
        q = self.home + np.multiply.outer(shares, self.line)
        at = {d: q[:, k] for k, d in enumerate(self.drivers)}
        return self.mech.run(at=at, want=list(want), on_gap="mark", **options)

    def compared(self, way):
        """Worst error of the poses on one side of home over the root of the margin, and the end."""
        points, end = self.march.points(way, TURN)
        run = self.run([p.t for p in points])
        assert set(run.quality.status) == {"ok"}
        margin = np.sqrt(np.min(list(run.quality.margin.values()), axis=0))
        worst = 0.0
        for k, link in enumerate(self.links):
            place = np.array([complex(*p.poses[k, :2]) for p in points])
            angle = np.array([p.poses[k, 2] for p in points])
            far = np.abs(run[f"{link}.p"] - place) / self.march.size
            off = np.abs(np.exp(1j * (run[f"{link}.angle"] - angle)) - 1)
            worst = max(worst, (np.maximum(far, off) * margin).max())
        return worst, end


@functools.cache
def followed(seed, options):
    return Followed(seed, options)


@pytest.mark.parametrize("way", [1, -1], ids=["up", "down"])
@pytest.mark.parametrize(
    ("options", "seeds"),
    [(TRIADS, range(EXAMPLES)), (BIGGER, range(EXAMPLES // 2))],
    ids=["four links", "others"],
)
def test_home_mode_is_reproduced_over_the_whole_arc(options, seeds, way):
    ends = []
    for seed in seeds:
        case = followed(seed, options)
        worst, end = case.compared(way)
        assert worst <= POSES, f"seed {seed}: off by {worst:.2g}"
        if end is None:
            continue
        ends.append(seed)
        # Just inside there is an answer, just outside there is none, and that is said.
        run = case.run([end - way * ENDS, end + way * ENDS], want=["*.margin", "*.p"])
        assert run.quality.status == ("ok", "no-assembly"), f"seed {seed}"
        assert {(f.sample, f.code) for f in run.quality.flags} >= {(1, "path-ended")}
    assert len(ends) >= len(seeds) // 5


@pytest.mark.parametrize("seed", range(3))
def test_margin_is_linear_near_the_end_of_an_arc(seed):
    case = next(c for c in _ending(seed) if c)
    (mech, driver, end, way) = case
    near = np.array([1e-4, 1e-5, 1e-6, 1e-7])
    margins = mech.run(at={driver: end - way * near}, want="*.margin").quality.margin
    (margin,) = margins.values()
    slope = margin / near
    # The next term of the margin is of the order of the distance itself.
    assert np.abs(slope[1:] / slope[:-1] - 1).max() <= 100 * near[0]
    beyond = mech.run(at={driver: end + way * near}, want="*.margin", on_gap="mark").quality.margin
    (margin,) = beyond.values()
    assert (np.diff(margin) > 0).all()
    assert (margin < 0).all()


def _ending(seed):
    for more in range(20):
        case = followed(3 * more + seed, TRIADS)
        _, end = case.march.points(1, TURN)
        if end is not None:
            yield case.mech, case.drivers[0], case.home[0] + end, 1
    yield None


# -- a sample alone decides --------------------------------------------------------------

WANT = ["*.p", "*.angle", "*.alpha", "*.reaction", "*.drive", "*.margin"]


def samples(make, n, seed=0):
    chance = np.random.default_rng(seed)
    return {d: q + make.span[d] * chance.uniform(-1.0, 1.0, n) for d, q in make.home.items()}


def run_alone(make, at, **options):
    """A mechanism made anew, so that nobody has asked its path before."""
    mech = make().compile()
    return mech.run(at=at, **moving(mech), want=WANT, on_gap="mark", **options)


def moving(mech):
    """Rates and accelerations of all drivers."""
    drivers = mech.drivers
    return {"rates": dict.fromkeys(drivers, 1.0), "accelerations": dict.fromkeys(drivers, 0.3)}


def assert_same_bits(a, b, samples=slice(None)):
    for name in a:
        assert np.array_equal(a[name][samples], b[name], equal_nan=True), name


MACHINES = pytest.mark.parametrize("make", [triad, two_drivers], ids=["triad", "two drivers"])


@MACHINES
def test_answers_do_not_depend_on_order_batch_or_chunk(make):
    at = samples(make, 9)
    whole = run_alone(make, at, engine="numpy")
    assert 3 <= whole.quality.status.count("ok") <= 8  # some behind the end as well
    mixed = np.random.default_rng(1).permutation(9)
    other = {d: q[mixed] for d, q in at.items()}
    assert_same_bits(whole, run_alone(make, other, engine="numpy", chunk=4), mixed)
    one = {d: q[[5]] for d, q in at.items()}
    assert_same_bits(whole, run_alone(make, one, engine="numpy"), [5])


@MACHINES
def test_a_last_step_known_to_be_safe_by_a_bound_arrives_where_the_exact_value_has_it(
    make, monkeypatch
):
    assert 2 * homotopy.CHANGE / (1 + homotopy.CHANGE) >= tracking.CALM
    at = samples(make, 60)
    bounded = run_alone(make, at, engine="numpy")
    monkeypatch.setattr(tracking, "CALM", 0.0)
    assert_same_bits(bounded, run_alone(make, at, engine="numpy"))


# -- turns --------------------------------------------------------------------------------


@ENGINES
def test_further_turns_are_the_first_one(engine):
    mech = platform(crank=0.3).compile()
    q = np.linspace(-3.0, 3.0, 13)
    want = ["*.p", "*.margin"]
    first = mech.run(at=q, want=want, engine=engine)
    for turns in (1, -1, 7, -30):
        again = mech.run(at=q + turns * TURN, want=want, engine=engine)
        for name in first:
            # The sample itself is rounded: a few ulps of the angle, by a lever of order one.
            allowed = 100 * np.spacing(abs(turns) * TURN + 3.0)
            assert np.abs(first[name] - again[name]).max() <= allowed, name
    assert mech.limits().whole_turn


def parallelograms(excess, copies, general, q0=0.9):
    """Dyads on one crank that nearly fold at q = 0; together or each for itself."""
    graph = bm.Graph("near", gravity=(0.0, 0.0))
    pivots = {f"D{k}": (2.0 + k, 0.0) for k in range(copies)}
    graph.add("frame", bm.Frame(markers={"O": (0.0, 0.0), **pivots}))
    graph.add("crank", bm.Crank(length=1.0))
    graph.connect("frame.O", "crank.A")
    links, pairs, poses = {}, {}, {}
    for k in range(copies):
        dyad = bm.RRR(l_i=2.0 + k + excess, l_j=1.0)
        if not general:
            graph.add(f"d{k}", dyad)
            wire(graph, f"crank.B d{k}.B", f"frame.D{k} d{k}.D")
            continue
        pose = dyad.kernels.position(cmath.exp(1j * q0), complex(2.0 + k), dyad.parameters())
        for name, link in (("i", pose.i), ("j", pose.j)):
            links[f"{name}{k}"] = bm.Link()
            poses[f"{name}{k}"] = (link.o.real, link.o.imag, cmath.phase(link.e))
        pairs[f"B{k}"] = {"type": "R", "link": f"i{k}"}
        inner = (f"i{k}", f"j{k}")
        pairs[f"C{k}"] = {"type": "R", "links": inner, "at": ((dyad.l_i, 0.0), (1.0, 0.0))}
        pairs[f"D{k}"] = {"type": "R", "link": f"j{k}"}
    if general:
        home = {"drivers": {"crank": q0}, "poses": poses}
        graph.add("d", bm.GeneralGroup(links=links, pairs=pairs, home=home))
        for k in range(copies):
            wire(graph, f"crank.B d.B{k}", f"frame.D{k} d.D{k}")
    return graph.compile()


@pytest.mark.parametrize("excess", [1e-1, 1e-3, 1e-6, 1e-10])
@pytest.mark.parametrize("copies", [1, 2, 3])
def test_mode_that_comes_near_is_not_taken(copies, excess):
    # Two groups that come near at once keep the sign of the determinant: it is no witness.
    q = np.linspace(0.02, TURN - 0.02, 60)
    shut = np.arccos(1 - excess * (2.0 + excess / 2)) if excess < 0.5 else 0.0  # of copy 0
    q = q[(q > 2 * shut) & (q < TURN - 2 * shut)]
    expected = parallelograms(excess, copies, general=False).run(at=q, want="*.j.angle")
    result = parallelograms(excess, copies, general=True).run(at=q, want=["*.angle", "*.margin"])
    root = np.sqrt(result.quality.margin["d"])
    for k in range(copies):
        turn = np.exp(1j * (expected[f"d{k}.j.angle"] - result[f"d.j{k}.angle"])) - 1
        assert (np.abs(turn) * root).max() <= POSES


@pytest.mark.parametrize("near", [1e-2, 1e-5, 1e-8])
def test_home_may_be_near_a_dead_centre(near):
    far = Followed(0, TRIADS)
    _, end = far.march.points(1, TURN)
    (block,) = (b for b in far.mech.structure.blocks.values() if b.own_form)
    q0 = far.home[0] + end - near
    at_home = far.mech.run(at=q0, want=["*.p", "*.angle"])
    (name,) = (n for n, b in far.mech.structure.blocks.items() if b is block)
    poses = {
        link: (
            at_home[f"{name}.{link}.p"][0].real,
            at_home[f"{name}.{link}.p"][0].imag,
            float(at_home[f"{name}.{link}.angle"][0]),
        )
        for link in block.link_names
    }
    graph = random_mechanism(Seeded(0), TRIADS).graph
    home = block.home.model_copy(update={"drivers": {far.drivers[0]: q0}, "poses": poses})
    graph.blocks[name] = block.model_copy(update={"home": home})
    q = far.home[0] + np.linspace(0.0, end - near, 20)
    a, b = (m.run(at=q, want=["*.p", "*.margin"]) for m in (far.mech, graph.compile()))
    root = np.sqrt(a.quality.margin[name])
    for link in block.link_names:
        off = np.abs(a[f"{name}.{link}.p"] - b[f"{name}.{link}.p"]) / far.march.size
        assert (off * root).max() <= POSES


def test_a_message_says_how_far_a_path_came():
    mech, arc = triad_and_arc()
    for q, end in ((arc.end.q + 0.3, arc.end.q), (arc.start.q - 0.3, arc.start.q)):
        with pytest.raises(bm.AssemblyError) as refused:
            mech.run(at=q, rates=1.0, accelerations=0.0, want="platform.plate.angle")
        assert f"followed from its home it comes as far as crank = {end:.9g} rad" in str(
            refused.value
        )


def test_a_pose_that_is_asked_for_again_has_the_same_answer():
    """The answer asked for last is kept; of a group that nothing moves it is that of its home."""
    mechanism = two_drivers().compile()
    (name,) = homotopy.followed(mechanism.structure)
    path = homotopy.Path(mechanism.structure, name)
    home = tuple(path.home.tolist())
    first, second, again = (path(q) for q in (home, tuple(x + 0.01 for x in home), home))
    assert again == first != second
    unmoved = homotopy.Path(mechanism.structure, name)
    assert unmoved.at_home.frames.size
    unmoved.drivers = ()
    assert np.allclose(unmoved(())[0], first[0], rtol=0.0, atol=1e-13)
    assert unmoved(()) == unmoved(())
