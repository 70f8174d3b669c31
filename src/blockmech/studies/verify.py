"""`verify` of all that a mechanism answers, studies included."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, ParamSpec

import numpy as np

from blockmech.analysis.verify import Check, Verification
from blockmech.analysis.verify import verify as verified
from blockmech.compiled import Compiled
from blockmech.ground.errors import refused
from blockmech.studies.family import document_value, remade
from blockmech.studies.motions import MotionRunner
from blockmech.studies.table import Study

P = ParamSpec("P")
DESIGNS = 8  # of a study, made again


def _also_studies(function: Callable[P, Verification]) -> Callable[P, Verification]:
    """The same, of a study as well."""

    @functools.wraps(function)
    def verify(*args: P.args, **settings: P.kwargs) -> Verification:
        given: tuple[Any, ...] = args
        if len(given) == 2 and isinstance(given[1], Study) and not settings:
            return _made_again(given[0], given[1])
        return function(*args, **settings)

    return verify


def _made_again(mechanism: Compiled, study: Study) -> Verification:
    """Some designs of a study, each made from the document and run by itself, against its rows.

    Errors are relative to the column's largest number, times the conditioning of the design.
    """
    runner, names = study.runner, [n for n in mechanism.outputs if n.endswith(".margin")]
    if isinstance(runner, MotionRunner):
        raise refused("at", "it is a study of motions", "verify a simulation of one of its designs")
    if runner.family.mechanism is not mechanism:
        raise refused("at", f"it is a study of another mechanism, {study.name}")
    plain = {"friction": "none", "static": True}
    answered = np.flatnonzero(study.found.word == 0)
    some = answered[np.unique(np.linspace(0, len(answered) - 1, DESIGNS).round().astype(int))]
    sizes = {w.label: float(np.nanmax(np.abs(study[w.label]))) or 1.0 for w in study.columns}
    alone, worst, most = replace(runner, engine="numpy"), dict.fromkeys(sizes, 0.0), 1.0
    for design in some.tolist():
        columns = {p: study.vary[a][[design]] for a, p in study.parameters.items()}
        own = remade(mechanism, {p.address: document_value(p, x[0]) for p, x in columns.items()})
        taken = runner.samples(own)
        run = own._answer(taken, names, plain) if names else {}
        margin = min((float(np.min(run[name])) for name in names), default=1.0)
        condition = 1 / math.sqrt(margin)
        most = max(most, condition)
        for label, again in alone.design(own, columns).values.items():
            gap = np.abs(again[0] - study[label][design]) / (sizes[label] * condition)
            worst[label] = max(worst[label], float(np.max(gap)))
    rows = tuple(Check(f"{label} made again", value) for label, value in worst.items())
    return Verification(rows, len(some), most)


verify = _also_studies(verified)
"""`blockmech.analysis.verify.verify`, which takes a study as well."""
