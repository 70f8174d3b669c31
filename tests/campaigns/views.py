"""Pictures of the studio's views for the docs: a script, not a test.

python -m tests.campaigns.views [--folder docs/studio] [--theme dark] [--size 1440x900]
"""

from __future__ import annotations

import argparse
import shutil
import tempfile
from pathlib import Path

from playwright.sync_api import Page, sync_playwright

from tests.studio.conftest import ARGUMENTS, served
from tests.studio.page import Sheet

FOURBAR = {"example": "joints/ruiz_fourbar"}


def drawn(page: Page, studio: tuple[str, Path], folder: Path) -> None:
    """Draw all views, each as a file."""

    def shoot(name: str) -> None:
        page.wait_for_timeout(700)
        page.screenshot(path=folder / f"{name}.png")

    def tab(name: str) -> None:
        page.get_by_role("tab", name=name, exact=True).click()

    page.goto(studio[0])
    page.locator("#gallery .card").first.wait_for()
    page.wait_for_timeout(15000)  # until its pictures are there
    shoot("gallery")
    Sheet(page, studio, {"new": "joints"})
    shoot("drawing_first")
    hand = Sheet(page, studio, {"example": "joints/excavator"})
    hand.click("arm_pivot")
    shoot("drawing")
    field = page.get_by_label("friction coefficient", exact=True)
    field.fill("a lot")
    field.press("Enter")
    shoot("form")
    Sheet(page, studio, {"example": "ruiz_fourbar"})
    tab("Blocks")
    page.locator("g.block").first.wait_for(timeout=60000)
    shoot("blocks")
    Sheet(page, studio, {"example": "joints/toggle_press"})
    page.get_by_label("Pose", exact=True).fill("60")
    page.get_by_label("show", exact=True).select_option("reactions")
    tab("Margins")
    shoot("margins")
    tab("Curves")
    shoot("curves")
    Sheet(page, studio, {"example": "motions/pin_pendulum"})
    tab("Motion")
    page.get_by_role("button", name="Simulate", exact=True).click()
    page.get_by_role("button", name="Pause").wait_for(timeout=60000)
    shoot("motion")
    Sheet(page, studio, FOURBAR)
    tab("Analyses")
    page.get_by_role("button", name="Equilibria", exact=True).click()
    page.locator(".answers img").wait_for(timeout=60000)
    shoot("analyses")
    hand = Sheet(page, studio, {"new": "joints"})
    field = page.get_by_label("new pin at", exact=True)
    for position in ("300, 300", "400, 450", "550, 500", "700, 450"):
        hand.changed(lambda position=position: (field.fill(position), field.press("Enter")))
    tab("Synthesis")
    page.get_by_role("button", name="Candidates", exact=True).click()
    page.locator(".answers .card").first.wait_for(timeout=120000)
    shoot("synthesis")


def main() -> None:
    """Draw them."""
    options = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    options.add_argument("--folder", type=Path, default=Path("docs/studio"))
    options.add_argument("--theme", default="light")
    options.add_argument("--size", default="1440x900")
    arguments = options.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    width, height = map(int, arguments.size.split("x"))
    with (
        tempfile.TemporaryDirectory() as folder,
        served(Path(folder)) as (address, _),
        sync_playwright() as tool,
    ):
        browser = tool.chromium.launch(executable_path=shutil.which("chromium"), args=ARGUMENTS)
        page = browser.new_page(
            viewport={"width": width, "height": height}, color_scheme=arguments.theme
        )
        drawn(page, (address, Path(folder)), arguments.folder)
        browser.close()


if __name__ == "__main__":
    main()
