"""Enclosures: bounds of outputs that hold for every part within its tolerance, proved.

Monte Carlo says what most parts do, an enclosure what none exceeds: rounding is in it, so with no
tolerance at all it is a certificate of a run. Where no proof is found the answer says why.

Source: `blockmech.engines.enclosed.forms`, `blockmech.engines.enclosed.proofs`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from blockmech.compiled import CONTRACTION, Compiled
from blockmech.engines.enclosed.engine import EnclosedEngine
from blockmech.engines.enclosed.forms import SYMBOLS, Form, form, within
from blockmech.ground.arguments import declared
from blockmech.ground.errors import (
    Problem,
    RequestError,
    as_names,
    listed,
    path_text,
    refused,
)
from blockmech.ground.report import Facts, Report, sections
from blockmech.ground.runnable import EVERYTHING
from blockmech.model.joints.varied import Varied
from blockmech.model.parameters import Parameter, Path, parameters_of
from blockmech.plan.plan import Plan
from blockmech.result.result import Result
from blockmech.result.tables import aligned
from blockmech.studies.differentiate import chosen_numbers
from blockmech.studies.family import in_si_by_address, remade
from blockmech.studies.variation import (
    designed,
    followers,
    graph_sections,
    is_written_out,
    of_links,
    planned_near,
)
from blockmech.typing import (
    Arguments,
    Array,
    Complex,
    Coordinates,
    FrictionMethod,
    Numbers,
    Quantity,
    Values,
)

PROVED = "proved"


@dataclass(frozen=True, repr=False)
class Enclosure(Facts, Report, Mapping[str, Array]):
    """Outputs with proved bounds: ``e["crank.drive"]`` is (n,), half of each width.

    Attributes
    ----------
    result : run of the planned design
    tolerances : address -> largest deviation of the number
    low, high : output -> bounds (n,), complex for the x and y of a vector; infinite where nothing
        is proved
    status : (n,) "proved", or why not
    margin : (n,) lower bound of the smallest margin: if positive, every part assembles
    """

    FACTS = ("status", "margin", "low", "high")

    result: Result
    tolerances: Mapping[str, float]
    low: Mapping[str, Array]
    high: Mapping[str, Array]
    status: tuple[str, ...]
    margin: Array

    def __getitem__(self, output: str) -> Array:
        return np.asarray(0.5 * (self.high[output] - self.low[output]))

    def __iter__(self) -> Iterator[str]:
        return iter(self.low)

    def __len__(self) -> int:
        return len(self.low)

    @property
    def proved(self) -> bool:
        """Whether the bounds of all samples are proved."""
        return set(self.status) == {PROVED}

    @property
    def closes(self) -> bool:
        """Whether the mechanism closes at all samples, for every part within its tolerance."""
        return bool((self.margin > 0.0).all())

    def contains(self, output: str, values: Array) -> Array:
        """Whether values (..., n) of an output are within its bounds."""
        low, high, x = self.low[output], self.high[output], np.asarray(values)
        inside = (low.real <= x.real) & (x.real <= high.real)
        return inside & (low.imag <= x.imag) & (x.imag <= high.imag)

    def lines(self) -> Iterator[str]:
        """For each output its middle and half width at every sample, then what is proved."""
        subject = "every part within its tolerance" if self.tolerances else "exact numbers"
        yield from sections(self._table(name) for name in self)
        yield ""
        count = sum(word == PROVED for word in self.status)
        yield f"{count} of {len(self.status)} samples proved for {subject}"
        if self.closes:
            yield f"the mechanism closes for {subject}: margin at least {self.margin.min():.4g}"
        for word in dict.fromkeys(self.status):
            if word != PROVED:
                yield f"not proved: {word}"

    def _table(self, name: str) -> Iterator[str]:
        yield f"{name} [{self.result.unit(name) or '-'}]"
        low, high = self.low[name], self.high[name]
        rows = []
        for k, word in enumerate(self.status):
            text = "not proved" if word != PROVED else _bounded(low[k], high[k])
            rows.append((self.result._place(k, self._display), text))
        yield from aligned(("at", "value ± bound"), rows)


def _bounded(low: complex, high: complex) -> str:
    """The middle and half the width, of which the last digits are rounded up."""
    parts = []
    for a, b in ((low.real, high.real), (low.imag, high.imag)):
        half = 0.5 * (b - a)
        digits = max(0, 1 - int(np.floor(np.log10(half)))) if half > 0.0 else 6
        middle = round(0.5 * (a + b), min(digits, 16))
        parts.append(f"{middle:.{min(digits, 16)}f} ± {max(b - middle, middle - a) * 1.05:.2g}")
    return parts[0] if isinstance(low, float) else f"({parts[0]}, {parts[1]})"


@declared
def enclose(
    mechanism: Compiled,
    at: Coordinates | None = None,
    *,
    samples: int | None = None,
    times: Numbers | None = None,
    rates: Coordinates | None = None,
    accelerations: Coordinates | None = None,
    tolerance: Mapping[str, Quantity] | None = None,
    want: Iterable[str] | str = EVERYTHING,
    friction: FrictionMethod | None = None,
    static: bool = False,
) -> Enclosure:
    """Proved bounds of outputs for all parts within their tolerances, rounding included.

    Coordinates, rates and accelerations of the drivers are exact. Friction solves Coulomb's
    equations, not a number of iterations. The largest length of a group, by which its numbers
    are scaled, is that of the planned design. A sample takes some milliseconds.

    Parameters
    ----------
    at, samples, times, rates, accelerations : the samples, as those of a run
    tolerance : address -> largest deviation of the number to both sides, e.g.
        ``{"dyad.l_i": 1e-4}``, of links and joints ``{"links.rod.mass": 0.01}``; without any
        the bounds are those of rounding
    want : names or patterns of outputs that are numbers or vectors
    friction : "none" or "newton" (default)
    static : without inertia

    Returns
    -------
    Enclosure

    Raises
    ------
    RequestError for unknown names, and for numbers of links and joints that go into the graph of
    blocks by a formula, as lengths do

    >>> print(mech.enclose(at=0.5, want="crank.drive", friction="none"))
    crank.drive [N m]
    at                 value ± bound
    crank.q = 0.5 rad  8851.138615945429 ± 8e-11
    <BLANKLINE>
    1 of 1 samples proved for exact numbers
    the mechanism closes for exact numbers: margin at least 0.3029
    """
    widths = in_si_by_address(mechanism, tolerance or {}, "tolerance")
    problems = [
        Problem("bad-request", a, f"{x!r:.40} is no tolerance", "", "give a number above zero")
        for a, x in widths.items()
        if isinstance(x, bool) or not isinstance(x, int | float) or not 0.0 < x < np.inf
    ]
    if friction not in (None, "none", "newton"):
        remedy = "others are no solution of its equations"
        problems.append(Problem("bad-request", "friction", str(friction), "none, newton", remedy))
    RequestError.raise_for(problems)
    numbers_of = chosen_numbers(mechanism, list(widths))
    tolerances = {
        p.address: float(x) for p, x in zip(numbers_of.values(), widths.values(), strict=True)
    }
    paths_of = {p: _graph_paths(mechanism, p, tolerances[p.address]) for p in numbers_of.values()}
    catalogue = mechanism.outputs
    patterns = as_names("want", want)
    names = [n for n in catalogue.match(patterns) if catalogue[n].kind in ("real", "vector")]
    if not names:
        message = "bounds are of outputs that are a number or a vector a sample"
        raise RequestError([Problem("bad-request", n, message) for n in patterns])
    settings = {"friction": friction or "newton", "static": static}
    poses = {"samples": samples, "times": times, "rates": rates, "accelerations": accelerations}
    result = mechanism.run(at, want=names, on_gap="mark", **poses, **settings)  # type: ignore[arg-type]
    return _enclosed(mechanism, result, paths_of, tolerances, settings)


def _graph_paths(mechanism: Compiled, p: Parameter, width: float) -> tuple[Path, ...]:
    """Where a number stands in the graph of blocks.

    Raises `RequestError` for one that goes there by a formula, as a dimension between pins.
    """
    if not of_links(mechanism) and not is_written_out(mechanism):
        return (p.path,)
    number, planned = Varied(p.value, np.ones(1)), parameters_of(graph_sections(mechanism))
    numbers = followers(mechanism, {p.path: number})[1]
    unchanged = bool(numbers) and all(x is number for x in numbers.values())
    for x in (p.value - width, p.value + width):
        design = remade(mechanism, {p.address: x})
        same_links, values = design.names == mechanism.names, parameters_of(graph_sections(design))
        passed = {y.path for y in values.values() if y.value == x}
        unchanged &= same_links and values.keys() == planned.keys() and numbers.keys() <= passed
    if unchanged:
        return tuple(numbers)
    names = listed([path_text(path[1:]) for path in numbers], 4) or "another graph"
    message = f"{names} of blocks follows it by a formula"
    remedy = "enclose linkage.decompose().graph.compile(), with tolerances of its numbers"
    raise refused(p.address, message, remedy)


def _enclosed(
    mechanism: Compiled,
    result: Result,
    paths_of: Mapping[Parameter, tuple[Path, ...]],
    tolerances: Mapping[str, float],
    settings: Arguments,
) -> Enclosure:
    """Bounds at each sample of a result."""
    numbers: dict[Path, float] = {at: p.value for p, paths in paths_of.items() for at in paths}
    plan = planned_near(mechanism, numbers)._plan_at(result.samples, tuple(result), **settings)
    if missing := set(plan.program.inputs) - result.samples.given(plan.program.inputs).keys():
        message = f"the outputs depend on states: {', '.join(sorted(missing))}"
        raise RequestError([Problem("bad-request", "want", message, "", "name others")])
    laws = [law for b in mechanism.structure.blocks.values() for law in b.friction.values()]
    curved = settings["friction"] == "newton" and any(x.acts and x.reads_load for x in laws)
    engine = EnclosedEngine(plan.program)
    inputs = result.samples.given(plan.program.inputs)
    columns = [np.broadcast_to(inputs[name], result.n) for name in plan.program.inputs]
    shape = result.n
    ends = {
        name: np.empty((2, shape), complex if output.kind == "vector" else float)
        for name, output in ((n, mechanism.outputs[n]) for n in result)
    }
    margins, status = np.empty(shape), []
    for k in range(shape):
        SYMBOLS.count = 0
        forms: dict[Path, Form] = {}
        for p, paths in paths_of.items():
            forms |= dict.fromkeys(paths, within(p.value, tolerances[p.address]))
        parameters = (
            plan.program.values(*designed(mechanism, forms))
            if forms
            else tuple(plan.program.parameters.values())
        )
        values = engine.one([float(c[k]) for c in columns], parameters)
        for name, room in ends.items():
            y = mechanism.outputs[name].read(*(values[i] for i in plan.layout[name]))
            room[:, k] = _ends(y)
        margins[k], word = _judged(plan, values)
        wide = [name for name, room in ends.items() if not np.isfinite(room[:, k]).all()]
        message = f"nothing bounds {listed(wide, 3)}"
        word = word or ("friction is not linear in its load" if curved else "")
        status.append(word or (message if wide else PROVED))
    return Enclosure(
        result,
        tolerances,
        {name: room[0] for name, room in ends.items()},
        {name: room[1] for name, room in ends.items()},
        tuple(status),
        margins,
    )


def _ends(y: Complex) -> tuple[complex, complex]:
    """Bounds of a number, or of both components of a vector."""
    if isinstance(y, Form | float | int):
        y = form(y)
        return y.low, y.high
    x, y = form(y.real), form(y.imag)
    return complex(x.low, y.low), complex(x.high, y.high)


def _judged(plan: Plan, values: Values) -> tuple[float, str]:
    """The lower bound of the margins, and why nothing is proved of a sample; "" where it is."""
    lowest, word = 1.0, ""
    for block, at in plan.reports["margin"].items():
        low = form(values[at[0]]).low
        lowest = min(lowest, low)
        if not low > 0.0:
            word = f"{block} may not close: margin at least {low:.3g}"
    for block, at in plan.reports["friction"].items():
        bound = form(values[at[CONTRACTION]]).high
        if not bound < 1.0:
            word = word or f"friction of {block} may have several solutions: P up to {bound:.3g}"
        elif not form(values[at[3]]).high < 2.0:
            word = word or f"friction of {block} is not solved"
    return lowest, word
