"""Why samples have no answer, as the error that a result with gaps becomes.

The first gap is reported: which group fails and where the drivers are there, whether it cannot
close, stands at a dead centre or locks itself, and on which arcs it would close. By how much a
group misses closing is told with the way, and with a slip of units that explains it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from math import inf, isfinite
from typing import Any, TypeAlias, cast

import numpy as np

from blockmech.blocks.contract import Block, Moving
from blockmech.blocks.modes import TwoModes
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
from blockmech.ground.values import MILLI, Marker, Place
from blockmech.model.structure import JointRef, Structure
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
from blockmech.typing import Arguments, Data

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
        reason = _unproved(result, first, block) or f"{method} did not converge"
        return FrictionError, status, reason
    if status in (SELF_LOCKED, JAMMED):
        flags = (f for f in quality.flags if f.sample == first and f.where == block)
        limit = next((flag.value for flag in flags), None)
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


Places: TypeAlias = Mapping[str, float]


def shortfall(mechanism: Any, block: str, drivers: Places, margin: float) -> str:
    """By how much a group misses closing at a place of the drivers [rad or m], in words.

    ``mechanism`` is a `Compiled`, which stands above; ``margin`` [-] is the group's there.
    """
    reason = _unreachable_distance(mechanism, block, drivers, margin)
    reason = reason or f"its margin is {margin:.4g}, 0 at a dead centre and negative beyond it"
    slip = _unit_slip(mechanism, block, drivers)
    return f"{reason}; {slip}" if slip else reason


def _unreachable_distance(mechanism: Any, block: str, drivers: Places, margin: float) -> str:
    structure: Structure = mechanism.structure
    dyad = structure.blocks[block]
    if not isinstance(dyad, TwoModes):
        return ""
    pins = [j.name for j in dyad.joints.values() if j.outer and j.kind == "R"]
    ends = [f"{structure.feeds[JointRef(block, pin)]}.p" for pin in pins]
    run = _run_at(mechanism._of_blocks, drivers, ends)
    apart = abs(complex(run[ends[0]][0]) - complex(run[ends[-1]][0]))
    description, x, low, high = dyad.reach(apart, margin)
    if not isfinite(x) or low <= x <= high:
        return ""
    names = [mechanism._joint_names.get(f"{block}.{pin}", pin) for pin in pins]
    reach = f"at least {low:.6g} m" if high == inf else f"at most {high:.6g} m"
    reach = f"{low:.6g} to {high:.6g} m" if low > 0 and high < inf else reach
    by, direction = (x - high, "large") if x > high else (low - x, "small")
    length = f"{description.format(*names)} is {x:.6g} m"
    return f"{length}, {by:.4g} m too {direction}: its lengths allow {reach}"


def _run_at(mechanism: Any, drivers: Places, want: list[str]) -> Any:
    still = dict.fromkeys(drivers, 0.0)
    return mechanism.run(at=drivers, rates=still, want=want, friction="none", on_gap="mark")


def _unit_slip(mechanism: Any, block: str, drivers: Places) -> str:
    """The one length, or lengths of one block, that let the group close in mm or m instead.

    A slip shows in that the lengths of a mechanism are more alike without it. Groups that are
    followed from a home are as they are: their homes are lengths as well.
    """
    structure: Structure = mechanism.structure
    above = {n: b for n, b in structure.blocks.items() if n in structure.ancestors(block)}
    blocks: dict[str, Block] = {structure.frame: structure.fixed, **above}
    ranges = {name: _range(b) for name, b in blocks.items()}
    spread, tried = _spread(ranges), []
    for name, original in blocks.items():
        if not (isinstance(original, Moving) and original.own_form):
            for factor, times in MILLI.items():
                for lengths, scaled in _scaled(original, factor):
                    slip = f"{mechanism._block_name(name)}{lengths} {times}"
                    tried.append((_spread({**ranges, name: _range(scaled)}), slip, name, scaled))
    alike = sorted((x for x in tried if x[0] < spread), key=lambda x: x[0])
    followed = any(b.own_form for b in above.values())  # which takes longer
    for _, lengths, name, scaled in alike[: 1 if followed else SEARCHED]:
        if name == structure.frame:
            changed = replace(structure, fixed=scaled)
        else:
            changed = replace(structure, blocks={**structure.blocks, name: cast(Moving, scaled)})
        variant = type(mechanism)(changed, mechanism._of_blocks.scene, mechanism.name)
        if float(_run_at(variant, drivers, [f"{block}.margin"])[f"{block}.margin"][0]) > 0:
            return f"it would close with {lengths}: is that in mm? Lengths are in m"
    return ""


def _scaled(block: Block, factor: float) -> Iterator[tuple[str, Block]]:
    """A block with one of its lengths by a factor, and with all, its markers among them."""
    lengths = _lengths(block)
    for name, x in lengths.items() if len(lengths) > 1 else ():
        yield f".{name}", block.model_copy(update={name: factor * x})
    update: Arguments = {name: factor * x for name, x in lengths.items()}
    if isinstance(block, Moving):
        links = block.links.items()
        update["links"] = {k: link.model_copy(update=_markers(link, factor)) for k, link in links}
    else:
        update |= _markers(block, factor)
    names = " and ".join(lengths) or "markers"
    yield f".{names}", block.model_copy(update=update)


def _lengths(block: Block) -> dict[str, float]:
    names = block.lengths if isinstance(block, Moving) else ()
    return {name: x for name in names if (x := getattr(block, name))}


def _markers(owner: Any, factor: float) -> Data:
    markers = owner.markers.items()
    return {"markers": {k: m.model_copy(update={"at": Place(factor * m.at.z)}) for k, m in markers}}


def _range(block: Block) -> tuple[float, float]:
    """The smallest length [m] of a block and its markers that is not zero, and the largest."""
    placed = [abs(m.at.z) for _, m in block.all_markers.values() if isinstance(m, Marker)]
    sizes = [x for x in (*map(abs, _lengths(block).values()), *placed) if x]
    return min(sizes, default=inf), max(sizes, default=0.0)


def _spread(ranges: Mapping[str, tuple[float, float]]) -> float:
    """The largest length of some blocks by the smallest."""
    smallest, largest = zip(*ranges.values(), strict=True)
    return float(max(largest) / min(smallest))
