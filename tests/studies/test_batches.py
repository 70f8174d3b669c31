"""Designs side by side: what each has alone, to the last bit, and rows that say why not."""

import numpy as np
import pytest

from blockmech.studies.family import Family, remade
from tests.gallery import SHORT, mechanism

DESIGNS, NUMBERS, MOST = 3, 12, 6


def poses(mech):
    """Some poses: over the drivers' laws, or from where a motion starts."""
    if set(mech.drivers) <= set(mech.scene.drive):
        return {"samples": 5}
    start = {d: mech.scene.begin(d) or 0.0 for d in mech.drivers}
    return {"at": {d: q + np.linspace(0.0, 0.2, 5) for d, q in start.items()}}


def varied(mech, rng):
    """Values of some numbers that one program serves, the first design the mechanism's own."""
    parameters = mech.parameters()
    chosen = [a for a in rng.permutation(list(parameters))[:NUMBERS] if not Family(mech, [a]).alone]
    columns = {}
    for p in (parameters[str(a)] for a in chosen[: 2 if len(parameters) > 400 else MOST]):
        aside = rng.uniform(1e-5, 1e-4, DESIGNS) * (abs(p.value) or 1.0)
        aside *= -1 if p.path[-1] == "efficiency" else 1  # which is one at most
        columns[p.address] = p.value + aside * (np.arange(DESIGNS) > 0)
    return columns


def kind_of(label):
    return label.rpartition(".")[2]


@pytest.mark.parametrize("name", SHORT)
def test_a_design_in_a_batch_equals_the_same_design_alone(name):
    mech = mechanism(name)
    columns = varied(mech, np.random.default_rng(len(name)))
    want = [n for n in mech.outputs if n.endswith((".drive", ".reaction", ".alpha"))][:12]
    request = {"want": dict.fromkeys(want, "poses"), **poses(mech)}
    together = mech.study(columns, sampling="paired", **request)
    assert not together.alone
    general = any(block.own_form for block in mech.structure.blocks.values())
    first = next(iter(columns))
    for k in range(DESIGNS):
        design = remade(mech, {a: float(x[k]) for a, x in columns.items()})
        single = design.study({first: columns[first][k]}, **request)
        sizes = dict.fromkeys((kind_of(label) for label in together.found.values), 0.0)
        for label in together.found.values:  # what is zero is rounding of others of its kind
            size = np.nanmax(np.abs(single[label][0]), initial=0.0)
            sizes[kind_of(label)] = max(size, sizes[kind_of(label)])
        for label in together.found.values:
            batched, alone = together[label][k], single[label][0]
            if general:  # LAPACK's
                size = sizes[kind_of(label)]
                np.testing.assert_allclose(batched, alone, rtol=0.0, atol=1e-11 * size)
            else:
                np.testing.assert_array_equal(batched, alone, err_msg=label)
        assert together.status[k] == single.status[0]
