"""Friction laws by themselves: numbers by hand, files, refusals, conformance, a stranger's law."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
import pytest

import blockmech as bm
from blockmech.friction.laws import LAWS, FrictionLaw, FrictionTerms
from blockmech.ground.errors import FormatError, GraphError
from blockmech.ground.values import NotNegative
from blockmech.model.schema import joints_schema
from blockmech.testing import ConformanceError, conformance
from tests.gallery import document

STRIBECK = {"static": 0.3, "kinetic": 0.2, "stribeck_speed": 0.5, "viscous": 0.01}
PIN = {"radius": 0.05}
BEARING = {"mean_diameter": 0.05, "f1": 0.0006, "f0": 2.0, "viscosity": 20e-6}
FILM = {"viscosity": 0.02, "radius": 0.025, "length": 0.05, "clearance": 2.5e-5}
TABLE = {"sommerfeld": [0.0, 0.05, 0.3, 2.0], "friction_variable": [3.0, 1.8, 6.5, 39.7]}
EXAMPLES = {
    "coulomb, pin": bm.friction.Coulomb(coefficient=0.2, radius=0.05),
    "coulomb, guide": bm.friction.Coulomb(coefficient=0.2, guide_length=0.3),
    "stiction": bm.friction.Stiction(static=0.3, kinetic=0.2, **PIN),
    "stribeck, pin": bm.friction.Stribeck(**STRIBECK, **PIN),
    "stribeck, guide": bm.friction.Stribeck(**STRIBECK, guide_length=0.3, exponent=1.0),
    "viscous": bm.friction.Viscous(damping=0.3),
    "preload": bm.friction.Preload(resistance=0.4),
    "rolling bearing": bm.friction.RollingBearing(**BEARING),
    "dahl": bm.friction.Dahl(kinetic=0.2, stiffness=300.0, **PIN),
    "lugre, pin": bm.friction.LuGre(**STRIBECK, stiffness=1e3, damping=0.9, **PIN),
    "lugre, guide": bm.friction.LuGre(**STRIBECK, stiffness=1e4, damping=9.0, guide_length=0.3),
    "elasto-plastic": bm.friction.ElastoPlastic(**STRIBECK, stiffness=1e3, breakaway=0.1, **PIN),
    "hydrodynamic": bm.friction.Hydrodynamic(**FILM),
    "hydrodynamic, table": bm.friction.Hydrodynamic(**FILM, **TABLE),
}


@pytest.mark.parametrize("name", EXAMPLES)
def test_every_law_keeps_the_contract(name):
    assert conformance(EXAMPLES[name]).measured


def test_laws_say_what_their_formulas_do():
    curve = bm.friction.Stribeck(**STRIBECK, exponent=1.5, **PIN).at(0.8).factor / 0.05
    assert curve == pytest.approx(0.2 + 0.1 * math.exp(-((0.8 / 0.5) ** 1.5)) + 0.008, rel=1e-15)
    assert bm.friction.Stiction(static=0.3, kinetic=0.2).at(1e-30) == (0.2, 0.0)
    assert bm.friction.Stiction(static=0.3, kinetic=0.2).at_rest() == (0.3, 0.0)
    assert bm.friction.Viscous(damping=0.3).at(2.0) == (0.0, 0.6)
    assert bm.friction.Preload(resistance=0.4).at_rest() == (0.0, 0.4)


def test_a_film_resists_by_petroffs_equation():
    drag = bm.friction.Hydrodynamic(**FILM).at(100.0).drag
    assert drag == pytest.approx(2 * math.pi * 0.02 * 0.025**3 * 0.05 / 2.5e-5 * 100, rel=1e-14)


def test_a_film_with_a_table_is_its_friction_variable_at_sommerfelds_number():
    law, speed, turns = EXAMPLES["hydrodynamic, table"], 60.0, 60.0 / math.tau
    scale = 1e3**2 * 0.02 * turns * 2 * 0.025 * 0.05  # S times the load
    for S, F in zip(TABLE["sommerfeld"][1:], TABLE["friction_variable"][1:], strict=True):
        factor, drag = law.at(speed, scale / S)
        assert factor * scale / S + drag == pytest.approx(F * 2.5e-5 * scale / S, rel=1e-12)
    beyond = law.at(speed, scale / 50.0)  # as an unloaded bearing
    assert beyond == (pytest.approx(0.0, abs=1e-18), pytest.approx(39.7 / 2 * 2.5e-5 * scale))
    assert law.at_rest() == (3.0 * 2.5e-5, 0.0)


def test_a_films_tangent_is_that_of_its_couple_and_none_is_steeper():
    law, loads = EXAMPLES["hydrodynamic, table"], np.logspace(0, 6, 61)
    for load in loads:
        factor, _ = law.at(60.0, load)
        step = 1e-5 * load
        ends = load - step, load + step
        low, high = (law.at(60.0, x).factor * x + law.at(60.0, x).drag for x in ends)
        assert (high - low) / (2 * step) == pytest.approx(factor, abs=2e-9)
        assert abs(factor) <= law.parameters().steepest


@pytest.mark.parametrize(("n", "part"), [(50.0, 160.0), (955.0, 19100.0 ** (2 / 3))])
def test_a_rolling_bearing_resists_as_the_catalogues_formula_in_their_units(n, part):
    """M0 = 1e-7 f0 part dm^3 [N mm] with dm [mm], part of nu [mm2/s] n [1/min]; M1 = f1 P1 dm."""
    factor, drag = bm.friction.RollingBearing(**BEARING).at(n * math.pi / 30)
    assert drag == pytest.approx(1e-7 * 2.0 * part * 50.0**3 / 1000, rel=1e-13)
    assert factor * 400.0 == pytest.approx(0.0006 * 400.0 * 50.0 / 1000, rel=1e-14)  # of 400 N


# -- files ---------------------------------------------------------------------------------


def four_bar(law):
    data = document("ruiz_fourbar")
    data["blocks"]["dyad"]["friction"] = dict.fromkeys("BCD", law)
    return data


@pytest.mark.parametrize("name", sorted(set(LAWS) - {"coulomb"}))
def test_files_keep_laws_and_their_numbers_have_addresses_and_units(name):
    law = next(x for x in EXAMPLES.values() if x.type_name == name)
    if "radius" in type(law).model_fields and not law.radius:
        law = law.model_copy(update={"radius": 0.05, "guide_length": None})
    graph = bm.Graph.from_data(four_bar(law))
    again = bm.Graph.from_data(graph.to_data())
    assert again.to_data() == graph.to_data()
    assert again.blocks["dyad"].friction["C"] == law
    assert graph.to_data()["blocks"]["dyad"]["friction"]["C"]["law"] == name
    known = graph.compile().parameters()
    own = {a.rpartition(".")[2]: p.unit for a, p in known.items() if ".friction.C." in a}
    assert own
    damping = "s/rad" if law.remembers else "N m s/rad"  # of a coefficient, or of a couple
    units = {"stribeck_speed": "rad/s", "damping": damping, "resistance": "N m"}
    units["stiffness"] = "1/rad"
    assert {key: own[key] for key in units if key in own}.items() <= units.items()


def test_units_are_those_of_the_pair():
    pin, guide = bm.friction.Viscous(damping=0.3), bm.friction.Stribeck(**STRIBECK)
    data = document("slider_crank")
    rod = next(b for b in data["blocks"].values() if b["type"] == "dyad.rrp")
    rod["friction"] = {
        "B": {"law": "viscous", "damping": 0.3},
        "S": {"law": "stribeck", **STRIBECK},
    }
    known = {
        a.partition(".friction.")[2]: p.unit
        for a, p in bm.Graph.from_data(data).compile().parameters().items()
    }
    assert known["B.damping"] == "N m s/rad"
    assert known["S.stribeck_speed"] == "m/s"
    assert known["S.viscous"] == "s/m"
    assert (pin.kinds, guide.kinds) == (("R", "P"), ("R", "P"))


def test_links_and_joints_take_laws_too():

    data = document("joints/ruiz_fourbar")
    data["joints"]["C"]["friction"] = {"law": "stribeck", **STRIBECK, **PIN}
    mech = bm.Linkage.from_data(data).compile()
    unit = {a: p.unit for a, p in mech.parameters().items()}["joints.C.friction.stribeck_speed"]
    assert unit == "rad/s"
    assert mech.verify(samples=9).ok
    assert "Stribeck" in joints_schema()["$defs"]


WRONG = {
    "exchanged": ({"law": "stiction", "static": 0.1, "kinetic": 0.2, **PIN}, "bad-friction"),
    "speed": ({"law": "stribeck", **STRIBECK, "stribeck_speed": -1.0, **PIN}, "wrong-value"),
    "exponent": ({"law": "stribeck", **STRIBECK, "exponent": 0.0, **PIN}, "wrong-value"),
    "no radius": ({"law": "stribeck", **STRIBECK}, "friction-mismatch"),
    "catalogue": ({"law": "rolling_bearing", **BEARING, "f0": 200.0}, "bad-friction"),
    "breakaway": (
        {"law": "elasto_plastic", **STRIBECK, "stiffness": 1e3, "breakaway": 0.2, **PIN},
        "bad-friction",
    ),
    "soft": ({"law": "dahl", "kinetic": 0.2, "stiffness": 0.0, **PIN}, "wrong-value"),
    "film": ({"law": "hydrodynamic", **FILM, "clearance": 0.02}, "bad-friction"),
    "range": (
        {"law": "hydrodynamic", **FILM, **TABLE, "sommerfeld": [0.01, 0.05, 0.3, 2.0]},
        "bad-friction",
    ),
    "rows": ({"law": "hydrodynamic", **FILM, **TABLE, "sommerfeld": [0.0, 0.05]}, "bad-table"),
    "name": ({"law": "stribek", **STRIBECK, **PIN}, "unknown-friction-law"),
    "no name": ({"law": 3, **PIN}, "unknown-friction-law"),
    "no object": (0.3, "wrong-type"),
    "key": ({"law": "viscous", "dampng": 0.3, "damping": 0.1}, "unknown-key"),
    "missing": ({"law": "viscous"}, "missing-key"),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_data_are_one_message(name):
    law, code = WRONG[name]
    with pytest.raises(FormatError) as wrong:
        bm.Graph.from_data(document("ruiz_fourbar") | {"blocks": only_c(law)})
    assert [p.code for p in wrong.value.problems] == [code]
    assert "friction.C" in wrong.value.problems[0].where


def only_c(law):
    blocks = document("ruiz_fourbar")["blocks"]
    blocks["dyad"]["friction"] = {"C": law}
    return blocks


def test_a_bearing_is_for_pins():
    with pytest.raises(GraphError, match="S is prismatic") as wrong:
        bm.SlideDrive(friction={"S": bm.friction.RollingBearing(**BEARING)})
    assert [p.code for p in wrong.value.problems] == ["friction-mismatch"]
    assert "coulomb" in wrong.value.problems[0].remedy


# -- a stranger's law ----------------------------------------------------------------------


def softened(speed, p):
    return FrictionTerms(p.coefficient * p.arm * speed / (speed + p.speed), 0.0)


@pytest.fixture
def registered():
    before = set(LAWS)
    yield
    for name in set(LAWS) - before:
        LAWS._types.pop(name)


def made(kernel, at_rest=None, **options):
    class Stranger(FrictionLaw):
        """A law that somebody else made."""

        drags = options.pop("drags", True)
        law: Literal["stranger"] = "stranger"
        coefficient: NotNegative = 0.1
        arm: NotNegative = 0.02
        speed: NotNegative = 0.3

        def kernel(self):
            return kernel

        def kernel_at_rest(self):
            return at_rest

    return Stranger


def test_a_strangers_law_is_known_in_files_and_obeyed(registered):
    law = made(softened, drags=False)
    assert LAWS["stranger"] is law
    assert conformance("stranger", {"coefficient": 0.2}).name == "stranger"
    g = bm.Graph.from_data(four_bar({"law": "stranger", "coefficient": 0.2}))
    assert g.compile().verify(samples=9).ok


BAD = {
    "drives": (lambda speed, p: FrictionTerms(-0.1 * speed, 0.0), True, "Friction does not drive"),
    "forgets its drag": (lambda p: FrictionTerms(0.1, 0.3), False, "set drags = True"),
    "swallows NaN": (
        lambda speed, p: FrictionTerms(0.0 * p.arm, max(0.0, 0.0) + 0.1),
        True,
        "NaN",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_a_law_that_breaks_its_contract_is_named(name, registered):
    kernel, drags, said = BAD[name]
    with pytest.raises(ConformanceError, match=said):
        conformance(made(kernel, drags=drags)())


def test_a_law_that_holds_less_than_it_resists_is_named(registered):
    weak = made(lambda p: FrictionTerms(0.1, 0.0), lambda p: FrictionTerms(0.05, 0.0))
    with pytest.raises(ConformanceError, match="more friction than what holds it"):
        conformance(weak())


def test_a_kernel_that_reads_what_is_not_there_is_refused(registered):
    def misspelt(velocity, p):
        return FrictionTerms(velocity, 0.0)

    with pytest.raises(TypeError, match=r"misspelt: a kernel of a friction law takes \(speed, p\)"):
        made(misspelt)()
    with pytest.raises(TypeError, match=r"takes \(p\)"):
        made(softened, softened)()


# -- engines and derivatives ---------------------------------------------------------------


@pytest.mark.parametrize("name", [n for n in EXAMPLES if "guide" not in n])
def test_engines_agree(name):
    mech = bm.Graph.from_data(four_bar(EXAMPLES[name])).compile()
    batch = mech.run(samples=12, engine="numpy", want="crank.drive")["crank.drive"]
    size = np.abs(batch).max()
    for engine in ("scalar", "llvm"):
        result = mech.run(samples=12, engine=engine, want="crank.drive")["crank.drive"]
        assert np.abs(result - batch).max() <= 1e-13 * size
    single = mech.run(samples=12, precision="complex64", want="crank.drive")["crank.drive"]
    assert np.abs(single - batch).max() <= 1e-4 * size
    longer = mech.run(samples=12, precision="clongdouble", want="crank.drive")["crank.drive"]
    assert np.abs(longer - batch).max() <= 1e-13 * size


@pytest.mark.parametrize(
    "key", ["static", "kinetic", "stribeck_speed", "exponent", "viscous", "radius"]
)
def test_derivatives_by_the_numbers_of_a_law(key):
    law = {"law": "stribeck", **STRIBECK, "exponent": 1.7, **PIN}
    mech = bm.Graph.from_data(four_bar(law)).compile()
    address = f"dyad.friction.C.{key}"
    sensitivity = mech.sensitivity(at=[1.0, 2.0], rates=0.4, to=[address], want="crank.drive")
    slope = sensitivity["crank.drive", address]
    h = 1e-4 * mech.parameters()[address].value

    def drive(shift):
        other = four_bar(law | {key: law[key] + shift})
        other["blocks"]["dyad"]["friction"] |= dict.fromkeys("BD", law)
        return (
            bm.Graph.from_data(other)
            .compile()
            .run(at=[1.0, 2.0], rates=0.4, want="crank.drive")["crank.drive"]
        )

    expected = (8 * (drive(h) - drive(-h)) - (drive(2 * h) - drive(-2 * h))) / (12 * h)
    assert np.abs(slope - expected).max() <= 1e-7 * np.abs(expected).max()


# The four-bar of [R10] at 10 rad/s, fc 0.3, fs 0.5, ws 2 rad/s, exponent 2, f2 0.001 s/rad in pins
# of 7.5 mm, worked out in maximal coordinates by a program that knows nothing of blockmech:
# crank [rad], coefficients at B, C, D, couples [N m] at B on i, at C on i, at D on j,
# reactions [N].
STRIBECK_FOURBAR = [
    (1.0, (0.3101834, 0.30661689, 0.30643641), (9.43926331, 1.70640077, -2.62875402),
     (4057.49773859, 742.03382238, 1143.795332)),
    (2.0, (0.30907498, 0.30564975, 0.30649269), (5.77942476, 4.48964953, -5.55612091),
     (2493.21371628, 1958.51602548, 2417.07595141)),
    (3.0, (0.30757732, 0.46380359, 0.31585894), (11.49405861, 2.07494249, -1.6766695),
     (4982.62084133, 596.50033403, 707.77142054)),
]  # fmt: skip


@pytest.mark.parametrize("engine", ["scalar", "numpy", "llvm"])
def test_a_fourbar_with_stribeck_pins_has_the_couples_of_an_outside_program(engine):
    if engine == "llvm":
        pytest.importorskip("llvmlite", reason="machine code needs the extra fast")
    data = document("ruiz_fourbar")
    law = {"law": "stribeck", "static": 0.5, "kinetic": 0.3, "stribeck_speed": 2.0}
    law |= {"exponent": 2.0, "viscous": 0.001, "radius": 0.0075}
    data["blocks"]["dyad"] |= {"friction": dict.fromkeys("BCD", law)}
    mech = bm.Graph.from_data(data | {"expect": []}).compile()
    at, coefficients, couples, reactions = map(np.array, zip(*STRIBECK_FOURBAR, strict=True))
    run = mech.run(at=at, rates=10.0, engine=engine)
    on_i = {"B": 1.0, "C": -1.0, "D": 1.0}  # friction is that on the later link: j at C
    for k, pin in enumerate("BCD"):
        load = np.abs(run[f"dyad.{pin}.reaction"])
        friction = run[f"dyad.{pin}.friction"]
        assert load == pytest.approx(reactions[:, k], abs=1e-8)
        assert on_i[pin] * friction == pytest.approx(couples[:, k], abs=1e-8)
        assert np.abs(friction) / (0.0075 * load) == pytest.approx(coefficients[:, k], abs=1e-8)
