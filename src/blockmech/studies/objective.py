"""A study point as a function: numbers of a design in, what is kept of it out.

Optimisers are SciPy's: ``minimize(f, f.start, jac=f.jacobian)`` for one number,
``least_squares(lambda x: f(x) - wanted, f.start, jac=f.jacobian)`` for several. A design that
does not assemble, or that its file would refuse, is infinitely bad.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from blockmech.compiled import Compiled
from blockmech.ground.arguments import declared
from blockmech.ground.errors import Problem, RequestError, listed, refused
from blockmech.ground.tolerances import EQUAL
from blockmech.studies.differentiate import sensitivity
from blockmech.studies.family import Family, remade
from blockmech.studies.motions import STEP, MotionRunner, runner_of
from blockmech.studies.reductions import WHOLE
from blockmech.studies.runner import Runner
from blockmech.studies.sampling import as_sequence
from blockmech.typing import Arguments, Array, Coordinates, Floats, FrictionMethod, Numbers

INFEASIBLE = 1 / EQUAL  # times the size of what is minimized: a design that cannot be


class Objective:
    """A reduction of a design's outputs as a function of its parameters ``x`` (k,).

    Attributes
    ----------
    addresses : the numbers, in the order of x
    start : the mechanism's present x
    """

    def __init__(self, mechanism: Compiled, runner: Runner, over: Arguments) -> None:
        self.mechanism = mechanism
        self.addresses = tuple(p.address for p in runner.family.parameters)
        self.start = np.array([p.value for p in runner.family.parameters], float)
        self._runner = runner
        self._over = over
        self._planned = runner.prepared(1)

    def __repr__(self) -> str:
        return f"<Objective of {self.mechanism.name}: by {listed(self.addresses, 3)}>"

    def __call__(self, x: Floats) -> float | Floats:
        """One number, or all that is kept (r,): of a vector its x, then its y."""
        family, numbers = self._runner.family, self.numbers(x)
        parameters = dict(zip(family.parameters, numbers.values(), strict=True))
        bad = any(problem for p in parameters for problem in family.problems(p, parameters[p]))
        rows = self._rows(self.start if bad else np.array([*numbers.values()]))
        answer = np.where(np.isfinite(rows) & (not bad), rows, np.inf)
        return float(answer[0]) if len(answer) == 1 else answer

    def jacobian(self, x: Floats) -> Array:
        """Derivatives (k,) of one number, (r, k) of all; exact to rounding, one-sided at kinks.

        Of a drawing with dimensions, whose points move from where they are drawn to each design,
        they are differences of fourth order, good to about 1e-9. Raises `BlockmechError` for a
        design that does not assemble.
        """
        if getattr(self.mechanism.document, "dimensions", None):
            return self._by_differences(x)
        design = remade(self.mechanism, self.numbers(x))
        labels = [w.label for w in self._runner.want]
        derivatives = sensitivity(
            design, labels, self.addresses, **self._over, **self._runner.settings
        )
        jacobian = np.concatenate([real_parts(derivatives[label]).T for label in labels])
        return jacobian[0] if len(jacobian) == 1 else jacobian

    def _by_differences(self, x: Floats) -> Array:
        at = np.array([*self.numbers(x).values()])
        jacobian = np.stack([self._slope(at, k) for k in range(len(at))], axis=-1)
        return jacobian[0] if len(jacobian) == 1 else jacobian

    def _slope(self, at: Array, k: int) -> Array:
        step = STEP * (abs(at[k]) or 1.0)
        rules = {
            (-2, -1, 1, 2): (1.0, -8.0, 8.0, -1.0),
            (0, 1, 2, 3, 4): (-25.0, 48.0, -36.0, 16.0, -3.0),
            (0, -1, -2, -3, -4): (25.0, -48.0, 36.0, -16.0, 3.0),
        }
        for offsets, weights in rules.items():
            rows = np.repeat(at[None], len(offsets), axis=0)
            rows[:, k] += step * np.array(offsets)
            values = np.array([np.atleast_1d(self(row)) for row in rows])
            if np.isfinite(values).all():
                return np.asarray(np.array(weights) @ values / (12.0 * step))
        message = f"there is no answer near {self.addresses[k]} = {at[k]:.9g}"
        raise refused(
            self.addresses[k], message, "start where designs have one", code="no-derivative"
        )

    def numbers(self, x: Floats) -> dict[str, float]:
        """Address -> number, for `Graph.replace`. Raises `RequestError` where they are not k."""
        try:
            row = np.atleast_1d(np.asarray(x, float))
        except (TypeError, ValueError, OverflowError):
            raise refused("x", f"got {x!r:.60}", "give a row of numbers") from None
        if row.shape != self.start.shape:
            message = f"has shape {row.shape} where there are {len(self.addresses)} numbers"
            raise refused("x", message, f"give those of {listed(self.addresses)}")
        return dict(zip(self.addresses, row.tolist(), strict=True))

    def _rows(self, x: Array) -> Array:
        columns = {p: x[k : k + 1] for k, p in enumerate(self._runner.family.parameters)}
        values = self._runner.block(self._planned, columns).values
        rows = [real_parts(np.atleast_1d(values[w.label][0])) for w in self._runner.want]
        return np.concatenate(rows)


class MotionObjective(Objective):
    """A reduction of a design's motion as a function of its parameters."""

    def jacobian(self, x: Floats) -> Array:
        """Derivatives (k,) of one number, (r, k) of all, by differences of fourth order.

        Dual numbers cannot be used, because the end of a motion and its slipping pairs are found
        during it. Motions are accurate to about 1e-12, the derivatives to about 1e-9. At a bound
        of a parameter, where one side has no motion, one-sided differences are taken. Raises
        `BlockmechError` if neither side has one.
        """
        return self._by_differences(x)


@declared
def objective(
    mechanism: Compiled,
    to: Iterable[str],
    *,
    want: Mapping[str, str | Sequence[str]] | Sequence[str] | str,
    at: Coordinates | None = None,
    samples: int | None = None,
    times: Numbers | None = None,
    friction: FrictionMethod | None = None,
    static: bool = False,
    simulate: Arguments | None = None,
) -> Objective:
    """A result of a design as a function of some of its numbers, for `scipy.optimize`.

    Parameters
    ----------
    to : addresses of the numbers, in the order of the function's argument
    want, at, samples, times, friction, static, simulate : as those of a study
        Derivatives of motions are differences of fourth order, see `MotionObjective`.

    Raises `RequestError` for unknown names, or settings that do not fit.

    >>> largest = mech.objective(["dyad.l_i"], want={"crank.drive": "max"}, samples=13)
    >>> round(largest([6.0]), 3)
    9288.306
    """
    settings = {"friction": friction, "static": static}
    family = Family(mechanism, as_sequence("to", to), friction)
    poses: Arguments = {"at": at, "samples": samples, "times": times}
    runner = runner_of(family, want, poses, settings, simulate)
    if isinstance(runner, MotionRunner):
        return MotionObjective(mechanism, runner, poses)
    if undifferentiable := [w.label for w in runner.want if w.how == WHOLE]:
        message = "it is one number a turn, and has no derivative"
        raise RequestError([Problem("no-derivative", label, message) for label in undifferentiable])
    return Objective(mechanism, runner, poses)


def real_parts(y: Array) -> Array:
    """Real numbers (..., n), of vectors (..., 2 n): all x, then all y."""
    return np.concatenate([y.real, y.imag], axis=-1) if np.iscomplexobj(y) else y
