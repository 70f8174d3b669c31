"""Random motions, and whether their estimates hold: a script, not a test.

    python -m tests.campaigns.honesty RESULTS [--runs 4000] [--seed 1] [--again]
    python -m tests.campaigns.honesty --falls

Machines of the gallery and of `blockmech.testing.strategies`, random starts and spans, every
method that fits by every engine, targets 1e-3 to 1e-12. The truth is a method of another kind:
DOP853 for the path and Radau, for all others the path, or Radau where that does not fit; what it
does not know itself is not held against a run. A line of RESULTS is a run (JSON); the table counts,
by method and engine, runs that say they failed, that end by another name than the truth, and those
above their estimate; below it are the names by which runs failed. A campaign that was ended goes on
where RESULTS ends: ``--runs`` counts those that are there. ``--again`` only prints the table of
RESULTS. ``--falls`` asks every machine for ever tighter accuracies, and prints where a tighter one
states a larger error.
"""

from __future__ import annotations

import argparse
import json
import math
import signal
import sys
from collections import Counter, defaultdict
from functools import cache
from itertools import pairwise, product
from pathlib import Path
from typing import Any

import numpy as np

import blockmech as bm
from blockmech.ground.errors import BlockmechError
from blockmech.testing.strategies import Options, Seeded, random_mechanism
from tests.dynamics.honesty import DEAR, GRAPHS, RUNS, apart, mechanism

METHODS = ("energy", "dop853", "radau", "auto", "rk4", "euler_q")
ENGINES = ("auto", "scalar", "llvm")
FINEST, FINE = 1e-14, 1e-10  # of a truth: along the path and by DOP853, by Radau
PATIENCE = 4  # [s] of computing for a run
TIGHTER = (1e-5, 1e-7, 1e-9, 1e-11, 1e-12, 1e-13, 1e-14)
SAME = 1 + 1e-6  # of a floor of rounding, which is told by states on the way
MOTIONS = {"pin_pendulum": 3.0, "sticking_slider": 1.0, "shaken_slider": 2.0, "gas_crank": 0.1,
           "clock": 2.0, "falling_rod": 2.0}  # [s]  # fmt: skip


class TooLong(Exception):
    """A run that takes longer than anybody waits."""


def impatient(signum: int, frame: Any) -> None:
    """End a run."""
    raise TooLong


@cache
def of_motions(name: str) -> Any:
    """A graph of the folder `motions`."""
    return bm.Graph.load(GRAPHS / "motions" / f"{name}.json").compile()


def scene(seed: int) -> tuple[str, Any, dict[str, tuple[float, float]], float]:
    """Name, mechanism, start and span [s] of a case."""
    rng, chance = np.random.default_rng(seed), Seeded(seed)
    kind = rng.choice(["gallery", "motions", "random"], p=[0.35, 0.15, 0.5])
    if kind == "gallery":
        name = str(rng.choice([n for n in RUNS if n not in DEAR]))
        mech, runs = mechanism(name), RUNS[name][1]
        run = runs[int(rng.integers(len(runs)))]
        (driver,) = mech.drivers
        rate = run.rate * rng.uniform(0.3, 1.5) if rng.random() < 0.7 else 0.0
        return name, mech, {driver: (run.q + rng.normal() * 0.3, rate)}, run.span * rng.random()
    if kind == "motions":
        name = str(rng.choice(list(MOTIONS)))
        mech = of_motions(name)
        ((driver, start),) = mech.scene.initial.items()
        stay = rng.random() < 0.5
        q = start.q + (0.0 if name == "falling_rod" else 0.3 * rng.normal())
        rate = start.rate if stay else start.rate + rng.normal()
        return name, mech, {driver: (q, rate)}, MOTIONS[name] * rng.uniform(0.3, 1.5)
    rubs = bool(rng.random() < 0.3)
    case = random_mechanism(chance, Options(drivers=(1, 1), groups=(1, 3), friction=rubs))
    mech = case.graph.compile()
    (driver,) = mech.drivers
    q = float(np.ravel(case.request["at"][driver])[0])
    rate = 0.0 if rng.random() < 0.4 else float(rng.normal() * 3)
    return f"random {seed}", mech, {driver: (q, rate)}, float(rng.uniform(0.05, 2.0))


def moved(case: tuple[Any, ...], method: str, accuracy: float | None, engine: str = "auto") -> Any:
    """The motion of a case by a method; None where that is refused or takes too long."""
    _, mech, start, span = case
    signal.setitimer(signal.ITIMER_VIRTUAL, PATIENCE)
    try:
        times = np.linspace(0.0, span, 10)[1:]
        options: dict[str, Any] = {"times": times, "method": method, "accuracy": accuracy}
        options["engine"] = engine
        driver = next(iter(start))
        until = f"time={span!r}"
        return mech.simulate(until, start=start, want=[f"{driver}.q"], **options).motion
    except (BlockmechError, TooLong):
        return None
    except Exception as crash:  # a finding, and no reason to lose the rest
        print(f"{case[0]}, {method}, {accuracy}: {crash!r:.200}", file=sys.stderr, flush=True)
        return None
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)


def known(truth: Any) -> bool:
    """Whether a motion is good enough to be a truth."""
    return truth is not None and truth.status != "failed" and truth.error < 1e-6


def compared(motion: Any, truth: Any) -> dict[str, Any]:
    """How far a motion is from the truth, beyond what that does not know itself."""
    off = max(0.0, apart(motion, truth) - truth.error) if truth.t_end > 0 else 0.0
    late = 0.0
    if motion.end == truth.end != "time":
        late = max(0.0, abs(motion.t_end - truth.t_end) - truth.time_error)
    ratios = [e / s if s > 0 else math.inf * (e > 0) if e else 0.0
              for e, s in ((off, motion.error), (late, motion.time_error))]  # fmt: skip
    return {"error": off, "late": late, "ratio": max(ratios), "end": motion.end,
            "estimate": motion.error, "time_estimate": motion.time_error,
            "status": motion.status, "truth_end": truth.end,
            "other_end": motion.end != truth.end}  # fmt: skip


def campaign(path: Path, runs: int, seed: int) -> None:
    """Append runs to a file until there are so many."""
    stored = rows_of(path) if path.exists() else []
    count, seed = len(stored), max([seed, *(row["seed"] for row in stored)])
    with path.open("a", encoding="utf-8") as out:
        while count < runs:
            seed += 1
            rng = np.random.default_rng(seed)
            try:
                case = scene(seed)
            except (BlockmechError, ValueError):
                continue
            explicit, path_motion = (moved(case, kind, FINEST) for kind in ("dop853", "energy"))
            second = path_motion or moved(case, "radau", FINE)
            comparable = {"energy", "radau", "euler_q"} | ({"auto"} if path_motion else set())
            lost: set[tuple[str, str]] = set()  # refused, or for longer than anybody waits
            for method in 2 * METHODS:
                truth = explicit if method in comparable else second
                target = float(10.0 ** -rng.uniform(3, 6 if method in ("rk4", "euler_q") else 12))
                engine = str(rng.choice(ENGINES))
                if (method, engine) in lost or not known(truth):
                    continue
                motion = moved(case, method, target, engine)
                if motion is None:
                    lost.add((method, engine))
                    continue
                row = {"seed": seed, "name": case[0], "method": method, "engine": engine,
                       "by": motion.method, "code": motion.engine, "target": target,
                       **compared(motion, truth)}  # fmt: skip
                out.write(json.dumps(row) + "\n")
                out.flush()
                count += 1


def falls() -> None:
    """Print what ever tighter requests state, and where that grows."""
    for path in sorted(GRAPHS.rglob("*.json")):
        for method, engine in product(("auto", "dop853", "radau"), ("scalar", "llvm")):
            stated = tighter(path, {"method": method, "engine": engine})
            grows = "  grows" if any(b > SAME * a for a, b in pairwise(stated)) else ""
            errors = " ".join(f"{x:.1e}" for x in stated)
            if stated:
                print(f"{path.stem:28}{method:8}{engine:8}{errors}{grows}", flush=True)


def tighter(path: Path, options: dict[str, Any]) -> list[float]:
    """What ever tighter requests of a machine state; nothing where it cannot move."""
    try:
        mech = bm.Graph.load(path).compile()
        options |= {"want": [], "budget": PATIENCE}
        runs = (mech.simulate("time=0.1", accuracy=target, **options) for target in TIGHTER)
        return [run.motion.error for run in runs]
    except BlockmechError:
        return []


def rows_of(path: Path) -> list[dict[str, Any]]:
    """The runs of a file."""
    return [json.loads(line) for line in path.read_text("utf-8").splitlines()]


def table(path: Path) -> None:
    """Print what became of the runs of a file."""
    rows = rows_of(path)
    by: dict[str, list[Any]] = defaultdict(list)
    for row in rows:
        for name in (row["method"], f"{row['method']} {row['engine']}", "all"):
            by[name].append(row)
    print(f"{'method':16}{'runs':>6}{'failed':>8}{'other end':>11}{'above':>7}{'share':>8}"
          f"{'> 10x':>7}{'worst':>10}")  # fmt: skip
    for method in [*(f"{m}{e}" for m in METHODS for e in ("", *(f" {e}" for e in ENGINES))), "all"]:
        result = by[method]
        sure = [r for r in result if r["status"] != "failed"]
        same = [r for r in sure if not r["other_end"]]
        above = [r for r in same if r["ratio"] > 1]
        worst = max((r["ratio"] for r in same), default=0.0)
        print(
            f"{method:16}{len(result):6}{len(result) - len(sure):8}{len(sure) - len(same):11}"
            f"{len(above):7}{len(above) / max(1, len(same)):8.2%}"
            f"{sum(r['ratio'] > 10 for r in above):7}{worst:10.3g}"
        )
    print("\nnames of those that failed")
    failed = Counter((r["method"], r["end"]) for r in rows if r["status"] == "failed")
    for (method, end), times in failed.most_common():
        print(f"{method:16}{times:6}  {end}")
    print("\nthe worst, and other ends")
    doubtful = [r for r in rows if r["status"] != "failed" and (r["ratio"] > 1 or r["other_end"])]
    for row in sorted(doubtful, key=lambda r: (not r["other_end"], r["ratio"]))[::-1][:40]:
        print({k: f"{v:.3g}" if isinstance(v, float) else v for k, v in row.items()})


def main() -> None:
    """Read the arguments and go."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("results", type=Path, nargs="?")
    parser.add_argument("--falls", action="store_true")
    parser.add_argument("--runs", type=int, default=4000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--again", action="store_true")
    options = parser.parse_args()
    if options.falls or options.results is None:
        falls()
        return
    signal.signal(signal.SIGVTALRM, impatient)
    if not options.again:
        campaign(options.results, options.runs, options.seed * 1_000_000)
    table(options.results)


if __name__ == "__main__":
    main()
