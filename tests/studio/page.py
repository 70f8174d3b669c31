"""A page of one pane in a browser, as a test sees it."""

import socket
from contextlib import contextmanager


@contextmanager
def served(page, make):
    """Show what ``make()`` gives in a browser's page."""
    import panel as pn
    from playwright.sync_api import Error

    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    server = pn.serve(
        make, address="127.0.0.1", port=port, show=False, threaded=True, verbose=False
    )
    try:
        for patience in (100, 300, 1000, 0):
            try:
                page.goto(f"http://127.0.0.1:{port}/")
                break
            except Error:  # the server has not begun
                page.wait_for_timeout(patience)
        yield
        page.goto("about:blank")
    finally:
        server.stop()


def wait_until(page, met):
    """Let the page work until something holds, at most 8 s; the test says whether it does."""
    for _ in range(160):
        if met():
            return
        page.wait_for_timeout(50)
