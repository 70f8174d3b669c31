"""Charts: any joint may be the coordinate of a motion.

The class of a mechanism depends on its driving link, and each choice of driving joints gives
another formation sequence: a chart of the configuration space. Where the coordinates of one stand
still though the mechanism moves, another one goes on. With the rates of all joints for k
independent motions that the pairs allow,

    T (joints, k),

joints whose rows of T span the largest volume move most: pivoted Gram-Schmidt picks them, those of
drivers that must stay first. A joint between moving links counts a fifth, because it makes general
groups. The state is handed over through the poses of links and their rates.

Source: Wehage & Haug, Generalized coordinate partitioning for dimension reduction in analysis of
constrained dynamic systems, J. Mech. Design 104, 1982.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from blockmech.blocks.general import GeneralGroup
from blockmech.blocks.modes import TwoModes
from blockmech.dynamics.request import Start
from blockmech.ground.values import free_name
from blockmech.model.graph import Graph
from blockmech.model.joints.closing import Closing, coordinate
from blockmech.model.joints.contents import FRAME, DriverGiven
from blockmech.model.joints.decompose import decompose
from blockmech.model.joints.layout import Layout, Pose, Poses
from blockmech.model.joints.linkage import Linkage
from blockmech.model.joints.references import coordinate_of
from blockmech.model.naming import Names
from blockmech.model.scene import Initial
from blockmech.model.structure import COORDINATE
from blockmech.result.motion import Floats, Motion

if TYPE_CHECKING:
    from blockmech.compiled import Compiled

T = TypeVar("T")
CHANGE = 1e-4  # of the largest singular value: below, the pairs' conditions lose rank
FLOATING = 0.2  # what a joint between moving links counts


@dataclass(frozen=True)
class Chart:
    """A formation sequence of a document: the joints of its drivers are the coordinates.

    Attributes
    ----------
    mechanism : compiled, with the names of the document
    joints : those that lead, in the order of the drivers
    home : the document of the user, whose drivers may be others
    names : where links and joints of the document are in the blocks of the user
    kept : charts of the document that there are already, by their blocks
    """

    mechanism: Compiled
    joints: tuple[str, ...]
    home: Linkage
    names: Names
    kept: dict[str, Chart]

    @cached_property
    def layout(self) -> Layout:
        """Links and pairs."""
        return Layout.of(self.home)

    @cached_property
    def weights(self) -> dict[str, float]:
        """Pairs that may lead, and what each counts."""
        return {
            name: 1.0 if FRAME in c.links else FLOATING
            for name, c in self.layout.pairs.items()
            if name in self.home.joints  # of a pin of three links it is not said which two
        }

    @cached_property
    def is_general(self) -> bool:
        """Whether a group has no closed form: its poses are dear, and known near its home."""
        return any(isinstance(x, GeneralGroup) for x in self.mechanism.structure.blocks.values())

    def in_outputs(self, link: str = "", joint: str = "") -> str:
        """What names of outputs of a link or joint begin with."""
        if self.mechanism.names is not None:
            return f"link.{link}" if link else f"joint.{joint}"
        return str(self.names.links[link].link if link else self.names.joints[joint].joint)

    def said(self, joints: Sequence[str]) -> tuple[str, ...]:
        """Joints in the words of outputs."""
        return tuple(self.in_outputs(joint=j).removeprefix("joint.") for j in joints)

    def poses(self, q: Floats) -> list[Poses]:
        """Poses of all links at coordinates (n, k); NaN where they do not close."""
        links, at = self.layout.links, dict(zip(self.mechanism.drivers, q.T, strict=True))
        heads = [self.in_outputs(link) for link in links]
        want = [f"{head}.{what}" for head in heads for what in ("p", "angle")]
        still = dict.fromkeys(at, 0.0)
        found = self.mechanism.run(at, rates=still, want=want, friction="none", on_gap="mark")
        columns = [
            map(Pose, *(found[x].tolist() for x in want[i : i + 2])) for i in range(0, len(want), 2)
        ]
        rows = zip(*columns, strict=True)
        return [dict(zip((FRAME, *links), (Pose(), *row), strict=True)) for row in rows]

    def _slopes(self, poses: Poses) -> tuple[Floats, Floats]:
        """What poses (3n,) change: conditions that pairs hold, and coordinates of pairs."""
        pairs, layout = self.layout.pairs, self.layout
        measured = dict.fromkeys(pairs, 0.0)
        rows = Closing(layout.links, tuple(pairs.values()), layout.size, measured).conditions(poses)
        return np.delete(rows[1], np.s_[2::3], axis=0), rows[1][2::3]

    def tangent(self, poses: Poses) -> Floats:
        """Rates (joints, k) of joints that may lead, for k motions of unit size of all links."""
        held, along = self._slopes(poses)
        motions = np.linalg.svd(held)[2][-len(self.joints) :]
        return np.asarray(along[[name in self.weights for name in self.layout.pairs]] @ motions.T)

    def conditioning(self, poses: Poses) -> float:
        """How many times roundings of the coordinates that lead are those of the poses."""
        held, along = self._slopes(poses)
        leading = along[[name in self.joints for name in self.layout.pairs]]
        return float(1.0 / np.linalg.svd(np.vstack([held, leading]), compute_uv=False)[-1])

    def rows(self, T: Floats, joints: Sequence[str]) -> Floats:
        """Those (k, k) of some joints."""
        names = list(self.weights)
        return T[[names.index(joint) for joint in joints]]

    def volume(self, T: Floats, joints: Sequence[str]) -> float:
        """What some joints span of all motions, as they count."""
        counts = math.prod(self.weights[joint] for joint in joints)
        return counts * abs(float(np.linalg.det(self.rows(T, joints))))

    def largest(self, T: Floats, fixed: Sequence[str], without: Collection[str]) -> list[str]:
        """The joints that span most, those that are fixed among them; ``without`` some."""
        names, joints = list(self.weights), list[str]()
        left = T * np.array([*self.weights.values()])[:, None]
        left[[name in without for name in names]] = 0.0
        for n in range(T.shape[1]):
            sizes = np.linalg.norm(left, axis=1)
            i = names.index(fixed[n]) if n < len(fixed) else int(sizes.argmax())
            joints.append(names[i])
            left -= np.outer(left @ left[i], left[i]) / (sizes[i] ** 2 or 1.0)
        return joints

    def rates(self, poses: Poses, joints: Sequence[str], qd: Floats) -> Floats:
        """Rates (k,) of some joints at rates (k,) of those that lead."""
        T, pairs = self.tangent(poses), self.layout.pairs
        own, others = (
            np.array([1.0 if pairs[j].kind == "R" else self.layout.size for j in some])
            for some in (self.joints, joints)
        )
        return others * (
            self.rows(T, joints) @ np.linalg.solve(self.rows(T, self.joints), qd / own)
        )

    def coordinates(self, poses: Poses, joints: Sequence[str]) -> list[float]:
        """Coordinates [rad or m] of some joints."""
        return [coordinate(poses, self.layout.pairs[joint]) for joint in joints]

    def stops_led_by(self, joints: Collection[str], stops: Mapping[str, T]) -> dict[str, T]:
        """End stops by the names that they have where some joints lead."""
        joint_of = {d: x.joint for d, x in self.home.drivers.items()}
        driver_of = {joint: d for d, joint in joint_of.items()}
        renamed = dict[str, T]()
        for name, between in stops.items():
            joint = joint_of.get(name) or coordinate_of(name) or name
            renamed[
                driver_of.get(joint, joint) if joint in joints else f"joint.{joint}.{COORDINATE}"
            ] = between
        return renamed

    def following(self, motion: Motion, start: Start) -> Chart | None:
        """The same chart, its dyads following a motion that ended at a change point.

        There the conditions of the pairs lose rank. None where they do not.
        """
        (poses,) = self.poses(np.reshape(motion.q_end, (1, -1)))
        if all(math.isfinite(pose.theta) for pose in poses.values()):
            held = np.linalg.svd(self._slopes(poses)[0], compute_uv=False)
            if held[-1] > CHANGE * held[0]:
                return None
        document = self.mechanism.document
        if isinstance(document, Graph):
            data, names = document.flat().to_data(), self.mechanism.names
        else:
            data, names, *_ = decompose(self.home)
        driver, blocks = self.mechanism.drivers[0], self.mechanism.structure.blocks
        for name, block in blocks.items():
            branch = getattr(block, "branch", None)
            if isinstance(block, TwoModes) and branch in (-1, 1):
                home = {"drivers": {driver: float(start.q)}, "branch": branch}
                data["blocks"][name] |= {"branch": "follow", "home": home}
        made = type(self.mechanism).of(Graph.from_data(data), names, document)
        return replace(self, mechanism=made) if made.structure.followed else None

    def led_by(self, starts: Mapping[str, tuple[float, float]], poses: Poses) -> Chart:
        """The chart that some joints lead: joint -> (coordinate, rate), in these poses.

        Joints that a user drives keep their drivers. Raises `GraphError` where the poses tell no
        assembly mode.
        """
        linkage = self.home
        taken = {*linkage.drivers, *linkage.links, *linkage.loads, *linkage.signals}
        names = {joint: free_name(joint, taken) for joint in starts} | linkage.driven
        other = linkage.snapshot()
        other.links = {
            name: link if name == FRAME else link.model_copy(update={"pose": _pose(poses[name])})
            for name, link in linkage.links.items()
        }
        other.drivers = {
            names[joint]: linkage.drivers.get(names[joint]) or DriverGiven(joint=joint)
            for joint in starts
        }
        other.initial = {names[j]: Initial(q=q, rate=rate) for j, (q, rate) in starts.items()}
        other.stops = self.stops_led_by(starts, linkage.stops)
        other.motion = {d: role for d, role in linkage.motion.items() if d in other.drivers}
        data, named, _, document = decompose(other)
        key = repr(data["blocks"])  # with the home of general groups, so those are new
        if key not in self.kept:
            mechanism = type(self.mechanism).of(Graph.from_data(data), named, document)
            joints = tuple(other.drivers[d].joint for d in mechanism.drivers)
            made = replace(self, mechanism=mechanism, joints=joints)
            if made.is_general:
                return made
            self.kept[key] = made
        return self.kept[key]


def _pose(pose: Pose) -> tuple[float, float, float]:
    return pose.o.real, pose.o.imag, pose.theta
