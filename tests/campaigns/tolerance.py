"""Linear tolerance against Monte Carlo of a million designs, on three mechanisms.

Run with ``python -m tests.campaigns.tolerance [designs]``: some minutes. The deviations of both
may differ by four standard errors of a deviation, 4 / sqrt(2 N), and by what is not linear,
which goes with the square of the deviations.
"""

from __future__ import annotations

import math
import sys

import numpy as np

import blockmech as bm
from tests.gallery import mechanism

CASES = {
    "ruiz_fourbar": ("dyad.C.p", "crank.drive"),
    "slider_crank": ("piston.C.p", "crank.drive"),
    "watt_sixbar": ("second.C.p", "crank.drive"),
}
RELATIVE = 1e-5  # deviation of each length, of itself: what is not linear is far below the errors


def main(count: int = 1_000_000) -> int:
    """Number of outputs that differ by more than their sampling error."""
    wrong = 0
    for name, want in CASES.items():
        mech = mechanism(name)
        laws = {
            a: bm.normal(p.value, RELATIVE * abs(p.value))
            for a, p in mech.parameters().items()
            if p.unit == "m" and p.value and not a.split(".")[-1].startswith("cm")
        }
        given = [x for x in want if x in mech.outputs]
        at = {d: np.array([0.7, 2.1, 4.4]) for d in mech.drivers}
        found = mech.tolerance(laws, given, count=count, at=at)
        for output in given:
            off = np.abs(found.sampled[output].deviation / found[output] - 1.0).max()
            allowed = 4.0 / math.sqrt(2.0 * count)
            wrong += off > allowed
            print(f"{name} {output}: {len(laws)} numbers, off {off:.1e}, allowed {allowed:.1e}")
            sys.stdout.flush()
    return wrong


if __name__ == "__main__":
    sys.exit(bool(main(*map(int, sys.argv[1:]))))
