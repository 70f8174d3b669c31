"""Rules 1, 2 and 7 to 9 of a block: how its kernels take arguments, batches and no numbers."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from typing import Any

import numpy as np

from blockmech.testing import rig
from blockmech.testing.batches import (
    Leaves,
    as_number,
    at_sample,
    identical,
    joined,
    leaves,
    same_bits,
    spoilt,
)
from blockmech.testing.block_trial import SAMPLES, STAGES, BlockTrial
from blockmech.testing.rig import MarkerMotion, Motions


def inputs(trial: BlockTrial) -> Iterator[str]:
    """Kernels name what they get, in the order of the joints."""
    for stage in ("position", "velocity", "acceleration"):
        names = list(inspect.signature(getattr(trial.block.kernels, stage)).parameters)
        for joint, name in zip(trial.subject.outer, names[STAGES[stage] :], strict=False):
            if name.rsplit("_", 1)[-1] != joint.name:
                yield f"{stage} calls what joint {joint.name} reads {name}"


def outputs(trial: BlockTrial) -> Iterator[str]:
    """Calling again gives the same bits, and leaves the inputs alone."""
    for stage, arguments in trial.calls():
        given = arguments()
        before = leaves(tuple(given))
        once, again = (leaves(trial.subject.call(stage, *given)) for _ in range(2))
        if not identical(before, leaves(tuple(given))):
            yield f"{stage} changes its inputs"
        if not identical(once, again):
            yield f"{stage} gives another answer to the same inputs"


def batches(trial: BlockTrial) -> Iterator[str]:
    """Any batch shape gives the same numbers, for samples and for designs."""
    designs = type(trial.subject.p)(*(np.full((3, 1), x) for x in trial.subject.p))
    for stage, arguments in trial.calls():
        whole = leaves(trial.subject.call(stage, *arguments()))
        for k in (0, SAMPLES // 2):
            one = arguments(slice(k, k + 1))
            alone = leaves(trial.subject.call(stage, *one))
            scalar = leaves(_scalar(trial, stage, one))
            for name, x in whole.items():
                here = at_sample(x, k, SAMPLES)
                if not same_bits(here, at_sample(alone[name], 0, 1)):
                    yield f"{stage} {name} of a sample alone is not the same as in a batch"
                what = f"scalar {stage} {name} against a batch"
                yield from trial.same(what, scalar[name], here, float(np.max(abs(x))) or 1.0)
        many = leaves(trial.subject.call(stage, *arguments(), p=designs))
        for name, x in many.items():
            shape = np.broadcast_shapes(x.shape, (3, SAMPLES))
            if shape != (3, SAMPLES) or not same_bits(x, whole[name]):
                yield f"{stage} {name} of equal designs (3, 1) is not that of one design"


def _scalar(trial: BlockTrial, stage: str, arguments: list[Any]) -> Any:
    kernel = getattr(trial.block.kernels, stage)
    return kernel(*map(as_number, arguments), trial.subject.p)


def not_a_number(trial: BlockTrial) -> Iterator[str]:
    """What depends on a NaN is NaN."""
    for stage, arguments in trial.calls():
        given = arguments()
        whole = leaves(trial.subject.call(stage, *given))
        names = list(inspect.signature(getattr(trial.block.kernels, stage)).parameters)
        for k in range(STAGES[stage], len(given)):
            for bad, part in spoilt(given[k]):
                found = trial.subject.call(stage, *given[:k], bad, *given[k + 1 :])
                where = f"{names[k]}.{part}" if part else names[k]
                yield from _poisoned(trial, stage, where, whole, leaves(found))
        for name in trial.subject.p._fields:
            p = trial.subject.p._replace(**{name: np.nan})
            found = trial.subject.call(stage, *given, p=p)
            yield from _poisoned(trial, stage, name, whole, leaves(found))


def _poisoned(
    trial: BlockTrial, stage: str, what: str, whole: Leaves, found: Leaves
) -> Iterator[str]:
    for name, x in found.items():
        if not np.all(np.isnan(x)) and not same_bits(x, whole[name]):
            yield f"{stage} {name} depends on {what}, but is not NaN with it"


def impossible(trial: BlockTrial) -> Iterator[str]:
    """Impossible samples are NaN in both engines, and touch no neighbour."""
    mechanism = rig.rig(trial.block, trial.size, friction=False)
    settings: dict[str, Any] = {"want": ("block.*",), "friction": "none", "on_gap": "mark"}
    asked = rig.request(_with_impossible(trial), trial.size)
    scalar, batch = (
        mechanism.run(**asked, **settings, engine=engine) for engine in ("scalar", "numpy")
    )
    alone = mechanism.run(**rig.request(trial.motions, trial.size), **settings, engine="numpy")
    for name in batch:
        one, other = np.asarray(scalar[name]), np.asarray(batch[name])
        if one.shape and not np.array_equal(np.isnan(one), np.isnan(other)):
            yield f"the engines do not agree on where {name} exists"
        if one.shape and not same_bits(other[:SAMPLES], np.asarray(alone[name])):
            yield f"{name} changes when impossible samples stand beside it"


def _with_impossible(trial: BlockTrial) -> Motions:
    """Good samples, bad ones, and all joints in one point and one direction."""
    bad = np.flatnonzero(~trial.closed(trial.every))[:10]
    worst = {
        name: MarkerMotion(0j * m.p, 0 * m.phi, m.v, m.om, m.a, m.al)
        if isinstance(m, MarkerMotion)
        else m
        for name, m in rig.only(trial.motions, slice(0, 1)).items()
    }
    return joined([trial.motions, rig.only(trial.every, bad), worst])
