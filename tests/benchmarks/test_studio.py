"""From a change in the studio's form to the new picture, and a long chain in a browser."""

import copy
import json
import time
from pathlib import Path

import numpy as np
import pytest

from blockmech.builders import opened
from blockmech.studio.answers import Answers
from blockmech.studio.mechanism import MechanismView
from blockmech.studio.sheet import Sheet
from tests.doors import linkage_of
from tests.proof import chain
from tests.studio.conftest import browser, page, studio  # noqa: F401
from tests.studio.page import blocks, show

from .results import ROWS, Row

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


FRAMES = """() => {
    window.frames = []; window.counting = true;
    let last = performance.now();
    const count = (now) => {
        window.frames.push(now - last); last = now;
        if (window.counting) requestAnimationFrame(count);
    };
    requestAnimationFrame(count);
}"""


def frame_times(page, act):  # noqa: F811
    """Median and 95 % of the frame times [s] in the browser while something is done."""
    page.evaluate(FRAMES)
    act()
    page.evaluate("window.counting = false")
    return np.percentile(page.evaluate("window.frames.slice(1)"), [50, 95]) / 1e3


def test_a_chain_of_a_hundred_dyads_opens_and_pans(page, studio):  # noqa: F811
    linkage_of(json.dumps(chain.document(100))).decompose().graph.save(studio[1] / "chain.json")
    page.set_default_timeout(120_000)
    page.goto("about:blank")
    idle = frame_times(page, lambda: page.wait_for_timeout(1000))
    begun = time.perf_counter()
    show(page, studio, "?open=chain.json")
    blocks(page).nth(101).wait_for(state="attached")
    taken = time.perf_counter() - begun
    canvas = page.locator(".diagram svg").bounding_box()

    def pan():
        page.mouse.move(canvas["x"] + 20, canvas["y"] + 20)
        page.mouse.down()
        for step in range(60):
            page.mouse.move(canvas["x"] + 20 + 4 * step, canvas["y"] + 20 + step)
        page.mouse.up()

    where = page.locator(".diagram .all")
    before = where.get_attribute("transform")
    panned = frame_times(page, pan)
    assert where.get_attribute("transform") != before
    task = "chain of 100 dyads in the studio"
    ROWS.append(Row(f"{task}: open", taken, 5.0, "5 s", 1.0))
    for share, measured, beside in zip(("median", "95 %"), panned, idle, strict=True):
        against = f"{share} of an idle page"
        ROWS.append(Row(f"{task}: {share} frame while panning", measured, beside, against, 2.0))
