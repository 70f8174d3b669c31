"""C against Python over many random states of every graph: a script, not a test.

    python -m tests.campaigns.c_bits [--states 100000] [--compiler clang] RESULTS [GRAPH ...]

A line of RESULTS (JSON) is a graph: states with an answer, how many numbers were compared, and how
many of them have other bits than those of Python's scalar engine; of groups without closed form the
largest difference over the largest number of its unit and the root of the smallest margin. Angles
of links come from NumPy's own arc tangent and may differ by one unit of the last place.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from pathlib import Path

import numpy as np

from blockmech.exchange.c.program import CProgram
from blockmech.passes.homotopy import followed
from blockmech.result.quality import WORDS
from tests.exchange.compiled_c import Called, scalar, states
from tests.gallery import GRAPHS, mechanism

CHUNK = 10_000
WANT = ("*.drive", "*.reaction", "*.p", "*.v", "*.a", "*.margin", "*.J_red", "*.tau_red")


def compared(name: str, count: int, compiler: str) -> dict[str, object]:
    """One graph: its line of the results."""
    mech = mechanism(name)
    patterns = [w for w in WANT if any(n.endswith(w[1:]) for n in mech.outputs)]
    program, start = CProgram(mech, patterns), time.process_time()
    row = {"states": 0, "numbers": 0, "differ": 0, "words": 0, "largest": 0.0}
    general = bool(followed(mech.structure))
    with tempfile.TemporaryDirectory() as folder:
        called = Called(program, Path(folder), compiler)
        for seed in range(max(1, count // CHUNK)):
            samples = states(mech, min(CHUNK, count), seed)
            values, statuses = called(samples)
            expected = scalar(program, samples)
            row["words"] += sum(
                WORDS[i] != x for i, x in zip(statuses, expected.quality.status, strict=True)
            )
            good = statuses == 0
            row["states"] += int(good.sum())
            expected_values = np.stack([program.column(expected, n) for n in program.outputs], 1)
            same = (values == expected_values) | ~np.isfinite(expected_values)
            row["numbers"] += int(same[good].size)
            row["differ"] += int((~same[good]).sum())
            if general and good.any():
                scales = program._scales(np.where(good[:, None], expected_values, 0.0))
                margin = np.minimum.reduce(
                    [np.asarray(m) for m in expected.quality.margin.values()]
                )
                off = (
                    np.abs(values - expected_values)[good]
                    / scales
                    * np.sqrt(np.minimum(margin[good], 1))[:, None]
                )
                row["largest"] = max(row["largest"], float(np.nanmax(off)))
    return {"graph": name, **row, "seconds": round(time.process_time() - start, 1)}


def main() -> None:
    """Run the campaign."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("results", type=Path)
    parser.add_argument("graphs", nargs="*")
    parser.add_argument("--states", type=int, default=100_000)
    parser.add_argument("--compiler", default="gcc")
    options = parser.parse_args()
    for name in options.graphs or sorted(path.stem for path in GRAPHS.glob("*.json")):
        row = compared(name, options.states, options.compiler)
        print(row, flush=True)
        with options.results.open("a", encoding="utf-8") as stream:
            stream.write(json.dumps(row) + "\n")


if __name__ == "__main__":
    main()
