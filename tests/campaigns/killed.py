"""Studies that are stopped by signals at random, continued, and compared: a script, not a test.

    python -m tests.campaigns.killed [--runs 200] [--seed 1]

A study into a folder is sent SIGINT, SIGTERM or SIGKILL after a random time, or its folder is
removed; one in `BY_COMMAND` is `blockmech sweep --workers 2`, the others are forks of this process.
Afterwards no process of it may remain, nothing may lie in the folder but complete parts and drafts,
and the study that continues must give the bytes and rows of a study that nobody stopped.
"""

from __future__ import annotations

import argparse
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np

import blockmech as bm
from tests.gallery import GRAPHS

COUNT, SAMPLES = 60_000, 72  # five parts
FILE, NUMBER, WANT = GRAPHS / "ruiz_fourbar.json", "dyad.l_i", "max_abs(crank.drive)"
BY_COMMAND = 5
PATIENCE = 10.0  # [s] after which workers of an ended command count as left behind
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGKILL)


def study(folder: Path) -> bm.Study:
    """The study, by this process."""
    vary, sampling = {NUMBER: bm.dist.Normal(6.0, 1e-3)}, bm.dist.Sample(COUNT, "random")
    mechanism = bm.Graph.load(FILE).compile()
    return mechanism.study(vary, want=WANT, samples=SAMPLES, sampling=sampling, out=folder)


def command(folder: Path) -> list[str]:
    """The same study as a command of two workers."""
    return [
        *(
            sys.executable,
            "-m",
            "blockmech",
            "sweep",
            str(FILE),
            "--vary",
            f"{NUMBER}=normal(6,1e-3)",
        ),
        *("--want", WANT, "--samples", str(SAMPLES), "--sampling", "random", "--count", str(COUNT)),
        *("--workers", "2", "--out", str(folder)),
    ]


def parts(folder: Path) -> dict[str, bytes]:
    """The parts in a folder."""
    return {path.name: path.read_bytes() for path in sorted(folder.glob("*.parquet"))}


def processes_of(group: int) -> list[int]:
    """Processes of the group of a study that has ended."""
    numbers = []
    for status in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = status.read_text("utf-8").rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[2]) == group and fields[0] != "Z":
            numbers.append(int(status.parent.name))
    return numbers


def forked(folder: Path) -> int:
    """A process of a group of its own that does the study."""
    process = os.fork()
    if not process:
        os.setsid()
        try:
            study(folder)
        except (KeyboardInterrupt, bm.BlockmechError):  # what a removed folder ends in
            os._exit(1)
        except BaseException:
            os._exit(70)
        os._exit(0)
    return process


def stopped(folder: Path, chance: random.Random, longest: float) -> str:
    """Start a study and stop it: what was done to it, then what may not be."""
    if by_command := chance.randrange(BY_COMMAND) == 0:
        silent = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        process = subprocess.Popen(command(folder), start_new_session=True, **silent).pid
    else:
        process = forked(folder)
    time.sleep(chance.uniform(0.0, longest * (4.0 if by_command else 1.0)))
    event = chance.choice((*SIGNALS, None))
    finished, _ = os.waitpid(process, os.WNOHANG)
    if event is None:
        shutil.rmtree(folder, ignore_errors=True)
    elif not finished:
        os.kill(process, event)
    status = 0 if finished else os.waitpid(process, 0)[1]
    until = time.monotonic() + PATIENCE
    while (remaining := processes_of(process)) and time.monotonic() < until:
        time.sleep(0.05)
    name = ("command " if by_command else "") + (event.name if event else "folder removed")
    name = f"{name}, after its end" if finished else name
    wrong = f": processes {remaining} remain" if remaining else ""
    return name + wrong + (": a fault" if os.waitstatus_to_exitcode(status) == 70 else "")


def main() -> int:
    """Stop studies, continue, compare; 1 if anything was lost or left."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    chance, events, wrong = random.Random(options.seed), Counter[str](), list[str]()
    with tempfile.TemporaryDirectory() as scratch:
        undisturbed = Path(scratch) / "undisturbed"
        study(undisturbed)
        start = time.monotonic()
        shutil.rmtree(undisturbed)
        values = np.asarray(study(undisturbed)[WANT])
        longest, expected = time.monotonic() - start, parts(undisturbed)
        folder, continued = Path(scratch) / "stopped", 0
        for number in range(options.runs):
            event, _, fault = stopped(folder, chance, longest).partition(": ")
            events[event] += 1
            if fault:
                wrong.append(f"run {number}, {event}: {fault}")
            if not parts(folder).items() <= expected.items():
                wrong.append(f"run {number}, {event}: parts differ")
            if chance.random() < 0.5:
                continued += 1
                if not np.array_equal(study(folder)[WANT], values) or parts(folder) != expected:
                    wrong.append(f"run {number}, {event}: rows differ from an undisturbed study's")
                shutil.rmtree(folder)
            print(number, event, fault, flush=True)
    print(dict(events), f"{continued} continued and compared", *wrong, sep="\n")
    return bool(wrong)


if __name__ == "__main__":
    raise SystemExit(main())
