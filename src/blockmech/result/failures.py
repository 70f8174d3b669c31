"""Why samples have no answer, as the error that a result with gaps becomes.

The first gap is reported: which group fails and where the drivers are there, whether it cannot
close, stands at a dead centre or locks itself, and on which arcs it would close.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from blockmech.ground.errors import (
    AssemblyError,
    FrictionError,
    Problem,
    SampleError,
    SampleFailure,
    SingularError,
    listed,
    refused,
)
from blockmech.ground.limits import SEARCHED
from blockmech.model.structure import JointRef
from blockmech.passes.homotopy import followed, last_good, path_of
from blockmech.result.quality import (
    CHANGE_POINT,
    DEAD_CENTRE,
    JAMMED,
    NO_ASSEMBLY,
    SELF_LOCKED,
    UNDEFINED,
)
from blockmech.result.result import Result
from blockmech.result.samples import Samples
from blockmech.result.shortfall import shortfall

ACTIONS = (".couple", ".force")  # outputs of a load


def without_gaps(result: Result, on_gap: str) -> Result:
    """The result; one with gaps raises, is handed out or is cut before the first of them."""
    if on_gap not in ("raise", "mark", "stop"):
        valid = "valid: raise, mark, stop"
        raise refused("on_gap", f"got {on_gap!r}", valid=valid, code="bad-value")
    if on_gap == "mark" or result._surely_whole():
        return result
    gaps = result.quality.gaps
    if not gaps:
        return result
    if on_gap == "raise":
        raise failure_of(result)
    return result.isel(slice(gaps[0]))


def failure_of(result: Result) -> SampleError:
    """The error of a result that has gaps, about the first of them."""
    quality, mechanism = result.quality, result.mechanism
    first = quality.gaps[0]
    block = quality.blame[first]
    same = [i for i in quality.gaps if quality.blame[i] == block]
    drivers = {name: float(q[first]) for name, q in result.drivers.items()}
    margin = float(quality.margin[block][first]) if block in quality.margin else float("nan")
    failing = mechanism._block_name(block) if block else "mechanism"
    error, code, reason = _what(result, first, block, margin, drivers)
    count = f"{len(same)} of {result.n} samples" if len(same) > 1 else "one sample"
    return error(
        Problem(
            code,
            f"{failing} at {result._place(first)} (sample {first} of {result.n})",
            f"{reason}; {count} affected",
            _arcs(result, first) if block and error is not FrictionError else "",
            'choose other samples, or pass on_gap="mark" to keep the rest',
        ),
        SampleFailure(block, same, drivers, margin),
    )


def why_not(result: Result) -> str:
    """Why the first sample without an answer has none, in words."""
    (problem,) = failure_of(result).problems
    return str(replace(problem, remedy=""))


def _unproved(result: Result, first: int, block: str) -> str:
    """What is missing where laws are not linear in the load and no certificate holds, if so."""
    certificate = result.quality.contraction[block][first]
    structure, names = result.mechanism.structure, result.mechanism._joint_names
    pairs = [JointRef(block, joint) for joint in structure.block(block).friction]
    of = [str(ref) for ref in pairs if structure.friction_law(ref).reads_load]
    if not of or certificate < 1.0:
        return ""
    why = f"friction of {listed(names.get(x, x) for x in of)} is not linear in the load"
    return f"no proof that there is one solution: {why}, certificate {certificate:.4g} (valid: < 1)"


def _what(
    result: Result, first: int, block: str, margin: float, drivers: Mapping[str, float]
) -> tuple[type[SampleError], str, str]:
    """Error, code and words for what fails at a sample."""
    quality = result.quality
    status = quality.status[first]
    if status == "not-converged":
        by = {"single": "a single correction", "successive": "successive approximations"}
        method = by.get(str(result.settings["friction"]), "continuation")
        return (
            FrictionError,
            status,
            _unproved(result, first, block) or f"{method} did not converge",
        )
    if status in (SELF_LOCKED, JAMMED):
        limit = next(
            (f.value for f in quality.flags if f.sample == first and f.where == block), None
        )
        reach = f" (solvable up to {limit:.4g} times the friction)" if limit else ""
        return FrictionError, status, f"no solution is connected with zero friction{reach}"
    if status != NO_ASSEMBLY:
        silent = loads_without_value(result.mechanism, result.samples.at(np.array([first])))
        lost = {
            CHANGE_POINT: "its two modes meet there, rates and reactions are limits of 0/0",
            DEAD_CENTRE: "rates and reactions do not exist there",
            UNDEFINED: f"{listed(silent) or 'a wanted output'} has no value there",
        }[status]
        if block and result.mechanism.structure.blocks[block].kind == "PRP":
            lost = "its guides are parallel, so no pose, rate or reaction exists there"
        return SingularError, status, lost
    if np.isnan(margin):
        why = "its outer joints coincide"
    else:
        coordinates = dict(zip(result.mechanism.drivers, drivers.values(), strict=True))
        why = shortfall(result.mechanism, block, coordinates, margin)
    reached = _came_as_far(result.mechanism, block, drivers) if margin < 0 else ""
    return AssemblyError, status, f"the group cannot close, {why}{reached}"


def loads_without_value(mechanism: Any, samples: Samples) -> list[str]:
    """Loads that have no value at samples in a good pose: beyond the end of a table, say."""
    load_outputs = {
        name: [o for o in mechanism.outputs if o.startswith(f"{name}.") and o.endswith(ACTIONS)]
        for name in mechanism.structure.elements
    }
    every = [output for outputs in load_outputs.values() for output in outputs]
    if not every:
        return []
    result = mechanism._answer(samples, every, {"friction": "none", "static": False})
    good = np.ones(samples.n, bool)
    for margin in result.quality.margin.values():
        good &= np.broadcast_to(margin, good.shape) > 0

    def silent(output: str) -> bool:
        return bool(np.isnan(np.broadcast_to(result[output].T, good.shape)[good]).any())

    return [name for name, outputs in load_outputs.items() if any(map(silent, outputs))]


def _came_as_far(mechanism: Any, block: str, drivers: Mapping[str, float]) -> str:
    """Where the way from home of a group without closed form ends, in words."""
    if not mechanism.structure.blocks[block].own_form:
        return ""
    path = path_of(mechanism.structure, block)
    q = [drivers[mechanism._of_driver(name, "q")] for name in path.drivers]
    coordinates = []
    for name, x in zip(path.drivers, last_good(path, np.array(q)), strict=True):
        unit = mechanism.structure.driver_joint(name).coordinate_unit
        coordinates.append(f"{name} = {x:.9g} {unit}")
    return f"; followed from its home it comes as far as {', '.join(coordinates)}"


def _arcs(result: Result, sample: int) -> str:
    """Where the groups of this run close, in words, if that is found in an instant.

    Of several drivers each is moved by itself, the others held as in the sample.
    """
    mechanism = result.mechanism
    groups, drivers = frozenset(result.quality.margin), mechanism.drivers
    if len(groups) > SEARCHED:
        return ""
    if len(drivers) == 1:
        return str(mechanism._feasible(groups))
    if followed(mechanism.structure):
        return ""  # each sample of an arc would be followed from home by itself
    coordinates = {
        d: float(q[sample]) for d, q in zip(drivers, result.drivers.values(), strict=True)
    }
    return str(mechanism._feasible(groups, coordinates))
