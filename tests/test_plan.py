"""What a request costs: the kernel calls of the Watt six-bar, and that pruning changes no number.

The counts are those of the port contract for a crank and two RRR dyads: positions cost one
call a block, velocities and accelerations one more each, the force pass one call for every
block that carries a load; what nobody asks for costs nothing.
"""

import random

import networkx as nx
import numpy as np
import pytest

import blockmech as bm
from tests.machines import chain, ruiz, toggle, watt
from tests.wiring import rewired, same_bits


def calls(graph, *want, **settings):
    return graph.compile().plan(want, **settings).calls


def stages(graph, *want, **settings):
    plan = graph.compile().plan(want, **settings)
    return {s: plan.count(s) for s in {e.stage for e in plan.entries}}


# ---- kernel calls, all links massive, weight on ------------------------------------------

MASSIVE = [
    ("position of the first dyad", ["first.C.p"], 2),
    ("position of the last dyad", ["last.C.p"], 3),
    ("velocities of all", ["*.omega"], 6),
    ("accelerations of the first dyad", ["first.i.alpha", "first.j.alpha"], 6),
    ("accelerations of all", ["*.alpha"], 9),
    ("reactions of the last dyad", ["last.*.reaction"], 10),
    ("reactions of the first dyad", ["first.*.reaction"], 11),
    ("driving moment by reactions", ["crank.drive"], 12),
    ("driving moment by reduction", ["crank.drive_by_reduction"], 9),
    ("J_red alone", ["crank.J_red"], 6),
    ("tau_red alone", ["crank.tau_red"], 6),
]


@pytest.mark.parametrize(("want", "count"), [x[1:] for x in MASSIVE], ids=[x[0] for x in MASSIVE])
def test_kernel_calls_of_the_massive_sixbar(want, count):
    assert calls(watt(), *want) == count


WEIGHTLESS = {"massive": False, "gravity": False}
LIGHT = [
    ("reactions of the first dyad", {"force": True}, ["first.*.reaction"], 3),
    ("reactions of the last dyad", {"force": True}, ["last.*.reaction"], 0),
    ("driving moment by reactions", {"force": True}, ["crank.drive"], 4),
    ("driving moment by reduction", {"force": True}, ["crank.drive_by_reduction"], 4),
    ("spring, first dyad", {"spring": 0.0}, ["first.*.reaction"], 5),
    ("damper, first dyad", {"spring": 3.0}, ["first.*.reaction"], 8),
    ("friction, first dyad", {"force": True, "friction": True}, ["first.*.reaction"], 5),
    ("friction, driving moment", {"force": True, "friction": True}, ["crank.drive"], 6),
]


@pytest.mark.parametrize(
    ("options", "want", "count"), [x[1:] for x in LIGHT], ids=[x[0] for x in LIGHT]
)
def test_kernel_calls_of_the_massless_sixbar(options, want, count):
    assert calls(watt(**WEIGHTLESS, **options), *want) == count


def test_friction_costs_two_velocities_and_nothing_where_it_is_switched_off():
    g = watt(**WEIGHTLESS, force=True, friction=True)
    assert stages(g, "first.*.reaction") == {"position": 2, "velocity": 2, "force": 1}
    assert stages(g, "first.*.reaction", friction="none") == {"position": 2, "force": 1}


NEVER = [
    (("*.p", "*.angle", "*.margin"), {"velocity", "acceleration", "force"}),
    (("*.v", "*.omega", "*.slip"), {"acceleration", "force"}),
    (("*.drive_by_reduction", "*.J_red", "*.tau_red"), {"force"}),
]


@pytest.mark.parametrize(("want", "stages_not_asked"), NEVER)
@pytest.mark.parametrize("make", [ruiz, lambda: watt(spring=3.0, friction=True), toggle])
def test_outputs_ask_for_no_stage_that_they_do_not_take(make, want, stages_not_asked):
    assert not stages(make(), *want).keys() & stages_not_asked


def test_static_request_asks_for_no_acceleration():
    g = watt(friction=True)
    assert "acceleration" not in stages(g, "*.reaction", static=True)
    assert "acceleration" in stages(g, "*.reaction")


def test_a_run_at_rest_asks_for_no_inertia():
    mech = watt().compile()
    request = {"at": [1.0, 1.5], "want": ["*.reaction", "*.p", "crank.drive"]}
    rest = mech.run(**request, rates=0.0)
    nearly = mech.run(**request, rates=0.0, accelerations=[0.0, 1e-300])
    assert rest._plan.calls == mech.plan(request["want"], static=True).calls < nearly._plan.calls
    assert same_bits(rest, nearly) == []
    assert "acceleration" in {e.stage for e in mech.run(1.0, rates=0.0)._plan.entries}  # asked for


def test_static_request_without_friction_asks_for_no_velocity():
    assert set(stages(watt(), "*.reaction", static=True)) == {"position", "force"}


def test_relative_rate_asks_for_both_links_only():
    assert stages(watt(), "first.D.slip") == {"position": 2, "velocity": 2}
    assert stages(watt(), "crank.A.slip") == {}


def test_frame_reaction_asks_for_the_blocks_on_the_frame():
    # shaking force: crank and first dyad stand on the frame, the last dyad loads the first
    assert stages(watt(), "mechanism.shaking_force")["force"] == 3


def test_damper_makes_the_reduction_ask_for_velocities():
    assert "velocity" not in stages(watt(spring=0.0), "crank.tau_red")
    assert stages(watt(spring=3.0), "crank.tau_red")["velocity"] == 3


def test_echo_of_the_driver_costs_nothing():
    assert calls(watt(), "crank.q", "crank.rate", "crank.acceleration") == 0


def test_no_wish_costs_nothing():
    assert calls(watt()) == 0
    assert len(watt().run(at=1.0, want=[])) == 0


# ---- structural zeros --------------------------------------------------------------------


def test_block_without_load_is_a_structural_zero():
    r = watt(**WEIGHTLESS, force=True, friction=True).run(at=[0.3, 1.0, 2.0])
    for joint in "BCD":
        for quantity in ("reaction", "friction", "friction_power"):
            assert np.all(r[f"last.{joint}.{quantity}"] == 0)
    assert np.all(r["first.B.reaction"] != 0)


def test_mass_makes_a_block_active_only_where_something_accelerates_or_weighs():
    light = watt(gravity=False)
    assert calls(light, "last.*.reaction") == 10
    assert calls(light, "last.*.reaction", static=True) == 0
    assert calls(watt(), "last.*.reaction", static=True) == 4


def test_load_on_the_frame_alone_loads_nothing():
    g = watt(**WEIGHTLESS)
    g.add("push", bm.Force(force=(1.0, 2.0)))
    g.connect("frame.O2", "push.at")
    assert calls(g, "*.reaction") == 0
    r = g.run(at=1.0)
    assert r["mechanism.shaking_force"][0] == 1 + 2j
    assert r["crank.drive"][0] == 0


# ---- pruning changes nothing but cost ----------------------------------------------------

SUBJECTS = {
    "ruiz": (ruiz, {"at": [0.0, 0.7, 3.0]}),
    "watt": (lambda: watt(spring=3.0, force=True, friction=True), {"at": [0.2, 1.9, 4.0]}),
    "toggle": (toggle, {"at": [0.05, 0.3, 0.55]}),
}


@pytest.mark.parametrize("engine", ["scalar", "numpy"])
@pytest.mark.parametrize("name", SUBJECTS)
def test_each_output_alone_is_the_same_to_the_last_bit(name, engine):
    make, request = SUBJECTS[name]
    mech = make().compile()
    result = mech.run(**request, engine=engine)
    for output in result:
        alone = mech.run(**request, engine=engine, want=output)
        assert same_bits(alone, result) == []


def test_static_and_friction_settings_do_not_leak_into_each_other():
    mech = watt(friction=True, force=True).compile()
    before = mech.run(at=[1.0, 2.0])
    for settings in ({"static": True}, {"friction": "none"}, {"friction": "single"}):
        mech.run(at=[1.0, 2.0], **settings)
    assert same_bits(mech.run(at=[1.0, 2.0]), before) == []


# ---- the same plan for any order of writing ----------------------------------------------


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("name", SUBJECTS)
def test_order_of_blocks_and_wires_changes_no_bit(name, seed):
    make, request = SUBJECTS[name]
    graph = make()
    shuffled = rewired(graph, random.Random(seed))
    first, second = graph.compile(), shuffled.compile()
    assert (
        first.plan("crank.*" if name != "toggle" else "ram.*").program
        == second.plan("crank.*" if name != "toggle" else "ram.*").program
    )
    assert same_bits(first.run(**request), second.run(**request)) == []


# ---- explain -----------------------------------------------------------------------------


def test_explain_prints_the_schedule_and_the_calls():
    text = watt(**WEIGHTLESS, force=True, friction=True).compile().explain("crank.drive")
    assert text.startswith(
        "6 kernel calls for 1 output\n"
        "  position             2  crank, first\n"
        "  velocity             2  crank, first\n"
        "  force                2  crank, first"
    )


# ---- the schedule as a graph -------------------------------------------------------------


def test_the_program_is_a_topological_order_of_its_graph():
    for g in (ruiz(), watt(spring=3.0, friction=True), toggle()):
        plan = g.compile().plan("*")
        graph = plan.graph()
        order_of = {call: i for i, call in enumerate(graph)}
        entries = [e.node for e in plan.entries]
        assert nx.is_directed_acyclic_graph(graph)
        assert set(entries) <= set(graph)
        kernels = graph.subgraph(entries)
        order = nx.lexicographical_topological_sort(kernels, key=order_of.get)
        assert list(order) == [call for call in graph if call in kernels]
        assert all("kind" in data and "way" in data for *_, data in graph.edges(data=True))


def test_forces_go_back_the_way_that_places_came():
    graph = watt().compile().plan("crank.drive").graph()

    def wires(stage):
        return {(a[0], b[0]) for a, b in graph.edges if a[1] == b[1] == stage}

    assert wires("position") == {("crank", "first"), ("first", "last")}
    assert wires("force") == {(b, a) for a, b in wires("position")}
    order = [block for block, stage in graph if stage == "position"]
    assert [block for block, stage in graph if stage == "force"] == order[::-1]
    kinds = {(data["kind"], data["way"]) for *_, data in graph.edges(data=True)}
    forward = {(kind, "forward") for kind in ("place", "velocity", "acceleration")}
    assert kinds == forward | {("force and moment", "back")}


def test_reduced_inertia_and_effort_go_back_to_the_driver():
    graph = watt().compile().plan(["crank.J_red", "crank.tau_red"]).graph()
    to_driver = {
        first[0]
        for first, then, data in graph.edges(data=True)
        if data["kind"] == "reduced inertia and effort"
    }
    assert to_driver == {"first", "last"}
    assert graph.nodes["crank", "reduction", "crank"]["stage"] == "reduction"
    assert not [call for call in graph if call[1] == "force"]


# ---- names of blocks are the user's ------------------------------------------------------

NAMES = [
    {"dyad": "rrr"},  # the dyad's own module
    {"dyad": "rpr"},
    {"weightlike": "forces"},  # a module of the passes
    {"weightlike": "load", "couple": "forces"},
    {"crank": "rrr", "dyad": "crank"},
    {"dyad": "a b", "crank": "a_b", "weightlike": "a_b_2"},  # alike but for a space
    {"dyad": "zz", "crank": "zz_2", "weightlike": "zz 2", "couple": "zz-2"},
    {"dyad": "margin:x"},
    {"dyad": "rest:x", "crank": "friction:x"},
    {"dyad": "class", "crank": "lambda"},
    {"dyad": "P", "crank": "q", "weightlike": "t"},
    {"dyad": "ZERO", "crank": "ONE", "couple": "program"},
    {"dyad": "Kurbelschwinge größer", "crank": "曲柄"},
    {"dyad": "*", "crank": "[a]"},
    {"dyad": "1", "crank": "2"},
]


@pytest.mark.parametrize("names", NAMES, ids=lambda names: ",".join(names.values()))
def test_any_name_of_a_block_gives_the_same_answer(names):
    graph = ruiz()
    expected = graph.run(at=1.3)
    renamed = bm.Graph("renamed")
    for name, block in graph.blocks.items():
        renamed.add(names.get(name, name), block)
    for wire in graph.wires:
        ends = [end.split(".") for end in (wire.source, wire.target)]
        renamed.connect(*(f"{names.get(block, block)}.{port}" for block, port in ends))
    renamed.drive(names.get("crank", "crank"), graph.scene.drive["crank"])
    for engine in ("scalar", "numpy"):
        result = renamed.run(at=1.3, engine=engine)
        assert result.quality.status == ("ok",)
        crank, dyad = names.get("crank", "crank"), names.get("dyad", "dyad")
        for quantity in ("B.reaction", "C.friction", "transmission_angle", "J_red"):
            assert result[f"{dyad}.{quantity}"][0] == pytest.approx(
                expected[f"dyad.{quantity}"][0], rel=1e-12
            )
        assert result[f"{crank}.drive"][0] == pytest.approx(expected["crank.drive"][0], rel=1e-12)


# ---- long chains -------------------------------------------------------------------------


def test_everything_of_a_long_chain_with_friction_runs():
    r = chain(250, friction=True).run(at=1.0)
    assert r.quality.status == ("ok",)
    assert r["mechanism.kinetic_energy"][0] > 0
    assert r["mechanism.friction_power"][0] > 0
