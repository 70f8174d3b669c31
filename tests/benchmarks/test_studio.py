"""From a change in the studio's form to the new picture and curves, at the server."""

import copy
import time
from pathlib import Path

import pytest

from blockmech.builders import opened
from blockmech.studio.answers import Answers
from blockmech.studio.mechanism import MechanismView
from blockmech.studio.sheet import Sheet

GRAPHS = Path(__file__).parents[2] / "graphs"


@pytest.mark.parametrize(
    ("name", "block", "length", "most"),
    [("ruiz_fourbar", "dyad", "l_i", 0.15), ("excavator", "bucket", "l_i", 0.4)],
)
def test_a_change_is_seen_at_once(name, block, length, most):
    sheet = Sheet(opened(GRAPHS / f"{name}.json"))
    view = MechanismView(sheet)
    answers = Answers(sheet, view)
    taken = []
    for _ in range(5):
        form = copy.deepcopy(sheet.form)
        form["blocks"][block][length] *= 1.0001
        begun = time.perf_counter()
        sheet.change(form, length)
        taken.append(time.perf_counter() - begun)
        assert answers.result.mechanism is sheet.mechanism
    print(f"{name}: a change is seen after {1e3 * min(taken):.0f} ms")
    assert min(taken) < most
