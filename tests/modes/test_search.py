"""Groups without a polynomial: a search finds modes, and says that there may be more."""

from __future__ import annotations

import numpy as np
import pytest

import blockmech as bm
from blockmech.modes.file_pose import file_poses
from blockmech.modes.listing import _Lister
from tests.gallery import GRAPHS


def test_the_search_finds_of_a_triad_what_its_polynomial_has() -> None:
    mechanism = bm.Graph.load(GRAPHS / "stephenson_3_triad.json").compile()
    listed = mechanism.modes(arcs=False)["triad"].samples[0]
    stands = file_poses(mechanism, [{"crank": 0.0}])
    block = mechanism.structure.blocks["triad"]
    outer = [joint.name for joint in block.joints.values() if joint.outer]
    (found,) = _Lister(mechanism, stands, "")._modes("triad", None, outer)
    assert len(found) == len(listed)
    for mode in listed:
        x, y, angle = mode.links["plate"]
        assert any(
            abs(m.links["plate"].o - complex(x, y)) < 1e-9
            and abs(m.links["plate"].e - np.exp(1j * angle)) < 1e-9
            for m in found
        )


def test_modes_of_a_group_of_class_4_are_listed_and_each_can_be_put_into_the_file() -> None:
    graph = bm.Graph.load(GRAPHS / "stephenson_2_class_4.json")
    result = graph.compile().modes(arcs=False)["loop"]
    assert "there may be more" in result.note
    (modes,) = result.samples
    assert len(modes) == 6  # complex solutions come in pairs: of six real ones none is missed alone
    assert [mode.chosen for mode in modes].count(True) == 1
    angles = {round(mode.links["coupler"][2], 6) for mode in modes}
    assert len(angles) == 6
    for mode in modes:
        data = graph.to_data()
        data["blocks"]["loop"]["home"] = mode.put["home"]
        data.pop("expect", None)
        run = bm.Graph.from_data(data).run(at=0.0, rates=0.0, want="loop.coupler.angle")
        turned = run["loop.coupler.angle"][0] - mode.links["coupler"][2]
        assert np.exp(1j * turned) == pytest.approx(1.0, abs=1e-9)
