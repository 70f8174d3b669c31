"""Settings of a run: what does not fit together is refused, all of it at once."""

from __future__ import annotations

import math

import numpy as np

from blockmech.engines.numpy import PRECISIONS
from blockmech.errors import Problem, RequestError, listed
from blockmech.friction.solvers import METHODS
from blockmech.plan import Friction


def friction_asked(method: str, tolerance: float | None, iterations: int | None) -> Friction:
    """The friction method of a request. Raises `RequestError` for what does not fit."""
    problems = []
    if method not in METHODS:
        problems.append(
            Problem(
                "unknown-method",
                "friction",
                f'no friction method "{method}"',
                f"methods: {listed(METHODS)}",
                "",
            )
        )
    given = [n for n, x in (("tolerance", tolerance), ("iterations", iterations)) if x is not None]
    if given and method != "successive":
        problems.append(
            Problem(
                "useless-setting",
                listed(given),
                f'has no meaning for friction="{method}"',
                "",
                'use friction="successive" with it',
            )
        )
    if tolerance is not None and not 0 <= tolerance < math.inf:
        problems.append(
            Problem("bad-value", "tolerance", f"must be >= 0 N, got {tolerance}", "", "")
        )
    if iterations is not None and (iterations < 1 or iterations != int(iterations)):
        found = f"must be a whole number, at least 1, got {iterations}"
        problems.append(Problem("bad-value", "iterations", found, "", ""))
    if problems:
        raise RequestError(problems)
    return Friction(
        method,
        None if tolerance is None else float(tolerance),
        None if iterations is None else int(iterations),
    )


def unknown_engine(engine: str, precision: str) -> RequestError:
    """The error of an engine that there is not, or not with this precision."""
    found = f'no engine "{engine}" with precision "{precision}"'
    valid = f"engines: auto, scalar, numpy; precisions of numpy: {listed(PRECISIONS)}"
    return RequestError(Problem("unknown-engine", "engine", found, valid, ""))


def check_chunk(chunk: int | None) -> None:
    """Raise `RequestError` for a number of samples at once that is none."""
    if chunk is not None and (not isinstance(chunk, int | np.integer) or chunk < 1):
        found = f"must be a whole number, at least 1 sample, got {chunk!r}"
        raise RequestError(Problem("bad-value", "chunk", found, "", ""))
