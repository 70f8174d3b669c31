"""What crosses the border is typed and checked once; what is inside does not change."""

from __future__ import annotations

import copy
import pickle
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

import blockmech as bm
from blockmech.testing import conformance
from tests.gallery import GRAPHS

RUIZ = bm.Graph.load(GRAPHS / "ruiz_fourbar.json")


def test_a_setting_is_refused_whatever_was_planned_before() -> None:
    mechanism = RUIZ.compile()
    mechanism.run(at=1.0, want="crank.drive", friction=bm.friction.Successive(iterations=1))
    for wrong in (True, 1.0):
        with pytest.raises(bm.RequestError, match="iterations"):
            mechanism.run(
                at=1.0, want="crank.drive", friction=bm.friction.Successive(iterations=wrong)
            )


def test_numbers_without_names_are_told_theirs() -> None:
    with pytest.raises(bm.GraphError, match=r"write RRR\(l_i=\.\.\., l_j=\.\.\.\)"):
        bm.RRR(6, 3)  # type: ignore[misc]


def test_a_name_alone_is_not_spelled_letter_by_letter(tmp_path: Any) -> None:
    mechanism, file = RUIZ.compile(), tmp_path / "a.svg"
    assert mechanism.limits(blocks="dyad") == mechanism.limits(blocks=["dyad"])
    assert [group.group for group in mechanism.modes(groups="dyad").groups] == ["dyad"]
    bm.draw.draw(mechanism, file, "mechanism", 1.0, trace="dyad.C")
    bm.draw.plot(mechanism.run(at=[0.0, 1.0]), file, "dyad.margin")
    with pytest.raises(bm.GraphError, match=r"joints\.J\.links: .* at least 2 values, has 1"):
        bm.Linkage().add_joint("J", "R", "frame", point=0j)


@pytest.mark.parametrize("value", [3, None, ["crank.drive", 3], 2.5])
def test_what_is_no_name_is_refused_where_names_are_asked(value: Any) -> None:
    mechanism = RUIZ.compile()
    for ask in (
        lambda: mechanism.run(at=1.0, want=value),
        lambda: mechanism.explain(value),
        lambda: mechanism.extremes(value),
        lambda: mechanism.sensitivity(value),
        lambda: mechanism.limits(blocks=value or 3),
        lambda: mechanism.modes(groups=value or 3),
        lambda: bm.Linkage().add_joint("J", "R", value, point=0j),
    ):
        with pytest.raises(bm.RequestError, match=r"give a name, or several|a text is meant"):
            ask()
    with pytest.raises(bm.RequestError, match=r'foo: no block "foo"\. blocks: crank, dyad'):
        mechanism.limits(blocks=["foo"])


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (lambda m, r: bm.draw.draw(r, "a.svg"), "subject: got <Result .* a graph, a linkage or a"),
        (lambda m, r: bm.draw.plot(m, "a.svg"), "result: got <Mechanism .* run it first: "),
        (lambda m, r: bm.draw.plot(r, 3), "path: got 3. a text or a path is meant"),
        (lambda m, r: bm.draw.plot([r, r]), r"got \[<Result of \w+: .* \.\.\. a .*plot\(ax=ax"),
        (lambda m, r: bm.draw.plot({"a": r}), r"one by one: a.plot\(ax=ax, label="),
        (lambda m, r: bm.Graph.load(None), "path: got None. a text or a path is meant"),
        (lambda m, r: bm.Graph.from_data([]), "data: got .* a mapping is meant"),
        (lambda m, r: m.impulses(None), "impact: got None. give one of the impacts of a motion"),
        (lambda m, r: r.to_csv(["a.csv"]), "path: got .* a text or a path is meant"),
        (lambda m, r: bm.draw.animate(m, frames="9", seconds="x"), r"(?s)frames: .*\n.*seconds: "),
        (lambda m, r: bm.Graph().start(3), "driver: got 3. a text is meant"),
        (lambda m, r: bm.Graph(drive=[1]), "drive: got .* a mapping is meant"),
        (lambda m, r: bm.Linkage().add_driver("a", "b", 3), "law: got 3. a law of motion such as"),
        (
            lambda m, r: bm.Linkage().add_load("a", bm.Link()),
            "load: .* a load such as .* a text",
        ),
        (lambda m, r: m.limits(at=3), "at: got 3. a mapping is meant"),
        (lambda m, r: m.run(at=1.0, accuracy="fine"), "accuracy: got 'fine'. a number is meant"),
        (lambda m, r: r[["crank.q", "dyad.margin"]], r"\['crank.q', 'dyad.margin'\]: the run did"),
        (lambda m, r: r.unit("crank.drvie"), 'no output has that name.*"crank.drive"'),
        (lambda m, r: r.to_csv("a\0.csv"), "no file has such a name"),
        (
            lambda m, r: m.objective(["dyad.l_i"], want="max(crank.drive)", at=1.0)("x"),
            "x: got 'x'",
        ),
        (
            lambda m, r: conformance(bm.RRR),
            "block: got <class .* a text or a block or a friction law",
        ),
    ],
)
def test_what_a_signature_says_is_asked_of_every_call(ask: Any, message: str) -> None:
    mechanism = RUIZ.compile()
    with pytest.raises(bm.RequestError, match=message):
        ask(mechanism, mechanism.run(at=1.0))


@pytest.mark.parametrize("built", [bm.Graph("a"), bm.Linkage("b")])
def test_what_only_a_mechanism_can_do_is_said_to_be_there(built: Any) -> None:
    for name in ("simulate", "outputs", "limits"):
        with pytest.raises(AttributeError, match=rf"write compile\(\)\.{name}$"):
            getattr(built, name)
    with pytest.raises(AttributeError, match=r"has no attribute 'simulat'$"):
        _ = built.simulat
    assert copy.deepcopy(built).name == built.name


def test_what_is_no_place_and_no_law_is_refused_as_such() -> None:
    with pytest.raises(bm.GraphError, match=r"joints\.J\.at: at must be a list"):
        bm.Linkage().add_joint("J", "P", ["a", "b"], at=3, slider=0)  # type: ignore[arg-type]
    with pytest.raises(bm.GraphError, match=r"Motor\.law.*no kind .*Crank"):
        bm.Motor(law=bm.Crank)  # type: ignore[arg-type]


def test_no_message_is_endless() -> None:
    with pytest.raises(bm.GraphError) as error:
        bm.Graph().connect("x" * 10_000, "crank.A")
    assert len(str(error.value)) < 3000


def test_mappings_of_blocks_and_scenes_do_not_change() -> None:
    dyad, drive = RUIZ.blocks["dyad"], RUIZ.scene.drive
    for change in (
        lambda: dyad.links.update(i=bm.Link(mass=1.0)),
        lambda: dyad.links["i"].markers.pop("S"),
        lambda: dyad.friction.clear(),
        lambda: drive.__setitem__("crank", 3),
        lambda: dyad.model_copy(update={"links": {}}).links.setdefault("i", 0),
    ):
        with pytest.raises(bm.GraphError, match="frozen"):
            change()
    for duplicate in (pickle.loads(pickle.dumps(dyad)), copy.deepcopy(dyad)):
        assert duplicate == dyad
        with pytest.raises(bm.GraphError, match="frozen"):
            duplicate.links.clear()


@pytest.mark.parametrize("name", ["stephenson_3_triad", "stephenson_2_class_4"])
def test_eight_threads_that_share_a_mechanism_find_what_one_finds(name: str) -> None:
    graph = bm.Graph.load(GRAPHS / f"{name}.json")
    alone = graph.compile()
    (driver,) = alone.drivers
    start = graph.scene.drive[driver].start if driver in graph.scene.drive else 0.0
    ways = [start + sign * np.linspace(0.0, 5.0, 21) for sign in (1, -1) for _ in range(4)]
    want = [f"{driver}.drive"]

    def found(mechanism: Any, at: Any) -> Any:
        options = {
            "friction": "none",
            "on_gap": "mark",
            "engine": "numpy",
        }  # of one engine: same bits
        return mechanism.run(at=at, want=want, **options)[want[0]]

    expected = [found(alone, at) for at in ways]
    for _ in range(2):
        shared = graph.compile()  # cold: all its knots are still to be laid
        with ThreadPoolExecutor(8) as pool:
            results = list(pool.map(lambda at, m=shared: found(m, at), ways))
        for result, other in zip(results, expected, strict=True):
            np.testing.assert_array_equal(result, other)
