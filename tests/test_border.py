"""What crosses the border is typed and checked once; what is inside does not change."""

from __future__ import annotations

import copy
import pickle
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

import blockmech as bm
from tests.gallery import GRAPHS

RUIZ = bm.Graph.load(GRAPHS / "ruiz_fourbar.json")


def test_a_setting_is_refused_whatever_was_planned_before() -> None:
    mechanism = RUIZ.compile()
    mechanism.run(at=1.0, want="crank.drive", friction="successive", iterations=1)
    for wrong in (True, 1.0):
        with pytest.raises(bm.RequestError, match="iterations"):
            mechanism.run(at=1.0, want="crank.drive", friction="successive", iterations=wrong)


def test_numbers_without_names_are_told_theirs() -> None:
    with pytest.raises(bm.GraphError, match=r"write RRR\(l_i=\.\.\., l_j=\.\.\.\)"):
        bm.RRR(6, 3)  # type: ignore[misc]


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
    for made in (pickle.loads(pickle.dumps(dyad)), copy.deepcopy(dyad)):
        assert made == dyad
        with pytest.raises(bm.GraphError, match="frozen"):
            made.links.clear()


@pytest.mark.parametrize("name", ["stephenson_3_triad", "stephenson_2_class_4", "watt_sixbar"])
def test_eight_threads_that_share_a_mechanism_find_what_one_finds(name: str) -> None:
    graph = bm.Graph.load(GRAPHS / f"{name}.json")
    alone = graph.compile()
    (driver,) = alone.drivers
    start = graph.scene.drive[driver].start if driver in graph.scene.drive else 0.0
    ways = [start + sign * np.linspace(0.0, 5.0, 21) for sign in (1, -1) for _ in range(4)]
    want = [f"{driver}.drive"]

    def found(mechanism: Any, at: Any) -> Any:
        return mechanism.run(at=at, want=want, friction="none", on_gap="mark")[want[0]]

    expected = [found(alone, at) for at in ways]
    for _ in range(3):
        shared = graph.compile()  # cold: all its knots are still to be laid
        with ThreadPoolExecutor(8) as pool:
            told = list(pool.map(lambda at, m=shared: found(m, at), ways))
        for one, other in zip(told, expected, strict=True):
            np.testing.assert_array_equal(one, other)
