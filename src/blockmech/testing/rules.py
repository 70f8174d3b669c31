"""Running numbered rules: what fails, what was measured, and how numbers are compared."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from blockmech.engines.nodes import AsksPython, Untraceable
from blockmech.engines.numpy import Planar
from blockmech.engines.trace import Trace
from blockmech.ground.plane import EPS
from blockmech.ground.report import Report
from blockmech.ground.tolerances import EQUAL, ROUNDING
from blockmech.plan.plan import Program
from blockmech.typing import Array, Complex, Data, Nested, Record

if TYPE_CHECKING:
    from blockmech.result.result import Result

Leaves = Mapping[str, Array]

ROUNDED = 8 * ROUNDING  # [-] of the largest term: some 100 operations, margins down to 1e-4
STEP = EPS ** (1 / 9) / 5  # [s] 4e-3: its eighth power, of a fifth of a second, is rounding over it
WEIGHTS = (4 / 5, -1 / 5, 4 / 105, -1 / 280)  # central difference of order 8
TIMES = np.linspace(0.3, 2.3, 9)  # [s] of motions in which a rule is tested
DERIVATIVE = EQUAL  # [-] of differences: 8! (STEP / T)^8 for a motion that changes over T = 0.2 s


class ConformanceError(AssertionError):
    """A block breaks its contract; the text names the rules."""


@dataclass(frozen=True, repr=False)
class Conformance(Report):
    """What was measured: the largest relative error [-] of each thing compared."""

    name: str
    measured: Mapping[str, float] = field(default_factory=dict)

    def lines(self) -> Iterator[str]:
        """What was measured, one a line."""
        yield f"{self.name} keeps its contract"
        yield from (f"  {label:<60} {error:.1e}" for label, error in self.measured.items())


class Checks:
    """Runs rules, each numbered and named by its docstring; collects what was measured."""

    rules: ClassVar[tuple[Callable[..., Iterator[str]], ...]] = ()

    def __init__(self) -> None:
        self.measured: dict[str, float] = {}

    def report(self, name: str) -> Conformance:
        """Run every rule. Raises `ConformanceError` with all that fails."""
        failed = []
        for number, rule in enumerate(self.rules, start=1):
            title = f"rule {number} ({(rule.__doc__ or '').rstrip('.')})"
            try:
                failed += [f"{title}: {fault}" for fault in rule(self)]
            except Exception as error:  # a broken kernel may fail in any way
                failed.append(f"{title}: raised {type(error).__name__}: {error}")
        if failed:
            raise ConformanceError("\n".join([f"{name} breaks its contract", *failed]))
        return Conformance(name, self.measured)

    def same(
        self, label: str, actual: Nested, expected: Nested, scale: float, allowed: float = ROUNDED
    ) -> Iterator[str]:
        """Compare two batches relative to a scale."""
        error = np.abs(np.asarray(actual) - np.asarray(expected))
        worst = float(np.max(error)) / scale if error.size and scale else float(np.max(error))
        self.measured[label] = max(self.measured.get(label, 0.0), worst)
        if not worst <= allowed:
            yield f"{label} is off by {worst:.1e} of its size (allowed {allowed:.0e})"

    def alike(self, label: str, scalar: Nested, batch: Array, single: Nested) -> Iterator[str]:
        """Engines agree on a batch (n,), and its fifth sample does not depend on the others."""
        yield from self.same(f"scalar {label}", scalar, batch, float(np.max(abs(batch))) or 1.0)
        if not same_bits(single, batch[4:5]):
            yield f"{label} of a sample alone is not the same as in a batch"

    def engines(
        self, run: Callable[..., Result], outputs: Iterable[str], condition: str = ""
    ) -> Iterator[str]:
        """Outputs of a run at `TIMES` are `alike`, and their program is traceable."""
        scalar, batch = (run(times=TIMES, engine=e) for e in ("scalar", "numpy"))
        single = run(times=TIMES[4:5], engine="numpy")
        yield from self.arithmetic(batch._plan.program, condition)
        for name in outputs:
            yield from self.alike(name, scalar[name], batch[name], single[name])

    def arithmetic(self, program: Program, condition: str = "") -> Iterator[str]:
        """Kernels are of the primitives alone: else machine code and C cannot have them."""
        try:
            Trace(program)
        except AsksPython:
            return  # which is no kernel
        except Untraceable as why:
            yield f"machine code and C cannot have it{condition}: {why}"

    def verified(self, report: Any, condition: str = "") -> Iterator[str]:
        """The balances of a mechanism, as `Mechanism.verify` found them."""
        if not report.samples:
            yield f"no sample has an answer{condition}"
        for row in report.rows:
            self.measured[f"{row.name}{condition}"] = row.value
            if not row.ok:
                yield f"{row.name}{condition} is off by {row.value:.1e} of its terms"


def derivative(values: Callable[[float], Record]) -> Data:
    """Derivative at t = 0 of values of time [s], by differences of order 8."""
    total: Data = {}
    for k, weight in enumerate(WEIGHTS, start=1):
        later, earlier = values(k * STEP), values(-k * STEP)
        for name in later:
            total[name] = total.get(name, 0.0) + weight * (later[name] - earlier[name]) / STEP
    return total


# ---- batches of numbers ------------------------------------------------------------------


def planar(z: Complex) -> Planar:
    """A batch of vectors for kernels."""
    z = np.asarray(z, complex)
    return Planar(z.real.copy(), z.imag.copy())


def vectors(z: Complex) -> Array:
    """Complex array of a batch of vectors."""
    return np.asarray(np.asarray(z.real) + 1j * np.asarray(z.imag))


def leaves(value: Nested, name: str = "") -> dict[str, Array]:
    """All numbers of a kernel's result by dotted name: complex or real arrays."""
    if isinstance(value, Planar):
        return {name: vectors(value)}
    if isinstance(value, tuple):
        names = getattr(value, "_fields", range(len(value)))
        return {
            k: x
            for n, v in zip(names, value, strict=True)
            for k, x in leaves(v, f"{name}.{n}" if name else str(n)).items()
        }
    return {name: np.asarray(value)}


def finite(values: Leaves) -> NDArray[np.bool_]:
    """(n,) whether all values of a sample are finite."""
    masks = np.broadcast_arrays(*(np.isfinite(x) for x in values.values()))
    return np.asarray(np.all(masks, axis=0))


def largest(values: Leaves) -> float:
    """Largest size of any number."""
    return max((float(np.max(abs(x))) for x in values.values()), default=0.0)


def same_bits(first: Nested, second: Nested) -> bool:
    """Whether two batches are the same to the last bit, after broadcasting."""
    a, b = np.broadcast_arrays(first, second)
    return bool(np.array_equal(a, b, equal_nan=True))


def as_number(value: Nested) -> Any:
    """A batch of one sample as Python numbers."""
    if isinstance(value, Planar):
        return complex(as_number(value.real), as_number(value.imag))
    if isinstance(value, tuple):
        parts = [as_number(x) for x in value]
        return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
    return float(np.asarray(value).ravel()[0])


def spoilt(value: Nested, name: str = "") -> Iterator[tuple[Nested, str]]:
    """The value with one of its numbers made NaN after the other, and which."""
    if isinstance(value, Planar):
        nan = np.full(np.shape(value.real), np.nan)
        yield Planar(nan, nan), name
    elif isinstance(value, tuple):
        for field_, part in value._asdict().items():  # type: ignore[attr-defined]
            for bad, part_name in spoilt(part, field_):
                yield value._replace(**{field_: bad}), part_name  # type: ignore[attr-defined]
    else:
        yield np.full(np.shape(value), np.nan), name
