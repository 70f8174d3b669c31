"""The studio in a browser: opening, an edit with its curves, a drag's frame, bytes and memory.

The limits are those of issue "The studio". Times are the least of several, on the machine's load
that the notes say.
"""
# ruff: noqa: F811 (fixtures are named by their users)

import json
import os
import statistics
import time
from pathlib import Path

import pytest

from tests.proof import chain
from tests.studio.conftest import browser, page, studio, tab  # noqa: F401
from tests.studio.page import FRAMES, Sheet, heap_around, resident

from .results import ROWS, Row

ROUNDS = 5
OPENED = {  # [s] until curves are drawn
    "four-bar": ({"example": "joints/ruiz_fourbar"}, 0.5),
    "excavator": ({"example": "joints/excavator"}, 0.6),
    "forty four-bars": ({"example": "n_four_bar"}, 2.0),
    "chain of 100 dyads": ({"text": json.dumps(chain.document(100)), "name": "chain"}, 2.0),
}


def row(task, figure, most, unit="s"):
    """A row whose yardstick is the wanted value."""
    assert 0 < figure < 60 * most  # the page did what it was asked for, not only waited for it
    against = f"goal at load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores"
    ROWS.append(Row(f"studio: {task}", figure, most, against, 1.0, unit=unit))


def opening(page, studio, source):
    """Seconds from the address of a sheet until its curves are drawn."""
    begun = time.perf_counter()
    hand = Sheet(page, studio, source, "path.curve")
    seconds = time.perf_counter() - begun
    page.locator("html[data-ready]").wait_for(state="attached")  # and can be moved
    return seconds, hand


def test_the_first_page_opens(page, studio):
    seconds = []
    page.goto(studio[0])
    for _ in range(ROUNDS):
        begun = time.perf_counter()
        page.goto(page.url)
        page.locator("#gallery .card").first.wait_for()
        seconds.append(time.perf_counter() - begun)
    row("first page", min(seconds), 0.3)


@pytest.mark.parametrize("name", OPENED)
def test_a_document_opens_and_follows_an_edit(page, studio, name):
    source, most = OPENED[name]
    seconds, hand = min((opening(page, studio, source) for _ in range(ROUNDS)), key=lambda x: x[0])
    row(f"open {name} to curves", seconds, most)
    if name not in ("four-bar", "excavator"):
        return
    hand = opening(page, studio, source)[1]
    hand.click(next(iter(hand.places())))
    page.evaluate(
        """() => new MutationObserver(() => { window.ended = performance.now(); }).observe(
            document.documentElement, { attributes: true, attributeFilter: ["data-revision"] })"""
    )
    html, edits = page.locator("html"), []
    for k in range(2 * ROUNDS):
        before = html.get_attribute("data-revision")
        page.evaluate(
            """() => addEventListener("keydown", () => { window.begun = performance.now(); },
                { capture: true, once: true })"""
        )
        page.keyboard.press("ArrowLeft" if k % 2 else "ArrowRight")
        while html.get_attribute("data-revision") == before:
            page.wait_for_timeout(10)
        edits.append(page.evaluate("(window.ended - window.begun) / 1e3"))
    row(f"edit of {name} to numbers", min(edits), 0.06)


def test_a_drag_is_drawn_within_a_frame(page, studio):
    hand = opening(page, studio, {"example": "joints/excavator"})[1]
    page.evaluate(FRAMES)
    hand.hold("arm_pivot", 20, 25, steps=60)
    spent = page.evaluate("window.spent")
    page.keyboard.press("Escape")
    page.mouse.up()
    row("median frame of a drag, excavator", statistics.median(spent) / 1e3, 0.008)


def test_bytes_of_a_cold_opening(page, studio):
    session = page.context.new_cdp_session(page)
    session.send("Network.enable")
    session.send("Network.clearBrowserCache")
    sizes = []
    session.on("Network.loadingFinished", lambda event: sizes.append(event["encodedDataLength"]))
    opening(page, studio, {"example": "joints/ruiz_fourbar"})
    session.detach()
    row("cold opening of a four-bar", sum(sizes) / 1e3, 400, "kB")


def test_memory_of_the_page_and_of_the_server(page, studio):
    server = server_of(studio)
    heap_around(page, studio, 40)  # what is made once is there now
    begun = resident(server)
    before, after = heap_around(page, studio, 500)
    row("heap of the page", before / 1e6, 10, "MB")
    row("growth of the heap by 500 edits", max((after - before) / 1e6, 1e-3), 1, "MB")
    row("growth of the server", max(resident(server) - begun, 1e-3), 5, "MB")


def server_of(studio):
    """The number of the server's process, by the folder that it works in."""
    folder = str(studio[1])
    return next(
        int(p.name)
        for p in Path("/proc").glob("[0-9]*")
        if os.access(p / "cwd", os.R_OK)
        and os.readlink(p / "cwd") == folder
        and b"blockmech\0studio" in (p / "cmdline").read_bytes()
    )
