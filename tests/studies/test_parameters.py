"""Every number has an address, and a document is made again with other numbers."""

import json

import numpy as np
import pytest

import blockmech as bm
from blockmech.model.parameters import parameters_of
from tests.gallery import GRAPHS, JOINTS, mechanism

FILES = [*sorted(GRAPHS.glob("*.json")), *sorted(JOINTS.glob("*.json"))]
SMALL = [path for path in FILES if path.stem not in ("n_four_bar", "parallelogram_chain")]


def document(path):
    return (bm.Linkage if path.parent.name == "joints" else bm.Graph).load(path)


def numbers(data):
    """Numbers in the data of a file, but for what is not computed with."""
    if isinstance(data, dict):
        sections = (x for key, x in data.items() if key not in ("version", "view", "expect"))
        return sum(map(numbers, sections))
    if isinstance(data, list):
        return sum(map(numbers, data))
    return isinstance(data, int | float) and not isinstance(data, bool)


@pytest.mark.parametrize("path", FILES, ids=lambda p: f"{p.parent.name}/{p.stem}")
def test_every_number_of_a_file_has_an_address(path):
    parameters = parameters_of(document(path).sections())
    assert len(parameters) >= numbers(document(path).to_data())
    assert len({p.path for p in parameters.values()}) == len(parameters)


@pytest.mark.parametrize("path", SMALL, ids=lambda p: f"{p.parent.name}/{p.stem}")
def test_the_same_numbers_make_the_same_mechanism(path):
    source = document(path)
    parameters = parameters_of(source.sections())
    again = source.replace({address: p.value for address, p in parameters.items()})
    assert parameters_of(again.sections()) == parameters


def test_a_place_is_replaced_by_a_text_with_its_unit():
    m = bm.read("graphs/joints/slider_crank.json")
    assert m.replace({"joints.B.at[0].x": "300 mm"}).joints["B"].at[0].z.real == pytest.approx(0.3)
    with pytest.raises(bm.BlockmechError, match="finite"):
        m.replace({"joints.B.at[0].x": "300 kg"})


def test_a_replaced_number_is_that_of_the_new_document_alone():
    graph = bm.Graph.load(GRAPHS / "engine.json")
    parameters = parameters_of(graph.sections())
    table = next(a for a in parameters if a.endswith("law.values[3]"))
    variant = graph.replace({table: np.float64(7.5), "frame.O.x": 0.5})
    changed = parameters_of(variant.sections())
    assert {a for a in parameters if changed[a].value != parameters[a].value} == {
        table,
        "frame.O.x",
    }
    assert changed[table].value == 7.5
    assert "expect" not in variant.to_data()
    assert parameters_of(graph.sections()) == parameters
    assert variant.compile().parameters()["frame.O.x"].value == 0.5


@pytest.mark.parametrize(
    "address",
    ["blocks.frame.markers.D.at[0]", "frame.markers.D.at.x", "frame.D.x", "frame.markers.D.at[0]"],
)
def test_addresses_are_those_of_the_file_as_well(address):
    graph = bm.Graph.load(GRAPHS / "ruiz_fourbar.json")
    assert graph.replace({address: 5.25}).blocks["frame"].markers["D"].at.z == 5.25


def test_of_a_linkage_sections_are_said_as_in_the_file_or_in_outputs():
    linkage = bm.Linkage.load(JOINTS / "ruiz_fourbar.json")
    link = next(name for name, link_data in linkage.links.items() if link_data.mass)
    for address in (f"links.{link}.mass", f"link.{link}.mass"):
        assert linkage.replace({address: 7.0}).links[link].mass == 7.0


def test_a_load_of_a_linkage_is_named_as_its_outputs_are():
    linkage = bm.Linkage("bar")
    linkage.add_link("rod", mass=1.0, cm=(1.0, 0.0))
    linkage.add_joint("O", "R", ["frame", "rod"], point=(0, 0))
    linkage.add_load("push", "force", link="rod", at=(2.0, 0.0), force=(0.0, 3.0))
    for address in ("loads.push.force.y", "load.push.force.y", "push.force.y"):
        assert linkage.replace({address: 7.0}).loads["push"].force.z == 7j


def test_wrong_addresses_are_told_together_with_the_nearest_one():
    graph = bm.Graph.load(GRAPHS / "ruiz_fourbar.json")
    with pytest.raises(bm.RequestError) as error:
        graph.replace({"dyad.l_k": 1.0, "fram.D.x": 2.0})
    first, second = error.value.problems
    assert first.code == second.code == "unknown-parameter"
    assert first.remedy == 'did you mean "dyad.l_j"?'
    assert second.remedy == 'did you mean "frame.D.x"?'
    with pytest.raises(bm.RequestError, match="given twice"):
        graph.replace({"frame.D.x": 1.0, "frame.markers.D.at.x": 1.0})


def test_values_are_refused_as_in_a_file_all_at_once():
    graph = bm.Graph.load(GRAPHS / "ruiz_fourbar.json")
    with pytest.raises(bm.FormatError) as error:
        graph.replace({"dyad.l_i": -1.0, "frame.D.x": float("nan"), "dyad.branch": 0.5})
    text = [p.where for p in error.value.problems]
    assert text == ["blocks.frame.markers.D.at", "blocks.dyad.l_i", "blocks.dyad.branch"]
    assert "must be > 0 m, got -1" in str(error.value)


def test_what_is_no_number_or_no_mapping_is_refused():
    graph = bm.Graph.load(GRAPHS / "ruiz_fourbar.json")
    for value in (np.array([6.1]), [6.1], "6.1", None, True, 6 + 0j):
        with pytest.raises(bm.FormatError, match="l_i must be a number in m"):
            graph.replace({"dyad.l_i": value})
    with pytest.raises(bm.RequestError, match="a mapping is meant"):
        graph.replace([("dyad.l_i", 6.1)])


def test_a_mechanism_lists_its_numbers_with_units():
    parameters = mechanism("ruiz_fourbar").parameters()
    assert parameters["dyad.l_i"].unit == "m"
    assert parameters["dyad.links.i.inertia"].unit == "kg m2"
    assert parameters["crank.offset"].unit == "rad"
    line = next(line for line in repr(parameters).splitlines() if line.startswith("dyad.l_i"))
    assert line.split() == ["dyad.l_i", "6", "m"]
    assert json.dumps([p.address for p in parameters.values()])


RATIOS = {  # of forces, and of components
    *("coefficient", "static", "kinetic", "exponent"),
    *("restitution", "efficiency", "friction", "direction", "dir"),
}
CHOICES = {"branch", "side", "sign", "slider", "turns", "teeth"}


def has_no_unit(path):
    """Whether the field with the number, or with the vector or list that has it, is a ratio."""
    field = next(
        part for part in reversed(path) if not isinstance(part, int) and part not in ("x", "y")
    )
    return field in RATIOS | CHOICES


@pytest.mark.parametrize("path", FILES, ids=lambda p: f"{p.parent.name}/{p.stem}")
def test_every_number_but_a_ratio_has_its_unit(path):
    parameters = parameters_of(document(path).sections()).values()
    assert {p.address for p in parameters if not p.unit and not has_no_unit(p.path)} == set()
    assert {p.address for p in parameters if p.unit and isinstance(p.value, int)} == set()


@pytest.mark.parametrize("document", [bm.Graph, bm.Linkage])
def test_forces_stiffnesses_and_sizes_of_laws_have_their_units(document):
    def units(name):
        folder = GRAPHS if document is bm.Graph else JOINTS
        parameters = parameters_of(document.load(folder / f"{name}.json").sections())
        return {address.rpartition(".")[2]: p.unit for address, p in parameters.items()}

    squeezer = units("andrews_squeezer")
    assert [squeezer[x] for x in ("stiffness", "free_length", "damping", "moment")] == [
        *("N/m", "m", "N s/m", "N m")
    ]
    assert [units("pump")[x] for x in ("stall_moment", "no_load_speed")] == ["N m", "rad/s"]
    engine = units("engine")
    assert [engine[x] for x in ("values[3]", "arguments[3]", "from")] == ["N", "rad", "rad"]
    assert [units("excavator")[x] for x in ("radius", "coefficient")] == ["m", ""]
    assert [units("elliptic_trammel")[x] for x in ("rate", "to")] == ["m/s", "m"]
    assert units("fivebar_falling")["rate"] == "rad/s"


def units_of(load, **blocks):
    parameters = parameters_of({"blocks": {"load": load, **blocks}})
    return {a.removeprefix("load."): p.unit for a, p in parameters.items() if a.startswith("load.")}


@pytest.mark.parametrize(
    ("element", "driver", "of", "units"),
    [
        (bm.Motor, None, "coordinate", ["N m", "N m/rad", "N m/rad2"]),
        (bm.Motor, None, "rate", ["N m", "N m s/rad", "N m s2/rad2"]),
        (bm.Motor, "slide", "coordinate", ["N m", "N m/m", "N m/m2"]),
        (bm.Thrust, None, "coordinate", ["N", "N/m", "N/m2"]),
        (bm.Thrust, "crank", "rate", ["N", "N s/rad", "N s2/rad2"]),
        (bm.Thrust, None, "time", ["N", "N/s", "N/s2"]),
    ],
)
def test_a_coefficient_has_the_unit_of_its_power(element, driver, of, units):
    drives = {"crank": bm.Crank(), "slide": bm.SlideDrive()}
    law = {"kind": "polynomial", "of": of, "coefficients": [1.0, 2.0, 3.0]}
    result = units_of(element(law=law, driver=driver), **drives)
    assert list(result.values())[:3] == units


def test_a_law_has_the_unit_of_what_its_element_gives():
    for element, unit, argument_unit in ((bm.Motor, "N m", "rad"), (bm.Thrust, "N", "m")):
        law = {"kind": "fourier", "mean": 2.0, "sines": [1.0], "period": 3.0}
        units = units_of(element(law=law))
        assert units == {"law.mean": unit, "law.sines[0]": unit, "law.period": argument_unit}
    assert units_of(bm.Force(force=(3.0, 4.0))) == {"force.x": "N", "force.y": "N"}


def test_a_torsional_load_along_a_guide_is_a_force_over_a_way():
    linkage = bm.Linkage.load(JOINTS / "slider_crank.json")
    guide = next(name for name, joint in linkage.joints.items() if joint.type == "P")
    linkage.add_load("damped", "torsion_spring", joint=guide, stiffness=2.0, damping=3.0)
    law = {"kind": "dc", "stall_moment": 4.0, "no_load_speed": 5.0}
    linkage.add_load("dc", "motor", joint=guide, law=law)
    parameters = linkage.compile().parameters()
    units = {a.split(".", 1)[1]: p.unit for a, p in parameters.items() if a.startswith("loads.d")}
    assert units["damped.stiffness"] == "N/m"
    assert units["damped.damping"] == "N s/m"
    assert units["dc.law.stall_moment"] == "N"
    assert units["dc.law.no_load_speed"] == "m/s"
