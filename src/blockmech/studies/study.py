"""A study: designs of one mechanism, each run over the same poses and reduced to numbers.

By this process it is one loop over blocks; by others, or into a folder, it goes by parts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import takewhile
from pathlib import Path
from typing import Any

from blockmech.compiled import Compiled
from blockmech.errors import FormatError, GraphError, Problem, needed
from blockmech.files import AnyPath
from blockmech.studies.block import Block, Rows
from blockmech.studies.family import Family, as_said
from blockmech.studies.parts import WITHOUT, Parts
from blockmech.studies.runner import Runner
from blockmech.studies.sampling import Designs, Distribution, Sampling, designs
from blockmech.studies.table import Study
from blockmech.studies.workers import Work, fingerprint, hands
from blockmech.typing import Coordinates, FrictionMethod, Numbers, Progress


def study(
    mechanism: Compiled,
    vary: Mapping[str, Numbers | Distribution],
    *,
    want: Mapping[str, str | Sequence[str]] | Sequence[str] | str,
    over: Coordinates | None = None,
    samples: int | None = None,
    times: Numbers | None = None,
    sampling: Sampling | None = None,
    count: int | None = None,
    seed: int = 0,
    friction: FrictionMethod | None = None,
    tolerance: float | None = None,
    iterations: int | None = None,
    static: bool = False,
    progress: Progress | None = None,
    out: AnyPath | None = None,
    workers: int | None = None,
    client: Any = None,
) -> Study:
    """Run many designs and keep a few numbers of each.

    Parameters
    ----------
    vary : address -> values (k,), or a distribution (`normal`, `uniform`)
        See `Mechanism.parameters` for the addresses.
    want : ``{"crank.drive": ["max_abs", "rms"], "dyad.margin": "min"}``, or texts such as
        ``"max_abs(crank.drive)"``
        Reductions over the poses: min, max, max_abs, range, mean, rms, at(coordinate), and
        poses for all of them.
    over : driver -> poses (n,) [rad or m]; by default the range of the drivers' laws
    samples, times : as those of a run, in place of ``over``
    sampling : "grid" (default of arrays) or "paired"; of distributions "latin" (default),
        "sobol" or "random"
    count, seed : of distributions, how many designs, and which
    friction, tolerance, iterations, static : as those of a run
    progress : told how far it is: ``progress(what, done, whole)``
    out : folder
        Where what is done is kept as Parquet files: asked again, a study that was interrupted
        goes on where it stopped. The numbers are read when they are asked for.
    workers : number of processes of this machine that do it, in place of this one
    client : a `dask.distributed.Client`, whose workers do it; ``out`` is a folder of theirs, too
        The answer is the same to the last bit, whoever does it.

    Returns
    -------
    Study
        A row a design. One that does not assemble says why. After Ctrl-C the designs that
        are done.

    Raises
    ------
    RequestError for unknown addresses, outputs or reductions, or settings that do not fit
    FormatError for values that the file would refuse
    MissingEngineError without pyarrow (extra ``study``) or distributed (extra ``cluster``)
    """
    how = {"friction": friction, "tolerance": tolerance, "iterations": iterations, "static": static}
    chosen = designs(vary, sampling, count, seed)
    family = Family(mechanism, vary)
    _check_values(family, chosen)
    poses = {"at": over, "samples": samples, "times": times}
    runner = Runner.of(family, want, poses, how)
    taken = runner.samples(mechanism)
    rows: Rows | Parts
    if out is None and workers is None and client is None:
        rows = _in_memory(runner, chosen, taken.n, progress)
    else:
        place = None if out is None else Path(out)
        rows = _in_parts(runner, chosen, taken.n, progress, place, workers, client)
    return Study(
        mechanism.name,
        dict(zip(vary, family.parameters, strict=True)),
        runner.want,
        rows,
        chosen.shape,
        {mechanism.of_driver(d, "q"): taken.coordinate(i) for i, d in enumerate(mechanism.drivers)},
        chosen.sampling,
        family.alone,
    )


def _check_values(family: Family, chosen: Designs) -> None:
    """Refuse values that the file would refuse: what it takes of a number are intervals.

    So the smallest and the largest value are tried, and zero, which is sometimes left out.
    """
    document = family.mechanism.document
    if document is None:
        return
    problems: list[Problem] = []
    columns = chosen.columns(0, chosen.count)
    for (address, values), p in zip(columns.items(), family.parameters, strict=True):
        tried = {float(values.min()), float(values.max()), *values[values == 0.0][:1].tolist()}
        for x in sorted(tried):
            try:
                document.replace({address: as_said(p, x)})
            except (FormatError, GraphError) as error:
                problems += error.problems
    if problems:
        raise FormatError(dict.fromkeys(problems))


def _in_memory(runner: Runner, chosen: Designs, n: int, say: Progress | None) -> Rows:
    """All designs, or those before Ctrl-C."""
    blocks: list[Block] = []
    done, size = 0, runner.part(n)
    try:
        planned = runner.prepared(chosen.count)
        for start in range(0, chosen.count, size):
            part = chosen.part(start, min(start + size, chosen.count))
            for block in runner.blocks(planned, part):
                blocks.append(block)
                done += len(block.word)
                _tell(say, done, chosen.count)
    except KeyboardInterrupt:
        if not blocks:
            raise
    return Rows(chosen.columns(0, done), Block.joined(blocks))


def _in_parts(
    runner: Runner,
    chosen: Designs,
    n: int,
    say: Progress | None,
    place: Path | None,
    workers: int | None,
    client: Any,
) -> Rows | Parts:
    """All designs, or those that were done in a row before Ctrl-C; parts that exist are done."""
    size = runner.part(n)
    starts = range(0, chosen.count, size)
    spans = tuple((start, min(start + size, chosen.count)) for start in starts)
    parts, left = None, list(spans)
    if place is not None:
        needed("pyarrow", "out", "study", WITHOUT)
        question = fingerprint(runner, chosen)
        parts = Parts(place, question, tuple(chosen.vary), runner.want, spans)
        left = parts.missing()
    ask = hands(Work(runner, chosen, parts), workers, client)
    found: dict[tuple[int, int], Block | None] = dict.fromkeys(set(spans) - set(left))
    done = chosen.count - sum(stop - start for start, stop in left)
    answers = ask(left)
    try:
        for span, block in answers:
            found[span] = block
            done += span[1] - span[0]
            _tell(say, done, chosen.count)
    except KeyboardInterrupt:
        answers.close()
        if spans[0] not in found:
            raise
    whole = tuple(takewhile(lambda span: span in found, spans))
    if parts is not None:
        return replace(parts, spans=whole)
    blocks = [block for span in whole if (block := found[span]) is not None]
    return Rows(chosen.columns(0, whole[-1][1]), Block.joined(blocks))


def _tell(say: Progress | None, done: int, whole: int) -> None:
    if say is not None:
        say(f"{done} of {whole} designs", done, whole)
