"""Random machines with friction in all pairs, released and followed for 12 s: a script, not a test.

    python -m tests.campaigns.crawl RESULTS [--machines 200] [--seed 1] [--again]

Each is moved by ``auto`` and by methods that take friction, to the default accuracy. A line of
RESULTS is a machine (JSON): processor time, end and estimated error by method. The table lists
machines for which `auto` takes `OFTEN` times the cheapest method that reaches the accuracy, or
longer than anybody waits.
"""

from __future__ import annotations

import argparse
import json
import math
import signal
import time
from pathlib import Path
from typing import Any

import numpy as np

from blockmech.friction.laws import Coulomb
from blockmech.ground.errors import BlockmechError
from blockmech.testing.strategies import Options, Seeded, random_mechanism
from tests.campaigns.honesty import TooLong, impatient

METHODS = ("auto", "dop853")
SPAN, PATIENCE, REACHED, OFTEN = 12.0, 20.0, 1e-9, 100.0  # [s], [s] of computing, [rad or m]
KINDS = Options(drivers=(1, 1), groups=(1, 2), loads=False, springs=False)


def machine(seed: int) -> tuple[Any, dict[str, tuple[float, float]]]:
    """A mechanism in which every pair rubs, and its start at rest."""
    case = random_mechanism(Seeded(seed), KINDS)
    rng = np.random.default_rng(seed)
    for name, block in list(case.graph.blocks.items()):
        laws = dict(getattr(block, "friction", {}))
        for joint in getattr(block, "joints", {}).values():
            law = {"coefficient": float(rng.uniform(0.05, 0.3))}
            if joint.kind == "R":
                law["radius"] = float(rng.uniform(0.005, 0.05))
            laws.setdefault(joint.name, Coulomb(**law))
        if laws:
            case.graph.blocks[name] = block.model_copy(update={"friction": laws})
    mech = case.graph.compile()
    (driver,) = mech.drivers
    q = float(np.ravel(case.request["at"][driver])[0])
    return mech, {driver: (q, 0.0)}


def timed(mech: Any, start: Any, method: str) -> dict[str, Any]:
    """What a motion takes, and how it ends."""
    signal.setitimer(signal.ITIMER_VIRTUAL, PATIENCE)
    begin = time.process_time()
    try:
        motion = mech.simulate(f"time={SPAN}", start=start, method=method, want=[]).motion
    except TooLong:
        return {"seconds": math.inf, "end": "too long", "error": math.inf, "by": method}
    except BlockmechError as error:
        return {"seconds": 0.0, "end": f"{error!s:.60}", "error": math.inf, "by": method}
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
    seconds = time.process_time() - begin
    standstills = sum(event.kind == "standstill" for event in motion.events)
    return {"seconds": seconds, "end": motion.end, "status": motion.status, "by": motion.method,
            "error": motion.error, "t": motion.t_end, "standstills": standstills,
            "notes": motion.notes}  # fmt: skip


def campaign(path: Path, machines: int, first: int) -> None:
    """Append machines to a file."""
    with path.open("a", encoding="utf-8") as out:
        seed = count = 0
        while count < machines:
            seed += 1
            try:
                mech, start = machine(first + seed)
                mech.simulate("time=0.001", start=start, want=[])
            except (BlockmechError, ValueError):  # no inertia, or no pose
                continue
            rows = {method: timed(mech, start, method) for method in METHODS}
            out.write(json.dumps({"seed": first + seed, "name": mech.name} | rows) + "\n")
            out.flush()
            count += 1


def table(path: Path) -> None:
    """Print what became of the machines of a file."""
    rows = [json.loads(line) for line in path.read_text("utf-8").splitlines()]
    ratios = []
    for row in rows:
        good = [row[m]["seconds"] for m in METHODS[1:] if row[m]["error"] <= REACHED]
        ratios.append(row["auto"]["seconds"] / max(min(good, default=math.inf), 1e-3))
    print(f"{len(rows)} machines; auto / cheapest that reaches {REACHED:g}: median "
          f"{np.median(ratios):.2f}, largest {max(ratios):.3g}; auto takes at most "
          f"{max(row['auto']['seconds'] for row in rows):.3g} s")  # fmt: skip
    for row, ratio in sorted(zip(rows, ratios, strict=True), key=lambda pair: -pair[1])[:12]:
        descriptions = (f"{m} {row[m]['seconds']:.3g} s, {row[m]['end']}, {row[m]['error']:.1e}"
                for m in METHODS)  # fmt: skip
        print(
            f"{'!' if ratio > OFTEN else ' '} {row['seed']} {ratio:.3g}: {'; '.join(descriptions)}"
        )


def main() -> None:
    """Read the arguments and go."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("results", type=Path)
    parser.add_argument("--machines", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--again", action="store_true")
    options = parser.parse_args()
    signal.signal(signal.SIGVTALRM, impatient)
    if not options.again:
        campaign(options.results, options.machines, options.seed * 1_000_000)
    table(options.results)


if __name__ == "__main__":
    main()
