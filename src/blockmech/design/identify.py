r"""Identification: numbers of a mechanism from what was measured on it.

Measured are coordinates of the drivers (with rates and accelerations where they matter) and any
outputs: driving efforts, reactions, places, angles; of a free motion, that the driving effort is
zero. The numbers p minimise

    sum over columns and samples of ((measured - output(p)) / noise of the column)^2

by SciPy's `least_squares` on exact derivatives, joint friction included. The noise of a column
is estimated from its own residual. A long record is fitted by a part of its samples first; then
Gauss-Newton steps on all of it follow until they are below the numbers' own scatter.

Columns of the Jacobian that depend on each other are numbers that the data cannot tell apart.
By QR with pivoting the rest are taken as base numbers, each with the share of those that depend
on it: what the data tell is the sum, and the sum is what is given. A number that nothing
depends on, or that scatters by more than its own size, is named and never given a value.

Deviations are the robust ones (HC3), which hold also where the noise follows the size of what is
measured.

Sources: Gautier, Numerical calculation of the base inertial parameters of robots, J. Robotic
Systems 8 (1991); MacKinnon & White, J. Econometrics 29 (1985): HC3.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from blockmech.analysis.deflections import refuse_deflections
from blockmech.analysis.extremes import PART_OF, number_of
from blockmech.compiled import Compiled
from blockmech.design.measurements import Record, record_of
from blockmech.engines.derivatives import DualEngine, slope, value
from blockmech.figures import palette as ink
from blockmech.figures.panels import label_coordinate
from blockmech.figures.paper import Pictured, panelled, picture_unit, shown_name
from blockmech.functions.roots import NEWTON_STEPS
from blockmech.ground.arguments import declared
from blockmech.ground.errors import BlockmechError, as_names, held, listed, refused
from blockmech.ground.plane import EPS
from blockmech.ground.report import Facts
from blockmech.ground.tolerances import ROUNDING
from blockmech.model.joints.varied import Varied
from blockmech.model.parameters import Parameter
from blockmech.plan.plan import Plan
from blockmech.result.tables import aligned
from blockmech.studies.differentiate import chosen_numbers, program_numbers
from blockmech.studies.family import remade
from blockmech.studies.objective import INFEASIBLE
from blockmech.studies.sensitivity import size_of
from blockmech.studies.variation import Variation, is_written_out, of_links
from blockmech.typing import Arguments, Array, Data, Floats, FrictionMethod

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PART = 512  # samples of a long record that are fitted first
ENOUGH = 1e-2  # of a number's standard deviation: a step that changes nothing any more
SAME = math.sqrt(EPS)  # relative: what rounding leaves of columns that depend on each other
START = 1e-3  # of the largest value of a column: the least that it is first weighed by
PATTERN = 5.0  # standard deviations of how often neighbours agree: a residual is no noise
PANEL = 9.0 * ink.TEXT  # [pt] height of a panel of a picture


class Combination(NamedTuple):
    """What the data tell of numbers that they cannot tell apart.

    weights : address -> factor; the first one's is 1
    value : of the sum, in the unit of the first number
    deviation : its standard deviation
    """

    weights: Mapping[str, float]
    value: float
    deviation: float

    def __str__(self) -> str:
        terms = []
        for a, w in self.weights.items():
            size = f"{abs(w):.6g}"
            terms.append(f"{'-' if w < 0 else '+'} {a if size == '1' else f'{size} {a}'}")
        return " ".join(terms).removeprefix("+ ")


@dataclass(frozen=True, repr=False)
class Identification(Facts, Pictured):
    """Identified parameters.

    Attributes
    ----------
    mechanism : the mechanism with the identified parameters
    values : address -> value, for parameters that the data determine
    deviations : address -> standard deviation
    combinations : identified combinations of parameters that the data cannot separate
    unseen : parameters on which no column depends, or whose deviation exceeds their value
    noise : column -> standard deviation of its residual
    residuals : column -> measured less computed (n,)
    coordinate : (n,) of the first driver, over which residuals are drawn
    units : column or address -> unit
    doubts : columns whose residual has a pattern, so that the model lacks an effect
    notes : remarks for the reader
    """

    FACTS = ("values", "deviations", "unseen", "noise", "units", "doubts", "combinations")

    mechanism: Compiled
    values: Mapping[str, float]
    deviations: Mapping[str, float]
    combinations: tuple[Combination, ...]
    unseen: tuple[str, ...]
    noise: Mapping[str, float]
    residuals: Mapping[str, Floats]
    coordinate: Floats
    units: Mapping[str, str]
    doubts: tuple[str, ...]
    notes: tuple[str, ...] = ()

    def __getitem__(self, address: str) -> float:
        message = ("it was not asked for", "the data do not tell it")[address in self.not_apart]
        return held(self.values, address, message, "identified")

    @property
    def not_apart(self) -> frozenset[str]:
        """Parameters that the data cannot separate."""
        return frozenset([*self.unseen, *(a for c in self.combinations for a in c.weights)])

    def figure(self, ax: Axes | None = None) -> Any:
        """Residual of each column over the first driver's coordinate, with its scatter."""
        names, driver = [*self.residuals][: ink.PANELS], self.mechanism.drivers[0]
        scale, unit_of_x = picture_unit(self.mechanism._coordinate_units[driver], self._display)
        caption = f"{shown_name(self.mechanism.name, 40)}: measured less computed; shaded: "
        caption += f"{ink.BAND:g} standard deviations. "
        caption += (
            f"Red: a pattern that is no noise, so the model misses something at "
            f"{', '.join(dict.fromkeys(n.partition('.')[0] for n in self.doubts))}."
            if self.doubts
            else "What is left is noise."
        )
        with panelled(caption, len(names) * PANEL + 2 * ink.ROW, len(names), ax=ax) as panels:
            for (axes,), name in zip(panels, names, strict=True):
                r = self.residuals[name]
                factor, unit = picture_unit(self.units[name], self._display, float(np.abs(r).max()))
                band = ink.BAND * factor * self.noise[name]
                colour = ink.ALARM if name in self.doubts else ink.FORWARD
                dots = {"s": ink.DOT, "lw": 0, "color": colour, "rasterized": True}
                axes.axhspan(-band, band, color=ink.LINK_FILLS[0], lw=0)
                axes.scatter(scale * self.coordinate, factor * r, **dots)
                axes.set_ylabel(f"{shown_name(name)}\n[{unit or '–'}]", labelpad=2)
            label_coordinate(axes, f"{self.mechanism._of_driver(driver, 'q')} [{unit_of_x}]")
        return axes.figure

    def lines(self) -> Iterator[str]:
        """The parameters with their deviations, then those that the data do not determine."""
        rows = [
            (a, f"{x:.7g} {self.units[a]}".rstrip(), f"± {self.deviations[a]:.2g}")
            for a, x in self.values.items()
        ]
        if rows:
            yield from aligned(("number", "value", "standard deviation"), rows)
        for c in self.combinations:
            yield f"only together: {c} = {c.value:.7g} ± {c.deviation:.2g}"
        if self.unseen:
            yield f"not seen in the data: {listed(self.unseen)}"
        for name, sigma in self.noise.items():
            yield f"residual of {name}: {sigma:.4g} {self.units[name]}".rstrip()
        for name in self.doubts:
            yield f"{name} leaves a pattern, not noise: the model misses something there"
        yield from self.notes


# -- fitting -------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Fit:
    """Outputs and their derivatives by some numbers, at the samples of a record."""

    mechanism: Compiled
    chosen: Mapping[str, Parameter]
    record: Record
    settings: Arguments

    @cached_property
    def _variation_and_plan(self) -> tuple[Variation, Plan]:
        """The mechanism as these numbers vary, and its plan."""
        variation = Variation.of(self.mechanism, self.chosen.values())
        outputs = (number_of(self.mechanism, n)[0] for n in self.record.columns)
        return variation, variation.general.plan(tuple(dict.fromkeys(outputs)), **self.settings)

    def _variation_at(self, x: Floats) -> tuple[Variation, Plan, dict[str, Parameter]]:
        """The same about other numbers, whatever the file says of them by themselves.

        Of links and joints it is the document that is decomposed again.
        """
        numbers = dict(zip(self.chosen, x.tolist(), strict=True))
        chosen = {a: p._replace(value=numbers[a]) for a, p in self.chosen.items()}
        if of_links(self.mechanism) or is_written_out(self.mechanism):
            fit = replace(self, mechanism=remade(self.mechanism, numbers), chosen=chosen)
            return *fit._variation_and_plan, chosen
        variation, plan = self._variation_and_plan
        seeds = zip(chosen.values(), np.eye(len(chosen)), strict=True)
        return (
            replace(variation, numbers={p.path: Varied(p.value, e) for p, e in seeds}),
            plan,
            chosen,
        )

    def at(self, x: Floats, rows: slice | Array = slice(None)) -> tuple[Floats, Array]:
        """Residuals (c, n) and derivatives (c, n, k) of the outputs at numbers (k,).

        Raises `BlockmechError` for a design that does not assemble.
        """
        variation, plan, chosen = self._variation_at(x)
        parts = [number_of(self.mechanism, n) for n in self.record.columns]
        sizes = np.array([size_of(p, chosen.values()) for p in chosen.values()])
        seeds = np.diag(sizes)
        samples = self.record.samples
        samples = samples if isinstance(rows, slice) else samples.at(rows)
        refuse_deflections(self.mechanism, plan, "derivatives")
        inputs = {k: np.asarray(v) for k, v in samples.given(plan.program.inputs).items()}
        shape = len(chosen), samples.n
        values = DualEngine(plan.program).run(
            inputs, program_numbers(plan, variation, seeds), *shape[::-1]
        )
        outputs, residuals, slopes = variation.outputs(seeds), [], []
        with np.errstate(all="ignore"):
            for (output, part), measured in zip(parts, self.record.columns.values(), strict=True):
                output_value = outputs[output].read(*(values[i] for i in plan.layout[output]))
                y = PART_OF[part](output_value)
                computed = np.broadcast_to(value(y), shape[1:])
                residuals.append(outputs[output].difference(measured[rows], computed))
                slopes.append((np.broadcast_to(slope(y), shape) / sizes[:, None]).T)
        return np.array(residuals), np.array(slopes)


def _solved(
    fit: _Fit, free: list[int], start: Floats, sizes: Floats, rows: Array, largest: Floats
) -> Floats:
    """Numbers that fit some rows best, those not free kept where they are."""
    from scipy.optimize import least_squares

    scatter = np.std([*fit.record.columns.values()], axis=1)
    weight = 1.0 / np.maximum(scatter, START * largest)
    last: Data = {}

    def evaluated(u: Floats) -> tuple[Floats, Array]:
        if last.get("u") != u.tobytes():
            x = start.copy()
            x[free] = u * sizes[free]
            try:
                r, d = fit.at(x, rows)
            except BlockmechError:
                r = np.full((len(weight), len(rows)), INFEASIBLE / weight[:, None])
                d = np.zeros((*r.shape, len(start)))
            last.update(u=u.tobytes(), r=r, d=d)
        return last["r"], last["d"]

    def residual(u: Floats) -> Floats:
        r = np.nan_to_num(
            evaluated(u)[0] * weight[:, None], nan=INFEASIBLE, posinf=INFEASIBLE, neginf=-INFEASIBLE
        )
        return np.asarray(r).ravel()

    def jacobian(u: Floats) -> Floats:
        d = evaluated(u)[1] * weight[:, None, None]
        return np.asarray(-np.nan_to_num(d[..., free] * sizes[free]).reshape(-1, len(free)))

    x = start.copy()
    for _ in range(2):  # by the size of the columns first, then by their noise
        optimum = least_squares(
            residual, x[free] / sizes[free], jacobian, method="lm", xtol=1e-10, ftol=1e-10
        )
        x[free] = optimum.x * sizes[free]
        noise = np.sqrt(np.mean(evaluated(optimum.x)[0] ** 2, axis=1))
        weight = 1.0 / np.maximum(noise, ROUNDING * largest)
    return x


def _covariance(r: Floats, J: Floats) -> Floats:
    """HC3 covariance of numbers from weighted residuals (n,) and their Jacobian (n, k)."""
    bread = np.linalg.inv(J.T @ J)
    leverage = np.minimum(np.einsum("ij,jk,ik->i", J, bread, J), 1 - 1e-6)
    meat = J * (r / (1 - leverage))[:, None]
    return np.asarray(bread @ (meat.T @ meat) @ bread)


def dependent(J: Floats) -> tuple[list[int], list[int], Floats]:
    """Base columns of a matrix (n, k), those that depend on them, and how (base, dependent).

    By QR with pivoting: J[:, dependent] = J[:, base] @ how.
    """
    from scipy.linalg import qr, solve_triangular

    if not J.shape[1]:
        return [], [], np.zeros((0, 0))
    _, R, order = qr(J, mode="economic", pivoting=True)
    size = np.abs(np.diag(R))
    rank = int((size > SAME * size.max(initial=0.0)).sum()) if size.size else 0
    factors = (
        solve_triangular(R[:rank, :rank], R[:rank, rank:]) if rank else np.zeros((0, J.shape[1]))
    )
    factors = np.where(np.abs(factors) > math.sqrt(SAME), factors, 0.0)
    return order[:rank].tolist(), order[rank:].tolist(), factors


@declared
def identify(
    mechanism: Compiled,
    numbers: Iterable[str] | str,
    data: Any,
    *,
    friction: FrictionMethod | None = None,
    static: bool = False,
) -> Identification:
    """Parameters of a mechanism from measured coordinates, forces, reactions or positions.

    Parameters
    ----------
    numbers : addresses of the unknown parameters (`Mechanism.parameters`); the search starts from
        the mechanism's values
    data : a CSV file, a DataFrame, or a mapping column -> (n,)
        Columns have the names of outputs: ``crank.q`` of every driver, and ``crank.rate``,
        ``crank.acceleration`` where they differ from the law's; the others are measurements,
        e.g. ``crank.drive``, ``dyad.C.p.x``, ``dyad.D.reaction.y``. Heads may have a unit,
        ``crank.q [deg]``. In a free motion ``crank.drive`` is zero.
    friction, static : as those of a run

    Returns
    -------
    Identification, with standard deviations; a parameter that the data do not determine is listed
    without a value

    Raises
    ------
    RequestError for unknown parameters or columns, invalid data, or fewer rows than parameters

    >>> run = mech.run(at=np.linspace(0.0, 6.0, 50), want="crank.drive")
    >>> fit = bm.design.identify(mech, "dyad.links.j.mass", run.to_dataframe())
    >>> {number: round(value, 6) for number, value in fit.values.items()}
    {'dyad.links.j.mass': 7.2}
    """
    chosen = chosen_numbers(mechanism, as_names("numbers", numbers))
    record = record_of(mechanism, data)
    if record.samples.n * len(record.columns) <= len(chosen):
        message = f"{record.samples.n} rows for {len(chosen)} numbers"
        raise refused("data", message, "measure more, or identify less")
    settings = {"friction": friction, "static": static or record.samples.at_rest}
    fit = _Fit(mechanism, chosen, record, settings)
    start = np.array([float(p.value) for p in chosen.values()])
    sizes = np.array([size_of(p, chosen.values()) for p in chosen.values()])
    names, k = [*chosen], len(chosen)
    n = record.samples.n
    rows = np.unique(np.linspace(0, n - 1, min(n, PART)).astype(int))
    _, d = fit.at(start, rows)
    scale = np.abs([*record.columns.values()]).max(axis=1)
    scale = np.where(scale > 0, scale, 1.0)
    J = (d * sizes / scale[:, None, None]).reshape(-1, k)
    visible = [i for i in range(k) if np.abs(J[:, i]).max() > SAME * np.abs(J).max(initial=0.0)]
    columns, dependents, factors = dependent(J[:, visible])
    base, rest = [visible[i] for i in columns], [visible[i] for i in dependents]
    x = _solved(fit, base, start, sizes, rows, scale) if base else start
    cov = np.empty((0, 0))
    for _ in range(NEWTON_STEPS):
        r, d = fit.at(x)
        noise = np.maximum(np.sqrt(np.mean(r**2, axis=1)), ROUNDING * scale)
        if not base:
            break
        weighted = (r / noise[:, None]).ravel()
        J = (d[..., base] * sizes[base] / noise[:, None, None]).reshape(-1, len(base))
        cov = _covariance(weighted, J)
        step = np.linalg.lstsq(J, weighted, rcond=None)[0]
        if n <= PART or np.abs(step / np.sqrt(np.diag(cov))).max() <= ENOUGH:
            break
        x[base] += step * sizes[base]
    return _identification(fit, names, x, (base, rest, factors, visible), sizes, cov, r, noise)


def _identification(
    fit: _Fit,
    names: list[str],
    x: Floats,
    parts: tuple[list[int], list[int], Floats, list[int]],
    sizes: Floats,
    cov: Floats,
    r: Floats,
    noise: Floats,
) -> Identification:
    base, rest, factors, visible = parts
    values: dict[str, float] = {}
    deviations: dict[str, float] = {}
    together: list[Combination] = []
    unseen = [names[i] for i in range(len(names)) if i not in visible]
    for row, i in enumerate(base):
        deviation = math.sqrt(cov[row, row]) * sizes[i]
        if deviation > max(sizes[i], abs(x[i])):
            unseen.append(names[i])
            continue
        weights = {names[i]: 1.0}
        weights |= {
            names[j]: w * sizes[i] / sizes[j] for j, w in zip(rest, factors[row], strict=True) if w
        }
        if len(weights) == 1:
            values[names[i]], deviations[names[i]] = float(x[i]), float(deviation)
        else:
            total = sum(w * x[names.index(a)] for a, w in weights.items())
            together.append(Combination(weights, float(total), float(deviation)))
    lone = [names[j] for n, j in enumerate(rest) if not factors[:, n].any()]
    units_of_numbers = {a: p.unit for a, p in fit.chosen.items()}
    columns = [*fit.record.columns]
    outputs = fit.mechanism.outputs
    units = units_of_numbers | {c: outputs[number_of(fit.mechanism, c)[0]].unit for c in columns}
    order = np.argsort(fit.record.coordinate, kind="stable")
    doubts = [c for c, row in zip(columns, r, strict=True) if _is_pattern(row[order])]
    ordered = dict(sorted(values.items(), key=lambda kv: names.index(kv[0])))
    notes = []
    try:
        identified = remade(fit.mechanism, values) if values else fit.mechanism
    except BlockmechError as error:
        identified = fit.mechanism
        notes = [f"no mechanism has these numbers: {error.problems[0].found}"]
    return Identification(
        identified, ordered, deviations, tuple(together), tuple(dict.fromkeys([*unseen, *lone])),
        dict(zip(columns, noise.tolist(), strict=True)), dict(zip(columns, r, strict=True)),
        fit.record.coordinate, units, tuple(doubts), tuple(notes),
    )  # fmt: skip


def _is_pattern(r: Floats) -> bool:
    """Whether neighbours of a residual (n,) have the same sign more often than noise has.

    Signs, as noise that follows the size of what is measured is no pattern.
    """
    if len(r) <= 8:
        return False
    signs = np.sign(r)
    return bool(np.mean(signs[1:] * signs[:-1]) > PATTERN / math.sqrt(len(r)))
