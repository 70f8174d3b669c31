"""The numbered rules of a block with links, tested on random motions in which it closes.

The rules stand at the head of `blockmech.blocks.contract`. Kernels are called with
motions of their joints and held against each other and against differences; the rig
(`blockmech.testing.rig`) puts the block into a mechanism for the rest.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blockmech.blocks.contract import AssurGroup, Moving
from blockmech.ground.limits import CHECKED
from blockmech.ground.tolerances import BLUR
from blockmech.testing.rig import (
    STAGES,
    Subject,
    after,
    random_loads,
    random_motions,
    request,
    rig,
)
from blockmech.testing.rules import (
    DERIVATIVE,
    Checks,
    ConformanceError,
    Leaves,
    as_number,
    derivative,
    finite,
    largest,
    leaves,
    planar,
    same_bits,
    spoilt,
    vectors,
)
from blockmech.typing import (
    Arguments,
    Array,
    Complex,
    LinkAcceleration,
    LinkPosition,
    LinkVelocity,
    Load,
    Nested,
    Slide,
    Values,
)

X, Y = 0.7, -1.3  # factors of a linear combination


class BlockRules(Checks):
    """Rules 1 to 10 of a block with links.

    Attributes
    ----------
    subject : the block's kernels, to be called with motions
    size : [m] of its motions: its largest length, scaled until it closes
    every, motions : random motions, and slow ones of them in which the block closes well
    pose : of ``motions``
    """

    def __init__(self, block: Moving, seed: int = 0) -> None:
        super().__init__()
        self.block = block
        self.subject = Subject(block)
        self.size = block.largest_length() or 1.0
        self.every, self.motions = self._closing(seed)
        self.pose = self.subject.position(self.motions)

    def _closing(self, seed: int) -> tuple[Array, Array]:
        """Random motions, and slow ones of them, which differences resolve, that close well."""
        unclosed = f"{type(self.block).__name__} breaks its contract\nrule 3 (joints close):"
        for scale in (1.0, 3.0, 0.3, 10.0, 0.1):
            motions = random_motions(self.block, 4000, scale * self.size, seed)
            try:
                pose = leaves(self.subject.position(motions))
            except Exception as error:  # a broken kernel may fail in any way
                message = f"{unclosed} position raised {type(error).__name__}: {error}"
                raise ConformanceError(message) from error
            good = finite(pose)
            if isinstance(self.block, AssurGroup) and "margin" in pose:
                margin = np.broadcast_to(pose["margin"], good.shape)
                good = good & (margin >= 0.5 * np.max(margin, initial=0.0, where=good))
            if good.sum() >= 4 * CHECKED:
                self.size *= scale
                well = motions[..., good]
                try:
                    speed = self._speeds(self.subject.velocity(well))
                except Exception:  # the rule on velocities will say why
                    speed = np.zeros(well.shape[-1])
                return motions, well[..., speed <= np.quantile(speed, 0.25)][..., :CHECKED]
        raise ConformanceError(
            f"{unclosed} no pose was found in which the block closes: position is wrong, "
            "or the example hardly ever closes"
        )

    def _speeds(self, vel: Values) -> Array:
        """Largest speed (n,) [m/s] of links and slides, rates counted at the block's size."""
        speeds = [abs(x) * (self.size if n.endswith("om") else 1.0) for n, x in leaves(vel).items()]
        return np.asarray(np.max(np.broadcast_arrays(*speeds), axis=0))

    def _closed(self, motions: Array) -> NDArray[np.bool_]:
        """Whether the block closes (n,)."""
        pose = leaves(self.subject.position(motions))
        pose_of_links = {n: x for n, x in pose.items() if n.split(".")[0] in self.block.link_names}
        return np.broadcast_to(finite(pose_of_links), motions.shape[-1:])

    # -- 1, 2, 7, 8, 9: how kernels are called ---------------------------------------------

    def _arguments(self, stage: str, samples: slice = slice(None)) -> list[Complex]:
        """What a kernel gets (but the parameters) at some samples."""
        motions = self.motions[..., samples]
        if stage == "position":
            return self.subject.arguments(stage, motions)
        pose = self.subject.position(motions)
        if stage == "reactions":
            loads = random_loads(self.block, CHECKED, self.size, 3)
            return [pose, *(Load(planar(vectors(x.F)[samples]), x.M[samples]) for x in loads)]
        before = [self.subject.velocity(motions, pose)] if stage == "acceleration" else []
        return [pose, *before, *self.subject.arguments(stage, motions)]

    def _names(self, stage: str) -> list[str]:
        return list(inspect.signature(getattr(self.block.kernels, stage)).parameters)

    def inputs(self) -> Iterator[str]:
        """Kernels name what they get, in the order of the joints."""
        for stage in ("position", "velocity", "acceleration"):
            names = self._names(stage)[STAGES[stage] :]
            for joint, name in zip(self.subject.outer, names, strict=False):
                if name.rsplit("_", 1)[-1] != joint.name:
                    yield f"{stage} calls what joint {joint.name} reads {name}"

    def outputs(self) -> Iterator[str]:
        """Calling again gives the same bits, and leaves the inputs alone."""
        for stage in STAGES:
            arguments = self._arguments(stage)
            before = leaves(tuple(arguments))
            once, again = (leaves(self.subject.call(stage, *arguments)) for _ in range(2))
            now = leaves(tuple(arguments))
            if not all(same_bits(before[name], now[name]) for name in now):
                yield f"{stage} changes its inputs"
            if not all(same_bits(once[name], again[name]) for name in again):
                yield f"{stage} gives another answer to the same inputs"

    def batches(self) -> Iterator[str]:
        """Any batch shape gives the same numbers, for samples and for designs."""
        designs = type(self.subject.p)(*(np.full((3, 1), x) for x in self.subject.p))
        for stage in STAGES:
            batch = leaves(self.subject.call(stage, *self._arguments(stage)))
            for k in (0, CHECKED // 2):
                arguments = self._arguments(stage, slice(k, k + 1))
                alone = leaves(self.subject.call(stage, *arguments))
                kernel = getattr(self.block.kernels, stage)
                scalar = leaves(kernel(*map(as_number, arguments), self.subject.p))
                for name, x in batch.items():
                    value = np.broadcast_to(x, CHECKED)[k]
                    if not same_bits(value, np.broadcast_to(alone[name], 1)[0]):
                        yield f"{stage} {name} of a sample alone is not the same as in a batch"
                    label = f"scalar {stage} {name} against a batch"
                    yield from self.same(label, scalar[name], value, float(np.max(abs(x))) or 1.0)
            many = leaves(self.subject.call(stage, *self._arguments(stage), p=designs))
            for name, x in many.items():
                shape = np.broadcast_shapes(x.shape, (3, CHECKED))
                if shape != (3, CHECKED) or not same_bits(x, batch[name]):
                    yield f"{stage} {name} of equal designs (3, 1) is not that of one design"

    def not_a_number(self) -> Iterator[str]:
        """What depends on a NaN is NaN."""
        p = self.subject.p
        for stage in STAGES:
            inputs, names = self._arguments(stage), self._names(stage)
            batch = leaves(self.subject.call(stage, *inputs))
            cases = [
                (
                    f"{names[k]}.{part}" if part else names[k],
                    [*inputs[:k], bad, *inputs[k + 1 :]],
                    p,
                )
                for k in range(STAGES[stage], len(inputs))
                for bad, part in spoilt(inputs[k])
            ]
            cases += [(name, inputs, p._replace(**{name: np.nan})) for name in p._fields]
            for label, arguments, numbers in cases:
                values = leaves(self.subject.call(stage, *arguments, p=numbers))
                for name, x in values.items():
                    if not np.all(np.isnan(x)) and not same_bits(x, batch[name]):
                        yield f"{stage} {name} depends on {label}, but is not NaN with it"

    def impossible(self) -> Iterator[str]:
        """Impossible samples are NaN in both engines, and touch no neighbour."""
        bad = self.every[..., ~self._closed(self.every)][..., :10]
        worst = self.motions[..., :1].copy()  # all joints in one point and one direction
        worst[: 2 * len(self.subject.outer), 0] = 0.0
        every = np.concatenate([self.motions, bad, worst], axis=-1)
        mechanism = rig(self.block, self.size, friction=False)

        def run(motions: Array, engine: Any) -> Any:
            motion = request(self.subject, motions, self.size)
            settings: Arguments = {"want": ("block.*",), "friction": "none", "on_gap": "mark"}
            return mechanism.run(**motion, **settings, engine=engine)

        scalar, batch, alone = run(every, "scalar"), run(every, "numpy"), run(self.motions, "numpy")
        yield from self.arithmetic(batch._plan.program)
        for name in batch:
            single, several = np.asarray(scalar[name]), np.asarray(batch[name])
            if single.shape and not np.array_equal(np.isnan(single), np.isnan(several)):
                yield f"the engines do not agree on where {name} exists"
            if single.shape and not same_bits(several[:CHECKED], np.asarray(alone[name])):
                yield f"{name} changes when impossible samples stand beside it"

    # -- 3 to 5: places, rates and accelerations -------------------------------------------

    def _returned(self, stage: str, returned: Nested, kind: type) -> str:
        """What is missing from what a kernel returns."""
        for link in self.block.link_names:
            if not isinstance(getattr(returned, link, None), kind):
                return f"{stage} returns no {kind.__name__} named {link}"
        return ""

    def positions(self) -> Iterator[str]:
        """Links are placed so that all joints close; the margin tells how well."""
        if missing := self._returned("position", self.pose, LinkPosition):
            yield missing
            return
        for link in self.block.link_names:
            length = abs(vectors(getattr(self.pose, link).e))
            yield from self.same(f"length of the direction of link {link}", length, 1.0, 1.0)
        scale = self.size + largest(leaves(self.pose))
        for label, gap, unit in self.subject.gaps(self.pose, self.motions):
            yield from self.same(label, gap, 0.0, scale if unit == "m" else 1.0)
        if isinstance(self.block, AssurGroup):
            yield from self._margin()

    def _margin(self) -> Iterator[str]:
        pose = leaves(self.subject.position(self.every))
        if "margin" not in pose:
            yield "position of a group returns no margin"
            return
        margin = np.broadcast_to(pose["margin"], self.every.shape[-1:])
        closed = self._closed(self.every)
        if np.any(margin > 1 + 1e-12):
            yield f"the margin is {np.nanmax(margin):.3g}, above 1"
        if np.any(closed & ~(margin >= 0)):
            yield "the margin is not positive where the group closes"
        if np.any(~closed & (margin > 0)):
            yield "the margin is positive where the group does not close"
        good, bad = self.every[..., closed], self.every[..., ~closed]
        n = min(good.shape[-1], bad.shape[-1], 100)
        if not n:
            return
        low, high = good[..., :n], bad[..., :n]
        for _ in range(60):  # to the edge, to rounding
            middle = (low + high) / 2
            inside = self._closed(middle)
            low, high = np.where(inside, middle, low), np.where(inside, high, middle)
        for where, motions in (("inside", low), ("outside", high)):
            m = leaves(self.subject.position(motions))["margin"]
            if not np.all(abs(m) < BLUR):
                yield f"the margin is not near 0 just {where} the edge where the group closes"

    def velocities(self) -> Iterator[str]:
        """Velocity is the derivative of position, and so linear in the velocities it gets."""
        vel = self.subject.velocity(self.motions)
        if missing := self._returned("velocity", vel, LinkVelocity):
            yield missing
            return
        rates = {}
        for joint in self.subject.slides:
            if not hasattr(vel, joint.name):
                yield f"velocity returns no sliding rate named {joint.name}"
                return
            rates[joint.name] = np.asarray(getattr(vel, joint.name))
        for link in self.block.link_names:
            moved, e = getattr(vel, link), vectors(getattr(self.pose, link).e)
            rates |= {f"{link}.o": vectors(moved.v), f"{link}.e": 1j * np.asarray(moved.om) * e}
        speed = self.size + float(np.max(self._speeds(vel)))
        yield from self._derivative("velocity", rates, self._coordinates, speed)

    def accelerations(self) -> Iterator[str]:
        """Acceleration is the derivative of velocity, and so affine in what it gets."""
        vel = self.subject.velocity(self.motions)
        acc = self.subject.acceleration(self.motions, self.pose, vel)
        if missing := self._returned("acceleration", acc, LinkAcceleration):
            yield missing
            return
        values, links = leaves(acc), self.block.link_names
        rates = {
            f"{k}.{v}": values[f"{k}.{a}"] for k in links for v, a in (("v", "a"), ("om", "al"))
        }
        scale = self.size + float(np.max(self._speeds(vel)))
        scale += largest(values) * max(1.0, self.size)
        yield from self._derivative(
            "acceleration", rates, lambda m: leaves(self.subject.velocity(m)), scale
        )

    def _coordinates(self, motions: Array) -> dict[str, Array]:
        """What moves: origins and directions of links, strokes of prismatic pairs."""
        pose = self.subject.position(motions)
        coordinates = {j.name: self.subject.stroke(pose, j, motions) for j in self.subject.slides}
        for link in self.block.link_names:
            link_pose = getattr(pose, link)
            coordinates |= {
                f"{link}.o": vectors(link_pose.o),
                f"{link}.e": vectors(link_pose.e),
            }
        return coordinates

    def _derivative(
        self, stage: str, rates: Leaves, values: Callable[[Array], Leaves], scale: float
    ) -> Iterator[str]:
        """Rates against differences of values; those of turning count at the block's size."""
        slopes = derivative(lambda t: values(after(self.motions, t)))
        for name, rate in rates.items():
            unit = scale / self.size if name.endswith((".e", ".om")) else scale
            yield from self.same(f"{stage} of {name}", rate, slopes[name], unit, DERIVATIVE)

    # -- 6 and 10: forces ------------------------------------------------------------------

    def forces(self) -> Iterator[str]:
        """Reactions carry the joints' names, and are linear in the loads."""
        loads_1, loads_2 = (random_loads(self.block, CHECKED, self.size, seed) for seed in (1, 2))
        reactions = self.subject.call("reactions", self.pose, *loads_1)
        for joint in self.block.joints.values():
            expected_type = "Slide" if joint.kind == "P" else "force"
            reaction = getattr(reactions, joint.name, None)
            if reaction is None or (joint.kind == "P") != isinstance(reaction, Slide):
                yield f"reactions returns no {expected_type} named {joint.name}"
        for joint in self.block.driven:
            effort = self.block.effort_field(joint.name)
            if not hasattr(reactions, effort):
                yield f"reactions returns no {effort} for the driven joint {joint.name}"
        both = [
            Load(planar(X * vectors(a.F) + Y * vectors(b.F)), X * a.M + Y * b.M)
            for a, b in zip(loads_1, loads_2, strict=True)
        ]
        first, second, sum_ = (
            leaves(self.subject.call("reactions", self.pose, *loads))
            for loads in (loads_1, loads_2, both)
        )
        for name, a in first.items():
            scale = float(np.max(abs(a)) + np.max(abs(second[name]))) or 1.0
            label, combined = f"linearity of reactions {name}", X * a + Y * second[name]
            yield from self.same(label, sum_[name], combined, scale)

    def balances(self) -> Iterator[str]:
        """Links balance, wires' powers balance, the two routes to each drive agree."""
        motion = request(self.subject, self.motions, self.size)
        for friction in (False, True):
            case = " with friction" if friction else " without friction"
            yield from self.verified(rig(self.block, self.size, friction).verify(**motion), case)

    rules = (
        inputs,
        outputs,
        positions,
        velocities,
        accelerations,
        forces,
        batches,
        not_a_number,
        impossible,
        balances,
    )
