"""A mechanism at a pose, as files of other programs have it: places of pairs, centres of mass."""

from __future__ import annotations

import cmath
from collections.abc import Callable, Sequence

import numpy as np

from blockmech.compiled import Compiled
from blockmech.engines.interpreters import ScalarEngine
from blockmech.exchange.formats import Order
from blockmech.model.structure import JointRef, LinkRef
from blockmech.passes.forward import guide_direction
from blockmech.passes.homotopy import schedule
from blockmech.passes.pairs import slider_point
from blockmech.plan.plan import Friction, Schedule
from blockmech.plan.values import Value
from blockmech.result.samples import Samples


class Standing:
    """The pose of a mechanism of blocks that an order asks for, by default where it starts.

    Attributes
    ----------
    joints : all pairs
    place, angle : of outputs that are places [m] and angles [rad] of links, by name
    point, direction : where a guide is [m], and its unit direction
    """

    def __init__(self, order: Order) -> None:
        mechanism = order.mechanism._of_blocks
        self.structure = s = mechanism.structure
        names = order.mechanism.names
        self._called = dict(names.of_links if names else {}) | {s.frame_link: "frame"}
        self._joint_names = order.mechanism._joint_names
        at = dict(order.at)
        if not at:
            at = {"at": {d: mechanism.scene.start_of(d)[0] for d in mechanism.drivers}}
        self.joints = [JointRef(b, j) for b, block in s.blocks.items() for j in block.joints]
        guides = [ref for ref in self.joints if s.joint(ref).kind == "P"]
        result = mechanism.run(**at, want=["*.p", "*.angle"], static=True)
        self.place = {n: complex(result[n][0]) for n in result if n.endswith(".p")}
        self.angle = {n: float(result[n][0]) for n in result if n.endswith(".angle")}
        self.point, self.direction = (
            dict(zip(guides, _at_pose(mechanism, result.samples, rule, guides), strict=True))
            for rule in (slider_point, guide_direction)
        )

    def pin(self, ref: JointRef) -> complex:
        """Where a pair is [m]: its own place, or that of the marker that it is wired to."""
        if ref in self.point:
            return self.point[ref]
        position = self.place.get(f"{ref}.p")
        return self.place[f"{self.structure.feeds[ref]}.p"] if position is None else position

    def called(self, link: LinkRef) -> str:
        """The link's name in the document; of blocks that of the block and the link."""
        return self._called.get(link, str(link))

    def joint_name(self, ref: JointRef) -> str:
        """The pair's name in the document; of blocks that of the block and the joint."""
        return self._joint_names.get(str(ref), str(ref)).removeprefix("joint.")

    def centre(self, link: LinkRef) -> complex:
        """The centre of mass [m] of a link."""
        properties = self.structure.properties(link)
        turned = cmath.exp(1j * self.angle[f"{link}.angle"])
        return self.place[f"{link}.p"] + complex(properties.cm.z) * turned


def _at_pose(
    mechanism: Compiled,
    samples: Samples,
    rule: Callable[[Schedule, JointRef], Value],
    refs: Sequence[JointRef],
) -> list[complex]:
    """What a rule answers for some pairs at the pose of some samples."""
    s = schedule(mechanism.structure, mechanism.scene, Friction("none"), static=True)
    program = s.program([s.ask(rule, ref) for ref in refs])
    inputs = [float(np.ravel(samples.inputs[name])[0]) for name in program.inputs]
    return [complex(value) for value in ScalarEngine(program).one(inputs)]
