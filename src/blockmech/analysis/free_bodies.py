"""Free bodies: everything that acts on each link, and how the link moves, from outputs alone.

Reactions, friction, drives, elements, weight and D'Alembert terms are taken from the labelled
outputs of a run and put on the link as forces at their places and couples. The kernels that
made the numbers are not asked.

Source: [R10] Ruiz, Durango & Calle 2010, Eqs. 2-7.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from blockmech.model.structure import JointRef, LinkRef, Structure

if TYPE_CHECKING:
    from blockmech.result import Result

Array = NDArray[Any]


class FreeBodies:
    """The links of a run, each with what acts on it.

    run : a run of blocks with all outputs; arrays are (n,) over its samples
    """

    def __init__(self, run: Result) -> None:
        self.run = run
        self.structure: Structure = run.mechanism.structure

    def link(self, link: LinkRef) -> tuple[Array, Array, Array, Array]:
        """Place [m] and velocity [m/s] of a link's origin, its rate [rad/s] and unit direction."""
        if link == self.structure.frame_link:
            zero = np.zeros(self.run.n)
            return zero + 0j, zero + 0j, zero, zero + 1
        r = self.run
        e = np.exp(1j * r[f"{link}.angle"])
        return r[f"{link}.p"], r[f"{link}.v"], r[f"{link}.omega"], e

    def terms(self, link: LinkRef) -> Iterator[tuple[Array, Array, Array]]:
        """Everything that acts on a link: force [N], where it acts [m], couple [N m]."""
        yield from self.inertia_and_weight(link)
        yield from self.elements(link)
        for joint in self._joints_on(link):
            yield self._pair(joint, link)

    def inertia_and_weight(self, link: LinkRef) -> Iterator[tuple[Array, Array, Array]]:
        """Weight and, unless the run is static, D'Alembert's force and couple."""
        properties = self.structure.properties(link)
        if link == self.structure.frame_link or not properties.massive:
            return
        r = self.run
        o, _, om, e = self.link(link)
        arm = e * properties.cm.z
        gravity = self.run.mechanism.scene.gravity.z
        force = np.full(r.n, properties.mass * gravity)
        couple = np.zeros(r.n)
        if not r.settings["static"]:
            al = r[f"{link}.alpha"]
            force = force - properties.mass * (r[f"{link}.a"] + (1j * al - om**2) * arm)
            couple = -properties.inertia * al
        yield force, o + arm, couple

    def elements(self, link: LinkRef) -> Iterator[tuple[Array, Array, Array]]:
        """Forces and couples of springs, dampers and other loads."""
        r, zero = self.run, np.zeros(self.run.n)
        for terminal in self.structure.loaded[link]:
            marker = self.structure.holds[terminal]
            if f"{terminal}.force" in r:
                yield r[f"{terminal}.force"], r[f"{marker}.p"], zero
            else:
                yield zero + 0j, r[f"{marker}.p"], r[f"{terminal}.couple"]

    def _joints_on(self, link: LinkRef) -> list[JointRef]:
        own = []
        if link != self.structure.frame_link:
            joints = self.structure.blocks[link.block].joints.values()
            own = [JointRef(link.block, j.name) for j in joints if link.link in (j.link, *j.links)]
        return own + list(self.structure.carried[link])

    def _pair(self, ref: JointRef, link: LinkRef) -> tuple[Array, Array, Array]:
        """What a pair does to one of its links, from the reported reaction and friction."""
        r, joint = self.run, self.structure.joint(ref)
        t = np.array(r[f"{ref}.friction"])
        if joint.driven:
            driver = self.structure.blocks[ref.block].driver_name(*ref)
            t = t + r[f"{driver}.drive"]
        sign = 1.0 if self.structure.later_link(ref) == link else -1.0
        if joint.kind == "R":
            return sign * r[f"{ref}.reaction"], self._pin(ref), sign * t
        u = self._guide(ref)
        return sign * (r[f"{ref}.reaction"] + t * u), self._slider(ref, u), sign * r[f"{ref}.C"]

    def _pin(self, ref: JointRef) -> Array:
        joint = self.structure.joint(ref)
        if joint.outer:
            found: Array = self.run[f"{self.structure.feeds[ref]}.p"]
            return found
        inner: Array = self.run[f"{ref.block}.{ref.name}.p"]
        return inner

    def _guide(self, ref: JointRef) -> Array:
        joint = self.structure.joint(ref)
        if not joint.outer:
            earlier = LinkRef(ref.block, joint.links[0])
            own = self.structure.blocks[ref.block].guide_line(ref.name, earlier.link)[1]
            return self.link(earlier)[3] * own
        marker = self.structure.feeds[ref]
        declared = self.structure.marker(marker)
        direction = getattr(declared, "direction", 1 + 0j)
        return self.link(marker.on)[3] * direction

    def _slider(self, ref: JointRef, u: Array) -> Array:
        """The slider's point of a prismatic pair."""
        joint, block = self.structure.joint(ref), self.structure.blocks[ref.block]
        owner = self.structure.later_link(ref)
        if block.slider_owner(ref.name) == "earlier":
            if joint.outer:
                found: Array = self.run[f"{self.structure.feeds[ref]}.p"]
                return found
            owner = self.structure.earlier_link(ref)
        o, _, _, e = self.link(owner)
        return o + e * block.slider_place(ref.name, owner.link)
