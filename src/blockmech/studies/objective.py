"""A study point as a function: numbers of a design in, what is kept of it out.

Optimisers are SciPy's: ``minimize(f, f.start, jac=f.jacobian)`` for one number,
``least_squares(lambda x: f(x) - wanted, f.start, jac=f.jacobian)`` for several. A design that
does not assemble, or that its file would refuse, is infinitely bad.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blockmech.compiled import Compiled
from blockmech.errors import BlockmechError, Problem, RequestError, refused
from blockmech.studies.differentiate import sensitivity
from blockmech.studies.family import Family, remade
from blockmech.studies.reductions import WHOLE, Wanted
from blockmech.studies.runner import Runner
from blockmech.typing import Coordinates, FrictionMethod, Numbers

Array = NDArray[Any]


class Objective:
    """What is kept of a design as a function of its numbers ``x`` (k,).

    Attributes
    ----------
    addresses : the numbers, in the order of x
    start : the mechanism's own x
    """

    def __init__(self, mechanism: Compiled, runner: Runner, over: Mapping[str, Any]) -> None:
        self.mechanism = mechanism
        self.addresses = tuple(p.address for p in runner.family.parameters)
        self.start = np.array([p.value for p in runner.family.parameters], float)
        self._runner = runner
        self._over = over
        self._planned = runner.prepared(1)
        self._box = np.stack([self.start, self.start])  # values that the file takes

    def __call__(self, x: Any) -> Any:
        """One number, or all that is kept (r,): of a vector its x, then its y."""
        if not self._taken(self.numbers(x)):
            rows = [np.full(len(row), np.inf) for row in self._rows(self.start)]
        else:
            rows = self._rows(np.asarray(x, float))
        whole = np.where(np.isfinite(found := np.concatenate(rows)), found, np.inf)
        return float(whole[0]) if len(whole) == 1 else whole

    def jacobian(self, x: Any) -> Array:
        """Derivatives (k,) of one number, (r, k) of all; exact to rounding, one-sided at kinks.

        Raises `BlockmechError` for a design that does not assemble.
        """
        other = remade(self.mechanism, self.numbers(x))
        names = [w.output for w in self._runner.want]
        found = sensitivity(other, names, self.addresses, **self._over, **self._runner.settings)
        rows = [_reduced(w, found.result[w.output], found[w.output]) for w in self._runner.want]
        whole = np.concatenate(rows)
        return whole[0] if len(whole) == 1 else whole

    def numbers(self, x: Any) -> dict[str, float]:
        """Address -> number, for `Graph.replace`."""
        return dict(zip(self.addresses, np.asarray(x, float).tolist(), strict=True))

    def _rows(self, x: Array) -> list[Array]:
        columns = {p: x[k : k + 1] for k, p in enumerate(self._runner.family.parameters)}
        found = self._runner.block(self._planned, columns).values
        return [_parts(np.atleast_1d(found[w.label][0])) for w in self._runner.want]

    def _taken(self, numbers: Mapping[str, float]) -> bool:
        """Whether the file takes these numbers: each by itself, and what it takes are intervals."""
        document = self.mechanism.document
        for k, (address, x) in enumerate(numbers.items()):
            low, high = self._box[:, k]
            if document is None or low <= x <= high:
                continue
            try:
                document.replace({address: x})
            except BlockmechError:
                return False
            self._box[:, k] = min(low, x), max(high, x)
        return True


def objective(
    mechanism: Compiled,
    to: Iterable[str],
    *,
    want: Mapping[str, str | Sequence[str]] | Sequence[str] | str,
    over: Coordinates | None = None,
    samples: int | None = None,
    times: Numbers | None = None,
    friction: FrictionMethod | None = None,
    tolerance: float | None = None,
    iterations: int | None = None,
    static: bool = False,
) -> Objective:
    """What is kept of a design as a function of some of its numbers, for `scipy.optimize`.

    Parameters
    ----------
    to : addresses of the numbers, in the order of the function's argument
    want, over, samples, times, friction, tolerance, iterations, static : as those of a study

    Raises `RequestError` for unknown names, or settings that do not fit.
    """
    how = {"friction": friction, "tolerance": tolerance, "iterations": iterations, "static": static}
    family = Family(mechanism, (to,) if isinstance(to, str) else to)
    if not family.parameters:
        raise refused("to", "no numbers", "name some addresses")
    poses: dict[str, Any] = {"at": over, "samples": samples, "times": times}
    runner = Runner.of(family, want, poses, how)
    if whole := [w.label for w in runner.want if w.how == WHOLE]:
        found = "it is one number a turn, and has no derivative"
        raise RequestError([Problem("no-derivative", label, found) for label in whole])
    return Objective(mechanism, runner, poses)


def _parts(row: Array) -> Array:
    """A row of real numbers: of vectors all x, then all y."""
    return np.concatenate([row.real, row.imag]) if np.iscomplexobj(row) else row


def _reduced(w: Wanted, y: Array, d: Array) -> Array:
    """Derivatives (r, k) of a reduction of an output y (n,) with derivatives d (k, n)."""
    if w.vector and w.how in ("max_abs", "rms"):
        size = np.abs(y)
        y, d = size, (y.conj() * d).real / size
    low, high = int(np.argmin(y.real)), int(np.argmax(y.real))
    far = int(np.argmax(np.abs(y)))
    rules: Mapping[str, Callable[[], Any]] = {
        "min": lambda: d[:, low],
        "max": lambda: d[:, high],
        "max_abs": lambda: np.sign(y[far]) * d[:, far],
        "range": lambda: d[:, high] - d[:, low],
        "mean": lambda: d.mean(axis=1),
        "rms": lambda: (y * d).mean(axis=1) / np.sqrt(np.mean(y * y)),
        "at": lambda: d[:, w.sample],
        "poses": lambda: d,
    }
    found = np.asarray(rules[w.how]())
    columns = found.T if found.ndim > 1 else found[None, :]
    if np.iscomplexobj(columns):
        return np.concatenate([columns.real, columns.imag])
    return columns
