"""A study: designs of one mechanism, each run over the same poses and reduced to numbers.

Designs go out in parts: to this process, or to others, their answers into memory or a folder.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from blockmech.compiled import Compiled
from blockmech.ground.arguments import declared
from blockmech.ground.errors import needed
from blockmech.ground.files import AnyPath
from blockmech.ground.progress import with_bar
from blockmech.studies.distributions import Distribution, Sample
from blockmech.studies.family import Family, in_si_by_address
from blockmech.studies.fingerprint import fingerprint
from blockmech.studies.motions import runner_of
from blockmech.studies.rows import WITHOUT, Parts, Rows, Span
from blockmech.studies.runner import Runner
from blockmech.studies.sampling import Designs, designs
from blockmech.studies.table import Study
from blockmech.studies.workers import Work, hands
from blockmech.typing import (
    Arguments,
    Coordinates,
    EngineName,
    FrictionMethod,
    Numbers,
    Progress,
)

if TYPE_CHECKING:
    from distributed import Client


@with_bar
@declared
def study(
    mechanism: Compiled,
    vary: Mapping[str, Numbers | Distribution],
    *,
    want: Mapping[str, str | Sequence[str]] | Sequence[str] | str,
    at: Coordinates | None = None,
    samples: int | None = None,
    times: Numbers | None = None,
    sampling: Literal["grid", "paired"] | Sample | None = None,
    friction: FrictionMethod | None = None,
    static: bool = False,
    engine: EngineName = "auto",
    progress: Progress | None = None,
    out: AnyPath | None = None,
    workers: int | Client | None = None,
    simulate: Arguments | None = None,
) -> Study:
    """Run many designs, and keep a few results of each.

    Parameters
    ----------
    vary : address -> values (k,), e.g. ["50mm", 0.06], or a distribution (`Normal`, `Uniform`)
        See `Mechanism.parameters` for the addresses.
    want : ``{"crank.drive": ["max_abs", "rms"], "dyad.margin": "min"}``, or texts such as
        ``"max_abs(crank.drive)"``
        Extremes over the range of the poses, found between them to 1e-9 of the value: min, max,
        max_abs, range, stroke; over the poses themselves mean, rms, at(coordinate), and poses for
        all of them; ``rest`` is the output at the stable equilibrium nearest to the first pose.
    at : driver -> poses (n,) [rad or m]; by default the range of the drivers' laws
    samples, times : as those of a run, in place of ``at``
    sampling : "grid" (default) or "paired" of arrays; of distributions a `Sample`, such as
        ``bm.dist.Sample(1000)``
    friction, static : as those of a run
    engine : "numpy", "llvm" for machine code, or "auto", the quicker one
    progress : called as ``progress(task, completed, total)``
    out : folder
        Folder of the completed designs, as Parquet files; an interrupted study continues from
        them. Numbers are read when they are used.
    workers : number of processes on this machine to use in place of this one; or a
        `dask.distributed.Client`, whose workers must then reach ``out`` as well. The result is
        bitwise the same in all cases.
    simulate : arguments of `simulate`, e.g. ``{"until": "standstill", "budget": 5}``
        Each design is simulated, and outputs are reduced over the output times: also ``final``,
        ``settling`` (2 % of the change, or ``settling(crank.q, 0.05)``) and numbers of the
        motion such as ``"motion.t_end"``, ``"motion.fluctuation"``, ``"motion.time_to_rest"``

    Returns
    -------
    Study
        One row per design. A design that does not assemble has margins and a status, but no
        numbers; one whose extreme was not refined fully is "coarse". After Ctrl-C the completed
        designs.

    Raises
    ------
    RequestError for unknown addresses, outputs or reductions, or settings that do not fit
    FormatError for values that the file would refuse
    MissingEngineError without pyarrow (extra ``study``), distributed (``cluster``) or llvmlite
        (``fast``)

    >>> study = mech.study({"dyad.l_i": [5.9, 6.0, 6.1]}, want={"crank.drive": "max"}, samples=13)
    >>> print(study)
    ruiz_fourbar: 3 designs at 13 poses, 1 number varied
    <BLANKLINE>
    dyad.l_i [m]  max(crank.drive) [N m]  status
    5.9           8941.81                 ok
    6             9288.31                 ok
    6.1           10150.1                 ok
    """
    how = {"friction": friction, "static": static}
    vary = in_si_by_address(mechanism, vary, "vary")
    chosen = designs(vary, sampling)
    family = Family(mechanism, vary, friction)
    poses = {"at": at, "samples": samples, "times": times}
    runner = runner_of(family, want, poses, how, simulate)
    runner.check_values(chosen)
    runner = replace(runner, engine=engine).settled(chosen.count)
    return Study(
        mechanism.name,
        dict(zip(vary, family.parameters, strict=True)),
        runner.want,
        chosen,
        _rows(runner, chosen, progress, out, workers),
        runner.coordinates,
        family.alone,
        runner.engine,
        runner,
    )


def _rows(
    runner: Runner,
    chosen: Designs,
    say: Progress | None,
    out: AnyPath | None,
    workers: int | Client | None,
) -> Rows | Parts:
    """All designs, or those that were done in a row before Ctrl-C; parts that exist are done."""
    parts, gaps = None, [(0, chosen.count)]
    if out is not None:
        needed("pyarrow", "out", "study", WITHOUT)
        parts = Parts(Path(out), fingerprint(runner, chosen), runner.want).existing(chosen)
        gaps = parts.missing(chosen.count)
    blocks: dict[Span, Rows | None] = dict.fromkeys(parts.spans if parts else ())
    done = chosen.count - sum(stop - start for start, stop in gaps)
    left = [span for gap in gaps for span in runner.spans(*gap)]
    answers = hands(Work(runner, chosen, parts), workers)(left)
    try:
        for span, block in answers:
            blocks[span] = block
            done += span[1] - span[0]
            if say is not None:
                say(f"{done} of {chosen.count} designs", done, chosen.count)
    except KeyboardInterrupt:
        answers.close()
        if not any(start == 0 for start, _ in blocks):
            raise
    whole: list[Span] = []
    stop = 0
    for span in sorted(blocks):
        if span[0] == stop:
            whole.append(span)
            stop = span[1]
    if parts is not None:
        return replace(parts, spans=tuple(whole))
    return Rows.joined([block for span in whole if (block := blocks[span]) is not None])
