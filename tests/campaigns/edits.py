"""Memory of a studio around many edits, of its server and its page: a script, not a test.

    python -m tests.campaigns.edits [--edits 1000]

A block is added to a four-bar and taken back, in a browser. Issue 30 allows 50 MB of the server
and 100 MB of the page for 1,000 edits. It reads /proc, so it runs on Linux.
"""

from __future__ import annotations

import argparse
import shutil
import tempfile
import time
from pathlib import Path

from playwright.sync_api import sync_playwright

from tests.studio.conftest import ARGUMENTS, served
from tests.studio.page import heap_around

KEPT = {"server": 50.0, "page": 100.0}  # MB for 1,000 edits


def resident(process: int) -> float:
    """Memory of a process [MB]."""
    status = Path(f"/proc/{process}/status").read_text("ascii").splitlines()
    (line,) = (line for line in status if line.startswith("VmRSS"))
    return int(line.split()[1]) * 1024 / 1e6


def main() -> int:
    """Measure, print, and end with 1 where more was kept than may be."""
    options = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    options.add_argument("--edits", type=int, default=1000)
    edits: int = options.parse_args().edits
    with (
        tempfile.TemporaryDirectory() as folder,
        served(Path(folder)) as (address, server),
        sync_playwright() as tool,
    ):
        result = shutil.which("chromium")
        page = tool.chromium.launch(executable_path=result, args=ARGUMENTS).new_page()
        page.set_default_timeout(0)
        heap_around(page, (address, folder), 40)  # what is made once is there now
        before, start = resident(server.pid), time.perf_counter()
        heap = [x / 1e6 for x in heap_around(page, (address, folder), edits)]
        grown = {"server": (before, resident(server.pid)), "page": heap}
        took = time.perf_counter() - start
    print(f"{edits} edits in {took:.0f} s")
    for memory, (first, last) in grown.items():
        print(f"{memory}: {first:.1f} -> {last:.1f} MB, {KEPT[memory]:g} MB more are allowed")
    return int(any(b - a > KEPT[memory] for memory, (a, b) in grown.items()))


if __name__ == "__main__":
    raise SystemExit(main())
