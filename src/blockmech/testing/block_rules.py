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
from blockmech.testing import rig
from blockmech.testing.batches import (
    Leaves,
    as_number,
    at_sample,
    chosen,
    combined,
    count,
    finite,
    halfway,
    identical,
    joined,
    largest,
    leaves,
    same_bits,
    spoilt,
    vectors,
)
from blockmech.testing.closure import Closure
from blockmech.testing.rig import MarkerMotion, Motions, Subject
from blockmech.testing.rules import DERIVATIVE, Checks, ConformanceError, derivative
from blockmech.typing import LinkAcceleration, LinkPosition, LinkVelocity, Load, Slide

Array = NDArray[Any]

SAMPLES = 24
STAGES = {"position": 0, "velocity": 1, "acceleration": 2, "reactions": 1}
"""Each kernel, and how many of its arguments come from earlier kernels."""
EDGE = 1e-6  # [-] margin where a group just closes, after bisection to rounding
X, Y = 0.7, -1.3  # factors of a linear combination


class BlockRules(Checks):
    """Rules 1 to 10."""

    def __init__(self, block: Moving, seed: int = 0) -> None:
        super().__init__()
        self.block = block
        self.subject = Subject(block)
        self.size = block.largest_length() or 1.0
        self.every, self.motions = self._closing(seed)
        self.other = rig.random_motions(block, SAMPLES, self.size, seed + 1)
        self.pose = self.subject.position(self.motions)
        self.closure = Closure(block)

    def _closing(self, seed: int) -> tuple[Motions, Motions]:
        """Random motions, and those of them in which the block closes well."""
        for scale in (1.0, 3.0, 0.3, 10.0, 0.1):
            motions = rig.random_motions(self.block, 4000, scale * self.size, seed)
            try:
                pose = leaves(self.subject.position(motions))
            except Exception as error:  # a broken kernel may fail in any way
                raise self._unclosed(f"position raised {type(error).__name__}: {error}") from error
            good = finite(pose)
            if isinstance(self.block, AssurGroup) and "margin" in pose:
                margin = np.broadcast_to(pose["margin"], good.shape)
                good = good & (margin >= 0.5 * np.max(margin, initial=0.0, where=good))
            found = np.flatnonzero(good)
            if len(found) >= 4 * SAMPLES:
                self.size *= scale
                return motions, self._slow(rig.only(motions, found))
        raise self._unclosed(
            "no pose was found in which the block closes: position is wrong, "
            "or the example hardly ever closes"
        )

    def _unclosed(self, why: str) -> ConformanceError:
        name = type(self.block).__name__
        return ConformanceError(
            f"{name} breaks its contract\nrule 3 (positions close the joints): {why}"
        )

    def _slow(self, motions: Motions) -> Motions:
        """Some of the slower quarter of the motions, which differences resolve."""
        try:
            speed = self._speeds(self.subject.velocity(motions))
        except Exception:  # the rule on velocities will say why
            speed = np.zeros(count(motions))
        return rig.only(motions, np.flatnonzero(speed <= np.quantile(speed, 0.25))[:SAMPLES])

    # -- what goes in --------------------------------------------------------------------

    def inputs(self) -> Iterator[str]:
        """Kernels name what they get, in the order of the joints."""
        for stage in ("position", "velocity", "acceleration"):
            names = list(inspect.signature(getattr(self.block.kernels, stage)).parameters)
            for joint, name in zip(self.subject.outer, names[STAGES[stage] :], strict=False):
                if name.rsplit("_", 1)[-1] != joint.name:
                    yield f"{stage} calls what joint {joint.name} reads {name}"

    def outputs(self) -> Iterator[str]:
        """Calling again gives the same bits, and leaves the inputs alone."""
        for stage, arguments in self._calls():
            given = arguments()
            before = leaves(tuple(given))
            once, again = (leaves(self.subject.call(stage, *given)) for _ in range(2))
            if not identical(before, leaves(tuple(given))):
                yield f"{stage} changes its inputs"
            if not identical(once, again):
                yield f"{stage} gives another answer to the same inputs"

    # -- kinematics ----------------------------------------------------------------------

    def positions(self) -> Iterator[str]:
        """Links are placed so that all joints close; the margin tells how well."""
        for link in self.block.link_names:
            place = getattr(self.pose, link, None)
            if not isinstance(place, LinkPosition):
                yield f"position returns no LinkPosition named {link}"
                return
            length = abs(vectors(place.e))
            yield from self.same(f"length of the direction of link {link}", length, 1.0, 1.0)
        scale = self.size + largest(leaves(self.pose))
        for what, gap, unit in self.closure.gaps(self.pose, self.motions):
            yield from self.same(what, gap, 0.0, scale if unit == "m" else 1.0)
        if isinstance(self.block, AssurGroup):
            yield from self._margin()

    def _margin(self) -> Iterator[str]:
        pose = leaves(self.subject.position(self.every))
        if "margin" not in pose:
            yield "position of a group returns no margin"
            return
        margin = np.broadcast_to(pose["margin"], (count(self.every),))
        closed = self._closed(self.every)
        if np.any(margin > 1 + 1e-12):
            yield f"the margin is {np.nanmax(margin):.3g}, above 1"
        if np.any(closed & ~(margin >= 0)):
            yield "the margin is not positive where the group closes"
        if np.any(~closed & (margin > 0)):
            yield "the margin is positive where the group does not close"
        good, bad = np.flatnonzero(closed)[:100], np.flatnonzero(~closed)[:100]
        n = min(len(good), len(bad))
        if n:
            low, high = rig.only(self.every, good[:n]), rig.only(self.every, bad[:n])
            for _ in range(60):  # to the edge, to rounding
                middle = halfway(low, high)
                inside = self._closed(middle)
                low, high = chosen(inside, middle, low), chosen(inside, high, middle)
            for where, motions in (("inside", low), ("outside", high)):
                m = leaves(self.subject.position(motions))["margin"]
                if not np.all(abs(m) < EDGE):
                    yield f"the margin is not near 0 just {where} the edge where the group closes"

    def _closed(self, motions: Motions) -> NDArray[np.bool_]:
        pose = leaves(self.subject.position(motions))
        places = {n: x for n, x in pose.items() if n.split(".")[0] in self.block.link_names}
        return np.broadcast_to(finite(places), (count(motions),))

    def velocities(self) -> Iterator[str]:
        """Velocity is the derivative of position, and linear in the velocities it gets."""
        vel = self.subject.velocity(self.motions)
        for link in self.block.link_names:
            if not isinstance(getattr(vel, link, None), LinkVelocity):
                yield f"velocity returns no LinkVelocity named {link}"
                return
        for joint in self.closure.slides:
            if not hasattr(vel, joint.name):
                yield f"velocity returns no sliding rate named {joint.name}"
                return
        speed = self.size + self._speed(vel)
        slopes = derivative(lambda t: self._places(rig.after(self.motions, t)))
        for name, slope in slopes.items():
            found, scale = self._rate(vel, name), speed
            if name.endswith(".e"):
                scale = speed / self.size
            yield from self.same(f"velocity of {name}", found, slope, scale, DERIVATIVE)

        def call(rates: Motions) -> Leaves:
            return leaves(
                self.subject.call("velocity", self.pose, *self.subject.arguments("velocity", rates))
            )

        both = combined(self.motions, self.other, X, Y)
        yield from self._linear("velocity", call(self.motions), call(self.other), call(both), X, Y)

    def _places(self, motions: Motions) -> dict[str, Array]:
        """What moves: origins and directions of links, strokes of prismatic pairs."""
        pose = self.subject.position(motions)
        found = {}
        for link in self.block.link_names:
            place = getattr(pose, link)
            found[f"{link}.o"], found[f"{link}.e"] = vectors(place.o), vectors(place.e)
        for joint in self.closure.slides:
            found[joint.name] = self.closure.stroke(pose, joint, motions)
        return found

    def _rate(self, vel: Any, name: str) -> Array:
        """What the velocity kernel says of the rate of such a place."""
        link, _, what = name.partition(".")
        if not what:
            return np.asarray(getattr(vel, link))
        if what == "o":
            return vectors(getattr(vel, link).v)
        e = vectors(getattr(self.pose, link).e)
        return 1j * np.asarray(getattr(vel, link).om) * e

    def _speed(self, vel: Any) -> float:
        """Largest speed [m/s] of links and slides."""
        return float(np.max(self._speeds(vel)))

    def _speeds(self, vel: Any) -> Array:
        """Largest speed (n,) [m/s], rates counted at the block's size."""
        found = [abs(x) * (self.size if n.endswith("om") else 1.0) for n, x in leaves(vel).items()]
        speeds: Array = np.max(np.broadcast_arrays(*found), axis=0)
        return speeds

    def accelerations(self) -> Iterator[str]:
        """Acceleration is the derivative of velocity, and affine in what it gets."""
        acc, vel = self.subject.acceleration(self.motions), self.subject.velocity(self.motions)
        for link in self.block.link_names:
            if not isinstance(getattr(acc, link, None), LinkAcceleration):
                yield f"acceleration returns no LinkAcceleration named {link}"
                return

        def rates(t: float) -> dict[str, Array]:
            moved = leaves(self.subject.velocity(rig.after(self.motions, t)))
            return {n: x for n, x in moved.items() if n.split(".")[0] in self.block.link_names}

        found = leaves(acc)
        scale = self.size + self._speed(vel) + largest(found) * max(1.0, self.size)
        for name, slope in derivative(rates).items():
            link, what = name.split(".")
            value = found[f"{link}.{'a' if what == 'v' else 'al'}"]
            unit = scale if what == "v" else scale / self.size
            yield from self.same(f"acceleration of {name}", value, slope, unit, DERIVATIVE)

        def call(given: Motions) -> Leaves:
            arguments = self.subject.arguments("acceleration", given)
            return leaves(self.subject.call("acceleration", self.pose, vel, *arguments))

        both = combined(self.motions, self.other, X, 1 - X)
        one, two = call(self.motions), call(self.other)
        yield from self._linear("acceleration", one, two, call(both), X, 1 - X)

    def _linear(
        self, stage: str, one: Leaves, two: Leaves, both: Leaves, x: float, y: float
    ) -> Iterator[str]:
        for name, a in one.items():
            scale = float(np.max(abs(a)) + np.max(abs(two[name]))) or 1.0
            yield from self.same(
                f"linearity of {stage} {name}", both[name], x * a + y * two[name], scale
            )

    # -- forces ----------------------------------------------------------------------------

    def forces(self) -> Iterator[str]:
        """Reactions carry the joints' names, and are linear in the loads."""
        one, two = self._loads(1), self._loads(2)
        found = self.subject.call("reactions", self.pose, *one)
        for joint in self.block.joints.values():
            wanted = "Slide" if joint.kind == "P" else "force"
            reaction = getattr(found, joint.name, None)
            if reaction is None or (joint.kind == "P") != isinstance(reaction, Slide):
                yield f"reactions returns no {wanted} named {joint.name}"
        for joint in self.block.driven:
            effort = self.block.effort_field(joint.name)
            if not hasattr(found, effort):
                yield f"reactions returns no {effort} for the driven joint {joint.name}"
        both = [
            Load(rig.planar(X * vectors(a.F) + Y * vectors(b.F)), X * a.M + Y * b.M)
            for a, b in zip(one, two, strict=True)
        ]
        a, b, c = (leaves(self.subject.call("reactions", self.pose, *x)) for x in (one, two, both))
        yield from self._linear("reactions", a, b, c, X, Y)

    def balances(self) -> Iterator[str]:
        """Links balance, wires' powers balance, the two routes to each drive agree."""
        for friction in (False, True):
            how = "with friction" if friction else "without friction"
            mechanism = rig.rig(self.block, self.size, friction)
            found = mechanism.verify(**rig.request(self.motions, self.size))
            if not found.samples:
                yield f"no sample has an answer {how}"
            for row in found.rows:
                self.measured[f"{row.name} {how}"] = row.value
                if not row.ok:
                    yield f"{row.name} {how} is off by {row.value:.1e} of its terms"

    # -- batches, NaN and impossible samples -----------------------------------------------

    def batches(self) -> Iterator[str]:
        """Any batch shape gives the same numbers, for samples and for designs."""
        designs = type(self.subject.p)(*(np.full((3, 1), x) for x in self.subject.p))
        for stage, arguments in self._calls():
            whole = leaves(self.subject.call(stage, *arguments()))
            for k in (0, SAMPLES // 2):
                one = arguments(slice(k, k + 1))
                alone = leaves(self.subject.call(stage, *one))
                scalar = leaves(self._scalar(stage, one))
                for name, x in whole.items():
                    here = at_sample(x, k, SAMPLES)
                    if not same_bits(here, at_sample(alone[name], 0, 1)):
                        yield f"{stage} {name} of a sample alone is not the same as in a batch"
                    what = f"scalar {stage} {name} against a batch"
                    yield from self.same(what, scalar[name], here, float(np.max(abs(x))) or 1.0)
            many = leaves(self.subject.call(stage, *arguments(), p=designs))
            for name, x in many.items():
                shape = np.broadcast_shapes(x.shape, (3, SAMPLES))
                if shape != (3, SAMPLES) or not same_bits(x, whole[name]):
                    yield f"{stage} {name} of equal designs (3, 1) is not that of one design"

    def _scalar(self, stage: str, arguments: list[Any]) -> Any:
        kernel = getattr(self.block.kernels, stage)
        return kernel(*map(as_number, arguments), self.subject.p)

    def not_a_number(self) -> Iterator[str]:
        """What depends on a NaN is NaN."""
        for stage, arguments in self._calls():
            given = arguments()
            whole = leaves(self.subject.call(stage, *given))
            names = list(inspect.signature(getattr(self.block.kernels, stage)).parameters)
            for k in range(STAGES[stage], len(given)):
                for bad, part in spoilt(given[k]):
                    found = self.subject.call(stage, *given[:k], bad, *given[k + 1 :])
                    where = f"{names[k]}.{part}" if part else names[k]
                    yield from self._poisoned(stage, where, whole, leaves(found))
            for name in self.subject.p._fields:
                p = self.subject.p._replace(**{name: np.nan})
                found = self.subject.call(stage, *given, p=p)
                yield from self._poisoned(stage, name, whole, leaves(found))

    def _poisoned(self, stage: str, what: str, whole: Leaves, found: Leaves) -> Iterator[str]:
        for name, x in found.items():
            if not np.all(np.isnan(x)) and not same_bits(x, whole[name]):
                yield f"{stage} {name} depends on {what}, but is not NaN with it"

    def impossible(self) -> Iterator[str]:
        """Impossible samples are NaN in both engines, and touch no neighbour."""
        mechanism = rig.rig(self.block, self.size, friction=False)
        settings: dict[str, Any] = {"want": ("block.*",), "friction": "none", "on_gap": "mark"}
        asked = rig.request(self._with_impossible(), self.size)
        scalar, batch = (
            mechanism.run(**asked, **settings, engine=engine) for engine in ("scalar", "numpy")
        )
        alone = mechanism.run(**rig.request(self.motions, self.size), **settings, engine="numpy")
        for name in batch:
            one, other = np.asarray(scalar[name]), np.asarray(batch[name])
            if one.shape and not np.array_equal(np.isnan(one), np.isnan(other)):
                yield f"the engines do not agree on where {name} exists"
            if one.shape and not same_bits(other[:SAMPLES], np.asarray(alone[name])):
                yield f"{name} changes when impossible samples stand beside it"

    def _with_impossible(self) -> Motions:
        """Good samples, bad ones, and all joints in one point and one direction."""
        bad = np.flatnonzero(~self._closed(self.every))[:10]
        worst = {
            name: MarkerMotion(0j * m.p, 0 * m.phi, m.v, m.om, m.a, m.al)
            if isinstance(m, MarkerMotion)
            else m
            for name, m in rig.only(self.motions, slice(0, 1)).items()
        }
        return joined([self.motions, rig.only(self.every, bad), worst])

    rules = {
        "rule 1 (inputs are declared)": inputs,
        "rule 2 (outputs depend on inputs and parameters only)": outputs,
        "rule 3 (positions close the joints)": positions,
        "rule 4 (velocities)": velocities,
        "rule 5 (accelerations)": accelerations,
        "rule 6 (reactions)": forces,
        "rule 7 (batches)": batches,
        "rule 8 (NaN in, NaN out)": not_a_number,
        "rule 9 (impossible samples)": impossible,
        "rule 10 (balances)": balances,
    }

    # -- kernel calls ------------------------------------------------------------------------

    def _calls(self) -> Iterator[tuple[str, Callable[..., list[Any]]]]:
        """Each kernel, and its arguments (but the parameters) at some samples."""
        for stage in STAGES:
            yield stage, lambda samples=slice(None), stage=stage: self._arguments(stage, samples)

    def _arguments(self, stage: str, samples: slice) -> list[Any]:
        motions = rig.only(self.motions, samples)
        if stage == "position":
            return self.subject.arguments(stage, motions)
        pose = self.subject.position(motions)
        if stage == "reactions":
            loads = self._loads(3)
            return [pose, *(Load(rig.planar(vectors(x.F)[samples]), x.M[samples]) for x in loads)]
        before = [pose]
        if stage == "acceleration":
            before.append(self.subject.velocity(motions, pose))
        return [*before, *self.subject.arguments(stage, motions)]

    def _loads(self, seed: int) -> list[Load]:
        chance = np.random.default_rng(seed)

        def numbers() -> Array:
            return chance.normal(size=SAMPLES)

        return [
            Load(rig.planar(numbers() + 1j * numbers()), self.size * numbers())
            for _ in self.block.link_names
        ]
