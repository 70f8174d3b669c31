"""``python -m tests.fuzz --documents N --seed S``: spoilt documents by hand, as many as wanted."""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

from tests.fuzz.judge import Findings
from tests.fuzz.mutants import mutant


def main() -> int:
    """Judge documents, print what was found, and keep each mutant that shows something."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--documents", type=int, default=1000)
    parser.add_argument("--first", type=int, default=0, help="number of the first")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--keep", type=Path, help="folder for the documents that show something")
    parser.add_argument("--show", action="store_true", help="only print the document")
    asked = parser.parse_args()
    numbers = range(asked.first, asked.first + asked.documents)
    if asked.show:
        for number in numbers:
            print(mutant(asked.seed, number).text)
        return 0
    findings, begun = Findings(), time.process_time()
    for number in numbers:
        before, clock = len(findings.problems), time.process_time()
        findings.judge(asked.seed, number)
        for made, kind, detail in findings.problems[before:]:
            spent = time.process_time() - clock
            print(f"--- {kind}: --seed {asked.seed} --first {number} ({made.base}, {spent:.1f} s)")
            print(detail.rstrip(), flush=True)
            if asked.keep:
                asked.keep.mkdir(parents=True, exist_ok=True)
                (asked.keep / f"{asked.seed}-{number}.json").write_text(made.text, "utf-8")
    spent = time.process_time() - begun
    print(f"seed {asked.seed}, {asked.documents} documents, {spent:.0f} s: {findings.reached}")
    print(f"{len(findings.problems)} findings")
    return 1 if findings.problems else 0


sys.exit(main())
