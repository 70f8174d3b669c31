"""Verify: a computed mechanism held against the equations of mechanics, from its outputs alone.

The checks are a table. Each reads labelled outputs (places, rates, reactions) and the document,
not the kernels that made the numbers, and yields residuals of one link, pair, load or driver.
Two runs are held against it: the one that was asked for, and one without friction in which every
driver has another rate and acceleration at each sample, so that inertia is never out of sight.
Of a simulation the states are held against one another as well.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from blockmech.analysis.coupling_checks import derivatives, laws, lines_of_action
from blockmech.analysis.evidence import TOLERANCE, Evidence, Part, Residual
from blockmech.analysis.force_checks import (
    blocks,
    blows,
    couplings,
    frame,
    friction,
    links,
    reduction,
    whole,
)
from blockmech.analysis.load_checks import energies, loads
from blockmech.analysis.motion_checks import (
    closures,
    drivers,
    laws_of_motion,
    margins,
    markers,
    modes,
)
from blockmech.analysis.signal_checks import outputs
from blockmech.analysis.trajectory_checks import idle, trajectory
from blockmech.dynamics.chart_outputs import ChartedResult, result_along
from blockmech.ground.arguments import declared
from blockmech.ground.errors import refused
from blockmech.ground.limits import CHECKED
from blockmech.ground.report import Facts, Report
from blockmech.ground.runnable import EVERYTHING
from blockmech.model.structure import LinkRef
from blockmech.passes.signals import STATE
from blockmech.result.result import Result
from blockmech.result.samples import Samples
from blockmech.typing import (
    Arguments,
    Coordinates,
    Data,
    EngineName,
    FrictionMethod,
    Numbers,
    Precision,
    Real,
)

if TYPE_CHECKING:
    from blockmech.compiled import Compiled


CheckOf: TypeAlias = Callable[[Evidence], Iterator[Residual]]
CHECKS: tuple[CheckOf, ...] = (
    closures,
    markers,
    drivers,
    laws_of_motion,
    modes,
    margins,
    outputs,
    loads,
    links,
    frame,
    friction,
    blocks,
    couplings,
    laws,
    derivatives,
    lines_of_action,
    energies,
    whole,
    reduction,
)


@dataclass(frozen=True)
class Check(Facts):
    """One check: the largest relative error over the samples, and its tolerance.

    ``value`` is in units of the sum of absolute terms times the conditioning [-].
    """

    FACTS = ("name", "value", "allowed", "ok")

    name: str
    value: float
    allowed: float = TOLERANCE

    @property
    def ok(self) -> bool:
        """Whether the check holds."""
        return self.value <= self.allowed


@dataclass(frozen=True, repr=False)
class Verification(Facts, Report):
    """All checks of a mechanism.

    Attributes
    ----------
    rows : the checks
    samples : number of samples with an answer that were checked
    conditioning : largest conditioning of a block met [-]
    """

    FACTS = ("ok", "rows")

    rows: tuple[Check, ...]
    samples: int
    conditioning: float

    @property
    def ok(self) -> bool:
        """Whether every check holds and at least one sample was checked."""
        return self.samples > 0 and all(r.ok for r in self.rows)

    def lines(self) -> Iterator[str]:
        """The checks, one a line."""
        width = max((len(r.name) for r in self.rows), default=4)
        yield f"{'check':<{width}}  error [-]  allowed [-]"
        for r in self.rows:
            word = "ok" if r.ok else "FAILS"
            yield f"{r.name:<{width}}  {r.value:9.2e}  {r.allowed:9.2e}  {word}"
        yield (
            f"{self.samples} samples; errors are relative to the sum of absolute terms "
            f"times the conditioning (at most {self.conditioning:.3g})"
        )


@np.errstate(all="ignore")  # a check that is not finite fails
@declared
def verify(
    mechanism: Compiled,
    at: Coordinates | Result | None = None,
    *,
    samples: int | None = None,
    times: Numbers | None = None,
    rates: Coordinates | None = None,
    accelerations: Coordinates | None = None,
    friction: FrictionMethod | None = None,
    static: bool = False,
    engine: EngineName = "auto",
    precision: Precision | None = None,
    chunk: int | None = None,
) -> Verification:
    """Check a mechanism against the equations of mechanics at some samples.

    Checked are the closure of every pair in position, velocity and acceleration, the requested
    drivers and assembly modes, the derivatives of laws of motion, the declared values of loads,
    the balance of every link and of the frame, Coulomb's law, the balance of power and energy, and
    the driving effort, which reactions and reduction must give alike.

    Parameters
    ----------
    at, samples, times, rates, accelerations : [rad or m], [s] as in a run; by default 25
        samples of the laws' ranges. Gaps are left out.
        Or a result of this mechanism. A run is checked at its samples, with its friction. In a
        simulation consecutive states must also agree, impacts obey momentum, restitution and loss,
        and free drivers have zero drive. Some designs of a study are computed again one by one;
        derivatives (`sensitivity`) are compared with differences of designs.
    friction, static, engine, precision, chunk : as in a run

    Returns
    -------
    Verification, with a number for each check

    Raises
    ------
    RequestError for a result of another mechanism, or for a result together with settings

    >>> mech.verify(at=0.5)
    <Verification: check                          error [-]  allowed [-] ...>
    """
    if isinstance(at, Result):
        settings_given = (samples, times, rates, accelerations, friction, precision)
        if static or any(x is not None for x in settings_given):
            message = "a result is verified at its own samples, with its own settings"
            raise refused("at", message, "leave the others out")
        return _of_result(mechanism, at, engine, chunk)
    if at is None and samples is None and times is None:
        samples = CHECKED
    engine_settings: Arguments = {
        "engine": engine,
        "precision": precision or "complex128",
        "chunk": chunk,
    }
    blocks = mechanism._of_blocks
    poses = blocks.samples(at, samples, times, rates, accelerations)
    poses = replace(poses, inputs={**poses.inputs, **_states(blocks, poses.n)})
    settings = {"friction": friction, "static": static}
    run = blocks._answer(poses, EVERYTHING, settings, **engine_settings)
    shaken = _perturbed_run(run, engine_settings)
    evidence = Evidence(shaken) if shaken.n > run.n else Evidence(run, shaken)
    return _worst_rows(mechanism, run.n, evidence)


def refuse_foreign(mechanism: Compiled, source: Compiled, answer: str) -> None:
    """Raises `RequestError` for an answer of a mechanism that differs from this one in value."""
    values = zip(*((m.structure, m.scene, m.names) for m in (mechanism, source)), strict=True)
    if source is not mechanism and any(a != b for a, b in values):
        raise refused("at", f"{answer} of another mechanism, {source.name}")


def _of_result(
    mechanism: Compiled, result: Result, engine: EngineName, chunk: int | None
) -> Verification:
    """A result's own samples, and what a simulation says of itself."""
    refuse_foreign(mechanism, result.mechanism, "the result is")
    if isinstance(result, ChartedResult):
        legs = (_of_result(x.mechanism, x.result, engine, chunk) for x in result.parts)
        return _worst_legs([*legs])
    motion = result.motion
    blocks = mechanism._of_blocks
    settings = {"friction": result.settings["friction"]}
    if motion is None:
        settings["static"] = result.settings["static"]
        run = blocks._answer(result.samples, EVERYTHING, settings, engine, None, chunk)
        return _worst_rows(mechanism, run.n, Evidence(run))
    t = motion.times(1) if result.time is None else result.time
    run = result_along(blocks, motion, t, EVERYTHING, **settings, engine=engine, chunk=chunk)
    judged = _worst_rows(mechanism, run.n, Evidence(run), idle)
    jumps = list(blows(mechanism, motion)) if motion.impacts else []
    checks = [
        Check(f"{x.equation} {_document_name(mechanism, x.of)}", float(_relative(x.error, x.scale)))
        for x in jumps
    ]
    checks += [Check(*row) for row in trajectory(result, motion)]
    return replace(judged, rows=(*judged.rows, *checks))


def _worst_legs(legs: Sequence[Verification]) -> Verification:
    """The worst of each check over legs of a motion, each in its own chart."""
    worst: dict[str, Check] = {}
    for row in (row for leg in legs for row in leg.rows):
        worst[row.name] = max(worst.get(row.name, row), row, key=lambda r: r.value / r.allowed)
    conditioning = max(leg.conditioning for leg in legs)
    return Verification(tuple(worst.values()), sum(leg.samples for leg in legs), conditioning)


def _worst_rows(mechanism: Compiled, n: int, evidence: Evidence, *further: CheckOf) -> Verification:
    """The worst of every check over all evidence, the first ``n`` samples of which were asked."""
    worst: dict[str, float] = {}
    good = evidence.good
    residuals = [row for check in (*CHECKS, *further) for row in check(evidence)]
    errors, scale = (np.array([row[k] for row in residuals])[..., good] for k in (2, 3))
    for (equation, of, *_), value in zip(residuals, _relative(errors, scale).tolist(), strict=True):
        name = f"{equation} {_document_name(mechanism, of)}"
        worst[name] = np.maximum(worst.get(name, 0.0), value)
    requested = good & (np.arange(len(good)) < n)
    conditions = [evidence.condition(block)[requested] for block in evidence.structure.blocks]
    rows = tuple(Check(name, float(value)) for name, value in worst.items())
    return Verification(rows, int(requested.sum()), float(np.max(conditions, initial=1.0)))


def _relative(error: Real, scale: Real) -> Real:
    """The largest residuals (m,) by their scales (m, n) each; NaN where there is one.

    Below the smallest normal number rounding is a share of that, not of the number.
    """
    nonzero = np.maximum(scale, np.finfo(np.float64).tiny)
    return np.max(np.where(error == 0, 0.0, np.abs(error) / nonzero), axis=-1, initial=0.0)


def _states(mechanism: Compiled, n: int) -> Data:
    """States of signal blocks at n samples, each a number of its own: any will do."""
    structure, at = mechanism.structure, np.arange(n)
    initial = structure.initial_states[: len(structure.states) - len(structure.remembering)]
    return {f"{STATE}{k}": x + np.cos(at + 2 * k) for k, x in enumerate(initial)}


def _perturbed_run(run: Result, engine_settings: Arguments) -> Result:
    """The same poses without friction, each with rates and accelerations of its own.

    Rates are between half of those asked for and those; none is zero. Accelerations are of the
    size of the rate times the largest rate of a link. Where nothing rubs, the run itself comes
    before, in the same arrays.
    """
    mechanism, at = run.mechanism, np.arange(run.n)
    inputs = {name: np.asarray(column, dtype=float) for name, column in run.samples.inputs.items()}
    links = [f"{link}.omega" for link in mechanism.structure.links][1:]
    fastest = float(np.nanmax(np.abs([run[name] for name in links]), initial=0.0)) or 1.0
    for k, _ in enumerate(mechanism.drivers):
        rate = inputs[f"qd_{k}"]
        speed = np.where(rate == 0, float(np.abs(rate).max()) or 1.0, rate)
        inputs[f"qd_{k}"] = speed * (3 + np.cos(at + k)) / 4
        inputs[f"qdd_{k}"] = inputs[f"qdd_{k}"] + np.abs(speed) * fastest * np.sin(2 * at + k + 1)
    plan = mechanism.plan("*", friction="none", static=run.settings["static"])
    samples = Samples(run.n, inputs, run.samples.time)
    if plan.program.source == run._plan.program.source:
        samples = _stacked(run.samples, samples)
    values, engine = mechanism._evaluate(plan, samples, **engine_settings)
    return Result(mechanism, plan, samples, values, engine, run.settings | {"friction": "none"})


def _stacked(first: Samples, second: Samples) -> Samples:
    """The samples of two runs, one behind the other."""
    n = first.n
    inputs = {
        name: np.concatenate([np.broadcast_to(column, n), np.broadcast_to(second.inputs[name], n)])
        for name, column in first.inputs.items()
    }
    return Samples(2 * n, inputs, None if first.time is None else np.tile(first.time, 2))


def _document_name(mechanism: Compiled, of: Part) -> str:
    """A part in the words of a document of links and joints, if there is one."""
    names = mechanism.names
    if names is None:
        return str(of)
    if isinstance(of, LinkRef):
        return next((name for name, link in names.links.items() if link.link == of), str(of))
    driver, dot, output = str(of).partition(".")
    if driver in mechanism.drivers:
        return mechanism._of_driver(driver, output) if dot else driver
    return mechanism._joint_names.get(str(of), mechanism._block_name(str(of)))
