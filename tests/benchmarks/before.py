"""Speed beside the commit before: `python -m tests.benchmarks.before [COMMIT]`.

Both versions take turns in processes of their own, in processor time, the least of many. Machines
are shared, so a ratio is a regression only if it is above the limit in all of three repetitions.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

ROOT = Path(__file__).parents[2]
LIMIT = 1.5  # times as long as before
REPETITIONS, TURNS = 3, 3  # until a regression is believed; of both versions in each

TASKS = """
import json, sys, time
import numpy as np
start = time.process_time()
import blockmech as bm
times = {"import blockmech": time.process_time() - start}

def graph(name):
    return bm.Graph.load(f"graphs/{name}.json")

def least(task, run, prepare=lambda: None):
    try:
        begin, spent = time.process_time(), []
        while len(spent) < 3 or time.process_time() - begin < 0.4:
            argument = prepare()
            start = time.process_time()
            run() if argument is None else run(argument)
            spent.append(time.process_time() - start)
        times[task] = min(spent)
    except Exception as error:  # an older version has no such request
        print(task, repr(error), file=sys.stderr)

four_bar, watt = graph("ruiz_fourbar").compile(), graph("watt_sixbar").compile()
places, forces = ["*.p", "*.v", "*.a"], ["*.reaction", "crank.drive"]
q, many = np.linspace(0.0, 6.28, 2048), np.linspace(0.0, 6.28, 20_000)
lengths = {"crank.length": np.linspace(0.45, 0.55, 500)}
motion = {"method": "energy", "start": {"crank": (1.05, 0.0)}, "want": []}
least("load the excavator", lambda: graph("excavator"))
least("plan the excavator", lambda m: m.plan(), lambda: graph("excavator").compile())
least("one pose", lambda: four_bar.run(1.0, want=places))
least("2,048 poses", lambda: four_bar.run(q, want=places, engine="llvm"))
for engine in ("llvm", "numpy"):
    request = {"want": forces, "engine": engine}
    least(f"20,000 poses with friction, {engine}", lambda: four_bar.run(many, **request))
least("a study of 500 designs", lambda: four_bar.study(lengths, want=["max(crank.drive)"]))
least("a motion of 2 s", lambda: watt.simulate("time=2", **motion))
least("a proof", lambda: four_bar.enclose(1.0, want="crank.drive"))
print(json.dumps(times))
"""


def measure(version: Path) -> dict[str, float]:
    """Seconds of each task by the package of a folder."""
    environment = {**os.environ, "PYTHONPATH": str(version / "src")}
    command = [sys.executable, "-W", "ignore", "-c", TASKS]
    run = subprocess.run(command, cwd=version, env=environment, capture_output=True, text=True)
    if run.returncode:
        raise RuntimeError(run.stderr)
    times: dict[str, float] = json.loads(run.stdout.splitlines()[-1])
    return times


def ratios(before: Path, now: Path) -> dict[str, float]:
    """How many times as long each task takes as before, by the least of several turns."""
    times: list[dict[str, float]] = [{}, {}]
    for _ in range(TURNS):
        for version, fastest in zip((before, now), times, strict=True):
            for task, seconds in measure(version).items():
                fastest[task] = min(seconds, fastest.get(task, seconds))
    return {
        task: times[1][task] / seconds for task, seconds in times[0].items() if task in times[1]
    }


def regressions(repetition: Mapping[str, float], suspects: set[str] | None) -> set[str]:
    """Tasks above the limit in this repetition and in those before."""
    slower = {task for task, ratio in repetition.items() if ratio > LIMIT}
    return slower if suspects is None else slower & suspects


def main() -> int:
    """The exit status: 1 where a task is slower in all repetitions."""
    commit = sys.argv[1] if len(sys.argv) > 1 else "HEAD~1"
    archive = ["git", "-C", str(ROOT), "archive", commit, "src", "graphs"]
    with tempfile.TemporaryDirectory() as folder:
        files = subprocess.run(archive, capture_output=True)
        if files.returncode:
            print(f"no commit {commit} to compare the speed with")
            return 0
        subprocess.run(["tar", "-x", "-C", folder], input=files.stdout, check=True)
        try:
            measure(Path(folder))
        except RuntimeError as error:
            print(f"{commit} does not run here: {str(error).splitlines()[-1]}")
            return 0
        suspects: set[str] | None = None
        for k in range(REPETITIONS):
            repetition = ratios(Path(folder), ROOT)
            print(f"times as long as {commit}, repetition {k + 1}:")
            for task, ratio in repetition.items():
                print(f"  {task:42} {ratio:.2f}", flush=True)
            suspects = regressions(repetition, suspects)
            if not suspects:
                return 0
    print(f"above {LIMIT} in {REPETITIONS} repetitions: {', '.join(sorted(suspects))}")
    return 1


if __name__ == "__main__":
    sys.exit(main())
