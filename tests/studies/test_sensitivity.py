"""Sensitivities: exact, by address, ranked, and honest where there is no derivative."""

import csv
import random

import mpmath
import numpy as np
import pytest

import blockmech as bm
from blockmech.ground.errors import RequestError
from blockmech.ground.plane import primitives_of
from blockmech.model.joints.varied import Varied, settled
from blockmech.studies.differentiate import sensitivity
from blockmech.studies.family import Family
from tests.campaigns.derivatives import documents_from
from tests.engines.derivatives import STEP, of_document, outputs
from tests.engines.test_derivatives import EXACT, request_of
from tests.extremes.precise import DIGITS, PRIMITIVES, Precise
from tests.gallery import GRAPHS, JOINTS, mechanism
from tests.machines import wire


def in_double(function, *x):
    return tuple(map(mpmath.mpf, function(*map(float, x))))


for number in (mpmath.mpf, mpmath.mpc):
    primitives_of.register(number, lambda x: PRIMITIVES | {"one_by_one": in_double})

SPLINES = (".law.arguments", ".law.values")  # whose coefficients SciPy finds, in double


def by_differences(mech, derivatives, request, ways):
    """Derivatives of all outputs along one way, by output, from formulas and kernels in 60 digits.

    ``ways`` is a change of each number.
    """
    want = list(derivatives)
    family = Family(mech, derivatives.parameters)
    precise = Precise(family.general, want, "newton")
    program = precise.plan.program
    inputs = derivatives.result.samples.given(program.inputs)
    columns = {name: [] for name in want}
    with mpmath.workdps(DIGITS):
        sides = []
        for h in (STEP, -STEP):
            moved = {
                p: mpmath.mpf(p.value) + h * ways[a] for a, p in derivatives.parameters.items()
            }
            sides.append(program.values(*family.design(moved)))
        for k in range(derivatives.result.n):
            sample = {x: float(np.asarray(inputs[x])[k]) for x in inputs}
            forward, backward = (precise.run(sample, side) for side in sides)
            for name in want:
                output = mech.outputs[name]
                if output.read.__name__ == "_identity":
                    (i,) = precise.plan.layout[name]
                    columns[name].append(complex((forward[i] - backward[i]) / (2 * STEP)))
    return {name: np.array(column) for name, column in columns.items() if column}


GALLERY = ("ruiz_fourbar", "engine", "excavator", "toggle_press", "whitworth_shaper")


@pytest.mark.parametrize("name", GALLERY)
def test_derivatives_by_address_agree_with_60_digits(name):
    mech = mechanism(name)
    request = request_of(mech)
    derivatives = sensitivity(mech, outputs(mech), **request, on_gap="mark")
    dice = random.Random(3)
    ways = {
        a: 0.0 if any(x in a for x in SPLINES) else (abs(p.value) or 1.0) * dice.uniform(-1.0, 1.0)
        for a, p in derivatives.parameters.items()
    }
    exact = by_differences(mech, derivatives, request, ways)
    margin = min([1.0, *(x.min() for x in derivatives.result.quality.margin.values())])
    largest = {}
    for x, d in exact.items():
        unit = mech.outputs[x].unit.removesuffix("/rad")
        size = max(np.abs(d).max(), np.nanmax(np.abs(derivatives.result[x])))
        largest[unit] = max(size, largest.get(unit, 0.0))
    assert len(exact) > 10
    for x, d in exact.items():
        slopes = np.einsum("m,mn->n", list(ways.values()), derivatives[x])
        scale = largest[mech.outputs[x].unit.removesuffix("/rad")] / margin
        assert np.abs(slopes - d).max() <= EXACT * scale, x


DOCUMENTS = (  # of every kind of block, and with cylinders and pins of three links
    *("elliptic_trammel", "tangent_generator", "whitworth_shaper", "scotch_yoke", "pump"),
    *("toggle_press", "floating_drive_press", "andrews_squeezer", "fivebar_falling"),
)


@pytest.mark.parametrize("name", DOCUMENTS)
def test_derivatives_by_the_numbers_of_a_document_agree_with_differences(name):
    linkage = bm.Linkage.load(JOINTS / f"{name}.json")
    assert of_document(linkage, request_of(linkage.compile()), step=1e-4) <= EXACT


def test_what_only_a_chance_makes_a_dyad_has_no_transmission_angle_near_by():
    mech = bm.Linkage.load(JOINTS / "excavator.json").compile()
    angles = [name for name in mech.outputs if name.endswith("transmission_angle")]
    derivatives = sensitivity(mech, "*", samples=3)
    gone = set(angles) - set(derivatives)
    assert gone
    assert gone <= set(derivatives.left_out)
    assert set(derivatives) == set(outputs(mech)) - gone
    with pytest.raises(bm.RequestError, match="designs near by do not have it"):
        sensitivity(mech, sorted(gone), samples=3)


def test_drivers_may_come_in_another_order_near_by():
    """A cylinder whose line misses its pins is a group, which is placed sooner."""
    ((_, linkage, request),) = documents_from(13, 1)
    assert of_document(linkage, request, step=1e-4) <= EXACT


def pendulum(**options):
    """A bar on a crank that is driven; a force where the bar's pin is."""
    linkage = bm.Linkage("pendulum", gravity=(0.0, -10.0))
    linkage.add_link("bar", pose=(0.0, 0.0, 0.3), mass=2.0, inertia=0.1, **options)
    linkage.add_joint("A", "R", ["frame", "bar"], at=[(0.0, 0.0), (0.5, 0.0)])
    linkage.add_load("push", bm.Force(force=(3.0, 4.0)), link="bar", at=(0.5, 0.0))
    linkage.add_driver("motor", "A", bm.motion.ConstantRate(rate=0.0))
    return linkage


def test_what_coincides_by_chance_moves_by_itself():
    mech = pendulum(cm=(1.0, 0.0)).compile()
    derivatives = mech.sensitivity(
        "driver.motor.drive", ["loads.push.at.*", "joints.A.at*"], at=0.0
    )
    by = {a: derivatives["driver.motor.drive", a][0] for a in derivatives.parameters}
    # The moment about A of a force F at s is (s - A) x F; the weight acts 0.5 m from A.
    assert by["loads.push.at.x"] == pytest.approx(-4.0, rel=1e-14)
    assert by["loads.push.at.y"] == pytest.approx(3.0, rel=1e-14)
    assert by["joints.A.at[1].x"] == pytest.approx(4.0 - 20.0, rel=1e-14)
    assert by["joints.A.at[0].x"] == 0.0


def test_a_mass_without_a_place_is_at_the_origin_of_its_link():
    text, default = (pendulum(**fields).compile() for fields in ({"cm": (0.0, 0.0)}, {}))
    for mech in (text, default):
        run = mech.run(at=0.0, want=["driver.motor.drive"])
        assert run["driver.motor.drive"][0] == pytest.approx(-0.5 * 20.0, rel=1e-14)


def test_numbers_are_equal_if_they_stay_equal():
    x, same, unequal = Varied(2.0, [1.0, 0.0]), Varied(2.0, [1.0, 0.0]), Varied(2.0, [0.0, 1.0])
    assert x == same
    assert {x: "found"}[same] == "found"
    assert x not in (unequal, 2.0)
    assert (bool(x - unequal), bool(x - same)) == (True, False)
    assert settled({"a": [x, (1j * x,)]}) == {"a": [2.0, (2j,)]}


def test_the_coordinate_of_a_driver_is_turned_at_held_rates():
    mech = mechanism("watt_sixbar")
    want = ["second.C.p", "second.C.v", "crank.J_red", "crank.dJ_red"]
    derivatives = sensitivity(
        mech, want, "crank.q", at=[0.3, 1.7], rates=[2.0, 2.0], accelerations=[0, 0]
    )
    result = derivatives.result
    np.testing.assert_allclose(
        derivatives["second.C.p", "crank.q"] * 2.0, result["second.C.v"], rtol=1e-13
    )
    np.testing.assert_allclose(
        derivatives["crank.J_red", "crank.q"], result["crank.dJ_red"], rtol=1e-12
    )
    acceleration = mech.run(**request_at([0.3, 1.7]), want=["second.C.a"])["second.C.a"]
    np.testing.assert_allclose(derivatives["second.C.v", "crank.q"] * 2.0, acceleration, rtol=1e-12)
    assert derivatives.unit("second.C.p", "crank.q") == "m/rad"


def request_at(q):
    return {"at": q, "rates": [2.0] * len(q), "accelerations": [0.0] * len(q)}


def test_numbers_are_ranked_by_what_a_hundredth_of_them_does():
    derivatives = mechanism("ruiz_fourbar").sensitivity("crank.drive", "dyad.l_*", samples=73)
    first, second = derivatives.ranked("crank.drive")
    assert first.change >= second.change > 0.0
    assert first.parameter.address == "dyad.l_i"
    assert first.change == pytest.approx(0.01 * 6.0 * abs(first.derivative), rel=1e-15)
    assert "dyad.l_i" in derivatives.text().splitlines()[2]


def test_a_zero_has_no_hundredth_and_says_by_how_much_it_changes():
    """A hundredth of the largest length, which is the rod's 5.9 m."""
    centre = "crank.links.crank.cm.y"
    graph = bm.Graph.load(GRAPHS / "ruiz_fourbar.json").replace({centre: 0.0})
    numbers = [centre, "dyad.l_i"]
    text = str(graph.compile().sensitivity("crank.drive", numbers, at=[0.5], rates=1.0))
    length = graph.compile().parameters()["dyad.l_i"].value
    (row,) = (line for line in text.splitlines() if centre in line)
    assert row.endswith(f" by {length / 100:.3g} m")
    assert text.count(" by ") == 2  # and the head, "by 1 %"


def test_a_document_has_the_derivatives_of_its_graph():
    by_blocks = mechanism("ruiz_fourbar").sensitivity("crank.drive", "dyad.l_i", samples=13)
    linkage = bm.Linkage.load(JOINTS / "ruiz_fourbar.json").compile()
    derivatives = linkage.sensitivity("driver.motor.drive", "joints.C.at[0].x", samples=13)
    np.testing.assert_allclose(
        derivatives["driver.motor.drive", "joints.C.at[0].x"],
        by_blocks["crank.drive", "dyad.l_i"],
        rtol=1e-11,
    )


def test_a_kink_has_two_derivatives():
    graph = bm.Graph.load(GRAPHS / "slider_crank.json")
    law = {"kind": "table", "arguments": [0.0, 1.0, 3.0], "values": [0.0, 2.0, 0.0]}
    graph.add("motor", bm.Motor(law=law | {"interpolation": "linear"}, driver="crank"))
    wire(graph, "frame.frame motor.a", "crank.crank motor.b")
    derivatives = graph.compile().sensitivity("crank.tau_red", "crank.q", at=[0.9, 1.0, 1.1])
    assert derivatives.kinks("crank.tau_red").tolist() == [[False, True, False]]
    step = derivatives.behind["crank.tau_red"] - derivatives.ahead["crank.tau_red"]
    assert step[0, 1] == pytest.approx(2.0 - -1.0, rel=1e-12)
    assert "one-sided at 1 of 3 samples: " in derivatives.text()


def rubbing():
    """A slider-crank whose slider rubs; at no turn of the crank it rests, for an instant."""
    data = bm.Graph.load(GRAPHS / "slider_crank.json").to_data()
    data["blocks"]["piston"]["friction"] = {"S": {"law": "coulomb", "coefficient": 0.2}}
    return bm.Graph.from_data(data).replace({"gas.force.y": -50.0}).compile()


def test_where_a_number_sets_a_resting_pair_going_there_is_no_derivative():
    mech, numbers = rubbing(), ["frame.O.y", "crank.length", "crank.q", "crank.rate"]
    derivatives = mech.sensitivity(["crank.drive", "piston.C.p"], numbers, at=[0.0, 0.3])
    moves = [[True, False], [False, False], [True, False], [False, False]]
    assert derivatives.jumps["crank.drive"].tolist() == moves
    assert not derivatives.jumps["piston.C.p"].any()
    text = "no derivative by frame.O.y, crank.q at 1 of 2 samples: a pair with friction rests"
    assert text in derivatives.text()
    forward, backward = mech.run(at=[1e-9, -1e-9], want="piston.S.friction")["piston.S.friction"]
    assert forward == pytest.approx(-backward, rel=1e-6)
    assert abs(forward) > 1.0
    for number in ("frame.O.y", "crank.q"):  # the rest of the output has its derivative
        without = mech.sensitivity("crank.drive", number, at=0.0, friction="none")
        assert derivatives["crank.drive", number][0] == without["crank.drive", number][0]


def test_at_rest_it_is_the_rate_that_sets_all_pairs_going():
    numbers = ["dyad.l_i", "crank.q", "crank.rate", "crank.acceleration"]
    request = {"at": 0.3, "rates": 0.0, "accelerations": 0.0}
    derivatives = mechanism("ruiz_fourbar").sensitivity("crank.drive", numbers, **request)
    assert derivatives.jumps["crank.drive"][:, 0].tolist() == [False, False, True, False]


def test_a_table_of_numbers_reads_back(tmp_path):
    derivatives = mechanism("ruiz_fourbar").sensitivity(
        ["crank.drive", "dyad.C.p"], "dyad.l_*", at=[0.1, 0.2]
    )
    derivatives.to_csv(tmp_path / "s.csv")
    head, *rows = csv.reader((tmp_path / "s.csv").read_text("utf-8").splitlines())
    assert head[-2:] == ["per dyad.l_i [m]", "per dyad.l_j [m]"]
    assert [row[0] for row in rows] == ["crank.drive"] * 2 + ["dyad.C.p.x"] * 2 + ["dyad.C.p.y"] * 2
    assert float(rows[0][-2]) == derivatives["crank.drive", "dyad.l_i"][0]
    assert float(rows[-1][-1]) == derivatives["dyad.C.p", "dyad.l_j"][1].imag


@pytest.mark.parametrize(
    ("want", "to", "message"),
    [
        ("crank.drive", "dyad.li", 'did you mean "dyad.l_i"'),
        ("crank.drive", "dyad.branch", "dyad.branch: a whole number chooses"),
        ("crank.drive", "scene.drive.crank.rate", "it says how the drivers move"),
        ("crank.drive", ["dyad.b*"], "dyad.branch: a whole number chooses"),
        ("mechanism.friction_efficiency", "dyad.l_i", "a number or a vector a sample"),
        ("crank.drive", [], "give a name, or several"),
        (None, "dyad.l_i", "give a name, or several"),
    ],
)
def test_what_has_no_derivative_is_refused(want, to, message):
    with pytest.raises(RequestError, match=message.replace("?", r"\?")):
        mechanism("ruiz_fourbar").sensitivity(want, to, at=0.3)


def test_a_number_without_a_derivative_is_refused_beside_others_as_well():
    mech = mechanism("engine")
    to = ["crank.length", "blocks.gas.law.arguments[21]", "crank.sign"]
    with pytest.raises(RequestError) as error:
        mech.sensitivity("crank.drive", to, at=0.3)
    assert {p.where for p in error.value.problems} == {"gas.law.arguments[21]", "crank.sign"}
    derivatives = mech.sensitivity("crank.drive", ["crank.length", "gas.law.arg*"], at=0.3)
    assert list(derivatives.parameters) == ["crank.length"]


@pytest.mark.parametrize(
    ("to", "message"),
    [
        ("links.rocker.pose[2]", "a home only tells the assembly mode"),
        ("drivers.motor.rate", "it says how the drivers move"),
        ("joints.C.at[0].z", "the mechanism has no parameter with that address"),
    ],
)
def test_what_has_no_derivative_in_a_document_is_refused(to, message):
    linkage = bm.Linkage.load(JOINTS / "ruiz_fourbar.json").compile()
    with pytest.raises(RequestError, match=message):
        linkage.sensitivity("driver.motor.drive", to, at=0.3)


def test_linear_tolerance_is_what_many_designs_scatter():
    mech = mechanism("ruiz_fourbar")
    laws = {"dyad.l_i": bm.dist.Normal(6.0, 1e-4), "dyad.l_j": bm.dist.Uniform(2.999, 3.001)}
    laws["dyad.friction.C.radius"] = bm.dist.Normal(0.02, 1e-4)
    count = 4000
    tolerance = mech.tolerance(laws, ["crank.drive", "dyad.C.p"], samples=7, count=count)
    for name in tolerance:
        np.testing.assert_allclose(tolerance.shares(name).sum(axis=0), 1.0, rtol=1e-14)
        ratio = tolerance.sampled[name].deviation / tolerance[name]
        # Four standard errors of a deviation, for a normal distribution the largest of the three.
        np.testing.assert_allclose(ratio, 1.0, atol=4.0 / np.sqrt(2.0 * count))
    assert tolerance.shares("dyad.C.p")[2].max() == 0.0


def test_a_tolerance_is_drawn_and_told(tmp_path):
    laws = {"dyad.l_i": bm.dist.Normal(6.0, 1e-3), "dyad.l_j": bm.dist.Uniform(2.99, 3.01)}
    tolerance = mechanism("ruiz_fourbar").tolerance(laws, "crank.drive", samples=5, count=20)
    tolerance.plot(tmp_path / "t.png")
    assert (tmp_path / "t.png").read_bytes().startswith(b"\x89PNG")
    text = tolerance.text().splitlines()
    assert text[0].startswith("crank.drive: deviation up to ")
    assert text[1].startswith("20 designs: ")
    assert {line.split()[0] for line in text[3:]} == set(laws)


def test_designs_that_the_file_would_refuse_are_not_drawn():
    laws = {"dyad.friction.C.coefficient": bm.dist.Normal(0.1, 0.1)}
    with pytest.raises(bm.FormatError, match="coefficient must be >= 0, got -"):
        mechanism("ruiz_fourbar").tolerance(laws, "crank.drive", at=0.3, count=100)


@pytest.mark.parametrize("numbers", [None, ["dyad.l_i"], {}, {"dyad.l_i": 6.0}])
def test_a_tolerance_needs_distributions(numbers):
    with pytest.raises(RequestError, match="no distribution"):
        mechanism("ruiz_fourbar").tolerance(numbers, "crank.drive")


def test_tolerance_is_about_the_means():
    moved = mechanism("ruiz_fourbar").tolerance(
        {"dyad.l_i": bm.dist.Normal(6.1, 1e-3)}, "crank.drive", at=0.3
    )
    graph = bm.Graph.load(GRAPHS / "ruiz_fourbar.json").replace({"dyad.l_i": 6.1})
    derivatives = graph.compile().sensitivity("crank.drive", "dyad.l_i", at=0.3)
    assert moved["crank.drive"] == abs(derivatives["crank.drive", "dyad.l_i"]) * 1e-3


@pytest.mark.parametrize("make", [bm.Graph, bm.Linkage])
def test_parts_of_vectors_are_outputs_everywhere(make):
    folder = GRAPHS if make is bm.Graph else JOINTS
    mech = make.load(folder / "ruiz_fourbar.json").compile()
    vector = next(n for n in mech.outputs if n.endswith(".p") and "A" not in n)
    number = next(a for a, p in mech.parameters().items() if a.endswith(".mass") or "l_i" in a)
    want = [f"{vector}.x", vector, f"{vector}.y"]
    for engine in ("scalar", "numpy"):
        run = mech.run(samples=5, want=want, engine=engine)
        np.testing.assert_array_equal(run[want[0]] + 1j * run[want[2]], run[vector])
    assert run.unit(want[0]) == "m"
    derivatives = mech.sensitivity(want, [number], samples=5)
    np.testing.assert_array_equal(
        derivatives[want[0]] + 1j * derivatives[want[2]], derivatives[vector]
    )
    bands = mech.tolerance({number: bm.dist.Normal(6.0, 1e-3)}, want, samples=5, count=16)
    both = np.hypot(bands[want[0]], bands[want[2]])
    np.testing.assert_allclose(both, bands[vector], rtol=1e-12)
    assert set(bands.sampled) == set(want)
    assert want[0] not in list(mech.outputs)
    for wrong in (f"{vector}.z", f"{mech.drivers[0]}.q.x"):
        with pytest.raises(RequestError, match="no output has that name"):
            mech.run(samples=5, want=wrong)


def test_a_distribution_says_its_arguments_to_a_call_that_does_not_fit():
    with pytest.raises(TypeError, match=r'did you mean "deviation".*arguments: mean, deviation'):
        bm.dist.Normal(mean=6.0, std=0.1)
    with pytest.raises(TypeError, match=r"missing 1 required.*arguments: "):
        bm.dist.Uniform(1.0)
