"""How much of `blockmech.dynamics` the gallery's scenes execute: a script, not a test.

    python -m tests.campaigns.scenes_reach [-v]

The scenes are those of ``blockmech test graphs``, the motion of every graph from its own
start, and the motions of `tests.dynamics.honesty`, with the default method and the graph's
own joint friction. With ``-v`` the lines that no scene reaches are listed. Needs `coverage`.
"""

from __future__ import annotations

import sys
from pathlib import Path

import coverage

ROOT = Path(__file__).resolve().parents[2]
GRAPHS, DYNAMICS = ROOT / "graphs", ROOT / "src" / "blockmech" / "dynamics"
TYPES_ONLY = ["if TYPE_CHECKING:", r"^\s*\.\.\.$"]


def play() -> None:
    """Every scene once."""
    import blockmech as bm
    from blockmech.cli import command
    from blockmech.ground.errors import BlockmechError
    from tests.dynamics.honesty import DEAR, RUNS, mechanism

    command()(["test", str(GRAPHS)], standalone_mode=False)
    for path in sorted([*GRAPHS.glob("*.json"), *GRAPHS.glob("motions/*.json")]):
        mech = bm.Graph.load(path).compile()
        if path.stem in DEAR or not set(mech.drivers) <= set(mech.scene.initial):
            continue
        for until in ("standstill", "time=0.5", "steady"):
            if until != "standstill" or len(mech.drivers) == 1:
                try:
                    mech.simulate(until)
                except BlockmechError as error:  # a steady state that there is not
                    print(f"{path.stem} until {until}: {str(error).splitlines()[0]}")
    for name, (_, runs) in RUNS.items():
        for run in runs if name not in DEAR else ():
            mech = mechanism(name)
            (driver,) = mech.drivers
            mech.simulate(f"time={run.span!r}", start={driver: (run.q, run.rate)})


def main() -> None:
    """Play under the eyes of `coverage` and tell the share of statements."""
    watch = coverage.Coverage(
        data_file=None, source=[str(DYNAMICS)], config_file=False, messages=False
    )
    for line in TYPES_ONLY:
        watch.exclude(line)
    watch.start()
    play()
    watch.stop()
    share = watch.report(show_missing="-v" in sys.argv, file=sys.stdout)
    print(f"{share:.1f} % of the statements")


if __name__ == "__main__":
    main()
