"""Enclosures against 60 digits, random designs and the exact range; a wrong proof must fail."""

from __future__ import annotations

import itertools
import math
import random

import mpmath
import numpy as np
import pytest

import blockmech as bm
from blockmech.engines.enclosed import proofs
from blockmech.engines.enclosed.forms import SYMBOLS, Form, form, within
from blockmech.ground.plane import EPS
from blockmech.model.joints.diagram import Diagram
from blockmech.studies.family import remade
from tests.extremes.precise import assert_encloses
from tests.gallery import JOINTS, changed, document, mechanism

GROUPS = ["stephenson_3_triad", "stephenson_2_class_4"]
CLOSED = ["slider_crank", "engine", "watt_sixbar", "toggle_press", "geared_fivebar", "scotch_yoke"]
OUTPUTS = [
    "*.p",
    "*.omega",
    "*.alpha",
    "*.reaction",
    "*.drive",
    "*.tau_red",
    "*.J_red",
    "*.v",
    "*.a",
    "mechanism.*",
]
LENGTHS = {"dyad.l_i": 1e-4, "dyad.l_j": 1e-4, "crank.length": 1e-4}


@pytest.mark.parametrize("name", [*CLOSED, *GROUPS])
def test_bounds_of_rounding_hold_60_digits(name):
    mech, dice = mechanism(name), random.Random(name)
    q = [dice.uniform(-0.3, 0.3) + mech.samples(None, 5, None, None, None).inputs["q_0"][2]]
    enclosure = mech.enclose(q, rates=1.3, accelerations=-0.7, friction="none", want=OUTPUTS)
    assert enclosure.proved
    assert enclosure.closes
    assert_encloses(enclosure, mech, "none")


def test_friction_is_proved_and_holds_60_digits():
    mech = mechanism("ruiz_fourbar")
    enclosure = mech.enclose([0.3, 1.0, 2.5], want=["crank.drive", "*.reaction"])
    assert enclosure.proved
    assert_encloses(enclosure, mech, "newton")
    assert enclosure["crank.drive"].max() < 1e-8


@pytest.mark.parametrize("gap", [1e-3, 1e-6, 1e-9, 1e-12])
def test_dead_centres_are_bounded(gap):
    data = document("ruiz_fourbar")
    data["blocks"]["dyad"] |= {"l_i": 4.0, "l_j": 2.0}
    mech = changed(data)
    end = math.acos((5.5**2 + 2.0**2 - 6.0**2) / (2 * 5.5 * 2.0))  # B and D are l_i + l_j apart
    enclosure = mech.enclose(
        end - gap, rates=1.0, friction="none", want=["dyad.C.p", "dyad.margin"]
    )
    assert enclosure.proved
    assert enclosure.closes
    assert_encloses(enclosure, mech, "none")


@pytest.mark.parametrize(("name", "count"), [("ruiz_fourbar", 1000), *((n, 10) for n in GROUPS)])
def test_random_designs_are_inside(name, count):
    mech = mechanism(name)
    every = mech.parameters()
    tolerance = (
        LENGTHS
        if name == "ruiz_fourbar"
        else {a: 1e-5 for a, p in every.items() if p.unit == "m" and p.value}
    )
    tolerance = dict(list(tolerance.items())[:4])
    q = mech.samples(None, 5, None, None, None).inputs["q_0"][2]
    want = ["crank.drive", "crank.tau_red"]
    enclosure = mech.enclose(q, tolerance=tolerance, want=want)
    assert enclosure.proved, enclosure
    dice = np.random.default_rng(1)
    vary = {a: every[a].value + r * dice.uniform(-1, 1, count) for a, r in tolerance.items()}
    study = mech.study(vary, want=[f"max({n})" for n in enclosure], at=[q], sampling="paired")
    for n in enclosure:
        assert enclosure.contains(n, study[f"max({n})"][:, None]).all(), n


def test_width_is_that_of_the_exact_range():
    mech = mechanism("ruiz_fourbar")
    every, widths = mech.parameters(), []
    for size in (1e-4, 1e-6):
        tolerance = dict.fromkeys(LENGTHS, size)
        enclosure = mech.enclose(1.0, tolerance=tolerance, want="crank.drive")
        drives = [
            remade(
                mech, {a: every[a].value + s * size for a, s in zip(LENGTHS, side, strict=True)}
            ).run(1.0, want="crank.drive")["crank.drive"][0]
            for side in itertools.product((-1, 1), repeat=3)
        ]
        exact = 0.5 * (max(drives) - min(drives))
        assert exact <= enclosure["crank.drive"][0] <= 1.01 * exact
        widths.append(enclosure["crank.drive"][0] / size)
    slope = mech.sensitivity("crank.drive", list(LENGTHS), at=1.0)["crank.drive"]
    assert widths[1] == pytest.approx(np.abs(slope).sum(), rel=1e-4)


EQUAL = ["crank.length", "first.l_i", "first.l_j", "second.l_i", "second.l_j"]


@pytest.mark.parametrize(
    "name", ["watt_sixbar", "toggle_press", "geared_fivebar", "rack_gripper", *GROUPS]
)
def test_width_is_at_most_a_fifth_above_the_corners_of_lengths(name):
    mech = mechanism(name)
    values = {a: p.value for a, p in mech.parameters().items() if p.unit == "m" and p.value}
    lengths = EQUAL if name == "watt_sixbar" else list(values)[:5]  # of Watt's, two links tie
    tolerance = {a: 1e-4 * abs(values[a]) for a in lengths}
    (driver,) = mech.drivers
    q = mech.samples(None, 7, None, None, None).inputs["q_0"][[2, 4]]
    options = {"friction": "none", "want": f"{driver}.drive", "rates": 1.0, "accelerations": 0.5}
    bounds = mech.enclose(q, tolerance=tolerance, **options)
    corners = itertools.product((-1, 1), repeat=len(lengths))
    designs = (
        {a: values[a] + s * tolerance[a] for a, s in zip(lengths, side, strict=True)}
        for side in corners
    )
    drives = np.array(
        [remade(mech, numbers).run(q, **options)[options["want"]] for numbers in designs]
    )
    exact = 0.5 * np.ptp(drives, axis=0)
    assert bounds.contains(options["want"], drives).all()
    assert (bounds[options["want"]] <= 1.2 * exact).all()


def test_what_may_not_close_is_said():
    enclosure = mechanism("ruiz_fourbar").enclose(
        1.0, tolerance={"dyad.l_i": 3.0}, want="crank.drive"
    )
    assert not enclosure.proved
    assert not enclosure.closes
    assert "may not close" in str(enclosure)


def test_a_chain_of_forty_loops_is_bounded():
    mech = mechanism("n_four_bar")
    last = [n for n in mech.outputs if n.endswith(".C.p")][-1]
    enclosure = mech.enclose(0.3, rates=1.0, friction="none", want=last)
    assert enclosure.proved
    assert abs(enclosure[last][0]) < 1e-12


def test_a_shrunk_proof_fails(monkeypatch):
    inside = proofs.is_inside  # a box is twice what is needed: of 0.4 of it nothing is proved
    monkeypatch.setattr(proofs, "is_inside", lambda image, box: inside(image, 0.4 * box))
    enclosure = mechanism("ruiz_fourbar").enclose(1.0, want="crank.drive")
    assert not enclosure.proved
    assert not np.isfinite(enclosure["crank.drive"]).any()


@pytest.mark.parametrize("seed", range(20))
def test_sine_and_angle_hold_60_digits(seed):
    dice = random.Random(seed)
    x = dice.uniform(-10.0, 10.0) * 10.0 ** dice.randint(-12, 8)
    SYMBOLS.count = 0
    cos, sin = form(x).expi()
    with mpmath.workdps(60):
        assert cos.low <= mpmath.cos(x) <= cos.high
        assert sin.low <= mpmath.sin(x) <= sin.high
    assert sin.high - sin.low <= 4 * EPS * abs(sin.c) + 1e-29


@pytest.mark.parametrize("function", ["sqrt", "exp", "inverse", "expi"])
def test_functions_hold_what_is_within_a_tolerance(function):
    dice = random.Random(function)
    for _ in range(50):
        SYMBOLS.count = 0
        c, r = dice.uniform(0.5, 3.0), dice.uniform(0.0, 0.4)
        x = within(c, r) * 1.0
        y = getattr(x, function)()
        y = y[1] if function == "expi" else y
        exact = {"expi": mpmath.sin, "inverse": lambda v: 1 / v}.get(function)
        for t in (c - r, c + r, c + dice.uniform(-r, r)):
            value = (exact or getattr(mpmath, function))(mpmath.mpf(t))
            assert y.low <= value <= y.high
        assert isinstance(y, Form)
        assert y.high - y.low < 40 * r + 1e-14


def test_wrong_requests_are_refused():
    mech = mechanism("ruiz_fourbar")
    for tolerance in ({"dyad.l_i": 0.0}, {"dyad.no": 1e-3}):
        with pytest.raises(bm.RequestError):
            mech.enclose(1.0, tolerance=tolerance)
    with pytest.raises(bm.RequestError):
        mech.enclose(1.0, friction="single")


def test_a_number_is_not_passed_unchanged_because_it_is_so_at_the_ends(monkeypatch):
    """A formula that is right in the middle and at both ends is far off between them."""
    document = bm.Linkage.load(JOINTS / "ruiz_fourbar.json")
    mech, width, mass_of = document.compile(), 1e-3, Diagram._mass
    mass, value = next(
        (a, p.value) for a, p in mech.parameters().items() if a.endswith(".mass") and p.value
    )

    def bent(diagram, carrier):
        data = mass_of(diagram, carrier)
        if abs(complex(m := data.get("mass", 0.0)) - value) <= 2 * width:  # of this link alone
            data["mass"] = m + 1e9 * (m - value) * (m - (value - width)) * (m - (value + width))
        return data

    monkeypatch.setattr(Diagram, "_mass", bent)
    for x in (value - width, value, value + width):
        assert repr(x) in str(document.replace({mass: x}).decompose().data)
    with pytest.raises(bm.RequestError, match="follows it by a formula"):
        document.compile().enclose(1.0, tolerance={mass: width}, want="driver.*.drive")


def test_numbers_of_links_and_joints_are_enclosed_where_they_pass_unchanged():
    mech = bm.Linkage.load(JOINTS / "ruiz_fourbar.json").compile()
    mass = next(a for a, p in mech.parameters().items() if a.endswith(".mass") and p.value)
    (drive,) = (mech._of_driver(d, "drive") for d in mech.drivers)
    value, width = mech.parameters()[mass].value, 1e-3
    enclosure = mech.enclose(1.0, rates=2.0, tolerance={mass: width}, want=drive)
    assert enclosure.proved
    for end in (value - width, value + width):
        design = mech.document.replace({mass: end}).compile()
        assert enclosure.contains(drive, design.run(1.0, rates=2.0, want=drive)[drive]).all()
    bars = bm.Linkage("bars")
    for link in ("crank", "rod", "rocker"):
        bars.add_link(link)
    for name, links, point in (
        ("O", ["frame", "crank"], (0, 0)),
        ("A", ["crank", "rod"], (0.3, 0.4)),
        ("B", ["rod", "rocker"], (2.0, 1.5)),
        ("C", ["rocker", "frame"], (2.0, 0.0)),
    ):
        bars.add_joint(name, "R", links, point=point)
    bars.add_driver("motor", "O", bm.motion.ConstantRate(rate=1.0))
    mech = bars.compile()
    with pytest.raises(bm.RequestError, match=r"rocker_rod.* follows it .*decompose\(\)") as error:
        mech.enclose(1.0, tolerance={"joints.A.at[1].x": width}, want="link.rod.angle")
    assert "._" not in str(error.value)
