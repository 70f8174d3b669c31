"""Sweeps that are stopped by signals at random, gone on with, and compared: a script, not a test.

    python -m tests.campaigns.killed [--runs 200] [--seed 1]

`blockmech sweep --workers 2` into a folder is sent SIGINT, SIGTERM or SIGKILL after a random time.
Afterwards no process of it may be left, nothing may lie in the folder but whole parts and drafts,
and going on with it must give the bytes of a sweep that nobody stopped.
"""

from __future__ import annotations

import argparse
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from tests.gallery import GRAPHS

COUNT = 1_200_000  # designs: several parts, a second or two of two workers
PATIENCE = 10.0  # [s] after which workers of an ended command count as left behind
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGKILL)


def command(folder: Path) -> list[str]:
    """The sweep, with a mark in its arguments by which its processes are found."""
    return [
        *(sys.executable, "-m", "blockmech", "sweep", str(GRAPHS / "ruiz_fourbar.json")),
        *("--vary", "dyad.l_i=normal(6,1e-3)", "--want", "max_abs(crank.drive)"),
        *("--samples", "12", "--sampling", "random", "--count", str(COUNT)),
        *("--workers", "2", "--out", str(folder)),
    ]


def parts(folder: Path) -> dict[str, bytes]:
    """The parts in a folder."""
    return {path.name: path.read_bytes() for path in sorted(folder.glob("*.parquet"))}


def left_of(started: int) -> list[int]:
    """Processes of the group of a command that is over."""
    found = []
    for status in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = status.read_text("utf-8").rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[2]) == started and fields[0] != "Z":
            found.append(int(status.parent.name))
    return found


def stopped(folder: Path, chance: random.Random, longest: float) -> tuple[str, list[int]]:
    """Start a sweep and stop it: the signal that was sent, and the processes that it left."""
    run = subprocess.Popen(
        command(folder), stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True
    )
    kind = chance.choice(SIGNALS)
    time.sleep(chance.uniform(0.2, longest))
    early = run.poll() is None
    run.send_signal(kind)
    run.communicate(timeout=120)  # whoever reads its output sees the end
    until = time.monotonic() + PATIENCE
    while (left := left_of(run.pid)) and time.monotonic() < until:
        time.sleep(0.05)
    return kind.name if early else "done before", left


def main() -> int:
    """Stop sweeps, go on, compare; 1 if anything was lost or left."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    chance, kinds, wrong = random.Random(asked.seed), Counter[str](), list[str]()
    with tempfile.TemporaryDirectory() as place:
        whole = Path(place) / "whole"
        begun = time.monotonic()
        subprocess.run(command(whole), check=True, capture_output=True)
        longest, expected = time.monotonic() - begun, parts(whole)
        folder = Path(place) / "stopped"
        for number in range(asked.runs):
            kind, left = stopped(folder, chance, longest)
            kinds[kind] += 1
            if left:
                wrong.append(f"run {number}, {kind}: processes {left} are left")
            if not parts(folder).items() <= expected.items():
                wrong.append(f"run {number}, {kind}: parts differ")
            if kind == "done before" or chance.random() < 0.2:
                subprocess.run(command(folder), check=True, capture_output=True)
                if parts(folder) != expected:
                    wrong.append(f"run {number}: what was gone on with differs")
                for path in folder.iterdir():
                    path.unlink()
    print(dict(kinds), *(wrong or ["nothing lost, nothing left"]), sep="\n")
    return bool(wrong)


if __name__ == "__main__":
    raise SystemExit(main())
