"""A block on trial: random motions in which it closes, and its kernels called with them.

The numbered rules ask it: `calling_rules`, `kinematic_rules` and `force_rules`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blockmech.blocks.contract import AssurGroup, Moving
from blockmech.testing import rig
from blockmech.testing.batches import Leaves, count, finite, leaves, vectors
from blockmech.testing.closure import Closure
from blockmech.testing.rig import Motions, Subject
from blockmech.testing.rules import Checks, ConformanceError
from blockmech.typing import Load

Array = NDArray[Any]

SAMPLES = 24
STAGES = {"position": 0, "velocity": 1, "acceleration": 2, "reactions": 1}
"""Each kernel, and how many of its arguments come from earlier kernels."""
X, Y = 0.7, -1.3  # factors of a linear combination


class BlockTrial(Checks):
    """A block with links, motions of its joints and what its kernels make of them.

    Attributes
    ----------
    subject : the block's kernels, to be called with motions
    size : [m] of its motions: its largest length, scaled until it closes
    every, motions : random motions, and slow ones of them in which the block closes well
    other : further motions, of which only rates are read
    pose, closure : of ``motions``
    """

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
            speed = self.speeds(self.subject.velocity(motions))
        except Exception:  # the rule on velocities will say why
            speed = np.zeros(count(motions))
        return rig.only(motions, np.flatnonzero(speed <= np.quantile(speed, 0.25))[:SAMPLES])

    def closed(self, motions: Motions) -> NDArray[np.bool_]:
        """Whether the block closes (n,)."""
        pose = leaves(self.subject.position(motions))
        places = {n: x for n, x in pose.items() if n.split(".")[0] in self.block.link_names}
        return np.broadcast_to(finite(places), (count(motions),))

    def speed(self, vel: Any) -> float:
        """Largest speed [m/s] of links and slides."""
        return float(np.max(self.speeds(vel)))

    def speeds(self, vel: Any) -> Array:
        """Largest speed (n,) [m/s], rates counted at the block's size."""
        found = [abs(x) * (self.size if n.endswith("om") else 1.0) for n, x in leaves(vel).items()]
        speeds: Array = np.max(np.broadcast_arrays(*found), axis=0)
        return speeds

    def linear(
        self, stage: str, one: Leaves, two: Leaves, both: Leaves, x: float, y: float
    ) -> Iterator[str]:
        """What a kernel makes of x one + y two, against x times and y times its answers."""
        for name, a in one.items():
            scale = float(np.max(abs(a)) + np.max(abs(two[name]))) or 1.0
            yield from self.same(
                f"linearity of {stage} {name}", both[name], x * a + y * two[name], scale
            )

    def calls(self) -> Iterator[tuple[str, Callable[..., list[Any]]]]:
        """Each kernel, and its arguments (but the parameters) at some samples."""
        for stage in STAGES:
            yield stage, lambda samples=slice(None), stage=stage: self.arguments(stage, samples)

    def arguments(self, stage: str, samples: slice) -> list[Any]:
        """What a kernel gets at some samples, but the parameters."""
        motions = rig.only(self.motions, samples)
        if stage == "position":
            return self.subject.arguments(stage, motions)
        pose = self.subject.position(motions)
        if stage == "reactions":
            loads = self.loads(3)
            return [pose, *(Load(rig.planar(vectors(x.F)[samples]), x.M[samples]) for x in loads)]
        before = [pose]
        if stage == "acceleration":
            before.append(self.subject.velocity(motions, pose))
        return [*before, *self.subject.arguments(stage, motions)]

    def loads(self, seed: int) -> list[Load]:
        """Random forces and moments on each link, as many as there are samples."""
        chance = np.random.default_rng(seed)

        def numbers() -> Array:
            return chance.normal(size=SAMPLES)

        return [
            Load(rig.planar(numbers() + 1j * numbers()), self.size * numbers())
            for _ in self.block.link_names
        ]
