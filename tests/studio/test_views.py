"""The ten main views: what axe says of them, and their pictures in the docs.

With ``BLOCKMECH_PICTURES=docs/studio`` the pictures are written there; look at them then.
"""

import os
import struct
from pathlib import Path

import pytest

from tests.studio.page import accessible, choose, fill, press, show

DOCS = Path(__file__).parents[2] / "docs" / "studio"
SIZE = {"width": 1280, "height": 800}


def drawn(page, studio, theme):
    """An empty drawing, and a machine as links and joints."""
    page.goto(f"{studio[0]}?draw&theme={theme}")
    page.get_by_text("Drag: a link is drawn").wait_for()
    yield "drawing_first"
    page.goto(f"{studio[0]}?example=joints/excavator&theme={theme}")
    page.locator("[data-pin] .ring").first.wait_for()
    page.locator("svg[role=application]").press("Control+a")
    yield "drawing"


def of_blocks(page, studio, theme):
    """Blocks, a form in which something is wrong, curves."""
    show(page, studio, f"?example=watt_sixbar&theme={theme}")
    yield "blocks"
    choose(page, "Edit", "crank")
    fill(page, "length [m]", "-1")
    page.get_by_role("alert").first.wait_for()
    yield "form"
    press(page, "Margins")
    page.wait_for_function(
        "[...Bokeh.documents[0]._all_models.values()].some((m) => m.axis_label === 'margin [–]')"
    )
    yield "margins"


def answered(page, studio, theme):
    """A simulation, analyses and what methods cost."""
    show(page, studio, f"?example=engine&theme={theme}")
    press(page, "Motion")
    fill(page, "Simulate until", "time=0.05")
    press(page, "Simulate")
    page.locator(".caption").get_by_text("t = 0.000 s").wait_for()
    yield "motion"
    press(page, "Turn")
    page.locator(".caption").get_by_text("t = 0.000 s").wait_for(state="detached")
    press(page, "Curves")
    yield "curves"
    press(page, "Analyses")
    press(page, "Equilibria")
    picture = page.get_by_alt_text("picture of the answer")
    picture.wait_for()
    box = picture.bounding_box()
    assert box["y"] + box["height"] <= SIZE["height"]  # as a whole, without scrolling
    yield "analyses"
    press(page, "Cost")
    page.get_by_text("kernel calls").first.wait_for()
    yield "methods"


def gallery(page, studio, theme):
    """The first page."""
    page.unroute("**/picture/*.svg")
    page.goto(f"{studio[0]}?theme={theme}")
    page.locator(".card img").nth(7).scroll_into_view_if_needed()
    page.wait_for_function(
        """() => {
            const all = (root) => [...root.querySelectorAll("*")]
                .flatMap((one) => [one, ...(one.shadowRoot ? all(one.shadowRoot) : [])]);
            const seen = all(document).filter((one) => one.tagName === "IMG").slice(0, 8);
            return seen.length && seen.every((one) => one.complete && one.naturalWidth);
        }"""
    )
    page.mouse.wheel(0, -9999)
    yield "gallery"


VIEWS = (gallery, drawn, of_blocks, answered)
NAMES = (
    "gallery", "drawing_first", "drawing", "blocks", "form",
    "margins", "motion", "curves", "analyses", "methods",
)  # fmt: skip


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("views", VIEWS, ids=lambda views: views.__name__)
def test_axe_finds_nothing_in_any_view(page, studio, views, theme):
    page.set_viewport_size(SIZE)
    folder = os.environ.get("BLOCKMECH_PICTURES")
    for name in views(page, studio, theme):
        assert name in NAMES
        accessible(page, *(["color-contrast"] if theme == "dark" else []))
        if folder and theme == "light":
            page.mouse.move(1, 1)
            page.screenshot(path=Path(folder) / f"{name}.png")


@pytest.mark.parametrize("name", NAMES)
def test_every_view_has_its_picture_in_the_docs(name):
    data = (DOCS / f"{name}.png").read_bytes()
    assert struct.unpack(">II", data[16:24]) == tuple(SIZE.values())
    assert f"studio/{name}.png" in (DOCS.parent / "studio.md").read_text("utf-8")
