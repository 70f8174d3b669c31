"""A graph as a block of another one equals its blocks written out, and says where inside."""

from __future__ import annotations

import json
from random import Random

import numpy as np
import pytest

import blockmech as bm
from blockmech.ground.errors import FormatError, GraphError, RequestError
from blockmech.model.flat import renamed
from blockmech.model.subgraph import Resolver, resolving
from blockmech.testing.strategies import Options, random_mechanism
from tests import machines

BAR = bm.Link(mass=7.2, inertia=5.5, cm=(1.5, 0.3))


def knee() -> bm.Graph:
    """A dyad without supports; its shin and thigh have names."""
    graph = bm.Graph("knee")
    graph.add("dyad", bm.RRR(l_i=6, l_j=3, links={"j": BAR}))
    graph.parameters |= {"shin": "dyad.l_j", "thigh": ["dyad.l_i"]}
    return graph


def two_knees(first, second, join=".") -> bm.Graph:
    """A crank and two dyads in a row, which are parts ``a`` and ``b``."""
    graph = bm.Graph("legs", gravity=(0.0, -9.81))
    graph.add("frame", bm.Frame(markers={"A": (0, 0), "D": (5.5, 0), "E": (9, 0)}))
    graph.add("crank", bm.Crank(length=2, links={"crank": BAR}))
    graph.add(f"a{join}dyad" if join != "." else "a", first)
    graph.add(f"b{join}dyad" if join != "." else "b", second)
    return machines.wire(
        graph,
        "frame.A crank.A",
        f"crank.B a{join}dyad.B",
        f"frame.D a{join}dyad.D",
        f"a{join}dyad.C b{join}dyad.B",
        f"frame.E b{join}dyad.D",
    )


def same(result, expected, called=lambda name: name.replace("a.", "a-", 1).replace("b.", "b-", 1)):
    """Raise where an output of two runs differs in a bit."""
    assert len(result.mechanism.outputs) == len(expected.mechanism.outputs)
    for name in result.mechanism.outputs:
        a, b = result[name], expected[called(name)]
        assert np.array_equal(np.asarray(a), np.asarray(b), equal_nan=True), name


def written_out():
    second = bm.RRR(l_i=5.0, l_j=3.3, links={"j": BAR})
    return two_knees(bm.RRR(l_i=6, l_j=3, links={"j": BAR}), second, "-")


def test_one_library_twice_with_other_numbers_equals_its_blocks():
    longer = bm.Subgraph(graph=knee(), parameters={"shin": 3.3, "thigh": 5.0})
    graph = two_knees(knee(), longer)
    assert graph.check() == []
    same(graph.run(at=np.linspace(0, 1, 30)), written_out().run(at=np.linspace(0, 1, 30)))
    again = bm.Graph.from_json(graph.to_json())
    assert again.to_json() == graph.to_json()
    same(again.run(at=[0.3]), graph.run(at=[0.3]), str)


def test_files_are_found_from_the_document_and_follow_it_into_other_folders(tmp_path, monkeypatch):
    (tmp_path / "legs").mkdir()
    knee().save(tmp_path / "legs" / "knee.json")
    monkeypatch.chdir(tmp_path)
    longer = bm.Subgraph(file="legs/knee.json", parameters={"shin": 3.3, "thigh": 5.0})
    graph = two_knees(bm.Subgraph(file="legs/knee.json"), longer)
    (tmp_path / "far").mkdir()
    graph.save(tmp_path / "far" / "robot.json")
    monkeypatch.chdir(tmp_path / "legs")
    loaded = bm.Graph.load(tmp_path / "far" / "robot.json")
    assert loaded.blocks["a"].file == "../legs/knee.json"
    same(loaded.run(at=[0.2, 0.4]), written_out().run(at=[0.2, 0.4]))
    loaded.save(tmp_path / "robot.json")
    assert bm.Graph.load(tmp_path / "robot.json").blocks["a"].file == "legs/knee.json"


def test_libraries_are_found_by_folder_and_by_package(tmp_path, monkeypatch):
    package = tmp_path / "acme_legs"
    package.mkdir()
    (package / "__init__.py").write_text("", encoding="utf-8")
    knee().save(package / "knee.json")
    point = tmp_path / "acme-1.0.dist-info"
    point.mkdir()
    (point / "METADATA").write_text(
        "Metadata-Version: 2.1\nName: acme\nVersion: 1.0\n", encoding="utf-8"
    )
    (point / "entry_points.txt").write_text(
        "[blockmech.libraries]\nacme = acme_legs\n", encoding="utf-8"
    )
    monkeypatch.syspath_prepend(tmp_path)
    by_package = two_knees(knee(), bm.Subgraph(file="acme/knee.json"))
    monkeypatch.setenv("BLOCKMECH_PATH", str(package))
    by_folder = two_knees(knee(), bm.Subgraph(file="knee.json"))
    same(by_package.run(at=[1.9]), by_folder.run(at=[1.9]), str)
    by_folder.save(tmp_path / "robot.json")
    assert bm.Graph.load(tmp_path / "robot.json").blocks["b"].file == "knee.json"


def test_graphs_inside_of_graphs_inside(tmp_path):
    leg = bm.Graph("leg")
    leg.add("upper", knee())
    leg.add("lower", bm.Subgraph(graph=knee(), parameters={"thigh": 5.0}))
    leg.connect("upper.dyad.C", "lower.dyad.B")
    leg.parameters["length"] = "lower.shin"
    leg.save(tmp_path / "leg.json")
    graph = bm.Graph("robot", gravity=(0.0, -9.81))
    graph.add("frame", bm.Frame(markers={"A": (0, 0), "D": (5.5, 0), "E": (9, 0)}))
    graph.add("crank", bm.Crank(length=2, links={"crank": BAR}))
    graph.add("leg", bm.Subgraph(file=str(tmp_path / "leg.json"), parameters={"length": 3.3}))
    machines.wire(
        graph,
        "frame.A crank.A",
        "crank.B leg.upper.dyad.B",
        "frame.D leg.upper.dyad.D",
        "frame.E leg.lower.dyad.D",
    )
    names = {"leg.upper.": "a-", "leg.lower.": "b-"}

    def called(name):
        for prefix, flat in names.items():
            name = name.replace(prefix, flat)
        return name

    same(graph.run(at=[0.2, 0.9]), written_out().run(at=[0.2, 0.9]), called)
    assert graph.compile().parameters()["leg.length"].value == 3.3
    variant = graph.replace({"leg.length": 3.5, "leg.upper.shin": 3.1})
    assert variant.flat().blocks["leg.lower.dyad"].l_j == 3.5
    assert variant.flat().blocks["leg.upper.dyad"].l_j == 3.1


def arm() -> bm.Graph:
    """An arm on its own frame: two such stand on each other."""
    graph = bm.Graph("arm", drive={"joint": bm.motion.ConstantRate(rate=2.0)})
    graph.add("base", bm.Frame(markers={"O": (0.1, 0.2), "G": {"at": (0.0, 0.3), "angle": 0.4}}))
    graph.add("joint", bm.Crank(length=1.5, links={"crank": BAR}))
    graph.add("slider", bm.SlideDrive())
    return machines.wire(graph, "base.O joint.A", "base.G slider.S")


def test_a_frame_inside_stands_on_a_link_or_is_the_outer_frame():
    graph = bm.Graph("arms")
    graph.add("lower", arm())
    graph.add("upper", bm.Subgraph(graph=arm(), on="lower.joint.B"))
    assert graph.check() == []
    drivers = ("lower.joint", "lower.slider", "upper.joint", "upper.slider")
    assert graph.compile().drivers == drivers
    at = dict(zip(drivers, (0.3, 0.7, 0.5, 0.2), strict=True))
    run = graph.run(at={d: [x] for d, x in at.items()}, rates=dict.fromkeys(drivers, 1.0))
    tip = (0.1 + 0.2j) + np.exp(0.3j) * (1.5 + (0.1 + 0.2j) + np.exp(0.5j) * 1.5)
    assert abs(run["upper.joint.B.p"][0] - tip) < 1e-15
    guide = (0.1 + 0.2j) + np.exp(0.3j) * (1.5 + 0.3j + 0.2 * np.exp(0.4j))
    assert abs(run["upper.slider.slider.p"][0] - guide) < 1e-15
    assert graph.compile().scene.drive["upper.joint"].rate == 2.0


def test_frames_that_stand_on_each_other_are_one_problem():
    graph = bm.Graph("arms")
    graph.add("lower", bm.Subgraph(graph=arm(), on="upper.base.O"))
    graph.add("upper", bm.Subgraph(graph=arm(), on="lower.base.O"))
    assert [p.code for p in graph.check()] == ["cycle"]


@pytest.mark.parametrize("seed", range(24))
def test_any_blocks_of_a_mechanism_may_be_a_part(seed):
    """Some moving blocks of a random mechanism inside of a graph: the same to the last bit."""
    chance = Random(seed)
    options = Options(drivers=(1, 2), groups=(2, 4), friction=bool(seed % 2), springs=True)
    case = random_mechanism(chance, options)
    source, part, graph, plain = case.graph, bm.Graph("part"), bm.Graph("whole"), bm.Graph("plain")
    inside = {n for n in source.blocks if n != "frame" and chance.random() < 0.5} or {"drive1"}

    def called(name, sign):
        head, dot, rest = name.partition(".")
        return f"part{sign}{head}{dot}{rest}" if head in inside else name

    for g in (graph, plain):
        g.gravity = source.gravity
    graph.add("frame", source.blocks["frame"])
    graph.blocks["part"] = bm.Subgraph(graph=part)
    for name, block in source.blocks.items():
        (part if name in inside else graph).blocks[name] = block
        plain.blocks[called(name, "-")] = renamed(block, lambda d: called(d, "-"))
    del graph.blocks["part"]
    for name in list(graph.blocks):  # what is outside refers to what is inside by its way in
        graph.blocks[name] = renamed(graph.blocks[name], lambda d: called(d, "."))
    outer = []
    for wire in source.wires:
        heads = {end.partition(".")[0] for end in wire.ends}
        (part.wires if heads <= inside else outer).append(wire)
        plain.connect(called(wire.source, "-"), called(wire.target, "-"))
    back = [w for w in outer if w.source.partition(".")[0] in inside]
    graph.add("part", part)
    for wire in outer:
        graph.connect(called(wire.source, "."), called(wire.target, "."))
    assert graph.check() == [], back

    def request(sign):
        at, rates, accelerations = (
            {called(d, sign): x for d, x in case.request[key].items()}
            for key in ("at", "rates", "accelerations")
        )
        return {"at": at, "rates": rates, "accelerations": accelerations, "on_gap": "mark"}

    again = bm.Graph.from_json(graph.to_json())
    names = lambda name: name.replace("part.", "part-")  # noqa: E731
    same(again.run(**request(".")), plain.run(**request("-")), names)


def test_studies_and_derivatives_reach_inside():
    longer = bm.Subgraph(graph=knee(), parameters={"shin": 3.3, "thigh": 5.0})
    mech, plain = two_knees(knee(), longer).compile(), written_out().compile()
    sensitivity = mech.sensitivity("crank.drive", to=["b.shin", "a.thigh"], at=[1.3, 1.8])
    expected = plain.sensitivity("crank.drive", to=["b-dyad.l_j", "a-dyad.l_i"], at=[1.3, 1.8])
    assert np.array_equal(sensitivity["crank.drive"], expected["crank.drive"])


def test_derivatives_follow_a_number_that_moves_a_frame():
    graph = bm.Graph("arms")
    graph.add("lower", arm())
    graph.add("upper", bm.Subgraph(graph=arm(), on="lower.joint.B"))
    at = {"lower.joint": [0.3], "lower.slider": 0.1, "upper.joint": 0.5, "upper.slider": 0.2}
    want = "max(upper.joint.B.p.x)"
    study = graph.compile().study({"lower.joint.length": [1.5, 2.0]}, want=want, at=at)
    longer = graph.replace({"lower.joint.length": 2.0}).run(at=at)["upper.joint.B.p"][0]
    assert abs(study[want][1] - longer.real) < 1e-14
    slope = graph.compile().sensitivity(want, to="lower.joint.length", at=at)
    assert abs(float(np.ravel(slope[want])[0]) - np.cos(0.3)) < 1e-14


def refused(make) -> list[str]:
    with pytest.raises((FormatError, GraphError, RequestError)) as caught:
        make()
    return [f"{p.code} {p.where}" for p in caught.value.problems]


def test_each_mistake_is_one_message_that_says_where_inside(tmp_path):
    def part(**fields):
        return lambda: bm.Graph("g").add("knee", bm.Subgraph(**fields))

    where = "blocks.knee"
    assert refused(part(file="no.json")) == [f"no-file {where}.file"]
    assert refused(part(graph=knee(), parameters={"shin": -1.0})) == [
        f"wrong-value {where}.parameters"
    ]
    unknown = refused(part(graph=knee(), parameters={"shim": 1.0}))
    assert unknown == [f"unknown-parameter {where}.parameters.shim"]
    bad = {"blocks": {"dyad": {"type": "dyad.rrr", "l_i": -1.0, "l_j": 1.0}}}
    assert refused(part(graph=bad)) == [f"wrong-value {where}.graph.blocks.dyad.l_i"]
    bad = knee()
    bad.parameters["hip"] = "dyad.hip"
    assert refused(part(graph=bad)) == [f"unknown-parameter {where}.graph.parameters.hip"]
    bad.parameters["hip"] = ["dyad.l_i", "dyad.links.j.mass"]
    assert refused(part(graph=bad)) == [f"wrong-value {where}.graph.parameters.hip"]
    graph = two_knees(knee(), knee())
    graph.add("arm", bm.Subgraph(graph=arm(), on="a.dyad.X"))
    assert [f"{p.code} {p.where}" for p in graph.check()] == ["unknown-marker arm.on"]


def test_a_file_that_holds_itself_is_told(tmp_path):
    for outer, inner in (("a", "b"), ("b", "a")):
        text = {"format": "blockmech/graph", "version": 1, "name": outer, "wires": []}
        text["blocks"] = {"part": {"type": "graph", "file": f"{inner}.json"}}
        (tmp_path / f"{outer}.json").write_text(json.dumps(text), encoding="utf-8")
    with pytest.raises(FormatError, match=r"a.json -> b.json -> a.json") as caught:
        bm.Graph.load(tmp_path / "a.json")
    assert len(caught.value.problems) == 1


@pytest.mark.parametrize("text", ["hunter2-and-more", '{"key": "hunter2"}', '["hunter2"]', ""])
def test_a_file_that_is_no_graph_is_not_quoted(text, tmp_path):
    (tmp_path / "secret").write_text(text, "utf-8")
    part = bm.Subgraph(file=str(tmp_path / "secret"))
    with pytest.raises(FormatError, match="is no graph") as caught:
        two_knees(knee(), part)
    assert "hunter2" not in str(caught.value)
    assert [f"{p.code} {p.where}" for p in caught.value.problems] == ["no-graph blocks.b.file"]


def test_within_a_folder_no_file_outside_of_it_is_read(tmp_path):
    knee().save(tmp_path / "knee.json")
    (tmp_path / "in").mkdir()
    knee().save(tmp_path / "in" / "knee.json")
    (tmp_path / "in" / "link.json").symlink_to(tmp_path / "knee.json")
    with resolving(Resolver(str(tmp_path / "in"))):
        two_knees(knee(), bm.Subgraph(file=str(tmp_path / "in" / "knee.json")))
        for file in ("in/../knee.json", "in/link.json", "knee.json"):
            with pytest.raises(FormatError, match="outside of the folder"):
                two_knees(knee(), bm.Subgraph(file=f"{tmp_path}/{file}"))


def nested(folder, files, times):
    """Files of a graph each, in which the next one stands several times; the first is given."""
    knee().save(folder / f"{files}.json")
    for level in range(files - 1, 0, -1):
        part = {"type": "graph", "file": f"{level + 1}.json"}
        data = {"format": "blockmech/graph", "version": 1, "name": "g"}
        data["blocks"] = {f"k{i}": part for i in range(times)}
        (folder / f"{level}.json").write_text(json.dumps(data), "utf-8")
    return folder / "1.json"


def test_more_blocks_than_a_mechanism_has_are_one_message(tmp_path):
    with pytest.raises(FormatError, match=r"9\.json: blocks: 64000 blocks .* 10000") as caught:
        bm.Graph.load(nested(tmp_path, 12, 40)).compile()
    assert [p.code for p in caught.value.problems] == ["too-large"]
    outer = bm.Graph("outer")
    for name in "ab":
        outer.add(name, bm.Subgraph(file=str(tmp_path / "11.json")))
    assert outer.size == len(outer.flat().blocks) == 80
    with resolving(Resolver(blocks=79)), pytest.raises(GraphError, match="80 blocks"):
        outer.flat()


def test_whoever_opens_bounds_depth_and_size_of_what_is_read(tmp_path):
    with pytest.raises(FormatError, match="nested more than 20 deep") as caught:
        bm.Graph.load(nested(tmp_path, 30, 2))
    assert [p.code for p in caught.value.problems] == ["too-deep"]
    first = nested(tmp_path, 3, 2)
    for bounds in ({"depth": 1}, {"size": first.stat().st_size + 100}, {"blocks": 3}):
        with resolving(Resolver(**bounds)), pytest.raises(bm.BlockmechError) as caught:
            bm.Graph.load(first)
        assert [p.code.partition("-")[0] for p in caught.value.problems] == ["too"]
    with resolving(Resolver(blocks=4, depth=2)):
        assert bm.Graph.load(first).size == 4


def test_a_file_is_read_once_and_many_parts_take_time_like_few(tmp_path, monkeypatch):
    from blockmech.model import document, graph

    knee().save(tmp_path / "knee.json")
    crowd = bm.Graph("crowd")
    crowd.add("frame", bm.Frame(markers={"A": (0, 0), "D": (5.5, 0)}))
    crowd.add("crank", bm.Crank(length=2))
    crowd.connect("frame.A", "crank.A")
    data = crowd.to_data()
    data["blocks"] |= {f"k{i}": {"type": "graph", "file": "knee.json"} for i in range(60)}
    for i in range(60):
        data["wires"].append({"from": "crank.B", "to": f"k{i}.dyad.B"})
        data["wires"].append({"from": "frame.D", "to": f"k{i}.dyad.D"})
    (tmp_path / "crowd.json").write_text(json.dumps(data), "utf-8")
    reads, sizes = [], []
    text_of, flattened = document.text_of, graph.flattened
    monkeypatch.setattr(document, "text_of", lambda path: reads.append(path) or text_of(path))
    monkeypatch.setattr(graph, "flattened", lambda g: sizes.append(g.size) or flattened(g))
    loaded = bm.Graph.load(tmp_path / "crowd.json")
    assert len(reads) == 2
    assert sum(sizes) < 3 * loaded.size
    sizes.clear()
    for i in range(60):
        crowd.add(f"k{i}", knee())
        machines.wire(crowd, f"crank.B k{i}.dyad.B", f"frame.D k{i}.dyad.D")
    assert sum(sizes) < 20 * loaded.size  # the square is 60 times as much
    assert crowd.structure().formula == loaded.structure().formula


def test_what_is_unknown_inside_is_kept_and_told_where_it_is(tmp_path):
    data = knee().to_data()
    data["blocks"]["hand"] = {"type": "acme.hand", "fingers": 5}
    (tmp_path / "knee.json").write_text(json.dumps(data), encoding="utf-8")
    graph = two_knees(knee(), bm.Subgraph(file=str(tmp_path / "knee.json")))
    assert [f"{p.code} {p.where}" for p in graph.check()] == ["unknown-block b.hand"]


def test_wires_into_a_part_are_checked_like_others():
    graph = two_knees(knee(), knee())
    assert refused(lambda: graph.connect("frame.A", "a.dyad.C")) == ["unknown-joint a.dyad.C"]
    assert refused(lambda: graph.connect("frame.A", "a.dyd.B")) == ["no-such-block a.dyd.B"]
    assert refused(lambda: graph.connect("frame.A", "a.dyad.B")) == ["double-wire a.dyad.B"]
    graph.wires.pop()
    assert [f"{p.code} {p.where}" for p in graph.check()] == ["unwired-joint b.dyad.D"]


def geared(join: str) -> bm.Graph:
    """Two cranks that a gear pair couples, and a controller that holds the first one's rate."""
    graph = bm.Graph("drive", gravity=(0.0, -9.81))
    parts = {
        "frame": bm.Frame(markers={"A": (0, 0), "E": (0.3, 0)}),
        "sun": bm.Crank(length=0.1, links={"crank": BAR}),
        "planet": bm.Crank(length=0.2, links={"crank": BAR}),
        "pair": bm.Gear(driver=f"{join}sun", driven=f"{join}planet", teeth=(20, 40)),
        "motor": bm.Motor(law={"kind": "signal"}),
        "pid": bm.signals.Pid(kp=20.0, ki=4.0),
    }
    for name, block in parts.items():
        graph.add(name if name == "frame" else f"{join}{name}", block)
    wires = ["frame.A .sun.A", "frame.E .planet.A", "frame.A .motor.a", ".sun.crank .motor.b"]
    wires += [".sun.rate .pid.u", ".pid.y .motor.law"]
    for ends in wires:
        graph.connect(*(e.replace(".", join, 1) if e[0] == "." else e for e in ends.split()))
    return graph


def test_couplings_signals_and_starts_inside_keep_their_names():
    part = geared("")
    part.start("sun", rate=3.0)
    graph = bm.Graph("whole", gravity=(0.0, -9.81))
    graph.add("frame", bm.Frame())
    graph.add("unit", part)
    plain = geared("unit-")
    plain.start("unit-sun", rate=3.0)
    assert graph.check() == plain.check() == []
    options = {"method": "dop853", "times": [0.1, 0.5], "want": ["*"]}
    runs = [g.compile().simulate("time=0.5", **options) for g in (graph, plain)]
    for name in ("unit.planet.q", "unit.sun.rate", "unit.pid.y", "unit.planet.A.reaction"):
        values, expected = runs[0][name], runs[1][name.replace("unit.", "unit-")]
        assert np.array_equal(values, expected), name
