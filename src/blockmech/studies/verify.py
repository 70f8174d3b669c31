"""`verify` of all that a mechanism answers, studies and derivatives included."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, ParamSpec

import numpy as np

from blockmech.analysis.verify import Check, Verification, refuse_foreign
from blockmech.analysis.verify import verify as verified
from blockmech.compiled import Compiled
from blockmech.ground.errors import BlockmechError, refused
from blockmech.result.result import Result
from blockmech.result.samples import Samples
from blockmech.studies.family import document_value, remade
from blockmech.studies.motions import STEP, MotionRunner
from blockmech.studies.sensitivity import Sensitivity, size_of
from blockmech.studies.table import Study
from blockmech.typing import Array

P = ParamSpec("P")
DESIGNS = 8  # of a study, made again


def _with_studies(function: Callable[P, Verification]) -> Callable[P, Verification]:
    """The same, of a study and of derivatives as well."""

    @functools.wraps(function)
    def verify(*args: P.args, **settings: P.kwargs) -> Verification:
        arguments: tuple[Any, ...] = args
        if len(arguments) == 2 and not settings:
            mechanism, answer = arguments
            if isinstance(answer, Study):
                return _recompute_designs(mechanism, answer)
            if isinstance(answer, Sensitivity):
                return _differences(mechanism, answer)
        return function(*args, **settings)

    return verify


def _recompute_designs(mechanism: Compiled, study: Study) -> Verification:
    """Some designs of a study, each made from the document and run by itself, against its rows.

    Errors are relative to the column's largest number, times the conditioning of the design.
    """
    runner = study.runner
    if isinstance(runner, MotionRunner):
        raise refused("at", "it is a study of motions", "verify a simulation of one of its designs")
    refuse_foreign(mechanism, runner.family.mechanism, "it is a study")
    answered = np.flatnonzero(study.found.word == 0)
    chosen = answered[np.unique(np.linspace(0, len(answered) - 1, DESIGNS).round().astype(int))]
    sizes = {w.label: float(np.nanmax(np.abs(study[w.label]))) or 1.0 for w in study.columns}
    alone, worst, largest = replace(runner, engine="numpy"), dict.fromkeys(sizes, 0.0), 1.0
    for design in chosen.tolist():
        columns = {p: study.vary[a][[design]] for a, p in study.parameters.items()}
        design_mechanism = remade(
            mechanism, {p.address: document_value(p, x[0]) for p, x in columns.items()}
        )
        condition = _condition(design_mechanism, runner.samples(design_mechanism))
        largest = max(largest, condition)
        for label, again in alone.design(design_mechanism, columns).values.items():
            gap = np.abs(again[0] - study[label][design]) / (sizes[label] * condition)
            worst[label] = max(worst[label], float(np.max(gap)))
    rows = tuple(Check(f"{label} made again", value) for label, value in worst.items())
    return Verification(rows, len(chosen), largest)


def _condition(mechanism: Compiled, samples: Samples) -> float:
    """Largest conditioning [-] of a group over some samples."""
    names = [name for name in mechanism.outputs if name.endswith(".margin")]
    run = mechanism._answer(samples, names, {"friction": "none", "static": True}) if names else {}
    return 1 / math.sqrt(min((float(np.nanmin(run[name])) for name in names), default=1.0))


def _differences(mechanism: Compiled, derivatives: Sensitivity) -> Verification:
    """Derivatives of outputs by some numbers, against differences of designs near by.

    Numbers at a bound and samples at kinks are left out, and what differences of the wider step may
    be off by.
    Errors are relative to what rounding of the output makes of a difference.
    """
    run, parameters, rows = derivatives.result, derivatives.parameters, list[Check]()
    refuse_foreign(mechanism, run.mechanism, "they are")
    names = [name for name in derivatives if name not in derivatives.reduced]
    condition = _condition(mechanism, run.samples)
    chosen = np.unique(np.linspace(0, len(parameters) - 1, DESIGNS).round().astype(int))
    for k in chosen.tolist():
        address, p = list(parameters.items())[k]
        step, near = STEP * size_of(p, parameters.values()), {}
        try:
            for side in (-2, -1, 1, 2):
                design = remade(mechanism, {address: document_value(p, p.value + side * step)})
                near[side] = design._answer(run.samples, names, run.settings)
        except BlockmechError:  # at a bound
            continue
        for name in names:
            centre = np.asarray(run[name])
            y = {side: _nearest_turn(centre, near[side], name) for side in near}
            wide, narrow = (y[2] - y[-2]) / (4 * step), (y[1] - y[-1]) / (2 * step)
            slope = (4 * narrow - wide) / 3
            gap = np.abs(derivatives[name, address] - slope) - np.abs(slope - wide)
            smooth = ~(derivatives.kinks(name)[k] | derivatives.jumps[name][k]) & np.isfinite(gap)
            size = np.nanmax(np.abs(centre)) or 1.0
            error = float(np.max(gap * smooth, initial=0.0, where=smooth)) * step
            rows.append(Check(f"{name} by {address}", error / (size * condition)))
    return Verification(tuple(rows), run.n, condition)


def _nearest_turn(centre: Array, run: Result, name: str) -> Array:
    """An output (n,) of a design near by; angles without a turn more or less."""
    y = np.asarray(run[name])
    return y - math.tau * np.round((y - centre) / math.tau) if name.endswith("angle") else y


verify = _with_studies(verified)
"""`blockmech.analysis.verify.verify`, which takes studies and derivatives as well."""
