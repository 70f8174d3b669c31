"""What is kept of an output over the poses of a design: its extremes, its mean, one pose.

A want is an output and a reduction, ``max_abs(crank.drive)``. Reductions of a vector are those
of its length; a mean and a single pose are vectors. Extremes and strokes are those of the whole
range that the poses go through, found between them (`blockmech.analysis.peaks`,
`blockmech.analysis.stroke`); means are of the poses; ``rest(crank.q)`` is an output where the
design comes to rest.

Derivatives are those of the reduction: of a largest value that of the place where it is, of
several that are alike the one that leads.

Of the stable equilibria the one nearest to the first pose is meant, friction of joints left out.
With the effort Q(q, p) of the loads, zero there, it moves with a number p of the design by

    dq/dp = -(dQ/dq)^-1 dQ/dp,    dy/dp = y_p + y_q dq/dp,

an end stop that holds it does not move.

Source: Shabana, Dynamics of Multibody Systems, 4th ed.; the implicit function theorem.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from blockmech.dynamics.loads import period_of
from blockmech.ground.errors import Problem, RequestError, close_match, listed, refused
from blockmech.ground.plane import REST_SHARE
from blockmech.outputs.by_block import Catalogue
from blockmech.plan.plan import Output
from blockmech.result.samples import Samples
from blockmech.studies.sampling import as_sequence
from blockmech.typing import Array, Complex, Data, Floats, Real, Reals

TEXT = re.compile(r"(?P<how>\w+)\s*\((?P<output>[^,()]+)(?:,\s*(?P<at>[^,()]+))?\)")
AT = re.compile(r"(?P<how>\w+)\(\s*(?P<at>[^()]+)\s*\)")
WHOLE, POSES, STROKE, REST = "value", "poses", "stroke", "rest"


def mean(x: Array) -> Array:
    """Mean over the poses of each design."""
    return np.asarray(np.add.reduce(np.ascontiguousarray(x), axis=1) / x.shape[1])


SIMPLE: Mapping[str, Callable[[Array], Array]] = {
    "min": lambda x: x.min(axis=1),
    "max": lambda x: x.max(axis=1),
    "max_abs": lambda x: np.abs(x).max(axis=1),
    "range": lambda x: x.max(axis=1) - x.min(axis=1),
    "mean": mean,
    "rms": lambda x: np.sqrt(mean(x * x)),
}
EXTREMES = {"min": (-1,), "max": (1,), "max_abs": (1,), "range": (1, -1), STROKE: (1, -1)}
"""Reductions that are found between the poses: signs with which an output is largest there."""
OF_VECTORS = ("max_abs", "rms", "mean", "at", "final", POSES, STROKE, REST)
Words = Mapping[str, Callable[[str, str], Any] | None]
"""Reductions; of those that take a number, what reads it of a text, for the output of a name."""


@dataclass(frozen=True)
class Wanted:
    """One column of a study.

    Attributes
    ----------
    label : how it is called, ``max_abs(crank.drive)``
    output : name of the output
    how : name of the reduction
    sample : the number of the reduction, read: of ``at`` the pose
    unit, kind : as the output's; "vector" only where the column is one
    vector : whether the output is one
    """

    label: str
    output: str
    how: str
    unit: str
    kind: str
    sample: Real = 0
    vector: bool = False

    @property
    def of_margin(self) -> bool:
        """Whether it is of a margin, which poses without an answer have as well."""
        return self.output.endswith(".margin")

    def nothing(self, n: int) -> Complex:
        """What stands for it in a design without an answer: NaN, (n,) of poses."""
        nan = complex(math.nan, math.nan) if self.kind == "vector" else math.nan
        return np.full(n, nan) if self.how == POSES else nan

    def of(self, output: Output, columns: Reals, shape: tuple[int, int], weights: Array) -> Array:
        """The column (m,), or (m, n) of poses, of the output's values that broadcast to (m, n)."""
        if self.how == REST:  # which is followed design by design
            return np.full(shape[0], self.nothing(1))
        if self.how == WHOLE:
            rows = [np.broadcast_to(x, shape) for x in columns]
            return np.array([output.read(*row, weights) for row in zip(*rows, strict=True)])
        return self._reduced(self.poses(output, columns, shape))

    def poses(self, output: Output, columns: Reals, shape: tuple[int, int]) -> Array:
        """The output at poses (m, n), as its design reads it; of a vector its length where that
        is reduced."""
        y = output.read(*columns)
        if not self.vector:
            return np.broadcast_to(_finite(y), shape)
        x, y = (np.broadcast_to(_finite(part), shape) for part in (y.real, y.imag))
        return np.hypot(x, y) if self.how in ("max_abs", "rms") else x + 1j * y

    def _reduced(self, x: Array) -> Array:
        if self.how == POSES:
            return np.array(x)
        return np.array(x[:, self.sample]) if self.how == "at" else SIMPLE[self.how](x)

    def value(self, y: Array) -> Array:
        """The reduction of an output (n,) of one design: an array of one number, or all (n,)."""
        size = np.abs(y) if self.vector and self.how in ("max_abs", "rms") else y
        return np.atleast_1d(self._reduced(size[None])[0])

    def slopes(self, y: Array, d: Array) -> Array:
        """Derivatives (k, 1), of poses (k, n), of the reduction of y (n,) with slopes d (k, n)."""
        size = np.abs(y)
        grows = (y.conj() * d).real / np.where(size > 0.0, size, 1.0)
        rules: Mapping[str, Callable[[], Any]] = {
            "min": lambda: -_of_largest(-y, -d),
            "max": lambda: _of_largest(y, d),
            "max_abs": lambda: _of_largest(size, grows),
            "range": lambda: _of_largest(y, d) + _of_largest(-y, -d),
            "mean": lambda: d.mean(axis=1),
            "rms": lambda: (size * grows).mean(axis=1) / (np.sqrt(np.mean(size**2)) or 1.0),
            "at": lambda: d[:, self.sample],
            POSES: lambda: d,
        }
        rows: Array = rules[self.how]()
        return rows if rows.ndim > 1 else rows[:, None]


def _of_largest(y: Array, d: Array) -> Array:
    """Derivatives (k,) of the largest of y (n,): of several but for rounding, that which leads."""
    slopes: Array = d[:, np.isclose(y, y.max(), rtol=REST_SHARE, atol=0.0)].max(axis=1)
    return slopes


def is_reduction(text: str) -> bool:
    """Whether a text names a reduction, ``max_abs(crank.drive)``, and not an output."""
    return bool(TEXT.fullmatch(text.strip()))


def _finite(x: Real) -> Array:
    """An output with NaN for what is infinite; the sum tells quickly that nothing is."""
    return np.asarray(x if np.isfinite(np.sum(x)) else np.where(np.isfinite(x), x, np.nan))


def wanted(
    want: Any, outputs: Catalogue, samples: Samples, drivers: Sequence[str]
) -> tuple[Wanted, ...]:
    """The columns of runs at samples that a request names; see `columns`."""
    readers: Words = {
        **dict.fromkeys((*SIMPLE, STROKE, REST, POSES)),
        "at": lambda text, name: _sample(text, name, samples, drivers),
    }
    return columns(want, outputs, lambda output, how: column(output, how, readers))


def columns(
    want: Any,
    outputs: Catalogue,
    column: Callable[[Output, str], Wanted],
    facts: Mapping[str, Wanted] | None = None,
) -> tuple[Wanted, ...]:
    """The columns that a request names: ``{"crank.drive": ["max_abs", "rms"]}`` or texts.

    Patterns of names are as those of a run; ``facts`` are columns that are no outputs, by name.
    Raises `RequestError` with all that is wrong.
    """
    by_label: dict[str, Wanted] = {}
    problems: list[Problem] = []
    numbers = facts or {}
    for name, reduction in _pairs(want, problems):
        try:
            if name in numbers and reduction == WHOLE:
                by_label[name] = numbers[name]
                continue
            for output in outputs.match([name]):
                reduced = column(outputs[output], reduction)
                by_label[reduced.label] = reduced
        except RequestError as error:
            problems += error.problems
    RequestError.raise_for(problems)
    if not by_label:
        raise refused("want", "nothing is wanted", 'e.g. "max_abs(crank.drive)"')
    return tuple(by_label.values())


def _pairs(want: Any, problems: list[Problem]) -> Iterator[tuple[str, str]]:
    """Names of outputs, each with its reduction."""
    if isinstance(want, Mapping):
        for name, hows in want.items():
            for reduction in as_sequence(f"want[{name}]", hows):
                yield str(name), reduction
        return
    for text in as_sequence("want", want):
        match = TEXT.fullmatch(text.strip())
        at = f"({match['at']})" if match and match["at"] else ""
        yield (match["output"].strip(), match["how"] + at) if match else (text.strip(), WHOLE)


def column(output: Output, reduction: str, readers: Words) -> Wanted:
    """The column of an output by one of some reductions. Raises `RequestError` for another."""
    called, vector = output.name, output.kind == "vector"
    if output.kind == "matrix":
        raise refused(called, "it is a matrix", "ask for the outputs of its drivers")
    if output.kind == "number":
        if reduction != WHOLE:
            raise refused(
                f"{reduction}({called})", "it is one number a design", f'ask for "{called}"'
            )
        return Wanted(called, called, WHOLE, output.unit, "real")
    at = AT.fullmatch(reduction)
    word = at["how"] if at else reduction
    reader = readers.get(word)
    if word not in readers or (at and reader is None) or (word == "at" and not at):
        message = (
            f'no reduction "{reduction}"' if reduction != WHOLE else "how it is reduced is not said"
        )
        remedy = close_match(reduction, readers) or f'e.g. "max_abs({called})"'
        spelled = listed("at(coordinate)" if x == "at" else x for x in readers)
        raise refused(called, message, remedy, f"reductions: {spelled}", "bad-value")
    if vector and word == STROKE and not called.endswith(".p"):
        raise refused(
            f"{reduction}({called})", "not the position of a marker", "name a place, or a part"
        )
    if vector and word not in OF_VECTORS:
        remedy = f'ask for "{reduction}({called}.x)", or {listed(OF_VECTORS)}'
        raise refused(f"{reduction}({called})", "it is a vector", remedy)
    sample = reader(at["at"] if at else "", called) if reader else 0
    if word == STROKE and not vector:
        word = "range"
    label = f"{word}({called}, {at['at']})" if at else f"{reduction}({called})"
    kind = "vector" if vector and word in ("mean", "at", "final", POSES, REST) else "real"
    return Wanted(label, called, word, output.unit, kind, sample, vector)


def _sample(text: str, name: str, samples: Samples, drivers: Sequence[str]) -> int:
    """The number of the pose at a coordinate of the only driver."""
    where = f"at({name}, {text})"
    if len(drivers) != 1:
        raise refused(where, f"there are {len(drivers)} drivers", 'ask for its "poses"')
    q = samples.coordinate(0)
    try:
        x = float(text)
    except ValueError:
        raise refused(where, f'"{text}" is not a coordinate', "give a number") from None
    k = int(np.argmin(np.abs(q - x)))
    if not (q[k] == x or math.isclose(q[k], x)):
        raise refused(where, "the study has no such pose", f"the nearest one is {q[k]:.9g}")
    return k


class Rest(NamedTuple):
    """Where a mechanism rests.

    at : driver -> coordinate [rad or m]
    stop : whether an end stop holds it
    jump : of the effort, so that the place has no derivative
    """

    at: dict[str, float]
    stop: bool
    jump: bool

    @property
    def still(self) -> Data:
        """The pose at rest, as a run takes it."""
        none = dict.fromkeys(self.at, 0.0)
        poses = {driver: [q] for driver, q in self.at.items()}
        return {"at": poses, "rates": none, "accelerations": none, "friction": "none"}


def rest_of(mechanism: Any, samples: Samples) -> Rest | None:
    """The stable equilibrium nearest to the first of some poses; None where there is none.

    Raises `RequestError` where loads follow the time or signals.
    """
    drivers = mechanism.drivers
    first = np.array([float(np.ravel(samples.coordinate(i))[0]) for i in range(len(drivers))])
    s, stops = mechanism.structure, mechanism.scene.stops
    periods = [0.0 if d in stops else period_of(s, d) or 0.0 for d in drivers]
    time = None if samples.times is None else float(samples.times[0])

    def near(q: Floats) -> Floats:
        ways = zip(q, first, periods, strict=True)
        return np.array([x + p * round((to - x) / p) if p else x for x, to, p in ways])

    equilibria = [
        (near(e.q), e) for e in mechanism.equilibria(friction="none", time=time, charts=False)
        if e.kind == "stable"
    ]  # fmt: skip
    if not equilibria:
        return None
    q, e = min(equilibria, key=lambda row: float(np.abs(row[0] - first).max()))
    return Rest(dict(zip(drivers, q.tolist(), strict=True)), e.stop, e.jump)


def rest_value(mechanism: Any, samples: Samples, output: str) -> Any:
    """An output where a mechanism rests; NaN where it does not."""
    rest = rest_of(mechanism, samples)
    if rest is None:
        return np.nan
    return np.ravel(mechanism.run(want=[output], **rest.still)[output])[0]


def rest_slopes(
    mechanism: Any, samples: Samples, output: str, to: Sequence[str]
) -> tuple[Array, tuple[Array, Array]]:
    """An output where a mechanism rests, and its derivatives (k, 1) to both sides.

    Raises `RequestError` where no stable equilibrium exists, or the effort jumps there.
    """
    rest = rest_of(mechanism, samples)
    label = f"rest({output})"
    if rest is None:
        raise refused(label, "no stable equilibrium exists", "change the loads or the stops")
    if rest.jump:
        found = "the effort of the loads jumps where it rests"
        raise refused(
            label, found, "it does not depend smoothly on any number", code="no-derivative"
        )
    drivers = mechanism.drivers
    efforts = [mechanism._of_driver(d, "tau_red") for d in drivers]
    coordinates = [mechanism._of_driver(d, "q") for d in drivers]
    of = mechanism.sensitivity([output, *efforts], [*to, *coordinates], **rest.still)
    sides = []
    for d in (of.ahead, of.behind):
        slopes, k = np.asarray(d[output])[:, 0], len(to)
        effort = np.array([d[name][:, 0] for name in efforts])
        if not rest.stop:
            moved = -np.linalg.solve(effort[:, k:], effort[:, :k])
            slopes = slopes[:k] + slopes[k:] @ moved
        sides.append(slopes[:k, None])
    return np.asarray(of.result[output]), (sides[0], sides[1])
