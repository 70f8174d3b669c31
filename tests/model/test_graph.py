"""Wiring: what is locally wrong is refused at once, `check` finds all the rest together."""

import math
from pathlib import Path

import networkx as nx
import pytest

import blockmech as bm
from blockmech.ground.values import Marker
from blockmech.model.diagram import UnknownBlock, Wire
from tests.machines import ruiz, toggle, watt, wire

GRAPHS = Path(__file__).parents[2] / "graphs"


def fourbar():
    """Blocks of a four-bar, not yet wired."""
    g = bm.Graph("fourbar")
    g.add("frame", bm.Frame(markers={"A": (0.0, 0.0), "D": (5.5, 0.0)}))
    g.add("crank", bm.Crank(length=2.0))
    g.add("dyad", bm.RRR(l_i=6.0, l_j=3.0))
    return g


def wired(g=None):
    return wire(g or fourbar(), "frame.A crank.A", "crank.B dyad.B", "frame.D dyad.D")


def ring(x, y):
    """Two dyads that wait for each other: a.D on a marker of b, b.B on a marker of a."""
    g = bm.Graph("ring")
    g.add("frame", bm.Frame(markers={"A": (0.0, 0.0), "D": (1.0, 0.0)}))
    links = {"i": bm.Link(markers={"E": (0.3, 0.4)}), "j": bm.Link(markers={"F": (0.2, 0.5)})}
    g.add("a", bm.RRR(l_i=1.0, l_j=1.0, links=links))
    g.add("b", bm.RRR(l_i=1.0, l_j=1.0, links=links))
    return wire(g, "frame.A a.B", f"b.{x} a.D", f"a.{y} b.B", "frame.D b.D")


# ---- golden text of every problem --------------------------------------------------------


def with_block(name, block):
    g = wired()
    g.add(name, block)
    return g


def with_wires(*wires):
    g = wired()
    g.wires += [Wire(*text.split()) for text in wires]
    return g


PROBLEMS = {
    "joint of a block without joints": (
        lambda: with_wires("crank.B frame.A"),
        ['[unknown-joint] frame.A: no joint "A". it takes no wires.'],
    ),
    "a group of class III": (
        lambda: ring("E", "E"),
        [
            "[cycle] a, b: the blocks depend on each other: b.E -> a.D, a.E -> b.B; a.i, a.j, b.i, "
            "b.j are one Assur group of class III with 4 links and 6 pairs. a formation sequence "
            "feeds every joint from an earlier block. replace a, b by one group.general block of "
            "class III, or re-wire a joint to a link that already moves."
        ],
    ),
}


def tangled():
    """Four links and six pairs, two of which hold one link where another one is loose."""
    g = bm.Graph("tangled")
    g.add("frame", bm.Frame(markers={n: (float(k), 0.0) for k, n in enumerate("ABC")}))
    legs = {f"leg{k}": {} for k in range(3)}
    tips = {
        f"C{k}": {"type": "R", "links": [f"leg{k}", "plate"], "at": [(1, 0), (k, 0)]}
        for k in range(3)
    }
    feet = {f"G{k}": {"type": "R", "link": link} for k, link in enumerate(["leg0", "leg0", "leg2"])}
    home = {"drivers": {}, "poses": dict.fromkeys([*legs, "plate"], (0.0, 0.0, 0.0))}
    group = bm.GeneralGroup(links={**legs, "plate": {}}, pairs={**tips, **feet}, home=home)
    g.add("group", group)
    for marker, joint in zip("ABC", feet, strict=True):
        g.connect(f"frame.{marker}", f"group.{joint}")
    return g


def misnamed():
    """A link between two pins of the frame, its sliding driven by a name that is taken."""
    g = bm.Graph()
    g.add("frame", bm.Frame(markers={"A": (0, 0), "B": (1, 0)}))
    pairs = {
        "A": {"type": "R", "link": "barrel"},
        "S": {"type": "P", "links": ["barrel", "rod"], "at": [(0, 0), (0, 0)]},
        "C": {"type": "R", "links": ["rod", "arm"], "at": [(0, 0), (1, 0)]},
        "B": {"type": "R", "link": "arm"},
    }
    pairs["S"] |= {"driven": True, "driver": "frame"}
    poses = {"barrel": (0, 0, 1.0), "rod": (0, 0, 1.0), "arm": (1, 0, 2.0)}
    home = {"drivers": {"frame": 1.0}, "poses": poses}
    g.add("lift", bm.GeneralGroup(links={link: {} for link in poses}, pairs=pairs, home=home))
    for marker in "AB":
        g.connect(f"frame.{marker}", f"lift.{marker}")
    return g


MOVE_A_PAIR = "move a pair from an over-constrained link to a loose one."
PROBLEMS |= {
    "a general group that is none": (
        tangled,
        [
            "[over-constrained] group.pairs: leg0, the supports are over-constrained: their pairs "
            f"G0, G1 hold them once too often. {MOVE_A_PAIR}",
            "[too-few-drivers] group.pairs: mobility 1, drivers 0: 1 driver too few. "
            f"{MOVE_A_PAIR}",
            "[loose-links] group.pairs: leg1 can still move with every driver held: 1 degree of "
            "freedom. "
            f"{MOVE_A_PAIR}",
        ],
    ),
    "a driver called like a block": (
        misnamed,
        ['[taken-name] lift.pairs.S.driver: "frame" is taken. choose another name.'],
    ),
}


@pytest.mark.parametrize("name", PROBLEMS)
def test_check_says_what_is_wrong_and_what_to_do_and_nothing_compiles(name):
    make, texts = PROBLEMS[name]
    assert [str(p) for p in make().check()] == texts
    with pytest.raises(bm.GraphError) as caught:
        make().compile()
    assert str(caught.value) == "\n".join(texts)
    assert "not complete: see check()" in repr(make())


def test_unknown_block_is_kept_and_refused_by_name():
    g = with_block("geneva", UnknownBlock("geneva.rod", {"type": "geneva.rod", "pins": 4}))
    (problem,) = g.check()
    assert (problem.code, problem.where) == ("unknown-block", "geneva")
    assert problem.found == 'no block type "geneva.rod"'
    assert problem.valid.startswith("known types: ")
    assert "dyad.rrr" in problem.valid
    assert problem.remedy == "import the file that defines it, or install its package"
    misspelt = with_block("d", UnknownBlock("dyad.rrrr", {}))
    assert misspelt.check()[0].remedy == 'did you mean "dyad.rrr"?'


def test_element_that_follows_a_driver_needs_one():
    law = bm.laws.Polynomial(coefficients=[0.0, 5.0])
    g = with_block("gas", bm.Thrust(law=law, driver="crnak"))
    wire(g, "frame.A gas.a", "dyad.C gas.b")
    assert [str(p) for p in g.check()] == [
        '[unknown-driver] gas.driver: no driver "crnak". drivers: crank. did you mean "crank"?'
    ]


def test_all_problems_come_at_once():
    g = fourbar()
    g.add("ground", bm.Frame())
    g.add("push", bm.Force(force=(1.0, 0.0)))
    g.wires += [Wire("frame.A", "dyad.X"), Wire("frame.Q", "crank.A")]
    g.drive("motor", bm.motion.ConstantRate(rate=1.0))
    result = [(p.code, p.where) for p in g.check()]
    assert result == [
        ("two-frames", "ground"),
        ("unknown-joint", "dyad.X"),
        ("unknown-marker", "frame.Q"),
        ("unwired-joint", "dyad.B"),
        ("unwired-joint", "dyad.D"),
        ("unwired-joint", "push.at"),
        ("unknown-driver", "scene.drive.motor"),
    ]


def test_cycle_with_a_broken_address_is_still_told():
    g = ring("E", "E")
    g.wires[1] = Wire("b.i.E", "a.D")
    assert [p.code for p in g.check()] == ["bad-address", "cycle"]
    g.wires[1] = Wire("b.nothing", "a.D")
    assert [p.code for p in g.check()] == ["unknown-marker", "cycle"]


def test_links_between_the_same_two_pins_are_no_group():
    # a.j and b.i both reach from pin a.C to pin b.C: one of them is too many
    (problem,) = ring("C", "C").check()
    assert "do not form an Assur group" in problem.found
    assert "over-constrained: a.j, b.i" in problem.found


# ---- refused at once ---------------------------------------------------------------------


@pytest.mark.parametrize(
    ("source", "target", "code"),
    [
        ("frame.X", "crank.A", "unknown-marker"),
        ("frame.A", "crank.B", "unknown-joint"),
        ("frame.A", "dyad.C", "unknown-joint"),
        ("frame.A", "dyad.D", "double-wire"),
        ("dyad.C", "dyad.B", "self-wire"),
        ("frame.A", "dyad", "bad-address"),
        ("", "crank.A", "bad-address"),
        ("frame.", "crank.A", "bad-address"),
        ("nobody.A", "crank.A", "no-such-block"),
    ],
)
def test_locally_wrong_wire_is_refused_and_not_kept(source, target, code):
    g = fourbar()
    g.connect("frame.D", "dyad.D")
    before = list(g.wires)
    with pytest.raises(bm.GraphError) as caught:
        g.connect(source, target)
    assert code in [p.code for p in caught.value.problems]
    assert g.wires == before


@pytest.mark.parametrize("name", ["", "a.b", "a/b", 3, None])
def test_bad_name_is_refused(name):
    with pytest.raises(bm.GraphError) as caught:
        fourbar().add(name, bm.Frame())
    (problem,) = caught.value.problems
    assert problem.code == "bad-name"
    assert problem.valid == 'a name is not empty and has no "." or "/"'


@pytest.mark.parametrize("thing", [bm.Crank, 3, None])
def test_what_is_no_block_and_a_taken_name_are_refused(thing):
    with pytest.raises(bm.GraphError, match="not-a-block"):
        fourbar().add("x", thing)
    with pytest.raises(bm.GraphError, match=r"\[duplicate-block\] crank: the name is taken"):
        fourbar().add("crank", thing)


def test_a_block_named_like_the_outputs_of_the_whole_is_refused():
    graph = fourbar()
    graph.add("mechanism", bm.Crank(length=1.0))
    (problem,) = (problem for problem in graph.check() if problem.code == "taken-name")
    assert problem.where == "mechanism"
    assert problem.found == 'outputs of the whole begin with "mechanism."'


@pytest.mark.parametrize("law", [5, 10.0, "constant_rate", None, bm.motion.ConstantRate])
def test_what_is_no_law_of_motion_is_refused(law):
    with pytest.raises(bm.GraphError, match=r"\[not-a-law\] scene.drive.crank"):
        fourbar().drive("crank", law)


# ---- remarks -----------------------------------------------------------------------------


def test_unused_and_unreachable_things_are_remarks_not_problems():
    g = wired()
    g.blocks["frame"] = bm.Frame(markers={"A": (0, 0), "D": (5.5, 0), "spare": (1, 1)})
    g.add("idle", bm.Crank(length=1.0))
    g.connect("frame.A", "idle.A")
    assert g.check() == []
    assert [str(p) for p in g.remarks()] == [
        "[unused-marker] frame.spare: no wire starts there.",
        "[idle-driver] idle: it moves nothing and carries no load.",
    ]


def test_block_off_the_frame_is_remarked():
    g = wired()
    g.add("lost", bm.Crank(length=1.0))
    assert ("unreachable", "lost") in [(p.code, p.where) for p in g.remarks()]


@pytest.mark.parametrize("make", [ruiz, watt, toggle])
def test_good_mechanisms_have_no_remarks(make):
    assert make().check() == []
    assert make().remarks() == []


def test_heavy_driver_that_moves_nothing_is_no_idle_one():
    g = bm.Graph("pendulum", gravity=(0.0, -9.81))
    g.add("frame", bm.Frame(markers={"A": (0.0, 0.0)}))
    g.add("rod", bm.Crank(links={"crank": bm.Link(mass=1.0, cm=(0.5, 0.0))}))
    g.connect("frame.A", "rod.A")
    assert g.remarks() == []


# ---- repr, copies, editing ---------------------------------------------------------------


def test_repr_counts_links_pairs_and_mobility_and_shows_the_formula():
    assert repr(wired()) == (
        "<Graph fourbar: 3 moving links, 4 pairs, mobility 1; I(crank: 0,1) -> II RRR(dyad: 2,3)>"
    )
    assert repr(fourbar()) == "<Graph fourbar: 3 blocks, not complete: see check()>"
    assert repr(wired().compile()) == repr(wired()).replace("Graph", "Mechanism")


def test_networkx_copy_has_blocks_and_wires_and_is_a_copy():
    g = ruiz()
    copy = g.to_networkx()
    assert isinstance(copy, nx.DiGraph)
    assert nx.is_directed_acyclic_graph(copy)
    assert set(copy) == set(g.blocks)
    assert copy.nodes["dyad"]["type"] == "dyad.rrr"
    assert copy.nodes["dyad"]["block"] is g.blocks["dyad"]
    assert copy.edges["crank", "dyad"]["wires"] == [("crank.B", "dyad.B")]
    assert copy.edges["dyad", "weightlike"]["wires"] == [("dyad.S", "weightlike.at")]
    copy.remove_node("dyad")
    copy.edges["frame", "crank"]["wires"].clear()
    assert "dyad" in g.blocks
    assert g.check() == []
    assert g.to_networkx().edges["frame", "crank"]["wires"] == [("frame.A", "crank.A")]


def test_compiling_takes_a_snapshot():
    g = ruiz()
    mech = g.compile()
    before = mech.run(at=1.0, want="crank.drive")["crank.drive"][0]
    g.blocks["couple"] = bm.Couple(moment=1e6)
    g.drive("crank", bm.motion.ConstantRate(rate=99.0))
    g.wires.pop()
    assert mech.run(at=1.0, want="crank.drive")["crank.drive"][0] == before
    assert [p.code for p in g.check()] == ["unwired-joint"]


def test_marker_has_one_direction_exact_for_vertical_guides():
    assert Marker(at=(0, 0), dir=(0, -7)).direction == -1j
    assert Marker(at=(0, 0)).direction == 1
    assert abs(Marker(at=(0, 0), angle=-math.pi / 2).direction + 1j) < 1e-16


# ---- multiple pins, drivers on moving links ----------------------------------------------


def test_marker_feeds_any_number_of_joints():
    g = wired()
    g.blocks["frame"] = bm.Frame(markers={"A": (0, 0), "D": (5.5, 0), "H": (3.0, 5.0)})
    g.add("third", bm.RRR(l_i=4.0, l_j=4.0))
    wire(g, "dyad.C third.B", "frame.H third.D")  # three links on one pin
    assert g.check() == []
    assert g.structure().pairs == 4 + 3
    r = g.run(at=1.0)
    assert r["third.B.p"][0] == r["dyad.C.p"][0]


def test_check_and_compile_find_the_same_in_a_home_that_does_not_close():
    graph = bm.Graph.load(GRAPHS / "stephenson_3_triad.json")
    data = graph.to_data()
    data["blocks"]["triad"]["home"]["poses"]["coupler"] = [5.0, 0.0, 0.0]
    graph = bm.Graph.from_data(data)
    assert [p.code for p in graph.check()] == ["bad-home"]
    with pytest.raises(bm.GraphError) as refused:
        graph.compile()
    assert list(refused.value.problems) == graph.check()
