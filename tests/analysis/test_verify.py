"""`verify` says ok where the mechanics are right, and names what is wrong where they are not."""

from dataclasses import replace

import numpy as np
import pytest

import blockmech as bm
from blockmech.analysis.evidence import Stretches
from blockmech.analysis.verify import TOLERANCE, Verification
from blockmech.dynamics.equation import Equation
from blockmech.result.motion import State
from blockmech.result.result import Result
from blockmech.testing.strategies import Options, Seeded, random_mechanism
from tests.gallery import GRAPHS, document, mechanism
from tests.machines import chain, pushed, ruiz, squeezer, toggle, watt, wire
from tests.wiring import changed

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
    report = MECHANISMS[name]().compile().verify(**settings)
    assert report.ok, str(report)
    assert report.samples == 24
    assert max(row.value for row in report.rows) < TOLERANCE / 100


@pytest.mark.parametrize("length", [0.6, 1e3, 1e6, 1e9])
def test_slow_slip_may_be_sliding_or_rest(length):
    graph = bm.Graph.load(GRAPHS / "stribeck_slider_crank.json").replace({"ram.l": length})
    report = graph.compile().verify(samples=7)
    assert report.ok, str(report)


def test_every_pair_link_load_block_and_drive_has_its_row():
    names = [row.name for row in ruiz().compile().verify().rows]
    assert names == [
        *(f"closure of {pair}" for pair in ("crank.A", "dyad.B", "dyad.C", "dyad.D")),
        *(f"markers on {link}" for link in ("frame.frame", "crank.crank", "dyad.i", "dyad.j")),
        "value of crank",
        "law of motion of crank",
        "mode of dyad",
        "margin of dyad",
        "transmission angle of dyad",
        "load of couple",
        "load of weightlike",
        *(
            f"{kind} on {link}"
            for link in ("crank.crank", "dyad.i", "dyad.j", "frame")
            for kind in ("forces", "moments")
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
    for settings in ({"friction": "single"}, {"friction": bm.friction.Successive(iterations=2)}):
        assert ruiz(radius=0.3).compile().verify(**settings).ok


def test_request_can_be_any_that_run_takes():
    mech = squeezer().compile()
    report = mech.verify(at=[0.1, 15.8], rates=1000.0, accelerations=-2e4)
    assert report.ok
    assert report.samples == 2
    assert mech.verify(at=-0.06).samples == 1


def test_gaps_are_left_out_and_nothing_to_check_is_not_ok():
    locked = ruiz(radius=3.75).compile()
    part = locked.verify(at=[0.2, 2.0, 3.2])
    assert (part.ok, part.samples) == (True, 2)
    none = locked.verify(at=[2.0])
    assert (none.ok, none.samples) == (False, 0)


class AtTheEdge(Seeded):
    """Choices of which most are at the ends of what may be drawn, or at zero."""

    def uniform(self, low, high):
        edges = [low, high, *([0.0] if low <= 0 <= high else [])]
        return self.choice([*edges, super().uniform(low, high)])


PUSH = 70 - 35j  # [N]


def into_the_pin():
    """A dyad between a crank and the frame; the only load pushes on its pin on the frame."""
    g = bm.Graph("into the pin")
    g.add("frame", bm.Frame(markers={"A": (0.0, 0.0), "D": (1.7, 0.4)}))
    g.add("crank", bm.Crank(length=0.3))
    g.add("dyad", bm.RRR(l_i=1.3, l_j=0.8, branch=-1))
    g.add("push", bm.Force(force=PUSH))
    wire(g, "frame.D dyad.B", "frame.A crank.A", "crank.B dyad.D", "dyad.B push.at")
    g.drive("crank", bm.motion.ConstantRate(rate=3.0, start=0.0, end=2 * np.pi))
    return g


def strut():
    """A force along the rod: all of it goes to the frame, the crank gets only its rounding."""
    g = bm.Graph("strut")
    g.add("frame", bm.Frame(markers={"A": (0.0, 0.0), "D": (1.0, 0.3)}))
    g.add("crank", bm.Crank(length=0.7))
    links = {"j": bm.Link(markers={"P": (0.37, 0.0)})}
    g.add("dyad", bm.RRR(l_i=1.1, l_j=0.9, links=links))
    g.add("push", bm.Force(force=(100.0, 0.0), axes="link"))
    wire(g, "frame.A crank.A", "crank.B dyad.B", "frame.D dyad.D", "dyad.P push.at")
    g.drive("crank", bm.motion.ConstantRate(rate=3.0, start=0.3, end=1.2))
    return g


def wheel():
    """Its weight has an arm of 1e-9 m: seven digits are left between coordinates of 1 m."""
    g = bm.Graph("nearly balanced wheel", gravity=(0.0, -9.81))
    g.add("frame", bm.Frame(markers={"A": (0.7, 0.4)}))
    g.add("wheel", bm.Crank(links={"crank": bm.Link(mass=20.0, cm=(1e-9, 0.0))}))
    wire(g, "frame.A wheel.A")
    g.drive("wheel", bm.motion.ConstantRate(rate=3.0, start=0.0, end=2 * np.pi))
    return g


def rough_pivot():
    """A pin of 1e14 m: its friction and the drive that overcomes it leave rounding of both."""
    graph, pin = ruiz(radius=0.0), bm.friction.Coulomb(coefficient=0.4, radius=1e14)
    graph.blocks["crank"] = changed(graph.blocks["crank"], friction={"A": pin})
    return graph


def slowest():
    """Driven at the smallest rate there is."""
    graph = ruiz()
    graph.drive("crank", bm.motion.ConstantRate(rate=5e-324))
    return graph


def far_guide():
    """Moments at a point of the guide 1e12 m away are known to the rounding of that place."""
    data = document("slider_crank_offset")
    data["blocks"]["frame"]["markers"]["G"]["at"][0] = 1e12
    return bm.Graph.from_data(data)


def nothing():
    """No mass, no weight, no load: there is nothing to fail."""
    return watt(massive=False, gravity=False)


ROUNDED = {
    into_the_pin: {"static": True, "friction": "none"},
    strut: {},
    wheel: {"static": True},
    rough_pivot: {},
    slowest: {},
    far_guide: {},
    nothing: {},
}


@pytest.mark.parametrize("make", ROUNDED, ids=lambda make: make.__name__)
def test_what_is_rounding_alone_is_no_false_alarm(make):
    report = make().compile().verify(**ROUNDED[make], samples=9)
    assert report.ok, str(report)


def test_loads_that_cancel_leave_rounding():
    # else the test above shows nothing
    static = {"static": True, "friction": "none", "samples": 9}
    pushed = into_the_pin().run(**static, want="*")
    assert 0 < np.max(np.abs(pushed["dyad.C.reaction"])) < TOLERANCE * abs(PUSH)
    assert np.max(np.abs(pushed["dyad.B.reaction"] + PUSH)) < TOLERANCE * abs(PUSH)
    assert 0 < np.max(np.abs(strut().run(samples=9)["dyad.B.reaction"])) < 1e-13
    assert wheel().run(**static)["wheel.drive"][0] == pytest.approx(20.0 * 9.81 * 1e-9)


def test_draws_at_the_edge_leave_no_false_alarm():
    # loads in a pin, motion without speed, parts without mass: much of it cancels exactly
    for seed in range(25):
        case = random_mechanism(AtTheEdge(seed), Options(groups=(1, 3), drivers=(1, 2)))
        report = case.graph.compile().verify(**case.request, friction="none", static=True)
        assert report.ok, (seed, str(report))


def test_text_is_a_table_with_every_number_and_the_verdict():
    text = str(ruiz().compile().verify())
    lines = text.splitlines()
    assert lines[0].split() == ["check", "error", "[-]", "allowed", "[-]"]
    assert len(lines) == 2 + len(ruiz().compile().verify().rows)
    assert all(line.endswith("ok") for line in lines[1:-1])
    assert lines[-1].startswith("24 samples; errors are relative to the sum of absolute terms")


# ---- wrong mechanics ---------------------------------------------------------------------


@pytest.fixture
def tampered(monkeypatch):
    """Changes an output of every result before it is judged."""
    honest = Result.__getitem__

    def tamper(name, change):
        def read(result, output):
            return change(honest(result, output)) if output == name else honest(result, output)

        monkeypatch.setattr(Result, "__getitem__", read)

    return tamper


def failures(verification: Verification):
    return {row.name for row in verification.rows if not row.ok}


def test_wrong_sign_of_a_load_in_a_pin_is_found(tampered):
    request = {"static": True, "friction": "none", "samples": 25}
    for change in (lambda x: -x, lambda x: x * SLIGHTLY):
        tampered("dyad.B.reaction", change)
        result = failures(into_the_pin().compile().verify(**request))
        assert result == {"forces on dyad.i", "forces on frame", "moments on frame"}


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
    report = ruiz(radius=0.2).compile().verify(samples=9)
    assert where in failures(report), str(report)


def test_single_wrong_sample_is_enough(tampered):
    def spoil(values):
        changed_ = values.copy()
        changed_[4] += 1e-3
        return changed_

    tampered("dyad.C.reaction", spoil)
    assert not ruiz().compile().verify(samples=9).ok


# -- results --------------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["auto", "dop853", "radau"])
@pytest.mark.parametrize("name", ["watt_sixbar", "pump", "engine", "fivebar_falling"])
def test_a_simulated_motion_is_verified(name, method):
    mech = mechanism(name)
    report = mech.verify(mech.simulate("time=0.2", method=method, accuracy=1e-6))
    assert report.ok, str(report)
    driver = mech.drivers[0]
    names = [row.name for row in report.rows]
    assert names[-2:] == [f"{x} of {mech.drivers[-1]}" for x in ("rate", "acceleration")]
    assert f"idle drive of {driver}" in names


MOVING = [
    *(f"motions/{path.stem}" for path in (GRAPHS / "motions").glob("*.json")),
    *(f"control/{path.stem}" for path in (GRAPHS / "control").glob("*.json")),
    *("hammer", "planetary_hoist", "rack_gripper", "stribeck_slider_crank", "valve_engine"),
]


@pytest.mark.parametrize("name", MOVING)
def test_motions_of_the_gallery_are_verified(name):
    report = mechanism(name).verify(mechanism(name).simulate("time=0.3", want=()))
    assert report.ok, str(report)


def slides_from_rest(direction):
    """A slider with dry friction on an incline, at rest, which does not hold."""
    g = bm.Graph("incline", gravity=(0.0, -9.81))
    g.add("frame", bm.Frame(markers={"G": bm.Marker(at=(0.0, 0.0), angle=direction * 0.5)}))
    rub, links = {"S": bm.friction.Coulomb(coefficient=0.3)}, {"slider": bm.Link(mass=3.0)}
    g.add("s", bm.SlideDrive(links=links, friction=rub))
    g.connect("frame.G", "s.S")
    g.start("s", q=0.0)
    return g.compile()


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize("factor", [0.0, 0.9, 1.0, -1.0])
def test_what_starts_from_rest_rubs_from_there_on(tampered, direction, factor):
    mech = slides_from_rest(direction)
    motion = mech.simulate("time=0.1", times=[0.0, 0.1])
    tampered("s.S.friction", lambda x: x * np.where(np.arange(len(x)) == 0, factor, 1.0))
    assert ("friction in s.S" in failures(mech.verify(motion))) == (factor != 1.0)


def test_a_motion_is_verified_up_to_its_dead_centre():
    rod = bm.Link(mass=2.0, inertia=0.2, cm=(0.5, 0.0))
    g = pushed(1.0, 1.0, 3.0, (rod, rod), gravity=9.81)  # the power of the drive is the rods'
    g.start("ram", q=1.3, rate=-1.0)
    mech = g.compile()
    end = mech.simulate("standstill").motion
    assert end.end == "dead centre"
    result = mech.simulate(
        "standstill", times=end.t_end * np.array([0.9, 0.999, 0.99999]), want="*"
    )
    assert mech.verify(result).ok, str(mech.verify(result))


@pytest.mark.parametrize("power", [0, 1])
def test_a_quadrature_knows_where_a_rate_jumps_or_bends(power):
    kinks = np.random.default_rng(1).uniform(0.0, 1.0, 500)
    over = Stretches(np.zeros(500), np.ones(500))
    late = np.maximum(over.nodes - kinks[:, None], 0.0)
    rate = (late > 0) * late**power
    value = late ** (power + 1) / (power + 1)
    assert over.gap(value, rate).max() == 0.0
    smooth = np.exp(over.nodes)
    assert over.gap(smooth, smooth).max() < 1e-14
    assert over.gap(smooth, (1 + 1e-9) * smooth).min() > 1e-9


def falsified(result, change):
    """The result with another motion: its states as a function of state and time."""
    track = result.motion.track

    class Other:
        def state(self, t):
            return change(track.state(t), t)

    result.motion = replace(result.motion, track=Other())
    return result


@pytest.mark.parametrize(
    ("change", "failing"),
    [
        (lambda s, t: s._replace(q=s.q + 1e-6 * np.sin(9 * t)), "rate of crank"),
        (lambda s, t: s._replace(qd=s.qd * (1 + 1e-6 * t)), "rate of crank"),
        (lambda s, t: State(s.q - 1e-6 * t**2, s.qd - 2e-6 * t), "acceleration of crank"),
    ],
)
def test_a_falsified_motion_is_caught(change, failing):
    mech = mechanism("watt_sixbar")
    good = mech.simulate("time=1", method="dop853", accuracy=1e-9)
    assert mech.verify(good).ok
    result = failures(mech.verify(falsified(good, change)))
    assert failing in result


def test_a_motion_by_a_wrong_equation_is_caught():
    """Accelerations too large by a thousandth: a motion that is consistent in itself."""
    mech, right = mechanism("watt_sixbar"), Equation.__call__

    def faster(self, t, y):
        rate, acceleration, *works = right(self, t, y)
        return rate, 1.001 * acceleration, *works

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Equation, "__call__", faster)
        moved = mech.simulate("time=1", method="radau", accuracy=1e-9, engine="scalar")
    assert "acceleration of crank" in failures(mech.verify(moved))


def test_a_run_is_verified_at_its_own_samples():
    mech = mechanism("ruiz_fourbar")
    report = mech.verify(mech.run(at=[0.3, 1.0, 2.0], rates=3.0, friction="newton"))
    assert report.ok
    assert report.samples == 3


def test_a_result_of_another_mechanism_is_refused():
    with pytest.raises(bm.RequestError, match="another mechanism"):
        mechanism("ruiz_fourbar").verify(mechanism("watt_sixbar").run(at=1.0))
    again = bm.read("graphs/joints/slider_crank.json").compile().run(at=[1.0, 2.0])
    assert bm.read("graphs/joints/slider_crank.json").compile().verify(again).ok


@pytest.mark.parametrize("engine", ["scalar", "numpy", "llvm"])
def test_a_result_is_verified_by_the_engine_that_is_asked_for(engine):
    mech = mechanism("slider_crank")
    run = mech.run(samples=5)
    fall = mechanism("watt_sixbar").simulate("time=0.1", times=[0.0, 0.05, 0.1], want=())
    assert mech.verify(run, engine=engine).ok
    assert mechanism("watt_sixbar").verify(fall, engine=engine, chunk=2).ok
    for verified in (
        mech.verify,
        lambda at, **options: mechanism("watt_sixbar").verify(fall, **options),
    ):
        with pytest.raises(bm.BlockmechError, match="engine"):
            verified(run, engine="abacus")
