"""What `explain` predicts against what is measured, on batches of 1e5."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

import blockmech as bm
from blockmech.cost import price
from blockmech.mechanism import Mechanism

from .results import SAVINGS, Saving

GRAPHS = Path(__file__).parents[2] / "graphs"
SAMPLES = 100_000
REQUESTS = (
    ("*.p",),
    ("*.p", "*.v"),
    ("*.p", "*.v", "*.a", "*.omega", "*.alpha"),
    ("*.reaction",),
    ("*.drive",),
    ("*.J_red", "*.tau_red"),
)


def seconds(mech: Mechanism, want: tuple[str, ...], friction: str) -> float:
    start = time.perf_counter()
    mech.run(samples=SAMPLES, want=want, friction=friction, on_gap="mark")
    return time.perf_counter() - start


def measured_saving(mech: Mechanism, want: tuple[str, ...], friction: str) -> float:
    """Both requests in turn, so that both see the same machine; the fastest of each."""
    pairs = [(seconds(mech, ("*",), "newton"), seconds(mech, want, friction)) for _ in range(7)]
    whole, part = (min(column) for column in zip(*pairs[1:], strict=True))
    return whole / part


@pytest.mark.parametrize("name", ["ruiz_fourbar", "watt_sixbar", "slider_crank", "stephenson_3"])
def test_savings_of_asking_for_less(name: str) -> None:
    mech = bm.Graph.load(GRAPHS / f"{name}.json").compile()
    full = price(mech, mech.plan("*"))
    for want in REQUESTS:
        for friction in ("newton", "none") if name == "ruiz_fourbar" else ("newton",):
            predicted = full / price(mech, mech.plan(want, friction=friction))
            measured = measured_saving(mech, want, friction)
            without = ", without friction" if friction == "none" else ""
            what = f"{name}: {', '.join(want)} in place of *{without}"
            SAVINGS.append(Saving(what, predicted, measured))
            assert predicted > 1.0  # less is asked for, so less is computed
