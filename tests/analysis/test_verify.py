"""`verify` says ok where the mechanics are right, and names what is wrong where they are not."""

import json

import numpy as np
import pytest

import blockmech as bm
from blockmech.analysis.verify import TOLERANCE, Verification
from blockmech.blocks import slide_drive
from blockmech.blocks.contract import Kernels
from blockmech.blocks.rrr import acceleration, position, reactions, transmission, velocity
from blockmech.blocks.slide_drive import reactions as slide_reactions
from blockmech.loads.springs import pull
from blockmech.plane import hyp, imul, mul
from blockmech.result import Result
from blockmech.testing.strategies import Options, Seeded, random_mechanism
from blockmech.typing import LinkAcceleration, LinkVelocity
from tests.wiring import GRAPHS, chain, changed, rewired, ruiz, squeezer, toggle, watt, wire

MECHANISMS = {
    "ruiz": ruiz,
    "watt": lambda: watt(spring=3.0, force=True, friction=True),
    "toggle": toggle,
    "chain": lambda: chain(5, friction=True),
}
SLIGHTLY = 1 + 1e-10  # far above the tolerance, far below what a picture would show


# ---- right mechanics ---------------------------------------------------------------------


@pytest.mark.parametrize("settings", [{}, {"friction": "none", "engine": "scalar"}])
@pytest.mark.parametrize("name", MECHANISMS)
def test_right_mechanism_is_verified(name, settings):
    found = MECHANISMS[name]().compile().verify(**settings)
    assert found.ok, str(found)
    assert found.samples == 25
    assert max(row.value for row in found.rows) < TOLERANCE / 100


def test_every_pair_link_load_block_and_drive_has_its_row():
    names = [row.name for row in ruiz().compile().verify().rows]
    assert names == [
        *(f"closure of {pair}" for pair in ("crank.A", "dyad.B", "dyad.C", "dyad.D")),
        *(f"markers on {link}" for link in ("frame.frame", "crank.crank", "dyad.i", "dyad.j")),
        "value of crank",
        "mode of dyad",
        "load of couple",
        "load of weightlike",
        *(
            f"{what} on {link}"
            for link in ("crank.crank", "dyad.i", "dyad.j", "frame")
            for what in ("forces", "moments")
        ),
        *(f"friction in {pair}" for pair in ("crank.A", "dyad.B", "dyad.C", "dyad.D")),
        "power through crank",
        "power through dyad",
        "kinetic energy of the whole",
        "potential energy of the whole",
        "power of the whole",
        "two routes to crank.drive",
    ]


def test_single_correction_is_balanced_too():
    # one correction leaves Coulomb's law behind, not the balance of any link
    for settings in ({"friction": "single"}, {"friction": "successive", "iterations": 2}):
        assert ruiz(radius=0.3).compile().verify(**settings).ok


def test_request_can_be_any_that_run_takes():
    mech = squeezer().compile()
    found = mech.verify(at=[0.1, 15.8], rates=1000.0, accelerations=-2e4)
    assert found.ok
    assert found.samples == 2
    assert mech.verify(at=-0.06).samples == 1


def test_gaps_are_left_out_and_nothing_to_check_is_not_ok():
    locked = ruiz(radius=3.75).compile()
    part = locked.verify(at=[0.2, 2.0, 3.2])
    assert (part.ok, part.samples) == (True, 2)
    none = locked.verify(at=[2.0])
    assert (none.ok, none.samples) == (False, 0)


def test_mechanism_without_loads_has_nothing_to_fail():
    found = watt(massive=False, gravity=False).compile().verify()
    assert found.ok
    still = ("closure", "markers", "value", "mode")  # what is of motion has its rounding
    assert max(row.value for row in found.rows if not row.name.startswith(still)) == 0.0


def test_loads_that_cancel_leave_rounding_and_no_false_alarm():
    # a force along the rod: all of it goes to the frame, the crank gets only its rounding
    g = bm.Graph("strut")
    g.add("frame", bm.Frame(markers={"A": (0.0, 0.0), "D": (1.0, 0.3)}))
    g.add("crank", bm.Crank(length=0.7))
    links = {"j": bm.Link(markers={"P": (0.37, 0.0)})}
    g.add("dyad", bm.RRR(l_i=1.1, l_j=0.9, links=links))
    g.add("push", bm.Force(force=(100.0, 0.0), axes="link"))
    wire(g, "frame.A crank.A", "crank.B dyad.B", "frame.D dyad.D", "dyad.P push.at")
    g.drive("crank", bm.ConstantRate(rate=3.0, start=0.3, end=1.2))
    r = g.run(samples=9)
    assert 0 < np.max(np.abs(r["dyad.B.reaction"])) < 1e-13
    found = g.compile().verify()
    assert found.ok, str(found)


class AtTheEdge(Seeded):
    """Choices of which most are at the ends of what may be drawn, or at zero."""

    def uniform(self, low, high):
        edges = [low, high, *([0.0] if low <= 0 <= high else [])]
        return self.choice([*edges, super().uniform(low, high)])


def into_the_pin(kind=bm.RRR):
    """A dyad between a crank and the frame; the only load pushes on its pin on the frame."""
    g = bm.Graph("into the pin")
    g.add("frame", bm.Frame(markers={"A": (0.0, 0.0), "D": (1.7, 0.4)}))
    g.add("crank", bm.Crank(length=0.3))
    g.add("dyad", kind(l_i=1.3, l_j=0.8, branch=-1))
    g.add("push", bm.Force(force=(70.0, -35.0)))
    wire(g, "frame.D dyad.B", "frame.A crank.A", "crank.B dyad.D", "dyad.B push.at")
    g.drive("crank", bm.ConstantRate(rate=3.0, start=0.0, end=2 * np.pi))
    return g.compile()


def test_loads_straight_into_a_pin_leave_rounding_and_no_false_alarm():
    # the pins C and D, and the crank, get the rounding of a load that has no moment at all
    mech, request = into_the_pin(), {"static": True, "friction": "none", "samples": 25}
    r = mech.run(want="*", **request)
    push = 70 - 35j
    assert 0 < np.max(np.abs(r["dyad.C.reaction"])) < TOLERANCE * abs(push)
    assert np.max(np.abs(r["dyad.B.reaction"] + push)) < TOLERANCE * abs(push)
    found = mech.verify(**request)
    assert found.ok, str(found)


def test_weight_that_passes_a_pin_by_less_than_coordinates_show_gives_no_false_alarm():
    # an arm of 1e-9 m has seven digits left between coordinates of 1 m
    g = bm.Graph("nearly balanced wheel", gravity=(0.0, -9.81))
    g.add("frame", bm.Frame(markers={"A": (0.7, 0.4)}))
    g.add("wheel", bm.Crank(links={"crank": bm.Link(mass=20.0, cm=(1e-9, 0.0))}))
    wire(g, "frame.A wheel.A")
    g.drive("wheel", bm.ConstantRate(rate=3.0, start=0.0, end=2 * np.pi))
    r = g.run(samples=25, static=True)
    assert r["wheel.drive"][0] == pytest.approx(20.0 * 9.81 * 1e-9)
    found = g.compile().verify(samples=25, static=True)
    assert found.ok, str(found)


def test_draws_at_the_edge_leave_no_false_alarm():
    # loads in a pin, motion without speed, parts without mass: much of it cancels exactly
    for seed in range(50):
        case = random_mechanism(AtTheEdge(seed), Options(groups=(1, 3), drivers=(1, 2)))
        found = case.graph.compile().verify(**case.request, friction="none", static=True)
        assert found.ok, (seed, str(found))


def test_text_is_a_table_with_every_number_and_the_verdict():
    text = str(ruiz().compile().verify())
    lines = text.splitlines()
    assert lines[0].split() == ["check", "error", "[-]", "allowed", "[-]"]
    assert len(lines) == 2 + len(ruiz().compile().verify().rows)
    assert all(line.endswith("ok") for line in lines[1:-1])
    assert lines[-1].startswith("25 samples; errors are relative to the sum of absolute terms")


# ---- wrong mechanics ---------------------------------------------------------------------


@pytest.fixture
def tampered(monkeypatch):
    """Changes an output of every result before it is judged."""
    honest = Result.__getitem__

    def tamper(name, change):
        def read(result, asked):
            return change(honest(result, asked)) if asked == name else honest(result, asked)

        monkeypatch.setattr(Result, "__getitem__", read)

    return tamper


# Kernels are called by the names they are imported under, so that every engine binds them.


def wrong_reactions(pose, load_i, load_j, p):
    found = reactions(pose, load_i, load_j, p)
    return found._replace(B=mul(found.B, SLIGHTLY))


def wrong_inner_reaction(pose, load_i, load_j, p):
    found = reactions(pose, load_i, load_j, p)
    return found._replace(C=-found.C)


def wrong_velocity(pose, v_B, v_D, p):
    found = velocity(pose, v_B, v_D, p)
    return found._replace(j=LinkVelocity(found.j.v, found.j.om * SLIGHTLY))


def wrong_acceleration(pose, vel, a_B, a_D, p):
    found = acceleration(pose, vel, a_B, a_D, p)
    return found._replace(i=LinkAcceleration(found.i.a, found.i.al * SLIGHTLY))


def wrong_across(pose, load_i, load_j, p):
    found = reactions(pose, load_i, load_j, p)
    more = imul(pose.i.e, hyp(load_i.F) * (SLIGHTLY - 1))
    return found._replace(B=found.B + more, C=found.C + more, D=found.D - more)


RIGHT = {
    "position": position,
    "velocity": velocity,
    "acceleration": acceleration,
    "reactions": reactions,
    "transmission": transmission,
}


def dyad(**wrong):
    """An RRR dyad with other kernels."""
    return type(bm.RRR)("Wrong", (bm.RRR,), {"kernels": Kernels(**RIGHT | wrong)})


def failures(found: Verification):
    return {row.name for row in found.rows if not row.ok}


def with_dyad(**wrong):
    graph = ruiz()
    return rewired(graph, dyad=changed_to(dyad(**wrong), graph.blocks["dyad"])).compile()


def changed_to(kind, block):
    return kind(**{n: getattr(block, n) for n in block.model_fields_set})


def test_wrong_reaction_is_found_on_the_links_it_loads():
    found = failures(with_dyad(reactions=wrong_reactions).verify(friction="none"))
    assert "forces on dyad.i" in found
    assert "two routes to crank.drive" in found
    assert "power of the whole" in found
    assert "forces on dyad.j" not in found


def test_wrong_sign_of_an_inner_reaction_is_found_where_it_acts():
    # the outer reactions are right, and so are the drive and all powers
    found = failures(with_dyad(reactions=wrong_inner_reaction).verify(friction="none"))
    assert found >= {"forces on dyad.i", "forces on dyad.j"}
    assert not any("power" in name or "drive" in name for name in found)


def test_reactions_that_balance_but_turn_a_link_are_found_by_moments_alone():
    request = {"static": True, "friction": "none", "samples": 25}
    found = failures(into_the_pin(dyad(reactions=wrong_across)).verify(**request))
    assert "moments on dyad.i" in found
    assert not any(name.startswith("forces on") for name in found)


def test_wrong_sign_of_a_load_in_a_pin_is_found(tampered):
    request = {"static": True, "friction": "none", "samples": 25}
    for change in (lambda x: -x, lambda x: x * SLIGHTLY):
        tampered("dyad.B.reaction", change)
        found = failures(into_the_pin().verify(**request))
        assert found == {"forces on dyad.i", "forces on frame", "moments on frame"}


@pytest.mark.parametrize("change", [lambda x: -x, lambda x: x * SLIGHTLY], ids=["sign", "size"])
def test_wrong_reaction_is_found_in_random_mechanisms(tampered, monkeypatch, change):
    # the largest reaction of the last group, on which no other is hung
    for seed in range(40):
        options = Options(groups=(1, 2), drivers=(1, 1), least_margin=0.3)
        case = random_mechanism(Seeded(seed), options)
        mech = case.graph.compile()
        request = {**case.request, "friction": "none"}
        r = mech.run(**request, want="*")
        last = list(mech.structure.blocks)[-1]
        sizes = {n: abs(r[n][0]) for n in r if n.startswith(last) and n.endswith(".reaction")}
        largest = max(sizes, key=sizes.get)
        tampered(largest, change)
        found = failures(mech.verify(**request))
        monkeypatch.undo()
        moved = any(name.startswith(f"forces on {last}") for name in found)
        assert moved == (sizes[largest] > 0), (seed, largest)


def test_wrong_velocity_is_found_by_the_powers_and_the_drive():
    found = failures(with_dyad(velocity=wrong_velocity).verify(friction="none"))
    assert {"power through dyad", "two routes to crank.drive"} <= found
    assert not any(name.startswith("forces on") for name in found)


def test_wrong_acceleration_is_found_where_the_links_part():
    # forces balance with any acceleration
    found = with_dyad(acceleration=wrong_acceleration).verify(friction="none")
    assert failures(found) == {"closure of dyad.C", "two routes to crank.drive"}


def wrong_pull(p_a, p_b, p):
    one, other = pull(p_a, p_b, p)
    return one, mul(other, SLIGHTLY)


class OneSidedSpring(bm.Spring):
    def kernel(self):
        return wrong_pull


def test_element_is_taken_at_its_word():
    # a spring that pulls harder at one end is a load like any other: what it gives is balanced
    graph = watt(spring=0.0)
    odd = changed_to(OneSidedSpring, graph.blocks["spring"])
    assert rewired(graph, spring=odd).compile().verify().ok


def wrong_slide(pose, load_slider, p):
    found = slide_reactions(pose, load_slider, p)
    return found._replace(tau=found.tau * SLIGHTLY)


class WrongSlide(bm.SlideDrive):
    kernels = Kernels(
        slide_drive.position, slide_drive.velocity, slide_drive.acceleration, wrong_slide
    )


def test_wrong_drive_is_found():
    graph = toggle(friction=False)
    wrong = changed_to(WrongSlide, graph.blocks["ram"])
    found = failures(rewired(graph, ram=wrong).compile().verify())
    assert found >= {"forces on ram.slider", "power through ram", "two routes to ram.drive"}
    assert not any("dyad" in name for name in found)


# Friction is a few thousandths of what it is balanced with, so it counts by that much less.
@pytest.mark.parametrize(
    ("output", "where"),
    [
        ("dyad.C.friction", "moments on dyad.j"),
        ("dyad.C.friction_power", "power through dyad"),
        ("dyad.B.reaction", "forces on dyad.i"),
        ("dyad.C.reaction", "forces on dyad.j"),
        ("dyad.D.reaction", "forces on dyad.j"),
        ("crank.A.reaction", "forces on crank.crank"),
        ("crank.drive", "moments on crank.crank"),
        ("dyad.i.alpha", "moments on dyad.i"),
        ("dyad.i.a", "forces on dyad.i"),
        ("dyad.B.wrench_F", "power through crank"),
        ("weightlike.at.force", "forces on dyad.i"),
        ("couple.on.couple", "moments on dyad.j"),
        ("dyad.C.p", "markers on dyad.i"),
        ("mechanism.friction_power", "power of the whole"),
        ("crank.power", "power of the whole"),
        ("crank.drive_by_reduction", "two routes to crank.drive"),
    ],
)
def test_any_number_that_is_slightly_wrong_is_found(tampered, output, where):
    slightly = 1 + 1e-9 if "friction" in output else SLIGHTLY
    tampered(output, lambda x: x * slightly)
    found = ruiz(radius=0.2).compile().verify(samples=9)
    assert where in failures(found), str(found)


def test_single_wrong_sample_is_enough(tampered):
    def spoil(values):
        changed_ = values.copy()
        changed_[4] += 1e-3
        return changed_

    tampered("dyad.C.reaction", spoil)
    assert not ruiz().compile().verify(samples=9).ok


def test_friction_that_is_all_of_the_drive_is_no_mistake():
    """A pin of 1e14 m: its friction and the drive that overcomes it leave rounding of both."""
    for found in (ruiz().compile().verify(), ruiz_with_a_rough_pivot(1e14).verify()):
        assert found.ok, str(found)


def ruiz_with_a_rough_pivot(radius):
    graph = ruiz(radius=0.0)
    pin = bm.Coulomb(coefficient=0.4, radius=radius)
    graph.blocks["crank"] = changed(graph.blocks["crank"], friction={"A": pin})
    return graph.compile()


def test_a_drive_at_the_smallest_rate_is_no_mistake():
    graph = ruiz()
    graph.drive("crank", bm.ConstantRate(rate=5e-324))
    assert graph.compile().verify(samples=7).ok


def test_a_guide_that_is_pinned_far_off_is_no_mistake():
    """Moments at a point of the guide 1e12 m away are known to the rounding of that place."""
    data = json.loads((GRAPHS / "slider_crank_offset.json").read_text("utf-8"))
    data["blocks"]["frame"]["markers"]["G"]["at"][0] = 1e12
    assert bm.Graph.from_data(data).compile().verify(samples=7).ok
