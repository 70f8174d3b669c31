"""Freezes the numbers of the gallery, and says which of them a change has moved: a script.

    python -m tests.campaigns.frozen write FILE.npz
    python -m tests.campaigns.frozen compare FILE.npz

Frozen are every output of every graph with each way to treat friction, the motion from every
start by each method that takes it, and the arcs in which a mechanism closes. `compare` tells
per request the largest change, as a share of the output's own largest magnitude; it is silent
about what stayed to the last bit, and exits with 1 if anything went beyond `ROUNDING`.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import blockmech as bm
from blockmech.ground.errors import BlockmechError
from blockmech.mechanism import Mechanism
from tests.dynamics.honesty import DEAR

GRAPHS = Path(__file__).resolve().parents[2] / "graphs"
ROUNDING = 1e-12  # of an output's largest magnitude: motions pass through conditioned places
SAMPLES = 37
SPAN = "time=0.5"
FRICTION = ("none", "single", "successive", "newton")
METHODS = ("energy", "dop853", "radau")
REFUSED = np.array(["refused"])  # itself an answer, which a change may move


def mechanisms() -> Iterator[tuple[str, Mechanism]]:
    """Every file of the gallery, compiled."""
    for folder, read in ((GRAPHS, bm.Graph), (GRAPHS / "motions", bm.Graph)):
        for path in sorted(folder.glob("*.json")):
            yield path.relative_to(GRAPHS).as_posix(), read.load(path).compile()
    for path in sorted((GRAPHS / "joints").glob("*.json")):
        yield path.relative_to(GRAPHS).as_posix(), bm.Linkage.load(path).compile()


def answers(name: str, mech: Mechanism) -> Iterator[tuple[str, bm.Result | None]]:
    """What is asked of one mechanism; None where the request is refused."""
    for friction in FRICTION:
        try:
            yield f"run/{friction}", mech.run(samples=SAMPLES, friction=friction, on_gap="mark")
        except BlockmechError:
            yield f"run/{friction}", None
    if Path(name).stem in DEAR or not set(mech.drivers) <= set(mech.scene.initial):
        return
    for method in METHODS:
        try:
            yield f"simulate/{method}", mech.simulate(SPAN, method=method, want=["*.q", "*.rate"])
        except BlockmechError:
            yield f"simulate/{method}", None


def numbers() -> dict[str, np.ndarray]:
    """All frozen numbers, by file, request and output."""
    frozen: dict[str, np.ndarray] = {}
    for name, mech in mechanisms():
        for request, result in answers(name, mech):
            if result is None:
                frozen[f"{name}|{request}|"] = REFUSED
                continue
            for output in result:
                frozen[f"{name}|{request}|{output}"] = np.asarray(result[output])
        if len(mech.drivers) == 1:
            frozen[f"{name}|limits|"] = np.array([(a.start.q, a.end.q) for a in mech.limits().arcs])
        print(name, flush=True)
    return frozen


def moved(old: np.ndarray, new: np.ndarray) -> float:
    """The largest change as a share of the largest magnitude; infinite where shapes differ."""
    if old.shape != new.shape or old.dtype.kind != new.dtype.kind:
        return np.inf
    if old.dtype.kind not in "fc":
        return 0.0 if np.array_equal(old, new) else np.inf
    finite = np.isfinite(old)
    if not np.array_equal(finite, np.isfinite(new)):
        return np.inf
    largest = np.max(np.abs(old[finite]), initial=0.0)
    return float(np.max(np.abs(old - new)[finite], initial=0.0) / (largest or 1.0))


def main() -> int:
    """Write or compare."""
    warnings.simplefilter("ignore")
    command, file = sys.argv[1:]
    new = numbers()
    if command == "write":
        np.savez_compressed(file, **new)
        return 0
    old = dict(np.load(file))
    worst: dict[str, tuple[float, str]] = {}
    for key in sorted(old.keys() | new.keys()):
        change = moved(old[key], new[key]) if key in old and key in new else np.inf
        request, _, output = key.rpartition("|")
        worst[request] = max(worst.get(request, (0.0, "")), (change, output))
    for request, (change, output) in worst.items():
        if change:
            print(f"{request}: {change:.1e} in {output or 'the answer'}")
    return int(any(change > ROUNDING for change, _ in worst.values()))


if __name__ == "__main__":
    sys.exit(main())
