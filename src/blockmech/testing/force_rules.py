"""Rules 6 and 10 of a block: its reactions, and the balances of a mechanism around it."""

from __future__ import annotations

from collections.abc import Iterator

from blockmech.testing import rig
from blockmech.testing.batches import leaves, vectors
from blockmech.testing.block_trial import BlockTrial, X, Y
from blockmech.typing import Load, Slide


def forces(trial: BlockTrial) -> Iterator[str]:
    """Reactions carry the joints' names, and are linear in the loads."""
    one, two = trial.loads(1), trial.loads(2)
    found = trial.subject.call("reactions", trial.pose, *one)
    for joint in trial.block.joints.values():
        wanted = "Slide" if joint.kind == "P" else "force"
        reaction = getattr(found, joint.name, None)
        if reaction is None or (joint.kind == "P") != isinstance(reaction, Slide):
            yield f"reactions returns no {wanted} named {joint.name}"
    for joint in trial.block.driven:
        effort = trial.block.effort_field(joint.name)
        if not hasattr(found, effort):
            yield f"reactions returns no {effort} for the driven joint {joint.name}"
    both = [
        Load(rig.planar(X * vectors(a.F) + Y * vectors(b.F)), X * a.M + Y * b.M)
        for a, b in zip(one, two, strict=True)
    ]
    a, b, c = (leaves(trial.subject.call("reactions", trial.pose, *x)) for x in (one, two, both))
    yield from trial.linear("reactions", a, b, c, X, Y)


def balances(trial: BlockTrial) -> Iterator[str]:
    """Links balance, wires' powers balance, the two routes to each drive agree."""
    for friction in (False, True):
        how = "with friction" if friction else "without friction"
        mechanism = rig.rig(trial.block, trial.size, friction)
        found = mechanism.verify(**rig.request(trial.motions, trial.size))
        if not found.samples:
            yield f"no sample has an answer {how}"
        for row in found.rows:
            trial.measured[f"{row.name} {how}"] = row.value
            if not row.ok:
                yield f"{row.name} {how} is off by {row.value:.1e} of its terms"
