"""Random motions through dead centres of their drivers, beside absolute coordinates: a script.

    python -m tests.campaigns.charts [--cases 100] [--five-bars 30] [--first 0] [--accuracy 1e-11]

Double rockers and four-bars at or near a change point that start at +-2 rad/s, and five-bars with
two drivers released at rest, all with random masses under gravity, from documents of links and as
graphs of blocks in turn. The truth is `tests.independent.released.truth`, which shares no code with
the package; how far it is from itself at a coarser tolerance is how good a judge it is. A line is a
case: the error of the drivers' coordinates against the judge, the judge's own, the stated one, how
often another chart led, and what ended the motion. The word ABOVE stands where more is off than is
stated, by more than the judge is.
"""

from __future__ import annotations

import argparse
import time
from typing import Any

import numpy as np

import blockmech as bm
from tests.independent.released import five_bar, four_bar, truth

SPAN = 1.5  # [s] of a motion
JUDGE, COARSER = 2.3e-14, 1e-13  # tolerances of the truth, and of that which judges it
LOOKED_AT = 16  # times


def compared(case: dict[str, Any], accuracy: float, times: Any) -> tuple[float, float, Any]:
    """The error of a motion, the judge's own, and the motion."""
    want, coarser = truth(case, times, JUDGE), truth(case, times, COARSER)
    mechanism = bm.Linkage.from_data(case).compile()
    motion = mechanism.simulate(times=times, want=(), accuracy=accuracy).motion
    reached = times <= motion.t_end
    q = motion.at(times[reached]).q.reshape(reached.sum(), -1)
    off, judge_error = (float(np.abs(x - want[reached]).max()) for x in (q, coarser[reached]))
    return off, judge_error, motion


def main() -> None:
    """Run the cases."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--cases", type=int, default=100)
    parser.add_argument("--five-bars", type=int, default=30)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--accuracy", type=float, default=1e-11)
    options = parser.parse_args()
    times = np.linspace(0.0, SPAN, LOOKED_AT)
    kinds = ["rocker", "near"] * options.cases
    cases = [(kind, i) for i, kind in enumerate(kinds[: options.cases])]
    cases += [("fivebar", i) for i in range(options.five_bars)]
    for kind, i in cases[options.first :]:
        rng = np.random.default_rng([i, len(kind)])
        case = five_bar(rng) if kind == "fivebar" else four_bar(rng, kind)
        begin = time.process_time()
        try:
            error, judge, motion = compared(case, options.accuracy, times)
        except Exception as failure:  # a case of its own
            print(kind, i, "RAISED", repr(failure)[:200], flush=True)
            continue
        word = "" if error <= motion.error + judge else "ABOVE"
        spent = time.process_time() - begin
        judged = f"error {error:.1e} judge {judge:.0e} stated {motion.error:.1e} {word}"
        print(
            f"{kind} {i} {judged} charts "
            f"{len(motion.charts)} end {motion.end} at {motion.t_end:.6g} s in {spent:.1f} s",
            flush=True,
        )


if __name__ == "__main__":
    main()
