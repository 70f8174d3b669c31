"""Long chains of dyads given as links and joints: from text to plan, and cost of a sample.

Process times are reported, never asserted. The forces are checked in tests/proof/test_chain.py.
"""

from __future__ import annotations

import json
import time

import numpy as np
import pytest

from blockmech.plan.plan import Plan
from tests.doors import linkage_of as loads
from tests.proof import chain

from .results import NOTES, ROWS, Row

NUMBERS = (10, 100, 1000)  # dyads
SAMPLES, ROUNDS = 200, 5
WANT = ("joint.*.reaction", "driver.motor.drive")
GOAL = 1.0  # [s] process time from text to plan of a thousand dyads


def planned(text: str) -> Plan:
    """Read, decompose, check, compile and plan."""
    graph = loads(text).decompose()
    assert graph.graph.check() == []
    return graph.compile().plan(WANT)


def least(run: object) -> float:
    """The least process time [s] of several rounds."""
    times = []
    for _ in range(ROUNDS):
        start = time.process_time()
        run()  # type: ignore[operator]
        times.append(time.process_time() - start)
    return min(times)


@pytest.mark.parametrize("number", NUMBERS)
def test_from_text_to_plan(number: int) -> None:
    text = json.dumps(chain.document(number))
    seconds = least(lambda: planned(text))
    goal = GOAL * number / max(NUMBERS)
    row = Row(f"chain of {number} dyads, text to plan", seconds, goal, "goal of 1 ms a dyad", 1.0)
    ROWS.append(row)
    assert seconds > 0


def test_a_sample_costs_in_proportion_to_the_length() -> None:
    a_dyad = {}
    for number in NUMBERS:
        mechanism = loads(json.dumps(chain.document(number))).compile()
        at = np.linspace(chain.HOME - 0.05, chain.HOME + 0.05, SAMPLES)
        request = {"at": at, "rates": 2.0, "accelerations": -1.0, "want": WANT}
        result = mechanism.run(**request)
        assert result.quality.status == ("ok",) * SAMPLES
        a_dyad[number] = least(lambda m=mechanism, r=request: m.run(**r)) / SAMPLES / number
    first = a_dyad[NUMBERS[0]]
    for number, seconds in a_dyad.items():
        task = f"chain of {number} dyads, reactions of one sample, a dyad"
        ROWS.append(Row(task, seconds, first, f"a dyad in a chain of {NUMBERS[0]}"))
    NOTES.append(
        f"chains of {', '.join(map(str, NUMBERS))} dyads: a sample costs "
        + ", ".join(f"{1e6 * seconds:.2f}" for seconds in a_dyad.values())
        + " µs a dyad (process time, reactions and drive)"
    )
