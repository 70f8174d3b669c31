"""Settings of a run: what does not fit together is refused, all of it at once."""

from __future__ import annotations

import numpy as np

from blockmech.friction.solvers import METHODS
from blockmech.ground.errors import Problem, RequestError, listed, refused, shown
from blockmech.ground.values import is_count, is_number
from blockmech.plan.plan import Friction


def friction_asked(method: str | None, tolerance: float | None, iterations: int | None) -> Friction:
    """The friction method of a request; None is Newton's.

    Raises `RequestError` for what does not fit.
    """
    problems = []
    method = "newton" if method is None else method
    if not isinstance(method, str) or method not in METHODS:
        found = f"no friction method {shown(method)}"
        valid = f"methods: {listed(METHODS)}"
        problems.append(Problem("unknown-method", "friction", found, valid, ""))
    given = [n for n, x in (("tolerance", tolerance), ("iterations", iterations)) if x is not None]
    if given and method != "successive":
        found = f'has no meaning for friction="{method}"'
        remedy = 'use friction="successive" with it'
        problems.append(Problem("useless-setting", listed(given), found, "", remedy))
    if tolerance is not None and not (is_number(tolerance) and tolerance >= 0):
        found = f"must be >= 0 N, got {tolerance!r}"
        problems.append(Problem("bad-value", "tolerance", found, "", ""))
    if iterations is not None and not is_count(iterations):
        found = f"must be a whole number, at least 1, got {iterations!r}"
        problems.append(Problem("bad-value", "iterations", found, "", ""))
    if problems:
        raise RequestError(problems)
    return Friction(
        method,
        None if tolerance is None else float(tolerance),
        None if iterations is None else int(iterations),
    )


def check_chunk(chunk: int | None) -> None:
    """Raise `RequestError` for a number of samples at once that is none."""
    if chunk is not None and not is_count(chunk):
        found = f"must be a whole number, at least 1 sample, got {chunk!r}"
        raise refused("chunk", found, code="bad-value")


def check_switch(name: str, value: object) -> None:
    """Raise `RequestError` for a switch that is neither on nor off."""
    if not isinstance(value, bool | np.bool_):
        found = f"must be True or False, got {value!r}"
        raise refused(name, found, code="bad-value")
