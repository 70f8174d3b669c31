"""Play of places by clearance in pins, against massless links, and against runs of unit loads."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import blockmech as bm
from tests.independent import loose
from tests.independent.loose import Body
from tests.machines import wire

PLACES = np.array([0.4, 1.7, 2.9, 4.1, 5.6])
CLEARANCE = {"A": 3e-5, "B": 1e-5, "C": 4e-5, "D": 2e-5}
BODIES = (
    Body(2.0, 0.02, 0.5 + 0.03j, 1.0 + 0j),
    Body(3.0, 0.5, 1.5 + 0.1j, 1.7 + 0.6j),
    Body(2.0, 0.3, 1.2 - 0.1j, 0.4 - 0.3j),
)


def link_of(body: Body) -> bm.Link:
    """The link of a body, with its marker M."""
    return bm.Link(mass=body.mass, inertia=body.inertia, cm=body.cm, markers={"M": body.M})


def mechanism(kind, clearance=CLEARANCE, friction=None, at="dyad.Mj"):
    """A four-bar or a slider-crank with a force at the last link's M."""
    crank, i, j = (link_of(body) for body in BODIES)
    j = j.model_copy(update={"markers": {"Mj": j.markers["M"]}})
    g = bm.Graph(kind, gravity=(0.0, -9.81))
    markers = {"O": (0.0, 0.0), "Q": (4.0, 0.0), "G": bm.Marker(at=(0.0, 0.3), angle=0.0)}
    g.add("frame", bm.Frame(markers=markers))
    loose_at = {k: {p: clearance[p] for p in pins if p in clearance} for k, pins in PINS[kind]}
    rubbing = {"friction": friction} if friction else {}
    g.add("crank", bm.Crank(length=1.0, links={"crank": crank}, clearance=loose_at["crank"]))
    fields = {"links": {"i": i, "j": j}, "clearance": loose_at["dyad"], **rubbing}
    if kind == "four_bar":
        g.add("dyad", bm.RRR(l_i=3.5, l_j=2.5, **fields))
        g.connect("frame.Q", "dyad.D")
    else:
        g.add("dyad", bm.RRP(l=3.5, **fields))
        g.connect("frame.G", "dyad.S")
    wire(g, "frame.O crank.A", "crank.B dyad.B")
    g.add("push", bm.Force(force=(-60.0, 25.0)))
    g.connect(at, "push.at")
    return g


PINS = {
    "four_bar": (("crank", "A"), ("dyad", "BCD")),
    "slider_crank": (("crank", "A"), ("dyad", "BC")),
}
CLOSED = {
    "four_bar": loose.four_bar(1.0, 3.5, 2.5, 4.0),
    "slider_crank": loose.slider_crank(1.0, 3.5, 0.3),
}


@pytest.mark.parametrize("rate", [0.0, 6.0])
@pytest.mark.parametrize("kind", CLOSED)
def test_play_is_that_of_massless_links_that_are_put_in(kind, rate):
    gaps = tuple(CLEARANCE[pin] for _, pins in PINS[kind] for pin in pins)
    want = ["crank.M.play", "dyad.M.play", "dyad.Mj.play"]
    run = mechanism(kind).run(at=PLACES, rates=rate, want=want)
    for k, q in enumerate(PLACES):
        expected = loose.play(CLOSED[kind], BODIES, gaps, q, rate, (2, -60.0 + 25.0j))
        mine = np.array([run[name][k] for name in want])
        assert abs(mine - expected).max() <= 1e-9 * sum(gaps)


def test_a_pendulum_hangs_lower_by_its_clearance():
    g = bm.Graph("pendulum", gravity=(0.0, -9.81))
    g.add("frame", bm.Frame(markers={"O": (0.0, 0.0)}))
    arm = bm.Link(mass=2.0, cm=(1.0, 0.0))
    g.add("arm", bm.Crank(length=1.0, links={"crank": arm}, clearance={"A": 2e-4}))
    g.connect("frame.O", "arm.A")
    run = g.run(at=[-1.2, 0.7], static=True, want=["arm.B.play", "arm.B.play_bound"])
    assert run["arm.B.play"] == pytest.approx(-2e-4j, abs=1e-18)
    assert run["arm.B.play_bound"] == pytest.approx(2e-4 + 2e-4j, abs=1e-18)


def test_play_of_general_groups_and_gears_is_that_of_runs_under_unit_loads(graph_with_clearance):
    mechanism, bare, marker, pins = graph_with_clearance
    at = samples_of(mechanism)
    names = [f"{pin}.reaction" for pin in pins]
    run = mechanism.run(at=at, want=[f"{marker}.play", f"{marker}.play_bound", *names])
    parts, bounds = [], []
    for force in ((1.0, 0.0), (0.0, 1.0)):
        unit = bare(force).run(at=at, static=True, friction="none", want=names)
        rows = [(c, unit[f"{p}.reaction"], run[f"{p}.reaction"]) for p, c in pins.items()]
        parts.append(sum(c * (e * np.conj(R)).real / abs(R) for c, e, R in rows))
        bounds.append(sum(c * abs(e) for c, e, _ in rows))
    size = 1e-10 * np.nanmax(np.abs(bounds))
    assert run[f"{marker}.play"] == pytest.approx(parts[0] + 1j * parts[1], abs=size, nan_ok=True)
    bound = bounds[0] + 1j * bounds[1]
    assert run[f"{marker}.play_bound"] == pytest.approx(bound, abs=size, nan_ok=True)
    assert np.isfinite(run[f"{marker}.play"]).any()


GRAPHS = Path(__file__).resolve().parents[2] / "graphs"
CASES = ("stephenson_3_triad", "geared_fivebar", "ruiz_fourbar", "watt_sixbar", "planetary_hoist")


@pytest.fixture(params=CASES)
def graph_with_clearance(request):
    """A graph of the gallery with clearance in every pin, and the same under a unit load alone."""
    path = GRAPHS / f"{request.param}.json"
    data = json.loads(path.read_text(encoding="utf-8"))
    for block in data["blocks"].values():
        block.pop("pressure_angle", None)  # with it no unit load tells where teeth lean
    graph = bm.Graph.load(path)
    structure = graph.compile().structure
    pins = {}
    for name, block in structure.blocks.items():
        for joint in block.joints.values():
            if joint.rotary:
                data["blocks"][name].setdefault("clearance", {})[joint.name] = 1e-5
                pins[f"{name}.{joint.name}"] = 1e-5
    last = list(structure.blocks)[-1]
    marker = str(structure.markers(last)[-1])
    upstream = structure.ancestors(last)
    pins = {p: c for p, c in pins.items() if p.split(".")[0] in upstream}

    def bare(force):
        document = json.loads(json.dumps(data))
        bared(document, structure, marker, force)
        return bm.Graph.from_json(json.dumps(document)).compile()

    data.pop("expect", None)
    return bm.Graph.from_json(json.dumps(data)).compile(), bare, marker, pins


def bared(data, structure, marker, force):
    """Take all loads and masses out of a graph's data, and put a force at a marker in."""
    elements = set(structure.elements)
    data["blocks"] = {k: b for k, b in data["blocks"].items() if k not in elements}
    data["wires"] = [w for w in data["wires"] if w["to"].split(".")[0] not in elements]
    data.get("scene", {}).pop("gravity", None)
    data.pop("expect", None)
    for block in data["blocks"].values():
        for link in block.get("links", {}).values():
            for key in ("mass", "inertia", "cm"):
                link.pop(key, None)
    data["blocks"]["unit_load"] = {"type": "load.force", "force": list(force)}
    data["wires"].append({"from": marker, "to": "unit_load.at"})


def samples_of(mechanism):
    """Some places of every driver, near its first one."""
    run = mechanism.run(samples=9, want=[f"{d}.q" for d in mechanism.drivers])
    return {d: run[f"{d}.q"] for d in mechanism.drivers}


@pytest.mark.parametrize("name", ["geared_fivebar", "planetary_hoist"])
@pytest.mark.parametrize("direction", [0.3, 2.2, 4.0])
def test_teeth_lean_as_the_loads_that_there_are_press_them(name, direction):
    """Under one force alone its place gives way to it by c |R| / F in each pin."""
    data = json.loads((GRAPHS / f"{name}.json").read_text(encoding="utf-8"))
    gears = [block for block in data["blocks"].values() if block["type"] == "coupling.gear"]
    assert gears
    for gear in gears:
        gear["pressure_angle"] = 0.35
    structure = bm.Graph.load(GRAPHS / f"{name}.json").compile().structure
    force = 40.0 * np.exp(1j * direction)
    last = list(structure.blocks)[-1]
    marker = str(structure.markers(last)[-1])
    bared(data, structure, marker, (force.real, force.imag))
    pins = [f"{block}.A" for block in structure.blocks if "A" in structure.blocks[block].joints]
    for pin in pins:
        data["blocks"][pin.split(".")[0]]["clearance"] = {"A": 2e-5}
    mechanism = bm.Graph.from_json(json.dumps(data)).compile()
    names = [f"{pin}.reaction" for pin in pins]
    at = samples_of(mechanism)
    run = mechanism.run(at=at, static=True, friction="none", want=[f"{marker}.play", *names])
    component = (run[f"{marker}.play"] * force.conjugate()).real / abs(force)
    pressed = sum(2e-5 * abs(run[r]) for r in names) / abs(force)
    assert pressed.max() > 1e-6
    assert component == pytest.approx(pressed, rel=1e-10)


def test_friction_turns_the_reactions_and_with_them_the_journals():
    pin = bm.friction.Coulomb(coefficient=0.2, radius=0.2)
    rough = mechanism("four_bar", friction={"B": pin, "C": pin, "D": pin})
    want = ["dyad.M.play", "dyad.M.play_bound"]
    with_friction = rough.run(at=PLACES, rates=1.0, want=want)
    without = rough.run(at=PLACES, rates=1.0, want=want, friction="none")
    assert abs(with_friction["dyad.M.play"] - without["dyad.M.play"]).max() > 1e-7
    assert (with_friction["dyad.M.play_bound"] == without["dyad.M.play_bound"]).all()


def test_without_the_key_nothing_moves():
    pin = {"B": bm.friction.Coulomb(coefficient=0.1, radius=0.05)}
    loose_one, tight = (mechanism("four_bar", c, pin).compile() for c in (CLEARANCE, {}))
    assert not [name for name in tight.outputs if "play" in name]
    assert [n for n in loose_one.outputs if "play" not in n] == list(tight.outputs)
    want = ["*.reaction", "crank.drive", "dyad.M.*"]
    plan, loose_plan = (
        m.plan([n for n in m.plan(want).want if "play" not in n]) for m in (tight, loose_one)
    )
    assert plan.explain() == loose_plan.explain()
    rigid, playing = (m.run(at=PLACES, rates=3.0, want=plan.want) for m in (tight, loose_one))
    assert all((rigid[name] == playing[name]).all() for name in plan.want)
    assert rigid.quality.flags == tuple(
        f for f in playing.quality.flags if f.code != "reaction-reversal"
    )


def test_play_has_derivatives_by_clearance_and_lengths():
    g = mechanism("four_bar").compile()
    to, h = ["dyad.clearance.C", "dyad.l_i"], {"dyad.clearance.C": 1e-6, "dyad.l_i": 1e-5}
    sensitivity = g.sensitivity(["dyad.M.play.x"], to=to, at=PLACES)
    for address in to:
        value = {"dyad.clearance.C": CLEARANCE["C"], "dyad.l_i": 3.5}[address]

        def play(by, address=address, value=value):
            varied = mechanism("four_bar").replace({address: value + by * h[address]})
            return varied.run(at=PLACES, want="dyad.M.play.x")["dyad.M.play.x"]

        quotient = (play(1) - play(-1)) / (2 * h[address])
        assert sensitivity["dyad.M.play.x", address] == pytest.approx(quotient, rel=1e-6, abs=1e-10)


def test_a_reaction_that_turns_between_samples_is_flagged_at_its_smaller_one():
    g = mechanism("four_bar").compile()
    run = g.run(at=np.linspace(0.0, 6.28, 15), rates=4.0, want="dyad.*.reaction")
    flagged = {(f.sample, f.where) for f in run.quality.flags if f.code == "reaction-reversal"}
    assert flagged
    for joint in "BCD":
        R = run[f"dyad.{joint}.reaction"]
        turned = [k for k in range(14) if (R[k + 1] * R[k].conjugate()).real <= 0]
        smaller = {(k if abs(R[k]) <= abs(R[k + 1]) else k + 1, f"dyad.{joint}") for k in turned}
        assert smaller == {f for f in flagged if f[1] == f"dyad.{joint}"}


def test_a_journal_that_nothing_loads_counts_as_centred_and_is_flagged():
    g = bm.Graph("idle")
    g.add("frame", bm.Frame(markers={"O": (0.0, 0.0)}))
    g.add("arm", bm.Crank(length=1.0, clearance={"A": 2e-4}))
    g.connect("frame.O", "arm.A")
    run = g.run(at=[0.0, 1.0], want=["arm.B.play", "arm.B.play_bound"])
    assert (run["arm.B.play"] == 0).all()
    assert run["arm.B.play_bound"] == pytest.approx(2e-4 + 2e-4j)
    assert [(f.sample, f.code, f.where) for f in run.quality.flags] == [
        (0, "reaction-reversal", "arm.A"),
        (1, "reaction-reversal", "arm.A"),
    ]


def test_links_and_joints_have_clearance_too(tmp_path):
    linkage = bm.Linkage("four_bar", gravity=(0.0, -9.81))
    linkage.add_link("crank", mass=2.0, pose=(0.0, 0.0, 0.0))
    linkage.add_link("rod", mass=3.0, cm=(1.5, 0.1), markers={"M": (1.7, 0.6)})
    linkage.add_link("rocker", mass=2.0)
    linkage.add_joint("A", "R", ["frame", "crank"], point=(0.0, 0.0), clearance=3e-5)
    linkage.add_joint("B", "R", ["crank", "rod"], point=(0.6, 0.8), clearance=1e-5)
    linkage.add_joint("C", "R", ["rod", "rocker"], point=(3.8, 2.2), clearance=4e-5)
    linkage.add_joint("D", "R", ["frame", "rocker"], point=(4.0, 0.0))
    linkage.add_driver("motor", "A")
    path = tmp_path / "four_bar.json"
    linkage.save(path)
    result = json.loads(path.read_text(encoding="utf-8"))["joints"]
    assert [joint.get("clearance") for joint in result.values()] == [3e-5, 1e-5, 4e-5, None]
    mechanism = bm.Linkage.load(path).compile()
    assert {p for p in mechanism.parameters() if "clearance" in p} == {
        f"joints.{name}.clearance" for name in "ABC"
    }
    run = mechanism.run(at=[0.0, 0.2], want=["link.rod.M.play", "link.rod.M.play_bound"])
    play, bound = run["link.rod.M.play"], run["link.rod.M.play_bound"]
    assert (abs(play) > 1e-6).all()
    assert (abs(play.real) <= bound.real).all()
    assert (abs(play.imag) <= bound.imag).all()
