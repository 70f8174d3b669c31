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
    options = parser.parse_args()
    numbers = range(options.first, options.first + options.documents)
    if options.show:
        for number in numbers:
            print(mutant(options.seed, number).text)
        return 0
    findings, start = Findings(), time.process_time()
    for number in numbers:
        before, clock = len(findings.problems), time.process_time()
        findings.judge(options.seed, number)
        for mutated, kind, detail in findings.problems[before:]:
            spent = time.process_time() - clock
            command = f"--seed {options.seed} --first {number}"
            print(f"--- {kind}: {command} ({mutated.base}, {spent:.1f} s)")
            print(detail.rstrip(), flush=True)
            if options.keep:
                options.keep.mkdir(parents=True, exist_ok=True)
                (options.keep / f"{options.seed}-{number}.json").write_text(mutated.text, "utf-8")
    spent = time.process_time() - start
    print(f"seed {options.seed}, {options.documents} documents, {spent:.0f} s: {findings.reached}")
    print(f"{len(findings.problems)} findings")
    return 1 if findings.problems else 0


sys.exit(main())
