"""A study: designs of one mechanism, each run over the same poses and reduced to numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from blockmech.compiled import Compiled
from blockmech.errors import FormatError, GraphError, Problem
from blockmech.settings import check_switch, friction_asked
from blockmech.studies.family import Family, as_said
from blockmech.studies.reductions import wanted
from blockmech.studies.runner import Block, Runner
from blockmech.studies.sampling import Designs, Distribution, Sampling, designs
from blockmech.studies.table import Study
from blockmech.typing import Coordinates, FrictionMethod, Numbers

Told = Callable[[str, float, float | None], None]


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
    progress: Told | None = None,
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

    Returns
    -------
    Study
        A row a design. One that does not assemble says why. After Ctrl-C the designs that
        are done.

    Raises
    ------
    RequestError for unknown addresses, outputs or reductions, or settings that do not fit
    FormatError for values that the file would refuse
    """
    check_switch("static", static)
    friction_asked(friction, tolerance, iterations)
    how = {"friction": friction, "tolerance": tolerance, "iterations": iterations, "static": static}
    chosen = designs(vary, sampling, count, seed)
    family = Family(mechanism, vary)
    _check_values(family, chosen)
    poses = {"at": over, "samples": samples, "times": times}
    taken = Runner(family, (), poses, how).samples(mechanism)
    columns = wanted(want, family.general.outputs, taken, mechanism.drivers)
    runner = Runner(family, columns, poses, how)
    blocks, done = _run(runner, chosen, taken.n, progress)
    made = chosen.columns(0, done)
    return Study(
        mechanism.name,
        dict(zip(made, family.parameters, strict=True)),
        made,
        columns,
        Block.joined(blocks),
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


def _run(runner: Runner, chosen: Designs, n: int, say: Told | None) -> tuple[list[Block], int]:
    """All blocks of designs, and how many designs that are; fewer after Ctrl-C."""
    blocks: list[Block] = []
    size, done = runner.size(n), 0
    try:
        planned = runner.prepared()
        for start in range(0, chosen.count, size):
            stop = min(start + size, chosen.count)
            made = chosen.columns(start, stop)
            numbers = dict(zip(runner.family.parameters, made.values(), strict=True))
            blocks.append(runner.block(planned, numbers))
            done = stop
            if say is not None:
                say(f"{done} of {chosen.count} designs", done, chosen.count)
    except KeyboardInterrupt:
        if not blocks:
            raise
    return blocks, done
