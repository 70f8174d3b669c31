"""Settings of a run: what does not fit together is refused, all of it at once."""

from __future__ import annotations

from blockmech.friction.solvers import METHODS
from blockmech.ground.errors import Problem, RequestError, listed, refused, shown
from blockmech.ground.values import is_count, is_number
from blockmech.plan.plan import Friction
from blockmech.typing import FrictionMethod, Successive


def friction_asked(method: FrictionMethod | None) -> Friction:
    """The friction method of a request; None is Newton's.

    Raises `RequestError` for a method that does not exist and numbers that do not fit.
    """
    if not isinstance(method, Successive):
        method = "newton" if method is None else method
        if not isinstance(method, str) or method not in METHODS:
            message = f"no friction method {shown(method)}"
            valid = f"methods: {listed(METHODS)}, bm.friction.Successive(...)"
            raise refused("friction", message, valid=valid, code="unknown-method")
        return Friction(method)
    problems = []
    tolerance, iterations = method.tolerance, method.iterations
    if tolerance is not None and not (is_number(tolerance) and tolerance >= 0):
        message = f"must be >= 0 N, got {tolerance!r}"
        problems.append(Problem("bad-value", "tolerance", message, "", ""))
    if iterations is not None and not is_count(iterations):
        message = f"must be a whole number, at least 1, got {iterations!r}"
        problems.append(Problem("bad-value", "iterations", message, "", ""))
    RequestError.raise_for(problems)
    return Friction(
        "successive",
        None if tolerance is None else float(tolerance),
        None if iterations is None else int(iterations),
    )


def check_chunk(chunk: int | None) -> None:
    """Raise `RequestError` for a number of samples at once that is none."""
    if chunk is not None and not is_count(chunk):
        message = f"must be a whole number, at least 1 sample, got {chunk!r}"
        raise refused("chunk", message, code="bad-value")
