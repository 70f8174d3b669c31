"""Every public call on every file of the gallery: a script, not a test.

    python -m tests.campaigns.calls [FILES ...] [--calls NAMES ...] [--patience 60]

Files are named as in the gallery, e.g. ``joints/engine.json``. What may not come of a call is
printed, with the time of those that take long.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Sequence

from tests.calls import CALLS, Fault, Subject, faults, gallery_files
from tests.fuzz.judge import Hang, last_lines, soon
from tests.gallery import GRAPHS

LONG = 10.0  # [s] of processor time: named in the table


def campaign(files: Sequence[str], calls: Sequence[str], patience: float) -> int:
    """Ask every call of every file; the number of faults."""
    count = 0
    for file in files:
        start = time.process_time()
        subject = Subject.of(GRAPHS / file)
        for call in calls:
            clock = time.process_time()
            try:
                with soon(patience):
                    answer = faults(subject, call)
            except Hang:
                answer = [Fault(call, "hang", last_lines())]
            spent = time.process_time() - clock
            if spent > LONG and not answer:
                print(f"    {file} {call}: {spent:.1f} s", flush=True)
            for fault in answer:
                print(f"--- {file} {fault.call}: {fault.kind}\n{fault.detail.rstrip()}", flush=True)
            count += len(answer)
        print(f"{file}: {time.process_time() - start:.1f} s", flush=True)
    return count


def main() -> int:
    """Read the arguments and go."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="*", help="default all")
    parser.add_argument("--calls", nargs="*", help="default all")
    parser.add_argument("--patience", type=float, default=60.0, help="[s] for one call")
    options = parser.parse_args()
    os.environ.setdefault("MPLBACKEND", "agg")
    count = campaign(options.files or gallery_files(), options.calls or [*CALLS], options.patience)
    print(f"{count} faults")
    return 1 if count else 0


if __name__ == "__main__":
    sys.exit(main())
