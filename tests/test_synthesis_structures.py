"""Synthesis over structures: the structures are different, designs do what their table says.

That a six-bar meets what a four-bar cannot is on the page `docs/synthesis.md`, which is run.
"""

from __future__ import annotations

import numpy as np
import pytest

import blockmech as bm
from blockmech.synthesis import path_over_structures, structures
from blockmech.synthesis.structures import blank

POINTS = np.array([0.5 + 2.2j, 0.9 + 2.9j, 0.4 + 3.2j, -0.4 + 3.1j, -1.2 + 2.6j, -1.6 + 2.0j])
ANGLES = np.radians([0, 40, 80, 120, 160, 200])


def test_structures_are_counted_by_hand():
    """Four links: one. Six: Watt's and Stephenson's chains, traced by links that need all dyads."""
    assert len(structures(4)) == 1
    result = structures(6)
    assert len(result) == len({s.name for s in result}) == 8
    for s in result:
        assert s.tracer not in s.chain[s.frame]
        assert s.crank in s.chain[s.frame]
        assert len(s.dyads) == 2


@pytest.mark.parametrize("links", [4, 6])
def test_every_structure_is_a_mechanism(links):
    for s in structures(links):
        mech = blank(s).compile()
        assert mech.drivers == ("crank",)
        assert len(mech.outputs.match("*.margin")) == len(s.dyads)
        run = mech.run(at=[0.0], want=mech.outputs.match("*.P.p"))
        assert np.isfinite([*run.values()]).all()


def test_a_table_over_structures(tmp_path):
    """Errors, margins and moments are those of the files; the search goes on where it stopped."""
    calls = []
    settings = {"links": [4], "starts": 256, "density": 2.0, "rate": 3.0}
    first = path_over_structures(POINTS, ANGLES, **settings, budget=0.0, out=tmp_path)
    assert len(first.unfinished) == 1
    candidates = path_over_structures(
        POINTS, ANGLES, **settings, out=tmp_path, progress=lambda *row: calls.append(row)
    )
    assert len(calls) == 1
    assert not candidates.unfinished
    assert len(candidates) > 1
    for c in candidates:
        at = c.design.at
        run = c.graph.run(at=at, want=c.design.output)[c.design.output]
        assert np.abs(run - POINTS) == pytest.approx(c.design.errors, abs=1e-9)
        grid = np.linspace(at[0], at[-1], 721)
        run = c.graph.run(at=grid, rates=3.0, accelerations=0.0, want=["*.margin", "crank.drive"])
        assert min(run[m].min() for m in run if m.endswith("margin")) > 0
        assert np.abs(run["crank.drive"]).max() == pytest.approx(c.moment, rel=0.05)
        assert c.design.at == pytest.approx(ANGLES)
    best = candidates.pareto
    assert best[0] is candidates[0]
    for c in candidates:
        beaten = any(
            all(a <= b for a, b in zip(d.measures, c.measures, strict=True))
            and d.measures != c.measures
            for d in candidates
        )
        assert (c in best) == (not beaten)
    files = sorted(tmp_path.glob("*.json"))
    assert len(files) == len(candidates)
    assert all(bm.Graph.load(f).check() == [] for f in files)
    again = path_over_structures(POINTS, ANGLES, **settings, budget=0.0, out=tmp_path)
    assert str(again) == str(candidates)
    stopped = path_over_structures(
        POINTS, ANGLES, **settings | {"seed": 1}, budget=0.0, out=tmp_path
    )
    assert len(stopped.unfinished) == 1
