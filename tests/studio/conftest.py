"""One server and one browser for all tests that act as a user does."""

import atexit
import os
import re
import shutil
import subprocess
import sys
from contextlib import contextmanager
from functools import cache

import pytest

ARGUMENTS = (
    *("--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking"),
    *("--disable-component-update", "--disable-sync"),
)

REFUSED = re.compile(r"status of (409|422) ")  # a refusal, which the page says in words
LOUD = ("error", "warning")  # what a console says that somebody should hear
WINDOW = {"width": 1440, "height": 900}
PATIENCE = 60_000  # ms of a machine on which others work too


@contextmanager
def served(folder):
    """Address of a studio that runs in a folder, and its process."""
    command = [sys.executable, "-m", "blockmech", "studio", "--no-browser"]
    environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
    with (
        (folder / ".log").open("w", encoding="utf-8") as log,
        subprocess.Popen(
            command, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=log, text=True
        ) as server,
    ):
        address = server.stdout.readline().strip()
        assert address.startswith("http://127.0.0.1:"), (folder / ".log").read_text("utf-8")
        try:
            yield address, server
        finally:  # else a failed test waits for it for ever
            server.terminate()


@pytest.fixture(scope="session")
def studio(tmp_path_factory):
    """Address and folder of a studio that runs."""
    folder = tmp_path_factory.mktemp("studio")
    with served(folder) as (address, _):
        yield address, folder


@cache
def driver():
    """What drives browsers. A process has one: a second one beside it is refused by Playwright."""
    tool = pytest.importorskip("playwright.sync_api", reason="it is no browser's driver")
    running = tool.sync_playwright().start()
    atexit.register(running.stop)
    return running


def chromium():
    """The browser's program."""
    program = shutil.which("chromium")
    if program is None:
        pytest.skip("there is no browser: the Debian package chromium is not installed")
    return program


@pytest.fixture(scope="session")
def browser(tmp_path_factory):
    """Chromium with a user's folder of its own."""
    flags = {
        "executable_path": chromium(),
        "headless": True,
        "args": ARGUMENTS,
        "viewport": WINDOW,
    }
    context = driver().chromium.launch_persistent_context(tmp_path_factory.mktemp("user"), **flags)
    context.set_default_timeout(PATIENCE)
    pytest.importorskip("playwright.sync_api").expect.set_options(timeout=PATIENCE)
    yield context
    context.close()


@pytest.fixture(scope="session")
def tab(browser):
    """One window for all tests, and what was wrong in it: scripts that failed, errors and warnings
    of the console, addresses outside.
    """
    page, wrong = browser.new_page(), []
    page.on("console", lambda entry: wrong.append(_told(entry)) if entry.type in LOUD else None)
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("request", lambda request: wrong.append(request.url) if _outside(request.url) else None)
    page.on("dialog", lambda dialog: dialog.accept())
    return page, wrong


@pytest.fixture
def page(tab, request):
    """The window, in which nothing is wrong. Pictures of the gallery are empty: they are drawn
    beside what is tested. Its policy is that of the server: no script of a test runs in it.
    """
    page, wrong = tab
    empty = {"content_type": "image/svg+xml", "body": '<svg xmlns="http://www.w3.org/2000/svg"/>'}
    page.route("**/picture/*.svg", lambda route: route.fulfill(**empty))
    page.set_viewport_size(WINDOW)
    page.emulate_media(color_scheme="light")
    yield page
    page.unroute_all()
    faults = [fault for fault in wrong if not REFUSED.search(fault)]
    wrong.clear()
    assert faults == []


def _told(entry):
    """What the console says, and about which address."""
    return f"{entry.text} {entry.location.get('url', '')}"


def _outside(url):
    return not url.startswith(("http://127.0.0.1:", "blob:http://127.0.0.1:", "data:", "about:"))
