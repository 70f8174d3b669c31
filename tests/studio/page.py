"""A page of one pane in a browser, as a test sees it."""

import shutil
import socket
from contextlib import contextmanager

import pytest

ARGS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]


@contextmanager
def page_of(make):
    """A browser's page that shows what ``make()`` gives, and the errors that it met."""
    path = shutil.which("chromium")
    if path is None:
        pytest.skip("no browser: the program chromium is not installed")
    import panel as pn
    from playwright.sync_api import Error, sync_playwright

    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    server = pn.serve(
        make, address="127.0.0.1", port=port, show=False, threaded=True, verbose=False
    )
    try:
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=path, args=ARGS)
            page = browser.new_page(viewport={"width": 1440, "height": 900})
            page.set_default_timeout(8000)
            page.errors = []
            page.on("pageerror", lambda error: page.errors.append(str(error)))
            for patience in (100, 300, 1000, 0):
                try:
                    page.goto(f"http://127.0.0.1:{port}/")
                    break
                except Error:  # the server has not begun
                    page.wait_for_timeout(patience)
            yield page
            browser.close()
    finally:
        server.stop()


def wait_until(page, met):
    """Let the page work until something holds, at most 8 s; the test says whether it does."""
    for _ in range(160):
        if met():
            return
        page.wait_for_timeout(50)
