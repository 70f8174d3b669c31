"""The result: labelled arrays with units and quality."""

from __future__ import annotations

from cmath import isfinite
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, Generic, Self

import numpy as np
from numpy.typing import NDArray

from blockmech.engines.numpy import Planar, Whole, batch_of, complex_array, real_part, samples_of
from blockmech.ground.arguments import declared
from blockmech.ground.errors import held, listed, refused
from blockmech.ground.report import places
from blockmech.ground.runnable import LazyMethod
from blockmech.model.structure import LinkRef
from blockmech.plan.plan import Output, Plan, Undefined
from blockmech.result.columns import unwrapped
from blockmech.result.data import Exported
from blockmech.result.motion import Motion
from blockmech.result.quality import Failures, Flag, Quality, assess, failures
from blockmech.result.remarks import missing_data, remainder_of_friction
from blockmech.result.samples import Samples
from blockmech.result.wires import on_wires
from blockmech.typing import (
    Arguments,
    Array,
    Data,
    FrictionMethod,
    M,
    Record,
    Values,
)

ADVANTAGE = "mechanism.mechanical_advantage"
BY_DRIVES = ADVANTAGE, "mechanism.efficiency", "mechanism.friction_efficiency"
FREE = Undefined("in a free motion the drives give nothing")  # their effort there is rounding


class Result(Exported, Generic[M]):
    """Outputs of a run by name.

    ``result["dyad.B.reaction"]`` is an array (n,): complex x + iy for vectors, whose parts are
    ``result["dyad.B.reaction.x"]`` and ``.y``, float else, (n, drivers, drivers) for matrices,
    a float for one number a run.
    Samples without an answer are NaN; ``result.quality`` says why.

    It can be pickled, for other processes or a cache of the same version of blockmech; to
    keep numbers for long, export them.

    >>> result = mech.run(at=["10deg", "20deg"], want=["crank.drive", "dyad.C.p"])
    >>> result["dyad.C.p"].shape
    (2,)
    >>> result.unit("crank.drive")
    'N m'
    >>> result.quality.status
    ('ok', 'ok')
    """

    _called = "a result"
    _several = (
        'in one picture they are drawn one by one: a.plot(ax=ax, label="a"), b.plot(ax=ax, ...)'
    )
    _instead = "its plot() draws its outputs; the mechanism is its .mechanism"
    _homes = {"mechanism.{}": "blockmech.mechanism.Mechanism"}

    plot = LazyMethod("blockmech.figures.curves.plot")
    stroke = LazyMethod("blockmech.analysis.stroke.stroke")
    _digits_lost = LazyMethod("blockmech.analysis.reference_errors.digits_lost")
    _motion_svg = LazyMethod("blockmech.draw.simulation.motion_svg")

    mechanism: M  # a `Compiled`, which makes results
    _planned: tuple[tuple[str, ...], Mapping[str, tuple[int, ...]]]  # of an unpickled one

    def __init__(
        self,
        mechanism: M,
        plan: Plan,
        samples: Samples,
        values: Values,
        engine: str,
        settings: Arguments,
        motion: Motion | None = None,
    ) -> None:
        self.mechanism = mechanism
        self._plan = plan
        self.samples = samples
        self._engine = engine
        self.settings = dict(settings)
        self.motion = motion
        self.accuracy = None
        self._values = values
        self._read: Data = {}

    # -- pickling ---------------------------------------------------------------

    def __getstate__(self) -> Data:
        """The numbers and where they stand; the program and what was read are made again."""
        again = {"_plan", "quality", "_read"}
        return {
            **{name: x for name, x in vars(self).items() if name not in again},
            "_planned": (self._plan.want, self._plan.layout),
        }

    def __setstate__(self, state: Data) -> None:
        vars(self).update(state, _read={})

    @cached_property
    def _plan(self) -> Plan:
        """The plan of the computed outputs; an unpickled result is planned again at first use.

        Raises `RequestError` where another version of blockmech plans otherwise.

        >>> result._plan.calls
        12
        """
        want, layout = self._planned
        again: Plan = self._compiled.plan(want, **self.settings)
        if again.layout != layout:
            message = "it was pickled by a version of blockmech that orders its numbers otherwise"
            remedy = "run it again; to keep numbers, export them: to_csv, to_dict, bm.write"
            raise refused(self.mechanism.name, message, remedy, code="other-version")
        return again

    # -- reading ----------------------------------------------------------------

    def __getitem__(self, name: str) -> Any:
        if not isinstance(name, str) or name not in self._read:
            values = self._make(name)  # refuses what is no name
            self._read[name] = values
        return self._read[name]

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and name in self._plan.layout and name in self._plan.want

    def __iter__(self) -> Iterator[str]:
        return iter(self._plan.want)

    def __len__(self) -> int:
        return len(self._plan.want)

    @property
    def _compiled(self) -> Any:
        """The mechanism as what it is, a `Compiled`, which stands above results: it makes them."""
        return self.mechanism

    @property
    def n(self) -> int:
        """Number of samples.

        >>> result.n
        2
        """
        return self.samples.n

    @property
    def time(self) -> NDArray[np.float64] | None:
        """Times (n,) [s] of the samples, if the request defines them.

        >>> result.time
        array([0.05, 0.1 ])
        """
        return self.samples.time

    @property
    def drivers(self) -> dict[str, NDArray[np.float64]]:
        """Driver coordinates: ``"crank.q"`` -> (n,) [rad or m].

        >>> result.drivers["crank.q"]
        array([0.5, 1. ])
        """
        names = self.mechanism.drivers
        name = self._compiled._of_driver
        return {name(d, "q"): self.samples.coordinate(i) for i, d in enumerate(names)}

    def _place(self, sample: int, display: Iterable[str] = ()) -> str:
        """Where the drivers stand at a sample, in words: ``crank.q = 0.5 rad``."""
        at = {name: float(q[sample]) for name, q in self.drivers.items()}
        return places(at, {name: self._unit_of_driver(name) for name in at}, display)

    def _output(self, name: str) -> Output:
        """Declaration of an output: unit, kind, and who acts on whom.

        >>> reaction = result._output("dyad.B.reaction")
        >>> reaction.unit, reaction.by, reaction.on
        ('N', 'crank.crank', 'dyad.i')
        """
        declared_output: Output = held(
            self._compiled.outputs, name, "no output has that name", "outputs"
        )
        return declared_output

    def unit(self, name: str) -> str:
        """Unit of an output; empty where dimensionless.

        >>> result.unit("dyad.C.v")
        'm/s'
        """
        return self._output(name).unit

    @np.errstate(all="ignore")  # what is not finite is reported by the quality
    def _make(self, name: str) -> Any:
        source = name if name in self else str(name).rpartition(".")[0]  # of a vector's x or y
        if source != name and name in tuple(self.drivers):
            return self.drivers[name]
        if source not in self or name not in self._compiled.outputs:
            known = dict.fromkeys(self._plan.want)
            held(known, name, "the run did not compute it", "computed", "name it in want=")
        output = self._output(name)
        columns = [self._column(i) for i in self._plan.layout[source]]
        if self.motion is not None and name in BY_DRIVES:
            return FREE if output.kind == "number" else np.full(self.n, np.nan)
        if output.kind == "number":
            return output.read(*columns, self.samples.weights(len(self.mechanism.drivers)))
        if output.kind == "matrix":
            m = len(self.mechanism.drivers)
            table = np.stack(columns, axis=-1)
            table = table.reshape(self.n, m, m) if len(columns) == m * m else table
            return output.read(table)
        values = output.read(*columns)
        if output.kind == "vector":
            return complex_array(values)
        values = np.array(values)  # its own: the columns of a run share one block of memory
        if not np.isfinite(values).all():
            values[~np.isfinite(values)] = np.nan
        return values

    def unwrapped(self, name: str) -> NDArray[np.float64]:
        """An angle (n,) [rad] without jumps of 2 pi between consecutive samples.

        Samples without an answer stay NaN, and count no turn.

        Raises `RequestError` for an output that was not computed.

        >>> mech.run(samples=5).unwrapped("crank.crank.angle").round(3)
        array([0.   , 1.571, 3.142, 4.712, 6.283])
        """
        return unwrapped(self[name])

    def _column(self, index: int) -> Any:
        """One value of the program as a batch, whatever engine made it."""
        return batch_of(self._values[index])

    # -- quality ----------------------------------------------------------------

    @cached_property
    def quality(self) -> Quality:
        """Status of each sample, margins, friction reports and flags.

        >>> result.quality.status
        ('ok', 'ok')
        """
        quality = assess(self.n, self._reports, self._failures, self._compiled.structure)
        flags, joints = quality.flags, self._compiled._joint_names
        if joints:
            flags = tuple(replace(f, where=joints.get(f.where, f.where)) for f in flags)
        return replace(quality, flags=flags + self._without_effort(quality))

    @cached_property
    def _reports(self) -> dict[str, dict[Any, tuple[Array, ...]]]:
        """What the plan reports, by kind and by what it is about."""
        return {
            kind: {
                where: tuple(np.atleast_1d(real_part(self._column(i))) for i in indices)
                for where, indices in of.items()
            }
            for kind, of in self._plan.reports.items()
        }

    @cached_property
    def _failures(self) -> Failures:
        """Samples without an answer; much cheaper than the flags of `quality`."""
        margin = {block: m for block, (m,) in self._reports["margin"].items()}
        outcomes = {block: friction[3] for block, friction in self._reports["friction"].items()}
        return failures(margin, outcomes, self._not_finite(), self._compiled.structure)

    def _without_effort(self, quality: Quality) -> tuple[Flag, ...]:
        """Answered samples at which the drive rests, so that no mechanical advantage exists."""
        if ADVANTAGE not in self._plan.want:
            return ()
        gaps = np.flatnonzero(~np.isfinite(np.atleast_1d(self[ADVANTAGE])))
        resting = (i for i in gaps.tolist() if i not in quality.blame)
        return tuple(Flag(i, "infinite", ADVANTAGE) for i in resting)

    def _not_finite(self) -> NDArray[np.bool_]:
        """(n,) whether a wanted value is not finite."""
        bad = np.zeros(self.n, dtype=bool)
        if isinstance(self._values, Whole):
            return bad
        judged = [
            name
            for name in self._plan.want
            if self._output(name).kind != "number" and name != ADVANTAGE
        ]
        for i in {i for name in judged for i in self._plan.layout[name]}:
            column = self._column(i)
            for part in (column.real, column.imag) if isinstance(column, Planar) else (column,):
                with np.errstate(all="ignore"):
                    finite = bool(np.isfinite(part.sum()))  # quicker than each by itself
                if not finite:
                    bad |= ~np.isfinite(part)
        return bad

    def _surely_whole(self) -> bool:
        """A cheap sufficient test that every sample has an answer, so that it needs no report."""
        values, (margins, outcomes) = self._values, self._plan.verdicts
        if isinstance(values, Whole):
            closed = all(values[i].min(initial=np.inf) > 0 for i in margins)
            return closed and not any(values[i].any() for i in outcomes)
        if self.n > 1 or self._engine == "numpy":
            return False
        try:
            if not isfinite(sum(values)):
                return False
            return all(values[i] > 0 for i in margins) and not any(values[i] for i in outcomes)
        except TypeError:  # the guarded program's answer to a division by zero
            return False

    def _unit_of_driver(self, name: str) -> str:
        """Unit of a driver coordinate ``"crank.q"``."""
        return self._output(name).unit

    @declared
    def isel(self, index: int | slice | NDArray[np.intp]) -> Self:
        """The samples of these indices, as xarray has it: ``isel(slice(0, 10))`` the first ten.

        >>> result.isel(-1)["crank.q"]
        array([1.])
        """
        index = np.atleast_1d(np.arange(self.n)[index])
        values = tuple(samples_of(self._column(i), index) for i in range(len(self._values)))
        samples = self.samples.at(index)
        cut = type(self)(
            self.mechanism, self._plan, samples, values, self._engine, self.settings, self.motion
        )
        cut.accuracy = self.accuracy
        return cut

    def notes(self) -> list[str]:
        """Remarks on the result: lost digits, links that turn without inertia.

        Of a motion its own notes, too, and where it failed.

        >>> result.notes()
        []
        """
        motion = [] if self.motion is None else [*self.motion.notes]
        if self.motion is not None and self.motion.status == "failed":
            motion.insert(
                0, f"the motion failed after {self.motion.t_end:.6g} s: {self.motion.end}"
            )
        lost = [f"{flag.where} (error {flag.value:.1g})" for flag in self._lost_digits]
        why = "; numbers of very different size cancel: are all in the same unit?"
        notes = [f"digits lost to rounding: {listed(lost, 4)}{why}"] if lost else []
        if (bounds := self.friction_error) is not None:
            method, status = self.settings["friction"], self.quality.status
            notes.append(remainder_of_friction(method, bounds, status))
        return motion + notes + missing_data(self, self._first_rates)

    def _first_rates(self, links: Sequence[LinkRef]) -> list[float]:
        """Rates [rad/s] of some links at the first sample."""
        first = self.isel(0)._inside(*(f"{link}.omega" for link in links))
        return [float(first[f"{link}.omega"][0]) for link in links]

    @property
    def friction_error(self) -> NDArray[np.float64] | None:
        """Bound (n,) [-] of the deviation from the friction laws, relative to the largest friction.

        For the truncated iterations ``single`` and ``successive``; None for other methods. Infinite
        where the certificate of a group is 1 or more.

        >>> run = mech.run(at=0.5, want="crank.drive", friction="successive")
        >>> bool(run.friction_error.max() < 1e-6)
        True
        """
        if self.motion is not None and "friction_misfit" in self.motion.facts:
            return np.full(self.n, self.motion.facts["friction_misfit"])
        errors = self.quality.friction_error
        if self.settings["friction"] in ("none", "newton") or not errors:
            return None
        worst: NDArray[np.float64] = np.max(
            [np.broadcast_to(x, self.n) for x in errors.values()], axis=0
        )
        return worst

    @cached_property
    def _lost_digits(self) -> tuple[Flag, ...]:
        """A flag for each output that has lost more than half of its digits to rounding.

        Evaluated at first use, by repeating a few samples in extended precision.

        >>> result._lost_digits
        ()
        """
        return tuple(self._digits_lost())

    @cached_property
    def _judged(self) -> Quality:
        """The quality with all flags, those of digits lost among them."""
        return replace(self.quality, flags=self.quality.flags + self._lost_digits)

    # -- more of the same run -----------------------------------------------------

    @declared
    def rerun(self, *want: str, friction: FrictionMethod | None = None) -> Result:
        """Other outputs, or the same, at the same samples with the same settings; gaps are marked.

        ``friction`` is another method of friction than that of the run.

        >>> result.rerun("crank.drive", friction="none")["crank.drive"].round(3)
        array([8851.139, 3745.809])
        """
        settings = self.settings if friction is None else self.settings | {"friction": friction}
        return self._again(self.mechanism, want or tuple(self), settings)

    def _between(self, positions: NDArray[np.float64]) -> Self:
        """The same outputs at positions (m,) among the samples, counted from 0."""
        moved = self.to(*self._display)
        moved.samples = self.samples.between(positions)
        return moved._again(self.mechanism, tuple(self))

    def _inside(self, *want: str) -> Result:
        """Outputs of the graph's blocks at the same samples; gaps are marked.

        For a mechanism made from a graph, these are its own outputs.
        """
        return self._again(self._compiled._of_blocks, want)

    def _again(
        self, mechanism: Any, want: tuple[str, ...], settings: Arguments | None = None
    ) -> Self:
        settings = self.settings if settings is None else settings
        plan = mechanism.plan(want, **settings)
        values, engine = mechanism._evaluate(plan, self.samples, self._engine)
        again = type(self)(mechanism, plan, self.samples, values, engine, settings, self.motion)
        return again.to(*self._display)

    @declared
    def wire(self, source: str, target: str | None = None) -> Data:
        """Quantities on a wire: motion forwards, force and reduced inertia backwards.

        ``wire("crank.B", "dyad.B")`` or ``wire("crank.B -> dyad.B")``; see `result.wires`.

        >>> sorted(result.wire("crank.B", "dyad.B"))
        ['F', 'J_red', 'M', 'a', 'al', 'om', 'p', 'power', 'tau_red', 'v']
        """
        name = source if target is None else f"{source} -> {target}"
        return on_wires(self._compiled.structure, self._inside, self.n, name)[name]

    @declared
    def compare(self, reference: Record) -> dict[str, float]:
        """Largest difference of each common output, relative to its largest magnitude.

        Infinite where only one of the two has an answer. Raises `RequestError` where the
        runs have different numbers of samples.

        >>> other = mech.run(at=[0.5, 1.0], want="crank.drive", friction="none")
        >>> round(other.compare(result)["crank.drive"], 5)
        0.01011
        """
        differences = {}
        for name in self:
            if name in reference:
                mine, theirs = np.atleast_1d(self[name]), np.atleast_1d(reference[name])
                if mine.shape != theirs.shape:
                    message = f"has shape {mine.shape} here and {theirs.shape} there"
                    raise refused(name, message, "compare runs of the same samples")
                scale = float(np.nanmax(np.abs(mine), initial=0.0)) or 1.0
                off = float(np.nanmax(np.abs(mine - theirs), initial=0.0)) / scale
                differ = (np.isnan(mine) != np.isnan(theirs)).any()
                differences[name] = float("inf") if differ else off
        return differences

    def _repr_html_(self) -> str:
        return super()._repr_html_() + str(self._motion_svg())

    def __repr__(self) -> str:
        gaps = len(self.quality.gaps)
        holes = f", {gaps} without an answer" if gaps else ""
        return (
            f"<Result of {self.mechanism.name}: {self.n} samples{holes}, {len(self)} outputs, "
            f"{self._plan.calls} kernel calls a sample, {self._engine} engine>"
        )
