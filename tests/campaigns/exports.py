"""What leaves the package, over random machines: C, FMUs and functions of JAX against its own runs.

    python -m tests.campaigns.exports {c,fmu,jax} RESULTS [--first 0] [--count 100]

A line of RESULTS (JSON) is a machine: how many samples had an answer, and the largest difference of
an output by the largest number of its unit. C is held against Python's scalar engine, JAX against
NumPy, FMUs by where they are after a free motion of 20 ms against `simulate`, and by the rest of
their drives' balance. A refusal says why: C knows no general group that several drivers move, and a
machine that locks itself does not move. Quantities that are zero but for rounding differ by
rounding.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

import blockmech as bm
from blockmech.mechanism import Mechanism
from blockmech.result.result import Result
from blockmech.testing.strategies import EVERY, KINDS, Options, Seeded, random_mechanism

SHAPES = (
    Options(groups=(1, 3), kinds=EVERY),
    Options(groups=(1, 4), kinds=KINDS),
    Options(groups=(1, 2), kinds=("group.general",), drivers=(1, 1), sizes=((4, 0), (2, 0))),
)
SAMPLES, END = 20, 0.02
Request = Mapping[str, Any]


def samples_around(mech: Mechanism, pose: Request, seed: int) -> dict[str, Any]:
    """Samples near the pose in which a machine was made, the first one that, with any rates."""
    rng, n = np.random.default_rng(seed), SAMPLES
    offsets = [np.append(0.0, rng.uniform(-0.3, 0.3, n - 1)) for _ in mech.drivers]
    at = {d: np.asarray(pose["at"][d]) + x for d, x in zip(mech.drivers, offsets, strict=True)}
    rates, accelerations = ({d: k * rng.normal(size=n) for d in at} for k in (3.0, 5.0))
    return {"at": at, "rates": rates, "accelerations": accelerations}


def misfit(columns: Mapping[str, tuple[str, Any, Any]]) -> dict[str, Any]:
    """The largest difference of columns: name -> unit, number, and what it should be."""
    scales: dict[str, float] = {}
    for unit, _, expected in columns.values():
        top = np.abs(expected[np.isfinite(expected)]).max(initial=0.0)
        scales[unit] = max(scales.get(unit, 0.0), float(top))
    deviations = {
        name: float(np.nanmax(np.abs(x - y) / (scales[unit] or 1.0), initial=0.0))
        for name, (unit, x, y) in columns.items()
    }
    name = max(deviations, key=deviations.__getitem__)
    nan = [n for n, (_, x, y) in columns.items() if (np.isnan(x) != np.isnan(y)).any()]
    return {"deviation": deviations[name], "output": name, "only_one_is_nan": nan[:4]}


def by_c(mech: Mechanism, pose: Request, seed: int) -> dict[str, Any]:
    """The C text, compiled, at samples."""
    from blockmech.exchange.c.program import CProgram
    from blockmech.result.quality import WORDS
    from tests.exchange.compiled_c import Called, scalar

    program = CProgram(mech)
    request = samples_around(mech, pose, seed)
    samples = mech.samples(request["at"], None, None, request["rates"], request["accelerations"])
    with tempfile.TemporaryDirectory() as folder:
        values, statuses = Called(program, Path(folder), level="-O0")(samples)
    run, feasible = scalar(program, samples), statuses == 0
    expected = [np.broadcast_to(program.column(run, n), SAMPLES) for n in program.outputs]
    columns = {
        n: (program.unit_of(n), x[feasible], y[feasible])
        for n, x, y in zip(program.outputs, values.T, expected, strict=True)
    }
    statuses_agree = [WORDS[i] for i in statuses] == [*run.quality.status]
    return {"answers": int(feasible.sum()), "statuses_agree": statuses_agree, **misfit(columns)}


def by_jax(mech: Mechanism, pose: Request, seed: int) -> dict[str, Any]:
    """The function of JAX at samples, interpreted."""
    import jax

    jax.config.update("jax_enable_x64", True)
    friction = ("newton", "none", "successive", "single")[seed % 4]
    request = samples_around(mech, pose, seed)
    run: Result = mech.run(**request, friction=friction, on_gap="mark", engine="numpy")
    names = [n for n in run if mech.outputs[n].kind != "number"]
    quantities = zip(("q", "rate", "acceleration"), request.values(), strict=True)
    inputs = {mech._of_driver(d, name): x for name, by in quantities for d, x in by.items()}
    f = mech.function([*inputs], names, "*", friction=friction)
    with jax.disable_jit():
        y = f(f.parameters, inputs)
    columns = {
        n: (mech.outputs[n].unit, np.broadcast_to(y[n], np.shape(run[n])), run[n]) for n in names
    }
    return {"answers": run.quality.status.count("ok"), **misfit(columns)}


def by_fmu(mech: Mechanism, pose: Request, seed: int) -> dict[str, Any]:
    """The unit, moved by FMPy."""
    import fmpy

    quantities = ("q", "rate", "drive")
    q, rate, drive = ([mech._of_driver(d, name) for d in mech.drivers] for name in quantities)
    coordinates = [float(np.ravel(pose["at"][d])[0]) for d in mech.drivers]
    speeds = [float(np.clip(np.ravel(pose["rates"][d])[0], -2, 2)) for d in mech.drivers]
    start = dict(zip(mech.drivers, zip(coordinates, speeds, strict=True), strict=True))
    ours = mech.simulate(f"time={END}", times=[0.0, END], want=q, accuracy=1e-9, start=start)
    with tempfile.TemporaryDirectory() as folder:
        (unit,) = bm.write(mech, Path(folder) / "m.fmu", want=drive)
        theirs = fmpy.simulate_fmu(
            str(unit),
            fmi_type="ModelExchange",
            stop_time=END,
            start_values=dict(zip(q + rate, coordinates + speeds, strict=True)),
            output=q + drive,
            relative_tolerance=1e-10,
        )
    deviation = float(max(abs(theirs[n][-1] - ours[n][-1]) for n in q))
    residual = max(float(abs(theirs[n]).max()) for n in drive)
    return {"answers": len(ours[q[0]]), "deviation": deviation, "drive": residual}


JUDGES: dict[str, Callable[..., dict[str, Any]]] = {"c": by_c, "fmu": by_fmu, "jax": by_jax}


def main() -> None:
    """Run the campaign."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("judge", choices=JUDGES)
    parser.add_argument("results", type=Path)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=100)
    options = parser.parse_args()
    for seed in range(options.first, options.first + options.count):
        case = random_mechanism(Seeded(seed), SHAPES[seed % len(SHAPES)])
        try:
            row = JUDGES[options.judge](case.graph.compile(), case.request, seed)
        except bm.BlockmechError as error:
            row = {"refused": str(error)[:200]}
        except Exception as error:  # any other is a fault of ours
            row = {"fault": repr(error)[:300]}
        print(line := json.dumps({"seed": seed, **row}), flush=True)
        with options.results.open("a", encoding="utf-8") as stream:
            stream.write(line + "\n")


if __name__ == "__main__":
    main()
