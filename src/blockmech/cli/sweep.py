"""``blockmech sweep`` and ``sensitivity``: designs of a mechanism, and a few numbers of each."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from blockmech.builders import compiled
from blockmech.cli.numbers import row, starts, texts_by_name
from blockmech.cli.options import (
    Accuracy,
    DisplayUnits,
    Friction,
    FrictionOptions,
    GraphFile,
    Method,
    Poses,
    Start,
    Static,
    Until,
    names_of,
    option,
)
from blockmech.cli.output import TableDisplay, check_places, write_answer
from blockmech.cli.terminal import Interrupted, progress_bar, reading, say
from blockmech.ground.errors import needed, refused
from blockmech.ground.runnable import EVERYTHING
from blockmech.model.parameters import named
from blockmech.studies.distributions import Distribution, Normal, Sample, Uniform
from blockmech.studies.sampling import OF_DISTRIBUTIONS
from blockmech.typing import Arguments

if TYPE_CHECKING:
    from blockmech.compiled import Compiled

Vary = Annotated[
    list[str],
    option("A number and its values: dyad.l_i=5.5:6.5:201, normal(6,1e-4), ...", "ADDRESS=VALUES"),
]
Keep = Annotated[list[str], option('What is kept, e.g. "max_abs(crank.drive)".', "REDUCTION")]
How = Annotated[str | None, option("grid or paired; latin, sobol or random.", "SAMPLING")]
Count = Annotated[int | None, option("How many designs distributions draw.", "N", min=1)]
Seed = Annotated[int, option("Seed of the designs that distributions draw.", "N", min=0)]
Out = Annotated[
    str | None,
    option("Write a table (csv, parquet), or parts into a folder, to go on there.", "FILE|FOLDER"),
]
Workers = Annotated[int | None, option("Processes of this machine that do it.", "N", min=1)]
Dask = Annotated[str | None, option("A Dask cluster that does it: tcp://host:8786.", "ADDRESS")]
Plot = Annotated[str | None, option("Draw it (png, svg, pdf).", "FILE")]

TABLES = (".csv", ".parquet")
LAWS: dict[str, Callable[..., Distribution]] = {"normal": Normal, "uniform": Uniform}
LAW = re.compile(r"(normal|uniform)\((.*)\)")


def sweep(
    file: GraphFile,
    vary: Vary,
    want: Keep,
    poses: Poses,
    friction: FrictionOptions,
    sampling: How = None,
    count: Count = None,
    seed: Seed = 0,
    static: Static = False,
    out: Out = None,
    plot: Plot = None,
    workers: Workers = None,
    dask: Dask = None,
    until: Until = None,
    start: Start = None,
    method: Method = "auto",
    accuracy: Accuracy = None,
    unit: DisplayUnits = None,
) -> None:
    """Run many designs: vary numbers of the file, and keep extremes or means of outputs.

    With --until each design moves under its loads, and reductions are over its motion.
    """
    mechanism = reading(file, compiled)
    check_places(out, plot)
    if out is not None and Path(out).suffix.lower() not in (*TABLES, ""):
        remedy = "give the name such a suffix, or none: that of a folder"
        raise refused(out, "a table is csv or parquet", remedy)
    in_parts = out is not None and not Path(out).suffix
    over = poses.of(mechanism)
    moving: Arguments | None = None
    if until is not None:
        moving = {"until": until, "method": method, "accuracy": accuracy}
        moving |= {"start": starts(mechanism, start), "times": over.pop("times")}
    elif start or method != "auto" or accuracy is not None:
        where, remedy = "--start, --method, --accuracy", "say what ends it: --until standstill"
        raise refused(where, "no design moves", remedy, code="useless-setting")
    request: Arguments = {**over, "friction": friction.method, "simulate": moving}
    request |= {"sampling": _sampling(sampling, count, seed), "static": static}
    request |= {"want": [_reduction(mechanism, x) for x in want]}
    request |= {"out": out if in_parts else None}
    numbers = _vary(mechanism, vary)
    with progress_bar("running") as progress, _hands(workers, dask) as hands:
        study = mechanism.study(numbers, progress=progress, workers=hands, **request)
    study = study.to(*names_of(unit))
    say(str(study))
    if in_parts:
        say(f"wrote {out}")
    write_answer(study, None if in_parts else out, None if study.interrupted else plot)
    if study.interrupted:
        raise Interrupted("what was run is kept")


def _sampling(method: str | None, count: int | None, seed: int) -> str | Sample | None:
    """How designs are made: of arrays by a word, of distributions by drawing so many."""
    if count is None and method not in OF_DISTRIBUTIONS:
        return method
    return Sample(count, method or "latin", seed)  # type: ignore[arg-type]


@contextmanager
def _hands(workers: int | None, address: str | None) -> Iterator[Any]:
    """The client of the cluster at an address, or so many processes of this machine."""
    if address is None:
        yield workers
        return
    if workers is not None:
        remedy = "give workers of this machine, or the address of a cluster"
        raise refused("--workers", "a cluster is given", remedy, code="useless-setting")
    distributed = needed("distributed", "--dask", "cluster")
    try:
        client = distributed.Client(address)
    except (OSError, ValueError) as error:
        reason = str(error).splitlines()[0]
        raise refused(f"--dask {address}", reason, "give the address of a scheduler") from error
    with client:
        yield client


def _reduction(mechanism: Compiled, text: str) -> str:
    """A reduction with its pose as a plain number: ``at(crank.drive, 60deg)`` at 1.047 rad."""
    from blockmech.studies.reductions import TEXT  # brings what runs

    match = TEXT.fullmatch(text.strip())
    if match is None or match["at"] is None or match["how"] != "at" or not mechanism.drivers:
        return text
    (q,) = row(f"--want {text}", match["at"], mechanism._coordinate_units[mechanism.drivers[0]])
    return f"{match['how']}({match['output']}, {q!r})"


def _vary(mechanism: Compiled, texts: list[str]) -> dict[str, list[float] | Distribution]:
    """Address -> values or distribution, from the ``--vary`` options."""
    from blockmech.studies.family import parameters  # brings what runs

    catalogue = parameters(mechanism)
    varied: dict[str, list[float] | Distribution] = {}
    for address, values in texts_by_name("--vary", texts, "dyad.l_i=1:2:11"):
        where = f"--vary {address}={values}"
        (parameter,) = named(catalogue, {address: 0})
        if parameter.address in varied:
            raise refused(where, f"{address} is given twice", "give it once")
        law = LAW.fullmatch(values)
        numbers = row(where, law[2] if law else values, parameter.unit)
        if law and len(numbers) != 2:
            raise refused(where, f"{len(numbers)} numbers", f"{law[1]} has two")
        varied[parameter.address] = LAWS[law[1]](*numbers) if law else numbers
    return varied


Wants = Annotated[list[str], option('Outputs or patterns, e.g. crank.drive,"*.reaction".', "A,B")]
To = Annotated[
    list[str] | None,
    option('Numbers or patterns, e.g. "dyad.l_*",crank.q; by default all numbers.', "A,B"),
]


def sensitivity(
    file: GraphFile,
    want: Wants,
    poses: Poses,
    display: TableDisplay,
    to: To = None,
    friction: Friction = None,
    static: Static = False,
) -> None:
    """Rank the parameters of a mechanism by their influence on outputs, from exact derivatives."""
    settings: Arguments = {
        "to": names_of(to) or EVERYTHING,
        "friction": friction,
        "static": static,
    }
    outputs = names_of(want)
    display.answer_command(
        file,
        compiled,
        "differentiating",
        lambda m: m.sensitivity(outputs, **poses.of(m, display.deg), **settings),
    )
