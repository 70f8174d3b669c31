"""Rules 3 to 5 of a block: places, rates and accelerations, against joints and differences."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blockmech.blocks.contract import AssurGroup
from blockmech.testing import rig
from blockmech.testing.batches import (
    Leaves,
    chosen,
    combined,
    count,
    halfway,
    largest,
    leaves,
    vectors,
)
from blockmech.testing.block_trial import BlockTrial, X, Y
from blockmech.testing.rig import Motions
from blockmech.testing.rules import DERIVATIVE, derivative
from blockmech.typing import LinkAcceleration, LinkPosition, LinkVelocity

Array = NDArray[Any]

EDGE = 1e-6  # [-] margin where a group just closes, after bisection to rounding


def positions(trial: BlockTrial) -> Iterator[str]:
    """Links are placed so that all joints close; the margin tells how well."""
    for link in trial.block.link_names:
        place = getattr(trial.pose, link, None)
        if not isinstance(place, LinkPosition):
            yield f"position returns no LinkPosition named {link}"
            return
        length = abs(vectors(place.e))
        yield from trial.same(f"length of the direction of link {link}", length, 1.0, 1.0)
    scale = trial.size + largest(leaves(trial.pose))
    for what, gap, unit in trial.closure.gaps(trial.pose, trial.motions):
        yield from trial.same(what, gap, 0.0, scale if unit == "m" else 1.0)
    if isinstance(trial.block, AssurGroup):
        yield from _margin(trial)


def _margin(trial: BlockTrial) -> Iterator[str]:
    pose = leaves(trial.subject.position(trial.every))
    if "margin" not in pose:
        yield "position of a group returns no margin"
        return
    margin = np.broadcast_to(pose["margin"], (count(trial.every),))
    closed = trial.closed(trial.every)
    if np.any(margin > 1 + 1e-12):
        yield f"the margin is {np.nanmax(margin):.3g}, above 1"
    if np.any(closed & ~(margin >= 0)):
        yield "the margin is not positive where the group closes"
    if np.any(~closed & (margin > 0)):
        yield "the margin is positive where the group does not close"
    good, bad = np.flatnonzero(closed)[:100], np.flatnonzero(~closed)[:100]
    n = min(len(good), len(bad))
    if n:
        low, high = rig.only(trial.every, good[:n]), rig.only(trial.every, bad[:n])
        for _ in range(60):  # to the edge, to rounding
            middle = halfway(low, high)
            inside = trial.closed(middle)
            low, high = chosen(inside, middle, low), chosen(inside, high, middle)
        for where, motions in (("inside", low), ("outside", high)):
            m = leaves(trial.subject.position(motions))["margin"]
            if not np.all(abs(m) < EDGE):
                yield f"the margin is not near 0 just {where} the edge where the group closes"


def velocities(trial: BlockTrial) -> Iterator[str]:
    """Velocity is the derivative of position, and linear in the velocities it gets."""
    vel = trial.subject.velocity(trial.motions)
    for link in trial.block.link_names:
        if not isinstance(getattr(vel, link, None), LinkVelocity):
            yield f"velocity returns no LinkVelocity named {link}"
            return
    for joint in trial.closure.slides:
        if not hasattr(vel, joint.name):
            yield f"velocity returns no sliding rate named {joint.name}"
            return
    speed = trial.size + trial.speed(vel)
    slopes = derivative(lambda t: _places(trial, rig.after(trial.motions, t)))
    for name, slope in slopes.items():
        found, scale = _rate(trial, vel, name), speed
        if name.endswith(".e"):
            scale = speed / trial.size
        yield from trial.same(f"velocity of {name}", found, slope, scale, DERIVATIVE)

    def call(rates: Motions) -> Leaves:
        return leaves(
            trial.subject.call("velocity", trial.pose, *trial.subject.arguments("velocity", rates))
        )

    both = combined(trial.motions, trial.other, X, Y)
    yield from trial.linear("velocity", call(trial.motions), call(trial.other), call(both), X, Y)


def _places(trial: BlockTrial, motions: Motions) -> dict[str, Array]:
    """What moves: origins and directions of links, strokes of prismatic pairs."""
    pose = trial.subject.position(motions)
    found = {}
    for link in trial.block.link_names:
        place = getattr(pose, link)
        found[f"{link}.o"], found[f"{link}.e"] = vectors(place.o), vectors(place.e)
    for joint in trial.closure.slides:
        found[joint.name] = trial.closure.stroke(pose, joint, motions)
    return found


def _rate(trial: BlockTrial, vel: Any, name: str) -> Array:
    """What the velocity kernel says of the rate of such a place."""
    link, _, what = name.partition(".")
    if not what:
        return np.asarray(getattr(vel, link))
    if what == "o":
        return vectors(getattr(vel, link).v)
    e = vectors(getattr(trial.pose, link).e)
    return 1j * np.asarray(getattr(vel, link).om) * e


def accelerations(trial: BlockTrial) -> Iterator[str]:
    """Acceleration is the derivative of velocity, and affine in what it gets."""
    acc, vel = trial.subject.acceleration(trial.motions), trial.subject.velocity(trial.motions)
    for link in trial.block.link_names:
        if not isinstance(getattr(acc, link, None), LinkAcceleration):
            yield f"acceleration returns no LinkAcceleration named {link}"
            return

    def rates(t: float) -> dict[str, Array]:
        moved = leaves(trial.subject.velocity(rig.after(trial.motions, t)))
        return {n: x for n, x in moved.items() if n.split(".")[0] in trial.block.link_names}

    found = leaves(acc)
    scale = trial.size + trial.speed(vel) + largest(found) * max(1.0, trial.size)
    for name, slope in derivative(rates).items():
        link, what = name.split(".")
        value = found[f"{link}.{'a' if what == 'v' else 'al'}"]
        unit = scale if what == "v" else scale / trial.size
        yield from trial.same(f"acceleration of {name}", value, slope, unit, DERIVATIVE)

    def call(given: Motions) -> Leaves:
        arguments = trial.subject.arguments("acceleration", given)
        return leaves(trial.subject.call("acceleration", trial.pose, vel, *arguments))

    both = combined(trial.motions, trial.other, X, 1 - X)
    one, two = call(trial.motions), call(trial.other)
    yield from trial.linear("acceleration", one, two, call(both), X, 1 - X)
