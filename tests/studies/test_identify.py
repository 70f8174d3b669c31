"""Identification on records whose truth is known."""

from __future__ import annotations

import math
import os
import time

import numpy as np
import pytest

import blockmech as bm
from tests.gallery import GRAPHS

RUIZ = bm.Graph.load(GRAPHS / "ruiz_fourbar.json")
BENCH = RUIZ.compile()
RECORDS = int(os.environ.get("BLOCKMECH_EXAMPLES", "30"))  # 100 is the full run
NUMBERS = ("dyad.links.i.mass", "dyad.links.j.cm.x", "crank.friction.A.coefficient")


def record(n, seed=0, scale=0.01, friction=None, mechanism=BENCH):
    """A record with noise in proportion to what is measured."""
    q = np.linspace(0.0, 6.2, n)
    rate = 10 + 3 * np.sin(3 * q)
    options = {"rates": rate, "accelerations": 9 * np.cos(3 * q) * rate, "friction": friction}
    run = mechanism.run(at=q, want=["crank.drive", "dyad.D.reaction"], **options)
    noise = 1 + scale * np.random.default_rng(seed).standard_normal((2, n))
    return {
        "crank.q": q,
        "crank.rate": rate,
        "crank.acceleration": options["accelerations"],
        "crank.drive": run["crank.drive"] * noise[0],
        "dyad.D.reaction.x": run["dyad.D.reaction"].real * noise[1],
    }


def drawn():
    """The mechanism as it was drawn, with other numbers than the bench has."""
    start = {"dyad.links.i.mass": 25.0, "dyad.links.j.cm.x": 1.2}
    return RUIZ.replace(start | {"crank.friction.A.coefficient": 0.3}).compile()


def true(addresses):
    parameters = BENCH.parameters()
    return np.array([parameters[a].value for a in addresses])


def test_without_noise_the_numbers_come_back():
    identification = bm.design.identify(drawn(), NUMBERS, record(60, scale=0.0))
    assert np.array([identification[a] for a in NUMBERS]) == pytest.approx(true(NUMBERS), rel=1e-9)
    assert not identification.unseen
    assert not identification.combinations
    assert (
        identification.mechanism.parameters()["dyad.links.i.mass"].value
        == identification["dyad.links.i.mass"]
    )


def test_true_values_are_within_three_deviations():
    """Of 97 of 100 records, all numbers at a time."""
    mech, good = drawn(), 0
    for seed in range(RECORDS):
        identification = bm.design.identify(mech, NUMBERS, record(120, seed=seed))
        off = [
            abs(identification[a] - x) / identification.deviations[a]
            for a, x in zip(NUMBERS, true(NUMBERS), strict=True)
        ]
        good += max(off) < 3.0
    assert good >= math.floor(0.97 * RECORDS)


def test_ten_thousand_samples_take_two_seconds():
    data, mech, spans = record(10_000), drawn(), []
    for _ in range(3):
        start = time.process_time()
        bm.design.identify(mech, NUMBERS, data)
        spans.append(time.process_time() - start)
    assert min(spans) < 2.0


def test_what_acts_alike_is_told_together():
    """The crank turns about its pin: only m c^2 + J, here c = 1 m."""
    pair = ["crank.links.crank.mass", "crank.links.crank.inertia"]
    data = record(200, friction="none")
    del data["dyad.D.reaction.x"]
    identification = bm.design.identify(BENCH, [*pair, "dyad.links.j.mass"], data, friction="none")
    assert list(identification.values) == ["dyad.links.j.mass"]
    (sum_,) = identification.combinations
    assert set(sum_.weights) == set(pair)
    weights = [sum_.weights[a] for a in pair]
    assert weights[0] / weights[1] == pytest.approx(1.0, rel=1e-6)
    total = true(pair).sum() * sum_.weights[pair[0]]
    assert abs(sum_.value - total) < 4 * sum_.deviation
    with pytest.raises(bm.RequestError, match="the data do not tell it"):
        identification[pair[0]]


def test_what_is_not_seen_has_no_value():
    """A centre of mass that moves square to the crank changes its inertia in second order only."""
    data = record(80, friction="none")
    addresses = ["dyad.links.i.mass", "crank.links.crank.cm.y"]
    identification = bm.design.identify(BENCH, addresses, data, friction="none")
    assert "crank.links.crank.cm.y" in identification.unseen
    assert "crank.links.crank.cm.y" not in identification.values
    assert "not seen in the data: crank.links.crank.cm.y" in str(identification)
    alone = bm.design.identify(
        BENCH, "frame.D.y", {"crank.q": [0.0, 1.0], "crank.crank.omega": [0.0, 0.0]}
    )
    assert alone.unseen == ("frame.D.y",)


def test_a_missing_effect_leaves_a_pattern():
    data = record(400)
    assert bm.design.identify(drawn(), NUMBERS, data).doubts == ()
    assert bm.design.identify(drawn(), NUMBERS[:2], data, friction="none").doubts


def test_places_identify_lengths_also_of_links_and_joints():
    linkage = bm.Linkage.load(GRAPHS / "joints" / "watt_sixbar.json")
    bench = linkage.compile()
    name = next(n for n in bench.outputs if n.endswith(".p") and n.startswith("joint."))
    address = next(a for a in bench.parameters() if a.startswith("joints.") and a.endswith(".x"))
    q = np.linspace(0.5, 2.5, 40)
    z = bench.run(at=q, want="joint.*.p")
    columns = {bench._of_driver(bench.drivers[0], "q"): q}
    for joint in [n for n in z if n.endswith(".p")]:
        columns |= {f"{joint}.x": z[joint].real, f"{joint}.y": z[joint].imag}
    value = bench.parameters()[address].value
    design = linkage.replace({address: value + 0.01}).compile()
    identification = bm.design.identify(design, address, columns)
    assert name in z
    assert identification[address] == pytest.approx(value, abs=1e-9)


def test_files_and_frames_are_read(tmp_path):
    import pandas as pd

    data = record(50, scale=0.0)
    frame = pd.DataFrame(data)
    degrees = {"crank.q [deg]": np.degrees(data["crank.q"])} | {
        k: x for k, x in data.items() if k != "crank.q"
    }
    plain, german = tmp_path / "a.csv", tmp_path / "b.csv"
    pd.DataFrame(degrees).to_csv(plain, index=False)
    frame.to_csv(german, index=False, sep=";", decimal=",")
    for source in (frame, plain, str(german)):
        identification = bm.design.identify(drawn(), NUMBERS, source)
        assert identification[NUMBERS[0]] == pytest.approx(30.0, rel=1e-6)
    run = BENCH.run(samples=20, want="crank.drive")
    run.to_csv(tmp_path / "own.csv")
    assert bm.design.identify(BENCH, NUMBERS[0], tmp_path / "own.csv")[NUMBERS[0]] == pytest.approx(
        30.0
    )


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"crank.drive": [1.0, 2.0]}, "a column is missing for crank.q"),
        ({"crank.q": [1.0, 2.0]}, "no measured column"),
        ({"crank.q": [1.0, 2.0], "crank.drive": [1.0]}, "not equally long"),
        ({"crank.q": [1.0, 2.0], "dyad.C.p": [1.0, 2.0]}, "name a part: dyad.C.p.x"),
        ({"crank.q": [1.0, 2.0], "crank.drve": [1.0, 2.0]}, "drve"),
        ("nowhere.csv", "no such file"),
    ],
)
def test_data_that_are_none_are_refused(data, message):
    with pytest.raises(bm.RequestError, match=message):
        bm.design.identify(BENCH, "dyad.links.i.mass", data)


def test_too_few_rows_and_numbers_without_a_derivative():
    short = {k: x[:1] for k, x in record(5).items()}
    with pytest.raises(bm.RequestError, match="1 rows for 3 numbers"):
        bm.design.identify(BENCH, NUMBERS, short)
    with pytest.raises(bm.RequestError, match="a whole number chooses"):
        bm.design.identify(BENCH, "dyad.branch", record(5))


def test_the_picture_marks_the_block(tmp_path):
    identification = bm.design.identify(drawn(), NUMBERS[:2], record(400), friction="none")
    identification.plot(tmp_path / "r.png")
    assert (tmp_path / "r.png").stat().st_size > 10_000
    variant = identification.figure()._supxlabel.get_text().replace("\n", " ")
    assert "dyad" in variant.partition("the model misses something at")[2]
